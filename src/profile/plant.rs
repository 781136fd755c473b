//! A plant file and the profiles it names become one `PlantDef`. Pure: the texts come from outside.

use std::{collections::BTreeMap, rc::Rc};

use jiff::tz::TimeZone;
use sha2::{Digest, Sha256};

use super::{
    access,
    address::{check_base, warn_unclear},
    alarm,
    automatic_report::Rules,
    batch, calculated, device, device_alarms,
    device_line::check_lines,
    diagnostic::{Errors, Problems},
    history, interlock, line, lint, mimic,
    names::{Defs, Names, Scope, Unique, check_name},
    north, procedure, program, reader,
    reader::{At, OptionalKey, Raw, text},
    report, rows, run,
    schema::{AlarmTable, DeviceTable, PlantFile, ProfileFile},
    sets,
    signature::probes,
    size::{TAGS_MAX, is_of_size},
    tag::{self, DeviceContext},
    tag_keys::period,
    texts,
};
use crate::plant::{
    classification,
    def::{DeviceDef, DeviceId, LineDef, LineId, MimicDef, PlantDef, TagId},
    number::to_u16,
    record::hex,
    tag::{PollClass, TagDef},
};

/// A text and the name the user knows it by.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Text {
    pub file: String,
    pub bytes: Vec<u8>,
}

/// Where device profiles come from.
pub(super) struct Library<'a> {
    /// The profile of a name: `Ok(None)` if there is none, `Err` with the reason if it cannot be read.
    pub find: &'a dyn Fn(&str) -> Result<Option<Text>, String>,
    /// The names of all profiles, for suggestions.
    pub names: Vec<String>,
    /// Is there a program of this name, or at this path?
    pub is_program: &'a dyn Fn(&str) -> bool,
}

/// Builds the plant called `name`, with the warnings; or returns every error in its texts.
pub(super) fn build(name: &str, plant: &Text, library: &Library) -> Result<(PlantDef, Errors), Errors> {
    let mut problems = Problems::default();
    let raw = reader::parse(&plant.file, &plant.bytes, &mut problems);
    let built = raw.filter(|raw| is_of_size(raw, &mut problems)).and_then(|raw| {
        let file = PlantFile::of(&[raw], &mut problems);
        assemble(name, &file, library, &mut problems)
    });
    match problems.finish_warned(built)? {
        (Some(built), warnings) => {
            Ok((PlantDef { file_sha256: hex(&Sha256::digest(&plant.bytes)), ..built }, warnings))
        }
        // A text that gave no plant always gave a problem; this keeps the promise without a panic.
        (None, _) => Err(Errors::unreadable(format!("{} is not a plant file", plant.file), String::new())),
    }
}

fn assemble(name: &str, file: &PlantFile, library: &Library, problems: &mut Problems) -> Option<PlantDef> {
    let lines = line::lines(&file.lines, problems);
    line::warn_of_limits(&file.devices, &lines, problems);
    let Devices { devices, mut tags, names, classes, exprs, alarms, texts: device_texts } =
        devices(file, &lines, library, problems)?;
    calculated::calculate(
        exprs,
        &mut tags,
        Defs { names: &names, lines: &lines, devices: &devices, tags: &[] },
        problems,
    );
    let defs = Defs { names: &names, lines: &lines, devices: &devices, tags: &tags };
    let alarms = alarm::alarms(&file.alarms, &alarms, &defs, problems);
    lint::lint(&file.alarms, &tags, problems);
    let mimic = file.mimic.as_ref().map_or_else(MimicDef::default, |mimic| mimic::mimic(&mimic.value, &defs, problems));
    let access = access::access(file.access.as_ref().map(|table| &table.value), problems);
    let logic = interlock::logic(file, &defs, problems);
    let trends = mimic::trends(&file.trends, &defs, problems);
    let batches = batch::batches(&file.batches, &defs, problems);
    let runs = run::runs(&file.runs, &batches, &defs, problems);
    let procedures = procedure::procedures(&file.procedures, &runs, &defs, problems);
    let shifts = report::shifts(&file.shifts, problems);
    let rules = Rules { shifts: !shifts.is_empty(), is_program: library.is_program };
    let report = report::report(file.report.as_ref().map(|report| &report.value), &defs, &trends, &rules, problems);
    let history = history::history(file.history.as_ref().map(|history| &history.value), problems);
    let north = north::north(name, file.north.as_ref().map(|north| &north.value), &defs, problems);
    let tables = file.texts.iter().chain(&device_texts);
    let (texts, translated) = texts::texts(tables, problems);
    let classes = classification::classes(&tags, &alarms, &classes);
    tags.iter_mut().zip(classes).for_each(|(tag, class)| tag.class = class);
    let def = PlantDef {
        name: name.to_owned(),
        title: text(&file.title),
        time_zone: time_zone(&file.time_zone, problems),
        lines,
        alarm_rules: alarm::rules(file, problems),
        alarms,
        access,
        logic,
        mimic,
        trends,
        batches,
        runs,
        procedures,
        shifts,
        report,
        history,
        north,
        simulation: file.simulation.as_ref().map(|simulation| simulation.value.clone()),
        devices,
        tags,
        texts,
        file_sha256: String::new(),
    };
    texts::warn_unused(&def, &translated, problems);
    Some(def)
}

