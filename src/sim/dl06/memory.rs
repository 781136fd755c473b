//! Memory of the DL06 at its Modbus addresses: bits in banks, words in V memory, and the bits once more as words.

use std::ops::Range;

use crate::sim::pdu::{Bits, Refusal};

/// Bits of one kind, sixteen to a word, lowest number in the lowest bit.
#[derive(Debug, Clone)]
pub struct Bank(Vec<u16>);

impl Bank {
    fn new(words: usize) -> Bank {
        Bank(vec![0; words])
    }

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
    /// X0–X777.
    pub x: Bank,
    /// Y0–Y777.
    pub y: Bank,
    /// C0–C1777.
    pub c: Bank,
    gx: Bank,
    gy: Bank,
    sp: Bank,
    s: Bank,
    t: Bank,
    ct: Bank,
    v: Vec<u16>,
}

/// The banks by name, so that one table serves bits and words.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Inputs.
    X,
    /// Outputs.
    Y,
    /// Control relays.
    C,
    /// Remote inputs.
    Gx,
    /// Remote outputs.
    Gy,
    /// Special relays.
    Sp,
    /// Stages.
    S,
    /// Timer bits.
    T,
    /// Counter bits.
    Ct,
}

/// Where a bank stands: first bit address with its table, first word in V memory, length in words, writable.
struct Place {
    kind: Kind,
    table: Bits,
    first_bit: u16,
    first_word: u16,
    words: u16,
    writable: bool,
}

const fn place(kind: Kind, table: Bits, first_bit: u16, first_word: u16, words: u16, writable: bool) -> Place {
    Place { kind, table, first_bit, first_word, words, writable }
}

/// DL06 user manual, 3rd edition, pages 4-12 to 4-15; V memory in octal as the manual has it.
const PLACES: &[Place] = &[
    place(Kind::Gx, Bits::Discretes, 0, 0o40000, 128, false),
    place(Kind::X, Bits::Discretes, 2048, 0o40400, 32, false),
    place(Kind::Sp, Bits::Discretes, 3072, 0o41200, 32, false),
    place(Kind::Gy, Bits::Coils, 0, 0o40200, 128, true),
    place(Kind::Y, Bits::Coils, 2048, 0o40500, 32, true),
    place(Kind::C, Bits::Coils, 3072, 0o40600, 64, true),
    place(Kind::S, Bits::Coils, 5120, 0o41000, 64, false),
    place(Kind::T, Bits::Coils, 6144, 0o41100, 16, false),
    place(Kind::Ct, Bits::Coils, 6400, 0o41140, 8, false),
];

/// V memory that holds words of its own, and whether it may be written. System parameters are left out on purpose.
const AREAS: &[(Range<u16>, bool)] = &[
    (0..0o400, false),
    (0o400..0o700, true),
    (0o1000..0o1200, false),
    (0o1200..0o7600, true),
    (0o10000..0o20000, true),
];

impl Memory {
    /// All off, all zero, but SP1, which is always on.
    pub fn new() -> Memory {
        let mut memory = Memory {
            x: Bank::new(32),
            y: Bank::new(32),
            c: Bank::new(64),
            gx: Bank::new(128),
            gy: Bank::new(128),
            sp: Bank::new(32),
            s: Bank::new(64),
            t: Bank::new(16),
            ct: Bank::new(8),
            v: vec![0; 0o20000],
        };
        memory.sp.set(1, true);
        memory
    }

    /// One bit by its wire address.
    pub fn bit(&self, table: Bits, address: u16) -> Result<bool, Refusal> {
        let (place, number) = find_bit(table, address)?;
        Ok(self.bank(place.kind).get(number))
    }

    /// Writes a coil by its wire address.
    pub fn write_coil(&mut self, address: u16, on: bool) -> Result<(), Refusal> {
        let (place, number) = find_bit(Bits::Coils, address)?;
        if !place.writable {
            return Err(Refusal::Address);
        }
        self.bank_mut(place.kind).set(number, on);
        Ok(())
    }

    /// One word by its wire address.
    pub fn word(&self, address: u16) -> Result<u16, Refusal> {
        match find_word(address)? {
            Word::Own { .. } => Ok(self.v[usize::from(address)]),
            Word::Bits { place, index } => Ok(self.bank(place.kind).0[index]),
        }
    }

    /// Writes a word by its wire address.
    pub fn write_word(&mut self, address: u16, value: u16) -> Result<(), Refusal> {
        match find_word(address)? {
            Word::Own { writable: true } => self.v[usize::from(address)] = value,
            Word::Bits { place, index } if place.writable => self.bank_mut(place.kind).0[index] = value,
            Word::Own { .. } | Word::Bits { .. } => return Err(Refusal::Address),
        }
        Ok(())
    }

