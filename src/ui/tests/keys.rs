//! Keys through `update`: nothing is done unasked, and what was done is told.

use std::{sync::Arc, time::Duration};

use crossterm::event::{KeyCode, KeyEvent, KeyModifiers};
use jiff::SignedDuration;

use super::{model, screen, sent_kind, type_keys};
use crate::{
    history::{Answer, HistoryError, Query},
    plant::{
        command::{Command, CommandId, CommandKind, CommandStatus, NotConfirmed, Outcome, Refusal},
        def::{AlarmId, Priority},
        event::{Fault, LineState},
        record::{ActionRecord, AlarmEvent, AlarmRecord},
        sample::{Cause, Sample},
        snapshot::DeviceState,
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
fn a_number_is_written_only_after_enter() {
    let fixture = Fixture::normal();
    let mut model = model(&fixture, Theme::FULL);
    assert_eq!(type_keys(&mut model, "s65.5"), []);
    let effects = type_keys(&mut model, "⏎");
    assert_eq!(sent_kind(&effects), Some(&CommandKind::Write { tag: fixture.tag("TIC-1.SV"), value: 65.5 }));
    assert_eq!(model.modal, None);
    assert!(screen(&mut model, 80, 24).contains("TIC-1.SV ? → 65.5 °C  sent"));
}

#[test]
fn what_is_typed_is_what_is_written_or_refused() {
    let fixture = Fixture::normal();
    let check = |keys: &str, expect: Result<f64, &str>| {
        let mut model = model(&fixture, Theme::FULL);
        let command = sent_kind(&type_keys(&mut model, keys)).cloned();
        let shown = screen(&mut model, 80, 24);
        match expect {
            Ok(value) => {
                assert_eq!(command, Some(CommandKind::Write { tag: fixture.tag("TIC-1.SV"), value }), "{keys}")
            }
            Err(words) => {
                assert_eq!(command, None, "{keys}");
                assert!(shown.contains(words), "{words} is missing:\n{shown}");
            }
        }
    };
    check("s63,5⏎", Ok(63.5));
    check("s+1⏎", Ok(71.0));
    check("s+5⏎", Err("beyond the alarm limit of TIC-1.PV temperature high (72.0 °C)"));
    check("s3,5⏎", Err("a step of 66.5 °C, 55 % of the range"));
    check("s3,5⏎⏎", Ok(3.5));
    check("s7OO", Err("\"O\" is no part of a number"));
    check("s7OO⏎", Err("not all of it was taken"));
    check("s1e5⏎", Err("not all of it was taken"));
    check("s7 0", Err("a blank is no part of a number"));
    check("s7-0⏎", Err("\"7-0\" is no number"));
    check(&format!("s{}⏎", "7".repeat(70)), Err("not all of it was taken"));
}

#[test]
fn a_device_that_does_not_answer_is_said_so_before_anything_is_typed() {
    let check = |fixture: &Fixture, keys: &str, expect: &str| {
        let mut model = model(fixture, Theme::FULL);
        type_keys(&mut model, keys);
        assert!(matches!(model.modal, Some(Modal::Notice(_))), "{keys}: {:?}", model.modal);
        let shown = screen(&mut model, 80, 24);
        assert!(shown.contains(expect), "{expect} is missing:\n{shown}");
        assert_eq!(sent_kind(&type_keys(&mut model, "70⏎")), None);
    };
    let mut silent = Fixture::normal();
    silent.devices[0].state = DeviceState::Down { since: fixture::now() };
    for keys in ["s", "4⏎↓⏎", "4⏎f", "4⏎T", "4⏎S"] {
        check(&silent, keys, "TIC-1 is not answering");
    }
    check(&Fixture::line_down(), "r", "PLC-1 is not answering");
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
        screen(&mut model, 50, 10);
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
        assert_eq!(model.modal, None, "{keys}: a window that nobody sees is closed");
        assert_eq!(type_keys(&mut model, "⏎"), [], "{keys}");
    }
    let mut model = small("3↓↓");
    assert_eq!(sent_kind(&type_keys(&mut model, "a")), Some(&fixture.alarms[0].acknowledge()), "the banner's");
    type_keys(&mut model, "q");
    assert!(screen(&mut model, 50, 10).contains("Quit? ⏎ quit  Esc stay"));
    assert_eq!(type_keys(&mut model, "⎋"), []);
    assert_eq!(type_keys(&mut model, "q⏎"), [Effect::Quit]);
}

fn faceplate(fixture: &Fixture, tag: &str) -> Model {
    let mut model = model(fixture, Theme::FULL);
    model.modal = Faceplate::new("it", vec![fixture.tag(tag)]).map(Modal::Faceplate);
    model
}

#[test]
fn a_pump_is_switched_by_its_manual_command() {
    let mut fixture = Fixture::normal();
    for (auto, told) in [(1.0, true), (0.0, false)] {
        fixture.set("PLC-1.AUTO", auto);
        let mut model = faceplate(&fixture, "PLC-1.P-1");
        let shown = screen(&mut model, 80, 24);
        assert!(shown.contains("t ON P-1"), "{shown}");
        assert_eq!(shown.contains("effective in MANUAL only (PLC-1.AUTO is AUTO)"), told, "{shown}");
        assert_eq!(sent_kind(&type_keys(&mut model, "⏎↓⏎")), None, "asks first");
        let shown = screen(&mut model, 80, 24);
        assert_eq!(shown.contains("! effective in MANUAL only (PLC-1.AUTO is AUTO)"), told, "{shown}");
        let command = CommandKind::Write { tag: fixture.tag("PLC-1.MAN.P-1"), value: 1.0 };
        assert_eq!(sent_kind(&type_keys(&mut model, "⏎")), Some(&command));
    }
    // One without such a command has nothing to write.
    let mut model = faceplate(&fixture, "PLC-1.SV-1");
    type_keys(&mut model, "⏎t");
    assert!(matches!(model.modal, Some(Modal::Faceplate(_))));
}

#[test]
fn in_auto_the_change_to_manual_is_a_step_of_its_own() {
    let mut fixture = Fixture::normal();
    fixture.set("PLC-1.AUTO", 1.0);
    let mut model = faceplate(&fixture, "PLC-1.P-1");
    type_keys(&mut model, "t");
    let shown = screen(&mut model, 80, 24);
    assert!(shown.contains("old AUTO  →  new MANUAL"), "{shown}");
    assert!(shown.contains("PLC-1.MAN.P-1 has no effect now"), "{shown}");
    assert!(shown.contains("The commands by hand take over; no output changes."), "{shown}");
    let command = CommandKind::Write { tag: fixture.tag("PLC-1.AUTO"), value: 0.0 };
    assert_eq!(sent_kind(&type_keys(&mut model, "⏎")), Some(&command));
    assert!(matches!(model.modal, Some(Modal::Faceplate(_))), "back where it was asked from");
    assert_eq!(sent_kind(&type_keys(&mut model, "⏎⏎")), None, "further Enters send nothing that was not asked");
    let mut model = faceplate(&fixture, "PLC-1.P-1");
    type_keys(&mut model, "t⎋");
    assert!(matches!(model.modal, Some(Modal::Faceplate(_))), "Esc takes one step back");
    type_keys(&mut model, "⎋");
    assert_eq!(model.modal, None);
    // In MANUAL the same key asks for the command itself, and only the Enter after it sends it.
    fixture.set("PLC-1.AUTO", 0.0);
    let mut model = faceplate(&fixture, "PLC-1.P-1");
    assert_eq!(sent_kind(&type_keys(&mut model, "tt")), None, "a key pressed twice sends nothing");
    let command = CommandKind::Write { tag: fixture.tag("PLC-1.MAN.P-1"), value: 1.0 };
    assert_eq!(sent_kind(&type_keys(&mut model, "⏎")), Some(&command));
}

#[test]
fn what_manual_changes_at_once_is_told_before() {
    let mut fixture = Fixture::normal();
    fixture.set("PLC-1.AUTO", 1.0);
    fixture.set("PLC-1.MAN.P-1", 1.0);
    for (level, words) in [(12.0, "take over: P-1 STOP → ON."), (19.5, "take over: P-1 STOP → ON, blocked.")] {
        fixture.set("PLC-1.TK-2", level);
        let mut model = model(&fixture, Theme::FULL);
        type_keys(&mut model, "m");
        let shown = screen(&mut model, 80, 24);
        assert!(shown.contains(words), "{shown}");
    }
}

#[test]
fn a_mode_that_is_changed_under_the_question_is_told_in_it() {
    let mut fixture = Fixture::normal();
    fixture.set("PLC-1.AUTO", 0.0);
    let mut model = faceplate(&fixture, "PLC-1.P-1");
    type_keys(&mut model, "t");
    assert!(!screen(&mut model, 80, 24).contains("acts in MANUAL only"));
    fixture.set("PLC-1.AUTO", 1.0);
    update(&mut model, Msg::Snapshot(fixture.snapshot()));
    assert!(screen(&mut model, 80, 24).contains("! effective in MANUAL only (PLC-1.AUTO is AUTO)"));
}

#[test]
fn a_line_that_goes_down_under_the_question_is_told_in_it() {
    let mut fixture = Fixture::normal();
    fixture.set("PLC-1.AUTO", 0.0);
    let mut model = faceplate(&fixture, "PLC-1.P-1");
    type_keys(&mut model, "t");
    update(&mut model, Msg::Snapshot(Fixture::line_down().snapshot()));
    let shown = screen(&mut model, 80, 24);
    assert!(shown.contains("! Nothing can be written now. Line L1 is not connected"), "{shown}");
    // Asked while it is down, there is nothing to confirm.
    let mut model = faceplate(&Fixture::line_down(), "PLC-1.P-1");
    type_keys(&mut model, "t");
    assert!(matches!(model.modal, Some(Modal::Notice(_))));
    assert_eq!(sent_kind(&type_keys(&mut model, "⏎⏎t⏎")), None);
}

#[test]
fn all_actuators_are_in_one_window() {
    let mut model = model(&Fixture::normal(), Theme::FULL);
    type_keys(&mut model, "C");
    let shown = screen(&mut model, 80, 24);
    assert!(shown.contains("─ commands ─") && shown.contains("command  PLC-1.MAN.P-1 OFF"), "{shown}");
}

#[test]
fn what_an_interlock_blocks_is_told_and_not_sent() {
    let mut fixture = Fixture::normal();
    fixture.set("PLC-1.AUTO", 0.0);
    fixture.set("PLC-1.TK-2", 19.5);
    let mut model = faceplate(&fixture, "PLC-1.P-1");
    let reason = "⊘ no pumping into a full tank: PLC-1.TK-2 is 19.5 l";
    assert!(screen(&mut model, 80, 24).contains(reason));
    type_keys(&mut model, "t");
    let shown = screen(&mut model, 80, 24);
    assert!(shown.contains(reason) && shown.contains("This is not sent"), "{shown}");
    assert!(!shown.contains("write and verify"), "no key is offered that does nothing");
    assert_eq!(sent_kind(&type_keys(&mut model, "⏎y")), None);
    // The tank is emptied while the query stands: then it may be sent.
    fixture.set("PLC-1.TK-2", 12.0);
    update(&mut model, Msg::Snapshot(fixture.snapshot()));
    assert!(sent_kind(&type_keys(&mut model, "⏎")).is_some());
    // What nobody can tell is told, and left to the PLC.
    let level = fixture.tag("PLC-1.TK-2");
    fixture.samples[level.index()] = Sample::bad(Cause::Timeout, fixture::now());
    let mut model = faceplate(&fixture, "PLC-1.P-1");
    type_keys(&mut model, "t");
    let shown = screen(&mut model, 80, 24);
    assert!(shown.contains("? unknown: PLC-1.TK-2 is not good"), "{shown}");
    assert!(sent_kind(&type_keys(&mut model, "⏎")).is_some());
}

#[test]
fn a_key_that_is_sent_first_is_named_before_it_is() {
    let mut fixture = Fixture::normal();
    let (pump, key) = (fixture.tag("PLC-1.MAN.P-1"), fixture.tag("PLC-1.P-1"));
    fixture.def.tags[pump.index()].write_unlock = Some((key, 1.0));
    fixture.set("PLC-1.AUTO", 0.0);
    for (now, told) in [(0.0, true), (1.0, false)] {
        fixture.set("PLC-1.P-1", now);
        let mut model = faceplate(&fixture, "PLC-1.P-1");
        type_keys(&mut model, "t");
        let shown = screen(&mut model, 80, 24);
        assert_eq!(shown.contains("First PLC-1.P-1 := RUN; it stays so."), told, "{now}: {shown}");
    }
}

#[test]
fn a_stop_takes_two_keys_and_says_what_it_switches_off() {
    let mut fixture = Fixture::normal();
    fixture.set("PLC-1.P-1", 1.0);
    let stop = CommandKind::Write { tag: fixture.tag("PLC-1.RUN"), value: 0.0 };
    let mut model = model(&fixture, Theme::FULL);
    type_keys(&mut model, "r");
    let shown = screen(&mut model, 80, 24);
    assert!(shown.contains("The sequence stops in HEAT.") && shown.contains("Off go: P-1 RUN."), "{shown}");
    assert_eq!(sent_kind(&type_keys(&mut model, "⏎")), Some(&stop));
    // Also while nobody knows whether it runs.
    let run = fixture.tag("PLC-1.RUN");
    fixture.samples[run.index()] = Sample::bad(Cause::NotRead, fixture::now());
    let mut model = self::model(&fixture, Theme::FULL);
    assert_eq!(sent_kind(&type_keys(&mut model, "r⏎")), Some(&stop));
}

#[test]
fn a_stop_need_not_wait_for_a_window_to_close() {
    let mut fixture = Fixture::normal();
    fixture.set("PLC-1.AUTO", 0.0);
    let stop = CommandKind::Write { tag: fixture.tag("PLC-1.RUN"), value: 0.0 };
    for before in ["", "t"] {
        let mut model = faceplate(&fixture, "PLC-1.P-1");
        type_keys(&mut model, before);
        assert_eq!(sent_kind(&type_keys(&mut model, "r")), None, "it asks all the same");
        assert_eq!(sent_kind(&type_keys(&mut model, "⏎")), Some(&stop));
    }
}

#[test]
fn the_sequence_says_where_it_goes_on() {
    let mut fixture = Fixture::normal();
    fixture.set("PLC-1.AUTO", 0.0);
    for (run, words) in [(1.0, "goes on with HEAT"), (0.0, "once it is started")] {
        fixture.set("PLC-1.RUN", run);
        let mut model = model(&fixture, Theme::FULL);
        type_keys(&mut model, "m");
        let shown = screen(&mut model, 80, 24);
        assert!(shown.contains("MANUAL  →  new AUTO") && shown.contains(words), "{shown}");
    }
}

#[test]
fn a_start_says_what_it_begins_with() {
    let mut fixture = Fixture::normal();
    fixture.set("PLC-1.RUN", 0.0);
    for (auto, words) in [(1.0, "The sequence starts with FILL."), (0.0, "In manual no step starts")] {
        fixture.set("PLC-1.AUTO", auto);
        let mut model = model(&fixture, Theme::FULL);
        type_keys(&mut model, "r");
        let shown = screen(&mut model, 80, 24);
        assert!(shown.contains(words), "{shown}");
    }
}

#[test]
fn the_mimic_shows_how_a_command_went() {
    let mut fixture = Fixture::normal();
    fixture.set("PLC-1.AUTO", 0.0);
    let tag = fixture.tag("PLC-1.MAN.P-1");
    let id = CommandId { terminal: 9, number: 1 };
    let check = |fixture: &Fixture, outcome: Option<Outcome>, disobeys: bool, expect: &str| {
        let mut snapshot = Arc::unwrap_or_clone(fixture.snapshot());
        let kind = CommandKind::Write { tag, value: 1.0 };
        let at = snapshot.at;
        let status = |outcome| CommandStatus {
            old: Some(0.0),
            outcome,
            ..CommandStatus::new(Command::new(0, id, kind), "b", at)
        };
        snapshot.commands = outcome.map(status).into_iter().collect();
        if disobeys {
            let samples = snapshot.samples.clone();
            let since = at - SignedDuration::from_secs(8);
            snapshot.watch.look(&snapshot.def.logic, |tag| samples[tag.index()], since);
        }
        let mut model = model(fixture, Theme::FULL);
        update(&mut model, Msg::Snapshot(Arc::new(snapshot)));
        let shown = screen(&mut model, 80, 24);
        assert!(shown.contains(expect), "{expect}:\n{shown}");
    };
    check(&fixture, Some(Outcome::Pending), false, "… sent");
    check(&fixture, Some(Outcome::Failed(Fault::Timeout)), false, "✗ failed");
    check(&fixture, Some(Outcome::Refused(Refusal::ReadOnly)), false, "✗ refused");
    check(&fixture, Some(Outcome::Verified), false, "✓ done");
    check(&fixture, Some(Outcome::NotConfirmed(NotConfirmed::NoReadBack)), false, "✓ accepted");
    fixture.set("PLC-1.MAN.P-1", 1.0);
    check(&fixture, None, true, "≠ not ON");
    fixture.set("PLC-1.MAN.P-1", 0.0);
    fixture.set("PLC-1.TK-2", 19.5);
    check(&fixture, None, false, "⊘ blocked");
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
    assert_eq!(sent_kind(&effects), Some(&CommandKind::Write { tag: fixture.tag("PLC-1.RUN"), value: 0.0 }));
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
        assert_eq!(sent_kind(&type_keys(&mut model, "4L")), None);
        assert_eq!(sent_kind(&type_keys(&mut model, "⏎")), Some(&CommandKind::Connect(line, open)));
    }
}

