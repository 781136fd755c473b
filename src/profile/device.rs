//! A device of the plant: its profile, its limits, the rows of its tags, its faceplate and its actions.

use std::{rc::Rc, time::Duration};

use super::{
    diagnostic::{Problems, Span},
    names::{Names, Scope, check_number, held_number_of, number_of},
    reader::{At, OptionalKey, Raw, text},
    schema::{ActionTable, DeviceTable, FaceplateTable, LimitsTable, ProfileFile, Roles, Stated, TableLimitsTable},
    simulate::simulate,
    tag::{Defined, range_of},
    units,
};
use crate::plant::{
    def::{ActionDef, Faceplate, Limits, TableLimits, TagId},
    output::Output,
    tag::{Access, Bound, Point, Poll, Table, TagDef},
};

/// The keys of a device profile that stand in the plant file itself; `None` where there is no map at all.
pub(super) fn inline_profile(table: &DeviceTable, problems: &mut Problems) -> Option<Rc<ProfileFile>> {
    if table.tags.is_empty() && table.repeats.is_empty() {
        let at = table.name.as_ref().map_or(table.at, |name| name.at);
        problems
            .add(at, "a device needs `profile`, or tags of its own")
            .label("neither is here")
            .help("write the register map below it as [[device.tag]], or profile = \"NAME\" (`sightglass profiles`)");
        return None;
    }
    Some(Rc::new(ProfileFile {
        at: table.at,
        valid: table.valid,
        vendor: table.vendor.clone(),
        model: table.model.clone(),
        revision: None,
        status: None,
        source: table.source.clone(),
        notes: table.notes.clone(),
        address_base: None,
        scheme: table.scheme,
        functions: table.functions.clone(),
        // The limits of the device itself are read with it.
        limits: None,
        default: table.default.clone(),
        // These of the device itself are read with it.
        roles: None,
        exception_status: None,
        output: None,
        tags: Vec::new(),
        repeats: Vec::new(),
        alarms: Vec::new(),
        actions: table.actions.clone(),
        faceplate: table.faceplate.clone(),
        program: table.program.clone(),
        signature: table.signature.clone(),
        // A plant file has them for all of its devices.
        texts: None,
    }))
}

/// A register map stands in one place: what belongs to a profile is refused beside the name of one.
pub(super) fn check_inline_keys(table: &DeviceTable, problems: &mut Problems) {
    let Some(profile) = &table.profile else { return };
    for (key, at) in OF_PROFILE.into_iter().filter_map(|key| Some((key, table.span_of(key)?))) {
        problems
            .add(at, format!("`{key}` is written in the profile `{}`", profile.value))
            .label("expected in a device without `profile` only")
            .also(profile.at, "its profile");
    }
}

/// Keys of a `[[device]]` that has no profile.
const OF_PROFILE: [&str; 11] = [
    "vendor",
    "model",
    "source",
    "notes",
    "scheme",
    "functions",
    "default",
    "action",
    "faceplate",
    "program",
    "signature",
];

/// What a device needs of time and of its line.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Timing {
    /// See [`crate::plant::def::DeviceDef`].
    pub gap: Duration,
    pub write_gap: Duration,
    pub response_time: Option<Duration>,
    pub units_max: Option<u16>,
}

/// What the device and its profile say about requests, over the limits of the standard.
pub(super) fn limits(device: &DeviceTable, profile: &ProfileFile, problems: &mut Problems) -> (Limits, Timing) {
    let layers: Vec<Raw> =
        [&device.limits, &profile.limits].into_iter().flatten().map(|raw| raw.value.clone()).collect();
    let standard = Limits::STANDARD;
    if layers.is_empty() {
        return (standard, Timing::default());
    }
    let table = LimitsTable::of(&layers, problems);
    let mut within = |value, most, word| within(value, most, word, problems).unwrap_or(most);
    let limits = Limits {
        read_registers_max: within(table.read_registers_max, standard.read_registers_max, "read_registers_max"),
        read_bits_max: within(table.read_bits_max, standard.read_bits_max, "read_bits_max"),
        write_registers_max: within(table.write_registers_max, standard.write_registers_max, "write_registers_max"),
        gap_registers_max: table.gap_registers_max.value_or(8),
        alignment: alignment(table.alignment, false, problems).unwrap_or(1),
        in_flight_max: table.in_flight_max.value_or(1),
        of_tables: of_tables(&table, problems),
    };
    if let Some(count) = table.in_flight_max.filter(|count| !(1..=64).contains(&count.value)) {
        problems.add(count.at, format!("in_flight_max = {} is not possible", count.value)).label("expected 1 to 64");
    }
    if let Some(time) = table.response_time_ms.filter(|time| !(1..=10_000).contains(&time.value)) {
        let problem = problems.add(time.at, format!("response_time_ms = {} is not possible", time.value));
        problem.label("expected 1 to 10000");
    }
    if let Some(count) = table.units_max.filter(|count| !(1..=247).contains(&count.value)) {
        problems.add(count.at, format!("units_max = {} is not possible", count.value)).label("expected 1 to 247");
    }
    let millis = |value: Option<At<u16>>| value.map(|value| Duration::from_millis(u64::from(value.value)));
    let timing = Timing {
        gap: millis(table.request_gap_ms).unwrap_or_default(),
        write_gap: millis(table.write_gap_ms).unwrap_or_default(),
        response_time: millis(table.response_time_ms),
        units_max: table.units_max.map(|count| count.value),
    };
    (limits, timing)
}

