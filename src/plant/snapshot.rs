//! All that is true at one instant, as plain data: what screens draw and scripts print.

mod encoding;

use crate::t;
use crate::text::of_plant;
use std::{collections::BTreeMap, sync::Arc, time::Duration};

use jiff::{SignedDuration, Timestamp};
use serde::{Deserialize, Serialize};

use super::{
    alarm::{ActiveAlarm, AlarmCommand, AlarmMetrics, SuppressedAlarm},
    command::{Command, CommandId, CommandKind, CommandStatus},
    control_run::ControlRun,
    def::{AlarmId, Condition, DeviceId, LineDef, LineId, PlantDef, ProcedureId, TagId},
    diagnostics::DiagnosticRun,
    exact::{Exact, digits},
    fault::Fault,
    identity::Identities,
    interlock::ActuatorTracker,
    line_report::LineReport,
    line_state::{DeviceState, LineCounters, LineState},
    ne107,
    north_status::NorthStatus,
    number::{to_i8, to_u32},
    parameter_set::StoredSet,
    procedure::ProcedureRun,
    process_load::ProcessLoad,
    record::ChainHash,
    restore::Restore,
    sample::{Cause, Sample},
    scale,
    station_fault::StationFault,
    tag::Decimals,
    text_value,
    time::elapsed,
    traffic::Exchange,
    tuning::Tuning,
};

/// The plant at one instant. Losing an intermediate snapshot is harmless.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Snapshot {
    /// The instant.
    pub at: Timestamp,
    /// Which run of the station: another one may have another plant file.
    pub run: u64,
    /// What the system clock was set by since the run began: without it, `at` is steady time.
    pub stepped: SignedDuration,
    /// What never changes; not encoded, because who reads a snapshot already has it.
    #[serde(skip)]
    pub def: Arc<PlantDef>,
    /// Samples, by [`TagId`].
    #[serde(with = "encoding::samples")]
    pub samples: Vec<Sample>,
    /// What tags that hold text say, by [`TagId`]; `None` for all others and while the quality is bad.
    pub texts: Arc<Vec<Option<Arc<str>>>>,
    /// What devices say of themselves, where a condition of their profile asks.
    pub identities: Identities,
    /// Decimals to show, by [`TagId`] (they may come from the device).
    pub decimals: Vec<u8>,
    /// The last request that was made for each tag, with its answer, by [`TagId`]: why a value is what it is.
    #[serde(with = "encoding::source_frames")]
    pub source_frames: Arc<Vec<Option<Arc<Exchange>>>>,
    /// Lines, by [`LineId`].
    pub lines: Vec<LineStatus>,
    /// Devices, by [`DeviceId`].
    pub devices: Vec<DeviceStatus>,
    /// Alarms that are active, unacknowledged or latched: most urgent first, then latest first.
    pub alarms: Arc<Vec<ActiveAlarm>>,
    /// Alarms that are suppressed, in the order of the plant file: never annunciated, always listed.
    pub suppressed: Arc<Vec<SuppressedAlarm>>,
    /// An unacknowledged active alarm came after the last silence.
    pub sound: bool,
    /// How many annunciations there have been: what an acknowledgement of all goes by.
    pub annunciations: u64,
    /// How good the alarm system is: the rates of this moment, and the figures of the last 24 hours.
    pub alarm_metrics: AlarmMetrics,
    /// The latest commands, newest first, at most 32.
    pub commands: Vec<CommandStatus>,
    /// Since when the feedback of actuators has differed from their commands.
    pub actuators: ActuatorTracker,
    /// The history store.
    pub history: HistoryStatus,
    /// The details of each fault that the station has or had.
    pub station: Arc<BTreeMap<StationFault, Arc<str>>>,
    /// The parameter sets that the station keeps, by name.
    pub sets: Arc<Vec<StoredSet>>,
    /// The latest restore of each device that had one.
    pub restores: Vec<Arc<Restore>>,
    /// The latest auto-tuning of each device, by [`DeviceId`]; `None` if none was seen.
    pub tunings: Vec<Option<Arc<Tuning>>>,
    /// How long the program of each device has been where it is, by [`DeviceId`], and whether its beginning was seen.
    pub programs: Vec<Option<(Duration, bool)>>,
    /// The control run at work, or the last one, by place in [`PlantDef::runs`]; `None` before the first.
    pub runs: Vec<Option<Arc<ControlRun>>>,
    /// Each procedure as it stands or as it ended last, by [`ProcedureId`]; `None` before its first start.
    pub procedures: Vec<Option<Arc<ProcedureRun>>>,
    /// How far the data out has come; `None` for a plant that sends nothing.
    pub north: Option<Arc<NorthStatus>>,
    /// What the program takes of its computer; `None` until it is known.
    pub load: Option<ProcessLoad>,
    /// Plant seconds per real second; 1 except in demonstrations.
    pub speed: f64,
}

