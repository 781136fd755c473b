//! The characters of a picture by column and row, each with its place in the file.

use crate::profile::{diagnostic::Span, reader::At};
use unicode_width::UnicodeWidthChar;

/// A text as cells: a combining mark shares the cell of its letter, a wide character takes two.
pub(super) struct Grid {
    rows: Vec<Vec<Cell>>,
    width: usize,
    /// The byte of the file where each row begins; `None` where escapes hide it.
    starts: Option<Vec<usize>>,
    whole: Span,
}

#[derive(Clone, Default)]
struct Cell {
    text: String,
    /// Bytes of its row before it.
    byte: usize,
}

impl Grid {
    /// The cells of a string of the file, whose whole text is `source`.
    pub fn new(picture: &At<String>, source: &str) -> Grid {
        let lines: Vec<&str> = picture.value.trim_end().lines().collect();
        let rows: Vec<Vec<Cell>> = lines.iter().map(|line| cells(line)).collect();
        let width = rows.iter().map(Vec::len).max().unwrap_or(0);
        Grid { rows, width, starts: starts(picture.at, source, &lines), whole: picture.at }
    }
    /// Columns and rows.
    pub fn size(&self) -> (usize, usize) {
        (self.width, self.rows.len())
    }
    /// The character of a cell, a blank outside.
    pub fn get(&self, x: usize, y: usize) -> char {
        self.rows.get(y).and_then(|row| row.get(x)).and_then(|cell| cell.text.chars().next()).unwrap_or(' ')
    }
    /// The text of some cells of a row.
    pub fn text(&self, y: usize, from: usize, to: usize) -> String {
        let row = self.rows.get(y).map_or(&[][..], Vec::as_slice);
        row.iter().take(to).skip(from).map(|cell| cell.text.as_str()).collect()
    }
    /// Makes cells of a row blank; their places stay known.
    pub fn clear(&mut self, x: usize, y: usize, width: usize) {
        let row = self.rows.get_mut(y).map_or(&mut [][..], Vec::as_mut_slice);
        row.iter_mut().skip(x).take(width).for_each(|cell| cell.text = " ".to_owned());
    }
    /// Where cells of a row stand in the file.
    pub fn span(&self, x: usize, y: usize, width: usize) -> Span {
        let Some(start) = self.starts.as_ref().and_then(|starts| starts.get(y)) else { return self.whole };
        let row = self.rows.get(y).map_or(&[][..], Vec::as_slice);
        let end = row.last().map_or(0, |cell| cell.byte + cell.text.len());
        let byte = |x: usize| row.get(x).map_or(end, |cell| cell.byte);
        Span { start: start + byte(x), end: start + byte(x + width.max(1)), ..self.whole }
    }
}

fn cells(line: &str) -> Vec<Cell> {
    let mut cells: Vec<Cell> = Vec::new();
    for (byte, letter) in line.char_indices() {
        match (letter.width().unwrap_or(0), cells.last_mut()) {
            (0, Some(last)) => last.text.push(letter),
            (columns, _) => {
                cells.push(Cell { text: letter.to_string(), byte });
                cells.extend((1..columns).map(|_| Cell { text: String::new(), byte }));
            }
        }
    }
    cells
}

/// Where each line of a string in `'''` or `"""` begins in the file; `None` where the string is not written as it reads.
fn starts(at: Span, source: &str, lines: &[&str]) -> Option<Vec<usize>> {
    let written = source.get(at.start..at.end)?;
    let body = written.strip_prefix("\"\"\"").or_else(|| written.strip_prefix("'''"))?;
    let body = body.strip_prefix("\r\n").or_else(|| body.strip_prefix('\n')).unwrap_or(body);
    let mut start = at.end - body.len();
    let mut starts = Vec::new();
    for (written, line) in body.split_inclusive('\n').zip(lines) {
        if written.trim_end_matches(['\r', '\n', '"', '\'']) != line.trim_end_matches(['"', '\'']) {
            return None;
        }
        starts.push(start);
        start += written.len();
    }
    (starts.len() == lines.len()).then_some(starts)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(source: &str) -> Grid {
        let text = source.trim_start_matches("p = '''\n").trim_end_matches("'''\n").to_owned();
        let at = Span { source: 0, start: 4, end: source.len() - 1 };
        Grid::new(&At { value: text, at }, source)
    }

    #[test]
    fn cells_count_as_a_terminal_shows_them() {
        let grid = grid("p = '''\nถังน้ำ{A}\n  ─┐\n'''\n");
        assert_eq!(grid.size(), (7, 2), "marks share a cell, sara am has one of its own");
        assert_eq!((grid.get(4, 0), grid.get(3, 1), grid.get(99, 99)), ('{', '┐', ' '));
        assert_eq!(grid.text(0, 0, 4), "ถังน้ำ");
    }

    #[test]
    fn a_cell_is_found_in_the_file() {
        let source = "p = '''\nถังน้ำ{A}\n  ─┐\n'''\n";
        let grid = grid(source);
        let text = |span: Span| &source[span.start..span.end];
        assert_eq!(text(grid.span(4, 0, 3)), "{A}");
        assert_eq!(text(grid.span(3, 1, 1)), "┐");
    }

    #[test]
    fn an_escape_hides_the_place_but_not_the_picture() {
        let source = "p = \"\"\"\n\\u2500 x\n\"\"\"\n";
        let at = Span { source: 0, start: 4, end: source.len() - 1 };
        let grid = Grid::new(&At { value: "─ x\n".to_owned(), at }, source);
        assert_eq!((grid.get(0, 0), grid.span(2, 0, 1)), ('─', at));
    }
}
