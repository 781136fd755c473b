//! A text becomes rows of cells: at one separator for the whole text where its heading has one, else line by line.

use super::{
    columns::Said,
    headings::{has_addresses, is_heading},
    sections::title_of,
};

/// Most rows of a list.
pub const ROWS_MAX: usize = 10_000;
/// What is further right in a row is not read: each heading is compared with all others.
const COLUMNS_MAX: usize = 1_000;
/// A cell may have several lines; one with more has lost its closing quote.
const CELL_LINES_MAX: usize = 40;

/// A row of a list.
#[derive(Debug, Clone, PartialEq)]
pub struct Cells {
    /// Number of its first line, from 1.
    pub line: usize,
    /// Trimmed.
    pub cells: Vec<String>,
    /// It has swallowed what follows.
    pub is_unclosed: bool,
    /// A line is drawn below it, as below the heading of a table of Markdown.
    pub is_ruled: bool,
}

/// The separator that the rows have in common: tab, semicolon, bar or comma; that of a heading, else as in most of its first
/// lines.
pub fn separator(text: &str, said: &Said) -> Option<char> {
    let first: Vec<&str> =
        text.lines().filter(|line| !line.trim().is_empty() && !line.starts_with('#')).take(20).collect();
    let all = ['\t', ';', '|', ','];
    let heads = |separator: char| {
        let headings = first.iter().filter_map(|line| separated(line, separator).into_iter().next());
        headings
            .filter(|row| is_heading(&row.cells, said))
            .map(|row| row.cells.len())
            .max()
            .map(|count| (count, separator))
    };
    // Of several the one with most cells; `|` of Markdown and a tab come before what may stand within a cell.
    let heading = all.into_iter().rev().filter_map(heads).max_by_key(|(count, _)| *count);
    heading.map(|(_, separator)| separator).or_else(|| {
        all.into_iter().find(|separator| {
            // A single comma may be that of a decimal number.
            let least = if matches!(separator, ',' | '|') { 2 } else { 1 };
            let has = first.iter().filter(|line| least <= line.matches(*separator).count()).count();
            0 < has && first.len() <= 2 * has
        })
    })
}

/// A cell that a spreadsheet takes for a text, where it would take it for a formula.
pub fn as_text(cell: String) -> String {
    let is_formula = cell.starts_with(['=', '+', '-', '@', '\'', '\t']) && cell.parse::<f64>().is_err();
    if is_formula { format!("'{cell}") } else { cell }
}

/// What [`as_text`] was given.
pub fn of_text(cell: &str) -> &str {
    cell.strip_prefix('\'').filter(|rest| rest.starts_with(['=', '+', '-', '@', '\'', '\t'])).unwrap_or(cell)
}

/// The rows of a text with what separates its cells; blank rows and those of Markdown's rule are left out.
pub fn rows(text: &str, separator: Option<char>, said: &Said) -> Vec<Cells> {
    let all = match separator {
        Some(separator) => separated(text, separator),
        None => text.lines().zip(1..).map(|(line, number)| row(number, by_blanks(line))).collect(),
    };
    without_rules(all, said)
}

/// The same rows without those that only draw a line, are blank or a comment. A `#` may also head a column of numbers.
pub fn without_rules(mut all: Vec<Cells>, said: &Said) -> Vec<Cells> {
    let is_rule = |cells: &[String]| cells.iter().all(|cell| cell.chars().all(|sign| "-: ".contains(sign)));
    // `|---|---|` stands below the heading of a table; a single `---` ends a part of a text.
    let is_drawn = |pair: &[Cells]| {
        let [row, rule] = pair else { return false };
        2 <= row.cells.len()
            && is_rule(&rule.cells)
            && rule.cells.iter().any(|cell| cell.contains("--"))
            && rule.cells.len() == row.cells.len()
    };
    let ruled: Vec<bool> = all.windows(2).map(is_drawn).collect();
    all.iter_mut().zip(ruled).for_each(|(row, is_ruled)| row.is_ruled = is_ruled);
    let is_marked = |row: &Cells| row.cells.first().is_some_and(|cell| cell.starts_with('#'));
    let is_bare = |row: &Cells| row.cells.first().is_some_and(|cell| cell == "#");
    let is_numbered = all.iter().any(|row| is_bare(row) && is_heading(&row.cells, said));
    // `#address;name` heads the rows, unless another row does.
    let is_only = !all.iter().any(|row| !is_marked(row) && is_heading(&row.cells, said));
    let is_comment = |row: &Cells| is_marked(row) && !is_numbered && !(is_only && is_heading(&row.cells, said));
    let has_marks = all.iter().any(is_marked);
    let mut heading: Option<Vec<String>> = None;
    let mut is_left_out = |row: &Cells| {
        let is_new = has_marks && (is_only || !is_marked(row)) && is_heading(&row.cells, said);
        heading = Some(&row.cells).filter(|_| is_new).cloned().or(heading.take());
        let is_row = || heading.as_ref().is_some_and(|heading| is_row_below(heading, &row.cells, said));
        // `## Input registers` is no comment, and the heading of the next part is none.
        is_rule(&row.cells) || is_comment(row) && !is_row() && title_of(&row.cells).is_none()
    };
    all.into_iter().filter(|row| !is_left_out(row)).take(ROWS_MAX).collect()
}

