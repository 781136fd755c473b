//! The controllers tab as an operator sees it and works with it.

mod lists;
mod procedures;
mod runs;
mod lamps;
mod sets;
mod wall;

use std::{sync::Arc, time::Duration};

use jiff::SignedDuration;

use crate::{
    plant::{
        alarm::{ActiveAlarm, AlarmState},
        command::{Command, CommandId, CommandKind, CommandStatus, Outcome, Refusal},
        control_run::RunState,
        def::{ActionDef, AlarmId, DeviceId},
        line_state::DeviceState,
        ne107::Reason,
        parameter_set::StoredSet,
        restore::{Restore, RestoreRequest, State},
        sample::{Cause, Sample},
        tag::Confidence,
        tuning::{TunedParameter, Tuning},
    },
    ui::{
        Effect, Model, Msg,
        fixture::{
            self, Fixture,
            controllers::{control_run, many, set},
        },
        tests::{model, screen, sent_kind, type_keys},
        theme::Theme,
        update,
    },
};

const SIZES: [(u16, u16); 2] = [(80, 24), (120, 40)];

/// One of everything that is wrong: an alarm, a device that is gone, one that is asked too often.
fn trouble(count: u16) -> Fixture {
    let mut fixture = many(count);
    fixture.set("TIC-1.PV", 72.4);
    let raised_at = fixture::now() - SignedDuration::from_secs(41);
    let alarm = ActiveAlarm::new(AlarmId(0), AlarmState::Unacknowledged, raised_at);
    fixture.alarms = vec![ActiveAlarm { value: Some(72.1.into()), ..alarm }];
    if let Some(device) = fixture.devices.get_mut(1) {
        (device.state, device.diagnosis) = (DeviceState::Down { since: raised_at }, Some(Reason::Down));
        for tag in fixture.def.tags.iter().filter(|tag| tag.device == DeviceId(1)) {
            fixture.samples[tag.id.index()] = Sample::bad(Cause::DeviceDown, raised_at);
        }
    }
    fixture
}

/// What is wrong with a set that a person has edited.
fn spoiled() -> StoredSet {
    let why = "summer.toml:6:1: unknown setting `SW` (expected a setting of the device; did you mean `SV`?)";
    StoredSet { name: "summer".into(), set: Err(vec![why.into()]) }
}

fn with_sets() -> Fixture {
    let mut fixture = many(2);
    fixture.sets = vec![spoiled(), set(&fixture, "winter", &[("SV", 150.0), ("SV-H", 200.0), ("P", 5.0)])];
    fixture
}

/// The screen after some keys in both sizes.
fn assert_seen(name: &str, fixture: &Fixture, theme: Theme, keys: &str) {
    for (width, height) in SIZES {
        let mut model = model(fixture, theme);
        type_keys(&mut model, keys);
        insta::assert_snapshot!(format!("{name}_{width}x{height}"), screen(&mut model, width, height));
    }
}

fn tuning(fixture: &Fixture, ended: bool) -> Tuning {
    use crate::plant::tuning::TuningTracker;
    let mut watch = TuningTracker::default();
    let device = &fixture.def.devices[0];
    let faceplate = device.faceplate.as_ref().expect("a controller");
    let began = fixture::now() - SignedDuration::from_secs(754);
    let swings = [64.0, 72.4, 68.1, 73.0, 68.0, 70.0];
    let last = swings.len() - 1;
    for (n, pv) in std::iter::once(60.0).chain(swings).enumerate() {
        let at = began + SignedDuration::from_secs(n as i64 * 120);
        let sample = |tag| match tag {
            tag if tag == faceplate.pv => Sample::good(pv, at),
            tag if Some(tag) == faceplate.tune => Sample::good(f64::from(u8::from(n > 0)), at),
            tag => Sample { at, ..fixture.samples[crate::plant::def::TagId::index(tag)] },
        };
        watch.observe(device, &sample, Some(120.0), at);
        assert!(n <= last + 1);
    }
    let mut tuning = watch.tuning.expect("it is on").as_ref().clone();
    if ended {
        tuning.ended = Some(fixture::now() - SignedDuration::from_secs(4));
        let new = [1.2, 70.0, 13.5];
        tuning.found =
            tuning.found.iter().zip(new).map(|(found, new)| TunedParameter { new: Some(new), ..*found }).collect();
    }
    tuning
}

