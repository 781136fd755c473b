//! Inverters of ha-solarman: <https://github.com/davidrapan/ha-solarman/wiki>.

mod bounds;
mod sums;

use std::time::Duration;

use super::{apart, beside, field_of, missing, unsaid, wrong};
use crate::{
    plant::{
        data_type::Clock,
        tag::{Access, ByteOrder, DataType, Poll, Table},
    },
    profile::unit_of,
    register_map::{
        container::node::{Node, Tree, Value},
        list::{List, ListContext, calculated::Calculated},
        named::Named,
    },
    t,
};

/// Keys that are kept, or say nothing about a value.
const KNOWN: &[&str] = &[
    "name",
    "rule",
    "registers",
    "scale",
    "offset",
    "divide",
    "uom",
    "unit_of_measurement",
    "class",
    "device_class",
    "state_class",
    "icon",
    "lookup",
    "mask",
    "bit",
    "bitmask",
    "magnitude",
    "inverted",
    "platform",
    "configurable",
    "code",
    "digits",
    "update_interval",
    "alt",
    "friendly_name",
    "description",
    "attribute",
    "attributes",
    "hidden",
    "disabled",
    "l",
    "mppt",
    "pack",
    "options",
    "uint",
    "display",
    "enabled_lookup",
    "name_lookup",
    "persistent",
    "realtime",
    "key",
    "plaform",
    "descripton",
    "max",
    "min",
    "dec",
    "hex",
    "delimiter",
    "remove",
    "range",
    "validation",
];

/// The tables of registers that the requests of an older file state.
type Tables = Vec<(i64, i64, Table)>;

/// Reads a device.
pub fn read(tree: &Tree, context: &ListContext) -> List {
    let mut list = List::of_tree(tree);
    let info = tree.root.get("info");
    let word = |key: &str| info.and_then(|info| info.word(key)).unwrap_or_default().to_owned();
    list.about = ["manufacturer", "model"].map(word);
    let request = |node: &Node| {
        let code = node.get("code").or(node.get("mb_functioncode"))?.whole()?;
        Some((node.get("start")?.whole()?, node.get("end")?.whole()?, table_of(code)?))
    };
    // Requests of fine control only say what is read together.
    let requests = if tree.root.entries().iter().any(|(key, _)| key == "requests_fine_control") {
        &[]
    } else {
        tree.root.all("requests")
    };
    let tables: Tables = requests.iter().filter_map(request).collect();
    let usual = tree.root.get("default").and_then(code_of).unwrap_or(Table::Holding);
    for group in tree.root.all("parameters") {
        let name = group.word("group").unwrap_or_default();
        let own = code_of(group).unwrap_or(usual);
        for item in group.all("items") {
            let item = &with_those_of(item, group);
            let chosen = of_variant(item, context.variant);
            let is_stated = code_of(item).is_some();
            let named = chosen.as_ref().map_err(Clone::clone).and_then(|item| item_of(item, own, &tables, is_stated));
            let poll = item.get("update_interval").and_then(Node::whole);
            let poll =
                poll.and_then(|seconds| u64::try_from(seconds).ok()).filter(|seconds| (1..=86_400).contains(seconds));
            let poll = poll.map(Duration::from_secs).map(Poll::Every);
            let title = item.word("name").unwrap_or("?");
            let with_place = |named| Named { line: item.line, group: name.to_owned(), poll, ..named };
            if let Ok(item) = &chosen
                && item.get("sensors").is_some()
            {
                match sums::sum_of(item, own, &tables) {
                    Ok(sum) => {
                        list.note_keys(item, &[KNOWN, &["sensors"]]);
                        list.calculated.push(Calculated { named: with_place(sum.named), ..sum });
                    }
                    Err(why) => list.push_of(context, None, item.line, Err(format!("{title}: {why}"))),
                }
                continue;
            }
            let named = named.map(with_place);
            let named = named.map_err(|why| format!("{title}: {why}"));
            if named.is_ok() {
                list.note_keys(item, &[KNOWN]);
            }
            list.push_of(context, None, item.line, named);
        }
    }
    list
}

/// An item with the keys of its group that it does not have itself.
fn with_those_of(item: &Node, group: &Node) -> Node {
    let inherited = group.entries().iter().filter(|(key, _)| !["group", "items"].contains(&key.as_str()));
    let inherited = inherited.filter(|(key, _)| item.get(key).is_none());
    let entries = item.entries().iter().chain(inherited).cloned().collect();
    Node { line: item.line, value: Value::Map(entries) }
}

