//! The settings of the PXR4 with their places, limits and first values (register list 41001–41083 of the family).

/// Settings in each area.
pub const COUNT: usize = 83;

/// 41001: 1 saves all settings.
pub const FIX: usize = 0;
/// 41002: 0 PID, 1 fuzzy, 2 self-tuning.
pub const CONTROL: usize = 1;
/// 41003: set value on the face.
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
/// 41018: lower end of the range.
pub const RANGE_LOW: usize = 17;
/// 41019: upper end of the range.
pub const RANGE_HIGH: usize = 18;
/// 41024: input filter, 0.1 s.
pub const FILTER: usize = 23;
/// 41031: lower limit of SV.
pub const SV_LOW: usize = 30;
/// 41032: upper limit of SV.
pub const SV_HIGH: usize = 31;
/// 41057: SV of ramp/soak step 1; seven more follow.
pub const STEP_SV: usize = 56;
/// 41065: ramp time of step 1 in minutes, soak time, and so on for eight steps.
pub const STEP_TIMES: usize = 64;
/// 41082: 0 off, 1 run, 2 halt, 3 end.
pub const PROGRAM: usize = 81;
/// 41083: 0 steps 1–4, 1 steps 5–8, 2 all.
pub const PATTERN: usize = 82;

/// How a number converts between the two areas.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Meaning {
    /// A point of the range.
    Temperature,
    /// A difference of two points.
    Difference,
    /// The same number in both areas.
    Plain,
}

/// One setting.
#[derive(Debug, Clone, Copy)]
pub struct Row {
    /// Address in the internal area.
    pub place: u16,
    /// How it converts.
    pub meaning: Meaning,
    /// Least value that may be written.
    pub min: i16,
    /// Greatest value that may be written; equal to `min` where the rig does not let it change.
    pub max: i16,
    /// Value before anybody writes.
    pub first: i16,
}

/// The setting at a place, if one is known there.
pub fn row(place: usize) -> Option<&'static Row> {
    ROWS.iter().find(|row| usize::from(row.place) == place)
}

/// All settings as they are before anybody writes.
pub fn initial() -> [i16; COUNT] {
    let mut settings = [0; COUNT];
    for row in ROWS {
        settings[usize::from(row.place)] = row.first;
    }
    settings
}

use Meaning::{Difference, Plain, Temperature};

const fn r(place: u16, meaning: Meaning, min: i16, max: i16, first: i16) -> Row {
    Row { place, meaning, min, max, first }
}

/// Span 0.0–185.0 °C, Pt100, one decimal. SV rows keep the limits of 41031 and 41032, which stand elsewhere.
const ROWS: &[Row] = &[
    r(0, Plain, 0, 1, 0),
    r(1, Plain, 0, 2, 0),
    r(2, Temperature, 0, 1850, 700),
    r(3, Plain, 0, 1, 0),
    r(4, Plain, 0, 2, 0),
    r(5, Plain, 0, 9999, 50),
    r(6, Plain, 0, 32_000, 2400),
    r(7, Plain, 0, 9999, 600),
    r(8, Difference, 0, 925, 10),
    r(9, Plain, 0, 1000, 10),
    r(10, Plain, -500, 500, 0),
    r(15, Plain, 1, 1, 1),
    r(16, Plain, 0, 0, 0),
    r(17, Plain, 0, 0, 0),
    r(18, Plain, 1850, 1850, 1850),
    r(19, Plain, 1, 1, 1),
    r(23, Plain, 0, 9000, 0),
    r(30, Temperature, 0, 1850, 0),
    r(31, Temperature, 0, 1850, 1200),
    r(38, Plain, 0, 500, 0),
    r(56, Temperature, 0, 1850, 0),
    r(57, Temperature, 0, 1850, 0),
    r(58, Temperature, 0, 1850, 0),
    r(59, Temperature, 0, 1850, 0),
    r(60, Temperature, 0, 1850, 0),
    r(61, Temperature, 0, 1850, 0),
    r(62, Temperature, 0, 1850, 0),
    r(63, Temperature, 0, 1850, 0),
    r(64, Plain, 0, 5999, 0),
    r(65, Plain, 0, 5999, 0),
    r(66, Plain, 0, 5999, 0),
    r(67, Plain, 0, 5999, 0),
    r(68, Plain, 0, 5999, 0),
    r(69, Plain, 0, 5999, 0),
    r(70, Plain, 0, 5999, 0),
    r(71, Plain, 0, 5999, 0),
    r(72, Plain, 0, 5999, 0),
    r(73, Plain, 0, 5999, 0),
    r(74, Plain, 0, 5999, 0),
    r(75, Plain, 0, 5999, 0),
    r(76, Plain, 0, 5999, 0),
    r(77, Plain, 0, 5999, 0),
    r(78, Plain, 0, 5999, 0),
    r(79, Plain, 0, 5999, 0),
    r(80, Plain, 0, 15, 0),
    r(81, Plain, 0, 2, 0),
    r(82, Plain, 0, 2, 0),
];
