//! Memory of the DL06 at its Modbus addresses: bits in banks, words in V memory, and the bits once more as words.

use std::ops::Range;

use crate::plant::{fault::ExceptionCode, tag::Table};

/// Bits of one kind, sixteen to a word, lowest number in the lowest bit.
#[derive(Debug, Clone)]
pub struct Bank(Vec<u16>);

impl Bank {
    /// One bit; `false` beyond the end.
    pub fn get(&self, number: u16) -> bool {
        self.0.get(usize::from(number / 16)).is_some_and(|word| word >> (number % 16) & 1 == 1)
    }

    /// Sets one bit; nothing happens beyond the end.
    pub fn set(&mut self, number: u16, on: bool) {
        if let Some(word) = self.0.get_mut(usize::from(number / 16)) {
            *word = *word & !(1 << (number % 16)) | u16::from(on) << (number % 16);
        }
    }
}

/// Everything a master can reach.
#[derive(Debug, Clone)]
pub struct Memory {
    /// In the order of [`BANKS`].
    banks: [Bank; 9],
    v: Vec<u16>,
}

/// The banks by name, in the order of [`BANKS`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Remote inputs.
    Gx,
    /// Inputs.
    X,
    /// Special relays.
    Sp,
    /// Remote outputs.
    Gy,
    /// Outputs.
    Y,
    /// Control relays.
    C,
    /// Stages.
    S,
    /// Timer bits.
    T,
    /// Counter bits.
    Ct,
}

/// Where a bank stands: first bit address with its table, first word in V memory, length in words, writable.
struct BankLayout {
    kind: Kind,
    table: Table,
    first_bit: u16,
    first_word: u16,
    words: u16,
    writable: bool,
}

const fn layout(kind: Kind, table: Table, first_bit: u16, first_word: u16, words: u16, writable: bool) -> BankLayout {
    BankLayout { kind, table, first_bit, first_word, words, writable }
}

/// DL06 user manual, 3rd edition, pages 4-12 to 4-15; V memory in octal as the manual has it.
static BANKS: [BankLayout; 9] = [
    layout(Kind::Gx, Table::Discrete, 0, 0o40000, 128, false),
    layout(Kind::X, Table::Discrete, 2048, 0o40400, 32, false),
    layout(Kind::Sp, Table::Discrete, 3072, 0o41200, 32, false),
    layout(Kind::Gy, Table::Coil, 0, 0o40200, 128, true),
    layout(Kind::Y, Table::Coil, 2048, 0o40500, 32, true),
    layout(Kind::C, Table::Coil, 3072, 0o40600, 64, true),
    layout(Kind::S, Table::Coil, 5120, 0o41000, 64, false),
    layout(Kind::T, Table::Coil, 6144, 0o41100, 16, false),
    layout(Kind::Ct, Table::Coil, 6400, 0o41140, 8, false),
];

/// V memory that holds words of its own, and whether it may be written. Of the system parameters those of port 2 are there, which
/// the profile names; the others are left out on purpose.
const AREAS: &[(Range<u16>, bool)] = &[
    (0..0o400, false),
    (0o400..0o700, true),
    (0o1000..0o1200, false),
    (0o1200..0o7600, true),
    (0o7655..0o7657, false),
    (0o10000..0o20000, true),
];

impl Memory {
    /// All off, all zero, but SP1, which is always on.
    pub fn new() -> Memory {
        let banks = BANKS.each_ref().map(|layout| Bank(vec![0; usize::from(layout.words)]));
        let mut memory = Memory { banks, v: vec![0; 0o20000] };
        memory.bank_mut(Kind::Sp).set(1, true);
        memory
    }

    /// One bit by its wire address.
    pub fn bit(&self, table: Table, address: u16) -> Result<bool, ExceptionCode> {
        let (layout, number) = find_bit(table, address)?;
        Ok(self.bank(layout.kind).get(number))
    }

    /// Writes a coil by its wire address.
    pub fn write_coil(&mut self, address: u16, on: bool) -> Result<(), ExceptionCode> {
        let (layout, number) = find_bit(Table::Coil, address)?;
        if !layout.writable {
            return Err(ExceptionCode::ILLEGAL_ADDRESS);
        }
        self.bank_mut(layout.kind).set(number, on);
        Ok(())
    }

    /// One word by its wire address.
    pub fn word(&self, address: u16) -> Result<u16, ExceptionCode> {
        match find_word(address)? {
            Word::Own { .. } => Ok(self.v[usize::from(address)]),
            Word::Bits { layout, index } => Ok(self.bank(layout.kind).0[index]),
        }
    }

    /// Writes a word by its wire address.
    pub fn write_word(&mut self, address: u16, value: u16) -> Result<(), ExceptionCode> {
        match find_word(address)? {
            Word::Own { writable: true } => self.v[usize::from(address)] = value,
            Word::Bits { layout, index } if layout.writable => self.bank_mut(layout.kind).0[index] = value,
            Word::Own { .. } | Word::Bits { .. } => return Err(ExceptionCode::ILLEGAL_ADDRESS),
        }
        Ok(())
    }

