//! A unit that is heard: how long it takes to answer, and which responses of it may still come.
//!
//! Its response to A may come late, after the request B, and is then taken for the response to B; the one to B is taken for that to C,
//! and so on. Such a response had a start: it comes sooner, by the gap between the response before it and its request. Each
//! response that is not sooner therefore speaks against that, as much as the gap stands out from how the times vary.

use std::time::Duration;

use jiff::Timestamp;

use super::order::fits;
use crate::plant::time::elapsed;

/// Requests without response that are remembered; with more, no response is proven.
const OWED_MAX: usize = 16;
/// Counts are halved from here on.
const COUNT_MAX: u32 = 2048;
/// Of this many times the mean and the least are known.
const TIMES_MIN: u32 = 16;
/// Before they are known, a unit that has answered this many requests in a row owes nothing, if it hardly ever owes anything.
const CALM: u32 = 256;
/// A pause is long from here on, if it is longer than four times the response behind it takes.
const PAUSE_MIN: Duration = Duration::from_millis(100);
/// Each time counts for so much in the mean: one part in as many.
const MEAN_OF: f64 = 32.0;
/// The least is that of the last one or two windows.
const WINDOW: u32 = 1024;
/// Times vary by a millisecond at the least.
const VARIANCE_MIN: f64 = 1e-6;
/// A time is usual within this many standard deviations.
const USUAL: f64 = 4.0;

/// What is known of a unit.
#[derive(Debug)]
pub(super) struct Unit {
    /// Its last response; and whether no request has come since.
    answered_at: Timestamp,
    answered: bool,
    /// From its last response to its open request, if it owes none of the two.
    gap: Option<Duration>,
    /// Requests without response: any of them may still be answered. And whether one may be that was not heard.
    owed: Vec<Vec<u8>>,
    hidden: bool,
    /// The master has waited in vain, so that one is really late or lost: no mere suspicion.
    gave_up: bool,
    /// Responses since the last of them: how many; how much later than usual and how long after the one before, in seconds.
    since: u32,
    later: f64,
    gaps: f64,
    /// And how many of them came after a long pause.
    pauses: u32,
    /// How many of about as many requests had no response.
    requests: u32,
    misses: u32,
    /// The request before the open one, if it was answered.
    before: Option<Timestamp>,
    /// Seconds to a response: how many, their mean, their variance.
    times: u32,
    mean: f64,
    variance: f64,
    second: Least,
}

impl Unit {
    pub fn new(answered_at: Timestamp) -> Unit {
        let (requests, misses, times, mean, variance) = (0, 0, 0, 0.0, 0.0);
        let (owed, since, later, gaps) = (Vec::new(), 0, 0.0, 0.0);
        Unit {
            answered_at,
            answered: false,
            gap: None,
            owed,
            hidden: false,
            gave_up: false,
            since,
            later,
            gaps,
            pauses: 0,
            requests,
            misses,
            before: None,
            times,
            mean,
            variance,
            second: Least::default(),
        }
    }

    /// It is asked, by a request that began at `first`, so long after the last response of all, with nothing between.
    pub fn ask(&mut self, first: Timestamp, gap: Option<Duration>, rest: Duration) {
        if rest < elapsed(self.answered_at, first) {
            self.settle();
        }
        self.requests += 1;
        if self.requests == COUNT_MAX {
            (self.requests, self.misses) = (self.requests / 2, self.misses / 2);
        }
        // Through a gateway all units answer in one order.
        self.gap = gap.filter(|_| self.answered);
        self.answered = false;
    }

    fn is_in_doubt(&self) -> bool {
        self.hidden || !self.owed.is_empty()
    }

    /// No response to an earlier request can come any more.
    fn settle(&mut self) {
        self.owed.clear();
        (self.hidden, self.gave_up) = (false, false);
    }

    /// A request that was not heard may have had no response, which may still come.
    pub fn hide(&mut self) {
        self.hidden = true;
        (self.since, self.later, self.gaps, self.pauses) = (0, 0.0, 0.0, 0);
    }

    /// It has answered a request that ended at `asked_at`, from `first` to `at`; `clean` without noise between. An error in a
    /// million is taken for none.
    pub fn answer(&mut self, asked_at: Timestamp, first: Timestamp, at: Timestamp, clean: bool, risk: f64) {
        (self.answered_at, self.answered) = (at, true);
        if let Some(before) = std::mem::replace(&mut self.before, clean.then_some(asked_at)) {
            // A response that is not its own comes sooner.
            if !self.is_in_doubt() {
                self.second.add(elapsed(before, first));
            }
        }
        if !clean {
            return;
        }
        let time = elapsed(asked_at, first).as_secs_f64();
        let off = (time - self.mean).clamp(-self.spread(), self.spread());
        if !self.is_in_doubt() || (self.times < TIMES_MIN && !self.gave_up) {
            self.learn(time, off);
        } else if self.times < TIMES_MIN {
            // There is nothing to compare it with, but nothing outlasts a long pause unless it is late again.
            self.since += 1;
            self.pauses += u32::from(self.gap.is_some_and(|gap| PAUSE_MIN.max(elapsed(asked_at, first) * 4) < gap));
            let late_again = self.may_miss().powi(i32::try_from(self.pauses).unwrap_or(i32::MAX));
            if late_again <= risk || (CALM <= self.since && self.missed() * f64::from(CALM) <= 2.0) {
                self.settle();
            }
        } else if let Some(gap) = self.gap {
            (self.since, self.later, self.gaps) = (self.since + 1, self.later + off, self.gaps + gap.as_secs_f64());
            if self.in_order() <= risk {
                self.settle();
            }
        }
    }

    /// A response of it to no open request has come: what it owes may still come.
    pub fn answer_late(&mut self, at: Timestamp) {
        self.answered_at = at;
    }

