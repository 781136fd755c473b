//! The register browser: every register in hex and as numbers, and the selected pair as 32 bits in all four orders.

use std::collections::BTreeMap;

use ratatui::Frame as Screen;

use super::{Place, Window, test};
use crate::ui::tabs::prelude::*;
use crate::{
    bus::codec,
    plant::{
        diagnostics::{Diagnostic, DiagnosticState, Finding},
        number::to_f32,
        tag::{ByteOrder, DataType, Point, Table},
    },
    ui::modal::{Next, window},
};

/// Registers of a device.
#[derive(Debug, Clone, PartialEq)]
pub struct Registers {
    line: LineId,
    unit: u8,
    table: Table,
    address: u16,
    count: u16,
    selected: u16,
    problem: Option<String>,
}

impl Registers {
    /// Those that a test reads; `None` for another test.
    pub fn new(line: LineId, diagnostic: &Diagnostic) -> Option<Registers> {
        let Diagnostic::Read { unit, table, address, count } = *diagnostic else { return None };
        Some(Registers { line, unit, table, address, count, selected: 0, problem: None })
    }

    fn diagnostic(&self) -> Diagnostic {
        Diagnostic::Read { unit: self.unit, table: self.table, address: self.address, count: self.count }
    }

    /// A key.
    pub fn on_key(mut self, cx: &ViewContext, event: KeyEvent) -> Next {
        self.problem = None;
        if let Some(motion) = Motion::of(event) {
            self.selected = to_u16(motion.to(usize::from(self.selected), usize::from(self.count), 8));
        }
        match event.code {
            KeyCode::Char('q') => return Next::Close,
            _ if char('r').is(event) => {
                let started =
                    Place::of(cx, self.line).ok_or_else(String::new).and_then(|at| test::start(&at, self.diagnostic()));
                match started {
                    Ok(act) => {
                        return Next::Do(vec![act, Window::Registers(self).open()]);
                    }
                    Err(why) => self.problem = Some(why),
                }
            }
            _ => {}
        }
        Window::Registers(self).stay()
    }

    /// Words by address, and how the test stands.
    fn values(&self, cx: &ViewContext) -> (BTreeMap<u16, u16>, String, bool) {
        let run = cx.snapshot.lines.get(self.line.index()).and_then(|line| line.test.as_ref());
        let Some(run) = run.filter(|run| run.diagnostic == self.diagnostic()) else {
            return (BTreeMap::new(), t!("requested, no response yet").to_owned(), false);
        };
        let mut words = BTreeMap::new();
        let mut fault = None;
        for finding in &run.findings {
            match finding {
                Finding::Values { address, words: found, .. } => {
                    words.extend(found.iter().enumerate().map(|(n, word)| (address.wrapping_add(to_u16(n)), *word)));
                }
                Finding::Failed { fault: why, .. } => fault = Some(*why),
                // A read finds nothing else.
                Finding::Exchange(_)
                | Finding::Bytes { .. }
                | Finding::Unit { .. }
                | Finding::Object { .. }
                | Finding::Written(_)
                | Finding::Verdict(_) => {}
            }
        }
        let at = clock(run.started, &cx.def().time_zone);
        let (state, ill) = match (&run.state, fault) {
            (DiagnosticState::Running, _) => {
                (t!("reading, {done} of {total} requests", done = run.done, total = run.total), false)
            }
            (DiagnosticState::Failed(why), _) => (t!("FAILED: {why}", why), true),
            (DiagnosticState::Cancelled, _) => (t!("STOPPED").to_owned(), true),
            (DiagnosticState::Done, Some(why)) => (t!("read {at}; ---- is {why}", at, why), true),
            (DiagnosticState::Done, None) => (t!("read {at}", at), false),
        };
        (words, state, ill)
    }

