//! What is tried is seen, what is kept stays, and everything else is as before.

use super::*;
use crate::ui::keys;
use crate::ui::{
    Effect, Msg,
    fixture::Fixture,
    tests::{model, screen, type_keys},
    theme::Theme,
    update,
};

fn settings(fixture: &Fixture) -> Model {
    let mut model = model(fixture, Theme::FULL);
    press(&mut model);
    model
}

fn press(model: &mut Model) -> Vec<Effect> {
    update(model, Msg::Key(keys::code(KeyCode::F(2)).event()))
}

#[test]
fn a_choice_is_tried_at_once_and_kept_with_enter() {
    let mut model = settings(&Fixture::alarm());
    type_keys(&mut model, "→→");
    assert_eq!(model.theme.name, ThemeName::Light);
    let effects = type_keys(&mut model, "⏎");
    let light = Preferences { theme: ThemeName::Light, ..Preferences::default() };
    assert_eq!(effects, [Effect::KeepPreferences(Some("tech1".to_owned()), light.into())]);
    assert_eq!((model.theme.name, model.modal.is_none()), (ThemeName::Light, true));
}

#[test]
fn whatever_else_closes_the_window_ends_the_trial() {
    for way in ["⎋", "q", "3"] {
        let mut model = settings(&Fixture::alarm());
        type_keys(&mut model, "→↓→↓→↓→↓→");
        assert!(model.preferences != Preferences::default() && model.theme != Theme::FULL);
        let effects = type_keys(&mut model, way);
        assert_eq!(
            (model.preferences, model.theme, &model.modal),
            (Preferences::default(), Theme::FULL, &None),
            "{way}"
        );
        assert!(!effects.iter().any(|effect| matches!(effect, Effect::KeepPreferences(..))), "{way}");
    }
    let mut model = settings(&Fixture::alarm());
    type_keys(&mut model, "→");
    update(&mut model, Msg::Resize(30, 8));
    assert_eq!(model.theme, Theme::FULL, "a window that cannot be seen tries nothing");
}

#[test]
fn each_user_finds_what_that_user_has_kept() {
    let mut model = settings(&Fixture::normal());
    type_keys(&mut model, "→⏎");
    assert_eq!(model.theme.name, ThemeName::Dark);
    let out = crate::access::SessionStatus { may_view: true, ..Default::default() };
    update(&mut model, Msg::SessionStatus(std::sync::Arc::new(out)));
    assert_eq!(model.theme.name, ThemeName::Grey);
    update(&mut model, Msg::SessionStatus(crate::ui::fixture::session()));
    assert_eq!(model.theme.name, ThemeName::Dark);
}

#[test]
fn a_locked_terminal_asks_for_the_password_first() {
    let mut model = settings(&Fixture::normal());
    let locked = crate::access::SessionStatus { locked: true, ..(*crate::ui::fixture::session()).clone() };
    update(&mut model, Msg::SessionStatus(std::sync::Arc::new(locked)));
    if model.modal.is_none() {
        press(&mut model);
    }
    let effects = type_keys(&mut model, "→⏎");
    assert!(!effects.iter().any(|effect| matches!(effect, Effect::KeepPreferences(..))));
    assert!(model.modal.as_ref().is_some_and(Modal::is_unlock));
}

#[test]
fn what_could_not_be_kept_is_said() {
    let mut model = model(&Fixture::normal(), Theme::FULL);
    update(&mut model, Msg::Preferences(Err("p.toml:2:9: unknown theme `pink`".to_owned())));
    let shown = screen(&mut model, 80, 24);
    assert!(shown.contains("Not kept: p.toml:2:9: unknown theme `pink`"), "{shown}");
    model.preferences_file.problem = Some("p.toml:2:9: unknown theme `pink`".to_owned());
    press(&mut model);
    type_keys(&mut model, "→→");
    for (width, height) in [(60, 16), (80, 24)] {
        let shown = screen(&mut model, width, height);
        assert!(shown.contains("Not kept: p.toml:2:9: unknown theme `pink`"), "{shown}");
        assert!(shown.contains("‹ light ›"), "{shown}");
    }
}

#[test]
fn settings_at_all_sizes() {
    for (width, height) in [(60, 16), (80, 24), (120, 40)] {
        let mut model = settings(&Fixture::alarm());
        model.preferences_file.path = "/home/panel/.config/sightglass/preferences.toml".to_owned();
        model.modal = Some(Modal::TerminalSettings(TerminalSettings::new(&model)));
        insta::assert_snapshot!(format!("settings_{width}x{height}"), screen(&mut model, width, height));
    }
}

#[test]
fn no_note_of_a_choice_is_cut_at_60_columns() {
    let mut model = settings(&Fixture::alarm());
    for language in Language::all() {
        model.preferences.language = Some(language);
        for row in 0..ROWS.len() {
            for choice in 0..5 {
                let mut window = TerminalSettings::new(&model);
                window.chosen.language = Some(language);
                window.row = row;
                model.modal = Some(Modal::TerminalSettings(window));
                type_keys(&mut model, &"→".repeat(choice));
                let shown = screen(&mut model, 60, 20);
                let cut = shown.lines().skip(4).take(ROWS.len() + 1).find(|row| row.contains('…'));
                assert_eq!(cut, None, "{shown}");
            }
        }
    }
}
