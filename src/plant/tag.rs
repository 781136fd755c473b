//! A tag: where a value lives in its device, what it means and what may be done with it.

use std::{sync::Arc, time::Duration};

use serde::{Deserialize, Serialize};

use super::{
    bad_span::BadSpan,
    exact::Exact,
    expr::Expr,
    id::{DeviceId, TagId},
    keyword::keyword_enum,
    role::{Reauthentication, Role},
    sample::Sample,
    simulate::Simulate,
};
pub use super::{
    bound::Bound,
    calculation_def::Calculation,
    confidence::Confidence,
    data_type::{ByteOrder, DataType, Encoding},
    decimals::Decimals,
    poll_class::PollClass,
    store_policy::{STORE_EVERY_MAX, StorePolicy},
};

/// Definition of a tag.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TagDef {
    /// Its place.
    pub id: TagId,
    /// The device it belongs to.
    pub device: DeviceId,
    /// Full name, `TIC-1.PV`: device name, dot, short name.
    pub name: String,
    /// Short name, `PV`.
    pub short: String,
    /// A few words: `process value`.
    pub label: String,
    /// What the value does and means, for the controller tab.
    pub meaning: String,
    /// Where and how it is stored in the device.
    pub point: Point,
    /// `value = raw · scale · 10^-decimals_from + offset`, or `10^scale_from`.
    pub scale: f64,
    /// Added after scaling.
    pub offset: f64,
    /// Decimals to show, and where they come from.
    pub decimals: Decimals,
    /// `°C`, `%`, `s`; empty for none.
    pub unit: String,
    /// A tag whose value picks the unit from this list (PXR 41017: 0 °C, 1 °F).
    pub unit_from: Option<(TagId, Vec<(i128, String)>)>,
    /// Lowest value that may be written, and low end of bars.
    pub min: Option<Bound>,
    /// Highest value that may be written, and high end of bars.
    pub max: Option<Bound>,
    /// Where the value usually lies, from lowest to highest.
    pub normal: Option<[f64; 2]>,
    /// What may be done with it.
    pub access: Access,
    /// Asked before a write, beyond old and new value.
    pub confirm: Option<String>,
    /// What must be given again to write it.
    pub reauthenticate: Option<Reauthentication>,
    /// The least role that may write it: operating is for a technician, tuning and setting up for a supervisor.
    pub role: Role,
    /// Names of the numbers of an enumeration; empty for a quantity.
    pub enum_labels: Vec<(i128, String)>,
    /// Names of the bits of a status word.
    pub bit_labels: Vec<(u8, String)>,
    /// Raw numbers (before scaling) that mean "no value".
    pub bad_if: Vec<BadSpan>,
    /// Another tag that makes this one bad while `value & mask != 0` (PXR 31008 for PV).
    pub quality_from: Option<(TagId, u64)>,
    /// What must hold for its device to have it at all; it is read from the device. A condition of tags without one.
    pub when: Option<Arc<Expr>>,
    /// Function code to write with; `None` picks 5/6 for one word, 16 for more.
    pub write_fc: Option<u8>,
    /// Where it is written, if not where it is read.
    pub write_at: Option<(Table, u16)>,
    /// Written by reading its registers, setting its own bits and writing them back: another master, or the device itself, that
    /// changes the others in between is overwritten.
    pub read_modify_write: bool,
    /// Tag and value to write before this one (Delta DTB 0810H).
    pub write_unlock: Option<(TagId, f64)>,
    /// Group on the controller tab.
    pub group: String,
    /// How often it is read.
    pub poll: Poll,
    /// What happens to its reading on a line with too much to do.
    pub class: PollClass,
    /// Changes up to this are not stored; `None` is half the last shown digit, 0 stores every change.
    pub deadband: Option<f64>,
    /// Whether and when it is stored in the history.
    pub store: StorePolicy,
    /// An unchanged good value is stored again after this time, at most [`STORE_EVERY_MAX`].
    pub store_every: Duration,
    /// Whether it counts up, so that a report gives its difference and no mean; `None`: by its unit.
    pub counter: Option<bool>,
    /// After so much, in its unit, a counter shows the same again; `None`: by its type.
    pub modulus: Option<f64>,
    /// The most that a counter counts in an hour, in its unit.
    pub max_rate: Option<f64>,
    /// Whether a report gives how long and how often it was on.
    pub hours: bool,
    /// How sure the register map is of this row.
    pub confidence: Confidence,
    /// Where the row comes from (manual, clause).
    pub source: String,
    /// How a simulated device fills it; `None` holds what is written.
    pub simulate: Option<Arc<Simulate>>,
    /// What it is calculated from, instead of being read: its device only names it, and [`TagDef::point`] means nothing.
    pub calculation: Option<Arc<Calculation>>,
    /// What the maker sets it to before delivery, in the tag's unit; `None` if the profile is silent.
    pub default: Option<f64>,
    /// Part of a parameter set: a setting, not a command and not a measurement.
    pub in_sets: bool,
    /// What the plant file states that it is while its device has not said it: on the line of another master only.
    pub stated: Option<f64>,
}