#[test]
fn every_page_in_every_mood() {
    assert_seen("list_one_trouble", &trouble(2), Theme::FULL, "4");
    assert_seen("list_of_31", &trouble(31), Theme::FULL, "4");
    assert_seen("device_normal", &many(2), Theme::FULL, "4⏎");
    assert_seen("device_alarm", &trouble(2), Theme::FULL, "4⏎d");
    assert_seen("device_down", &trouble(2), Theme::FULL, "4⏎→");
    assert_seen("device_plc", &Fixture::normal(), Theme::FULL, "4↓⏎");
    assert_seen("device_ascii", &trouble(2), Theme::PLAIN, "4⏎");
    let mut running = many(1);
    running.into = Some((Duration::from_secs(192), true));
    assert_seen("program_running", &running, Theme::FULL, "4g");
    assert_seen("program_ascii", &running, Theme::PLAIN, "4g");
    assert_seen("program_down", &trouble(2), Theme::FULL, "4↓⏎g");
    assert_seen("sets", &with_sets(), Theme::FULL, "4⏎s");
    assert_seen("sets_none", &many(1), Theme::FULL, "4s");
    assert_seen("sets_spoiled", &with_sets(), Theme::FULL, "4⏎s⏎");
    assert_seen("compare", &with_sets(), Theme::FULL, "4⏎s↓⏎");
    assert_seen("compare_ascii", &with_sets(), Theme::PLAIN, "4⏎s↓⏎=");
    assert_seen("restore_asked", &with_sets(), Theme::FULL, "4⏎s↓⏎⏎");
    assert_seen("guide", &many(1), Theme::FULL, "4h→→→");
}

#[test]
fn a_tuning_shows_how_it_goes_and_what_it_has_found() {
    let mut fixture = many(2);
    fixture.set("TIC-1.AT", 1.0);
    fixture.tunings[0] = Some(tuning(&fixture, false));
    assert_seen("tuning", &fixture, Theme::FULL, "4⏎");
    fixture.set("TIC-1.AT", 0.0);
    fixture.tunings[0] = Some(tuning(&fixture, true));
    assert_seen("tuned", &fixture, Theme::FULL, "4⏎");
}

#[test]
fn a_run_shows_its_figures_as_they_come() {
    let mut fixture = many(2);
    fixture.runs[0] = Some(Arc::new(control_run(17, RunState::Running)));
    assert_seen("run_running", &fixture, Theme::FULL, "4⏎");
    fixture.runs[0] = Some(Arc::new(control_run(16, RunState::Ended)));
    assert_seen("run_ended", &fixture, Theme::PLAIN, "4⏎");
}

#[test]
fn a_tuning_at_work_is_stopped_by_the_key_that_starts_one() {
    let mut fixture = many(1);
    let mut stopped = model(&fixture, Theme::FULL);
    fixture.set("TIC-1.AT", 1.0);
    update(&mut stopped, Msg::Snapshot(fixture.snapshot()));
    let effects = type_keys(&mut stopped, "4T⏎");
    assert_eq!(sent_kind(&effects), Some(&CommandKind::Write { tag: fixture.tag("TIC-1.AT"), value: 0.0.into() }));
}

