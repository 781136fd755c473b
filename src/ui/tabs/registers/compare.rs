//! The window beside another unit, or beside what this unit gave at an earlier moment.

use super::{
    ReadFor, Registers,
    cells::{Cell, Cells},
    view,
};
use crate::ui::tabs::prelude::*;
use crate::{
    bus::interpret,
    plant::live::{LiveRead, LiveReading},
};

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reference {
    /// Another unit, read as often as the window.
    Unit(u8),
    /// This unit, as it was then.
    Moment(Timestamp),
}

#[derive(Debug)]
pub struct Comparison {
    reference: Reference,
    cells: Cells,
}

impl Comparison {
    fn label(&self, cx: &ViewContext) -> String {
        match self.reference {
            Reference::Unit(unit) => t!("unit {unit}", unit),
            Reference::Moment(at) => clock(at, &cx.def().time_zone),
        }
    }

    /// What it gives at an address; `None` where that is not known, or not any more.
    fn cell(&self, tab: &Registers, cx: &ViewContext, address: u16) -> Option<&Cell> {
        let cell = self.cells.get(tab.table, address).filter(|cell| cell.word.is_some())?;
        let holds = match self.reference {
            Reference::Unit(_) => !view::is_old(tab, cx, cell),
            Reference::Moment(_) => true,
        };
        holds.then_some(cell)
    }
}

impl Registers {
    /// Ends the comparison, or asks with what to compare.
    pub(super) fn toggle_comparison(&mut self) -> Vec<UiAction> {
        if self.comparison.take().is_some() {
            return Vec::new();
        }
        let hint = t!("the address of another unit; now: what was read so far, for comparison with later");
        self.ask_text(super::Asking::Compare, t!("compare with"), hint)
    }

    pub(super) fn compare_typed(&mut self, cx: &ViewContext, text: &str) -> Result<(), String> {
        let (reference, cells) = if text == t!("now") {
            (Reference::Moment(cx.now), self.cells.frozen(|cell| !view::is_old(self, cx, cell)))
        } else {
            let unit = self.parse_unit(cx, text)?;
            if unit == self.unit {
                return Err(t!("unit {unit} is the one that is shown: expected another, or now", unit));
            }
            (Reference::Unit(unit), Cells::default())
        };
        self.comparison = Some(Comparison { reference, cells });
        Ok(())
    }

    /// Reads the same of the other unit right behind this one, unless that is on its way.
    pub(super) fn read_compared(&mut self, cx: &ViewContext) -> Option<UiAction> {
        let Reference::Unit(unit) = self.comparison.as_ref()?.reference else { return None };
        let span = self.span(cx);
        let (line, what) = (self.line, ReadFor::Comparison(span));
        let read = LiveRead { line, unit, spans: vec![span], not_before: None, relearn: false };
        (!self.is_on_way(cx, &what)).then(|| self.send(cx, what, read))
    }

    pub(super) fn on_compared(&mut self, reading: Option<LiveReading>) {
        let Some(comparison) = &mut self.comparison else { return };
        reading.iter().for_each(|reading| comparison.cells.on_reading(reading));
    }
}

/// How the two sides stand at an address; what one of them did not give is never equal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Standing {
    Equal,
    Different,
    Unknown,
}

fn standing(own: Option<u16>, other: Option<u16>) -> Standing {
    match (own, other) {
        (Some(own), Some(other)) if own == other => Standing::Equal,
        (Some(_), Some(_)) => Standing::Different,
        (None, _) | (_, None) => Standing::Unknown,
    }
}

/// Where the columns of one side stand: the last cell of each number.
struct Side {
    hex: u16,
    unsigned: u16,
    signed: Option<u16>,
    float: u16,
}

/// Both sides, and the mark between them.
fn sides(width: u16) -> [Side; 2] {
    let wide = 108 <= width;
    let second = if wide { 43 } else { 32 };
    [0, second].map(|x| Side {
        hex: 17 + x,
        unsigned: 33 + x,
        signed: wide.then_some(41 + x),
        float: if wide { 54 } else { 45 } + x,
    })
}

/// `unit 1 and unit 2: 3 differ, 12 equal, 5 unknown`.
pub fn summary(tab: &Registers, cx: &ViewContext, comparison: &Comparison) -> String {
    let all: Vec<Standing> = tab.rows(cx).map(|address| pair(tab, cx, comparison, to_u16(address)).2).collect();
    let count = |wanted: Standing| all.iter().filter(|standing| **standing == wanted).count();
    let (unit, other) = (tab.unit, comparison.label(cx));
    t!(
        "unit {unit} and {other}: {different} differ, {equal} equal, {unknown} unknown",
        unit,
        other,
        different = count(Standing::Different),
        equal = count(Standing::Equal),
        unknown = count(Standing::Unknown)
    )
}

