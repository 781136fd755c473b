//! `sightglass audit verify`: is the book of deeds as it was written, line by line, and does the history agree?

use std::{collections::BTreeMap, path::PathBuf, sync::Arc};

use jiff::Timestamp;

use crate::{
    access::{
        book::{Summary, hex},
        io::book,
    },
    history::{Answer, Question},
    plant::{PlantDef, record::Seal},
};

use super::{CliError, StationArgs, client, in_runtime, load, run, say, source::Source};

/// The store counts time in these.
const MICROSECOND: jiff::SignedDuration = jiff::SignedDuration::from_micros(1);
/// Deeds that one question is answered with.
const PAGE: usize = 10_000;

/// Arguments of `audit`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, clap::Subcommand)]
enum Command {
    /// Reads the whole audit log and names the first line that is not as it was written: exit code 1 if there is one, 5 if
    /// every line is sound but could not be compared with the history
    Verify(VerifyArgs),
}

#[derive(Debug, clap::Args)]
struct VerifyArgs {
    /// A plant file, or the name of a shipped plant
    plant: String,
    /// The book [default: the plant's own, beside its history]
    #[arg(long, value_name = "FILE")]
    book: Option<PathBuf>,
    #[command(flatten)]
    login: client::Login,
    #[command(flatten)]
    station: StationArgs,
}

/// Does what the subcommand says.
pub fn main(args: Args) -> Result<(), CliError> {
    match args.command {
        Command::Verify(args) => verify(args),
    }
}

fn verify(args: VerifyArgs) -> Result<(), CliError> {
    let def = Arc::new(load(&args.plant, &args.station)?);
    // A book that lies somewhere else has no history to compare with.
    let (path, rows) = match &args.book {
        Some(path) => (path.clone(), None),
        None => (book::beside(&run::history_file(&def, &args.station)), Some(in_runtime(seals(&def, &args)))),
    };
    let (seals, not_compared) = match rows {
        None => (Vec::new(), None),
        Some(Ok(seals)) => (seals, None),
        Some(Err(error)) => (Vec::new(), Some(error)),
    };
    let summary = book::verify(&path, &seals).map_err(|error| CliError::Failed(error.to_string()))?;
    let found = if summary.entries == 0 { "empty: no deed was ever recorded in it" } else { "whole" };
    say(&format!("{}: {found}", path.display()));
    summary_lines(&summary, &def).iter().for_each(|line| say(line));
    not_compared.map_or(Ok(()), |why| Err(CliError::NotCompared(why.to_string())))
}

fn summary_lines(summary: &Summary, def: &PlantDef) -> Vec<String> {
    let local = |at: Timestamp| at.to_zoned(def.time_zone.clone()).strftime("%Y-%m-%d %H:%M:%S").to_string();
    let mut lines = vec![
        format!("lines      {}", summary.entries),
        format!("last seal  {} {}", summary.last.number, hex(&summary.last.hash)),
        format!("history    {} of {} entries compared", summary.compared, summary.entries),
    ];
    lines.extend(summary.span.map(|(first, last)| format!("from       {} to {}", local(first), local(last))));
    if summary.torn {
        lines.push("torn       behind the last line stands the beginning of another one".to_owned());
    }
    lines
}

/// The seals that the history holds.
async fn seals(def: &Arc<PlantDef>, args: &VerifyArgs) -> Result<Vec<Seal>, CliError> {
    let source = Source::open(def, &args.station, &args.login).await?;
    // Whatever the clock was: a history may hold what is yet to come.
    let (mut seals, mut to) = (BTreeMap::new(), Timestamp::MAX);
    loop {
        let all = String::new;
        let question =
            Question::Audit { from: Timestamp::UNIX_EPOCH, to, words: all(), by: all(), action: all(), limit: PAGE };
        let Answer::Actions(deeds) = source.ask(question).await? else {
            return Err(CliError::Failed("the history answered another question".to_owned()));
        };
        let before = seals.len();
        seals.extend(deeds.iter().filter_map(|deed| deed.seal).map(|seal| (seal.number, seal)));
        // Newest first: the next page ends with the instant in which this one begins, whose deeds come once more.
        match deeds.last().filter(|_| deeds.len() == PAGE && before < seals.len()) {
            Some(last) => to = last.at + MICROSECOND,
            None => return Ok(seals.into_values().collect()),
        }
    }
}
