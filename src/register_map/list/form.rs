//! A row without a heading: its cells are known by their form alone.

use super::{
    columns::{first_of, is_address, span_of},
    row::Row,
    words::{is_marked, kind_of, number_of, order_of, table_of},
};
use crate::{
    plant::address::of_modicon,
    profile::{is_known_unit, unit_of},
    t,
};

impl Row {
    /// Without a heading: an address, a type, a unit, a scale and an order are known by their form; the rest is the name.
    pub fn by_form(line: usize, cells: &[String]) -> Row {
        let mut row = Row::without_cells(line);
        // What is sure is one anywhere; a plain number, which may be a page or count the rows, only in front.
        let is_sure = |cell: &&String| {
            let first = first_of(cell);
            is_address(cell) && (of_modicon(first).is_some() || !is_plain(first))
        };
        let sure = cells.iter().find(is_sure);
        row.address = sure.or_else(|| cells.first().filter(|cell| is_address(cell))).cloned();
        row.length = row.address.as_deref().and_then(span_of);
        // A number that stands alone may be a factor, a length or part of a name; one with decimals or a mark is a factor.
        let mut numbers: Vec<&str> = Vec::new();
        let mut words: Vec<&str> = Vec::new();
        for (n, cell) in cells.iter().enumerate() {
            let counts = n == 0 && is_plain(cell);
            if cell.is_empty() || counts || Some(cell) == row.address.as_ref() {
                continue;
            }
            if row.kind.is_none() && kind_of(cell).is_some() {
                row.kind = Some(cell.clone());
            } else if let (None, Some(order)) = (row.order, order_of(cell)) {
                row.order = Some(order);
            } else if let (None, Some(table)) = (row.table, table_of(cell).filter(|_| number_of(cell).is_none())) {
                row.table = Some(table);
            } else if number_of(cell).is_some_and(|number| number != 0.0 && (number.fract() != 0.0 || is_marked(cell)))
            {
                row.refuse_second(row.scale.is_some(), cell);
                row.scale = number_of(cell);
            } else if number_of(cell).is_some() && !is_within_name(cells, n) && cell != "1" {
                numbers.push(cell);
            } else if row.unit.is_empty() && is_unit(cell) {
                row.unit = unit_of(cell);
            } else {
                words.push(cell);
            }
        }
        row.refuse_numbers(&numbers);
        row.name = words.join(" ");
        row
    }

    fn refuse_second(&mut self, is_second: bool, cell: &str) {
        if is_second {
            self.wrong.get_or_insert(t!("`{cell}` is a second factor", cell));
        }
    }

    /// What plain numbers mean only a heading can say.
    fn refuse_numbers(&mut self, numbers: &[&str]) {
        if let Some(number) = numbers.first() {
            self.wrong.get_or_insert(t!("what is `{number}`? Add a heading above the columns", number));
        }
    }
}

/// `Zone 2 temperature`: a number between words of a line that has no columns.
fn is_within_name(cells: &[String], n: usize) -> bool {
    let is_word = |at: Option<usize>| {
        let cell = at.and_then(|at| cells.get(at));
        cell.is_some_and(|cell| {
            cell.chars().all(char::is_alphabetic)
                && !is_unit(cell)
                && kind_of(cell).is_none()
                && order_of(cell).is_none()
        })
    };
    is_word(n.checked_sub(1)) && is_word(Some(n + 1))
}

/// A unit among the words of a name: `m³/h`, `degC`, but neither `in` nor `hours`.
fn is_unit(cell: &str) -> bool {
    let is_word = cell == "in" || cell.bytes().all(|byte| byte.is_ascii_lowercase()) && unit_of(cell) != cell;
    is_known_unit(cell) && !is_word
}

fn is_plain(text: &str) -> bool {
    text.bytes().all(|byte| byte.is_ascii_digit())
}
