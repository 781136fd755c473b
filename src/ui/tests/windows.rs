//! Windows: what they say of the way out, what a digit does in them, and what is not even opened.

use std::sync::Arc;

use crossterm::event::{KeyCode, KeyEvent, KeyModifiers};

use super::{model, screen, sent_kind, type_keys};
use crate::{
    access::{LoggedInUser, SessionStatus},
    plant::{alarm::AlarmCommand, command::CommandKind, role::Role},
    ui::{Leaving, Model, Msg, fixture::Fixture, fixture::session, modal::Modal, tabs::Tab, theme::Theme, update},
};

fn sits(model: &mut Model, role: Role) {
    let who = LoggedInUser { user: "tom".into(), role, must_change: false };
    update(model, Msg::SessionStatus(Arc::new(SessionStatus { who: Some(who), ..(*session()).clone() })));
}

#[test]
fn quitting_says_what_ends_in_each_way_to_run() {
    for (leaving, words) in [
        (Leaving::Station, "Polling and alarms stop too"),
        (Leaving::Demo, "The demonstration ends"),
        (Leaving::Terminal, "Only this terminal closes. Polling and alarms continue."),
    ] {
        for in_window in [false, true] {
            let mut model = model(&Fixture::normal(), Theme::FULL);
            model.leaving = leaving;
            type_keys(&mut model, if in_window { "?" } else { "q" });
            if in_window {
                update(&mut model, Msg::Key(KeyEvent::new(KeyCode::Char('c'), KeyModifiers::CONTROL)));
            }
            let shown = screen(&mut model, 80, 24);
            assert!(shown.contains(words), "{leaving:?}, in a window {in_window}:\n{shown}");
            assert_eq!(shown.contains("stop too"), leaving == Leaving::Station, "{shown}");
        }
    }
}

#[test]
fn the_number_of_a_tab_leads_out_of_windows_without_a_text() {
    // Help, the why window, a faceplate, a query, a choice, the guidance of an alarm.
    for keys in ["?", "w", "→⏎", "q", "4⏎T", "3⏎"] {
        let mut model = model(&Fixture::alarm(), Theme::FULL);
        type_keys(&mut model, keys);
        assert!(model.modal.is_some(), "{keys} opens no window");
        type_keys(&mut model, "2");
        assert_eq!((model.modal.is_none(), model.tabs.shown), (true, Tab::Trends), "{keys}");
    }
    let mut model = model(&Fixture::alarm(), Theme::FULL);
    type_keys(&mut model, "s2");
    assert_eq!(model.tabs.shown, Tab::Mimic, "a digit that is typed is a digit");
    assert!(screen(&mut model, 80, 24).contains("new 2"));
}

#[test]
fn a_form_is_not_opened_for_a_user_who_may_not_send_it() {
    let mut fixture = Fixture::traffic();
    fixture.alarms = Fixture::alarm().alarms;
    for (keys, role) in
        [("6c", Role::Technician), ("6T⏎", Role::Technician), ("3o", Role::Technician), ("3z", Role::Viewer)]
    {
        let mut model = model(&fixture, Theme::FULL);
        sits(&mut model, role);
        type_keys(&mut model, keys);
        let shown = screen(&mut model, 80, 24);
        assert!(matches!(model.modal, Some(Modal::Notice(_))), "{keys}: {:?}", model.modal);
        assert!(shown.contains("tom is"), "{keys}: who and what is needed is missing\n{shown}");
    }
}

#[test]
fn a_station_without_users_says_so_before_the_form() {
    let mut model = model(&Fixture::normal(), Theme::FULL);
    type_keys(&mut model, "7n");
    assert!(screen(&mut model, 80, 24).contains("This station has no users."));
    assert!(matches!(model.modal, Some(Modal::Notice(_))), "{:?}", model.modal);
}

#[test]
fn frames_run_on_after_escape() {
    let mut model = model(&Fixture::traffic(), Theme::FULL);
    type_keys(&mut model, "6F");
    for keys in [" ", "↑", "↑⏎⎋"] {
        type_keys(&mut model, keys);
        assert!(screen(&mut model, 80, 24).contains("PAUSED"), "{keys:?} holds");
        type_keys(&mut model, "⎋");
        assert!(screen(&mut model, 80, 24).contains("running, newest"), "{keys:?} and Esc");
    }
    type_keys(&mut model, "⏎⎋");
    assert!(screen(&mut model, 80, 24).contains("running, newest"), "a look at a frame holds nothing");
}