/// Lists of lists of registers, and lists of factors, have a place for each model.
fn of_variant(item: &Node, variant: Option<usize>) -> Result<Node, String> {
    let Value::Map(entries) = &item.value else { return Ok(item.clone()) };
    let is_many = |key: &str, node: &Node| match (key, &node.value) {
        ("registers", Value::List(items)) => items.iter().any(|item| matches!(item.value, Value::List(_))),
        ("scale" | "offset" | "divide" | "mask" | "uom", Value::List(_)) => true,
        _ => false,
    };
    let mut chosen = entries.clone();
    // Where it is not said which, nothing is written: see `with_limits`; nor is a value bad that one of them may have.
    let of_limit = |(key, node): &(String, Node)| match (variant, &node.value) {
        (Some(n), Value::List(items)) if matches!(key.as_str(), "min" | "max") => {
            (key.clone(), items.get(n).unwrap_or(node).clone())
        }
        _ => (key.clone(), node.clone()),
    };
    let has_limits = |key: &str| matches!(key, "configurable" | "range" | "validation");
    for (_, node) in chosen.iter_mut().filter(|(key, node)| has_limits(key) && !node.entries().is_empty()) {
        node.value = Value::Map(node.entries().iter().map(of_limit).collect());
    }
    for (key, node) in chosen.iter_mut().filter(|(key, node)| is_many(key, node)) {
        let count = node.items().len();
        let n = variant.ok_or_else(|| {
            let option = "--variant";
            t!("`{key}` differs between {count} models: which is meant? ({option} 0, 1 …)", key, count, option)
        })?;
        *node = node.items().get(n).cloned().ok_or_else(|| unsaid(key))?;
        if node.items().is_empty() {
            return Err(t!("this model does not have it").to_owned());
        }
    }
    Ok(Node { line: item.line, value: Value::Map(chosen) })
}

fn table_of(code: i64) -> Option<Table> {
    match code {
        1 => Some(Table::Coil),
        2 => Some(Table::Discrete),
        3 => Some(Table::Holding),
        4 => Some(Table::Input),
        _ => None,
    }
}

/// `code: 4`, or `code: { read: 4, write: 16 }`.
fn code_of(node: &Node) -> Option<Table> {
    let code = node.get("code")?;
    table_of(code.whole().or_else(|| code.get("read").and_then(Node::whole))?)
}

fn item_of(item: &Node, usual: Table, tables: &Tables, is_stated: bool) -> Result<Named, String> {
    let name = item.word("name").filter(|name| !name.trim().is_empty()).ok_or_else(|| missing("name"))?;
    let rule = item.opt_whole("rule")?.ok_or_else(|| missing("rule"))?;
    let nodes = item.all("registers");
    let registers: Vec<u16> = nodes.iter().map(|node| node.address("registers")).collect::<Result<_, _>>()?;
    let first = *registers.iter().min().ok_or_else(|| missing("registers"))?;
    let stated = tables.iter().find(|(start, end, _)| (*start..=*end).contains(&i64::from(first)));
    let table = if is_stated { code_of(item) } else { stated.map(|(.., table)| *table) }.unwrap_or(usual);
    let (kind, order) = match rule {
        1..=4 => (number(item, rule, registers.len())?, order(&registers)?),
        5 => (text(&registers)?, ByteOrder::Abcd),
        6 if registers.len() == 1 => (DataType::U16, ByteOrder::Abcd),
        7 => version(&registers)?,
        8 => (clock(&registers)?, ByteOrder::Abcd),
        9 => (time(item, &registers)?, ByteOrder::Abcd),
        _ => return Err(unsaid(&format!("rule: {rule}"))),
    };
    let kind = if table.is_bits() { DataType::Bool } else { kind };
    let named = Named { access: access(item, table), ..Named::new(table, first, kind, order, name) };
    let turning = beside(item, &[("scale", 1.0), ("divide", 1.0), ("multiply", 1.0), ("offset", 0.0)]);
    let turning = turning.or(["inverted", "inverse"].into_iter().find(|key| item.get(key).is_some_and(Node::is_true)));
    if let Some(key) = turning.or(item.get("lookup").map(|_| "lookup")).filter(|_| table.is_bits()) {
        return Err(unsaid(key));
    }
    if kind.is_text() || table.is_bits() || rule == 6 {
        return Ok(named.with_text_access());
    }
    let named = part(item, named, rule)?;
    let named = match item.get("lookup") {
        // Of a number with a sign it is no name.
        Some(lookup) if !lookup.items().is_empty() && rule % 2 == 1 => labelled(item, lookup, named)?,
        _ => scaled(item, named, rule)?,
    };
    let named = bounds::without_value(item, named)?;
    Ok(bounds::with_limits(item, named))
}

