//! A report as a reader sees it, before any format: titled sections of facts, tables, curves and lines, in one language.
//!
//! What it says is decided once, in [`content`](super::content); a format only sets it.

use std::ops::Range;

use jiff::{SignedDuration, Timestamp, tz::TimeZone};

use super::chart::Chart;
use crate::{
    plant::{
        def::Section as Kind,
        exact::{Exact, digits},
    },
    t,
    text::{Locale, translate},
};

/// A report, ready to be set.
#[derive(Debug, Clone, PartialEq)]
pub struct Document {
    /// The line above everything, as of the company: `[report] logo`; may be empty.
    pub logo: String,
    /// The plant: `Water tank`.
    pub title: String,
    /// What it is, of when: `Shift report: morning 2026-11-21`.
    pub heading: String,
    /// Its language.
    pub locale: Locale,
    /// The zone of its local times.
    pub zone: TimeZone,
    /// When its period begins.
    pub from: Timestamp,
    /// Up to when it has data. Formats that have a time of their own take this one, so that the same report gives the same bytes.
    pub until: Timestamp,
    /// How its times are written.
    pub times: Times,
    /// Its sections in order.
    pub sections: Vec<Section>,
}

/// How times are written for people.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Times {
    /// `06:12:45`: of a period of less than a day.
    Clock,
    /// `2026-11-21 06:12:45`.
    Date,
    /// `2026-11-21 06:12:45 UTC+07:00`: of a period in which the clocks were changed.
    Offset,
}

impl Times {
    /// As a period needs them.
    pub fn of(zone: &TimeZone, from: Timestamp, until: Timestamp) -> Times {
        if 1 < offsets(zone, from, until).len() {
            Times::Offset
        } else if until.duration_since(from) < SignedDuration::from_hours(24) {
            Times::Clock
        } else {
            Times::Date
        }
    }
}

impl Document {
    /// A cell of a table as people read it: a dash where there is no value.
    pub fn words(&self, cell: &Cell, kind: ColumnKind) -> String {
        match cell {
            Cell::Empty => "–".to_owned(),
            Cell::Text(text) => text.clone(),
            Cell::Number(value, decimals) => digits(*value, *decimals),
            Cell::Time(at) => {
                let local = local(&self.zone, *at, kind);
                let is_inside = self.from <= *at && *at <= self.until;
                match self.times {
                    Times::Clock if is_inside => {
                        local.split_once(' ').map_or(local.clone(), |(_, clock)| clock.to_owned())
                    }
                    Times::Clock | Times::Date if self.zone.to_offset(*at) == self.zone.to_offset(self.until) => local,
                    Times::Clock | Times::Date | Times::Offset => format!("{local} {}", offset(&self.zone, *at)),
                }
            }
        }
    }

    /// Which time is meant: all offsets of its period.
    pub fn times_line(&self) -> String {
        let offset = offsets(&self.zone, self.from, self.until).join(", ");
        plain(&t!("times are local, {offset}", offset))
    }

    /// The value of a fact as people read it: a time has its date.
    pub fn fact(&self, cell: &Cell) -> String {
        match (cell, self.times) {
            (Cell::Time(at), Times::Clock) if self.from <= *at && *at <= self.until => {
                local(&self.zone, *at, ColumnKind::Time)
            }
            _ => self.words(cell, cell.kind()),
        }
    }
}

/// A titled part.
#[derive(Debug, Clone, PartialEq)]
pub struct Section {
    /// Which one.
    pub kind: Kind,
    /// Its title.
    pub title: String,
    /// What it holds.
    pub content: Content,
}

/// What a section holds.
#[derive(Debug, Clone, PartialEq)]
pub enum Content {
    /// Facts.
    Facts(Vec<Fact>),
    /// A table.
    Table(Table),
    /// Curves; formats without pictures leave them out.
    Charts(Vec<Chart>),
    /// Lines to sign on, each with what it is for; only on paper.
    Signatures(Vec<String>),
}

/// A fact: what, and its value.
#[derive(Debug, Clone, PartialEq)]
pub struct Fact {
    /// Its name in English, whatever the language: for programs.
    pub id: &'static str,
    /// Its name.
    pub name: String,
    /// Its value.
    pub cell: Cell,
}

/// Rows of cells under headings, every row as long as the list of columns.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    /// Its columns.
    pub columns: Vec<Column>,
    /// Its rows.
    pub rows: Vec<Vec<Cell>>,
}

/// A column.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Column {
    /// Its heading in English, whatever the language: for programs.
    pub id: String,
    /// Its heading.
    pub heading: String,
    /// What its cells are.
    pub kind: ColumnKind,
}

/// What the cells of a column are, which decides how they are aligned and written. Any cell may be empty.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ColumnKind {
    /// Text.
    Text,
    /// Numbers.
    Number,
    /// Instants, in whole seconds.
    Time,
    /// Instants, in milliseconds.
    Milliseconds,
}

/// A cell, or the value of a fact.
#[derive(Debug, Clone, PartialEq)]
pub enum Cell {
    /// There is no value: never 0.
    Empty,
    /// A text.
    Text(String),
    /// A finite number with its decimals; `None` prints as many as it has.
    Number(Exact, Option<u8>),
    /// An instant.
    Time(Timestamp),
}

impl Cell {
    /// A text without the break points of the screen.
    pub fn text(text: impl AsRef<str>) -> Cell {
        match plain(text.as_ref()) {
            text if text.is_empty() => Cell::Empty,
            text => Cell::Text(text),
        }
    }

