//! Writing what is selected: asked with old and new value, sent once, read back, and kept in a list.

use super::Registers;
use crate::ui::{chrome::outcome_words, tabs::prelude::*};
use crate::{
    bus::codec,
    plant::{
        command::{CommandId, Outcome},
        diagnostics::{Diagnostic, DiagnosticState, Finding, RegisterWrite},
        live::number,
        tag::{ByteOrder, DataType, Point, Table},
    },
};

/// Writes that are listed.
const WRITES_MAX: usize = 200;

/// A write that has ended.
#[derive(Debug, Clone, PartialEq)]
pub struct Written {
    id: CommandId,
    at: Timestamp,
    write: RegisterWrite,
    outcome: Outcome,
}

/// What may be written here, and what was.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Writing {
    /// The operator has enabled it.
    pub enabled: bool,
    /// Oldest first.
    list: Vec<Written>,
}

impl Writing {
    /// Notes a write that the line has ended.
    pub fn follow(&mut self, cx: &ViewContext, line: LineId) {
        let Some(run) = cx.snapshot.lines.get(line.index()).and_then(|line| line.test.as_ref()) else { return };
        let (Diagnostic::Write(write), DiagnosticState::Done) = (&run.diagnostic, &run.state) else { return };
        let outcome = run.findings.iter().find_map(|finding| match finding {
            Finding::Written(outcome) => Some(outcome.clone()),
            _ => None,
        });
        let (Some(outcome), false) = (outcome, self.list.iter().any(|written| written.id == run.id)) else { return };
        if self.list.len() == WRITES_MAX {
            self.list.remove(0);
        }
        self.list.push(Written { id: run.id, at: run.started, write: write.clone(), outcome });
    }

    /// The last write in words, and whether its reader should worry.
    pub fn last(&self) -> Option<(String, bool)> {
        let written = self.list.last()?;
        let (outcome, trouble) = outcome_words(&written.outcome);
        Some((format!("{outcome}: {}", change(&written.write)), trouble))
    }

    /// All of them, the latest first.
    pub fn window(&self, cx: &ViewContext) -> UiAction {
        let mut lines: Vec<String> = self.list.iter().rev().map(|written| words(cx, written)).collect();
        if lines.is_empty() {
            lines.push(t!("Nothing was written.").to_owned());
        }
        UiAction::Open(Modal::Notice(Notice::new(t!("what was written"), lines)))
    }
}

impl Registers {
    /// Asks for the value to write, or first whether anything may be written at all.
    pub(super) fn ask_write(&mut self) -> Vec<UiAction> {
        if !self.writing.enabled {
            let hint = t!("wrong values can do harm. Type yes to enable writing until you quit");
            return self.ask_text(super::Asking::Enable, t!("writing is off"), hint);
        }
        let held = self.cells.words(self.table, self.selected, 1);
        let Some(word) = held.first() else {
            return vec![unknown()];
        };
        let title = t!("write {place}, now {word}", place = self.table.modicon(self.selected), word);
        let hint = if self.table.is_bits() {
            t!("0 or 1; several with blanks").to_owned()
        } else {
            t!(
                "601, -5, 0x2BC, +10; 1.5 or 70000: two registers, {order}; several with blanks",
                order = self.order.word()
            )
        };
        self.ask_text(super::Asking::Write, &title, &hint)
    }

    /// Enables writing.
    pub(super) fn enable_writing(&mut self, text: &str) -> Result<Vec<UiAction>, String> {
        if text != t!("yes") {
            return Err(t!("found `{text}`, expected yes", text));
        }
        self.writing.enabled = true;
        Ok(Vec::new())
    }

    /// Asks whether to write what was typed.
    pub(super) fn write_typed(&self, text: &str) -> Result<Vec<UiAction>, String> {
        let held = self.cells.words(self.table, self.selected, 1);
        let first = held.first().copied().ok_or_else(|| t!("it is not known what it holds now").to_owned())?;
        let words = typed(text, self.table, self.order, first)?;
        self.confirm(words)
    }

    /// Asks whether to add to the selected register.
    pub(super) fn add(&mut self, by: i16) -> Vec<UiAction> {
        if !self.writing.enabled {
            return self.ask_write();
        }
        let held = self.cells.words(self.table, self.selected, 1);
        let sum = held.first().map(|word| word.wrapping_add_signed(by));
        let confirm = sum.ok_or_else(String::new).and_then(|word| self.confirm(vec![word]));
        confirm.unwrap_or_else(|_| vec![unknown()])
    }

    /// Asks whether to write back what the last verified write has replaced.
    pub(super) fn undo(&self, cx: &ViewContext) -> Vec<UiAction> {
        let verified = |written: &&Written| written.outcome == Outcome::Verified;
        let Some(written) = self.writing.list.iter().rev().find(verified) else {
            return vec![self.writing.window(cx)];
        };
        let write = &written.write;
        let back = RegisterWrite { words: write.expected.clone(), expected: write.words.clone(), ..write.clone() };
        vec![self.confirmation(t!("undo"), back)]
    }

