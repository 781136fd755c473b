//! `sightglass run PLANT` and `sightglass PLANT`: a station on real lines, without or with a terminal.

use std::{path::PathBuf, sync::Arc, time::Duration};

use tokio::signal::unix::{SignalKind, signal};

use crate::{
    bus::io::{clock::Clock, transport::Connector},
    plant::{PlantDef, Snapshot, sample::Quality},
    profile::PlantFile,
    station::{Session, io as station, teller},
    ui,
};

use super::{CliError, StationArgs, in_runtime, load_with_file, log, paths, say, span};

/// Arguments of `run`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A plant file, or the name of a shipped plant
    plant: String,
    /// End after this time
    #[arg(long = "for", value_name = "TIME", value_parser = span)]
    duration: Option<Duration>,
    /// At the end print every tag with value, quality and age
    #[arg(long)]
    print: bool,
    #[command(flatten)]
    station: StationArgs,
}

/// Runs the station until it is told to stop; says on standard output what changes.
pub fn main(args: Args) -> Result<(), CliError> {
    let (def, file) = load_with_file(&args.plant, &args.station)?;
    let def = Arc::new(def);
    let _log = log::start(args.station.log.as_deref())?;
    in_runtime(async {
        let clock = Clock::real();
        let station = start(&def, clock, history_file(&def, &args.station), file)?;
        say(&format!("{}: {} tags on {} lines", def.title, def.tags.len(), def.lines.len()));
        let session = station.session("station");
        let last = follow(session, clock, args.duration).await;
        if args.print
            && let Ok(last) = &last
        {
            values(last).iter().for_each(|line| say(line));
        }
        station.stop().await;
        say("stopped");
        last.map(drop)
    })
}

/// Station and terminal in one process.
pub fn with_terminal(plant: &str, args: &StationArgs) -> Result<(), CliError> {
    let (def, file) = load_with_file(plant, args)?;
    let def = Arc::new(def);
    ui::io::require_terminal()?;
    let _log = log::start(args.log.as_deref())?;
    in_runtime(async {
        let station = start(&def, Clock::real(), history_file(&def, args), file)?;
        let session = station.session(&paths::operator());
        let result = ui::io::run(session, ui::io::Options::default()).await;
        station.stop().await;
        Ok(result?)
    })
}

/// One line a tag: name, value with unit, quality, age.
fn values(snapshot: &Snapshot) -> Vec<String> {
    let row = |tag: &crate::plant::tag::TagDef| {
        let sample = snapshot.sample(tag.id);
        let value =
            snapshot.text(tag.id).map_or_else(|| "----".into(), |text| format!("{text} {}", snapshot.unit(tag.id)));
        let quality = match sample.quality {
            Quality::Good => "good".to_owned(),
            Quality::Uncertain(cause) => format!("uncertain: {}", cause.words()),
            Quality::Bad(cause) => format!("bad: {}", cause.words()),
        };
        format!("{:20} {:>14}  {quality}  {:.1} s", tag.name, value.trim_end(), snapshot.age(tag.id).as_secs_f64())
    };
    snapshot.def.tags.iter().map(row).collect()
}

/// The history file that the arguments name, or the plant's own.
pub fn history_file(def: &PlantDef, args: &StationArgs) -> PathBuf {
    args.history.clone().unwrap_or_else(|| paths::history_of(&def.name))
}

/// A station on the lines of its plant.
fn start(
    def: &Arc<PlantDef>,
    clock: Clock,
    history: PathBuf,
    file: Option<PlantFile>,
) -> Result<station::Station, CliError> {
    if let Some(folder) = history.parent() {
        std::fs::create_dir_all(folder)
            .map_err(|error| CliError::Io { what: format!("cannot make {}", folder.display()), error })?;
    }
    let connectors = def.lines.iter().map(|line| Connector::Real(line.transport.clone())).collect();
    Ok(station::start(station::Options { def: def.clone(), clock, history, connectors, file })?)
}

/// Tells what changes until the time is over, a signal comes, or the station ends; gives the last snapshot.
pub async fn follow(mut session: Session, clock: Clock, duration: Option<Duration>) -> Result<Arc<Snapshot>, CliError> {
    let mut before = session.snapshots.borrow_and_update().clone();
    let end = over(clock, duration);
    tokio::pin!(end);
    let told_to_stop = signalled();
    tokio::pin!(told_to_stop);
    loop {
        tokio::select! {
            () = &mut end => break,
            () = &mut told_to_stop => break,
            changed = session.snapshots.changed() => {
                if changed.is_err() {
                    return Err(CliError::StationGone);
                }
                let after = session.snapshots.borrow_and_update().clone();
                let time = after.at.to_zoned(after.def.time_zone.clone()).strftime("%Y-%m-%d %H:%M:%S");
                for line in teller::changes(&before, &after) {
                    say(&format!("{time} {line}"));
                }
                before = after;
            }
        }
    }
    Ok(session.snapshots.borrow().clone())
}

/// Returns when a span of plant time is over; never without one.
pub async fn over(clock: Clock, duration: Option<Duration>) {
    match duration {
        Some(duration) => clock.sleep(duration).await,
        None => std::future::pending().await,
    }
}

/// Returns when the process is asked to end.
pub async fn signalled() {
    let wait = |kind| async move {
        match signal(kind) {
            Ok(mut signal) => drop(signal.recv().await),
            // Without a handler the system ends the process by itself.
            Err(_) => std::future::pending().await,
        }
    };
    tokio::select! {
        () = wait(SignalKind::interrupt()) => {}
        () = wait(SignalKind::terminate()) => {}
        () = wait(SignalKind::hangup()) => {}
    }
}