/// What its tables have of their own.
fn of_tables(limits: &LimitsTable, problems: &mut Problems) -> [TableLimits; 4] {
    let written = [&limits.coil, &limits.discrete, &limits.input, &limits.holding];
    let tables = [Table::Coil, Table::Discrete, Table::Input, Table::Holding];
    let mut of_tables = [TableLimits::default(); 4];
    for (table, raw) in tables.into_iter().zip(written) {
        let Some(raw) = raw else { continue };
        let own = TableLimitsTable::of(std::slice::from_ref(&raw.value), problems);
        let read_max = within(own.read_max, Limits::STANDARD.most(table), "read_max", problems);
        let gap_max = own.gap_max.map(|gap| gap.value);
        let alignment = alignment(own.alignment, table.is_bits(), problems);
        of_tables[table as usize] = TableLimits { read_max, gap_max, alignment };
    }
    of_tables
}

/// A limit that the standard allows.
fn within(value: Option<At<u16>>, most: u16, word: &str, problems: &mut Problems) -> Option<u16> {
    let value = value?;
    let is_possible = (1..=most).contains(&value.value);
    if !is_possible {
        let problem = problems.add(value.at, format!("{word} = {} is not possible", value.value));
        problem.label(format!("the Modbus standard allows 1 to {most}"));
    }
    is_possible.then_some(value.value)
}

fn alignment(value: Option<At<u16>>, of_bits: bool, problems: &mut Problems) -> Option<u16> {
    let alignment = value?;
    let (most, expected) = if of_bits { (16, "1, 2, 4, 8 or 16") } else { (4, "1, 2 or 4") };
    if !alignment.value.is_power_of_two() || most < alignment.value {
        let problem = problems.add(alignment.at, format!("alignment = {} is not known", alignment.value));
        problem.label(format!("expected {expected}"));
    }
    Some(alignment.value)
}

/// The function codes that the profile lists, against those that its tags need.
pub(super) fn functions(profile: &ProfileFile, tags: &[Defined], problems: &mut Problems) -> Vec<u8> {
    let listed: Vec<u8> = profile.functions.iter().map(|function| function.value).collect();
    for (tag, at) in tags.iter().filter(|_| !listed.is_empty()).filter_map(|d| Some((&d.tag, d.address_at?))) {
        let read = (tag.access != Access::Write).then(|| tag.point.table.read_fc());
        for function in read.into_iter().chain(tag.write_function()).filter(|needed| !listed.contains(needed)) {
            let problem = problems.add(at, format!("{} needs function {function}, which `functions` lacks", tag.name));
            problem.label(format!("the device knows {listed:?}"));
        }
    }
    listed
}

/// Reports tags of one device that see the same registers with different eyes.
/// The same place with the same type is fine, and so are fields of one word.
pub(super) fn check_overlaps(tags: &[Defined], problems: &mut Problems) {
    let mut placed: Vec<(&TagDef, Span)> = tags.iter().filter_map(|d| Some((&d.tag, d.address_at?))).collect();
    placed.sort_by_key(|(tag, _)| (tag.point.table, tag.point.address));
    for (index, (tag, at)) in placed.iter().enumerate() {
        let end = u32::from(tag.point.address) + u32::from(tag.point.len());
        let neighbours = placed[index + 1..]
            .iter()
            .take_while(|(next, _)| next.point.table == tag.point.table && u32::from(next.point.address) < end);
        for (next, next_at) in neighbours {
            let (a, b) = (tag.point, next.point);
            let same = a.address == b.address && (a.kind, a.order) == (b.kind, b.order);
            let fields = a.len() == 1 && b.len() == 1 && (a.part().is_some() || b.part().is_some());
            if same || fields {
                continue;
            }
            // The later of the two lines is the one that is probably wrong.
            let (late, early) = if next_at > at { (next_at, at) } else { (at, next_at) };
            let (later, earlier) = if next_at > at { (next, tag) } else { (tag, next) };
            problems
                .add(*late, format!("{} and {} overlap with different types", earlier.name, later.name))
                .label(extent(later.point))
                .also(*early, format!("{} begins at {}", earlier.name, earlier.point.address));
        }
    }
}

