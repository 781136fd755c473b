//! The rows of a report and of its record: pages, filter, jump and file.

use super::*;
use crate::report::RecordRow;

/// A shift of two hours, a row a minute: PV rises from 50.0 °C by 0.1, and is not known in the fourth row.
fn recorded(theme: Theme, width: u16, height: u16) -> Stand {
    let mut stand = Stand::new(theme, width, height);
    for (id, query) in std::mem::take(&mut stand.asked) {
        let Query::Report { period } = query else { continue };
        let row = |n: i64| {
            let pv = (n != 3).then_some(50.0 + n as f64 / 10.0);
            let at = period.from + SignedDuration::from_mins(n);
            let er = pv.map(|pv| (70.0 - pv).into());
            RecordRow { at, sv: Some(70.0.into()), pv: pv.map(Exact::from), er }
        };
        let record = (0..120).map(row).collect();
        let report = ShiftReport { record, ..report(period, true) };
        stand.send(Msg::Answer(id, Ok(Answer::Report(Box::new(report)))));
    }
    stand.press("n");
    stand
}

#[test]
fn the_record_is_paged_through_row_by_row() {
    for (width, height) in [(80, 24), (120, 40)] {
        let mut stand = recorded(Theme::FULL, width, height);
        let shown = stand.screen();
        for words in ["14:00:00", "70.0", "50.0", "20.0", "----", "120 rows"] {
            assert!(shown.contains(words), "no {words} at {width}x{height}:\n{shown}");
        }
        assert!(!shown.contains("15:59:00"));
        stand.press("↓↓↓");
        stand.send(Msg::Key(KeyEvent::new(KeyCode::End, KeyModifiers::NONE)));
        let shown = stand.screen();
        assert!(shown.contains("15:59:00") && shown.contains("61.9"), "{shown}");
        stand.press("⎋");
        assert!(!stand.screen().contains("15:59:00"), "Esc leads back to the figures");
    }
}

#[test]
fn a_time_is_found_and_a_condition_filters() {
    let mut stand = recorded(Theme::FULL, 80, 24);
    stand.press("/14:40⏎");
    let shown = stand.screen();
    assert!(shown.contains("14:40:00") && !shown.contains("14:39:00"), "{shown}");
    stand.press("⎋");
    let shown = stand.screen();
    assert!(["▸", "14:40:00", "14:41:00"].iter().all(|words| shown.contains(words)), "found among the others: {shown}");
    stand.press("/pv > 61.5⏎");
    let shown = stand.screen();
    assert!(shown.contains("4 of 120") && shown.contains("15:56:00") && !shown.contains("15:55:00"), "{shown}");
    stand.press("ssssS");
    let shown = stand.screen();
    let place = |words| shown.find(words).unwrap_or(usize::MAX);
    assert!(place("15:59:00") < place("15:56:00"), "the highest PV first: {shown}");
    stand.press("⎋⎋ssss");
    let last = |stand: &Stand| {
        let cx = stand.model.cx();
        let rows = stand.model.tabs.reports.report.rows(&cx);
        rows.last().map(|row| cx.local(RecordRows::id(row), "%H:%M"))
    };
    assert_eq!(last(&stand).as_deref(), Some("14:03"), "what is not known comes last");
    stand.press("S");
    assert_eq!(last(&stand).as_deref(), Some("14:03"), "either way");
    stand.press("⎋/pv > 90⏎");
    assert!(stand.screen().contains("No matching entries."), "{}", stand.screen());
    stand.press("⎋");
    assert!(stand.screen().contains("120 rows"), "{}", stand.screen());
}

#[test]
fn the_rows_are_written_as_they_are_recorded() {
    let mut stand = recorded(Theme::FULL, 80, 24);
    stand.press("e");
    let (path, bytes) = stand.saved.pop().expect("a file");
    let text = String::from_utf8(bytes).expect("text");
    assert!(path.display().to_string().ends_with(".record.csv"), "{}", path.display());
    assert_eq!(text.lines().count(), 121, "{text}");
}

#[test]
fn why_goes_through_the_values_of_the_report() {
    let mut stand = Stand::new(Theme::FULL, 80, 24);
    stand.press("w");
    assert!(stand.model.modal.is_none(), "there is no report yet");
    stand.answer(true);
    stand.press("w");
    assert!(stand.screen().contains("why TIC-1.PV"), "{}", stand.screen());
}
