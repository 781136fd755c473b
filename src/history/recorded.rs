//! When stations recorded, and in which order what they stored is read where a clock was set back; pure.
//!
//! ```text
//!   epoch 0   ├─────────────────┤
//!   epoch 1            ├───────────────────────┤       the clock was set back
//!   legs      ├── 1 ───┤
//!                      ├── 2 ──┤                       what epoch 0 stored there
//!                      ├── 3 ──┤                       and then what epoch 1 did
//!                              ├────── 4 ──────┤
//! ```

use std::ops::Range;

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

use super::tiers::HOUR;
use crate::plant::{def::TagId, sample::Sample};

/// A station that stores nothing for longer than this was not running: it has a value of every tag at least every minute, or a
/// minute of every line.
pub const PAUSE_MAX: i64 = 150_000_000;
/// Times without a station that an overview lists.
pub const PAUSES_MAX: usize = 100;
/// What an epoch has stored so long before the next one is read by the times alone: a clock that was a year ahead has its own
/// records in a year.
const INVERTED_MAX: i64 = 24 * HOUR;

/// A time in which a station recorded, with its clock as it was set then; microseconds since 1970.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Recorded {
    /// The epoch of its clock; `None` if that is not known.
    pub epoch: Option<u16>,
    /// The first instant that it stored.
    pub from: i64,
    /// The last one.
    pub to: i64,
}

impl Recorded {
    /// Both this and another one that follows or overlaps it; `None` if a pause lies between them.
    pub fn widened(self, other: Recorded) -> Option<Recorded> {
        let near = other.from <= self.to.saturating_add(PAUSE_MAX) && self.from <= other.to.saturating_add(PAUSE_MAX);
        let both = Recorded { from: self.from.min(other.from), to: self.to.max(other.to), ..self };
        (near && self.epoch == other.epoch).then_some(both)
    }
}

/// The times in which instants lie, which come in the order of their records.
pub fn recorded(epoch: u16, instants: impl Iterator<Item = i64>) -> Vec<Recorded> {
    let mut all: Vec<Recorded> = Vec::new();
    for at in instants {
        let one = Recorded { epoch: Some(epoch), from: at, to: at };
        match all.last_mut().and_then(|last| Some((last.widened(one)?, last))) {
            Some((both, last)) => *last = both,
            None => all.push(one),
        }
    }
    all
}

/// A time in which nothing was recorded.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Pause {
    /// From when to when.
    pub span: Range<i64>,
    /// A station ran all the time, and its clock was set forward over it.
    pub is_of_clock: bool,
}

/// The parts of a span in which nothing was recorded.
pub fn pauses(recorded: &[Recorded], span: Range<i64>) -> Vec<Pause> {
    let mut sorted: Vec<&Recorded> = recorded.iter().collect();
    sorted.sort_by_key(|recorded| recorded.from);
    let (mut last, mut pauses) = (Recorded { epoch: None, from: i64::MIN, to: i64::MIN }, Vec::new());
    let end = Recorded { epoch: None, from: i64::MAX, to: i64::MAX };
    for next in sorted.into_iter().chain([&end]) {
        // A start is of another epoch only where the clock went back.
        let is_of_clock = last.epoch.is_some() && next.epoch.is_some() && last.epoch != next.epoch;
        let within = last.to.max(span.start)..next.from.min(span.end);
        let is_short = is_of_clock && next.from <= last.to.saturating_add(PAUSE_MAX);
        if within.start < within.end && !is_short {
            pauses.push(Pause { span: within, is_of_clock });
        }
        last = if last.to < next.to { *next } else { last };
    }
    pauses
}

/// A time to which clocks came back.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Doubled {
    /// From when to when, the end not included.
    pub span: Range<i64>,
    /// The epochs in it, in order, each with the first and the last instant that it stored.
    pub epochs: Vec<(u16, i64, i64)>,
}

/// Where what was stored later has earlier times, in order of time.
pub fn doubled(recorded: &[Recorded]) -> Vec<Doubled> {
    let mut known: Vec<(u16, &Recorded)> =
        recorded.iter().filter_map(|recorded| Some((recorded.epoch?, recorded))).collect();
    known.sort_by_key(|(epoch, recorded)| (*epoch, recorded.from));
    let mut spans: Vec<Range<i64>> = Vec::new();
    for of_epoch in known.chunk_by(|(one, _), (other, _)| one == other) {
        let (epoch, begin) = (of_epoch[0].0, of_epoch[0].1.from);
        // Of those before it, the few that are ahead of its begin.
        for (_, first) in known.iter().filter(|(before, first)| *before < epoch && begin <= first.to) {
            let near = first.from.saturating_sub(INVERTED_MAX);
            let then = of_epoch.iter().find(|(_, then)| near <= then.to && then.from <= first.to);
            spans.extend(then.map(|(_, then)| then.from.max(near)..first.to.saturating_add(1)));
        }
    }
    spans.sort_by_key(|span| span.start);
    let mut merged: Vec<Range<i64>> = Vec::new();
    for span in spans {
        match merged.last_mut().filter(|last| span.start <= last.end) {
            Some(last) => last.end = last.end.max(span.end),
            None => merged.push(span),
        }
    }
    let with_epochs = |span: Range<i64>| {
        let mut epochs: Vec<(u16, i64, i64)> = Vec::new();
        for (epoch, recorded) in known.iter().filter(|(_, of)| of.from < span.end && span.start <= of.to) {
            match epochs.last_mut().filter(|(last, ..)| last == epoch) {
                Some((.., to)) => *to = recorded.to.max(*to),
                None => epochs.push((*epoch, recorded.from, recorded.to)),
            }
        }
        Doubled { span, epochs }
    };
    merged.into_iter().map(with_epochs).collect()
}

