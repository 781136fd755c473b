//! Keys through `update`: nothing is done unasked, and what was done is shown.

mod numbers;
mod alarms;
mod interlocks;
mod palette;

use std::{sync::Arc, time::Duration};

use crossterm::event::{KeyCode, KeyEvent, KeyModifiers};
use jiff::SignedDuration;

use super::{model, screen, sent_kind, type_keys};
use crate::{
    access::SessionStatus,
    history::{Answer, HistoryError, Query},
    plant::{
        command::{Command, CommandId, CommandKind, CommandStatus, NotConfirmed, Outcome, Refusal},
        def::{AlarmId, Priority},
        fault::Fault,
        line_state::{DeviceState, LineState},
        record::{ActionRecord, AlarmEvent, AlarmRecord},
        request_refusal::RequestRefusal,
        sample::{Cause, Sample},
    },
    ui::{
        Effect, Model, Msg, UiAction,
        fixture::{self, Fixture},
        modal::{Faceplate, Modal},
        perform,
        tabs::Tab,
        theme::Theme,
        update,
    },
};

#[test]
fn an_unreachable_device_is_named_before_anything_is_typed() {
    let check = |fixture: &Fixture, keys: &str, expect: &str| {
        let mut model = model(fixture, Theme::FULL);
        type_keys(&mut model, keys);
        assert!(matches!(model.modal, Some(Modal::Notice(_))), "{keys}: {:?}", model.modal);
        let shown = screen(&mut model, 80, 24);
        assert!(shown.contains(expect), "{expect} is missing:\n{shown}");
        let tab = model.tabs.shown;
        assert_eq!(sent_kind(&type_keys(&mut model, "70⏎")), None);
        assert_eq!((model.tabs.shown, &model.modal), (tab, &None), "a typed number leads nowhere");
    };
    let mut silent = Fixture::normal();
    silent.devices[0].state = DeviceState::Down { since: fixture::now() };
    for keys in ["s", "4⏎↓⏎", "4⏎f", "4⏎T", "4⏎S"] {
        check(&silent, keys, "TIC-1 is not responding");
    }
    check(&Fixture::line_down(), "r", "PLC-1 is not responding");
    let mut closed = Fixture::normal();
    closed.line.state = LineState::Disconnected;
    check(&closed, "s", "Line L1 was disconnected by an operator.");
}

#[test]
fn a_screen_too_small_to_see_takes_no_commands() {
    let fixture = Fixture::alarm();
    let small = |keys: &str| {
        let mut model = model(&fixture, Theme::FULL);
        type_keys(&mut model, keys);
        screen(&mut model, 30, 10);
        model
    };
    for keys in ["s65⏎", "r⏎", "m⏎", "A⏎", "4⏎T↓⏎⏎", "4u", "4L⏎", "?", "5w⏎"] {
        let mut model = small("");
        let shown = model.tabs.shown;
        assert_eq!(type_keys(&mut model, keys), [], "{keys}");
        assert_eq!((&model.modal, model.tabs.shown), (&None, shown), "{keys}");
    }
    for keys in ["s65", "r", "A", "4⏎T↓⏎", "?", "→⏎"] {
        let mut model = small(keys);
        assert_eq!(model.modal, None, "{keys}: a hidden window is closed");
        assert_eq!(type_keys(&mut model, "⏎"), [], "{keys}");
    }
    let mut model = small("3↓↓");
    assert_eq!(sent_kind(&type_keys(&mut model, "a")), Some(&fixture.alarms[0].acknowledge()), "the banner's");
    type_keys(&mut model, "q");
    assert!(screen(&mut model, 30, 10).contains("Quit? ⏎ quit  Esc cancel"));
    assert_eq!(type_keys(&mut model, "⎋"), []);
    assert_eq!(type_keys(&mut model, "q⏎"), [Effect::Quit]);
}

