//! Text on a clipped canvas: no widget can write outside its area, whatever the size of the screen.

use std::time::Duration;

use jiff::{Timestamp, tz::TimeZone};
use ratatui::{buffer::Buffer, layout::Rect, style::Style};
use unicode_segmentation::UnicodeSegmentation;
use unicode_width::UnicodeWidthStr;

use crate::{
    plant::{
        number::{Number, to_u16},
        time::elapsed,
    },
    t,
    text::weekday,
    ui::glyph_filter::cells,
};

#[cfg(test)]
pub(crate) use tests::take_overwritten;

/// A rectangle of the screen with coordinates of its own; what falls outside is not drawn.
#[derive(Debug)]
pub struct Canvas<'a> {
    buffer: &'a mut Buffer,
    area: Rect,
}

impl<'a> Canvas<'a> {
    /// A canvas over a part of the buffer.
    pub fn new(buffer: &'a mut Buffer, area: Rect) -> Canvas<'a> {
        let area = area.intersection(buffer.area);
        Canvas { buffer, area }
    }
    /// Columns.
    pub fn width(&self) -> u16 {
        self.area.width
    }
    /// Rows.
    pub fn height(&self) -> u16 {
        self.area.height
    }
    /// A part of this canvas as a canvas of its own.
    pub(crate) fn part(
        &mut self,
        x: impl Number,
        y: impl Number,
        width: impl Number,
        height: impl Number,
    ) -> Canvas<'_> {
        let (x, y) = (self.area.x.saturating_add(to_u16(x)), self.area.y.saturating_add(to_u16(y)));
        let wanted = Rect::new(x, y, to_u16(width), to_u16(height));
        Canvas { area: wanted.intersection(self.area), buffer: self.buffer }
    }
    /// Writes text; returns the column after it.
    pub(crate) fn text(&mut self, x: impl Number, y: impl Number, text: &str, style: Style) -> u16 {
        let (x, y, text) = (to_u16(x), to_u16(y), cells(text));
        if y < self.area.height && x < self.area.width {
            let room = usize::from(self.area.width - x);
            #[cfg(test)]
            tests::note_overwritten(self, x, y, &text);
            self.buffer.set_stringn(self.area.x + x, self.area.y + y, &text, room, style);
        }
        x.saturating_add(width(&text))
    }
    /// Writes rows of text, one below the other; returns the row after them.
    pub(crate) fn rows(&mut self, x: impl Number, y: impl Number, rows: &[(String, Style)]) -> u16 {
        let (x, y) = (to_u16(x), to_u16(y));
        for (n, (text, style)) in rows.iter().enumerate() {
            self.text(x, usize::from(y) + n, text, *style);
        }
        y.saturating_add(to_u16(rows.len()))
    }
    /// Writes text that ends before column `end`.
    pub(crate) fn text_right(&mut self, end: impl Number, y: impl Number, text: &str, style: Style) {
        self.text(to_u16(end).saturating_sub(width(text)), y, text, style);
    }
    /// Writes text in the middle of a row.
    pub(crate) fn text_centred(&mut self, y: impl Number, text: &str, style: Style) {
        self.text(self.width().saturating_sub(width(text)) / 2, y, text, style);
    }
    pub(crate) fn glyph(&mut self, x: impl Number, y: impl Number, glyph: char, style: Style) {
        if let Some(cell) = self.cell(to_u16(x), to_u16(y)) {
            cell.set_char(glyph).set_style(style);
        }
    }
    /// A horizontal run of one character.
    pub(crate) fn run(&mut self, x: impl Number, y: impl Number, length: impl Number, glyph: char, style: Style) {
        let (x, y, length) = (to_u16(x), to_u16(y), to_u16(length));
        for column in x..x.saturating_add(length).min(self.area.width) {
            self.glyph(column, y, glyph, style);
        }
    }
    /// Adds a style to a rectangle without changing its characters.
    pub(crate) fn paint(
        &mut self,
        x: impl Number,
        y: impl Number,
        width: impl Number,
        height: impl Number,
        style: Style,
    ) {
        let area = self.part(x, y, width, height).area;
        self.buffer.set_style(area, style);
    }
    /// Blanks everything.
    pub fn clear(&mut self) {
        for y in 0..self.height() {
            for x in 0..self.width() {
                if let Some(cell) = self.cell(x, y) {
                    cell.reset();
                }
            }
        }
    }
    /// A frame along the edge, with a title.
    pub fn frame(&mut self, title: &str, style: Style) {
        let (right, bottom) = (self.width().saturating_sub(1), self.height().saturating_sub(1));
        self.run(0, 0, self.width(), '─', style);
        self.run(0, bottom, self.width(), '─', style);
        for y in 0..self.height() {
            self.glyph(0, y, '│', style);
            self.glyph(right, y, '│', style);
        }
        for (x, y, corner) in [(0, 0, '┌'), (right, 0, '┐'), (0, bottom, '└'), (right, bottom, '┘')] {
            self.glyph(x, y, corner, style);
        }
        if !title.is_empty() {
            let text = fit(&format!(" {title} "), self.width().saturating_sub(4));
            self.text(2, 0, &text, style);
        }
    }
    /// The character that stands at a place.
    pub fn symbol(&self, x: u16, y: u16) -> Option<&str> {
        self.buffer.cell((self.area.x + x, self.area.y + y)).map(|cell| cell.symbol())
    }
    /// Is nothing written in these cells? What would stand outside is never blank, but for one cell behind the last column.
    pub fn is_blank(&self, x: u16, y: u16, length: u16) -> bool {
        let end = x.saturating_add(length);
        let inside = y < self.area.height && end <= self.area.width.saturating_add(1);
        inside && (x..end.min(self.area.width)).all(|column| self.symbol(column, y) == Some(" "))
    }
    /// The part of the screen under this canvas.
    pub fn area(&self) -> Rect {
        self.area
    }
    /// The buffer, for widgets of the library.
    pub fn buffer(&mut self) -> &mut Buffer {
        self.buffer
    }