impl Snapshot {
    /// A plant of which nothing is known yet.
    pub fn blank(def: Arc<PlantDef>) -> Snapshot {
        let (tags, devices) = (def.tags.len(), def.devices.len());
        Snapshot {
            at: Timestamp::UNIX_EPOCH,
            run: 0,
            stepped: SignedDuration::ZERO,
            samples: vec![Sample::bad(Cause::NotRead, Timestamp::UNIX_EPOCH); tags],
            texts: Arc::new(vec![None; tags]),
            identities: Identities::default(),
            decimals: vec![0; tags],
            source_frames: Arc::new(vec![None; tags]),
            lines: vec![LineStatus::default(); def.lines.len()],
            devices: vec![DeviceStatus::default(); devices],
            alarms: Arc::default(),
            suppressed: Arc::default(),
            sound: false,
            annunciations: 0,
            alarm_metrics: AlarmMetrics::default(),
            commands: Vec::new(),
            actuators: ActuatorTracker::default(),
            history: HistoryStatus::default(),
            station: Arc::default(),
            sets: Arc::default(),
            restores: Vec::new(),
            tunings: vec![None; devices],
            programs: vec![None; devices],
            runs: vec![None; def.runs.len()],
            procedures: vec![None; def.procedures.len()],
            north: None,
            load: None,
            speed: 1.0,
            def,
        }
    }
    /// The sample of a tag.
    pub fn sample(&self, tag: TagId) -> Sample {
        self.samples[tag.index()]
    }
    /// Age of a sample at this instant, zero for one that is newer.
    pub fn age(&self, tag: TagId) -> Duration {
        elapsed(self.sample(tag).at, self.at)
    }
    /// The value of a tag as text with its decimals or enumeration label, without unit; `None` without a value.
    pub fn text(&self, tag: TagId) -> Option<String> {
        if let Some(text) = &self.texts[tag.index()] {
            return Some(text.to_string());
        }
        Some(self.format(tag, self.sample(tag).exact()?))
    }
    /// Any value of a tag as text with its decimals or enumeration label.
    pub fn format(&self, tag: TagId, value: impl Into<Exact>) -> String {
        let value = value.into();
        match self.def.tag(tag).label_of(value) {
            Some(label) => of_plant(label).to_owned(),
            None => digits(value, Some(self.decimals[tag.index()])),
        }
    }
    /// A value as the device will hold it once it is written; as it is where it cannot be sent.
    pub fn rounded_to_device(&self, tag: TagId, value: Exact) -> Exact {
        scale::rounded_to_device(self.def.tag(tag), value, self.scaling_decimals(tag)).unwrap_or(value)
    }
    /// The smallest change of a value that a whole number in the device can hold.
    pub fn step(&self, tag: TagId) -> f64 {
        self.def.tag(tag).scale.abs() * 10f64.powi(-i32::from(self.scaling_decimals(tag)))
    }
    pub(crate) fn scaling_decimals(&self, tag: TagId) -> i8 {
        let def = self.def.tag(tag);
        let shown = to_i8(self.decimals[tag.index()]);
        match def.decimals {
            Decimals::Fixed(_) => 0,
            Decimals::From(_) => shown,
            Decimals::PowerFrom(_) => def.scaling_decimals(|tag| self.sample(tag).scaling_value()).unwrap_or(shown),
        }
    }
    /// The displayed value of the tag that a command writes; `None` where it writes none, or none is displayed.
    pub fn expected_value(&self, kind: &CommandKind) -> Option<Exact> {
        self.samples.get(kind.written()?.0.index())?.exact()
    }
    /// A command on the plant as it is shown here.
    pub fn command(&self, id: CommandId, kind: CommandKind) -> Command {
        Command { expected_value: self.expected_value(&kind), ..Command::new(self.run, id, kind) }
    }
    /// The tag that a command writes, and the new value with its unit, or the new text.
    pub fn written(&self, kind: &CommandKind) -> Option<(TagId, String)> {
        if let CommandKind::WriteText { tag, text, .. } = kind {
            return Some((*tag, text_value::quoted(text)));
        }
        let (tag, value) = kind.written()?;
        Some((tag, format!("{} {}", self.format(tag, value), self.unit(tag)).trim_end().to_owned()))
    }
    /// The unit of a tag, which the device may choose (°C or °F).
    pub fn unit(&self, tag: TagId) -> &str {
        self.def.tag(tag).unit_now(|tag| self.sample(tag))
    }
    /// Lowest and highest permitted value of a tag, where both are known now.
    pub fn bounds(&self, tag: TagId) -> Option<(Exact, Exact)> {
        let (min, max) = self.def.tag(tag).limits(|from| self.sample(from).exact()).ok()?;
        min.zip(max)
    }
    /// The same, to draw by.
    pub fn range(&self, tag: TagId) -> Option<(f64, f64)> {
        self.bounds(tag).map(|(min, max)| (min.near(), max.near()))
    }
    /// The state of a line.
    pub fn line(&self, id: LineId) -> &LineStatus {
        &self.lines[id.index()]
    }
    /// The state of a device.
    pub fn device(&self, id: DeviceId) -> &DeviceStatus {
        &self.devices[id.index()]
    }
    /// The restore of a device, at work or the last one.
    pub fn restore(&self, id: DeviceId) -> Option<&Restore> {
        self.restores.iter().find(|run| run.device == id).map(Arc::as_ref)
    }
    /// The auto-tuning of a device, at work or the last one.
    pub fn tuning(&self, id: DeviceId) -> Option<&Tuning> {
        self.tunings.get(id.index())?.as_deref()
    }
    /// Does a device have control runs?
    pub fn has_runs(&self, id: DeviceId) -> bool {
        self.def.runs.iter().any(|def| def.controller == id)
    }
    /// The control run of a device, at work or the last one.
    pub fn control_run(&self, id: DeviceId) -> Option<&ControlRun> {
        let place = self.def.runs.iter().position(|def| def.controller == id)?;
        self.runs.get(place)?.as_deref()
    }
    /// The procedure at work, and how it stands.
    pub fn procedure_at_work(&self) -> Option<(ProcedureId, &ProcedureRun)> {
        let mut runs = (0..).map(ProcedureId).zip(&self.procedures);
        runs.find_map(|(id, run)| run.as_deref().filter(|run| run.at_work()).map(|run| (id, run)))
    }
    /// The details of a fault of the station, as of the last time it was active.
    pub fn fault_details(&self, alarm: AlarmId) -> &str {
        let Condition::Station(fault) = self.def.alarm(alarm).condition else { return "" };
        self.station.get(&fault).map_or("", |details| details)
    }
    /// The alarms of a tag, most urgent first.
    pub fn alarms_of(&self, tag: TagId) -> impl Iterator<Item = &ActiveAlarm> {
        use super::def::Subject;
        self.alarms.iter().filter(move |alarm| self.def.alarm(alarm.id).subject == Subject::Tag(tag))
    }
}

