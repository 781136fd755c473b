//! The cells of a row below a heading, each read as its column means it.

use super::{
    cells::{Cells, of_text},
    columns::{Column, Columns},
    headings::Heading,
    row::{differ, unfit},
    words::{
        BadNumber, access_of, bad_of, bit_field_of, labels_of, number_of, poll_of, power_of_ten, type_of,
        unit_with_factor,
    },
};
use crate::{
    plant::{
        address::in_table,
        tag::{Access, Poll, Table},
    },
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
    pub write_at: Option<(Table, u16)>,
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
    fn cells(&self, column: Column) -> impl Iterator<Item = &'a str> {
        let (places, row) = (self.columns.places(column).into_iter(), self.row);
        let is_sure = self.columns.is_sure;
        let cells = places
            .filter_map(|place| row.cells.get(place))
            .map(move |cell| if is_sure { of_text(cell) } else { cell.as_str() });
        cells.filter(|cell| !matches!(*cell, "" | "-" | "–"))
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
        // 0 is none to ioBroker, which then takes 1.
        let columns = self.columns;
        let number = |cell: &str| match number_of(cell) {
            Some(0.0) if columns.is_iobroker => Some(1.0),
            found => found.or(with_unit(columns, cell).map(|(factor, _)| factor)).filter(|number| *number != 0.0),
        };
        let power = |cell: &str| cell.parse::<i8>().ok().map(f64::from);
        let scale = self.read(Column::Scale, number);
        let divisor = self.read(Column::Divisor, number).map(|by| 1.0 / by);
        let exponent = self.read(Column::Exponent, power).map(power_of_ten);
        let places = self.read(Column::Places, |cell| power(cell).filter(|places| 0.0 <= *places));
        // As a person would write it: 0.1, not the nearest to it.
        let places = places.map(|places| power_of_ten(-places));
        [divisor, exponent, places, scale].into_iter().flatten().reduce(|all, one| all * one)
    }

    pub fn more(&mut self) -> More {
        More {
            access: self.read(Column::Access, access_of),
            min: self.read(Column::Min, number_of),
            max: self.read(Column::Max, number_of),
            decimals: self.read(Column::Decimals, |cell| cell.parse().ok()),
            labels: self.read(Column::Labels, labels_of).unwrap_or_default(),
            bits: self.read(Column::Bits, labels_of).unwrap_or_default(),
            field: self.read(Column::Field, bit_field_of),
            bad: self.read(Column::Bad, bad_of).unwrap_or_default(),
            group: self.text(Column::Group).unwrap_or_default().to_owned(),
            label: self.text(Column::Label).unwrap_or_default().to_owned(),
            write_at: self.read(Column::WriteAt, in_table),
            write_with: self.read(Column::WriteWith, |cell| cell.parse().ok()),
            poll: self.read(Column::Poll, poll_of),
        }
    }

    /// Headings of what stands in no column that is used, and of a second name.
    pub fn unused(&self) -> Vec<String> {
        let names = self.columns.places(Column::Name);
        let first = names
            .iter()
            .find(|place| self.row.cells.get(**place).is_some_and(|cell| !matches!(cell.as_str(), "" | "-" | "–")));
        let is_unused = |n: usize| match self.columns.means[n] {
            None => true,
            Some(Column::Name) => first != Some(&n),
            Some(_) => false,
        };
        let cells = self.row.cells.iter().take(self.columns.means.len()).enumerate();
        let unused = cells.filter(|(n, cell)| is_unused(*n) && !matches!(cell.as_str(), "" | "-" | "–"));
        unused.map(|(n, _)| self.columns.headings[n].clone()).collect()
    }
}

/// `0.1 V` as a resolution: the factor, and the unit of the value. As a factor, 1 % may be 0.01 as well.
pub fn with_unit(columns: &Columns, cell: &str) -> Option<(f64, String)> {
    let place = *columns.places(Column::Scale).first()?;
    let is_resolution = Heading::new(&columns.headings[place]).has(&["resolution", "auflösung", "résolution"]);
    // A number alone has no unit.
    let is_number = cell.starts_with(|sign: char| sign.is_ascii_digit()) && number_of(cell).is_none();
    unit_with_factor(cell).ok().filter(|(_, unit)| is_resolution && is_number && is_known_unit(unit))
}