/// A role for a group that no tag is in protects nothing.
pub(super) fn check_roles(roles: &[Option<&Roles>], tags: &[Defined], problems: &mut Problems) {
    for (group, _) in roles.iter().flatten().flat_map(|roles| &roles.0) {
        if !tags.iter().any(|defined| defined.tag.group == group.value) {
            problems.unknown("group", group, tags.iter().map(|defined| defined.tag.group.as_str()));
        }
    }
}

/// `holding 1004 to 1005`.
fn extent(point: Point) -> String {
    let (word, first) = (point.table.word(), point.address);
    match point.len() {
        1 => format!("{word} {first}"),
        length => format!("{word} {first} to {}", first + length - 1),
    }
}

/// Finishes what needs other tags: names of units, unlock values, and that a needed tag is read at all.
pub(super) fn link(defined: Vec<Defined>, names: &Names, problems: &mut Problems) -> Vec<TagDef> {
    let all: Vec<TagDef> = defined.iter().map(|defined| defined.tag.clone()).collect();
    let finish = |defined: Defined| {
        let mut tag = defined.tag;
        for (need, what) in &defined.needs {
            let target = &all[need.value.index()];
            // Any text can be a unit, but where none is known they are states of something else.
            let known = target.enum_labels.iter().find(|(_, unit)| units::is_known(unit));
            if *what == "unit_from" && known.is_none() {
                let first = target.enum_labels.first();
                let found = first.map_or("it has no `enum`".to_owned(), |(_, unit)| format!("`{unit}` is not a unit"));
                problems.add(need.at, format!("{} gives no unit: {found}", target.name)).label("unit_from");
            }
            if *what == "decimals_from" && may_be_exponent(target) {
                let message =
                    format!("{} may hold a power of ten: it has a sign, a number of decimals has none", target.name);
                let problem = problems.add(need.at, message);
                problem.label("1 would be read as one decimal, and a power of ten of 1 is ten times as much");
                problem
                    .help("write scale_from instead if it holds a power of ten (SunSpec), or give it min = 0 if it counts decimals");
            }
            if target.is_text() {
                check_number(need.at, target, problems);
            } else if target.id == tag.id {
                problems.add(need.at, format!("{} needs itself", tag.name)).label("expected another tag");
            } else if tag.poll != Poll::Never && (target.poll == Poll::Never || target.access == Access::Write) {
                let problem =
                    problems.add(need.at, format!("{} is never read, so {} can never be shown", target.name, tag.name));
                problem
                    .label(*what)
                    .help(format!("give {} poll = \"slow\" and access = \"r\" or \"rw\"", target.short));
            }
        }
        if let Some((target, units)) = &mut tag.unit_from {
            let labels = all[target.index()].enum_labels.iter();
            *units = labels.map(|(number, unit)| (*number, units::of(unit))).collect();
            // Until the device was asked, the first of its units stands in columns and headings.
            let first = units.first().map(|(_, unit)| unit.clone()).unwrap_or_default();
            tag.unit = Some(tag.unit).filter(|unit| !unit.is_empty()).unwrap_or(first);
        }
        if let Some((target, choice)) = &defined.unlock {
            let value = number_of(choice, &all[target.index()], problems);
            tag.write_unlock = value.map(|value| (*target, value));
        }
        if let Some(table) = &defined.simulate {
            // A name of a device has no dot.
            let device = tag.name.split_once('.').map_or("", |(device, _)| device);
            tag.simulate = simulate(table, &tag, &Scope { names, tags: &all, device }, problems);
        }
        tag
    };
    let mut tags: Vec<TagDef> = defined.into_iter().map(finish).collect();
    read_powers_with_values(&mut tags);
    tags
}

/// A power of ten is read as often as the fastest of the values that it scales: only then are both of one cycle.
fn read_powers_with_values(tags: &mut [TagDef]) {
    let scaled: Vec<(TagId, Poll)> =
        tags.iter().filter_map(|tag| Some((tag.decimals.power_source()?, tag.poll))).collect();
    for (source, poll) in scaled {
        let source = &mut tags[source.index()];
        source.poll = source.poll.min(poll);
    }
}

