//! A list, written once: what it shows is a [`Listing`]; selection, marks, filter, order, room, mouse, copy, its query, what
//! is said where there is nothing to show, and that keys act only on what was drawn are the [`List`]'s.

mod column;
mod filter;
mod keys;
mod view;

use std::{borrow::Cow, fmt::Debug, hash::Hash};

use self::filter::Filter;
pub use self::{
    column::{Column, fitted, left, rest, right},
    keys::{all as all_keys, filter as ask_filter},
};
use crate::ui::tabs::prelude::*;

/// How often a list is asked for again, and when an answer counts as lost (real time).
const EVERY_S: f64 = 10.0;
const TIMEOUT_S: f64 = 20.0;

/// What a list shows.
pub trait Listing: Debug + 'static {
    /// What the history answers; `()` for a list of what the snapshot or the session holds.
    type Answer: FromAnswer + Debug + 'static;
    type Row: ToOwned + ?Sized + 'static;
    /// What a row stays selected and marked by.
    type Id: Clone + PartialEq + Hash + Debug + 'static;

    /// Can several rows be marked, for what is done with them together?
    const MARKS: bool = false;
    /// Is there a trend of what a row is about?
    const TRENDS: bool = false;
    /// Has it columns to be sorted by?
    const SORTS: bool = true;
    /// Do its newest rows come first, so that at the top it is the newest that is selected, whichever that is?
    const NEWEST_FIRST: bool = true;
    /// Is something done with a row, which its operator must have seen?
    const ACTS: bool = true;

    /// Its title, and what is said of it.
    fn heading<'a>(&self, cx: &ViewContext<'a>, answer: Option<&'a Self::Answer>) -> Heading<'a>;

    /// The query that is asked again and again.
    fn query(&self, _cx: &ViewContext) -> Option<Query> {
        None
    }

    /// The rows in their first order, from what was answered last.
    fn rows<'a>(&'a self, cx: &ViewContext<'a>, answer: Option<&'a Self::Answer>) -> Vec<Cow<'a, Self::Row>>;

    /// What identifies a row.
    fn id(row: &Self::Row) -> Self::Id;

    /// Does a row stand for this one? A row of several stands for each of them.
    fn holds(row: &Self::Row, id: &Self::Id) -> bool {
        Self::id(row) == *id
    }

    /// The columns in so many cells.
    fn columns(&self, cx: &ViewContext, room: u16) -> Vec<Column<Self::Row>>;

    /// Words in place of the columns.
    fn words(&self, _cx: &ViewContext, _row: &Self::Row) -> Option<String> {
        None
    }

    /// What a filter looks through in place of the texts of a row.
    fn searched(&self, _cx: &ViewContext, _row: &Self::Row) -> Option<String> {
        None
    }

    /// How a row looks that is not selected.
    fn style(&self, cx: &ViewContext, _row: &Self::Row) -> Style {
        cx.theme.normal()
    }

    /// What is known of the selected row, below the list; each text is broken into lines.
    fn details(&self, _cx: &ViewContext, _row: &Self::Row, _answer: Option<&Self::Answer>) -> Vec<(String, Style)> {
        Vec::new()
    }

    /// The last line of the page.
    fn foot(&self, _cx: &ViewContext) -> Option<(String, Style)> {
        None
    }

    /// Rows of the screen that it has.
    fn height(&self, cx: &ViewContext) -> u16 {
        cx.area.height
    }

    /// What an operator should have seen of a row, beside its identity, before a key acts on it.
    fn state(&self, _cx: &ViewContext, _row: &Self::Row) -> String {
        String::new()
    }

    /// When it was, for a replay to begin at.
    fn moment(&self, _row: &Self::Row) -> Option<Timestamp> {
        None
    }

    /// The tag whose curve shows what it is about, and the time.
    fn trend(&self, _cx: &ViewContext, _row: &Self::Row) -> Option<(TagId, (Timestamp, Timestamp))> {
        None
    }

    /// What is copied of a row in place of its cells; an empty text where there is nothing to copy.
    fn copied(&self, _cx: &ViewContext, _row: &Self::Row, _answer: Option<&Self::Answer>) -> Option<String> {
        None
    }
}

/// What stands above a list, and in its place while it is empty.
#[derive(Debug)]
pub struct Heading<'a> {
    title: Cow<'a, str>,
    words: Option<(String, Style)>,
    right: String,
    empty: &'static str,
    limit: Option<(usize, String)>,
    trouble: Option<String>,
    waits: bool,
}

