//! The reports tab in the whole terminal, with a made-up report behind it.

mod batches;
mod columns;
mod counters;
mod made;
mod chart;
mod rows;
use std::sync::Arc;

use crossterm::event::{KeyEvent, KeyModifiers};
use ratatui::{Terminal, backend::TestBackend};

use super::*;
use crate::{
    access::{Durability, SessionRequest},
    plant::{
        batch::Batch,
        command::Command,
        def::Priority,
        record::{ActionRecord, AlarmEvent, AlarmRecord, ChainHash},
        recorded_action::RecordedAction,
    },
    report::{TagFigures, batch::BatchReport},
    ui::{
        Effect, Model, Msg, QueryId,
        fixture::{Fixture, now},
        theme::Theme,
        update, view,
    },
};

struct Stand {
    model: Model,
    asked: Vec<(QueryId, Query)>,
    saved: Vec<(PathBuf, Vec<u8>)>,
    commands: Vec<Command>,
    /// What the station says to an export.
    reply: Result<Durability, RequestRefusal>,
}

impl Stand {
    fn new(theme: Theme, width: u16, height: u16) -> Stand {
        Stand::of(&Fixture::normal(), theme, width, height)
    }

    fn of(fixture: &Fixture, theme: Theme, width: u16, height: u16) -> Stand {
        let model = Model::new(fixture.snapshot(), theme, 1, crate::ui::fixture::session());
        let mut stand = Stand {
            model,
            asked: Vec::new(),
            saved: Vec::new(),
            commands: Vec::new(),
            reply: Ok(Durability::Recorded),
        };
        stand.send(Msg::Resize(width, height));
        stand.press("5");
        stand
    }

    fn send(&mut self, msg: Msg) {
        for effect in update(&mut self.model, msg) {
            match effect {
                Effect::Query(id, query) if id.tab == Some(Tab::Reports) => self.asked.push((id, query)),
                Effect::SaveReport { path, bytes, .. } => self.saved.push((path, bytes)),
                Effect::SessionRequest(id, SessionRequest::Exported { file, sha256 }) => {
                    assert_eq!((file.ends_with(".csv"), sha256.as_ref().map(String::len)), (true, Ok(64)));
                    self.send(Msg::RequestDone(id, self.reply.clone()));
                }
                Effect::Command(command, _) => self.commands.push(command),
                Effect::Query(..)
                | Effect::SessionRequest(..)
                | Effect::Extension(_)
                | Effect::SaveNew { .. }
                | Effect::Load { .. }
                | Effect::Append { .. }
                | Effect::Bell
                | Effect::Redraw
                | Effect::Copy(_)
                | Effect::KeepPreferences(..)
                | Effect::Quit => {}
            }
        }
    }

    fn press(&mut self, keys: &str) {
        for key in keys.chars() {
            let code = match key {
                '←' => KeyCode::Left,
                '→' => KeyCode::Right,
                '↓' => KeyCode::Down,
                '↑' => KeyCode::Up,
                '⏎' => KeyCode::Enter,
                '⎋' => KeyCode::Esc,
                '⇥' => KeyCode::Tab,
                '⌫' => KeyCode::Backspace,
                key => KeyCode::Char(key),
            };
            self.send(Msg::Key(KeyEvent::new(code, KeyModifiers::NONE)));
        }
    }

    /// Answers what was asked; `full` with figures, else with an empty report.
    fn answer(&mut self, full: bool) {
        for (id, query) in std::mem::take(&mut self.asked) {
            let answer = match query {
                Query::Report { period } => Answer::Report(Box::new(report(period, full))),
                Query::Batches { .. } => Answer::Batches(if full { batches() } else { Vec::new() }),
                Query::Series { tags, from, to, buckets } => batches::curve(tags[0], (from, to), buckets),
                Query::Reports { .. } => Answer::Reports(made::list()),
                other => panic!("no query of this tab: {other:?}"),
            };
            self.send(Msg::Answer(id, Ok(answer)));
        }
    }

