//! Which responses are taken for those of the requests before them, and which are not.

use super::*;
use crate::{
    bus::frame,
    plant::fault::{ExceptionCode, Fault},
};

/// Two blocks of the same length.
const A: &[u8] = &[1, 3, 0, 10, 0, 2];
const B: &[u8] = &[1, 3, 0, 20, 0, 2];
const OF_A: &[u8] = &[1, 3, 4, 0, 10, 0, 11];
const OF_B: &[u8] = &[1, 3, 4, 0, 20, 0, 21];
/// And one of another.
const C: &[u8] = &[1, 3, 0, 30, 0, 5];
const OF_C: &[u8] = &[1, 3, 10, 0, 30, 0, 31, 0, 32, 0, 33, 0, 34];

/// A line with its time, and how its requests have ended.
struct Line {
    listener: Listener,
    now: i64,
    framing: Framing,
    ended: Vec<Ended>,
}

impl Line {
    fn new(framing: Framing) -> Line {
        Line { listener: listener(framing), now: 0, framing, ended: Vec::new() }
    }

    fn take(&mut self, heard: Vec<Heard>) {
        self.ended.extend(heard.into_iter().filter_map(|heard| match heard {
            Heard::Ended(ended) => Some(ended),
            Heard::Frame(_) => None,
        }));
    }

    /// Bytes come after this many milliseconds.
    fn bytes(&mut self, after: i64, bytes: &[u8]) {
        self.now += after;
        let heard = self.listener.hear(at(self.now), bytes);
        self.take(heard);
    }

    fn frame(&mut self, after: i64, message: &[u8]) {
        self.bytes(after, &frame::wrap(self.framing, 7, message));
    }

    fn silence(&mut self, millis: i64) {
        self.now += millis;
        let heard = self.listener.rest(at(self.now));
        self.take(heard);
    }

    /// This many rounds of both blocks, as good as the line can be.
    fn rounds(&mut self, count: usize, answer_ms: i64) {
        for _ in 0..count {
            self.frame(5, A);
            self.frame(answer_ms, OF_A);
            self.frame(5, B);
            self.frame(answer_ms, OF_B);
        }
        self.ended.clear();
    }

    /// How requests have ended since: `A+` certain, `A?` not, `A×` without response.
    fn shown(&mut self) -> String {
        let name = |request: &[u8]| match request {
            A => "A",
            B => "B",
            _ => "C",
        };
        let one = |ended: &Ended| match (ended.outcome, &ended.response) {
            (Err(Fault::NotHeard | Fault::Unproven), Some(_)) => format!("{}?", name(&ended.request)),
            (_, Some(_)) => format!("{}+", name(&ended.request)),
            (_, None) => format!("{}×", name(&ended.request)),
        };
        std::mem::take(&mut self.ended).iter().map(one).collect::<Vec<_>>().join(" ")
    }
}

const LINES: [Framing; 3] = [Framing::Rtu, Framing::Ascii, Framing::Mbap];

#[test]
fn the_answer_to_a_lost_request_is_none_to_the_one_before() {
    // Whatever the times say; over TCP with a number that never changes.
    for (framing, answer_ms) in LINES.into_iter().flat_map(|framing| [(framing, 12), (framing, 0)]) {
        let mut line = Line::new(framing);
        line.rounds(300, answer_ms);
        // The answer to A and the request B are lost whole, and leave no noise.
        line.frame(5, A);
        line.frame(2 * answer_ms + 8, OF_B);
        line.frame(5, A);
        assert_eq!(line.shown(), "B+ A?", "{framing:?} {answer_ms} ms");
        line.frame(answer_ms, OF_A);
        for _ in 0..5 {
            line.frame(5, B);
            line.frame(answer_ms, OF_B);
            line.frame(5, A);
            line.frame(answer_ms, OF_A);
        }
        let shown = line.shown();
        // Where everything comes at once, only the order tells, and it was broken.
        let expect = if answer_ms == 0 { "A+ B?" } else { "A+ B+" };
        assert!(shown.ends_with(expect), "{framing:?} {answer_ms} ms: {shown}");
    }
}

#[test]
fn noise_between_request_and_answer_leaves_nothing_certain() {
    for framing in LINES {
        let mut line = Line::new(framing);
        line.rounds(100, 12);
        // What is left of an answer to A, and of a request B.
        line.frame(5, A);
        line.bytes(12, &frame::wrap(framing, 7, OF_A)[4..]);
        line.bytes(5, &frame::wrap(framing, 7, B)[3..]);
        line.frame(12, OF_B);
        line.frame(5, A);
        line.frame(12, OF_A);
        line.silence(60);
        let shown = line.shown();
        assert!(shown.contains("A?") || shown.contains("A×"), "{framing:?}: {shown}");
        assert!(shown.starts_with("B+") && shown.matches('+').count() <= 2, "{framing:?}: {shown}");
    }
}

