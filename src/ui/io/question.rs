//! What the terminal is asked once, before its keys are read: pictures, and the size of a cell. Keys that come in between
//! are kept; an answer that comes too late is no key.

#[cfg(test)]
mod tests;

use std::{io, time::Duration};

use crossterm::event::{Event, KeyCode, KeyEvent, KeyModifiers};
use rustix::{
    event::{PollFd, PollFlags, Timespec, poll},
    io::Errno,
};
use tokio::time::Instant;

use crate::ui::graphics::{Graphics, kitty};

/// The answers are waited for so long.
const BOUND: Duration = Duration::from_millis(300);
/// What has begun to arrive by then is read to its end, for so long.
const GRACE: Duration = Duration::from_millis(200);
/// Most bytes that are read meanwhile.
const BYTES_MAX: usize = 64 << 10;

/// Kitty graphics; colours and size of Sixel (XTSMGRAPHICS); the size of a cell; and last what every terminal answers, its
/// attributes (DA1), so that nothing is waited for in vain.
pub(super) fn question() -> Vec<u8> {
    [kitty::QUESTION, b"\x1b[?1;1;0S\x1b[?2;1;0S\x1b[16t\x1b[c"].concat()
}

#[derive(Debug, Default)]
pub(super) struct Answers {
    kitty: bool,
    sixel: bool,
    cell: Option<(u16, u16)>,
    sixel_max: Option<(u16, u16)>,
    sixel_colours: Option<u16>,
    /// The last answer came.
    pub is_whole: bool,
    /// The end of the input is the begin of something.
    is_cut: bool,
    /// What was typed meanwhile.
    pub typed: Vec<Event>,
}

impl Answers {
    /// What the terminal announces; the size of a cell as it says, else as its line says.
    pub fn graphics(&self) -> Graphics {
        let Answers { kitty, sixel, sixel_max, sixel_colours, .. } = *self;
        Graphics { kitty, sixel, cell: self.cell.or_else(cell_of_line), sixel_max, sixel_colours, unasked: None }
    }
}

/// Width and height of a cell in pixels, as the terminal's line says.
pub(super) fn cell_of_line() -> Option<(u16, u16)> {
    let line = rustix::termios::tcgetwinsize(rustix::stdio::stdout()).ok()?;
    size(line.ws_xpixel.checked_div(line.ws_col)?, line.ws_ypixel.checked_div(line.ws_row)?)
}

/// Reads the answers to a question that was sent at this time.
pub(super) fn read_answers(sent: Instant) -> Answers {
    let mut bytes = Vec::new();
    loop {
        let answers = parse(&bytes, false);
        let until = sent + if answers.is_cut { BOUND + GRACE } else { BOUND };
        let is_done = answers.is_whole && !answers.is_cut || bytes.len() >= BYTES_MAX;
        if is_done || !read_more(&mut bytes, until) {
            return parse(&bytes, true);
        }
    }
}

/// Reads what there is until then; `false` if nothing more comes.
fn read_more(bytes: &mut Vec<u8>, until: Instant) -> bool {
    let stdin = rustix::stdio::stdin();
    loop {
        let left = until.saturating_duration_since(Instant::now());
        let Ok(timeout) = Timespec::try_from(left) else { return false };
        match poll(&mut [PollFd::new(&stdin, PollFlags::IN)], Some(&timeout)) {
            Ok(0) => return false,
            Ok(_) => {}
            Err(Errno::INTR) => continue,
            Err(_) => return false,
        }
        let mut buffer = [0; 4_096];
        return match rustix::io::read(stdin, &mut buffer) {
            Ok(0) => false,
            Ok(count) => {
                bytes.extend(&buffer[..count]);
                true
            }
            Err(error) if io::Error::from(error).kind() == io::ErrorKind::Interrupted => continue,
            Err(_) => false,
        };
    }
}

