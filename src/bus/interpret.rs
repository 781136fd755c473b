//! Words as the numbers they may mean, and which meaning is likely.

use super::codec;
use crate::plant::{
    exact::{Exact, digits},
    number::to_f32,
    tag::{ByteOrder, DataType, Point, Table},
    text_value,
};

/// Words as a number of a type; `None` where there are too few of them or they hold none.
pub fn number(kind: DataType, order: ByteOrder, words: &[u16]) -> Option<Exact> {
    let point = Point { table: Table::Holding, address: 0, kind, order, field: None };
    codec::decode(point, words.get(..usize::from(kind.words()))?)
}

/// Words as text: `·` for what cannot be printed.
pub fn text(words: &[u16]) -> String {
    let letters = words.iter().flat_map(|word| word.to_be_bytes());
    letters.map(|byte| if (0x20..0x7F).contains(&byte) { char::from(byte) } else { text_value::UNPRINTABLE }).collect()
}

/// A number in at most `most` characters: whole numbers whole, others with what fits.
pub fn short(value: impl Into<Exact>, most: usize) -> String {
    let exact = value.into();
    let all = exact.rest().map(|_| digits(exact, None));
    if let Some(all) = all.filter(|all| all.len() <= most) {
        return all;
    }
    let value = exact.near();
    let plain = if value.fract() == 0.0 && value.abs() < 1e15 { format!("{value:.0}") } else { format!("{value}") };
    let readable = value == 0.0 || (1e-4..1e9).contains(&value.abs());
    if plain.len() <= most && (readable || value.fract() == 0.0) {
        return plain;
    }
    let cut = (0..7).rev().map(|decimals| format!("{value:.decimals$}")).find(|text| text.len() <= most);
    let powers = || (0..5).rev().map(|decimals| format!("{value:.decimals$e}")).find(|text| text.len() <= most);
    if readable { cut.or_else(powers) } else { powers() }.unwrap_or_else(|| "#".repeat(most))
}

/// A float of two words as short as it is still exact.
pub fn float(order: ByteOrder, words: &[u16], most: usize) -> Option<String> {
    let value = to_f32(number(DataType::F32, order, words)?.near());
    let plain = format!("{value}");
    Some(if plain.len() <= most { plain } else { short(f64::from(value), most) })
}

/// First and last second that a time stamp of a controller is taken for: the years 2000 to 2099, UNIX seconds.
const STAMPS: std::ops::Range<i64> = 946_684_800..4_102_444_800;

/// What words may mean as a moment, with its kind; only those that are plausible. 32-bit UNIX seconds in both orders
/// of words, and the clock that many controllers hold: year, month, day, hour, minute, second in a register each.
pub fn stamps(words: &[u16]) -> Vec<(&'static str, String)> {
    let unix = |order: ByteOrder| {
        let [high, low] = match order {
            ByteOrder::Abcd => *words.first_chunk::<2>()?,
            _ => words.first_chunk::<2>().map(|[low, high]| [*high, *low])?,
        };
        let seconds = i64::from(high) << 16 | i64::from(low);
        let stamp = STAMPS.contains(&seconds).then(|| jiff::Timestamp::from_second(seconds).ok())??;
        Some((order.word(), stamp.to_string()))
    };
    let clock = || {
        let [year, month, day, hour, minute, second] = words.first_chunk::<6>()?.map(|word| i16::try_from(word).ok());
        let small = |number: Option<i16>| number.and_then(|number| i8::try_from(number).ok());
        let year = year.filter(|year| (2000..2100).contains(year))?;
        let date = jiff::civil::Date::new(year, small(month)?, small(day)?).ok()?;
        let time = jiff::civil::Time::new(small(hour)?, small(minute)?, small(second)?, 0).ok()?;
        Some(("Y M D h m s", format!("{date} {time}")))
    };
    [unix(ByteOrder::Abcd), unix(ByteOrder::Cdab), clock()].into_iter().flatten().collect()
}

/// The byte orders in which two words may be a float, the usual first: its size is one that people measure in, and as
/// whole numbers they look like nothing. A small whole number beside a zero is no float in any order.
pub fn float_orders(words: &[u16; 2]) -> impl Iterator<Item = ByteOrder> + use<> {
    let words = *words;
    let [a, b] = words;
    // A measured value fills its mantissa, or ends in a whole word of zeros behind a full one.
    let small = |word: u16| word < 0x2000 && word.swap_bytes() < 0x2000;
    let whole = small(a) && small(b);
    let plausible = move |order: &ByteOrder| {
        let value = number(DataType::F32, *order, &words).map_or(0.0, Exact::near).abs();
        let swapped = matches!(order, ByteOrder::Badc | ByteOrder::Dcba);
        // A whole number below 256 has an empty high byte, which no swapped float of a usual size has in its first word.
        let full = !swapped || (a & 0xFF != 0 && a >> 8 != 0 && b & 0xFF != 0);
        !whole && full && if swapped { (1e-2..1e6).contains(&value) } else { (1e-3..1e7).contains(&value) }
    };
    [ByteOrder::Abcd, ByteOrder::Cdab, ByteOrder::Badc, ByteOrder::Dcba].into_iter().filter(plausible)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_float_is_recognised_in_its_order_and_whole_numbers_are_not() {
        for (words, expect) in [
            ([0x42D1, 0x6353], Some(ByteOrder::Abcd)),
            ([0x6353, 0x42D1], Some(ByteOrder::Cdab)),
            ([0xD142, 0x5363], Some(ByteOrder::Badc)),
            ([0x42C8, 0x0000], Some(ByteOrder::Abcd)),
            ([700, 0], None),
            ([0, 700], None),
            ([66, 0], None),
            ([700, 600], None),
            ([1, 10], None),
            ([0, 0], None),
        ] {
            assert_eq!(float_orders(&words).next(), expect, "{words:04X?}");
        }
    }

    #[test]
    fn numbers_are_cut_to_their_column() {
        assert_eq!(short(700.0, 11), "700");
        assert_eq!(short(104.69, 11), "104.69");
        assert_eq!(short(1.0 / 3.0, 6), "0.3333");
        assert_eq!(short(1.0 / 3.0, 11), "0.333333", "never more than six decimals");
        assert_eq!(short(2.75e-37, 8), "2.75e-37");
        let counter = number(DataType::U64, ByteOrder::Abcd, &[0xFFFF; 4]).expect("a number");
        assert_eq!((short(counter, 20).as_str(), short(counter, 8).as_str()), ("18446744073709551615", "1.845e19"));
        assert_eq!(float(ByteOrder::Abcd, &[0x42D1, 0x6353], 9).as_deref(), Some("104.69399"));
        assert_eq!(text(&[0x4142, 0x0043]), "AB·C");
    }

    #[test]
    fn a_plausible_time_stamp_is_shown_and_no_other() {
        let all =
            |words: &[u16]| stamps(words).into_iter().map(|(kind, text)| format!("{kind} {text}")).collect::<Vec<_>>();
        assert_eq!(all(&[0x386D, 0x4380]), ["ABCD 2000-01-01T00:00:00Z", "CDAB 2005-11-20T08:48:45Z"]);
        assert_eq!(all(&[0x0001, 0x386D]), [""; 0]);
        assert_eq!(all(&[2026, 11, 23, 18, 5, 9]), ["Y M D h m s 2026-11-23 18:05:09"]);
        assert_eq!(all(&[2026, 2, 30, 18, 5, 9]), [""; 0]);
        assert_eq!(all(&[700]), [""; 0]);
    }
}
