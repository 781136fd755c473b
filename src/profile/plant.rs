//! A plant file and the profiles it names become one `PlantDef`. Pure: the texts come from outside.

use std::{rc::Rc, time::Duration};

use jiff::tz::TimeZone;

use super::{
    alarm, device,
    diagnostic::{Errors, Problems},
    names::{Defs, Names, Unique, check_name},
    picture, reader,
    reader::{At, Node, Raw, text},
    report,
    schema::{DeviceTable, PlantFile, ProfileFile, RtuTable, TcpTable},
    tag::{self, Surroundings},
};
use crate::plant::def::{DeviceDef, DeviceId, LineDef, LineId, MimicDef, PlantDef, Serial, TagId, Transport};

/// A text and the name the user knows it by.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Text {
    pub file: String,
    pub bytes: Vec<u8>,
}

/// Where device profiles come from.
pub(super) struct Library<'a> {
    /// The profile of a name: `Ok(None)` if there is none, `Err` with the reason if it cannot be read.
    pub find: &'a dyn Fn(&str) -> Result<Option<Text>, String>,
    /// The names of all profiles, for suggestions.
    pub names: Vec<String>,
}

/// Builds the plant called `name`, or tells everything that is wrong with its texts.
pub(super) fn build(name: &str, plant: &Text, library: &Library) -> Result<PlantDef, Errors> {
    let mut problems = Problems::default();
    let built = reader::parse(&plant.file, &plant.bytes, &mut problems).map(|raw| {
        let file = PlantFile::of(&[raw], &mut problems);
        assemble(name, &file, library, &mut problems)
    });
    match problems.finish(built)? {
        Some(plant) => Ok(plant),
        // A text that gave no plant always gave a problem; this keeps the promise without a panic.
        None => Err(Errors::unreadable(format!("{} is not a plant file", plant.file), String::new())),
    }
}

fn assemble(name: &str, file: &PlantFile, library: &Library, problems: &mut Problems) -> PlantDef {
    let lines = lines(&file.lines, problems);
    let (devices, tags, names) = devices(file, &lines, library, problems);
    let defs = Defs { names: &names, devices: &devices, tags: &tags };
    let alarms = alarm::alarms(&file.alarms, &defs, problems);
    let mimic = file.mimic.as_ref().map_or_else(MimicDef::default, |mimic| picture::mimic(&mimic.value, &defs, problems));
    let trends = picture::trends(&file.trends, &defs, problems);
    let shifts = report::shifts(&file.shifts, problems);
    let report = report::report(file.report.as_ref().map(|report| &report.value), &defs, problems);
    PlantDef {
        name: name.to_owned(),
        title: text(&file.title),
        time_zone: time_zone(&file.time_zone, problems),
        lines,
        alarms,
        mimic,
        trends,
        shifts,
        report,
        simulation: file.simulation.as_ref().map(|simulation| simulation.value.clone()),
        devices,
        tags,
    }
}

fn time_zone(name: &Option<At<String>>, problems: &mut Problems) -> TimeZone {
    let Some(name) = name else { return TimeZone::UTC };
    TimeZone::get(&name.value).unwrap_or_else(|_| {
        let known: Vec<String> = jiff::tz::db().available().map(|zone| zone.to_string()).collect();
        let problem = problems.add(name.at, format!("unknown time zone `{}`", name.value));
        problem.label("expected an IANA name such as Asia/Bangkok").suggest(&name.value, known.iter().map(String::as_str));
        TimeZone::UTC
    })
}

fn lines(tables: &[At<Raw>], problems: &mut Problems) -> Vec<LineDef> {
    let mut seen = Unique::default();
    let mut lines = Vec::new();
    for (index, table) in tables.iter().enumerate() {
        let id = LineId(index as u16);
        let raw = table.value.clone();
        let Some(mode) = mode(&raw, problems) else { continue };
        let (name, transport, timeout, gap) = if mode == "tcp" { tcp(raw, problems) } else { rtu(raw, problems) };
        let Some(name) = name else { continue };
        check_name(&name, "line", problems);
        seen.insert(&name.value, name.at, "line", problems);
        if let Some(short) = timeout.filter(|timeout| timeout.value < 10) {
            problems.add(short.at, "no device answers within so little time").label("expected at least 10 ms");
        }
        lines.push(LineDef {
            id,
            name: name.value,
            transport,
            timeout: Duration::from_millis(timeout.map_or(1_000, |timeout| u64::from(timeout.value))),
            gap: Duration::from_millis(gap.map_or(0, |gap| u64::from(gap.value))),
        });
    }
    lines
}

