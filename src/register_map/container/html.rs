//! The tables of a page, as rows of cells.

use std::{collections::BTreeMap, rc::Rc};

use html5gum::{Token, Tokenizer};

use crate::register_map::list::{cells::Cells, titled};

/// A cell that spans more than this is a mistake.
const SPAN_MAX: usize = 64;
/// What is further right in a row is not read.
const COLUMNS_MAX: usize = 1_000;
/// Most bytes of texts that stand in more cells than one; the cells beyond have none.
const COPIED_MAX: usize = 64 << 20;
const ROWS_MAX: usize = 20_000;

/// The rows of all tables of a page, in their order.
#[derive(Default)]
struct Tables {
    tables: Vec<Vec<Cells>>,
    depth: usize,
    line: usize,
    row: Option<Cells>,
    cell: Option<(String, usize, usize)>,
    /// The last heading above, or caption.
    title: String,
    is_in_title: bool,
    /// Cells of a row above that reach into this one, by column: rows left, text.
    hanging: BTreeMap<usize, (usize, Rc<str>)>,
    copied: usize,
}

/// Each table of a page.
pub fn tables(text: &str) -> Vec<Vec<Cells>> {
    let mut tables = Tables { line: 1, ..Tables::default() };
    let mut starts = text.match_indices("<tr").map(|(at, _)| at);
    let mut lines = Lines { text, at: 0, line: 1 };
    for Ok(token) in Tokenizer::new(text) {
        match token {
            Token::StartTag(tag) => {
                if &**tag.name == b"tr" {
                    tables.line = starts.next().map_or(tables.line, |at| lines.of(at));
                }
                let number = |name: &[u8]| {
                    let value =
                        tag.attributes.get(name).map(|value| String::from_utf8_lossy(&value.value).into_owned());
                    value.and_then(|value| value.trim().parse::<usize>().ok()).unwrap_or(1).clamp(1, SPAN_MAX)
                };
                tables.open(&tag.name, number(b"colspan"), number(b"rowspan"));
            }
            Token::EndTag(tag) => tables.close(&tag.name),
            Token::String(text) => {
                if tables.is_in_title {
                    tables.title.push_str(&String::from_utf8_lossy(&text.value));
                } else if let Some((cell, ..)) = &mut tables.cell {
                    cell.push_str(&String::from_utf8_lossy(&text.value));
                }
            }
            Token::Comment(_) | Token::Doctype(_) | Token::Error(_) => {}
        }
    }
    tables.end_row();
    tables.tables.retain(|rows| !rows.is_empty());
    tables.tables
}

/// Counts lines up to places that rise.
struct Lines<'a> {
    text: &'a str,
    at: usize,
    line: usize,
}

impl Lines<'_> {
    fn of(&mut self, at: usize) -> usize {
        self.line += self.text.get(self.at..at).map_or(0, |between| between.matches('\n').count());
        self.at = at;
        self.line
    }
}

fn copy(text: &str, copied: &mut usize) -> String {
    *copied += text.len();
    if COPIED_MAX < *copied { String::new() } else { text.to_owned() }
}

impl Tables {
    fn open(&mut self, name: &[u8], columns: usize, rows: usize) {
        match name {
            b"table" => {
                self.depth += 1;
                self.tables.push(titled(&self.title).into_iter().collect());
                self.hanging.clear();
            }
            b"h1" | b"h2" | b"h3" | b"h4" | b"h5" | b"h6" | b"caption" => {
                self.title.clear();
                self.is_in_title = true;
            }
            b"tr" => {
                self.end_row();
                self.row = Some(Cells { line: self.line, cells: Vec::new(), is_unclosed: false, is_ruled: false });
            }
            b"td" | b"th" => {
                self.end_cell();
                self.cell = Some((String::new(), columns, rows));
            }
            // Words on two lines are two words.
            _ => self.cell.iter_mut().for_each(|(text, ..)| text.push(' ')),
        }
    }

    fn close(&mut self, name: &[u8]) {
        match name {
            b"table" => {
                self.end_row();
                self.depth = self.depth.saturating_sub(1);
            }
            b"tr" => self.end_row(),
            b"td" | b"th" => self.end_cell(),
            b"caption" => {
                self.is_in_title = false;
                self.tables.last_mut().into_iter().for_each(|rows| rows.extend(titled(&self.title)));
            }
            b"h1" | b"h2" | b"h3" | b"h4" | b"h5" | b"h6" => self.is_in_title = false,
            _ => self.cell.iter_mut().for_each(|(text, ..)| text.push(' ')),
        }
    }

    fn hang(&mut self) {
        let Some(row) = &mut self.row else { return };
        while let Some((rows, text)) = self.hanging.get_mut(&row.cells.len()).filter(|(rows, _)| 0 < *rows) {
            *rows -= 1;
            row.cells.push(copy(text, &mut self.copied));
        }
    }

    fn end_cell(&mut self) {
        let Some((text, columns, rows)) = self.cell.take() else { return };
        self.hang();
        let Some(row) = &mut self.row else { return };
        let text: Rc<str> = text.split_whitespace().collect::<Vec<_>>().join(" ").into();
        for _ in 0..columns.min(COLUMNS_MAX.saturating_sub(row.cells.len())) {
            if 1 < rows {
                self.hanging.insert(row.cells.len(), (rows - 1, Rc::clone(&text)));
            }
            row.cells.push(copy(&text, &mut self.copied));
        }
    }

    fn end_row(&mut self) {
        self.end_cell();
        self.hang();
        self.hanging.retain(|_, (rows, _)| 0 < *rows);
        let (Some(row), Some(table)) = (self.row.take(), self.tables.last_mut()) else { return };
        if row.cells.iter().any(|cell| !cell.is_empty()) && table.len() < ROWS_MAX {
            table.push(row);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_has_rows_with_lines_spans_and_characters() {
        let page = "<!DOCTYPE html><p>x</p>\n<TABLE><tr><th>Address<th>Name</tr>\n\
                    <tr><td rowspan=2>5</td><td>A &amp; B<br>&deg;C</td></tr>\n<tr><td>second</table>";
        let shown: Vec<(usize, String)> =
            tables(page).concat().into_iter().map(|row| (row.line, row.cells.join("|"))).collect();
        let expect = [(2, "Address|Name"), (3, "5|A & B °C"), (4, "5|second")];
        assert_eq!(shown, expect.map(|(line, text)| (line, text.to_owned())));
    }
}
