//! A small but complete tank plant for tests of the screens, in three moods: normal, alarm, line down.

use std::{sync::Arc, time::Duration};

use jiff::{SignedDuration, Timestamp, civil::time, tz::TimeZone};

use super::{Cx, theme::Theme};
use crate::plant::{
    alarm::AlarmState,
    def::*,
    event::{Fault, LineCounters, LineState},
    sample::{Cause, Sample},
    snapshot::{ActiveAlarm, DeviceState, DeviceStatus, HistoryStatus, LineStatus, Snapshot},
    tag::*,
};

/// The instant of every fixture: 2026-11-21 14:02:31 in Bangkok.
pub fn now() -> Timestamp {
    "2026-11-21T07:02:31Z".parse().expect("a valid instant")
}

/// A plant and its state, to be changed by a test before it becomes a snapshot.
#[derive(Debug, Clone)]
pub struct Fixture {
    /// The plant.
    pub def: PlantDef,
    /// Samples by tag.
    pub samples: Vec<Sample>,
    /// Alarms that are shown.
    pub alarms: Vec<ActiveAlarm>,
    /// The line.
    pub line: LineStatus,
    /// The devices.
    pub devices: Vec<DeviceStatus>,
}

impl Fixture {
    /// Heating at step HEAT, everything good, no alarm.
    pub fn normal() -> Fixture {
        let def = plant();
        let at = now() - SignedDuration::from_millis(400);
        let samples = def.tags.iter().map(|tag| Sample::good(start(&tag.name), at)).collect();
        let counters = LineCounters { requests: 812, ok: 812, utilisation: 0.62, last_tx: Some(at), last_rx: Some(at), ..LineCounters::default() };
        let answering = DeviceStatus { state: DeviceState::Answering, reply: Some(Duration::from_millis(12)), ok: 406, ..DeviceStatus::default() };
        let devices = vec![answering; def.devices.len()];
        Fixture { def, samples, alarms: Vec::new(), line: LineStatus { state: LineState::Connected, counters }, devices }
    }

    /// PV above its limit and unacknowledged, a late PLC acknowledged, a low level returned.
    pub fn alarm() -> Fixture {
        let mut plant = Fixture::normal();
        plant.set("TIC-1.PV", 72.4);
        let ago = |seconds| now() - SignedDuration::from_secs(seconds);
        plant.alarms = vec![
            ActiveAlarm { id: AlarmId(0), state: AlarmState::Unacknowledged, raised_at: ago(41), returned_at: None, value: Some(72.1) },
            ActiveAlarm { id: AlarmId(3), state: AlarmState::Acknowledged, raised_at: ago(269), returned_at: None, value: None },
            ActiveAlarm { id: AlarmId(2), state: AlarmState::Returned, raised_at: ago(2_540), returned_at: Some(ago(2_400)), value: Some(3.9) },
        ];
        plant
    }

    /// The port has gone: the controller's values are old, the PLC's are gone.
    pub fn line_down() -> Fixture {
        let mut plant = Fixture::normal();
        let retry_at = now() + SignedDuration::from_secs(4);
        plant.line.state = LineState::Waiting { why: "No such file or directory".to_owned(), retry_at };
        let at = now() - SignedDuration::from_secs(12);
        for (tag, sample) in plant.def.tags.iter().zip(&mut plant.samples) {
            sample.at = at;
            *sample = if tag.device == DeviceId(0) { sample.doubted(Cause::NotConnected) } else { Sample::bad(Cause::NotConnected, at) };
        }
        for device in &mut plant.devices {
            device.state = DeviceState::Down { since: at };
            device.last_fault = Some((at, Fault::NotConnected));
        }
        plant.alarms = vec![ActiveAlarm { id: AlarmId(3), state: AlarmState::Unacknowledged, raised_at: at, returned_at: None, value: None }];
        plant
    }

