//! The bytes of a frame in rows, those of one value between brackets: `01 04 02[02 D4]B8 F3`.

use std::ops::Range;

use crate::{bus::frame::hex, plant::line::Framing};

/// All bytes in rows of at most `room` columns, those of `marked` between brackets.
pub(super) fn rows(bytes: &[u8], framing: Framing, marked: Option<&Range<usize>>, room: u16) -> Vec<String> {
    let (cells, gap) = match framing {
        // An ASCII frame is text already.
        Framing::Ascii => (bytes.iter().map(|byte| byte.escape_ascii().to_string()).collect::<Vec<_>>(), ""),
        Framing::Rtu | Framing::Mbap => (bytes.iter().map(|byte| hex(&[*byte])).collect(), " "),
    };
    let opens = |at: usize| marked.is_some_and(|marked| marked.start == at);
    let closes = |at: usize| marked.is_some_and(|marked| marked.end == at);
    let mut rows = Vec::new();
    let mut row = String::new();
    for (at, cell) in cells.iter().enumerate() {
        let before = match (opens(at), closes(at)) {
            (true, _) => "[",
            (false, true) => "]",
            (false, false) => gap,
        };
        // One column stays free for a bracket that closes at the end.
        if !row.is_empty() && usize::from(room) < row.chars().count() + before.len() + cell.len() + 1 {
            // The bracket that closes belongs to the byte before it.
            if closes(at) {
                row.push(']');
            }
            rows.push(std::mem::take(&mut row));
            row.push_str(if opens(at) { "[" } else { gap });
        } else {
            row.push_str(before);
        }
        row.push_str(cell);
    }
    if closes(cells.len()) {
        row.push(']');
    }
    if !row.is_empty() {
        rows.push(row);
    }
    rows
}

/// The rows that matter, at most three: the first, and those with the marked bytes; what is left out is shown as `…`.
pub(super) fn abridged(rows: Vec<String>, ellipsis: &str) -> Vec<String> {
    let marked = |row: &String| row.contains(['[', ']']);
    let first = rows.iter().position(marked).unwrap_or(0);
    let last = rows.iter().rposition(marked).unwrap_or(0).min(first + 1);
    let count = rows.len();
    let kept = rows.into_iter().enumerate().filter(|(n, _)| *n == 0 || (first..=last).contains(n));
    let mut before = 0;
    let mut out: Vec<String> = Vec::new();
    for (n, row) in kept {
        match out.last_mut() {
            Some(above) if before + 1 < n => above.push_str(ellipsis),
            Some(_) | None => {}
        }
        before = n;
        out.push(row);
    }
    if let Some(end) = out.last_mut().filter(|_| before + 1 < count) {
        end.push_str(ellipsis);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(count: u8, marked: Range<usize>, room: u16, expect: &[&str]) {
        let bytes: Vec<u8> = (0..count).collect();
        let rows = rows(&bytes, Framing::Rtu, Some(&marked), room);
        assert_eq!(rows, expect);
        assert!(rows.iter().all(|row| row.len() <= usize::from(room)), "{rows:?}");
    }

    #[test]
    fn the_bytes_of_a_value_stand_between_brackets() {
        check(5, 1..3, 40, &[" 00[01 02]03 04"]);
        check(5, 0..5, 40, &["[00 01 02 03 04]"]);
        check(5, 3..5, 40, &[" 00 01 02[03 04]"]);
        check(6, 2..4, 10, &[" 00 01 02".replace(" 02", "[02").as_str(), " 03]04 05"]);
        check(6, 1..3, 10, &[" 00[01 02]", " 03 04 05"]);
        check(6, 3..5, 10, &[" 00 01 02", "[03 04]05"]);
    }

    #[test]
    fn an_ascii_frame_is_shown_as_it_is() {
        let rows = rows(b":0103\r\n", Framing::Ascii, Some(&(3..5)), 40);
        assert_eq!(rows, [":01[03]\\r\\n"]);
    }

    #[test]
    fn of_a_long_answer_the_rows_that_matter_are_kept() {
        let rows = |marked: &[usize]| -> Vec<String> {
            (0..5).map(|n| if marked.contains(&n) { format!("[{n}]") } else { n.to_string() }).collect()
        };
        assert_eq!(abridged(rows(&[3]), "…"), ["0…", "[3]…"]);
        assert_eq!(abridged(rows(&[1, 2]), "…"), ["0", "[1]", "[2]…"]);
        assert_eq!(abridged(rows(&[4]), "…"), ["0…", "[4]"]);
        assert_eq!(abridged(rows(&[]), "…"), ["0…"]);
        assert_eq!(abridged(vec!["0".into()], "…"), ["0"]);
    }
}
