//! A small plant for the tests of reports and history: one controller, three tags, three shifts.

use std::time::Duration;

use jiff::{Timestamp, civil::time, tz::TimeZone};

use super::{
    Compared, Gap, Outage, Period, PeriodName, RecordRow, RunFigures, ShiftReport, SuppressedSummary, TagFigures,
    alarm_metrics,
    chart::{Chart, ChartCurve},
    counters::CounterRow,
    curve::Bucket,
    figures::Figures,
    step_series::{HoldInterval, StepSeries},
};
use crate::plant::{
    counter::{Counter, CounterEvent, CounterRule, CounterStep, Reading},
    def::{DeviceDef, DeviceId, Faceplate, Limits, LineId, MimicDef, PlantDef, Priority, ReportDef, ShiftDef, TagId},
    exact::Exact,
    record::{ActionRecord, AlarmEvent, AlarmRecord, ChainHash},
    sample::Sample,
    tag::{ByteOrder, DataType, Decimals, Point, Table, TagDef},
};

/// Seconds after the epoch as an instant.
pub fn sec(at: i64) -> Timestamp {
    Timestamp::from_second(at).expect("tests stay within the calendar")
}

/// An instant from its text.
pub fn at(text: &str) -> Timestamp {
    text.parse().expect("tests write valid times")
}

/// The name of a period from its text: `morning 2026-11-21`, `period`.
pub fn named(text: &str) -> PeriodName {
    let shift = |(name, date): (&str, &str)| PeriodName::Shift {
        name: name.into(),
        date: date.parse().expect("tests write valid dates"),
    };
    text.split_once(' ').map_or(PeriodName::Free, shift)
}

/// A time zone by name.
pub fn zone(name: &str) -> TimeZone {
    TimeZone::get(name).expect("tests run where time zones are installed")
}

/// The plant: TIC-1 with PV, SV and MV, in a zone, with shifts (name, hour, minute).
pub fn plant(zone_name: &str, shifts: &[(&str, i8, i8)]) -> PlantDef {
    let device = DeviceId(0);
    PlantDef {
        access: Default::default(),
        name: "tank".into(),
        title: "Water tank".into(),
        time_zone: zone(zone_name),
        lines: Vec::new(),
        devices: vec![DeviceDef {
            id: device,
            name: "TIC-1".into(),
            title: "tank temperature".into(),
            line: LineId(0),
            unit: 1,
            profile: "fuji_pxr".into(),
            model: "FUJI PXR4".into(),
            limits: Limits {
                read_registers_max: 60,
                read_bits_max: 60,
                write_registers_max: 60,
                gap_registers_max: 4,
                alignment: 1,
                in_flight_max: 1,
                ..Limits::STANDARD
            },
            functions: Vec::new(),
            exception_status: Vec::new(),
            output: None,
            gap: Duration::ZERO,
            write_gap: Duration::ZERO,
            response_time: None,
            units_max: None,
            faceplate: Some(Faceplate {
                pv: TagId(0),
                sv: TagId(1),
                mv: Some(TagId(2)),
                run: None,
                mode: None,
                tune: None,
                sv_used: None,
                tunes: Vec::new(),
            }),
            actions: Vec::new(),
            program: None,
            signature: Vec::new(),
        }],
        tags: ["PV", "SV", "MV"].iter().enumerate().map(|(i, short)| tag(i as u16, short)).collect(),
        alarms: Vec::new(),
        alarm_rules: Default::default(),
        logic: Default::default(),
        mimic: MimicDef::default(),
        trends: Vec::new(),
        batches: Vec::new(),
        runs: Vec::new(),
        procedures: Vec::new(),
        shifts: shifts
            .iter()
            .map(|&(name, hour, minute)| ShiftDef { name: name.into(), start: time(hour, minute, 0, 0) })
            .collect(),
        history: Default::default(),
        north: Default::default(),
        texts: Default::default(),
        report: ReportDef { record: Some((device, Duration::from_secs(10))), ..ReportDef::default() },
        simulation: None,
        file_sha256: String::new(),
    }
}

/// Shifts at 06:00, 14:00 and 22:00.
pub const THREE: [(&str, i8, i8); 3] = [("morning", 6, 0), ("afternoon", 14, 0), ("night", 22, 0)];

/// A stored tag of TIC-1 with one decimal; MV in percent, the others in degrees.
pub fn tag(id: u16, short: &str) -> TagDef {
    let point = Point { table: Table::Input, address: id, kind: DataType::I16, order: ByteOrder::Abcd, field: None };
    let unit = if short == "MV" { "%" } else { "°C" };
    let name = format!("TIC-1.{short}");
    TagDef {
        scale: 0.1,
        decimals: Decimals::Fixed(1),
        unit: unit.into(),
        ..TagDef::new(TagId(id), DeviceId(0), &name, point)
    }
}

/// The figures of samples, which come in order of time.
pub fn figures_of(samples: impl Iterator<Item = Sample>, from: Timestamp, until: Timestamp) -> Figures {
    let (mut figures, mut steps) =
        (Figures::new(until.duration_since(from).as_secs_f64()), StepSeries::new(from, until));
    let held: Vec<_> = samples.filter_map(|sample| steps.next(sample)).collect();
    held.into_iter().chain(steps.end()).for_each(|held| figures.add(held.value, held.into()));
    figures
}

