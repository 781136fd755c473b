//! The words of the format: every table of a plant file and of a device profile, and every key in it.

use std::time::Duration;

use jiff::civil::Time;

use super::{
    address::{Location, Modicon},
    reader::{Choice, Numbered, Raw, table, words},
    simulate::Choices,
};
use crate::plant::{
    def::{AlarmClass, Parity, Priority, Reauthentication, Role, Rs485},
    ne107::Signal,
    tag::{Access, ByteOrder, Confidence, DataType, PollClass, Table},
};

table!(
    /// A plant file.
    PlantFile, "the plant file" {
        need "title" title: String,
        need "time_zone" time_zone: String,
        opt "simulation" simulation: String,
        list "line" lines: Raw,
        list "device" devices: DeviceTable,
        opt "access" access: AccessTable,
        list "alarm" alarms: AlarmTable,
        opt "alarms" alarm_rules: AlarmRulesTable,
        list "interlock" interlocks: InterlockTable,
        list "actuator" actuators: ActuatorTable,
        list "sequence" sequences: SequenceTable,
        opt "mimic" mimic: MimicTable,
        list "trend" trends: TrendTable,
        list "shift" shifts: ShiftTable,
        opt "report" report: ReportTable,
        opt "history" history: HistoryTable,
    }
);

table!(
    /// A `[[line]]` on a serial port.
    SerialTable, "a line on a serial port" {
        need "name" name: String,
        need "mode" mode: String,
        need "port" port: String,
        need "baud" baud: u32,
        opt "data_bits" data_bits: u8,
        need "parity" parity: Parity,
        opt "stop_bits" stop_bits: u8,
        opt "rs485" rs485: Rs485,
        opt "timeout_ms" timeout_ms: u16,
        opt "request_gap_ms" request_gap_ms: u16,
        opt "frame_timeout_ms" frame_timeout_ms: u16,
        opt "turnaround_ms" turnaround_ms: u16,
    }
);

table!(
    /// A `[[line]]` over TCP.
    TcpTable, "a line over TCP" {
        need "name" name: String,
        need "mode" mode: String,
        need "host" host: String,
        opt "tcp_port" tcp_port: u16,
        opt "timeout_ms" timeout_ms: u16,
        opt "request_gap_ms" request_gap_ms: u16,
        opt "frame_timeout_ms" frame_timeout_ms: u16,
    }
);

table!(
    /// A `[[device]]` of a plant file.
    DeviceTable, "a device" {
        need "name" name: String,
        opt "title" title: String,
        need "profile" profile: String,
        need "line" line: String,
        need "unit" unit: u8,
        /// Period of tags with `poll = "fast"`.
        opt "fast" fast: Duration,
        /// Period of tags with `poll = "slow"`.
        opt "slow" slow: Duration,
        opt "limits" limits: Raw,
        /// More tags, or other keys for the tags of the profile.
        list "tag" tags: Raw,
    }
);

table!(
    /// A device profile.
    ProfileFile, "the device profile" {
        need "vendor" vendor: String,
        need "model" model: String,
        opt "revision" revision: String,
        /// How well the map is known: `verified`, `manual` or `partial`.
        need "status" status: Status,
        need "source" source: String,
        opt "notes" notes: String,
        /// Always 0; written down so that nobody has to ask.
        opt "address_base" address_base: u8,
        opt "scheme" scheme: Scheme,
        /// The function codes that the device knows.
        list "functions" functions: u8,
        opt "limits" limits: Raw,
        /// Keys that every tag has unless it says otherwise.
        opt "default" default: Raw,
        list "tag" tags: Raw,
        list "action" actions: ActionTable,
        opt "faceplate" faceplate: FaceplateTable,
        opt "program" program: ProgramTable,
    }
);

table!(
    /// What one request may hold.
    LimitsTable, "limits" {
        opt "read_registers_max" read_registers_max: u16,
        opt "read_bits_max" read_bits_max: u16,
        opt "write_registers_max" write_registers_max: u16,
        opt "gap_registers_max" gap_registers_max: u16,
        opt "alignment" alignment: u16,
        opt "in_flight_max" in_flight_max: u16,
        opt "request_gap_ms" request_gap_ms: u16,
        opt "write_gap_ms" write_gap_ms: u16,
    }
);