    /// The id of a tag of the fixture.
    pub fn tag(&self, name: &str) -> TagId {
        self.def.tag_named(name).unwrap_or_else(|| panic!("the fixture has no tag {name}"))
    }
    /// Gives a tag a good value.
    pub fn set(&mut self, name: &str, value: f64) {
        let tag = self.tag(name);
        self.samples[tag.index()] = Sample::good(value, now() - SignedDuration::from_millis(400));
    }
    /// The snapshot.
    pub fn snapshot(&self) -> Arc<Snapshot> {
        let decimals = self.def.tags.iter().map(|tag| match tag.decimals {
            Decimals::Fixed(n) => n,
            Decimals::From(_) => 1,
        });
        Arc::new(Snapshot {
            at: now(),
            samples: self.samples.clone(),
            decimals: decimals.collect(),
            lines: vec![self.line.clone()],
            devices: self.devices.clone(),
            alarms: self.alarms.clone(),
            orders: Vec::new(),
            history: HistoryStatus { rows: 5_000, committed_at: Some(now()), ..HistoryStatus::default() },
            speed: 1.0,
            def: Arc::new(self.def.clone()),
        })
    }
}

/// Calls with a context over this snapshot, at 80x24 in full looks.
pub fn with_cx<T>(snapshot: &Snapshot, call: impl FnOnce(&Cx) -> T) -> T {
    let area = ratatui::layout::Rect::new(0, 4, 80, 18);
    call(&Cx { snapshot, theme: &Theme::FULL, now: snapshot.at, phase: 0, area })
}

fn start(tag: &str) -> f64 {
    match tag {
        "TIC-1.PV" => 64.2,
        "TIC-1.SV" => 70.0,
        "TIC-1.MV" => 42.0,
        "TIC-1.P" => 5.0,
        "TIC-1.I" => 240.0,
        "TIC-1.D" => 60.0,
        "PLC-1.LT-1" => 22.1,
        "PLC-1.TK-2" => 4.6,
        "PLC-1.TK-3" => 3.2,
        "PLC-1.FLOW" => 0.8,
        "PLC-1.POWER" => 672.0,
        "PLC-1.STEP" => 2.0,
        "PLC-1.LEFT" => 192.0,
        "PLC-1.M-1" | "PLC-1.SV-1" | "PLC-1.RUN" | "PLC-1.AUTO" => 1.0,
        _ => 0.0,
    }
}

