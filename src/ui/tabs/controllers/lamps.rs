//! The page of lamps: every bit of a device at a glance, as on the front of a PLC. While it is shown it reads them itself.

use crate::access::right::needs_for_query;
use crate::plant::{
    live::{AddressSpan, LiveRead, LiveReading, SPANS_MAX},
    tag::{Point, Table, TagDef},
};
use crate::ui::{rights, tabs::prelude::*};

/// Lamps in a row, as octal and decimal numbering have it.
const ROW: usize = 8;
/// A device with fewer bits has no lamps.
const BITS_MIN: usize = 4;
/// How often they are read, when an answer counts as lost, and how long a lamp is certain (real time).
const EVERY_S: f64 = 1.0;
const TIMEOUT_S: f64 = 20.0;
const CERTAIN_S: f64 = 5.0;

/// The lamps as they were read for the page.
#[derive(Debug, Default)]
pub struct Live {
    device: Option<DeviceId>,
    reading: Answered<LiveReading>,
}

impl Live {
    /// Reads the lamps when it is time to, where this user may.
    pub fn ask(&mut self, cx: &ViewContext, device: &DeviceDef) -> Vec<UiAction> {
        if self.device != Some(device.id) {
            *self = Live { device: Some(device.id), ..Live::default() };
        }
        let (line, unit, spans) = (device.line, device.unit, spans(cx, device));
        let query = Query::Registers(LiveRead { line, unit, spans, not_before: None, relearn: false });
        let may = !cx.is_past() && !cx.def().listens_on(line) && rights::lacks(cx, needs_for_query(&query)).is_none();
        let (every, timeout) = (real(cx, EVERY_S), real(cx, TIMEOUT_S));
        if may {
            self.reading.ask(cx, Tab::Controllers, every, timeout, query).into_iter().collect()
        } else {
            Vec::new()
        }
    }

    pub fn queries(&mut self) -> Queries<'_> {
        vec![&mut self.reading]
    }

    /// A bit, and when it was read.
    fn at(&self, cx: &ViewContext, point: Point) -> Option<(bool, Timestamp)> {
        let parts = self.reading.value.iter().filter(|_| !cx.is_past()).flat_map(|reading| &reading.parts);
        let mut parts = parts.filter(|part| part.span.table == point.table);
        parts.find_map(|part| {
            let place = point.address.checked_sub(part.span.address)?;
            Some((*part.words.as_ref().ok()?.get(usize::from(place))? != 0, part.at))
        })
    }
}

/// Where the bits of a device stand.
fn spans(cx: &ViewContext, device: &DeviceDef) -> Vec<AddressSpan> {
    let mut points: Vec<_> = bits(cx, device).map(|tag| (tag.point.table, tag.point.address)).collect();
    points.sort_unstable();
    points.dedup();
    let mut spans: Vec<AddressSpan> = Vec::new();
    for (table, address) in points {
        match spans.last_mut() {
            Some(span) if span.table == table && span.range().end == u32::from(address) => span.count += 1,
            Some(_) | None => spans.push(AddressSpan { table, address, count: 1 }),
        }
    }
    spans.truncate(SPANS_MAX);
    spans
}

/// One lamp: the tags that stand for the same bit, the profile's first.
struct Lamp<'a> {
    tags: Vec<&'a TagDef>,
}

/// Has a device enough bits for a page of lamps?
pub fn has_any(cx: &ViewContext, device: &DeviceDef) -> bool {
    BITS_MIN <= bits(cx, device).count()
}

fn bits<'a>(cx: &ViewContext<'a>, device: &DeviceDef) -> impl Iterator<Item = &'a TagDef> {
    let tags = cx.snapshot.def.tags_of(device.id);
    tags.filter(|tag| tag.point.table.is_bits() && tag.calculation.is_none())
}

/// The lamps by group, in the order of the profile.
fn groups<'a>(cx: &ViewContext<'a>, device: &DeviceDef) -> Vec<(&'a str, Vec<Lamp<'a>>)> {
    let mut groups: Vec<(&str, Vec<Lamp>)> = Vec::new();
    for tag in bits(cx, device) {
        let same = |point: Point| (point.table, point.address) == (tag.point.table, tag.point.address);
        let mut lamps = groups.iter_mut().flat_map(|(_, lamps)| lamps);
        if let Some(lamp) = lamps.find(|lamp| lamp.tags.iter().any(|other| same(other.point))) {
            lamp.tags.push(tag);
            continue;
        }
        match groups.iter_mut().find(|(group, _)| *group == tag.group) {
            Some((_, lamps)) => lamps.push(Lamp { tags: vec![tag] }),
            None => groups.push((&tag.group, vec![Lamp { tags: vec![tag] }])),
        }
    }
    groups
}

