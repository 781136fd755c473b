//! Rows of styled words that scroll, words that flow into rows, and tables that leave out columns where there is no room.

use ratatui::style::Style;

use super::text::{Canvas, fit_words, pad, pad_left, width};
use crate::{plant::number::to_u16, t, text::translate, ui::ViewContext};

/// A row of the screen: words with their looks, one behind the other.
pub type Spans = Vec<(String, Style)>;

/// A row of one look.
pub fn plain(text: impl Into<String>, style: Style) -> Spans {
    vec![(text.into(), style)]
}

/// Draws rows from `first` on, a column free on the left; says how many more there are below.
pub fn draw(cx: &ViewContext, canvas: &mut Canvas, rows: &[Spans], first: usize) {
    let height = usize::from(canvas.height());
    // The last row says how much there is more, so that the mark covers nothing.
    let room = if rows.len() <= height { height } else { height.saturating_sub(1) };
    let first = first.min(last_first(rows.len(), height));
    for (y, row) in rows.iter().skip(first).take(room).enumerate() {
        let mut x = 1;
        for (text, style) in row {
            // A gap at the end of a row is nothing that is cut.
            if text.trim().is_empty() {
                x += width(text);
                continue;
            }
            let text = fit_words(text, canvas.width().saturating_sub(x));
            x = canvas.text(x, to_u16(y), if text == "…" { "" } else { &text }, *style);
        }
    }
    let below = rows.len().saturating_sub(first + room);
    let above = if 0 < first { format!(" {first} ▲") } else { String::new() };
    let mark = if 0 < below { t!("{above} {below} more ▼", above, below) } else { above };
    canvas.text_right(canvas.width().saturating_sub(1), canvas.height().saturating_sub(1), &mark, cx.theme.strong());
}

/// The greatest first row that [`draw`] makes use of.
pub fn last_first(count: usize, height: usize) -> usize {
    if count <= height { 0 } else { count - height.saturating_sub(1) }
}

/// Columns of the label of a flow.
const LABEL: u16 = 10;

/// Words that flow into rows of this width behind a label; those of one part stay together.
pub fn flow(label: &str, style: Style, room: u16, parts: impl IntoIterator<Item = Spans>) -> Vec<Spans> {
    let (mut rows, mut at) = (vec![plain(pad(label, LABEL), style)], LABEL);
    for part in parts {
        let long: u16 = part.iter().map(|(text, _)| width(text)).sum();
        if room.saturating_sub(2) < at + long && LABEL < at {
            rows.push(plain(pad("", LABEL), Style::new()));
            at = LABEL;
        }
        if let Some(row) = rows.last_mut() {
            row.extend(part);
            row.push(("   ".to_owned(), Style::new()));
        }
        at += long + 3;
    }
    rows
}

pub struct TableColumn {
    pub title: &'static str,
    /// Numbers stand at the right.
    pub right: bool,
    /// The greatest is the first to be left out.
    pub need: u8,
}

pub const fn words(title: &'static str, need: u8) -> TableColumn {
    TableColumn { title, right: false, need }
}

pub const fn number(title: &'static str, need: u8) -> TableColumn {
    TableColumn { title, right: true, need }
}

/// Headings and lines of a table, as wide as their widest cell; columns that do not fit are left out whole.
pub fn table<const N: usize>(columns: &[TableColumn; N], lines: &[[String; N]], room: u16) -> (String, Vec<String>) {
    let widest =
        |n: usize| lines.iter().map(|line| width(&line[n])).max().unwrap_or(0).max(width(translate(columns[n].title)));
    let mut kept: Vec<(usize, u16)> = (0..N).map(|n| (n, widest(n))).collect();
    while room < kept.iter().map(|(_, width)| width + 1).sum::<u16>() && 1 < kept.len() {
        let Some(least) = kept.iter().map(|(n, _)| columns[*n].need).max() else { break };
        kept.retain(|(n, _)| columns[*n].need != least);
    }
    let line = |cells: &dyn Fn(usize) -> String| {
        let cell = |(n, width): &(usize, u16)| {
            let text = cells(*n);
            if columns[*n].right { pad_left(&text, *width) } else { pad(&text, *width) }
        };
        kept.iter().map(cell).collect::<Vec<_>>().join(" ")
    };
    let heading = line(&|n| translate(columns[n].title).to_owned());
    (heading, lines.iter().map(|cells| line(&|n| cells[n].clone())).collect())
}

#[cfg(test)]
mod tests {
    use ratatui::{buffer::Buffer, layout::Rect};

    use super::*;
    use crate::ui::fixture::{Fixture, with_cx};

    #[test]
    fn a_table_without_room_leaves_out_whole_columns() {
        let columns = [words("device", 0), number("ok", 1), number("jitter", 9)];
        let lines = [["TIC-1", "812", "3"], ["PLC-1", "7", "12"]].map(|line| line.map(str::to_owned));
        let check = |room, heading: &str, first: &str| {
            let (shown, rows) = table(&columns, &lines, room);
            assert_eq!((shown.as_str(), rows[0].as_str()), (heading, first), "{room}");
        };
        check(40, "device  ok jitter", "TIC-1  812      3");
        check(17, "device  ok", "TIC-1  812");
        check(9, "device", "TIC-1 ");
    }

    #[test]
    fn words_flow_into_the_next_row_whole() {
        let parts = ["sent 1 200", "received 48 000", "x"].map(|text| plain(text, Style::new()));
        let rows: Vec<String> = flow("bytes", Style::new(), 33, parts)
            .iter()
            .map(|row| row.iter().map(|(text, _)| text.as_str()).collect::<String>())
            .collect();
        assert_eq!(rows, ["bytes     sent 1 200   ", "          received 48 000   x   "]);
    }

    #[test]
    fn a_gap_at_the_end_of_a_row_is_not_marked_as_cut() {
        with_cx(&Fixture::normal().snapshot(), |cx| {
            let mut buffer = Buffer::empty(Rect::new(0, 0, 13, 1));
            let row = vec![("sent 1 200".to_owned(), Style::new()), ("   ".to_owned(), Style::new())];
            draw(cx, &mut Canvas::new(&mut buffer, Rect::new(0, 0, 13, 1)), &[row], 0);
            let shown: String = buffer.content.iter().map(|cell| cell.symbol()).collect();
            assert_eq!(shown, " sent 1 200  ");
        });
    }
}
