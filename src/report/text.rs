//! A report as plain lines of at most 80 columns, for a printer, a mail and the terminal.

use unicode_width::UnicodeWidthStr;

use super::{
    ReportFormat, Style, TagFigures,
    document::{Cell, ColumnKind, Content, Document, Fact, Section, Table},
};
use crate::plant::exact::{Exact, digits};

/// Columns of a page.
const WIDTH: usize = 80;
/// A column of texts, which wrap, is at least as wide as its longest word, up to this.
const TEXT_MIN: usize = 14;

/// The format `text`.
#[derive(Debug)]
pub struct Text;

impl ReportFormat for Text {
    fn name(&self) -> &'static str {
        "text"
    }
    fn about(&self) -> &'static str {
        "plain text of 80 columns"
    }

    fn extension(&self) -> &'static str {
        "txt"
    }

    fn render(&self, document: &Document, _style: &Style) -> Result<Vec<u8>, String> {
        Ok((lines(document, WIDTH).join("\n") + "\n").into_bytes())
    }
}

/// The report as lines of at most `width` columns; a missing figure is `–`.
pub fn lines(document: &Document, width: usize) -> Vec<String> {
    document.locale.within(|| {
        let head = [&document.logo, &document.title, &document.heading, &document.times_line()];
        let head = head.into_iter().filter(|line| !line.is_empty());
        let mut lines: Vec<String> = head.flat_map(|line| wrapped(line, width)).collect();
        for section in &document.sections {
            section_lines(document, section, width, &mut lines);
        }
        lines
    })
}

fn section_lines(document: &Document, section: &Section, width: usize, lines: &mut Vec<String>) {
    let body: Vec<String> = match &section.content {
        Content::Facts(facts) => fact_lines(document, facts, width),
        Content::Table(table) => table_lines(document, &table.dense(), width),
        Content::Signatures(names) => {
            let line = |name: &String| wrapped(&format!("{name} {}", "_".repeat(30)), width);
            names.iter().flat_map(|name| std::iter::once(String::new()).chain(line(name))).collect()
        }
        Content::Charts(_) => return,
    };
    lines.push(String::new());
    lines.extend(wrapped(&section.title, width));
    lines.push("-".repeat(section.title.width().min(width)));
    lines.extend(body);
}

fn fact_lines(document: &Document, facts: &[Fact], width: usize) -> Vec<String> {
    let name = facts.iter().map(|fact| fact.name.width()).max().unwrap_or(0);
    let fact = |fact: &Fact| {
        let room = width.saturating_sub(name + 2).max(TEXT_MIN);
        let words = document.fact(&fact.cell);
        let begins = std::iter::once(fact.name.as_str()).chain(std::iter::repeat(""));
        let lines = wrapped(&words, room).into_iter().zip(begins);
        lines.map(|(words, begin)| format!("{}  {words}", padded(begin, name, false))).collect::<Vec<_>>()
    };
    facts.iter().flat_map(fact).collect()
}

fn table_lines(document: &Document, table: &Table, width: usize) -> Vec<String> {
    let words = |row: &Vec<Cell>| -> Vec<String> {
        row.iter().zip(&table.columns).map(|(cell, column)| document.words(cell, column.kind)).collect()
    };
    let rows: Vec<Vec<String>> = table.rows.iter().map(words).collect();
    let headings: Vec<String> = table.columns.iter().map(|column| column.heading.clone()).collect();
    let widths = widths(table, &headings, &rows, width);
    let fit = (0..widths.len()).take_while(|n| widths[..=*n].iter().sum::<usize>() + n <= width).count();
    if fit < widths.len() && 1 < widths.len() {
        // What is too wide goes on below, under its first column.
        let [above, below] = table.split(fit.max(1)).map(|table| table_lines(document, &table, width));
        return above.into_iter().chain([String::new()]).chain(below).collect();
    }
    let rule = widths.iter().map(|width| "-".repeat(*width)).collect::<Vec<_>>().join(" ");
    let mut lines = row_lines(table, &headings, &widths);
    lines.push(rule);
    lines.extend(rows.iter().flat_map(|row| row_lines(table, row, &widths)));
    lines
}

/// Widths of columns that keep every number and time whole: headings wrap first, then texts.
fn widths(table: &Table, headings: &[String], rows: &[Vec<String>], width: usize) -> Vec<usize> {
    let longest = |text: &str| text.split(' ').map(UnicodeWidthStr::width).max().unwrap_or(0);
    let cells = |n: usize| rows.iter().map(|row| row[n].width()).max().unwrap_or(0);
    let word = |n: usize| rows.iter().map(|row| longest(&row[n])).max().unwrap_or(0);
    let mut widths: Vec<usize> = (0..headings.len()).map(|n| cells(n).max(headings[n].width())).collect();
    let over = |widths: &[usize]| (widths.iter().sum::<usize>() + widths.len()).saturating_sub(width + 1);
    while 0 < over(&widths) {
        let spare = |n: usize| {
            let least = match table.columns[n].kind {
                ColumnKind::Text => word(n).min(TEXT_MIN),
                ColumnKind::Number | ColumnKind::Time | ColumnKind::Milliseconds => cells(n),
            };
            let least = least.max(longest(&headings[n]));
            widths[n].saturating_sub(least)
        };
        let widest = (0..widths.len()).filter(|n| 0 < spare(*n)).max_by_key(|n| {
            let heading_only = cells(*n) < widths[*n];
            (heading_only, widths[*n])
        });
        let Some(widest) = widest else { break };
        widths[widest] -= 1;
    }
    widths
}

fn row_lines(table: &Table, cells: &[String], widths: &[usize]) -> Vec<String> {
    let cells: Vec<Vec<String>> = cells.iter().zip(widths).map(|(cell, width)| wrapped(cell, *width)).collect();
    let height = cells.iter().map(Vec::len).max().unwrap_or(0);
    let line = |at: usize| {
        let parts = cells.iter().zip(&table.columns).zip(widths).map(|((lines, column), width)| {
            let right = column.kind == ColumnKind::Number;
            padded(lines.get(at).map_or("", String::as_str), *width, right)
        });
        parts.collect::<Vec<_>>().join(" ").trim_end().to_owned()
    };
    (0..height).map(line).collect()
}

fn wrapped(text: &str, width: usize) -> Vec<String> {
    textwrap::wrap(text, width.max(1)).into_iter().map(|line| line.into_owned()).collect()
}

fn padded(text: &str, width: usize, right: bool) -> String {
    let spaces = " ".repeat(width.saturating_sub(text.width()));
    if right { spaces + text } else { text.to_owned() + &spaces }
}

/// `54.32`; of a counter `+12.5`, its difference; of neither a dash.
pub fn mean_or_difference(tag: &TagFigures) -> String {
    match (tag.mean, tag.difference) {
        // A mean has one decimal more than its values.
        (Some(mean), _) => digits(mean, Some(tag.decimals.saturating_add(1))),
        (None, Some(difference)) => {
            let sign = if difference < Exact::default() { "" } else { "+" };
            format!("{sign}{}", digits(difference, Some(tag.decimals)))
        }
        (None, None) => "—".into(),
    }
}
