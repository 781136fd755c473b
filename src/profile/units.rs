//! Units of measure: prefixes, products and quotients of those that are known, in one spelling each, so that `°C` and `degC`
//! never stand side by side. Any other text is a unit too, of which nothing is known: it stays as it was written.

/// A unit that can have a prefix, a power, and stand in a product.
struct Atom {
    /// As it is shown, then what it is also called.
    spellings: &'static [&'static str],
    /// Which prefixes make sense; `""`: none.
    prefixes: &'static str,
}

const fn atom(spellings: &'static [&'static str], prefixes: &'static str) -> Atom {
    Atom { spellings, prefixes }
}

/// After `UCUM`, with the signs that instruments show.
#[rustfmt::skip]
const ATOMS: &[Atom] = &[
    atom(&["m", "metre", "metres", "meter", "meters"], "nµmcdk"), atom(&["g", "gram", "grams"], "nµmk"), atom(&["t", "ton", "tons", "tonne", "tonnes"], "k"),
    atom(&["s", "sec", "secs", "second", "seconds"], "nµm"), atom(&["min", "mins", "minute", "minutes"], ""),
    atom(&["h", "hr", "hrs", "hour", "hours"], ""), atom(&["d", "day", "days"], ""),
    atom(&["A", "amp", "amps", "ampere", "amperes"], "µmk"), atom(&["V", "volt", "volts"], "µmkM"), atom(&["Ω", "\u{2126}", "ohm", "ohms"], "µmkMG"),
    atom(&["W", "watt", "watts"], "µmkMG"), atom(&["VA"], "mkMG"), atom(&["var", "vars"], "mkMG"),
    atom(&["Wh"], "mkMGT"), atom(&["VAh"], "mkMGT"), atom(&["varh"], "mkMGT"), atom(&["Ah"], "mk"),
    atom(&["J", "joule", "joules"], "mkMGT"), atom(&["cal"], "kMG"), atom(&["BTU"], "kM"), atom(&["hp"], ""),
    atom(&["Hz", "hertz"], "mkMG"), atom(&["rpm", "r/min"], ""), atom(&["C"], ""), atom(&["F"], "pnµm"), atom(&["H", "henry"], "nµm"),
    atom(&["°C", "℃", "degC", "deg C", "deg. C", "celsius", "degrees celsius", "grad celsius"], ""),
    atom(&["°F", "℉", "degF", "deg F", "fahrenheit", "degrees fahrenheit"], ""), atom(&["K", "kelvin"], "m"),
    atom(&["°", "deg", "degree", "degrees"], ""), atom(&["rad"], "m"),
    atom(&["Pa", "pascal"], "mhkMG"), atom(&["bar"], "m"), atom(&["psi"], ""), atom(&["mmH2O", "mmH₂O"], ""), atom(&["inH2O", "inH₂O"], ""),
    atom(&["mmHg"], ""), atom(&["inHg"], ""), atom(&["atm"], ""),
    atom(&["l", "L", "litre", "litres", "liter", "liters"], "µmcdh"), atom(&["gal", "gallon", "gallons"], ""),
    atom(&["ft", "foot", "feet"], ""), atom(&["in", "inch", "inches"], ""), atom(&["mi", "mile", "miles"], ""), atom(&["lb", "lbs"], ""), atom(&["oz"], ""),
    atom(&["N", "newton"], "mkM"), atom(&["mol"], "µmk"), atom(&["S", "siemens"], "µm"), atom(&["lx", "lux"], "k"), atom(&["lm"], "k"),
    atom(&["cd"], "m"), atom(&["T", "tesla"], "µm"), atom(&["Gs", "gauss"], ""), atom(&["eq"], "m"),
    atom(&["%", "percent", "pct"], ""), atom(&["‰"], ""), atom(&["ppm"], ""), atom(&["ppb"], ""), atom(&["pH"], ""), atom(&["NTU"], ""), atom(&["dB"], ""),
    atom(&["dBm"], ""), atom(&["dBA", "dB(A)"], ""), atom(&["1"], ""), atom(&["×"], ""),
];