/// Guidance as long as the plant files have it.
fn long_guidance() -> Fixture {
    let mut fixture = Fixture::alarm();
    let guidance = &mut fixture.def.alarms[0].guidance;
    guidance.cause =
        "the setpoint was raised while the inlet valve is open, or the relay of the heater sticks and heats on".into();
    guidance.action =
        "lower the setpoint or stop the sequence; check the lamp of the relay; open the drain by hand if the \
        level rises; tell the shift supervisor once the temperature is above 75 degrees for good"
            .into();
    fixture
}

#[test]
fn guidance_takes_the_rows_that_the_list_leaves_empty() {
    let mut model = model(&long_guidance(), Theme::FULL);
    type_keys(&mut model, "3");
    let shown = screen(&mut model, 80, 24);
    for words in ["heats on", "[_] lower the setpoint", "above 75 degrees", "go to"] {
        assert!(shown.contains(words), "{words} is missing:\n{shown}");
    }
}

#[test]
fn enter_on_an_alarm_opens_guidance_then_the_faceplate() {
    let mut model = model(&long_guidance(), Theme::FULL);
    type_keys(&mut model, "3⏎");
    assert!(matches!(model.modal, Some(Modal::Guidance(_))), "{:?}", model.modal);
    for (width, height) in [(80, 24), (60, 20)] {
        let shown = screen(&mut model, width, height);
        for words in ["lower the setpoint", "respond within"] {
            assert!(shown.contains(words), "{words} is missing:\n{shown}");
        }
        type_keys(&mut model, "↓↓↓↓↓↓↓↓");
        let shown = screen(&mut model, width, height);
        assert!(shown.contains("for good"), "the end is missing:\n{shown}");
        type_keys(&mut model, "↑↑↑↑↑↑↑↑");
    }
    type_keys(&mut model, "⏎");
    assert!(matches!(model.modal, Some(Modal::Faceplate(_))), "{:?}", model.modal);
}

#[test]
fn the_alarm_that_the_key_is_for_is_marked_in_the_list() {
    let mut model = model(&Fixture::alarm(), Theme::FULL);
    type_keys(&mut model, "3");
    assert!(screen(&mut model, 80, 24).contains("a ack ‹2›! TIC-1.PV"));
    // The last one has returned and waits too; the one before is acknowledged.
    type_keys(&mut model, "↓");
    assert!(!screen(&mut model, 80, 24).contains("a ack (3)"));
    type_keys(&mut model, "↓");
    let shown = screen(&mut model, 80, 24);
    assert!(shown.contains("a ack ·4· PLC-1.LT-1"), "{shown}");
}

#[test]
fn an_alarm_is_shelved_for_half_an_hour_or_for_any_time_typed() {
    let shelved = |keys: &str| {
        let mut model = model(&Fixture::alarm(), Theme::FULL);
        type_keys(&mut model, keys);
        let shown = screen(&mut model, 80, 24);
        let command = sent_kind(&type_keys(&mut model, "⏎")).cloned();
        let lasts = match command {
            Some(CommandKind::Alarm(AlarmCommand::Shelve { lasts, .. })) => Some(lasts.as_secs() / 60),
            _ => None,
        };
        (lasts, shown)
    };
    assert_eq!(shelved("3z→leak").0, Some(30));
    // A time that was typed while another one is selected is neither.
    assert_eq!(shelved("3z→45").0, None);
    // The last choice is a time of one's own: what is typed there is the time, Tab leads on to the reason.
    for (time, minutes) in [("45 min", Some(45)), ("1:30", Some(90)), ("99 h", None)] {
        let keys = format!("3z←{time}⇥leak");
        let (lasts, shown) = shelved(&keys);
        assert_eq!(lasts, minutes, "{time}:\n{shown}");
        assert!(shown.contains(time), "{shown}");
    }
}

#[test]
fn the_message_about_a_file_leaves_with_the_next_key() {
    let mut model = model(&Fixture::traffic(), Theme::FULL);
    type_keys(&mut model, "6F");
    update(&mut model, Msg::Saved(Some(Tab::Bus), Ok("L1.txt".into())));
    assert!(screen(&mut model, 80, 24).contains("written; read with: less L1.txt"));
    type_keys(&mut model, "↑");
    assert!(!screen(&mut model, 80, 24).contains("L1.txt"));
}
