//! Which report is next: a month in virtual time, with a station that is off, a clock that is set and reports that fail.

use jiff::civil;
use proptest::prelude::*;

use super::*;
use crate::report::testing::{THREE, at, plant};

fn rule(period: PeriodKind, formats: &[&str]) -> AutomaticReport {
    let formats = formats.iter().map(|format| (*format).to_owned()).collect();
    AutomaticReport { period, formats, folder: None, keep: None, after: Vec::new() }
}

fn def(rules: Vec<AutomaticReport>) -> PlantDef {
    let mut def = plant("Asia/Bangkok", &THREE);
    def.report.automatic = rules;
    def
}

fn made(due: &Due, now: Timestamp) -> ReportRecord {
    ReportRecord {
        at: now,
        period: due.rule.period,
        name: due.period.name.to_string().into(),
        from: due.period.from,
        to: due.period.to,
        format: due.format.into(),
        file: "f".into(),
        sha256: "00".into(),
        event: ReportEvent::Made,
        attempts: 0,
        error: None,
    }
}

fn hours(hours: i64) -> SignedDuration {
    SignedDuration::from_hours(hours)
}

/// A station that makes what is due between two instants. Gives the names and formats in order.
fn run(def: &PlantDef, record: &mut Record, since: Timestamp, from: Timestamp, to: Timestamp) -> Vec<String> {
    let (mut now, mut done, failures) = (from, Vec::new(), Failures::default());
    while now < to {
        match next_step(def, record, &failures, Some(since), now) {
            Step::Make(due) => {
                assert!(due.period.to + GRACE <= now, "{} is not over at {now}", due.period.name);
                done.push(format!("{} {}", due.period.name, due.format));
                let report = made(&due, now);
                assert!(record.insert(report.key(), report).is_none(), "made twice: {done:?}");
            }
            Step::Wait(until) => {
                assert!(now < until);
                now = until;
            }
            step @ (Step::Deliver(..) | Step::Delete(_)) => panic!("{step:?}"),
        }
    }
    done
}

/// The names of all periods of a kind that end between two instants.
fn names(def: &PlantDef, kind: PeriodKind, from: Timestamp, to: Timestamp) -> Vec<String> {
    let periods =
        std::iter::successors(calendar::period_at(def, kind, from), |period| calendar::period_at(def, kind, period.to));
    periods.take_while(|period| period.to + GRACE < to).map(|period| period.name.to_string()).collect()
}

#[test]
fn each_report_of_a_month_is_made_once_and_in_order() {
    let kinds = [PeriodKind::Shift, PeriodKind::Day, PeriodKind::Week, PeriodKind::Month];
    let def = def(kinds.map(|kind| rule(kind, &["csv", "text"])).to_vec());
    let (start, end) = (at("2026-10-28T09:30+07"), at("2026-12-02T00:00+07"));
    // It is off for three days, over the end of a week, and is killed at any time in between.
    let stops = ["2026-11-07T01:00+07", "2026-11-14T05:00+07", "2026-11-17T05:00+07", "2026-11-20T14:00:30+07"].map(at);
    let mut record = Record::new();
    let mut done = run(&def, &mut record, start, start, stops[0]);
    done.extend(run(&def, &mut record, start, stops[0], stops[1]));
    done.extend(run(&def, &mut record, start, stops[2], stops[3]));
    done.extend(run(&def, &mut record, start, stops[3], end));
    for kind in kinds {
        let expect = names(&def, kind, start, end);
        for format in ["csv", "text"] {
            let of_kind: Vec<String> = record
                .values()
                .filter(|report| report.period == kind && &*report.format == format)
                .map(|report| report.name.to_string())
                .collect();
            assert_eq!(of_kind, expect, "{kind:?}");
            let order: Vec<&String> =
                done.iter().filter(|name| expect.iter().any(|known| **name == format!("{known} {format}"))).collect();
            assert_eq!(order.len(), expect.len(), "once");
        }
    }
    assert_eq!(names(&def, PeriodKind::Week, start, end).len(), 5);
    assert_eq!(
        done[..4],
        ["morning 2026-10-28 csv", "morning 2026-10-28 text", "afternoon 2026-10-28 csv", "afternoon 2026-10-28 text"]
    );
}

