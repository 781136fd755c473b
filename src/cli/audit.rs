//! `sightglass audit`: verifies the audit log line by line, against the history and its seals; makes the key of the seals.

use std::{
    collections::BTreeMap,
    fs::File,
    io::{self, Read},
    path::{Path, PathBuf},
    sync::Arc,
};

use jiff::Timestamp;

use crate::{
    access::{
        audit_log::Summary,
        io::{audit_log, sealing},
        sealing::{Sealed, VerificationKey},
    },
    history::{Answer, Query},
    plant::{PlantDef, record::ChainHash},
};

use super::{
    CliError, StationArgs, client, in_runtime, load, local, paths, say,
    source::{Source, unexpected},
};

/// The store counts time in these.
const MICROSECOND: jiff::SignedDuration = jiff::SignedDuration::from_micros(1);
/// Actions of one page.
const PAGE: usize = 10_000;

/// A verification key is a line and some comments; whatever is longer is something else.
const KEY_BYTES_MAX: u64 = 4 << 10;

/// Arguments of `audit`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, clap::Subcommand)]
enum Command {
    /// Reads the whole audit log and names the first line that was changed: exit code 1 if there is one, 5 if
    /// every line is sound but could not be compared with the history, or with the present sealing key
    Verify(VerifyArgs),
    /// Makes the sealing key of a plant's audit log, once, and prints the verification key: keep it off this machine, it is
    /// not shown again. From then on the station seals the log each hour and when it stops
    Key(KeyArgs),
}

#[derive(Debug, clap::Args)]
struct KeyArgs {
    /// A plant file, or the name of a shipped plant
    plant: String,
    #[command(flatten)]
    station: StationArgs,
}

#[derive(Debug, clap::Args)]
struct VerifyArgs {
    /// A plant file, or the name of a shipped plant
    plant: String,
    /// The audit log [default: the plant's own, beside its history]
    #[arg(long, value_name = "FILE")]
    log: Option<PathBuf>,
    /// Check the seals too, with the verification key in this file; `-` for standard input
    #[arg(long, value_name = "FILE")]
    key: Option<PathBuf>,
    #[command(flatten)]
    login: client::Login,
    #[command(flatten)]
    station: StationArgs,
}

/// Does what the subcommand says.
pub fn main(args: Args) -> Result<(), CliError> {
    match args.command {
        Command::Verify(args) => verify(args),
        Command::Key(args) => make_key(&args),
    }
}

fn make_key(args: &KeyArgs) -> Result<(), CliError> {
    let def = load(&args.plant, &args.station)?;
    let log = audit_log::beside(&paths::history_file(&def, &args.station));
    let key = sealing::make(&log, Timestamp::now());
    let path = sealing::beside(&log);
    let key = key.map_err(|error| match error.kind() {
        io::ErrorKind::AlreadyExists => {
            CliError::Failed(format!("{} is there already: the station seals its audit log with it", path.display()))
        }
        io::ErrorKind::NotFound => CliError::Failed(format!(
            "{} cannot be made: its folder is made by the first start of the station, so start that first",
            path.display()
        )),
        _ => CliError::Io { what: format!("cannot make {}", path.display()), error },
    })?;
    say(&format!("# Verifies the seals of {}.", log.display()));
    say("# Keep it off this machine: whoever has it can forge them. It is not shown again.");
    say(key.text().trim_end());
    Ok(())
}

fn read_key(path: &Path) -> Result<VerificationKey, CliError> {
    let failed = CliError::io(format!("cannot read {}", path.display()));
    let from: Box<dyn Read> = match path == Path::new("-") {
        true => Box::new(io::stdin()),
        false => Box::new(File::open(path).map_err(&failed)?),
    };
    let mut text = String::new();
    from.take(KEY_BYTES_MAX).read_to_string(&mut text).map_err(&failed)?;
    let wrong = || CliError::Usage(format!("{}: expected the key that `sightglass audit key` printed", path.display()));
    VerificationKey::parse(&text).ok_or_else(wrong)
}

