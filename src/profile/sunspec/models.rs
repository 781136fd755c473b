//! The models of SunSpec, read on demand from the text that comes with the program (`profiles/sunspec/README.md`).

use std::str::Lines;

use crate::{
    plant::{data_type::NetworkAddress, tag::DataType},
    profile::sunspec_models,
};

/// A model, or a part of one that repeats.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct Group {
    /// `inverter_three_phase`.
    pub name: &'static str,
    /// How often it stands there.
    pub count: Count,
    /// First its points, in the order of their registers.
    pub points: Vec<ModelPoint>,
    /// Then the parts within.
    pub groups: Vec<Group>,
}

/// How often a part stands in its model.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) enum Count {
    /// So often.
    #[default]
    Once,
    /// So often, and counted.
    Times(u16),
    /// As this point says.
    From(&'static str),
    /// As often as the length of the model has room for.
    Fill,
}

/// A point of a model.
#[derive(Debug, PartialEq)]
pub(crate) struct ModelPoint {
    /// `PhVphA`.
    pub name: &'static str,
    /// What it holds.
    pub kind: Kind,
    /// Registers that it takes.
    pub registers: u16,
    /// It may be written.
    pub is_writable: bool,
    /// Every device has it.
    pub is_mandatory: bool,
    /// It does not change while the device is in use.
    pub is_static: bool,
    /// The point that holds its power of ten, or that power.
    pub scale: &'static str,
    /// Its unit; empty for none.
    pub unit: &'static str,
    /// What it is called in words; empty where its name says as much.
    pub label: &'static str,
    /// Names of its numbers, or bits.
    pub symbols: Vec<(u32, &'static str)>,
}

/// What a point holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    /// A number.
    Number(DataType),
    /// A counter: 0 means that there is none.
    NotZero(DataType),
    /// A number with names.
    Enum(DataType),
    /// Bits with names.
    Bits(DataType),
    /// A power of ten.
    Power,
    /// Text, two characters a register.
    Text,
    /// An address in a network.
    Address(NetworkAddress),
    /// Nothing.
    Pad,
}

impl Kind {
    /// Is it shown as text?
    pub fn is_text(self) -> bool {
        matches!(self, Kind::Text | Kind::Address(_))
    }
}

/// A model by its number; `None` for one that is not known.
pub(crate) fn model(id: u16) -> Option<Group> {
    let text = sunspec_models();
    let head = format!("\n= {id} ");
    let (name, body) = text[text.find(&head)? + head.len()..].split_once('\n')?;
    let body = body.split_once("\n= ").map_or(body, |(body, _)| body);
    Some(group(name, Count::Once, &mut body.lines()))
}

/// The numbers of all models.
#[cfg(test)]
pub(crate) fn ids() -> Vec<u16> {
    let heads = sunspec_models().lines().filter_map(|line| line.strip_prefix("= "));
    heads.filter_map(|head| head.split(' ').next()?.parse().ok()).collect()
}

/// The lines of a group up to its end.
fn group(name: &'static str, count: Count, lines: &mut Lines<'static>) -> Group {
    let mut group = Group { name, count, ..Group::default() };
    while let Some(line) = lines.next().filter(|line| *line != ")") {
        if let Some(symbol) = line.strip_prefix(' ') {
            let symbol = symbol.split_once(' ').and_then(|(number, name)| Some((number.parse().ok()?, name)));
            group.points.last_mut().into_iter().for_each(|point| point.symbols.extend(symbol));
        } else if let Some((name, count)) = line.strip_prefix("( ").and_then(|head| head.rsplit_once(' ')) {
            group.groups.push(self::group(name, count_of(count), lines));
        } else {
            group.points.push(point(line));
        }
    }
    group
}

fn count_of(word: &'static str) -> Count {
    match word.parse() {
        Ok(0) => Count::Fill,
        Ok(1) => Count::Once,
        Ok(times) => Count::Times(times),
        Err(_) => Count::From(word),
    }
}

fn point(line: &'static str) -> ModelPoint {
    let mut cells = line.split('\t');
    let mut cell = || cells.next().unwrap_or_default();
    let (name, (kind, registers), flags) = (cell(), kind_of(cell()), cell());
    let (scale, unit, label) = (cell(), cell(), cell());
    let [is_writable, is_static, is_mandatory] = ['w', 's', 'm'].map(|flag| flags.contains(flag));
    let symbols = Vec::new();
    ModelPoint { name, kind, registers, is_writable, is_mandatory, is_static, scale, unit, label, symbols }
}

/// What a type is here, and how many registers it takes; [`Kind::Pad`] for one that is not known.
pub(crate) fn kind_of(word: &str) -> (Kind, u16) {
    let kind = match word {
        "int16" => Kind::Number(DataType::I16),
        "uint16" | "count" => Kind::Number(DataType::U16),
        "int32" => Kind::Number(DataType::I32),
        "uint32" => Kind::Number(DataType::U32),
        "int64" => Kind::Number(DataType::I64),
        "uint64" => Kind::Number(DataType::U64),
        "float32" => Kind::Number(DataType::F32),
        "float64" => Kind::Number(DataType::F64),
        "acc16" => Kind::NotZero(DataType::U16),
        "acc32" => Kind::NotZero(DataType::U32),
        "acc64" => Kind::NotZero(DataType::U64),
        "eui48" => Kind::Address(NetworkAddress::Eui48),
        "ipaddr" => Kind::Address(NetworkAddress::Ipv4),
        "enum16" => Kind::Enum(DataType::U16),
        "enum32" => Kind::Enum(DataType::U32),
        "bitfield16" => Kind::Bits(DataType::U16),
        "bitfield32" => Kind::Bits(DataType::U32),
        "bitfield64" => Kind::Bits(DataType::U64),
        "sunssf" => Kind::Power,
        "ipv6addr" => Kind::Address(NetworkAddress::Ipv6),
        _ => {
            let registers = |name| word.strip_prefix(name).and_then(|count| count.parse().ok());
            let text = registers("string").map(|count| (Kind::Text, count));
            return text.unwrap_or((Kind::Pad, registers("pad").unwrap_or(1)));
        }
    };
    let registers = match kind {
        Kind::Number(kind) | Kind::NotZero(kind) | Kind::Enum(kind) | Kind::Bits(kind) => kind.registers(),
        Kind::Address(address) => DataType::NetworkAddress(address).registers(),
        Kind::Power | Kind::Text | Kind::Pad => 1,
    };
    (kind, registers)
}