    /// Writes consecutive words of V memory from inside, as the programme does; what falls outside is dropped.
    pub fn set_block(&mut self, first: u16, values: &[u16]) {
        for (word, value) in self.v.iter_mut().skip(usize::from(first)).zip(values) {
            *word = *value;
        }
    }

    /// The bits of one kind.
    pub fn bank(&self, kind: Kind) -> &Bank {
        &self.banks[kind as usize]
    }

    /// The bits of one kind, to set them.
    pub fn bank_mut(&mut self, kind: Kind) -> &mut Bank {
        &mut self.banks[kind as usize]
    }
}

/// What stands at a word address.
enum Word {
    Own { writable: bool },
    Bits { layout: &'static BankLayout, index: usize },
}

fn find_bit(table: Table, address: u16) -> Result<(&'static BankLayout, u16), ExceptionCode> {
    let number =
        |layout: &BankLayout| address.checked_sub(layout.first_bit).filter(|number| *number < layout.words * 16);
    let mut layouts = BANKS.iter().filter(|layout| layout.table == table);
    layouts.find_map(|layout| number(layout).map(|number| (layout, number))).ok_or(ExceptionCode::ILLEGAL_ADDRESS)
}

fn find_word(address: u16) -> Result<Word, ExceptionCode> {
    if let Some((_, writable)) = AREAS.iter().find(|(range, _)| range.contains(&address)) {
        return Ok(Word::Own { writable: *writable });
    }
    let index = |layout: &BankLayout| address.checked_sub(layout.first_word).filter(|index| *index < layout.words);
    let found = BANKS.iter().find_map(|layout| index(layout).map(|index| (layout, usize::from(index))));
    found.map(|(layout, index)| Word::Bits { layout, index }).ok_or(ExceptionCode::ILLEGAL_ADDRESS)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_bank_has_the_place_of_its_kind() {
        assert!(BANKS.iter().enumerate().all(|(index, layout)| layout.kind as usize == index));
    }

    #[test]
    fn bits_stand_where_the_manual_says() {
        let check = |table, address, expect| {
            assert_eq!(
                find_bit(table, address).ok().map(|(layout, number)| (layout.kind, number)),
                expect,
                "{address}"
            );
        };
        check(Table::Coil, 2048, Some((Kind::Y, 0)));
        check(Table::Coil, 2064, Some((Kind::Y, 0o20)));
        check(Table::Coil, 3116, Some((Kind::C, 0o54)));
        check(Table::Coil, 4095, Some((Kind::C, 0o1777)));
        check(Table::Coil, 4096, None);
        check(Table::Coil, 6527, Some((Kind::Ct, 0o177)));
        check(Table::Coil, 6528, None);
        check(Table::Discrete, 2063, Some((Kind::X, 0o17)));
        check(Table::Discrete, 2067, Some((Kind::X, 0o23)));
        check(Table::Discrete, 3150, Some((Kind::Sp, 0o116)));
        check(Table::Discrete, 3584, None);
    }

    #[test]
    fn words_can_be_written_where_users_own_them() {
        let check = |address, expect: Result<bool, ExceptionCode>| {
            let mut memory = Memory::new();
            let read = memory.word(address);
            assert_eq!(read.map(|_| memory.write_word(address, 1).is_ok()), expect, "V{address:o}");
        };
        check(0o0, Ok(false));
        check(0o377, Ok(false));
        check(0o400, Ok(true));
        check(0o700, Err(ExceptionCode::ILLEGAL_ADDRESS));
        check(0o2000, Ok(true));
        check(0o7577, Ok(true));
        check(0o7654, Err(ExceptionCode::ILLEGAL_ADDRESS));
        check(0o7655, Ok(false));
        check(0o7656, Ok(false));
        check(0o7657, Err(ExceptionCode::ILLEGAL_ADDRESS));
        check(0o17777, Ok(true));
        check(0o20000, Err(ExceptionCode::ILLEGAL_ADDRESS));
        check(0o40400, Ok(false));
        check(0o40500, Ok(true));
        check(0o40537, Ok(true));
        check(0o40540, Err(ExceptionCode::ILLEGAL_ADDRESS));
        check(0o40677, Ok(true));
        check(0o41257, Err(ExceptionCode::ILLEGAL_ADDRESS));
    }

    #[test]
    fn a_coil_and_its_word_are_one() {
        let mut memory = Memory::new();
        assert_eq!(memory.write_coil(2048 + 9, true), Ok(()));
        assert_eq!(memory.word(0o40500), Ok(0x0200));
        assert_eq!(memory.write_word(0o40600, 0x8001), Ok(()));
        assert_eq!([0, 1, 15].map(|relay| memory.bank(Kind::C).get(relay)), [true, false, true]);
        assert_eq!(memory.write_coil(2048 + 9, false), Ok(()));
        assert_eq!(memory.word(0o40500), Ok(0));
        assert_eq!(memory.write_coil(5120, true), Err(ExceptionCode::ILLEGAL_ADDRESS));
    }
}
