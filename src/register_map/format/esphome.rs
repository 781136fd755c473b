//! The `modbus_controller` items of ESPHome: <https://esphome.io/components/modbus_controller/>.

use super::{field_of, missing, text_of, unsaid, wrong};
use crate::{
    plant::tag::{Access, ByteOrder, DataType, Table},
    profile::unit_of,
    register_map::{
        container::node::{Node, Tree, Value},
        list::{List, ListContext, words},
        named::{Named, decimals_of},
    },
    t,
};

const SECTIONS: [&str; 6] = ["sensor", "binary_sensor", "switch", "number", "select", "text_sensor"];
const PLATFORM: &str = "modbus_controller";
/// Keys without a meaning for a value, or read beside the row.
#[rustfmt::skip]
const PLAIN: &[&str] = &[
    "platform", "name", "id", "modbus_controller_id", "device_class", "state_class", "entity_category", "icon", "internal", "disabled_by_default",
    "force_new_range", "skip_updates", "use_write_multiple", "mode", "step",
];
/// Keys that a row keeps.
#[rustfmt::skip]
const KEPT: &[&str] = &[
    "address", "register_type", "value_type", "register_count", "response_size", "bitmask", "filters", "unit_of_measurement", "accuracy_decimals", "multiply",
    "min_value", "max_value", "optionsmap",
];
/// Keys that make another value, in a way that no profile says.
const TURNING: [&str; 5] = ["lambda", "offset", "custom_command", "raw_encode", "inverted"];
/// Filters after which a value is the same.
#[rustfmt::skip]
const HARMLESS: [&str; 11] = [
    "throttle", "delta", "debounce", "heartbeat", "skip_initial", "round", "delayed_on", "delayed_off", "delayed_on_off", "settle", "autorepeat",
];

/// Reads the items of all sections; those of the first unit are taken.
pub fn read(tree: &Tree, context: &ListContext) -> List {
    let mut list = List::of_tree(tree);
    for section in SECTIONS {
        for item in tree.root.all(section).iter().filter(|item| item.word("platform") == Some(PLATFORM)) {
            let name = item.word("name").or(item.word("id"));
            let named = name
                .ok_or_else(|| missing("name"))
                .and_then(|name| row(section, item, name).map_err(|why| format!("{name}: {why}")));
            let taken = list.named.len();
            list.push_of(context, unit_of_item(tree, item).map(|unit| (0, unit)), item.line, named);
            if taken < list.named.len() {
                list.note_keys(item, &[PLAIN, KEPT]);
            }
        }
    }
    for item in tree.root.all("output").iter().filter(|item| item.word("platform") == Some(PLATFORM)) {
        let name = item.word("id").unwrap_or("output");
        list.push_of(context, None, item.line, Err(format!("{name}: {}", unsaid("output"))));
    }
    list
}

/// The unit address of the controller that an item names, or of the only one.
fn unit_of_item(tree: &Tree, item: &Node) -> Option<u8> {
    let all = tree.root.all(PLATFORM);
    let named = |one: &&Node| one.word("id").is_some() && one.word("id") == item.word("modbus_controller_id");
    let controller = all.iter().find(named).or(all.first().filter(|_| all.len() == 1))?;
    u8::try_from(controller.get("address")?.whole()?).ok()
}

