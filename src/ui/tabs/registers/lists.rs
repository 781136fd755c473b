//! What can be chosen from a list: every value that has a name, a device profile, a place that holds what is looked for.

use std::{
    collections::{BTreeMap, BTreeSet},
    sync::Arc,
};

use super::{ReadFor, Registers, find, view::named_text};
use crate::bus::recognise;
use crate::plant::{
    PlantDef,
    address::AddressBase,
    def::READ_REGISTERS_MAX,
    live::{AddressSpan, LiveRead, SPANS_MAX},
    tag::{ByteOrder, Table},
};
use crate::register_map::named::Named;
use crate::ui::tabs::prelude::*;

/// Rows around the selected one that are read, to either side.
const READ_MAX: usize = 40;
/// Registers that are read although no row has them, rather than with a request of their own.
const GAP_MAX: u32 = 8;
/// Columns of a value or a model: a text, the names of many bits or of a whole family are cut.
const VALUE_WIDTH: u16 = 28;

pub type Picking = List<Picks>;

#[derive(Debug)]
pub struct Picks {
    what: PicksOf,
    rows: Vec<Pick>,
}

#[derive(Debug, Clone, PartialEq)]
pub enum PicksOf {
    /// Everything that has a name.
    Values,
    /// Device profiles, the likeliest first.
    Profiles,
    /// Where a number may be, as it was typed.
    Hits(String),
}

#[derive(Debug, Clone)]
pub struct Pick {
    id: usize,
    group: String,
    name: String,
    /// In words; empty for none.
    label: String,
    value: String,
    note: String,
    target: Target,
}

#[derive(Debug, Clone)]
pub enum Target {
    /// Registers, and the order to see them in.
    Place(AddressSpan, Option<ByteOrder>),
    Profile(Arc<PlantDef>),
}

impl Listing for Picks {
    type Answer = ();
    type Row = Pick;
    type Id = usize;

    fn heading<'a>(&self, _cx: &ViewContext<'a>, _: Option<&'a ()>) -> Heading<'a> {
        match &self.what {
            PicksOf::Values => Heading::new(t!("values with names"), t!("nothing has a name yet")),
            PicksOf::Profiles => Heading::new(t!("device profiles, the likeliest first"), t!("no profile")),
            PicksOf::Hits(text) => {
                Heading::new(t!("where {text} may be", text), t!("in none of the registers read so far"))
            }
        }
    }

    fn rows<'a>(&'a self, _cx: &ViewContext<'a>, _: Option<&'a ()>) -> Vec<Cow<'a, Pick>> {
        self.rows.iter().map(Cow::Borrowed).collect()
    }

    fn id(row: &Pick) -> usize {
        row.id
    }

    fn columns(&self, _cx: &ViewContext, _room: u16) -> Vec<Column<Pick>> {
        let [group, name, value, note] = match self.what {
            PicksOf::Values => [t!("group"), t!("name"), t!("now"), t!("address")],
            PicksOf::Profiles => [t!("model"), t!("profile"), t!("probes fit"), t!("why not")],
            PicksOf::Hits(_) => [t!("address"), t!("type"), t!("likelihood"), t!("as")],
        };
        let label = Column::words(t!("label"), |_, row: &Pick| row.label.clone()).rank(1);
        let columns = [
            Some(Column::words(group, |_, row: &Pick| row.group.clone())),
            Some(Column::words(name, |_, row: &Pick| row.name.clone())),
            (self.what == PicksOf::Values).then_some(label),
            Some(Column::number(value, |_, row: &Pick| row.value.clone())),
            Some(rest(10, note, |_, row: &Pick, room| fit(&row.note, room))),
        ];
        columns.into_iter().flatten().collect()
    }
}

type Key = key_table::Key<Registers>;

/// Its own keys; those of every list come with it.
pub const KEYS: &[Key] = &[
    Key::new(code(KeyCode::Enter), "choose", "go there, or take the names of this profile", Registers::choose),
    Key::elsewhere(code(KeyCode::Esc), "back", "back to the registers"),
];

impl Registers {
    /// Shows everything that has a name.
    pub(super) fn list_values(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        self.list_of(cx, PicksOf::Values)
    }

    pub(super) fn list_profiles(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        self.list_of(cx, PicksOf::Profiles)
    }

    pub(super) fn list_of(&mut self, cx: &ViewContext, what: PicksOf) -> Vec<UiAction> {
        let rows = self.picks(cx, &what);
        self.picking = Some(List::new(Picks { what, rows }));
        self.follow_list(cx);
        self.read_now(cx)
    }

    /// What is listed now, and what must be read for it.
    pub(super) fn follow_list(&mut self, cx: &ViewContext) {
        let Some(picking) = &self.picking else { return self.listed_spans.clear() };
        let what = picking.of.what.clone();
        if what == PicksOf::Values {
            let rows = self.picks(cx, &what);
            self.picking.iter_mut().for_each(|picking| picking.of.rows.clone_from(&rows));
        }
        let Some(picking) = self.picking.as_ref().filter(|_| what == PicksOf::Values) else {
            return self.listed_spans.clear();
        };
        let (rows, selected) = (picking.rows(cx), picking.selected(cx).map(|row| row.id));
        let at = rows.iter().position(|row| Some(row.id) == selected).unwrap_or(0);
        let near = rows.iter().skip(at.saturating_sub(READ_MAX)).take(2 * READ_MAX);
        let spans = near.filter_map(|row| if let Target::Place(span, _) = row.target { Some(span) } else { None });
        self.listed_spans = joined(spans.collect());
    }