/// The mode decides which other keys a line has, so it is looked at first.
fn mode(raw: &Raw, problems: &mut Problems) -> Option<String> {
    let Some((_, value)) = raw.table.get("mode") else {
        problems.add(raw.at, "a line needs `mode`").label("missing here").help("mode = \"rtu\" or \"tcp\"");
        return None;
    };
    let mode = <String as reader::Value>::read(&value.value, value.at, problems)?;
    let at = value.at;
    if !matches!(mode.as_str(), "rtu" | "tcp") {
        let problem = problems.add(at, format!("unknown mode `{mode}`"));
        problem.label("expected \"rtu\" or \"tcp\"").suggest(&mode, ["rtu", "tcp"]);
        return None;
    }
    Some(mode)
}

type LineParts = (Option<At<String>>, Transport, Option<At<u16>>, Option<At<u16>>);

fn rtu(raw: Raw, problems: &mut Problems) -> LineParts {
    let table = RtuTable::of(&[raw], problems);
    if let Some(baud) = table.baud.filter(|baud| !BAUDS.contains(&baud.value)) {
        let problem = problems.add(baud.at, format!("{} is not a usual baud rate", baud.value));
        problem.label("expected 300, 600, 1200 … 9600, 19200, 38400, 57600, 115200 …");
    }
    if let Some(bits) = table.data_bits.filter(|bits| bits.value != 8) {
        problems.add(bits.at, "Modbus RTU sends 8 data bits").label("expected 8");
    }
    if let Some(bits) = table.stop_bits.filter(|bits| !matches!(bits.value, 1 | 2)) {
        problems.add(bits.at, format!("{} stop bits do not exist", bits.value)).label("expected 1 or 2");
    }
    let serial = Serial {
        baud: table.baud.map_or(9_600, |baud| baud.value),
        data_bits: 8,
        parity: table.parity.map_or(crate::plant::def::Parity::None, |parity| parity.value),
        stop_bits: table.stop_bits.map_or(1, |bits| bits.value),
    };
    let port = table.port.map(|port| port.value).unwrap_or_default();
    (table.name, Transport::Rtu { port, serial }, table.timeout_ms, table.gap_ms)
}

const BAUDS: &[u32] =
    &[300, 600, 1_200, 2_400, 4_800, 9_600, 19_200, 38_400, 57_600, 115_200, 230_400, 460_800, 921_600];

fn tcp(raw: Raw, problems: &mut Problems) -> LineParts {
    let table = TcpTable::of(&[raw], problems);
    let host = table.host.map(|host| host.value).unwrap_or_default();
    let port = table.tcp_port.map_or(502, |port| port.value);
    (table.name, Transport::Tcp { host, port }, table.timeout_ms, table.gap_ms)
}

fn devices(
    file: &PlantFile,
    lines: &[LineDef],
    library: &Library,
    problems: &mut Problems,
) -> (Vec<DeviceDef>, Vec<crate::plant::tag::TagDef>, Names) {
    let mut profiles = device::Profiles::new();
    let mut found = Vec::new();
    for table in file.devices.iter().map(|table| &table.value) {
        let profile = profile(&table.profile, library, &mut profiles, problems);
        found.extend(table.name.as_ref().zip(profile).map(|(name, profile)| (name.value.clone(), table, profile)));
    }
    check_devices(file, lines, problems);
    if found.is_empty() && file.devices.is_empty() {
        problems.add(file.at, "the plant has no device").label("expected a [[device]]");
    }
    // All names first, because tags refer to tags.
    let mut names = Names::default();
    let mut rows = Vec::new();
    for (index, (name, table, profile)) in found.iter().enumerate() {
        for row in device::rows(table, profile, problems) {
            if !row.short.is_empty() {
                names.insert(format!("{name}.{}", row.short), TagId(rows.len() as u16));
            }
            rows.push((DeviceId(index as u16), row));
        }
    }
    if rows.len() > TAGS_MAX {
        problems.add(file.at, format!("{} tags are too many", rows.len())).label(format!("at most {TAGS_MAX}"));
        return (Vec::new(), Vec::new(), names);
    }
    let mut rows = rows.into_iter().enumerate().peekable();
    let mut defined = Vec::new();
    let mut devices = Vec::new();
    for (index, (name, table, profile)) in found.iter().enumerate() {
        let id = DeviceId(index as u16);
        let (limits, gap, write_gap) = device::limits(table, profile, problems);
        let around = Surroundings {
            device: id,
            device_name: name,
            scheme: profile.scheme.map(|scheme| scheme.value).unwrap_or_default(),
            limits,
            fast: period(table.fast, 1, problems),
            slow: period(table.slow, 10, problems),
            names: &names,
        };
        let first = defined.len();
        while let Some((number, (_, row))) = rows.next_if(|(_, (device, _))| *device == id) {
            defined.push(tag::define(TagId(number as u16), row.layers, &around, problems));
        }
        device::check_overlaps(&defined[first..], problems);
        devices.push(DeviceDef {
            id,
            name: name.clone(),
            title: text(&table.title),
            line: line_of(table, lines).unwrap_or(LineId(0)),
            unit: table.unit.map_or(1, |unit| unit.value),
            profile: text(&table.profile),
            model: format!("{} {}", text(&profile.vendor), text(&profile.model)),
            limits,
            gap,
            write_gap,
            faceplate: None,
            actions: Vec::new(),
        });
    }
    let tags = device::link(defined, problems);
    for (device, (_, _, profile)) in devices.iter_mut().zip(&found) {
        let face = profile.faceplate.as_ref().map(|face| &face.value);
        device.faceplate = face.and_then(|face| device::faceplate(face, &device.name, &names, &tags, problems));
        device.actions = device::actions(&profile.actions, &device.name, &names, &tags, problems);
    }
    (devices, tags, names)
}

