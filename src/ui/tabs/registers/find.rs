//! Where something is: an address as it is typed, and a value among what was read.

use super::Registers;
use crate::{
    bus::interpret,
    plant::{
        address::{AddressBase, AddressContext},
        diagnostics::{Diagnostic, Finding},
        exact::Exact,
        live::{AddressSpan, SPANS_MAX, number},
        number::{to_f32, to_u16},
        sweep::SweptOutcome,
        tag::{ByteOrder, DataType, Table},
    },
    t,
    ui::ViewContext,
};

/// Places that are listed at most: the likeliest.
const HITS_MAX: usize = 200;
/// Registers of a map that are read to look for a number.
const SWEPT_MAX: u32 = 3_000;
/// Types that a number is looked for as, each with how likely it is.
const KINDS: [(DataType, u8); 10] = [
    (DataType::F32, 90),
    (DataType::U16, 80),
    (DataType::I16, 80),
    (DataType::U32, 60),
    (DataType::I32, 60),
    (DataType::F64, 60),
    (DataType::Bcd16, 40),
    (DataType::U64, 40),
    (DataType::I64, 40),
    (DataType::Bcd32, 30),
];
/// The type that the values before and now suggest.
const SUGGESTED: u8 = 10;

/// A place that may hold a number.
#[derive(Debug, Clone, PartialEq)]
pub struct Hit {
    pub table: Table,
    pub address: u16,
    pub kind: DataType,
    pub order: ByteOrder,
    /// Digits of the raw number behind the point.
    pub decimals: u8,
    /// Percent.
    pub likelihood: u8,
    /// The number that is there.
    pub shown: String,
}

struct Wanted {
    value: f64,
    /// Digits behind the point, as it was typed.
    decimals: u8,
    is_hex: bool,
}

impl Registers {
    /// `1002`, `0x3EA`, `41003`: in this table and by its base; `input:1000`: as sent, in any.
    pub(super) fn parse_address(&self, text: &str) -> Result<(Table, u16), String> {
        let of = AddressContext { table: self.table, is_stated: false, base: self.base };
        of.parse(text).ok_or_else(|| {
            if self.base == AddressBase::One && number(text) == Some(0) {
                return t!("the first is 1").to_owned();
            }
            t!("found `{text}`, expected an address such as 1002, 0x3EA, 41003 or holding:1002", text)
        })
    }

    /// Every place that may hold a number, over types, orders and scales, the likeliest first.
    pub(super) fn hits(&self, text: &str) -> Vec<Hit> {
        let Ok(wanted) = wanted(text) else { return Vec::new() };
        let mut hits: Vec<Hit> =
            self.cells.good().flat_map(|(table, address)| self.hits_at(table, address, &wanted)).collect();
        hits.sort_by_key(|hit| (std::cmp::Reverse(hit.likelihood), hit.table, hit.address));
        hits.truncate(HITS_MAX);
        hits
    }

    fn hits_at(&self, table: Table, address: u16, wanted: &Wanted) -> Vec<Hit> {
        let words = self.cells.words(table, address, 4);
        let suggested = self.cells.likely(table, address);
        let mut found: Vec<Hit> = Vec::new();
        for (kind, base) in KINDS.into_iter().filter(|(kind, _)| !table.is_bits() || *kind == DataType::U16) {
            let one_word = [ByteOrder::Abcd, ByteOrder::Badc];
            let orders: &[ByteOrder] = if kind.registers() == 1 { &one_word } else { &ByteOrder::ALL };
            for (n, order) in orders.iter().enumerate().filter(|_| usize::from(kind.registers()) <= words.len()) {
                let Some(value) = interpret::number(kind, *order, &words).map(Exact::near) else { continue };
                let Some(decimals) = wanted.decimals_of(value, kind) else { continue };
                let same = |hit: &&Hit| hit.kind.registers() == kind.registers() && hit.shown == shown(value, kind);
                // A positive number is the same with a sign, and two equal bytes are the same either way.
                if found.iter().find(same).is_some() {
                    continue;
                }
                let place = base.saturating_sub(if order == &ByteOrder::Badc { 30 } else { 10 * u8_of(n) });
                let is_float = matches!(kind, DataType::F32 | DataType::F64);
                let digits = if is_float { 0 } else { 10 * decimals.abs_diff(wanted.decimals) };
                let small = if value.abs() < 10.0 { 30 } else { 0 };
                let hint = if suggested == Some((kind, *order)) { SUGGESTED } else { 0 };
                let likelihood = (place.saturating_sub(digits).saturating_sub(small) + hint).max(1);
                let (order, shown) = (*order, shown(value, kind));
                found.push(Hit { table, address, kind, order, decimals, likelihood, shown });
            }
        }
        found
    }