#[test]
fn what_ended_while_the_station_was_off_is_made_oldest_first() {
    let def = def(vec![rule(PeriodKind::Day, &["csv"]), rule(PeriodKind::Shift, &["csv"])]);
    let since = at("2026-11-18T12:00+07");
    let done = run(&def, &mut Record::new(), since, at("2026-11-20T12:00+07"), at("2026-11-20T12:01+07"));
    let expect = [
        "morning 2026-11-18",
        "afternoon 2026-11-18",
        "day 2026-11-18",
        "night 2026-11-18",
        "morning 2026-11-19",
        "afternoon 2026-11-19",
        "day 2026-11-19",
        "night 2026-11-19",
    ];
    assert_eq!(done, expect.map(|name| format!("{name} csv")));
    // No farther back than two months, however old the history is.
    let now = at("2026-11-20T12:00+07");
    let done = run(&def, &mut Record::new(), at("2020-01-01T00:00+07"), now, now + hours(1));
    assert_eq!((done.len(), done[0].as_str()), (62 * 4, "morning 2026-09-19 csv"));
    // Nothing is stored yet: looked again soon.
    assert_eq!(next_step(&def, &Record::new(), &Failures::default(), None, now), Step::Wait(now + GRACE));
}

#[test]
fn a_clock_set_back_over_a_shift_end_makes_nothing_twice() {
    let def = def(vec![rule(PeriodKind::Shift, &["csv"])]);
    let (since, mut record) = (at("2026-11-20T06:00+07"), Record::new());
    let first = run(&def, &mut record, since, since, at("2026-11-20T22:05+07"));
    assert_eq!(first, ["morning 2026-11-20 csv", "afternoon 2026-11-20 csv"]);
    let again = run(&def, &mut record, since, at("2026-11-20T13:00+07"), at("2026-11-21T06:05+07"));
    assert_eq!(again, ["night 2026-11-20 csv"]);
    // A clock that was years ahead for a moment keeps nothing from being made when it is right again.
    let ahead = at("2030-01-01T00:00+07");
    run(&def, &mut record, since, ahead, ahead + hours(1));
    let after = run(&def, &mut record, since, at("2026-11-21T07:00+07"), at("2026-11-22T06:05+07"));
    assert_eq!(after, ["morning 2026-11-21 csv", "afternoon 2026-11-21 csv", "night 2026-11-21 csv"]);
}

#[test]
fn other_shift_times_leave_no_gap() {
    let old = def(vec![rule(PeriodKind::Shift, &["csv"])]);
    let (since, mut record) = (at("2026-11-20T06:00+07"), Record::new());
    run(&old, &mut record, since, since, at("2026-11-20T14:05+07"));
    let mut new = old.clone();
    new.shifts[1].start = civil::time(15, 0, 0, 0);
    new.shifts[0].start = civil::time(7, 0, 0, 0);
    let done = run(&new, &mut record, since, at("2026-11-20T14:05+07"), at("2026-11-20T22:05+07"));
    // From 14:00 on nothing was reported yet: the shift in which that lies comes first.
    assert_eq!(done, ["morning 2026-11-20 csv", "afternoon 2026-11-20 csv"]);
    assert_eq!(record.values().last().map(|report| report.from), Some(at("2026-11-20T15:00+07")));
}

#[test]
fn a_report_that_fails_waits_longer_and_holds_up_no_other() {
    let def = def(vec![rule(PeriodKind::Shift, &["csv", "text"])]);
    let (since, start) = (at("2026-11-20T06:00+07"), at("2026-11-20T14:02+07"));
    let (mut record, mut failures) = (Record::new(), Failures::default());
    let (mut now, mut tried, mut others) = (start, Vec::new(), 0);
    while now < start + hours(1) {
        match next_step(&def, &record, &failures, Some(since), now) {
            Step::Make(due) if due.format == "csv" => {
                tried.push(now.duration_since(start).as_secs());
                failures.fail(due.sequence(), "disk full".to_owned(), now);
                let words = failures.words(&def, &record);
                assert_eq!(words.as_deref(), Some("report of a shift as csv not made: disk full"));
            }
            Step::Make(due) => {
                others += 1;
                let report = made(&due, now);
                record.insert(report.key(), report);
            }
            Step::Wait(until) => now = until,
            step @ (Step::Deliver(..) | Step::Delete(_)) => panic!("{step:?}"),
        }
    }
    assert_eq!(tried[..6], [0, 5, 35, 155, 755, 1_355]);
    assert_eq!(others, 1, "the other format");
    failures.clear(&(PeriodKind::Shift, "csv".into()));
    assert_eq!(failures.words(&def, &record), None);
}

#[test]
fn a_command_runs_until_it_succeeds_or_has_failed_six_times() {
    let def = def(vec![AutomaticReport { after: vec!["true".into()], ..rule(PeriodKind::Shift, &["csv"]) }]);
    let (since, start) = (at("2026-11-20T06:00+07"), at("2026-11-20T14:02+07"));
    // How often it fails, how often it is run, and whether that is an alarm.
    for (fails, runs, alarm) in [(0, 1, false), (2, 3, false), (5, 6, false), (100, 6, true)] {
        let (mut record, failures, mut now, mut ran) = (Record::new(), Failures::default(), start, Vec::new());
        while now < start + hours(3) {
            match next_step(&def, &record, &failures, Some(since), now) {
                Step::Make(due) => {
                    let report = made(&due, now);
                    record.insert(report.key(), report);
                }
                Step::Deliver(report, _) => {
                    ran.push(now.duration_since(start).as_secs());
                    let event = if ran.len() > fails { ReportEvent::Delivered } else { ReportEvent::DeliveryFailed };
                    let report = ReportRecord { attempts: report.attempts + 1, ..report.then(now, event) };
                    record.insert(report.key(), report);
                }
                Step::Wait(until) => now = until,
                step @ Step::Delete(_) => panic!("{step:?}"),
            }
        }
        assert_eq!(ran, [0, 10, 70, 370, 1_270, 4_870][..runs], "{fails} failures");
        assert_eq!(failures.words(&def, &record).is_some(), alarm, "{fails} failures");
    }
}

