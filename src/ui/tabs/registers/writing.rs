//! Writing what is selected: asked with old and new value, sent once, read back, and kept in a list.

#[cfg(test)]
mod tests;

use std::borrow::Cow;

use jiff::Zoned;

use super::{AddressSpan, Registers};
use crate::ui::{command_text::outcome_words, tabs::prelude::*};
use crate::{
    bus::codec,
    plant::{
        command::{CommandId, NotConfirmed, Outcome, Refusal},
        diagnostics::{Diagnostic, Finding, RegisterWrite},
        fault::ExceptionCode,
        live::number,
        scale,
        tag::{ByteOrder, DataType, Encoding, Point, Table},
        tag_value::TagValue,
        text_value::{self, ExpectedText},
    },
    register_map::named::{Named, Names},
};

const WRITES_MAX: usize = 200;

/// A write that has ended.
#[derive(Debug, Clone, PartialEq)]
pub struct ListedWrite {
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
    list: Vec<ListedWrite>,
}

impl Writing {
    /// Notes a write that the line has ended.
    pub fn follow(&mut self, cx: &ViewContext, line: LineId) {
        let Some(run) = cx.snapshot.lines.get(line.index()).and_then(|line| line.test.as_ref()) else { return };
        let Diagnostic::Write(write) = &run.diagnostic else { return };
        let outcome = run.findings.iter().find_map(|finding| match finding {
            Finding::Written(outcome) => Some(outcome.clone()),
            _ => None,
        });
        let (Some(outcome), false) = (outcome, self.list.iter().any(|written| written.id == run.id)) else { return };
        if self.list.len() == WRITES_MAX {
            self.list.remove(0);
        }
        self.list.push(ListedWrite { id: run.id, at: run.started, write: write.clone(), outcome });
    }

    /// The last write in words, and whether its reader should worry.
    pub fn last(&self, names: &Names) -> Option<(String, bool)> {
        let written = self.list.last()?;
        let (outcome, trouble) = outcome_words(&named_outcome(names, written));
        Some((format!("{outcome}: {}", change(names, &written.write)), trouble))
    }

    /// The last verified write that no later one has taken back.
    fn undoable(&self) -> Option<&RegisterWrite> {
        let mut standing: Vec<&RegisterWrite> = Vec::new();
        let verified = self.list.iter().filter(|written| written.outcome == Outcome::Verified).map(|one| &one.write);
        // The time that a clock showed is over.
        for write in verified.filter(|write| write.clock.is_none()) {
            if standing.pop_if(|last| inverse(last) == *write).is_none() {
                standing.push(write);
            }
        }
        standing.pop()
    }

    /// Function 15 or 16 also for one: as the last write of one there, unless the unit does not know that function.
    fn multiple(&self, unit: u8, table: Table) -> bool {
        let same = |written: &&ListedWrite| {
            let write = &written.write;
            (write.unit, write.table, write.words.len()) == (unit, table, 1)
        };
        let unknown = Outcome::Refused(Refusal::Exception(ExceptionCode::ILLEGAL_FUNCTION));
        self.list.iter().rev().find(same).is_some_and(|last| last.write.multiple != (last.outcome == unknown))
    }

    /// Was it written here, with success?
    pub fn has_written(&self, unit: u8, table: Table, address: u16) -> bool {
        self.list.iter().any(|ListedWrite { write, outcome, .. }| {
            let range =
                AddressSpan { table: write.table, address: write.address, count: to_u16(write.words.len()) }.range();
            *outcome == Outcome::Verified
                && (write.unit, write.table) == (unit, table)
                && range.contains(&u32::from(address))
        })
    }

