//! Numbers that are calculated from several registers: `sensors`, one after the other.

use super::{super::unsaid, Tables, item_of};
use crate::{
    plant::tag::{Access, ByteOrder, DataType, Table},
    profile::unit_of,
    register_map::{
        container::node::{Node, Value},
        list::calculated::{Calculated, Piece},
        named::Named,
    },
};

/// The expression of an item with `sensors`; why there is none.
pub(super) fn sum_of(item: &Node, usual: Table, tables: &Tables) -> Result<Calculated, String> {
    let name = item.word("name").unwrap_or_default();
    if let Some(key) =
        ["lookup", "mask", "bit", "bitmask", "offset", "divide"].iter().find(|key| item.get(key).is_some())
    {
        return Err(unsaid(key));
    }
    let mut pieces: Vec<Piece> = Vec::new();
    let mut decimals = 0;
    for (n, sensor) in item.all("sensors").iter().enumerate() {
        // A part that is left out at times makes another sum.
        if let Some(key) = ["enabled_lookup", "validation"].iter().find(|key| has(sensor, key)) {
            return Err(unsaid(key));
        }
        let part = operand(item, sensor, format!("{name} part {}", n + 1), (usual, tables))?;
        decimals = decimals.max(part.decimals);
        let mut term = vec![Piece::Of(Box::new(part))];
        if let Some(factor) = sensor.get("multiply") {
            let inner = with_those(factor, sensor, &["code", "scale"]);
            let factor = operand(item, &inner, format!("{name} factor {}", n + 1), (usual, tables))?;
            term.extend([Piece::Text(" * "), Piece::Of(Box::new(factor))]);
        }
        pieces = match (sensor.word("operator"), pieces.is_empty()) {
            (Some("subtract"), true) => [vec![Piece::Text("0 - ")], term].concat(),
            (Some("subtract"), false) => [pieces, vec![Piece::Text(" - ")], term].concat(),
            (Some("multiply"), false) => [bracketed(pieces), vec![Piece::Text(" * ")], bracketed(term)].concat(),
            (Some("divide"), false) => [bracketed(pieces), vec![Piece::Text(" / ")], bracketed(term)].concat(),
            (Some("multiply" | "divide"), true) => return Err(unsaid("operator")),
            (_, true) => term,
            (_, false) => [pieces, vec![Piece::Text(" + ")], term].concat(),
        };
    }
    if pieces.is_empty() {
        return Err(unsaid("sensors"));
    }
    let rule = item.opt_whole("rule")?.unwrap_or(0);
    if rule % 2 == 0 && item.get("inverted").is_some_and(Node::is_true) {
        pieces = [vec![Piece::Text("0 - ")], bracketed(pieces)].concat();
    }
    if rule % 2 == 1 && has(item, "uint") {
        pieces = [vec![Piece::Text("max(0, ")], pieces, vec![Piece::Text(")")]].concat();
    }
    let unit = item.word("uom").or(item.word("unit_of_measurement")).unwrap_or_default();
    let named = Named::new(Table::Holding, 0, DataType::F64, ByteOrder::Abcd, name);
    Ok(Calculated { named: Named { unit: unit_of(unit), decimals, ..named }, pieces })
}

fn has(node: &Node, key: &str) -> bool {
    node.entries().iter().any(|(own, _)| own == key)
}

fn bracketed(pieces: Vec<Piece>) -> Vec<Piece> {
    if pieces.len() < 2 { pieces } else { [vec![Piece::Text("(")], pieces, vec![Piece::Text(")")]].concat() }
}

/// The register of a part, with the factor and the table of its item where it has none of its own.
fn operand(item: &Node, sensor: &Node, name: String, (usual, tables): (Table, &Tables)) -> Result<Named, String> {
    let mut node = with_those(sensor, item, &["code", "scale", "update_interval"]);
    let rule = if has(sensor, "signed") { "2" } else { "1" };
    let scalar = |text: &str| Node { line: sensor.line, value: Value::Scalar(text.to_owned()) };
    if let Value::Map(entries) = &mut node.value {
        entries.extend([("name".to_owned(), scalar(&name)), ("rule".to_owned(), scalar(rule))]);
    }
    let is_stated = node.get("code").is_some();
    let named = item_of(&node, usual, tables, is_stated)?;
    let label = named.name.clone();
    Ok(Named { access: Access::Read, line: sensor.line, label, ..named })
}

/// A node with these keys of another one that it does not have itself.
fn with_those(node: &Node, of: &Node, keys: &[&str]) -> Node {
    let own = node.entries().iter();
    let inherited = of.entries().iter().filter(|(key, _)| keys.contains(&key.as_str()) && node.get(key).is_none());
    Node { line: node.line, value: Value::Map(own.chain(inherited).cloned().collect()) }
}
