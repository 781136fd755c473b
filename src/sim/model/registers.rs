//! The registers of a modelled device: what is at an address, what a write must keep to, and why it is refused.

use std::{
    collections::{BTreeMap, BTreeSet},
    sync::Arc,
};

use crate::{
    bus::codec,
    plant::{
        def::{DeviceDef, Limits, TagId},
        fault::ExceptionCode,
        identity::{self, IdentityTest},
        number::to_u32,
        scale,
        tag::{Access, Bound, Table, TagDef},
    },
    sim::pdu::{Identity, Registers},
};

/// What a profile says of a device; never changes.
#[derive(Debug, Clone)]
pub struct Chart {
    limits: Limits,
    functions: Vec<u8>,
    /// What it says of itself, for the conditions of its tags.
    objects: Vec<(u8, String)>,
    tags: Vec<TagDef>,
    cells: [BTreeSet<u16>; 4],
    /// Addresses that hold two words each.
    wide: [BTreeSet<u16>; 4],
}

/// A device with what is in its registers now.
#[derive(Debug, Clone)]
pub struct Model {
    chart: Arc<Chart>,
    /// Words, and bits as 0 or 1, by table and [`spot`].
    cells: [BTreeMap<u32, u16>; 4],
}

impl Chart {
    pub fn new<'a>(device: &DeviceDef, tags: impl Iterator<Item = &'a TagDef>) -> Chart {
        let tags: Vec<TagDef> = tags.cloned().collect();
        let of_tables = |is_meant: fn(&&TagDef) -> bool| {
            let tables = [Table::Coil, Table::Discrete, Table::Input, Table::Holding];
            let meant = |table| tags.iter().filter(is_meant).filter(move |tag| tag.point.table == table);
            tables.map(|table| cells(meant(table), device.limits))
        };
        let cells = of_tables(|_| true);
        let wide = of_tables(|tag| tag.point.kind.address_words() != 1);
        let mut functions = if device.functions.is_empty() { functions(&tags) } else { device.functions.clone() };
        let objects = objects(&tags);
        if !objects.is_empty() && device.functions.is_empty() {
            functions.push(identity::FUNCTION);
        }
        Chart { limits: device.limits, functions, objects, tags, cells, wide }
    }

    fn tag(&self, id: TagId) -> Option<&TagDef> {
        // The tags of a device follow each other.
        let first = self.tags.first()?.id;
        self.tags.get(id.index().checked_sub(first.index())?)
    }
}

/// The addresses that answer: those of tags, and what lies between two of them where the profile allows reading over it.
fn cells<'a>(tags: impl Iterator<Item = &'a TagDef>, limits: Limits) -> BTreeSet<u16> {
    let mut cells: BTreeSet<u16> = BTreeSet::new();
    let mut gap_max = 0;
    for tag in tags {
        gap_max = limits.gap(tag.point.table);
        cells.extend((tag.point.address..).take(usize::from(tag.point.len())));
    }
    let taken: Vec<u16> = cells.iter().copied().collect();
    for pair in taken.windows(2) {
        if u32::from(pair[1] - pair[0] - 1) <= gap_max {
            cells.extend(pair[0] + 1..pair[1]);
        }
    }
    cells
}

/// The functions of a device whose profile does not list them: what reading and writing its tags takes.
fn functions(tags: &[TagDef]) -> Vec<u8> {
    let mut functions = BTreeSet::new();
    for tag in tags {
        if tag.access != Access::Write {
            functions.insert(tag.point.table.read_fc());
        }
        match (tag.writable(), tag.write_fc, tag.write_point().table.is_bits()) {
            (true, Some(function), _) => functions.extend([function]),
            (true, None, true) => functions.extend([5, 15]),
            (true, None, false) => functions.extend([6, 16]),
            (false, ..) => {}
        }
    }
    functions.into_iter().collect()
}

/// What a device says of itself whose tags have conditions on that: of the texts that an object is compared with, the
/// last of those that most conditions accept.
fn objects(tags: &[TagDef]) -> Vec<(u8, String)> {
    let mut of_object: BTreeMap<u8, Vec<&IdentityTest>> = BTreeMap::new();
    for test in tags.iter().filter_map(|tag| tag.when.as_ref()).flat_map(|when| when.identity_tests()) {
        of_object.entry(test.object.0).or_default().push(test);
    }
    let chosen = of_object.into_iter().filter_map(|(object, tests)| {
        let accepted = |text: &str| tests.iter().filter(|test| test.holds(text) == Some(true)).count();
        let best = tests.iter().map(|test| &test.with).max_by_key(|text| accepted(text))?;
        Some((object, best.clone()))
    });
    chosen.collect()
}

