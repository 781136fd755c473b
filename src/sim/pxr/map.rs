//! The settings of the PXR4 with their places, limits and first values (register list 41001–41083 of the family).

use std::ops::Range;

/// Settings in each area.
pub const COUNT: usize = 83;

/// 41001: 1 saves all settings.
pub const FIX: usize = 0;
/// 41002: 0 PID, 1 fuzzy, 2 self-tuning.
pub const CONTROL: usize = 1;
/// 41003: setpoint on the front panel.
pub const SV: usize = 2;
/// 41004: 1 standby.
pub const STANDBY: usize = 3;
/// 41005: 1 tunes at SV, 2 below it.
pub const TUNE: usize = 4;
/// 41006: proportional band, 0.1 % of the range.
pub const P: usize = 5;
/// 41007: integral time, 0.1 s.
pub const I: usize = 6;
/// 41008: derivative time, 0.1 s.
pub const D: usize = 7;
/// 41009: hysteresis of on/off control.
pub const HYSTERESIS: usize = 8;
/// 41014, a guess: bit 0 the output on a broken sensor (0 off, 1 full), bit 1 the action (0 heats, 1 cools).
pub const ACTION: usize = 13;
/// 41017: 0 °C, 1 °F.
pub const UNIT: usize = 16;
/// 41018: lower end of the range.
pub const RANGE_LOW: usize = 17;
/// 41019: upper end of the range.
pub const RANGE_HIGH: usize = 18;
/// 41020: decimals of every temperature.
pub const DECIMALS: usize = 19;
/// 41024: input filter, 0.1 s.
pub const FILTER: usize = 23;
/// 41025–41027, guesses: types of the three alarms.
pub const ALARM_TYPE: usize = 24;
/// 41031: lower limit of SV.
pub const SV_LOW: usize = 30;
/// 41032: upper limit of SV.
pub const SV_HIGH: usize = 31;
/// 41033–41038, guesses: lower and upper set point of alarm 1, of alarm 2, of alarm 3.
pub const ALARM_POINT: usize = 32;
/// 41039: least current of a heater that is not burnt out, 0.1 A; 0 is off.
pub const HEATER_BREAK: usize = 38;
/// 41040–41042, guesses: hysteresis of the three alarms.
pub const ALARM_HYSTERESIS: usize = 39;
/// 41043–41045, guesses: ON-delay of the three alarms in seconds.
pub const ALARM_DELAY: usize = 42;
/// 41046–41048, guesses: 1 keeps the alarm until 0 is written.
pub const ALARM_LATCH: usize = 45;
/// 41057: SV of ramp/soak step 1; seven more follow.
pub const STEP_SV: usize = 56;
/// 41065: ramp time of step 1 in minutes, soak time, and so on for eight steps.
pub const STEP_TIMES: usize = 64;
/// 41081: what happens at the end, when stopped, and at power-on; see the bits in [`super::program`].
pub const MODE: usize = 80;
/// 41082: 0 off, 1 run, 2 halt, 3 end.
pub const PROGRAM: usize = 81;
/// 41083: 0 steps 1–4, 1 steps 5–8, 2 all.
pub const PATTERN: usize = 82;

/// How a number converts between the two areas, and when unit or decimals change.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Meaning {
    /// A point of the range.
    Temperature,
    /// A difference of two points.
    Difference,
    /// An end of the range: in display units in both areas, as it defines the other one.
    End,
    /// A point of the range or a distance from SV, as the type of its alarm says.
    AlarmPoint,
    /// The same number always.
    Plain,
}

/// One setting, or some of a kind that stand together.
#[derive(Debug, Clone)]
pub struct Row {
    /// Addresses in the internal area.
    pub places: Range<usize>,
    /// How it converts.
    pub meaning: Meaning,
    /// Least plain value that may be written; temperatures have limits that are settings themselves.
    pub min: i16,
    /// Greatest plain value that may be written; equal to `min` where the rig does not let it change.
    pub max: i16,
    /// Default value, in °C with one decimal.
    pub first: i16,
}

/// The setting at a place, if one is known there.
pub fn row(place: usize) -> Option<&'static Row> {
    ROWS.iter().find(|row| row.places.contains(&place))
}

pub fn rows() -> &'static [Row] {
    ROWS
}

/// The default settings.
pub fn initial() -> [i16; COUNT] {
    let mut settings = [0; COUNT];
    for row in ROWS {
        settings[row.places.clone()].fill(row.first);
    }
    settings
}

use Meaning::{AlarmPoint, Difference, End, Plain, Temperature};

const fn one(place: usize, meaning: Meaning, min: i16, max: i16, first: i16) -> Row {
    some(place, 1, meaning, min, max, first)
}

const fn some(place: usize, count: usize, meaning: Meaning, min: i16, max: i16, first: i16) -> Row {
    Row { places: place..place + count, meaning, min, max, first }
}

/// Span 0.0–185.0 °C, Pt100, one decimal; alarm 1 above SV + 5 °C.
const ROWS: &[Row] = &[
    one(FIX, Plain, 0, 1, 0),
    one(CONTROL, Plain, 0, 2, 0),
    one(SV, Temperature, 0, 0, 700),
    one(STANDBY, Plain, 0, 1, 0),
    one(TUNE, Plain, 0, 2, 0),
    one(P, Plain, 0, 9999, 50),
    one(I, Plain, 0, 32_000, 2400),
    one(D, Plain, 0, 9999, 600),
    one(HYSTERESIS, Difference, 0, 0, 10),
    one(9, Plain, 0, 1000, 10),
    one(10, Plain, -500, 500, 0),
    one(ACTION, Plain, 0, 3, 0),
    one(15, Plain, 1, 1, 1),
    one(UNIT, Plain, 0, 1, 0),
    one(RANGE_LOW, End, 0, 0, 0),
    one(RANGE_HIGH, End, 0, 0, 1850),
    one(DECIMALS, Plain, 0, 2, 1),
    one(FILTER, Plain, 0, 9000, 0),
    one(ALARM_TYPE, Plain, 0, 31, 5),
    some(ALARM_TYPE + 1, 2, Plain, 0, 31, 0),
    one(SV_LOW, Temperature, 0, 0, 0),
    one(SV_HIGH, Temperature, 0, 0, 1200),
    one(ALARM_POINT, AlarmPoint, 0, 0, 0),
    one(ALARM_POINT + 1, AlarmPoint, 0, 0, 50),
    some(ALARM_POINT + 2, 4, AlarmPoint, 0, 0, 0),
    one(HEATER_BREAK, Plain, 0, 500, 0),
    some(ALARM_HYSTERESIS, 3, Difference, 0, 0, 10),
    some(ALARM_DELAY, 3, Plain, 0, 9999, 0),
    some(ALARM_LATCH, 3, Plain, 0, 1, 0),
    some(STEP_SV, 8, Temperature, 0, 0, 0),
    some(STEP_TIMES, 16, Plain, 0, 5999, 0),
    one(MODE, Plain, 0, 15, 0),
    one(PROGRAM, Plain, 0, 2, 0),
    one(PATTERN, Plain, 0, 2, 0),
];
