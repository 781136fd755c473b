//! What stands below each heading of a list, or in a list without one.

use super::{
    List, ListContext, base,
    cells::Cells,
    columns::{Column, Columns, Said, is_address, is_heading},
    headings::{Heading, has_addresses},
    row::Row,
    words::number_of,
};
use crate::t;

/// The rows of a list; `Err` where it is none.
pub fn rows(all: &[Cells], is_separated: bool, context: &ListContext, list: &mut List) -> Result<Vec<Row>, String> {
    let parts = parts(all, &context.means);
    let Some((first, _)) = parts.iter().find(|(_, is_list)| *is_list) else {
        return by_form(all, is_separated, &context.means);
    };
    let mut rows: Vec<Row> = all[..*first].iter().map(|row| Row::without_cells(row.line)).collect();
    for (n, (start, is_list)) in parts.iter().enumerate().filter(|(_, (start, _))| first <= start) {
        let end = parts.get(n + 1).map_or(all.len(), |(next, _)| *next);
        let (heading, below) = (&all[*start], &all[start + 1..end]);
        if *is_list {
            rows.extend(below_heading(&heading.cells, below, is_separated, context, list));
        } else {
            let why = no_addresses(&heading.cells);
            rows.extend(below.iter().map(|row| Row::refused(row.line, why.clone())));
        }
    }
    Ok(rows)
}

/// Where a table begins, and whether it is one of registers. Where lines are drawn below headings, no other row is one.
fn parts(all: &[Cells], said: &Said) -> Vec<(usize, bool)> {
    let is_list = |row: &Cells| is_heading(&row.cells, said);
    let is_drawn = all.iter().any(|row| row.is_ruled && is_list(row));
    let part = |(n, row): (usize, &Cells)| {
        let is_part = if is_drawn { row.is_ruled } else { is_list(row) };
        is_part.then(|| (n, is_list(row)))
    };
    all.iter().enumerate().filter_map(part).collect()
}

fn below_heading(
    heading: &[String],
    below: &[Cells],
    is_separated: bool,
    context: &ListContext,
    list: &mut List,
) -> Vec<Row> {
    let columns = Columns::new(heading, below, &context.means);
    list.is_sure |= columns.is_sure;
    let is_named = columns.means.contains(&Some(Column::Name));
    if let Some(n) = columns.means.iter().position(Option::is_none).filter(|_| !is_named) {
        let column = &columns.headings[n];
        list.warnings.push(t!("no column of names: `--column \"{column}=name\"` says which it is", column));
    }
    let place = columns.places(Column::Address).into_iter().map(|n| &columns.headings[n]).next();
    if let Some(column) = place.filter(|column| !columns.is_sure && Heading::new(column).is_place()) {
        list.warnings.push(t!("`{column}` is taken for the address of a register", column));
    }
    let named = columns.headings.iter().cloned().zip(columns.means.iter().copied());
    list.add_columns(named.collect(), columns.open.clone());
    let row = |row: &Cells| {
        // A line of a PDF with other columns than the heading is taken by its form.
        if is_separated || row.cells.len() == heading.len() { Row::headed(&columns, row) } else { of_form(row) }
    };
    let mut rows: Vec<Row> = below.iter().map(row).collect();
    base::contradicting(&mut rows);
    let has_commas = below.iter().flat_map(|row| &row.cells).any(|cell| is_with_comma(cell));
    for (row, cells) in rows.iter_mut().zip(below) {
        // Of a row without an address, any may be that.
        let is_any = row.address.is_none();
        let is_used = |n: usize| !columns.is_sure && (is_any || columns.means.get(n).is_some_and(Option::is_some));
        without_formulas(row, cells, is_used);
        let numbers = [Column::Scale, Column::Divisor, Column::Offset, Column::Min, Column::Max];
        let places = numbers.into_iter().flat_map(|column| columns.places(column));
        let mut found = places.filter_map(|place| cells.cells.get(place)).filter(|cell| is_of_thousands(cell));
        if let Some(cell) = found.next().filter(|_| has_commas) {
            row.wrong.get_or_insert(t!("`{cell}` is a number with three decimals, or thousands", cell));
        }
    }
    rows
}

/// `0,1`: the list has decimal commas, and its points may be those of thousands.
fn is_with_comma(cell: &str) -> bool {
    cell.contains(',') && !cell.contains(' ') && number_of(cell).is_some()
}

/// `1.000`, which then is one or a thousand.
fn is_of_thousands(cell: &str) -> bool {
    let is_digits = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    let cell = cell.trim_start_matches(['-', '+', 'x', 'X', '*', '×', '/', '÷', ' ']);
    cell.split_once('.')
        .is_some_and(|(first, rest)| is_digits(first) && !first.starts_with('0') && is_digits(rest) && rest.len() == 3)
}

/// A program that writes a workbook may leave the value of a formula to a spreadsheet: nothing is known of such a row.
fn without_formulas(row: &mut Row, cells: &Cells, is_used: impl Fn(usize) -> bool) {
    let is_formula = |cell: &str| cell.starts_with('=') && !cell.starts_with("==");
    let mut all = cells.cells.iter().enumerate();
    let Some((_, cell)) = all.find(|(n, cell)| is_formula(cell) && is_used(*n)) else { return };
    let why = t!("`{cell}` is a formula without its value: open and save the file in a spreadsheet program", cell);
    match row.address.as_deref().is_some_and(is_address) {
        true => row.wrong = Some(why),
        false => *row = Row::refused(row.line, why),
    }
}

/// A row that is known by the form of its cells, all of which count.
fn of_form(cells: &Cells) -> Row {
    let mut row = Row::by_form(cells.line, &cells.cells);
    without_formulas(&mut row, cells, |_| true);
    if cells.is_unclosed { Row::refused(cells.line, t!("a quote is never closed").to_owned()) } else { row }
}

/// Rows without a heading; `Err` where they are no list.
fn by_form(all: &[Cells], is_separated: bool, said: &Said) -> Result<Vec<Row>, String> {
    let Some(first) = all.first() else { return Err(t!("it is empty").to_owned()) };
    if is_separated && !first.cells.iter().any(|cell| is_address(cell)) {
        // Prose above a table is no heading of it.
        let count = |row: &Cells| row.cells.iter().filter(|cell| !cell.is_empty()).count();
        let with_addresses = all.iter().find(|row| 2 <= count(row) && has_addresses(&row.cells, said));
        if let Some(row) = with_addresses {
            let heading = row.cells.join(", ");
            let is_other = |cell: &&String| !cell.is_empty() && !Heading::new(cell).is_strong_address();
            let column = row.cells.iter().find(is_other).map_or("", String::as_str);
            return Err(t!(
                "its heading has no column of names: {heading}. `--column \"{column}=name\"` says which it is",
                heading,
                column
            ));
        }
        let ruled = all.iter().find(|row| row.is_ruled && 2 <= count(row));
        return Err(no_addresses(&ruled.unwrap_or(first).cells));
    }
    let rows: Vec<Row> = all.iter().map(of_form).collect();
    let (found, count) = (rows.iter().filter(|row| row.address.is_some()).count(), rows.len());
    if 2 * found < count {
        return Err(t!("only {found} of its {count} lines have an address", found, count));
    }
    Ok(rows)
}

fn no_addresses(heading: &[String]) -> String {
    t!("its heading has no column of addresses: {heading}", heading = heading.join(", "))
}
