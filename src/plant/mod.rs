//! What is true. No I/O, no clock: events and time come in as arguments, effects go out as values.
//!
//! ```text
//! Event ───┐                       ┌──> Effects { bus requests, records }
//! Command ─┼──> Plant (reducer) ───┤
//! tick  ───┘    image alarms       └──> Snapshot
//!               values alarms commands
//! ```

pub(crate) mod number;
pub mod exact;
pub mod id;
pub(crate) mod compare;
pub mod identity;
pub(crate) mod expr;
pub mod procedure_def;
pub mod fault;
pub(crate) mod keyword;
pub mod signal;
pub mod sample;
pub mod station_fault;
pub(crate) mod condition;
pub(crate) mod interlock_def;
pub(crate) mod alarm_def;
pub mod line;
pub mod process_load;
pub(crate) mod step_response;
pub(crate) mod store_policy;
pub mod device_time;
pub(crate) mod time;
pub mod output;
pub(crate) mod poll_class;
pub(crate) mod line_check;
pub mod history_def;
pub mod report;
pub(crate) mod report_def;
pub(crate) mod half;
pub(crate) mod decimals;
pub(crate) mod program;
pub(crate) mod data_type;
pub(crate) mod bad_span;
pub mod request_stats;
pub(crate) mod line_minute;
pub(crate) mod totalizer;
pub mod north_def;
pub mod visible;
pub(crate) mod text_value;
pub mod tag_value;
pub mod line_trouble;
pub(crate) mod mimic_def;
pub(crate) mod energy;
pub mod run_def;
pub mod bound;
pub mod role;
pub(crate) mod delay;
pub(crate) mod calculation_def;
pub(crate) mod confidence;
pub(crate) mod simulate;
pub mod tag;
pub mod raw_number;
pub mod counter;
pub mod address;
pub mod sweep;
pub(crate) mod scale;
pub mod live;
pub mod batch;
pub mod def;
pub(crate) mod interlock;
pub(crate) mod tuning;
pub mod parameter_set;
pub mod station_alarms;
pub mod port_signals;
pub mod diagnostic_request;
pub(crate) mod admission;
pub mod control_run;
pub mod recorded_action;
pub mod record;
pub(crate) mod place;
pub(crate) mod redefinition;
pub mod request_refusal;
pub mod alarm;
pub mod command;
pub mod procedure;
pub mod mqtt_request;
pub mod traffic;
pub mod diagnostics;
pub mod line_finding;
pub mod north_status;
pub mod restore;
pub(crate) mod heard;
pub(crate) mod calculation;
pub(crate) mod process_image;
pub(crate) mod commands;
pub(crate) mod counter_watch;
pub mod line_state;
pub(crate) mod ne107;
pub mod line_report;
pub(crate) mod line_minute_tracker;
pub mod snapshot;
pub mod losses;
pub mod event;
pub(crate) mod reducer;
pub mod past;
pub(crate) mod clock_step;
pub mod entry;
pub(crate) mod classification;

#[cfg(test)]
pub mod fixture;

pub use def::PlantDef;
pub use reducer::{Effects, Plant, Redefined, SetWork};
pub use snapshot::Snapshot;
