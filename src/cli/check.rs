//! `sightglass check`: every error of a file at once, or its warnings, the read plan of each line and whether the line has the capacity.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

use jiff::Timestamp;

use crate::{
    bus::{
        admission, listen,
        plan::{self, Block, UnreadableRanges},
    },
    history::io::alarm_file,
    plant::{
        Plant, PlantDef,
        admission::{Admission, DeadDevice},
        def::{LineDef, LineId},
        losses::Loss,
        record::AlarmRecord,
        tag::Poll,
    },
    profile::{self, Search},
};

use super::{CliError, client, in_runtime, paths, say, say_problems};

/// Arguments of `check`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A plant file or device profile, or the name of a shipped one
    file: PathBuf,
    /// Refuse a plant with warnings: every alarm must be complete and useful
    #[arg(long)]
    strict: bool,
    /// List what loading this file would end in a plant: alarms, shelvings, alarms out of service, procedures, runs and
    /// restores; of its running station, else as it left them [default: the plant of this file]
    #[arg(long, value_name = "PLANT", num_args = 0..=1, default_missing_value = "")]
    against: Option<String>,
}

/// Checks; on success prints what would be read, how busy each line would be, and whether every poll can meet its period.
pub fn main(args: Args) -> Result<(), CliError> {
    let checked = profile::check(&args.file, &Search::usual()).map_err(|errors| CliError::Profile(Box::new(errors)))?;
    let (def, warnings) = (checked.plant, checked.warnings);
    if warnings.count() > 0 && args.strict {
        return Err(CliError::Profile(Box::new(warnings.strictly())));
    }
    let (tags, alarms) = (def.tags.len(), def.alarms.len());
    say(&format!("{}: {} is good: {tags} tags, {alarms} alarms", args.file.display(), def.title));
    for line in &def.lines {
        describe(&def, line.id).iter().for_each(|text| say(text));
    }
    if warnings.count() > 0 {
        say_problems(&warnings);
    }
    let Some(against) = args.against else { return Ok(()) };
    let plant = Path::new(if against.is_empty() { &def.name } else { &against });
    let name = plant.file_stem().map_or_else(|| def.name.clone(), |stem| stem.to_string_lossy().into_owned());
    let losses = in_runtime(losses(def, &name))?;
    say("");
    match losses.as_slice() {
        [] => say(&format!("nothing in {name} would be lost or renamed")),
        [..] => losses.iter().for_each(|loss| say(&format!("against {name}: {loss}"))),
    }
    Ok(())
}

/// What a definition would end of a plant: of its running station, else of the state that its alarms were left in.
async fn losses(def: Arc<PlantDef>, name: &str) -> Result<Vec<String>, CliError> {
    match client::open(Some(name)).await {
        Ok(session) => {
            let losses = session.snapshots.borrow().losses(&def);
            return Ok(losses.iter().map(Loss::to_string).collect());
        }
        Err(CliError::NotRunning(_)) => {}
        Err(error) => return Err(error),
    }
    let path = alarm_file::beside(&paths::history_of(name));
    let left = alarm_file::left(&path).map_err(CliError::Failed)?;
    let succession = Plant::new(def, Timestamp::UNIX_EPOCH, 1.0).restore(&left);
    let loss = |end: &AlarmRecord| {
        let becomes = end.reason.as_deref().unwrap_or("ends");
        format!("alarm {} {} {becomes}", end.subject, end.message)
    };
    Ok(succession.ended.iter().map(loss).collect())
}

/// The plan of a line and its admission, a line of text each.
fn describe(def: &PlantDef, line: LineId) -> Vec<String> {
    let blocks = plan::blocks(def, line, &UnreadableRanges::default());
    let line = def.line(line);
    if line.listens {
        return describe_listening(def, line);
    }
    let mut text = vec![
        String::new(),
        format!("line {}: {}, timeout {} ms", line.name, line.transport, line.timeout.as_millis()),
        "  device      function     wire address             Modicon         count  tags  class       every    worst case  share"
            .into(),
    ];
    text.extend(blocks.iter().map(|block| block_words(def, line, block)));
    let devices = def.devices.iter().filter(|device| device.line == line.id);
    text.extend(devices.map(|device| {
        let time = admission::unseen(device);
        format!("  {} takes at most {} ms for a response ({})", device.name, time.bound.as_millis(), time.source)
    }));
    let admission = admission::admit(def, line.id, &blocks);
    let cycle = admission.cycle.as_secs_f64() * 1e3;
    // The sum of nothing is -0.
    let utilisation = admission.utilisation.abs() * 100.0;
    text.push(format!("  utilisation {utilisation:.1} %, one read of everything {cycle:.1} ms"));
    text.extend(verdict_words(&admission));
    text.extend(admission.dead.iter().map(dead_words));
    text.extend(admission.warnings.iter().map(|warning| format!("  warning: {warning}")));
    text
}

