//! The tables and keys of a plant file; one page for each kind.

mod alarm;
mod device;
mod keys;
mod line;

use std::time::Duration;

use jiff::civil::Time;

pub(super) use self::{
    alarm::{AlarmTable, Requirement},
    device::{
        ActionTable, CheckTable, FaceplateTable, LimitsTable, PollWord, ProfileFile, ProgramTable, RepeatTable,
        SignatureTable, SimulateTable, StepTable, TableLimitsTable, TagTable,
    },
    keys::{CounterKey, PollKey, Priorities, Roles, Stated},
    line::{ListenFraming, ListenSerialTable, ListenTcpTable, SerialTable, TcpTable, UdpTable},
};
use super::{
    address::Scheme,
    reader::{Choice, Numbered, Raw, Texts, toml_tables},
};
use crate::plant::{
    def::{Paper, ParquetVersion, Role, Section},
    output::Output,
    report::PeriodKind,
};

toml_tables! {
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
        list "batch" batches: BatchTable,
        list "run" runs: RunTable,
        list "procedure" procedures: ProcedureTable,
        list "shift" shifts: ShiftTable,
        opt "report" report: ReportTable,
        opt "history" history: HistoryTable,
        opt "north" north: NorthTable,
        /// Its texts in other languages.
        opt "texts" texts: Raw,
    }

    /// A `[[device]]` of a plant file.
    DeviceTable, "a device" {
        need "name" name: String,
        opt "title" title: String,
        /// Where its register map is; without it, the keys of a device profile stand here.
        opt "profile" profile: String,
        need "line" line: String,
        need "unit" unit: u8,
        /// Period of tags with `poll = "fast"`.
        opt "fast" fast: Duration,
        /// Period of tags with `poll = "slow"`.
        opt "slow" slow: Duration,
        opt "limits" limits: Raw,
        /// Always 0: says that addresses which could be Modicon numbers are as sent.
        opt "address_base" address_base: u8,
        /// More tags, or other keys for the tags of the profile.
        list "tag" tags: Raw,
        /// Tags that it has many times.
        list "repeat" repeats: RepeatTable,
        /// Another priority for alarms of the profile, or `off`.
        opt "alarm_priority" alarm_priority: Priorities,
        /// The least role that may write the tags of a group; what the profile says of the same group does not count.
        opt "roles" roles: Roles,
        /// Names of the eight states that function 07 reads; they stand for those of the profile.
        opt "exception_status" exception_status: Numbered,
        /// What its output is at the terminals, which the order code says; it stands for that of the profile.
        opt "output" output: Output,
        /// Values of registers that the other master of a listening line never reads: decimals and units.
        opt "stated" stated: Stated,
        // What follows belongs to a device without a profile.
        opt "vendor" vendor: String,
        opt "model" model: String,
        opt "source" source: String,
        opt "notes" notes: String,
        opt "scheme" scheme: Scheme,
        list "functions" functions: u8,
        opt "default" default: Raw,
        list "action" actions: ActionTable,
        opt "faceplate" faceplate: FaceplateTable,
        opt "program" program: ProgramTable,
        opt "signature" signature: SignatureTable,
    }

    /// What holds for all alarms, `[alarms]`.
    AlarmRulesTable, "the rules for alarms" {
        opt "shelve_max" shelve_max: Duration,
        opt "first_out_window" first_out_window: Duration,
    }

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

    /// An `[[actuator]]`.
    ActuatorTable, "an actuator" {
        need "output" output: String,
        need "command" command: String,
        opt "off" off: Choice,
        list "needs" needs: NeedTable,
        opt "travel" travel: Duration,
    }

    /// A state that another tag must be in.
    NeedTable, "a needed state" {
        need "tag" tag: String,
        need "is" is: Choice,
    }

    /// A `[[sequence]]`.
    SequenceTable, "a sequence" {
        need "run" run: String,
        opt "auto" auto: NeedTable,
        need "step" step: String,
        need "first" first: Choice,
    }

    /// The mimic of the process.
    MimicTable, "the mimic" {
        opt "name" name: String,
        opt "picture" pictures: Texts,
        opt "alias" aliases: Raw,
        list "page" pages: PageTable,
        list "command" commands: CommandTable,
    }

    /// A further page of the mimic.
    PageTable, "a page of the mimic" {
        need "name" name: String,
        need "picture" pictures: Texts,
    }

    /// A command on the mimic.
    CommandTable, "a mimic command" {
        need "key" key: String,
        need "label" label: String,
        need "tag" tag: String,
        opt "value" value: Choice,
    }

    /// A `[[trend]]` group.
    TrendTable, "a trend" {
        need "name" name: String,
        list "pens" pens: PenTable,
    }

    /// A pen of a trend.
    PenTable, "a pen" {
        need "tag" tag: String,
        opt "scale" scale: [f64; 2],
    }

    /// A `[[batch]]`.
    BatchTable, "a batch" {
        need "name" name: String,
        need "start" start: String,
        need "end" end: String,
        opt "phase" phase: String,
        opt "energy" energy: String,
        list "tags" tags: String,
    }

    /// A `[[run]]`.
    RunTable, "a run" {
        need "controller" controller: String,
        opt "band" band: f64,
        opt "steady_for" steady_for: Duration,
        opt "duration_max" duration_max: Duration,
        opt "energy" energy: String,
        opt "batches" batches: Texts,
        opt "tags" tags: Texts,
    }

    /// A `[[procedure]]`.
    ProcedureTable, "a procedure" {
        need "name" name: String,
        opt "about" about: String,
        list "steps" steps: ProcedureStepTable,
        list "safe" safe: SafeWriteTable,
        opt "reference" reference: ReferenceTable,
    }

    /// One of its steps: exactly one of `write`, `wait_until`, `hold`, `begin_measurement`, `end_measurement`, `steps_of`.
    ProcedureStepTable, "a step of a procedure" {
        opt "write" write: String,
        opt "value" value: Choice,
        opt "wait_until" wait_until: String,
        opt "limit" limit: Duration,
        opt "hold" hold: Duration,
        opt "begin_measurement" begin_measurement: String,
        opt "end_measurement" end_measurement: String,
        opt "steps_of" steps_of: String,
    }

    /// A write of its safe state.
    SafeWriteTable, "a write of the safe state" {
        need "write" write: String,
        need "value" value: Choice,
    }

    /// What its measurement is compared with.
    ReferenceTable, "a reference" {
        need "source" source: String,
        opt "at_sv" at_sv: Duration,
        opt "steady" steady: Duration,
        opt "overshoot" overshoot: f64,
    }

    /// A `[[shift]]`.
    ShiftTable, "a shift" {
        need "name" name: String,
        need "start" start: Time,
    }

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

    /// A user of the operating system who needs no password.
    TrustedTable, "a trusted user" {
        need "user" user: String,
        need "role" role: Role,
    }

    /// What reports contain.
    ReportTable, "the report" {
        opt "folder" folder: String,
        list "tags" tags: String,
        opt "record" record: RecordTable,
        opt "csv" csv: CsvTable,
        opt "logo" logo: String,
        opt "title" title: String,
        opt "text" text: String,
        list "sections" sections: Section,
        list "curves" curves: String,
        list "signatures" signatures: String,
        opt "language" language: String,
        opt "paper" paper: Paper,
        list "automatic" automatic: AutomaticReportTable,
    }

    /// A `[[report.automatic]]`.
    AutomaticReportTable, "an automatic report" {
        need "period" period: PeriodKind,
        list "formats" formats: String,
        opt "folder" folder: String,
        opt "keep_days" keep_days: u32,
        list "after" after: String,
    }

    /// What the history may take of its disk, and for how long it keeps what.
    HistoryTable, "the history" {
        opt "disk_free_percent_min" disk_free_percent_min: u8,
        opt "disk_free_mib_min" disk_free_mib_min: u32,
        opt "disk_share_percent_max" disk_share_percent_max: u8,
        opt "keep_samples_days" keep_samples_days: u32,
        opt "keep_minutes_days" keep_minutes_days: u32,
        opt "keep_hours_days" keep_hours_days: u32,
        opt "parquet" parquet: ParquetVersion,
    }

    /// Where values are sent to.
    NorthTable, "the data out" {
        opt "mqtt" mqtt: MqttTable,
    }

    /// The `[north.mqtt]`.
    MqttTable, "the MQTT broker" {
        need "host" host: String,
        opt "port" port: u16,
        opt "client_id" client_id: String,
        opt "user" user: String,
        opt "password_file" password_file: String,
        opt "password_env" password_env: String,
        opt "tls" tls: bool,
        opt "ca_file" ca_file: String,
        opt "topic" topic: String,
        opt "commands_as" commands_as: String,
        opt "deadband_percent" deadband_percent: f64,
        list "deadband" deadbands: DeadbandTable,
        opt "max_interval" max_interval: Duration,
        opt "lag_max" lag_max: Duration,
    }

    /// A `[[north.mqtt.deadband]]`.
    DeadbandTable, "a deadband" {
        need "tag" tag: String,
        opt "value" value: f64,
        opt "percent" percent: f64,
    }

    /// The raw record of a controller.
    RecordTable, "the report's record" {
        need "device" device: String,
        need "every" every: Duration,
    }

    /// How CSV is written.
    CsvTable, "the report's csv" {
        opt "separator" separator: String,
        opt "decimal" decimal: String,
        opt "bom" bom: bool,
    }
}
