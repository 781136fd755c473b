//! `sightglass procedure`: how the procedures of a running station stand; starts one, aborts one, waits for its end.

use crate::{
    plant::{
        Snapshot,
        command::{CommandKind, Outcome},
        def::ProcedureId,
        number::to_u16,
        procedure::{ProcedureEnd, ProcedureRun},
    },
    report::procedures,
};

use super::{CliError, client, in_runtime, say};

/// Arguments of `procedure`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The procedure; without it all are listed
    name: Option<String>,
    /// Start it
    #[arg(long, requires = "name", conflicts_with = "abort")]
    start: bool,
    /// Abort it: its safe state is written at once
    #[arg(long, requires = "name")]
    abort: bool,
    /// Wait until it has ended; not done is a failure
    #[arg(long, requires = "name")]
    wait: bool,
    #[command(flatten)]
    action: client::ActionArgs,
}

/// Lists the procedures, or does what is asked with one and prints how it stands.
pub fn main(args: Args) -> Result<(), CliError> {
    in_runtime(async {
        let mut actor = args.action.attach().await?;
        let snapshot = actor.session.snapshots.borrow().clone();
        let Some(name) = &args.name else {
            for (place, def) in snapshot.def.procedures.iter().enumerate() {
                say(format!("{:12} {:16} {}", def.name, procedures::state(&snapshot, id_of(place)), def.about)
                    .trim_end());
            }
            return Ok(());
        };
        let place = snapshot.def.procedures.iter().position(|def| *def.name == **name);
        let id = place
            .map(id_of)
            .ok_or_else(|| CliError::Usage(format!("no procedure `{name}` in {}", snapshot.def.name)))?;
        let kind = match (args.start, args.abort) {
            (true, _) => Some(CommandKind::StartProcedure(id)),
            (false, true) => Some(CommandKind::AbortProcedure(id)),
            (false, false) => None,
        };
        if let Some(kind) = kind {
            let status = actor.send_command(1, kind).await?;
            if !matches!(status.outcome, Outcome::Verified | Outcome::Unchanged) {
                return Err(CliError::Failed(format!("{name}: {}", status.outcome)));
            }
        }
        if args.wait {
            let ended =
                |snapshot: &Snapshot| !snapshot.procedures[id.index()].as_ref().is_some_and(|run| run.at_work());
            actor.session.snapshots.wait_for(|snapshot| ended(snapshot)).await.map_err(|_| CliError::StationGone)?;
        }
        let snapshot = actor.session.snapshots.borrow().clone();
        let run = snapshot.procedures[id.index()].as_deref();
        let state = run.map_or_else(|| "not started".to_owned(), |_| procedures::state(&snapshot, id));
        say(&format!("{name}: {state}"));
        for (line, _) in procedures::progress(&snapshot, id) {
            say(&format!("  {line}"));
        }
        // An abort is done once the safe state is written.
        let is_done =
            |run: &ProcedureRun| if args.abort { !run.is_fault() } else { run.end() == Some(&ProcedureEnd::Done) };
        match args.wait && !run.is_some_and(is_done) {
            true => Err(CliError::Failed(format!("{name} is not done"))),
            false => Ok(()),
        }
    })
}

fn id_of(place: usize) -> ProcedureId {
    ProcedureId(to_u16(place))
}

#[cfg(test)]
mod tests {
    use std::{
        path::Path,
        sync::{Arc, Mutex},
    };

    use jiff::Timestamp;

    use super::*;
    use crate::{
        bus::io::clock::Clock,
        plant::{
            PlantDef,
            command::{CommandId, CommandStatus, Refusal},
            record::Record,
            recorded_action::RecordedAction,
        },
        profile::{self, Search},
        sim::{
            io::{SimulatorHandle, in_memory},
            simulator::Simulator,
        },
        station::{
            Session,
            io::{self as station, Station},
        },
    };

    /// Station, line and simulated tank in virtual time, with the end of each procedure as it is recorded.
    fn tank() -> (Arc<PlantDef>, Clock, Station, Arc<Mutex<Vec<String>>>) {
        let def = profile::load(Path::new("tank"), &Search::shipped()).expect("a shipped plant");
        let time = Clock::starting_at(Timestamp::from_second(1_700_000_000).expect("a valid instant"), 1.0);
        let simulator = SimulatorHandle::spawn_for(&def, Simulator::new(&def).expect("it has one"), time);
        let ends = Arc::new(Mutex::new(Vec::new()));
        let seen = ends.clone();
        let observer = move |records: &[Record]| {
            let ended = records.iter().filter_map(|record| match record {
                Record::Action(action) if action.is(RecordedAction::EndProcedure) => Some(action.outcome.to_string()),
                _ => None,
            });
            seen.lock().expect("no test fails here").extend(ended);
        };
        let station = station::start_transient(def.clone(), time, in_memory(&def, &simulator), Box::new(observer));
        (def, time, station, ends)
    }

