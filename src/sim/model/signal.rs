//! Generates the simulated values of tags, step by step. Pure: the time of a step and the other values are arguments.

use std::time::Duration;

use crate::plant::{
    def::TagId,
    number::to_u64,
    simulate::{Check, Motion, Operation, Pace, Simulate, Source, Test},
};
use crate::sim::random::{GOLDEN, splitmix64};

/// Generates the value of one tag.
#[derive(Debug, Clone, PartialEq)]
pub struct SignalGenerator {
    /// The value without noise and without the grain of its register.
    pub exact: f64,
    /// Since when it has not been 0, for a pulse.
    on_since: Option<Duration>,
    seed: u64,
}

/// One step of time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    /// Plant time since the device was switched on.
    pub at: Duration,
    /// Length of the step.
    pub dt: Duration,
}

impl SignalGenerator {
    /// A value at its start. The name seeds oscillation and noise: tags differ, runs do not.
    pub fn new(name: &str, start: f64) -> SignalGenerator {
        // FNV-1a.
        let seed = name.bytes().fold(0xCBF2_9CE4_8422_2325, |hash: u64, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01B3)
        });
        SignalGenerator { exact: start, on_since: None, seed }
    }

    /// Moves by one step; `values` gives the value of another tag. Returns the register value.
    pub fn step(&mut self, how: &Simulate, step: Step, values: &impl Fn(TagId) -> Option<f64>) -> f64 {
        let case = how.cases.iter().find(|case| holds(&case.when, values));
        if let Some(case) = case {
            self.exact = case.value;
        } else if let Some(motion) = &how.motion {
            self.exact = self.moved(motion, step, values);
        }
        if let Some([low, high]) = how.range {
            self.exact = self.exact.max(low).min(high);
        }
        if let Some(pulse) = how.pulse {
            self.exact = self.pulsed(pulse, step.at);
        }
        self.exact + how.noise * noise(self.seed, step.at)
    }

    fn moved(&self, motion: &Motion, step: Step, values: &impl Fn(TagId) -> Option<f64>) -> f64 {
        let seconds = step.dt.as_secs_f64();
        let runs = holds(&motion.when, values);
        let target = match (&motion.source, runs) {
            (Source::Integral { of, time_base }, true) => {
                let grown = values(*of).unwrap_or(0.0) * motion.gain * seconds / time_base.as_secs_f64();
                return self.exact + grown;
            }
            (_, false) => motion.idle,
            (Source::Oscillation { range, period }, true) => Some(oscillate(*range, *period, step.at, self.seed)),
            (Source::Of(operation, tags), true) => made(*operation, tags, values),
        };
        // A source that is not a number now (a tag of another device) leaves the value where it is.
        let Some(target) = target else { return self.exact };
        let target = if runs { target * motion.gain + motion.offset } else { target };
        match motion.pace {
            Pace::AtOnce => target,
            Pace::Rate(rate) => self.exact + (target - self.exact).clamp(-rate * seconds, rate * seconds),
            Pace::Lag(lag) => self.exact + (target - self.exact) * (1.0 - (-seconds / lag.as_secs_f64()).exp()),
        }
    }

    fn pulsed(&mut self, length: Duration, at: Duration) -> f64 {
        if self.exact == 0.0 {
            self.on_since = None;
            return 0.0;
        }
        let since = *self.on_since.get_or_insert(at);
        if at.saturating_sub(since) < length { self.exact } else { 0.0 }
    }
}

/// Whether all of these are so. What cannot be asked is not so.
fn holds(checks: &[Check], values: &impl Fn(TagId) -> Option<f64>) -> bool {
    checks.iter().all(|check| {
        let Some(value) = values(check.tag) else { return false };
        let value = match check.field {
            Some((low, bits)) => ((to_u64(value) >> low) & (u64::MAX >> (64 - u32::from(bits)))) as f64,
            None => value,
        };
        match &check.test {
            Test::On => value != 0.0,
            Test::Is(wanted) => wanted.contains(&value),
            Test::Above(limit) => value > *limit,
            Test::Below(limit) => value < *limit,
        }
    })
}

