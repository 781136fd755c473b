//! What registers are called and how their numbers become values: the one place for names of a unit, wherever they come
//! from (a device profile, a list from a manual, by hand).

use std::collections::BTreeMap;

use crate::{
    bus::codec,
    plant::{
        exact::{Exact, digits},
        id::{DeviceId, TagId},
        number::to_u8,
        raw_number::BadSpan,
        scale,
        tag::{Access, Bound, ByteOrder, DataType, Decimals, Encoding, Point, Poll, Table, TagDef},
        text_value,
    },
    t,
};

/// A register, or some that stand together, with a name: `value = raw · scale + offset`.
#[derive(Debug, Clone, PartialEq)]
pub struct Named {
    /// Which table.
    pub table: Table,
    /// First address on the wire, 0-based.
    pub address: u16,
    /// Type of the raw value.
    pub kind: DataType,
    /// Byte and word order.
    pub order: ByteOrder,
    /// Factor of the raw value.
    pub scale: f64,
    /// Added after scaling.
    pub offset: f64,
    /// Decimals to show.
    pub decimals: u8,
    /// `°C`; empty for none.
    pub unit: String,
    /// `SV`.
    pub name: String,
    /// `Setpoint`: what it is called at length, where that is not its name; empty for none.
    pub label: String,
    /// Names of the numbers of an enumeration, before scaling; empty for a quantity.
    pub enum_labels: Vec<(i128, String)>,
    /// Only these bits of its registers, lowest and number.
    pub field: Option<(u8, u8)>,
    /// Names of the bits of a status word.
    pub bit_labels: Vec<(u8, String)>,
    /// Raw numbers that mean "no value".
    pub bad_if: Vec<BadSpan>,
    /// `Battery`; empty for none.
    pub group: String,
    /// Least and greatest value that may be written, in its unit.
    pub min: Option<f64>,
    /// The greatest.
    pub max: Option<f64>,
    /// What may be done with it.
    pub access: Access,
    /// The function that it must be written with.
    pub write_fc: Option<u8>,
    /// Where it is written, if not where it is read.
    pub write_at: Option<(Table, u16)>,
    /// How often it is read, where that is said.
    pub poll: Option<Poll>,
    /// Where a power of ten stands by which it is multiplied besides.
    pub power_at: Option<u16>,
    /// It is the first of several, of which the device says how many it has.
    pub repeat: Option<Repeat>,
    /// The line of the file that it comes from; 0 for none.
    pub line: usize,
}

/// Rows that stand in a device many times.
#[derive(Debug, Clone, PartialEq)]
pub struct Repeat {
    /// What the names of the first of them begin with, without its number: `module` of `module1.W`.
    pub prefix: String,
    /// From one to the next.
    pub step: u16,
    /// The most of them.
    pub count: u16,
    /// The register that says how many there are, or how long they are together with so many registers in front.
    pub counted_by: (u16, Option<u16>),
}

impl Named {
    /// An unscaled number without unit.
    pub fn new(table: Table, address: u16, kind: DataType, order: ByteOrder, name: &str) -> Named {
        Named {
            table,
            address,
            kind,
            order,
            scale: 1.0,
            offset: 0.0,
            decimals: 0,
            unit: String::new(),
            name: name.to_owned(),
            label: String::new(),
            enum_labels: Vec::new(),
            field: None,
            bit_labels: Vec::new(),
            bad_if: Vec::new(),
            group: String::new(),
            min: None,
            max: None,
            access: Access::Read,
            write_fc: None,
            write_at: None,
            poll: None,
            power_at: None,
            repeat: None,
            line: 0,
        }
    }

