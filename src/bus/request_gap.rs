//! Units that do not hear a request which follows their own answer too soon: how long they are left alone after each exchange.
//!
//! ```text
//!   answer ──quiet──> request ──> silence     several times, and no answer after so short a quiet meanwhile,
//!   answer ──quiet──────────────> answer      but after longer ones: they are left alone twice as long
//! ```

use std::{collections::BTreeMap, time::Duration};

use crate::plant::line_finding::DeviceFinding;

/// This many requests in a row that came soon after an answer must be lost, as no line loses them by chance …
const LOST_MIN: u32 = 8;
/// … or, where a gap is kept already, this many …
const LOST_AGAIN_MIN: u32 = 4;
/// … and this many that came later be answered.
const HEARD_MIN: u32 = 3;
/// The shortest gap that is tried, and the longest: what is lost after that is lost for other reasons, and so was what was lost before.
const GAP_MIN: Duration = Duration::from_millis(10);
const GAP_MAX: Duration = Duration::from_millis(500);

/// What is known of the units of a line. All spans are of real time; moments are spans since the line began.
#[derive(Debug, Clone, Default)]
pub struct RequestGaps {
    units: BTreeMap<u8, Hearing>,
}

#[derive(Debug, Clone, Copy, Default)]
struct Hearing {
    /// As the plant file says.
    stated: Duration,
    found: Duration,
    /// No gap has helped.
    is_vain: bool,
    /// When it has answered last.
    answered_at: Option<Duration>,
    /// Since nothing was answered after so short a quiet: requests lost, the longest quiet before one, and requests answered.
    lost: u32,
    longest_lost: Duration,
    heard: u32,
}

impl RequestGaps {
    /// The plant file says so.
    pub fn state(&mut self, unit: u8, gap: Duration) {
        self.units.entry(unit).or_default().stated = gap;
    }

    /// Remembers what was found of a unit earlier.
    pub fn recall(&mut self, unit: u8, found: DeviceFinding) {
        if let DeviceFinding::RequestGap { gap } = found {
            self.units.entry(unit).or_default().found = gap.min(GAP_MAX);
        }
    }

    /// How long a unit is left alone after each exchange.
    pub fn of(&self, unit: u8) -> Duration {
        self.units.get(&unit).map_or(Duration::ZERO, |hearing| hearing.stated.max(hearing.found))
    }

    /// More than the plant file says, if that was found.
    pub fn found(&self, unit: u8) -> Option<Duration> {
        self.units.get(&unit).filter(|hearing| hearing.stated < hearing.found).map(|hearing| hearing.found)
    }

    /// A request was answered.
    pub fn on_answer(&mut self, unit: u8, sent_at: Duration, now: Duration) {
        let hearing = self.units.entry(unit).or_default();
        match hearing.quiet(sent_at) {
            // It hears what comes as soon, or nearly: what was lost was lost for other reasons.
            Some(quiet) if quiet <= hearing.longest_lost * 5 / 4 => hearing.forget(),
            Some(_) => hearing.heard = hearing.heard.saturating_add(1),
            None => {}
        }
        hearing.answered_at = Some(now);
    }

    /// A request was not answered: the gap that is kept from now on, if this shows that a longer one is needed.
    pub fn on_silence(&mut self, unit: u8, sent_at: Duration) -> Option<Duration> {
        let hearing = self.units.entry(unit).or_default();
        let quiet = hearing.quiet(sent_at).filter(|quiet| *quiet <= GAP_MAX)?;
        hearing.lost = hearing.lost.saturating_add(1);
        hearing.longest_lost = hearing.longest_lost.max(quiet);
        let lost_min = if hearing.found.is_zero() { LOST_MIN } else { LOST_AGAIN_MIN };
        if hearing.lost < lost_min || hearing.heard < HEARD_MIN || hearing.is_vain {
            return None;
        }
        let wanted = (hearing.longest_lost * 2).max(GAP_MIN);
        hearing.is_vain = GAP_MAX < wanted;
        hearing.found = if hearing.is_vain { Duration::ZERO } else { wanted };
        hearing.forget();
        (!hearing.is_vain).then_some(hearing.found)
    }
}

impl Hearing {
    /// How long after its last answer a request came; `None` for one that was under way by then, and before the first.
    fn quiet(&self, sent_at: Duration) -> Option<Duration> {
        sent_at.checked_sub(self.answered_at?)
    }

    fn forget(&mut self) {
        (self.lost, self.longest_lost, self.heard) = (0, Duration::ZERO, 0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Asks a unit that is deaf for `deaf` ms after its answers, and loses some requests by their number; gives the gap and the answers.
    fn asked(deaf: u64, is_lost: impl Fn(u64) -> bool) -> (Duration, u32) {
        let ms = Duration::from_millis;
        let (mut gaps, mut now, mut heard_from, mut answers) = (RequestGaps::default(), 0, 0, 0);
        for n in 1..=2_000 {
            // Three requests one after another, each second.
            if n % 3 == 0 {
                now = (now / 1_000 + 1) * 1_000;
            }
            let sent = now + gaps.of(1).as_millis() as u64 + 2 + n * 7 % 5;
            if sent < heard_from || is_lost(n) {
                now = sent + 300;
                gaps.on_silence(1, ms(sent));
            } else {
                (now, answers) = (sent + 10, answers + 1);
                heard_from = now + deaf;
                gaps.on_answer(1, ms(sent), ms(now));
            }
        }
        (gaps.of(1), answers)
    }

    #[test]
    fn a_unit_that_needs_a_gap_is_given_one() {
        for deaf in [8, 20, 50, 100, 200] {
            let (gap, answers) = asked(deaf, |_| false);
            let deaf = Duration::from_millis(deaf);
            assert!(deaf <= gap + Duration::from_millis(6) && gap <= deaf * 5 / 2, "deaf for {deaf:?}: {gap:?}");
            assert!(1_900 < answers, "deaf for {deaf:?}: {answers}");
        }
    }

    #[test]
    fn a_unit_that_hears_at_once_is_given_none_however_much_is_lost() {
        for lossy in [2, 3, 5, 10, 50] {
            let by_chance = |n: u64| (n.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 33).is_multiple_of(lossy);
            assert_eq!(asked(0, by_chance).0, Duration::ZERO, "one in {lossy} is lost");
        }
        assert_eq!(asked(0, |n| n % 2 == 0).0, Duration::ZERO, "each second request is lost");
    }

    #[test]
    fn what_the_plant_file_says_is_kept() {
        let mut gaps = RequestGaps::default();
        gaps.state(1, Duration::from_millis(30));
        assert_eq!((gaps.of(1), gaps.of(2), gaps.found(1)), (Duration::from_millis(30), Duration::ZERO, None));
    }
}