/// A restore of two changes whose first is done.
fn half_done(fixture: &Fixture, state: State) -> Restore {
    let set = fixture.sets[1].set.clone().expect("a good set");
    let trusted = |tag: crate::plant::def::TagId| fixture.samples[tag.index()].good_exact();
    let changes = crate::plant::parameter_set::plan(&fixture.def, DeviceId(0), &set, &trusted).expect("it fits");
    let request = RestoreRequest { device: DeviceId(0), from: "set winter".into(), set, changes };
    let id = CommandId { terminal: 1, number: 9 };
    let mut run = Restore::new(id, "anna".into(), &request, fixture::now());
    run.begin();
    run.steps[0].command = Some(id);
    run.steps[0].outcome = Some(Outcome::Verified);
    run.steps[1].command = Some(id);
    if state == State::Failed {
        run.end_write(Outcome::Refused(Refusal::NotSent(crate::plant::fault::Fault::BackedOff)));
    }
    run
}

#[test]
fn a_restore_shows_each_write_and_where_it_stopped() {
    let mut fixture = with_sets();
    let (running, failed) = (half_done(&fixture, State::Running), half_done(&fixture, State::Failed));
    let mut reading = half_done(&fixture, State::Running);
    // The first write is done.
    fixture.set("TIC-1.P", 5.0);
    fixture.restores = vec![running];
    assert_seen("restore_running", &fixture, Theme::FULL, "4⏎s↓⏎");
    fixture.restores = vec![failed];
    assert_seen("restore_failed", &fixture, Theme::FULL, "4⏎s↓⏎");
    (reading.state, reading.steps) = (State::Reading, Vec::new());
    fixture.restores = vec![reading];
    let mut model = model(&fixture, Theme::FULL);
    type_keys(&mut model, "4⏎s↓⏎");
    let shown = screen(&mut model, 80, 24);
    assert!(shown.contains("reading the device first …   x stops"), "{shown}");
}

#[test]
fn an_old_restore_hides_nothing_of_what_the_device_holds() {
    let mut fixture = with_sets();
    let mut run = half_done(&fixture, State::Running);
    let id = run.id;
    for step in &mut run.steps {
        (step.command, step.outcome) = (Some(id), Some(Outcome::Verified));
    }
    run.state = State::Done;
    // It wrote P 5.0; since then it was set to 7.7 at the panel.
    fixture.set("TIC-1.P", 7.7);
    fixture.restores = vec![run];
    let shown = |fixture: &Fixture| {
        let mut model = model(fixture, Theme::FULL);
        type_keys(&mut model, "4⏎s↓⏎");
        screen(&mut model, 80, 24)
    };
    let page = shown(&fixture);
    let row = page.lines().find(|line| line.starts_with(" P ")).unwrap_or_default().to_owned();
    assert!(row.contains("5.0 %") && row.contains("7.7 %") && row.contains("differs"), "{page}");
    assert!(page.contains("in the device") && page.contains("3 of 3 written and verified, started"), "{page}");
    // A set of the same name that was saved later is another set: nothing of it was ever written.
    let later = fixture.sets[1].set.clone().expect("a good set");
    let saved = fixture::now() + SignedDuration::from_secs(60);
    let later = crate::plant::parameter_set::ParameterSet { saved, ..(*later).clone() };
    fixture.sets[1].set = Ok(Arc::new(later));
    assert!(!shown(&fixture).contains("written and verified"), "{}", shown(&fixture));
}

#[test]
fn only_an_action_that_saves_is_advised_after_a_restore() {
    let mut fixture = with_sets();
    let mut run = half_done(&fixture, State::Running);
    run.end_write(Outcome::Verified);
    run.state = State::Done;
    fixture.restores = vec![run];
    let fix = fixture.def.devices[0].actions[0].clone();
    let stop = ActionDef { name: "STOP".into(), saves: false, ..fix.clone() };
    let mut check = |actions: Vec<ActionDef>, advised: bool| {
        fixture.def.devices[0].actions = actions;
        let mut model = model(&fixture, Theme::FULL);
        type_keys(&mut model, "4⏎s↓⏎");
        let shown = screen(&mut model, 80, 24);
        assert_eq!((shown.contains("f FIX stores them"), shown.contains("STOP")), (advised, false), "{shown}");
    };
    check(vec![stop.clone(), fix], true);
    check(vec![stop], false);
}