    fn confirm(&self, words: Vec<u16>) -> Result<Vec<UiAction>, String> {
        let expected = self.cells.words(self.table, self.selected, to_u16(words.len()));
        if expected.len() != words.len() {
            return Err(t!("it is not known what all of them hold now").to_owned());
        }
        let (unit, table, address) = (self.unit, self.table, self.selected);
        let write = RegisterWrite { unit, table, address, words, expected, multiple: false };
        Diagnostic::Write(write.clone()).check()?;
        Ok(vec![self.confirmation(t!("write"), write)])
    }

    fn confirmation(&self, title: &str, write: RegisterWrite) -> UiAction {
        let words = t!("{change}. It is sent once and read back. Write it?", change = change(&write));
        let kind = CommandKind::Test(self.line, Diagnostic::Write(write));
        UiAction::Open(Modal::Confirm(Confirm::command(title, words, kind)))
    }
}

/// `unit 1 41003: 700 → 601`.
fn change(write: &RegisterWrite) -> String {
    let (old, new) = (list(&write.expected), list(&write.words));
    t!("unit {unit} {place}: {old} to {new}", unit = write.unit, place = write.table.modicon(write.address), old, new)
}

fn words(cx: &ViewContext, written: &Written) -> String {
    let at = clock(written.at, &cx.def().time_zone);
    format!("{at} {}  {}", change(&written.write), outcome_words(&written.outcome).0)
}

fn list(words: &[u16]) -> String {
    words.iter().map(u16::to_string).collect::<Vec<_>>().join(" ")
}

fn unknown() -> UiAction {
    let why = t!("It is not known what this address holds now, so nothing is written over it.").to_owned();
    UiAction::Open(Modal::Notice(Notice::new(t!("write"), vec![why])))
}

/// The words that a text means: whole numbers one each, a float or a greater number two in this order; `+10` adds.
fn typed(text: &str, table: Table, order: ByteOrder, held: u16) -> Result<Vec<u16>, String> {
    let wrong = |word: &str| t!("found `{word}`, expected numbers such as 601, -5, 0x2BC, +10 or 1.5", word);
    let one = |word: &str| -> Result<Vec<u16>, String> {
        if table.is_bits() {
            let bit = |word: &str| t!("found `{word}`, expected 0 or 1", word);
            return number(word).filter(|bit| *bit <= 1).map(|bit| vec![bit]).ok_or_else(|| bit(word));
        }
        if let Some(by) = word.strip_prefix('+') {
            let sum = by.parse::<u16>().ok().and_then(|by| held.checked_add(by));
            return sum.map(|sum| vec![sum]).ok_or_else(|| wrong(word));
        }
        if let Some(word) = number(word) {
            return Ok(vec![word]);
        }
        if let Ok(negative) = word.parse::<i16>() {
            return Ok(vec![negative.cast_unsigned()]);
        }
        let value = word.parse::<f64>().ok().filter(|value| value.is_finite()).ok_or_else(|| wrong(word))?;
        let kind = match (value.fract() == 0.0 && !word.contains(['.', 'e', 'E']), value < 0.0) {
            (true, true) => DataType::I32,
            (true, false) => DataType::U32,
            (false, _) => DataType::F32,
        };
        let point = Point { table: Table::Holding, address: 0, kind, order, field: None };
        codec::encode(point, value).ok_or_else(|| t!("{word} does not fit 32 bits", word))
    };
    let words = text.split_whitespace().map(one).collect::<Result<Vec<_>, _>>()?.concat();
    if words.is_empty() { Err(wrong(text)) } else { Ok(words) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_typed_becomes_words() {
        let words = |text: &str| typed(text, Table::Holding, ByteOrder::Abcd, 700);
        assert_eq!(words("601"), Ok(vec![601]));
        assert_eq!(words("-5"), Ok(vec![0xFFFB]));
        assert_eq!(words("0x2BC 1"), Ok(vec![700, 1]));
        assert_eq!(words("+10"), Ok(vec![710]));
        assert_eq!(words("104.0"), Ok(vec![0x42D0, 0]));
        assert_eq!(words("70000"), Ok(vec![1, 4464]));
        assert_eq!(typed("70000", Table::Holding, ByteOrder::Cdab, 0), Ok(vec![4464, 1]));
        for wrong in ["", "x", "+x", "99999999999", "NaN", "+65000"] {
            assert!(words(wrong).is_err(), "{wrong}");
        }
        assert_eq!(typed("1 0", Table::Coil, ByteOrder::Abcd, 0), Ok(vec![1, 0]));
        assert!(typed("2", Table::Coil, ByteOrder::Abcd, 0).is_err());
    }
}
