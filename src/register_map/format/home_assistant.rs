//! The `modbus:` section of Home Assistant: <https://www.home-assistant.io/integrations/modbus/>.

mod entities;

use std::time::Duration;

use super::{missing, swapped, text_of, unsaid, wrong};
use crate::{
    plant::tag::{ByteOrder, DataType, Poll, Table},
    profile::unit_of,
    register_map::{
        container::node::{Node, Tree, Value},
        list::{List, ListContext, words},
        named::Named,
    },
    t,
};

/// Keys without a meaning for a value, or read beside the row.
const PLAIN: &[&str] = &[
    "name",
    "unique_id",
    "device_class",
    "state_class",
    "slave",
    "device_address",
    "lazy_error_count",
    "scan_interval",
    "icon",
    "entity_category",
];
/// Keys of a sensor that its row keeps.
const SENSOR: &[&str] = &[
    "address",
    "input_type",
    "data_type",
    "count",
    "swap",
    "scale",
    "offset",
    "precision",
    "unit_of_measurement",
    "nan_value",
    "slave_count",
    "virtual_count",
    "structure",
];
/// Keys that turn a value into another one, in a way that no profile says.
const TURNING: &[&str] = &["reverse_order"];
/// The unit of an entity that states none.
const USUAL_UNIT: u8 = 1;
/// What an entity may be; sensors first.
const SECTIONS: [&str; 7] = ["sensors", "binary_sensors", "switches", "lights", "fans", "covers", "climates"];
/// Most registers of an array.
const ARRAY_MAX: i64 = 1_000;

/// What holds the hubs: the file, or packages in it.
fn holders(root: &Node) -> Vec<&Node> {
    if let Some(hubs) = root.get("modbus") {
        return vec![hubs];
    }
    let packages = root.get("homeassistant").and_then(|home| home.get("packages"));
    let hubs = packages.map_or(&[][..], Node::entries).iter().filter_map(|(_, package)| package.get("modbus"));
    let hubs: Vec<&Node> = hubs.collect();
    if hubs.is_empty() { vec![root] } else { hubs }
}

/// Reads all hubs; the rows of the first unit are taken.
pub fn read(tree: &Tree, context: &ListContext) -> List {
    let mut list = List::of_tree(tree);
    let mut hub_count = 0;
    for hubs in holders(&tree.root) {
        if let Value::Scalar(_) = hubs.value {
            list.problems.push(t!("line {line}: `{section}` is in another file", line = hubs.line, section = "modbus"));
        }
        // A file that is included has the sensors of one hub, without their key.
        if hubs.items().iter().all(|item| item.get("address").is_some()) {
            hubs.items().iter().for_each(|item| row(&mut list, context, hub_count, SECTIONS[0], item));
            continue;
        }
        for of_hub in hubs.items() {
            hub(&mut list, context, hub_count, of_hub);
            hub_count += 1;
        }
    }
    list
}

fn hub(list: &mut List, context: &ListContext, n: usize, hub: &Node) {
    for section in SECTIONS {
        let items = hub.all(section);
        if let [Node { line, value: Value::Scalar(_) }] = items {
            list.problems.push(t!("line {line}: `{section}` is in another file", line = *line, section));
            continue;
        }
        items.iter().for_each(|item| row(list, context, n, section, item));
    }
}

fn row(list: &mut List, context: &ListContext, hub: usize, section: &str, item: &Node) {
    let unit = match item.get("slave").or(item.get("device_address")) {
        Some(node) => node.whole().and_then(|unit| u8::try_from(unit).ok()).ok_or_else(|| wrong("slave", node)),
        None => Ok(USUAL_UNIT),
    };
    let is_sensor = section == SECTIONS[0];
    let turning = TURNING.iter().find(|key| item.get(key).is_some_and(Node::is_true));
    let rows = match section {
        _ if unit.is_err() || turning.is_some() => {
            Err(turning.map_or_else(|| unit.clone().err().unwrap_or_default(), |key| unsaid(key)))
        }
        _ if is_sensor => sensors(item),
        "binary_sensors" => entities::binary_sensors(item),
        "covers" => entities::cover(item).map(|one| vec![one]),
        "climates" => entities::climate(item),
        _ => entities::switch(item).map(|one| vec![one]),
    };
    let rows = rows.map_or_else(|why| vec![Err(why)], |rows| rows.into_iter().map(Ok).collect());
    let poll = item.get("scan_interval").and_then(Node::whole).and_then(|seconds| u64::try_from(seconds).ok());
    let poll = poll.filter(|seconds| (1..=86_400).contains(seconds)).map(Duration::from_secs).map(Poll::Every);
    let taken = list.named.len();
    for named in rows {
        let named = named.map(|named| Named { line: item.line, poll, ..named }).map_err(|why| because(item, &why));
        list.push_of(context, unit.as_ref().ok().map(|unit| (hub, *unit)), item.line, named);
    }
    if taken < list.named.len() {
        list.note_keys(item, &[PLAIN, if is_sensor { SENSOR } else { entities::KEPT }]);
    }
}