    /// Draws it.
    pub fn view(&self, cx: &ViewContext, screen: &mut Screen, body: Rect) {
        let theme = cx.theme;
        let (words, state, ill) = self.values(cx);
        let title = t!(
            "unit {unit}, {table} from {modicon}",
            unit = self.unit,
            table = translate(self.table.word()),
            modicon = self.table.modicon(self.address)
        );
        let pair = if self.table.is_bits() { 0 } else { 6 };
        let wanted = self.count.saturating_add(pair + 4);
        let mut canvas = window(cx, screen, body, &title, (74.min(body.width), wanted));
        let (width, height) = (canvas.width(), canvas.height());
        // On a small screen the registers themselves come first: without their bits, and without the pairs.
        let bits = BITS_WIDTH <= width;
        let (pair, too_low) = if height < pair + 3 + ROWS_MIN { (0, 0 < pair) } else { (pair, false) };
        let (state, ill) = self.problem.clone().map_or((state, ill), |why| (why, true));
        canvas.text(0, 0, &fit_words(&state, width), if ill { theme.trouble() } else { theme.normal() });
        let heading = match (self.table.is_bits(), bits) {
            (true, _) => t!("bit"),
            (false, true) => t!("hex       unsigned   signed  bits"),
            (false, false) => t!("hex       unsigned   signed"),
        };
        canvas.text(0, 1, &format!("  {:18} {heading}", t!("register / wire")), theme.dim());
        let room = usize::from(height.saturating_sub(pair + 3)).max(1);
        let first = list::first(usize::from(self.selected), usize::from(self.count), room);
        for (y, n) in (first..usize::from(self.count)).take(room).enumerate() {
            let address = self.address.wrapping_add(to_u16(n));
            let style = if n == usize::from(self.selected) { theme.focus() } else { theme.normal() };
            canvas.text(0, to_u16(y) + 2, &self.row(address, words.get(&address), bits), style);
        }
        let below = usize::from(self.count).saturating_sub(first + room);
        if 0 < below {
            canvas.text_right(width, 0, &t!(" {below} more ▼", below), theme.strong());
        }
        if 0 < pair {
            let y = (2 + to_u16(room.min(usize::from(self.count)))).min(height.saturating_sub(pair + 1));
            self.pair(cx, &words, &mut canvas.part(0, y, width, pair));
        }
        let keys = t!("↑↓ move   r read again   Esc close");
        let x = canvas.text(0, height.saturating_sub(1), keys, theme.strong());
        if too_low {
            let more = fit_words(t!("enlarge for more"), width.saturating_sub(x + 2));
            canvas.text(x + 2, height.saturating_sub(1), &more, theme.dim());
        }
    }

    /// `41003 / 0x03EA     02BC         700      700  0000 0010 1011 1100`.
    fn row(&self, address: u16, word: Option<&u16>, bits: bool) -> String {
        let place = format!("{} / 0x{address:04X}", self.table.modicon(address));
        let value = match word {
            None => "----".to_owned(),
            Some(bit) if self.table.is_bits() => bit.to_string(),
            Some(word) => {
                let number = format!("{word:04X}  {word:>12} {:>8}", word.cast_signed());
                if !bits {
                    return format!("  {place:18} {number}");
                }
                let bits = [word >> 12, word >> 8 & 15, word >> 4 & 15, word & 15].map(|four| format!("{four:04b}"));
                format!("{number}  {}", bits.join(" "))
            }
        };
        format!("  {place:18} {value}")
    }

    /// The selected register and the next one as one value.
    fn pair(&self, cx: &ViewContext, words: &BTreeMap<u16, u16>, canvas: &mut Canvas) {
        let theme = cx.theme;
        let first = self.address.wrapping_add(self.selected);
        let second = first.wrapping_add(1);
        let (Some(a), Some(b)) = (words.get(&first), words.get(&second)) else {
            canvas.text(0, 1, t!("32 bits: select a register that is followed by another"), theme.dim());
            return;
        };
        let (from, to) = (self.table.modicon(first), self.table.modicon(second));
        let text = format!("{:18}", format!("{from}+{to}"));
        canvas.text(0, 1, &t!("  {text} unsigned 32    signed 32  float", text), theme.dim());
        for (y, (name, order)) in ORDERS.into_iter().enumerate() {
            canvas.text(0, to_u16(y) + 2, &format!("  {name:18} {}", pair_text([*a, *b], order)), theme.normal());
        }
    }
}

/// Columns of a row with its bits.
const BITS_WIDTH: u16 = 69;
/// Fewer registers than this at once are no list.
const ROWS_MIN: u16 = 4;

const ORDERS: [(&str, ByteOrder); 4] =
    [("ABCD", ByteOrder::Abcd), ("CDAB", ByteOrder::Cdab), ("BADC", ByteOrder::Badc), ("DCBA", ByteOrder::Dcba)];

/// `  4294901760       -65536  -1.5`.
fn pair_text(words: [u16; 2], order: ByteOrder) -> String {
    let point = |kind| Point { table: Table::Holding, address: 0, kind, order, field: None };
    let number = |kind| codec::decode(point(kind), &words);
    let whole = |kind| number(kind).map_or("–".to_owned(), |value| format!("{value:.0}"));
    let float = number(DataType::F32).map_or(t!("not a number").to_owned(), |value| {
        let value = to_f32(value);
        let plain = value == 0.0 || (1e-4..1e7).contains(&value.abs());
        if plain { format!("{value}") } else { format!("{value:e}") }
    });
    format!("{:>11} {:>12}  {float}", whole(DataType::U32), whole(DataType::I32))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pair_is_read_in_all_four_orders() {
        let check = |order, expect: &str| assert_eq!(pair_text([0x42C8, 0x0000], order).trim_start(), expect);
        check(ByteOrder::Abcd, "1120403456   1120403456  100");
        check(ByteOrder::Cdab, "17096        17096  2.3957e-41");
        check(ByteOrder::Badc, "3359768576   -935198720  -198656");
        check(ByteOrder::Dcba, "51266        51266  7.1839e-41");
        assert!(pair_text([0x7FC0, 0], ByteOrder::Abcd).ends_with("not a number"));
    }
}
