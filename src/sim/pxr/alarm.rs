//! The three alarms: absolute, deviation and zone, with hold, latch, hysteresis and ON-delay.
//!
//! The data sheet confirms the families; the numbers of the types are those remembered of the family, and where the
//! settings stand in the registers is a guess (see `map`).
use crate::plant::number::to_usize;

/// What a set point is compared with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Base {
    /// The range: the set point is a temperature.
    Zero,
    /// SV: the set point is a distance from it, upwards for the upper one, downwards for the lower one.
    Sv,
}

/// What a type means.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shape {
    /// What the upper set point counts from; `None` if the type has none.
    pub high: Option<Base>,
    /// The same for the lower one.
    pub low: Option<Base>,
    /// One set point, the upper, serves both sides.
    pub shared: bool,
    /// The alarm is on between the set points, not beyond them.
    pub zone: bool,
    /// After power-on and after a new SV the alarm waits until it would have been off once.
    pub hold: bool,
}

/// The shape of a type number; 0 and unknown numbers are no alarm.
pub fn shape(number: i16) -> Option<Shape> {
    use Base::{Sv, Zero};
    let one = |high, low, hold| Shape { high, low, shared: false, zone: false, hold };
    let two = |pair: i16, zone, hold| {
        let (high, low) = [(Zero, Zero), (Sv, Sv), (Zero, Sv), (Sv, Zero)][to_usize(pair.rem_euclid(4))];
        Shape { high: Some(high), low: Some(low), shared: false, zone, hold }
    };
    Some(match number {
        1 | 3 => one(Some(Zero), None, number == 3),
        2 | 4 => one(None, Some(Zero), number == 4),
        5 | 8 => one(Some(Sv), None, number == 8),
        6 | 9 => one(None, Some(Sv), number == 9),
        7 | 10 => Shape { shared: true, ..one(Some(Sv), Some(Sv), number == 10) },
        11 => Shape { shared: true, zone: true, ..one(Some(Sv), Some(Sv), false) },
        12..=15 => two(number - 12, true, false),
        16..=23 => two(number - 16, false, number >= 20),
        24..=31 => two(number - 24, true, number >= 28),
        _ => return None,
    })
}

/// The settings of one alarm, in °C and K.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Setup {
    /// The type; `None` is no alarm.
    pub shape: Option<Shape>,
    /// Lower set point.
    pub low: f64,
    /// Upper set point.
    pub high: f64,
    /// An alarm goes off this far behind the point where it came on.
    pub hysteresis_k: f64,
    /// It comes on after this time.
    pub delay_s: f64,
    /// Once on it stays, until latching is switched off.
    pub latch: bool,
}

/// One alarm as it stands.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Alarm {
    on: bool,
    present: bool,
    since_s: f64,
    /// It was off since power-on, new SV or new type.
    free: bool,
    seen: Option<(Shape, f64)>,
}

impl Alarm {
    /// Whether it is on.
    pub fn on(&self) -> bool {
        self.on
    }

    /// One sample. `sv_set_c` is SV as it was set: a ramp moves SV without beginning the hold again.
    pub fn step(&mut self, dt_s: f64, setup: &Setup, pv_c: f64, sv_c: f64, sv_set_c: f64) {
        let Some(shape) = setup.shape else {
            *self = Alarm::default();
            return;
        };
        if self.seen.replace((shape, sv_set_c)) != Some((shape, sv_set_c)) {
            self.free = !shape.hold;
        }
        self.present = beyond(shape, setup, pv_c, sv_c, self.present);
        self.free |= !self.present;
        let wanted = self.present && self.free;
        let waited_s = if wanted { self.since_s + dt_s } else { 0.0 };
        self.since_s = waited_s.min(setup.delay_s + dt_s);
        // The first sample of an alarm without delay brings it on.
        self.on = wanted && self.since_s > setup.delay_s || self.on && setup.latch;
    }
}