/// Most tags of a plant; an id has 16 bits, and a terminal plant is far from it.
const TAGS_MAX: usize = 20_000;

/// A poll period that a line can keep and an operator can wait for.
fn period(written: Option<At<Duration>>, default_s: u64, problems: &mut Problems) -> Duration {
    let Some(period) = written else { return Duration::from_secs(default_s) };
    if period.value < Duration::from_millis(50) || period.value > Duration::from_secs(86_400) {
        problems.add(period.at, "this is not a poll period").label("expected 50ms to 1 day");
    }
    period.value
}

fn line_of(table: &DeviceTable, lines: &[LineDef]) -> Option<LineId> {
    let name = table.line.as_ref()?;
    lines.iter().find(|line| line.name == name.value).map(|line| line.id)
}

/// Names, lines and units of all devices against each other.
fn check_devices(file: &PlantFile, lines: &[LineDef], problems: &mut Problems) {
    let mut seen = Unique::default();
    let mut units = Unique::default();
    let known_lines: Vec<String> = file.lines.iter().filter_map(|line| line_name(&line.value)).collect();
    for device in file.devices.iter().map(|device| &device.value) {
        if let Some(name) = &device.name {
            check_name(name, "device", problems);
            seen.insert(&name.value, name.at, "device", problems);
        }
        let Some(line) = &device.line else { continue };
        if !known_lines.contains(&line.value) {
            let problem = problems.add(line.at, format!("unknown line `{}`", line.value));
            problem.label("no such line").suggest(&line.value, known_lines.iter().map(String::as_str));
        }
        let (Some(unit), Some(id)) = (device.unit, line_of(device, lines)) else { continue };
        let Some(def) = lines.iter().find(|line| line.id == id) else { continue };
        if matches!(def.transport, Transport::Rtu { .. }) && !(1..=247).contains(&unit.value) {
            let problem = problems.add(unit.at, format!("unit {} cannot be used on a serial line", unit.value));
            problem.label("expected 1 to 247");
            if unit.value == 0 {
                problem.help("0 is the broadcast address: every device obeys and none answers");
            }
        }
        units.insert(&format!("{} on line {}", unit.value, line.value), unit.at, "unit", problems);
    }
}

/// The name of a line even if the rest of it is wrong, so that one mistake is reported once.
fn line_name(raw: &Raw) -> Option<String> {
    match &raw.table.get("name")?.1.value {
        Node::Text(name) => Some(name.clone()),
        _ => None,
    }
}

/// Finds and reads a profile, once.
fn profile(
    name: &Option<At<String>>,
    library: &Library,
    profiles: &mut device::Profiles,
    problems: &mut Problems,
) -> Option<Rc<ProfileFile>> {
    let name = name.as_ref()?;
    if let Some(known) = profiles.get(&name.value) {
        return known.clone();
    }
    let read = match (library.find)(&name.value) {
        Ok(Some(text)) => reader::parse(&text.file, &text.bytes, problems).map(|raw| {
            let file = ProfileFile::of(&[raw], problems);
            if let Some(base) = file.address_base.filter(|base| base.value != 0) {
                let problem = problems.add(base.at, "addresses are written as they are sent, from 0");
                problem.label("expected 0").help("`modicon` may be added to a tag and is checked against its address");
            }
            Rc::new(file)
        }),
        Ok(None) => {
            let problem = problems.add(name.at, format!("unknown profile `{}`", name.value));
            problem.label("no such profile").suggest(&name.value, library.names.iter().map(String::as_str));
            None
        }
        Err(why) => {
            problems.add(name.at, format!("profile `{}` cannot be read: {why}", name.value)).label("named here");
            None
        }
    };
    profiles.insert(name.value.clone(), read.clone());
    read
}
