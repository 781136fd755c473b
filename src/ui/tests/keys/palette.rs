//! The palette: what is typed finds what was meant, and Enter goes there.

use crossterm::event::{KeyCode, KeyEvent, KeyModifiers};

use crate::{
    plant::role::Role,
    ui::{
        Model, Msg,
        fixture::Fixture,
        modal::{Modal, palette::Target},
        tabs::Tab,
        tests::{model, screen, sent_kind, type_keys},
        theme::Theme,
        update,
    },
};

fn at(tab: Tab, typed: &str) -> Model {
    let mut model = model(&Fixture::alarm(), Theme::FULL);
    model.tabs.shown = tab;
    type_keys(&mut model, typed);
    model
}

#[test]
fn a_few_letters_lead_to_what_was_meant() {
    let fixture = Fixture::alarm();
    for (typed, expect) in [
        ("alarms", Target::Tab(Tab::Alarms)),
        ("ALAR", Target::Tab(Tab::Alarms)),
        ("bus", Target::Tab(Tab::Bus)),
        ("tic pv", Target::Tag(fixture.tag("TIC-1.PV"))),
        ("pv trend", Target::Trend(fixture.tag("TIC-1.PV"))),
        ("plc-1 dev", Target::Device(fixture.def.devices[1].id)),
        ("temperature high", Target::Alarm(fixture.alarms[0].id)),
    ] {
        let model = at(Tab::Mimic, &format!(":{typed}⏎"));
        assert_eq!(model.recent.first(), Some(&expect), "{typed}");
    }
}

#[test]
fn a_target_is_shown() {
    assert_eq!(at(Tab::Mimic, ":alarms⏎").tabs.shown, Tab::Alarms);
    assert_eq!(at(Tab::Mimic, ":plc-1 dev⏎").tabs.shown, Tab::Controllers);
    let model = at(Tab::Mimic, ":pv trend⏎");
    assert_eq!((model.tabs.shown, &model.modal), (Tab::Trends, &None));
    assert!(matches!(at(Tab::Bus, ":tic pv⏎").modal, Some(Modal::Faceplate(_))));
    assert!(matches!(at(Tab::Bus, ":temperature high⏎").modal, Some(Modal::Guidance(_))));
    assert!(matches!(at(Tab::Mimic, ":zzzz⏎").modal, Some(Modal::Palette(_))), "nothing fits: it stays");
}

/// What is typed is never taken for keys of the tab, such as `a` for acknowledge.
#[test]
fn the_palette_opens_on_the_smallest_screen() {
    for (width, height) in [(36, 8), (40, 12), (59, 15)] {
        let mut model = at(Tab::Mimic, "");
        screen(&mut model, width, height);
        assert_eq!(type_keys(&mut model, ":alarms"), []);
        let shown = screen(&mut model, width, height);
        assert!(shown.contains(": alarms") && shown.contains("Alarms"), "{shown}");
        type_keys(&mut model, "⏎:tic pv⏎");
        assert_eq!(model.tabs.shown, Tab::Alarms);
        assert!(matches!(model.modal, Some(Modal::Faceplate(_))));
        assert_eq!(type_keys(&mut model, "⎋:-10m⏎"), [], "there is no room for the past");
        assert!(matches!(model.modal, Some(Modal::Palette(_))));
        type_keys(&mut model, "⎋:pv trend⏎");
        assert_eq!((model.tabs.shown, model.note.is_some()), (Tab::Alarms, true), "it says that this needs room");
    }
}

#[test]
fn what_was_chosen_comes_first_the_next_time() {
    let mut model = at(Tab::Mimic, ":tic pv⏎⎋:plc-1 dev⏎:");
    let shown = screen(&mut model, 80, 24);
    let rows: Vec<&str> = shown.lines().skip(7).take(2).collect();
    assert!(rows[0].contains("device  PLC-1") && rows[1].contains("tag     TIC-1.PV"), "{shown}");
}

#[test]
fn a_command_of_the_tab_asks_as_its_key_does() {
    let mut by_name = at(Tab::Mimic, "");
    assert_eq!(sent_kind(&type_keys(&mut by_name, ":set sv⏎")), None);
    assert_eq!(by_name.modal, at(Tab::Mimic, "s").modal);
    // Without the right it says so, as the key does.
    let mut viewer = model(&Fixture::alarm(), Theme::FULL);
    let session = std::sync::Arc::make_mut(&mut viewer.session);
    session.who.iter_mut().for_each(|who| who.role = Role::Viewer);
    type_keys(&mut viewer, "4⏎:tune⏎");
    assert!(!matches!(viewer.modal, Some(Modal::Confirm(_))), "{:?}", viewer.modal);
}

#[test]
fn a_paste_is_searched_for() {
    let mut model = at(Tab::Mimic, "");
    update(&mut model, Msg::Key(KeyEvent::new(KeyCode::Char('p'), KeyModifiers::CONTROL)));
    update(&mut model, Msg::Paste("TIC-1.PV\n".into()));
    type_keys(&mut model, "⏎");
    assert_eq!(model.recent, [Target::Tag(Fixture::alarm().tag("TIC-1.PV"))]);
}

#[test]
fn back_and_forward_lead_through_the_tabs() {
    let mut model = at(Tab::Mimic, "235");
    for (key, expect) in [("[", Tab::Alarms), ("[", Tab::Trends), ("]", Tab::Alarms), ("[", Tab::Trends)] {
        type_keys(&mut model, key);
        assert_eq!(model.tabs.shown, expect, "{key}");
    }
}

#[test]
fn a_key_without_a_meaning_is_answered() {
    let mut model = at(Tab::Mimic, "Z");
    assert!(screen(&mut model, 80, 24).contains("This key does nothing here. ? lists the keys"));
    type_keys(&mut model, "M");
    assert!(!screen(&mut model, 80, 24).contains("does nothing"), "one that only changes the view is none");
}

#[test]
fn the_help_presses_the_selected_key() {
    let mut model = at(Tab::Mimic, "?↓⏎");
    assert_eq!(model.modal, at(Tab::Mimic, "s").modal, "the first key of the mimic sets SV");
    type_keys(&mut model, "⎋?⏎");
    assert_eq!(model.modal, None, "a heading is no key");
}
