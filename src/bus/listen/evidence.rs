//! Whether a response belongs to the request before it: what the frames prove, with all that was heard of the line so far.
//!
//! Without transaction ids a response names unit, function and length. Where the response to A and the request B behind it are both
//! lost on the way here, the response to B directly follows A. Any of these excludes that:
//!
//! | proof | what it rests on |
//! |---|---|
//! | only | no other request of the master may have this response |
//! | time | it came sooner than the second response after a request of this unit ever has |
//! | order | the request that comes next follows A, and hardly ever B |
//!
//! Noise between the two is the rest of something, so that nothing is proven; what a driver leaves behind that is switched over leaves
//! the order. Without a response to an earlier request that may still come, too: see [`Unit`]. A master that was out of step with its
//! devices before the first byte was heard looks like any other.

use std::{collections::BTreeMap, time::Duration};

use jiff::Timestamp;

use super::{
    order::{Key, Order, key},
    unit::Unit,
};
use crate::plant::time::elapsed;

/// So few bytes between two frames are what a driver leaves behind that is switched over, and no rest of a frame.
pub(super) const GLITCH_MAX: usize = 2;
/// The most likely error that is taken for none: four in a million.
const RISK_MAX: f64 = 4e-6;
/// Losses are counted among about this many requests.
const COUNT_MAX: u32 = 2048;
/// A unit that was silent for this many times the usual timeout owes nothing any more.
const REST: u32 = 5;
/// A master that goes on so long after the usual end of a response has surely given up.
const PATIENCE_MAX: Duration = Duration::from_millis(50);
/// A response lasts longer by this at the most, while its time is to be a proof.
const LASTS_MAX: Duration = Duration::from_millis(10);

/// A request and a response behind it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pair<'a> {
    pub request: &'a [u8],
    pub response: &'a [u8],
    /// The last byte of the request, the first and the last of the response.
    pub asked_at: Timestamp,
    pub first: Timestamp,
    pub at: Timestamp,
    /// Bytes between them.
    pub noise: usize,
}

/// What is known of a pair.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Verdict {
    /// The response belongs to the request.
    Proven,
    /// So it seems, but it may be that to another request.
    Unproven,
    /// Nothing is known yet, or nothing can be.
    Open,
}

/// All that was learned of a line.
#[derive(Debug)]
pub(super) struct Evidence {
    order: Order,
    units: BTreeMap<u8, Unit>,
    /// How many frames of about as many requests were lost.
    requests: u32,
    losses: u32,
    /// So often the master seemed to leave out a request: more than one frame was lost.
    gaps: u32,
    /// Requests since the last of either.
    whole: u32,
    /// The last request and the last response of all; and whether a request before the next may have been without response.
    last: Key,
    answered_at: Timestamp,
    hidden: bool,
    /// A response takes no longer, as far as nothing else is known.
    timeout: Duration,
}

impl Evidence {
    pub fn new(timeout: Duration) -> Evidence {
        let (order, units, answered_at) = (Order::default(), BTreeMap::new(), Timestamp::MIN);
        let (last, hidden, requests, losses, gaps, whole) = (Key::default(), false, 0, 0, 0, 0);
        Evidence { order, units, requests, losses, gaps, whole, last, answered_at, hidden, timeout }
    }

    fn unit(&mut self, unit: u8, at: Timestamp) -> &mut Unit {
        self.units.entry(unit).or_insert_with(|| Unit::new(at))
    }

    /// A request was heard that began at `first`, `previous` and its response directly before it.
    pub fn ask(&mut self, request: &[u8], first: Timestamp, previous: Option<&[u8]>) {
        self.requests += 1;
        self.whole = self.whole.saturating_add(1);
        if self.requests == COUNT_MAX {
            (self.requests, self.losses, self.gaps) = (self.requests / 2, self.losses / 2, self.gaps / 2);
        }
        let asked = key(request);
        self.order.ask(&asked);
        let gap = previous.map(key).map(|previous| {
            let pause = elapsed(self.answered_at, first);
            let usual = self.order.pause(&previous);
            if self.order.is_unusual(&previous, &asked) {
                (self.gaps, self.whole) = (self.gaps + 1, 0);
            }
            self.order.follow(&previous, &asked, pause);
            // What is longer may be but a delay on the way here.
            usual.map_or(pause, |usual| pause.min(2 * usual))
        });
        self.last = asked;
        let rest = REST * self.timeout;
        let gap = gap.filter(|_| !std::mem::take(&mut self.hidden));
        self.unit(request[0], first).ask(first, gap, rest);
    }

    /// Something comes after a silence in which no response was waited for.
    pub fn pause(&mut self, silence: Duration) {
        if self.order.pause(&self.last).is_some_and(|usual| 2 * usual + PATIENCE_MAX < silence) {
            self.suspect();
        }
    }

    /// There was time enough for a request that was not heard and is without response. A line that hardly ever loses frames, with
    /// units that hardly ever are silent, does not do both.
    fn suspect(&mut self) {
        let missed = self.units.values().map(Unit::may_miss).fold(0.0, f64::max);
        if RISK_MAX < self.rate(self.losses) * missed {
            self.hide();
        }
    }

    /// How often something is lost, of 1, which has happened so often lately; a line that loses nothing for long has a small one.
    fn rate(&self, count: u32) -> f64 {
        (f64::from(count + 1) / f64::from(self.requests + 1)).min(1.0 / f64::from(self.whole + 1))
    }