#[test]
fn the_journal_lists_alarms_and_actions_in_one_order() {
    let mut model = model(&Fixture::alarm(), Theme::FULL);
    let effects = type_keys(&mut model, "3j");
    let ago = |seconds| fixture::now() - jiff::SignedDuration::from_secs(seconds);
    let step = |seconds, step, by: Option<&str>| AlarmRecord {
        at: ago(seconds),
        subject: "TIC-1.PV".into(),
        message: "temperature high".into(),
        priority: Priority::High,
        event: step,
        value: Some(72.1),
        limit: Some(72.0),
        by: by.map(Arc::from),
        reason: None,
        until: None,
        first_out: None,
    };
    let action = ActionRecord {
        at: ago(700),
        by: "tech1".into(),
        action: "write".into(),
        target: "TIC-1.SV".into(),
        old: Some("60.0 °C".into()),
        new: Some("70.0 °C".into()),
        outcome: "verified".into(),
        from: "".into(),
        note: None,
        chain_hash: None,
    };
    for effect in effects {
        let Effect::Query(id, query) = effect else { continue };
        let answer = match query {
            Query::Journal { .. } => Answer::Journal(vec![
                step(100, AlarmEvent::Acknowledged, Some("tech1")),
                step(800, AlarmEvent::Raised, None),
                step(90_000, AlarmEvent::Raised, None),
            ]),
            Query::Actions { .. } => Answer::Actions(vec![action.clone()]),
            Query::Series { .. }
            | Query::Audit { .. }
            | Query::LineMinutes { .. }
            | Query::Report { .. }
            | Query::AlarmMetrics { .. }
            | Query::Values { .. } => continue,
        };
        update(&mut model, Msg::Answer(id, Ok(answer)));
    }
    insta::assert_snapshot!("journal_80x24", screen(&mut model, 80, 24));
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
fn acknowledging_takes_the_most_urgent_or_the_selected() {
    let fixture = Fixture::alarm();
    let mut model = model(&fixture, Theme::FULL);
    assert_eq!(sent_kind(&type_keys(&mut model, "a")), Some(&fixture.alarms[0].acknowledge()));
    assert_eq!(sent_kind(&type_keys(&mut model, "3↓↓a")), Some(&fixture.alarms[2].acknowledge()));
    assert_eq!(sent_kind(&type_keys(&mut model, "↑a")), None, "already acknowledged");
    let shown = screen(&mut model, 80, 24);
    assert!(shown.contains("already acknowledged"), "{shown}");
    assert!(
        !shown.lines().nth(2).is_some_and(|banner| banner.contains("a ack")),
        "it is not for the banner's: {shown}"
    );
    assert_eq!(sent_kind(&type_keys(&mut model, "⎋A")), None, "all: asks first");
    assert_eq!(sent_kind(&type_keys(&mut model, "⏎")), fixture.snapshot().acknowledge_all().as_ref());
    let mut quiet = super::model(&Fixture::normal(), Theme::FULL);
    assert_eq!(type_keys(&mut quiet, "aA"), []);
    assert_eq!(quiet.modal, None);
}

#[test]
fn what_came_after_the_last_frame_is_not_acknowledged_unseen() {
    let mut fixture = Fixture::alarm();
    let newer = crate::plant::snapshot::ActiveAlarm { id: AlarmId(1), ..fixture.alarms[0].clone() };
    for tab in ["", "3"] {
        let mut model = model(&fixture, Theme::FULL);
        type_keys(&mut model, tab);
        screen(&mut model, 80, 24);
        let mut later = fixture.clone();
        later.alarms.insert(0, newer.clone());
        update(&mut model, Msg::Snapshot(later.snapshot()));
        assert_eq!(sent_kind(&type_keys(&mut model, "a")), Some(&fixture.alarms[0].acknowledge()), "as it was seen");
        screen(&mut model, 80, 24);
        assert_eq!(sent_kind(&type_keys(&mut model, "a")), Some(&newer.acknowledge()), "now it is seen");
    }
    fixture.alarms.clear();
    let mut model = model(&fixture, Theme::FULL);
    screen(&mut model, 80, 24);
    fixture.alarms.push(newer);
    update(&mut model, Msg::Snapshot(fixture.snapshot()));
    assert_eq!(type_keys(&mut model, "a"), []);
}

#[test]
fn a_selected_alarm_stays_selected_when_the_list_moves() {
    let mut fixture = Fixture::alarm();
    let mut model = model(&fixture, Theme::FULL);
    type_keys(&mut model, "3↓↓");
    let chosen = fixture.alarms[2].id;
    let newer = crate::plant::snapshot::ActiveAlarm { id: AlarmId(1), ..fixture.alarms[0].clone() };
    fixture.alarms.insert(0, newer);
    update(&mut model, Msg::Snapshot(fixture.snapshot()));
    assert_eq!(model.tabs.alarms.selected(&model.cx()).map(|alarm| alarm.id), Some(chosen));
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
            old: Some(70.0),
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
    check(Outcome::NotConfirmed(NotConfirmed::Different(65.0)), "NOT CONFIRMED: read back 65");
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
                Command::new(0, model.pending_command.as_ref().expect("the command is pending").command.id, kind),
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
            old: Some(70.0),
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
    update(&mut model, Msg::Undelivered(*id, "station too busy"));
    assert!(screen(&mut model, 80, 24).contains("NOT SENT: station too busy"));
}

#[test]
fn the_journal_is_asked_only_while_it_is_shown() {
    let mut model = model(&Fixture::normal(), Theme::FULL);
    let asks = |effects: Vec<Effect>| {
        effects.iter().filter(|effect| matches!(effect, Effect::Query(id, _) if id.tab == Tab::Alarms)).count()
    };
    let tick = || Msg::Tick { silent: Duration::ZERO };
    assert_eq!(asks(type_keys(&mut model, "3")), 0);
    assert_eq!(asks(type_keys(&mut model, "j")), 2, "alarms and actions");
    for number in [1, 2] {
        update(
            &mut model,
            Msg::Answer(crate::ui::QueryId { tab: Tab::Alarms, number }, Ok(Answer::Journal(Vec::new()))),
        );
    }
    let half = |n: u64| Msg::Tick { silent: Duration::from_millis(500 * n) };
    assert_eq!((0..=10).map(|n| asks(update(&mut model, half(n)))).sum::<usize>(), 2, "once more in five seconds");
    type_keys(&mut model, "1");
    assert_eq!((0..30).map(|_| asks(update(&mut model, tick()))).sum::<usize>(), 0);
}

#[test]
fn a_history_without_answer_is_said_so() {
    let mut model = model(&Fixture::normal(), Theme::FULL);
    let effects = type_keys(&mut model, "3j");
    assert!(screen(&mut model, 80, 24).contains("collecting data"));
    for effect in effects {
        if let Effect::Query(id, _) = effect {
            update(&mut model, Msg::Answer(id, Err(HistoryError::Engine("disk full".to_owned()))));
        }
    }
    assert!(screen(&mut model, 80, 24).contains("history: disk full"));
}

/// An alarm fixture whose acknowledgement asks for no note.
fn plain_alarms() -> Fixture {
    let mut fixture = Fixture::alarm();
    fixture.def.alarms.iter_mut().for_each(|alarm| alarm.ack_comment = false);
    fixture
}

#[test]
fn a_key_for_an_alarm_that_has_left_the_list_acknowledges_no_other() {
    let mut fixture = plain_alarms();
    let mut model = model(&fixture, Theme::FULL);
    type_keys(&mut model, "3");
    screen(&mut model, 80, 24);
    type_keys(&mut model, "↓↓↓");
    screen(&mut model, 80, 24);
    let chosen = model.tabs.alarms.selected(&model.cx()).map(|alarm| alarm.id).expect("one is selected");
    assert_ne!(chosen, fixture.alarms[0].id, "another one than the first");
    // The frame with it is on the screen; now a colleague's acknowledgement takes it from the list.
    fixture.alarms.retain(|alarm| alarm.id != chosen);
    update(&mut model, Msg::Snapshot(fixture.snapshot()));
    assert_eq!(sent_kind(&type_keys(&mut model, "a")), None);
    assert!(screen(&mut model, 80, 24).contains("The list has changed, press again"));
    // What is on the screen now is what the next press is for.
    assert!(sent_kind(&type_keys(&mut model, "a")).is_some());
    assert!(!screen(&mut model, 80, 24).contains("press again"));
}

#[test]
fn a_chosen_alarm_that_was_raised_again_is_not_acknowledged_unseen() {
    let mut fixture = plain_alarms();
    let mut model = model(&fixture, Theme::FULL);
    type_keys(&mut model, "3↓↑");
    screen(&mut model, 80, 24);
    let chosen = model.tabs.alarms.selected(&model.cx()).map(|alarm| alarm.id).expect("one is selected");
    for alarm in fixture.alarms.iter_mut().filter(|alarm| alarm.id == chosen) {
        (alarm.raised_at, alarm.annunciated_at) = (fixture::now(), fixture::now());
    }
    update(&mut model, Msg::Snapshot(fixture.snapshot()));
    assert_eq!(sent_kind(&type_keys(&mut model, "a")), None);
}

#[test]
fn rows_that_move_between_two_frames_take_no_key_meant_for_another() {
    let mut fixture = plain_alarms();
    let newest = fixture.alarms.remove(0);
    let mut model = model(&fixture, Theme::FULL);
    type_keys(&mut model, "3");
    screen(&mut model, 80, 24);
    // A new one pushes in at the top, unseen: neither the first row nor the next one is what it was.
    fixture.alarms.insert(0, newest);
    update(&mut model, Msg::Snapshot(fixture.snapshot()));
    for keys in ["z", "↓a", "o"] {
        // Moving the selection is possible, but what a key means then is unknown until it is drawn.
        assert_eq!(sent_kind(&type_keys(&mut model, keys)), None, "{keys}");
        assert_eq!(model.modal, None, "{keys}");
    }
}

#[test]
fn what_was_seen_is_sent_though_the_values_are_doubted_meanwhile() {
    let fixture = Fixture::normal();
    let mut model = model(&fixture, Theme::FULL);
    type_keys(&mut model, "s65.5");
    update(&mut model, Msg::Tick { silent: Duration::from_secs(4) });
    let effects = type_keys(&mut model, "⏎");
    let seen = effects.iter().find_map(|effect| match effect {
        Effect::Command(command, _) => Some(command.expected_value),
        _ => None,
    });
    assert_eq!(seen, Some(Some(70.0)), "the window showed `old 70.0`");
}

#[test]
fn a_number_that_the_device_rounds_is_shown_rounded_before_it_is_written() {
    let mut fixture = Fixture::normal();
    let sv = fixture.tag("TIC-1.SV");
    fixture.def.tags[sv.index()].scale = 0.5;
    let mut model = model(&fixture, Theme::FULL);
    assert_eq!(sent_kind(&type_keys(&mut model, "s72.3⏎")), None);
    let shown = screen(&mut model, 80, 24);
    assert!(shown.contains("72.3 → the device holds steps of 0.5: 72.5"), "{shown}");
    assert!(shown.contains("new 72.5 °C"), "{shown}");
    assert_eq!(sent_kind(&type_keys(&mut model, "⏎")), Some(&CommandKind::Write { tag: sv, value: 72.5 }));
}
