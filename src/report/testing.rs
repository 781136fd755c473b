//! A small plant for the tests of reports and history: one controller, three tags, three shifts.

use std::time::Duration;

use jiff::{Timestamp, civil::time, tz::TimeZone};

use super::{PeriodName, figures::Figures, step_series::StepSeries};
use crate::plant::{
    def::{CsvDialect, DeviceDef, DeviceId, Faceplate, Limits, LineId, MimicDef, PlantDef, ReportDef, ShiftDef, TagId},
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
            },
            functions: Vec::new(),
            gap: Duration::ZERO,
            write_gap: Duration::ZERO,
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
        shifts: shifts
            .iter()
            .map(|&(name, hour, minute)| ShiftDef { name: name.into(), start: time(hour, minute, 0, 0) })
            .collect(),
        history: Default::default(),
        report: ReportDef {
            folder: "reports".into(),
            tags: Vec::new(),
            record: Some((device, Duration::from_secs(10))),
            csv: CsvDialect::default(),
        },
        simulation: None,
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
    let (mut figures, mut steps) = (Figures::new(from, until), StepSeries::new(from, until));
    let held: Vec<_> = samples.filter_map(|sample| steps.next(sample)).collect();
    held.into_iter().chain(steps.end()).for_each(|held| figures.add(held.value, held.into(), 0.0));
    figures
}
