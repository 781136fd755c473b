//! Project files of ModbusScope: <https://github.com/ModbusScope/ModbusScope>. Addresses are Modicon numbers; an expression
//! such as `${40001: 1: 32b} / 10` is taken where it is a register with a factor and an offset.

use super::{field_of, missing, unsaid, wrong};
use crate::{
    plant::tag::{ByteOrder, DataType, Table},
    register_map::{
        container::node::{Node, Tree, whole},
        list::{List, ListContext},
        named::Named,
    },
    t,
};

/// Reads a project; the rows of the first connection are taken.
pub fn read(tree: &Tree, context: &ListContext) -> List {
    let mut list = List::of_tree(tree);
    let Some(root) = tree.root.get("modbusscope") else { return List::refused(missing("modbusscope")) };
    let below = |key: &'static str, entry: &'static str| {
        let entries = root.get(key).map_or(&[][..], Node::entries);
        entries.iter().filter(move |(own, _)| own == entry).map(|(_, node)| node)
    };
    let connections: Vec<(i64, u8, bool)> = below("modbus", "connection")
        .map(|node| {
            let number = |key: &str, usual| node.get(key).and_then(Node::whole).unwrap_or(usual);
            // Least word first unless it is said.
            let little = node.get("int32littleendian").is_none_or(Node::is_true);
            (number("connectionid", 0), u8::try_from(number("slaveid", 1)).unwrap_or(1), little)
        })
        .collect();
    for register in below("scope", "register") {
        let id = register.get("connectionid").and_then(Node::whole);
        let (connection, named) = row(register, id.unwrap_or(0), &connections);
        let found = connections.iter().position(|(own, ..)| *own == connection);
        let station = found.map(|n| (n, connections[n].1));
        let title = register.word("text").unwrap_or_default();
        let named = named.map(|named| Named { line: register.line, ..named });
        let named = named.map_err(|why| if title.is_empty() { why } else { format!("{title}: {why}") });
        list.push_of(context, station, register.line, named);
    }
    list
}

/// A register and its connection.
fn row(node: &Node, connection: i64, connections: &[(i64, u8, bool)]) -> (i64, Result<Named, String>) {
    match node.get("expression").map(|node| (node, parse(&node.shown()))) {
        None => (connection, plain(node, is_little(connection, connections))),
        Some((node, None)) => {
            (connection, Err(t!("the formula `{formula}` is more than a factor and an offset", formula = node.shown())))
        }
        Some((_, Some(found))) => {
            let connection = found.connection.unwrap_or(connection);
            (connection, of_expression(node, &found, is_little(connection, connections)))
        }
    }
}

fn is_little(connection: i64, connections: &[(i64, u8, bool)]) -> bool {
    connections.iter().find(|(own, ..)| *own == connection).is_none_or(|(.., little)| *little)
}

/// `${40001: 1: s32b} * 0.1 + 5`.
struct Expression {
    address: String,
    connection: Option<i64>,
    kind: String,
    scale: f64,
    offset: f64,
}

fn parse(text: &str) -> Option<Expression> {
    let inner = text.trim().strip_prefix("${")?;
    let (inside, mut rest) = inner.split_once('}')?;
    let parts: Vec<&str> = inside.split(':').map(str::trim).collect();
    let (connection, kind) = match parts.as_slice() {
        [_] => (None, ""),
        [_, one] => (whole(one), if whole(one).is_some() { "" } else { one }),
        [_, connection, kind] => (Some(whole(connection)?), *kind),
        _ => return None,
    };
    let (mut scale, mut offset, mut has_added) = (1.0, 0.0, false);
    while !rest.trim().is_empty() {
        let sign = rest.trim().chars().next()?;
        let behind = rest.trim()[sign.len_utf8()..].trim_start();
        let end =
            behind.char_indices().find(|(at, c)| !(c.is_ascii_digit() || ".eE".contains(*c) || *at == 0 && *c == '-'));
        let (number, left) = behind.split_at(end.map_or(behind.len(), |(at, _)| at));
        let number: f64 = number.parse().ok()?;
        match sign {
            // What is multiplied after something was added would multiply that as well.
            '*' | '/' if has_added => return None,
            '*' => scale *= number,
            '/' if number != 0.0 => scale = if scale == 1.0 { 1.0 / number } else { scale / number },
            '+' | '-' => (offset, has_added) = (if sign == '+' { offset + number } else { offset - number }, true),
            _ => return None,
        }
        rest = left;
    }
    Some(Expression { address: parts.first()?.to_string(), connection, kind: kind.to_owned(), scale, offset })
}