/// A part of a span that is read in order of time, after the leg before it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Leg {
    /// From, inclusive; microseconds.
    pub from: i64,
    /// To, exclusive.
    pub to: i64,
    /// Of which epochs.
    pub epochs: Epochs,
    /// When its epoch began, where the leg before ends at a later time.
    pub began: Option<i64>,
    /// When its epoch ended, where the next leg begins at an earlier time.
    pub ended: Option<i64>,
}

impl Leg {
    /// A span in which the clock was not set back, or that goes by its time alone.
    pub fn whole(from: i64, to: i64) -> Leg {
        Leg { from, to, epochs: Epochs::All, began: None, ended: None }
    }
}

/// The epochs of what is read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Epochs {
    /// All: they follow each other in time.
    All,
    /// One, among others in that time.
    One(u16),
    /// All but these, which come later: the first of a time, and what no station recorded.
    Without(Vec<u16>),
}

impl Epochs {
    /// The condition in SQL for rows that were stored before an instant, which is its parameter.
    pub fn before(&self) -> String {
        match self {
            Epochs::All | Epochs::Without(_) => format!("utc < ?{}", self.condition()),
            Epochs::One(epoch) => format!("(coalesce(epoch, 0) < {epoch} OR (epoch = {epoch} AND utc < ?))"),
        }
    }

    /// The condition in SQL for rows.
    pub fn condition(&self) -> String {
        match self {
            Epochs::All => String::new(),
            Epochs::One(epoch) => format!(" AND epoch = {epoch}"),
            Epochs::Without(later) => {
                let later: Vec<String> = later.iter().map(u16::to_string).collect();
                format!(" AND coalesce(epoch, 0) NOT IN ({})", later.join(", "))
            }
        }
    }
}

/// How long legs are together, in microseconds: more than their span where the clock was set back.
pub fn micros(legs: &[Leg]) -> i64 {
    let micros = legs.iter().map(|Leg { from, to, began, ended, .. }| {
        (ended.unwrap_or(*to).min(*to) - began.unwrap_or(*from).max(*from)).max(0)
    });
    micros.sum()
}

/// The same in seconds.
pub fn seconds(legs: &[Leg]) -> f64 {
    micros(legs) as f64 / 1e6
}

/// The legs of a span, in the order in which what they hold was stored.
pub fn legs(doubled: &[Doubled], from: i64, to: i64) -> Vec<Leg> {
    let mut legs = Vec::new();
    let mut next = from;
    for Doubled { span, epochs } in doubled.iter().filter(|doubled| doubled.span.start < to && from < doubled.span.end)
    {
        let (start, end) = (span.start.max(from), span.end.min(to));
        if next < start {
            legs.push(Leg::whole(next, start));
        }
        for (place, (epoch, first, last)) in epochs.iter().enumerate() {
            let (of, began) = match place {
                0 => (Epochs::Without(epochs[1..].iter().map(|(epoch, ..)| *epoch).collect()), None),
                _ => (Epochs::One(*epoch), Some(*first)),
            };
            // Nothing goes back after the last of them.
            let ended = (place + 1 < epochs.len()).then_some(*last);
            legs.push(Leg { from: start, to: end, epochs: of, began, ended });
        }
        next = end;
    }
    if next < to {
        legs.push(Leg::whole(next, to));
    }
    legs
}

/// Samples of an epoch of the clock.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct StoredSamples {
    /// In order of time.
    pub samples: Vec<(TagId, Sample)>,
    /// Where the next epoch has begun to store.
    pub over: Option<Over>,
}

/// How an epoch of the clock gave way to the next one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Over {
    /// The last instant that was stored in it.
    pub ended: Timestamp,
    /// The next epoch in which anything was stored, and its first instant.
    pub next: (u16, Timestamp),
}

