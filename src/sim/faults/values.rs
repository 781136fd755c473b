//! Faults inside good answers: what a unit has measured stays, comes torn, in the wrong order, or as its mark of no sensor.

use std::collections::BTreeMap;

use super::syntax::{InjectedFault, ValueFault};
use crate::{
    bus::{codec, pdu},
    plant::{
        PlantDef,
        def::DeviceDef,
        number::to_u16,
        tag::{Access, Point, Table, TagDef},
    },
};

/// The measured values of a unit: what can be wrong inside its answers.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Values {
    /// Where read-only values stand.
    measured: Vec<Point>,
    /// Where 32-bit values stand.
    pairs: Vec<Point>,
    /// What stands where the sensor is broken, for units that have a mark for it.
    marks: Vec<(Point, Vec<u16>)>,
}

/// What a unit has answered, as far as a fault needs it.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct AnswerMemory {
    /// The first answer since values are stuck, by table and address.
    held: BTreeMap<(Table, u16), u16>,
    /// The answer before this one, by table and address.
    before: BTreeMap<(Table, u16), u16>,
}

impl Values {
    /// Those of one device of a plant.
    pub fn of_device(def: &PlantDef, device: &DeviceDef) -> Values {
        Values::of_tags(def.tags_of(device.id))
    }

    /// Those of one tag only.
    pub fn of_tags<'a>(tags: impl Iterator<Item = &'a TagDef>) -> Values {
        let mut values = Values::default();
        for tag in tags {
            if tag.access == Access::Read {
                values.measured.push(tag.point);
            }
            if !tag.point.table.is_bits() && tag.point.len() == 2 {
                values.pairs.push(tag.point);
            }
            let mark = tag.bad_if.first().and_then(|mark| codec::encode(tag.point, mark.first));
            values.marks.extend(mark.map(|words| (tag.point, words)));
        }
        values
    }

    /// Whether a fault can be there: torn values need 32 bits, a burnt-out sensor its mark.
    pub fn can_have(&self, fault: ValueFault) -> bool {
        match fault {
            ValueFault::Stuck => !self.measured.is_empty(),
            ValueFault::Torn | ValueFault::WordOrder => !self.pairs.is_empty(),
            ValueFault::SensorBurnout => !self.marks.is_empty(),
        }
    }

    /// The answer with what these faults make of it. `request` and `answer` are PDUs; what is no read of the four tables
    /// passes as it is.
    pub fn corrupt(
        &self,
        faults: &[InjectedFault],
        memory: &mut AnswerMemory,
        request: &[u8],
        answer: Vec<u8>,
    ) -> Vec<u8> {
        let Some(mut cells) = Cells::parse(request, &answer) else { return answer };
        let now = cells.clone();
        for fault in faults.iter().filter_map(|fault| fault.of_values()) {
            match fault {
                ValueFault::Stuck => self.hold(&mut cells, memory),
                ValueFault::Torn => self.tear(&mut cells, &now, memory),
                ValueFault::WordOrder => self.swap(&mut cells),
                ValueFault::SensorBurnout => self.mark(&mut cells),
            }
        }
        memory.before.extend(now.each());
        cells.into_answer(answer)
    }

    fn hold(&self, cells: &mut Cells, memory: &mut AnswerMemory) {
        for at in self.measured.iter().flat_map(|point| words_of(*point)) {
            if let Some(cell) = cells.get(at) {
                *cell = *memory.held.entry(at).or_insert(*cell);
            }
        }
    }

    fn tear(&self, cells: &mut Cells, now: &Cells, memory: &AnswerMemory) {
        for point in &self.pairs {
            let second = (point.table, point.address.wrapping_add(1));
            let whole = now.has((point.table, point.address));
            if let (true, Some(cell), Some(old)) = (whole, cells.get(second), memory.before.get(&second)) {
                *cell = *old;
            }
        }
    }

    fn swap(&self, cells: &mut Cells) {
        for point in &self.pairs {
            let (first, second) = ((point.table, point.address), (point.table, point.address.wrapping_add(1)));
            if let (Some(one), Some(two)) = (cells.get(first).copied(), cells.get(second).copied()) {
                cells.set(first, two);
                cells.set(second, one);
            }
        }
    }

    fn mark(&self, cells: &mut Cells) {
        for (point, words) in &self.marks {
            for (at, word) in words_of(*point).zip(words) {
                cells.set(at, *word);
            }
        }
    }
}

impl AnswerMemory {
    /// Forgets what was held: the next answer is the one that stays.
    pub fn let_go(&mut self) {
        self.held.clear();
    }
}

fn words_of(point: Point) -> impl Iterator<Item = (Table, u16)> {
    (0..point.len()).map(move |word| (point.table, point.address.wrapping_add(word)))
}

/// The words, or bits, of an answer with their addresses.
#[derive(Debug, Clone)]
struct Cells {
    table: Table,
    first: u16,
    cells: Vec<u16>,
}

impl Cells {
    /// Of an answer that fits its request to read; `None` for any other exchange.
    fn parse(request: &[u8], answer: &[u8]) -> Option<Cells> {
        let (table, first, cells) = pdu::values_read(request, answer)?;
        Some(Cells { table, first, cells })
    }

