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