    fn terminal(&self) -> Terminal<TestBackend> {
        let screen = self.model.screen;
        let mut terminal =
            Terminal::new(TestBackend::new(screen.width, screen.height)).expect("a test backend never fails");
        terminal.draw(|frame| view(&self.model, frame)).expect("a test backend never fails");
        terminal
    }

    fn screen(&self) -> String {
        self.terminal().backend().to_string()
    }
}

fn report(period: Period, full: bool) -> ShiftReport {
    let until = period.to.min(now());
    let tag = |tag: &str, unit: &str, decimals, min: f64, mean: f64, max: f64, last: Option<f64>, in_alarm, good| {
        TagFigures {
            tag: tag.to_owned(),
            unit: unit.to_owned(),
            decimals,
            first: None,
            min: full.then_some(min.into()),
            mean: full.then_some(mean.into()),
            max: full.then_some(max.into()),
            last: last.filter(|_| full).map(Exact::from),
            difference: None,
            in_alarm: std::time::Duration::from_secs(in_alarm),
            good: if full { good } else { 0.0 },
        }
    };
    let at = |seconds: i64| period.from + SignedDuration::from_secs(seconds);
    let alarm = |seconds, priority, subject: &str, text: &str, step, by: Option<&str>| AlarmRecord {
        at: at(seconds),
        subject: subject.into(),
        message: text.into(),
        priority,
        event: step,
        value: (subject == "TIC-1.PV").then_some(72.44.into()),
        limit: None,
        by: by.map(Into::into),
        reason: None,
        until: None,
        first_out: None,
        identity: None,
    };
    let (high, low) = (Priority::High, Priority::Low);
    let alarms = vec![
        alarm(12, high, "TIC-1.PV", "temperature high", AlarmEvent::Raised, None),
        alarm(31, high, "TIC-1.PV", "temperature high", AlarmEvent::Acknowledged, Some("tech1")),
        alarm(53, high, "TIC-1.PV", "temperature high", AlarmEvent::ReturnedToNormal, None),
        alarm(80, low, "PLC-1", "not responding", AlarmEvent::Raised, None),
        alarm(95, high, "TIC-1.PV", "temperature high", AlarmEvent::Raised, None),
    ];
    let action = ActionRecord {
        old: Some("60.0 °C".into()),
        new: Some("70.0 °C".into()),
        ..ActionRecord::new(at(20), "tech1", RecordedAction::Write, "TIC-1.SV", "verified")
    };
    ShiftReport {
        counters: Vec::new(),
        control_runs: Vec::new(),
        run_parts: Vec::new(),
        period,
        until,
        audit: full.then_some(ChainHash { number: 1_042, hash: [0xA5; 32] }),
        unstored: Some(0),
        unreadable: Vec::new(),
        compared: Vec::new(),
        runs: Vec::new(),
        outages: Vec::new(),
        coarse: Vec::new(),
        charts: Vec::new(),
        batches: Vec::new(),
        tags: vec![
            tag("TIC-1.PV", "°C", 1, 26.8, 58.31, 72.6, Some(72.4), 41, 0.989_99),
            tag("TIC-1.MV", "%", 1, 0.0, 41.3, 100.0, Some(12.0), 0, 1.0),
            tag("PLC-1.FLOW", "l/min", 2, 0.0, 0.412, 1.25, None, 0, 0.742),
        ],
        suppressed: Vec::new(),
        alarms: if full { alarms } else { Vec::new() },
        alarm_metrics: crate::plant::alarm::PeriodMetrics::default(),
        actions: if full { vec![action] } else { Vec::new() },
        record: Vec::new(),
        record_of: full.then(|| ("TIC-1".to_owned(), "°C".to_owned())),
    }
}