/// What a counter counted by samples, which come in order of time, and what was not plain counting.
pub fn counted_of(
    samples: impl Iterator<Item = Sample>,
    rule: CounterRule,
    (from, until): (Timestamp, Timestamp),
) -> (Exact, Vec<CounterStep>) {
    let (mut counter, mut gain, mut found) = (Counter::new(rule), Exact::default(), Vec::new());
    let mut steps = StepSeries::new(Timestamp::MIN, until);
    let held: Vec<_> = samples.filter_map(|sample| steps.next(sample)).collect();
    for HoldInterval { from: at, to, value } in held.into_iter().chain(steps.end()) {
        let counted = counter.read(Reading { value, at, until: to });
        if from <= at {
            gain = gain + counted.gain;
            found.extend(counted.step);
        }
    }
    (gain, found)
}

/// The report of a morning: figures with and without values, a counter, every list filled, names that are formulas.
pub fn shift_report() -> ShiftReport {
    let from = at("2026-11-21T06:00+07");
    ShiftReport {
        period: Period { name: named("morning 2026-11-21"), from, to: at("2026-11-21T14:00+07") },
        until: at("2026-11-21T13:59:30+07"),
        audit: Some(ChainHash { number: 17, hash: [0xA5; 32] }),
        unstored: Some(0),
        unreadable: vec![Gap {
            from: from + Duration::from_secs(3_600),
            to: from + Duration::from_secs(3_720),
            why: "checksum".into(),
        }],
        batches: Vec::new(),
        control_runs: Vec::new(),
        run_parts: Vec::new(),
        counters: vec![CounterRow {
            tag: "PM-1.E".into(),
            unit: "kWh".into(),
            decimals: 1,
            step: CounterStep {
                at: at("2026-11-21T09:30+07"),
                event: CounterEvent::Replaced,
                old: 50_000.5.into(),
                new: 300.0.into(),
                counted: 0.0.into(),
            },
            note: String::new(),
        }],
        compared: vec![Compared {
            period: Period {
                name: named("night 2026-11-20"),
                from: at("2026-11-20T22:00+07"),
                to: at("2026-11-21T06:00+07"),
            },
            tags: vec![TagFigures {
                tag: "TIC-1.PV".into(),
                unit: "°C".into(),
                decimals: 1,
                first: Some(20.0.into()),
                min: Some(20.0.into()),
                mean: Some(50.0.into()),
                max: Some(70.0.into()),
                last: Some(27.0.into()),
                difference: None,
                in_alarm: Duration::ZERO,
                good: 1.0,
            }],
        }],
        runs: vec![RunFigures {
            tag: "PLC-1.P-1".into(),
            on: Some(Duration::from_secs(5_400)),
            starts: Some(3.0),
            good: 0.875,
        }],
        outages: vec![Outage {
            from: at("2026-11-21T08:00+07"),
            to: at("2026-11-21T08:10+07"),
            what: Some("PLC-1".into()),
            why: "not responding".into(),
        }],
        coarse: Vec::new(),
        charts: vec![Chart {
            title: "TIC-1".into(),
            from,
            to: at("2026-11-21T13:59:30+07"),
            curves: vec![ChartCurve {
                name: "TIC-1.PV".into(),
                unit: "°C".into(),
                decimals: 1,
                from,
                step: 3_600.0,
                columns: [Some(27.0), Some(71.2), None, Some(70.0)].map(|value| value.map(bucket)).into(),
            }],
        }],
        tags: vec![
            TagFigures {
                tag: "TIC-1.PV".into(),
                unit: "°C".into(),
                decimals: 1,
                first: Some(27.0.into()),
                min: Some((-0.04).into()),
                mean: Some(54.3219.into()),
                max: Some(71.2.into()),
                last: Some(70.0.into()),
                difference: None,
                in_alarm: Duration::from_secs(90),
                good: 0.99999,
            },
            TagFigures {
                tag: "TIC-1.MV".into(),
                unit: "%".into(),
                decimals: 0,
                first: None,
                min: None,
                mean: None,
                max: None,
                last: None,
                difference: None,
                in_alarm: Duration::ZERO,
                good: 0.0,
            },
            TagFigures {
                tag: "PM-1.E".into(),
                unit: "kWh".into(),
                decimals: 2,
                first: Some(1250.0.into()),
                min: Some(1250.0.into()),
                mean: None,
                max: Some(1262.5.into()),
                last: Some(1262.5.into()),
                difference: Some(12.5.into()),
                in_alarm: Duration::ZERO,
                good: 1.0,
            },
        ],
        suppressed: vec![SuppressedSummary {
            subject: "PLC-1.LT-1".into(),
            message: "level low".into(),
            priority: Priority::Low,
            raised: 2,
            active: Duration::from_secs(486),
        }],
        alarms: vec![AlarmRecord {
            at: at("2026-11-21T06:12:45.5+07"),
            subject: "TIC-1.PV".into(),
            message: "temperature high; \"check\" heater".into(),
            priority: Priority::High,
            event: AlarmEvent::Raised,
            value: Some((-85.25).into()),
            limit: Some(85.0),
            by: None,
            reason: None,
            until: None,
            first_out: None,
            identity: None,
        }],
        alarm_metrics: alarm_metrics::tests::figures(),
        actions: vec![ActionRecord {
            at: at("2026-11-21T06:13+07"),
            by: "=cmd|' /C calc'!A0".into(),
            action: "write".into(),
            target: "TIC-1.SV".into(),
            old: Some("-70.0 °C".into()),
            new: Some("60.0 °C".into()),
            outcome: "verified".into(),
            from: "".into(),
            note: None,
            chain_hash: None,
        }],
        record: vec![
            RecordRow { at: from, sv: Some(70.0.into()), pv: Some(72.5.into()), er: Some((-2.5).into()) },
            RecordRow { at: from + Duration::from_secs(10), sv: Some(70.0.into()), pv: None, er: None },
        ],
        record_of: Some(("TIC-1".into(), "°C".into())),
    }
}

fn bucket(value: f64) -> Bucket {
    Bucket { min: value, max: value, mean: value, last: value.into() }
}