/// A line as it stands.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct LineStatus {
    /// Connected, waiting, closed.
    pub state: LineState,
    /// Totals since the start.
    pub counters: LineCounters,
    /// Settings, polls and frames; `None` until the line has reported. Encoded by itself: it is large, and changes once a second.
    #[serde(skip)]
    pub report: Option<Arc<LineReport>>,
    /// Settings as they were before others were tried.
    pub settings_before: Option<Arc<LineDef>>,
    /// The test at work, or the last one.
    pub test: Option<Arc<DiagnosticRun>>,
    /// When it came into this state.
    pub since: Option<Timestamp>,
    /// Since when it has not been connected although it should be.
    pub lost_since: Option<Timestamp>,
}

/// A device as it stands.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct DeviceStatus {
    /// Responding or not.
    pub state: DeviceState,
    /// Time of the last answer, from last byte sent to first byte received.
    pub response_time: Option<Duration>,
    /// Valid answers since the start.
    pub ok: u64,
    /// Values in those answers.
    pub values: u64,
    /// Requests that failed since the start.
    pub failed: u64,
    /// The last failure and its time.
    pub last_fault: Option<(Timestamp, Fault)>,
    /// What is wrong with it, by NAMUR NE 107; `None` while it is well.
    pub diagnosis: Option<ne107::Reason>,
}