fn batches() -> Vec<BatchReport> {
    let minutes = |minutes: u64| std::time::Duration::from_secs(minutes * 60);
    let batch = |number: u32, end: Option<i64>, seen, unknown| {
        let from = now() - SignedDuration::from_mins(i64::from(20 - number) * 40);
        let phases = vec![("FILL".into(), minutes(6)), ("HEAT".into(), minutes(12)), ("HOLD".into(), minutes(3))];
        let to = end.map(|end| from + SignedDuration::from_mins(end));
        let batch = Batch { name: "hot-water".into(), number, from, to, seen, lasted: minutes(21), phases, unknown };
        let until = to.unwrap_or(now());
        let tags = report(Period::free(from, until), true).tags[..1].to_vec();
        BatchReport {
            tags,
            energy: Some((0.263, 1.0)),
            alarms: Some(u64::from(number % 3)),
            ..BatchReport::new(batch, until)
        }
    };
    let ended = (3..19).rev().map(|number| batch(number, Some(30), (true, number % 4 != 0), minutes(0)));
    std::iter::once(batch(19, None, (true, true), minutes(0)))
        .chain(ended)
        .chain([batch(2, Some(30), (false, true), minutes(9))])
        .collect()
}

#[test]
fn batches_are_listed_reported_and_exported() {
    for (name, width, height) in [("batches_at_80x24", 80, 24), ("batches_at_120x40", 120, 40)] {
        let mut stand = Stand::new(Theme::FULL, width, height);
        stand.press("b");
        stand.answer(true);
        stand.press("↓");
        insta::assert_snapshot!(name, stand.screen());
    }
    let mut stand = Stand::new(Theme::FULL, 80, 24);
    stand.press("b");
    stand.answer(false);
    assert!(stand.screen().contains("No batch ran yet."));
    stand.press("e");
    assert!(stand.screen().contains("not written: nothing to export yet"));
    let mut stand = Stand::new(Theme::FULL, 80, 24);
    stand.press("b");
    stand.answer(true);
    stand.press("↓e");
    let (path, bytes) = stand.saved.pop().expect("written");
    assert!(path.ends_with("2026-11-21-batches.csv"), "{path:?}");
    assert_eq!(bytes.iter().filter(|byte| **byte == b'\n').count(), 1 + batches().len(), "a header and a row each");
    stand.press("⏎");
    let (_, asked) = stand.asked.last().expect("it asks for a report");
    assert_eq!(*asked, Query::Report { period: batches()[1].period() });
    stand.answer(true);
    assert!(stand.screen().contains("hot-water-18"));
}

#[test]
fn a_running_shift_at_80x24() {
    let mut stand = Stand::new(Theme::FULL, 80, 24);
    stand.answer(true);
    insta::assert_snapshot!(stand.screen());
}

#[test]
fn a_closed_shift_at_120x40() {
    let mut stand = Stand::new(Theme::FULL, 120, 40);
    stand.press("←");
    stand.answer(true);
    stand.answer(true);
    insta::assert_snapshot!(stand.screen());
}

#[test]
fn a_shift_without_data() {
    let mut stand = Stand::new(Theme::FULL, 80, 24);
    stand.answer(false);
    insta::assert_snapshot!(stand.screen());
}

#[test]
fn a_night_without_unicode_and_colour() {
    let mut stand = Stand::new(Theme::PLAIN, 80, 24);
    stand.answer(true);
    stand.press("←←");
    stand.answer(true);
    stand.answer(true);
    insta::assert_snapshot!(stand.screen());
}

#[test]
fn a_report_that_takes_long_says_so_and_is_cancelled() {
    let mut stand = Stand::new(Theme::FULL, 80, 24);
    stand.press("←");
    let (id, _) = stand.asked.last().expect("it asks at once").clone();
    let silent = |tenths: u64| Msg::Tick { silent: std::time::Duration::from_millis(100 * tenths) };
    stand.send(silent(4));
    assert!(stand.screen().contains("collecting data") && !stand.screen().contains("Esc cancels"));
    stand.send(silent(30));
    assert!(stand.screen().contains("reading for 3 s of at most 20 s, Esc cancels"));
    assert!(stand.model.tabs.reports.awaits(id.number));
    stand.press("⎋");
    assert!(stand.screen().contains("cancelled"));
    assert!(!stand.model.tabs.reports.awaits(id.number), "the history need not work on it");
    stand.asked.clear();
    stand.send(silent(90));
    assert!(stand.asked.is_empty(), "a closed shift is not asked for again by itself");
    stand.press("u");
    stand.answer(true);
    assert!(stand.screen().contains("TIC-1.PV"));
}

