//! What Home Assistant switches, moves and keeps warm: a place to write, and often another one to read.

use super::{array, missing, quantity, unsaid, wrong};
use crate::{
    plant::tag::{Access, ByteOrder, DataType, Table},
    profile::unit_of,
    register_map::{container::node::Node, named::Named},
};

/// Keys that are kept of these rows.
pub const KEPT: &[&str] = &[
    "address",
    "input_type",
    "write_type",
    "command_on",
    "command_off",
    "verify",
    "slave_count",
    "virtual_count",
    "status_register",
    "status_register_type",
    "state_open",
    "state_closed",
    "state_opening",
    "state_closing",
    "target_temp_register",
    "target_temp_write_registers",
    "data_type",
    "count",
    "swap",
    "scale",
    "offset",
    "current_temp_scale",
    "current_temp_offset",
    "target_temp_scale",
    "target_temp_offset",
    "precision",
    "min_temp",
    "max_temp",
    "temperature_unit",
    "temp_step",
    "hvac_mode_register",
    "hvac_action_register",
    "fan_mode_register",
    "swing_mode_register",
    "hvac_onoff_register",
    "hvac_on_value",
    "hvac_off_value",
    "hvac_onoff_coil",
    "write_registers",
    "structure",
];

fn table_of(word: &str) -> Option<Table> {
    Some(match word {
        "holding" | "holdings" => Table::Holding,
        "input" => Table::Input,
        "coil" | "coils" => Table::Coil,
        "discrete_input" => Table::Discrete,
        _ => return None,
    })
}

fn table(item: &Node, key: &str, usual: Table) -> Result<Table, String> {
    let Some(node) = item.get(key) else { return Ok(usual) };
    node.text().and_then(table_of).ok_or_else(|| wrong(key, node))
}

/// A register or bit without scale.
fn plain(table: Table, address: u16, name: &str) -> Named {
    let kind = if table.is_bits() { DataType::Bool } else { DataType::U16 };
    Named::new(table, address, kind, ByteOrder::Abcd, name)
}

fn name_of(item: &Node) -> Result<&str, String> {
    item.word("name").ok_or_else(|| missing("name"))
}

/// A bit of a table, or the lowest of a register.
pub fn binary_sensors(item: &Node) -> Result<Vec<Named>, String> {
    let table = table(item, "input_type", Table::Coil)?;
    let named = plain(table, item.wire_address("address")?, name_of(item)?);
    let named = if table.is_bits() { named } else { Named { field: Some((0, 1)), ..named } };
    let more = item.opt_whole("slave_count")?.or(item.opt_whole("virtual_count")?).unwrap_or(0);
    // The next ones are the lowest bits of the next registers.
    array(named, more, |named, n| {
        let address = named.address.checked_add(u16::try_from(n).ok()?)?;
        Some(Named { address, ..named.clone() })
    })
}

/// A switch, light or fan.
pub fn switch(item: &Node) -> Result<Named, String> {
    let word = item.word("write_type").unwrap_or("holding");
    let write = table(item, "write_type", Table::Holding)?;
    if matches!(write, Table::Input | Table::Discrete) {
        return Err(item.get("write_type").map_or_else(|| missing("write_type"), |node| wrong("write_type", node)));
    }
    let address = item.wire_address("address")?;
    let [on, off] = [item.opt_whole("command_on")?.unwrap_or(1), item.opt_whole("command_off")?.unwrap_or(0)];
    let write_fc = match word {
        "holdings" => Some(16),
        "coils" => Some(15),
        _ => None,
    };
    // A bit that is on while it is 0 would be shown the other way round.
    if write.is_bits() && [on, off] != [1, 0] {
        return Err(unsaid("command_on"));
    }
    let written = Named { access: Access::ReadWrite, write_fc, ..plain(write, address, name_of(item)?) };
    let Some(verify) = item.get("verify").filter(|verify| !verify.entries().is_empty()) else {
        return Ok(with_states(written, on, off));
    };
    let read = table(verify, "input_type", write)?;
    let place = if verify.get("address").is_some() { verify.wire_address("address")? } else { address };
    let states = [verify.opt_whole("state_on")?.unwrap_or(on), verify.opt_whole("state_off")?.unwrap_or(off)];
    if (read, place) == (write, address) && states == [on, off] {
        return Ok(with_states(written, on, off));
    }
    // What is read back is then not what was written.
    if states != [on, off] || read.is_bits() != write.is_bits() {
        return Err(unsaid("verify"));
    }
    let write_at = Some((write, address));
    Ok(with_states(Named { table: read, address: place, write_at, ..written }, on, off))
}

fn with_states(named: Named, on: i64, off: i64) -> Named {
    if named.table.is_bits() {
        return named;
    }
    named.labelled(vec![(i128::from(off), "off".to_owned()), (i128::from(on), "on".to_owned())])
}