impl HistoryStatus {
    /// What is wrong with it and how many records wait: `not recording: 1234 records waiting (12 %); disk full`.
    pub fn words(&self) -> Option<String> {
        let trouble = self.trouble.as_ref()?;
        if self.failing.is_none() {
            return Some(trouble.clone());
        }
        let share = self.waiting * 100 / self.waiting_max.max(1);
        Some(t!("not recording: {count} records waiting ({share} %); {trouble}", count = self.waiting, share, trouble))
    }
}

impl Snapshot {
    /// The command to acknowledge all that waits here, as it is seen; `None` if nothing does.
    pub fn acknowledge_all(&self) -> Option<CommandKind> {
        let waits = self.alarms.iter().any(|alarm| alarm.state.needs_acknowledgement());
        waits.then_some(CommandKind::Alarm(AlarmCommand::AcknowledgeAll { alarms: None, seen: self.annunciations }))
    }

    /// The most urgent alarm that waits for an acknowledgement, else the most urgent one: what every page names.
    pub fn foremost_alarm(&self) -> Option<&ActiveAlarm> {
        let mut waiting = self.alarms.iter().filter(|alarm| alarm.state.needs_acknowledgement());
        waiting.next().or_else(|| self.alarms.first())
    }
}

/// The history store as it stands.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct HistoryStatus {
    /// Rows committed since the start.
    pub rows: u64,
    /// Records that had to be dropped because the store could not keep up.
    pub lost: u64,
    /// Last commit.
    pub committed_at: Option<Timestamp>,
    /// Why it takes no records now; they wait meanwhile.
    pub failing: Option<String>,
    /// Records that wait to be stored, and how many can.
    pub waiting: u64,
    /// Most records that can wait; the oldest samples are dropped first.
    pub waiting_max: u64,
    /// What was damaged or missing, and where it was set aside; since the start.
    pub damaged: Option<String>,
    /// Why closed hours are not archived: they stay in the database meanwhile.
    pub unarchived: Option<String>,
    /// How little of the disk is free; `None` while there is enough.
    pub disk: Option<String>,
    /// The clock was behind the last record at the start.
    pub clock: Option<String>,
    /// How often the clock was set while this history was written; stored with each record.
    pub epoch: u16,
    /// The last entry of the audit log that is on disk.
    pub audit: Option<ChainHash>,
    /// All that is wrong with it, in words for the operator.
    pub trouble: Option<String>,
    /// Size of the file, bytes.
    pub file_bytes: u64,
}
