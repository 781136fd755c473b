//! Rows that may be the halves of one number: a list names the high and the low word of it.

use crate::{plant::tag::DataType, register_map::named::Named, t};

/// How a name says which half it is.
const HALVES: [(&str, &str); 7] = [
    ("h", "l"),
    ("hi", "lo"),
    ("high", "low"),
    ("msw", "lsw"),
    ("upper", "lower"),
    ("hw", "lw"),
    ("highword", "lowword"),
];
/// What may stand behind that.
const BEHIND: [&str; 4] = ["word", "register", "part", "half"];

/// Two neighbours with one name may be an upper and a lower limit as well: only a person knows.
pub fn warnings(named: &[Named]) -> Vec<String> {
    let pairs = named.windows(2).filter_map(|pair| pair.first().zip(pair.last()));
    let are_halves = |(first, second): &(&Named, &Named)| {
        let is_plain = |one: &Named| matches!(one.kind, DataType::U16 | DataType::I16) && one.field.is_none();
        let are_neighbours = first.table == second.table && first.address.abs_diff(second.address) == 1;
        is_plain(first) && is_plain(second) && are_neighbours && are_of_one(&first.name, &second.name)
    };
    let words = |(first, second): (&Named, &Named)| {
        let (line, first, second) = (first.line, &first.name, &second.name);
        t!(
            "line {line}: `{first}` and `{second}` may be the halves of one number: they are taken as two",
            line,
            first,
            second
        )
    };
    pairs.filter(are_halves).map(words).collect()
}

/// Differ two names only in which half they say?
fn are_of_one(first: &str, second: &str) -> bool {
    let split = |name: &str| {
        let mut words: Vec<String> = name
            .to_lowercase()
            .split(|sign: char| !sign.is_alphanumeric())
            .filter(|word| !word.is_empty())
            .map(str::to_owned)
            .collect();
        words.pop_if(|word| BEHIND.contains(&word.as_str()));
        let half = words.pop();
        (words, half)
    };
    let ((first, one), (second, other)) = (split(first), split(second));
    let (Some(one), Some(other)) = (one, other) else { return false };
    let is_pair = |(high, low): &(&str, &str)| (one == *high && other == *low) || (one == *low && other == *high);
    !first.is_empty() && first == second && HALVES.iter().any(is_pair)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_halves_are_known() {
        for (first, second, expect) in [
            ("Eac today H", "Eac today L", true),
            ("Energy (low word)", "Energy (high word)", true),
            ("Power_MSW", "Power_LSW", true),
            ("Power H", "Energy L", false),
            ("H", "L", false),
            ("Valve 1", "Valve 2", false),
        ] {
            assert_eq!(are_of_one(first, second), expect, "{first} {second}");
        }
    }
}
