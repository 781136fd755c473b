//! What is done about damage at an opening.

use std::{fs::File, path::Path};

use jiff::Timestamp;

use super::{
    blocks,
    files::{self, Failure, SetAside},
    last::{self, LastCommit, Noted},
    probe::{self, Probe, Proven},
    store::Store,
};
use crate::{
    history::{HistoryError, engine_error, words::plain},
    profile::io::atomic::with_suffix,
};

/// What an operator reads of damage that was gone at the second try.
fn unread_at_first(why: &str) -> String {
    format!("a part of the history could not be read at first ({})", plain(why))
}

/// A store that is open, what is wrong with its archive, and what was read of it.
pub type Tried<T> = Result<(Store, Option<String>, T), Failure>;

/// Opens, and does about damage what can be done, the least first: the blocks of a checkpoint that power was lost in are put
/// back, a log is cut before the commit that never ended, a log is set aside, everything is. Gives the last try, and what an
/// operator reads of damage that has gone; damage that was set aside is reported.
pub fn mend<T>(
    path: &Path,
    now: Timestamp,
    noted: &Noted,
    try_open: &dyn Fn() -> Tried<T>,
    report: &mut dyn FnMut(Proven),
) -> Result<(Tried<T>, Option<String>), HistoryError> {
    let (mut opened, mut repaired) = (try_open(), None);
    if matches!(&opened, Err(Failure::Damaged(why)) if engine_error::is_of_database(why)) && put_blocks_back(path)? {
        opened = try_open();
    }
    for part in [SetAside::Log, SetAside::Everything] {
        let Err(Failure::Damaged(why)) = &opened else { break };
        if part == SetAside::Log && (!files::has_log(path) || engine_error::is_of_database(why)) {
            continue;
        }
        match probe::in_child(path) {
            Probe::Obstacle(error) => return Err(error),
            // What the engine has stumbled over is gone, or the log had what could not be read.
            Probe::Sound => (repaired, opened) = (Some(unread_at_first(why)), try_open()),
            Probe::Untried(_) | Probe::Damaged(_) => {}
        }
        let Err(Failure::Damaged(why)) = &opened else { break };
        let proven = Proven { part, why: why.clone(), target: files::set_aside(path, part, now)? };
        if part == SetAside::Log && copy_logs_before_damage(&proven, path)? {
            opened = try_open();
            match &opened {
                // What was cut off had never been confirmed.
                Ok((store, ..)) if missing(noted, &store.last_commit(), false).is_none() => {
                    tracing::warn!(proven.why, "a commit never ended: it is cut off the log");
                    files::remove_logs(&proven.target);
                    break;
                }
                Ok(_) => {
                    report(proven);
                    break;
                }
                Err(_) => files::remove_logs(path),
            }
        }
        report(proven);
        opened = try_open();
    }
    Ok((opened, repaired))
}

/// Puts the blocks back that a checkpoint has overwritten before power was lost. While the disk takes none, the opening waits.
fn put_blocks_back(path: &Path) -> Result<bool, HistoryError> {
    let put_back = blocks::put_back(path).map_err(|error| {
        HistoryError::Engine(format!("the blocks of its last checkpoint are not put back: {error}"))
    })?;
    if put_back {
        tracing::warn!("power was lost during a checkpoint: the blocks before it are put back");
    }
    Ok(put_back)
}

/// What an operator reads of what was set aside.
pub fn said_of(Proven { part, why, target }: Proven) -> String {
    tracing::error!(why, ?part, "the history is damaged");
    let what = match part {
        SetAside::Log => "the last minutes of the history are",
        SetAside::Everything => "the history is",
    };
    format!("{what} damaged ({}) and set aside as {}", plain(&why), target.display())
}

/// What is missing; a file that was set aside itself is not said to be missing as well.
pub fn missing(noted: &Noted, open: &LastCommit, set_aside: bool) -> Option<String> {
    match noted {
        Noted::Commit(noted) if set_aside && noted.identity != open.identity => None,
        Noted::Unreadable if set_aside => None,
        Noted::Nothing | Noted::Unreadable | Noted::Commit(_) => last::missing(noted, open),
    }
}

/// Copies logs that were set aside as those of `db`, up to the entry that cannot be read. `false` where none is named.
fn copy_logs_before_damage(Proven { why, target, .. }: &Proven, db: &Path) -> Result<bool, HistoryError> {
    let Some((log, sound)) = engine_error::damaged_log_entry(why) else { return Ok(false) };
    if !files::LOGS.iter().any(|name| with_suffix(db, name) == log) {
        return Ok(false);
    }
    files::copy_logs(target, db)?;
    let cut = File::options().write(true).open(log).and_then(|file| file.set_len(sound).and_then(|()| file.sync_all()));
    cut.map_err(|error| HistoryError::Engine(format!("{}: {error}", log.display())))?;
    Ok(true)
}
