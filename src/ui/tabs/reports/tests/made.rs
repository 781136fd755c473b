//! The list of automatic reports.

use super::*;
use crate::{
    history::MadeReports,
    plant::report::{PeriodKind, ReportEvent, ReportRecord},
    report::calendar,
};

/// The last shifts and the last week as a station has made them.
pub fn list() -> MadeReports {
    let def = Fixture::normal().def;
    let record = |kind, hours: i64, format: &str, event, attempts, error: Option<&str>| {
        let at = now() - SignedDuration::from_hours(hours);
        let running = calendar::period_at(&def, kind, at).expect("a period");
        let period = calendar::previous(&def, kind, &running).expect("a period");
        ReportRecord {
            at: period.to + SignedDuration::from_secs(61),
            period: kind,
            name: period.name.to_string().into(),
            from: period.from,
            to: period.to,
            format: format.into(),
            file: if event == ReportEvent::NotMade {
                "".into()
            } else {
                format!("/srv/reports/{}-{hours}.{format}", kind.word()).into()
            },
            sha256: if event == ReportEvent::NotMade { "".into() } else { "5f".repeat(32).into() },
            event,
            attempts,
            error: error.map(Into::into),
        }
    };
    use PeriodKind::{Day, Month, Shift, Week};
    let reports = vec![
        record(Shift, 0, "csv", ReportEvent::Delivered, 1, None),
        record(Shift, 0, "html", ReportEvent::Made, 0, None),
        record(Shift, 8, "csv", ReportEvent::DeliveryFailed, 6, Some("curl: exit status: 6: could not resolve host")),
        record(Day, 0, "html", ReportEvent::DeliveryFailed, 1, Some("curl: exit status: 6: could not resolve host")),
        record(Week, 0, "html", ReportEvent::Delivered, 1, None),
        record(Month, 0, "html", ReportEvent::NotMade, 0, Some("too much for one query")),
        record(Month, 900, "html", ReportEvent::Deleted, 1, None),
    ];
    MadeReports { reports, extent: None, host: "panel-3".to_owned() }
}

fn stand(width: u16, height: u16) -> Stand {
    let mut stand = Stand::of(&Fixture::normal(), Theme::FULL, width, height);
    stand.answer(true);
    stand.press("r");
    stand
}

#[test]
fn automatic_reports_are_listed_with_their_state() {
    let mut stand = stand(120, 30);
    assert!(matches!(stand.asked.last(), Some((_, Query::Reports { .. }))), "{:?}", stand.asked);
    stand.answer(true);
    insta::assert_snapshot!("automatic_reports_at_120x30", stand.screen());
    stand.press("↓↓");
    let screen = stand.screen();
    assert!(screen.contains("could not resolve host, 6 times") && screen.contains("NOT DELIVERED"), "{screen}");
    stand.press("r");
    assert!(stand.screen().contains("TIC-1.PV"), "back at the report of the shift");
    let mut small = self::stand(60, 20);
    small.answer(true);
    insta::assert_snapshot!("automatic_reports_at_60x20", small.screen());
}

#[test]
fn the_command_that_fetches_a_file_is_copied() {
    let mut stand = stand(120, 30);
    stand.answer(true);
    let copied = |stand: &Stand| stand.model.tabs.shown().copied(&stand.model.cx());
    assert_eq!(copied(&stand), ["scp panel-3:/srv/reports/shift-0.csv ."]);
    stand.press("↓↓↓↓↓");
    assert_eq!(copied(&stand), [""; 0], "a report that was not made has no file");
}

#[test]
fn an_automatic_report_is_shown_as_text() {
    let mut stand = stand(100, 24);
    stand.answer(true);
    stand.press("↓↓↓↓⏎");
    let Some((_, Query::Report { period })) = stand.asked.last() else { panic!("{:?}", stand.asked) };
    assert_eq!(period.name.to_string(), "2026-W46");
    stand.answer(true);
    let top = stand.screen();
    assert!(top.contains("Report: 2026-W46"), "{top}");
    stand.press("↓↓↓");
    assert_ne!(stand.screen(), top, "it scrolls");
    stand.press("⎋");
    assert!(stand.screen().contains("Automatic reports"));
    stand.press("⎋");
    assert!(!stand.screen().contains("Automatic reports"));
}
