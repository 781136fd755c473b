//! The list of all values.

use super::*;

#[test]
fn the_list_of_all_values_is_filtered_while_it_is_typed() {
    let mut stand = Stand::new(Theme::FULL, 80, 24);
    stand.press("/lt-1");
    stand.answer();
    let shown = stand.screen();
    assert!(shown.contains("PLC-1.LT-1") && !shown.contains("TIC-1.SV"), "{shown}");
    stand.press("⎋");
    assert!(stand.screen().contains("TIC-1.SV"), "Esc: as it was before");
    stand.press("/lt-1⏎");
    for (keys, expect) in [("", "\"lt-1\": 1 of"), ("⎋", "All values"), ("⎋", "window 10 min")] {
        stand.press(keys);
        assert!(stand.screen().contains(expect), "{expect}: {}", stand.screen());
    }
}

#[test]
fn a_listed_value_is_copied_with_unit_quality_and_time() {
    let mut stand = Stand::new(Theme::FULL, 80, 24);
    stand.press("v↓");
    let copied = TabView::copied(&stand.model.tabs.trends, &stand.model.cx());
    let expect = value::line(&stand.model.cx(), TagId(1));
    assert_eq!(copied, [expect]);
}