impl Model {
    /// As it is switched on: each tag at 0, or at the bound or state nearest to it.
    pub fn new(chart: Arc<Chart>) -> Model {
        let mut cells: [BTreeMap<u32, u16>; 4] =
            chart.cells.each_ref().map(|cells| cells.iter().map(|address| (spot(*address, 0), 0)).collect());
        for (cells, wide) in cells.iter_mut().zip(&chart.wide) {
            cells.extend(wide.iter().map(|address| (spot(*address, 1), 0)));
        }
        let mut model = Model { chart: chart.clone(), cells };
        // Twice: a later tag may hold the place of a decimal point.
        for tag in chart.tags.iter().chain(&chart.tags) {
            let start = tag.simulate.as_ref().and_then(|simulate| simulate.start);
            model.set(tag, start.unwrap_or_else(|| at_rest(tag)));
        }
        model
    }

    /// What the registers hold for a tag, in its unit; `None` for a tag of another device or what is not a number.
    pub fn value(&self, tag: TagId) -> Option<f64> {
        let tag = self.chart.tag(tag)?;
        let raw = codec::decode(tag.point, &self.words(tag)?)?;
        Some(scale::to_value(tag, raw, self.decimals(tag)).near())
    }

    /// Puts a value into the registers; `false` if they cannot hold it.
    pub fn set_value(&mut self, tag: TagId, value: f64) -> bool {
        let chart = self.chart.clone();
        chart.tag(tag).is_some_and(|tag| self.set(tag, value))
    }

    fn set(&mut self, tag: &TagDef, value: f64) -> bool {
        let Some(raw) = scale::to_raw(tag, value, self.decimals(tag)) else { return false };
        let words = match tag.point.part() {
            Some(_) => self.words(tag).and_then(|words| codec::modified(tag.point, &words, raw)),
            None => codec::encode(tag.point, raw),
        };
        let Some(words) = words else { return false };
        let spots = spots(tag.point.address, tag.point.kind.address_words());
        self.cells[place(tag.point.table)].extend(spots.zip(words));
        true
    }

    fn words(&self, tag: &TagDef) -> Option<Vec<u16>> {
        let cells = &self.cells[place(tag.point.table)];
        let spots = spots(tag.point.address, tag.point.kind.address_words());
        spots.take(usize::from(tag.point.words())).map(|spot| cells.get(&spot).copied()).collect()
    }

    fn decimals(&self, tag: &TagDef) -> i8 {
        tag.scaling_decimals(|from| self.value(from)).unwrap_or(0)
    }

    fn bound(&self, bound: Option<Bound>) -> Option<f64> {
        match bound? {
            Bound::Fixed(value) => Some(value.near()),
            Bound::From(tag) => self.value(tag),
        }
    }

    /// Writes cells of a table from a request, or refuses: nothing there takes a write, a value is cut in two, is out of
    /// its bounds, is no state of its tag, or the device is locked.
    fn write_cells(&mut self, table: Table, address: u16, values: &[u16]) -> Result<(), ExceptionCode> {
        let chart = self.chart.clone();
        let is_for = |tag: &&TagDef| {
            tag.writable() && tag.write_at == Some((table, address)) && usize::from(tag.point.words()) == values.len()
        };
        if let Some(tag) = chart.tags.iter().find(is_for) {
            let spots = spots(tag.point.address, tag.point.kind.address_words());
            self.cells[place(tag.point.table)].extend(spots.zip(values.iter().copied()));
            return if self.admits(tag) { Ok(()) } else { Err(ExceptionCode::ILLEGAL_VALUE) };
        }
        let each = self.address_words(table, address);
        // One word does not make a value here.
        if !values.len().is_multiple_of(each.into()) {
            return Err(ExceptionCode::ILLEGAL_ADDRESS);
        }
        let span = u32::from(address)..u32::from(address) + to_u32(values.len()) / u32::from(each);
        let extent =
            |tag: &TagDef| u32::from(tag.point.address)..u32::from(tag.point.address) + u32::from(tag.point.len());
        let touched: Vec<&TagDef> = chart
            .tags
            .iter()
            .filter(|tag| tag.point.table == table && tag.writable() && tag.write_at.is_none())
            .filter(|tag| extent(tag).start < span.end && span.start < extent(tag).end)
            .collect();
        let taken = |at: u32| touched.iter().any(|tag| extent(tag).contains(&at));
        let cut = |tag: &&TagDef| extent(tag).start < span.start || span.end < extent(tag).end;
        if !span.clone().all(taken) || touched.iter().any(cut) {
            return Err(ExceptionCode::ILLEGAL_ADDRESS);
        }
        let locked = |tag: &&TagDef| tag.write_unlock.is_some_and(|(key, value)| self.value(key) != Some(value));
        if touched.iter().any(locked) {
            return Err(ExceptionCode::ILLEGAL_ADDRESS);
        }
        self.cells[place(table)].extend(spots(address, each).zip(values.iter().copied()));
        if touched.iter().all(|tag| self.admits(tag)) { Ok(()) } else { Err(ExceptionCode::ILLEGAL_VALUE) }
    }

