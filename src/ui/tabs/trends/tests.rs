//! The trends tab in the whole terminal, with a made-up history behind it.

mod cursors;
mod events;
mod export;
mod overlay;
mod pens;
mod picture;
mod queries;
mod values;
mod window;

use queries::kinds;
use std::sync::Arc;

use crossterm::event::{KeyCode, KeyEvent, KeyModifiers};
use jiff::SignedDuration;
use ratatui::{Terminal, backend::TestBackend};

use super::*;
use crate::plant::record::{ActionRecord, AlarmEvent};
use crate::{
    history::Bucket,
    plant::{def::Priority, sample::Sample},
    ui::{
        Effect, Model, Msg, QueryId,
        fixture::{Fixture, now, with_cx},
        theme::Theme,
        update, view,
    },
};

/// A terminal on the trends tab, and the history that answers it.
struct Stand {
    model: Model,
    asked: Vec<(QueryId, Query)>,
    /// When the store began.
    begin: Timestamp,
    /// Nothing was recorded here.
    gap: (Timestamp, Timestamp),
}

fn ago(seconds: i64) -> Timestamp {
    now() - SignedDuration::from_secs(seconds)
}

/// The made-up past of a tag: PV swings, SV steps five minutes ago, the rest climbs.
fn past(tag: TagId, at: Timestamp) -> f64 {
    let seconds = at.duration_since(now()).as_secs_f64();
    match tag.0 {
        0 => 64.0 + 6.0 * (seconds / 90.0).sin() * (1.0 + seconds / 9_000.0),
        1 => {
            if seconds < -300.0 {
                60.0
            } else {
                70.0
            }
        }
        n => 42.0 + f64::from(n) + seconds / 40.0 % 30.0,
    }
}

fn action(at: Timestamp, action: &str, note: Option<&str>) -> ActionRecord {
    ActionRecord {
        at,
        by: "anna".into(),
        from: "".into(),
        action: action.into(),
        target: "TIC-1.SV".into(),
        old: Some("60.0 °C".into()),
        new: Some("70.0 °C".into()),
        outcome: "verified".into(),
        note: note.map(Into::into),
        chain_hash: None,
    }
}

impl Stand {
    fn new(theme: Theme, width: u16, height: u16) -> Stand {
        let mut model = Model::new(Fixture::normal().snapshot(), theme, 1, crate::ui::fixture::session());
        update(&mut model, Msg::Resize(80, 24));
        let begin = ago(86_400);
        update(&mut model, Msg::Resize(width, height));
        let mut stand = Stand { model, asked: Vec::new(), begin, gap: (begin, begin) };
        stand.press("2");
        stand
    }

    fn send(&mut self, msg: Msg) {
        let effects = update(&mut self.model, msg);
        self.asked.extend(effects.into_iter().filter_map(|effect| match effect {
            Effect::Query(id, query) if id.tab == Some(Tab::Trends) => Some((id, query)),
            _ => None,
        }));
    }

    fn press(&mut self, keys: &str) {
        for key in keys.chars() {
            let code = match key {
                '←' => KeyCode::Left,
                '→' => KeyCode::Right,
                '↓' => KeyCode::Down,
                '⏎' => KeyCode::Enter,
                '⎋' => KeyCode::Esc,
                key => KeyCode::Char(key),
            };
            self.send(Msg::Key(KeyEvent::new(code, KeyModifiers::NONE)));
        }
    }

    /// Answers everything that was asked, until nothing more is asked.
    fn answer(&mut self) {
        for _ in 0..10 {
            for (id, query) in std::mem::take(&mut self.asked) {
                let answer = self.history(&query);
                self.send(Msg::Answer(id, Ok(answer)));
            }
        }
        assert_eq!(self.asked, [], "the tab never comes to rest");
    }

    fn history(&self, query: &Query) -> Answer {
        match query {
            Query::Series { tags, from, to, buckets } => {
                Answer::Series(tags.iter().map(|tag| self.series(*tag, *from, *to, *buckets)).collect())
            }
            Query::Journal { .. } => Answer::Journal(vec![AlarmRecord {
                value: Some(72.1.into()),
                limit: Some(72.0),
                ..AlarmRecord::new(ago(240), "TIC-1.PV", "temperature high", Priority::High, AlarmEvent::Raised)
            }]),
            Query::Actions { .. } => Answer::Actions(vec![
                action(ago(200), "write", Some("too slow")),
                action(ago(210), "login", None),
                action(ago(420), "write", None),
            ]),
            Query::Batches { .. } => Answer::Batches(Vec::new()),
            Query::Values { tags, from, every, .. } => Answer::Values(
                tags.iter().map(|tag| vec![Some(Sample::good(past(*tag, *from + *every), *from).into())]).collect(),
            ),
            other => panic!("the trends never ask {other:?}"),
        }
    }

