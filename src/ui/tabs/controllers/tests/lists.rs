//! What is found in the lists of devices and of parameters.

use super::*;

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
