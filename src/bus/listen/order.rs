//! What the other master asks, and what it asks next: learned from what is heard.

use std::{collections::BTreeMap, time::Duration};

use crate::{bus::frame, plant::line::Framing};

/// Requests that are remembered; those that were heard least recently give way.
const REQUESTS_MAX: usize = 1024;
/// Requests that are remembered behind one; the rarest gives way.
const NEXT_MAX: usize = 16;
/// What follows a request more rarely may have come about by losses.
const SHARE_MIN: f64 = 1.0 / 16.0;
/// And what is not asked rarely, but after this one, has come about by them.
const SHARE_RARE: f64 = 1.0 / 64.0;
/// What was never heard has been as if so often: less than once.
const UNSEEN: f64 = 0.25;
/// How long the master pauses after a request is known once it was heard so often.
const PAUSES_MIN: u32 = 8;
/// What follows it is known once it was heard so often.
const ORDER_MIN: u32 = 64;
/// Counts are halved from here on, so that the master's order of today counts, and what it did once is forgotten.
const COUNT_MAX: u32 = 1024;

/// What tells a request from others: unit, function and place. What is written there makes no difference.
pub(super) type Key = [u8; 6];

/// The key of a request message.
pub(super) fn key(request: &[u8]) -> Key {
    let length = if matches!(request.get(1), Some(0x05 | 0x06 | 0x16)) { 4 } else { 6 };
    let mut key = Key::default();
    key.iter_mut().zip(request.iter().take(length)).for_each(|(to, from)| *to = *from);
    key
}

/// May this be the response to a request, for all that the two frames say?
pub(super) fn fits(request: &[u8], response: &[u8]) -> bool {
    frame::answers(Framing::Rtu, request, response)
}

#[derive(Debug, Default)]
struct Known {
    /// How often it was heard, and when last, counted in requests.
    times: u32,
    last: u64,
    /// From its end to the end of its response, and from the beginning of that, as a rule.
    takes: Option<Duration>,
    lasts: Option<Duration>,
    /// How long the master waits without a response, at the least.
    waits: Option<Duration>,
    /// From the end of its response to the next request, as a rule.
    pause: Option<Duration>,
    /// What was asked after its response, and how often.
    next: Vec<(Key, u32)>,
}

impl Known {
    fn count(&self, next: &Key) -> u32 {
        self.next.iter().find(|(key, _)| key == next).map_or(0, |(_, count)| *count)
    }

    /// How often the next request is this one, of 1.
    fn share(&self, next: &Key) -> f64 {
        f64::from(self.count(next)) / f64::from(self.all().max(1))
    }

    fn all(&self) -> u32 {
        self.next.iter().map(|(_, count)| count).sum()
    }
}

/// The requests of a master.
#[derive(Debug, Default)]
pub(super) struct Order {
    requests: BTreeMap<Key, Known>,
    heard: u64,
}

impl Order {
    /// A request was heard.
    pub fn ask(&mut self, request: &Key) {
        self.heard += 1;
        if self.requests.len() == REQUESTS_MAX && !self.requests.contains_key(request) {
            let oldest = self.requests.iter().min_by_key(|(_, known)| known.last).map(|(key, _)| *key);
            oldest.and_then(|oldest| self.requests.remove(&oldest));
        }
        let known = self.requests.entry(*request).or_default();
        known.times = known.times.saturating_add(1);
        known.last = self.heard;
    }

    /// How often a request was heard.
    pub fn times(&self, request: &Key) -> u32 {
        self.requests.get(request).map_or(0, |known| known.times)
    }

    /// A request and its response were heard, then the next request after a pause, and nothing else.
    pub fn follow(&mut self, request: &Key, next: &Key, pause: Duration) {
        let Some(known) = self.requests.get_mut(request) else { return };
        known.pause = Some(mean(known.pause, pause));
        match known.next.iter_mut().find(|(key, _)| key == next) {
            Some((_, count)) => *count += 1,
            None => {
                if known.next.len() == NEXT_MAX {
                    let rarest = (0..NEXT_MAX).min_by_key(|place| known.next[*place].1);
                    rarest.map(|place| known.next.swap_remove(place));
                }
                known.next.push((*next, 1));
            }
        }
        if COUNT_MAX <= known.all() {
            known.next.iter_mut().for_each(|(_, count)| *count /= 2);
            known.next.retain(|(_, count)| 0 < *count);
        }
    }

    /// Is it unusual that a request follows another, whose order is known?
    pub fn is_unusual(&self, request: &Key, next: &Key) -> bool {
        let Some(known) = self.requests.get(request) else { return false };
        // What is asked rarely follows everything rarely.
        ORDER_MIN <= known.all() && known.share(next) < SHARE_RARE && known.times / 4 <= self.times(next)
    }

