//! The chart beside the figures on a wide screen.

use super::*;

#[test]
fn a_wide_screen_shows_the_chart_of_a_tag_beside_the_figures() {
    for (width, height) in [(110, 24), (120, 40), (160, 50), (200, 60)] {
        let mut stand = Stand::new(Theme::FULL, width, height);
        stand.answer(true);
        let [(_, Query::Series { tags, .. })] = stand.asked.as_slice() else { panic!("{:?}", stand.asked) };
        let first = tags.clone();
        stand.answer(true);
        let shown = stand.screen();
        assert!(shown.contains("t next tag   ● TIC-1.PV") && shown.contains("▸ TIC-1.PV"), "{shown}");
        stand.press("t");
        let asked: Vec<_> = stand
            .asked
            .iter()
            .filter_map(|(_, query)| match query {
                Query::Series { tags, .. } => Some(tags.clone()),
                _ => None,
            })
            .collect();
        assert!(asked.len() == 1 && asked[0] != first, "{asked:?}");
        stand.press("T");
        assert!(stand.screen().contains("▸ TIC-1.PV"));
    }
}

#[test]
fn no_curve_is_asked_for_that_is_not_shown() {
    let mut stand = Stand::new(Theme::FULL, 109, 40);
    stand.answer(true);
    assert!(stand.asked.is_empty(), "{:?}", stand.asked);
    assert!(!stand.screen().contains("next tag   "));
}

#[test]
fn a_wide_screen_has_the_whole_state_of_an_alarm() {
    let mut stand = Stand::new(Theme::FULL, 200, 60);
    stand.answer(true);
    let mut report = stand.model.tabs.reports.report.answered.value.take().expect("answered");
    report.alarms[0].event = AlarmEvent::SuppressedByDesign;
    stand.model.tabs.reports.report.answered.value = Some(report);
    let shown = stand.screen();
    assert!(shown.contains("alarms, 1 not annunciated hidden, d shows them"), "{shown}");
    stand.press("d");
    let shown = stand.screen();
    assert!(shown.contains("suppressed by design") && !shown.contains("hidden"), "{shown}");
}
