//! Templates and configurations of wb-mqtt-serial: <https://github.com/wirenboard/wb-mqtt-serial>. Only the form is known here.

use super::{missing, unsaid, wrong};
use crate::{
    plant::tag::{Access, ByteOrder, DataType, Table},
    profile::unit_of,
    register_map::{
        container::node::{Node, Tree, whole},
        list::{List, ListContext},
        named::{Named, decimals_of},
    },
    t,
};

/// Keys that are kept, or say nothing about a value.
const KNOWN: &[&str] = &[
    "name",
    "id",
    "title",
    "description",
    "reg_type",
    "address",
    "write_address",
    "type",
    "format",
    "scale",
    "offset",
    "round_to",
    "word_order",
    "byte_order",
    "on_value",
    "off_value",
    "error_value",
    "unsupported_value",
    "readonly",
    "enum",
    "enum_titles",
    "units",
    "min",
    "max",
    "group",
    "order",
    "enabled",
    "sporadic",
    "semi-sporadic",
    "read_period_ms",
    "read_rate_limit_ms",
    "poll_interval",
    "default",
    "control_type",
    "required",
    "oneOf",
    "ui_options",
    "string_data_size",
];
/// Units of the types that are one.
#[rustfmt::skip]
const TYPES: [(&str, &str); 21] = [
    ("temperature", "°C"), ("rel_humidity", "%"), ("atmospheric_pressure", "mbar"), ("voltage", "V"), ("current", "A"), ("power", "W"),
    ("power_consumption", "kWh"), ("lux", "lx"), ("sound_level", "dB"), ("concentration", "ppm"), ("pressure", "bar"), ("heat_power", "Gcal/h"),
    ("heat_energy", "Gcal"), ("water_flow", "m³/h"), ("water_consumption", "m³"), ("resistance", "Ω"), ("wind_speed", "m/s"), ("rainfall", "mm/h"),
    ("illuminance", "lx"), ("range", ""), ("value", ""),
];

/// Reads the channels and parameters of all devices; the rows of the first are taken.
pub fn read(tree: &Tree, context: &ListContext) -> List {
    let mut list = List::of_tree(tree);
    let root = &tree.root;
    let of_ports = root.all("ports").iter().flat_map(|port| port.all("devices"));
    let devices: Vec<&Node> = match root.get("device") {
        Some(device) => vec![device],
        None if root.get("channels").is_some() => vec![root],
        None => of_ports.collect(),
    };
    list.about = [String::new(), root.word("title").or(root.word("device_type")).unwrap_or_default().to_owned()];
    for (n, device) in devices.iter().enumerate() {
        let unit = device.get("slave_id").and_then(Node::whole).and_then(|unit| u8::try_from(unit).ok());
        let station = (1 < devices.len()).then(|| (n, unit.unwrap_or(0))).or(unit.map(|unit| (n, unit)));
        for channel in device.all("channels") {
            push(&mut list, context, station, channel, "", device);
        }
        // A list, or a map by name.
        let parameters = device.get("parameters");
        let listed = parameters.map_or(&[][..], |node| if node.entries().is_empty() { node.items() } else { &[] });
        let named = parameters.map_or(&[][..], Node::entries).iter().map(|(key, node)| (key.as_str(), node));
        for (key, parameter) in listed.iter().map(|node| ("", node)).chain(named) {
            push(&mut list, context, station, parameter, key, device);
        }
        for setup in device.all("setup").iter().filter(|setup| setup.get("address").is_some()) {
            list.problems.push(format!("{}: {}", t!("line {number}", number = setup.line), unsaid("setup")));
        }
    }
    list
}

fn push(list: &mut List, context: &ListContext, station: Option<(usize, u8)>, row: &Node, key: &str, device: &Node) {
    let name = row.word("title").or(row.word("name")).or(row.word("id")).unwrap_or(key);
    // A channel may be several registers, such as a colour.
    if row.get("consists_of").is_some() {
        row.all("consists_of").iter().for_each(|part| push(list, context, station, part, name, device));
        return;
    }
    let named = channel(row, name, device, key);
    let named = named.map(|named| Named { line: row.line, ..named }).map_err(|why| format!("{name}: {why}"));
    if named.is_ok() {
        list.note_keys(row, &[KNOWN]);
    }
    list.push_of(context, station, row.line, named);
}

