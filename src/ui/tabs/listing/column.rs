//! A column of a list: its heading, how wide it is, its text in each row, and the order that it gives.

use std::{cmp::Ordering, ops::Deref};

use crate::ui::tabs::prelude::*;

pub struct Column<R: ?Sized> {
    pub head: &'static str,
    width: Width,
    /// Filled from the left.
    is_right: bool,
    /// Where there is no room those of the highest rank are left out first; never one of rank 0.
    rank: u8,
    text: Text<R>,
    order: Option<fn(&R, &R) -> Ordering>,
    /// How its cell looks in a row that is not selected; `None`: as the row.
    pub style: Option<fn(&ViewContext, &R) -> Style>,
    /// Rows can be sorted by it.
    pub sorts: bool,
    /// A long text goes on over the empty cells behind it.
    runs_on: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Width {
    Fixed(u16),
    /// That of the widest of its texts.
    Widest,
    /// What the others leave, at least so much.
    Rest(u16),
}

enum Text<R: ?Sized> {
    Plain(fn(&ViewContext, &R) -> String),
    /// Of so many cells.
    Fitting(fn(&ViewContext, &R, u16) -> String),
}

/// A column that is filled from the right.
pub fn left<R: ?Sized>(width: u16, head: &'static str, text: fn(&ViewContext, &R) -> String) -> Column<R> {
    Column::new(Width::Fixed(width), head, Text::Plain(text))
}

/// A column of figures, filled from the left.
pub fn right<R: ?Sized>(width: u16, head: &'static str, text: fn(&ViewContext, &R) -> String) -> Column<R> {
    Column { is_right: true, ..left(width, head, text) }
}

/// A column whose text is given its width.
pub fn fitted<R: ?Sized>(width: u16, head: &'static str, text: fn(&ViewContext, &R, u16) -> String) -> Column<R> {
    Column::new(Width::Fixed(width), head, Text::Fitting(text))
}

/// The last column, which has what the others leave, at least so much; its text is given the room.
pub fn rest<R: ?Sized>(least: u16, head: &'static str, text: fn(&ViewContext, &R, u16) -> String) -> Column<R> {
    Column::new(Width::Rest(least), head, Text::Fitting(text))
}

impl<R: ?Sized> Column<R> {
    fn new(width: Width, head: &'static str, text: Text<R>) -> Column<R> {
        Column { head, width, is_right: false, rank: 0, text, order: None, style: None, sorts: true, runs_on: false }
    }
    /// A column of words that is as wide as the widest of its texts.
    pub fn words(head: &'static str, text: fn(&ViewContext, &R) -> String) -> Column<R> {
        Column::new(Width::Widest, head, Text::Plain(text))
    }
    /// The same of figures, filled from the left.
    pub fn number(head: &'static str, text: fn(&ViewContext, &R) -> String) -> Column<R> {
        Column { is_right: true, ..Column::words(head, text) }
    }
    /// The same, left out where there is no room: those of the highest rank first.
    pub fn rank(self, rank: u8) -> Column<R> {
        Column { rank, ..self }
    }
    /// The same where its texts do not give the order.
    pub fn by(self, order: fn(&R, &R) -> Ordering) -> Column<R> {
        Column { order: Some(order), ..self }
    }

    /// The same where it is not known of every row: nothing is sorted by it.
    pub fn unsorted(self) -> Column<R> {
        Column { sorts: false, ..self }
    }
    /// The same with cells that look as this says.
    pub fn styled(self, style: fn(&ViewContext, &R) -> Style) -> Column<R> {
        Column { style: Some(style), ..self }
    }
    /// The same, read after the others.
    pub fn dim(self) -> Column<R> {
        self.styled(|cx, _| cx.theme.dim())
    }
    /// The same with texts that may go on over the empty cells behind it.
    pub fn runs_on(self) -> Column<R> {
        Column { runs_on: true, ..self }
    }

    fn aligned(&self, text: &str, width: u16) -> String {
        if self.is_right { pad_left(text, width) } else { pad(text, width) }
    }