fn row(section: &str, item: &Node, name: &str) -> Result<Named, String> {
    if let Some(key) = TURNING.iter().find(|key| item.get(key).is_some_and(|node| node.whole() != Some(0))) {
        return Err(unsaid(key));
    }
    let table = match (item.word("register_type"), section) {
        (Some("holding"), _) | (None, "number" | "select") => Table::Holding,
        (Some("read"), _) => Table::Input,
        (Some("coil"), _) => Table::Coil,
        (Some("discrete_input"), _) => Table::Discrete,
        _ => {
            return Err(item
                .get("register_type")
                .map_or_else(|| missing("register_type"), |node| wrong("register_type", node)));
        }
    };
    let address = item.wire_address("address")?;
    let (kind, order) = kind(section, item, table)?;
    let mut named = Named::new(table, address, kind, ByteOrder::Abcd, name).ordered(order);
    if kind.is_text() || table.is_bits() {
        unfiltered(item)?;
        named.access = if section == "switch" && table == Table::Coil { Access::ReadWrite } else { Access::Read };
        return Ok(named);
    }
    // A bit of a register is 1 where nothing else is said.
    let is_bit = matches!(section, "binary_sensor" | "switch");
    let mask = item.opt_whole("bitmask")?.or(is_bit.then_some(1));
    if let Some(mask) = mask {
        // What a mask leaves of a number has no sign.
        named.kind = match kind {
            DataType::I16 => DataType::U16,
            DataType::I32 => DataType::U32,
            DataType::I64 => DataType::U64,
            kind => kind,
        };
        let field = u64::try_from(mask).ok().and_then(field_of).filter(|(_, width)| !is_bit || *width == 1);
        let (low, width) = field.ok_or_else(|| unsaid("bitmask"))?;
        named.field = (u16::from(width) < u16::from(kind.bits())).then_some((low, width));
        return filtered(named, item);
    }
    match section {
        "number" => {
            let by = item.opt_number("multiply")?.unwrap_or(1.0);
            named = named.scaled(1.0 / Some(by).filter(|by| *by != 0.0).ok_or_else(|| unsaid("multiply"))?, 0.0);
            (named.min, named.max) = (item.opt_number("min_value")?, item.opt_number("max_value")?);
            named.access = Access::ReadWrite;
        }
        "select" => {
            let options = item.get("optionsmap").ok_or_else(|| missing("optionsmap"))?;
            let label = |(text, node): &(String, Node)| {
                Ok((i128::from(node.whole().ok_or_else(|| wrong("optionsmap", node))?), text.clone()))
            };
            named = named.labelled(options.entries().iter().map(label).collect::<Result<_, String>>()?);
            named.access = Access::ReadWrite;
        }
        _ => {}
    }
    if item.get("write_lambda").is_some() {
        named.access = Access::Read;
    }
    filtered(named, item)
}

/// A bit or text, of which filters would make another.
fn unfiltered(item: &Node) -> Result<(), String> {
    let filters = item.all("filters");
    let turning = filters.iter().flat_map(Node::entries).find(|(key, _)| !HARMLESS.contains(&key.as_str()));
    let is_odd = filters.iter().any(|filter| matches!(filter.value, Value::Scalar(_)));
    match turning {
        Some((key, _)) => Err(unsaid(key)),
        None if is_odd => Err(unsaid("filters")),
        None => Ok(()),
    }
}

/// The type, and the order of its registers: `_R` has the low one first.
fn kind(section: &str, item: &Node, table: Table) -> Result<(DataType, ByteOrder), String> {
    if table.is_bits() {
        return Ok((DataType::Bool, ByteOrder::Abcd));
    }
    if section == "text_sensor" {
        let bytes = item.opt_whole("response_size")?.filter(|bytes| bytes % 2 == 0).map(|bytes| bytes / 2);
        let registers = bytes.or(item.opt_whole("register_count")?).ok_or_else(|| missing("response_size"))?;
        return Ok((text_of(registers).ok_or_else(|| unsaid("response_size"))?, ByteOrder::Abcd));
    }
    let word = item.word("value_type").unwrap_or("U_WORD");
    let (plain, order) = word.strip_suffix("_R").map_or((word, ByteOrder::Abcd), |plain| (plain, ByteOrder::Cdab));
    let kind = match plain {
        "FP32" => Some(DataType::F32),
        plain => words::kind_of(plain),
    };
    Ok((kind.ok_or_else(|| t!("`{word}` is not a known type", word))?, order))
}

/// The unit, and what filters make of the value, one after the other.
fn filtered(mut named: Named, item: &Node) -> Result<Named, String> {
    for (key, node) in item.all("filters").iter().flat_map(Node::entries) {
        let number = || node.number().filter(|number| *number != 0.0).ok_or_else(|| wrong(key, node));
        match key.as_str() {
            "multiply" => (named.scale, named.offset) = (named.scale * number()?, named.offset * number()?),
            "offset" => named.offset += node.number().ok_or_else(|| wrong(key, node))?,
            key if HARMLESS.contains(&key) => {}
            key => return Err(unsaid(key)),
        }
    }
    let is_odd = item.all("filters").iter().any(|filter| matches!(filter.value, Value::Scalar(_)));
    if is_odd || !named.scale.is_finite() || !named.offset.is_finite() {
        return Err(unsaid("filters"));
    }
    let decimals = decimals_of(named.scale, named.kind).max(decimals_of(named.offset, DataType::U16));
    let stated = item.opt_whole("accuracy_decimals")?.map(|decimals| u8::try_from(decimals).unwrap_or(0).min(6));
    named.unit = unit_of(item.word("unit_of_measurement").unwrap_or_default());
    named.decimals = stated.unwrap_or(decimals);
    Ok(named)
}
