//! Lines between the rows that name the table of those below: `## Input registers`, `Coils;;;`, the name of a sheet. A heading
//! of Markdown that names none ends such a part, unless it is below it.

use super::{
    cells::Cells,
    columns::{Column, first_of, is_address},
    row::{Row, unfit},
    titles,
};
use crate::plant::{
    address::{AddressBase, of_modicon, wire},
    tag::Table,
};

/// The table that a line names for what stands below it.
fn table_below(cells: &[String]) -> Option<Table> {
    let mut filled = cells.iter().filter(|cell| !cell.is_empty());
    let first = filled.next()?;
    // One that spans several columns stands in each.
    titles::table_of(first).filter(|_| filled.all(|cell| cell == first))
}

/// A line between rows: how many `#` stand before it, and the table that it names. One `#` alone may as well be a comment.
pub fn title_of(cells: &[String]) -> Option<(usize, Option<Table>)> {
    let first = cells.first()?;
    let level = first.chars().take_while(|sign| *sign == '#').count();
    let is_heading = || 2 <= level && first.contains(char::is_alphabetic) && cells[1..].iter().all(String::is_empty);
    let table = table_below(cells);
    (table.is_some() || is_heading()).then_some((level, table))
}

/// A title above rows, such as the name of their sheet, as a line of its own where it names a table.
pub fn titled(title: &str) -> Option<Cells> {
    let cells = vec![title.to_owned()];
    table_below(&cells).map(|_| Cells { line: 0, cells, is_unclosed: false, is_ruled: false })
}

/// The rows without such lines, and of each its number with the table, if one holds from there on.
pub fn split(all: &[Cells], is_separated: bool) -> (Vec<Cells>, Vec<(usize, Option<Table>)>) {
    let (mut sections, mut section_level) = (Vec::new(), 0);
    let (mut rows, mut is_below) = (Vec::new(), false);
    for row in all {
        let joined = [row.cells.join(" ")];
        // The words of a line of a PDF are a cell each.
        let cells = if is_separated { &row.cells } else { &joined[..] };
        let title = title_of(cells).filter(|_| !row.cells.iter().any(|cell| is_address(cell)));
        match title {
            Some((level, table)) if table.is_some() || level <= section_level => {
                sections.push((row.line, table));
                section_level = level;
            }
            Some(_) => {}
            None => rows.push(row.clone()),
        }
        is_below |= title.is_none();
    }
    // A list of nothing but such lines is none, which its refusal says of all of them.
    if is_below { (rows, sections) } else { (all.to_vec(), Vec::new()) }
}

/// Gives the rows the tables of their sections. One without a table where others of its list have a cell for it has none:
/// merged cells leave such gaps.
pub fn assign(rows: &mut [Row], sections: &[(usize, Option<Table>)], is_stated: bool, base: Option<AddressBase>) {
    let is_some_stated = rows.iter().any(|row| row.is_tabled && row.table.is_some());
    // Where numbers are known to be as sent, or to count from 1, none of those digits is one of Modicon.
    let is_counted = |text: &str| matches!(base, Some(AddressBase::Zero | AddressBase::One)) && wire(text).is_some();
    for row in rows.iter_mut().filter(|row| row.table.is_none()) {
        let Some(written) = row.address.as_deref().map(first_of) else { continue };
        let modicon = of_modicon(written).filter(|_| !is_counted(written)).map(|(table, _)| table);
        let above = sections.iter().rev().find(|(line, _)| *line <= row.line).and_then(|(_, table)| *table);
        // A number of another table says more than a line far above.
        row.table = above.filter(|above| modicon.is_none_or(|table| table == *above));
        row.is_titled = row.table.is_some();
        let is_clear = row.table.is_some() || modicon.is_some() || is_stated || written.contains(':');
        if is_some_stated && row.is_tabled && !is_clear {
            row.wrong.get_or_insert(unfit(Column::Table, ""));
        }
    }
}
