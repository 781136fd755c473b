//! What a cell says that its number is multiplied by, in each of the ways in which lists say it.

use super::{
    columns::Column,
    row::differ,
    words::{is_marked, length_of, number_of, power_of_ten, unit_with_factor},
};
use crate::profile::{is_known_unit, unit_of};

/// No register has a greater power of ten; what is greater is a factor or a code.
const POWER_MAX: i8 = 10;
/// What a unit is a part of, as the first word of it.
const PARTS: [(&[&str], f64); 3] = [
    (&["tenth", "tenths", "zehntel", "dixièmes"], 0.1),
    (&["hundredth", "hundredths", "hundertstel", "centièmes"], 0.01),
    (&["thousandth", "thousandths", "tausendstel", "millièmes"], 0.001),
];

/// What a cell makes of its row where its column means this: a number, by which the value is multiplied, or a length.
pub fn effect(column: Column, cell: &str) -> Option<f64> {
    let power =
        |power: i8| Some(power).filter(|power| power.abs() <= POWER_MAX).map(|power| power_of_ten(power.into()));
    match column {
        Column::Scale => number_of(cell).filter(|number| *number != 0.0),
        Column::Divisor => by_divisor(cell),
        Column::Exponent => power(cell.parse().ok()?),
        Column::Places => power(i8::try_from(places_of(cell)?).ok()?.checked_neg()?),
        Column::Decimals => places_of(cell).map(|_| 1.0),
        Column::Length | Column::Bytes => length_of(cell, column == Column::Bytes).map(f64::from),
        _ => None,
    }
}

/// `10` divides; `/10` and `1/10` say it themselves. What multiplies is no divisor.
fn by_divisor(cell: &str) -> Option<f64> {
    let number = number_of(cell).filter(|number| *number != 0.0)?;
    let factor = if cell.contains(['/', '÷', ':']) { number } else { 1.0 / number };
    let is_times = cell.contains(['x', 'X', '*', '×']) || is_marked(cell) && 1.0 < factor.abs();
    Some(factor).filter(|_| !is_times)
}

/// The digits behind the point: `2`, `FIX2`, `0.00`, `###.##`, and the `TEMP` of SMA.
pub fn places_of(cell: &str) -> Option<u8> {
    let upper = cell.trim().to_uppercase();
    if upper == "TEMP" {
        return Some(1);
    }
    if let Ok(places) = upper.strip_prefix("FIX").unwrap_or(&upper).parse() {
        return Some(places);
    }
    let is_digits = |text: &str, digits: &[char]| text.chars().all(|sign| digits.contains(&sign));
    let Some((whole, places)) = upper.rsplit_once(['.', ',']) else {
        return (!upper.is_empty() && is_digits(&upper, &['#', '0'])).then_some(0);
    };
    // `#,##0` groups thousands.
    let is_group = places.len() == 3 && !upper.contains('.');
    let is_pattern = is_digits(whole, &['#', '0', 'X', ',', '.']) && is_digits(places, &['#', '0', 'X']);
    u8::try_from(places.len()).ok().filter(|_| is_pattern && !places.is_empty() && !is_group)
}

/// Does it say by a pattern how many digits stand behind the point? That of a display may be the same.
pub fn is_pattern(cell: &str) -> bool {
    cell.contains(['.', ',']) && places_of(cell).is_some()
}

/// Is it the word of a format that has no decimals, such as `ENUM`?
pub fn is_kind_of_format(cell: &str) -> bool {
    let is_word = cell.starts_with(char::is_alphabetic)
        && cell.chars().all(|sign| sign.is_alphanumeric() || "_- ".contains(sign));
    is_word && places_of(cell).is_none()
}

/// Are they one number, but for how its digits are kept?
pub fn is_close(one: f64, other: f64) -> bool {
    (one - other).abs() <= 1e-9 * one.abs()
}

/// The factor that several cells say, each of which may say the same in its own way; `Err` where they differ.
pub fn one_of(all: &[(f64, &str)]) -> Result<Option<f64>, String> {
    let mut said = all.iter().filter(|(factor, _)| *factor != 1.0);
    let Some((first, cell)) = said.next() else { return Ok(all.first().map(|(factor, _)| *factor)) };
    match said.find(|(factor, _)| !is_close(*factor, *first)) {
        Some((_, other)) => Err(differ(cell, other)),
        None => Ok(Some(*first)),
    }
}

/// A unit, and the factor beside it: `[0.1 V]`, `W [0.1]`, `V×10⁻¹`, `tenths of °C`, and what stands in front of one.
pub fn of_unit(cell: &str) -> Result<(f64, String), String> {
    let cell = without_brackets(cell.trim());
    if let Some((part, unit)) = part_of(cell) {
        return Ok((part, unit_of(&unit)));
    }
    let behind = || {
        let open = cell.strip_suffix([']', ')']).unwrap_or(cell);
        let (unit, number) = open.rsplit_once(['[', '(', '×', '*']).or_else(|| open.rsplit_once(" x"))?;
        Some((number_of(&raised(number.trim()))?, unit.trim()))
    };
    // A unit times ten may as well be that of a number that was multiplied.
    let is_part = |(factor, unit): &(f64, &str)| *factor != 0.0 && factor.abs() <= 1.0 && is_known_unit(unit);
    match behind().filter(is_part) {
        Some((factor, unit)) => Ok((factor, unit_of(unit))),
        None => unit_with_factor(cell),
    }
}

/// `tenths of °C`, `Zehntel °C`: the part and the unit.
fn part_of(cell: &str) -> Option<(f64, String)> {
    let mut words = cell.split_whitespace();
    let first = words.next()?.to_lowercase();
    let (_, part) = PARTS.iter().find(|(words, _)| words.contains(&first.as_str()))?;
    let unit = words.skip_while(|word| ["of", "a", "de"].contains(word)).collect::<Vec<_>>().join(" ");
    Some((*part, unit))
}

/// What stands in a pair of brackets.
fn without_brackets(cell: &str) -> &str {
    let pairs = [('[', ']'), ('(', ')')];
    let inner = pairs.into_iter().find_map(|(open, close)| cell.strip_prefix(open)?.strip_suffix(close));
    inner.filter(|inner| !inner.contains(['[', '(', ']', ')'])).map_or(cell, str::trim)
}

/// `10⁻¹` as `10^-1`.
fn raised(number: &str) -> String {
    let plain = |sign: char| match sign {
        '⁻' | '−' => '-',
        sign => {
            "⁰¹²³⁴⁵⁶⁷⁸⁹".chars().zip('0'..='9').find(|(raised, _)| *raised == sign).map_or(sign, |(_, digit)| digit)
        }
    };
    let power = number.strip_prefix("10").filter(|power| power.chars().any(|sign| plain(sign) != sign));
    // A text may have lost what raises it.
    match power.or(number.strip_prefix("10").filter(|power| power.starts_with('-'))) {
        Some(power) => format!("10^{}", power.chars().map(plain).collect::<String>()),
        None => number.to_owned(),
    }
}
