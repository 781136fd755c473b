//! What lies between two instants, each by its own setting of the clock: of batches and control runs; pure.
//!
//! ```text
//!   epoch 0   ├────────[─────────┤                  begins in a time that is doubled
//!   epoch 1            ├──────────────]────────┤    and ends after the clock was set back
//!   legs               ╞═════════╡
//!                      ╞══════════════╡
//! ```

use std::{cmp::Ordering, ops::Range, time::Duration};

use super::recorded::{Doubled, Epochs, Leg, legs, micros};

/// An instant in microseconds since 1970, after the epoch of the clock that showed it.
pub type Position = (u16, i64);

/// The legs between two positions.
pub fn between(doubled: &[Doubled], from: Position, to: Position) -> Vec<Leg> {
    let around = |at: i64| doubled.iter().find(|of| of.span.contains(&at));
    let (first, last) = (around(from.1), around(to.1));
    let begin = first.map_or(from.1, |of| of.span.start);
    let end = last.map_or(to.1, |of| of.span.end);
    let cut = |leg: Leg| {
        let of = around(leg.from).filter(|_| leg.epochs != Epochs::All);
        // In a doubled time the epoch comes first; all else follows by time.
        let order = |(epoch, _): Position, own: Option<&Doubled>| match (of, own) {
            (Some(of), Some(own)) if of.span == own.span => leg_place(of, &leg).cmp(&place_of(of, epoch)),
            _ => Ordering::Equal,
        };
        let start = match order(from, first) {
            Ordering::Less => return None,
            Ordering::Equal => leg.from.max(from.1),
            Ordering::Greater => leg.from,
        };
        let end = match order(to, last) {
            Ordering::Less => leg.to,
            Ordering::Equal => leg.to.min(to.1),
            Ordering::Greater => return None,
        };
        (start < end).then_some(Leg { from: start, to: end, ..leg })
    };
    legs(doubled, begin, end).into_iter().filter_map(cut).collect()
}

/// The legs that lie together so long before a position, in microseconds.
pub fn back(doubled: &[Doubled], to: Position, lasts: i64) -> Vec<Leg> {
    let spans: i64 = doubled.iter().map(|of| of.span.end - of.span.start).sum();
    let begin = to.1.saturating_sub(lasts).saturating_sub(spans);
    let (mut rest, mut found) = (lasts, Vec::new());
    for leg in between(doubled, (0, begin), to).into_iter().rev() {
        let own = extent(&leg);
        if rest <= 0 {
            break;
        }
        let from = if own.end - own.start <= rest { leg.from } else { own.end - rest };
        rest -= (own.end - own.start).max(0);
        found.push(Leg { from, ..leg });
    }
    found.reverse();
    found
}

/// Legs that follow each other, those as one that are of the same epochs.
pub fn joined(legs: Vec<Leg>) -> Vec<Leg> {
    let mut joined: Vec<Leg> = Vec::new();
    for leg in legs {
        match joined.last_mut().filter(|last| last.to == leg.from && last.epochs == leg.epochs) {
            Some(last) => last.to = leg.to,
            None => joined.push(leg),
        }
    }
    joined
}

/// How long legs are together.
pub fn time(legs: &[Leg]) -> Duration {
    Duration::from_micros(u64::try_from(micros(legs)).unwrap_or_default())
}

/// What of legs lies in a period: in it is what the clock showed to be in it.
pub fn clip(legs: &[Leg], period: &Range<i64>) -> Vec<Leg> {
    let clipped =
        legs.iter().map(|leg| Leg { from: leg.from.max(period.start), to: leg.to.min(period.end), ..leg.clone() });
    clipped.filter(|leg| leg.from < leg.to).collect()
}

/// The last position of a period that ends at an instant.
pub fn end_of_period(doubled: &[Doubled], end: i64) -> Position {
    let of = doubled.iter().find(|of| of.span.contains(&end));
    (of.and_then(|of| Some(of.epochs.last()?.0)).unwrap_or(u16::MAX), end)
}

/// Is a position no later than another one?
pub fn is_by(doubled: &[Doubled], at: Position, end: Position) -> bool {
    match doubled.iter().find(|of| of.span.contains(&end.1) && of.span.contains(&at.1)) {
        Some(of) => (place_of(of, at.0), at.1) <= (place_of(of, end.0), end.1),
        None => at.1 <= end.1,
    }
}

/// A period with the whole of the times in it that are doubled at its edges.
pub fn widened(doubled: &[Doubled], period: Range<i64>) -> Range<i64> {
    let around = |at: i64| doubled.iter().find(|of| of.span.contains(&at));
    let start = around(period.start).map_or(period.start, |of| of.span.start);
    start..around(period.end).map_or(period.end, |of| of.span.end)
}

/// In which its station had this setting of the clock.
fn extent(leg: &Leg) -> Range<i64> {
    leg.began.map_or(leg.from, |began| began.max(leg.from))..leg.ended.map_or(leg.to, |ended| ended.min(leg.to))
}

fn leg_place(of: &Doubled, leg: &Leg) -> usize {
    match leg.epochs {
        Epochs::One(epoch) => place_of(of, epoch),
        Epochs::All | Epochs::Without(_) => 0,
    }
}

