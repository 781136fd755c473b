//! `sightglass drill`: a scenario in virtual time, with the operator of the scenario, and its verdict.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

use jiff::{Timestamp, civil::date};
use tokio::sync::mpsc;

use crate::{
    bus::io::clock::Clock,
    plant::{PlantDef, Snapshot, time::elapsed},
    profile::{self, Kind, Search},
    sim::{
        io::{SimulatorHandle, Trainer, in_memory, journal},
        scenario::{
            Scenario, Start,
            judge::{DrillResult, clock},
            read,
        },
        simulator::Simulator,
    },
    station::{event_log, io as station},
};

use super::{CliError, log, say};

/// Arguments of `drill`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A scenario file, or the name of a shipped scenario; without it they are listed
    scenario: Option<PathBuf>,
    /// Run without the operator of the scenario: what happens when no action is taken
    #[arg(long)]
    no_operator: bool,
    /// Print only the verdict
    #[arg(long)]
    quiet: bool,
}

/// Runs a scenario as fast as the machine can; an error if it is not passed.
pub fn main(args: Args) -> Result<(), CliError> {
    let Some(path) = &args.scenario else { return list() };
    let (scenario, def) = load(path)?;
    let _log = log::start(None, None)?;
    let scenario = Arc::new(scenario);
    let print = |line: &str| {
        if !args.quiet {
            say(line);
        }
    };
    let verdict = run_drill(scenario.clone(), def, !args.no_operator, print)?;
    say_verdict(&verdict);
    if verdict.passed() { Ok(()) } else { Err(CliError::Failed(format!("{}: not passed", scenario.name))) }
}

/// Reads a scenario and its plant.
pub fn load(path: &Path) -> Result<(Scenario, Arc<PlantDef>), CliError> {
    read::load(path, &Search::usual()).map_err(|errors| CliError::Profile(Box::new(errors)))
}

/// The simulator of a scenario at its start.
pub fn simulator(def: &PlantDef, scenario: Option<&Scenario>) -> Result<Simulator, CliError> {
    let mut simulator = Simulator::new(def).map_err(crate::sim::io::SimError::from)?;
    if let Some(scenario) = scenario {
        if scenario.start == Start::Rest {
            simulator = simulator.at_rest();
        }
        simulator.advance(scenario.warm_up);
    }
    Ok(simulator)
}

/// Prints a table of what was expected and what came of it.
pub fn say_verdict(verdict: &DrillResult) {
    say("");
    say(&verdict.title);
    verdict.lines().iter().for_each(|line| say(line));
}

fn list() -> Result<(), CliError> {
    let search = Search::usual();
    for listed in profile::list(&search).iter().filter(|listed| listed.kind == Kind::Scenario) {
        let title = match read::load(Path::new(&listed.name), &search) {
            Ok((scenario, _)) => format!("{}  {}", clock(scenario.duration), scenario.title),
            Err(errors) => format!("{} problems", errors.count()),
        };
        say(&format!("{:24}  {title}", listed.name));
    }
    Ok(())
}

/// A drill from its start to its verdict, in virtual time: one thread, no port, no file, no real clock.
fn run_drill(
    scenario: Arc<Scenario>,
    def: Arc<PlantDef>,
    with_operator: bool,
    print: impl Fn(&str),
) -> Result<DrillResult, CliError> {
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_time()
        .start_paused(true)
        .build()
        .map_err(CliError::io("cannot start"))?;
    runtime.block_on(async {
        let time = Clock::starting_at(morning(&def), 1.0);
        let simulator = SimulatorHandle::spawn_for(&def, simulator(&def, Some(&scenario))?, time);
        let (observer, journal) = journal();
        let station = station::start_transient(def.clone(), time, in_memory(&def, &simulator), Box::new(observer));
        let session = station.session("drill");
        // Without an operator the commands are dropped.
        let commands = if with_operator { station.commands.clone() } else { mpsc::channel(1).0 };
        let trainer = Trainer {
            def,
            simulator,
            snapshots: session.snapshots.clone(),
            journal,
            scenario: Some(scenario),
            operator: Some(commands),
            exam: false,
        };
        let (_port, mut work) = trainer.spawn();
        let began = time.now();
        let mut snapshots = session.snapshots.clone();
        let mut before = snapshots.borrow_and_update().clone();
        let verdict = loop {
            tokio::select! {
                biased;
                Ok(()) = snapshots.changed() => {
                    let after = snapshots.borrow_and_update().clone();
                    changes(began, &before, &after).iter().for_each(|line| print(line));
                    before = after;
                }
                ended = &mut work => break ended.ok().flatten(),
            }
        };
        drop((session, snapshots));
        station.stop().await;
        verdict.ok_or(CliError::StationGone)
    })
}

fn changes(began: Timestamp, before: &Snapshot, after: &Snapshot) -> Vec<String> {
    let at = clock(elapsed(began, after.at));
    event_log::changes(before, after).into_iter().map(|line| format!("{at} {line}")).collect()
}