    fn cell(&mut self, x: u16, y: u16) -> Option<&mut ratatui::buffer::Cell> {
        let inside = x < self.area.width && y < self.area.height;
        inside.then(|| self.buffer.cell_mut((self.area.x + x, self.area.y + y))).flatten()
    }
}

/// Columns that a text takes.
pub fn width(text: &str) -> u16 {
    to_u16(text.width())
}

/// The text, cut with `…` where it is too wide.
pub fn fit(text: &str, room: u16) -> String {
    if width(text) <= room {
        return text.to_owned();
    }
    let head = head(text, room.saturating_sub(1));
    // A phrase of Thai reads better whole than cut in a word, if most of the room is used.
    let phrase = head.rfind(BREAK).map(|at| &head[..at]).filter(|phrase| width(phrase) * 4 >= room * 3);
    format!("{}{}", phrase.unwrap_or(head), if room > 0 { "…" } else { "" })
}

/// Where a line of Thai may break, between two words: takes no column, and is not drawn.
const BREAK: char = '\u{200b}';

/// As much of the text as fits. A letter keeps its marks, and a vowel that is written before its consonant does not stand
/// alone.
fn head(text: &str, room: u16) -> &str {
    let mut used = 0;
    let wide = |cluster: &str| {
        used += width(cluster);
        used > room
    };
    let end = text.grapheme_indices(true).zip(text.graphemes(true).map(wide)).find(|(_, is_wide)| *is_wide);
    let head = end.map_or(text, |((at, _), _)| &text[..at]);
    head.trim_end_matches(|c| ('\u{e40}'..='\u{e44}').contains(&c))
}

/// The text, or `##` where it does not fit: for numbers, a part of which is another number.
pub fn whole(text: &str, room: u16) -> String {
    if width(text) <= room { text.to_owned() } else { "#".repeat(usize::from(room.min(2))) }
}

/// The text, cut with `…` between two words, so that no number in it is cut.
pub fn fit_words(text: &str, room: u16) -> String {
    if width(text) <= room {
        return text.to_owned();
    }
    let ends = text.match_indices([' ', BREAK]).map(|(at, _)| &text[..at]);
    match ends.rev().find(|part| width(part) + 2 <= room) {
        Some(part) => format!("{} …", part.trim_end()),
        None if room > 0 => "…".to_owned(),
        None => String::new(),
    }
}

/// The text, cut or filled with blanks to exactly this width.
pub fn pad(text: &str, room: u16) -> String {
    let text = fit(text, room);
    let blanks = room.saturating_sub(width(&text));
    format!("{text}{}", " ".repeat(usize::from(blanks)))
}