#[test]
fn the_csv_that_is_written_is_the_report_that_is_shown() {
    let mut stand = Stand::new(Theme::FULL, 80, 24);
    stand.press("e");
    assert!(stand.screen().contains("collecting data") && stand.saved.is_empty());
    stand.answer(true);
    stand.press("e");
    let (path, bytes) = stand.saved.pop().expect("the key writes");
    assert_eq!(path, PathBuf::from("reports/2026-11-21-afternoon-until-1402.csv"));
    let (def, shown) = (&stand.model.snapshot.def, stand.model.tabs.reports.report.answered.value.as_ref());
    let csv = shown.map(|shown| report::render(report::FORMATS[0], shown, def, &report::Style::of(def)));
    assert_eq!(Some(Ok(bytes)), csv);
    stand.send(Msg::Saved(Some(Tab::Reports), Ok(path)));
    assert!(stand.screen().contains("✓ written reports/2026-11-21-afternoon-until-1402.csv"));
    stand.press(";e");
    let (_, bytes) = stand.saved.pop().expect("the key writes");
    assert!(bytes.starts_with(b"\xef\xbb\xbf"), "the other dialect is for spreadsheets");
    stand.send(Msg::Saved(Some(Tab::Reports), Err("disk full".to_owned())));
    assert!(stand.screen().contains("not written: disk full"));
    stand.reply = Err(RequestRefusal::Role { needed: Role::Technician, role: Role::Viewer });
    stand.press("e");
    assert!(stand.saved.is_empty(), "what the station does not have on record is not written");
    assert!(stand.screen().contains("not written: this needs a technician"));
}

#[test]
fn figures_never_stand_under_the_name_of_another_shift() {
    let mut stand = Stand::new(Theme::FULL, 80, 24);
    stand.answer(true);
    stand.press("←");
    assert!(stand.screen().contains("morning 2026-11-21") && !stand.screen().contains("58.31"));
    let asked = std::mem::take(&mut stand.asked);
    stand.press("←");
    let Some((id, Query::Report { period })) = asked.into_iter().next() else { panic!("a report is asked for") };
    stand.send(Msg::Answer(id, Ok(Answer::Report(Box::new(report(period, true))))));
    assert!(
        stand.screen().contains("night 2026-11-20") && !stand.screen().contains("58.31"),
        "an answer for the morning"
    );
    stand.answer(true);
    assert!(stand.screen().contains("58.31"));
}

#[test]
fn a_typed_period_is_reported_or_explained() {
    let mut stand = Stand::new(Theme::FULL, 80, 24);
    stand.answer(true);
    stand.press("/06:00-x⏎");
    insta::assert_snapshot!(stand.screen());
    stand.send(Msg::Key(KeyEvent::new(KeyCode::Backspace, KeyModifiers::NONE)));
    stand.press("07:30⏎");
    stand.answer(true);
    assert!(stand.screen().contains("period   2026-11-21 06:00 – 07:30 +07   closed"), "{}", stand.screen());
    stand.press("l");
    assert!(stand.screen().contains("afternoon 2026-11-21"));
}

#[test]
fn the_next_shift_is_shown_when_it_begins() {
    let mut stand = Stand::new(Theme::FULL, 80, 24);
    stand.answer(true);
    let mut later = (*stand.model.snapshot).clone();
    later.at += SignedDuration::from_hours(8);
    stand.send(Msg::Snapshot(std::sync::Arc::new(later)));
    assert!(stand.screen().contains("night 2026-11-21"));
}

#[test]
fn a_clock_that_is_set_back_does_not_keep_a_report_waiting() {
    let mut stand = Stand::new(Theme::FULL, 80, 24);
    let later = |by: i64, seconds: i64| {
        let (snapshot, by) = (Fixture::normal().snapshot(), SignedDuration::from_secs(by));
        let at = snapshot.at + by + SignedDuration::from_secs(seconds);
        Msg::Snapshot(Arc::new(Snapshot { at, stepped: by, ..(*snapshot).clone() }))
    };
    stand.answer(true);
    stand.send(later(-50, 29));
    assert_eq!(stand.asked, [], "the figures are not old yet");
    stand.send(later(-50, 31));
    assert_eq!(stand.asked.len(), 1);
}
