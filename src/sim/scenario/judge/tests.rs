//! What is met and what is missed, by plain facts at plain times.

use jiff::SignedDuration;

use super::*;
use crate::{
    plant::{
        Plant,
        command::{Command, CommandId, CommandKind, Outcome, Refusal},
        def::Priority,
        fixture::{self, HIGH, PV, SV},
        sample::{Cause, Sample},
    },
    sim::scenario::Expect,
};

const BEGAN: Timestamp = Timestamp::UNIX_EPOCH;

fn at(second: u64) -> Timestamp {
    BEGAN + SignedDuration::from_secs(second as i64)
}

/// A drill of 100 s with one expectation from 10 to 20 s.
fn judge(expectation: Expectation) -> Judge {
    let s = Duration::from_secs;
    let expect = Expect { text: "it".to_owned(), points: 10, from: s(10), until: s(20), expectation };
    let scenario = Scenario {
        name: String::new(),
        title: "drill".to_owned(),
        description: String::new(),
        plant: String::new(),
        start: Default::default(),
        warm_up: Duration::ZERO,
        duration: s(100),
        pass_percent: 100,
        events: Vec::new(),
        operator: Vec::new(),
        expect: vec![expect],
    };
    Judge::new(Arc::new(scenario), fixture::shared(), BEGAN)
}

/// What the screens show at a second: PV as given, and the commands.
fn shown(second: u64, pv: Sample, commands: Vec<CommandStatus>) -> Snapshot {
    let mut snapshot = Plant::new(fixture::shared(), at(second), 1.0).snapshot();
    snapshot.samples[PV.index()] = pv;
    snapshot.commands = commands;
    snapshot
}

fn good(value: f64) -> Sample {
    Sample::good(value, BEGAN)
}

fn status(judge: &Judge) -> ExpectationStatus {
    judge.verdict().rows[0].status.clone()
}

fn is_over(judge: &mut Judge) -> ExpectationStatus {
    judge.on_values(&shown(100, good(0.0), Vec::new()), &ActualValues::new());
    status(judge)
}

fn met(second: u64) -> ExpectationStatus {
    ExpectationStatus::Met(Duration::from_secs(second))
}

fn late() -> ExpectationStatus {
    ExpectationStatus::Missed("did not happen in time".to_owned())
}

#[test]
fn an_alarm_counts_in_its_time_and_in_its_step_only() {
    let check = |expectation: Expectation, steps: &[(u64, AlarmEvent, &str)], expect: ExpectationStatus| {
        let mut judge = judge(expectation);
        let text = judge.def.alarm(HIGH).message.clone();
        let subject: Arc<str> = judge.def.tag(PV).name.as_str().into();
        for (second, step, by_text) in steps {
            let text = if by_text.is_empty() { text.as_str() } else { by_text };
            judge.on_records(&[Record::Alarm(AlarmRecord {
                at: at(*second),
                subject: subject.clone(),
                message: text.into(),
                priority: Priority::High,
                event: *step,
                value: Some(76.0.into()),
                limit: None,
                by: None,
                reason: None,
                until: None,
                first_out: None,
                identity: None,
            })]);
        }
        assert_eq!(is_over(&mut judge), expect, "{expectation:?} {steps:?}");
    };
    let raised = Expectation::Alarm(HIGH, AlarmEvent::Raised);
    check(raised, &[(12, AlarmEvent::Raised, "")], met(12));
    check(raised, &[(9, AlarmEvent::Raised, ""), (21, AlarmEvent::Raised, "")], late());
    check(raised, &[(12, AlarmEvent::ReturnedToNormal, "")], late());
    check(raised, &[(12, AlarmEvent::Raised, "another alarm of this tag")], late());
    check(Expectation::Alarm(HIGH, AlarmEvent::Acknowledged), &[(20, AlarmEvent::Acknowledged, "")], met(20));
    check(Expectation::NoAlarm(HIGH), &[], met(20));
    check(
        Expectation::NoAlarm(HIGH),
        &[(12, AlarmEvent::Raised, "")],
        ExpectationStatus::Missed("raised at 00:12: 76.0".to_owned()),
    );
}