    fn place(&self, (table, address): (Table, u16)) -> Option<usize> {
        let place = usize::from(address.checked_sub(self.first)?);
        (table == self.table && place < self.cells.len()).then_some(place)
    }

    fn has(&self, at: (Table, u16)) -> bool {
        self.place(at).is_some()
    }

    fn get(&mut self, at: (Table, u16)) -> Option<&mut u16> {
        self.place(at).map(|place| &mut self.cells[place])
    }

    fn set(&mut self, at: (Table, u16), word: u16) {
        if let Some(cell) = self.get(at) {
            *cell = word;
        }
    }

    fn each(&self) -> impl Iterator<Item = ((Table, u16), u16)> {
        self.cells.iter().enumerate().map(|(n, cell)| ((self.table, self.first.wrapping_add(to_u16(n))), *cell))
    }

    fn into_answer(self, mut answer: Vec<u8>) -> Vec<u8> {
        if self.table.is_bits() {
            for (bit, cell) in self.cells.iter().enumerate() {
                let mask = 1 << (bit % 8);
                let byte = &mut answer[2 + bit / 8];
                *byte = if *cell == 0 { *byte & !mask } else { *byte | mask };
            }
        } else {
            answer.truncate(2);
            answer.extend(self.cells.iter().flat_map(|word| word.to_be_bytes()));
        }
        answer
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::plant::{
        def::{DeviceId, TagId},
        tag::{ByteOrder, DataType},
    };

    fn tag(table: Table, address: u16, kind: DataType, access: Access) -> TagDef {
        let point = Point { table, address, kind, order: ByteOrder::Abcd, field: None };
        TagDef { access, bad_if: vec![32_767.0.into()], ..TagDef::new(TagId(0), DeviceId(0), "D-1.T", point) }
    }

    /// A float at 10, a setpoint at 12, a sensor at 13, all in one block, and a measured bit.
    fn values() -> Values {
        let tags = [
            TagDef { bad_if: Vec::new(), ..tag(Table::Holding, 10, DataType::F32, Access::Read) },
            TagDef { bad_if: Vec::new(), ..tag(Table::Holding, 12, DataType::U16, Access::ReadWrite) },
            tag(Table::Holding, 13, DataType::I16, Access::Read),
            TagDef { bad_if: Vec::new(), ..tag(Table::Discrete, 0, DataType::Bool, Access::Read) },
        ];
        Values::of_tags(tags.iter())
    }

    const READ: [u8; 5] = [3, 0, 10, 0, 4];

    fn answer(words: [u16; 4]) -> Vec<u8> {
        [3, 8].into_iter().chain(words.iter().flat_map(|word| word.to_be_bytes())).collect()
    }

    fn check(fault: InjectedFault, expect: [u16; 4]) {
        let mut memory = AnswerMemory::default();
        let before = values().corrupt(&[fault], &mut memory, &READ, answer([0x428B, 0xFAE1, 500, 270]));
        assert_eq!(before.len(), 10);
        let now = values().corrupt(&[fault], &mut memory, &READ, answer([0x428C, 0x0A3D, 700, 280]));
        assert_eq!(now, answer(expect), "{fault}");
    }

    #[test]
    fn what_the_second_answer_holds_under_each_fault() {
        // What is set stays true while what is measured is stuck.
        check(InjectedFault::Stuck, [0x428B, 0xFAE1, 700, 270]);
        check(InjectedFault::Torn, [0x428C, 0xFAE1, 700, 280]);
        check(InjectedFault::WordOrder, [0x0A3D, 0x428C, 700, 280]);
        check(InjectedFault::SensorBurnout, [0x428C, 0x0A3D, 700, 0x7FFF]);
        check(InjectedFault::Silent, [0x428C, 0x0A3D, 700, 280]);
    }

    #[test]
    fn bits_are_stuck_as_well_and_let_go() {
        let (values, mut memory) = (values(), AnswerMemory::default());
        let read = |memory: &mut AnswerMemory, bit| {
            values.corrupt(&[InjectedFault::Stuck], memory, &[2, 0, 0, 0, 2], vec![2, 1, bit])
        };
        assert_eq!(read(&mut memory, 0b01), [2, 1, 0b01]);
        assert_eq!(read(&mut memory, 0b10), [2, 1, 0b11], "the second bit is no tag and moves");
        memory.let_go();
        assert_eq!(read(&mut memory, 0b00), [2, 1, 0b00]);
    }

    #[test]
    fn a_fault_is_offered_where_it_can_be() {
        let can = |values: &Values| {
            InjectedFault::all().filter_map(InjectedFault::of_values).filter(|fault| values.can_have(*fault)).count()
        };
        assert_eq!((can(&values()), can(&Values::default())), (4, 0));
    }

    proptest! {
        #[test]
        fn no_exchange_breaks_it_and_refusals_pass(
            request in prop::collection::vec(any::<u8>(), 0..8),
            answer in prop::collection::vec(any::<u8>(), 0..12),
        ) {
            let mut memory = AnswerMemory::default();
            let corrupt = values().corrupt(&InjectedFault::all().collect::<Vec<_>>(), &mut memory, &request, answer.clone());
            prop_assert_eq!(corrupt.len(), answer.len());
            if answer.first().is_some_and(|function| *function >= 0x80) {
                prop_assert_eq!(corrupt, answer);
            }
        }
    }
}