/// Of the line of another master: what is followed there.
fn describe_listening(def: &PlantDef, line: &LineDef) -> Vec<String> {
    let silence = listen::silent_after(def, line.id).as_secs_f64();
    let mut text = vec![
        String::new(),
        format!("line {}: listens on {}, another master polls it and nothing is sent", line.name, line.transport),
        format!("  no traffic heard: an alarm after {silence} s"),
    ];
    let devices = def.devices.iter().filter(|device| device.line == line.id);
    text.extend(devices.map(|device| {
        let tags = def.tags_of(device.id).filter(|tag| tag.calculation.is_none()).count();
        format!("  {:10}  unit {:3}  {tags} tags, as far as the other master reads them", device.name, device.unit)
    }));
    text
}

fn block_words(def: &PlantDef, line: &LineDef, block: &Block) -> String {
    let device = def.device(block.device);
    let function = block.table.read_fc();
    let last = block.address + (block.count - 1);
    let cost = plan::cost(block, line, device, admission::unseen(device)).as_secs_f64();
    let (every, share) = match block.poll {
        Poll::Every(period) => {
            let period = period.as_secs_f64();
            (format!("{period} s"), format!("{:4.1} %", cost / period * 100.0))
        }
        Poll::Once => ("once".into(), String::new()),
        Poll::Never => ("never".into(), String::new()),
    };
    let text = format!(
        "  {:10}  {:11}  {:23}  {:14}  {:5}  {:4}  {:10}  {:7}  {:7.1} ms  {share}",
        device.name,
        format!("{function} / 0x{function:02X}"),
        format!("{}–{} / 0x{:04X}", block.address, last, block.address),
        format!("{}–{}", block.table.modicon(block.address), block.table.modicon(last)),
        block.count,
        block.tags.len(),
        block.class.word(),
        every,
        cost * 1e3,
    );
    text.trim_end().to_owned()
}

/// The schedulability, and what will happen if it is not good.
fn verdict_words(admission: &Admission) -> Vec<String> {
    let mut text = vec![format!("  {}", admission.schedulability)];
    if admission.schedulability.fits() {
        return text;
    }
    let consequence = match (admission.factor, admission.critical.fits()) {
        (Some(factor), true) if factor < 1.05 => {
            "some polls will start late; polls of alarm inputs take precedence if they are late repeatedly".into()
        }
        (Some(factor), true) => format!(
            "polls of alarm inputs keep their period; identification is left out, process values are read every {factor:.1} periods"
        ),
        (Some(_), false) | (None, _) => format!("even the alarm inputs alone do not fit: {}", admission.critical),
    };
    text.push(format!("  then: {consequence}"));
    text
}

fn dead_words(dead: &DeadDevice) -> String {
    let probe = dead.probe.as_secs_f64() * 1e3;
    let load = dead.utilisation * 100.0;
    format!(
        "  with {} dead: a probe of {probe:.1} ms each 30 s, utilisation {load:.1} %, {}",
        dead.name, dead.schedulability
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::fixture;

    #[test]
    fn the_plan_is_reported_in_both_number_bases_with_its_verdict() {
        let text = describe(&fixture::plant(), LineId(0)).join("\n");
        for part in [
            "9600 8N1",
            "4 / 0x04",
            "1000–1007 / 0x03E8",
            "31001–31008",
            "utilisation",
            "every poll meets its period",
            "TIC-1 takes at most 20 ms for a response (assumed)",
            "with TIC-1 dead: a probe of 312.0 ms",
            "warning: no parity and one stop bit",
        ] {
            assert!(text.contains(part), "no {part} in\n{text}");
        }
    }

    #[test]
    fn a_line_that_listens_has_no_plan_and_says_so() {
        let mut def = fixture::plant();
        def.lines[0].listens = true;
        let text = describe(&def, LineId(0)).join("\n");
        for part in ["listens on RTU", "nothing is sent", "an alarm after 10 s", "TIC-1       unit   1"] {
            assert!(text.contains(part), "no {part} in\n{text}");
        }
        for part in ["worst case", "utilisation", "meets its period", "timeout"] {
            assert!(!text.contains(part), "{part} in\n{text}");
        }
    }

    #[test]
    fn a_line_that_cannot_carry_its_polls_says_what_will_happen() {
        let mut def = fixture::plant();
        def.tags.iter_mut().for_each(|tag| tag.poll = Poll::Every(std::time::Duration::from_millis(80)));
        let text = describe(&def, LineId(0)).join("\n");
        for part in [
            "at worst the polls need",
            "then: polls of alarm inputs keep their period",
            "process values are read every",
        ] {
            assert!(text.contains(part), "no {part} in\n{text}");
        }
    }
}
