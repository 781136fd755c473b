//! Forms of addresses that only a column of addresses has, as the plain ones: `40009~40010`, `[40028]`, `FF00H`, `1!400001`.

use std::borrow::Cow;

use super::columns::span_of;
use crate::plant::address::wire;

/// Between the first and the last of a span.
const BETWEEN: [&str; 6] = ["...", "..", "~", "～", " to ", " bis "];
/// What refers to a note below the table.
const NOTES: [char; 7] = ['*', '†', '‡', '¹', '²', '³', ' '];

/// An address as it is written plainly; what can mean something else stays as it is.
pub fn plain(cell: &str) -> Cow<'_, str> {
    let cell = cell.trim();
    let bare =
        cell.strip_prefix('[').and_then(|cell| cell.strip_suffix(']')).unwrap_or(cell).trim_end_matches(NOTES).trim();
    // A mark alone is no note, nor is one behind a name.
    let bare = Some(bare).filter(|bare| bare.bytes().any(|byte| byte.is_ascii_digit())).unwrap_or(cell);
    let bare = of_unit(bare).map_or(bare, |(_, rest)| rest);
    let found = hexadecimal(bare).or_else(|| grouped(bare)).or_else(|| span(bare)).or_else(|| following(bare));
    match found {
        Some(found) => Cow::Owned(found),
        None if wire(bare).is_some() || bare.bytes().all(|byte| byte.is_ascii_digit()) => Cow::Borrowed(bare),
        None => Cow::Borrowed(cell),
    }
}

/// `1!400001`: a unit, and the address in it.
pub fn of_unit(cell: &str) -> Option<(u8, &str)> {
    let (unit, rest) = cell.trim().split_once('!')?;
    let is_digits = rest.len() >= 5 && rest.bytes().all(|byte| byte.is_ascii_digit());
    let unit: u8 = unit.parse().ok()?;
    (is_digits && (1..=247).contains(&unit)).then_some((unit, rest))
}

/// `FF00H`, `1008 h`, `&H1001`, `16#1003`, `H1004`.
fn hexadecimal(cell: &str) -> Option<String> {
    let prefixed = || ["&H", "&h", "16#"].iter().find_map(|prefix| cell.strip_prefix(prefix));
    // `H1` may be a name.
    let in_front = || cell.strip_prefix(['H', 'h']).filter(|digits| digits.len() == 4);
    let behind = || {
        let digits = cell.strip_suffix(['H', 'h'])?.trim_end();
        Some(digits).filter(|digits| digits.len() == 4 || digits.bytes().any(|byte| byte.is_ascii_digit()))
    };
    let digits = prefixed().or_else(in_front).or_else(behind)?;
    let is_hex = (1..=4).contains(&digits.trim_start_matches('0').len().max(1))
        && digits.bytes().all(|byte| byte.is_ascii_hexdigit());
    (is_hex && !digits.is_empty()).then(|| format!("0x{digits}"))
}

/// `40 019`, `40.019`: five or six digits in groups of three; a bit of a register has two digits at most. `450 451` are two.
fn grouped(cell: &str) -> Option<String> {
    let (first, last) = cell.split_once([' ', '\u{A0}', '.'])?;
    let number = |text: &str| text.parse::<u32>().ok();
    if !cell.contains('.')
        && first.len() == last.len()
        && !last.starts_with('0')
        && number(first)?.checked_add(1) == number(last)
    {
        return Some(format!("{first}-{last}"));
    }
    let is_number = |text: &str, lengths: std::ops::RangeInclusive<usize>| {
        lengths.contains(&text.len()) && text.bytes().all(|byte| byte.is_ascii_digit())
    };
    (is_number(first, 2..=3) && is_number(last, 3..=3) && !first.starts_with('0')).then(|| format!("{first}{last}"))
}

/// `40009..40010`, `40009 to 40010`.
fn span(cell: &str) -> Option<String> {
    let (first, last) = BETWEEN.iter().find_map(|between| cell.split_once(between))?;
    let plain = format!("{}-{}", plain(first), plain(last));
    span_of(&plain).is_some_and(|count| 1 < count).then_some(plain)
}

/// `40005/6`, `40015, 40016`: each follows the one before it, and the first has too many digits for a fraction or a code.
fn following(cell: &str) -> Option<String> {
    let parts: Vec<&str> = cell.split(['/', ',']).map(str::trim).collect();
    let is_digits = |text: &&str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    let [first, .., last] = parts.as_slice() else { return None };
    // `100,101` may be one number.
    let is_long = if cell.contains(',') && !cell.contains(", ") { 4 } else { 3 } <= first.len();
    if !is_long || !parts.iter().all(is_digits) {
        return None;
    }
    let whole =
        |part: &&str| format!("{}{part}", first.get(..first.len().saturating_sub(part.len())).unwrap_or_default());
    let numbers: Vec<u32> = parts.iter().filter_map(|part| whole(part).parse().ok()).collect();
    let follows = numbers.len() == parts.len() && numbers.windows(2).all(|two| two[0].checked_add(1) == Some(two[1]));
    follows.then(|| format!("{first}-{}", whole(last)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn forms_of_addresses_become_plain_ones_where_they_are_sure() {
        for (cell, expect) in [
            ("40009~40010", "40009-40010"),
            ("40009..40010", "40009-40010"),
            ("40009 to 40010", "40009-40010"),
            ("0x10 ~ 0x11", "0x10-0x11"),
            ("40005/6", "40005-40006"),
            ("40015, 40016", "40015-40016"),
            ("40015,40016,40017", "40015-40017"),
            ("[40028]", "40028"),
            ("40029*", "40029"),
            ("40029 ²", "40029"),
            ("FF00H", "0xFF00"),
            ("1008 h", "0x1008"),
            ("&H1001", "0x1001"),
            ("16#1003", "0x1003"),
            ("H1004", "0x1004"),
            ("1!400001", "400001"),
            ("40 019", "40019"),
            ("40.019", "40019"),
        ] {
            assert_eq!(plain(cell), expect, "{cell}");
        }
        for cell in [
            "40001",
            "0x10",
            "4x0001",
            "40001-40002",
            "1/2",
            "3/6",
            "40005/7",
            "100,101",
            "1,000",
            "1.000",
            "40.19",
            "H1",
            "EACH",
            "A1*",
            "*",
            "",
            "40010..40009",
            "2025-11-15",
            "holding:5",
            "0!40001",
            "4294967295/0",
            "1!5",
            "12:30",
        ] {
            assert_eq!(plain(cell), cell, "{cell}");
        }
    }
}