/// The text, cut or filled from the left to exactly this width.
pub fn pad_left(text: &str, room: u16) -> String {
    let text = fit(text, room);
    let blanks = room.saturating_sub(width(&text));
    format!("{}{text}", " ".repeat(usize::from(blanks)))
}

/// The text in lines of at most this width, broken between words where possible: at blanks and at U+200B.
pub fn wrap(text: &str, room: u16) -> Vec<String> {
    let mut lines = Vec::new();
    let mut line = String::new();
    for word in text.split(|c: char| c.is_whitespace() && c != NO_BREAK).filter(|word| !word.is_empty()) {
        for (n, part) in word.trim_matches(BREAK).split(BREAK).enumerate() {
            let blank = if n == 0 && !line.is_empty() { " " } else { "" };
            if line.is_empty() || width(&line) + width(blank) + width(part) <= room {
                line.push_str(blank);
            } else {
                lines.push(std::mem::take(&mut line));
            }
            line.push_str(part);
            // Thai of a plant file may have no break points.
            while width(&line) > room && line.contains(is_thai) {
                let rest = line.split_off(head(&line, room).len());
                if line.is_empty() {
                    line = rest;
                    break;
                }
                lines.push(std::mem::replace(&mut line, rest));
            }
        }
    }
    if !line.is_empty() {
        lines.push(line);
    }
    lines.into_iter().map(|line| fit(&line, room)).collect()
}

/// Keeps a number and its unit in one line.
const NO_BREAK: char = '\u{a0}';

fn is_thai(c: char) -> bool {
    ('\u{e01}'..='\u{e5b}').contains(&c)
}

/// How long ago, short: `0.4s`, `12s`, `4m12s`, `3h05m`, `2d`.
pub fn age(span: Duration) -> String {
    let seconds = span.as_secs();
    match seconds {
        0..=99 => format!("{seconds}s"),
        100..=5_999 => t!("{seconds}m{seconds2}s", seconds = seconds / 60, seconds2 = format!("{:02}", seconds % 60)),
        6_000..=172_799 => {
            t!("{seconds}h{seconds2}m", seconds = seconds / 3_600, seconds2 = format!("{:02}", seconds / 60 % 60))
        }
        _ => format!("{}d", seconds / 86_400),
    }
}

/// A running time: `00:41`, `1:02:03`, `2d 03:04`.
pub fn running(span: Duration) -> String {
    let (seconds, minutes, hours) = (span.as_secs() % 60, span.as_secs() / 60 % 60, span.as_secs() / 3_600);
    match hours {
        0 => format!("{minutes:02}:{seconds:02}"),
        1..=23 => format!("{hours}:{minutes:02}:{seconds:02}"),
        _ => format!("{}d {:02}:{minutes:02}", hours / 24, hours % 24),
    }
}

/// Local time of day: `14:02:31`.
pub fn clock(at: Timestamp, zone: &TimeZone) -> String {
    at.to_zoned(zone.clone()).strftime("%H:%M:%S").to_string()
}

/// Local time with its offset, for what leaves the program: `2026-11-21T14:02:31+07:00`.
pub fn stamp(at: Timestamp, zone: &TimeZone) -> String {
    at.to_zoned(zone.clone()).strftime("%Y-%m-%dT%H:%M:%S%:z").to_string()
}

