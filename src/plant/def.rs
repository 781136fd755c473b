//! The plant as its profile describes it: immutable, built once by `profile`, given to everyone at start.

use std::time::Duration;

use jiff::{civil::Time, tz::TimeZone};
use serde::{Deserialize, Serialize};

use super::tag::{Table, TagDef};
use crate::text::PlantTexts;

pub use super::{
    alarm_def::Priority,
    batch::BatchDef,
    history_def::{HistoryDef, ParquetVersion},
    id::{AlarmId, DeviceId, LineId, ProcedureId, TagId},
    line::{Framing, LineDef, Protocol, Serial, Transport},
    mimic_def::{MimicDef, MimicPage, Picture},
    north_def::{MqttDef, NorthDef, PasswordSource, TlsRoots},
    output::Output,
    procedure_def::{ProcedureDef, ProcedureStep, Reference},
    report_def::{CsvDialect, Paper, ReportDef, Section},
    role::{Reauthentication, Role},
    run_def::RunDef,
};
pub(crate) use super::{
    alarm_def::{AlarmClass, AlarmDef, AlarmRules, Condition, Guidance, Level, Subject},
    interlock_def::ControlLogic,
    line::{Parity, Rs485},
    mimic_def::{MimicCommand, MimicItem, MimicRect},
    program::{ProgramDef, ProgramStep},
    role::AccessDef,
};

/// Everything that a plant file says, checked.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PlantDef {
    /// Short name, the stem of the file: `tank`.
    pub name: String,
    /// What the screens show: `Water tank`.
    pub title: String,
    /// Local time of the plant, for display, shifts and reports.
    #[serde(with = "jiff::fmt::serde::tz::required")]
    pub time_zone: TimeZone,
    /// Lines, by [`LineId`].
    pub lines: Vec<LineDef>,
    /// Devices, by [`DeviceId`].
    pub devices: Vec<DeviceDef>,
    /// Tags of all devices, by [`TagId`].
    pub tags: Vec<TagDef>,
    /// Alarms, by [`AlarmId`].
    pub alarms: Vec<AlarmDef>,
    /// The rules for logging in.
    pub access: AccessDef,
    /// What holds for all alarms.
    pub alarm_rules: AlarmRules,
    /// What stands between commands and their effect.
    pub logic: ControlLogic,
    /// The mimic of the process.
    pub mimic: MimicDef,
    /// Groups of pens for the trends tab; at least one.
    pub trends: Vec<TrendGroup>,
    /// What its batches are, if it makes any.
    pub batches: Vec<BatchDef>,
    /// The control runs of each controller.
    pub runs: Vec<RunDef>,
    /// What the station can carry out on request, by [`ProcedureId`].
    pub procedures: Vec<ProcedureDef>,
    /// Shifts in order of their start; may be empty (then only free periods are reported).
    pub shifts: Vec<ShiftDef>,
    /// What reports contain and where they go.
    pub report: ReportDef,
    /// What the history needs of its disk.
    pub history: HistoryDef,
    /// Where values are sent to.
    pub north: NorthDef,
    /// Its texts in other languages.
    pub texts: PlantTexts,
    /// The simulated process that `demo` and `sim` serve for this plant, by name (`tank`).
    pub simulation: Option<String>,
    /// SHA-256 of the plant file in hexadecimal; empty for a plant without one.
    pub file_sha256: String,
}

impl Default for PlantDef {
    /// A plant that has nothing.
    fn default() -> PlantDef {
        PlantDef {
            name: String::new(),
            title: String::new(),
            time_zone: TimeZone::UTC,
            lines: Vec::new(),
            devices: Vec::new(),
            tags: Vec::new(),
            alarms: Vec::new(),
            access: AccessDef::default(),
            alarm_rules: AlarmRules::default(),
            logic: ControlLogic::default(),
            mimic: MimicDef::default(),
            trends: Vec::new(),
            batches: Vec::new(),
            runs: Vec::new(),
            procedures: Vec::new(),
            shifts: Vec::new(),
            report: ReportDef::default(),
            history: HistoryDef::default(),
            north: NorthDef::default(),
            texts: PlantTexts::NONE,
            simulation: None,
            file_sha256: String::new(),
        }
    }
}

impl PlantDef {
    /// Is it only a device on a line, or a log of one, without a plant file that says what its registers mean?
    pub fn is_bench(&self) -> bool {
        self.tags.is_empty()
    }