/// Is it a row although its name begins with `#`? A number stands below the heading of addresses, and it is not the first
/// cell, whose `#` makes a comment of it.
fn is_row_below(heading: &[String], cells: &[String], said: &Said) -> bool {
    let is_address = |(heading, cell): (&String, &String)| {
        cell.bytes().any(|byte| byte.is_ascii_digit()) && has_addresses(std::slice::from_ref(heading), said)
    };
    heading.len() == cells.len() && heading.iter().zip(cells).skip(1).any(is_address)
}

fn row(line: usize, cells: Vec<String>) -> Cells {
    Cells { line, cells, is_unclosed: false, is_ruled: false }
}

/// Stands for a bar of Markdown that is part of its cell, `\|`; no text has it.
const ESCAPED_BAR: &str = "\u{1F}";

fn separated(text: &str, separator: char) -> Vec<Cells> {
    let bars = (separator == '|' && text.contains("\\|")).then(|| text.replace("\\|", ESCAPED_BAR));
    let text = bars.as_deref().unwrap_or(text);
    let mut reader = csv::ReaderBuilder::new();
    let delimiter = u8::try_from(separator).unwrap_or(b',');
    let reader = reader.has_headers(false).flexible(true).delimiter(delimiter).trim(csv::Trim::All);
    let records = reader.from_reader(text.as_bytes()).into_records();
    // A text in memory is read to its end.
    let records: Vec<csv::StringRecord> = records.filter_map(Result::ok).collect();
    let place = |number: u64| usize::try_from(number).unwrap_or(0);
    let starts = |n: usize| records.get(n).and_then(csv::StringRecord::position);
    let rows = records.iter().enumerate().map(|(n, record)| {
        // It begins before the blank lines that are passed over.
        let line = starts(n).map_or(0, |at| {
            let rest = text.get(place(at.byte())..).unwrap_or_default();
            place(at.line()) + rest.lines().take_while(|line| line.trim().is_empty()).count()
        });
        let end = starts(n + 1).map_or(text.len(), |at| place(at.byte()));
        let written = starts(n).and_then(|at| text.get(place(at.byte())..end)).unwrap_or_default();
        let is_unclosed =
            record.iter().any(|cell| CELL_LINES_MAX < cell.lines().count()) || is_open(written, separator);
        let mut cells: Vec<String> = record.iter().take(COLUMNS_MAX).map(one_line).collect();
        if separator == '|' {
            // Markdown has one at both ends.
            cells.pop_if(|last| last.is_empty());
            cells.drain(..usize::from(cells.first().is_some_and(String::is_empty)));
            cells.iter_mut().for_each(|cell| *cell = without_markup(cell).to_owned());
        }
        Cells { line, cells, is_unclosed, is_ruled: false }
    });
    rows.collect()
}

/// Where in a cell something stands.
#[derive(Clone, Copy)]
enum Within {
    Start,
    Plain,
    Quotes,
    Behind,
}