table!(
    /// A `[[tag]]` of a profile, or a `[[device.tag]]` of a plant file.
    TagTable, "a tag" {
        need "name" name: String,
        opt "label" label: String,
        opt "meaning" meaning: String,
        opt "table" table: Table,
        need "address" address: Location,
        opt "modicon" modicon: Modicon,
        opt "type" kind: TypeName,
        opt "order" order: ByteOrder,
        opt "field" field: Choice,
        opt "scale" scale: f64,
        opt "offset" offset: f64,
        opt "decimals" decimals: u8,
        opt "decimals_from" decimals_from: String,
        opt "unit" unit: String,
        opt "unit_from" unit_from: String,
        opt "min" min: f64,
        opt "max" max: f64,
        opt "min_from" min_from: String,
        opt "max_from" max_from: String,
        opt "access" access: Access,
        opt "verify" verify: bool,
        opt "confirm" confirm: String,
        /// What must be given again to write it.
        opt "reauthenticate" reauthenticate: Reauthentication,
        opt "enum" labels: Numbered,
        opt "bits" bits: Numbered,
        list "bad_if" bad_if: i64,
        opt "quality_from" quality_from: String,
        opt "quality_mask" quality_mask: u64,
        opt "write_fc" write_fc: u8,
        opt "write_unlock" write_unlock: UnlockTable,
        opt "group" group: String,
        opt "poll" poll: PollWord,
        opt "poll_class" poll_class: PollClass,
        opt "deadband" deadband: f64,
        opt "store" store: bool,
        /// Counts up, or not: by its unit if this is not said.
        opt "counter" counter: bool,
        opt "confidence" confidence: Confidence,
        opt "source" source: String,
        opt "simulate" simulate: SimulateTable,
        /// What the maker delivers it with.
        opt "default" default: Choice,
        /// Part of parameter sets, or not.
        opt "set" in_sets: bool,
    }
);

table!(
    /// How a simulated device fills a tag.
    SimulateTable, "simulate" {
        opt "start" start: Choice,
        list "case" cases: CaseTable,
        opt "range" range: [f64; 2],
        opt "noise" noise: f64,
        opt "pulse" pulse: Duration,
        opt "oscillate" oscillate: [f64; 2],
        opt "period" period: Duration,
        opt "follow" follow: String,
        list "sum" sum: String,
        list "mean" mean: String,
        list "product" product: String,
        list "difference" difference: String,
        list "quotient" quotient: String,
        list "reactive" reactive: String,
        opt "angle" angle: String,
        opt "integrate" integrate: String,
        opt "time_base" time_base: Duration,
        opt "rate" rate: f64,
        opt "lag" lag: Duration,
        opt "gain" gain: f64,
        opt "offset" offset: f64,
        opt "when" when: CheckTable,
        opt "idle" idle: f64,
    }
);

table!(
    /// A condition on another tag; without `is`, `above` and `below`: is it not 0?
    CheckTable, "when" {
        need "tag" tag: String,
        opt "field" field: Choice,
        opt "is" is: Choices,
        opt "above" above: f64,
        opt "below" below: f64,
        list "and" and: CheckTable,
    }
);

table!(
    /// A value for when something is so.
    CaseTable, "a case" {
        need "when" when: CheckTable,
        need "value" value: Choice,
    }
);

table!(
    /// What must be written before a tag takes a write.
    UnlockTable, "write_unlock" {
        need "tag" tag: String,
        need "value" value: Choice,
    }
);

table!(
    /// An `[[action]]` of a profile.
    ActionTable, "an action" {
        need "name" name: String,
        need "tag" tag: String,
        need "value" value: Choice,
        opt "settle_ms" settle_ms: u32,
        opt "stop" stop: bool,
        need "confirm" confirm: String,
        opt "saves" saves: bool,
    }
);

table!(
    /// Which tags a controller is operated by.
    FaceplateTable, "the faceplate" {
        need "pv" pv: String,
        need "sv" sv: String,
        /// The set value in use, where a program or a ramp may move it.
        opt "sv_used" sv_used: String,
        opt "mv" mv: String,
        opt "run" run: String,
        opt "mode" mode: String,
        opt "tune" tune: String,
        list "tunes" tunes: String,
    }
);

table!(
    /// The ramp/soak program of a controller.
    ProgramTable, "the program" {
        need "position" position: String,
        need "command" command: String,
        need "run" run: Choice,
        opt "halt" halt: Choice,
        need "off" off: Choice,
        opt "pattern" pattern: String,
        /// First and last step of each pattern, from 1, in the order of the pattern's values.
        list "patterns" patterns: [u16; 2],
        opt "mode" mode: String,
        list "steps" steps: StepTable,
    }
);

table!(
    /// A step of a program.
    StepTable, "a step of the program" {
        need "sv" sv: String,
        need "ramp" ramp: String,
        need "soak" soak: String,
    }
);