    /// How likely it is that the latest responses belong to the requests before theirs, by their times.
    fn in_order(&self) -> f64 {
        let gap = self.gaps / f64::from(self.since);
        let odds = (self.later + self.gaps / 2.0) * gap / self.variance.max(VARIANCE_MIN);
        // Each of them may be late again.
        (-odds).exp().max(self.may_miss().powi(i32::try_from(self.since).unwrap_or(i32::MAX)))
    }

    /// How often it may have no response, of 1.
    pub fn may_miss(&self) -> f64 {
        self.missed() + 1.0 / f64::from(self.requests + 1)
    }

    fn learn(&mut self, time: f64, off: f64) {
        self.times = self.times.saturating_add(1);
        // A mean of all of the first times, then one that follows.
        if f64::from(self.times) <= MEAN_OF {
            let off = time - self.mean;
            self.mean += off / f64::from(self.times);
            self.variance += (off * (time - self.mean) - self.variance) / f64::from(self.times);
        } else {
            self.mean += off / MEAN_OF;
            self.variance += (off * off - self.variance) / MEAN_OF;
        }
    }

    /// How often it has no response, of 1.
    pub fn missed(&self) -> f64 {
        f64::from(self.misses) / f64::from(self.requests + 1)
    }

    /// A request had no response that was heard; `owed`: it may still come.
    pub fn miss(&mut self, request: &[u8], owed: bool) {
        self.before = None;
        if owed {
            self.misses += 1;
            self.gave_up = true;
            (self.since, self.later, self.gaps, self.pauses) = (0, 0.0, 0.0, 0);
        }
        // What the master has got may have been the response to an earlier one.
        if owed || self.is_in_doubt() {
            self.owe(request);
        }
    }

    /// The response to a request may still come.
    pub fn owe(&mut self, request: &[u8]) {
        if self.owed.len() < OWED_MAX && !self.owed.iter().any(|owed| owed == request) {
            self.owed.push(request.to_vec());
        }
    }

    /// It has certainly answered a request: what was asked before would have been answered before, unless this request was too.
    pub fn prove(&mut self, request: &[u8]) {
        if !self.hidden && self.owed.iter().all(|owed| owed != request) {
            self.settle();
        }
    }

    /// May this be the response to another request that was heard before?
    pub fn owes_another(&self, request: &[u8], response: &[u8]) -> bool {
        self.owed.iter().any(|owed| owed != request && fits(owed, response))
    }

    /// May requests that are not remembered be without response?
    pub fn owes_unknown(&self) -> bool {
        self.hidden || self.owed.len() == OWED_MAX
    }

    /// How far times to a response usually lie from their mean, in seconds.
    fn spread(&self) -> f64 {
        USUAL * self.variance.max(VARIANCE_MIN).sqrt()
    }

    /// By how much a response is usually late at the most; and the longest usual time to one. Once they are known.
    pub fn slack(&self) -> Option<Duration> {
        (TIMES_MIN <= self.times).then(|| Duration::from_secs_f64(self.spread()))
    }

    /// See above.
    pub fn longest(&self) -> Option<Duration> {
        self.slack().map(|slack| slack + Duration::from_secs_f64(self.mean.max(0.0)))
    }

    /// The shortest time from a request to the beginning of the second response after it, once it is known.
    pub fn second(&self) -> Option<Duration> {
        self.second.get()
    }
}

/// The least of the latest times.
#[derive(Debug, Default)]
struct Least {
    /// Of these, and of those before.
    windows: [Option<Duration>; 2],
    count: u32,
}

impl Least {
    fn add(&mut self, time: Duration) {
        if self.count == WINDOW {
            (self.windows, self.count) = ([None, self.windows[0]], 0);
        }
        self.count += 1;
        self.windows[0] = Some(self.windows[0].map_or(time, |least| least.min(time)));
    }

    fn get(&self) -> Option<Duration> {
        let known = TIMES_MIN <= self.count || self.windows[1].is_some();
        self.windows.iter().flatten().min().copied().filter(|_| known)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(millis: i64) -> Timestamp {
        Timestamp::UNIX_EPOCH + jiff::SignedDuration::from_millis(millis)
    }

    #[test]
    fn a_response_may_belong_to_any_request_that_is_owed_one() {
        let [first, second] = [[1, 3, 0, 10, 0, 2], [1, 3, 0, 20, 0, 2]];
        let response = [1, 3, 4, 0, 1, 0, 2];
        let mut unit = Unit::new(at(0));
        assert!(!unit.owes_another(&second, &response));
        unit.owe(&first);
        assert!(unit.owes_another(&second, &response) && !unit.owes_another(&first, &response));
        assert!(!unit.owes_unknown());
        for place in 0..2 * OWED_MAX as u8 {
            unit.owe(&[1, 3, 1, place, 0, 2]);
        }
        assert!(unit.owes_unknown() && unit.owed.len() == OWED_MAX);
    }

    #[test]
    fn usual_times_to_a_response_lie_around_their_mean() {
        let mut unit = Unit::new(at(0));
        let mut answer = |number: i64, time: i64| {
            let asked_at = at(1_000 * number);
            unit.ask(asked_at, None, Duration::from_secs(60));
            unit.answer(asked_at, asked_at + Duration::from_millis(time as u64), at(1_000 * number + 50), true, 1e-6);
            unit.longest()
        };
        for number in 0..100 {
            let longest = answer(number, 20 + 4 * (number % 2));
            assert_eq!(longest.is_some(), TIMES_MIN <= number as u32 + 1, "{number}");
            assert!(longest.is_none_or(|longest| (25..35).contains(&longest.as_millis())), "{number}: {longest:?}");
        }
    }
}