    /// The line of an id. Ids come from this very definition, so they are always there.
    pub fn line(&self, id: LineId) -> &LineDef {
        &self.lines[id.index()]
    }
    /// Is a tag of a line that another master polls?
    pub fn listens_to(&self, tag: TagId) -> bool {
        self.listens_on(self.device(self.tag(tag).device).line)
    }
    /// Does another master poll on a line? Not on one that is not there.
    pub fn listens_on(&self, line: LineId) -> bool {
        self.lines.get(line.index()).is_some_and(|line| line.listens)
    }
    /// The device of an id.
    pub fn device(&self, id: DeviceId) -> &DeviceDef {
        &self.devices[id.index()]
    }
    /// The tag of an id.
    pub fn tag(&self, id: TagId) -> &TagDef {
        &self.tags[id.index()]
    }
    /// The alarm of an id.
    pub fn alarm(&self, id: AlarmId) -> &AlarmDef {
        &self.alarms[id.index()]
    }
    /// The procedure of an id.
    pub fn procedure(&self, id: ProcedureId) -> &ProcedureDef {
        &self.procedures[id.index()]
    }
    /// Looks a tag up by its full name, `TIC-1.PV`.
    pub fn tag_named(&self, name: &str) -> Option<TagId> {
        self.tags.iter().find(|tag| tag.name == name).map(|tag| tag.id)
    }
    /// The tags of one device, in the order of its profile.
    pub fn tags_of(&self, device: DeviceId) -> impl Iterator<Item = &TagDef> {
        self.tags.iter().filter(move |tag| tag.device == device)
    }
}

/// One device on a line.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DeviceDef {
    /// Its place.
    pub id: DeviceId,
    /// `TIC-1`.
    pub name: String,
    /// What it does in the plant: `tank temperature`.
    pub title: String,
    /// The line it sits on.
    pub line: LineId,
    /// Unit address: 1–247 on a serial line, 0 there for a broadcast (write only), 0–255 over TCP.
    pub unit: u8,
    /// Name of its profile: `fuji_pxr`.
    pub profile: String,
    /// `FUJI PXR4`.
    pub model: String,
    /// What one request may hold.
    pub limits: Limits,
    /// The function codes that it knows; empty if its profile does not list them.
    pub functions: Vec<u8>,
    /// Names of the states that function 07 reads, by bit; what they mean is the device's own.
    pub exception_status: Vec<(u8, String)>,
    /// What its output is at the terminals; `None` where neither plant file nor profile says.
    pub output: Option<Output>,
    /// Least silence between two requests to this device (the PXR wants 10 ms).
    pub gap: Duration,
    /// Quiet time after a write before the next request.
    pub write_gap: Duration,
    /// The longest that it takes itself for a response, as its profile states it.
    pub response_time: Option<Duration>,
    /// Most devices on its serial line, as its profile states it; `None`: as many as RS-485 carries.
    pub units_max: Option<u16>,
    /// Which tags play PV, SV and so on, if it is a controller.
    pub faceplate: Option<Faceplate>,
    /// Actions that are more than a write (save to non-volatile memory).
    pub actions: Vec<ActionDef>,
    /// Its ramp/soak program, if it has one.
    pub program: Option<ProgramDef>,
    /// By what it is recognised; a terminal at a station has no use for it.
    #[serde(skip)]
    pub signature: Vec<Probe>,
}

impl DeviceDef {
    /// Is the same asked of it as of another, in the same way?
    pub fn is_asked_as(&self, other: &DeviceDef) -> bool {
        let of = |device: &DeviceDef| (device.unit, device.limits, device.gap, device.write_gap, device.response_time);
        of(self) == of(other) && self.functions == other.functions
    }

    /// Unit 1 of which nothing is known: it gets what every device must take.
    pub fn new(id: DeviceId, name: &str, line: LineId) -> DeviceDef {
        DeviceDef {
            id,
            name: name.to_owned(),
            title: String::new(),
            line,
            unit: 1,
            profile: String::new(),
            model: String::new(),
            limits: Limits { gap_registers_max: 0, ..Limits::STANDARD },
            functions: Vec::new(),
            exception_status: Vec::new(),
            output: None,
            gap: Duration::ZERO,
            write_gap: Duration::ZERO,
            response_time: None,
            units_max: None,
            faceplate: None,
            actions: Vec::new(),
            program: None,
            signature: Vec::new(),
        }
    }
}

/// Registers of one read (Modbus application protocol V1.1b3, 6.3).
pub const READ_REGISTERS_MAX: u16 = 125;

/// What one request to a device may hold, and how blocks are cut.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Limits {
    /// Registers a read may ask for, at most 125.
    pub read_registers_max: u16,
    /// Bits a read may ask for, at most 2000.
    pub read_bits_max: u16,
    /// Registers a write may carry, at most 123.
    pub write_registers_max: u16,
    /// Unused registers that may be read over to join two tags into one block.
    pub gap_registers_max: u16,
    /// Blocks start and end on multiples of this (2 for meters that refuse odd counts).
    pub alignment: u16,
    /// Requests that may be under way at once, over Modbus TCP only.
    pub in_flight_max: u16,
    /// What tables have of their own, in the order of [`Table`].
    pub of_tables: [TableLimits; 4],
}