fn time_zone(name: &Option<At<String>>, problems: &mut Problems) -> TimeZone {
    let Some(name) = name else { return TimeZone::UTC };
    TimeZone::get(&name.value).unwrap_or_else(|_| {
        let known: Vec<String> = jiff::tz::db().available().map(|zone| zone.to_string()).collect();
        let problem = problems.add(name.at, format!("unknown time zone `{}`", name.value));
        problem
            .label("expected an IANA name such as Asia/Bangkok")
            .suggest(&name.value, known.iter().map(String::as_str));
        TimeZone::UTC
    })
}

/// A device whose name and profile are known.
struct ResolvedDevice<'a> {
    name: &'a str,
    table: &'a DeviceTable,
    profile: Rc<ProfileFile>,
}

/// All devices and their tags.
struct Devices {
    devices: Vec<DeviceDef>,
    tags: Vec<TagDef>,
    names: Names,
    /// The classes that are written, by tag.
    classes: Vec<Option<PollClass>>,
    /// What is calculated.
    exprs: calculated::Exprs,
    /// Those of their profiles.
    alarms: Vec<At<AlarmTable>>,
    /// The texts of their profiles in other languages.
    texts: Vec<At<Raw>>,
}

/// `None` where they have too many tags together.
fn devices(file: &PlantFile, lines: &[LineDef], library: &Library, problems: &mut Problems) -> Option<Devices> {
    check_devices(file, lines, problems);
    let mut names = Names::default();
    let known = known_devices(file, library, &mut names, problems);
    // All names come first, because tags refer to tags.
    let (mut count, mut rows) = (0, Vec::new());
    for device in &known {
        let of_device = rows::rows(device.table, &device.profile, problems);
        if TAGS_MAX < count + of_device.len() {
            let at = device.table.name.as_ref().map_or(file.at, |name| name.at);
            let message = format!("too many tags: {} has number {}", device.name, TAGS_MAX + 1);
            problems.add(at, message).label(format!("expected at most {TAGS_MAX} in all"));
            return None;
        }
        for row in &of_device {
            // A row without a name is reported when it is read.
            if !row.short.is_empty() {
                let name = problems.named(format!("{}.{}", device.name, row.short));
                names.tags.insert(name, TagId(to_u16(count)));
            }
            count += 1;
        }
        rows.push(of_device);
    }
    let (mut devices, mut defined) = (Vec::new(), Vec::new());
    for (device, rows) in known.iter().zip(rows) {
        let (mut def, context) = define_device(DeviceId(to_u16(devices.len())), device, lines, &names, problems);
        let first = defined.len();
        for row in rows {
            problems.of_row(row.repeat);
            defined.push(tag::define(TagId(to_u16(defined.len())), row.layers, &context, problems));
            problems.of_row(None);
        }
        device::check_overlaps(&defined[first..], problems);
        device::check_roles(&context.roles, &defined[first..], problems);
        def.functions = device::functions(&device.profile, &defined[first..], problems);
        devices.push(def);
    }
    let unclear = defined.iter().filter(|defined| defined.is_unclear);
    let unclear = unclear.filter_map(|one| Some((one.address_at?, one.tag.point.table, one.tag.point.address)));
    warn_unclear(unclear, problems);
    let classes = defined.iter().map(|defined| defined.class).collect();
    let exprs = calculated::Exprs::of(&defined);
    let written = defined.iter().map(|defined| defined.in_sets).collect::<Vec<_>>();
    let mut tags = device::link(defined, &names, problems);
    check_lines(&devices, known.iter().map(|known| known.table), lines, &tags, problems);
    let (mut stated, mut alarms) = (Vec::new(), Vec::new());
    for (def, device) in devices.iter_mut().zip(&known) {
        let scope = Scope { names: &names, tags: &tags, device: device.name };
        let face = device.profile.faceplate.as_ref().map(|face| &face.value);
        def.faceplate = face.and_then(|face| device::faceplate(face, &scope, problems));
        let mv = def.faceplate.as_ref().and_then(|face| face.mv);
        device::check_output(device.table.output.or(device.profile.output), mv, &tags, problems);
        def.actions = device::actions(&device.profile.actions, &scope, problems);
        let program = device.profile.program.as_ref().map(|program| &program.value);
        def.program = program.and_then(|table| program::program(table, &scope, problems));
        let signature = device.profile.signature.as_ref().map(|signature| &signature.value);
        def.signature = signature.map_or(Vec::new(), |table| probes(table, &scope, problems));
        let priorities = &device.table.alarm_priority;
        alarms.extend(device_alarms::of_device(&device.profile.alarms, priorities, &scope, problems));
        if let Some(table) = &device.table.stated {
            let listens = lines.get(def.line.index()).is_some_and(|line| line.listens);
            stated.extend(device::stated(&table.value, &scope, listens, problems));
        }
    }
    stated.into_iter().for_each(|(tag, value)| tags[tag.index()].stated = Some(value));
    sets::mark(&devices, &mut tags, &written, problems);
    Some(Devices { devices, tags, names, classes, exprs, alarms, texts: texts_of(&known) })
}