/// Units whose parts say less than the whole.
#[rustfmt::skip]
const WHOLE: &[(&str, &str)] = &[
    ("% RH", "% RH"), ("%RH", "% RH"), ("%rH", "% RH"), ("RH%", "% RH"), ("% FS", "% FS"), ("%FS", "% FS"),
    ("C", "°C"), ("F", "°F"), ("1/min", "1/min"), ("U/min", "1/min"), ("rev/min", "rpm"), ("Nm", "Nm"), ("kNm", "kNm"), ("N·m", "Nm"), ("N.m", "Nm"),
    ("lpm", "l/min"), ("l/m", "l/m"), ("lph", "l/h"), ("lps", "l/s"), ("gpm", "gal/min"), ("cfm", "ft³/min"), ("kph", "km/h"), ("kmh", "km/h"),
    ("mph", "mi/h"), ("cbm", "m³"), ("CBM/h", "m³/h"), ("sqm", "m²"),
];

/// The unit in its one spelling: `m3/hr` is `m³/h`, `kVArh` is `kvarh`; what is not known stays as it is.
pub fn of(written: &str) -> String {
    let written = written.trim();
    meant(written).unwrap_or_else(|| written.to_owned())
}

/// Is it made of what is known, in any spelling?
pub fn is_known(written: &str) -> bool {
    let written = written.trim();
    !written.is_empty() && meant(written).is_some()
}

fn meant(written: &str) -> Option<String> {
    let whole = WHOLE.iter().find(|(spelling, _)| *spelling == written).map(|(_, unit)| (*unit).to_owned());
    whole.or_else(|| product(written, &exactly)).or_else(|| product(written, &roughly))
}

/// A factor with prefix and power, by the rule for its letters.
type Spelled = dyn Fn(&str) -> Option<String>;

/// `kg/m³`, `W/m2`, `m³·h`: factors between signs.
fn product(written: &str, spelled: &Spelled) -> Option<String> {
    if let Some(unit) = power(written, spelled) {
        return Some(unit);
    }
    let mut unit = String::new();
    for piece in written.split_inclusive(['/', '·', '*']) {
        let sign = piece.chars().last().filter(|sign| "/·*".contains(*sign));
        let factor = sign.map_or(piece, |sign| &piece[..piece.len() - sign.len_utf8()]);
        unit += &power(factor.trim(), spelled)?;
        match sign {
            Some('/') => unit.push('/'),
            Some(_) => unit.push('·'),
            None => {}
        }
    }
    let ends = unit.ends_with(['/', '·']);
    (!ends && written.contains(['/', '·', '*'])).then_some(unit)
}

/// `m`, `m³`, `m3`, `m^3`.
fn power(written: &str, spelled: &Spelled) -> Option<String> {
    if let Some(unit) = spelled(written) {
        return Some(unit);
    }
    let (base, sign) = [('2', '²'), ('3', '³'), ('²', '²'), ('³', '³')].into_iter().find_map(|(digit, sign)| {
        let base = written.strip_suffix(digit)?;
        Some((base.strip_suffix('^').unwrap_or(base), sign))
    })?;
    spelled(base).filter(|unit| unit != "1").map(|unit| format!("{unit}{sign}"))
}

/// In the letters of a unit, or by one of its names.
fn exactly(written: &str) -> Option<String> {
    let named = |atom: &&Atom| atom.spellings.contains(&written);
    if let Some(atom) = ATOMS.iter().find(named) {
        return Some(atom.spellings[0].to_owned());
    }
    let prefix = written.chars().next()?;
    let (prefix, rest) = (if "uμ".contains(prefix) { 'µ' } else { prefix }, &written[prefix.len_utf8()..]);
    let with = |atom: &&Atom| atom.prefixes.contains(prefix) && atom.spellings.contains(&rest);
    ATOMS.iter().find(with).map(|atom| format!("{prefix}{}", atom.spellings[0]))
}

