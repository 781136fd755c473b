//! Settings of a line: tried out on a running station, saved into its plant file, and what is said where that cannot be.
//! Commands made before a reload of the plant file.

use std::{fs, path::Path, sync::Arc, time::Duration};

use jiff::Timestamp;
use sightglass::api::{
    attach::{connect, listen},
    bus::{Clock, Connector},
    plant::{
        CommandId, CommandKind, DeviceState, LineDef, LineId, Outcome, PlantDef, Refusal, RequestRefusal, Serial,
        Snapshot, Transport,
    },
    profile::{self, PlantFile, Search},
    sim::{Rig, Simulator, SimulatorHandle, Wire, serve_line},
    station::{self, Request, Session},
};
use tokio::sync::mpsc;

use crate::support::folder;

const L1: LineId = LineId(0);

/// The tank on a simulated rig whose port can be opened three times.
fn start(def: &Arc<PlantDef>, file: Option<PlantFile>, history: &Path) -> station::Station {
    start_at(Timestamp::UNIX_EPOCH, def, file, history)
}

fn start_at(base: Timestamp, def: &Arc<PlantDef>, file: Option<PlantFile>, history: &Path) -> station::Station {
    let clock = Clock::starting_at(base, 1.0);
    let (ports, streams) = mpsc::channel(3);
    let simulator = SimulatorHandle::spawn(Simulator::tank(Rig::demo()), clock);
    for _ in 0..3 {
        let (ours, theirs) = tokio::io::duplex(1024);
        ports.try_send(ours).unwrap();
        let wire = Wire { serial: Serial::USUAL, ascii: false };
        tokio::spawn(serve_line(theirs, simulator.line(L1), wire, Duration::from_secs(86_400)));
    }
    let options = station::Options {
        def: def.clone(),
        clock,
        history: history.to_owned(),
        connectors: vec![Connector::Memory(streams)],
        file,
    };
    station::start(options).unwrap()
}

/// Waits, in virtual time, until the plant is so.
async fn until(session: &mut Session, what: &str, so: impl Fn(&Snapshot) -> bool) {
    let reached = session.snapshots.wait_for(|snapshot| so(snapshot));
    let reached = tokio::time::timeout(Duration::from_secs(600), reached).await;
    assert!(reached.is_ok_and(|reached| reached.is_ok()), "never: {what}");
}

async fn send_command(session: &mut Session, number: u32, kind: CommandKind) -> Outcome {
    let id = CommandId { terminal: session.terminal, number };
    let command = session.snapshots.borrow().command(id, kind);
    session.send(Request::Command(command, None)).unwrap();
    let of = move |snapshot: &Snapshot| snapshot.commands.iter().find(|status| status.command.id == id).cloned();
    until(session, "the command has ended", |snapshot| of(snapshot).is_some_and(|status| !status.is_pending())).await;
    let command = of(&session.snapshots.borrow()).unwrap();
    command.outcome
}

fn all_answer(snapshot: &Snapshot) -> bool {
    snapshot.devices.iter().all(|device| device.state == DeviceState::Responding)
}

fn faster(def: &PlantDef) -> LineDef {
    let line = def.lines[0].clone();
    let Transport::Serial { port, .. } = &line.transport else { panic!("the tank has a serial line") };
    LineDef { transport: Transport::rtu(port, Serial { baud: 19_200, ..Serial::USUAL }), ..line }
}

#[tokio::test(start_paused = true)]
async fn saved_settings_are_in_the_plant_file() {
    let folder = folder();
    let path = folder.path().join("tank.toml");
    let text = profile::text_of("tank", &Search::shipped()).unwrap();
    fs::write(&path, &text).unwrap();
    let (def, file) = profile::load_with_file(&path, &Search::shipped()).unwrap();
    let station = start(&def, file, &folder.path().join("tank.duckdb"));
    let mut session = station.session("anna");
    until(&mut session, "all answer", all_answer).await;

    let new = faster(&def);
    assert_eq!(send_command(&mut session, 1, CommandKind::Configure(Box::new(new.clone()))).await, Outcome::Verified);
    until(&mut session, "the line works with the new settings", |snapshot| {
        let report = snapshot.lines[0].report.as_ref();
        report.is_some_and(|report| report.settings == new) && all_answer(snapshot)
    })
    .await;
    assert_eq!(session.snapshots.borrow().lines[0].settings_before.as_deref(), Some(&def.lines[0]));
    assert_eq!(fs::read_to_string(&path).unwrap(), text, "trying out writes nothing");

    assert_eq!(send_command(&mut session, 2, CommandKind::SaveSettings(L1)).await, Outcome::Verified);
    assert_eq!(fs::read_to_string(&path).unwrap(), text.replace("baud = 9600", "baud = 19200"), "comments and all");
    assert_eq!(session.snapshots.borrow().lines[0].settings_before, None);
    assert_eq!(profile::load(&path, &Search::shipped()).unwrap().lines[0], new);

    // The file is edited meanwhile: that edit is not overwritten.
    fs::write(&path, &text).unwrap();
    let outcome = send_command(&mut session, 3, CommandKind::SaveSettings(L1)).await;
    let Outcome::Refused(Refusal::NotSaved(why)) = outcome else { panic!("{outcome:?}") };
    assert!(why.contains("was changed since"), "{why}");
    assert_eq!(fs::read_to_string(&path).unwrap(), text);
    drop(session);
    station.stop().await;
}