/// Is a quote of a row never closed, or by one that opens a cell of a later line?
fn is_open(written: &str, separator: char) -> bool {
    let (mut within, mut has_lines) = (Within::Start, false);
    for sign in written.trim_start().chars() {
        within = match (within, sign) {
            (Within::Quotes, '"') => Within::Behind,
            (Within::Quotes, _) => {
                has_lines |= sign == '\n';
                Within::Quotes
            }
            (Within::Start, '"') => {
                has_lines = false;
                Within::Quotes
            }
            // Two are one sign of the cell.
            (Within::Behind, '"') => Within::Quotes,
            (_, sign) if sign == separator || sign == '\n' => Within::Start,
            (Within::Behind, _) if has_lines && !sign.is_whitespace() => return true,
            (Within::Behind, _) => Within::Behind,
            (Within::Start | Within::Plain, _) => Within::Plain,
        };
    }
    matches!(within, Within::Quotes)
}

/// What stands in marks of Markdown: `` `0x0001` ``, `**0x0001**`.
fn without_markup(cell: &str) -> &str {
    let within = |mark: &&str| {
        let inner = cell.strip_prefix(*mark)?.strip_suffix(*mark)?.trim();
        Some(inner).filter(|inner| !inner.is_empty() && !inner.contains(*mark))
    };
    ["**", "__", "`", "*"].iter().find_map(within).map_or(cell, without_markup)
}

/// Lines of digits alone are several numbers, not the groups of one.
fn one_line(cell: &str) -> String {
    let lines: Vec<&str> = cell.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
    let are_numbers = lines.iter().all(|line| line.bytes().all(|byte| byte.is_ascii_digit()));
    lines.join(if are_numbers { ", " } else { " " }).replace(ESCAPED_BAR, "|")
}

/// The cells of a line of a PDF: at two blanks, else at every blank; or at what separates them in this line alone.
fn by_blanks(line: &str) -> Vec<String> {
    let line = line.trim_matches(['\u{FEFF}', '\r']);
    let separator = ['\t', ';', ','].into_iter().find(|separator| line.contains(*separator));
    let decimal_comma = separator == Some(',') && line.matches(',').count() == 1;
    match separator.filter(|_| !decimal_comma) {
        Some(separator) => separated(line, separator).into_iter().next().map_or(Vec::new(), |row| row.cells),
        None if line.trim().contains("  ") => {
            line.split("  ").map(|cell| cell.trim().to_owned()).filter(|cell| !cell.is_empty()).collect()
        }
        None => line.split_whitespace().map(str::to_owned).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_of_separators_is_cut_at_the_last_column() {
        let text = format!("a{}\n5,b\n", ",x".repeat(5_000_000));
        let lengths: Vec<usize> = rows(&text, Some(','), &Said::new()).iter().map(|row| row.cells.len()).collect();
        assert_eq!(lengths, [COLUMNS_MAX, 2]);
    }

    #[test]
    fn a_quoted_cell_keeps_its_separators_quotes_and_lines() {
        let text = "a,b,c\n5,\"a, \"\"b\"\"\",10\" pipe\n\n6,\"two\nlines\",x\n";
        let rows = rows(text, separator(text, &Said::new()), &Said::new());
        let cells: Vec<(usize, Vec<String>)> = rows.into_iter().map(|row| (row.line, row.cells)).collect();
        let row = |cells: [&str; 3]| cells.map(str::to_owned).to_vec();
        let expect =
            [(1, row(["a", "b", "c"])), (2, row(["5", "a, \"b\"", "10\" pipe"])), (4, row(["6", "two lines", "x"]))];
        assert_eq!(cells, expect);
        let open = format!("a;b\n1;\"{}", "x;y\n".repeat(60));
        assert!(super::rows(&open, separator(&open, &Said::new()), &Said::new())[1].is_unclosed);
    }

    #[test]
    fn a_table_of_markdown_has_rows() {
        let text = "| Address | Name |\n|---|:--|\n| 5 | Run |\n";
        let rows = rows(text, separator(text, &Said::new()), &Said::new());
        assert_eq!(rows.iter().map(|row| row.cells.join("+")).collect::<Vec<_>>(), ["Address+Name", "5+Run"]);
        let escaped = "| Address | Name | Notes |\n|---|---|---|\n| 5 | `A\\|B` | one \\| two |\n";
        let cells =
            super::rows(escaped, separator(escaped, &Said::new()), &Said::new()).pop().expect("it has rows").cells;
        assert_eq!(cells, ["5", "A|B", "one | two"], "a bar that is part of its cell");
        assert_eq!(separator("40010 Tank 0,1 cm\n40011 Flow 0,1 l\n", &Said::new()), None, "a decimal comma");
    }
}
