//! The types of raw values. A new type is a row here; the codec works by [`Encoding`] and size.

use std::fmt;

use serde::{Deserialize, Serialize};

use super::keyword::keyword_enum;

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
    /// No number.
    Text,
}

impl DataType {
    /// Every type that holds a number.
    pub const NUMBERS: [DataType; 11] = [
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
    ];
    /// Longest text, bytes: what one read of 125 registers holds.
    pub const TEXT_MAX: u8 = 250;

    /// Name in profiles, registers, encoding.
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
        }
    }

    /// The name in profiles, without the length of a text.
    pub fn name(self) -> &'static str {
        self.row().0
    }

    /// Registers it takes.
    pub fn registers(self) -> u16 {
        self.row().1
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
        let bits = 16 * u32::from(registers);
        match encoding {
            Encoding::Bit => Some((0, 1)),
            Encoding::Unsigned => Some((0, (1 << bits) - 1)),
            Encoding::Signed => Some((-(1 << (bits - 1)), (1 << (bits - 1)) - 1)),
            Encoding::Bcd => Some((0, 10i128.pow(bits / 4) - 1)),
            Encoding::Float | Encoding::Text => None,
        }
    }
}

/// As a profile writes it: `int16`, `string(8)`.
impl fmt::Display for DataType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            DataType::Text(bytes) => write!(f, "string({bytes})"),
            _ => f.write_str(self.name()),
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