#[tokio::test(start_paused = true)]
async fn a_plant_without_a_file_says_that_nothing_can_be_saved() {
    let folder = folder();
    let (def, file) = profile::load_with_file(Path::new("tank"), &Search::shipped()).unwrap();
    let station = start(&def, file, &folder.path().join("tank.duckdb"));
    let mut session = station.session("anna");
    let outcome = send_command(&mut session, 1, CommandKind::SaveSettings(L1)).await;
    let Outcome::Refused(Refusal::NotSaved(why)) = outcome else { panic!("{outcome:?}") };
    assert!(why.contains("built into the program"), "{why}");
    drop(session);
    station.stop().await;
}

#[tokio::test(start_paused = true)]
async fn a_command_made_before_a_reload_is_refused() {
    let folder = folder();
    let (socket, history) = (folder.path().join("tank.sock"), folder.path().join("tank.duckdb"));
    let def = profile::load(Path::new("tank"), &Search::shipped()).unwrap();
    let write = |snapshot: &Snapshot, number| {
        let kind = CommandKind::Write { tag: snapshot.def.tag_named("TIC-1.SV").unwrap(), value: 61.0.into() };
        snapshot.command(CommandId { terminal: 1, number }, kind)
    };
    let mut listener = listen(&socket).unwrap();
    let station = start(&def, None, &history);
    let acceptor = station.acceptor().clone();
    let serving = tokio::spawn(async move {
        listener.serve(&acceptor).await;
        listener
    });
    let mut session = connect(&socket).await.unwrap();
    until(&mut session, "all answer", all_answer).await;
    // The confirmation is open while the plant file is reloaded.
    let open = write(&session.snapshots.borrow(), 1);
    station.stop().await;
    let mut listener = serving.await.unwrap();
    let changed = Arc::new(PlantDef { title: "Another tank".to_owned(), ..PlantDef::clone(&def) });
    let base = Timestamp::UNIX_EPOCH + jiff::SignedDuration::from_hours(1);
    let station = start_at(base, &changed, None, &history);
    let acceptor = station.acceptor().clone();
    tokio::spawn(async move { listener.serve(&acceptor).await });
    until(&mut session, "the other plant", |snapshot| snapshot.def.title == "Another tank" && all_answer(snapshot))
        .await;

    let (id, before) = (open.id, session.snapshots.borrow().sample(changed.tag_named("TIC-1.SV").unwrap()).exact());
    session.send(Request::Command(open, None)).unwrap();
    let of = |snapshot: &Snapshot, id| snapshot.commands.iter().find(|status| status.command.id == id).cloned();
    let ended = |snapshot: &Snapshot, id| of(snapshot, id).is_some_and(|status| !status.is_pending());
    let undelivered = session.status.wait_for(|status| !status.undelivered.is_empty());
    let status =
        tokio::time::timeout(Duration::from_secs(600), undelivered).await.expect("never undelivered").unwrap().clone();
    let [(undelivered, why)] = &status.undelivered[..] else { panic!("{:?}", status.undelivered) };
    assert!(*undelivered == id && *why == RequestRefusal::OtherRun, "{why}");

    // What is made on the new plant is done, so the refused one had its time.
    let again = write(&session.snapshots.borrow(), 2);
    assert_eq!(again.expected_value, before, "nothing was written");
    let id = again.id;
    session.send(Request::Command(again, None)).unwrap();
    until(&mut session, "an outcome", |snapshot| ended(snapshot, id)).await;
    assert_eq!(of(&session.snapshots.borrow(), id).unwrap().outcome, Outcome::Verified);
    drop(session);
    station.stop().await;
}
