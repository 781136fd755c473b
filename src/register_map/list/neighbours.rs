//! What a column means by what stands in those beside it.

use super::{
    cells::Cells,
    columns::Column,
    words::{is_sized_type, type_of},
};

/// Lengths that fit the types of their rows as bytes, and none as registers, are bytes.
pub fn count_bytes(means: &mut [Option<Column>], rows: &[Cells]) {
    let at = |column: Column| means.iter().position(|means| *means == Some(column));
    let (Some(kind), Some(length)) = (at(Column::Type), at(Column::Length)) else { return };
    let sized = rows.iter().filter_map(|row| {
        let kind = row.cells.get(kind).filter(|cell| is_sized_type(cell)).and_then(|cell| type_of(cell, None).ok())?;
        Some((kind.0.registers(), row.cells.get(length)?.parse::<u16>().ok()?))
    });
    let sized: Vec<(u16, u16)> = sized.collect();
    if !sized.is_empty() && sized.iter().all(|(registers, length)| 2 * registers == *length) {
        means[length] = Some(Column::Bytes);
    }
}
