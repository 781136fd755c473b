//! Devices of modbus_local_gateway: <https://github.com/timlaing/modbus_local_gateway>.

use std::time::Duration;

use super::{beside, swapped, text_of, unsaid, wrong};
use crate::{
    plant::{
        number::to_u8,
        tag::{Access, ByteOrder, DataType, Poll, Table},
    },
    profile::unit_of,
    register_map::{
        container::node::{Node, Tree},
        list::{List, ListContext},
        named::Named,
    },
};

/// Keys that are kept, or say nothing about a value.
const KNOWN: &[&str] = &[
    "address",
    "name",
    "size",
    "scan_interval",
    "unit_of_measurement",
    "device_class",
    "state_class",
    "entity_category",
    "entity_registry_enabled_default",
    "icon",
    "control",
    "number",
    "options",
    "switch",
    "signed",
    "float",
    "string",
    "swap",
    "sum_scale",
    "shift_bits",
    "bits",
    "multiplier",
    "offset",
    "precision",
    "map",
    "flags",
    "never_resets",
    "unavailable_values",
    "on",
    "off",
];
const SECTIONS: [(&str, Table); 4] = [
    ("read_write_word", Table::Holding),
    ("read_only_word", Table::Input),
    ("read_write_boolean", Table::Coil),
    ("read_only_boolean", Table::Discrete),
];

/// Reads a device.
pub fn read(tree: &Tree, _: &ListContext) -> List {
    let mut list = List::of_tree(tree);
    let device = tree.root.get("device");
    let word = |key: &str| device.and_then(|device| device.word(key)).unwrap_or_default().to_owned();
    list.about = ["manufacturer", "model"].map(word);
    for (section, table) in SECTIONS {
        for (key, item) in tree.root.get(section).map_or(&[][..], Node::entries) {
            let named = entity(table, key, item).map(|named| Named { line: item.line, ..named });
            if named.is_ok() {
                list.note_keys(item, &[KNOWN]);
            }
            let named = named.map_err(|why| format!("{key}: {why}"));
            list.push_of(&ListContext::default(), None, item.line, named);
        }
    }
    for (key, item) in tree.root.get("composite").map_or(&[][..], Node::entries) {
        list.push_of(&ListContext::default(), None, item.line, Err(format!("{key}: {}", unsaid("composite"))));
    }
    list
}

fn entity(table: Table, key: &str, item: &Node) -> Result<Named, String> {
    let name = item.word("name").unwrap_or(key);
    let address = item.wire_address("address")?;
    let control = item.word("control").unwrap_or("sensor");
    let is_written =
        matches!(table, Table::Holding | Table::Coil) && matches!(control, "number" | "select" | "switch" | "text");
    let access = if is_written { Access::ReadWrite } else { Access::Read };
    let poll = item.opt_whole("scan_interval")?.and_then(|seconds| u64::try_from(seconds).ok());
    let poll = poll.filter(|seconds| (1..=86_400).contains(seconds)).map(Duration::from_secs).map(Poll::Every);
    let named = Named { access, poll, ..Named::new(table, address, DataType::Bool, ByteOrder::Abcd, name) };
    if table.is_bits() {
        return bit(item, named);
    }
    let kind = kind_of(item)?;
    let order = swapped(item.word("swap").unwrap_or("none")).ok_or_else(|| unsaid("swap"))?;
    if kind.is_text() {
        return Ok(Named { kind, order, ..named }.with_text_access());
    }
    let named = Named { kind, order, field: field(item, kind)?, ..named };
    numbers(item, named)
}

/// A bit that is on while it is 0 would be shown the other way round, and names of its states would be lost.
fn bit(item: &Node, named: Named) -> Result<Named, String> {
    let states = item.get("switch").filter(|_| item.word("control") == Some("switch")).unwrap_or(item);
    for (key, usual) in [("on", true), ("off", false)] {
        if states.get(key).is_some_and(|node| node.is_true() != usual) {
            return Err(unsaid(key));
        }
    }
    let scaled = beside(item, &[("multiplier", 1.0), ("offset", 0.0)]);
    match scaled.or(["map", "options", "flags"].into_iter().find(|key| item.get(key).is_some())) {
        Some(key) => Err(unsaid(key)),
        None => Ok(named),
    }
}

