//! A list before anything of it is taken: its first rows with what they hold now, what its columns mean, and what is left out.

use super::{Registers, next, view::named_text};
use crate::ui::tabs::prelude::*;
use crate::{
    plant::{
        address::{AddressBase, TABLES},
        live::AddressSpan,
        tag::{ByteOrder, Table},
    },
    register_map::{
        self,
        list::{Column, List, ListContext, Unclear},
        named::Named,
    },
};

/// Rows above the list: what can be taken, addresses, columns, heading.
const HEAD: u16 = 4;
/// Rows that are read beside the window.
const READ_MAX: usize = 24;

/// A list that was loaded and is not taken yet.
#[derive(Debug)]
pub struct Preview {
    bytes: Vec<u8>,
    context: ListContext,
    list: List,
    column: usize,
    /// The first row on the screen.
    top: usize,
}

type Key = key_table::Key<Registers>;

const SCROLL: [Key; 6] = motions!("", Registers::scroll_list);
const LIST: &[Key] = &[
    Key::new(code(KeyCode::Enter), "take", "take the registers of this list", |registers, _| registers.take_list()),
    Key::change(char('b'), "base", "plain numbers are Modicon numbers, as sent, or counted from 1", |registers, _| {
        registers.change_list(Preview::next_base)
    }),
    Key::change(code(KeyCode::Right), "column", "next column", |registers, _| {
        registers.change_list(|preview| preview.next_column(1))
    }),
    Key::change(code(KeyCode::Left), "", "previous column", |registers, _| {
        registers.change_list(|preview| preview.next_column(-1))
    }),
    Key::change(char('m'), "meaning", "what the selected column means", |registers, _| {
        registers.change_list(Preview::change_meaning)
    }),
    Key::change(char('t'), "table", "table of the addresses that name none", |registers, _| {
        registers.change_list(|preview| preview.context.table = next(&TABLES, preview.context.table))
    }),
    Key::change(char('o'), "order", "byte order of the rows that name none", |registers, _| {
        registers.change_list(|preview| {
            let order = preview.context.order.or(preview.list.order);
            preview.context.order = Some(next(&ByteOrder::ALL, order.unwrap_or_default()))
        })
    }),
];
const KEEP: &[Key] =
    &[Key::new(char('S'), "profile", "save all of it as a device profile", |registers, _| registers.keep_list())];
const CANCEL: &[Key] = &[Key::elsewhere(code(KeyCode::Esc), "cancel", "take nothing of this list")];

pub const KEYS: &[&[key_table::Key<Registers>]] = &[&SCROLL, LIST, KEEP, CANCEL];

impl Preview {
    fn new(bytes: Vec<u8>, context: ListContext) -> Preview {
        let list = register_map::read(&bytes, &context);
        Preview { bytes, context, list, column: 0, top: 0 }
    }

    fn read_again(&mut self) {
        self.list = register_map::read(&self.bytes, &self.context);
    }

    /// Rows, and what is said of others.
    fn count(&self) -> usize {
        self.list.named.len() + self.said().count()
    }

    /// What is odd about the file, and the lines that are left out.
    fn said(&self) -> impl Iterator<Item = String> {
        said(&self.list).into_iter()
    }

    /// What is read beside the window, so that the rows on the screen have values.
    pub fn spans(&self) -> impl Iterator<Item = AddressSpan> {
        let shown = self.list.named.iter().skip(self.top).take(READ_MAX);
        let span = shown.map(|named| AddressSpan { table: named.table, address: named.address, count: named.count() });
        span.filter(|span| span.range().end <= 0x1_0000)
    }

    /// What was read.
    pub fn list(&self) -> &List {
        &self.list
    }

    fn change_meaning(&mut self) {
        let Some((heading, now)) = self.list.columns.get(self.column) else { return };
        let all: Vec<Option<Column>> = Column::ALL.into_iter().map(Some).chain([None]).collect();
        // What a question offers comes first.
        let question = self.list.questions.iter().find(|question| question.heading == *heading);
        let means = question.map_or_else(|| next(&all, *now), |question| question.may_be.first().copied());
        self.context.means.insert(heading.clone(), means);
    }