impl Lamp<'_> {
    /// On or off as it was read last, and whether that is certain; `None` if nothing good is known.
    fn state(&self, cx: &ViewContext, live: &Live) -> Option<(bool, bool)> {
        let samples = self.tags.iter().map(|tag| cx.snapshot.sample(tag.id)).filter(|sample| sample.quality.is_good());
        let samples = samples.filter_map(|sample| Some((sample.value? != 0.0, sample.at)));
        let read = self.tags.iter().filter_map(|tag| live.at(cx, tag.point));
        let (on, at) = samples.chain(read).max_by_key(|(_, at)| *at)?;
        Some((on, cx.is_past() || cx.now.duration_since(at) <= real(cx, CERTAIN_S)))
    }

    /// The device itself decides over it, at once again after a write.
    fn is_taken_back(&self) -> bool {
        self.tags.iter().all(|tag| tag.point.table == Table::Coil && !tag.writable())
    }

    /// `Y0 P-1`: the terminal, and what the plant calls it.
    fn name(&self) -> String {
        self.tags.iter().map(|tag| tag.short.as_str()).collect::<Vec<_>>().join(" ")
    }
}

pub fn view(cx: &ViewContext, canvas: &mut Canvas, device: &DeviceDef, live: &Live) {
    let theme = cx.theme;
    let (wide, high) = (canvas.width(), canvas.height());
    let x = canvas.text(1, 0, &device.name, theme.strong());
    canvas.text(x + 2, 0, &fit_words(of_plant(&device.title), wide.saturating_sub(x + 3)), theme.dim());
    let (mut y, mut unknown, mut old, mut cut) = (1, 0, 0, 0);
    for (group, lamps) in groups(cx, device) {
        let cell = lamps.iter().map(|lamp| width(&lamp.name())).max().unwrap_or(0) + 4;
        let in_row = usize::from(wide.saturating_sub(2) / cell).clamp(1, ROW);
        // The last row is for what is not known.
        if high.saturating_sub(2) <= y {
            cut += lamps.len();
            continue;
        }
        let x = canvas.text(1, y, of_plant(group), theme.dim());
        if lamps.iter().all(Lamp::is_taken_back) {
            let words = t!("driven by the device: it overwrites what is written to them");
            canvas.text(x + 2, y, &fit_words(words, wide.saturating_sub(x + 3)), theme.normal());
        }
        y += 1;
        for row in lamps.chunks(in_row) {
            if high.saturating_sub(1) <= y {
                cut += row.len();
                continue;
            }
            for (n, lamp) in row.iter().enumerate() {
                let state = lamp.state(cx, live);
                let (glyph, style) = match state {
                    Some((true, true)) => (theme.pick("●", "#"), theme.strong()),
                    Some((false, true)) => (theme.pick("○", "."), theme.normal()),
                    Some((true, false)) => (theme.pick("◉", "*"), theme.dim()),
                    Some((false, false)) => (theme.pick("◌", ","), theme.dim()),
                    None => ("?", theme.trouble()),
                };
                unknown += usize::from(state.is_none());
                old += usize::from(state.is_some_and(|(_, is_certain)| !is_certain));
                canvas.text(2 + to_u16(n) * cell, y, &format!("{glyph} {}", lamp.name()), style);
            }
            y += 1;
        }
    }
    let notes = [
        (0 < unknown).then(|| t!("? {unknown} not read yet, or not known now: u reads all", unknown)),
        (0 < old).then(|| {
            let (on, off) = (theme.pick("◉", "*"), theme.pick("◌", ","));
            t!(
                "{on} {off} {old} read more than {seconds} s ago: they may have changed",
                on,
                off,
                old,
                seconds = CERTAIN_S
            )
        }),
        (0 < cut).then(|| t!("{cut} more: enlarge the screen", cut)),
    ];
    let notes = notes.into_iter().flatten().collect::<Vec<_>>().join("   ");
    canvas.text(1, high.saturating_sub(1), &fit_words(&notes, wide.saturating_sub(2)), theme.normal());
}