/// Can it be below 0? Decimals never are, a power of ten that makes decimals always is.
fn may_be_exponent(tag: &TagDef) -> bool {
    let is_signed = range_of(tag).is_some_and(|(low, _)| low.near() < 0.0);
    let is_bounded = matches!(tag.min, Some(Bound::Fixed(min)) if 0.0 <= min.near());
    let is_counted = !tag.enum_labels.is_empty() && tag.enum_labels.iter().all(|(number, _)| 0 <= *number);
    is_signed && 0.0 < tag.scale && !is_bounded && !is_counted
}

/// The tags that the controller is operated by.
pub(super) fn faceplate(table: &FaceplateTable, scope: &Scope, problems: &mut Problems) -> Option<Faceplate> {
    let mut find = |name: &Option<At<String>>| {
        let name = name.as_ref()?;
        let tag = scope.tag(name, problems)?;
        check_number(name.at, tag, problems);
        Some(tag.id)
    };
    let (pv, sv_used, mv) = (find(&table.pv), find(&table.sv_used), find(&table.mv));
    let (run, mode, tune) = (find(&table.run), find(&table.mode), find(&table.tune));
    let sv = find(&table.sv).and_then(|_| scope.writable(&table.sv, problems));
    let tunes = table.tunes.iter().filter_map(|name| Some(scope.tag(name, problems)?.id)).collect();
    Some(Faceplate { pv: pv?, sv: sv?.id, sv_used, mv, run, mode, tune, tunes })
}

/// What an output is at its terminals is calculated from percent.
pub(super) fn check_output(output: Option<At<Output>>, mv: Option<TagId>, tags: &[TagDef], problems: &mut Problems) {
    let Some(output) = output else { return };
    let found = match mv.map(|mv| &tags[mv.index()]) {
        None => "this device has no `mv`".to_owned(),
        Some(mv) if mv.unit != "%" || mv.unit_from.is_some() => format!("{} has the unit `{}`", mv.name, mv.unit),
        Some(_) => return,
    };
    problems.add(output.at, found).label("expected a faceplate whose `mv` is in %");
}

/// What the plant file states of registers that are never heard: by nothing else may it be known how values are scaled.
pub(super) fn stated(stated: &Stated, scope: &Scope, listens: bool, problems: &mut Problems) -> Vec<(TagId, f64)> {
    let mut found = Vec::new();
    for (name, choice) in &stated.0 {
        let Some(tag) = scope.tag(name, problems) else { continue };
        let is_unit = |other: &TagDef| other.unit_from.as_ref().is_some_and(|(from, _)| *from == tag.id);
        let scales = scope.tags.iter().any(|other| other.decimals.source() == Some(tag.id));
        if !listens {
            let problem = problems.add(name.at, format!("{} is read from the device", tag.name));
            problem.label("`stated` is for devices of a line that only listens");
        } else if !scales && !scope.tags.iter().any(is_unit) {
            let problem = problems.add(name.at, format!("no value is scaled by {}", tag.name));
            problem.label("expected a tag that is named in `decimals_from`, `scale_from` or `unit_from`");
        } else if let Some(value) = number_of(choice, tag, problems) {
            let scaled = scope.tags.iter().map(|other| other.decimals);
            let mut unusable =
                scaled.filter(|decimals| decimals.source() == Some(tag.id) && decimals.announced(value).is_none());
            if let Some(decimals) = unusable.next() {
                let is_power = decimals.power_source().is_some();
                let what = if is_power { "power of ten" } else { "number of decimals" };
                let problem = problems.add(choice.at, format!("{value} is not a {what}"));
                let (least, most) = decimals.possible();
                problem.label(format!("expected {least} to {most}"));
            }
            found.push((tag.id, value));
        }
    }
    found
}

/// The actions of a device.
pub(super) fn actions(tables: &[At<ActionTable>], scope: &Scope, problems: &mut Problems) -> Vec<ActionDef> {
    let mut found = Vec::new();
    for action in tables.iter().map(|table| &table.value) {
        let (Some(name), Some(_), Some(choice)) = (&action.name, &action.tag, &action.value) else { continue };
        let Some(target) = scope.writable(&action.tag, problems) else { continue };
        let Some(value) = held_number_of(choice, target, problems) else { continue };
        found.push(ActionDef {
            name: name.value.clone(),
            tag: target.id,
            value,
            settle: Duration::from_millis(action.settle_ms.map_or(0, |ms| u64::from(ms.value))),
            confirm: text(&action.confirm),
            stop: action.stop.value_or(false),
            saves: action.saves.value_or(false),
            role: action.role.map(|role| role.value.0),
        });
    }
    found
}