    fn next_base(&mut self) {
        let bases = [AddressBase::Modicon, AddressBase::Zero, AddressBase::One];
        // The first press settles what is unclear.
        let likely = self.list.unclear.as_ref().map_or(AddressBase::Modicon, |unclear| unclear.readings[0].0);
        self.context.base = Some(self.context.base.map_or(likely, |now| next(&bases, now)));
    }

    fn next_column(&mut self, by: isize) {
        self.column = around(self.column, by, self.list.columns.len().max(1));
    }
}

impl Registers {
    /// Shows what a list has before it is taken; `Err` says why it is none.
    pub fn preview(&mut self, cx: &ViewContext, bytes: &[u8]) -> Result<Vec<UiAction>, String> {
        let base = Some(self.base).filter(|base| *base != AddressBase::Modicon);
        let (table, unit) = (self.table, self.unit);
        let order = Some(self.order).filter(|order| *order != ByteOrder::Abcd);
        let context = ListContext { table, base, order, unit: Some(unit), ..ListContext::default() };
        let preview = Preview::new(bytes.to_vec(), context.clone());
        // A file of another unit is read for what it is of.
        let is_other = preview.list.named.is_empty() && preview.list.refused.is_none();
        let preview =
            if is_other { Preview::new(bytes.to_vec(), ListContext { unit: None, ..context }) } else { preview };
        if let Some(why) = preview.list.refused {
            return Err(why);
        }
        self.preview = Some(preview);
        Ok(self.read_now(cx))
    }

    fn change_list(&mut self, change: impl FnOnce(&mut Preview)) {
        let Some(preview) = &mut self.preview else { return };
        change(preview);
        preview.read_again();
    }

    fn scroll_list(&mut self, cx: &ViewContext, motion: Motion) {
        let Some(preview) = &mut self.preview else { return };
        let room = usize::from(cx.area.height.saturating_sub(HEAD));
        preview.top = motion.to(preview.top, preview.count(), room);
    }

    /// Asks for the file of a profile.
    fn keep_list(&mut self) -> Vec<UiAction> {
        match &self.preview {
            Some(preview) if preview.list.unclear.is_some() => vec![unclear()],
            _ => self.ask_profile(),
        }
    }

    /// Takes the names, in place of those that were there. Of several at one address the first has the row of the window.
    fn take_list(&mut self) -> Vec<UiAction> {
        let Some(preview) = self.preview.take_if(|preview| preview.list.unclear.is_none()) else {
            return vec![unclear()];
        };
        let mut list = preview.list;
        let mut places = std::collections::BTreeSet::new();
        let is_first = |named: &Named| places.insert((named.table, named.address));
        let (named, others) = list.named.into_iter().partition(is_first);
        list.named = named;
        let only = |named: Named| t!("{name}: several values at one address need a profile", name = named.name);
        list.problems.extend(Vec::into_iter(others).map(only));
        let sums =
            list.calculated.iter().map(|sum| t!("{name}: calculated values need a profile", name = sum.named.name));
        list.problems.extend(sums);
        let taken = t!("names taken: {count}", count = list.named.len());
        if let Some(first) = list.named.first() {
            (self.table, self.first, self.selected) = (first.table, first.address, first.address);
        }
        std::mem::take(&mut list.named).into_iter().for_each(|named| self.names.put(named));
        vec![UiAction::Open(Modal::Notice(Notice::list(
            t!("load a register list"),
            std::iter::once(taken).chain(said(&list)).collect(),
        )))]
    }
}

/// What is odd about a list, what of its rows is not kept, and the lines that are left out.
fn said(list: &List) -> Vec<String> {
    list.warnings.iter().cloned().chain(list.said_of_rows()).chain(list.problems.iter().cloned()).collect()
}

fn unclear() -> UiAction {
    let words = t!("Its addresses can be read in two ways: choose one with b first.").to_owned();
    UiAction::Open(Modal::Notice(Notice::new(t!("load a register list"), vec![words])))
}

/// `holding 79`.
fn place((table, address): (Table, u16)) -> String {
    format!("{} {address}", translate(table.word()))
}