#[test]
fn escape_changes_nothing() {
    for keys in ["s65⎋", "r⎋", "m⎋", "A⎋", "q⎋", "4⏎↓⏎⎋", "4⏎T↓⏎⎋", "4⏎f⏎⎋", "⎋⎋⎋"]
    {
        let mut model = model(&Fixture::alarm(), Theme::FULL);
        let effects = type_keys(&mut model, keys);
        assert!(effects.iter().all(|effect| matches!(effect, Effect::Query(..))), "{keys}: {effects:?}");
        assert_eq!(model.modal, None, "{keys}");
    }
}

#[test]
fn a_toggle_is_asked_and_does_what_it_said() {
    let fixture = Fixture::normal();
    let mut model = model(&fixture, Theme::FULL);
    type_keys(&mut model, "r");
    assert!(screen(&mut model, 80, 24).contains("old RUN  →  new STOP"));
    // Meanwhile someone else stops it: the window says so and asks again, and still writes STOP, not the opposite of
    // what is now.
    let mut later = fixture.clone();
    later.set("PLC-1.RUN", 0.0);
    update(&mut model, Msg::Snapshot(later.snapshot()));
    assert_eq!(type_keys(&mut model, "⏎"), []);
    assert!(screen(&mut model, 80, 24).contains("changed to STOP (was RUN)"));
    let effects = type_keys(&mut model, "⏎");
    assert_eq!(sent_kind(&effects), Some(&CommandKind::Write { tag: fixture.tag("PLC-1.RUN"), value: 0.0.into() }));
}

#[test]
fn a_toggle_of_the_unknown_becomes_a_choice() {
    let mut fixture = Fixture::normal();
    let auto = fixture.tag("PLC-1.AUTO");
    fixture.samples[auto.index()] = Sample::bad(Cause::NotRead, fixture::now());
    let mut model = model(&fixture, Theme::FULL);
    type_keys(&mut model, "m");
    assert!(matches!(model.modal, Some(Modal::Choice(_))));
}

#[test]
fn a_paste_never_acts() {
    let mut model = model(&Fixture::normal(), Theme::FULL);
    for window in ["", "r", "?", "q", "4⏎⏎"] {
        model.modal = None;
        type_keys(&mut model, window);
        let effects = update(&mut model, Msg::Paste("q\ry\r\n1".to_owned()));
        assert_eq!(effects, [], "{window}");
    }
    model.modal = None;
    type_keys(&mut model, "1s");
    assert_eq!(update(&mut model, Msg::Paste("66\r\n".to_owned())), []);
    assert!(model.modal.is_some(), "the pasted line end did not confirm");
    assert!(sent_kind(&type_keys(&mut model, "⏎")).is_some());
}

proptest::proptest! {
    #![proptest_config(proptest::prelude::ProptestConfig::with_cases(200))]

    #[test]
    fn no_key_by_accident_sends_a_command(keys in "[1-5smrqA?fTSLjcM0-9.hlx↑↓←→⎋⇥ ]{1,60}") {
        let mut model = model(&Fixture::alarm(), Theme::FULL);
        screen(&mut model, 80, 24);
        let effects = type_keys(&mut model, &keys);
        proptest::prop_assert_eq!(sent_kind(&effects), None);
        screen(&mut model, 80, 24);
    }
}

#[test]
fn closing_a_line_is_asked_and_opening_it_too() {
    let mut fixture = Fixture::normal();
    let line = fixture.def.lines[0].id;
    for (state, open) in [(LineState::Connected, false), (LineState::Disconnected, true)] {
        fixture.line.state = state;
        let mut model = model(&fixture, Theme::FULL);
        assert_eq!(sent_kind(&type_keys(&mut model, "4D")), None);
        assert_eq!(sent_kind(&type_keys(&mut model, "⏎")), Some(&CommandKind::Connect(line, open)));
    }
}

fn write_action() -> ActionRecord {
    ActionRecord {
        at: fixture::now() - SignedDuration::from_secs(700),
        by: "tech1".into(),
        action: "write".into(),
        target: "TIC-1.SV".into(),
        old: Some("60.0 °C".into()),
        new: Some("70.0 °C".into()),
        outcome: "verified".into(),
        from: "".into(),
        note: None,
        chain_hash: None,
    }
}