/// A cover, by its state.
pub fn cover(item: &Node) -> Result<Named, String> {
    let write = table(item, "input_type", Table::Holding)?;
    let address = item.wire_address("address")?;
    let named = plain(write, address, name_of(item)?);
    let mut states = Vec::new();
    for (key, usual, label) in [
        ("state_closed", 0, "closed"),
        ("state_open", 1, "open"),
        ("state_opening", 2, "opening"),
        ("state_closing", 3, "closing"),
    ] {
        states.push((i128::from(item.opt_whole(key)?.unwrap_or(usual)), label.to_owned()));
    }
    let named = Named { access: Access::ReadWrite, ..named };
    let named = match item.get("status_register") {
        None => named,
        Some(_) => {
            let read = table(item, "status_register_type", Table::Holding)?;
            if read.is_bits() != write.is_bits() {
                return Err(unsaid("status_register"));
            }
            let place = item.wire_address("status_register")?;
            let write_at = ((read, place) != (write, address)).then_some((write, address));
            Named { table: read, address: place, write_at, ..named }
        }
    };
    if !named.table.is_bits() {
        return Ok(named.labelled(states));
    }
    if states[..2].iter().map(|(state, _)| *state).ne([0, 1]) {
        return Err(unsaid("state_open"));
    }
    Ok(named)
}

/// The temperature, the one that is wanted, and the modes of a climate.
pub fn climate(item: &Node) -> Result<Vec<Named>, String> {
    let name = name_of(item)?;
    let unit =
        if item.word("temperature_unit").is_some_and(|unit| unit.eq_ignore_ascii_case("f")) { "°F" } else { "°C" };
    let of = |which: &str| -> Result<Named, String> {
        // One of the keys for both, or each has its own.
        let keys = ["scale", "offset"].map(|key| {
            let own = format!("{which}_temp_{key}");
            if item.get(&own).is_some() { own } else { key.to_owned() }
        });
        Ok(Named { unit: unit_of(unit), ..quantity(item, name, [&keys[0], &keys[1]])? })
    };
    let (now, wanted) = (of("current")?, of("target")?);
    let mut rows = vec![now.clone()];
    let targets = item.all("target_temp_register");
    for (n, node) in targets.iter().enumerate() {
        let address = node.address("target_temp_register")?;
        let number = if targets.len() == 1 { String::new() } else { format!(" {}", n + 1) };
        let many = item.get("target_temp_write_registers").is_some_and(Node::is_true) && now.kind.registers() == 1;
        let target = Named {
            table: Table::Holding,
            address,
            name: format!("{name} target{number}"),
            access: Access::ReadWrite,
            write_fc: many.then_some(16),
            min: item.opt_number("min_temp")?,
            max: item.opt_number("max_temp")?,
            ..wanted.clone()
        };
        // Where it is read is where it is written.
        if now.table == Table::Holding && address == now.address {
            if (now.scale, now.offset) != (wanted.scale, wanted.offset) {
                return Err(unsaid("target_temp_scale"));
            }
            rows.clear();
        }
        rows.push(target);
    }
    for (key, label, access) in [
        ("hvac_mode_register", "mode", Access::ReadWrite),
        ("hvac_action_register", "action", Access::Read),
        ("fan_mode_register", "fan mode", Access::ReadWrite),
        ("swing_mode_register", "swing mode", Access::ReadWrite),
    ] {
        if let Some(node) = item.get(key) {
            rows.push(mode(node, &format!("{name} {label}"), access)?);
        }
    }
    if item.get("hvac_onoff_register").is_some() {
        let named = plain(Table::Holding, item.wire_address("hvac_onoff_register")?, &format!("{name} on"));
        let [on, off] = [item.opt_whole("hvac_on_value")?.unwrap_or(1), item.opt_whole("hvac_off_value")?.unwrap_or(0)];
        let many = item.get("write_registers").is_some_and(Node::is_true).then_some(16);
        rows.push(with_states(Named { access: Access::ReadWrite, write_fc: many, ..named }, on, off));
    }
    if item.get("hvac_onoff_coil").is_some() {
        let named = plain(Table::Coil, item.wire_address("hvac_onoff_coil")?, &format!("{name} on"));
        rows.push(Named { access: Access::ReadWrite, ..named });
    }
    Ok(rows)
}

/// A register of modes: `values` has `state_heat: 1`, or several numbers of one.
fn mode(node: &Node, name: &str, access: Access) -> Result<Named, String> {
    let table = table(node, "input_type", Table::Holding)?;
    let address = match node.get("address").map(Node::items) {
        // One to read and one to write, the same.
        Some([one]) => one.address("address")?,
        _ => return Err(unsaid("address")),
    };
    let mut labels = Vec::new();
    for (key, values) in node.get("values").map_or(&[][..], Node::entries) {
        let words = ["state_fan_", "swing_mode_state_", "action_", "state_"];
        let word = words.iter().find_map(|prefix| key.strip_prefix(prefix)).unwrap_or(key);
        for value in values.items() {
            labels.push((i128::from(value.whole().ok_or_else(|| wrong(key, value))?), word.replace('_', " ")));
        }
    }
    let many = node.get("write_registers").is_some_and(Node::is_true) && access != Access::Read;
    let named = Named { access, write_fc: many.then_some(16), ..plain(table, address, name) };
    Ok(named.labelled(labels))
}