table!(
    /// An `[[alarm]]`.
    AlarmTable, "an alarm" {
        opt "tag" tag: String,
        opt "device" device: String,
        opt "high_high" high_high: f64,
        opt "high" high: f64,
        opt "low" low: f64,
        opt "low_low" low_low: f64,
        opt "deviation" deviation: f64,
        opt "from" from: String,
        opt "is" is: Choice,
        opt "bit" bit: u8,
        /// Tag's unit per minute, measured `over` a time; below 0 for a fall.
        opt "rate" rate: f64,
        opt "over" over: Duration,
        opt "no_change" no_change: Duration,
        opt "no_update" no_update: Duration,
        /// So many changes `within` a time.
        opt "changes" changes: u32,
        opt "within" within: Duration,
        opt "line" line: String,
        /// With `line`: it has too much to do, instead of not connected.
        opt "overloaded" overloaded: bool,
        /// `F`, `C`, `S` or `M`.
        opt "ne107" ne107: Signal,
        opt "enabled_when" enabled_when: String,
        opt "class" class: AlarmClass,
        opt "area" area: String,
        opt "latch" latch: bool,
        opt "ack_comment" ack_comment: Need,
        opt "re_alarm" re_alarm: Duration,
        opt "deadband" deadband: f64,
        opt "on_delay" on_delay: Duration,
        opt "off_delay" off_delay: Duration,
        need "priority" priority: Priority,
        need "message" message: String,
        opt "cause" cause: String,
        opt "effect" effect: String,
        opt "action" action: String,
        opt "response_time" response_time: Duration,
    }
);

table!(
    /// What holds for all alarms, `[alarms]`.
    AlarmRulesTable, "the rules for alarms" {
        opt "shelve_max" shelve_max: Duration,
        opt "first_out_window" first_out_window: Duration,
    }
);

table!(
    /// An `[[interlock]]`.
    InterlockTable, "an interlock" {
        need "tag" tag: String,
        need "value" value: Choice,
        need "of" of: String,
        opt "below" below: f64,
        opt "above" above: f64,
        opt "is" is: Choice,
        opt "bit" bit: u8,
        need "message" message: String,
        opt "refuse" refuse: bool,
    }
);

table!(
    /// An `[[actuator]]`.
    ActuatorTable, "an actuator" {
        need "output" output: String,
        need "command" command: String,
        opt "off" off: Choice,
        list "needs" needs: NeedTable,
        opt "travel" travel: Duration,
    }
);

table!(
    /// A state that another tag must be in.
    NeedTable, "a needed state" {
        need "tag" tag: String,
        need "is" is: Choice,
    }
);

table!(
    /// A `[[sequence]]`.
    SequenceTable, "a sequence" {
        need "run" run: String,
        opt "auto" auto: NeedTable,
        need "step" step: String,
        need "first" first: Choice,
    }
);

table!(
    /// The mimic of the process.
    MimicTable, "the mimic" {
        opt "size" size: [u16; 2],
        list "item" items: Raw,
        list "command" commands: CommandTable,
    }
);

table!(
    /// A command on the mimic.
    CommandTable, "a mimic command" {
        need "key" key: String,
        need "label" label: String,
        need "tag" tag: String,
        opt "value" value: Choice,
    }
);

table!(
    /// A `[[trend]]` group.
    TrendTable, "a trend" {
        need "name" name: String,
        list "pens" pens: PenTable,
    }
);

table!(
    /// A pen of a trend.
    PenTable, "a pen" {
        need "tag" tag: String,
        opt "scale" scale: [f64; 2],
    }
);

table!(
    /// A `[[shift]]`.
    ShiftTable, "a shift" {
        need "name" name: String,
        need "start" start: Time,
    }
);

table!(
    /// The rules for logging in.
    AccessTable, "access" {
        opt "banner" banner: String,
        opt "anonymous_view" anonymous_view: bool,
        opt "password_chars_min" password_chars_min: u16,
        opt "login_attempts_max" login_attempts_max: u16,
        opt "lockout" lockout: Duration,
        opt "idle_lock" idle_lock: Duration,
        opt "sessions_max" sessions_max: u16,
        list "trusted" trusted: TrustedTable,
    }
);

table!(
    /// A user of the operating system who needs no password.
    TrustedTable, "a trusted user" {
        need "user" user: String,
        need "role" role: Role,
    }
);

table!(
    /// What reports contain.
    ReportTable, "the report" {
        opt "folder" folder: String,
        list "tags" tags: String,
        opt "record" record: RecordTable,
        opt "csv" csv: CsvTable,
    }
);

table!(
    /// How little of the disk may be free.
    HistoryTable, "the history" {
        opt "disk_free_percent_min" disk_free_percent_min: u8,
        opt "disk_free_mib_min" disk_free_mib_min: u32,
    }
);

