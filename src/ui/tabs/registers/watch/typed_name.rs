//! A name as it is typed, with what makes a value of its register.

use crate::ui::tabs::prelude::*;
use crate::{
    plant::tag::{ByteOrder, DataType, Encoding},
    profile::unit_of,
    register_map::named::Named,
};

/// `NAME [TYPE] [ORDER] [SCALE] [UNIT]`, each known by its form.
pub(super) fn named(text: &str, plain: Named) -> Result<Named, String> {
    let mut words = text.split_whitespace();
    let name = words.next().ok_or_else(|| t!("expected a name").to_owned())?.to_owned();
    let mut named = Named { name, unit: String::new(), ..plain };
    for word in words {
        let kind = word.parse::<DataType>().ok();
        let order = ByteOrder::ALL.into_iter().find(|order| order.word().eq_ignore_ascii_case(word));
        match (kind, order, word.parse::<f64>()) {
            (Some(kind), ..) if named.table.is_bits() && kind != DataType::Bool => {
                return Err(t!("{word}: a bit holds 0 or 1", word));
            }
            (Some(kind), ..) => {
                let decimals = if kind.encoding() == Encoding::Float { 3 } else { 0 };
                (named.kind, named.decimals) = (kind, decimals);
            }
            (_, Some(order), _) => named.order = order,
            (.., Ok(scale)) if scale.is_finite() && scale != 0.0 => {
                let digits = word.split_once('.').map_or(0, |(_, digits)| digits.trim_end_matches('0').len());
                let decimals = crate::plant::number::to_u8(digits.min(6)).max(named.decimals);
                (named.scale, named.decimals) = (scale, decimals);
            }
            (.., Ok(_)) => return Err(t!("found `{word}`, expected a scale other than 0", word)),
            (None, None, Err(_)) if is_like_type(word) => return Err(t!("`{word}` is not a type", word)),
            (None, None, Err(_)) if named.unit.is_empty() => named.unit = unit_of(word),
            (None, None, Err(_)) => return Err(t!("found `{word}`, expected one unit at the end", word)),
        }
    }
    Ok(named)
}

/// Was it meant for a type: one of their names with another number?
fn is_like_type(word: &str) -> bool {
    let stem = |word: &str| {
        let end = word.find(|letter: char| letter.is_ascii_digit() || letter == '(').unwrap_or(word.len());
        word[..end].to_ascii_lowercase()
    };
    let numbered = stem(word).len() < word.len();
    let texts = ["string", "cstring", "chars", "version", "epoch", "ipv", "eui"].map(str::to_owned);
    numbered
        && DataType::NUMBERS.into_iter().map(|kind| stem(&kind.to_string())).chain(texts).any(|of| of == stem(word))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::tag::Table;

    #[test]
    fn a_name_has_its_parts_in_any_order_and_wrong_ones_are_refused() {
        let plain = Named::new(Table::Holding, 5, DataType::U16, ByteOrder::Abcd, "40006");
        let parse = |text: &str| named(text, plain.clone());
        let sv = parse("SV int16 0.1 °C").expect("a name");
        assert_eq!((sv.kind, sv.scale, sv.decimals, sv.unit.as_str()), (DataType::I16, 0.1, 1, "°C"));
        let energy = parse("energy CDAB float32 kWh").expect("a name");
        assert_eq!((energy.kind, energy.order, energy.unit.as_str()), (DataType::F32, ByteOrder::Cdab, "kWh"));
        assert_eq!(parse("T degC").map(|named| named.unit), Ok("°C".to_owned()));
        assert_eq!(parse("run").map(|named| named.kind), Ok(DataType::U16));
        assert!(parse("SV 0").is_err() && parse("SV a b").is_err());
        for word in
            ["string(10)", "chars(6)", "epoch32", "clock_words", "ipv4", "ipv6", "eui48", "version(1)", "time_decimal"]
        {
            assert_eq!(
                parse(&format!("N {word}")).map(|named| named.kind),
                Ok(word.parse().expect("a type")),
                "{word}"
            );
        }
        for word in ["int99", "uint17", "float31", "string(900)", "chars()", "bcd8", "ipv5", "epoch64"] {
            assert_eq!(parse(&format!("N {word}")), Err(format!("`{word}` is not a type")));
        }
        assert_eq!(parse("A m3").map(|named| named.unit), Ok("m³".to_owned()));
        let bit = Named { table: Table::Coil, kind: DataType::Bool, ..plain.clone() };
        assert!(named("run float32", bit).is_err());
    }
}
