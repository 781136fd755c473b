//! What is done about damage at an opening.

use std::{
    fs::{self, File},
    path::{Path, PathBuf},
};

use jiff::{Timestamp, tz::TimeZone};

use super::{
    blocks,
    files::{self, Failure, SetAside},
    last::{self, LastCommit, Noted},
    probe::{self, Probe, Proven},
    store::Store,
};
use crate::{
    history::{HistoryError, engine_error, words::plain},
    profile::io::{
        atomic::{sync_folder, with_suffix},
        regular,
    },
};

/// A log as it was before its end was cut off.
const WHOLE: &str = ".cut";

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
        if part == SetAside::Log
            && let Some(log) = cut_log(path, why)?
        {
            match try_open() {
                Err(Failure::Damaged(_)) => put_log_back(path, &log)?,
                tried => {
                    opened = tried;
                    break;
                }
            }
        }
        let proven = Proven { part, why: why.clone(), target: files::set_aside(path, part, now)? };
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

/// Cuts a log before the entry that cannot be read, in place: whatever ends the station now, a log without its end stays, and
/// the whole one beside it. Gives the log; `None` where no entry is named.
fn cut_log(db: &Path, why: &str) -> Result<Option<PathBuf>, HistoryError> {
    let Some((log, sound)) = engine_error::damaged_log_entry(why) else { return Ok(None) };
    if !files::LOGS.iter().any(|name| with_suffix(db, name) == log) {
        return Ok(None);
    }
    let whole = with_suffix(db, WHOLE);
    let cut = || {
        regular::copy(log, &whole)?;
        File::open(&whole)?.sync_all()?;
        sync_folder(&whole)?;
        let log = File::options().write(true).open(log)?;
        log.set_len(sound).and_then(|()| log.sync_all())
    };
    cut().map_err(|error| HistoryError::Engine(format!("{}: {error}", log.display())))?;
    tracing::warn!(why, "the end of the log is cut off");
    Ok(Some(log.to_owned()))
}

fn put_log_back(db: &Path, log: &Path) -> Result<(), HistoryError> {
    let put_back = fs::rename(with_suffix(db, WHOLE), log);
    put_back.map_err(|error| HistoryError::Engine(format!("{}: {error}", log.display())))
}

/// What becomes of the whole log once the history is open, in this opening or in one after a kill: what was cut off had never
/// been confirmed, unless something is missing now. Then it is kept, and said where.
pub fn end_cut(db: &Path, now: Timestamp, is_missing: bool) -> Option<String> {
    let whole = with_suffix(db, WHOLE);
    if !whole.exists() {
        return None;
    }
    if !is_missing {
        let _ = fs::remove_file(&whole);
        return None;
    }
    let stamp = now.to_zoned(TimeZone::UTC).strftime("%Y%m%dT%H%M%SZ");
    let kept = with_suffix(db, &format!(".damaged-{stamp}.wal"));
    let moved =
        fs::rename(&whole, &kept).inspect_err(|error| tracing::error!(%error, "the damaged log stays where it is"));
    Some(format!("its damaged log is set aside as {}", if moved.is_ok() { kept } else { whole }.display()))
}
