//! What terminals answer, and what is typed meanwhile.

use super::*;

const KITTY: &str = "\x1b_Gi=31;OK\x1b\\";

fn typed(answers: &Answers) -> String {
    let name = |event: &Event| match event {
        Event::Key(KeyEvent { code: KeyCode::Char(c), modifiers, .. }) if modifiers.contains(KeyModifiers::CONTROL) => {
            format!("^{c}")
        }
        Event::Key(KeyEvent { code: KeyCode::Char(c), .. }) => c.to_string(),
        Event::Key(KeyEvent { code, .. }) => format!("<{code}>"),
        Event::Paste(text) => format!("[{text}]"),
        other => format!("{other:?}"),
    };
    answers.typed.iter().map(name).collect()
}

#[test]
fn answers_and_keys_are_distinguished() {
    for (bytes, expect, keys) in [
        ("", (false, false, false), ""),
        ("\x1b[?62;22c", (false, false, true), ""),
        ("\x1b[?62;4;22c", (false, true, true), ""),
        ("\x1b[?4;22c", (false, false, true), ""),
        ("\x1b_Gi=31;OK\x1b\\\x1b[?62c", (true, false, true), ""),
        ("\x1b_Gi=31;ENOTSUPP:no\x1b\\\x1b[?62c", (false, false, true), ""),
        ("4\x1b_Gi=31;OK\x1b\\\x1b[B\x1b[6;20;10t\x1bOA\x1b[?62;4cé\r", (true, true, true), "4<Down><Up>é<Enter>"),
        ("\x1b[200~qqA\x1b[201~\x1b[?1c", (false, false, true), "[qqA]"),
        ("\x1b", (false, false, false), "<Esc>"),
        ("\x1b\x1b[6~\x1b[12~\x1b[17~\x1b[24~\x03", (false, false, false), "<Esc><Page Down><F2><F6><F12>^c"),
    ] {
        let answers = parse(bytes.as_bytes(), true);
        assert_eq!((answers.kitty, answers.sixel, answers.is_whole), expect, "{bytes:?}");
        assert_eq!(typed(&answers), keys, "{bytes:?}");
    }
}

#[test]
fn sizes_are_those_that_the_terminal_says() {
    let answers = parse(b"\x1b[?1;0;256S\x1b[?2;0;1000;800S\x1b[6;21;9t\x1b[?62;4c", true);
    assert_eq!((answers.cell, answers.sixel_max, answers.sixel_colours), (Some((9, 21)), Some((1000, 800)), Some(256)));
    let refused = parse(b"\x1b[?1;3;0S\x1b[?2;1S\x1b[6;0;0t\x1b[?62c", true);
    assert_eq!((refused.cell, refused.sixel_max, refused.sixel_colours), (None, None, None));
}

/// Wherever the input is cut, the first part and the whole give the same answers and keys.
#[test]
fn an_answer_may_arrive_in_pieces() {
    let whole = format!("4{KITTY}\x1b[6;20;10t\x1b[200~a\x1b[201~น\x1b[?62;4c");
    for cut in 0..whole.len() {
        let part = parse(&whole.as_bytes()[..cut], false);
        assert!(!part.is_whole, "{cut}");
        let keys = typed(&parse(whole.as_bytes(), true));
        assert!(keys.starts_with(&typed(&part)), "{cut}: {}", typed(&part));
    }
}

#[test]
fn a_late_answer_is_no_key() {
    let start = Instant::now();
    let event = |letter, modifiers| key(KeyCode::Char(letter), modifiers);
    let alt = |letter| event(letter, KeyModifiers::ALT);
    let plain = |letter| event(letter, KeyModifiers::NONE);
    assert!(LateAnswer::after(&parse(b"\x1b[?62c", true), start).is_none(), "all answers have come");
    let mut late = LateAnswer::after(&parse(b"", true), start).expect("one may come");
    assert!(!late.holds(&plain('4'), start));
    let answer = [alt('_'), plain('G'), plain('i'), plain('='), plain('3'), plain('1'), plain('A'), alt('\\')];
    assert!(answer.iter().all(|event| late.holds(event, start)));
    assert!(!late.holds(&plain('a'), start), "the next key acts again");
    // Keys that only look like its begin.
    assert!(late.holds(&alt('_'), start));
    assert!(!late.holds(&plain('4'), start));
    assert!(late.holds(&alt('_'), start) && late.holds(&plain('G'), start));
    assert!(!late.holds(&plain('4'), start + Duration::from_secs(1)));
    let mut cut = LateAnswer::after(&parse(b"\x1b_Gi=31;", true), start).expect("its end may come");
    assert!(cut.holds(&plain('O'), start) && cut.holds(&plain('K'), start) && cut.holds(&alt('\\'), start));
    assert!(!cut.holds(&plain('q'), start));
}