fn made(operation: Operation, tags: &[TagId], values: &impl Fn(TagId) -> Option<f64>) -> Option<f64> {
    let of: Vec<f64> = tags.iter().map(|tag| values(*tag)).collect::<Option<_>>()?;
    let (first, rest) = of.split_first()?;
    let rest_sum: f64 = rest.iter().sum();
    Some(match operation {
        Operation::Sum => first + rest_sum,
        Operation::Mean => (first + rest_sum) / of.len() as f64,
        Operation::Product => of.iter().product(),
        Operation::Difference => first - rest_sum,
        Operation::Quotient => rest.first().filter(|below| **below != 0.0).map_or(0.0, |below| first / below),
        Operation::Reactive => (first * first - rest.iter().map(|part| part * part).sum::<f64>()).max(0.0).sqrt(),
        Operation::Angle => first.clamp(-1.0, 1.0).acos().to_degrees(),
    })
}

/// Two swings of different length, which meet again only after a long time.
fn oscillate([low, high]: [f64; 2], period: Duration, at: Duration, seed: u64) -> f64 {
    let phase = |shift: u32| f64::from(((seed >> shift) & 0xFFFF) as u16) / 65_536.0;
    let turn = |length: f64, phase: f64| (std::f64::consts::TAU * (at.as_secs_f64() / length + phase)).sin();
    let period = period.as_secs_f64();
    let both = 0.6 * turn(period, phase(0)) + 0.4 * turn(period * 0.377, phase(16));
    low + (high - low) * (both + 1.0) / 2.0
}