/// Whether PV is where the alarm is; `was` decides within the hysteresis.
fn beyond(shape: Shape, setup: &Setup, pv_c: f64, sv_c: f64, was: bool) -> bool {
    let slack_k = if was { setup.hysteresis_k } else { 0.0 };
    let high_c = shape.high.map(|from| setup.high + if from == Base::Sv { sv_c } else { 0.0 });
    let low = if shape.shared { setup.high } else { setup.low };
    let low_c = shape.low.map(|from| if from == Base::Sv { sv_c - low } else { low });
    if shape.zone {
        high_c.is_some_and(|c| pv_c < c + slack_k) && low_c.is_some_and(|c| pv_c > c - slack_k)
    } else {
        high_c.is_some_and(|c| pv_c > c - slack_k) || low_c.is_some_and(|c| pv_c < c + slack_k)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SV_C: f64 = 70.0;

    fn setup(number: i16, low: f64, high: f64) -> Setup {
        Setup { shape: shape(number), low, high, hysteresis_k: 1.0, delay_s: 0.0, latch: false }
    }

    /// The states of the alarm after each PV, a second apart, as a row of 0 and 1.
    fn states(setup: Setup, pv_c: &[f64]) -> String {
        let mut alarm = Alarm::default();
        let mut state = |pv_c: &f64| {
            alarm.step(1.0, &setup, *pv_c, SV_C, SV_C);
            if alarm.on() { '1' } else { '0' }
        };
        pv_c.iter().map(&mut state).collect()
    }

    #[test]
    fn every_family_comes_and_goes_where_it_should() {
        let sweep = [40.0, 60.5, 66.0, 70.0, 74.0, 79.5, 90.0, 79.5, 74.0, 70.0, 66.0, 60.5, 40.0];
        let check = |number, low, high, expect| {
            assert_eq!(states(setup(number, low, high), &sweep), expect, "type {number}");
        };
        check(0, 60.0, 80.0, "0000000000000");
        check(1, 60.0, 80.0, "0000001100000");
        check(2, 60.0, 80.0, "1100000000001");
        check(5, 0.0, 5.0, "0000011100000");
        check(6, 5.0, 0.0, "1100000000011");
        check(7, 0.0, 5.0, "1100011100011");
        check(11, 0.0, 5.0, "0011100011100");
        check(12, 60.0, 80.0, "0111110111110");
        check(13, 5.0, 15.0, "0011110111100");
        check(14, 5.0, 80.0, "0011110111100");
        check(15, 60.0, 5.0, "0111100011110");
        check(16, 60.0, 80.0, "1100001100001");
        check(17, 5.0, 5.0, "1100011100011");
        check(18, 5.0, 80.0, "1100001100011");
        check(19, 60.0, 5.0, "1100011100001");
        check(24, 60.0, 80.0, "0111110111110");
        check(32, 60.0, 80.0, "0000000000000");
    }

    #[test]
    fn a_held_alarm_waits_until_it_was_off_once() {
        for number in [4, 9, 10, 20, 21, 22, 23] {
            let states = states(
                setup(number, if number == 4 || number == 20 || number == 23 { 60.0 } else { 5.0 }, 85.0),
                &[40.0, 70.0, 40.0],
            );
            let expect = if number == 10 { "000" } else { "001" };
            assert_eq!(states, expect, "type {number}");
        }
        assert_eq!(states(setup(10, 0.0, 5.0), &[40.0, 70.0, 40.0]), "001");
        assert_eq!(states(setup(3, 0.0, 80.0), &[90.0, 70.0, 90.0]), "001");
        assert_eq!(states(setup(8, 0.0, 5.0), &[90.0, 70.0, 90.0]), "001");
        assert_eq!(states(setup(28, 60.0, 80.0), &[70.0, 90.0, 70.0]), "001");
        // A new SV begins the waiting again, a moving one does not.
        let mut alarm = Alarm::default();
        let held = setup(9, 5.0, 0.0);
        for (pv_c, sv_c, sv_set_c, on) in [
            (70.0, 70.0, 70.0, false),
            (60.0, 70.0, 70.0, true),
            (60.0, 80.0, 80.0, false),
            (80.0, 80.0, 80.0, false),
            (70.0, 81.0, 80.0, true),
        ] {
            alarm.step(1.0, &held, pv_c, sv_c, sv_set_c);
            assert_eq!(alarm.on(), on, "PV {pv_c} SV {sv_c} set {sv_set_c}");
        }
    }

    #[test]
    fn the_delay_is_waited_out_and_begins_again() {
        let delayed = Setup { delay_s: 3.0, ..setup(1, 0.0, 80.0) };
        assert_eq!(states(delayed, &[90.0, 90.0, 90.0, 90.0, 70.0, 90.0, 90.0]), "0001000");
    }

    #[test]
    fn a_latched_alarm_stays_until_latching_is_switched_off() {
        let latched = Setup { latch: true, ..setup(1, 0.0, 80.0) };
        let mut alarm = Alarm::default();
        for (setup, pv_c, on) in
            [(latched, 90.0, true), (latched, 70.0, true), (setup(1, 0.0, 80.0), 70.0, false), (latched, 70.0, false)]
        {
            alarm.step(1.0, &setup, pv_c, SV_C, SV_C);
            assert_eq!(alarm.on(), on);
        }
    }
}