impl<'a> Heading<'a> {
    /// Of this title, and these words where there is no row.
    pub fn new(title: impl Into<Cow<'a, str>>, empty: &'static str) -> Heading<'a> {
        let (title, right) = (title.into(), String::new());
        Heading { title, words: None, right, empty, limit: None, trouble: None, waits: false }
    }
    /// With words behind the title.
    pub fn words(self, words: impl Into<String>, style: Style) -> Heading<'a> {
        Heading { words: Some((words.into(), style)), ..self }
    }
    /// With a word at the right end.
    pub fn right(self, right: &str) -> Heading<'a> {
        Heading { right: right.to_owned(), ..self }
    }
    /// With what is said in place of the words where there are so many rows: older ones are left out.
    pub fn limit(self, rows: usize, words: String) -> Heading<'a> {
        Heading { limit: Some((rows, words)), ..self }
    }
    /// Of queries that are not the list's: why the last one failed, and whether the first has not been answered.
    pub fn asked(self, trouble: Option<&String>, waits: bool) -> Heading<'a> {
        Heading { trouble: trouble.cloned(), waits, ..self }
    }
}

/// The list of a page, whatever it shows.
pub trait ListPage {
    /// Moves the selection.
    fn step(&mut self, cx: &ViewContext, motion: Motion);
    /// Esc: takes the marks off, then the filter, then the order, then gives up the query; `false` if there is nothing of
    /// these.
    fn back(&mut self, cx: &ViewContext) -> bool;
    /// The marked rows, else the selected one, a line each.
    fn copied(&self, cx: &ViewContext) -> Vec<String>;
    /// The words of the filter.
    fn filter(&self) -> String;
    /// Shows only rows with all of these words.
    fn set_filter(&mut self, cx: &ViewContext, text: &str);
    /// What may be typed, while nothing is.
    fn filter_hint(&self) -> &'static str {
        t!("words that a row must have, or a figure: minutes > 30")
    }
    /// The list that keys act on.
    fn fingerprint(&self, _cx: &ViewContext) -> Rows {
        Rows::default()
    }
    /// When the selected row was.
    fn moment(&self, _cx: &ViewContext) -> Option<Timestamp> {
        None
    }
    /// Which keys of every list it has.
    fn has(&self, _what: Can) -> bool {
        false
    }
    /// Marks the selected row, or takes its mark off.
    fn mark(&mut self, _cx: &ViewContext) {}
    /// The order of the next column, and after the last one the first order again.
    fn next_order(&mut self, _cx: &ViewContext) {}
    /// The other way round.
    fn reverse(&mut self) {}
    /// The trend of the selected row.
    fn trend(&self, _cx: &ViewContext) -> Option<UiAction> {
        None
    }
}

/// What not every list can.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Can {
    /// Several rows can be marked.
    Mark,
    Sort,
    /// Its rows have trends.
    Trend,
}

/// The list of a page: what it shows, and what its operator looks at.
#[derive(Debug)]
pub struct List<L: Listing> {
    pub of: L,
    pub answered: Answered<L::Answer>,
    /// `None`: the first one, whichever that is.
    selected: Option<L::Id>,
    marked: Vec<L::Id>,
    /// As it is typed.
    filter: String,
    /// The column that it is sorted by, and whether the other way round.
    order: Option<usize>,
    reversed: bool,
}

impl<L: Listing + Default> Default for List<L> {
    fn default() -> List<L> {
        List::new(L::default())
    }
}

impl<L: Listing> List<L> {
    pub fn new(of: L) -> List<L> {
        let (answered, filter) = (Answered::default(), String::new());
        List { of, answered, selected: None, marked: Vec::new(), filter, order: None, reversed: false }
    }

    /// All rows in their first order.
    pub fn all<'a>(&'a self, cx: &ViewContext<'a>) -> Vec<Cow<'a, L::Row>> {
        self.of.rows(cx, self.answered.value.as_ref())
    }

    /// The rows that the filter lets through, in the order of the operator.
    pub fn rows<'a>(&'a self, cx: &ViewContext<'a>) -> Vec<Cow<'a, L::Row>> {
        let mut rows = self.all(cx);
        if !self.filter.is_empty() {
            let columns = self.columns(cx);
            let filter = Filter::parse(&self.filter, &columns.iter().map(|column| column.head).collect::<Vec<_>>());
            let text = |row: &L::Row| self.of.searched(cx, row).unwrap_or_else(|| self.cells(cx, row).join(" "));
            rows.retain(|row| filter.fits_figures(cx, &columns, row));
            rows.retain(|row| !filter.has_words() || filter.fits_text(&text(row)));
        }
        let columns = self.order.map(|_| self.columns(cx)).unwrap_or_default();
        if let Some(column) = self.order.and_then(|order| columns.get(order)) {
            rows = column.sorted(cx, rows, self.reversed);
        }
        rows
    }

    /// All columns, also those that there is no room for.
    fn columns(&self, cx: &ViewContext) -> Vec<Column<L::Row>> {
        self.of.columns(cx, cx.area.width)
    }

    fn cells(&self, cx: &ViewContext, row: &L::Row) -> Vec<String> {
        let cells = self.columns(cx).iter().map(|column| column.text(cx, row, u16::MAX)).collect();
        self.of.words(cx, row).map_or(cells, |words| vec![words])
    }

    /// Place of the selected row among these.
    pub fn place(&self, rows: &[Cow<L::Row>]) -> usize {
        let id = self.selected.as_ref();
        id.and_then(|id| rows.iter().position(|row| L::holds(row, id))).unwrap_or(0)
    }