/// A pseudo-random number between −1 and 1, the same in every run.
fn noise(seed: u64, at: Duration) -> f64 {
    let bits = splitmix64(seed ^ to_u64(at.as_millis()).wrapping_mul(GOLDEN));
    2.0 * ((bits >> 11) as f64 / 9_007_199_254_740_992.0) - 1.0
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::plant::simulate::Case;

    const A: TagId = TagId(0);
    const B: TagId = TagId(1);

    fn motion(source: Source) -> Motion {
        Motion { source, gain: 1.0, offset: 0.0, pace: Pace::AtOnce, when: Vec::new(), idle: None }
    }

    fn moving(motion: Motion) -> Simulate {
        Simulate { motion: Some(motion), ..Simulate::default() }
    }

    fn follow(pace: Pace) -> Motion {
        Motion { pace, ..motion(Source::Of(Operation::Sum, vec![A])) }
    }

    /// The value after this many seconds in steps of 0.1 s, with A and B held.
    fn after(how: &Simulate, start: f64, seconds: u64, a: f64, b: f64) -> f64 {
        let mut generator = SignalGenerator::new("D.T", start);
        let dt = Duration::from_millis(100);
        (0..seconds * 10).fold(start, |_, count| {
            let step = Step { at: dt * count as u32, dt };
            generator.step(how, step, &|tag| Some(if tag == A { a } else { b }))
        })
    }

    fn check(how: &Simulate, start: f64, seconds: u64, (a, b): (f64, f64), expect: f64) {
        let found = after(how, start, seconds, a, b);
        assert!((found - expect).abs() < 1e-6, "{how:?} after {seconds} s: {found}, expected {expect}");
    }

    #[test]
    fn a_value_follows_by_its_rate_or_its_lag() {
        let ramp = moving(follow(Pace::Rate(5.0)));
        check(&ramp, 0.0, 4, (50.0, 0.0), 20.0);
        check(&ramp, 0.0, 60, (50.0, 0.0), 50.0);
        check(&ramp, 50.0, 4, (0.0, 0.0), 30.0);
        let lag = moving(follow(Pace::Lag(Duration::from_secs(10))));
        check(&lag, 20.0, 10, (120.0, 0.0), 20.0 + 100.0 * (1.0 - (-1f64).exp()));
        let scaled = moving(Motion { gain: 8.0, offset: 1.0, ..follow(Pace::AtOnce) });
        check(&scaled, 0.0, 1, (50.0, 0.0), 401.0);
        check(&Simulate { range: Some([0.0, 400.0]), ..scaled }, 0.0, 1, (50.0, 0.0), 400.0);
    }

    #[test]
    fn a_gate_holds_or_sends_the_value_to_its_idle_place() {
        let on = vec![Check { tag: B, field: None, test: Test::On }];
        let gated = Motion { when: on, ..follow(Pace::Rate(1.0)) };
        check(&moving(gated.clone()), 3.0, 5, (10.0, 1.0), 8.0);
        check(&moving(gated.clone()), 3.0, 5, (10.0, 0.0), 3.0);
        check(&moving(Motion { idle: Some(1.0), ..gated }), 3.0, 5, (10.0, 0.0), 1.0);
    }

    #[test]
    fn a_case_wins_over_the_motion_and_none_leaves_the_value() {
        let run = Check { tag: B, field: Some((4, 2)), test: Test::Is(vec![2.0, 3.0]) };
        let fast = Check { tag: A, field: None, test: Test::Above(10.0) };
        let case = Case { when: vec![run, fast], value: 7.0 };
        let cases = Simulate { cases: vec![case], ..Simulate::default() };
        check(&cases, 1.0, 1, (11.0, 32.0), 7.0);
        check(&cases, 1.0, 1, (10.0, 32.0), 1.0);
        check(&cases, 1.0, 1, (11.0, 16.0), 1.0);
        let both = Simulate { cases: cases.cases, ..moving(follow(Pace::AtOnce)) };
        check(&both, 1.0, 1, (11.0, 48.0), 7.0);
        check(&both, 1.0, 1, (11.0, 0.0), 11.0);
    }

    #[test]
    fn power_adds_up_to_energy() {
        let time_base = Duration::from_secs(3600);
        let energy = moving(Motion { gain: 0.001, ..motion(Source::Integral { of: A, time_base }) });
        check(&energy, 100.0, 1800, (6000.0, 0.0), 103.0);
    }

    #[test]
    fn values_are_made_of_others() {
        let of = |operation, expect| {
            check(&moving(motion(Source::Of(operation, vec![A, B]))), 0.0, 1, (5.0, 4.0), expect);
        };
        of(Operation::Sum, 9.0);
        of(Operation::Mean, 4.5);
        of(Operation::Product, 20.0);
        of(Operation::Difference, 1.0);
        of(Operation::Quotient, 1.25);
        of(Operation::Reactive, 3.0);
        check(&moving(motion(Source::Of(Operation::Quotient, vec![A, B]))), 0.0, 1, (5.0, 0.0), 0.0);
        check(&moving(motion(Source::Of(Operation::Angle, vec![A]))), 0.0, 1, (0.5, 0.0), 60.0);
    }

    #[test]
    fn a_command_resets_itself_after_its_time() {
        let pulse = Simulate { pulse: Some(Duration::from_secs(5)), ..Simulate::default() };
        check(&pulse, 1.0, 5, (0.0, 0.0), 1.0);
        check(&pulse, 1.0, 6, (0.0, 0.0), 0.0);
    }

    proptest! {
        #[test]
        fn oscillation_stays_in_its_range_and_repeats_in_every_run(
            low in -100.0..100.0f64, width in 0.1..100.0f64, at_s in 0..1_000_000u64, name in "[A-Z]{1,4}",
        ) {
            let range = [low, low + width];
            let how = moving(motion(Source::Oscillation { range, period: Duration::from_secs(60) }));
            let step = Step { at: Duration::from_secs(at_s), dt: Duration::from_millis(100) };
            let value = |_| SignalGenerator::new(&name, 0.0).step(&how, step, &|_| None);
            prop_assert!((low - 1e-9..=low + width + 1e-9).contains(&value(0)));
            prop_assert_eq!(value(0), value(1));
        }
    }

    #[test]
    fn oscillation_uses_its_range_and_noise_stays_small() {
        let range = [10.0, 20.0];
        let how = moving(motion(Source::Oscillation { range, period: Duration::from_secs(60) }));
        let noisy = Simulate { noise: 0.5, ..Simulate::default() };
        let step = |count: u64| Step { at: Duration::from_secs(count), dt: Duration::from_millis(100) };
        let values = |how: &Simulate| -> Vec<f64> {
            (0..600).map(|count| SignalGenerator::new("D.T", 5.0).step(how, step(count), &|_| None)).collect()
        };
        let spread = |values: &[f64]| {
            (values.iter().copied().fold(f64::MAX, f64::min), values.iter().copied().fold(f64::MIN, f64::max))
        };
        let (low, high) = spread(&values(&how));
        assert!(low < 12.0 && 18.0 < high, "{low} to {high}");
        let (low, high) = spread(&values(&noisy));
        assert!((4.5..4.6).contains(&low) && (5.4..=5.5).contains(&high), "{low} to {high}");
    }
}