#[test]
fn a_byte_of_a_driver_that_is_switched_costs_nothing() {
    let mut line = Line::new(Framing::Rtu);
    for _ in 0..20 {
        for (request, answer) in [(A, OF_A), (B, OF_B)] {
            line.frame(5, request);
            line.bytes(1, &[0]);
            line.frame(12, answer);
            line.bytes(1, &[0xFF]);
        }
    }
    let shown = line.shown();
    assert!(shown.ends_with("A+ B+ A+ B+ A+"), "{shown}");
}

#[test]
fn of_two_answers_to_one_request_none_counts() {
    let mut line = Line::new(Framing::Rtu);
    line.rounds(100, 12);
    line.frame(5, A);
    line.frame(12, OF_B);
    line.frame(12, OF_A);
    line.frame(5, B);
    assert_eq!(line.shown(), "B+ A?");
    // A frame that came twice is one answer.
    line.rounds(100, 12);
    line.frame(5, A);
    line.frame(12, OF_A);
    line.frame(1, OF_A);
    line.frame(5, B);
    assert_eq!(line.shown(), "B+ A+");
}

#[test]
fn what_is_heard_for_the_first_time_is_not_yet_certain() {
    for framing in LINES {
        let mut line = Line::new(framing);
        for _ in 0..2 {
            line.frame(100, A);
            line.frame(12, OF_A);
            line.silence(60);
        }
        assert_eq!(line.shown(), "A? A+", "{framing:?}");
        // On a line on which nothing was lost for long the first time is enough.
        line.rounds(300, 12);
        line.frame(100, C);
        line.frame(12, OF_C);
        line.silence(60);
        assert!(line.shown().ends_with("C+"), "{framing:?}");
    }
}

#[test]
fn an_answer_waits_for_the_next_request_only_if_it_must() {
    let mut line = Line::new(Framing::Rtu);
    line.rounds(100, 12);
    line.frame(5, A);
    line.frame(12, OF_A);
    line.ended.clear();
    line.silence(60);
    assert_eq!(line.shown(), "A+", "it came sooner than a second answer ever has");
    // Everything comes at once: only the next request tells.
    let mut line = Line::new(Framing::Rtu);
    line.rounds(300, 0);
    line.frame(5, A);
    line.frame(0, OF_A);
    line.ended.clear();
    line.silence(60);
    assert_eq!(line.shown(), "");
    line.frame(5, B);
    assert_eq!(line.shown(), "A+");
    let held = line.listener.end();
    assert!(matches!(&held[..], []), "{held:?}");
}

#[test]
fn a_late_answer_is_none_to_the_request_behind_it() {
    let mut line = Line::new(Framing::Rtu);
    line.rounds(100, 12);
    // The master gives A up after 300 ms; then each answer is that to the request before.
    line.frame(5, A);
    line.now += 295;
    for _ in 0..20 {
        for (request, answer) in [(B, OF_A), (A, OF_B)] {
            line.frame(5, request);
            line.frame(2, answer);
        }
    }
    let shown = line.shown();
    assert!(shown.starts_with("B+ A×") && shown.matches('+').count() == 1, "{shown}");
    // The answer that is left over comes in a pause; then a few answers in their time show that they are in order.
    line.frame(12, OF_A);
    line.silence(500);
    for _ in 0..10 {
        for (request, answer) in [(A, OF_A), (B, OF_B)] {
            line.frame(5, request);
            line.frame(12, answer);
        }
    }
    let shown = line.shown();
    assert!(shown.ends_with("A+ B+ A+"), "{shown}");
}

#[test]
fn a_master_that_gives_up_soon_has_not_got_its_answer() {
    // It waits for little longer than an answer takes.
    for (answer_ms, timeout_ms) in [(12, 40), (200, 300)] {
        let mut line = Line::new(Framing::Rtu);
        line.rounds(100, answer_ms);
        line.frame(5, A);
        line.frame(timeout_ms, B);
        line.frame(4, OF_A);
        line.frame(5, A);
        assert_eq!(line.ended[1].outcome, Err(Fault::Timeout), "{timeout_ms} ms");
        assert_eq!(line.shown(), "B+ A× B?", "{timeout_ms} ms");
    }
}