    /// A tag, with its decimals and unit. Where the device has not said where its point is, the number is shown as it came,
    /// and says so.
    pub fn of_tag(tag: &TagDef, scaling: Option<(i8, String)>) -> Named {
        let point = tag.point;
        let plain = Named {
            label: if tag.label == tag.short { String::new() } else { tag.label.clone() },
            enum_labels: tag.enum_labels.clone(),
            bit_labels: tag.bit_labels.clone(),
            bad_if: tag.bad_if.clone(),
            field: point.field,
            ..Named::new(point.table, point.address, point.kind, point.order, &tag.short)
        };
        let Some((decimals, unit)) = scaling else { return Named { unit: t!("raw").to_owned(), ..plain } };
        let power = if tag.decimals.source().is_some() { -decimals } else { 0 };
        let scale = times_power(tag.scale, power.into());
        Named { scale, offset: tag.offset, decimals: Decimals::shown(decimals), unit, ..plain }
    }

    /// The same with the power of ten that its device holds for it; `None` for one that is none: -10 to 10 are.
    pub fn with_power(&self, power: i16) -> Option<Named> {
        let power = Some(power).filter(|power| (-10..=10).contains(power))?;
        let decimals = (i16::from(self.decimals) - power).clamp(0, 10);
        Some(Named {
            scale: times_power(self.scale, power.into()),
            decimals: to_u8(decimals),
            power_at: None,
            ..self.clone()
        })
    }

    /// The same with the access of a type that holds a text: not every one can be written.
    pub fn with_text_access(self) -> Named {
        let access = if text_value::is_writable(self.kind) { self.access } else { Access::Read };
        Named { access, ..self }
    }

    /// The same as a tag that is called so.
    pub fn tag(&self, name: &str) -> TagDef {
        let bound = |value: Option<f64>| value.map(|value| Bound::Fixed(value.into()));
        let plain = TagDef::new(TagId(0), DeviceId(0), name, self.point());
        TagDef {
            short: name.to_owned(),
            label: match self.label.as_str() {
                "" if self.name != name => self.name.clone(),
                label => label.to_owned(),
            },
            scale: self.scale,
            offset: self.offset,
            decimals: Decimals::Fixed(self.decimals),
            unit: self.unit.clone(),
            enum_labels: self.enum_labels.clone(),
            bit_labels: self.bit_labels.clone(),
            bad_if: self.bad_if.clone(),
            group: self.group.clone(),
            min: bound(self.min),
            max: bound(self.max),
            access: self.access,
            write_fc: self.write_fc,
            write_at: self.write_at,
            read_modify_write: self.access != Access::Read && self.point().part().is_some(),
            poll: self.poll.unwrap_or(plain.poll),
            ..plain
        }
    }

    /// Sets the scale, and the decimals that show what it leaves.
    pub fn scaled(self, scale: f64, offset: f64) -> Named {
        let decimals = decimals_of(scale, self.kind).max(decimals_of(offset, self.kind));
        Named { scale, offset, decimals, ..self }
    }

    /// Registers or bits that it takes.
    pub fn count(&self) -> u16 {
        if self.table.is_bits() { 1 } else { self.kind.registers() }
    }

    /// Its value, of the words from its address on; `None` where there are too few, they hold no number, or the power of ten
    /// is not known by which it is multiplied, see [`Named::with_power`].
    pub fn value(&self, words: &[u16]) -> Option<Exact> {
        let raw = self.raw(words).filter(|raw| !self.is_bad(*raw) && self.power_at.is_none())?;
        Some(scale::scaled(raw, self.scale, self.offset, 0))
    }

    fn is_bad(&self, raw: Exact) -> bool {
        self.bad_if.iter().any(|bad| bad.holds(raw))
    }