fn pair<'a>(
    tab: &'a Registers,
    cx: &ViewContext,
    comparison: &'a Comparison,
    address: u16,
) -> (Option<&'a Cell>, Option<&'a Cell>, Standing) {
    let own = tab.cells.get(tab.table, address).filter(|cell| cell.word.is_some() && !view::is_old(tab, cx, cell));
    let other = comparison.cell(tab, cx, address);
    (own, other, standing(own.and_then(|cell| cell.word), other.and_then(|cell| cell.word)))
}

pub fn columns(tab: &Registers, cx: &ViewContext, comparison: &Comparison, canvas: &mut Canvas) {
    let theme = cx.theme;
    let labels = [t!("unit {unit}", unit = tab.unit), comparison.label(cx)];
    for (side, label) in sides(canvas.width()).iter().zip(labels) {
        canvas.text(side.hex, 2, &fit(&label, 9), theme.strong());
        if tab.table.is_bits() {
            continue;
        }
        canvas.text_right(side.unsigned, 2, "uint16", theme.dim());
        if let Some(signed) = side.signed {
            canvas.text_right(signed, 2, "int16", theme.dim());
        }
        canvas.text_right(side.float, 2, &format!("float {}", tab.order.word()), theme.dim());
    }
    if 108 <= canvas.width() && !tab.table.is_bits() {
        canvas.text_right(107, 2, &fit(t!("more by"), 8), theme.dim());
    }
}

/// One address of both.
pub fn row(tab: &Registers, cx: &ViewContext, comparison: &Comparison, canvas: &mut Canvas, (y, address): (u16, u16)) {
    let theme = cx.theme;
    let (own, other, standing) = pair(tab, cx, comparison, address);
    let (mark, style) = match standing {
        Standing::Equal => (" ", theme.normal()),
        Standing::Different => ("≠", theme.strong()),
        Standing::Unknown => ("?", theme.dim()),
    };
    let [first, second] = sides(canvas.width());
    canvas.text(second.hex - 2, y, mark, style);
    side(tab, cx, canvas, (y, address), (&first, own, &tab.cells), style);
    side(tab, cx, canvas, (y, address), (&second, other, &comparison.cells), style);
    let word = |cell: Option<&Cell>| cell.and_then(|cell| cell.word).map(i32::from);
    if let (true, Some(own), Some(other)) = (108 <= canvas.width() && !tab.table.is_bits(), word(own), word(other))
        && own != other
    {
        canvas.text_right(107, y, &format!("{:+}", other - own), style);
    }
    if let (true, Some(named)) = (124 <= canvas.width(), tab.names.get(tab.table, address)) {
        canvas.text(110, y, &fit(&named.name, canvas.width().saturating_sub(111)), theme.normal());
    }
}

fn side(
    tab: &Registers,
    cx: &ViewContext,
    canvas: &mut Canvas,
    (y, address): (u16, u16),
    (at, cell, cells): (&Side, Option<&Cell>, &Cells),
    style: Style,
) {
    let Some(word) = cell.and_then(|cell| cell.word) else {
        canvas.text(at.hex, y, "–", cx.theme.dim());
        return;
    };
    if tab.table.is_bits() {
        canvas.text(at.hex, y, &word.to_string(), style);
        return;
    }
    canvas.text(at.hex, y, &format!("{word:04X}"), style);
    canvas.text_right(at.unsigned, y, &word.to_string(), style);
    if let Some(signed) = at.signed {
        canvas.text_right(signed, y, &word.cast_signed().to_string(), style);
    }
    // A named register in its own terms.
    let named = tab.names.get(tab.table, address);
    let meaning = match named {
        Some(named) => cells.held(tab.table, address, named.count()).and_then(|words| cells.scaled(named).text(&words)),
        None => interpret::float(tab.order, &cells.words(tab.table, address, 2), 10),
    };
    canvas.text_right(at.float, y, &fit(meaning.as_deref().unwrap_or("–"), 11), style);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_one_side_did_not_give_is_never_equal() {
        assert_eq!(standing(Some(7), Some(7)), Standing::Equal);
        assert_eq!(standing(Some(7), Some(8)), Standing::Different);
        for (own, other) in [(None, None), (Some(0), None), (None, Some(0))] {
            assert_eq!(standing(own, other), Standing::Unknown);
        }
    }
}