/// What reads of one table have of their own; `None` is as for the others.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct TableLimits {
    /// Registers or bits.
    pub read_max: Option<u16>,
    /// Unused registers or bits between two tags.
    pub gap_max: Option<u16>,
    /// Multiple of an address and a count.
    pub alignment: Option<u16>,
}

impl Limits {
    fn of(&self, table: Table) -> TableLimits {
        self.of_tables[table as usize]
    }

    /// Registers or bits that one read of a table may ask for.
    pub fn most(&self, table: Table) -> u16 {
        self.of(table).read_max.unwrap_or(if table.is_bits() { self.read_bits_max } else { self.read_registers_max })
    }

    /// Unused registers or bits that may be read over: sixteen bits cost as much on the wire as one register.
    pub fn gap(&self, table: Table) -> u32 {
        let as_others = u32::from(self.gap_registers_max) * if table.is_bits() { 16 } else { 1 };
        self.of(table).gap_max.map_or(as_others, u32::from)
    }

    /// Multiple of the addresses and counts of reads.
    pub fn step(&self, table: Table) -> u16 {
        let of_registers = if table.is_bits() { 1 } else { self.alignment };
        self.of(table).alignment.unwrap_or(of_registers).max(1)
    }

    /// What the standard allows (Modbus application protocol V1.1b3, section 6), one request at a time.
    pub const STANDARD: Limits = Limits {
        read_registers_max: READ_REGISTERS_MAX,
        read_bits_max: 2_000,
        write_registers_max: 123,
        gap_registers_max: 8,
        alignment: 1,
        in_flight_max: 1,
        of_tables: [TableLimits { read_max: None, gap_max: None, alignment: None }; 4],
    };
}

/// The tags that a controller is operated by.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Faceplate {
    /// Process value.
    pub pv: TagId,
    /// Setpoint, as it is written.
    pub sv: TagId,
    /// The setpoint in use, where a program or a ramp may move it away from `sv`.
    pub sv_used: Option<TagId>,
    /// Manipulated value, output in percent.
    pub mv: Option<TagId>,
    /// Run / standby, if it can be switched.
    pub run: Option<TagId>,
    /// Control method (PID, FUZZY, SELF).
    pub mode: Option<TagId>,
    /// Auto-tuning command and state.
    pub tune: Option<TagId>,
    /// The parameters that auto-tuning finds: P, I, D.
    pub tunes: Vec<TagId>,
}

impl Faceplate {
    /// What the controller works towards now: to show, never to write.
    pub fn sv_to_show(&self) -> TagId {
        self.sv_used.unwrap_or(self.sv)
    }
}

/// An action on a device: a write that needs its own words, confirmation and quiet time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ActionDef {
    /// `FIX`.
    pub name: String,
    /// The tag it writes.
    pub tag: TagId,
    /// The value it writes.
    pub value: f64,
    /// How long the device is left alone afterwards.
    pub settle: Duration,
    /// What the operator is asked.
    pub confirm: String,
    /// It stops something: it goes before all that waits.
    pub stop: bool,
    /// It saves the settings in the device's own memory.
    pub saves: bool,
    /// The least role that may do it, where that is not the one of its tag.
    pub role: Option<Role>,
}

/// Fewest probes of a signature that fit.
pub const PROBES_MIN: usize = 3;
/// Fewest different numbers among those that fit: a unit that answers the same everywhere is nothing.
pub const PROBED_NUMBERS_MIN: usize = 3;

/// What a tag must hold in a device of this kind.
#[derive(Debug, Clone, PartialEq)]
pub struct Probe {
    /// The tag that is read.
    pub tag: TagId,
    /// Its raw number, before scaling, lies in one of these; both ends belong to them.
    pub ranges: Vec<(f64, f64)>,
    /// Instead: its word holds the same as 16 bits from this one on.
    pub bits: Option<TagId>,
}

/// A group of pens of the trends tab.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TrendGroup {
    /// `TIC-1`.
    pub name: String,
    /// The pens, at most eight.
    pub pens: Vec<Pen>,
}

/// One curve: its tag and the scale it is drawn on.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Pen {
    /// What.
    pub tag: TagId,
    /// Fixed scale (low, high); `None` fits the data.
    pub scale: Option<(f64, f64)>,
}

/// A shift of the day.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ShiftDef {
    /// `morning`.
    pub name: String,
    /// Local start; it lasts until the next shift starts.
    pub start: Time,
}
