//! `[[inputs.modbus]]` of Telegraf, in requests.

use std::{collections::BTreeMap, fmt::Write};

use super::{Exported, quoted};
use crate::plant::{
    PlantDef,
    tag::{Access, ByteOrder, DataType, Table, TagDef},
};

/// Writes one input, whose connection is for its user to say: a request for each table and byte order.
pub fn write(plant: &PlantDef, tags: &[&TagDef], exported: &mut Exported) {
    let unit = plant.devices.first().map_or(1, |device| device.unit);
    let mut requests: BTreeMap<(Table, &str), Vec<String>> = BTreeMap::new();
    for tag in tags {
        match field(tag) {
            Ok(field) => {
                let order = if tag.point.kind.is_half() { ByteOrder::Abcd } else { tag.point.order };
                requests.entry((tag.point.table, order.word())).or_default().push(field);
                exported.count += 1;
                lose(tag, exported);
            }
            Err(why) => exported.left_out.push(format!("{}: {why}", tag.short)),
        }
    }
    let mut out = String::from(
        "[[inputs.modbus]]\n  name = \"sightglass\"\n  controller = \"tcp://192.0.2.1:502\"\n  configuration_type = \"request\"\n",
    );
    for ((table, order), fields) in requests {
        // Writing into a string does not fail.
        let _ = write!(
            out,
            "\n  [[inputs.modbus.request]]\n    slave_id = {unit}\n    byte_order = \"{order}\"\n    register = \"{}\"\n    fields = [\n",
            table.word()
        );
        fields.iter().for_each(|field| out.push_str(&format!("      {field},\n")));
        out.push_str("    ]\n");
    }
    exported.text = out;
}

fn field(tag: &TagDef) -> Result<String, &'static str> {
    let point = tag.point;
    if tag.access == Access::Write {
        return Err("it is only written");
    }
    let mut keys = vec![format!("address = {}", point.address), format!("name = {}", quoted(&tag.short))];
    if point.table.is_bits() {
        return Ok(format!("{{ {} }}", keys.join(", ")));
    }
    if tag.offset != 0.0 {
        return Err("its offset");
    }
    let kind = match (point.kind, point.order, point.field) {
        // A bit counts in the word as it comes.
        (DataType::U16, ByteOrder::Abcd | ByteOrder::Cdab, Some((bit, 1))) => {
            keys.push(format!("bit = {bit}"));
            "BIT"
        }
        (.., Some(_)) => return Err("a part of a register"),
        (DataType::I8, ByteOrder::Badc | ByteOrder::Dcba, _) => "INT8H",
        (DataType::I8, ..) => "INT8L",
        (DataType::U8, ByteOrder::Badc | ByteOrder::Dcba, _) => "UINT8H",
        (DataType::U8, ..) => "UINT8L",
        (DataType::I16, ..) => "INT16",
        (DataType::U16, ..) => "UINT16",
        (DataType::I32, ..) => "INT32",
        (DataType::U32, ..) => "UINT32",
        (DataType::I64, ..) => "INT64",
        (DataType::U64, ..) => "UINT64",
        (DataType::F16, ..) => "FLOAT16",
        (DataType::F32, ..) => "FLOAT32",
        (DataType::F64, ..) => "FLOAT64",
        (DataType::Text(_) | DataType::TextToNul(_), ..) => "STRING",
        _ => return Err("its type"),
    };
    keys.push(format!("type = \"{kind}\""));
    if kind == "STRING" {
        keys.push(format!("length = {}", point.kind.registers()));
    } else if tag.scale != 1.0 && kind != "BIT" {
        // Written as a float in any case.
        let scale = tag.scale.to_string();
        keys.push(format!("scale = {}", if scale.contains(['.', 'e']) { scale } else { format!("{scale}.0") }));
    }
    if tag.scale != 1.0 && kind == "BIT" {
        return Err("a scale of a bit");
    }
    Ok(format!("{{ {} }}", keys.join(", ")))
}

fn lose(tag: &TagDef, exported: &mut Exported) {
    exported.lose(
        tag,
        &[
            (!tag.unit.is_empty(), "its unit"),
            (tag.writable(), "writing it"),
            (!tag.enum_labels.is_empty(), "names of its numbers"),
            (!tag.bit_labels.is_empty(), "names of its bits"),
            (!tag.bad_if.is_empty(), "numbers that mean \"no value\""),
            (tag.quality_from.is_some(), "its quality from another tag"),
            (tag.when.is_some(), "when the device has it"),
        ],
    );
}