    fn series(&self, tag: TagId, from: Timestamp, to: Timestamp, count: usize) -> Series {
        let step = std::time::Duration::try_from(to.duration_since(from)).expect("forward") / count as u32;
        let known = |at: Timestamp| at + step > self.begin && at <= now() && !(self.gap.0..self.gap.1).contains(&at);
        let bucket = |n: usize| {
            let at = from + step * n as u32;
            let is_state = lanes::is_state(self.model.snapshot.def.tag(tag));
            let past = |tag, at| if is_state { (past(tag, at) / 12.0).floor() % 2.0 } else { past(tag, at) };
            let (first, last) = (past(tag, at), past(tag, at + step));
            let (min, max, mean) = (first.min(last), first.max(last), (first + last) / 2.0);
            known(at).then_some(Bucket { min, max, mean, last: last.into() })
        };
        // Good is the share of the whole span, also of the part that lies ahead.
        let ahead = to.duration_since(now()).max(SignedDuration::ZERO).as_secs_f64();
        let good = 1.0 - ahead / to.duration_since(from).as_secs_f64();
        let good = if self.gap.0 < self.gap.1 { good - 0.166 } else { good };
        // What lies between two cursors has figures that tell from where on.
        let apart = if count == 1 { now().duration_since(from).as_secs_f64() / 100.0 } else { 0.0 };
        let summary = (self.begin < now()).then_some(((58.25 - apart).into(), 64.0.into(), 70.0.into()));
        let good = if summary.is_some() { good } else { 0.0 };
        Series { tag, from, step, buckets: (0..count).map(bucket).collect(), summary, counted: None, good }
    }