impl TagDef {
    /// A plain quantity: read only, unscaled, without unit, read every second, stored. A caller changes what it knows
    /// better: `TagDef { unit: "°C".into(), ..TagDef::new(…) }`.
    pub fn new(id: TagId, device: DeviceId, name: &str, point: Point) -> TagDef {
        TagDef {
            id,
            device,
            name: name.to_owned(),
            short: name.split_once('.').map_or(name, |(_, short)| short).to_owned(),
            label: String::new(),
            meaning: String::new(),
            point,
            scale: 1.0,
            offset: 0.0,
            decimals: Decimals::Fixed(0),
            unit: String::new(),
            unit_from: None,
            min: None,
            max: None,
            normal: None,
            access: Access::Read,
            confirm: None,
            reauthenticate: None,
            role: Role::Technician,
            enum_labels: Vec::new(),
            bit_labels: Vec::new(),
            bad_if: Vec::new(),
            quality_from: None,
            when: None,
            write_fc: None,
            write_at: None,
            read_modify_write: false,
            write_unlock: None,
            group: String::new(),
            poll: Poll::Every(Duration::from_secs(1)),
            class: PollClass::Normal,
            deadband: None,
            store: StorePolicy::Change,
            store_every: STORE_EVERY_MAX,
            counter: None,
            modulus: None,
            max_rate: None,
            hours: false,
            confidence: Confidence::Proven,
            source: String::new(),
            simulate: None,
            calculation: None,
            default: None,
            in_sets: false,
            stated: None,
        }
    }
    /// Is it the total of an expression?
    pub fn is_total(&self) -> bool {
        self.calculation.as_ref().is_some_and(|calculation| {
            matches!(calculation.over_time, Some(super::calculation_def::OverTime::Total(_)))
        })
    }

    /// Is it read, or calculated, without anybody asking? Of all others nothing is known most of the time, and nothing is
    /// wrong with that.
    pub fn is_read(&self) -> bool {
        self.calculation.is_some() || self.access != Access::Write && self.poll != Poll::Never
    }

    /// Is it stored in the history?
    pub fn is_stored(&self) -> bool {
        self.store != StorePolicy::Never
    }

    /// The tags without which its value cannot be shown or evaluated.
    pub fn needs(&self) -> impl Iterator<Item = TagId> {
        let unit = self.unit_from.as_ref().map(|(tag, _)| *tag);
        let bounds = [self.min, self.max].map(|bound| bound.and_then(Bound::source));
        self.value_needs().chain(unit).chain(bounds.into_iter().flatten())
    }
    /// The tags without which its value is not known: decimals, quality and whether it is there.
    pub fn value_needs(&self) -> impl Iterator<Item = TagId> + use<> {
        let when = self.when.as_ref().map_or(Vec::new(), |when| when.tags());
        self.decimals.source().into_iter().chain(self.quality_from.map(|(tag, _)| tag)).chain(when)
    }
    /// Decimals that scale its raw number, as its device announces them, below 0 for a multiple of ten; 0 where the profile
    /// fixes them, `None` while they are not known.
    pub fn scaling_decimals<N: Into<Exact>>(&self, value: impl Fn(TagId) -> Option<N>) -> Option<i8> {
        let Some(source) = self.decimals.source() else { return Some(0) };
        value(source).and_then(|value| self.decimals.announced(value.into().near()))
    }
    /// Least and greatest value that may be written now; `Err` names a tag that one of them needs and that is not known.
    pub fn limits(&self, value: impl Fn(TagId) -> Option<Exact>) -> Result<(Option<Exact>, Option<Exact>), TagId> {
        let now = |bound: Option<Bound>| bound.map(|bound| bound.now(&value)).transpose();
        Ok((now(self.min)?, now(self.max)?))
    }
    /// May an operator write it?
    pub fn writable(&self) -> bool {
        self.access != Access::Read
    }
    /// Does it hold words instead of a number?
    pub fn is_text(&self) -> bool {
        self.point.kind.is_text()
    }
    /// Where and as what it is written.
    pub fn write_point(&self) -> Point {
        self.write_at.map_or(self.point, |(table, address)| Point { table, address, ..self.point })
    }
    /// The function code that it is written with: the profile's, else 5 or 6 for one bit or word, 16 for more.
    pub fn write_function(&self) -> Option<u8> {
        let point = self.write_point();
        let usual = match (point.table.is_bits(), point.words()) {
            (true, _) => 5,
            (false, 1) => 6,
            (false, _) => 16,
        };
        self.writable().then(|| self.write_fc.unwrap_or(usual))
    }
    /// The unit that it has now, which the device may choose (°C or °F).
    pub fn unit_now(&self, sample: impl Fn(TagId) -> Sample) -> &str {
        match (self.unit_by(|tag| sample(tag).value), sample(self.id).value) {
            (Some(unit), _) => unit,
            (None, Some(_)) => "?",
            (None, None) => &self.unit,
        }
    }
    /// The unit, as the device chooses it; `None` while its choice is not known.
    pub fn unit_by<N: Into<Exact>>(&self, value: impl Fn(TagId) -> Option<N>) -> Option<&str> {
        let Some((from, units)) = &self.unit_from else { return Some(&self.unit) };
        let chosen = value(*from)?.into();
        units.iter().find(|(number, _)| Exact::whole(*number) == chosen).map(|(_, unit)| unit.as_str())
    }
    /// The text of an enumeration's number.
    pub fn label_of(&self, value: impl Into<Exact>) -> Option<&str> {
        let value = value.into();
        self.enum_labels.iter().find(|(number, _)| Exact::whole(*number) == value).map(|(_, text)| text.as_str())
    }
    /// Does this raw number mean "no value"?
    pub fn is_bad(&self, raw: Exact) -> bool {
        self.bad_if.iter().any(|bad| bad.holds(raw))
    }
}

