//! What tests, benches and fuzz targets use of each module.

#![expect(missing_docs, reason = "each module here is a part of the one of its name, which has its documentation")]

pub mod plant {
    pub use crate::plant::{
        Plant, PlantDef, Snapshot,
        address::AddressBase,
        alarm::{ActiveAlarm, AlarmCommand, AlarmState},
        command::{Command, CommandId, CommandKind, CommandStatus, NotConfirmed, Outcome, Refusal},
        def::{
            AlarmId, DeviceDef, DeviceId, Framing, HistoryDef, Limits, LineDef, LineId, ParquetVersion, Pen, Priority,
            ProcedureId, Protocol, Reauthentication, Serial, TagId, Transport, TrendGroup,
        },
        diagnostics::{Diagnostic, Scan},
        event::Event,
        exact::Exact,
        fault::{ExceptionCode, Fault},
        line::Rs485,
        line_report::{LineReport, PollReport},
        line_state::{DeviceState, LineState},
        live::{AddressSpan, LiveRead},
        port_signals::{OutputSignal, SignalTest},
        procedure::{ProcedureRun, ProcedureState},
        record::{ActionRecord, AlarmEvent, AlarmRecord, ChainHash, Record},
        recorded_action::RecordedAction,
        request_refusal::RequestRefusal,
        request_stats::RequestStats,
        restore::RestoreRequest,
        role::Role,
        sample::{Cause, Quality, Sample},
        station_fault::StationFault,
        sweep::Sweep,
        tag::{Access, ByteOrder, DataType, Decimals, Point, Poll, PollClass, Table, TagDef},
        traffic::{Exchange, Frame, FrameFault, FrameResult},
        visible::is_control_or_bidi,
    };
    pub mod parameter_set {
        pub use crate::plant::parameter_set::{ParameterSet, compare};
    }
}

pub mod profile {
    pub use crate::profile::{
        Checked, Errors, Kind, OwnProfiles, PlantFile, Search, check, list, load, load_with_file, read_set, render,
        text_of, text_of_set,
    };
}

pub mod bus {
    pub use crate::bus::{
        filter::Filter,
        io::{clock::Clock, live_reads::LiveReads, requests::Requests, transport::Connector},
        request_lint::check_request,
    };
    pub mod ascii {
        pub use crate::bus::ascii::{decode, encode, messages, open, open_frame};
    }
    pub mod capture {
        pub use crate::bus::capture::pcapng;
    }
    pub mod dissect {
        pub use crate::bus::dissect::{Direction, Dissection, dissect};
    }
    pub mod frame {
        pub use crate::bus::frame::{
            MESSAGE_MAX, Mbap, check_answer, hex, mbap, unit_of, unwrap, with_crc, with_mbap, without_crc, wrap,
            wrapped_length,
        };
    }
    pub mod framing {
        pub use crate::bus::framing::{FrameMatch, find_answer, find_reply, left_over};
    }
    pub mod hex_input {
        pub use crate::bus::hex_input::{parse, parse_paste};
    }
    pub mod listen {
        pub use crate::bus::listen::{Follower, Heard, Listener, Losses, events};
    }
    pub mod meaning {
        pub use crate::bus::meaning::{of_answer, of_request};
    }
    pub mod paste {
        pub use crate::bus::dissect::paste::{Asked, read};
    }
    pub mod plan {
        pub use crate::bus::plan::{Block, UnreadableRanges, Wire, blocks, single};
    }
    pub mod source_frame {
        pub use crate::bus::source_frame::find;
    }
    pub mod task {
        pub use crate::bus::io::task::run;
    }
    pub mod worker {
        pub use crate::bus::io::worker::simulate;
    }
}

pub mod register_map {
    pub use crate::register_map::{
        export::{Target, export},
        list::{List, ListContext},
        profile::written,
        read,
    };
}

pub mod sim {
    pub use crate::sim::{
        faults::{InjectedFault, TargetKind},
        io::{
            Endpoint, Mode, Pty, Service, Serving, SimulatorHandle, TcpFraming, Wire, in_memory, open_pty, serve,
            serve_line, serve_stream,
        },
        rig::Rig,
        simulator::Simulator,
        wire::Receiver,
    };
    pub mod pdu {
        pub use crate::sim::pdu::{Registers, serve};
    }
}

pub mod report {
    pub use crate::report::{FORMATS, Period, Style, render};
    pub mod period_parser {
        pub use crate::report::period_parser::{named, of_calendar, past_instant, period};
    }
}

pub mod history {
    pub use crate::history::{
        Answer, ArchiveFile, HistoryError, Query,
        io::{
            HistoryJob, JobRequest, QueryRequest,
            archive::{LeftOut, sync_and_hash},
            store::Store,
        },
    };
    pub mod alarm_file {
        pub use crate::history::io::alarm_file::{AlarmFile, beside};
    }
    pub mod alarm_state {
        pub use crate::history::alarm_state::{HEADER, LatestEvents, is_cut, line, parse};
    }
    pub mod import {
        pub use crate::history::{import::Rows, io::import::parse};
    }
    pub mod probe {
        pub use crate::history::io::probe::{child, requested};
    }
    pub mod sql {
        pub use crate::history::io::sql::copy_to;
    }
    pub mod thread {
        pub use crate::history::io::thread::{Handle, offer, start, start_with};
    }
    pub mod tiers {
        pub use crate::history::tiers::{HOUR, Tier, in_milliseconds};
    }
}

pub mod access {
    pub use crate::access::{
        Completion, Credentials, Durability, LoggedInUser, Peer, Secret, SessionRequest, SessionStatus, Users,
        io::{own_user, users_beside},
        user::{User, UserChange},
    };
    pub mod audit_log {
        pub use crate::access::{
            audit_log::{Check, Entry, START, Summary, fit, head, head_text, line},
            io::audit_log::{AuditLog, beside, verify},
        };
    }
    pub mod password {
        pub use crate::access::password::{SALT_BYTES, hash};
    }
    pub mod right {
        pub use crate::access::right::{needs, needs_for_query, needs_for_request};
    }
    pub mod sealing {
        pub use crate::access::{
            io::sealing::{make, verify},
            sealing::{Key, SealCheck, VerificationKey},
        };
    }
    pub mod users {
        pub use crate::access::io::users::write;
    }
}

pub mod north {
    pub mod request {
        pub use crate::north::request::{Received, check, id_of, read, reply_to};
    }
}

pub mod station {
    pub use crate::station::{
        LifecycleRequest, Request, Session, SessionAcceptor,
        io::{Options, Station, start, start_guarded, start_transient},
    };
}

pub mod attach {
    pub use crate::attach::{
        callers::TERMINALS_MAX,
        io::{
            connect::{AttachError, connect},
            find::SocketFolders,
            serve::{ListenError, listen},
        },
        redaction::redact,
    };
    pub mod check {
        pub use crate::attach::check::{command, query};
    }
    pub mod protocol {
        pub use crate::attach::protocol::{
            ClientMessage, HANDSHAKE_BYTES_MAX, Handshake, HandshakeReply, LENGTH_BYTES, REQUEST_BYTES_MAX,
            SERVER_MESSAGE_BYTES_MAX, ServerMessage, TerminalOrigin, client_handshake, decode, encode, handshake_reply,
            length,
        };
    }
}

pub mod ui {
    pub use crate::ui::{Model, Msg, preview, theme::Theme, update, view};
}