fn channel(row: &Node, name: &str, device: &Node, key: &str) -> Result<Named, String> {
    if name.is_empty() {
        return Err(missing("name"));
    }
    // Which device or setting has it, only the other program finds out.
    if row.get("condition").is_some() {
        return Err(unsaid("condition"));
    }
    let is_parameter = !key.is_empty() || row.get("default").is_some() || row.get("reg_type").is_none();
    let word = row.word("reg_type").unwrap_or("holding");
    let (table, write_fc) = match word {
        "coil" => (Table::Coil, None),
        "discrete" => (Table::Discrete, None),
        "input" => (Table::Input, None),
        "holding" | "holding_single" => (Table::Holding, None),
        "holding_multi" => (Table::Holding, Some(16)),
        word => return Err(t!("`{table}` is not a table", table = word)),
    };
    let node = row.get("address").ok_or_else(|| missing("address"))?;
    let (address, field) = place(node)?;
    let kind = if table.is_bits() { DataType::Bool } else { kind_of(row, node)? };
    let is_little = |key: &str| row.word(key).or(device.word(key)) == Some("little_endian");
    let order = match (is_little("word_order"), is_little("byte_order")) {
        _ if kind.is_text() && is_little("word_order") => return Err(unsaid("word_order")),
        (false, false) => ByteOrder::Abcd,
        (true, false) => ByteOrder::Cdab,
        (false, true) => ByteOrder::Badc,
        (true, true) => ByteOrder::Dcba,
    };
    if field.is_some() && !kind.is_binary() {
        return Err(unsaid("address"));
    }
    let is_only_read = row.get("readonly").is_some_and(Node::is_true) || kind.is_text();
    let is_written = !is_only_read && matches!(table, Table::Holding | Table::Coil);
    let shown = row.word("type").unwrap_or("value");
    let access = match (is_written, matches!(shown, "wo-switch" | "pushbutton")) {
        (false, _) => Access::Read,
        (true, true) => Access::Write,
        (true, false) => Access::ReadWrite,
    };
    let write_fc = write_fc.filter(|_| is_written && field.is_none() && kind.registers() == 1 && !kind.is_half());
    let named =
        Named { field, access, write_fc, ..Named::new(table, address, kind, ByteOrder::Abcd, name).ordered(order) };
    let named = match row.get("write_address").filter(|_| is_written) {
        Some(node) => Named { write_at: Some((table, place(node)?.0)), ..named },
        None => named,
    };
    let named = Named { group: row.word("group").unwrap_or_default().to_owned(), ..named };
    // A bit that is on while it is 0 would be shown the other way round.
    if table.is_bits() && row.opt_whole("on_value")?.is_some_and(|on| on == 0) {
        return Err(unsaid("on_value"));
    }
    if kind.is_text() || table.is_bits() { Ok(named) } else { numbers(row, named, shown, is_parameter) }
}

/// `16`, `"0x10"`, `"0x10:4:2"` with the lowest bit and how many.
fn place(node: &Node) -> Result<(u16, Option<(u8, u8)>), String> {
    let bad = || wrong("address", node);
    let text = node.text().ok_or_else(bad)?;
    let parts: Vec<Option<i64>> = text.split(':').map(whole).collect();
    let address = parts.first().copied().flatten().and_then(|number| u16::try_from(number).ok()).ok_or_else(bad)?;
    let part = |n: usize| parts.get(n).copied().flatten().and_then(|number| u8::try_from(number).ok());
    match parts.len() {
        1 => Ok((address, None)),
        3 => {
            let (low, width) = (part(1).ok_or_else(bad)?, part(2).ok_or_else(bad)?);
            let fits = 0 < width && low.saturating_add(width) <= 64;
            Ok((address, Some(Some((low, width)).filter(|_| fits).ok_or_else(bad)?)))
        }
        _ => Err(bad()),
    }
}

fn kind_of(row: &Node, address: &Node) -> Result<DataType, String> {
    Ok(match row.word("format").unwrap_or("u16") {
        "u8" => DataType::U8,
        "s8" => DataType::I8,
        "u16" => DataType::U16,
        "s16" => DataType::I16,
        "u24" => DataType::U24,
        "s24" => DataType::I24,
        "u32" => DataType::U32,
        "s32" => DataType::I32,
        "u64" => DataType::U64,
        "s64" => DataType::I64,
        "bcd16" => DataType::Bcd16,
        "bcd32" => DataType::Bcd32,
        "float" => DataType::F32,
        "double" => DataType::F64,
        "string" => {
            // A register holds one character, in its low byte.
            let length = row.opt_whole("string_data_size")?.ok_or_else(|| wrong("address", address))?;
            let length = u8::try_from(length).ok().filter(|length| (1..=DataType::CHARS_MAX).contains(length));
            DataType::Chars(length.ok_or_else(|| unsaid("string_data_size"))?)
        }
        word => return Err(t!("`{word}` is not a known type", word)),
    })
}

/// Scale, limits and names of numbers.
fn numbers(row: &Node, named: Named, shown: &str, is_parameter: bool) -> Result<Named, String> {
    if named.field.is_some_and(|(low, width)| named.kind.bits() < low.saturating_add(width)) {
        return Err(unsaid("address"));
    }
    let (scale, offset) = (row.opt_number("scale")?.unwrap_or(1.0), row.opt_number("offset")?.unwrap_or(0.0));
    if scale == 0.0 {
        return Err(unsaid("scale"));
    }
    let mut named = named.scaled(scale, offset);
    if let Some(round) = row.opt_number("round_to")?.filter(|round| 0.0 < *round) {
        named.decimals = decimals_of(round, DataType::U16);
    }
    let unit = TYPES.iter().find(|(word, _)| *word == shown).map_or("", |(_, unit)| unit);
    named.unit = unit_of(row.word("units").unwrap_or(unit));
    for key in ["error_value", "unsupported_value"] {
        if let Some(node) = row.get(key) {
            let is_pattern = node.shown().to_lowercase().starts_with("0x");
            named = named.bad_at(node.whole().ok_or_else(|| wrong(key, node))?, is_pattern);
        }
    }
    let (mut labels, titles) = (Vec::new(), row.all("enum_titles"));
    for (n, node) in row.all("enum").iter().enumerate() {
        let number = node.whole().ok_or_else(|| wrong("enum", node))?;
        labels.push((i128::from(number), titles.get(n).map_or_else(|| number.to_string(), Node::shown)));
    }
    if matches!(shown, "switch" | "wo-switch") && !is_parameter {
        let [on, off] = [("on_value", 1), ("off_value", 0)]
            .map(|(key, usual)| row.opt_whole(key).map(|value| value.unwrap_or(usual)));
        labels.extend([(i128::from(off?), "off".to_owned()), (i128::from(on?), "on".to_owned())]);
    }
    // Those of a scaled value are values.
    if !labels.is_empty() && (scale != 1.0 || offset != 0.0) {
        return Err(unsaid("enum"));
    }
    if named.access != Access::Read {
        (named.min, named.max) = (row.opt_number("min")?, row.opt_number("max")?);
    }
    Ok(named.labelled(labels))
}