fn verify(args: VerifyArgs) -> Result<(), CliError> {
    let def = Arc::new(load(&args.plant, &args.station)?);
    let key = args.key.as_deref().map(read_key).transpose()?;
    // An audit log at another place has no history to compare with.
    let (path, rows) = match &args.log {
        Some(path) => (path.clone(), None),
        None => {
            (audit_log::beside(&paths::history_file(&def, &args.station)), Some(in_runtime(chain_hashes(&def, &args))))
        }
    };
    let mut not_compared = Vec::new();
    let chain_hashes = rows.unwrap_or(Ok(Vec::new())).unwrap_or_else(|error| {
        not_compared.push(format!("it was not compared with the history: {error}"));
        Vec::new()
    });
    let failed = |error: audit_log::VerifyError| CliError::Failed(error.to_string());
    let (summary, sealed) = match &key {
        None => (audit_log::verify(&path, &chain_hashes).map_err(failed)?, None),
        Some(key) => {
            let (summary, sealed, is_compared) = sealing::verify(&path, &chain_hashes, key).map_err(failed)?;
            if !is_compared {
                let present = sealing::beside(&path);
                not_compared
                    .push(format!("it may have been cut behind the last seal: {} is missing", present.display()));
            }
            (summary, Some(sealed))
        }
    };
    let found = if summary.entries == 0 { "empty: no entry was ever recorded" } else { "whole" };
    say(&format!("{}: {found}", path.display()));
    summary_lines(&summary, &def).iter().for_each(|line| say(line));
    sealed.iter().for_each(|sealed| say(&sealed_line(sealed, &def)));
    if not_compared.is_empty() { Ok(()) } else { Err(CliError::NotCompared(not_compared.join("; "))) }
}

fn sealed_line(sealed: &Sealed, def: &PlantDef) -> String {
    match sealed.last {
        None => format!("sealed     nothing yet; {} entries are not sealed", sealed.unsealed),
        Some((entry, at)) => format!(
            "sealed     up to entry {entry} of {} by {} seals; {} entries behind it are not sealed yet",
            local(at, def),
            sealed.seals,
            sealed.unsealed
        ),
    }
}

fn summary_lines(summary: &Summary, def: &PlantDef) -> Vec<String> {
    let mut lines = vec![
        format!("lines      {}", summary.entries),
        format!("last entry {}", summary.last),
        format!("history    {} of {} entries compared", summary.compared, summary.entries),
    ];
    lines.extend(summary.span.map(|(first, last)| format!("from       {} to {}", local(first, def), local(last, def))));
    if summary.torn {
        lines.push("torn       an incomplete line follows the last one".to_owned());
    }
    lines
}

/// The chain hashes that the history holds.
async fn chain_hashes(def: &Arc<PlantDef>, args: &VerifyArgs) -> Result<Vec<ChainHash>, CliError> {
    let source = Source::open(def, &args.station, &args.login).await?;
    // Whatever the clock was: a history may hold what is yet to come.
    let (mut chain_hashes, mut to) = (BTreeMap::new(), Timestamp::MAX);
    loop {
        let all = String::new;
        let query =
            Query::Audit { from: Timestamp::UNIX_EPOCH, to, words: all(), by: all(), action: all(), limit: PAGE };
        let Answer::Actions(actions) = source.query(query).await? else { return Err(unexpected()) };
        let before = chain_hashes.len();
        chain_hashes.extend(
            actions.iter().filter_map(|action| action.chain_hash).map(|chain_hash| (chain_hash.number, chain_hash)),
        );
        // Newest first: the next page ends with the instant in which this one begins, whose actions come once more.
        match actions.last().filter(|_| actions.len() == PAGE && before < chain_hashes.len()) {
            Some(last) => to = last.at + MICROSECOND,
            None => return Ok(chain_hashes.into_values().collect()),
        }
    }
}
