//! What a column means by what stands in those beside it.

use super::{
    cells::Cells,
    columns::{Column, first_of, is_address},
    headings::Heading,
    meanings::{is_bare_hex, is_blank},
    words::{length_of, number_of, type_of},
};
use crate::plant::address::wire;

/// The columns of a list by what each alone can mean.
pub struct Neighbours<'a> {
    pub means: &'a mut [Option<Column>],
    pub headings: &'a [String],
    pub rows: &'a [Cells],
}

impl Neighbours<'_> {
    /// Settles what only the others decide; the column of the last addresses of spans.
    pub fn settle(&mut self) -> Option<usize> {
        self.count_bytes();
        self.find_addresses();
        let all = || 0..self.means.len();
        let places: Vec<usize> = all().filter(|n| self.is_of_addresses(*n)).collect();
        let heading = |n: usize| Heading::new(&self.headings[n]);
        let is_proper = |n: usize| {
            let heading = heading(n);
            let is_bare_decimal = heading.is_decimal() && !heading.is_strong_address();
            !heading.is_place() && !heading.is_last() && !heading.is_of_writes() && !is_bare_decimal
        };
        let proper: Vec<usize> = places.iter().copied().filter(|n| is_proper(*n)).collect();
        let first = proper.first().or(places.first()).copied()?;
        let last = all().find(|n| *n != first && heading(*n).is_last() && self.are_last(first, *n));
        let of_another = |n: usize| match self.means[n] {
            _ if Some(n) == last => Some(None),
            // What moves with the addresses says them once more.
            Some(Column::Offset) => places.iter().any(|place| self.moves(*place, n)).then_some(None),
            Some(Column::Address | Column::HexAddress) if n == first || proper.contains(&n) => None,
            Some(Column::Address | Column::HexAddress) if heading(n).is_of_writes() => Some(Some(Column::WriteAt)),
            Some(Column::Address | Column::HexAddress) if heading(n).is_place() => Some(None),
            Some(Column::Address) if heading(n).is_decimal() => (!self.are_same(first, n)).then_some(None),
            _ => None,
        };
        let settled: Vec<Option<Option<Column>>> = all().map(of_another).collect();
        self.means.iter_mut().zip(settled).for_each(|(means, other)| *means = other.unwrap_or(*means));
        last
    }

    fn is_of_addresses(&self, n: usize) -> bool {
        matches!(self.means[n], Some(Column::Address | Column::HexAddress))
    }

    /// A column of addresses that are none says so row by row; `Start` or `Offset` is one where no other is.
    fn find_addresses(&mut self) {
        if (0..self.means.len()).any(|n| self.is_of_addresses(n)) {
            return;
        }
        let is_free = |n: &usize| {
            let heading = Heading::new(&self.headings[*n]);
            let is_place = heading.is_place() && self.cells(*n).all(is_address);
            is_place || self.means[*n].is_none() && heading.is_strong_address()
        };
        if let Some(n) = (0..self.means.len()).find(is_free) {
            self.means[n] = Some(Column::Address);
        }
    }

    fn cells(&self, n: usize) -> impl Iterator<Item = &str> {
        self.rows.iter().filter_map(move |row| row.cells.get(n)).map(String::as_str).filter(|cell| !is_blank(cell))
    }

    /// The numbers of two columns in the rows that have both; the second is read as what it may mean.
    fn pairs(&self, one: usize, other: (usize, Option<Column>)) -> Vec<[f64; 2]> {
        let number = |row: &Cells, (n, means): (usize, Option<Column>)| {
            let written = row.cells.get(n)?;
            let cell = first_of(written);
            let digits = Some(cell).filter(|cell| means == Some(Column::HexAddress) && is_bare_hex(cell));
            let bare = digits.and_then(|digits| u16::from_str_radix(digits, 16).ok());
            bare.or_else(|| wire(cell)).map(f64::from).or_else(|| number_of(written))
        };
        let one = (one, self.means[one]);
        self.rows.iter().filter_map(|row| Some([number(row, one)?, number(row, other)?])).collect()
    }

    /// Does a column step as the addresses do? It may begin again at 0.
    fn moves(&self, address: usize, other: usize) -> bool {
        let pairs = self.pairs(address, (other, self.means[other]));
        let is_step = |two: &[[f64; 2]]| two[1][0] - two[0][0] == two[1][1] - two[0][1];
        let is_begin = |two: &[[f64; 2]]| two[1][1] == 0.0 && two[0][1] != 0.0;
        let mut steps = pairs.windows(2);
        steps.clone().all(|two| is_step(two) || is_begin(two)) && steps.any(|two| is_step(two) && two[0] != two[1])
    }

    /// Does a column say the same addresses, as they are or as they count in another way?
    fn are_same(&self, address: usize, other: usize) -> bool {
        let pairs = self.pairs(address, (other, self.means[other]));
        let apart = pairs.first().map_or(0.0, |[address, other]| address - other);
        // 1 and 40001 are the first register; 40000 is one that counts from 0 with its table.
        let is_count = [0, 1, 10_000, 30_000, 40_000, 100_000, 300_000, 400_000].iter().any(|from| {
            let from = f64::from(*from);
            apart == from || apart == from + 1.0
        });
        is_count && pairs.iter().all(|[address, other]| address - other == apart)
    }

    /// Is each number of a column that of the address before it, or a greater one?
    fn are_last(&self, first: usize, last: usize) -> bool {
        let pairs = self.pairs(first, (last, self.means[first]));
        let is_hex = |cell: &str| self.means[first] == Some(Column::HexAddress) && is_bare_hex(cell);
        let is_last = self.cells(last).all(|cell| is_address(cell) || is_hex(cell));
        !pairs.is_empty() && pairs.iter().all(|[first, last]| first <= last) && is_last
    }

    /// Lengths that fit the types of their rows as bytes, and none as registers, are bytes.
    fn count_bytes(&mut self) {
        let at = |column: Column| self.means.iter().position(|means| *means == Some(column));
        let (Some(kind), Some(length)) = (at(Column::Type), at(Column::Length)) else { return };
        let fits = self.rows.iter().filter_map(|row| {
            let kind = row.cells.get(kind).filter(|cell| is_fixed_type(cell))?;
            let (registers, cell) = (type_of(kind, None).ok()?.0.registers(), row.cells.get(length)?);
            Some([false, true].map(|is_bytes| length_of(cell, is_bytes) == Some(registers)))
        });
        let fits: Vec<[bool; 2]> = fits.collect();
        if fits.contains(&[false, true]) && !fits.contains(&[true, false]) {
            self.means[length] = Some(Column::Bytes);
        }
    }
}

/// Does the word of a type say its size, as `uint16` and `float` do and `int` does not?
pub fn is_fixed_type(cell: &str) -> bool {
    type_of(cell, None).is_ok_and(|(kind, _)| kind.registers() == 4 || type_of(cell, Some(4)).is_err())
}