#[test]
fn the_journal_lists_alarms_and_actions_in_one_order() {
    let mut model = model(&Fixture::alarm(), Theme::FULL);
    let effects = type_keys(&mut model, "3j");
    let ago = |seconds| fixture::now() - jiff::SignedDuration::from_secs(seconds);
    let step = |seconds, step, by: Option<&str>| AlarmRecord {
        value: Some(72.1.into()),
        limit: Some(72.0),
        by: by.map(Arc::from),
        ..AlarmRecord::new(ago(seconds), "TIC-1.PV", "temperature high", Priority::High, step)
    };
    for effect in effects {
        let Effect::Query(id, query) = effect else { continue };
        let answer = match query {
            Query::Journal { .. } => Answer::Journal(vec![
                step(100, AlarmEvent::Acknowledged, Some("tech1")),
                step(800, AlarmEvent::Raised, None),
                step(90_000, AlarmEvent::Raised, None),
            ]),
            Query::Actions { .. } => Answer::Actions(vec![write_action()]),
            Query::Series { .. }
            | Query::Audit { .. }
            | Query::LineMinutes { .. }
            | Query::Report { .. }
            | Query::AlarmMetrics { .. }
            | Query::Values { .. }
            | Query::Batches { .. }
            | Query::ControlRuns { .. }
            | Query::SampleTime { .. }
            | Query::Reports { .. }
            | Query::Past { .. }
            | Query::Samples { .. }
            | Query::Unarchived { .. }
            | Query::Overview
            | Query::Registers(_) => continue,
        };
        update(&mut model, Msg::Answer(id, Ok(answer)));
    }
    insta::assert_snapshot!("journal_80x24", screen(&mut model, 80, 24));
    insta::assert_snapshot!("journal_120x40", screen(&mut model, 120, 40));
}

#[test]
fn leaving_is_asked() {
    let mut model = model(&Fixture::normal(), Theme::FULL);
    assert_eq!(type_keys(&mut model, "qn"), []);
    assert_eq!(type_keys(&mut model, "q⏎"), [Effect::Quit]);
    let ctrl_c = KeyEvent::new(KeyCode::Char('c'), KeyModifiers::CONTROL);
    assert_eq!(update(&mut model, Msg::Key(ctrl_c)), []);
    assert_eq!(type_keys(&mut model, "y"), [Effect::Quit]);
    // Out of a text entry as well.
    type_keys(&mut model, "s12");
    update(&mut model, Msg::Key(ctrl_c));
    assert_eq!(type_keys(&mut model, "⏎"), [Effect::Quit]);
}

#[test]
fn the_outcome_of_a_command_stays_until_dismissed() {
    let fixture = Fixture::normal();
    let check = |outcome: Outcome, expect: &str| {
        let mut model = model(&fixture, Theme::FULL);
        let effects = type_keys(&mut model, "s60⏎");
        let Some(Effect::Command(Command { id, kind, .. }, _)) = effects.first().cloned() else {
            panic!("{effects:?}")
        };
        let mut snapshot = Arc::unwrap_or_clone(fixture.snapshot());
        snapshot.commands = vec![CommandStatus {
            old: Some(70.0.into()),
            outcome,
            ..CommandStatus::new(Command::new(0, id, kind), "tech1", snapshot.at)
        }];
        update(&mut model, Msg::Snapshot(Arc::new(snapshot)));
        // The station forgets old commands; the terminal still knows its own.
        update(&mut model, Msg::Snapshot(fixture.snapshot()));
        let shown = screen(&mut model, 80, 24);
        assert!(shown.contains(expect), "{expect} is missing:\n{shown}");
        type_keys(&mut model, "⎋");
        assert!(!screen(&mut model, 80, 24).contains("TIC-1.SV 70.0"));
    };
    check(Outcome::Pending, "TIC-1.SV 70.0 → 60.0 °C  pending");
    check(Outcome::Verified, "TIC-1.SV 70.0 → 60.0 °C  verified 14:02:31");
    check(Outcome::Unchanged, "unchanged, nothing written");
    check(Outcome::Refused(Refusal::ReadOnly), "REFUSED: read only");
    check(Outcome::NotConfirmed(NotConfirmed::Different(65.0.into())), "NOT CONFIRMED: read back 65");
    check(Outcome::NotConfirmed(NotConfirmed::NoReadBack), "accepted (cannot be read back)");
    check(Outcome::Failed(Fault::Timeout), "FAILED, may have taken effect");
}

