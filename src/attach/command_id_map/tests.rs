//! One terminal to its operator, whatever numbers the station gives it.
#![allow(clippy::unwrap_used)]

use std::sync::Arc;

use super::*;
use crate::plant::alarm::AlarmCommand;
use crate::{plant::command::CommandKind, ui::fixture::Fixture};

const NOT_CONFIRMED: Outcome = Outcome::NotConfirmed(NotConfirmed::ConnectionLost);

fn request(terminal: u32, number: u32) -> Command {
    Command::new(1, CommandId { terminal, number }, CommandKind::Alarm(AlarmCommand::Silence))
}

fn snapshot(commands: &[(u32, u32, Outcome)]) -> Arc<Snapshot> {
    let mut snapshot = Snapshot::clone(&Fixture::normal().snapshot());
    let at = snapshot.at;
    let of = |(terminal, number, outcome): &(u32, u32, Outcome)| {
        status(&request(*terminal, *number), "anna".into(), at, outcome.clone())
    };
    snapshot.commands = commands.iter().map(of).collect();
    Arc::new(snapshot)
}

fn seen(id_map: &mut CommandIdMap, commands: &[(u32, u32, Outcome)]) -> Vec<(u32, u32, Outcome)> {
    let seen = id_map.apply(&snapshot(commands));
    seen.commands
        .iter()
        .map(|status| (status.command.id.terminal, status.command.id.number, status.outcome.clone()))
        .collect()
}

fn send(id_map: &mut CommandIdMap, number: u32) -> CommandId {
    id_map.send(request(id_map.terminal, number), "anna".into(), Fixture::normal().snapshot().at).id
}

#[test]
fn own_commands_keep_their_number_over_connections() {
    let mut id_map = CommandIdMap::new(1, 3);
    assert_eq!(send(&mut id_map, 1), CommandId { terminal: 3, number: 1 });
    // The station was restarted: this terminal is 1 now, and another one is 3.
    id_map.on_disconnected();
    id_map.on_connected(2, 1);
    assert_eq!(send(&mut id_map, 2), CommandId { terminal: 1, number: 2 });
    let commands = [(1, 2, Outcome::Verified), (3, 9, Outcome::Verified), (4, 7, Outcome::Verified)];
    let lost = (3, 1, NOT_CONFIRMED);
    let expected = [lost, (3, 2, Outcome::Verified), (1, 9, Outcome::Verified), (4, 7, Outcome::Verified)];
    assert_eq!(seen(&mut id_map, &commands), expected);
}

#[test]
fn the_outcome_of_a_command_survives_a_reconnect() {
    let mut id_map = CommandIdMap::new(1, 3);
    send(&mut id_map, 1);
    id_map.on_disconnected();
    assert_eq!(seen(&mut id_map, &[]), [(3, 1, NOT_CONFIRMED)], "not known yet");
    id_map.on_connected(1, 5);
    assert_eq!(seen(&mut id_map, &[(3, 1, Outcome::Verified)]), [(3, 1, Outcome::Verified)]);
    assert_eq!(send(&mut id_map, 2), CommandId { terminal: 5, number: 2 });
    assert_eq!(seen(&mut id_map, &[(5, 2, Outcome::Pending)]), [(3, 2, Outcome::Pending)]);
}

#[test]
fn a_pending_command_is_uncertain_until_the_station_is_back() {
    let under_way = [(3, 1, Outcome::Pending), (2, 1, Outcome::Verified)];
    let uncertain = [(3, 1, NOT_CONFIRMED), (2, 1, Outcome::Verified)];
    let begun = || {
        let mut id_map = CommandIdMap::new(1, 3);
        send(&mut id_map, 1);
        assert_eq!(seen(&mut id_map, &under_way), under_way);
        id_map.on_disconnected();
        assert_eq!(seen(&mut id_map, &under_way), uncertain, "the last snapshot is not final");
        id_map
    };
    let mut same = begun();
    same.on_connected(1, 5);
    assert_eq!(seen(&mut same, &under_way), under_way);
    same.on_disconnected();
    assert_eq!(seen(&mut same, &under_way), uncertain, "a second time as well");
    same.on_connected(1, 6);
    assert_eq!(seen(&mut same, &[(3, 1, Outcome::Verified)]), [(3, 1, Outcome::Verified)]);
    let mut another = begun();
    another.on_connected(2, 3);
    assert_eq!(seen(&mut another, &[]), uncertain[..1], "a new station does not know it");
}

#[test]
fn an_undelivered_command_is_listed_with_its_reason() {
    let mut id_map = CommandIdMap::new(1, 3);
    let id = send(&mut id_map, 1);
    id_map.on_undelivered(id, RequestRefusal::StationBusy);
    id_map.on_undelivered(id, RequestRefusal::StationBusy);
    id_map.refuse(request(3, 2).id, RequestRefusal::StationGone);
    let undelivered = [(id, RequestRefusal::StationBusy), (request(3, 2).id, RequestRefusal::StationGone)];
    assert_eq!(id_map.undelivered(), undelivered);
    assert_eq!(seen(&mut id_map, &[]), [], "the plant has not seen them");
    for number in 3..200 {
        send(&mut id_map, number);
    }
    id_map.on_disconnected();
    assert_eq!(seen(&mut id_map, &[]).len(), COMMANDS_MAX, "what is remembered is bounded");
}

#[test]
fn a_snapshot_without_own_news_is_not_copied() {
    let mut id_map = CommandIdMap::new(1, 3);
    let snapshot = snapshot(&[(3, 1, Outcome::Verified), (2, 1, Outcome::Verified)]);
    assert!(Arc::ptr_eq(&id_map.apply(&snapshot), &snapshot));
}
