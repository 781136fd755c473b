//! `sightglass history PLANT`: what is stored, and where.

use std::sync::Arc;

use jiff::Timestamp;

use crate::{
    history::{
        Answer, ArchiveFile, Overview, Query,
        retention::{self, Deletion, Why},
        tiers::Tier,
    },
    plant::{PlantDef, number::to_u64},
};

use super::{StoredPlant, size};
use crate::cli::{CliError, in_runtime, local, say, source::unexpected};

/// Asks the station, or reads the file, and prints.
pub fn main(stored: &StoredPlant, json: bool) -> Result<(), CliError> {
    let def = stored.load()?;
    let overview = in_runtime(ask(stored, &def))?;
    match json {
        true => say(&serde_json::to_string_pretty(&overview).expect("its keys are words and its numbers are finite")),
        false => in_words(&overview, &def).iter().for_each(|line| say(line)),
    }
    Ok(())
}

/// What is stored, by the station or from the file.
pub async fn ask(stored: &StoredPlant, def: &Arc<PlantDef>) -> Result<Overview, CliError> {
    match stored.source(def).await?.query(Query::Overview).await? {
        Answer::Overview(overview) => Ok(*overview),
        _ => Err(unexpected()),
    }
}

/// One fact a line.
fn in_words(overview: &Overview, def: &PlantDef) -> Vec<String> {
    let Overview { database, database_bytes, samples, extent, pauses, folder, files, imports, .. } = overview;
    let time = |at: Timestamp| local(at, def);
    let stored =
        extent.map_or_else(|| "nothing yet".to_owned(), |(from, to)| format!("{} to {}", time(from), time(to)));
    let mut lines = vec![
        format!("stored    {stored}"),
        format!("database  {}: {samples} samples not archived yet, {}", database.display(), size(*database_bytes)),
        format!("archive   {}: {} files, {}", folder.display(), files.len(), size(bytes(files.iter()))),
    ];
    for tier in Tier::ALL {
        let files: Vec<&ArchiveFile> = files.iter().filter(|file| file.tier == tier).collect();
        let (Some(first), Some(last)) = (files.first(), files.last()) else { continue };
        let rows: u64 = files.iter().map(|file| file.rows).sum();
        let all = bytes(files.iter().copied());
        // The file of a day begins with the day, also of the first one.
        let begin = extent.map_or(first.from, |(stored, _)| first.from.max(stored.as_microsecond()));
        let span = [begin, last.to].map(|at| Timestamp::from_microsecond(at).map_or_else(|_| "?".into(), time));
        let each = all as f64 / rows.max(1) as f64;
        lines.push(format!(
            "{:9} {} to {}: {rows} rows in {} files, {}, {each:.2} bytes a row",
            tier.word(),
            span[0],
            span[1],
            files.len(),
            size(all)
        ));
    }
    lines.extend(imports.iter().map(|import| {
        let [at, from, to] = [import.at, import.from, import.to].map(time);
        format!("imported  {from} to {to}: {} rows of {}, on {at}", import.rows, import.file)
    }));
    lines.extend(of_room(overview, &time));
    lines.extend(
        pauses.iter().map(|(from, to)| format!("off       {} to {}: no station recorded", time(*from), time(*to))),
    );
    lines
}

/// What the disk has room for, what was deleted, and what will be.
fn of_room(overview: &Overview, time: &impl Fn(Timestamp) -> String) -> Vec<String> {
    let Overview { disk, rule, deleted_until, next_deletion, files, database_bytes, .. } = overview;
    let mut lines = Vec::new();
    if let Some(disk) = disk {
        lines.push(format!(
            "disk      {} free of {}; the history has {} and may take {} % of the disk, {}",
            size(disk.free),
            size(disk.all),
            size(database_bytes + bytes(files.iter())),
            rule.disk_share_percent_max,
            size(disk.share(*rule))
        ));
    }
    lines.extend(retention::growth(files).map(|growth| format!("growth    {} a day", size(to_u64(growth)))));
    lines.extend(deleted_until.map(|until| format!("deleted   samples before {}", time(until))));
    lines.push(match next_deletion {
        None => "next      nothing is deleted as things stand".to_owned(),
        Some(Deletion { file, why, at }) => {
            let at = Timestamp::from_microsecond(*at).map_or_else(|_| "in the far future".to_owned(), time);
            let why = match why {
                Why::Age(days) => format!("kept for {days} days"),
                Why::Share => format!("the history would have more than {} % of the disk", rule.disk_share_percent_max),
                Why::DiskFull => "the disk is nearly full".to_owned(),
            };
            format!("next      {} is deleted {at}: {why}", file.path)
        }
    });
    lines
}

fn bytes<'a>(files: impl Iterator<Item = &'a ArchiveFile>) -> u64 {
    files.map(|file| file.bytes).sum()
}