    /// All of them, the latest first.
    pub fn window(&self, cx: &ViewContext, names: &Names) -> UiAction {
        let mut lines: Vec<String> = self.list.iter().rev().map(|written| words(cx, names, written)).collect();
        if lines.is_empty() {
            lines.push(t!("Nothing was written.").to_owned());
        }
        UiAction::Open(Modal::Notice(Notice::list(t!("what was written"), lines)))
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
        if let Some((named, held)) = self.named_and_held() {
            let title =
                t!("write {name}, now {value}", name = named.name, value = named.text(&held).unwrap_or_default());
            let hint = if named.kind.is_text() {
                ExpectedText(named.kind).to_string()
            } else if named.enum_labels.is_empty() {
                t!("a value as it is shown, or +1; 0x2BC: words as they are").to_owned()
            } else {
                let labels: Vec<&str> = named.enum_labels.iter().map(|(_, label)| label.as_str()).collect();
                labels.join(", ")
            };
            return self.ask_text(super::Asking::Write, &title, &hint);
        }
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

    pub(super) fn enable_writing(&mut self, text: &str) -> Result<Vec<UiAction>, String> {
        if text != t!("yes") {
            return Err(t!("found `{text}`, expected yes", text));
        }
        self.writing.enabled = true;
        Ok(Vec::new())
    }

    /// Asks whether to write what was typed.
    pub(super) fn write_typed(&self, cx: &ViewContext, text: &str) -> Result<Vec<UiAction>, String> {
        let held = self.cells.words(self.table, self.selected, 1);
        let first = held.first().copied().ok_or_else(|| t!("its current value is unknown").to_owned())?;
        let words = match self.named_and_held() {
            Some((named, held)) if !text.starts_with("0x") && !text.starts_with("0X") => {
                typed_as(text, &named, &held, &cx.now.to_zoned(cx.def().time_zone.clone()))?
            }
            Some(_) | None => typed(text, self.table, self.order, first)?,
        };
        self.confirm(words)
    }

    /// The name of what is selected, if it has one, and the words that it holds.
    fn named_and_held(&self) -> Option<(Cow<'_, Named>, Vec<u16>)> {
        let named = self.names.get(self.table, self.selected).filter(|named| !named.table.is_bits())?;
        let named = Some(self.cells.scaled(named)).filter(|named| named.power_at.is_none())?;
        let held = self.cells.words(self.table, self.selected, named.count());
        (held.len() == usize::from(named.count())).then_some((named, held))
    }

    /// Asks whether to add to the selected register.
    pub(super) fn add(&mut self, by: i16) -> Vec<UiAction> {
        if !self.writing.enabled {
            return self.ask_write();
        }
        let held = self.cells.words(self.table, self.selected, 1);
        let Some(word) = held.first() else { return vec![unknown()] };
        let most = if self.table.is_bits() { 1 } else { u16::MAX };
        let words = match self.named_and_held() {
            Some((named, held)) => next_step(&named, &held, by),
            None => word.checked_add_signed(by).filter(|word| *word <= most).map(|word| vec![word]),
        };
        let confirm =
            words.ok_or_else(|| t!("There is no further value.").to_owned()).and_then(|words| self.confirm(words));
        confirm.unwrap_or_else(|why| vec![UiAction::Open(Modal::Notice(Notice::new(t!("write"), vec![why])))])
    }

    /// Asks whether to write back what the last verified write has replaced, and after it the one before.
    pub(super) fn undo(&self, cx: &ViewContext) -> Vec<UiAction> {
        match self.writing.undoable() {
            Some(write) => vec![self.confirmation(t!("undo"), inverse(write))],
            None => vec![self.writing.window(cx, &self.names)],
        }
    }

    fn confirm(&self, words: Vec<u16>) -> Result<Vec<UiAction>, String> {
        let expected = self.cells.words(self.table, self.selected, to_u16(words.len()));
        if expected.len() != words.len() {
            return Err(t!("not all of their current values are known").to_owned());
        }
        let (unit, table, address) = (self.unit, self.table, self.selected);
        let multiple = words.len() == 1 && self.writing.multiple(unit, table);
        let named = self.named_and_held().map(|(named, _)| named);
        let clock = named.filter(|named| text_value::is_running(named.kind)).map(|named| named.point());
        let write = RegisterWrite { unit, table, address, words, expected, multiple, clock };
        Diagnostic::Write(write.clone()).check()?;
        Ok(vec![self.confirmation(t!("write"), write)])
    }

    fn confirmation(&self, title: &str, write: RegisterWrite) -> UiAction {
        let (change, function) = (change(&self.names, &write), write.function());
        let words =
            t!("{change}. It is sent once, with function {function}, and read back. Write it?", change, function);
        let kind = CommandKind::Test(self.line, Diagnostic::Write(write));
        UiAction::Open(Modal::Confirm(Confirm::command(title, words, kind)))
    }
}

/// What takes a write back.
fn inverse(write: &RegisterWrite) -> RegisterWrite {
    RegisterWrite { words: write.expected.clone(), expected: write.words.clone(), ..write.clone() }
}

/// `unit 1 41003: 700 to 601`, for a name `SV 70.0 °C to 60.1 °C, unit 1 41003: 700 to 601`.
fn change(names: &Names, write: &RegisterWrite) -> String {
    let (old, new) = (list(&write.expected), list(&write.words));
    let place = write.table.modicon(write.address);
    let raw = t!("unit {unit} {place}: {old} to {new}", unit = write.unit, place, old, new);
    let named = names.get(write.table, write.address).filter(|named| usize::from(named.count()) == write.words.len());
    let said = named.and_then(|named| {
        let (old, new) = (named.text(&write.expected)?, named.text(&write.words)?);
        Some(t!("{name} {old} to {new}, {raw}", name = named.name, old, new, raw))
    });
    said.unwrap_or(raw)
}

/// What became of it, with what the device holds as its name shows that.
fn named_outcome(names: &Names, ListedWrite { write, outcome, .. }: &ListedWrite) -> Outcome {
    let shown = |held: &TagValue| {
        let words = match held {
            TagValue::Number(word) => vec![to_u16(word.near())],
            TagValue::Text(words) => words.split(' ').filter_map(|word| word.parse().ok()).collect(),
        };
        let named = names.get(write.table, write.address).filter(|named| usize::from(named.count()) == words.len());
        named.and_then(|named| named.text(&words)).map_or_else(|| held.clone(), |text| TagValue::Text(text.into()))
    };
    match outcome {
        Outcome::NotConfirmed(NotConfirmed::Different(held)) => {
            Outcome::NotConfirmed(NotConfirmed::Different(shown(held)))
        }
        Outcome::NotConfirmed(NotConfirmed::NotApplied(fault, held)) => {
            Outcome::NotConfirmed(NotConfirmed::NotApplied(*fault, shown(held)))
        }
        other => other.clone(),
    }
}

fn words(cx: &ViewContext, names: &Names, written: &ListedWrite) -> String {
    let at = clock(written.at, &cx.def().time_zone);
    format!("{at} {}  {}", change(names, &written.write), outcome_words(&named_outcome(names, written)).0)
}

fn list(words: &[u16]) -> String {
    words.iter().map(u16::to_string).collect::<Vec<_>>().join(" ")
}

fn unknown() -> UiAction {
    let why = t!("The current value of this address is unknown, so it is not overwritten.").to_owned();
    UiAction::Open(Modal::Notice(Notice::new(t!("write"), vec![why])))
}

/// The words of a named value: a number as it is shown, `+1` to add, one of its words, or a text. `now` sets a clock.
fn typed_as(text: &str, named: &Named, held: &[u16], now: &Zoned) -> Result<Vec<u16>, String> {
    if named.kind.is_half() {
        return Err(t!("{name} is one byte of a register: write the register", name = named.name));
    }
    if named.kind.is_text() {
        let shown = text_value::as_held(named.kind, text, now);
        let words = shown.and_then(|shown| codec::encode_text(named.point(), &shown).ok_or(ExpectedText(named.kind)));
        return words.map_err(|expected| t!("found `{text}`, expected {what}", text, what = expected));
    }
    if let Some((raw, _)) = named.enum_labels.iter().find(|(_, label)| label.eq_ignore_ascii_case(text)) {
        return encode(named, Exact::whole(*raw)).ok_or_else(|| does_not_fit(text, named));
    }
    let wrong = || {
        t!(
            "found `{text}`, expected one value of {name}, such as {shown}",
            text,
            name = named.name,
            shown = named.text(held).unwrap_or_default()
        )
    };
    let number = |text: &str| text.parse::<Exact>().ok().filter(|value| value.is_finite());
    let value = match text.strip_prefix('+') {
        Some(by) => number(by).zip(named.value(held)).map(|(by, value)| value + by),
        None => number(text),
    };
    let value = value.ok_or_else(wrong)?;
    let raw = (value.near() - named.offset) / named.scale;
    if named.kind.encoding() == Encoding::Float {
        return encode(named, raw.into()).ok_or_else(|| does_not_fit(text, named));
    }
    let whole = scale::whole_raw(value, named.scale, named.offset, 0).map(Exact::whole);
    let whole = whole.ok_or_else(|| does_not_fit(text, named))?;
    let held = scale::scaled(whole, named.scale, named.offset, 0);
    // 70.2 / 0.1 is not quite 702.
    let is_step =
        if held.rest().is_some() { held == value } else { (raw - whole.near()).abs() <= 1e-6 * raw.abs().max(1.0) };
    if !is_step {
        return Err(t!("{text}: {name} has steps of {step}", text, name = named.name, step = named.scale.abs()));
    }
    encode(named, whole).ok_or_else(|| does_not_fit(text, named))
}

fn does_not_fit(text: &str, named: &Named) -> String {
    t!("{text} does not fit {kind}", text, kind = named.kind.name())
}

/// One step of its last digit up or down; `None` where the type ends.
fn next_step(named: &Named, held: &[u16], by: i16) -> Option<Vec<u16>> {
    let raw = named.raw(held)?;
    let step = match named.kind.encoding() {
        Encoding::Float => f64::from(by) * 10_f64.powi(-i32::from(named.decimals)) / named.scale,
        _ => f64::from(by),
    };
    encode(named, raw + step.into())
}

fn encode(named: &Named, raw: Exact) -> Option<Vec<u16>> {
    codec::encode(named.point(), raw)
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