/// The texts of their profiles in other languages.
fn texts_of(known: &[ResolvedDevice]) -> Vec<At<Raw>> {
    known.iter().filter_map(|device| device.profile.texts.clone()).collect()
}

fn known_devices<'a>(
    file: &'a PlantFile,
    library: &Library,
    names: &mut Names,
    problems: &mut Problems,
) -> Vec<ResolvedDevice<'a>> {
    let mut profiles = Profiles::new();
    let mut known = Vec::new();
    if file.devices.is_empty() {
        problems.add(file.at, "the plant has no device").label("expected a [[device]]");
    }
    for table in file.devices.iter().map(|table| &table.value) {
        check_base(table.address_base, problems);
        let profile = match &table.profile {
            Some(_) => {
                device::check_inline_keys(table, problems);
                profile(&table.profile, library, &mut profiles, problems)
            }
            None => device::inline_profile(table, problems),
        };
        match (&table.name, profile) {
            (Some(name), Some(profile)) => known.push(ResolvedDevice { name: &name.value, table, profile }),
            (Some(name), None) => names.unread.push(name.value.clone()),
            (None, _) => {}
        }
    }
    known
}

/// The device without its faceplate and actions, which need the tags; and what its tags must know of it.
fn define_device<'a>(
    id: DeviceId,
    known: &'a ResolvedDevice,
    lines: &[LineDef],
    names: &'a Names,
    problems: &mut Problems,
) -> (DeviceDef, DeviceContext<'a>) {
    let ResolvedDevice { name, table, profile } = known;
    let (limits, timing) = device::limits(table, profile, problems);
    let def = DeviceDef {
        id,
        name: (*name).to_owned(),
        title: text(&table.title),
        line: line_of(table, lines).unwrap_or(LineId(0)),
        unit: table.unit.value_or(1),
        // A map of its own is that of this device alone.
        profile: table.profile.as_ref().map_or_else(|| (*name).to_owned(), |profile| profile.value.clone()),
        model: format!("{} {}", text(&profile.vendor), text(&profile.model)).trim().to_owned(),
        limits,
        functions: Vec::new(),
        exception_status: tag::named_bits(
            table.exception_status.as_ref().or(profile.exception_status.as_ref()),
            8,
            problems,
        ),
        output: table.output.or(profile.output).map(|output| output.value),
        gap: timing.gap,
        write_gap: timing.write_gap,
        response_time: timing.response_time,
        units_max: timing.units_max,
        faceplate: None,
        actions: Vec::new(),
        program: None,
        signature: Vec::new(),
    };
    let context = DeviceContext {
        device: id,
        device_name: name,
        scheme: profile.scheme.value_or(Default::default()),
        limits,
        has_default: profile.default.is_some(),
        has_base: table.address_base.or(profile.address_base).is_some(),
        fast: period(table.fast, 1, problems),
        slow: period(table.slow, 10, problems),
        names,
        roles: [&table.roles, &profile.roles].map(|roles| roles.as_ref().map(|roles| &roles.value)),
    };
    (def, context)
}