#[test]
fn a_restore_asks_what_each_of_its_writes_would_have_asked() {
    let mut fixture = many(1);
    let words = |n: usize| format!("Wrong values of number {n} can spoil a whole batch, and are noticed late.");
    let mut shown = |asking: &[&str]| {
        for tag in &mut fixture.def.tags {
            tag.confidence = if tag.short.starts_with("TM") { Confidence::Medium } else { Confidence::High };
            tag.confirm = asking.iter().position(|short| *short == tag.short).map(words);
        }
        let names =
            ["SV", "P", "I", "SV-1", "SV-2", "SV-3", "TM1R", "TM2R", "TM3R", "TM4R", "TM1S", "TM2S", "TM3S", "TM4S"];
        let changes: Vec<(&str, f64)> = names.into_iter().map(|name| (name, 11.0)).collect();
        fixture.sets = vec![set(&fixture, "winter", &changes)];
        let mut model = model(&fixture, Theme::FULL);
        type_keys(&mut model, "4s⏎⏎");
        screen(&mut model, 80, 24)
    };
    let few = shown(&["P"]);
    assert!(few.contains("P: Wrong values of number 0 can spoil"), "{few}");
    assert!(few.contains("! not verified: TM1R TM1S TM2R") && few.contains("write and verify"), "{few}");
    // However many there are, the keys of the window stay on the screen, and what is left out is said to be.
    let many = shown(&["SV", "P", "I", "SV-1", "SV-2"]);
    for words in
        ["number 0", "number 1", "… and 3 more that ask for confirmation", "! not verified", "write and verify"]
    {
        assert!(many.contains(words), "{words} in {many}");
    }
}

#[test]
fn a_cell_of_the_program_is_written_and_the_program_commanded() {
    let fixture = many(1);
    let check = |keys: &str, tag: &str, value: f64| {
        let mut model = model(&fixture, Theme::FULL);
        let effects = type_keys(&mut model, &format!("4g{keys}"));
        assert_eq!(
            sent_kind(&effects),
            Some(&CommandKind::Write { tag: fixture.tag(tag), value: value.into() }),
            "{keys}"
        );
    };
    check("↓→⏎25⏎", "TIC-1.TM2R", 25.0);
    check("⏎80⏎", "TIC-1.SV-1", 80.0);
    check("p⏎", "TIC-1.PROG", 2.0);
    check("o⏎", "TIC-1.PROG", 0.0);
    check("t↓⏎⏎", "TIC-1.PTN", 1.0);
}

#[test]
fn a_value_that_another_has_changed_meanwhile_is_asked_again() {
    let fixture = many(1);
    let mut model = model(&fixture, Theme::FULL);
    type_keys(&mut model, "4↓↓↓↓↓⏎7.5");
    assert!(screen(&mut model, 80, 24).contains("write TIC-1.P"), "{}", screen(&mut model, 80, 24));
    let mut later = fixture.clone();
    later.set("TIC-1.P", 3.0);
    let mut snapshot = later.snapshot();
    Arc::make_mut(&mut snapshot).commands = vec![CommandStatus {
        old: Some(1.2.into()),
        outcome: Outcome::Verified,
        ..CommandStatus::new(
            Command::new(
                0,
                CommandId { terminal: 2, number: 1 },
                CommandKind::Write { tag: fixture.tag("TIC-1.P"), value: 3.0.into() },
            ),
            "boris",
            fixture::now(),
        )
    }];
    update(&mut model, Msg::Snapshot(snapshot));
    assert_eq!(sent_kind(&type_keys(&mut model, "⏎")), None);
    let shown = screen(&mut model, 80, 24);
    assert!(shown.contains("changed to 3.0 % by boris 14:02:31 (was 1.2)"), "{shown}");
    let effects = type_keys(&mut model, "⏎");
    assert_eq!(sent_kind(&effects), Some(&CommandKind::Write { tag: fixture.tag("TIC-1.P"), value: 7.5.into() }));
}

