//! `sightglass demo`: a simulated plant on real pseudo-terminals and TCP ports, station and terminal in one process.

use std::{path::PathBuf, sync::Arc, time::Duration};

use futures_util::{StreamExt, stream};
use jiff::Timestamp;

use crate::{
    bus::io::{clock::Clock, transport::Connector},
    history::{Answer, Query},
    plant::{PlantDef, Snapshot, time::elapsed},
    profile::io::atomic::write_for_user,
    report::{self, Period, ShiftReport},
    sim::{
        self,
        drill::SimCommand,
        scenario::{Scenario, judge::DrillResult},
    },
    station::{Session, io as station},
    ui::{
        self,
        extension::{Extension, ExtensionMessage},
        io::ExtensionPort,
    },
};

use super::{
    CliError, StationArgs, TerminalArgs, drill, in_runtime, load, log, own_files, paths, run, say,
    source::{query_station, unexpected},
    span, speed,
};

/// Arguments of `demo`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The plant to simulate
    #[arg(default_value = "tank")]
    plant: String,
    /// Run the plant, its line and its clock this many times faster
    #[arg(long, value_name = "N", default_value = "1", value_parser = speed)]
    speed: f64,
    /// Begin with a tour: eight small tasks
    #[arg(long, conflicts_with_all = ["headless", "scenario", "plant"])]
    tour: bool,
    /// Run without a terminal and print what was done
    #[arg(long)]
    headless: bool,
    /// A drill: a scenario file, or the name of a shipped scenario; its plant is simulated
    #[arg(long, value_name = "FILE", conflicts_with = "plant")]
    scenario: Option<PathBuf>,
    /// Do not show the faults before the drill is over
    #[arg(long, requires = "scenario", conflicts_with = "headless")]
    exam: bool,
    /// End after this plant time
    #[arg(long = "for", value_name = "TIME", value_parser = span)]
    duration: Option<Duration>,
    /// Write a report of the whole run at the end, as CSV
    #[arg(long, value_name = "FILE", requires = "headless")]
    report: Option<PathBuf>,
    #[command(flatten)]
    terminal: TerminalArgs,
    #[command(flatten)]
    station: StationArgs,
}

/// Runs the demonstration.
pub fn main(args: Args) -> Result<(), CliError> {
    let (scenario, def) = match &args.scenario {
        Some(path) => {
            let (scenario, def) = drill::load(path)?;
            (Some(Arc::new(scenario)), Arc::unwrap_or_clone(def))
        }
        None => (None, load(&args.plant, &args.station)?),
    };
    if !args.headless {
        ui::io::require_terminal()?;
    }
    if let (Some(report), Some(history)) = (&args.report, &args.station.history) {
        own_files::refuse(report, history)?;
    }
    let _log = log::start(args.station.log.as_deref(), args.station.history.as_deref())?;
    // A history of its own, gone with the demonstration, unless the user wants to keep one.
    let scratch = Scratch::new(&args.station)?;
    in_runtime(demonstrate(&args, def, scenario, scratch.history.clone()))
}

/// Serves the plant, runs its station, and shows it until the time is over or the operator leaves.
async fn demonstrate(
    args: &Args,
    mut def: PlantDef,
    scenario: Option<Arc<Scenario>>,
    history: PathBuf,
) -> Result<(), CliError> {
    let clock = Clock::starting_at(Timestamp::now(), args.speed);
    let services: Vec<_> = def.lines.iter().map(sim::io::Service::new).collect();
    let simulated = drill::simulator(&def, scenario.as_deref())?;
    let simulated = sim::io::serve_simulator(&def, simulated, clock, &services).await?;
    simulated.plug_into(&mut def);
    let def = Arc::new(def);
    let connectors = def.lines.iter().map(|line| Connector::Real(line.transport.clone())).collect();
    let options = station::Options { def: def.clone(), clock, history, connectors, file: None };
    let (observer, journal) = sim::io::journal();
    let station = station::start_observed(options, Some(Box::new(observer)))?;
    let session = station.session(&if args.headless { "demo".to_owned() } else { paths::operator() });
    let trainer = sim::io::Trainer {
        def: def.clone(),
        simulator: simulated.simulator.clone(),
        snapshots: session.snapshots.clone(),
        journal,
        // Without a terminal the operator of the scenario acts.
        operator: (args.headless && scenario.is_some()).then(|| station.commands.clone()),
        scenario: scenario.clone(),
        exam: args.exam,
    };
    let (port, _judging) = trainer.spawn();
    let drilled = port.status.clone();
    let result = if args.headless {
        let places: Vec<_> = simulated.endpoints().iter().map(ToString::to_string).collect();
        say(&format!("{}: simulated on {}", def.title, places.join(", ")));
        let drill = scenario.as_ref().map(|scenario| scenario.duration);
        headless(session, clock, args.duration.or(drill), args).await
    } else {
        let options = ui::io::Options {
            tour: args.tour,
            extension: Some(extension(port)),
            ..args.terminal.options(ui::Leaving::Demo)
        };
        tokio::select! {
            result = ui::io::run(session, options) => result.map_err(CliError::from),
            () = run::over(clock, args.duration) => Ok(()),
        }
    };
    let last = station.stop().await;
    if args.headless {
        run::say_anchor(last);
    }
    let verdict = drilled.borrow().scenario.as_ref().map(|progress| progress.verdict.clone());
    result.and(verdict.map_or(Ok(()), |verdict| close_drill(&verdict, args.headless)))
}

