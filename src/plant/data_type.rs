//! The types of raw values. A new type is a row here; the codec works by [`Encoding`] and size.

use std::{fmt, str::FromStr};

use serde::{Deserialize, Serialize};

use super::{keyword::keyword_enum, number::to_u8};

/// Type of a raw value.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum DataType {
    /// One bit of a bit table, or a whole register that is not 0.
    Bool,
    /// 16 bits, two's complement.
    I16,
    /// 16 bits.
    U16,
    /// 32 bits, two's complement.
    I32,
    /// 32 bits.
    U32,
    /// 64 bits, two's complement.
    I64,
    /// 64 bits.
    U64,
    /// IEEE 754 single.
    F32,
    /// IEEE 754 double.
    F64,
    /// Four decimal digits.
    Bcd16,
    /// Eight decimal digits.
    Bcd32,
    /// This many bytes of text, two a register. It has no number: see [`super::snapshot::Snapshot::text`].
    Text(u8),
    /// 8 bits, two's complement: the low byte of a register, in the order BADC the high one. The other byte is not its own.
    I8,
    /// 8 bits, the same.
    U8,
    /// 24 bits, two's complement, in two registers whose upper byte only repeats the sign, or is 0.
    I24,
    /// 24 bits in two registers whose upper byte is 0.
    U24,
    /// 48 bits, two's complement.
    I48,
    /// 48 bits.
    U48,
    /// IEEE 754 half.
    F16,
    /// A sign bit and 15 bits.
    Sm16,
    /// A sign bit and 31 bits.
    Sm32,
    /// So many registers of four decimal digits each, 0 to 9999 in binary.
    Mod10k(u8),
    /// The same with a sign that all registers have, -9999 to 9999.
    SignedMod10k(u8),
    /// So many bytes of text that ends at the first NUL; what follows is none of it.
    TextToNul(u8),
    /// So many characters of text, one in each register: in its low byte, in the order BADC in the high one.
    Chars(u8),
    /// Date and time, shown as text.
    Clock(Clock),
    /// So many registers of four hexadecimal digits each, as versions are written: `1.0.A.2`.
    Version(u8),
    /// An address in a network, shown as text.
    NetworkAddress(NetworkAddress),
    /// 32 bits in one address, as Enron and Daniel count: two's complement.
    EnronI32,
    /// 32 bits in one address.
    EnronU32,
    /// IEEE 754 single in one address.
    EnronF32,
}

keyword_enum! {
    /// How a device keeps an address.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
    pub enum NetworkAddress: "network address" {
        /// Of an Ethernet port, in the lower six bytes of four registers.
        Eui48 => "eui48",
        /// Two registers.
        Ipv4 => "ipv4",
        /// Eight registers.
        Ipv6 => "ipv6",
    }
}

impl NetworkAddress {
    fn registers(self) -> u16 {
        match self {
            NetworkAddress::Eui48 => 4,
            NetworkAddress::Ipv4 => 2,
            NetworkAddress::Ipv6 => 8,
        }
    }
}

/// How a device keeps date and time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Clock {
    /// Seconds since 1970 in 32 bits, UTC.
    Epoch,
    /// Year, month, day, hour, minute, second, a register each.
    Words,
    /// The same in bytes, year since 2000, in three registers.
    Bytes,
    /// The same with two decimal digits a byte.
    Bcd,
    /// Hour times 100 and minute, as `2359`.
    TimeDecimal,
    /// Hour and minute, a byte each.
    TimeBytes,
    /// The same with two decimal digits a byte.
    TimeBcd,
    /// The same, a register each.
    TimeWords,
}

impl Clock {
    /// All of them.
    pub const ALL: [Clock; 8] = [
        Clock::Epoch,
        Clock::Words,
        Clock::Bytes,
        Clock::Bcd,
        Clock::TimeDecimal,
        Clock::TimeBytes,
        Clock::TimeBcd,
        Clock::TimeWords,
    ];

    /// Name in profiles and registers.
    fn row(self) -> (&'static str, u16) {
        match self {
            Clock::Epoch => ("epoch32", 2),
            Clock::Words => ("clock_words", 6),
            Clock::Bytes => ("clock_bytes", 3),
            Clock::Bcd => ("clock_bcd", 3),
            Clock::TimeDecimal => ("time_decimal", 1),
            Clock::TimeBytes => ("time_bytes", 1),
            Clock::TimeBcd => ("time_bcd", 1),
            Clock::TimeWords => ("time_words", 2),
        }
    }
}

