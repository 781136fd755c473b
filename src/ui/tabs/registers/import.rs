//! Register lists of other programs: the JSON of MTUI, and the CSV that Wingpath's ModMaster and Modsak export. Their scales
//! are not those of a manual: read as such a list they would give wrong values. What is known to be something else is refused
//! with its name.

mod foreign;
pub(super) mod preview;

use serde::Deserialize;

use super::{
    list::{self, List, ListContext, words},
    names::Named,
};
use crate::{
    plant::{
        address::AddressContext,
        exact::Exact,
        tag::{ByteOrder, DataType, Table},
    },
    profile::unit_of,
    t,
};

/// Reads a list of any form that is known; else says what it is and what can be read.
pub fn parse(text: &str, context: &ListContext) -> List {
    let text = text.trim_start_matches('\u{FEFF}').trim_start();
    let list = match foreign::form(text) {
        Some(form) => List::refused(t!("it is {form}", form)),
        None if text.starts_with('{') => mtui(text),
        None if is_wingpath(text) => wingpath(text, context),
        None => list::parse(text, context),
    };
    let known = t!(
        "What can be read: CSV and other text with a heading (address, name, type, scale, unit, table, in any order), columns of a PDF, tables of Markdown, lists of ioBroker, the JSON of MTUI, and exports of ModMaster and Modsak."
    );
    List { refused: list.refused.map(|why| format!("{why}. {known}")), ..list }
}

fn is_wingpath(text: &str) -> bool {
    let head = text.lines().next().unwrap_or_default();
    ["Address", "Name", "Type", "Radix", "Offset", "Scale"].iter().all(|column| head.contains(column))
}

