//! One terminal to its operator, whatever numbers the station gives it.
#![allow(clippy::unwrap_used)]

use std::sync::Arc;

use super::*;
use crate::plant::alarm::AlarmCommand;
use crate::{plant::command::CommandKind, ui::fixture::Fixture};

const NOT_CONFIRMED: Outcome = Outcome::NotConfirmed(NotConfirmed::ConnectionLost);

fn request(terminal: u32, number: u32) -> OrderRequest {
    OrderRequest::new(1, OrderId { terminal, number }, CommandKind::Alarm(AlarmCommand::Silence))
}

fn snapshot(orders: &[(u32, u32, Outcome)]) -> Arc<Snapshot> {
    let mut snapshot = Snapshot::clone(&Fixture::normal().snapshot());
    let at = snapshot.at;
    let of = |(terminal, number, outcome): &(u32, u32, Outcome)| {
        status(&request(*terminal, *number), "anna".into(), at, outcome.clone())
    };
    snapshot.orders = orders.iter().map(of).collect();
    Arc::new(snapshot)
}

fn seen(own: &mut Own, orders: &[(u32, u32, Outcome)]) -> Vec<(u32, u32, Outcome)> {
    let seen = own.see(&snapshot(orders));
    seen.orders.iter().map(|order| (order.id.terminal, order.id.number, order.outcome.clone())).collect()
}

fn send(own: &mut Own, number: u32) -> OrderId {
    own.send(request(own.terminal(), number), "anna".into(), Fixture::normal().snapshot().at).id
}

#[test]
fn own_orders_keep_their_number_and_nobody_elses_are_taken_for_own() {
    let mut own = Own::new(1, 3);
    assert_eq!(send(&mut own, 1), OrderId { terminal: 3, number: 1 });
    // The station was started anew: this terminal is 1 now, and somebody else is 3.
    own.gone();
    own.welcomed(2, 1);
    assert_eq!(send(&mut own, 2), OrderId { terminal: 1, number: 2 });
    let orders = [(1, 2, Outcome::Verified), (3, 9, Outcome::Verified), (4, 7, Outcome::Verified)];
    let lost = (3, 1, NOT_CONFIRMED);
    let expected = [lost, (3, 2, Outcome::Verified), (1, 9, Outcome::Verified), (4, 7, Outcome::Verified)];
    assert_eq!(seen(&mut own, &orders), expected);
}

#[test]
fn the_outcome_of_an_order_from_before_a_break_is_found_again() {
    let mut own = Own::new(1, 3);
    send(&mut own, 1);
    own.gone();
    assert_eq!(seen(&mut own, &[]), [(3, 1, NOT_CONFIRMED)], "not known yet");
    own.welcomed(1, 5);
    assert_eq!(seen(&mut own, &[(3, 1, Outcome::Verified)]), [(3, 1, Outcome::Verified)]);
    assert_eq!(send(&mut own, 2), OrderId { terminal: 5, number: 2 });
    assert_eq!(seen(&mut own, &[(5, 2, Outcome::Pending)]), [(3, 2, Outcome::Pending)]);
}

#[test]
fn an_order_under_way_when_the_station_goes_is_uncertain_until_the_same_station_tells_more() {
    let under_way = [(3, 1, Outcome::Pending), (2, 1, Outcome::Verified)];
    let uncertain = [(3, 1, NOT_CONFIRMED), (2, 1, Outcome::Verified)];
    let begun = || {
        let mut own = Own::new(1, 3);
        send(&mut own, 1);
        assert_eq!(seen(&mut own, &under_way), under_way);
        own.gone();
        assert_eq!(seen(&mut own, &under_way), uncertain, "the last snapshot does not stand for ever");
        own
    };
    let mut same = begun();
    same.welcomed(1, 5);
    assert_eq!(seen(&mut same, &under_way), under_way);
    same.gone();
    assert_eq!(seen(&mut same, &under_way), uncertain, "a second time as well");
    same.welcomed(1, 6);
    assert_eq!(seen(&mut same, &[(3, 1, Outcome::Verified)]), [(3, 1, Outcome::Verified)]);
    let mut another = begun();
    another.welcomed(2, 3);
    assert_eq!(seen(&mut another, &[]), uncertain[..1], "a new station has never heard of it");
}

#[test]
fn an_order_that_did_not_arrive_is_refused_in_words() {
    let mut own = Own::new(1, 3);
    let id = send(&mut own, 1);
    own.undelivered(id, "station too busy".to_owned());
    let why = |why: &str| Outcome::Refused(Refusal::NotPermitted(why.to_owned()));
    assert_eq!(seen(&mut own, &[]), [(3, 1, why("station too busy"))]);
    own.refuse(&request(3, 2), "anna".into(), Fixture::normal().snapshot().at, GONE);
    assert_eq!(seen(&mut own, &[]), [(3, 2, why(GONE)), (3, 1, why("station too busy"))]);
    for number in 3..200 {
        send(&mut own, number);
    }
    own.gone();
    assert_eq!(seen(&mut own, &[]).len(), ORDERS_MAX, "what is remembered is bounded");
}

#[test]
fn a_snapshot_without_own_news_is_not_copied() {
    let mut own = Own::new(1, 3);
    let snapshot = snapshot(&[(3, 1, Outcome::Verified), (2, 1, Outcome::Verified)]);
    assert!(Arc::ptr_eq(&own.see(&snapshot), &snapshot));
}
