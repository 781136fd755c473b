//! The page of lamps: every bit of a device at a glance, as on the front of a PLC.

use crate::plant::tag::{Point, TagDef};
use crate::ui::tabs::prelude::*;

/// Lamps in a row, as octal and decimal numbering have it.
const ROW: usize = 8;
/// A device with fewer bits has no lamps.
const BITS_MIN: usize = 4;

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
    /// On or off as the latest good sample has it; `None` if none is good.
    fn state(&self, cx: &ViewContext) -> Option<bool> {
        let samples = self.tags.iter().map(|tag| cx.snapshot.sample(tag.id)).filter(|sample| sample.quality.is_good());
        samples.max_by_key(|sample| sample.at)?.value.map(|value| value != 0.0)
    }

    /// `Y0 P-1`: the terminal, and what the plant calls it.
    fn name(&self) -> String {
        self.tags.iter().map(|tag| tag.short.as_str()).collect::<Vec<_>>().join(" ")
    }
}

/// Draws the page.
pub fn view(cx: &ViewContext, canvas: &mut Canvas, device: &DeviceDef) {
    let theme = cx.theme;
    let (wide, high) = (canvas.width(), canvas.height());
    let x = canvas.text(1, 0, &device.name, theme.strong());
    canvas.text(x + 2, 0, &fit_words(&device.title, wide.saturating_sub(x + 3)), theme.dim());
    let (mut y, mut unknown, mut cut) = (1, 0, 0);
    for (group, lamps) in groups(cx, device) {
        let cell = lamps.iter().map(|lamp| width(&lamp.name())).max().unwrap_or(0) + 4;
        let in_row = usize::from(wide.saturating_sub(2) / cell).clamp(1, ROW);
        // The last row is for what is not known.
        if high.saturating_sub(2) <= y {
            cut += lamps.len();
            continue;
        }
        canvas.text(1, y, group, theme.dim());
        y += 1;
        for row in lamps.chunks(in_row) {
            if high.saturating_sub(1) <= y {
                cut += row.len();
                continue;
            }
            for (n, lamp) in row.iter().enumerate() {
                let (glyph, style) = match lamp.state(cx) {
                    Some(true) => (theme.pick("●", "#"), theme.strong()),
                    Some(false) => (theme.pick("○", "."), theme.normal()),
                    None => ("?", theme.trouble()),
                };
                unknown += usize::from(glyph == "?");
                canvas.text(2 + to_u16(n) * cell, y, &format!("{glyph} {}", lamp.name()), style);
            }
            y += 1;
        }
    }
    let notes = [
        (0 < unknown).then(|| t!("? {unknown} not read yet, or not known now: u reads all", unknown)),
        (0 < cut).then(|| t!("{cut} more: enlarge the screen", cut)),
    ];
    let notes = notes.into_iter().flatten().collect::<Vec<_>>().join("   ");
    canvas.text(1, high.saturating_sub(1), &fit_words(&notes, wide.saturating_sub(2)), theme.normal());
}
