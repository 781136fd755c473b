//! Zoom, and the way back through earlier windows; gaps at every window.

use super::{super::view::NO_TRACE, *};

#[test]
fn the_way_back_leads_through_earlier_windows() {
    let mut stand = Stand::new(Theme::FULL, 80, 24);
    let mut check = |keys: &str, expect: &str| {
        stand.press(keys);
        stand.answer();
        let title = stand.screen().lines().nth(4).map(str::to_owned).unwrap_or_default();
        assert!(title.contains(expect), "{keys}: {title}");
    };
    check("z", "window 10 min   live");
    check("-", "window 15 min   live");
    check("←←←", "window 15 min    past");
    check("-", "window 30 min    past");
    check("z", "window 15 min    past");
    check("z", "window 15 min   live");
    check("Z", "window 15 min    past");
    check("Z", "window 30 min    past");
    check("Z", "window 30 min    past");
    check("zzzz", "window 10 min   live");
    check("m", "all since midnight");
    check("z", "window 10 min   live");
    check("+", "window 5 min   live");
    check("Z", "window 5 min   live");
}

#[test]
fn a_pause_keeps_the_width_of_the_day() {
    let mut stand = Stand::new(Theme::FULL, 80, 24);
    stand.press("m");
    stand.answer();
    let width = |stand: &Stand| stand.model.tabs.trends.span(&stand.model.cx()).width();
    let before = width(&stand);
    stand.press("p");
    stand.answer();
    assert!(before <= width(&stand) && width(&stand) < before * 2, "{before:#} {:#}", width(&stand));
}

#[test]
fn enter_zooms_to_the_time_between_the_cursors() {
    let mut stand = Stand::new(Theme::FULL, 80, 24);
    stand.answer();
    stand.press("c←←←←←←←←←←b→→→→⏎");
    stand.answer();
    let (a, b) = stand.model.tabs.trends.both().expect("both cursors");
    let view = stand.model.tabs.trends.span(&stand.model.cx());
    assert!(view.holds(a) && view.holds(b));
    assert_eq!(stand.model.tabs.trends.window, 0, "a minute");
    stand.press("z");
    assert!(stand.screen().contains("window 10 min"));
}

#[test]
fn no_window_bridges_a_gap() {
    for (place, seconds) in WINDOWS.into_iter().enumerate() {
        let mut stand = Stand::new(Theme::FULL, 120, 40);
        stand.begin = ago(2 * seconds);
        stand.gap = (ago(seconds / 2), ago(seconds / 4));
        stand.model.tabs.trends.window = place;
        stand.model.tabs.trends.moved();
        stand.press("↓");
        stand.answer();
        let trends = &stand.model.tabs.trends;
        let view = trends.span(&stand.model.cx());
        let trace = trends.traces.get(&TagId(0)).unwrap_or(&NO_TRACE);
        let columns = trace.columns(view.from, view.to, now(), 220);
        let width = view.width() / 220;
        for (n, column) in (0..).zip(&columns) {
            let at = view.from + width * n;
            let inside = at > stand.gap.0 + width * 2 && at + width * 2 < stand.gap.1;
            assert!(!inside || column.is_none(), "{seconds} s: column {n} at {at}");
        }
        let past = columns.iter().take(200).filter(|column| column.is_none()).count();
        assert!((45..65).contains(&past), "{seconds} s: {past} empty columns");
    }
}

#[test]
fn a_pause_keeps_the_window() {
    let mut stand = Stand::new(Theme::FULL, 80, 24);
    stand.answer();
    stand.press("m");
    stand.answer();
    let width = stand.model.tabs.trends.span(&stand.model.cx()).width();
    stand.press("p");
    let trends = &stand.model.tabs.trends;
    assert_eq!(trends.window, nearest(width));
    assert_eq!(trends.end, Some(now()));
}
