//! Clicks, the wheel and drags mean what the keys of the same place mean.

use super::*;
use crate::ui::{
    Effect, Msg,
    fixture::Fixture,
    modal::Modal,
    preferences::Preferences,
    tabs::Tab,
    tests::{model, screen, type_keys},
    theme::Theme,
    update,
};

fn with_mouse(fixture: &Fixture) -> Model {
    let mut model = model(fixture, Theme::FULL);
    model.preferences_file.set(Some("tech1"), Preferences { mouse: true, ..Preferences::default() });
    screen(&mut model, 80, 24);
    model
}

/// Where these words stand on the screen.
fn place(model: &mut Model, words: &str) -> Position {
    let shown = screen(model, 80, 24);
    let rows = shown.lines().zip(0..);
    let found = rows.filter_map(|(line, y)| Some((line.split_once(words)?.0.chars().count(), y))).last();
    let (x, y) = found.unwrap_or_else(|| panic!("no {words}\n{shown}"));
    Position::new(x as u16, y)
}

fn click(model: &mut Model, words: &str) -> Vec<Effect> {
    let at = place(model, words);
    update(model, Msg::Drawn);
    update(model, Msg::Pointer(Pointer::Press(at)))
}

#[test]
fn a_click_on_a_heading_shows_its_tab_from_any_window() {
    let mut model = with_mouse(&Fixture::alarm());
    click(&mut model, "3 Alarms");
    assert_eq!(model.tabs.shown, Tab::Alarms);
    type_keys(&mut model, "?");
    click(&mut model, "2 Trends");
    assert_eq!((model.tabs.shown, &model.modal), (Tab::Trends, &None));
    type_keys(&mut model, "1s7");
    let before = model.modal.clone();
    click(&mut model, "3 Alarms");
    assert_eq!(model.modal, before, "a number that is being typed is not lost by a click");
}

#[test]
fn a_click_that_cancels_a_confirmation_says_so() {
    let mut model = with_mouse(&Fixture::normal());
    type_keys(&mut model, "q");
    assert!(matches!(model.modal, Some(Modal::Confirm(_))));
    click(&mut model, "3 Alarms");
    assert_eq!((model.tabs.shown, &model.modal), (Tab::Alarms, &None));
    assert_eq!(model.note.as_deref(), Some("Cancelled: nothing was sent"));
}

#[test]
fn a_click_on_what_has_changed_does_nothing() {
    let mut model = with_mouse(&Fixture::normal());
    let at = place(&mut model, "3 Alarms");
    update(&mut model, Msg::Drawn);
    update(&mut model, Msg::Snapshot(Fixture::alarm().snapshot()));
    update(&mut model, Msg::Pointer(Pointer::Press(at)));
    assert_eq!(model.tabs.shown, Tab::Mimic);
    update(&mut model, Msg::Drawn);
    update(&mut model, Msg::Pointer(Pointer::Press(at)));
    assert_eq!(model.tabs.shown, Tab::Alarms);
}

#[test]
fn a_click_on_a_key_of_the_footer_presses_it() {
    let mut model = with_mouse(&Fixture::alarm());
    click(&mut model, "? help");
    assert!(matches!(model.modal, Some(Modal::Help(_))));
    click(&mut model, "Esc close");
    assert_eq!(model.modal, None);
    click(&mut model, "q quit");
    assert!(model.modal.as_ref().is_some_and(Modal::is_quit));
}

#[test]
fn a_click_selects_a_row_and_the_wheel_moves_on() {
    let mut model = with_mouse(&Fixture::alarm());
    type_keys(&mut model, "3");
    let chosen = |model: &Model| model.tabs.alarms.selected(&model.cx()).map(|alarm| alarm.id.index());
    assert_eq!(chosen(&model), Some(0));
    click(&mut model, "level low");
    assert_eq!(chosen(&model), Some(2));
    click(&mut model, "not responding");
    assert_eq!(chosen(&model), Some(3));
    update(&mut model, Msg::Pointer(Pointer::Wheel { down: false }));
    assert_eq!(chosen(&model), Some(0));
}

#[test]
fn a_click_selects_in_windows_and_on_the_mimic() {
    let mut model = with_mouse(&Fixture::normal());
    update(&mut model, Msg::Key(keys::code(KeyCode::F(2)).event()));
    click(&mut model, "motion");
    type_keys(&mut model, " ");
    assert!(!model.preferences.motion, "the row of the click is the one that changes");
    type_keys(&mut model, "⎋");
    click(&mut model, "TK-2 cold");
    let copied = model.tabs.shown().copied(&model.cx());
    assert!(
        copied.iter().any(|line| line.starts_with("PLC-1.TK-2\t4.6\tl\tgood\t2026-11-21T14:02:30+07:00")),
        "{copied:?}"
    );
}

#[test]
fn a_drag_moves_the_cursor_of_the_trends() {
    let mut model = with_mouse(&Fixture::normal());
    type_keys(&mut model, "2");
    let moment = |model: &mut Model, x| {
        update(model, Msg::Pointer(Pointer::Drag(Position::new(x, 10))));
        model.tabs.shown().moment(&model.cx())
    };
    let (left, right) = (moment(&mut model, 20), moment(&mut model, 60));
    assert!(left.is_some() && left < right, "{left:?} {right:?}");
    assert_eq!(moment(&mut model, 20), left);
}

#[test]
fn without_the_preference_the_mouse_does_nothing() {
    let mut model = model(&Fixture::alarm(), Theme::FULL);
    click(&mut model, "3 Alarms");
    assert_eq!(model.tabs.shown, Tab::Mimic);
}

#[test]
fn what_is_selected_is_copied_with_unit_quality_and_time() {
    let copied = |effects: Vec<Effect>| {
        effects.into_iter().find_map(|effect| if let Effect::Copy(text) = effect { Some(text) } else { None })
    };
    let mut model = with_mouse(&Fixture::alarm());
    assert_eq!(copied(type_keys(&mut model, "y")), None);
    assert!(screen(&mut model, 80, 24).contains("Nothing is selected that can be copied"));
    let alarm = "high\tTIC-1.PV\ttemperature high\tUNACK\t72.1 °C\t2026-11-21T14:01:50+07:00";
    assert_eq!(copied(type_keys(&mut model, "3y")).as_deref(), Some(alarm));
    assert!(screen(&mut model, 80, 24).contains("Copied: high  TIC-1.PV  temperature high"));
    let both = copied(type_keys(&mut model, " ↓ y")).unwrap_or_default();
    assert!(both.lines().count() == 2 && both.contains(alarm), "the marked ones: {both}");
    let value = copied(type_keys(&mut model, "4⏎y")).unwrap_or_default();
    assert!(value.ends_with("\tgood\t2026-11-21T14:02:30+07:00"), "{value}");
}