/// Where a value lives in its device: wire address, 0-based.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Point {
    /// Which of the four tables.
    pub table: Table,
    /// Address on the wire (PDU), 0-based.
    pub address: u16,
    /// Type of the raw value.
    pub kind: DataType,
    /// Byte and word order.
    pub order: ByteOrder,
    /// A field of bits inside a word: (lowest bit, number of bits). That of a signed type is signed.
    pub field: Option<(u8, u8)>,
}

impl Point {
    /// Registers (or bits, for the bit tables) that it takes.
    pub fn len(self) -> u16 {
        if self.table.is_bits() { 1 } else { self.kind.registers() }
    }
    /// Words of 16 bits that it has on the wire; one for a bit.
    pub fn words(self) -> u16 {
        if self.table.is_bits() { 1 } else { self.kind.words() }
    }
    /// The bits of its register that are its own, lowest and number; `None` where all are.
    pub fn part(self) -> Option<(u8, u8)> {
        self.field.or_else(|| self.kind.is_half().then(|| (0, self.kind.bits())))
    }
    /// Never empty; here because clippy and readers expect it beside `len`.
    pub fn is_empty(self) -> bool {
        false
    }
}

keyword_enum! {
    /// The four tables of Modbus.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
    pub enum Table: "table" {
        /// Read-write bits, FC 01 / 05 / 15.
        Coil => "coil",
        /// Read-only bits, FC 02.
        Discrete => "discrete",
        /// Read-only registers, FC 04.
        Input => "input",
        /// Read-write registers, FC 03 / 06 / 16.
        Holding => "holding",
    }
}

impl Table {
    /// `true` for coils and discrete inputs.
    pub fn is_bits(self) -> bool {
        matches!(self, Table::Coil | Table::Discrete)
    }
    /// The read function code.
    pub fn read_fc(self) -> u8 {
        match self {
            Table::Coil => 1,
            Table::Discrete => 2,
            Table::Holding => 3,
            Table::Input => 4,
        }
    }
    /// First digit of the Modicon number.
    pub fn digit(self) -> u8 {
        match self {
            Table::Coil => 0,
            Table::Discrete => 1,
            Table::Input => 3,
            Table::Holding => 4,
        }
    }
    /// The Modicon number of a wire address: five digits up to address 9998, else six.
    pub fn modicon(self, address: u16) -> String {
        let number = u32::from(address) + 1;
        if number <= 9_999 { format!("{}{number:04}", self.digit()) } else { format!("{}{number:05}", self.digit()) }
    }
}

keyword_enum! {
    /// What may be done with a tag.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
    pub enum Access: "access" {
        /// Read only.
        Read => "r",
        /// Read and write.
        ReadWrite => "rw",
        /// Write only: it has no value of its own.
        Write => "w",
    }
}

/// How often a tag is read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum Poll {
    /// On an absolute grid with this period.
    Every(Duration),
    /// When the device appears, and when asked for.
    Once,
    /// Never by itself.
    Never,
}

#[cfg(test)]
mod tests {
    use jiff::Timestamp;

    use super::*;
    use crate::plant::{
        fixture::{self, DP, PV},
        sample::Cause,
    };

    #[test]
    fn the_unit_is_what_the_device_says_that_it_counts_in() {
        let tag = fixture::plant().tags[PV.index()].clone();
        let units = vec![(0, "°F".to_owned()), (1, "°C".to_owned())];
        let tag = TagDef { unit: "°F".into(), unit_from: Some((DP, units)), ..tag };
        let good = |value: f64| Sample::good(value, Timestamp::UNIX_EPOCH);
        let never = Sample::bad(Cause::NotRead, Timestamp::UNIX_EPOCH);
        let unit = |said: Sample, own: Sample| tag.unit_now(|of| if of == DP { said } else { own }).to_owned();
        assert_eq!(unit(good(1.0), good(70.0)), "°C");
        assert_eq!(unit(good(0.0), good(70.0)), "°F");
        assert_eq!(unit(good(7.0), good(70.0)), "?", "a number that names no unit");
        assert_eq!(unit(never, good(70.0)), "?", "not said yet");
    }
}