fn kind_of(item: &Node) -> Result<DataType, String> {
    let size = item.opt_whole("size")?.unwrap_or(1);
    let flag = |key: &str| item.get(key).is_some_and(Node::is_true);
    if flag("string") {
        return text_of(size).ok_or_else(|| unsaid("size"));
    }
    // Bits are masked out of a number with a sign, and have none.
    let is_signed = flag("signed") && item.get("bits").is_none();
    let known = match (size, flag("float"), is_signed) {
        _ if item.get("sum_scale").is_some() => return sum(item),
        (2, true, _) => DataType::F32,
        (4, true, _) => DataType::F64,
        (1, false, false) => DataType::U16,
        (1, false, true) => DataType::I16,
        (2, false, false) => DataType::U32,
        (2, false, true) => DataType::I32,
        (4, false, false) => DataType::U64,
        (4, false, true) => DataType::I64,
        _ => return Err(unsaid("size")),
    };
    Ok(known)
}

/// `[1, 10000]`: digits in each register, the lowest first.
fn sum(item: &Node) -> Result<DataType, String> {
    let factors: Vec<Option<f64>> = item.all("sum_scale").iter().map(Node::number).collect();
    let expect = [1.0, 1e4, 1e8, 1e12];
    let is_digits = factors.iter().zip(expect).all(|(found, expect)| *found == Some(expect));
    match factors.len() {
        count @ 2..=4 if is_digits => Ok(DataType::Mod10k(to_u8(count))),
        _ => Err(unsaid("sum_scale")),
    }
}

fn field(item: &Node, kind: DataType) -> Result<Option<(u8, u8)>, String> {
    let (shift, bits) = (item.opt_whole("shift_bits")?, item.opt_whole("bits")?);
    if shift.is_none() && bits.is_none() {
        return Ok(None);
    }
    let size = i64::from(kind.bits());
    let shift = shift.unwrap_or(0);
    let bits = bits.unwrap_or(size - shift);
    let fits = (0..size).contains(&shift) && (1..=size - shift).contains(&bits);
    match (u8::try_from(shift), u8::try_from(bits)) {
        (Ok(low), Ok(width)) if fits && kind.is_binary() => Ok(Some((low, width)).filter(|_| bits < size)),
        _ => Err(unsaid("bits")),
    }
}

/// Scale, labels and limits.
fn numbers(item: &Node, named: Named) -> Result<Named, String> {
    let (scale, offset) = (item.opt_number("multiplier")?.unwrap_or(1.0), item.opt_number("offset")?.unwrap_or(0.0));
    if scale == 0.0 {
        return Err(unsaid("multiplier"));
    }
    // The sum of registers of digits begins with the lowest.
    let order = if item.get("sum_scale").is_some() { ByteOrder::Cdab } else { named.order };
    let mut named = Named { order, ..named.scaled(scale, offset) };
    if let Some(precision) = item.opt_whole("precision")? {
        named.decimals = u8::try_from(precision).unwrap_or(0).min(6);
    }
    named.unit = unit_of(item.word("unit_of_measurement").unwrap_or_default());
    let labels = item.get("map").or(item.get("options"));
    if let Some(labels) = labels {
        // The names are those of the value, not of the register.
        if scale != 1.0 || offset != 0.0 {
            return Err(unsaid("map"));
        }
        named = named.labelled(labels.labels()?);
    }
    if item.word("control") == Some("switch") {
        if scale != 1.0 || offset != 0.0 {
            return Err(unsaid("switch"));
        }
        let state = |key: &str, usual| {
            item.get("switch").map_or(Ok(None), |node| node.opt_whole(key)).map(|found| found.unwrap_or(usual))
        };
        let states =
            vec![(i128::from(state("off", 0)?), "off".to_owned()), (i128::from(state("on", 1)?), "on".to_owned())];
        named = named.labelled(states);
    }
    for (bit, label) in item.get("flags").map_or(Ok(Vec::new()), Node::labels)? {
        // They are counted from 1.
        let bit = u8::try_from(bit - 1).ok().filter(|bit| *bit < named.kind.bits()).ok_or_else(|| unsaid("flags"))?;
        named.bit_labels.push((bit, label));
    }
    for node in item.all("unavailable_values") {
        named = named.bad_at(node.whole().ok_or_else(|| wrong("unavailable_values", node))?, false);
    }
    if let Some(limits) = item.get("number").filter(|_| named.access == Access::ReadWrite) {
        (named.min, named.max) = (limits.opt_number("min")?, limits.opt_number("max")?);
    }
    Ok(named)
}