    /// Its text in so many cells.
    pub fn text(&self, cx: &ViewContext, row: &R, room: u16) -> String {
        match self.text {
            Text::Plain(text) => text(cx, row),
            Text::Fitting(text) => text(cx, row, room),
        }
    }

    /// The rows in the order of this column; what it does not know comes last either way.
    pub fn sorted<T: Deref<Target = R>>(&self, cx: &ViewContext, rows: Vec<T>, reversed: bool) -> Vec<T> {
        let texts = rows.into_iter().map(|row| (self.text(cx, &row, u16::MAX), row));
        let (mut known, unknown): (Vec<_>, Vec<_>) = texts.partition(|(text, _)| text.contains(char::is_alphanumeric));
        known.sort_by(|(one, a), (other, b)| self.order.map_or_else(|| natural(one, other), |order| order(a, b)));
        if reversed {
            known.reverse();
        }
        known.into_iter().chain(unknown).map(|(_, row)| row).collect()
    }
}

/// The columns that there is room for, each with its width; of some it is that of their widest text.
pub fn placed<R: ?Sized>(
    columns: Vec<Column<R>>,
    room: u16,
    widest: impl Fn(&Column<R>) -> u16,
) -> Vec<(Column<R>, u16)> {
    let least = |column: Column<R>| {
        let width = match column.width {
            Width::Fixed(width) | Width::Rest(width) => width,
            Width::Widest => widest(&column).max(width(column.head)),
        };
        (column, width)
    };
    let mut columns: Vec<(Column<R>, u16)> = columns.into_iter().map(least).collect();
    let taken =
        |columns: &[(Column<R>, u16)]| columns.iter().map(|(_, width)| width + 1).sum::<u16>().saturating_sub(1);
    while room < taken(&columns) {
        let Some(last @ 1..) = columns.iter().map(|(column, _)| column.rank).max() else { break };
        columns.retain(|(column, _)| column.rank < last);
    }
    let all = taken(&columns);
    let of_rest = columns.iter_mut().filter(|(column, _)| matches!(column.width, Width::Rest(_)));
    of_rest
        .for_each(|(_, width)| *width = (*width + room.saturating_sub(all)).saturating_sub(all.saturating_sub(room)));
    columns
}

/// A row of headings. Of one that has no room for three letters nothing is shown.
pub fn heads<R: ?Sized>(columns: &[(Column<R>, u16)]) -> String {
    let cell = |(column, width): &(Column<R>, u16)| match (*width, text::width(column.head)) {
        (room @ ..3, wanted) if room < wanted => " ".repeat(usize::from(room)),
        _ => column.aligned(column.head, *width),
    };
    columns.iter().map(cell).collect::<Vec<_>>().join(" ")
}

/// The cells of a row, each with the cell of the screen that it begins at; between them is a blank.
pub fn cells<R: ?Sized>(cx: &ViewContext, columns: &[(Column<R>, u16)], row: &R) -> Vec<(u16, String)> {
    let texts: Vec<String> = columns.iter().map(|(column, width)| column.text(cx, row, *width)).collect();
    let aligned = columns.iter().zip(&texts).map(|((column, width), text)| column.aligned(text, *width));
    let mut x = 0;
    let place = |cell: String| {
        let from = x;
        x += text::width(&cell) + 1;
        (from, cell)
    };
    let mut cells: Vec<(u16, String)> = aligned.map(place).collect();
    for (n, ((column, width), text)) in columns.iter().zip(&texts).enumerate() {
        if column.runs_on && *width < text::width(text) {
            run_on(&mut cells[n..], text);
        }
    }
    cells
}

/// Lays a text over the first of these cells and the blanks behind it, but one before what follows.
fn run_on(cells: &mut [(u16, String)], text: &str) {
    let [(from, cell), behind @ ..] = cells else { return };
    let first = behind.iter().find(|(_, text)| !text.trim_start().is_empty());
    let end = match (first, behind.last()) {
        (Some((x, text)), _) => x + text::width(text) - text::width(text.trim_start()) - 1,
        (None, Some((x, text))) => x + text::width(text),
        (None, None) => *from + text::width(cell),
    };
    *cell = fit(text, end.saturating_sub(*from));
    let taken = *from + text::width(cell);
    for (x, text) in behind.iter_mut().take_while(|(x, _)| *x < taken) {
        *text = text.chars().skip(usize::from(taken - *x)).collect();
        *x = taken;
    }
}

/// The figure that a text begins with.
pub fn figure(text: &str) -> Option<f64> {
    let figure = text.trim_start_matches(['>', '<', '≥', '≤', ' ']).split_whitespace().next()?;
    // What is uncertain is marked behind its figure.
    figure.trim_end_matches('?').parse().ok()
}

/// Numbers by their size, `9:05` before `10:01`, other texts by their letters.
fn natural(a: &str, b: &str) -> Ordering {
    match (figure(a), figure(b)) {
        (Some(a), Some(b)) => a.total_cmp(&b),
        (Some(_), None) => Ordering::Less,
        (None, Some(_)) => Ordering::Greater,
        (None, None) => parts(a).cmp(&parts(b)),
    }
}

/// Runs of digits and of letters; digits stand before letters.
fn parts(text: &str) -> Vec<(bool, u64, String)> {
    let text = text.to_lowercase();
    let mut parts = Vec::new();
    let mut rest = text.as_str();
    while let Some(first) = rest.chars().next() {
        let is_number = first.is_ascii_digit();
        let end = rest.find(|letter: char| letter.is_ascii_digit() != is_number).unwrap_or(rest.len());
        let (part, behind) = rest.split_at(end);
        parts.push((!is_number, part.parse().unwrap_or(0), part.to_owned()));
        rest = behind;
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_ordered_as_they_are_read() {
        let check = |sorted: &[&str]| {
            let mut texts: Vec<&str> = sorted.iter().rev().copied().collect();
            texts.sort_by(|a, b| natural(a, b));
            assert_eq!(texts, sorted);
        };
        check(&["-2.5", "-1", "0.5", ">1.2", "10"]);
        check(&["-5.0 °C", "-1 °C", "20.5 °C", "100.0 °C"]);
        check(&["9:05", "10:01", "10:15", "never"]);
        check(&["anna", "Berta", "carl"]);
        check(&["hot-water-9", "hot-water-10"]);
    }

    /// A sort panics where three texts are each below the next.
    #[test]
    fn any_three_cells_have_one_order() {
        let texts =
            ["-5.0", "-3.0?", "-1.0", "9.25", "9.3?", "2", "3/4", "9:05", "never", "–", "20 °C", "-3 °C?", ">1.2"];
        for a in texts {
            for b in texts {
                assert_eq!(natural(a, b), natural(b, a).reverse(), "{a} {b}");
                for c in texts.into_iter().filter(|c| natural(a, b).is_le() && natural(b, c).is_le()) {
                    assert!(natural(a, c).is_le(), "{a} {b} {c}");
                }
            }
        }
        assert_eq!(natural("-3.0?", "-1.0"), Ordering::Less, "an uncertain figure is one");
    }

    #[test]
    fn columns_of_the_highest_rank_give_way_first() {
        let columns = || {
            let text: fn(&ViewContext, &u8) -> String = |_, _| String::new();
            let last = rest(4, "d", |_, _, _| String::new());
            vec![left(10, "a", text), right(8, "b", text).rank(1), Column::words("c", text).rank(2), last]
        };
        let shown = |room| {
            placed(columns(), room, |_| 3).into_iter().map(|(column, width)| (column.head, width)).collect::<Vec<_>>()
        };
        assert_eq!(shown(40), [("a", 10), ("b", 8), ("c", 3), ("d", 16)]);
        assert_eq!(shown(25), [("a", 10), ("b", 8), ("d", 5)]);
        assert_eq!(shown(13), [("a", 10), ("d", 2)], "the others always stand");
    }
}