#[test]
fn only_a_verified_write_of_the_right_value_counts() {
    let check = |second: u64, value: f64, outcome: Outcome, expect: ExpectationStatus| {
        let mut judge = judge(Expectation::Written(SV, 60.0));
        let command = CommandStatus {
            outcome,
            ..CommandStatus::new(
                Command::new(
                    0,
                    CommandId { terminal: 1, number: 1 },
                    CommandKind::Write { tag: SV, value: value.into() },
                ),
                "tech1",
                at(second),
            )
        };
        judge.on_values(&shown(50, good(50.0), vec![command]), &ActualValues::new());
        assert_eq!(is_over(&mut judge), expect);
    };
    check(15, 60.0, Outcome::Verified, met(15));
    check(15, 60.0, Outcome::Unchanged, met(15));
    check(15, 60.5, Outcome::Verified, late());
    check(25, 60.0, Outcome::Verified, late());
    check(15, 60.0, Outcome::Refused(Refusal::ReadOnly), late());
}

#[test]
fn a_value_is_judged_by_what_is_shown_and_by_what_is_so() {
    let check = |expectation: Expectation, seconds: &[(u64, Sample, f64)], expect: ExpectationStatus| {
        let mut judge = judge(expectation);
        for (second, sample, truth) in seconds {
            judge.on_values(&shown(*second, *sample, Vec::new()), &ActualValues::from([(PV, *truth)]));
        }
        assert_eq!(is_over(&mut judge), expect, "{expectation:?}");
    };
    let bad = Sample::bad(Cause::SensorFault, BEGAN);
    let within = Expectation::Within { tag: PV, low: 0.0, high: 90.0 };
    check(Expectation::NotGood(PV), &[(9, bad, 50.0), (12, good(50.0), 50.0), (14, bad, 50.0)], met(14));
    check(Expectation::NotGood(PV), &[(12, good(50.0), 50.0)], late());
    check(Expectation::Good(PV), &[(12, bad, 50.0), (13, good(50.0), 50.0)], met(13));
    check(within, &[(12, bad, 89.0)], met(20));
    check(within, &[(12, good(70.0), 91.0)], ExpectationStatus::Missed("left at 00:12: 91.0".to_owned()));
    let unknown = ExpectationStatus::Missed("not evaluated: the simulator has no such value".to_owned());
    check(within, &[], unknown);
    // A moment's difference is the way from probe to screen; a lasting one is a wrong value shown as a right one.
    let wrong = |second| (second, good(50.0), 60.0);
    check(Expectation::True(PV, 2.0), &[wrong(10), wrong(14), (15, good(60.0), 60.0), wrong(16), wrong(20)], met(20));
    check(
        Expectation::True(PV, 2.0),
        &[wrong(11), wrong(14), wrong(18)],
        ExpectationStatus::Missed("shown as good and wrong from 00:11: 50.0".to_owned()),
    );
    check(Expectation::True(PV, 2.0), &[(11, bad, 60.0), (18, bad, 60.0)], met(20));
}

#[test]
fn a_verdict_is_open_until_its_time_is_over_and_then_a_sum() {
    let mut judge = judge(Expectation::NotGood(PV));
    judge.on_values(&shown(15, good(50.0), Vec::new()), &ActualValues::new());
    assert_eq!(status(&judge), ExpectationStatus::Open);
    assert_eq!(judge.verdict().summary(), "so far 0 of 10 points, 100 % needed");
    judge.on_values(&shown(21, good(50.0), Vec::new()), &ActualValues::new());
    assert_eq!(status(&judge), late());
    assert!(!judge.verdict().over);
    assert_eq!(is_over(&mut judge), late());
    assert_eq!(
        judge.verdict().lines(),
        ["MISSED    0/10   it  did not happen in time", "FAILED  0 of 10 points, 100 % needed"]
    );
}

#[test]
fn a_drill_of_which_steps_were_lost_is_not_passed() {
    let mut judge = judge(Expectation::NoAlarm(HIGH));
    judge.on_values(&shown(100, Sample::good(60.0, at(100)), Vec::new()), &ActualValues::new());
    assert!(judge.verdict().passed(), "{:?}", judge.verdict());
    judge.on_lost(3);
    let verdict = judge.verdict();
    assert!(!verdict.passed());
    assert_eq!(verdict.summary(), "FAILED  10 of 10 points, 100 % needed; not evaluated: 3 alarm events lost");
}
