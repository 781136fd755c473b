//! `sightglass history restore PLANT DIR`: a backup in the place of the history, which is set aside; with `--set-aside` what a
//! station has set aside, joined with the history.

use std::{
    os::unix::fs::PermissionsExt,
    path::{Path, PathBuf},
};

use jiff::Timestamp;

use super::{StoredPlant, open_log, record};
use crate::{
    access::io::audit_log,
    cli::{CliError, paths, say},
    history::{
        backup::{AUDIT_LOG, Backup},
        io::{
            files::Exclusive,
            restore,
            reunite::{self, Reunited},
        },
    },
    plant::recorded_action::RecordedAction,
    profile::io::atomic::write_atomic,
    station::companions,
};

/// Arguments of `history restore`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    plant: StoredPlant,
    /// The folder of a backup
    #[arg(value_name = "DIR", required_unless_present = "set_aside", conflicts_with = "set_aside")]
    from: Option<PathBuf>,
    /// Bring back what a station has set aside as damaged and is sound, with what was recorded since
    #[arg(long)]
    set_aside: bool,
}

/// Restores, or finishes a restore that was interrupted. Refused while a station records to the history.
pub fn main(args: &Args) -> Result<(), CliError> {
    let def = args.plant.load()?;
    let db = paths::history_file(&def, &args.plant.station);
    let now = Timestamp::now();
    if let Some(folder) = db.parent() {
        std::fs::create_dir_all(folder).map_err(CliError::io(folder.display().to_string()))?;
    }
    // What was set aside is joined with the history, which this process opens for it.
    let _exclusive = if args.set_aside { Exclusive::hold(&db)? } else { Exclusive::acquire(&db)? };
    if let Some(before) = restore::finish(&db)? {
        say(&format!("the restore that was interrupted is finished{}", set_aside(&before)));
        return Ok(());
    }
    match &args.from {
        Some(from) => from_backup(from, &def.name, &db, now),
        None => from_set_aside(&db, now),
    }
}

/// Histories that were set aside, in front of the present one.
fn from_set_aside(db: &Path, now: Timestamp) -> Result<(), CliError> {
    let Reunited { sound, damaged, rows, aside } = reunite::prepare(db, now)?;
    for (path, why) in &damaged {
        say(&format!("{} is damaged and stays: {why}", path.display()));
    }
    if sound.is_empty() {
        return Err(CliError::Failed(format!("{}: nothing sound is set aside", db.display())));
    }
    let target = sound.iter().map(|path| path.display().to_string()).collect::<Vec<_>>().join(", ");
    let mut log = open_log(&audit_log::beside(db))?;
    let outcome = |word: &str| format!("{word}: {rows} rows that were set aside");
    record(&mut log, RecordedAction::RestoreHistory, &target, &outcome("begun"), now)?;
    restore::commit(db)?;
    restore::finish(db)?;
    record(&mut log, RecordedAction::RestoreHistory, &target, &outcome("done"), now)?;
    say(&format!("brought back {target}: {rows} rows, with those recorded since{}", set_aside(&aside)));
    Ok(())
}

/// A backup in the place of the history.
fn from_backup(from: &Path, plant: &str, db: &Path, now: Timestamp) -> Result<(), CliError> {
    let sound = restore::verify(from)?;
    let log = audit_log::beside(db);
    // The log goes on, and says so; where it is not the one of the backup, that of the backup takes its place.
    let is_kept = log.exists() && audit_log::verify(&log, &sound.chain_hashes).is_ok();
    let present = if log.exists() { Some(open_log(&log)?) } else { None };
    let mut also = if is_kept { Vec::new() } else { vec![audit_log::head_of(&log)] };
    if !is_kept && !sound.backup.files.iter().any(|file| file.path == AUDIT_LOG) {
        also.push(log.clone());
    }
    let replaced = (!is_kept).then_some(log.as_path());
    let aside = restore::prepare(from, &sound.backup, db, replaced, &also, now)?;
    let (target, what) = (from.display().to_string(), sound.backup.summary());
    let outcome = |word: &str| format!("{word}: {what}{}", set_aside(&aside));
    let mut kept = present.filter(|_| is_kept);
    if let Some(log) = &mut kept {
        record(log, RecordedAction::RestoreHistory, &target, &outcome("begun"), now)?;
    }
    let (restored, present) = restore_companions(from, &sound.backup, db, plant)?;
    restore::commit(db)?;
    restore::finish(db)?;
    let mut log = kept.map_or_else(|| open_log(&log), Ok)?;
    record(&mut log, RecordedAction::RestoreHistory, &target, &outcome("done"), now)?;
    say(&format!(
        "restored {}: {what}{}",
        from.display(),
        if aside.exists() { set_aside(&aside) } else { String::new() }
    ));
    if restored + present != 0 {
        say(&format!("users and parameter sets: {restored} files restored, {present} there already and kept"));
    }
    if !is_kept {
        say("its audit log is restored with it, because the present one is missing or that of another history");
    }
    Ok(())
}

/// Users and parameter sets are restored where they are missing, and never replaced: a role that was taken away since does
/// not come back. How many were restored, and how many were there.
fn restore_companions(from: &Path, backup: &Backup, db: &Path, plant: &str) -> Result<(usize, usize), CliError> {
    let (mut restored, mut present) = (0, 0);
    for file in &backup.files {
        let Some(to) = companions::place(db, plant, &file.path) else { continue };
        if to.exists() {
            present += 1;
            continue;
        }
        let stored = from.join(file.stored());
        let copied = to.parent().map_or(Ok(()), std::fs::create_dir_all).and_then(|()| {
            let mode = std::fs::metadata(&stored)?.permissions().mode();
            write_atomic(&to, &std::fs::read(&stored)?, mode & 0o777)
        });
        copied.map_err(CliError::io(to.display().to_string()))?;
        restored += 1;
    }
    Ok((restored, present))
}

fn set_aside(aside: &Path) -> String {
    format!("; the history before it is in {}", aside.display())
}