/// How the bits of a raw value make a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Encoding {
    /// 0 or 1.
    Bit,
    /// No sign.
    Unsigned,
    /// Two's complement.
    Signed,
    /// Four bits a decimal digit.
    Bcd,
    /// IEEE 754, single or double by size.
    Float,
    /// A sign bit and a size.
    SignMagnitude,
    /// Registers of four decimal digits in binary.
    Mod10k,
    /// No number.
    Text,
}

impl DataType {
    /// Every type that holds a number.
    pub const NUMBERS: [DataType; 29] = [
        DataType::I16,
        DataType::U16,
        DataType::I32,
        DataType::U32,
        DataType::I64,
        DataType::U64,
        DataType::F32,
        DataType::F64,
        DataType::Bcd16,
        DataType::Bcd32,
        DataType::Bool,
        DataType::I8,
        DataType::U8,
        DataType::I24,
        DataType::U24,
        DataType::I48,
        DataType::U48,
        DataType::F16,
        DataType::Sm16,
        DataType::Sm32,
        DataType::Mod10k(2),
        DataType::Mod10k(3),
        DataType::Mod10k(4),
        DataType::SignedMod10k(2),
        DataType::SignedMod10k(3),
        DataType::SignedMod10k(4),
        DataType::EnronI32,
        DataType::EnronU32,
        DataType::EnronF32,
    ];
    /// Longest text, bytes: what one read of 125 registers holds.
    pub const TEXT_MAX: u8 = 250;
    /// Most registers of one character, or one version, each: what one read holds.
    pub const CHARS_MAX: u8 = 125;

    /// Name in profiles, words of 16 bits, encoding.
    fn row(self) -> (&'static str, u16, Encoding) {
        match self {
            DataType::Bool => ("bool", 1, Encoding::Bit),
            DataType::I16 => ("int16", 1, Encoding::Signed),
            DataType::U16 => ("uint16", 1, Encoding::Unsigned),
            DataType::I32 => ("int32", 2, Encoding::Signed),
            DataType::U32 => ("uint32", 2, Encoding::Unsigned),
            DataType::I64 => ("int64", 4, Encoding::Signed),
            DataType::U64 => ("uint64", 4, Encoding::Unsigned),
            DataType::F32 => ("float32", 2, Encoding::Float),
            DataType::F64 => ("float64", 4, Encoding::Float),
            DataType::Bcd16 => ("bcd16", 1, Encoding::Bcd),
            DataType::Bcd32 => ("bcd32", 2, Encoding::Bcd),
            DataType::Text(bytes) => ("string", u16::from(bytes).div_ceil(2), Encoding::Text),
            DataType::I8 => ("int8", 1, Encoding::Signed),
            DataType::U8 => ("uint8", 1, Encoding::Unsigned),
            DataType::I24 => ("int24", 2, Encoding::Signed),
            DataType::U24 => ("uint24", 2, Encoding::Unsigned),
            DataType::I48 => ("int48", 3, Encoding::Signed),
            DataType::U48 => ("uint48", 3, Encoding::Unsigned),
            DataType::F16 => ("float16", 1, Encoding::Float),
            DataType::Sm16 => ("sm16", 1, Encoding::SignMagnitude),
            DataType::Sm32 => ("sm32", 2, Encoding::SignMagnitude),
            DataType::Mod10k(registers) => ("mod10k", registers.into(), Encoding::Mod10k),
            DataType::SignedMod10k(registers) => ("smod10k", registers.into(), Encoding::Mod10k),
            DataType::TextToNul(bytes) => ("cstring", u16::from(bytes).div_ceil(2), Encoding::Text),
            DataType::Chars(registers) => ("chars", registers.into(), Encoding::Text),
            DataType::Clock(clock) => {
                let (name, registers) = clock.row();
                (name, registers, Encoding::Text)
            }
            DataType::Version(registers) => ("version", registers.into(), Encoding::Text),
            DataType::NetworkAddress(address) => (address.word(), address.registers(), Encoding::Text),
            DataType::EnronI32 => ("enron_int32", 2, Encoding::Signed),
            DataType::EnronU32 => ("enron_uint32", 2, Encoding::Unsigned),
            DataType::EnronF32 => ("enron_float32", 2, Encoding::Float),
        }
    }