fn of_expression(node: &Node, found: &Expression, is_little: bool) -> Result<Named, String> {
    let (kind, order) = match found.kind.as_str() {
        "" | "16b" => (DataType::U16, ByteOrder::Abcd),
        "s16b" => (DataType::I16, ByteOrder::Abcd),
        "32b" => (DataType::U32, wide(is_little)),
        "s32b" => (DataType::I32, wide(is_little)),
        "f32b" => (DataType::F32, wide(is_little)),
        word => return Err(t!("`{word}` is not a known type", word)),
    };
    let named = named(node, &found.address, kind, order)?;
    match (named.table.is_bits(), (found.scale, found.offset)) {
        (false, (scale, offset)) => Ok(named.scaled(scale, offset)),
        (true, (1.0, 0.0)) => Ok(named),
        (true, _) => Err(unsaid("expression")),
    }
}

fn wide(is_little: bool) -> ByteOrder {
    if is_little { ByteOrder::Cdab } else { ByteOrder::Abcd }
}

fn named(node: &Node, written: &str, kind: DataType, order: ByteOrder) -> Result<Named, String> {
    let found = place(written).ok_or_else(|| t!("`{written}` is not an address", written))?;
    let name = node.word("text").filter(|name| !name.is_empty()).unwrap_or(written);
    let kind = if found.0.is_bits() { DataType::Bool } else { kind };
    Ok(Named::new(found.0, found.1, kind, order, name))
}

/// `40001`, `h0`, `i5`, `c3`, `d7`.
fn place(written: &str) -> Option<(Table, u16)> {
    let tables = [('h', Table::Holding), ('i', Table::Input), ('c', Table::Coil), ('d', Table::Discrete)];
    let lettered =
        tables.iter().find_map(|(letter, table)| Some((*table, written.strip_prefix(*letter)?.parse().ok()?)));
    lettered.or_else(|| of_number(written.trim().parse().ok()?))
}

/// The first number of each table, the highest first. Coils begin with 0 in this program, and the last table has no end.
fn of_number(number: u32) -> Option<(Table, u16)> {
    let tables = [(40_001, Table::Holding), (30_001, Table::Input), (10_001, Table::Discrete), (0, Table::Coil)];
    let (first, table) = tables.into_iter().find(|(first, _)| *first <= number)?;
    Some((table, u16::try_from(number - first).ok()?))
}

/// The form of older versions: `unsigned`, `bitmask`, `shift`, `multiply` and `divide`, each of its own.
fn plain(node: &Node, is_little: bool) -> Result<Named, String> {
    let address = node.word("address").ok_or_else(|| missing("address"))?;
    let flag = |key: &str| node.get(key).is_some_and(Node::is_true);
    let (kind, order) = match (flag("bit32"), flag("unsigned")) {
        (false, true) => (DataType::U16, ByteOrder::Abcd),
        (false, false) => (DataType::I16, ByteOrder::Abcd),
        (true, true) => (DataType::U32, wide(is_little)),
        (true, false) => (DataType::I32, wide(is_little)),
    };
    let named = named(node, address, kind, order)?;
    if named.table.is_bits() {
        return Ok(named);
    }
    let number = |key: &str, usual: f64| node.opt_number(key).map(|found| found.unwrap_or(usual));
    let (multiply, divide, shift) = (number("multiply", 1.0)?, number("divide", 1.0)?, number("shift", 0.0)?);
    if multiply == 0.0 || divide == 0.0 {
        return Err(unsaid("divide"));
    }
    let all = (1u64 << named.kind.bits()) - 1;
    let mask = node.get("bitmask").map(|node| node.whole().ok_or_else(|| wrong("bitmask", node))).transpose()?;
    let mask = mask.map_or(all, |mask| u64::try_from(mask).unwrap_or(all) & all);
    let field = if mask == all { None } else { Some(field_of(mask).ok_or_else(|| unsaid("bitmask"))?) };
    if field.is_some() && !flag("unsigned") {
        return Err(unsaid("bitmask"));
    }
    // The mask leaves the bits where they are, the shift moves them.
    let moved = 2f64.powf(f64::from(field.map_or(0, |(low, _)| low)) + shift);
    let scale = if divide == 1.0 { multiply * moved } else { multiply * moved / divide };
    Ok(Named { field, ..named }.scaled(scale, 0.0))
}