    /// A request has taken so long, up to the end of its response, which has lasted so long.
    pub fn took(&mut self, request: &Key, time: Duration, lasted: Duration) {
        let Some(known) = self.requests.get_mut(request) else { return };
        // A spell of slow responses must not look like the rule: the master gives up in it.
        let usual = known.takes.map_or(time, |takes| time.min(takes + takes / 16));
        (known.takes, known.lasts) = (Some(mean(known.takes, usual)), Some(mean(known.lasts, lasted)));
    }

    /// How long its response lasts as a rule.
    pub fn lasts(&self, request: &Key) -> Option<Duration> {
        self.requests.get(request)?.lasts
    }

    /// How long a request takes as a rule, up to the end of its response.
    pub fn takes(&self, request: &Key) -> Option<Duration> {
        self.requests.get(request)?.takes
    }

    /// The master has waited so long for a response in vain: `false` if it usually gives up sooner.
    pub fn gives_up(&mut self, request: &Key, waited: Duration, margin: Duration) -> bool {
        let Some(known) = self.requests.get_mut(request) else { return false };
        let usual = known.waits.is_some_and(|waits| waited <= waits + margin);
        // What is longer counts little.
        known.waits = Some(known.waits.map_or(waited, |waits| waited.min(waits + waits / 16)));
        usual
    }

    /// How long the master pauses after its response as a rule, once that is known.
    pub fn pause(&self, request: &Key) -> Option<Duration> {
        self.requests.get(request).filter(|known| PAUSES_MIN <= known.all())?.pause
    }

    /// Is no other request known that may have this response?
    pub fn is_only(&self, request: &Key, response: &[u8]) -> bool {
        self.others(request, response).next().is_none()
    }

    /// How much more often than one request directly follows the other, a third one stands between them that may have this
    /// response too. Infinite where the master was never heard to ask them in this order.
    pub fn detours(&self, request: &Key, next: &Key, response: &[u8]) -> f64 {
        let Some(known) = self.requests.get(request).filter(|known| SHARE_MIN <= known.share(next)) else {
            return f64::INFINITY;
        };
        let between = self.others(request, response).map(|(other, behind)| {
            (f64::from(known.count(other)) + UNSEEN) * (f64::from(behind.count(next)) + UNSEEN)
                / f64::from(behind.all() + 1)
        });
        between.sum::<f64>() / f64::from(known.count(next))
    }

    /// How much more often than after one request, the next is asked after others that may have this response too. Infinite
    /// where the master was never heard to ask them in this order.
    pub fn others_before(&self, request: &Key, next: &Key, response: &[u8]) -> f64 {
        let count = |known: &Known| f64::from(known.count(next));
        let known = self.requests.get(request).filter(|known| SHARE_MIN <= known.share(next));
        let others = self.others(request, response).map(|(_, other)| count(other));
        known.map_or(f64::INFINITY, |known| others.sum::<f64>() / count(known))
    }

    /// The other requests that may have this response.
    fn others<'a>(&'a self, request: &'a Key, response: &'a [u8]) -> impl Iterator<Item = (&'a Key, &'a Known)> {
        let unit = request[0];
        let of_unit = self.requests.range([unit, 0, 0, 0, 0, 0]..=[unit, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF]);
        of_unit.filter(move |(other, _)| *other != request && fits(&other[..], response))
    }
}

fn mean(known: Option<Duration>, time: Duration) -> Duration {
    known.map_or(time, |known| (known * 7 + time) / 8)
}

#[cfg(test)]
mod tests {
    use super::*;

    const FIRST: &[u8] = &[1, 3, 0, 10, 0, 2];
    const SECOND: &[u8] = &[1, 3, 0, 20, 0, 2];
    const NEXT: &[u8] = &[1, 3, 0, 30, 0, 1];

    #[test]
    fn requests_before_another_are_compared_by_how_often_they_are() {
        let mut order = Order::default();
        for (request, times) in [(FIRST, 4), (SECOND, 2)] {
            for _ in 0..times {
                order.ask(&key(request));
                order.follow(&key(request), &key(NEXT), Duration::from_millis(50));
            }
        }
        let before = |request: &[u8]| order.others_before(&key(request), &key(NEXT), &[1, 3, 4, 0, 1, 0, 2]);
        assert_eq!((before(FIRST), before(SECOND), before(NEXT)), (0.5, 2.0, f64::INFINITY));
    }

    #[test]
    fn a_wait_without_response_is_usual_once_it_was_so_long() {
        let millis = Duration::from_millis;
        let mut order = Order::default();
        order.ask(&key(FIRST));
        let gives_up = [500, 500, 900, 510].map(|waited| order.gives_up(&key(FIRST), millis(waited), millis(20)));
        assert_eq!(gives_up, [false, true, false, true]);
    }
}