#[test]
fn escape_leads_back_step_by_step_and_never_out() {
    let mut model = model(&with_sets(), Theme::FULL);
    let title = |model: &mut Model| screen(model, 80, 24).lines().nth(4).unwrap_or_default().to_owned();
    type_keys(&mut model, "4⏎s↓⏎h");
    for expect in ["P, I and D", "set winter → TIC-1", "parameter sets of", "‹ TIC-1 ›", "2 devices", "2 devices"]
    {
        let shown = title(&mut model);
        assert!(shown.contains(expect), "{expect}: {shown}");
        type_keys(&mut model, "⎋");
    }
}

#[test]
fn a_find_selects_the_exact_name_before_names_and_meanings() {
    let mut fixture = Fixture::normal();
    let last = fixture.def.tags.iter().rposition(|tag| tag.device == DeviceId(0)).expect("tags of the controller");
    let exact = fixture.tag("TIC-1.P");
    fixture.def.tags[last].meaning = "P band".to_owned();
    let mut model = model(&fixture, Theme::FULL);
    type_keys(&mut model, "4⏎/p⏎");
    let cx = model.cx();
    assert_eq!(model.tabs.controllers.table.tag(&cx, DeviceId(0)).map(|tag| tag.id), Some(exact));
}

#[test]
fn thirty_one_devices_can_all_be_reached() {
    let mut model = model(&many(31), Theme::FULL);
    let code = |code| Msg::Key(crossterm::event::KeyEvent::new(code, crossterm::event::KeyModifiers::NONE));
    type_keys(&mut model, "4");
    assert!(screen(&mut model, 80, 24).contains("more ▼"));
    update(&mut model, code(crossterm::event::KeyCode::End));
    assert!(screen(&mut model, 80, 24).contains("TIC-31"));
    type_keys(&mut model, "⏎");
    assert!(screen(&mut model, 80, 24).contains("‹ TIC-31 ›"));
    type_keys(&mut model, "→");
    assert!(screen(&mut model, 80, 24).contains("‹ TIC-1 ›"), "around the end");
}

#[test]
fn a_key_for_a_set_acts_only_on_the_set_that_was_drawn() {
    let mut fixture = with_sets();
    let mut model = model(&fixture, Theme::FULL);
    type_keys(&mut model, "4⏎s↓");
    screen(&mut model, 80, 24);
    // A colleague saves a set that comes before the selected one, which stays selected.
    fixture.sets.insert(0, set(&fixture, "autumn", &[("SV", 90.0)]));
    update(&mut model, Msg::Snapshot(fixture.snapshot()));
    type_keys(&mut model, "⏎");
    assert!(screen(&mut model, 80, 24).contains("set winter → TIC-1"));
    // A colleague deletes it.
    type_keys(&mut model, "⎋");
    screen(&mut model, 80, 24);
    fixture.sets.retain(|stored| stored.name != "winter");
    update(&mut model, Msg::Snapshot(fixture.snapshot()));
    type_keys(&mut model, "⏎");
    let shown = screen(&mut model, 80, 24);
    assert!(shown.contains("The list has changed, press again") && shown.contains("parameter sets of"), "{shown}");
    type_keys(&mut model, "⏎");
    assert!(screen(&mut model, 80, 24).contains("set autumn → TIC-1"));
}

#[test]
fn only_a_copy_between_devices_offers_to_be_reversed() {
    for (fixture, keys, offered) in [(many(2), "4⏎s⏎", true), (with_sets(), "4⏎s↓⏎", false)] {
        let mut model = model(&fixture, Theme::FULL);
        type_keys(&mut model, keys);
        let shown = screen(&mut model, 120, 40);
        let footer = shown.lines().last().unwrap_or_default();
        assert_eq!((footer.contains("all"), footer.contains("reverse")), (true, offered), "{footer}");
    }
}
