//! Text of others, safe for a terminal: characters that would move the cursor or turn the direction of writing are seen instead.

use std::{borrow::Cow, fmt::Write};

/// Does it act on a terminal rather than being shown: a control (C0, DEL, C1), a mark that turns or hides the direction of
/// writing, or a separator of lines that is none on a screen?
pub fn is_control_or_bidi(letter: char) -> bool {
    letter.is_control()
        || matches!(letter, '\u{61C}' | '\u{200B}' | '\u{200E}' | '\u{200F}' | '\u{2028}'..='\u{202E}')
        || matches!(letter, '\u{2060}'..='\u{206F}' | '\u{FEFF}')
}

/// Is it shown as one character by itself: it does not act, join or hide, and every font has the same for it?
pub fn is_printable(letter: char) -> bool {
    !is_control_or_bidi(letter)
        && !matches!(letter, '\u{AD}' | '\u{180E}' | '\u{200C}' | '\u{200D}' | '\u{E000}'..='\u{F8FF}')
        && !matches!(letter, '\u{FFF0}'..='\u{FFFF}' | '\u{E0000}'..)
}

/// The text with such characters as `\u{202e}`; ends of lines and tabs stay.
pub fn visible(text: &str) -> Cow<'_, str> {
    let is_hidden = |letter: char| is_control_or_bidi(letter) && !matches!(letter, '\n' | '\t');
    if !text.contains(is_hidden) {
        return Cow::Borrowed(text);
    }
    let mut shown = String::with_capacity(text.len() + 16);
    for letter in text.chars() {
        match is_hidden(letter) {
            // Writing into a string does not fail.
            true => drop(write!(shown, "{}", letter.escape_unicode())),
            false => shown.push(letter),
        }
    }
    Cow::Owned(shown)
}

/// The first such character of a text of several lines, whose lines may end in CR LF, and the byte where it stands.
pub fn first_hidden(text: &str) -> Option<(usize, char)> {
    text.char_indices().find(|(at, letter)| match letter {
        '\n' | '\t' => false,
        '\r' => !text[at + 1..].starts_with('\n'),
        _ => is_control_or_bidi(*letter),
    })
}

/// The same text with as many bytes, for places that are counted in bytes: `?`, `¿` or `�` for each such character.
pub fn same_length(text: &str) -> String {
    let shown = |letter: char| match (is_control_or_bidi(letter) && !matches!(letter, '\n' | '\t'), letter.len_utf8()) {
        (false, _) => letter,
        (true, 1) if letter == '\r' => ' ',
        (true, 1) => '?',
        (true, 2) => '¿',
        (true, _) => '\u{FFFD}',
    };
    text.chars().map(shown).collect()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn what_acts_on_a_terminal_is_seen_and_everything_else_stays() {
        for (text, expect) in [
            ("สมชาย 72.4 °C\n\tÜ", "สมชาย 72.4 °C\n\tÜ"),
            ("a\u{1b}[2Jb", "a\\u{1b}[2Jb"),
            ("\r\u{7}\u{9b}31m", "\\u{d}\\u{7}\\u{9b}31m"),
            ("\u{202e}evil\u{2066}", "\\u{202e}evil\\u{2066}"),
            ("\u{200f}\u{61c}\u{feff}", "\\u{200f}\\u{61c}\\u{feff}"),
        ] {
            assert_eq!(visible(text), expect);
        }
    }

    #[test]
    fn lines_may_end_in_cr_lf_and_a_cr_alone_is_found() {
        assert_eq!(first_hidden("a\r\nb\tc\n"), None);
        assert_eq!(first_hidden("a\r\nb\rc"), Some((4, '\r')));
        assert_eq!(first_hidden("é\u{202e}"), Some((2, '\u{202e}')));
    }

    proptest! {
        #[test]
        fn nothing_that_acts_is_left(text in "\\PC*|[\u{0}-\u{a0}\u{200b}-\u{2070}a]*") {
            let same = same_length(&text);
            prop_assert_eq!(same.len(), text.len());
            for shown in [visible(&text).into_owned(), same] {
                prop_assert_eq!(first_hidden(&shown), None);
                prop_assert!(!shown.contains('\r'));
            }
        }
    }
}