/// In other letters, where only one unit can be meant: `KW`, `kwh`, `VAR`, `Seconds`. Never milli for mega.
fn roughly(written: &str) -> Option<String> {
    // `In` is a nominal current, no inch.
    let same = |a: &str, b: &str| 2 <= a.chars().count() && a.to_lowercase() == b.to_lowercase() && b != "In";
    let named = |atom: &&Atom| atom.spellings.iter().any(|spelling| same(spelling, written));
    if let Some(unit) = exactly(written).or_else(|| ATOMS.iter().find(named).map(|atom| atom.spellings[0].to_owned())) {
        return Some(unit);
    }
    let prefix = written.chars().next()?;
    let rest = &written[prefix.len_utf8()..];
    // The case of `m` and `M` alone says which prefix is meant, and only in a unit that is written with care.
    let prefix = match prefix {
        'K' | 'k' => 'k',
        'u' | 'μ' | 'µ' => 'µ',
        'M' | 'G' if rest.starts_with(char::is_uppercase) => prefix,
        'M' if rest.starts_with("var") => prefix,
        _ => return None,
    };
    let with = |atom: &&Atom| {
        // Of the signs after kilo only one is a unit, in either case.
        let is_same = same(atom.spellings[0], rest) || prefix == 'k' && atom.spellings[0].eq_ignore_ascii_case(rest);
        atom.prefixes.contains(prefix) && is_same
    };
    ATOMS.iter().find(with).map(|atom| format!("{prefix}{}", atom.spellings[0]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_unit_has_one_spelling_however_it_is_written() {
        #[rustfmt::skip]
        let spellings = [
            ("°C", "°C"), ("degC", "°C"), ("C", "°C"), ("Celsius", "°C"), ("℃", "°C"), ("F", "°F"),
            ("m3/hr", "m³/h"), ("m3/h", "m³/h"), ("m^3/h", "m³/h"), ("L/min", "l/min"), ("lpm", "l/min"), ("gal/min", "gal/min"),
            ("kVArh", "kvarh"), ("kVAr", "kvar"), ("VAR", "var"), ("KW", "kW"), ("kw", "kW"), ("kwh", "kWh"), ("KWH", "kWh"), ("KVA", "kVA"),
            ("MVAr", "Mvar"), ("MWh", "MWh"), ("MWH", "MWh"), ("GWh", "GWh"), ("Watts", "W"), ("Volts", "V"), ("Amps", "A"),
            ("%/In", "%/In"), ("%In/s", "%In/s"), ("In", "In"), ("Seconds", "s"), ("seconds", "s"), ("sec", "s"), ("hours", "h"), ("Hours", "h"), ("Hz", "Hz"), ("HZ", "Hz"), ("percent", "%"),
            ("mg/m3", "mg/m³"), ("W/m2", "W/m²"), ("W/m²", "W/m²"), ("m³/d", "m³/d"), ("kg/m3", "kg/m³"), ("uS/cm", "µS/cm"), ("μS/cm", "µS/cm"),
            ("ohm", "Ω"), ("kohm", "kΩ"), ("mL", "ml"), ("msec", "ms"), ("mΩ", "mΩ"), ("MΩ", "MΩ"), ("Ah", "Ah"), ("mAh", "mAh"), ("GJ", "GJ"), ("ft", "ft"), ("inHg", "inHg"), ("%RH", "% RH"),
            ("1/min", "1/min"), ("rpm", "rpm"), ("RPM", "rpm"), ("Nm", "Nm"), ("mW", "mW"), ("MW", "MW"), ("mWh", "mWh"), (" kWh ", "kWh"), ("", ""),
            ("°", "°"), ("×", "×"), ("pH", "pH"), ("km/h", "km/h"), ("m/s²", "m/s²"), ("W/(m²K)", "W/(m²K)"),
        ];
        for (written, unit) in spellings {
            assert_eq!(of(written), unit, "{written}");
            assert_eq!(of(&of(written)), unit, "{written} once more");
        }
    }

    #[test]
    fn a_spelling_that_is_shown_never_changes() {
        // Histories keep units as they are shown.
        let shown = "% °C °F K ms s min h d mV V kV mA A kA Ω kΩ W kW MW VA kVA MVA var kvar Mvar Wh kWh MWh VAh kVAh varh kvarh \
                     Mvarh Hz kHz rpm 1/min ° Pa hPa kPa MPa mbar bar psi mmH2O µm mm cm m km m² ml l hl m³ mm/s m/s m/min l/s \
                     l/min l/h ml/min m³/h m³/s mg g kg t kg/s kg/h t/h kg/m³ N kN Nm J kJ MJ pH ppm ppb mg/l g/l µS/cm mS/cm NTU \
                     lx dB × GWh Ah kAh";
        for unit in shown.split_whitespace().chain(["% FS", "% RH"]) {
            assert_eq!((of(unit).as_str(), is_known(unit)), (unit, true), "{unit}");
        }
    }

    #[test]
    fn what_is_not_known_is_kept_and_never_made_another() {
        for unit in ["imp", "furlong", "mwh", "MA", "x10", "min/", "kk", "m4", "STOP", "/h", "·", "Mm", "impulses"] {
            assert_eq!((of(unit).as_str(), is_known(unit)), (unit, false), "{unit}");
        }
        for unit in ["Ah", "GJ", "m³/d", "ft", "KW", "degC", "kg·m²"] {
            assert!(is_known(unit), "{unit}");
        }
        assert!(!is_known(""));
    }
}