/// `config.json` of MTUI, or the part of it that it takes as a paste: since its version 1 `registers` with everything of an
/// address together, before that `labels` and `custom_rules`. Addresses count from 0.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct Mtui {
    device: MtuiDevice,
    registers: Tables,
    labels: Tables,
    custom_rules: Tables,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct MtuiDevice {
    word_order: Option<String>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct Tables {
    holdings: Vec<Entry>,
    inputs: Vec<Entry>,
    coils: Vec<Entry>,
    discretes: Vec<Entry>,
}

/// A register, a label or a rule of MTUI.
#[derive(Debug, Clone, Deserialize)]
struct Entry {
    #[serde(alias = "i", alias = "a")]
    address: u16,
    #[serde(default, alias = "t")]
    label: Option<String>,
    #[serde(default)]
    custom: Option<Rule>,
    #[serde(default, flatten)]
    rule: Rule,
}

/// What MTUI makes of the words of an address.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(default)]
struct Rule {
    repr: Option<String>,
    /// `/10`, `+5`, in this order.
    ops: Vec<serde_json::Value>,
    #[serde(rename = "enum")]
    labels: Vec<Label>,
    bits: Vec<serde_json::Value>,
    /// Addresses of the words behind the first, where they do not follow each other.
    next: Vec<u16>,
    decimals: Option<u8>,
    suffix: String,
    word_order: Option<String>,
}

#[derive(Debug, Clone, Deserialize)]
struct Label {
    value: i64,
    text: String,
}

fn mtui(text: &str) -> List {
    let mut list = List::default();
    // By way of a value: what is flattened meets numbers of any precision there as numbers.
    let read: Mtui = match serde_json::from_str::<serde_json::Value>(text).and_then(serde_json::from_value) {
        Ok(read) => read,
        Err(error) => {
            return List::refused(t!(
                "it is JSON, but not the registers, labels or custom_rules of MTUI: {error}",
                error
            ));
        }
    };
    let all = [&read.registers, &read.labels, &read.custom_rules];
    if Table::ALL.iter().all(|table| all.iter().all(|tables| tables.of(*table).is_empty())) {
        return List::refused(t!("it is JSON without the registers, labels or custom_rules of MTUI").to_owned());
    }
    let usual = read.device.word_order.as_deref().and_then(words::order_of).unwrap_or_default();
    for table in [Table::Holding, Table::Input, Table::Coil, Table::Discrete] {
        let entries = [&read.registers, &read.labels, &read.custom_rules].map(|tables| tables.of(table));
        let mut addresses: Vec<u16> =
            entries.iter().flat_map(|entries| entries.iter()).map(|one| one.address).collect();
        addresses.sort_unstable();
        addresses.dedup();
        for address in addresses {
            let here = || entries.iter().flat_map(|entries| entries.iter()).filter(|one| one.address == address);
            let label = here().find_map(|one| one.label.clone());
            let rule =
                here().find_map(|one| one.custom.clone().or_else(|| Some(one.rule.clone()).filter(Rule::is_one)));
            if label.is_none() && rule.is_none() {
                // Only pinned: it has no name.
                continue;
            }
            let name = label.unwrap_or_else(|| format!("{}-{address}", table.word()));
            list.push(&table.modicon(address), rule.unwrap_or_default().named(table, address, usual, &name));
        }
    }
    list
}

impl Tables {
    fn of(&self, table: Table) -> &[Entry] {
        match table {
            Table::Holding => &self.holdings,
            Table::Input => &self.inputs,
            Table::Coil => &self.coils,
            Table::Discrete => &self.discretes,
        }
    }
}

impl Rule {
    /// An old label is an entry without one.
    fn is_one(&self) -> bool {
        self.repr.is_some()
    }

    fn named(self, table: Table, address: u16, usual: ByteOrder, name: &str) -> Result<Named, String> {
        let repr = self.repr.as_deref().unwrap_or("U16");
        let kind = words::kind_of(repr).ok_or_else(|| t!("`{repr}` is not a known type", repr))?;
        let kind = if table.is_bits() { DataType::Bool } else { kind };
        if !self.bits.is_empty() {
            return Err(t!("names of bits cannot be taken").to_owned());
        }
        if self.next.iter().zip(1u16..).any(|(next, n)| address.checked_add(n) != Some(*next)) {
            return Err(t!("its words do not stand beside each other").to_owned());
        }
        let order = self.word_order.as_deref().map_or(Some(usual), words::order_of);
        let order = order.ok_or_else(|| t!("unknown word order").to_owned())?;
        let order = if kind.is_half() { ByteOrder::Abcd } else { order };
        let (mut scale, mut offset) = (1.0, 0.0);
        for op in &self.ops {
            let wrong = || t!("{op} is not a step that a scale and an offset can do", op);
            let text = op.as_str().map(str::trim).ok_or_else(wrong)?;
            let by: f64 = text.get(1..).and_then(|number| number.trim().parse().ok()).ok_or_else(wrong)?;
            match text.chars().next() {
                Some('+') => offset += by,
                Some('-') => offset -= by,
                Some('*' | 'x' | 'X') => (scale, offset) = (scale * by, offset * by),
                Some('/') if by != 0.0 => (scale, offset) = (scale / by, offset / by),
                _ => return Err(wrong()),
            }
        }
        let suffix = self.suffix.trim();
        let unit = unit_of(suffix);
        let plain = Named::new(table, address, kind, order, name);
        let raw = |value: i64| plain.point().raw_number(value.into(), false).number().and_then(Exact::as_whole);
        let label = |Label { value, text }| raw(value).map(|raw| (raw, text));
        let enum_labels = self.labels.into_iter().filter_map(label).collect();
        let decimals = self.decimals.unwrap_or_else(|| words::decimals_of(scale, kind));
        Ok(Named { scale, offset, decimals, unit, enum_labels, ..plain })
    }
}

/// "Export Registers" of ModMaster and Modsak: their displayed value is (raw + offset) / scale.
fn wingpath(text: &str, context: &ListContext) -> List {
    let mut reader = csv::ReaderBuilder::new().flexible(true).has_headers(false).from_reader(text.as_bytes());
    // A text in memory is read to its end.
    let mut records = reader.records().filter_map(Result::ok);
    let columns = records.next().unwrap_or_default();
    let cell = |record: &csv::StringRecord, name: &str| {
        let at = columns.iter().position(|column| column.trim() == name);
        at.and_then(|at| record.get(at)).unwrap_or_default().trim().to_owned()
    };
    let rows: Vec<csv::StringRecord> = records.collect();
    let written: Vec<String> = rows.iter().map(|row| cell(row, "Address")).collect();
    let written: Vec<(&str, Option<Table>)> = written.iter().map(|text| (text.as_str(), None)).collect();
    let (base, unclear) = list::base_of(&written, context);
    let mut list = List { unclear, ..List::default() };
    for row in &rows {
        let place = t!("line {number}", number = row.position().map_or(0, csv::Position::line));
        let of = AddressContext { table: context.table, is_stated: false, base };
        list.push(&place, exported(|name| cell(row, name), of));
    }
    list
}

fn exported(cell: impl Fn(&str) -> String, of: AddressContext) -> Result<Named, String> {
    let (written, name, word) = (cell("Address"), cell("Name"), cell("Type"));
    // A discrete value stands in a table of bits.
    let table = if word == "int1" && !of.table.is_bits() { Table::Coil } else { of.table };
    let found = AddressContext { table, ..of }.parse(&written);
    let (table, address) = found.ok_or_else(|| t!("`{written}` is not an address", written))?;
    if name.is_empty() {
        return Err(t!("{written}: no name", written));
    }
    let kind = if word == "int1" { Some(DataType::Bool) } else { words::kind_of(&word) };
    // Its 8-bit types are those of devices whose registers have 8 bits.
    let kind = kind.filter(|kind| table.is_bits() == (*kind == DataType::Bool) && !kind.is_half());
    let kind = kind.ok_or_else(|| t!("{written}: `{word}` is not a known type", written, word))?;
    let number = |name: &str, usual: f64| {
        let text = cell(name);
        let number = if text.is_empty() { Ok(usual) } else { text.parse::<f64>() };
        number
            .ok()
            .filter(|number| number.is_finite())
            .ok_or_else(|| t!("{written}: `{text}` is not a scale", written, text))
    };
    let (offset, divisor) = (number("Offset", 0.0)?, number("Scale", 1.0)?);
    if divisor == 0.0 {
        return Err(t!("{written}: `{text}` is not a scale", written, text = cell("Scale")));
    }
    let (scale, unit) = (1.0 / divisor, unit_of(&cell("Unit")));
    let decimals = words::decimals_of(scale, kind);
    let order = ByteOrder::Abcd;
    Ok(Named { scale, offset: offset / divisor, decimals, unit, ..Named::new(table, address, kind, order, &name) })
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;

    fn context() -> ListContext {
        ListContext { table: Table::Holding, base: None, order: ByteOrder::Abcd, unit: 1, means: BTreeMap::new() }
    }

    fn read(text: &str) -> (Vec<String>, Vec<String>) {
        let list = parse(text, &context());
        let shown = |named: &Named| {
            let (place, kind, order) = (named.table.modicon(named.address), named.kind.name(), named.order.word());
            let (name, unit) = (&named.name, &named.unit);
            format!("{place} {name} {kind} {order} {} {} {} {unit}", named.scale, named.offset, named.decimals)
        };
        (list.named.iter().map(shown).collect(), list.problems)
    }

    #[test]
    fn an_export_of_modmaster_divides_by_its_scale() {
        let head = "\"Address\",\"Name\",\"Type\",\"Value\",\"Unit\",\"Radix\",\"Offset\",\"Scale\",\"Min\",\"Max\",\"Write\"\n";
        let rows = "\"1002\",\"\"\"SV\"\" wanted\",\"int16\",\"700\",\"degC\",\"10\",\"-20.0\",\"10.0\",\"\",\"\",\"true\"\n\
                    \"3049\",\"Alarm 4\",\"int16\",\"0\",\"\",\"10\",\"0.0\",\"1.0\",\"false\"\n\
                    \"7\",\"Run\",\"int1\",\"0\",\"\",\"10\",\"0.0\",\"1.0\",\"false\"\n\
                    \"8\",\"Half\",\"int8\",\"0\",\"\",\"10\",\"0.0\",\"1.0\",\"false\"\n\
                    \"9\",\"Zero\",\"int16\",\"0\",\"\",\"10\",\"0.0\",\"0\",\"false\"\n";
        let (named, problems) = read(&format!("{head}{rows}"));
        let expect = [
            "41003 \"SV\" wanted int16 ABCD 0.1 -2 1 °C",
            "43050 Alarm 4 int16 ABCD 1 0 0 ",
            "00008 Run bool ABCD 1 0 0 ",
        ];
        assert_eq!(named, expect);
        assert_eq!(problems, ["line 5: 8: `int8` is not a known type", "line 6: 9: `0` is not a scale"]);
        assert_eq!(read("Address,Name,Scale\n5,a,10\n").0, ["40006 a uint16 ABCD 10 0 0 "], "a list of a manual");
    }

    #[test]
    fn registers_of_mtui_are_taken_with_their_rules() {
        let text = r#"{ "version": 1, "device": { "word_order": "CDAB" }, "registers": {
            "holdings": [
                { "address": 50, "label": "set voltage", "custom": { "repr": "U16", "ops": ["/10"], "decimals": 1, "suffix": " V" } },
                { "address": 53, "pinned": true },
                { "address": 54, "label": "state", "custom": { "repr": "U16", "enum": [{ "value": 0, "text": "off" }] } },
                { "address": 60, "custom": { "repr": "F32", "ops": ["*2", "+5"], "word_order": "ABCD" } },
                { "address": 70, "label": "flags", "custom": { "repr": "U16", "bits": [{ "bit": 0, "name": "run" }] } },
                { "address": 80, "label": "half", "custom": { "repr": "F16" } },
                { "address": 90, "label": "apart", "custom": { "repr": "U32", "next": [95] } },
                { "address": 91, "label": "squared", "custom": { "repr": "U16", "ops": ["^2"] } } ],
            "coils": [{ "address": 0, "label": "breaker" }] } }"#;
        let (named, problems) = read(text);
        let expect = [
            "40051 set voltage uint16 CDAB 0.1 0 1 V",
            "40055 state uint16 CDAB 1 0 0 ",
            "40061 holding-60 float32 ABCD 2 5 2 ",
            "40081 half float16 CDAB 1 0 2 ",
            "00001 breaker bool CDAB 1 0 0 ",
        ];
        assert_eq!(named, expect);
        assert_eq!(problems.len(), 3, "{problems:?}");
        assert!(problems[0].starts_with("40071: names of bits") && problems[2].contains("\"^2\""), "{problems:?}");
    }

    #[test]
    fn labels_and_rules_of_an_older_mtui_are_joined_by_address() {
        let text = r#"{ "labels": { "inputs": [{ "i": 7, "t": "temperature" }, { "i": 9, "t": "plain" }] },
            "custom_rules": { "inputs": [{ "a": 7, "repr": "I16", "ops": ["/10"], "decimals": 1, "suffix": " C" }] } }"#;
        let expect = ["30008 temperature int16 ABCD 0.1 0 1 °C", "30010 plain uint16 ABCD 1 0 0 "];
        assert_eq!(read(text), (expect.map(str::to_owned).to_vec(), Vec::new()));
        let broken = parse("{ \"holdings\": ", &context()).refused.expect("a reason");
        assert!(broken.contains("not the registers") && broken.contains("What can be read: CSV"), "{broken}");
    }
}