    /// A response to a request that was not heard may still come.
    pub fn hide(&mut self) {
        self.hidden = true;
        self.units.values_mut().for_each(Unit::hide);
    }

    /// A frame of the line was not heard, or only in part.
    pub fn lose(&mut self) {
        (self.losses, self.whole) = (self.losses.saturating_add(1), 0);
    }

    /// Was this request heard more than once?
    pub fn is_usual(&self, request: &[u8]) -> bool {
        1 < self.order.times(&key(request))
    }

    /// How long a response of a unit is waited for.
    pub fn patience(&self, unit: u8) -> Duration {
        self.units.get(&unit).and_then(Unit::longest).map_or(self.timeout, |longest| 2 * longest)
    }

    /// May a response be the late one to an earlier request?
    pub fn is_late(&self, request: &[u8], response: &[u8]) -> bool {
        let unknown = |unit: &Unit| unit.owes_unknown() && !self.order.is_only(&key(request), response);
        self.units.get(&request[0]).is_some_and(|unit| unit.owes_another(request, response) || unknown(unit))
    }

    /// Does the response belong to the request? `next` is the request behind it, with no more than a glitch between.
    pub fn judge(&self, pair: &Pair, next: Option<&[u8]>) -> Verdict {
        if GLITCH_MAX < pair.noise {
            return Verdict::Open;
        }
        let unit = self.units.get(&pair.request[0]);
        let (request, clean) = (key(pair.request), pair.noise == 0);
        let time = elapsed(pair.asked_at, pair.first);
        let is_usual = unit.and_then(Unit::longest).is_none_or(|longest| time <= longest);
        // Within three quarters of the shortest time, and in one piece: the beginning of one response and the end of another may be
        // as good a frame. What came with its request tells nothing.
        let lasts = elapsed(pair.first, pair.at);
        let is_whole = self.order.lasts(&request).is_some_and(|usual| lasts <= usual + LASTS_MAX);
        let second = unit.and_then(Unit::second).filter(|_| clean && is_whole && is_usual && !time.is_zero());
        if second.is_some_and(|second| time * 4 <= second * 3) {
            return Verdict::Proven;
        }
        // Two frames are lost one by one, where nothing is left as noise; or at once, which there may be a first time for.
        let lost = self.rate(self.losses) + unit.map_or(0.0, Unit::missed);
        let (one_by_one, at_once) = (lost.powi(2), self.rate(self.gaps));
        let in_time = time <= self.timeout.max(self.patience(request[0]));
        if clean && in_time && self.order.is_only(&request, pair.response) {
            let is_new = self.order.times(&request) < 2 && RISK_MAX < one_by_one;
            return if is_new { Verdict::Unproven } else { Verdict::Proven };
        }
        let Some(next) = next.map(key).filter(|_| is_usual) else { return Verdict::Open };
        let risk = match clean {
            true => one_by_one.max(at_once).min(1.0) * self.order.detours(&request, &next, pair.response),
            false => self.order.others_before(&request, &next, pair.response),
        };
        if risk <= RISK_MAX { Verdict::Proven } else { Verdict::Open }
    }

    /// A response has come; `proven` to its request. One that may be late leaves its own request without response.
    pub fn answer(&mut self, pair: &Pair, proven: bool, late: bool) {
        let clean = pair.noise == 0;
        let time = elapsed(pair.asked_at, pair.first);
        let unit = self.unit(pair.request[0], pair.at);
        if proven {
            unit.prove(pair.request);
        } else if late {
            unit.owe(pair.request);
        }
        let unusual = !proven && unit.longest().is_some_and(|longest| longest < time);
        unit.answer(pair.asked_at, pair.first, pair.at, clean, RISK_MAX);
        self.answered_at = pair.at;
        if unusual {
            self.suspect();
        }
        if clean {
            self.order.took(&key(pair.request), elapsed(pair.asked_at, pair.at), elapsed(pair.first, pair.at));
        }
    }

    /// A response of a unit to no open request has come.
    pub fn answer_late(&mut self, unit: u8, at: Timestamp) {
        self.unit(unit, at).answer_late(at);
    }

    /// A request had no response that was heard whole, when the master went on after `waited`. `false`: its response was lost on the
    /// way here, because a master that gives up waits for longer, or because it was heard, `damaged`.
    pub fn miss(&mut self, request: &[u8], waited: Duration, damaged: bool) -> bool {
        let request_key = key(request);
        // After a response it pauses as usual, or a little longer.
        let slack = self.units.get(&request[0]).and_then(Unit::slack).unwrap_or_default();
        let pause = 2 * self.order.pause(&request_key).unwrap_or_default() + slack;
        let takes = self.order.takes(&request_key);
        let gave_up = !damaged && takes.map_or(2 * PATIENCE_MAX, |takes| takes + pause.min(PATIENCE_MAX)) < waited;
        // Or its response was lost on the way here, and the master has waited for that to a request behind it, which was lost too.
        if gave_up && !self.order.gives_up(&request_key, waited, takes.unwrap_or_default() / 2) {
            self.suspect();
        }
        self.units.get_mut(&request[0]).into_iter().for_each(|unit| unit.miss(request, gave_up));
        gave_up
    }
}
