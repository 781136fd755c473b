//! Rewrites the cells of a drawn frame so that the terminal draws each in the width that the layout assumes.

use std::borrow::Cow;

use ratatui::buffer::Buffer;

use super::theme::{Glyphs, Theme};
use crate::plant::visible::is_control_or_bidi;

/// A text as it is put into cells: without break points (U+200B), and with SARA AM (U+0E33) as NIKHAHIT + SARA AA, which looks
/// the same and makes every cluster one cell wide. Terminals put SARA AM in a cell of its own, and the diff of two frames
/// then leaves it behind on the screen.
pub fn cells(text: &str) -> Cow<'_, str> {
    if !text.contains(['\u{e33}', '\u{200b}']) {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len() + 8);
    for c in text.chars() {
        if c == '\u{e33}' {
            let tone = out.chars().last().filter(|tone| ('\u{e48}'..='\u{e4b}').contains(tone));
            if tone.is_some() {
                out.pop();
            }
            out.push('\u{e4d}');
            out.extend(tone);
            out.push('\u{e32}');
        } else if c != '\u{200b}' {
            out.push(c);
        }
    }
    Cow::Owned(out)
}

/// Makes a drawn frame safe for the terminal: nothing that moves the cursor or turns the direction of writing, no SARA AM,
/// and only characters of the glyph set.
pub fn apply(buffer: &mut Buffer, theme: &Theme) {
    split_sara_am(buffer);
    for cell in &mut buffer.content {
        if cell.symbol().chars().any(is_control_or_bidi) {
            cell.set_symbol("?");
        }
        if cell.symbol().is_ascii() {
            continue;
        }
        let first = cell.symbol().chars().next().unwrap_or(' ');
        match theme.glyphs {
            Glyphs::Braille => {}
            Glyphs::Block => {
                if let Some(c) = console(first) {
                    cell.set_char(c);
                }
            }
            Glyphs::Ascii => {
                cell.set_char(ascii(first));
            }
        }
    }
}

/// What a widget of the library has drawn: a letter with SARA AM becomes two cells, as if a canvas had drawn it.
fn split_sara_am(buffer: &mut Buffer) {
    let columns = usize::from(buffer.area.width);
    for at in 0..buffer.content.len() {
        let symbol = cells(buffer.content[at].symbol());
        let Cow::Owned(symbol) = symbol else { continue };
        let letter = symbol.trim_end_matches('\u{e32}');
        // Alone it has one column.
        let is_wide = !letter.starts_with('\u{e4d}') && (at + 1) % columns != 0;
        buffer.content[at].set_symbol(if is_wide { letter } else { &symbol });
        if is_wide && buffer.content[at + 1].symbol() == " " {
            buffer.content[at + 1].set_symbol("\u{e32}");
        }
    }
}

/// The nearest character that the fonts of the Linux console have (code page 437), for those that they lack.
fn console(c: char) -> Option<char> {
    Some(match c {
        '━' => '═',
        '┃' => '║',
        '┏' => '╔',
        '┓' => '╗',
        '┗' => '╚',
        '┛' => '╝',
        '╌' | '┄' | '╶' | '╴' | '–' | '−' => '-',
        '┆' | '╵' | '╷' => ':',
        '╂' => '┼',
        '▁' | '▂' => '_',
        '▃' | '▅' => '▄',
        '▆' | '▇' => '█',
        '▶' | '▸' => '►',
        '◀' | '◂' => '◄',
        '▷' | '›' => '>',
        '◁' | '‹' => '<',
        '▪' | '◆' => '■',
        '□' | '◇' | '△' => '○',
        '●' => '•',
        '≋' => '≈',
        '✎' => 'w',
        '✓' => '√',
        '✗' => 'x',
        '⊘' => '×',
        '≠' => '!',
        '⏎' => '┘',
        '…' => '.',
        '\u{2800}'..='\u{28ff}' => '·',
        _ => return None,
    })
}

/// The nearest character of seven bits, one cell wide.
fn ascii(c: char) -> char {
    match c {
        '─' | '┄' | '╌' | '╶' | '╴' | '–' | '−' => '-',
        '━' | '═' => '=',
        '│' | '┃' | '║' | '╵' | '╷' | '┆' | '▏' => '|',
        '┌' | '┐' | '└' | '┘' | '├' | '┤' | '┬' | '┴' | '┼' | '╂' | '┏' | '┓' | '┗' | '┛' | '╔' | '╗' | '╚' | '╝'
        | '╫' | '╪' | '╢' | '╟' => '+',
        '▶' | '▷' | '▸' | '►' | '→' | '›' => '>',
        '◀' | '◁' | '◂' | '◄' | '←' | '‹' => '<',
        '▲' | '▴' | '↑' => '^',
        '▼' | '▾' | '↓' => 'v',
        '⏎' => '/',
        '°' => '*',
        '·' | '…' => '.',
        '●' | '■' | '◆' => '@',
        '○' | '□' | '◇' | '△' => 'o',
        '▁' | '▂' => '_',
        '▃' | '▄' | '≋' | '≈' => '~',
        '▅' | '▆' | '▇' | '█' | '▓' | '▒' => '#',
        '░' => ':',
        '×' => 'x',
        '✓' => 'v',
        '✗' => 'x',
        'µ' => 'u',
        '²' => '2',
        '³' => '3',
        c if c.is_ascii() => c,
        _ => '?',
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ratatui::{layout::Rect, style::Style};

    #[test]
    fn sara_am_never_reaches_the_terminal() {
        assert_eq!(cells("อุณหภูมิ\u{200b}น้ำ"), "อุณหภูมิน\u{e4d}\u{e49}\u{e32}");
        assert_eq!(cells("ทำ"), "ท\u{e4d}\u{e32}");
        let mut buffer = Buffer::empty(Rect::new(0, 0, 20, 1));
        buffer.set_string(0, 0, "น้ำในถัง", Style::new());
        apply(&mut buffer, &Theme::FULL);
        assert!(buffer.content.iter().all(|cell| !cell.symbol().contains('\u{e33}')));
    }

    #[test]
    fn an_ascii_terminal_gets_seven_bits() {
        let mut buffer = Buffer::empty(Rect::new(0, 0, 12, 1));
        buffer.set_string(0, 0, "72.4 °C ▲─█⡇", Style::new());
        apply(&mut buffer, &Theme::PLAIN);
        let text: String = buffer.content.iter().map(|cell| cell.symbol()).collect();
        assert_eq!(text, "72.4 *C ^-#?");
    }
}