    /// So many seconds pass, with a snapshot each; `value` is the PV.
    fn live(&mut self, seconds: i64, value: impl Fn(i64) -> Option<f64>) {
        for second in 1..=seconds {
            let mut snapshot = (*self.model.snapshot).clone();
            snapshot.at += SignedDuration::from_secs(1);
            let at = snapshot.at;
            for (n, sample) in snapshot.samples.iter_mut().enumerate() {
                sample.at = at;
                if n == 0 {
                    *sample = value(second)
                        .map_or(Sample::bad(crate::plant::sample::Cause::Timeout, at), |v| Sample::good(v, at));
                }
            }
            self.send(Msg::Snapshot(Arc::new(snapshot)));
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

#[test]
fn a_living_trend_at_80x24() {
    let mut stand = Stand::new(Theme::FULL, 80, 24);
    stand.answer();
    insta::assert_snapshot!(stand.screen());
}

#[test]
fn a_living_trend_at_120x40() {
    let mut stand = Stand::new(Theme::FULL, 120, 40);
    stand.answer();
    insta::assert_snapshot!(stand.screen());
}

#[test]
fn a_gap_and_the_cursor() {
    let mut stand = Stand::new(Theme::FULL, 80, 24);
    stand.gap = (ago(300), ago(180));
    stand.answer();
    stand.press("c←←←←←←←←←←");
    stand.answer();
    insta::assert_snapshot!(stand.screen());
}

#[test]
fn an_empty_history() {
    let mut stand = Stand::new(Theme::FULL, 80, 24);
    stand.begin = now();
    stand.answer();
    insta::assert_snapshot!(stand.screen());
}

#[test]
fn without_unicode_and_colour() {
    let mut stand = Stand::new(Theme::PLAIN, 80, 24);
    stand.answer();
    insta::assert_snapshot!(stand.screen());
}

#[test]
fn the_list_of_all_values() {
    let mut stand = Stand::new(Theme::FULL, 80, 24);
    stand.press("v↓↓");
    stand.answer();
    let screen = stand.screen();
    let footer = screen.lines().last().unwrap_or_default();
    assert!(footer.contains("⏎ curve") && !footer.contains("zoom"), "{footer}");
    insta::assert_snapshot!(screen);
}

#[test]
fn the_past_is_distinguished_from_the_present() {
    let mut stand = Stand::new(Theme::FULL, 80, 24);
    stand.answer();
    stand.press("←←←←←");
    stand.answer();
    insta::assert_snapshot!(stand.screen());
    stand.press("l");
    assert!(stand.screen().contains("live ●"));
}

#[test]
fn everything_since_the_first_value_of_the_day() {
    let mut stand = Stand::new(Theme::FULL, 80, 24);
    stand.begin = ago(3_000);
    stand.answer();
    stand.press("m");
    stand.answer();
    insta::assert_snapshot!(stand.screen());
}

#[test]
fn keys_move_through_time() {
    let mut stand = Stand::new(Theme::FULL, 80, 24);
    let mut check = |keys: &str, expect: &str| {
        stand.press(keys);
        stand.answer();
        let title = stand.screen().lines().nth(4).map(str::to_owned).unwrap_or_default();
        assert!(title.contains(expect), "{keys}: {title}");
    };
    check("", "window 10 min   live ●");
    check("-", "window 15 min   live ●");
    check("+++++++++", "window 1 min   live ●");
    check("-------------------------", "window 5 years   live ●   columns of");
    check("+++++++++", "window 12 h   live ●");
    check("←", "past 11-20 23:06 – 11-21 11:06");
    check("→", "live ●");
    check("+++", "window 2 h   live ●   update 1 s");
    check("u", "update 2 s");
    check("---", "window 12 h   live ●   columns of 6 min, min–max");
    check("m", "all since midnight");
    check("m", "window 12 h");
    check("g", "Levels group 2/2");
    check("v↓↓↓↓⏎", "TIC-1.I group 3/3");
    check("v⏎", "TIC-1 group 1/3");
}

#[test]
fn a_time_can_be_typed() {
    let mut stand = Stand::new(Theme::FULL, 80, 24);
    let mut check = |text: &str, expect: &str| {
        stand.press("t");
        stand.press(text);
        stand.press("⏎");
        stand.answer();
        let title = stand.screen().lines().nth(4).map(str::to_owned).unwrap_or_default();
        assert!(title.contains(expect), "{text}: {title}");
    };
    check("13:12", "past 13:04:");
    check("2026-11-20", "window 24 h    past 11-20 00:");
    check("2025-11-20..2026-02-01", "window 90 d    past 2025-11-04");
}

#[test]
fn a_pen_is_switched_off_and_on() {
    let mut stand = Stand::new(Theme::FULL, 80, 24);
    stand.answer();
    stand.press("↓ ");
    stand.answer();
    assert!(stand.screen().contains("- TIC-1.SV"));
    assert_eq!(stand.model.tabs.trends.drawn(&stand.model.cx()).len(), 2);
    stand.press(" ");
    assert_eq!(stand.model.tabs.trends.drawn(&stand.model.cx()).len(), 3);
}

#[test]
fn no_size_is_too_small_to_survive() {
    for (width, height) in
        (0..40).flat_map(|width| (0..20).map(move |height| (width, height))).chain([(200, 60), (80, 12), (300, 8)])
    {
        for keys in ["", "c", "v", "m"] {
            let mut stand = Stand::new(Theme::FULL, width, height);
            stand.press(keys);
            stand.answer();
            assert_eq!(stand.terminal().backend().buffer().area.width, width);
        }
    }
}

#[test]
fn figures_of_another_view_do_not_stand_beside_this_one() {
    let mut stand = Stand::new(Theme::FULL, 80, 24);
    stand.answer();
    assert!(stand.screen().contains("58.2"));
    stand.press("-");
    assert!(!stand.screen().contains("58.2"), "until the history has answered");
    let old = std::mem::take(&mut stand.asked);
    stand.press("-");
    for (id, query) in old {
        let answer = stand.history(&query);
        stand.send(Msg::Answer(id, Ok(answer)));
    }
    assert!(!stand.screen().contains("58.2"), "the answer was for the window before");
    stand.answer();
    assert!(stand.screen().contains("58.2") && stand.screen().contains("100 %"));
}

#[test]
fn a_snapshot_a_little_behind_the_clock_changes_nothing() {
    let mut stand = Stand::new(Theme::FULL, 80, 24);
    stand.answer();
    stand.press("+++");
    stand.send(Msg::Tick { silent: std::time::Duration::from_millis(900) });
    assert_eq!(kinds(&std::mem::take(&mut stand.asked)), "curves alarms actions batches");
    stand.send(Msg::Snapshot(stand.model.snapshot.clone()));
    assert_eq!(kinds(&stand.asked), "");
    assert!(!stand.model.tabs.trends.traces[&TagId(0)].past().is_none_or(|past| past.buckets.is_empty()));
}

#[test]
fn figures_keep_their_utc_times_after_the_clock_was_set() {
    let screen = |by| {
        let mut stand = Stand::new(Theme::FULL, 80, 24);
        stand.answer();
        let snapshot = Snapshot { stepped: by, ..(*stand.model.snapshot).clone() };
        stand.send(Msg::Snapshot(Arc::new(snapshot)));
        stand.press("-");
        stand.answer();
        stand.screen()
    };
    assert_eq!(screen(SignedDuration::from_hours(24 * 365 * 56)), screen(SignedDuration::ZERO));
}

#[test]
fn a_span_is_shown_whole_and_alive_while_it_lasts() {
    let tag = Fixture::normal().def.trends[0].pens[0].tag;
    with_cx(&Fixture::normal().snapshot(), |cx| {
        for (begin, end, alive) in [(300, 270, false), (30, 10, false), (30, 0, true), (20, 1, true)] {
            let ago = |minutes: i64| cx.now - SignedDuration::from_mins(minutes);
            let mut trends = Trends::new(cx.snapshot);
            trends.show(cx, tag, (ago(begin), ago(end)));
            let view = trends.span(cx);
            assert!(view.from <= ago(begin) && view.holds(ago(end)), "{begin} {end}: {view:?}");
            assert_eq!((trends.end.is_none(), trends.cursor), (alive, None), "{begin} {end}");
        }
    });
}
