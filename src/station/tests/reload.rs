//! A whole station whose files are reloaded.

use super::*;
use crate::{
    access::{SessionEnd, io::users},
    plant::{
        PlantDef,
        calculation_def::{Calculation, OverTime},
        def::TagId,
        expr::Expr,
        tag::TagDef,
        totalizer::Total,
    },
    station::io::{Reloaded, Station},
};

/// What the command line does with files that were read; `false` where nothing has changed.
async fn reload(station: &mut Station, new: Reloaded) -> bool {
    let Some(prepared) = station.prepare_reload(new).unwrap() else { return false };
    station.end_what_changes(&prepared).await;
    station.reload(prepared).await;
    true
}

fn reloaded(def: PlantDef) -> Reloaded {
    let connectors = def.lines.iter().map(|line| Connector::Real(line.transport.clone())).collect();
    Reloaded { def: Arc::new(def), connectors, file: None, users: None }
}

/// The fixture with the hours that the PLC has run.
fn with_hours() -> (PlantDef, TagId) {
    let (mut def, id) = (fixture::plant(), TagId(5));
    let (text, over_time) = ("on_time(PLC-1.RUN)".into(), Some(OverTime::Total(Total::OnTime)));
    let calculation = Some(Arc::new(Calculation { text, over_time, expr: Expr::Tag(fixture::RUN) }));
    let run = def.tags[fixture::RUN.index()].clone();
    def.tags.push(TagDef { id, name: "PLC-1.HOURS".into(), calculation, ..run });
    (def, id)
}

#[tokio::test(flavor = "multi_thread")]
async fn a_total_that_is_new_begins_and_terminals_of_before_go() {
    let folder = tempfile::tempdir().unwrap();
    let mut station = start_guarded(options(&folder.path().join("fixture.duckdb"))).unwrap();
    let mut session = station.session("whoever");
    session.status.wait_for(|status| status.password_chars_min > 0).await.unwrap();
    assert!(!reload(&mut station, reloaded(fixture::plant())).await, "it is the same");
    let run = session.snapshots.borrow().run;
    let (def, hours) = with_hours();
    assert!(reload(&mut station, reloaded(def)).await);
    let gone = session.status.wait_for(|status| status.gone.is_some()).await.unwrap().gone.clone();
    assert_eq!(gone, Some(SessionEnd::PlantReloaded));
    let begun =
        |snapshot: &Arc<crate::plant::Snapshot>| snapshot.run != run && snapshot.sample(hours).value == Some(0.0);
    session.snapshots.wait_for(begun).await.unwrap();
    drop(session);
    station.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_restored_users_file_is_taken_while_the_station_runs() {
    let folder = tempfile::tempdir().unwrap();
    let history = folder.path().join("fixture.duckdb");
    assert!(without_users(&history).await.2.is_ok(), "the first Supervisor");
    let (path, password) = (users_beside(&history), "eight wet horses in a tank");
    let good = std::fs::read(&path).unwrap();
    std::fs::write(&path, &good[..good.len() / 2]).unwrap();
    let mut station = start_guarded(options(&history)).unwrap();
    let login = || SessionRequest::Login { user: "eve".into(), password: password.into() };
    let session = station.session("whoever");
    assert!(session.request(login()).await.is_err_and(|why| matches!(why, RequestRefusal::LoginDisabled(_))));
    std::fs::write(&path, &good).unwrap();
    let with = |users| Reloaded { users: Some((None, users)), ..reloaded(fixture::plant()) };
    let restored = users::read(&path).unwrap();
    assert!(reload(&mut station, with(restored.clone())).await);
    let session = station.session("whoever");
    session.request(login()).await.unwrap();
    // What was read before these were taken is not newer than they are.
    assert!(reload(&mut station, with(restored)).await);
    assert_eq!(session.request(SessionRequest::Active).await.map(drop), Ok(()), "nobody is sent away");
    drop(session);
    station.stop().await;
}
