//! `[[inputs.modbus]]` of Telegraf: <https://github.com/influxdata/telegraf/tree/master/plugins/inputs/modbus>.

use super::{apart, missing, text_of, unsaid, wrong};
use crate::{
    plant::tag::{ByteOrder, DataType, Table},
    register_map::{
        container::node::{Node, Tree},
        list::{List, ListContext},
        named::Named,
    },
    t,
};

/// Keys that are kept, or say nothing about a value.
const KNOWN: &[&str] = &[
    "name",
    "address",
    "type",
    "data_type",
    "byte_order",
    "scale",
    "length",
    "bit",
    "omit",
    "measurement",
    "output",
    "register",
];

/// Reads all of them; the rows of the first unit are taken.
pub fn read(tree: &Tree, context: &ListContext) -> List {
    let mut list = List::of_tree(tree);
    let inputs = tree.root.get("inputs").unwrap_or(&tree.root).all("modbus");
    for (n, input) in inputs.iter().enumerate() {
        // An input of its own is a connection of its own, unless it is the same.
        let connection =
            inputs.iter().position(|other| other.word("controller") == input.word("controller")).unwrap_or(n);
        // The program asks unit 0 where none is stated.
        let unit = unit_of(input).unwrap_or(0);
        let cut = input.get("workarounds").and_then(|own| own.word("string_register_location")).unwrap_or("both");
        let in_whole = |named: Result<Option<Named>, String>| match named {
            Ok(Some(named)) if named.kind.is_text() && cut != "both" => Err(unsaid("string_register_location")),
            named => named,
        };
        for (section, table) in [
            ("discrete_inputs", Table::Discrete),
            ("coils", Table::Coil),
            ("holding_registers", Table::Holding),
            ("input_registers", Table::Input),
        ] {
            for field in input.all(section) {
                push(&mut list, context, (connection, unit), field, in_whole(register(field, table)));
            }
        }
        for request in input.all("request").iter().chain(input.all("metric")) {
            let unit = unit_of(request).unwrap_or(unit);
            for field in request.all("fields") {
                push(&mut list, context, (connection, unit), field, in_whole(requested(request, field)));
            }
        }
    }
    list
}

fn unit_of(node: &Node) -> Option<u8> {
    node.get("slave_id").and_then(Node::whole).and_then(|unit| u8::try_from(unit).ok())
}

fn push(
    list: &mut List,
    context: &ListContext,
    station: (usize, u8),
    field: &Node,
    named: Result<Option<Named>, String>,
) {
    // What is omitted only fills a request.
    let Some(named) = named.transpose() else { return };
    let name = field.word("name").unwrap_or_default();
    let named = named.map(|named| Named { line: field.line, ..named });
    let named = named.map_err(|why| if name.is_empty() { why } else { format!("{name}: {why}") });
    if named.is_ok() {
        list.note_keys(field, &[KNOWN]);
    }
    list.push_of(context, Some(station), field.line, named);
}

/// A field of the style with registers, `address = [3, 4]`.
fn register(field: &Node, table: Table) -> Result<Option<Named>, String> {
    let name = field.word("name").ok_or_else(|| missing("name"))?;
    let addresses = field.all("address").iter().map(|node| node.address("address"));
    let addresses: Vec<u16> = addresses.collect::<Result<_, _>>()?;
    let first = *addresses.first().ok_or_else(|| missing("address"))?;
    if table.is_bits() {
        return Ok(Some(Named::new(table, first, DataType::Bool, ByteOrder::Abcd, name)));
    }
    let word = field.word("data_type").ok_or_else(|| missing("data_type"))?;
    if word == "BIT" {
        return bit(field, table, first, field.get("byte_order"), name).map(Some);
    }
    if addresses.windows(2).any(|pair| pair[0].checked_add(1) != Some(pair[1])) {
        return Err(apart());
    }
    let count = i64::try_from(addresses.len()).unwrap_or(0);
    let (kind, order) = kind_of(word, count, field.get("byte_order"))?;
    Ok(Some(scaled(Named::new(table, first, kind, ByteOrder::Abcd, name).ordered(order), field)?))
}