    /// A number with fixed decimals.
    pub fn number(value: Option<impl Into<Exact>>, decimals: u8) -> Cell {
        Cell::finite(value, Some(decimals))
    }

    /// A number with as many digits as it has.
    pub fn shortest(value: Option<impl Into<Exact>>) -> Cell {
        Cell::finite(value, None)
    }

    /// A whole number.
    pub fn count(count: usize) -> Cell {
        Cell::Number((count as f64).into(), Some(0))
    }

    /// The kind of the column that it would stand in.
    pub fn kind(&self) -> ColumnKind {
        match self {
            Cell::Empty | Cell::Text(_) => ColumnKind::Text,
            Cell::Number(..) => ColumnKind::Number,
            Cell::Time(_) => ColumnKind::Time,
        }
    }

    fn finite(value: Option<impl Into<Exact>>, decimals: Option<u8>) -> Cell {
        let value = value.map(Into::<Exact>::into);
        value.filter(|value| value.is_finite()).map_or(Cell::Empty, |value| Cell::Number(value, decimals))
    }
}

/// Without the places where a screen may break a line.
pub fn plain(text: &str) -> String {
    text.replace('\u{200b}', "")
}

/// `2026-11-21 06:12:45`, as spreadsheets take for a date; in a column of milliseconds with three decimals.
pub fn local(zone: &TimeZone, at: Timestamp, kind: ColumnKind) -> String {
    let form = if kind == ColumnKind::Milliseconds { "%Y-%m-%d %H:%M:%S%.3f" } else { "%Y-%m-%d %H:%M:%S" };
    at.to_zoned(zone.clone()).strftime(form).to_string()
}

/// `UTC+07:00`: a spreadsheet would take `+07:00` for a formula.
pub fn offset(zone: &TimeZone, at: Timestamp) -> String {
    at.to_zoned(zone.clone()).strftime("UTC%:z").to_string()
}

/// The offsets of a period, each once, in the order in which they begin.
fn offsets(zone: &TimeZone, from: Timestamp, until: Timestamp) -> Vec<String> {
    let changes = zone.following(from).map(|change| change.timestamp()).take_while(|at| *at < until);
    let mut offsets: Vec<String> = Vec::new();
    for offset in std::iter::once(from).chain(changes).map(|at| offset(zone, at)) {
        if !offsets.contains(&offset) {
            offsets.push(offset);
        }
    }
    offsets
}

impl Column {
    /// Of texts.
    pub fn text(heading: &'static str) -> Column {
        Column::new(heading, ColumnKind::Text)
    }
    /// Of numbers.
    pub fn number(heading: &'static str) -> Column {
        Column::new(heading, ColumnKind::Number)
    }
    /// Of instants in whole seconds.
    pub fn time(heading: &'static str) -> Column {
        Column::new(heading, ColumnKind::Time)
    }
    /// Of instants in milliseconds.
    pub fn milliseconds(heading: &'static str) -> Column {
        Column::new(heading, ColumnKind::Milliseconds)
    }

    fn new(heading: &'static str, kind: ColumnKind) -> Column {
        Column { id: heading.to_owned(), heading: plain(translate(heading)), kind }
    }
}

impl Table {
    /// Without rows yet.
    pub fn new(columns: impl Into<Vec<Column>>) -> Table {
        Table { columns: columns.into(), rows: Vec::new() }
    }

    /// With these rows.
    pub fn with(mut self, rows: impl Iterator<Item = Vec<Cell>>) -> Table {
        self.rows = rows.collect();
        self
    }

    /// Its first `n` columns, and the first of all beside the others.
    pub fn split(&self, n: usize) -> [Table; 2] {
        let repeated = usize::from(1 < n);
        let of = |columns: [Range<usize>; 2]| {
            let row = |row: &Vec<Cell>| columns.iter().flat_map(|range| row[range.clone()].to_vec()).collect();
            let headings = columns.iter().flat_map(|range| self.columns[range.clone()].to_vec());
            Table { columns: headings.collect(), rows: self.rows.iter().map(row).collect() }
        };
        [of([0..0, 0..n]), of([0..repeated, n..self.columns.len()])]
    }

    /// Without the columns that are empty in every row, and with labels beside their names, as a page has little room.
    pub fn dense(&self) -> Table {
        let named = |id: &str| self.columns.iter().position(|column| column.id == id);
        let labels = named("label").zip(named("tag").or_else(|| named("actuator")));
        let is_label = |n: usize| labels.is_some_and(|(label, _)| label == n);
        let used: Vec<bool> = (0..self.columns.len())
            .map(|n| !is_label(n) && self.rows.iter().any(|row| row[n] != Cell::Empty))
            .collect();
        let columns = self.columns.iter().zip(&used).filter(|(_, used)| **used).map(|(column, _)| column.clone());
        let cell = |row: &[Cell], n: usize| match (&row[n], labels.filter(|(_, name)| *name == n).map(|at| &row[at.0]))
        {
            (Cell::Text(name), Some(Cell::Text(label))) => Cell::Text(format!("{name} {label}")),
            _ => row[n].clone(),
        };
        let row = |row: &Vec<Cell>| (0..row.len()).filter(|n| used[*n]).map(|n| cell(row, n)).collect();
        Table { columns: columns.collect(), rows: self.rows.iter().map(row).collect() }
    }
}

impl ColumnKind {
    /// Has it instants?
    pub fn is_time(self) -> bool {
        matches!(self, ColumnKind::Time | ColumnKind::Milliseconds)
    }
}