    /// The rows on the screen.
    pub fn seen<'a>(&'a self, cx: &ViewContext<'a>) -> Vec<Cow<'a, L::Row>> {
        let rows = self.rows(cx);
        let room = self.room(cx, &rows);
        let begin = first(self.place(&rows), rows.len(), room);
        rows.into_iter().skip(begin).take(room).collect()
    }

    pub fn selected<'a>(&'a self, cx: &ViewContext<'a>) -> Option<Cow<'a, L::Row>> {
        let mut rows = self.rows(cx);
        let place = self.place(&rows);
        (place < rows.len()).then(|| rows.swap_remove(place))
    }

    /// Selects the first row again, whichever that is.
    pub fn rewind(&mut self) {
        self.selected = None;
    }

    pub fn select(&mut self, id: L::Id) {
        self.selected = Some(id);
    }

    pub fn is_marked(&self, row: &L::Row) -> bool {
        self.marked.contains(&L::id(row))
    }

    /// The query, if it is due.
    pub fn ask(&mut self, cx: &ViewContext, tab: Tab) -> Option<UiAction> {
        let query = self.of.query(cx)?;
        self.answered.ask(cx, tab, real(cx, EVERY_S), real(cx, TIMEOUT_S), query)
    }

    pub fn is_filtered(&self) -> bool {
        !self.filter.is_empty()
    }

    /// Takes all marks off; `false` if there was none.
    pub fn unmark(&mut self) -> bool {
        !std::mem::take(&mut self.marked).is_empty()
    }
}

impl<L: Listing> ListPage for List<L> {
    fn step(&mut self, cx: &ViewContext, motion: Motion) {
        let rows = self.rows(cx);
        let place = motion.to(self.place(&rows), rows.len(), self.room(cx, &rows));
        let id = rows.get(place).filter(|_| 0 < place || !L::NEWEST_FIRST).map(|row| L::id(row));
        self.selected = id;
    }

    fn back(&mut self, cx: &ViewContext) -> bool {
        if self.unmark() {
            return true;
        }
        if !self.filter.is_empty() {
            // What was found stays selected among all the others.
            self.selected = self.selected(cx).map(|row| L::id(&row));
            self.filter.clear();
        } else if self.order.is_some() {
            (self.order, self.reversed) = (None, false);
        } else {
            return self.answered.query.cancel(cx);
        }
        true
    }

    fn copied(&self, cx: &ViewContext) -> Vec<String> {
        let rows = self.rows(cx);
        let (place, marks) = (self.place(&rows), rows.iter().any(|row| self.is_marked(row)));
        let meant = rows.iter().enumerate().filter(|(n, row)| if marks { self.is_marked(row) } else { *n == place });
        let line = |row: &L::Row| {
            let own = self.of.copied(cx, row, self.answered.value.as_ref());
            own.unwrap_or_else(|| self.cells(cx, row).join("\t").trim_end().to_owned())
        };
        meant.map(|(_, row)| line(row)).filter(|line| !line.is_empty()).collect()
    }

    fn filter(&self) -> String {
        self.filter.clone()
    }

    fn set_filter(&mut self, _cx: &ViewContext, text: &str) {
        self.filter = text.trim().to_owned();
    }

    fn fingerprint(&self, cx: &ViewContext) -> Rows {
        if !L::ACTS {
            return Rows::default();
        }
        let rows = self.rows(cx);
        Rows::of(rows.iter().map(|row| (L::id(row), self.of.state(cx, row))), self.place(&rows))
    }

    fn moment(&self, cx: &ViewContext) -> Option<Timestamp> {
        self.selected(cx).and_then(|row| self.of.moment(&row))
    }

    fn has(&self, what: Can) -> bool {
        match what {
            Can::Mark => L::MARKS,
            Can::Sort => L::SORTS,
            Can::Trend => L::TRENDS,
        }
    }

    fn mark(&mut self, cx: &ViewContext) {
        let Some(id) = self.selected(cx).map(|row| L::id(&row)) else { return };
        match self.marked.iter().position(|marked| *marked == id) {
            Some(place) => drop(self.marked.remove(place)),
            None => self.marked.push(id),
        }
    }

    fn next_order(&mut self, cx: &ViewContext) {
        let next = self.order.map_or(0, |order| order + 1);
        let columns = self.columns(cx);
        let named = columns.iter().enumerate().skip(next).find(|(_, column)| column.sorts && !column.head.is_empty());
        (self.order, self.reversed) = (named.map(|(n, _)| n), false);
    }

    fn reverse(&mut self) {
        self.reversed = !self.reversed && self.order.is_some();
    }

    fn trend(&self, cx: &ViewContext) -> Option<UiAction> {
        let row = self.selected(cx)?;
        let (tag, span) = self.of.trend(cx, &row)?;
        Some(UiAction::ShowOnTrends(tag, span))
    }
}