    /// Whether a tag may hold what has just been written.
    fn admits(&self, tag: &TagDef) -> bool {
        let Some(value) = self.value(tag.id) else { return tag.is_text() };
        let above = self.bound(tag.min).is_none_or(|min| min <= value);
        let below = self.bound(tag.max).is_none_or(|max| value <= max);
        above && below && (tag.enum_labels.is_empty() || tag.label_of(value).is_some())
    }
}

/// 0, or what is nearest to it of the values that the tag may have.
fn at_rest(tag: &TagDef) -> f64 {
    let fixed = |bound: Option<Bound>| match bound {
        Some(Bound::Fixed(value)) => Some(value.near()),
        Some(Bound::From(_)) | None => None,
    };
    match tag.enum_labels.first() {
        Some((first, _)) if tag.label_of(0.0).is_none() => *first as f64,
        _ => 0f64.min(fixed(tag.max).unwrap_or(0.0)).max(fixed(tag.min).unwrap_or(0.0)),
    }
}

/// Where a word stands among the cells of its table: the second one of an address behind all the first ones.
fn spot(address: u16, word: u16) -> u32 {
    u32::from(word) << 16 | u32::from(address)
}

/// Those from an address on, where each holds so many words.
fn spots(address: u16, each: u16) -> impl Iterator<Item = u32> {
    (address..=u16::MAX).flat_map(move |address| (0..each).map(move |word| spot(address, word)))
}

fn place(table: Table) -> usize {
    match table {
        Table::Coil => 0,
        Table::Discrete => 1,
        Table::Input => 2,
        Table::Holding => 3,
    }
}

impl Registers for Model {
    fn functions(&self) -> &[u8] {
        &self.chart.functions
    }

    fn limits(&self) -> Limits {
        self.chart.limits
    }

    fn identity(&self) -> Identity {
        Identity { server_id: 0, objects: self.chart.objects.clone() }
    }

    fn bit(&self, table: Table, address: u16) -> Result<bool, ExceptionCode> {
        self.cells[place(table)].get(&spot(address, 0)).map(|bit| *bit != 0).ok_or(ExceptionCode::ILLEGAL_ADDRESS)
    }

    fn write_bit(&mut self, address: u16, on: bool) -> Result<(), ExceptionCode> {
        // A few devices write the bits that they call discrete inputs.
        let discrete =
            |tag: &TagDef| tag.writable() && tag.point.table == Table::Discrete && tag.point.address == address;
        let table = if self.chart.tags.iter().any(discrete) { Table::Discrete } else { Table::Coil };
        self.write_cells(table, address, &[u16::from(on)])
    }

    fn word(&self, table: Table, address: u16) -> Result<u16, ExceptionCode> {
        self.word_at(table, address, 0)
    }

    fn address_words(&self, table: Table, address: u16) -> u16 {
        if self.chart.wide[place(table)].contains(&address) { 2 } else { 1 }
    }

    fn word_at(&self, table: Table, address: u16, word: u16) -> Result<u16, ExceptionCode> {
        self.cells[place(table)].get(&spot(address, word)).copied().ok_or(ExceptionCode::ILLEGAL_ADDRESS)
    }

    fn write_word(&mut self, address: u16, value: u16) -> Result<(), ExceptionCode> {
        self.write_block(address, &[value])
    }

    fn write_block(&mut self, address: u16, values: &[u16]) -> Result<(), ExceptionCode> {
        self.write_cells(Table::Holding, address, values)
    }
}