/// Prints the verdict of a drill. Without a terminal one that was not passed is a failure.
fn close_drill(verdict: &DrillResult, headless: bool) -> Result<(), CliError> {
    drill::say_verdict(verdict);
    if headless && !(verdict.over && verdict.passed()) {
        return Err(CliError::Failed("the drill was not passed".into()));
    }
    Ok(())
}

/// The simulator as an extension of the terminal: its states, and its commands from the Faults tab.
fn extension(sim::io::Port { commands, mut status }: sim::io::Port) -> ExtensionPort {
    status.mark_changed();
    let states = stream::unfold(status, |mut status| async move {
        status.changed().await.ok()?;
        let state: Arc<dyn Extension> = status.borrow_and_update().clone();
        Some((state, status))
    });
    let send = move |message: ExtensionMessage| {
        // Active faults are seen in the next state; a command that finds no room changes nothing there.
        message.get::<SimCommand>().map(|command| commands.try_send(*command));
    };
    ExtensionPort { states: states.fuse().boxed(), send: Box::new(send) }
}

/// Prints what happens until the time is over, then sums up and writes the report.
async fn headless(session: Session, clock: Clock, duration: Option<Duration>, args: &Args) -> Result<(), CliError> {
    let from = clock.now();
    let last = run::follow(session.snapshots.clone(), clock, duration).await?;
    let period = Period::free(from, clock.now());
    let Answer::Report(report) = query_station(&session, Query::Report { period }).await? else {
        return Err(unexpected());
    };
    for line in summary(&last, &report) {
        say(&line);
    }
    if let Some(path) = &args.report {
        let bytes = report::render(report::FORMATS[0], &report, &last.def, &report::Style::of(&last.def))
            .map_err(CliError::Failed)?;
        write_for_user(path, &bytes).map_err(CliError::io(format!("cannot write {}", path.display())))?;
        say(&format!("report written: {}", path.display()));
    }
    Ok(())
}

/// What was done, for people and scripts: one `name value` a line.
fn summary(last: &Snapshot, report: &ShiftReport) -> Vec<String> {
    use crate::plant::record::AlarmEvent;
    let lines = last.lines.iter().map(|line| line.counters);
    let (mut polls, mut ok, mut timeouts, mut corrupt, mut exceptions) = (0, 0, 0, 0, 0);
    for counters in lines {
        polls += counters.requests;
        ok += counters.ok;
        timeouts += counters.timeouts;
        corrupt += counters.corrupt;
        exceptions += counters.exceptions;
    }
    let values: u64 = last.devices.iter().map(|device| device.values).sum();
    let raised = report.alarms.iter().filter(|step| step.event == AlarmEvent::Raised).count();
    let span = elapsed(report.period.from, report.until);
    vec![
        format!("plant time     {} s", span.as_secs()),
        format!("polls          {polls} ({ok} good, {timeouts} timeouts, {corrupt} corrupt, {exceptions} exceptions)"),
        format!("values         {values} read"),
        format!("alarms         {raised} raised"),
        format!("rows stored    {} ({} lost)", last.history.rows, last.history.lost),
    ]
}

/// The folder of a history that is not kept.
struct Scratch {
    history: PathBuf,
    folder: Option<PathBuf>,
}

impl Scratch {
    fn new(args: &StationArgs) -> Result<Scratch, CliError> {
        if let Some(history) = &args.history {
            return Ok(Scratch { history: history.clone(), folder: None });
        }
        // Private to this process: the temporary folder is shared.
        let started = Timestamp::now().as_microsecond();
        let folder = std::env::temp_dir().join(format!("sightglass-demo-{}-{started}", std::process::id()));
        std::os::unix::fs::DirBuilderExt::mode(&mut std::fs::DirBuilder::new(), 0o700)
            .create(&folder)
            .map_err(CliError::io(format!("cannot make {}", folder.display())))?;
        Ok(Scratch { history: folder.join("demo.duckdb"), folder: Some(folder) })
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        if let Some(folder) = &self.folder {
            // A folder that will not go is the temporary folder's business, not the operator's.
            let _ = std::fs::remove_dir_all(folder);
        }
    }
}
