//! Keys that command actuators: interlocks, modes, sequences and stops.

use super::*;

pub(super) fn faceplate(fixture: &Fixture, tag: &str) -> Model {
    let mut model = model(fixture, Theme::FULL);
    model.modal = Faceplate::new("it", vec![fixture.tag(tag)]).map(Modal::Faceplate);
    model
}

#[test]
fn a_pump_is_switched_by_its_manual_command() {
    let mut fixture = Fixture::normal();
    for (auto, warned) in [(1.0, true), (0.0, false)] {
        fixture.set("PLC-1.AUTO", auto);
        let mut model = faceplate(&fixture, "PLC-1.P-1");
        let shown = screen(&mut model, 80, 24);
        assert!(shown.contains("t ON P-1"), "{shown}");
        assert_eq!(shown.contains("effective in MANUAL only (PLC-1.AUTO is"), warned, "{shown}");
        assert_eq!(sent_kind(&type_keys(&mut model, "⏎↓⏎")), None, "asks first");
        let shown = screen(&mut model, 80, 24);
        assert_eq!(shown.contains("! effective in MANUAL only (PLC-1.AUTO is AUTO)"), warned, "{shown}");
        let command = CommandKind::Write { tag: fixture.tag("PLC-1.MAN.P-1"), value: 1.0.into() };
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
    assert!(shown.contains("Manual commands take over; no output changes."), "{shown}");
    let command = CommandKind::Write { tag: fixture.tag("PLC-1.AUTO"), value: 0.0.into() };
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
    let command = CommandKind::Write { tag: fixture.tag("PLC-1.MAN.P-1"), value: 1.0.into() };
    assert_eq!(sent_kind(&type_keys(&mut model, "⏎")), Some(&command));
}

#[test]
fn what_manual_changes_at_once_is_reported_before() {
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
fn a_mode_that_is_changed_under_it_is_in_the_confirmation() {
    let mut fixture = Fixture::normal();
    fixture.set("PLC-1.AUTO", 0.0);
    let mut model = faceplate(&fixture, "PLC-1.P-1");
    type_keys(&mut model, "t");
    assert!(!screen(&mut model, 80, 24).contains("effective in MANUAL only"));
    fixture.set("PLC-1.AUTO", 1.0);
    update(&mut model, Msg::Snapshot(fixture.snapshot()));
    assert!(screen(&mut model, 80, 24).contains("! effective in MANUAL only (PLC-1.AUTO is AUTO)"));
}

#[test]
fn a_line_that_goes_down_under_it_is_in_the_confirmation() {
    let mut fixture = Fixture::normal();
    fixture.set("PLC-1.AUTO", 0.0);
    let mut model = faceplate(&fixture, "PLC-1.P-1");
    type_keys(&mut model, "t");
    update(&mut model, Msg::Snapshot(Fixture::line_down().snapshot()));
    let shown = screen(&mut model, 80, 24);
    assert!(shown.contains("! Writing is not possible now. Line L1 is not connected"), "{shown}");
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
fn what_an_interlock_blocks_is_reported_and_not_sent() {
    let mut fixture = Fixture::normal();
    fixture.set("PLC-1.AUTO", 0.0);
    fixture.set("PLC-1.TK-2", 19.5);
    let mut model = faceplate(&fixture, "PLC-1.P-1");
    let reason = "⊘ no pumping into a full tank: PLC-1.TK-2 is 19.5 l";
    assert!(screen(&mut model, 80, 24).contains(reason));
    type_keys(&mut model, "t");
    let shown = screen(&mut model, 80, 24);
    assert!(shown.contains(reason) && shown.contains("Not sent"), "{shown}");
    assert!(!shown.contains("write and verify"), "no key is offered that does nothing");
    assert_eq!(sent_kind(&type_keys(&mut model, "⏎y")), None);
    // The tank is emptied while the confirmation is open: then it may be sent.
    fixture.set("PLC-1.TK-2", 12.0);
    update(&mut model, Msg::Snapshot(fixture.snapshot()));
    assert!(sent_kind(&type_keys(&mut model, "⏎")).is_some());
    // An unknown state is shown, and left to the PLC.
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
    for (now, warned) in [(0.0, true), (1.0, false)] {
        fixture.set("PLC-1.P-1", now);
        let mut model = faceplate(&fixture, "PLC-1.P-1");
        type_keys(&mut model, "t");
        let shown = screen(&mut model, 80, 24);
        assert_eq!(shown.contains("First writes PLC-1.P-1 := RUN; it keeps this value."), warned, "{now}: {shown}");
    }
}

#[test]
fn a_stop_takes_two_keys_and_says_what_it_switches_off() {
    let mut fixture = Fixture::normal();
    fixture.set("PLC-1.P-1", 1.0);
    let stop = CommandKind::Write { tag: fixture.tag("PLC-1.RUN"), value: 0.0.into() };
    let mut model = model(&fixture, Theme::FULL);
    type_keys(&mut model, "r");
    let shown = screen(&mut model, 80, 24);
    assert!(shown.contains("The sequence stops in HEAT.") && shown.contains("Switched off: P-1 RUN."), "{shown}");
    assert_eq!(sent_kind(&type_keys(&mut model, "⏎")), Some(&stop));
    // Also while its state is unknown.
    let run = fixture.tag("PLC-1.RUN");
    fixture.samples[run.index()] = Sample::bad(Cause::NotRead, fixture::now());
    let mut model = self::model(&fixture, Theme::FULL);
    assert_eq!(sent_kind(&type_keys(&mut model, "r⏎")), Some(&stop));
}

#[test]
fn a_stop_need_not_wait_for_a_window_to_close() {
    let mut fixture = Fixture::normal();
    fixture.set("PLC-1.AUTO", 0.0);
    let stop = CommandKind::Write { tag: fixture.tag("PLC-1.RUN"), value: 0.0.into() };
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
    for (run, words) in [(1.0, "continues with HEAT"), (0.0, "once it is started")] {
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
    for (auto, words) in [(1.0, "The sequence starts with FILL."), (0.0, "In MANUAL no step starts")] {
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
    let check = |fixture: &Fixture, outcome: Option<Outcome>, mismatch: bool, expect: &str| {
        let mut snapshot = Arc::unwrap_or_clone(fixture.snapshot());
        let kind = CommandKind::Write { tag, value: 1.0.into() };
        let at = snapshot.at;
        let status = |outcome| CommandStatus {
            old: Some(0.0.into()),
            outcome,
            ..CommandStatus::new(Command::new(0, id, kind), "b", at)
        };
        snapshot.commands = outcome.map(status).into_iter().collect();
        if mismatch {
            let samples = snapshot.samples.clone();
            let since = at - SignedDuration::from_secs(8);
            snapshot.actuators.update(&snapshot.def.logic, |tag| samples[tag.index()], since);
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
fn a_mark_counts_from_the_outcome_of_its_command() {
    let mut fixture = Fixture::normal();
    fixture.set("PLC-1.AUTO", 0.0);
    let tag = fixture.tag("PLC-1.MAN.P-1");
    let check = |outcome: Outcome, since: i64, expect: Option<&str>| {
        let mut snapshot = Arc::unwrap_or_clone(fixture.snapshot());
        let kind = CommandKind::Write { tag, value: 1.0.into() };
        // A slow line: accepted two minutes before.
        let accepted_at = snapshot.at - SignedDuration::from_secs(121);
        let status = CommandStatus::new(Command::new(0, CommandId::default(), kind), "b", accepted_at);
        let outcome_at = snapshot.at - SignedDuration::from_secs(since);
        snapshot.commands = vec![CommandStatus { outcome, outcome_at, ..status }];
        let mut model = model(&fixture, Theme::FULL);
        update(&mut model, Msg::Snapshot(Arc::new(snapshot)));
        let shown = screen(&mut model, 80, 24);
        let marks = ["✗ not confirmed", "✓ done"];
        let found = marks.into_iter().find(|mark| shown.contains(mark));
        assert_eq!(found, expect, "{since} s:\n{shown}");
    };
    let expired = || Outcome::NotConfirmed(NotConfirmed::NotAnswered(Fault::Timeout));
    check(expired(), 1, Some("✗ not confirmed"));
    check(expired(), 61, None);
    check(Outcome::Verified, 1, Some("✓ done"));
    check(Outcome::Verified, 6, None);
}
