//! The JSON of MTUI.

use serde::Deserialize;

use crate::{
    plant::{
        exact::Exact,
        tag::{ByteOrder, DataType, Table},
    },
    profile::unit_of,
    register_map::{
        list::{List, words},
        named::{Named, decimals_of},
    },
    t,
};

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

pub fn read(text: &str) -> List {
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
            return Err(t!("names of bits cannot be imported").to_owned());
        }
        if self.next.iter().zip(1u16..).any(|(next, n)| address.checked_add(n) != Some(*next)) {
            return Err(t!("its words are not adjacent").to_owned());
        }
        let order = self.word_order.as_deref().map_or(Some(usual), words::order_of);
        let order = order.ok_or_else(|| t!("unknown word order").to_owned())?;
        let order = if kind.is_half() { ByteOrder::Abcd } else { order };
        let (mut scale, mut offset) = (1.0, 0.0);
        for op in &self.ops {
            let wrong = || t!("{op} cannot be expressed by a scale and an offset", op);
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
        let decimals = self.decimals.unwrap_or_else(|| decimals_of(scale, kind));
        Ok(Named { scale, offset, decimals, unit, enum_labels, ..plain })
    }
}