/// Most bytes of a plant file and its profiles together.
const BYTES_MAX: usize = 16 << 20;

fn line_of(table: &DeviceTable, lines: &[LineDef]) -> Option<LineId> {
    let name = table.line.as_ref()?;
    lines.iter().find(|line| line.name == name.value).map(|line| line.id)
}

/// Names, lines and units of all devices against each other.
fn check_devices(file: &PlantFile, lines: &[LineDef], problems: &mut Problems) {
    let mut seen = Unique::default();
    let mut units = Unique::default();
    let known_lines: Vec<String> = file.lines.iter().filter_map(|line| line::name_of(&line.value)).collect();
    for device in file.devices.iter().map(|device| &device.value) {
        if let Some(name) = &device.name {
            check_name(name, "device", problems);
            seen.insert(&name.value, name.at, format!("duplicate device `{}`", name.value), problems);
        }
        let Some(line) = &device.line else { continue };
        if !known_lines.contains(&line.value) {
            problems.unknown("line", line, known_lines.iter().map(String::as_str));
        }
        let (Some(unit), Some(id)) = (device.unit, line_of(device, lines)) else { continue };
        let Some(def) = lines.iter().find(|line| line.id == id) else { continue };
        // 0 is the broadcast address: allowed for what is only written, which is checked with the tags.
        if def.transport.serial().is_some() && !(0..=247).contains(&unit.value) {
            let problem = problems.warn(unit.at, format!("unit {} is reserved on serial lines", unit.value));
            problem.label("1 to 247 are for devices; a few use others all the same");
        }
        let place = format!("unit {} is used twice on line {}", unit.value, line.value);
        units.insert(&place, unit.at, place.as_str(), problems);
    }
}

/// The profiles of a plant by name, each read once; `None` if it could not be read.
type Profiles = BTreeMap<String, Option<Rc<ProfileFile>>>;

/// Finds and reads a profile, once.
fn profile(
    name: &Option<At<String>>,
    library: &Library,
    profiles: &mut Profiles,
    problems: &mut Problems,
) -> Option<Rc<ProfileFile>> {
    let name = name.as_ref()?;
    if let Some(known) = profiles.get(&name.value) {
        return known.clone();
    }
    let read = match (library.find)(&name.value) {
        Ok(Some(text)) if BYTES_MAX < problems.bytes() + text.bytes.len() => {
            let message = format!("with the profile `{}` there is too much to read", name.value);
            problems.add(name.at, message).label("expected at most 16 MiB in all files");
            None
        }
        Ok(Some(text)) => reader::parse(&text.file, &text.bytes, problems).map(|raw| {
            let file = ProfileFile::of(&[raw], problems);
            check_base(file.address_base, problems);
            Rc::new(file)
        }),
        Ok(None) => {
            let problem = problems.add(name.at, format!("unknown profile `{}`", name.value)).label("no such profile");
            let known = library.names.iter().map(String::as_str);
            problem.help("`sightglass profiles --search TEXT` finds one").suggest(&name.value, known);
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
