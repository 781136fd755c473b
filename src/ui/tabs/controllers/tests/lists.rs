//! What is found in the lists of devices and of parameters.

use super::*;
use crate::ui::tabs::TabView;

#[test]
fn a_filter_finds_by_name_and_meaning_and_escape_takes_it_away() {
    let mut model = model(&many(1), Theme::FULL);
    type_keys(&mut model, "4/highest⏎");
    let shown = screen(&mut model, 80, 24);
    assert!(shown.contains("SV-H") && !shown.contains("integral") && shown.contains("only \"highest\""), "{shown}");
    type_keys(&mut model, "⎋");
    assert!(screen(&mut model, 80, 24).contains("integral"));
    type_keys(&mut model, "/xyz");
    assert!(screen(&mut model, 80, 24).contains("no matching parameter"));
}

#[test]
fn devices_are_found_by_their_names_as_table_and_as_faceplates() {
    for width in [80, 200] {
        let mut model = model(&many(31), Theme::FULL);
        screen(&mut model, width, 50);
        type_keys(&mut model, "4/tic-31");
        let shown = screen(&mut model, width, 50);
        assert!(
            shown.contains("\"tic-31\": 1 of 31") && shown.contains("TIC-31") && !shown.contains("TIC-30"),
            "{shown}"
        );
        type_keys(&mut model, "⏎⏎");
        assert!(screen(&mut model, width, 50).contains("‹ TIC-31 ›"));
        type_keys(&mut model, "⎋⎋");
        assert!(screen(&mut model, width, 50).contains("TIC-30"), "Esc shows all");
        type_keys(&mut model, "/xyz");
        assert!(screen(&mut model, width, 50).contains("No matching entries."));
    }
}

#[test]
fn what_is_copied_of_a_device_is_its_value() {
    let mut model = model(&many(3), Theme::FULL);
    type_keys(&mut model, "4↓");
    let copied = TabView::copied(&model.tabs.controllers, &model.cx());
    assert!(copied.len() == 1 && copied[0].starts_with("TIC-2.PV\t") && copied[0].contains("°C"), "{copied:?}");
}

#[test]
fn a_page_over_the_list_is_of_the_device_that_is_selected() {
    let mut model = model(&many(3), Theme::FULL);
    type_keys(&mut model, "4↓h");
    let id = |model: &Model| model.tabs.controllers.device(&model.cx()).map(|device| device.id);
    assert_eq!(id(&model), Some(DeviceId(1)));
    type_keys(&mut model, "⎋/xyz⏎h");
    let shown = screen(&mut model, 80, 24);
    assert!(shown.contains("P, I and D") && id(&model).is_none(), "{shown}");
}

#[test]
fn a_device_stays_selected_while_live_values_change_the_order() {
    let mut fixture = many(3);
    let values = |fixture: &mut Fixture, values: [f64; 3]| {
        for (n, value) in (1..).zip(values) {
            fixture.set(&format!("TIC-{n}.PV"), value);
        }
    };
    values(&mut fixture, [30.0, 10.0, 20.0]);
    let mut model = model(&fixture, Theme::FULL);
    type_keys(&mut model, "4ssssss↓↑");
    let selected = |model: &Model| model.tabs.controllers.device(&model.cx()).map(|device| device.name.clone());
    assert_eq!(selected(&model).as_deref(), Some("TIC-2"), "the lowest comes first");
    values(&mut fixture, [30.0, 40.0, 20.0]);
    update(&mut model, Msg::Snapshot(fixture.snapshot()));
    assert_eq!(selected(&model).as_deref(), Some("TIC-2"));
}
