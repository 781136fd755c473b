//! Interlocks, actuators and sequences: what the plant file says about commands.

use super::{
    diagnostic::Problems,
    names::{Defs, Unique, check_writable, held_number_of, number_of},
    reader::{At, OptionalKey, text},
    schema::{ActuatorTable, InterlockTable, NeedTable, PlantFile, SequenceTable},
};
use crate::plant::{
    interlock::{ActuatorDef, ControlLogic, InterlockCondition, InterlockDef, SequenceDef, stops},
    tag::{Access, Decimals, TagDef},
};

/// All that the plant file says about commands.
pub(super) fn logic(file: &PlantFile, defs: &Defs, problems: &mut Problems) -> ControlLogic {
    let mut seen = Unique::default();
    let actuators = file.actuators.iter().filter_map(|table| actuator(&table.value, &mut seen, defs, problems));
    let actuators: Vec<ActuatorDef> = actuators.collect();
    let sequences = file.sequences.iter().filter_map(|table| sequence(&table.value, defs, problems)).collect();
    let logic = ControlLogic { interlocks: Vec::new(), actuators, sequences };
    let interlocks = file.interlocks.iter().filter_map(|table| interlock(&table.value, &logic, defs, problems));
    ControlLogic { interlocks: interlocks.collect(), ..logic.clone() }
}

fn interlock(
    table: &InterlockTable,
    logic: &ControlLogic,
    defs: &Defs,
    problems: &mut Problems,
) -> Option<InterlockDef> {
    let tag = commanded(table.tag.as_ref()?, defs, problems)?;
    if let Some(name) = table.tag.as_ref().filter(|_| defs.listens_to(tag)) {
        let problem = problems.warn(name.at, format!("{} is on a line that only listens", tag.name));
        problem.label("another master polls it: this interlock never acts");
    }
    let of = defs.tag(table.of.as_ref()?, problems)?;
    let value = held_number_of(table.value.as_ref()?, tag, problems)?;
    let when = blocking(table, of, problems)?;
    let device = defs.devices.iter().find(|device| device.id == tag.device)?;
    let stops: Vec<f64> = stops(logic, &device.actions, tag.id).collect();
    // Where nothing says which value stops, 0 counts as the stop; another value may be it all the same, so it only warns.
    let off = stops.contains(&value) || (stops.is_empty() && value == 0.0);
    if let Some(refuse) = table.refuse.filter(|refuse| refuse.value && off) {
        let problem = problems.add(refuse.at, "switching off is never refused");
        problem.label("expected refuse = false").help("a stop must always be possible; the operator is still warned");
    }
    let refuse = table.refuse.value_or(!off && !stops.is_empty());
    Some(InterlockDef { tag: tag.id, value, of: of.id, when, message: text(&table.message), refuse })
}

/// Exactly one of the four conditions.
fn blocking(table: &InterlockTable, of: &TagDef, problems: &mut Problems) -> Option<InterlockCondition> {
    let mut found = Vec::new();
    found.extend(table.below.map(|limit| (limit.at, Some(InterlockCondition::Below(limit.value)))));
    found.extend(table.above.map(|limit| (limit.at, Some(InterlockCondition::Above(limit.value)))));
    found.extend(table.is.as_ref().map(|is| (is.at, number_of(is, of, problems).map(InterlockCondition::Is))));
    found.extend(table.bit.map(|bit| (bit.at, Some(InterlockCondition::Bit(bit.value)))));
    if let Some(bit) = table.bit {
        check_bit(bit, of, problems);
    }
    match found.as_slice() {
        [(_, one)] => *one,
        [] => {
            problems.add(table.at, "an interlock needs a condition").label("expected `below`, `above`, `is` or `bit`");
            None
        }
        [_, (second, _), ..] => {
            problems.add(*second, "an interlock has one condition").label("expected an [[interlock]] of its own");
            None
        }
    }
}

/// The bits that the value of a tag has; none where it is not the raw number, or no binary one.
fn bits_of(of: &TagDef) -> u16 {
    let is_raw = of.scale == 1.0 && of.offset == 0.0 && matches!(of.decimals, Decimals::Fixed(_));
    let is_binary = of.point.kind.is_binary() && !of.point.table.is_bits();
    match of.point.field {
        _ if !is_raw || !is_binary => 0,
        Some((_, bits)) => u16::from(bits),
        None => of.point.words() * 16,
    }
}

/// Reports a bit that the register of a tag does not have.
pub(super) fn check_bit(bit: At<u8>, tag: &TagDef, problems: &mut Problems) {
    let bits = bits_of(tag);
    if u16::from(bit.value) >= bits {
        let problem = problems.add(bit.at, format!("{} has no bit {}", tag.name, bit.value));
        problem.label(match bits {
            0 => "expected a tag of a whole binary number that is not scaled".to_owned(),
            bits => format!("expected 0 to {}", bits - 1),
        });
    }
}

fn actuator(table: &ActuatorTable, seen: &mut Unique, defs: &Defs, problems: &mut Problems) -> Option<ActuatorDef> {
    let (output, command) = (table.output.as_ref()?, table.command.as_ref()?);
    for name in [output, command] {
        let twice = format!("{} belongs to another actuator", name.value);
        seen.insert(&name.value, name.at, twice, problems);
    }
    let (output, command) = (defs.tag(output, problems)?, commanded(command, defs, problems)?);
    let off = table.off.as_ref().map_or(Some(0.0), |off| held_number_of(off, command, problems))?;
    let needs = table.needs.iter().filter_map(|need| state(&need.value, defs, problems)).collect();
    Some(ActuatorDef {
        output: output.id,
        command: command.id,
        off,
        needs,
        travel: table.travel.map(|travel| travel.value),
    })
}

fn sequence(table: &SequenceTable, defs: &Defs, problems: &mut Problems) -> Option<SequenceDef> {
    let name = table.run.as_ref()?;
    let run = commanded(name, defs, problems)?;
    if run.access != Access::ReadWrite {
        problems.add(name.at, format!("whether {} runs is not known", run.name)).label("expected access = \"rw\"");
    }
    let step = defs.tag(table.step.as_ref()?, problems)?;
    let first = number_of(table.first.as_ref()?, step, problems)?;
    let auto = table.auto.as_ref().and_then(|auto| state(&auto.value, defs, problems));
    Some(SequenceDef { run: run.id, auto, step: step.id, first })
}

fn state(need: &NeedTable, defs: &Defs, problems: &mut Problems) -> Option<(crate::plant::def::TagId, f64)> {
    let tag = defs.tag(need.tag.as_ref()?, problems)?;
    Some((tag.id, number_of(need.is.as_ref()?, tag, problems)?))
}

/// A tag that can be written.
fn commanded<'a>(name: &At<String>, defs: &'a Defs, problems: &mut Problems) -> Option<&'a TagDef> {
    let tag = defs.tag(name, problems)?;
    check_writable(name, tag, problems);
    Some(tag)
}
