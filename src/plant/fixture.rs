//! A small plant for tests: one controller and one PLC on one line.

use std::{sync::Arc, time::Duration};

use jiff::tz::TimeZone;

use super::{
    def::{
        AlarmDef, AlarmId, Condition, DeviceDef, DeviceId, Level, Limits, LineDef, LineId, MimicDef, PlantDef,
        ReportDef, Serial, Subject, TagId, Transport,
    },
    exact::Exact,
    tag::{Access, Bound, ByteOrder, DataType, Decimals, Point, Table, TagDef},
};

/// Process value, decimals from [`DP`], bad while [`FAULT`] is not zero.
pub const PV: TagId = TagId(0);
/// Setpoint, writable between 0 and 100.
pub const SV: TagId = TagId(1);
/// Decimals of PV and SV.
pub const DP: TagId = TagId(2);
/// Input fault word.
pub const FAULT: TagId = TagId(3);
/// Run / stop coil of the PLC, an enumeration.
pub const RUN: TagId = TagId(4);
/// The controller.
pub const TIC: DeviceId = DeviceId(0);
/// The PLC.
pub const PLC: DeviceId = DeviceId(1);
/// PV high at 75, deadband 1, on-delay 2 s.
pub const HIGH: AlarmId = AlarmId(0);
/// The controller does not answer.
pub const SILENT: AlarmId = AlarmId(1);

/// The plant.
pub fn plant() -> PlantDef {
    let device = |id: DeviceId, name: &str, unit| DeviceDef {
        unit,
        profile: "fixture".into(),
        model: "FIXTURE".into(),
        limits: Limits {
            read_registers_max: 60,
            read_bits_max: 128,
            write_registers_max: 60,
            gap_registers_max: 8,
            ..Limits::STANDARD
        },
        ..DeviceDef::new(id, name, LineId(0))
    };
    let alarm = |id: AlarmId, subject, condition, on_delay| AlarmDef {
        on_delay,
        ..AlarmDef::new(id, subject, condition, format!("alarm {}", id.0))
    };
    PlantDef {
        access: Default::default(),
        name: "fixture".into(),
        title: "Fixture".into(),
        time_zone: TimeZone::UTC,
        lines: vec![LineDef {
            timeout: Duration::from_millis(300),
            ..LineDef::new(LineId(0), "L1", Transport::rtu("/dev/null", Serial::USUAL))
        }],
        devices: vec![device(TIC, "TIC-1", 1), device(PLC, "PLC-1", 2)],
        tags: vec![
            TagDef {
                decimals: Decimals::From(DP),
                quality_from: Some((FAULT, 0xFFFF)),
                ..tag(PV, "PV", Table::Input, 1000)
            },
            TagDef {
                decimals: Decimals::From(DP),
                access: Access::ReadWrite,
                min: Some(Bound::Fixed(0.0.into())),
                max: Some(Bound::Fixed(100.0.into())),
                ..tag(SV, "SV", Table::Holding, 1002)
            },
            tag(DP, "DP", Table::Holding, 1019),
            tag(FAULT, "FAULT", Table::Input, 1007),
            TagDef {
                device: PLC,
                name: "PLC-1.RUN".into(),
                access: Access::ReadWrite,
                enum_labels: vec![(0, "STOP".into()), (1, "RUN".into())],
                unit: String::new(),
                ..tag(RUN, "RUN", Table::Coil, 3072)
            },
        ],
        alarms: vec![
            alarm(
                HIGH,
                Subject::Tag(PV),
                Condition::Limit { level: Level::High, limit: 75.0, deadband: 1.0 },
                Duration::from_secs(2),
            ),
            alarm(SILENT, Subject::Device(TIC), Condition::NotResponding, Duration::ZERO),
        ],
        alarm_rules: Default::default(),
        logic: Default::default(),
        mimic: MimicDef::default(),
        trends: Vec::new(),
        batches: Vec::new(),
        runs: Vec::new(),
        procedures: Vec::new(),
        shifts: Vec::new(),
        history: Default::default(),
        north: Default::default(),
        texts: Default::default(),
        report: ReportDef::default(),
        simulation: None,
        file_sha256: String::new(),
    }
}

/// Raw numbers as a line reads them.
pub fn raw(values: impl IntoIterator<Item = (TagId, f64)>) -> Vec<(TagId, Exact)> {
    values.into_iter().map(|(tag, raw)| (tag, raw.into())).collect()
}

/// The same behind an [`Arc`].
pub fn shared() -> Arc<PlantDef> {
    Arc::new(plant())
}

fn tag(id: TagId, short: &str, table: Table, address: u16) -> TagDef {
    let kind = if table.is_bits() { DataType::Bool } else { DataType::I16 };
    let point = Point { table, address, kind, order: ByteOrder::Abcd, field: None };
    TagDef { unit: "°C".into(), ..TagDef::new(id, TIC, &format!("TIC-1.{short}"), point) }
}