    fn picks(&self, cx: &ViewContext, what: &PicksOf) -> Vec<Pick> {
        let mut rows = match what {
            PicksOf::Values => self.value_rows(cx),
            PicksOf::Profiles => self.profile_rows(),
            PicksOf::Hits(text) => self.hit_rows(text),
        };
        rows.iter_mut().enumerate().for_each(|(n, row)| row.id = n);
        rows
    }

    /// In the order of their registers, but powers of ten behind the rest of their group.
    fn value_rows(&self, cx: &ViewContext) -> Vec<Pick> {
        let def = self.recognition.applied();
        let sources =
            def.iter().flat_map(|def| def.tags.iter().filter_map(|tag| Some(def.tag(tag.decimals.source()?))));
        let sources: BTreeSet<(Table, u16)> = sources.map(|tag| (tag.point.table, tag.point.address)).collect();
        let mut order: BTreeMap<String, usize> = BTreeMap::new();
        let row = |named: &Named| {
            let row = self.value_row(cx, named);
            let next = order.len();
            let group = *order.entry(row.group.clone()).or_insert(next);
            ((group, sources.contains(&(named.table, named.address))), row)
        };
        let mut rows: Vec<((usize, bool), Pick)> = self.names.iter().map(row).collect();
        rows.sort_by_key(|(place, _)| *place);
        rows.into_iter().map(|(_, row)| row).collect()
    }

    fn value_row(&self, cx: &ViewContext, named: &Named) -> Pick {
        let (group, name) = named.name.split_once('.').unwrap_or(("", &named.name));
        let span = AddressSpan { table: named.table, address: named.address, count: named.count() };
        Pick {
            id: 0,
            group: group.to_owned(),
            name: name.to_owned(),
            label: fit(&named.label, VALUE_WIDTH),
            value: fit(&named_text(self, cx, named).0, VALUE_WIDTH),
            note: self.place_words(span.table, span.address),
            target: Target::Place(span, None),
        }
    }

    fn profile_rows(&self) -> Vec<Pick> {
        let row = |ranked: recognise::Ranked| {
            let recognise::Ranked { def, fit, misses } = ranked;
            let note = match misses.first() {
                _ if self.is_in_use(&def) => t!("in use").to_owned(),
                _ if fit.of == 0 => t!("it has no signature").to_owned(),
                miss => miss.map_or(String::new(), ToString::to_string),
            };
            let value = if fit.of == 0 { "–".to_owned() } else { t!("{fits} of {of}", fits = fit.fits, of = fit.of) };
            let group = def.devices.first().map(|device| text::fit(&device.model, VALUE_WIDTH)).unwrap_or_default();
            Pick {
                id: 0,
                group,
                name: def.name.clone(),
                label: String::new(),
                value,
                note,
                target: Target::Profile(def),
            }
        };
        self.ranked().into_iter().map(row).collect()
    }

    fn hit_rows(&self, text: &str) -> Vec<Pick> {
        let row = |hit: find::Hit| {
            let span = AddressSpan { table: hit.table, address: hit.address, count: hit.kind.registers() };
            let scale =
                if hit.decimals == 0 { String::new() } else { format!(" ÷{}", 10u32.pow(hit.decimals.into())) };
            Pick {
                id: 0,
                group: self.place_words(hit.table, hit.address),
                name: format!("{} {}{scale}", hit.kind, hit.order.word()),
                label: String::new(),
                value: format!("{} %", hit.likelihood),
                note: hit.shown,
                target: Target::Place(span, Some(hit.order)),
            }
        };
        self.hits(text).into_iter().map(row).collect()
    }

    fn place_words(&self, table: Table, address: u16) -> String {
        match self.base {
            AddressBase::Modicon => table.modicon(address),
            AddressBase::Zero => format!("{} {address}", translate(table.word())),
            AddressBase::One => format!("{} {}", translate(table.word()), u32::from(address) + 1),
        }
    }

    /// Lists every place that may hold a number; first what a map has found is read.
    pub(super) fn find(&mut self, cx: &ViewContext, text: &str) -> Result<Vec<UiAction>, String> {
        find::check(text)?;
        let spans = self.swept(cx);
        if spans.is_empty() {
            return Ok(self.list_of(cx, PicksOf::Hits(text.to_owned())));
        }
        let read = LiveRead { line: self.line, unit: self.unit, spans, not_before: None, relearn: false };
        Ok(vec![self.send(cx, ReadFor::Search(text.to_owned()), read)])
    }

    /// Does what the selected row leads to.
    fn choose(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        let chosen = self.picking.as_ref().and_then(|picking| picking.selected(cx)).map(|row| row.target.clone());
        self.picking = None;
        match chosen {
            Some(Target::Place(span, order)) => self.go_to(cx, span, order),
            Some(Target::Profile(def)) => return self.choose_profile(cx, def),
            None => {}
        }
        self.read_now(cx)
    }

    pub(super) fn go_to(&mut self, cx: &ViewContext, span: AddressSpan, order: Option<ByteOrder>) {
        (self.table, self.selected) = (span.table, span.address);
        self.order = order.unwrap_or(self.order);
        self.keep_in_sight(cx);
    }
}

/// As few requests as these registers need, in the order of their addresses.
pub fn joined(mut spans: Vec<AddressSpan>) -> Vec<AddressSpan> {
    spans.sort_unstable();
    let mut all: Vec<AddressSpan> = Vec::new();
    for span in spans {
        let joins = |last: &AddressSpan| {
            let whole = span.range().end.max(last.range().end) - last.range().start;
            last.table == span.table
                && span.range().start <= last.range().end + GAP_MAX
                && whole <= READ_REGISTERS_MAX.into()
        };
        match all.last_mut() {
            Some(last) if joins(last) => {
                last.count = to_u16(span.range().end.max(last.range().end) - last.range().start)
            }
            _ => all.push(span),
        }
    }
    all.truncate(SPANS_MAX / 2);
    all
}