#[test]
fn a_file_is_deleted_when_its_time_is_over() {
    let keep = Some(Duration::from_secs(2 * 86_400));
    let def = def(vec![AutomaticReport { keep, ..rule(PeriodKind::Day, &["csv"]) }]);
    let since = at("2026-11-18T00:00+07");
    let (mut record, failures, mut now, mut deleted) = (Record::new(), Failures::default(), since, Vec::new());
    while now < at("2026-11-23T00:00+07") {
        match next_step(&def, &record, &failures, Some(since), now) {
            Step::Make(due) => {
                let report = made(&due, now);
                record.insert(report.key(), report);
            }
            Step::Delete(report) => {
                deleted.push((report.name.to_string(), now));
                let event = if deleted.len() == 1 { ReportEvent::LeftAlone } else { ReportEvent::Deleted };
                let report = report.then(now, event);
                record.insert(report.key(), report);
            }
            Step::Wait(until) => now = until,
            step @ Step::Deliver(..) => panic!("{step:?}"),
        }
    }
    let expect = [
        ("day 2026-11-18".to_owned(), at("2026-11-21T00:00+07")),
        ("day 2026-11-19".to_owned(), at("2026-11-22T00:00+07")),
    ];
    assert_eq!(deleted, expect);
}

#[test]
fn a_report_belongs_to_the_rule_of_its_period_and_format() {
    use PeriodKind::{Day, Shift, Week};
    let def = def(vec![rule(Day, &["csv", "text"]), rule(Shift, &["text"]), rule(Shift, &["csv"])]);
    let now = at("2026-11-20T12:00+07");
    let period = calendar::period_at(&def, Day, now).expect("a day");
    for (kind, format, expect) in [
        (Day, "csv", Some(0)),
        (Day, "text", Some(0)),
        (Shift, "text", Some(1)),
        (Shift, "csv", Some(2)),
        (Day, "pdf", None),
        (Week, "csv", None),
    ] {
        let due = Due { rule: &def.report.automatic[0], period: period.clone(), format };
        let report = ReportRecord { period: kind, ..made(&due, now) };
        let expect = expect.map(|place: usize| &def.report.automatic[place]);
        assert_eq!(rule_of(&def, &report), expect, "{kind:?} {format}");
    }
}

#[test]
fn placeholders_are_filled_once() {
    let def = def(vec![rule(PeriodKind::Day, &["csv"])]);
    let since = at("2026-11-20T00:00+07");
    let record = Record::new();
    let Step::Make(due) = next_step(&def, &record, &Failures::default(), Some(since), since + hours(25)) else {
        panic!("a day is over")
    };
    let report = ReportRecord { file: "/r/{name}.csv".into(), ..made(&due, since) };
    let fill = |word: &str| filled(word, &report, "tank");
    assert_eq!(fill("{file}"), "/r/{name}.csv");
    assert_eq!(fill("https://x/{plant}/{period}?f={format}&s={sha256}"), "https://x/tank/day?f=csv&s=00");
    assert_eq!(fill("{{name} {\"a\":{}} {"), "{day 2026-11-20 {\"a\":{}} {");
}

proptest! {
    #[test]
    fn however_a_station_stops_each_report_is_made_once(
        stops in prop::collection::vec(0i64..40 * 86_400, 1..12),
        kind in prop::sample::select(PeriodKind::ALL.to_vec()),
    ) {
        let def = def(vec![rule(kind, &["csv"])]);
        let (start, mut record, mut stops) = (at("2026-10-10T10:10+07"), Record::new(), stops);
        stops.sort_unstable();
        let mut from = start;
        for (number, stop) in stops.iter().enumerate() {
            let to = start + SignedDuration::from_secs(*stop);
            // Every other span it is off.
            if number % 2 == 0 {
                run(&def, &mut record, start, from, to);
            }
            from = to;
        }
        let end = start + hours(24 * 41);
        run(&def, &mut record, start, from, end);
        let made: Vec<String> = record.values().map(|report| report.name.to_string()).collect();
        prop_assert_eq!(made, names(&def, kind, start, end));
    }
}
