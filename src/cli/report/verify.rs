//! `sightglass report verify`: whether a report is the file that was written: against its checksum, the record of automatic reports
//! and the audit log.

use std::{
    fs, io,
    path::{Path, PathBuf},
    sync::Arc,
};

use jiff::Timestamp;

use crate::{
    access::audit_log::sha256,
    cli::{
        CliError, StationArgs, client, in_runtime, load, say,
        source::{Source, unexpected},
    },
    history::{Answer, Query},
    plant::recorded_action::RecordedAction,
    profile::io::atomic::with_suffix,
    station::io::{report_files::CHECKSUM, reports::REPORTS_MAX},
};

/// What the help says of it.
pub const ABOUT: &str = "Compares a report with its checksum (FILE.sha256), the record of automatic reports and the audit log. Exit code 0 \
    if all agree; 1 if the file was changed, or has neither a checksum nor a record; 5 if what is there agrees, but the checksum is missing, \
    the audit log may not be read, or has no entry of a report that was made without the station";

/// Entries of the audit log about one file that are listed.
const ENTRIES_MAX: usize = 20;

/// Arguments of `report verify`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The report
    file: PathBuf,
    /// A plant file, or the name of a shipped plant [default: the station that runs here]
    plant: Option<String>,
    #[command(flatten)]
    login: client::Login,
    #[command(flatten)]
    station: StationArgs,
}

/// How one comparison ended, and what is said about it.
enum Compared {
    Agrees(String),
    Differs(String),
    Missing(String),
    /// Nothing is known of it there, as of a report that was made without the station.
    Unrecorded(String),
}

/// Compares, and says each result.
pub fn main(args: Args) -> Result<(), CliError> {
    let failed = CliError::io(format!("cannot read {}", args.file.display()));
    let sha = sha256(&fs::read(&args.file).map_err(failed)?);
    let (record, log) = in_runtime(async {
        let source = match &args.plant {
            Some(plant) => Source::open(&Arc::new(load(plant, &args.station)?), &args.station, &args.login).await?,
            None => Source::Station(Box::new(client::attach(None, &args.login).await?)),
        };
        Ok((of_record(&source, &args.file, &sha).await?, of_log(&source, &sha).await))
    })?;
    let results = [("checksum", of_checksum(&args.file, &sha)), ("record", record), ("audit log", log)];
    say(&format!("{}: SHA-256 {sha}", args.file.display()));
    for (what, result) in &results {
        let (Compared::Agrees(words)
        | Compared::Differs(words)
        | Compared::Missing(words)
        | Compared::Unrecorded(words)) = result;
        say(&format!("{what:9}  {words}"));
    }
    let [(_, checksum), (_, record), (_, log)] = &results;
    let agrees = |result: &Compared| matches!(result, Compared::Agrees(_));
    let file = args.file.display();
    if results.iter().any(|(_, result)| matches!(result, Compared::Differs(_))) {
        return Err(CliError::Failed(format!("{file} is not what was written")));
    }
    match (agrees(record) || agrees(log), log, agrees(checksum)) {
        (true, _, true) => Ok(()),
        (true, _, false) => {
            Err(CliError::NotVerified(format!("{file} is what was written, but its checksum is missing")))
        }
        (false, Compared::Unrecorded(_), true) => Err(CliError::NotVerified(format!(
            "{file} agrees with its checksum, but no station has recorded it: nothing else shows that it was not changed"
        ))),
        (false, Compared::Unrecorded(_), false) => {
            Err(CliError::Failed(format!("{file} was not recorded by a station of this plant, and has no checksum")))
        }
        (false, _, _) => Err(CliError::NotVerified(format!("{file} could not be compared with the audit log"))),
    }
}

fn of_checksum(file: &Path, sha: &str) -> Compared {
    let path = with_suffix(file, CHECKSUM);
    match fs::read_to_string(&path) {
        Ok(line) if line.split_whitespace().next() == Some(sha) => {
            Compared::Agrees(format!("agrees with {}", path.display()))
        }
        Ok(_) => Compared::Differs(format!("DIFFERS from {}", path.display())),
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            Compared::Missing(format!("MISSING: no {}", path.display()))
        }
        Err(error) => Compared::Missing(format!("NOT READ: {}: {error}", path.display())),
    }
}

/// Whether the station has made it by itself.
async fn of_record(source: &Source, file: &Path, sha: &str) -> Result<Compared, CliError> {
    let Answer::Reports(made) = source.query(Query::Reports { limit: REPORTS_MAX }).await? else {
        return Err(unexpected());
    };
    if let Some(report) = made.reports.iter().find(|report| *report.sha256 == *sha) {
        return Ok(Compared::Agrees(format!("automatic report {}, {}", report.name, report.file)));
    }
    let path = std::path::absolute(file).unwrap_or_else(|_| file.to_owned());
    Ok(match made.reports.iter().find(|report| Path::new(&*report.file) == path && !report.sha256.is_empty()) {
        Some(report) => {
            Compared::Differs(format!("DIFFERS from the automatic report {}, {}", report.name, report.sha256))
        }
        None => Compared::Missing("no automatic report".to_owned()),
    })
}

/// Whether the audit log has an export of it.
async fn of_log(source: &Source, sha: &str) -> Compared {
    let (words, by, action) = (sha.to_owned(), String::new(), RecordedAction::Export.word().to_owned());
    let query = Query::Audit { from: Timestamp::UNIX_EPOCH, to: Timestamp::MAX, words, by, action, limit: ENTRIES_MAX };
    match source.query(query).await {
        Ok(Answer::Actions(actions)) => match actions.iter().find(|action| action.new.as_deref() == Some(sha)) {
            Some(action) => {
                let entry = action.chain_hash.map_or_else(String::new, |entry| format!(", entry {}", entry.number));
                Compared::Agrees(format!("exported by {} at {:.0} as {}{entry}", action.by, action.at, action.target))
            }
            None => Compared::Unrecorded(
                "NO ENTRY: it was made without the station, or changed, or made by another plant".to_owned(),
            ),
        },
        Ok(_) => Compared::Missing("NOT READ: the station answered another query".to_owned()),
        Err(error) => Compared::Missing(format!("NOT READ: {error}")),
    }
}