/// Where an epoch stands among those of a doubled time; one that stored nothing there, after those before it.
fn place_of(of: &Doubled, epoch: u16) -> usize {
    of.epochs.iter().rposition(|(known, ..)| *known <= epoch).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::history::{
        recorded::{Recorded, doubled, seconds},
        tiers::HOUR,
    };

    /// A clock that was set back from 5 to 4 o'clock.
    fn set_back() -> Vec<Doubled> {
        let of = |epoch, from: i64, to: i64| Recorded { epoch: Some(epoch), from: from * HOUR, to: to * HOUR };
        doubled(&[of(0, 0, 5), of(1, 4, 9)])
    }

    fn hours(legs: &[Leg]) -> Vec<(f64, f64)> {
        let hours = |at: i64| (at as f64 / HOUR as f64 * 100.0).round() / 100.0;
        legs.iter().map(|leg| (hours(leg.from), hours(leg.to))).collect()
    }

    fn at(hour: f64) -> i64 {
        (hour * HOUR as f64) as i64
    }

    #[test]
    fn legs_lie_between_what_each_clock_showed() {
        let doubled = set_back();
        for (from, to, expect, lasts) in [
            ((0, 4.5), (1, 4.25), vec![(4.5, 5.0), (4.0, 4.25)], 0.75),
            ((0, 4.5), (1, 6.0), vec![(4.5, 5.0), (4.0, 5.0), (5.0, 6.0)], 2.5),
            ((1, 4.5), (1, 6.0), vec![(4.5, 5.0), (5.0, 6.0)], 1.5),
            ((0, 3.0), (0, 4.5), vec![(3.0, 4.0), (4.0, 4.5)], 1.5),
            ((0, 3.0), (1, 4.5), vec![(3.0, 4.0), (4.0, 5.0), (4.0, 4.5)], 2.5),
            ((0, 3.0), (1, 6.0), vec![(3.0, 4.0), (4.0, 5.0), (4.0, 5.0), (5.0, 6.0)], 4.0),
            ((0, 4.25), (0, 4.5), vec![(4.25, 4.5)], 0.25),
            ((1, 4.25), (1, 4.5), vec![(4.25, 4.5)], 0.25),
            ((1, 6.0), (1, 7.0), vec![(6.0, 7.0)], 1.0),
            ((1, 4.5), (0, 4.25), vec![], 0.0),
            // An epoch that stored nothing there is later than those before it.
            ((7, 4.5), (7, 6.0), vec![(4.5, 5.0), (5.0, 6.0)], 1.5),
        ] {
            let legs = between(&doubled, (from.0, at(from.1)), (to.0, at(to.1)));
            assert_eq!(hours(&legs), expect, "{from:?} to {to:?}");
            assert!((seconds(&legs) / 3_600.0 - lasts).abs() < 1e-6, "{from:?} to {to:?}: {}", seconds(&legs));
            if !legs.is_empty() {
                let back = back(&doubled, (to.0, at(to.1)), at(lasts));
                assert!((seconds(&back) / 3_600.0 - lasts).abs() < 1e-6, "{to:?} less {lasts}: {:?}", hours(&back));
                assert_eq!(hours(&back).first(), expect.first(), "{to:?} less {lasts}");
            }
        }
        assert_eq!(hours(&between(&[], (0, at(4.0)), (9, at(6.0)))), [(4.0, 6.0)]);
    }

    #[test]
    fn periods_share_what_their_clocks_showed() {
        let doubled = set_back();
        let legs = between(&doubled, (0, at(4.5)), (1, at(6.0)));
        let parts = [at(0.0)..at(4.75), at(4.75)..at(5.5), at(5.5)..at(9.0)].map(|period| clip(&legs, &period));
        assert_eq!(hours(&parts[0]), [(4.5, 4.75), (4.0, 4.75)]);
        assert_eq!(hours(&parts[1]), [(4.75, 5.0), (4.75, 5.0), (5.0, 5.5)]);
        let sum: f64 = parts.iter().map(|part| seconds(part)).sum();
        assert!((sum - seconds(&legs)).abs() < 1e-3, "{sum}");
        assert_eq!(end_of_period(&doubled, at(4.5)), (1, at(4.5)));
        assert_eq!(end_of_period(&doubled, at(6.0)), (u16::MAX, at(6.0)));
        for (position, end, expect) in [
            ((0, 4.9), (1, 4.5), true),
            ((1, 4.4), (1, 4.5), true),
            ((1, 4.6), (1, 4.5), false),
            ((1, 4.1), (0, 4.5), false),
            ((0, 6.1), (u16::MAX, 6.0), false),
            ((0, 4.9), (u16::MAX, 6.0), true),
        ] {
            let (position, end) = ((position.0, at(position.1)), (end.0, at(end.1)));
            assert_eq!(is_by(&doubled, position, end), expect, "{position:?} {end:?}");
        }
        assert_eq!(widened(&doubled, at(3.0)..at(4.5)), at(3.0)..at(5.0) + 1);
        assert_eq!(widened(&doubled, at(4.5)..at(6.0)), at(4.0)..at(6.0));
    }
}
