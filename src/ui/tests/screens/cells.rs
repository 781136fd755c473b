//! Frames of Thai over each other: what a terminal shows after each is what it shows of that frame alone.

use ratatui::{
    backend::{Backend, CrosstermBackend},
    buffer::Buffer,
    layout::Rect,
    style::{Color, Style},
};

use crate::ui::{
    glyph_filter,
    theme::Theme,
    widgets::text::{Canvas, fit, pad, width},
};

const AREA: Rect = Rect::new(0, 0, 32, 4);
const FRAMES: usize = 500;

/// Numbers that are the same in every run (Lehmer).
struct Numbers(u64);

impl Numbers {
    fn below(&mut self, end: usize) -> usize {
        self.0 = self.0 * 48_271 % 2_147_483_647;
        self.0 as usize % end
    }
    fn one_of(&mut self, letters: &str) -> char {
        letters.chars().nth(self.below(letters.chars().count())).unwrap_or(' ')
    }
    /// Letters with vowels and tone marks above, below, before and behind them, figures, blanks and break points.
    fn text(&mut self) -> String {
        let mut text = String::new();
        for _ in 0..self.below(12) {
            match self.below(10) {
                0 => text.push_str(" 72.4 °C "),
                1 => text.push('\u{200b}'),
                2 => text.push_str("น้ำ"),
                _ => {
                    text.extend((self.below(4) == 0).then(|| self.one_of("เแโใไ")));
                    text.push(self.one_of("กขงจตถทนบปมยรลวสหอ"));
                    text.extend((self.below(3) == 0).then(|| self.one_of("ัิีึืุู็์")));
                    text.extend((self.below(3) == 0).then(|| self.one_of("่้๊๋")));
                    text.extend((self.below(3) == 0).then(|| self.one_of("ำาะ")));
                }
            }
        }
        text
    }
}

/// Of so many frames, those after which the screen shows something else than that frame alone.
fn wrong_frames(draw: impl Fn(&mut Buffer, u16, u16, &str, Style), finish: impl Fn(&mut Buffer)) -> usize {
    let mut numbers = Numbers(20_569);
    let send = |parser: &mut vt100::Parser, from: &Buffer, to: &Buffer| {
        let mut bytes = Vec::new();
        CrosstermBackend::new(&mut bytes).draw(from.diff_iter(to)).expect("a vector takes every byte");
        parser.process(&bytes);
    };
    let parser = || vt100::Parser::new(AREA.height, AREA.width, 0);
    let (empty, mut living) = (Buffer::empty(AREA), parser());
    let mut last = empty.clone();
    let mut wrong = 0;
    for _ in 0..FRAMES {
        let mut next = empty.clone();
        for _ in 0..numbers.below(6) {
            let colour = [Color::Reset, Color::Blue, Color::Rgb(96, 128, 152)][numbers.below(3)];
            let (x, y, text) = (numbers.below(32) as u16, numbers.below(4) as u16, numbers.text());
            draw(&mut next, x, y, &text, Style::new().bg(colour));
        }
        finish(&mut next);
        send(&mut living, &last, &next);
        let mut fresh = parser();
        send(&mut fresh, &empty, &next);
        let cells = |parser: &vt100::Parser| {
            let places = (0..AREA.height).flat_map(|row| (0..AREA.width).map(move |column| (row, column)));
            let cells = places.filter_map(|(row, column)| parser.screen().cell(row, column));
            cells.map(|cell| (cell.contents().trim().to_owned(), cell.bgcolor())).collect::<Vec<_>>()
        };
        wrong += usize::from(cells(&living) != cells(&fresh));
        last = next;
    }
    wrong
}

#[test]
fn the_next_frame_leaves_nothing_of_the_last_one() {
    let as_it_is = |buffer: &mut Buffer, x, y, text: &str, style| buffer.set_string(x, y, text, style);
    assert!(wrong_frames(as_it_is, |_| ()) > FRAMES / 2, "the test finds what the rewriting is for");
    let draw = |buffer: &mut Buffer, x, y, text: &str, style| {
        Canvas::new(buffer, AREA).text(x, y, text, style);
    };
    assert_eq!(wrong_frames(draw, |buffer| glyph_filter::apply(buffer, &Theme::FULL)), 0);
    // What is not drawn by a canvas is made right in the cells.
    assert_eq!(wrong_frames(as_it_is, |buffer| glyph_filter::apply(buffer, &Theme::FULL)), 0);
}

#[test]
fn a_text_takes_as_many_cells_as_its_width_says() {
    let mut numbers = Numbers(7);
    for _ in 0..FRAMES {
        let text = numbers.text();
        let mut buffer = Buffer::empty(Rect::new(0, 0, 160, 1));
        let area = buffer.area;
        let end = Canvas::new(&mut buffer, area).text(0, 0, &text, Style::new().bg(Color::Blue));
        let cells = buffer.content.iter().filter(|cell| cell.bg == Color::Blue).count();
        assert_eq!((usize::from(end), end), (cells, width(&text)), "{text:?}");
        for room in 0..20 {
            let (cut, padded) = (fit(&text, room), pad(&text, room));
            assert!(width(&cut) <= room && width(&padded) == room, "{text:?} in {room}: {cut:?}");
            let before = cut.strip_suffix('…').filter(|_| cut != text);
            assert!(
                before.is_none_or(|head| text.starts_with(head) && !head.ends_with(['เ', 'แ', 'โ', 'ใ', 'ไ'])),
                "{cut:?}"
            );
        }
    }
}
