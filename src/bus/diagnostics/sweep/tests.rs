//! Sweeps of a unit that is a function from a span to an outcome.

use jiff::Timestamp;

use super::*;
use crate::plant::{command::CommandId, diagnostics::Diagnostic, number::to_u8, tag::Table};

const REFUSED: Result<(), Fault> = Err(Fault::Exception(ExceptionCode::ILLEGAL_ADDRESS));

fn sweep(first: u16, last: u16, every: u8) -> Sweep {
    Sweep { unit: 1, table: Table::Holding, first, last, every }
}

/// What the sweep has shown, and its requests.
fn run(sweep: Sweep, unit: impl Fn(AddressSpan, usize) -> Result<(), Fault>) -> (SweepJob, usize) {
    let (mut job, mut requests) = (SweepJob::new(sweep), 0);
    while let Some(span) = job.next() {
        assert!(requests < 200_000, "it never ends");
        job.on_outcome(unit(span, requests));
        requests += 1;
    }
    (job, requests)
}

fn has(ranges: &[std::ops::Range<u32>]) -> impl Fn(AddressSpan, usize) -> Result<(), Fault> {
    move |span, _| {
        let all = span.range().all(|address| ranges.iter().any(|range| range.contains(&address)));
        if all { Ok(()) } else { REFUSED }
    }
}

fn answering(job: &SweepJob) -> Vec<(u16, u16)> {
    let answers = job.ranges().iter().filter(|range| range.outcome == SweptOutcome::Answers);
    answers.map(|range| (range.first, range.last)).collect()
}

#[test]
fn a_unit_that_answers_everything_takes_one_request_a_block() {
    let (job, requests) = run(sweep(0, 65_535, 8), |_, _| Ok(()));
    assert_eq!((answering(&job), requests), (vec![(0, 65_535)], 547));
    assert!(job.conclusion().to_string().contains("does not refuse addresses that it lacks"), "{}", job.conclusion());
}

#[test]
fn ranges_are_found_with_exact_edges() {
    // The second begins right before a block, the third has a hole.
    let parts = [1003..1030, 1198..1215, 4000..4050, 4051..4100, 65_521..65_536];
    let (job, requests) = run(sweep(0, 65_535, 8), has(&parts));
    assert_eq!(answering(&job), [(1003, 1029), (1198, 1214), (4000, 4049), (4051, 4099), (65_521, 65_535)]);
    assert_eq!(job.done(), 65_536);
    assert!(requests < 9_500, "{requests}");
}

#[test]
fn every_address_is_asked_where_that_is_wanted() {
    let parts = [17..18, 400..403];
    let (job, requests) = run(sweep(0, 999, 1), has(&parts));
    assert_eq!(answering(&job), [(17, 17), (400, 402)]);
    assert!(requests < 1_020, "{requests}");
}

#[test]
fn a_unit_that_gives_few_at_once_is_asked_for_fewer() {
    let (job, requests) = run(sweep(0, 9_999, 8), |span, _| if span.count <= 20 { Ok(()) } else { REFUSED });
    assert_eq!(answering(&job), [(0, 9_999)]);
    assert!(requests < 10_000 / 8 + 200, "{requests}");
}

#[test]
fn nothing_but_exceptions_is_said_as_such() {
    let (job, _) = run(sweep(0, 999, 8), |_, _| Err(Fault::Exception(ExceptionCode(4))));
    assert_eq!(answering(&job), []);
    assert!(job.conclusion().to_string().starts_with("only exceptions"), "{}", job.conclusion());
    let (job, requests) = run(sweep(0, 999, 8), |_, _| Err(Fault::Exception(ExceptionCode::ILLEGAL_FUNCTION)));
    assert!(requests == 1 && job.conclusion().to_string().contains("no such table"), "{}", job.conclusion());
}

#[test]
fn a_silent_unit_is_given_up_and_nothing_is_claimed_of_it() {
    let (job, requests) = run(sweep(0, 65_535, 8), |_, _| Err(Fault::Timeout));
    assert_eq!(requests, 6, "three blocks, twice each");
    assert!(job.ranges().iter().all(|range| range.outcome == SweptOutcome::Silent(Fault::Timeout)));
    assert!(job.conclusion().to_string().contains("is unknown"), "{}", job.conclusion());
}