    /// The name in profiles, without its length.
    pub fn name(self) -> &'static str {
        self.row().0
    }

    /// Addresses it takes.
    pub fn registers(self) -> u16 {
        self.words() / self.address_words()
    }

    /// Words of 16 bits that it has on the wire.
    pub fn words(self) -> u16 {
        self.row().1
    }

    /// Words that each of its addresses holds: two where a device has 32 bits in one.
    pub fn address_words(self) -> u16 {
        if let DataType::EnronI32 | DataType::EnronU32 | DataType::EnronF32 = self { 2 } else { 1 }
    }

    /// Bits of the value: those of its registers, or fewer.
    pub fn bits(self) -> u8 {
        match self {
            DataType::I24 | DataType::U24 => 24,
            kind => to_u8(if kind.is_half() { 8 } else { 16 * kind.words() }),
        }
    }

    /// Is it one byte of a register, so that the other is something else?
    pub fn is_half(self) -> bool {
        matches!(self, DataType::I8 | DataType::U8)
    }

    /// Does it hold words instead of a number?
    pub fn is_text(self) -> bool {
        self.encoding() == Encoding::Text
    }

    /// Is it a text of which the words may come in the other order?
    pub fn is_reversible(self) -> bool {
        matches!(self, DataType::Clock(Clock::Epoch) | DataType::Version(_) | DataType::NetworkAddress(_))
    }

    /// The number that stands behind its name: bytes or characters of a text, registers.
    pub fn length(self) -> Option<u8> {
        match self {
            DataType::Text(length)
            | DataType::TextToNul(length)
            | DataType::Chars(length)
            | DataType::Version(length)
            | DataType::Mod10k(length)
            | DataType::SignedMod10k(length) => Some(length),
            _ => None,
        }
    }

    /// How its bits make a number.
    pub fn encoding(self) -> Encoding {
        self.row().2
    }

    /// A whole number of single bits: a bit field can be cut out of it.
    pub fn is_binary(self) -> bool {
        matches!(self.encoding(), Encoding::Unsigned | Encoding::Signed)
    }

    /// Lowest and highest whole number that it holds; `None` for floats and texts.
    pub fn whole_range(self) -> Option<(i128, i128)> {
        let (_, registers, encoding) = self.row();
        let bits = u32::from(self.bits());
        match encoding {
            Encoding::Bit => Some((0, 1)),
            Encoding::Unsigned => Some((0, (1 << bits) - 1)),
            Encoding::Signed => Some((-(1 << (bits - 1)), (1 << (bits - 1)) - 1)),
            Encoding::Bcd => Some((0, 10i128.pow(bits / 4) - 1)),
            Encoding::SignMagnitude => Some((1 - (1 << (bits - 1)), (1 << (bits - 1)) - 1)),
            Encoding::Mod10k => {
                let most = 10_000_i128.pow(registers.into()) - 1;
                Some((if let DataType::SignedMod10k(_) = self { -most } else { 0 }, most))
            }
            Encoding::Float | Encoding::Text => None,
        }
    }
}

/// A type as a profile writes it: `int16`, `string(8)`.
impl FromStr for DataType {
    type Err = UnknownType;

    fn from_str(word: &str) -> Result<DataType, UnknownType> {
        if let Some(kind) = DataType::NUMBERS.into_iter().find(|kind| kind.to_string() == word) {
            return Ok(kind);
        }
        if let Some(clock) = Clock::ALL.into_iter().find(|clock| clock.row().0 == word) {
            return Ok(DataType::Clock(clock));
        }
        if let Some(address) = NetworkAddress::ALL.iter().find(|address| address.word() == word) {
            return Ok(DataType::NetworkAddress(*address));
        }
        let (name, rest) = word.split_at(word.find('(').unwrap_or(word.len()));
        let texts: [fn(u8) -> DataType; 4] = [DataType::Text, DataType::TextToNul, DataType::Chars, DataType::Version];
        let of_length = texts.into_iter().find(|of| of(1).name() == name).ok_or(UnknownType::Name)?;
        let most = match of_length(1) {
            DataType::Chars(_) | DataType::Version(_) => DataType::CHARS_MAX,
            _ => DataType::TEXT_MAX,
        };
        let length = rest.strip_prefix('(').and_then(|rest| rest.strip_suffix(')')?.trim().parse().ok());
        length.filter(|length| (1..=most).contains(length)).map(of_length).ok_or(UnknownType::Length(most))
    }
}

/// Why a word is no type.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum UnknownType {
    /// There is no such type.
    Name,
    /// A text without its length, at most this.
    Length(u8),
}

/// As a profile writes it: `int16`, `string(8)`.
impl fmt::Display for DataType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.length() {
            Some(length) => write!(f, "{}({length})", self.name()),
            None => f.write_str(self.name()),
        }
    }
}

keyword_enum! {
    /// Sequence of the bytes A B C D (A most significant) on the wire.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
    pub enum ByteOrder: "order" {
        /// Big-endian, the default of the Modbus world.
        #[default]
        Abcd => "ABCD",
        /// Low word first (DirectLOGIC).
        Cdab => "CDAB",
        /// Bytes swapped inside words.
        Badc => "BADC",
        /// Little-endian.
        Dcba => "DCBA",
    }
}