struct Row(&'static str, &'static str, &'static str, (f64, f64), u8, Access, &'static [(i64, &'static str)], &'static str);

fn plant() -> PlantDef {
    use Access::{Read, ReadWrite};
    const NONE: &[(i64, &str)] = &[];
    const RUN: &[(i64, &str)] = &[(0, "STOP"), (1, "RUN")];
    const OPEN: &[(i64, &str)] = &[(0, "SHUT"), (1, "OPEN")];
    let tic = [
        Row("PV", "process value", "°C", (0.0, 120.0), 1, Read, NONE, "Operation"),
        Row("SV", "set value", "°C", (0.0, 120.0), 1, ReadWrite, NONE, "Operation"),
        Row("MV", "output", "%", (0.0, 100.0), 1, Read, NONE, "Operation"),
        Row("RUN", "run / standby", "", (0.0, 1.0), 0, ReadWrite, &[(0, "RUN"), (1, "STANDBY")], "Operation"),
        Row("AT", "auto-tuning", "", (0.0, 2.0), 0, ReadWrite, &[(0, "off"), (1, "normal"), (2, "low PV")], "Operation"),
        Row("P", "proportional", "%", (0.0, 999.9), 1, ReadWrite, NONE, "PID"),
        Row("I", "integral", "s", (0.0, 3200.0), 0, ReadWrite, NONE, "PID"),
        Row("D", "derivative", "s", (0.0, 999.9), 1, ReadWrite, NONE, "PID"),
        Row("CTRL", "control method", "", (0.0, 2.0), 0, ReadWrite, &[(0, "PID"), (1, "FUZZY"), (2, "SELF")], "PID"),
        Row("FIX", "save settings", "", (0.0, 1.0), 0, Access::Write, NONE, "Setup"),
    ];
    let plc = [
        Row("LT-1", "TK-1 level", "cm", (0.0, 30.0), 1, Read, NONE, "Process"),
        Row("TK-2", "TK-2 volume", "l", (0.0, 20.0), 1, Read, NONE, "Process"),
        Row("TK-3", "TK-3 volume", "l", (0.0, 20.0), 1, Read, NONE, "Process"),
        Row("FLOW", "flow out of TK-1", "l/min", (0.0, 5.0), 1, Read, NONE, "Process"),
        Row("POWER", "heater power", "W", (0.0, 1600.0), 0, Read, NONE, "Process"),
        Row("P-1", "pump", "", (0.0, 1.0), 0, Read, RUN, "Outputs"),
        Row("M-1", "agitator", "", (0.0, 1.0), 0, Read, RUN, "Outputs"),
        Row("SV-1", "valve TK-1 to TK-3", "", (0.0, 1.0), 0, Read, OPEN, "Outputs"),
        Row("SV-2", "valve TK-2 to TK-1", "", (0.0, 1.0), 0, Read, OPEN, "Outputs"),
        Row("STEP", "sequence step", "", (0.0, 6.0), 0, Read, &[(0, "IDLE"), (1, "FILL"), (2, "HEAT"), (3, "HOLD"), (4, "DRAIN"), (5, "COOL"), (6, "RETURN")], "Sequence"),
        Row("LEFT", "seconds left in step", "s", (0.0, 9999.0), 0, Read, NONE, "Sequence"),
        Row("RUN", "sequence", "", (0.0, 1.0), 0, ReadWrite, RUN, "Sequence"),
        Row("AUTO", "mode", "", (0.0, 1.0), 0, ReadWrite, &[(0, "MANUAL"), (1, "AUTO")], "Sequence"),
    ];
    let rows = tic.into_iter().map(|row| (DeviceId(0), "TIC-1", row)).chain(plc.into_iter().map(|row| (DeviceId(1), "PLC-1", row)));
    let tags: Vec<TagDef> = rows.enumerate().map(|(n, (device, name, row))| tag(n as u16, device, name, row)).collect();
    let id = |name: &str| tags.iter().find(|tag| tag.name == name).map(|tag| tag.id).expect("a tag of the fixture");
    let faceplate = Faceplate {
        pv: id("TIC-1.PV"),
        sv: id("TIC-1.SV"),
        mv: Some(id("TIC-1.MV")),
        run: Some(id("TIC-1.RUN")),
        mode: Some(id("TIC-1.CTRL")),
        tune: Some(id("TIC-1.AT")),
    };
    let fix = ActionDef {
        name: "FIX".to_owned(),
        tag: id("TIC-1.FIX"),
        value: 1.0,
        settle: Duration::from_secs(5),
        confirm: "Save all settings to the controller's memory? It does not answer for 5 s.".to_owned(),
    };
    let alarms = vec![
        alarm(0, Subject::Tag(id("TIC-1.PV")), limit(Level::High, 72.0), Priority::High, "temperature high"),
        alarm(1, Subject::Tag(id("TIC-1.PV")), limit(Level::HighHigh, 90.0), Priority::Critical, "temperature very high"),
        alarm(2, Subject::Tag(id("PLC-1.LT-1")), limit(Level::Low, 4.0), Priority::Low, "level low"),
        alarm(3, Subject::Device(DeviceId(1)), Condition::NotAnswering, Priority::Medium, "not answering"),
    ];
    PlantDef {
        name: "tank".to_owned(),
        title: "Water tank".to_owned(),
        time_zone: TimeZone::fixed(jiff::tz::offset(7)),
        lines: vec![LineDef {
            id: LineId(0),
            name: "L1".to_owned(),
            transport: Transport::Rtu {
                port: "/dev/ttyUSB0".to_owned(),
                serial: Serial { baud: 9_600, data_bits: 8, parity: Parity::None, stop_bits: 1 },
            },
            timeout: Duration::from_millis(300),
            gap: Duration::ZERO,
        }],
        devices: vec![
            device(0, "TIC-1", "tank temperature", "FUJI PXR4", Some(faceplate), vec![fix]),
            device(1, "PLC-1", "sequence", "KOYO DL06", None, Vec::new()),
        ],
        mimic: mimic(&id),
        trends: vec![
            TrendGroup {
                name: "TIC-1".to_owned(),
                pens: vec![
                    Pen { tag: id("TIC-1.PV"), scale: Some((0.0, 100.0)) },
                    Pen { tag: id("TIC-1.SV"), scale: Some((0.0, 100.0)) },
                    Pen { tag: id("TIC-1.MV"), scale: Some((0.0, 100.0)) },
                ],
            },
            TrendGroup {
                name: "Levels".to_owned(),
                pens: vec![
                    Pen { tag: id("PLC-1.LT-1"), scale: None },
                    Pen { tag: id("PLC-1.TK-2"), scale: None },
                    Pen { tag: id("PLC-1.TK-3"), scale: None },
                ],
            },
        ],
        shifts: [("morning", 6), ("afternoon", 14), ("night", 22)]
            .map(|(name, hour)| ShiftDef { name: name.to_owned(), start: time(hour, 0, 0, 0) })
            .to_vec(),
        report: ReportDef {
            folder: "reports".into(),
            tags: Vec::new(),
            record: Some((DeviceId(0), Duration::from_secs(60))),
            csv: CsvDialect::default(),
        },
        simulation: Some("tank".to_owned()),
        alarms,
        tags,
    }
}

fn tag(n: u16, device: DeviceId, of: &str, Row(short, label, unit, (min, max), decimals, access, labels, group): Row) -> TagDef {
    TagDef {
        id: TagId(n),
        device,
        name: format!("{of}.{short}"),
        short: short.to_owned(),
        label: label.to_owned(),
        meaning: if short == "I" { "0 = off".to_owned() } else { String::new() },
        point: Point { table: Table::Holding, address: 1_000 + n, kind: Kind::I16, order: Order::Abcd, field: None },
        scale: 1.0,
        offset: 0.0,
        decimals: Decimals::Fixed(decimals),
        unit: unit.to_owned(),
        unit_from: None,
        min: Some(Bound::Fixed(min)),
        max: Some(Bound::Fixed(max)),
        access,
        confirm: (short == "AT").then(|| "Auto-tuning swings the process around SV.".to_owned()),
        labels: labels.iter().map(|(number, text)| (*number, (*text).to_owned())).collect(),
        bit_labels: Vec::new(),
        bad_if: Vec::new(),
        quality_from: None,
        write_fc: None,
        write_unlock: None,
        group: group.to_owned(),
        poll: Poll::Every(Duration::from_secs(1)),
        deadband: 0.0,
        store: !unit.is_empty(),
        confidence: if short == "D" { Confidence::Medium } else { Confidence::High },
        source: "fixture".to_owned(),
    }
}

fn device(n: u16, name: &str, title: &str, model: &str, faceplate: Option<Faceplate>, actions: Vec<ActionDef>) -> DeviceDef {
    DeviceDef {
        id: DeviceId(n),
        name: name.to_owned(),
        title: title.to_owned(),
        line: LineId(0),
        unit: n as u8 + 1,
        profile: "fixture".to_owned(),
        model: model.to_owned(),
        limits: Limits { read_words_max: 60, read_bits_max: 2_000, write_words_max: 60, gap_words_max: 8, alignment: 1 },
        gap: Duration::ZERO,
        write_gap: Duration::ZERO,
        faceplate,
        actions,
    }
}

fn limit(level: Level, limit: f64) -> Condition {
    Condition::Limit { level, limit, deadband: 1.0 }
}

fn alarm(n: u16, subject: Subject, condition: Condition, priority: Priority, text: &str) -> AlarmDef {
    AlarmDef {
        id: AlarmId(n),
        subject,
        condition,
        priority,
        on_delay: Duration::from_secs(2),
        off_delay: Duration::from_secs(2),
        text: text.to_owned(),
        guidance: Guidance {
            cause: "SV changed while SV-1 is open; heater relay stuck".to_owned(),
            effect: "product out of specification above 75 °C".to_owned(),
            action: "lower SV or stop; check SSR lamp".to_owned(),
            respond: Some(Duration::from_secs(600)),
        },
    }
}

fn mimic(id: &impl Fn(&str) -> TagId) -> MimicDef {
    let place = |x, y, width, height| Place { x, y, width, height };
    let tank = |place, label: &str, level| MimicItem::Tank {
        place,
        label: label.to_owned(),
        level: Some(level),
        temperature: None,
        heater: None,
        agitator: None,
    };
    MimicDef {
        size: (80, 18),
        items: vec![
            tank(place(2, 0, 12, 6), "TK-2 cold", id("PLC-1.TK-2")),
            MimicItem::Tank {
                place: place(15, 6, 17, 8),
                label: "TK-1 control".to_owned(),
                level: Some(id("PLC-1.LT-1")),
                temperature: Some(id("TIC-1.PV")),
                heater: Some(id("PLC-1.POWER")),
                agitator: Some(id("PLC-1.M-1")),
            },
            tank(place(34, 13, 12, 5), "TK-3 hot", id("PLC-1.TK-3")),
            MimicItem::Pipe { points: vec![(14, 4), (20, 4), (20, 5)], flow: vec![id("PLC-1.SV-2")] },
            MimicItem::Valve { place: place(16, 4, 1, 1), label: "SV-2".to_owned(), tag: id("PLC-1.SV-2"), vertical: false },
            MimicItem::Pipe { points: vec![(32, 12), (40, 12), (40, 12)], flow: vec![id("PLC-1.SV-1")] },
            MimicItem::Valve { place: place(35, 12, 1, 1), label: "SV-1".to_owned(), tag: id("PLC-1.SV-1"), vertical: false },
            MimicItem::Pipe { points: vec![(33, 16), (4, 16), (4, 6)], flow: vec![id("PLC-1.P-1")] },
            MimicItem::Pump { place: place(18, 16, 12, 1), label: "P-1".to_owned(), tag: id("PLC-1.P-1") },
            MimicItem::Value { place: place(34, 8, 16, 1), label: "flow".to_owned(), tag: id("PLC-1.FLOW") },
            MimicItem::Sequence {
                place: place(53, 0, 26, 4),
                label: "sequence".to_owned(),
                step: id("PLC-1.STEP"),
                remaining: Some(id("PLC-1.LEFT")),
                states: vec![id("PLC-1.AUTO"), id("PLC-1.RUN")],
            },
            MimicItem::Controller { place: place(53, 6, 26, 6), device: DeviceId(0) },
            MimicItem::Text { place: place(34, 6, 16, 1), text: "to the drain".to_owned() },
            MimicItem::Trend { place: place(53, 13, 26, 4), tag: id("TIC-1.PV"), window: Duration::from_secs(3_600) },
        ],
        commands: vec![
            MimicCommand { key: 's', label: "set SV".to_owned(), tag: id("TIC-1.SV"), value: None },
            MimicCommand { key: 'r', label: "run/stop".to_owned(), tag: id("PLC-1.RUN"), value: None },
            MimicCommand { key: 'm', label: "auto/manual".to_owned(), tag: id("PLC-1.AUTO"), value: None },
        ],
    }
}