/// What rule 1 and 3 read without a sign, 2 and 4 with one.
fn number(item: &Node, rule: i64, count: usize) -> Result<DataType, String> {
    let is_signed = rule % 2 == 0;
    let by_sign = item.get("magnitude").is_some_and(Node::is_true);
    Ok(match (count, is_signed, by_sign) {
        (1, false, _) => DataType::U16,
        (2, false, _) => DataType::U32,
        (3, false, _) => DataType::U48,
        (4, false, _) => DataType::U64,
        (1, true, false) => DataType::I16,
        (2, true, false) => DataType::I32,
        (3, true, false) => DataType::I48,
        (4, true, false) => DataType::I64,
        (1, true, true) => DataType::Sm16,
        (2, true, true) => DataType::Sm32,
        _ => return Err(t!("a number of {length} registers is not known", length = count)),
    })
}

/// The first that is listed is the lowest word.
fn order(registers: &[u16]) -> Result<ByteOrder, String> {
    let rises = registers.windows(2).all(|pair| pair[0].checked_add(1) == Some(pair[1]));
    let falls = registers.windows(2).all(|pair| pair[1].checked_add(1) == Some(pair[0]));
    match (registers.len(), rises, falls) {
        (1, ..) => Ok(ByteOrder::Abcd),
        (_, true, _) => Ok(ByteOrder::Cdab),
        (_, _, true) => Ok(ByteOrder::Abcd),
        _ => Err(apart()),
    }
}

fn text(registers: &[u16]) -> Result<DataType, String> {
    if 1 < registers.len() && order(registers)? != ByteOrder::Cdab {
        return Err(apart());
    }
    let bytes = u8::try_from(2 * registers.len()).ok().filter(|bytes| *bytes <= DataType::TEXT_MAX);
    bytes.map(DataType::Text).ok_or_else(|| unsaid("registers"))
}

fn clock(registers: &[u16]) -> Result<DataType, String> {
    match (registers.len(), order(registers)?) {
        (3, ByteOrder::Cdab) => Ok(DataType::Clock(Clock::Bytes)),
        // Six registers may have a year of two digits, which would be another one.
        _ => Err(unsaid("rule: 8")),
    }
}

/// The first that is listed is shown first.
fn version(registers: &[u16]) -> Result<(DataType, ByteOrder), String> {
    let order = if order(registers)? == ByteOrder::Cdab { ByteOrder::Abcd } else { ByteOrder::Cdab };
    let count = u8::try_from(registers.len()).map_err(|_| unsaid("registers"))?;
    Ok((DataType::Version(count), if count == 1 { ByteOrder::Abcd } else { order }))
}

/// Hour and minute, apart by `dec` in one register; with `hex` of two decimal digits each, or of their characters.
fn time(item: &Node, registers: &[u16]) -> Result<DataType, String> {
    let is_hex = item.entries().iter().any(|(key, _)| key == "hex");
    let apart = item.opt_whole(if is_hex { "hex" } else { "dec" })?.unwrap_or(if is_hex { 0x100 } else { 100 });
    let characters = i64::from(u16::from_be_bytes(*b"00"));
    match (registers.len(), order(registers)?, is_hex, apart, item.opt_whole("offset")?.unwrap_or(0)) {
        (1, _, false, 100, _) => Ok(DataType::Clock(Clock::TimeDecimal)),
        (1, _, false, 0x100, _) => Ok(DataType::Clock(Clock::TimeBytes)),
        (1, _, true, 0x100, _) => Ok(DataType::Clock(Clock::TimeBcd)),
        (2, ByteOrder::Cdab, false, 100, _) => Ok(DataType::Clock(Clock::TimeWords)),
        (2, ByteOrder::Cdab, true, 0x100, offset) if offset == characters => Ok(DataType::Text(4)),
        _ => Err(unsaid("rule: 9")),
    }
}

