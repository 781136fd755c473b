//! The cells of a row below a heading, each read as its column means it.

use super::{
    cells::{Cells, of_text},
    columns::{Column, Columns},
    factors::{effect, is_kind_of_format, of_unit, one_of, places_of},
    headings::Heading,
    meanings::{is_blank, is_dash},
    row::{differ, unfit},
    words::{BadNumber, access_of, bad_of, bit_field_of, labels_of, number_of, poll_of, type_of, written_labels_of},
};
use crate::{
    plant::tag::{Access, Poll},
    profile::is_known_unit,
};

/// What few lists say.
#[derive(Debug, Default)]
pub struct More {
    pub access: Option<Access>,
    pub min: Option<f64>,
    pub max: Option<f64>,
    pub decimals: Option<u8>,
    pub labels: Vec<(i128, String)>,
    pub bits: Vec<(i128, String)>,
    pub field: Option<(u8, u8)>,
    pub bad: Vec<(BadNumber, BadNumber)>,
    pub group: String,
    pub label: String,
    pub write_with: Option<u8>,
    pub poll: Option<Poll>,
}

/// The cells below a heading, by what their columns mean.
pub struct Reader<'a> {
    pub columns: &'a Columns,
    pub row: &'a Cells,
    /// The first reason why the row cannot be taken.
    pub wrong: Option<String>,
}