/// Every drill begins at the same moment, so that replays are alike to the last digit.
fn morning(def: &PlantDef) -> Timestamp {
    let eight = date(2026, 1, 5).at(8, 0, 0, 0).to_zoned(def.time_zone.clone());
    eight.map_or(Timestamp::UNIX_EPOCH, |eight| eight.timestamp())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::faults::{FaultTarget, InjectedFault, available_faults};

    fn drill(name: &str, with_operator: bool) -> (DrillResult, Vec<String>) {
        let printed = std::cell::RefCell::new(Vec::new());
        let (scenario, def) = read::load(Path::new(name), &Search::shipped()).expect("a shipped scenario");
        let verdict =
            run_drill(Arc::new(scenario), def, with_operator, |line| printed.borrow_mut().push(line.to_owned()));
        (verdict.expect("the drill comes to its end"), printed.into_inner())
    }

    fn shipped() -> Vec<String> {
        let all = profile::list(&Search::shipped()).into_iter();
        all.filter(|listed| listed.kind == Kind::Scenario).map(|listed| listed.name).collect()
    }

    #[test]
    fn every_shipped_scenario_is_passed_only_with_its_operator() {
        let names = shipped();
        assert!(names.len() >= 4, "{names:?}");
        for name in names {
            let (verdict, printed) = drill(&name, true);
            assert!(
                verdict.over && verdict.passed(),
                "{name}:\n{}\n{}",
                printed.join("\n"),
                verdict.lines().join("\n")
            );
            let (alone, _) = drill(&name, false);
            assert!(!alone.passed(), "{name} needs no operator:\n{}", alone.lines().join("\n"));
        }
    }

    /// A drill of this fault in this target from 0:40 to 2:40, with more to expect.
    fn drill_of(target: &str, fault: &str, more: &str) -> (DrillResult, Vec<String>) {
        let text = format!(
            "title = 't'\nplant = 'tank'\nduration = '4m'\n[[event]]\nat = '40s'\nfor = '2m'\nfault = '{fault}'\n{target}\n{more}"
        );
        let find = |plant: &str| profile::load(Path::new(plant), &Search::shipped());
        let (scenario, def) =
            read::read("s", "s.toml", text.as_bytes(), &find).unwrap_or_else(|errors| panic!("{errors}"));
        let printed = std::cell::RefCell::new(Vec::new());
        let verdict = run_drill(Arc::new(scenario), def, true, |line| printed.borrow_mut().push(line.to_owned()));
        (verdict.expect("the drill comes to its end"), printed.into_inner())
    }

    /// No value is shown as good and is not so, and in the end all is well again.
    const HONEST: &str = "[[expect]]\ndisplayed_within = 'TIC-1.PV'\ntolerance = 4.0\n\
        [[expect]]\ndisplayed_within = 'PLC-1.LT-1'\ntolerance = 0.6\n[[expect]]\ndisplayed_within = 'PLC-1.HEATER'\ntolerance = 200\n\
        [[expect]]\ngood = 'TIC-1.PV'\nafter = '3m 45s'\n[[expect]]\ngood = 'PLC-1.LT-1'\nafter = '3m 45s'\n";

    /// What the operator sees of a fault in a device: a value that is bad, and an alarm that comes and goes.
    fn seen(device: &str, fault: InjectedFault) -> String {
        let value = if device == "TIC-1" { "TIC-1.PV" } else { "PLC-1.LT-1" };
        let bad = format!("[[expect]]\nnot_good = '{value}'\nafter = '40s'\nwithin = '10s'\n");
        let alarm = |of: &str| {
            let step = |step: &str, after: &str| {
                format!("[[expect]]\nalarm = '{of}'\nevent = '{step}'\nafter = '{after}'\nwithin = '50s'\n")
            };
            step("raised", "40s") + &step("RTN", "2m 40s")
        };
        match fault {
            // A device that refuses everything is as good as silent.
            InjectedFault::Silent
            | InjectedFault::Late(_)
            | InjectedFault::BadCrc
            | InjectedFault::Cut
            | InjectedFault::Exception(_) => bad + &alarm(device),
            InjectedFault::SensorBurnout => bad + &alarm("TIC-1.FAULT"),
            _ => String::new(),
        }
    }

    #[test]
    fn what_an_operator_sees_of_each_fault_is_never_a_wrong_value() {
        let tank = profile::load(Path::new("tank"), &Search::shipped()).expect("the tank");
        let mut tried = 0;
        for available in available_faults(&tank) {
            let name = available.target.name(&tank);
            let (target, device) = match available.target {
                FaultTarget::Line(_) => (format!("line = '{name}'"), ""),
                FaultTarget::Unit(..) => (format!("device = '{name}'"), name.as_str()),
                FaultTarget::Tag(_) | FaultTarget::Process => (String::new(), ""),
            };
            // What is stuck no master can know; the next test says so.
            for fault in available.faults.into_iter().filter(|fault| *fault != InjectedFault::Stuck) {
                let (verdict, printed) = drill_of(&target, &fault.to_string(), &(seen(device, fault) + HONEST));
                let all = format!("{name} {fault}\n{}\n{}", printed.join("\n"), verdict.lines().join("\n"));
                assert!(verdict.over && verdict.passed(), "{all}");
                tried += 1;
            }
        }
        assert!(tried >= 20, "{tried} faults");
    }

    #[test]
    fn a_stuck_value_is_shown_as_good_and_only_a_comparison_tells() {
        let (verdict, printed) = drill_of("device = 'TIC-1'", "stuck value", HONEST);
        let missed = verdict.lines()[0].contains("TIC-1.PV never shown wrong") && verdict.lines()[0].contains("MISSED");
        assert!(missed, "{}", verdict.lines().join("\n"));
        assert!(printed.iter().all(|line| !line.contains("RAISED")), "{printed:?}");
    }

    #[test]
    fn a_replay_is_the_same_to_the_last_line() {
        let (first, second) = (drill("line_noise", true), drill("line_noise", true));
        assert_eq!(first.0, second.0);
        assert_eq!(first.1, second.1);
        assert!(first.1.len() > 3, "something was printed: {:?}", first.1);
    }
}