#[test]
fn only_what_was_read_back_is_called_verified() {
    let fixture = Fixture::alarm();
    let device = fixture.def.devices[0].id;
    let check = |kind: CommandKind, expect: &str| {
        let mut model = model(&fixture, Theme::FULL);
        perform(&mut model, vec![UiAction::Command(kind.clone())]);
        let mut snapshot = Arc::unwrap_or_clone(fixture.snapshot());
        snapshot.commands = vec![CommandStatus {
            outcome: Outcome::Verified,
            ..CommandStatus::new(
                Command::new(0, model.last_command.as_ref().expect("the command is pending").command.id, kind),
                "tech1",
                snapshot.at,
            )
        }];
        update(&mut model, Msg::Snapshot(Arc::new(snapshot)));
        let shown = screen(&mut model, 80, 24);
        assert!(shown.contains(expect), "{expect} is missing:\n{shown}");
    };
    check(CommandKind::Refresh(device), "refresh TIC-1  requested 14:02:31");
    check(fixture.alarms[0].acknowledge(), "temperature high  done 14:02:31");
}

#[test]
fn a_good_outcome_goes_after_a_minute_and_a_bad_one_stays() {
    let fixture = Fixture::normal();
    let check = |outcome: Outcome, stays: bool| {
        let mut model = model(&fixture, Theme::FULL);
        let effects = type_keys(&mut model, "s60⏎");
        let Some(Effect::Command(Command { id, kind, .. }, _)) = effects.first().cloned() else {
            panic!("{effects:?}")
        };
        let mut snapshot = Arc::unwrap_or_clone(fixture.snapshot());
        let status = CommandStatus {
            old: Some(70.0.into()),
            outcome,
            ..CommandStatus::new(Command::new(0, id, kind), "tech1", snapshot.at)
        };
        snapshot.commands = vec![status];
        update(&mut model, Msg::Snapshot(Arc::new(snapshot)));
        let mut after = |ticks: usize| {
            (0..ticks).for_each(|_| drop(update(&mut model, Msg::Tick { silent: Duration::ZERO })));
            screen(&mut model, 80, 24).contains("14:02:31 ─") || screen(&mut model, 80, 24).contains("─ 14:02:31 ")
        };
        assert!(after(119));
        assert_eq!(after(1), stays);
    };
    check(Outcome::Verified, false);
    check(Outcome::Refused(Refusal::ReadOnly), true);
    check(Outcome::Failed(Fault::Timeout), true);
}

#[test]
fn a_command_that_was_never_sent_is_reported() {
    let mut model = model(&Fixture::normal(), Theme::FULL);
    let effects = type_keys(&mut model, "s60⏎");
    let Some(Effect::Command(Command { id, .. }, _)) = effects.first() else { panic!("{effects:?}") };
    update(&mut model, Msg::Undelivered(*id, RequestRefusal::StationBusy));
    assert!(screen(&mut model, 80, 24).contains("NOT SENT: station too busy"));
}

#[test]
fn a_command_that_the_plant_did_not_take_is_reported() {
    let mut model = model(&Fixture::normal(), Theme::FULL);
    let effects = type_keys(&mut model, "s60⏎");
    let Some(Effect::Command(Command { id, .. }, _)) = effects.first() else { panic!("{effects:?}") };
    let mut session = SessionStatus::clone(&model.session);
    session.undelivered = vec![(CommandId { number: id.number + 1, ..*id }, RequestRefusal::TooManyRequests)];
    update(&mut model, Msg::SessionStatus(session.clone().into()));
    assert!(screen(&mut model, 80, 24).contains("sent …"));
    session.undelivered.push((*id, RequestRefusal::StationBusy));
    update(&mut model, Msg::SessionStatus(session.into()));
    assert!(screen(&mut model, 80, 24).contains("NOT SENT: station too busy"));
}