/// Tells answers from keys. `at_end`: nothing more comes, and a lone Esc is the key.
fn parse(bytes: &[u8], at_end: bool) -> Answers {
    let mut answers = Answers::default();
    let mut rest = bytes;
    while let Some(first) = rest.first() {
        let length = match (first, rest.get(1)) {
            (0x1b, Some(b'_' | b'P' | b']')) => string(rest, &mut answers),
            (0x1b, Some(b'[')) => control(rest, &mut answers),
            (0x1b, Some(b'O')) => rest.get(2).map(|letter| {
                answers.typed.extend(named(*letter, KeyModifiers::NONE));
                3
            }),
            (0x1b, None) if !at_end => None,
            (0x1b, _) => {
                answers.typed.push(key(KeyCode::Esc, KeyModifiers::NONE));
                Some(1)
            }
            _ => letter(rest, &mut answers),
        };
        let Some(length) = length else {
            answers.is_cut = true;
            return answers;
        };
        rest = rest.get(length..).unwrap_or_default();
    }
    answers
}

fn key(code: KeyCode, modifiers: KeyModifiers) -> Event {
    Event::Key(KeyEvent::new(code, modifiers))
}

/// `ESC _ … ESC \`: an answer about Kitty graphics, or nothing of ours. How long it is; `None` if its end is missing.
fn string(bytes: &[u8], answers: &mut Answers) -> Option<usize> {
    let end = bytes.windows(2).position(|two| two == b"\x1b\\")?;
    answers.kitty |= bytes[..end].starts_with(b"\x1b_Gi=31") && bytes[..end].ends_with(b";OK");
    Some(end + 2)
}

/// `ESC [ … letter`: an answer, a paste or a key. How long it is; `None` if its end is missing.
fn control(bytes: &[u8], answers: &mut Answers) -> Option<usize> {
    const PASTED: &[u8] = b"\x1b[201~";
    let end = bytes.iter().skip(2).position(|byte| (0x40..=0x7e).contains(byte))? + 2;
    let (words, letter) = (std::str::from_utf8(&bytes[2..end]).unwrap_or_default(), bytes[end]);
    let numbers: Vec<u16> =
        words.trim_start_matches('?').split(';').map(|number| number.parse().unwrap_or(0)).collect();
    match (words.starts_with('?'), letter, numbers.as_slice()) {
        (true, b'c', attributes) => {
            answers.is_whole = true;
            answers.sixel = attributes.iter().skip(1).any(|attribute| *attribute == 4);
        }
        (true, b'S', [1, 0, colours, ..]) => answers.sixel_colours = Some(*colours).filter(|colours| *colours > 0),
        (true, b'S', [2, 0, width, height, ..]) => answers.sixel_max = size(*width, *height),
        (false, b't', [6, height, width]) => answers.cell = size(*width, *height),
        (false, b'~', [200]) => {
            let pasted = &bytes[end + 1..];
            let length = pasted.windows(PASTED.len()).position(|part| part == PASTED)?;
            answers.typed.push(Event::Paste(String::from_utf8_lossy(&pasted[..length]).into_owned()));
            return Some(end + 1 + length + PASTED.len());
        }
        (false, b'~', [number, ..]) => answers.typed.extend(numbered(*number).map(|code| key(code, held(&numbers)))),
        (false, letter, numbers) => answers.typed.extend(named(letter, held(numbers))),
        (true, _, _) => {}
    }
    Some(end + 1)
}

fn size(width: u16, height: u16) -> Option<(u16, u16)> {
    (width > 0 && height > 0).then_some((width, height))
}

/// The keys held down, as the second number of a sequence has them.
fn held(numbers: &[u16]) -> KeyModifiers {
    let bits = numbers.get(1).map_or(0, |number| number.saturating_sub(1));
    let keys = [(1, KeyModifiers::SHIFT), (2, KeyModifiers::ALT), (4, KeyModifiers::CONTROL)];
    keys.into_iter().filter(|(bit, _)| bits & bit != 0).map(|(_, modifier)| modifier).collect()
}