    /// Writes consecutive words of V memory from inside, as the programme does; what falls outside is dropped.
    pub fn set_block(&mut self, first: u16, values: &[u16]) {
        for (word, value) in self.v.iter_mut().skip(usize::from(first)).zip(values) {
            *word = *value;
        }
    }

    fn bank(&self, kind: Kind) -> &Bank {
        match kind {
            Kind::X => &self.x,
            Kind::Y => &self.y,
            Kind::C => &self.c,
            Kind::Gx => &self.gx,
            Kind::Gy => &self.gy,
            Kind::Sp => &self.sp,
            Kind::S => &self.s,
            Kind::T => &self.t,
            Kind::Ct => &self.ct,
        }
    }

    fn bank_mut(&mut self, kind: Kind) -> &mut Bank {
        match kind {
            Kind::X => &mut self.x,
            Kind::Y => &mut self.y,
            Kind::C => &mut self.c,
            Kind::Gx => &mut self.gx,
            Kind::Gy => &mut self.gy,
            Kind::Sp => &mut self.sp,
            Kind::S => &mut self.s,
            Kind::T => &mut self.t,
            Kind::Ct => &mut self.ct,
        }
    }
}

/// What stands at a word address.
enum Word {
    Own { writable: bool },
    Bits { place: &'static Place, index: usize },
}

fn find_bit(table: Bits, address: u16) -> Result<(&'static Place, u16), Refusal> {
    let number = |place: &Place| address.checked_sub(place.first_bit).filter(|number| *number < place.words * 16);
    let mut places = PLACES.iter().filter(|place| place.table == table);
    places.find_map(|place| number(place).map(|number| (place, number))).ok_or(Refusal::Address)
}

fn find_word(address: u16) -> Result<Word, Refusal> {
    if let Some((_, writable)) = AREAS.iter().find(|(range, _)| range.contains(&address)) {
        return Ok(Word::Own { writable: *writable });
    }
    let index = |place: &Place| address.checked_sub(place.first_word).filter(|index| *index < place.words);
    let found = PLACES.iter().find_map(|place| index(place).map(|index| (place, usize::from(index))));
    found.map(|(place, index)| Word::Bits { place, index }).ok_or(Refusal::Address)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_stand_where_the_manual_says() {
        let check = |table, address, expect| {
            assert_eq!(find_bit(table, address).ok().map(|(place, number)| (place.kind, number)), expect, "{address}");
        };
        check(Bits::Coils, 2048, Some((Kind::Y, 0)));
        check(Bits::Coils, 2064, Some((Kind::Y, 0o20)));
        check(Bits::Coils, 3116, Some((Kind::C, 0o54)));
        check(Bits::Coils, 4095, Some((Kind::C, 0o1777)));
        check(Bits::Coils, 4096, None);
        check(Bits::Coils, 6527, Some((Kind::Ct, 0o177)));
        check(Bits::Coils, 6528, None);
        check(Bits::Discretes, 2063, Some((Kind::X, 0o17)));
        check(Bits::Discretes, 2067, Some((Kind::X, 0o23)));
        check(Bits::Discretes, 3150, Some((Kind::Sp, 0o116)));
        check(Bits::Discretes, 3584, None);
    }

    #[test]
    fn words_can_be_written_where_users_own_them() {
        let check = |address, expect: Result<bool, Refusal>| {
            let mut memory = Memory::new();
            let read = memory.word(address);
            assert_eq!(read.map(|_| memory.write_word(address, 1).is_ok()), expect, "V{address:o}");
        };
        check(0o0, Ok(false));
        check(0o377, Ok(false));
        check(0o400, Ok(true));
        check(0o700, Err(Refusal::Address));
        check(0o2000, Ok(true));
        check(0o7577, Ok(true));
        check(0o7655, Err(Refusal::Address));
        check(0o17777, Ok(true));
        check(0o20000, Err(Refusal::Address));
        check(0o40400, Ok(false));
        check(0o40500, Ok(true));
        check(0o40537, Ok(true));
        check(0o40540, Err(Refusal::Address));
        check(0o40677, Ok(true));
        check(0o41257, Err(Refusal::Address));
    }

    #[test]
    fn a_coil_and_its_word_are_one() {
        let mut memory = Memory::new();
        assert_eq!(memory.write_coil(2048 + 9, true), Ok(()));
        assert_eq!(memory.word(0o40500), Ok(0x0200));
        assert_eq!(memory.write_word(0o40600, 0x8001), Ok(()));
        assert_eq!([0, 1, 15].map(|relay| memory.c.get(relay)), [true, false, true]);
        assert_eq!(memory.write_coil(2048 + 9, false), Ok(()));
        assert_eq!(memory.word(0o40500), Ok(0));
        assert_eq!(memory.write_coil(5120, true), Err(Refusal::Address));
    }
}
