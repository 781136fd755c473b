//! `sightglass history import PLANT FILE`: samples of another program for the gaps of a history; not while its station runs.

use std::path::PathBuf;

use jiff::Timestamp;

use super::{StoredPlant, open_log, record};
use crate::{
    access::io::audit_log,
    cli::{CliError, local, run, say},
    history::{import::parse, io::store::Store},
    plant::record::IMPORT,
};

/// A file is read whole.
const BYTES_MAX: u64 = 512 << 20;

/// Arguments of `history import`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "The first line names the columns: tag, time (or time_utc, time_local), value, and if there are such \
    quality and unit. Times have an offset, or are local times of the plant. Rows for which a value is in force already \
    are left out; one error, and nothing is stored."
)]
pub struct Args {
    #[command(flatten)]
    plant: StoredPlant,
    /// A CSV file with a row for each sample
    file: PathBuf,
}

/// Reads the file, stores what fills a gap, and puts that on record.
pub fn main(args: &Args) -> Result<(), CliError> {
    let def = args.plant.load()?;
    let (path, now, file) = (run::history_file(&def, &args.plant.station), Timestamp::now(), args.file.display());
    let failed = CliError::io(format!("cannot read {file}"));
    if BYTES_MAX < std::fs::metadata(&args.file).map_err(&failed)?.len() {
        return Err(CliError::Usage(format!("{file}: expected at most {} MiB: split the file", BYTES_MAX >> 20)));
    }
    let text = std::fs::read(&args.file).map_err(&failed)?;
    let opened = Store::open(&path, &def, now)?;
    if let Some(trouble) = opened.trouble {
        say(&trouble);
    }
    let store = opened.store;
    // Before the first row of this start, as a station does.
    store.end_curves_left_behind(now)?;
    let rows = parse(&def, &text, store.importable_from()?, now).map_err(|problems| {
        let lines: Vec<String> = problems.iter().map(|problem| format!("{file}: {problem}")).collect();
        CliError::Usage(format!("{}\nnothing is imported", lines.join("\n")))
    })?;
    let all: usize = rows.values().map(Vec::len).sum();
    let mut log = open_log(&audit_log::beside(&path))?;
    let Some(import) = store.import(rows, &file.to_string(), now)? else {
        say(&format!("nothing to import: at each of {all} rows a value is stored already"));
        return Ok(());
    };
    store.checkpoint()?;
    let span = [import.from, import.to].map(|at| local(at, &def)).join(" to ");
    let (rows, left_out) = (import.rows, all as u64 - import.rows);
    let left_out = match left_out {
        0 => String::new(),
        count => format!("; {count} left out, where a value is stored already"),
    };
    let done = format!("{rows} rows, {span}{left_out}");
    record(&mut log, IMPORT, &file.to_string(), &format!("done: {done}"), now)?;
    say(&format!("imported {done}"));
    Ok(())
}