/// How plain numbers are read: as its reader has said, else as they were.
fn base_words(context: &ListContext, list: &List) -> &'static str {
    match context.base.or(list.base) {
        Some(AddressBase::Modicon) => t!("Modicon numbers"),
        None | Some(AddressBase::Zero) => t!("as sent, from 0"),
        Some(AddressBase::One) => t!("counted from 1"),
    }
}

pub fn view(tab: &Registers, cx: &ViewContext, canvas: &mut Canvas) {
    let (Some(preview), theme) = (&tab.preview, cx.theme) else { return };
    let Preview { context, list, column, top, .. } = preview;
    let room = canvas.width().saturating_sub(2);
    let (count, left) = (list.named.len(), list.problems.len());
    let words =
        t!("Registers that can be taken: {count}, lines that cannot: {left}. Are the values right?", count, left);
    canvas.text(1, 0, &fit_words(&words, room), theme.strong());
    let (words, style) = match (&list.unclear, list.questions.first()) {
        (Some(Unclear { written, readings }), _) => {
            let [first, second] = readings.map(|(base, at)| match base {
                AddressBase::Modicon => t!("{place} (Modicon)", place = place(at)),
                AddressBase::Zero => t!("{place} (as sent)", place = place(at)),
                AddressBase::One => t!("{place} (from 1)", place = place(at)),
            });
            (t!("{written}: {first} or {second}? b chooses", written, first, second), theme.trouble())
        }
        (None, Some(question)) => {
            (t!("{question} m chooses what the column means", question = question.words()), theme.trouble())
        }
        (None, None) => {
            let (base, table) = (base_words(context, list), translate(context.table.word()));
            let order = context.order.or(list.order).unwrap_or_default().word();
            (t!("plain numbers: {base}; by default: {table}, {order}", base, table, order), theme.normal())
        }
    };
    canvas.text(1, 1, &fit_words(&words, room), style);
    columns(canvas, cx, &list.columns, *column);
    let (place_end, name_end, type_end) = (9, 33, 49);
    for (x, words) in
        [(1, t!("address")), (place_end + 2, t!("name")), (name_end + 2, t!("type")), (type_end + 2, t!("factor"))]
    {
        canvas.text(x, HEAD - 1, words, theme.dim());
    }
    canvas.text_right(room, HEAD - 1, t!("now"), theme.dim());
    let rows = usize::from(canvas.height().saturating_sub(HEAD));
    for (y, named) in (HEAD..).zip(list.named.iter().skip(*top).take(rows)) {
        let (value, is_good) = named_text(tab, cx, named);
        canvas.text_right(place_end, y, &named.table.modicon(named.address), theme.normal());
        canvas.text(place_end + 2, y, &fit(&named.name, name_end - place_end - 2), theme.strong());
        canvas.text(
            name_end + 2,
            y,
            &fit(&format!("{} {}", named.kind, named.order.word()), type_end - name_end - 2),
            theme.normal(),
        );
        let offset = if named.offset == 0.0 { String::new() } else { format!(" {:+}", named.offset) };
        canvas.text(type_end + 2, y, &format!("×{}{offset}", named.scale), theme.normal());
        canvas.text_right(room, y, &value, if is_good { theme.strong() } else { theme.dim() });
    }
    let shown = list.named.len().saturating_sub(*top).min(rows);
    let problems = preview.said().skip(top.saturating_sub(list.named.len())).take(rows - shown);
    for (y, problem) in (HEAD + to_u16(shown)..).zip(problems) {
        canvas.text(1, y, &fit_words(&problem, room), theme.trouble());
    }
}

/// Each column with what it means, the selected one in sight.
fn columns(canvas: &mut Canvas, cx: &ViewContext, columns: &[(String, Option<Column>)], selected: usize) {
    if columns.is_empty() {
        canvas.text(1, 2, t!("no heading: a cell is known by its form"), cx.theme.dim());
        return;
    }
    let mut x = 1;
    for (n, (heading, means)) in columns.iter().enumerate().skip(selected.saturating_sub(2)) {
        let means = means.map_or("–", |means| translate(means.word()));
        let style = if n == selected { cx.theme.focus() } else { cx.theme.dim() };
        x = canvas.text(x, 2, &format!("{}: {means}", fit(heading, 16)), style) + 2;
    }
}