#[test]
fn an_answer_that_no_other_request_has_is_beyond_doubt() {
    let mut line = Line::new(Framing::Rtu);
    for _ in 0..2 {
        line.frame(100, C);
        line.frame(12, OF_C);
        line.rounds(50, 12);
    }
    // In this silence a request may have been lost, and its answer may still come.
    line.silence(700);
    line.frame(5, A);
    line.frame(12, OF_A);
    line.frame(5, C);
    line.frame(12, OF_C);
    line.frame(5, A);
    assert_eq!(line.shown(), "B+ A? C+");
}

#[test]
fn a_number_that_comes_again_soon_proves_nothing() {
    let mut line = Line::new(Framing::Mbap);
    let frame =
        |line: &mut Line, after, number: u16, message| line.bytes(after, &frame::with_mbap(number % 3, message));
    for number in (0..200).step_by(2) {
        frame(&mut line, 5, number, A);
        frame(&mut line, 12, number, OF_A);
        frame(&mut line, 5, number + 1, B);
        frame(&mut line, 12, number + 1, OF_B);
    }
    line.ended.clear();
    // Three requests are given up; the answer to the first comes when the fourth has its number.
    for (after, number, request) in [(5, 200, A), (300, 201, B), (300, 202, A), (300, 203, B)] {
        frame(&mut line, after, number, request);
    }
    frame(&mut line, 4, 200, OF_A);
    frame(&mut line, 5, 204, A);
    assert_eq!(line.shown(), "B+ A× B? B×");
}

#[test]
fn an_answer_lost_on_the_way_here_is_no_timeout() {
    let mut line = Line::new(Framing::Rtu);
    line.rounds(100, 12);
    line.frame(5, A);
    // The master has got it, and goes on as always.
    line.frame(22, B);
    line.frame(12, OF_B);
    line.frame(5, A);
    let outcomes: Vec<_> = line.ended.iter().map(|ended| ended.outcome).collect();
    assert_eq!(outcomes, [Ok(()), Err(Fault::NotHeard), Ok(())]);
    // It has waited in vain.
    line.ended.clear();
    line.frame(300, B);
    assert_eq!(line.ended[0].outcome, Err(Fault::Timeout));
}

#[test]
fn an_exception_may_be_that_to_another_request_too() {
    let refused = &[1, 0x83, 2];
    let mut line = Line::new(Framing::Rtu);
    line.rounds(100, 12);
    line.frame(5, A);
    line.frame(12, refused);
    line.frame(5, B);
    let last = line.ended.last().map(|ended| ended.outcome);
    assert_eq!(last, Some(Err(Fault::Exception(ExceptionCode(2)))));
    line.frame(12, OF_B);
    line.ended.clear();
    line.frame(5, A);
    line.frame(32, refused);
    line.frame(5, A);
    assert_eq!(line.shown(), "B+ A?");
}

#[test]
fn a_request_that_looks_like_an_answer_stays_one() {
    // Coils 769 to 792: the request reads like an answer of three bytes.
    let (asked, answer): (&[u8], &[u8]) = (&[1, 1, 3, 0, 0, 24], &[1, 1, 3, 5, 0, 20]);
    let mut line = Line::new(Framing::Rtu);
    for _ in 0..40 {
        line.frame(5, asked);
        line.frame(12, answer);
    }
    line.ended.clear();
    // The request is lost: its answer looks like another request, which the next request would answer.
    for _ in 0..10 {
        line.frame(30, answer);
        line.frame(12, asked);
    }
    let of_others = line.ended.iter().filter(|ended| ended.request != asked && ended.outcome.is_ok());
    assert_eq!(of_others.count(), 0, "{:?}", line.ended);
}

#[test]
fn a_line_that_loses_nothing_for_long_is_believed() {
    // Nothing else proves it: two blocks of one length, each as often behind itself as behind the other, and all at once.
    let mut line = Line::new(Framing::Rtu);
    let mut outcomes = |count: usize, noise: &[u8]| {
        line.bytes(5, noise);
        for place in 0..count {
            let (request, response) = if place % 4 < 2 { (A, OF_A) } else { (B, OF_B) };
            line.frame(5, request);
            line.frame(0, response);
        }
        let last = line.ended.split_off(line.ended.len() - 100);
        line.ended.clear();
        last.into_iter().map(|ended| ended.outcome).collect::<Vec<_>>()
    };
    assert_eq!(outcomes(2_000, &[]), [Err(Fault::Unproven); 100]);
    assert_eq!(outcomes(140_000, &[]), [Ok(()); 100]);
    assert_eq!(outcomes(2_000, &[9; 20]), [Err(Fault::Unproven); 100], "what is lost once may be lost again");
}
