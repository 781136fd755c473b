//! The units of measure that a tag may have: a closed list, so that `°C` and `degC` never stand side by side.

use super::{diagnostic::Problems, reader::At};

/// `true` for a unit that a tag may have.
pub(super) fn known(unit: &str) -> bool {
    KNOWN.contains(&unit)
}

/// The unit that a word of a manual means, in the spelling that a tag may have.
pub fn unit_of(word: &str) -> Option<&'static str> {
    let other = || OTHER_SPELLINGS.iter().find(|(other, _)| other.eq_ignore_ascii_case(word)).map(|(_, unit)| *unit);
    KNOWN.iter().find(|unit| **unit == word).copied().or_else(other)
}

/// The unit if it is known; else its problem, with the unit that was meant.
pub(super) fn check(unit: &At<String>, problems: &mut Problems) -> String {
    let written = unit.value.as_str();
    if !known(written) {
        let problem = problems.add(unit.at, format!("unknown unit `{written}`"));
        problem.label("not in the list of units");
        match OTHER_SPELLINGS.iter().find(|(other, _)| other.eq_ignore_ascii_case(written)) {
            Some((_, meant)) => problem.help(format!("did you mean `{meant}`?")),
            None => problem.suggest(written, KNOWN.iter().copied()),
        };
    }
    unit.value.clone()
}

#[rustfmt::skip]
const KNOWN: &[&str] = &[
    "", "%", "% FS", "% RH", "×",
    "°C", "°F", "K",
    "ms", "s", "min", "h", "d",
    "mV", "V", "kV", "mA", "A", "kA", "Ω", "kΩ",
    "W", "kW", "MW", "VA", "kVA", "MVA", "var", "kvar", "Mvar",
    "Wh", "kWh", "MWh", "VAh", "kVAh", "varh", "kvarh", "Mvarh",
    "Hz", "kHz", "rpm", "1/min", "°",
    "Pa", "hPa", "kPa", "MPa", "mbar", "bar", "psi", "mmH2O",
    "µm", "mm", "cm", "m", "km", "m²", "ml", "l", "hl", "m³",
    "mm/s", "m/s", "m/min", "l/s", "l/min", "l/h", "ml/min", "m³/h", "m³/s",
    "mg", "g", "kg", "t", "kg/s", "kg/h", "t/h", "kg/m³",
    "N", "kN", "Nm", "J", "kJ", "MJ",
    "pH", "ppm", "ppb", "mg/l", "g/l", "µS/cm", "mS/cm", "NTU", "lx", "dB",
];

/// Spellings that are too far from the unit for a guess by letters.
const OTHER_SPELLINGS: &[(&str, &str)] = &[
    ("C", "°C"),
    ("degC", "°C"),
    ("deg C", "°C"),
    ("celsius", "°C"),
    ("F", "°F"),
    ("degF", "°F"),
    ("sec", "s"),
    ("seconds", "s"),
    ("hours", "h"),
    ("percent", "%"),
    ("ohm", "Ω"),
    ("litre", "l"),
    ("liter", "l"),
    ("lpm", "l/min"),
    ("m3", "m³"),
    ("m2", "m²"),
    ("m3/h", "m³/h"),
    ("kg/m3", "kg/m³"),
    ("um", "µm"),
    ("uS/cm", "µS/cm"),
    ("%RH", "% RH"),
    ("%FS", "% FS"),
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::profile::diagnostic::Span;

    #[test]
    fn a_wrong_unit_names_the_right_one() {
        let check = |written: &str, expect: Option<&str>| {
            let mut problems = Problems::default();
            problems.source("a.toml", format!("{written}        "));
            let unit = At { value: written.to_owned(), at: Span { source: 0, start: 0, end: 1 } };
            super::check(&unit, &mut problems);
            let text = problems.finish(()).err().map(|errors| errors.to_string());
            match expect {
                None => assert_eq!(text, None, "{written}"),
                Some(meant) => assert!(text.is_some_and(|text| text.contains(&format!("`{meant}`"))), "{written}"),
            }
        };
        check("°C", None);
        check("", None);
        check("degc", Some("°C"));
        check("L/min", Some("l/min"));
        check("KW", Some("kW"));
        check("m3/h", Some("m³/h"));
    }
}
