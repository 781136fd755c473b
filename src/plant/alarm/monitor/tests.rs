//! The monitor as an operator would check it with pencil and paper.

use proptest::prelude::*;

use super::*;
use crate::plant::{alarm::metrics::Metric, def::Priority};

/// A Saturday, 06:00 UTC.
const START: i64 = 1_795_240_800;

fn at(second: f64) -> Timestamp {
    Timestamp::from_microsecond(START * 1_000_000 + (second * 1e6) as i64).expect("within the calendar")
}

fn event(second: f64, name: &str, event: AlarmEvent) -> AlarmRecord {
    AlarmRecord {
        at: at(second),
        subject: "TIC-1.PV".into(),
        message: name.into(),
        priority: Priority::High,
        event,
        value: None,
        limit: None,
        by: None,
        reason: None,
        until: None,
        first_out: None,
        identity: None,
    }
}

/// A monitor of a period in which a station always ran.
fn of_period(from: f64, until: f64) -> AlarmMonitor {
    let mut monitor = AlarmMonitor::of_period(at(from), at(until));
    (second(at(from)).div_euclid(WINDOW_S)..=second(at(until)).div_euclid(WINDOW_S)).for_each(|n| monitor.watched(n));
    monitor
}

/// The figures of 06:00 to a second after it.
fn figures(until: f64, events: &[(f64, &str, AlarmEvent)]) -> PeriodMetrics {
    let mut monitor = of_period(0.0, until);
    events.iter().for_each(|(second, name, kind)| monitor.on_event(&event(*second, name, *kind)));
    monitor.figures()
}

fn names(alarms: &[Named]) -> Vec<&str> {
    alarms.iter().map(|alarm| &*alarm.message).collect()
}

use AlarmEvent::{Acknowledged, Raised, ReturnedToNormal};

#[test]
fn activations_and_empty_windows_of_the_period_count() {
    let events = [
        (-0.001, "before", Raised),
        (0.0, "first", Raised),
        (599.9, "first", Raised),
        (600.0, "second window", Raised),
        (700.0, "second window", Acknowledged),
        (800.0, "second window", ReturnedToNormal),
        (7_200.0, "after", Raised),
    ];
    let got = figures(7_200.0, &events);
    assert_eq!((got.annunciated(), got.windows, got.most, got.windows_over), (3, 12, 2, 0));
    assert_eq!(got.value(Metric::PerWindow), Some(0.25));
    assert_eq!(got.top.iter().map(|alarm| (&*alarm.alarm.message, alarm.raised)).collect::<Vec<_>>()[0], ("first", 2));
    // A period that begins and ends within windows touches 14 of them.
    let mut monitor = of_period(-1.0, 7_200.5);
    events.iter().for_each(|(second, name, kind)| monitor.on_event(&event(*second, name, *kind)));
    let got = monitor.figures();
    assert_eq!((got.annunciated(), got.windows), (5, 14));
}

#[test]
fn time_in_which_no_station_ran_thins_no_figure_out() {
    let mut monitor = AlarmMonitor::of_period(at(300.0), at(86_400.0));
    [0, 1, 2].into_iter().for_each(|window| monitor.watched(START / WINDOW_S + window));
    monitor.on_event(&event(400.0, "x", Raised));
    let got = monitor.figures();
    assert_eq!((got.windows, got.watched.as_secs()), (3, 1_500));
    let mut running = AlarmMonitor::running(at(0.0));
    running.advance(at(0.0));
    running.advance(at(900.0));
    let day = running.metrics().day;
    assert_eq!((day.windows, day.watched.as_secs()), (2, 900), "the day before it started is not watched");
}

#[test]
fn the_figures_of_the_day_are_kept_for_ten_seconds() {
    let mut monitor = AlarmMonitor::running(at(0.0));
    // At the very beginning of a window no time has been watched: there is nothing to keep.
    for (now, until) in [(0.0, 0.0), (1.0, 1.0), (2.0, 1.0), (10.0, 1.0), (11.0, 11.0), (20.0, 11.0), (21.0, 21.0)] {
        monitor.advance(at(now));
        assert_eq!(monitor.metrics().day.until, at(until), "at {now} s");
    }
}

#[test]
fn a_suppressed_activation_is_counted_and_not_annunciated() {
    let (raised, returned) = (AlarmEvent::RaisedSuppressed, AlarmEvent::ReturnedSuppressed);
    let got = figures(600.0, &[(1.0, "a", raised), (2.0, "a", returned), (3.0, "b", raised), (600.0, "a", raised)]);
    assert_eq!((got.suppressed, got.annunciated()), (2, 0));
}

#[test]
fn eleven_in_a_window_are_too_many_and_ten_are_not() {
    let raise = |count: usize| (0..count).map(|i| (i as f64, "x", Raised)).collect::<Vec<_>>();
    for (count, over) in [(10, 0), (11, 1), (25, 1)] {
        let got = figures(3_600.0, &raise(count));
        assert_eq!((got.most, got.windows_over), (count as u64, over), "{count}");
    }
}

#[test]
fn an_alarm_chatters_with_its_third_activation_within_a_minute() {
    let third = |second: f64| figures(3_600.0, &[(-20.0, "a", Raised), (-5.0, "a", Raised), (second, "a", Raised)]);
    assert_eq!(names(&third(39.9).chattering), ["a"]);
    assert_eq!(names(&third(40.0).chattering), [""; 0]);
    let two = figures(3_600.0, &[(1.0, "a", Raised), (2.0, "b", Raised), (3.0, "a", Raised), (4.0, "b", Raised)]);
    assert_eq!(names(&two.chattering), [""; 0], "two alarms in turn are not one that chatters");
}