    /// What a map of addresses has found that was not read yet.
    pub(super) fn swept(&self, cx: &ViewContext) -> Vec<AddressSpan> {
        let run = cx.snapshot.lines.get(self.line.index()).and_then(|line| line.test.as_ref());
        let Some((run, sweep)) = run.and_then(|run| match run.diagnostic {
            Diagnostic::Sweep(sweep) if sweep.unit == self.unit => Some((run, sweep)),
            _ => None,
        }) else {
            return Vec::new();
        };
        let (mut spans, mut left) = (Vec::new(), SWEPT_MAX);
        for finding in &run.findings {
            let Finding::Swept(range) = finding else { continue };
            let is_known = self.cells.get(sweep.table, range.first).is_some_and(|cell| cell.word.is_some());
            if range.outcome == SweptOutcome::Answers && !is_known && left != 0 && spans.len() < SPANS_MAX {
                let count = (u32::from(range.last) + 1).saturating_sub(range.first.into()).min(left);
                left -= count;
                spans.push(AddressSpan { table: sweep.table, address: range.first, count: to_u16(count) });
            }
        }
        spans
    }
}

/// Reads a number; `Err` says what is expected.
pub fn check(text: &str) -> Result<(), String> {
    wanted(text).map(|_| ())
}

fn wanted(text: &str) -> Result<Wanted, String> {
    let wrong = || t!("found `{text}`, expected a number such as 702, 70.2 or 0x2BE", text);
    let word = number(text).filter(|_| !text.contains('.'));
    let value = match word {
        Some(word) => f64::from(word),
        None => text.parse::<f64>().ok().filter(|wanted| wanted.is_finite()).ok_or_else(wrong)?,
    };
    let decimals = text.split_once('.').map_or(0, |(_, digits)| u8_of(digits.len().min(9)));
    Ok(Wanted { value, decimals, is_hex: text.to_ascii_lowercase().starts_with("0x") })
}

impl Wanted {
    /// The digits behind the point with which a raw number is the wanted one, as exact as it was typed.
    fn decimals_of(&self, value: f64, kind: DataType) -> Option<u8> {
        let digit = 0.5 * 10f64.powi(-i32::from(self.decimals));
        let near = |scaled: f64| (scaled - self.value).abs() < digit * 1e-6 + f64::EPSILON * self.value.abs();
        let most = if self.is_hex { 0 } else { 3 };
        let exact = (0..=most).find(|decimals| near(value / 10f64.powi(i32::from(*decimals))));
        let is_float = matches!(kind, DataType::F32 | DataType::F64);
        let rounded = is_float && value.fract() != 0.0 && (value - self.value).abs() <= digit;
        // A float has its point itself.
        if is_float { (exact == Some(0) || rounded).then_some(0) } else { exact }
    }
}

/// As short as its type permits.
fn shown(value: f64, kind: DataType) -> String {
    if kind == DataType::F32 { to_f32(value).to_string() } else { value.to_string() }
}

fn u8_of(number: usize) -> u8 {
    u8::try_from(number).unwrap_or(u8::MAX)
}