#[test]
fn a_unit_that_falls_silent_ends_the_sweep_there() {
    let (job, requests) =
        run(sweep(0, 65_535, 8), |_, request| if request < 10 { Ok(()) } else { Err(Fault::Timeout) });
    assert_eq!((answering(&job), requests), (vec![(0, 1_199)], 13));
    assert!(
        job.conclusion().to_string().starts_with("no more responses, last request at address 1200"),
        "{}",
        job.conclusion()
    );
    let silent = SweptRange { first: 1_200, last: 1_319, outcome: SweptOutcome::Silent(Fault::Timeout) };
    assert_eq!(job.ranges().last(), Some(&silent));
}

#[test]
fn a_unit_silent_for_a_block_is_asked_on_while_it_lives() {
    let unit = |span: AddressSpan, _| if span.address == 240 { Err(Fault::Timeout) } else { Ok(()) };
    let (job, _) = run(sweep(0, 599, 8), unit);
    assert_eq!(answering(&job), [(0, 239), (360, 599)]);
    assert!(job.conclusion().to_string().contains("120 silent"), "{}", job.conclusion());
}

#[test]
fn one_lost_answer_changes_nothing() {
    let unit = |_, request| if request == 3 { Err(Fault::Timeout) } else { Ok(()) };
    let (job, _) = run(sweep(0, 999, 8), unit);
    assert_eq!(answering(&job), [(0, 999)]);
}

#[test]
fn only_addresses_that_were_asked_are_holes() {
    let (mut job, _) = run(sweep(0, 239, 8), has(&[100..110, 112..120]));
    let holes: Vec<u16> = job.take_holes().iter().map(|span| span.address).collect();
    assert_eq!(holes, [96, 97, 98, 99, 110, 111], "of what is far from any answer only each eighth was asked");
}

#[test]
fn a_refused_range_has_the_reason_of_a_single_address() {
    let unit = |span: AddressSpan, _| {
        let code = if span.count == 1 { ExceptionCode::ILLEGAL_ADDRESS } else { ExceptionCode(3) };
        Err(Fault::Exception(code))
    };
    let (job, _) = run(sweep(0, 999, 8), unit);
    let refused = SweptOutcome::Refused(ExceptionCode::ILLEGAL_ADDRESS);
    assert_eq!(job.ranges(), [SweptRange { first: 0, last: 999, outcome: refused }]);
}

#[test]
fn an_address_behind_the_last_whole_block_is_asked_too() {
    let (job, requests) = run(sweep(0, 120, 8), |_, _| Ok(()));
    assert_eq!((answering(&job), requests, job.done()), (vec![(0, 120)], 2, 121));
}

#[test]
fn where_every_address_is_asked_each_one_missing_is_a_hole() {
    let mut job = Job::new(
        CommandId { terminal: 1, number: 1 },
        "anna".into(),
        Diagnostic::Sweep(sweep(0, 9, 1)),
        Timestamp::UNIX_EPOCH,
    );
    let unit = has(std::slice::from_ref(&(3..5)));
    while let Some(step) = job.next().cloned() {
        let Ask::Message(request) = &step.ask else { panic!("a sweep only reads") };
        let word = |at: usize| u16::from_be_bytes([request[at], request[at + 1]]);
        let span = AddressSpan { table: Table::Holding, address: word(2), count: word(4) };
        let bytes = to_u8(2 * span.count);
        let answer = [vec![1, 3, bytes], vec![0; bytes.into()]].concat();
        job.on_swept(&step, unit(span, 0).map(|()| answer));
    }
    let (unit, holes) = job.take_holes().expect("a sweep");
    let holes: Vec<u16> = holes.iter().map(|span| span.address).collect();
    assert_eq!((unit, holes), (1, vec![0, 1, 2, 5, 6, 7, 8, 9]));
    assert_eq!(job.take_holes(), Some((1, vec![])), "each is named once");
}
