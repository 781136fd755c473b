//! The control runs of each controller: the defaults, or what a `[[run]]` says.

use std::time::Duration;

use super::{
    batch,
    diagnostic::Problems,
    names::{Defs, Unique},
    reader::{At, Texts},
    schema::RunTable,
};
use crate::plant::{
    control_run::{DURATION_MAX, RunDef, STEADY_FOR},
    def::{BatchDef, DeviceDef, TagId},
    energy,
};

/// Tags of a run whose curves are compared, at most: as many as a trend group has pens.
const TAGS_MAX: usize = 8;
/// The longest run, and the longest time for steady, that can be asked for.
const TIME_MAX: Duration = Duration::from_secs(30 * 86_400);

/// Those of all devices that have SV and PV, in their order.
pub(super) fn runs(tables: &[At<RunTable>], batches: &[BatchDef], defs: &Defs, problems: &mut Problems) -> Vec<RunDef> {
    let mut runs: Vec<RunDef> = defs.devices.iter().filter_map(|device| default(device, batches, defs)).collect();
    let mut seen = Unique::default();
    for RunTable { controller, band, steady_for, duration_max, energy, batches: named, tags, .. } in
        tables.iter().map(|table| &table.value)
    {
        let Some((name, id)) = controller.as_ref().and_then(|name| Some((name, defs.device(name, problems)?))) else {
            continue;
        };
        seen.insert(&name.value, name.at, format!("duplicate run of `{}`", name.value), problems);
        let Some(run) = runs.iter_mut().find(|run| run.controller == id) else {
            let message = format!("{} has no SV and PV", name.value);
            problems.add(name.at, message).label("expected a device with a [faceplate]");
            continue;
        };
        if let Some(band) = band.filter(|band| !(band.value.is_finite() && 0.0 < band.value)) {
            problems.add(band.at, "PV is never exactly at SV").label("expected more than 0");
        }
        run.band = band.map(|band| band.value);
        run.steady_for = time(*steady_for, STEADY_FOR, problems);
        run.duration_max = time(*duration_max, DURATION_MAX, problems);
        if run.duration_max < run.steady_for {
            let at = duration_max.or(*steady_for).map_or(name.at, |time| time.at);
            problems.add(at, "a run ends before it can be steady").label("expected duration_max above steady_for");
        }
        if let Some(energy) = energy {
            run.energy = batch::energy_tag(energy, defs, problems);
        }
        if let Some(named) = named {
            run.batches =
                each(named, "batch", problems).into_iter().filter_map(|name| place(name, batches, problems)).collect();
        }
        if let Some(tags) = tags {
            run.tags =
                each(tags, "tag", problems).into_iter().filter_map(|tag| batch::stored(tag, defs, problems)).collect();
            if let Some(tag) = tags.value.0.get(TAGS_MAX) {
                problems.add(tag.at, "too many tags of a run").label(format!("expected at most {TAGS_MAX}"));
            }
        }
    }
    runs
}

/// The names of a list that is written to have some, each once.
fn each<'a>(list: &'a At<Texts>, what: &str, problems: &mut Problems) -> Vec<&'a At<String>> {
    if list.value.0.is_empty() {
        problems.add(list.at, format!("a run without a {what}")).label("expected at least one: else leave the key out");
    }
    let mut seen = Unique::default();
    let mut is_new = |name: &At<String>, problems: &mut Problems| {
        seen.insert(&name.value, name.at, format!("{what} {} is named twice", name.value), problems)
    };
    list.value.0.iter().filter(|name| is_new(name, problems)).collect()
}

/// Batches that summarise a tag of the controller begin its runs, and their energy is that of the run.
fn default(device: &DeviceDef, batches: &[BatchDef], defs: &Defs) -> Option<RunDef> {
    let faceplate = device.faceplate.as_ref()?;
    let is_own = |tag: &TagId| defs.tags[tag.index()].device == device.id;
    let own: Vec<usize> = (0..batches.len()).filter(|place| batches[*place].tags.iter().any(is_own)).collect();
    let energy = own.iter().find_map(|place| batches[*place].energy);
    let tags = [Some(faceplate.pv), Some(faceplate.sv_to_show()), faceplate.mv].into_iter().flatten();
    Some(RunDef {
        controller: device.id,
        sv: faceplate.sv,
        sv_used: faceplate.sv_used,
        pv: faceplate.pv,
        band: None,
        steady_for: STEADY_FOR,
        duration_max: DURATION_MAX,
        energy: energy.and_then(|tag| Some((tag, energy::of_unit(&defs.tags[tag.index()].unit)?))),
        batches: own,
        tags: tags.filter(|tag| defs.tags[tag.index()].is_stored()).collect(),
    })
}

fn time(written: Option<At<Duration>>, default: Duration, problems: &mut Problems) -> Duration {
    let Some(time) = written else { return default };
    if time.value < Duration::from_secs(10) || TIME_MAX < time.value {
        problems.add(time.at, "this is not the time of a run").label("expected 10s to 30 days");
    }
    time.value
}

fn place(name: &At<String>, batches: &[BatchDef], problems: &mut Problems) -> Option<usize> {
    let found = batches.iter().position(|batch| *batch.name == *name.value);
    if found.is_none() {
        problems.unknown("batch", name, batches.iter().map(|batch| &*batch.name));
    }
    found
}