table!(
    /// The raw record of a controller.
    RecordTable, "the report's record" {
        need "device" device: String,
        need "every" every: Duration,
    }
);

table!(
    /// How CSV is written.
    CsvTable, "the report's csv" {
        opt "separator" separator: String,
        opt "decimal" decimal: String,
        opt "bom" bom: bool,
    }
);

words!(Rs485, "RS-485 direction control" { "off" => Rs485::Off, "rts-high" => Rs485::RtsHigh, "rts-low" => Rs485::RtsLow, });

words!(Parity, "parity" { "N" => Parity::None, "E" => Parity::Even, "O" => Parity::Odd, });

words!(Table, "table" {
    "coil" => Table::Coil, "discrete" => Table::Discrete, "input" => Table::Input, "holding" => Table::Holding,
});

words!(ByteOrder, "order" {
    "ABCD" => ByteOrder::Abcd, "CDAB" => ByteOrder::Cdab, "BADC" => ByteOrder::Badc, "DCBA" => ByteOrder::Dcba,
});

words!(Access, "access" { "r" => Access::Read, "rw" => Access::ReadWrite, "w" => Access::Write, });

words!(Confidence, "confidence" {
    "proven" => Confidence::Proven, "high" => Confidence::High, "medium" => Confidence::Medium, "low" => Confidence::Low,
});

words!(Role, "role" {
    "viewer" => Role::Viewer, "technician" => Role::Technician, "supervisor" => Role::Supervisor,
});

words!(Reauthentication, "reauthenticate" { "password" => Reauthentication::Password, "second user" => Reauthentication::SecondUser, });

words!(PollClass, "poll class" { "critical" => PollClass::Critical, "normal" => PollClass::Normal, "background" => PollClass::Background, });

words!(AlarmClass, "class of alarms" {
    "process" => AlarmClass::Process, "system" => AlarmClass::System,
});
words!(Signal, "signal of NE 107" {
    "F" => Signal::Failure, "C" => Signal::FunctionCheck, "S" => Signal::OutOfSpecification, "M" => Signal::Maintenance,
});

/// Whether something must be written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Need {
    /// It must.
    Required,
    /// It may.
    Optional,
}

words!(Need, "need for a comment" {
    "required" => Need::Required, "optional" => Need::Optional,
});
words!(Priority, "priority" {
    "critical" => Priority::Critical, "high" => Priority::High, "medium" => Priority::Medium, "low" => Priority::Low,
});

/// How addresses are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) enum Scheme {
    /// 0-based numbers, as sent.
    #[default]
    Modbus,
    /// Octal `V40500`, `Y17`, `X23`, `C54` of KOYO and AutomationDirect.
    DirectLogic,
}
words!(Scheme, "scheme" { "modbus" => Scheme::Modbus, "directlogic" => Scheme::DirectLogic, });

/// How well a register map is known.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Status {
    /// Tried on the device.
    Verified,
    /// Taken from the maker's manual.
    Manual,
    /// Parts are known.
    Partial,
}
words!(Status, "status" { "verified" => Status::Verified, "manual" => Status::Manual, "partial" => Status::Partial, });

/// How often a tag is read; the device says what fast and slow are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum PollWord {
    Fast,
    Slow,
    Once,
    Never,
}
words!(PollWord, "poll" {
    "fast" => PollWord::Fast, "slow" => PollWord::Slow, "once" => PollWord::Once, "never" => PollWord::Never,
});

/// The type of a raw value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct TypeName(pub DataType);

impl super::reader::Value for TypeName {
    fn read(
        value: &super::reader::Node,
        at: super::diagnostic::Span,
        problems: &mut super::diagnostic::Problems,
    ) -> Option<Self> {
        let word = <String as super::reader::Value>::read(value, at, problems)?;
        if let Some(rest) = word.strip_prefix("string") {
            let count = rest.strip_prefix('(').and_then(|rest| rest.strip_suffix(')'));
            let count =
                count.and_then(|count| count.trim().parse().ok()).filter(|n| (1..=DataType::TEXT_MAX).contains(n));
            if count.is_none() {
                let problem = problems.add(at, format!("`{word}` does not say how long the text is"));
                problem.label(format!("expected \"string(N)\" with N bytes, 1 to {}", DataType::TEXT_MAX));
            }
            return count.map(|count| TypeName(DataType::Text(count)));
        }
        let found = DataType::NUMBERS.into_iter().find(|kind| kind.name() == word);
        if found.is_none() {
            let names = DataType::NUMBERS.into_iter().map(DataType::name);
            problems.add(at, format!("unknown type `{word}`")).label("not a type").suggest(&word, names);
        }
        found.map(TypeName)
    }
}