/// Samples that are not archived, of every tag that was ever stored.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Unarchived {
    /// Name and unit of their tags, as they were stored.
    pub tags: Vec<(String, String)>,
    /// The place of its tag in `tags`, and the sample; in order of time, and of storing.
    pub samples: Vec<(u16, Sample)>,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(epoch: u16, from: i64, to: i64) -> Recorded {
        Recorded { epoch: Some(epoch), from: from * HOUR, to: to * HOUR }
    }

    fn spans(recorded: &[Recorded]) -> Vec<(i64, i64, Vec<u16>)> {
        let epochs = |doubled: &Doubled| doubled.epochs.iter().map(|(epoch, ..)| *epoch).collect();
        let span = |doubled: &Doubled| (doubled.span.start / HOUR, (doubled.span.end - 1) / HOUR, epochs(doubled));
        doubled(recorded).iter().map(span).collect()
    }

    #[test]
    fn a_time_is_doubled_until_the_clock_has_caught_up() {
        assert_eq!(spans(&[of(0, 0, 5), of(0, 6, 9)]), []);
        assert_eq!(spans(&[of(0, 0, 5), of(1, 6, 9)]), [], "set forward");
        assert_eq!(spans(&[of(0, 0, 5), of(1, 4, 9)]), [(4, 5, vec![0, 1])]);
        assert_eq!(spans(&[of(0, 3, 5), of(1, 1, 2)]), [(1, 5, vec![0, 1])], "not caught up yet");
        assert_eq!(spans(&[of(0, 0, 8), of(1, 4, 5), of(2, 6, 9)]), [(4, 8, vec![0, 1, 2])]);
        // A year ahead for an hour: only there.
        let ahead = [of(0, 0, 5), of(1, 9_000, 9_001), of(2, 6, 99)];
        assert_eq!(spans(&ahead), []);
        assert_eq!(spans(&[ahead[0], ahead[1], of(2, 6, 9_010)]), [(8_976, 9_001, vec![1, 2])]);
        assert_eq!(spans(&[Recorded { epoch: None, ..of(0, 0, 9) }, of(1, 4, 5)]), []);
    }

    #[test]
    fn legs_follow_the_order_of_writing() {
        let doubled = doubled(&[of(0, 0, 5), of(1, 4, 9)]);
        let whole = Leg::whole;
        let got = legs(&doubled, 0, 9 * HOUR);
        let (first, then) = (Epochs::Without(vec![1]), Epochs::One(1));
        let end = 5 * HOUR + 1;
        assert_eq!(
            got,
            [
                whole(0, 4 * HOUR),
                Leg { from: 4 * HOUR, to: end, epochs: first, began: None, ended: Some(5 * HOUR) },
                Leg { from: 4 * HOUR, to: end, epochs: then, began: Some(4 * HOUR), ended: None },
                whole(end, 9 * HOUR),
            ]
        );
        assert_eq!(legs(&doubled, 0, 4 * HOUR), [whole(0, 4 * HOUR)]);
        assert_eq!(legs(&doubled, 6 * HOUR, 7 * HOUR), [whole(6 * HOUR, 7 * HOUR)]);
        assert_eq!(legs(&doubled, 7, 7), []);
    }

    #[test]
    fn pauses_are_what_no_station_recorded() {
        let all = [of(0, 1, 3), of(1, 2, 4), of(1, 6, 8)];
        let pauses = |all: &[Recorded], from: i64, to: i64| -> Vec<(i64, i64, bool)> {
            let pauses = super::pauses(all, from * HOUR..to * HOUR);
            pauses.iter().map(|of| (of.span.start / HOUR, of.span.end / HOUR, of.is_of_clock)).collect()
        };
        assert_eq!(pauses(&all, 0, 10), [(0, 1, false), (4, 6, false), (8, 10, false)]);
        assert_eq!(pauses(&all, 2, 7), [(4, 6, false)]);
        assert_eq!(pauses(&all, 2, 3), []);
        assert_eq!(pauses(&all, 5, 6), [(5, 6, false)]);
        assert_eq!(pauses(&[], 0, 1), [(0, 1, false)]);
        // Set forward by two hours, and by a minute.
        assert_eq!(pauses(&[of(0, 1, 3), of(1, 5, 9)], 4, 9), [(4, 5, true)]);
        let minute = Recorded { from: 3 * HOUR + 60_000_000, ..of(1, 3, 9) };
        assert_eq!(pauses(&[of(0, 1, 3), minute], 1, 9), []);
    }

    #[test]
    fn instants_near_each_other_are_one_time() {
        let (near, far) = (PAUSE_MAX, PAUSE_MAX + 1);
        let got = recorded(3, [0, near, 5, near + near, 3 * near + far].into_iter());
        let one = |from, to| Recorded { epoch: Some(3), from, to };
        assert_eq!(got, [one(0, 2 * near), one(3 * near + far, 3 * near + far)]);
    }
}