#[test]
fn an_alarm_is_fleeting_if_it_goes_before_anybody_could_read_it() {
    let gone = |second: f64| figures(3_600.0, &[(1.0, "a", Raised), (second, "a", ReturnedToNormal)]);
    assert_eq!(names(&gone(10.9).fleeting), ["a"]);
    assert_eq!(names(&gone(11.0).fleeting), [""; 0]);
    let seen = figures(3_600.0, &[(1.0, "a", Raised), (2.0, "a", Acknowledged), (3.0, "a", ReturnedToNormal)]);
    assert_eq!(names(&seen.fleeting), [""; 0], "it was acknowledged");
}

#[test]
fn alarms_are_stale_after_a_day_and_the_most_at_one_time_count() {
    let day = 86_400.0;
    let events = [
        (10.0, "a", Raised),
        (20.0, "b", Raised),
        (day + 15.0, "a", ReturnedToNormal),
        // "b" becomes stale after "a" has gone: never two at once.
        (day + 40.0, "b", ReturnedToNormal),
        (day + 50.0, "c", Raised),
    ];
    assert_eq!(figures(day + 10.0, &events[..2]).stale, 0, "active for exactly a day is not over a day");
    assert_eq!(figures(day + 11.0, &events[..2]).stale, 1);
    assert_eq!(figures(day + 60.0, &events).stale, 1);
    assert_eq!(figures(day + 60.0, &events[..2]).stale, 2);
    let mut monitor = AlarmMonitor::of_period(at(0.0), at(600.0));
    monitor.already(&event(-100_000.0, "old", Raised));
    let got = monitor.figures();
    assert_eq!((got.stale, got.annunciated()), (1, 0), "what was there before the period is stale, not new");
}

#[test]
fn a_flood_counts_its_whole_seconds_within_the_period() {
    let raises = |from: f64| (0..11).map(|i| (from + f64::from(i), "x", Raised)).collect::<Vec<_>>();
    assert_eq!(figures(3_600.0, &raises(100.0)).flood.as_secs(), 596);
    assert_eq!(figures(200.0, &raises(100.0)).flood.as_secs(), 90, "it goes on beyond the end");
    assert_eq!(figures(3_600.0, &raises(-510.0)).flood.as_secs(), 96, "it began before the beginning");
}

#[test]
fn memory_does_not_grow_with_the_storms_it_has_seen() {
    let mut monitor = AlarmMonitor::running(at(0.0));
    for day in 0..10 {
        for second in 0..2_000 {
            let name = format!("alarm {}", second % 500);
            monitor.on_event(&event(f64::from(day) * 86_400.0 + f64::from(second), &name, Raised));
            monitor.on_event(&event(f64::from(day) * 86_400.0 + f64::from(second) + 0.5, &name, ReturnedToNormal));
        }
    }
    monitor.advance(at(12.0 * 86_400.0));
    assert_eq!((monitor.sums.len(), monitor.alarms.len(), monitor.stale.len()), (0, 0, 0));
    assert_eq!(monitor.watched.len(), 1);
}

fn events() -> impl Strategy<Value = Vec<AlarmRecord>> {
    // Floods and quiet: most events follow within seconds, some after hours.
    let gap = prop_oneof![8 => 0.0..20.0, 2 => 20.0..900.0, 1 => 900.0..20_000.0f64];
    let kind = prop_oneof![3 => Just(Raised), 2 => Just(ReturnedToNormal), 1 => Just(Acknowledged)];
    let priority =
        prop_oneof![Just(Priority::Critical), Just(Priority::High), Just(Priority::Medium), Just(Priority::Low)];
    proptest::collection::vec((gap, 0..6u8, kind, priority), 1..400).prop_map(|rows| {
        let mut now = 0.0;
        let mut list = Vec::new();
        for (gap, name, kind, priority) in rows {
            now += gap;
            list.push(AlarmRecord { priority, ..event(now, &format!("alarm {name}"), kind) });
        }
        list
    })
}

proptest! {
    #[test]
    fn the_screen_and_the_report_of_one_span_agree(events in events(), rest in 0.0..5_000.0f64) {
        let mut running = AlarmMonitor::running(at(0.0));
        events.iter().for_each(|event| running.on_event(event));
        let now = events.last().map_or(at(0.0), |event| event.at) + Duration::from_secs_f64(rest);
        // The running figures are of whole seconds.
        let now = Timestamp::from_second(second(now) + 1).expect("within the calendar");
        running.advance(now);
        let metrics = running.metrics();
        let mut period = AlarmMonitor::of_period(metrics.day.from, metrics.day.until);
        let known = metrics.day.from - LEAD;
        running.watched.iter().for_each(|window| period.watched(*window));
        events.iter().filter(|event| event.at < known).for_each(|event| period.already(event));
        events.iter().filter(|event| known <= event.at).for_each(|event| period.on_event(event));
        let in_window = events.iter().filter(|event| event.event == Raised && second(now) - 600 < second(event.at));
        prop_assert_eq!(metrics.last_10_min as usize, in_window.count());
        prop_assert_eq!(&*metrics.day, &period.figures());
    }
}
