//! The files of a station: no report, export or log is written into them.

use std::{
    fs,
    path::{Path, PathBuf},
};

use crate::{
    access::io::{audit_log, sealing, users_beside},
    history::io::{alarm_file, files},
    profile::io::atomic,
};

use super::CliError;

/// Refuses to write to the history, its log and notes, the audit log, its note and its key, the users file or the
/// alarm-state file, under whatever name they are reached.
pub fn refuse(out: &Path, history: &Path) -> Result<(), CliError> {
    let beside =
        ["", ".wal", ".last", ".opening", ".blocks", ".cut"].map(|suffix| atomic::with_suffix(history, suffix));
    let log = audit_log::beside(history);
    let of_log = [audit_log::head_of(&log), sealing::beside(&log), log];
    let others = [users_beside(history), alarm_file::beside(history)];
    let same = |own: &PathBuf| {
        let is_one_file = files::inode(own).is_some() && files::inode(own) == files::inode(out);
        is_one_file || resolved(own).is_some() && resolved(own) == resolved(out)
    };
    match beside.iter().chain(&of_log).chain(&others).find(|own| same(own)) {
        Some(own) => Err(CliError::Usage(format!("{} belongs to the station: choose another file", own.display()))),
        None => Ok(()),
    }
}

/// The path without links and dots, also of a file that is not there yet.
fn resolved(path: &Path) -> Option<PathBuf> {
    let absolute = std::path::absolute(path).ok()?;
    fs::canonicalize(&absolute)
        .ok()
        .or_else(|| Some(fs::canonicalize(absolute.parent()?).ok()?.join(path.file_name()?)))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn a_report_never_goes_over_a_file_of_the_station() {
        let folder = tempfile::tempdir().unwrap();
        let history = folder.path().join("tank.duckdb");
        fs::write(&history, "history").unwrap();
        let link = folder.path().join("link.csv");
        std::os::unix::fs::symlink(&history, &link).unwrap();
        let hard = folder.path().join("hard.csv");
        fs::hard_link(&history, &hard).unwrap();
        let dotted = folder.path().join("./tank.duckdb.wal");
        let [log, users, alarms] = [audit_log::beside(&history), users_beside(&history), alarm_file::beside(&history)];
        let (key, note) = (sealing::beside(&log), folder.path().join("tank.audit.head"));
        for own in [&history, &link, &hard, &dotted, &log, &key, &note, &users, &alarms] {
            assert!(refuse(own, &history).is_err(), "{}", own.display());
        }
        for other in [folder.path().join("report.csv"), folder.path().join("none/report.csv"), PathBuf::from("-")] {
            assert!(refuse(&other, &history).is_ok(), "{}", other.display());
        }
    }
}