    fn place_of(def: &PlantDef, name: &str) -> usize {
        def.procedures.iter().position(|def| &*def.name == name).expect("it is shipped")
    }

    /// A command to start a procedure, given once everything was read that it needs.
    async fn start(session: &mut Session, time: Clock, number: u32, place: usize) -> CommandStatus {
        let read = |snapshot: &Snapshot| {
            let tags = ["PLC-1.LT-1", "TIC-1.PV", "PLC-1.MAN.HEATER"].map(|name| snapshot.def.tag_named(name));
            tags.iter().flatten().all(|tag| snapshot.sample(*tag).quality.is_good())
        };
        let seen = session.snapshots.wait_for(|snapshot| read(snapshot)).await.expect("it runs").clone();
        let id = CommandId { terminal: session.terminal, number };
        let command = seen.command(id, CommandKind::StartProcedure(id_of(place)));
        CommandStatus::new(command, "anna", time.now())
    }

    #[tokio::test(start_paused = true)]
    async fn a_station_that_stops_leaves_the_safe_state() {
        let (def, time, station, ends) = tank();
        let mut session = station.session("test");
        let fill = place_of(&def, "fill-5l");
        let status = start(&mut session, time, 1, fill).await;
        station.commands.send(status).await.expect("it runs");
        let opened = def.tag_named("PLC-1.MAN.SV-1").expect("a tag of the tank");
        let is_open = |snapshot: &Snapshot| snapshot.sample(opened).good_value() == Some(1.0);
        session.snapshots.wait_for(|snapshot| is_open(snapshot)).await.expect("the tank is drained");
        station.stop().await;
        let last = session.snapshots.borrow().clone();
        assert_eq!(last.sample(opened).good_value(), Some(0.0), "the valve is closed");
        let ends = ends.lock().expect("no test fails here").clone();
        assert_eq!(ends.len(), 1, "{ends:?}");
        assert!(
            ends[0].starts_with("aborted by station, step ") && ends[0].ends_with("; safe state written"),
            "{ends:?}"
        );
    }

    /// Station, line and simulated tank in virtual time: the tank is drained, cools, and holds five litres, as the plant file has it.
    #[tokio::test(start_paused = true)]
    async fn the_shipped_procedure_fills_five_litres() {
        let (def, time, station, _) = tank();
        let mut session = station.session("test");
        let [level, pv, heater] =
            ["PLC-1.LT-1", "TIC-1.PV", "PLC-1.MAN.HEATER"].map(|name| def.tag_named(name).expect("a tag of the tank"));
        let fill = place_of(&def, "fill-5l");
        let status = start(&mut session, time, 1, fill).await;
        station.commands.send(status).await.expect("it runs");
        let ended = |snapshot: &Snapshot| snapshot.procedures[fill].as_ref().is_some_and(|run| !run.at_work());
        let last = session.snapshots.wait_for(|snapshot| ended(snapshot)).await.expect("it runs").clone();
        let run = last.procedures[fill].as_deref().expect("it was started");
        assert_eq!(run.end(), Some(&ProcedureEnd::Done), "{:?}", procedures::progress(&last, id_of(fill)));
        let [level, pv, heater] = [level, pv, heater].map(|tag| last.sample(tag).good_value().expect("it is read"));
        assert!((10.0..10.3).contains(&level) && pv < 27.6 && heater == 0.0, "{level} cm, {pv} °C, heater {heater}");
        // Without a history nothing could be compared afterwards: what measures is refused before its first write.
        let status = start(&mut session, time, 2, fill + 1).await;
        station.commands.send(status).await.expect("it runs");
        let id = CommandId { terminal: session.terminal, number: 2 };
        let outcome = |snapshot: &Snapshot| {
            let status = snapshot.commands.iter().find(|status| status.command.id == id);
            status.map(|status| status.outcome.clone())
        };
        let last = session.snapshots.wait_for(|snapshot| outcome(snapshot).is_some()).await.expect("it runs").clone();
        assert_eq!(outcome(&last), Some(Outcome::Refused(Refusal::NotMeasurable)));
        drop(session);
        station.stop().await;
    }
}