/// A field of the styles with requests and metrics.
fn requested(request: &Node, field: &Node) -> Result<Option<Named>, String> {
    if field.get("omit").is_some_and(Node::is_true) {
        return Ok(None);
    }
    let name = field.word("name").ok_or_else(|| missing("name"))?;
    let word = field.word("register").or(request.word("register")).unwrap_or("holding");
    let table = match word {
        "coil" => Table::Coil,
        "discrete" => Table::Discrete,
        "input" => Table::Input,
        "holding" => Table::Holding,
        word => return Err(t!("`{table}` is not a table", table = word)),
    };
    let address = field.wire_address("address")?;
    if table.is_bits() {
        return Ok(Some(Named::new(table, address, DataType::Bool, ByteOrder::Abcd, name)));
    }
    let word = field.word("type").ok_or_else(|| missing("type"))?;
    let order = field.get("byte_order").or(request.get("byte_order"));
    if word == "BIT" {
        return bit(field, table, address, order, name).map(Some);
    }
    let length = field.opt_whole("length")?.unwrap_or(1);
    let (kind, order) = kind_of(word, if word == "STRING" { length } else { 0 }, order)?;
    Ok(Some(scaled(Named::new(table, address, kind, ByteOrder::Abcd, name).ordered(order), field)?))
}

/// A bit of a register, counted after its bytes are in order.
fn bit(field: &Node, table: Table, address: u16, order: Option<&Node>, name: &str) -> Result<Named, String> {
    let bit = field.opt_whole("bit")?.unwrap_or(0);
    let bit = u8::try_from(bit).ok().filter(|bit| *bit < 16).ok_or_else(|| unsaid("bit"))?;
    let order = order.map_or(Ok(ByteOrder::Abcd), order_of)?;
    let named = Named::new(table, address, DataType::U16, ByteOrder::Abcd, name).ordered(order);
    Ok(Named { field: Some((bit, 1)), ..named })
}

fn scaled(named: Named, field: &Node) -> Result<Named, String> {
    let scale = field.opt_number("scale")?.filter(|scale| *scale != 0.0).unwrap_or(1.0);
    Ok(if named.kind.is_text() { named } else { named.scaled(scale, 0.0) })
}

/// Type and order; so many registers, or 0 where the type says how many.
fn kind_of(word: &str, count: i64, order: Option<&Node>) -> Result<(DataType, ByteOrder), String> {
    let of_length = |one, two, four| match count {
        1 => Ok(one),
        2 => Ok(two),
        4 => Ok(four),
        _ => Err(t!("`{word}` of {length} registers is not known", word, length = count)),
    };
    let kind = match word {
        "INT8L" | "INT8H" => DataType::I8,
        "UINT8L" | "UINT8H" => DataType::U8,
        "INT16" => DataType::I16,
        "UINT16" => DataType::U16,
        "INT32" => DataType::I32,
        "UINT32" => DataType::U32,
        "INT64" => DataType::I64,
        "UINT64" => DataType::U64,
        "FLOAT16-IEEE" | "FLOAT16" => DataType::F16,
        "FLOAT32-IEEE" => DataType::F32,
        // With registers, an old word for a fixed number of digits; in a request it is the float.
        "FLOAT32" if count == 0 => DataType::F32,
        "FLOAT64-IEEE" | "FLOAT64" => DataType::F64,
        "FIXED" => of_length(DataType::I16, DataType::I32, DataType::I64)?,
        "UFIXED" | "FLOAT32" => of_length(DataType::U16, DataType::U32, DataType::U64)?,
        "STRING" => text_of(count).ok_or_else(|| unsaid("address"))?,
        word => return Err(t!("`{word}` is not a known type", word)),
    };
    if count != 0 && count != i64::from(kind.registers()) {
        return Err(t!("`{word}` does not take {length} registers", word, length = count));
    }
    if kind.is_half() {
        return Ok((kind, if word.ends_with('H') { ByteOrder::Badc } else { ByteOrder::Abcd }));
    }
    Ok((kind, order.map_or(Ok(ByteOrder::Abcd), order_of)?))
}

fn order_of(order: &Node) -> Result<ByteOrder, String> {
    Ok(match order.text().unwrap_or_default() {
        "AB" | "ABCD" | "ABCDEFGH" => ByteOrder::Abcd,
        "CDAB" | "GHEFCDAB" => ByteOrder::Cdab,
        "BA" | "BADC" | "BADCFEHG" => ByteOrder::Badc,
        "DCBA" | "HGFEDCBA" => ByteOrder::Dcba,
        _ => return Err(wrong("byte_order", order)),
    })
}