/// The name of an item before what is wrong with it.
fn because(item: &Node, why: &str) -> String {
    item.word("name").map_or_else(|| why.to_owned(), |name| format!("{name}: {why}"))
}

/// Table, type and order of a value in registers.
fn point(item: &Node, name: &str) -> Result<Named, String> {
    let table = match item.word("input_type").unwrap_or("holding") {
        "holding" => Table::Holding,
        "input" => Table::Input,
        "coil" => Table::Coil,
        "discrete_input" => Table::Discrete,
        _ => {
            return Err(item.get("input_type").map_or_else(|| missing("input_type"), |node| wrong("input_type", node)));
        }
    };
    let address = item.wire_address("address")?;
    let count = item.opt_whole("count")?;
    let word = item.word("data_type").unwrap_or("int16");
    let kind = match word {
        _ if table.is_bits() => DataType::Bool,
        "custom" => return Err(unsaid("structure")),
        "string" => text_of(count.ok_or_else(|| missing("count"))?).ok_or_else(|| unsaid("count"))?,
        "int" => words::type_of("int", count.and_then(|count| u16::try_from(count).ok()))?.0,
        "uint" => words::type_of("uint", count.and_then(|count| u16::try_from(count).ok()))?.0,
        "float" => words::type_of("float", count.and_then(|count| u16::try_from(count).ok()))?.0,
        word => words::kind_of(word).ok_or_else(|| t!("`{word}` is not a known type", word))?,
    };
    if count.is_some_and(|count| !kind.is_text() && count != i64::from(kind.registers())) {
        return Err(unsaid("count"));
    }
    let swap = item.word("swap").unwrap_or("none");
    let order = swapped(swap).ok_or_else(|| unsaid("swap"))?;
    // Of a text the registers are swapped, too, end to end.
    if kind.is_text() && 1 < kind.registers() && matches!(order, ByteOrder::Cdab | ByteOrder::Dcba) {
        return Err(unsaid("swap"));
    }
    Ok(Named::new(table, address, kind, ByteOrder::Abcd, name).ordered(order))
}

/// A value with its unit and its scale, which these keys state.
fn quantity(item: &Node, name: &str, [scale, offset]: [&str; 2]) -> Result<Named, String> {
    let named = point(item, name)?;
    if named.kind.is_text() || named.table.is_bits() {
        return Ok(named);
    }
    let (factor, added) = (item.opt_number(scale)?.unwrap_or(1.0), item.opt_number(offset)?.unwrap_or(0.0));
    if factor == 0.0 {
        return Err(unsaid(scale));
    }
    let mut named = named.scaled(factor, added);
    if let Some(precision) = item.opt_whole("precision")? {
        named.decimals = u8::try_from(precision).unwrap_or(0).min(6);
    }
    named.unit = unit_of(item.word("unit_of_measurement").unwrap_or_default());
    if let Some(node) = item.get("nan_value") {
        let value = node.whole().ok_or_else(|| wrong("nan_value", node))?;
        // The program takes the number with either sign; its pattern is what the file means where the type has a sign.
        let is_pattern = node.shown().to_lowercase().starts_with("0x");
        named = named.bad_at(value, is_pattern).bad_at(-value, false);
    }
    Ok(named)
}

/// A sensor, and those behind it in the same way.
fn sensors(item: &Node) -> Result<Vec<Named>, String> {
    let name = item.word("name").ok_or_else(|| missing("name"))?;
    let first = quantity(item, name, ["scale", "offset"])?;
    let more = item.opt_whole("slave_count")?.or(item.opt_whole("virtual_count")?).unwrap_or(0);
    array(first, more, |named, n| {
        let address = named.address.checked_add(u16::try_from(n).ok()?.checked_mul(named.count())?)?;
        Some(Named { address, ..named.clone() })
    })
}

/// So many more of a row, each with its number behind the name.
fn array(first: Named, more: i64, next: impl Fn(&Named, i64) -> Option<Named>) -> Result<Vec<Named>, String> {
    if !(0..ARRAY_MAX).contains(&more) {
        return Err(unsaid("slave_count"));
    }
    let name =
        |n: i64, named: Named| if n == 0 { named } else { Named { name: format!("{} {n}", first.name), ..named } };
    let rows = (0..=more).map(|n| next(&first, n).map(|named| name(n, named)).ok_or_else(|| unsaid("slave_count")));
    rows.collect()
}