/// A key whose sequence ends in a letter.
fn named(letter: u8, modifiers: KeyModifiers) -> Option<Event> {
    let code = match letter {
        b'A' => KeyCode::Up,
        b'B' => KeyCode::Down,
        b'C' => KeyCode::Right,
        b'D' => KeyCode::Left,
        b'F' => KeyCode::End,
        b'H' => KeyCode::Home,
        b'Z' => KeyCode::BackTab,
        b'P'..=b'S' => KeyCode::F(1 + letter - b'P'),
        _ => return None,
    };
    Some(key(code, modifiers))
}

/// A key whose sequence is a number.
fn numbered(number: u16) -> Option<KeyCode> {
    Some(match number {
        1 | 7 => KeyCode::Home,
        2 => KeyCode::Insert,
        3 => KeyCode::Delete,
        4 | 8 => KeyCode::End,
        5 => KeyCode::PageUp,
        6 => KeyCode::PageDown,
        n @ 11..=15 => KeyCode::F(u8::try_from(n - 10).ok()?),
        n @ 17..=21 => KeyCode::F(u8::try_from(n - 11).ok()?),
        n @ (23 | 24) => KeyCode::F(u8::try_from(n - 12).ok()?),
        _ => return None,
    })
}

/// A letter, or one with Ctrl. How long it is; `None` if its end is missing.
fn letter(bytes: &[u8], answers: &mut Answers) -> Option<usize> {
    let first = bytes[0];
    let (code, modifiers) = match first {
        b'\r' => (KeyCode::Enter, KeyModifiers::NONE),
        b'\t' => (KeyCode::Tab, KeyModifiers::NONE),
        0x7f => (KeyCode::Backspace, KeyModifiers::NONE),
        0 => (KeyCode::Char(' '), KeyModifiers::CONTROL),
        1..=0x1a => (KeyCode::Char(char::from(first - 1 + b'a')), KeyModifiers::CONTROL),
        0x1b..=0x1f => (KeyCode::Char(char::from(first - 0x1c + b'4')), KeyModifiers::CONTROL),
        _ => {
            let length = match first {
                0xc0..=0xdf => 2,
                0xe0..=0xef => 3,
                0xf0..=0xff => 4,
                _ => 1,
            };
            let text = std::str::from_utf8(bytes.get(..length)?).unwrap_or_default();
            let shift = |c: &char| if c.is_uppercase() { KeyModifiers::SHIFT } else { KeyModifiers::NONE };
            answers.typed.extend(text.chars().map(|c| key(KeyCode::Char(c), shift(&c))));
            return Some(length);
        }
    };
    answers.typed.push(key(code, modifiers));
    Some(1)
}

/// Keeps an answer about Kitty graphics that came too late from acting as keys: `Alt-_`, `G`, …, `Alt-\`.
#[derive(Debug)]
pub(super) struct LateAnswer {
    /// When it began, and whether its second letter has come.
    began: Option<(Instant, bool)>,
}

impl LateAnswer {
    /// One may come; its begin may have been read already.
    pub fn after(answers: &Answers, now: Instant) -> Option<LateAnswer> {
        (!answers.is_whole).then(|| LateAnswer { began: answers.is_cut.then_some((now, true)) })
    }

    /// Is this a part of it?
    pub fn holds(&mut self, event: &Event, now: Instant) -> bool {
        let Event::Key(KeyEvent { code: KeyCode::Char(letter), modifiers, .. }) = event else { return false };
        let is_alt = modifiers.contains(KeyModifiers::ALT);
        let began = self.began.filter(|(at, _)| now.duration_since(*at) < GRACE);
        let (next, holds) = match (began, letter) {
            (None, '_') if is_alt => (Some((now, false)), true),
            (None, _) => (None, false),
            (Some((at, false)), 'G') => (Some((at, true)), true),
            (Some((_, false)), _) => (None, false),
            (Some((_, true)), '\\') if is_alt => (None, true),
            (Some(begun @ (_, true)), _) => (Some(begun), true),
        };
        self.began = next;
        holds
    }
}