/// Local time in at most nine columns: `14:02:31` today, `Fri 14:02` in the last six days, else `11-02 14h`.
pub fn moment(at: Timestamp, now: Timestamp, zone: &TimeZone) -> String {
    let (days, at) = (elapsed(at, now).as_secs() / 86_400, at.to_zoned(zone.clone()));
    let today = at.date() == now.to_zoned(zone.clone()).date();
    match days {
        _ if today => at.strftime("%H:%M:%S").to_string(),
        0..6 => format!("{} {}", weekday(at.weekday()), at.strftime("%H:%M")),
        _ => at.strftime(t!("%m-%d %Hh")).to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    thread_local! {
        static OVERWRITTEN: std::cell::RefCell<Vec<String>> = const { std::cell::RefCell::new(Vec::new()) };
    }

    /// Texts that were written over other texts of the same frame since the last call, each with what stood there.
    pub(crate) fn take_overwritten() -> Vec<String> {
        OVERWRITTEN.take()
    }

    pub(super) fn note_overwritten(canvas: &Canvas, x: u16, y: u16, text: &str) {
        let end = x.saturating_add(width(text)).min(canvas.width());
        let there: String = (x..end).filter_map(|column| canvas.symbol(column, y)).collect();
        if there.contains(char::is_alphanumeric) && !text.trim().is_empty() && there.trim_end() != text.trim_end() {
            OVERWRITTEN.with_borrow_mut(|all| all.push(format!("{text:?} over {there:?}")));
        }
    }

    #[test]
    fn a_cut_text_says_that_it_is_cut() {
        assert_eq!(fit("temperature", 11), "temperature");
        assert_eq!(fit("temperature", 6), "tempe…");
        assert_eq!(fit("temperature", 1), "…");
        assert_eq!(fit("temperature", 0), "");
        assert_eq!(pad("PV", 4), "PV  ");
        assert_eq!(pad_left("7", 3), "  7");
    }

    #[test]
    fn a_cut_sentence_has_no_cut_number() {
        let check = |room, expect: &str| assert_eq!(fit_words("SV 60.0 → 100.0 °C verified", room), expect, "{room}");
        check(27, "SV 60.0 → 100.0 °C verified");
        check(26, "SV 60.0 → 100.0 °C …");
        check(16, "SV 60.0 → …");
        check(2, "…");
        check(0, "");
        assert_eq!(
            (whole("100.0", 5).as_str(), whole("100.0", 4).as_str(), whole("100.0", 1).as_str()),
            ("100.0", "##", "#")
        );
    }

    #[test]
    fn spans_read_as_a_technician_says_them() {
        let check = |seconds, short: &str, long: &str| {
            let span = Duration::from_secs(seconds);
            assert_eq!((age(span).as_str(), running(span).as_str()), (short, long));
        };
        check(0, "0s", "00:00");
        check(41, "41s", "00:41");
        check(252, "4m12s", "04:12");
        check(11_100, "3h05m", "3:05:00");
        check(200_000, "2d", "2d 07:33");
    }

    #[test]
    fn lines_break_between_words() {
        assert_eq!(wrap("lower SV or stop; check SSR lamp", 12), ["lower SV or", "stop; check", "SSR lamp"]);
        assert_eq!(wrap("", 12), Vec::<String>::new());
    }

    #[test]
    fn thai_is_cut_between_letters_and_broken_between_words() {
        let check = |text: &str, room, expect: &str| assert_eq!(fit(text, room), expect, "{room}");
        check("น้ำร้อน", 5, "น้ำร้อน");
        check("น้ำร้อน", 4, "น้ำร้…");
        check("น้ำร้อน", 2, "…");
        check("ถังแก้ว", 4, "ถัง…");
        check("สัญญาณ\u{200b}เตือน", 9, "สัญญาณ\u{200b}เตือน");
        check("ตรวจสอบ\u{200b}ไฟเลี้ยง", 9, "ตรวจสอบ…");
        let phrase = "ตรวจสอบ\u{200b}ไฟเลี้ยง \u{200b}การเดินสาย \u{200b}และหมายเลข\u{200b}อุปกรณ์";
        let lines: Vec<_> = wrap(phrase, 16).iter().map(|line| line.replace(BREAK, "")).collect();
        assert_eq!(lines, ["ตรวจสอบไฟเลี้ยง", "การเดินสาย", "และหมายเลขอุปกรณ์"]);
        assert_eq!(wrap("ถังน้ำร้อนเต็ม", 5), ["ถังน้ำร้", "อนเต็ม"]);
        assert_eq!(wrap("limit 72.0\u{a0}°C", 8), ["limit", "72.0\u{a0}°C"]);
    }

    #[test]
    fn nothing_is_drawn_outside_a_canvas() {
        let mut buffer = Buffer::empty(Rect::new(0, 0, 6, 3));
        let mut canvas = Canvas::new(&mut buffer, Rect::new(2, 1, 2, 1));
        canvas.text(0, 0, "abcdef", Style::new());
        canvas.text(0, 1, "below", Style::new());
        canvas.glyph(9, 9, 'x', Style::new());
        canvas.part(1, 0, 9, 9).run(0, 0, 9, '-', Style::new());
        let text: String = buffer.content.iter().map(|cell| cell.symbol()).collect();
        assert_eq!(text, "        a-        ");
    }
}