impl<'a> Reader<'a> {
    pub fn cells(&self, column: Column) -> impl Iterator<Item = &'a str> {
        let (places, row) = (self.columns.places(column).into_iter(), self.row);
        let is_sure = self.columns.is_sure;
        let cells = places
            .filter_map(|place| row.cells.get(place))
            .map(move |cell| if is_sure { of_text(cell) } else { cell.as_str() });
        // `n/a` is no number that a device gives for none.
        cells.filter(move |cell| if column == Column::Bad { !is_dash(cell) } else { !is_blank(cell) })
    }

    pub fn text(&self, column: Column) -> Option<&'a str> {
        self.cells(column).next()
    }

    /// What a cell holds; one that does not hold it makes the row wrong, as do two that differ.
    pub fn read<T: PartialEq>(&mut self, column: Column, of: impl Fn(&str) -> Option<T>) -> Option<T> {
        let mut found = None;
        let cells: Vec<&str> = self.cells(column).collect();
        for cell in cells {
            match (of(cell), &found) {
                (None, _) => self.refuse(unfit(column, cell)),
                (Some(value), None) => found = Some((value, cell)),
                (Some(value), Some((first, other))) if value != *first => {
                    self.refuse(differ(other, cell));
                }
                (Some(_), Some(_)) => {}
            }
        }
        found.map(|(value, _)| value)
    }

    pub fn refuse(&mut self, why: String) {
        self.wrong.get_or_insert(why);
    }

    /// The type; of several columns that one in which it is known.
    pub fn kind(&mut self) -> Option<String> {
        let all = self.columns.types(self.row);
        let known = || all.iter().copied().filter(|cell| type_of(cell, None).is_ok());
        if let Some(other) =
            known().find(|cell| type_of(cell, None).ok() != known().next().and_then(|first| type_of(first, None).ok()))
        {
            let first = known().next().unwrap_or_default();
            self.refuse(differ(first, other));
        }
        known().next().or(all.first().copied()).map(str::to_owned)
    }

    /// The factor of all columns that have one.
    pub fn factor(&mut self) -> Option<f64> {
        let columns = self.columns;
        let words = self.is_of_formats();
        let of = |column: Column, cell: &str| match column {
            // 0 is none to ioBroker, which then takes 1.
            Column::Scale if columns.is_iobroker && number_of(cell) == Some(0.0) => Some(1.0),
            Column::Scale => effect(column, cell).or(with_unit(columns, cell).map(|(factor, _)| factor)),
            Column::Places if words && is_kind_of_format(cell) => effect(column, cell).or(Some(1.0)),
            column => effect(column, cell),
        };
        let mut all = Vec::new();
        for column in [Column::Scale, Column::Divisor, Column::Exponent, Column::Places] {
            let factor = self.read(column, |cell| of(column, cell));
            all.extend(factor.zip(self.text(column)));
        }
        one_of(&all).unwrap_or_else(|why| {
            self.refuse(why);
            None
        })
    }

    /// Is a column of decimals one of formats, of which some have none?
    fn is_of_formats(&self) -> bool {
        let is_format = |place: &usize| Heading::new(&self.columns.headings[*place]).is_format();
        [Column::Places, Column::Decimals]
            .into_iter()
            .flat_map(|column| self.columns.places(column))
            .any(|n| is_format(&n))
    }

    pub fn more(&mut self) -> More {
        let words = self.is_of_formats();
        let decimals = |cell: &str| places_of(cell).map(Some).or((words && is_kind_of_format(cell)).then_some(None));
        let labels = if self.columns.is_sure { labels_of } else { written_labels_of };
        More {
            access: self.read(Column::Access, access_of),
            min: self.read(Column::Min, number_of),
            max: self.read(Column::Max, number_of),
            decimals: self.read(Column::Decimals, decimals).flatten(),
            labels: self.read(Column::Labels, labels).unwrap_or_default(),
            bits: self.read(Column::Bits, labels).unwrap_or_default(),
            field: self.read(Column::Field, bit_field_of),
            bad: self.read(Column::Bad, bad_of).unwrap_or_default(),
            group: self.text(Column::Group).unwrap_or_default().to_owned(),
            label: self.text(Column::Label).unwrap_or_default().to_owned(),
            write_with: self.read(Column::WriteWith, |cell| cell.parse().ok()),
            poll: self.read(Column::Poll, poll_of),
        }
    }

    /// Does a range or a least value begin below zero?
    pub fn is_below_zero(&self) -> bool {
        let bounds =
            (0..self.columns.headings.len()).filter(|n| Heading::new(&self.columns.headings[*n]).is_of_bounds());
        let is_negative = |cell: &String| {
            let digits = cell.trim_start().strip_prefix(['-', '−', '–']).unwrap_or_default();
            digits.trim_start().starts_with(|sign: char| sign.is_ascii_digit())
        };
        bounds.filter_map(|n| self.row.cells.get(n)).any(is_negative)
    }

    /// Headings of what stands in no column that is used, and of a second name.
    pub fn unused(&self) -> Vec<String> {
        let names = self.columns.places(Column::Name);
        let first = names.iter().find(|place| self.row.cells.get(**place).is_some_and(|cell| !is_blank(cell)));
        let is_type = |cell: &str| type_of(cell, None).is_ok();
        let is_known = self.columns.types(self.row).into_iter().any(is_type);
        let is_unused = |n: usize| match self.columns.means[n] {
            None => self.columns.last != Some(n),
            Some(Column::Name) => first != Some(&n),
            Some(Column::Places | Column::Decimals) => places_of(&self.row.cells[n]).is_none(),
            Some(Column::WriteAt) => self.text(Column::Access).and_then(access_of) == Some(Access::Read),
            Some(Column::Type) => is_known && !self.columns.type_at(n, self.row).is_some_and(is_type),
            Some(_) => false,
        };
        let cells = self.row.cells.iter().take(self.columns.means.len()).enumerate();
        let unused = cells.filter(|(n, cell)| is_unused(*n) && !is_blank(cell));
        unused.map(|(n, _)| self.columns.headings[n].clone()).collect()
    }
}

/// `0.1 V` as a resolution: the factor, and the unit of the value. As a factor, 1 % may be 0.01 as well.
pub fn with_unit(columns: &Columns, cell: &str) -> Option<(f64, String)> {
    let place = *columns.places(Column::Scale).first()?;
    let is_resolution = Heading::new(&columns.headings[place]).is_resolution();
    // A number alone has no unit.
    let is_number = cell.starts_with(|sign: char| sign.is_ascii_digit()) && number_of(cell).is_none();
    of_unit(cell).ok().filter(|(_, unit)| is_resolution && is_number && is_known_unit(unit))
}
