//! Calculated rows: each becomes an expression over the tags of its registers, which are added where no row has them.

use std::collections::BTreeSet;

use super::{Row, row};
use crate::{
    register_map::{
        list::{
            calculated::{Calculated, Piece},
            conflict,
        },
        named::Named,
    },
    t,
};

/// Adds these rows, and the registers that only they have; how many of the latter. What cannot be said goes to the problems.
pub(super) fn add(
    calculated: &[Calculated],
    rows: &mut Vec<Row>,
    taken: &mut BTreeSet<String>,
    problems: &mut Vec<String>,
) -> usize {
    let mut parts = 0;
    for Calculated { named, pieces } in calculated {
        let before = rows.len();
        let names = taken.clone();
        let mut expr = String::new();
        let done = pieces.iter().try_for_each(|piece| match piece {
            Piece::Text(text) => {
                expr += text;
                Ok(())
            }
            Piece::Of(of) => value_of(named, of, rows, taken).map(|text| expr += &text),
        });
        match done {
            Ok(()) => {
                parts += rows.len() - before;
                rows.push(Row { expr: Some(expr), ..row(named, taken) });
            }
            Err(why) => {
                rows.truncate(before);
                *taken = names;
                let place = t!("line {number}", number = named.line);
                problems.push(format!("{place}: {}: {why}", named.name));
            }
        }
    }
    parts
}

/// The tag of a register, with another factor where its row has another one.
fn value_of(sum: &Named, of: &Named, rows: &mut Vec<Row>, taken: &mut BTreeSet<String>) -> Result<String, String> {
    let of = Named { group: sum.group.clone(), poll: sum.poll, ..of.clone() };
    let registers = || rows.iter().filter(|row| row.expr.is_none());
    // What is no value of the row is none of the sum either.
    let is_it = |row: &&Row| row.named.point() == of.point() && (of.bad_if.is_empty() || of.bad_if == row.named.bad_if);
    if let Some(row) = registers().find(is_it) {
        let is_same = (row.named.scale, row.named.offset) == (of.scale, of.offset);
        let short = &row.tag.short;
        return match is_same {
            true => Ok(short.clone()),
            false if row.named.offset == 0.0 && of.offset == 0.0 => {
                let ratio: f64 = format!("{:.9}", of.scale / row.named.scale).parse().unwrap_or(1.0);
                Ok(format!("({short} * {ratio})"))
            }
            false => Err(conflict(&row.named, &of).unwrap_or_default()),
        };
    }
    if let Some(why) = registers().find_map(|row| conflict(&row.named, &of)) {
        return Err(format!("{}: {why}", of.name));
    }
    let row = row(&of, taken);
    let short = row.tag.short.clone();
    rows.push(row);
    Ok(short)
}