/// A part of the number: by its mask, or one bit.
fn part(item: &Node, named: Named, rule: i64) -> Result<Named, String> {
    let found: Vec<_> = ["mask", "bit", "bitmask"].iter().filter_map(|key| Some((*key, item.get(key)?))).collect();
    let (key, node) = match found.as_slice() {
        [] => return Ok(named),
        [one] => *one,
        // One after the other.
        [_, (key, _), ..] => return Err(unsaid(key)),
    };
    let number = node.whole().and_then(|number| u64::try_from(number).ok()).ok_or_else(|| wrong(key, node))?;
    let field = match key {
        "bit" => u8::try_from(number).ok().map(|bit| (bit, 1)),
        "bitmask" => field_of(number).filter(|(_, width)| *width == 1),
        _ => field_of(number),
    };
    // A signed number has no mask there.
    let field = field.filter(|(low, width)| rule % 2 == 1 && low + width <= named.kind.bits());
    Ok(Named {
        field: Some(field.ok_or_else(|| unsaid(key))?).filter(|(_, width)| *width < named.kind.bits()),
        ..named
    })
}

/// How far the bits of a mask are moved: their value is that of the whole number.
fn shift(item: &Node, named: &Named) -> u8 {
    if item.get("mask").is_some() { named.field.map_or(0, |(low, _)| low) } else { 0 }
}

fn scaled(item: &Node, named: Named, rule: i64) -> Result<Named, String> {
    let scale = item.opt_number("scale")?.unwrap_or(1.0);
    let divide = item.opt_number("divide")?.unwrap_or(1.0);
    let before = item.opt_number("offset")?.unwrap_or(0.0);
    if scale == 0.0 || divide == 0.0 {
        return Err(unsaid("scale"));
    }
    // Of a number without a sign the other program does not turn it.
    if rule % 2 == 1 && item.get("inverted").is_some_and(Node::is_true) {
        return Err(unsaid("inverted"));
    }
    let sign = if item.get("inverted").is_some_and(Node::is_true) { -1.0 } else { 1.0 };
    let scale = if divide == 1.0 { sign * scale } else { sign * scale / divide };
    // It is taken off before scaling.
    let offset = if before == 0.0 { 0.0 } else { rounded(-before * scale) };
    let shift = 2f64.powi(i32::from(shift(item, &named)));
    let named = named.scaled(scale * shift, offset);
    let unit = item.word("uom").or(item.word("unit_of_measurement")).unwrap_or_default();
    Ok(Named { unit: unit_of(unit), ..named })
}

/// As a person would write it.
fn rounded(number: f64) -> f64 {
    format!("{number:.9}").parse().unwrap_or(number)
}

/// `- key: [2, 0x0200], value: "…"`, `- bit: 3, value: "…"`; several bits are one number.
fn labelled(item: &Node, lookup: &Node, named: Named) -> Result<Named, String> {
    // They are those of the number with its mask, the field begins at 0: one beyond the mask never occurs.
    let low = shift(item, &named);
    let width = named.field.map_or(named.kind.bits(), |(_, width)| width);
    let within = |number: i128| {
        let moved = number >> low;
        (moved << low == number && 0 <= moved && moved >> width == 0).then_some(moved)
    };
    let are_bits = lookup.items().iter().all(|entry| entry.all("bit").len() < 2);
    let mut labels = Vec::new();
    let mut bits: Vec<(u8, String)> = Vec::new();
    for entry in lookup.items() {
        let label = entry.get("value").map(Node::shown).ok_or_else(|| missing("value"))?;
        let mut number = 0i128;
        for node in entry.all("bit") {
            let bit = node.whole().and_then(|bit| u8::try_from(bit).ok()).filter(|bit| *bit < named.kind.bits());
            let bit = bit.ok_or_else(|| wrong("bit", node))?;
            number |= 1 << bit;
            let bit = bit.checked_sub(low).filter(|bit| *bit < width);
            if let Some(bit) = bit.filter(|bit| are_bits && !bits.iter().any(|(known, _)| known == bit)) {
                bits.push((bit, label.clone()));
            }
        }
        if !are_bits && number != 0 {
            labels.extend(within(number).map(|number| (number, label.clone())));
        }
        for node in entry.all("key").iter().filter(|node| node.text() != Some("default")) {
            let key = node.whole().ok_or_else(|| wrong("key", node))?;
            labels.extend(within(key.into()).map(|number| (number, label.clone())));
        }
    }
    // A word with names of bits has the text for none of them as a number.
    if !bits.is_empty() {
        return Ok(Named { bit_labels: bits, ..named });
    }
    Ok(named.labelled(labels))
}

fn access(item: &Node, table: Table) -> Access {
    let is_written = ["number", "switch", "select", "time", "datetime", "button"];
    let platform = item.word("platform").is_some_and(|platform| is_written.contains(&platform));
    let is_written = platform || item.get("configurable").is_some();
    if is_written && matches!(table, Table::Holding | Table::Coil) { Access::ReadWrite } else { Access::Read }
}
