//! Register lists of other programs: the JSON of MTUI, and the CSV that Wingpath's ModMaster and Modsak export. Their scales
//! are not those of a manual: read as such a list they would give wrong values.

use serde::Deserialize;

use super::{
    list::{self, List},
    names::Named,
};
use crate::{
    plant::tag::{ByteOrder, DataType, Table},
    profile::unit_of,
    t,
};

/// The list of another program; `None` where it is none of these.
pub fn parse(text: &str, table: Table, first: u16) -> Option<List> {
    let text = text.trim_start_matches('\u{FEFF}').trim();
    if text.starts_with('{') {
        return Some(mtui(text));
    }
    let (head, _) = text.split_once('\n')?;
    let is_export = ["Address", "Name", "Type", "Radix", "Offset", "Scale"].iter().all(|column| head.contains(column));
    is_export.then(|| wingpath(text, table, first))
}

impl List {
    fn push(&mut self, place: &str, named: Result<Named, String>) {
        match named {
            Ok(named) => self.named.push(named),
            Err(why) => self.problems.push(format!("{place}: {why}")),
        }
    }
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
            list.problems
                .push(t!("found JSON, expected the registers, labels or custom_rules of MTUI: {error}", error));
            return list;
        }
    };
    let usual = read.device.word_order.as_deref().and_then(list::order_of).unwrap_or_default();
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
        let kind = list::kind_of(repr).ok_or_else(|| t!("`{repr}` is not a known type", repr))?;
        let kind = if table.is_bits() { DataType::Bool } else { kind };
        if !self.bits.is_empty() {
            return Err(t!("names of bits cannot be taken").to_owned());
        }
        if self.next.iter().zip(1u16..).any(|(next, n)| address.checked_add(n) != Some(*next)) {
            return Err(t!("its words do not stand beside each other").to_owned());
        }
        let order = self.word_order.as_deref().map_or(Some(usual), list::order_of);
        let order = order.ok_or_else(|| t!("unknown word order").to_owned())?;
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
        let unit = unit_of(suffix).map_or(suffix.to_owned(), str::to_owned);
        let enum_labels = self.labels.into_iter().map(|Label { value, text }| (value.into(), text)).collect();
        let decimals = self.decimals.unwrap_or_else(|| list::decimals_of(scale, kind));
        Ok(Named { scale, offset, decimals, unit, enum_labels, ..Named::new(table, address, kind, order, name) })
    }
}

/// "Export Registers" of ModMaster and Modsak: their displayed value is (raw + offset) / scale.
fn wingpath(text: &str, table: Table, first: u16) -> List {
    let mut list = List::default();
    let mut reader = csv::ReaderBuilder::new().flexible(true).has_headers(false).from_reader(text.as_bytes());
    let mut columns: Option<csv::StringRecord> = None;
    for (n, record) in reader.records().enumerate() {
        let place = t!("line {number}", number = n + 1);
        let Ok(record) = record else {
            list.problems.push(t!("{place}: it is no CSV", place));
            continue;
        };
        let Some(columns) = &columns else {
            columns = Some(record);
            continue;
        };
        let cell = |name: &str| {
            let at = columns.iter().position(|column| column.trim() == name);
            at.and_then(|at| record.get(at)).unwrap_or_default().trim()
        };
        list.push(&place, exported(cell, table, first));
    }
    list
}

fn exported<'a>(cell: impl Fn(&str) -> &'a str, table: Table, first: u16) -> Result<Named, String> {
    let (written, name, word) = (cell("Address"), cell("Name"), cell("Type"));
    // A discrete value stands in a table of bits.
    let table = if word == "int1" && !table.is_bits() { Table::Coil } else { table };
    let found = list::address_of(written, table, first);
    let (table, address) = found.ok_or_else(|| t!("`{written}` is not an address", written))?;
    if name.is_empty() {
        return Err(t!("{written}: no name", written));
    }
    let kind = if word == "int1" { Some(DataType::Bool) } else { list::kind_of(word) };
    let kind = kind.filter(|kind| table.is_bits() == (*kind == DataType::Bool));
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
    let (scale, unit) = (1.0 / divisor, cell("Unit"));
    let unit = unit_of(unit).map_or(unit.to_owned(), str::to_owned);
    let decimals = list::decimals_of(scale, kind);
    let order = ByteOrder::Abcd;
    Ok(Named { scale, offset: offset / divisor, decimals, unit, ..Named::new(table, address, kind, order, name) })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> (Vec<String>, Vec<String>) {
        let list = parse(text, Table::Holding, 0).expect("a list of another program");
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
        assert_eq!(parse("Address,Name,Scale\n5,a,10\n", Table::Holding, 0), None, "a list of a manual");
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
            "00001 breaker bool CDAB 1 0 0 ",
        ];
        assert_eq!(named, expect);
        assert_eq!(problems.len(), 4, "{problems:?}");
        assert!(problems[0].starts_with("40071: names of bits") && problems[3].contains("\"^2\""), "{problems:?}");
    }

    #[test]
    fn labels_and_rules_of_an_older_mtui_are_joined_by_address() {
        let text = r#"{ "labels": { "inputs": [{ "i": 7, "t": "temperature" }, { "i": 9, "t": "plain" }] },
            "custom_rules": { "inputs": [{ "a": 7, "repr": "I16", "ops": ["/10"], "decimals": 1, "suffix": " C" }] } }"#;
        let expect = ["30008 temperature int16 ABCD 0.1 0 1 °C", "30010 plain uint16 ABCD 1 0 0 "];
        assert_eq!(read(text), (expect.map(str::to_owned).to_vec(), Vec::new()));
        let (named, problems) = read("{ \"holdings\": ");
        assert!(named.is_empty() && problems[0].contains("expected the registers"), "{problems:?}");
    }
}
