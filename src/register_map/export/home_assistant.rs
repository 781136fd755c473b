//! The `modbus:` section of Home Assistant.

use std::fmt::Write;

use super::{Exported, decimals, quoted, title};
use crate::plant::{
    PlantDef,
    tag::{Access, ByteOrder, DataType, Table, TagDef},
};

/// Writes one hub, whose connection is for its user to say.
pub fn write(plant: &PlantDef, tags: &[&TagDef], exported: &mut Exported) {
    let unit = plant.devices.first().map_or(1, |device| device.unit);
    let mut sections: [(&str, String); 3] =
        [("sensors", String::new()), ("binary_sensors", String::new()), ("switches", String::new())];
    for tag in tags {
        match entity(tag, unit) {
            Ok((section, text)) => {
                sections[section].1.push_str(&text);
                exported.count += 1;
                lose(tag, exported);
            }
            Err(why) => exported.left_out.push(format!("{}: {why}", tag.short)),
        }
    }
    let mut out = String::from("modbus:\n  - name: sightglass\n    type: tcp\n    host: 192.0.2.1\n    port: 502\n");
    for (name, text) in sections.iter().filter(|(_, text)| !text.is_empty()) {
        // Writing into a string does not fail.
        let _ = write!(out, "    {name}:\n{text}");
    }
    exported.text = out;
}

fn entity(tag: &TagDef, unit: u8) -> Result<(usize, String), &'static str> {
    let point = tag.point;
    let mut keys = vec![
        format!("name: {}", quoted(title(tag))),
        format!("unique_id: {}", quoted(&tag.short)),
        format!("slave: {unit}"),
        format!("address: {}", point.address),
    ];
    let section = match point.table {
        _ if tag.access == Access::Write => return Err("it is only written"),
        Table::Coil if tag.writable() && tag.write_at.is_none() => {
            keys.extend(["write_type: coil".to_owned(), "verify: {}".to_owned()]);
            2
        }
        Table::Coil => {
            keys.push("input_type: coil".to_owned());
            1
        }
        Table::Discrete => {
            keys.push("input_type: discrete_input".to_owned());
            1
        }
        Table::Input | Table::Holding => {
            register(tag, &mut keys)?;
            0
        }
    };
    Ok((section, format!("      - {}\n", keys.join("\n        "))))
}

fn register(tag: &TagDef, keys: &mut Vec<String>) -> Result<(), &'static str> {
    let point = tag.point;
    if point.field.is_some() {
        return Err("a part of a register");
    }
    keys.push(format!("input_type: {}", point.table.word()));
    let kind = match point.kind {
        DataType::I16 => "int16",
        DataType::U16 => "uint16",
        DataType::I32 => "int32",
        DataType::U32 => "uint32",
        DataType::I64 => "int64",
        DataType::U64 => "uint64",
        DataType::F16 => "float16",
        DataType::F32 => "float32",
        DataType::F64 => "float64",
        DataType::Text(_) | DataType::TextToNul(_) => "string",
        DataType::Bool
        | DataType::Bcd16
        | DataType::Bcd32
        | DataType::I8
        | DataType::U8
        | DataType::I24
        | DataType::U24
        | DataType::I48
        | DataType::U48
        | DataType::Sm16
        | DataType::Sm32
        | DataType::Mod10k(_)
        | DataType::SignedMod10k(_)
        | DataType::Chars(_)
        | DataType::Clock(_)
        | DataType::Version(_)
        | DataType::NetworkAddress(_)
        | DataType::EnronI32
        | DataType::EnronU32
        | DataType::EnronF32 => return Err("its type"),
    };
    keys.push(format!("data_type: {kind}"));
    let swap = match point.order {
        ByteOrder::Abcd => None,
        ByteOrder::Cdab => Some("word"),
        ByteOrder::Badc => Some("byte"),
        ByteOrder::Dcba => Some("word_byte"),
    };
    keys.extend(swap.map(|swap| format!("swap: {swap}")));
    if tag.is_text() {
        keys.push(format!("count: {}", point.kind.registers()));
        return Ok(());
    }
    keys.extend((tag.scale != 1.0).then(|| format!("scale: {}", tag.scale)));
    keys.extend((tag.offset != 0.0).then(|| format!("offset: {}", tag.offset)));
    keys.push(format!("precision: {}", decimals(tag)));
    // One that the device chooses is none of the file.
    let has_unit = !tag.unit.is_empty() && tag.unit_from.is_none();
    keys.extend(has_unit.then(|| format!("unit_of_measurement: {}", quoted(&tag.unit))));
    keys.extend(whole_bad(tag).next().map(|bad| format!("nan_value: {bad}")));
    Ok(())
}

/// It takes whole numbers alone for "no value", and by itself what is not a number.
fn whole_bad(tag: &TagDef) -> impl Iterator<Item = i128> {
    tag.bad_if.iter().filter_map(|bad| bad.single()?.as_whole())
}

fn lose(tag: &TagDef, exported: &mut Exported) {
    let is_fraction =
        tag.bad_if.iter().filter_map(|bad| bad.single()).any(|bad| bad.as_whole().is_none() && !bad.near().is_nan());
    let is_written = tag.writable() && tag.point.table != Table::Coil;
    exported.lose(
        tag,
        &[
            (is_written, "writing it"),
            (!tag.enum_labels.is_empty(), "names of its numbers"),
            (!tag.bit_labels.is_empty(), "names of its bits"),
            (1 < whole_bad(tag).count(), "all numbers that mean \"no value\" but the first"),
            (tag.bad_if.iter().any(|bad| bad.single().is_none()), "ranges of numbers that mean \"no value\""),
            (is_fraction, "a number that means \"no value\" and is not whole"),
            (tag.quality_from.is_some(), "its quality from another tag"),
            (tag.when.is_some(), "when the device has it"),
            (tag.unit_from.is_some(), "its unit from another tag"),
        ],
    );
}