    /// `70.0 °C`, `RUN`, `no value`; `None` where there are too few words or they hold no number.
    pub fn text(&self, words: &[u16]) -> Option<String> {
        if self.kind.is_text() {
            return codec::decode_text(self.point(), words.get(..usize::from(self.count()))?);
        }
        let raw = self.raw(words)?;
        if self.is_bad(raw) {
            return Some(t!("no value").to_owned());
        }
        if let Some((_, label)) = self.enum_labels.iter().find(|(number, _)| Exact::whole(*number) == raw) {
            return Some(label.clone());
        }
        if !self.bit_labels.is_empty() {
            let word = raw.as_whole().unwrap_or_default();
            let set = self.bit_labels.iter().filter(|(bit, _)| word >> bit & 1 == 1).map(|(_, label)| label.as_str());
            let set: Vec<&str> = set.collect();
            return Some(if set.is_empty() { raw.to_string() } else { set.join(", ") });
        }
        if self.power_at.is_some() {
            return Some(format!("{raw} {}", t!("raw")));
        }
        let value = digits(scale::scaled(raw, self.scale, self.offset, 0), Some(self.decimals));
        Some(if self.unit.is_empty() { value } else { format!("{value} {}", self.unit) })
    }

    /// Where and as what it is encoded.
    pub fn point(&self) -> Point {
        Point { table: self.table, address: self.address, kind: self.kind, order: self.order, field: self.field }
    }

    /// The number before scaling; `None` as for [`Named::value`].
    pub fn raw(&self, words: &[u16]) -> Option<Exact> {
        let bit = || words.first().map(|word| f64::from(*word).into());
        if self.table.is_bits() { bit() } else { codec::decode(self.point(), words.get(..usize::from(self.count()))?) }
    }
}

/// As a person would write the product.
fn times_power(scale: f64, power: i32) -> f64 {
    format!("{scale}e{power}").parse().unwrap_or(scale)
}

/// Decimals that show what a scale leaves of a raw number.
pub fn decimals_of(scale: f64, kind: DataType) -> u8 {
    let fraction = format!("{scale}").split_once('.').map_or(0, |(_, digits)| digits.len().min(6));
    let float = kind.encoding() == Encoding::Float;
    u8::try_from(if float { fraction.max(2) } else { fraction }).unwrap_or(0)
}

/// The names of a unit, by table and first address.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Names(BTreeMap<(Table, u16), Named>);

impl Names {
    /// What begins at an address.
    pub fn get(&self, table: Table, address: u16) -> Option<&Named> {
        self.0.get(&(table, address))
    }

    /// Gives a name; the one that stood there before is gone.
    pub fn put(&mut self, named: Named) {
        self.0.insert((named.table, named.address), named);
    }

    /// Takes a name away.
    pub fn remove(&mut self, table: Table, address: u16) -> Option<Named> {
        self.0.remove(&(table, address))
    }

    /// All, in the order of tables and addresses.
    pub fn iter(&self) -> impl Iterator<Item = &Named> {
        self.0.values()
    }

    /// Has nothing a name yet?
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_named_register_is_shown_scaled_or_by_its_label() {
        let plain = Named::new(Table::Holding, 1002, DataType::I16, ByteOrder::Abcd, "SV");
        let scaled = Named { scale: 0.1, decimals: 1, unit: "°C".into(), ..plain.clone() };
        assert_eq!(scaled.text(&[700]).as_deref(), Some("70.0 °C"));
        assert_eq!(scaled.text(&[0xFFF6]).as_deref(), Some("-1.0 °C"));
        assert_eq!(scaled.text(&[]), None);
        let state = Named { enum_labels: vec![(0, "RUN".into())], ..plain.clone() };
        assert_eq!((state.text(&[0]).as_deref(), state.text(&[7]).as_deref()), (Some("RUN"), Some("7")));
        let marked = Named { bad_if: vec![Exact::whole(-1).into()], ..scaled };
        assert_eq!((marked.text(&[0xFFFF]).as_deref(), marked.value(&[0xFFFF])), (Some("no value"), None));
        let float = Named { kind: DataType::F32, decimals: 2, ..plain.clone() };
        assert_eq!((float.text(&[0x42D1, 0x6353]).as_deref(), float.text(&[0x42D1])), (Some("104.69"), None));
        let bit = Named { table: Table::Coil, kind: DataType::Bool, ..plain };
        assert_eq!(bit.text(&[1]).as_deref(), Some("1"));
    }
}
