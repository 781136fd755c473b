//! Which type two registers are likely of, by their values and by how they change together.

use super::cells::Cells;
use crate::{
    bus::interpret::{float_orders, number},
    plant::{
        exact::Exact,
        number::to_f32,
        tag::{ByteOrder, DataType, Table},
    },
};

/// A larger part of its value than this a measured value does not change by between two reads.
const STEP_MAX: f64 = 0.05;
/// A 16-bit value of a process does not jump so far between two reads; the lower half of a float does.
const JUMP: u16 = 0x1000;
/// A value that does not change is a float only if it was entered by a person: with this many digits at most.
const DIGITS_MAX: usize = 5;
/// Registers to either side that are looked at.
const RUN_MAX: usize = 40;
/// A counter has risen so often before it is called one.
const RISES_MIN: usize = 3;

impl Cells {
    /// The likely type that is shown at a register: of two that share a register only one can be.
    pub fn marked(&self, table: Table, address: u16) -> Option<(DataType, ByteOrder)> {
        let likely = |address: &u16| self.likely(table, *address).map(|of| (*address, of));
        let before = (0..address).rev().map_while(|address| likely(&address)).take(RUN_MAX);
        let behind = (address..=u16::MAX).map_while(|address| likely(&address)).take(RUN_MAX);
        let mut run: Vec<(u16, (DataType, ByteOrder))> = before.chain(behind).collect();
        // The usual order is the likelier one.
        run.sort_by_key(|(address, (_, order))| (*order != ByteOrder::Abcd, *address));
        let mut chosen: Vec<u16> = Vec::new();
        for (start, _) in &run {
            if chosen.iter().all(|other| 1 < start.abs_diff(*other)) {
                chosen.push(*start);
            }
        }
        run.into_iter().find(|(start, _)| *start == address && chosen.contains(start)).map(|(_, of)| of)
    }

    /// The type that a register and the next are likely of, by what came in the same responses.
    pub fn likely(&self, table: Table, address: u16) -> Option<(DataType, ByteOrder)> {
        let good = |address| self.get(table, address).filter(|cell| cell.fault.is_none() && !table.is_bits());
        let (first, second) = (good(address)?, good(address.checked_add(1)?)?);
        // Two halves of different moments are no value.
        let pairs = first.seen.iter().rev().zip(second.seen.iter().rev()).take_while(|(a, b)| a.0 == b.0);
        let mut pairs: Vec<[u16; 2]> = pairs.map(|(a, b)| [a.1, b.1]).collect();
        pairs.reverse();
        likely(&pairs)
    }
}

/// The likely type of pairs of words in the order in which they were read; `None` where nothing speaks for one.
fn likely(pairs: &[[u16; 2]]) -> Option<(DataType, ByteOrder)> {
    let mut pairs = pairs.to_vec();
    pairs.dedup();
    let float = float_orders(pairs.last()?).find(|order| is_float(*order, &pairs));
    let float = float.map(|order| (DataType::F32, order));
    let counter = || [ByteOrder::Abcd, ByteOrder::Cdab].into_iter().find(|order| is_counter(*order, &pairs));
    float.or_else(|| counter().map(|order| (DataType::U32, order)))
}

/// Floats of a usual size throughout that change little, though their words change as halves of one value do.
fn is_float(order: ByteOrder, pairs: &[[u16; 2]]) -> bool {
    let usual = pairs.iter().all(|pair| float_orders(pair).any(|other| other == order));
    let value = |pair: &[u16; 2]| number(DataType::F32, order, pair).map_or(f64::NAN, Exact::near);
    let steady = pairs.windows(2).all(|two| {
        let (old, new) = (value(&two[0]), value(&two[1]));
        (new - old).abs() <= STEP_MAX * old.abs().max(new.abs())
    });
    let round = || pairs.iter().all(|pair| digits(to_f32(value(pair))) <= DIGITS_MAX);
    let together = || {
        pairs.windows(2).any(|two| {
            let by = [two[0][0].abs_diff(two[1][0]), two[0][1].abs_diff(two[1][1])];
            by.iter().all(|by| *by != 0) || by.iter().any(|by| JUMP <= *by)
        })
    };
    usual && steady && (together() || round())
}

/// Whole numbers that only rise, and have carried from the lower word to the upper one.
fn is_counter(order: ByteOrder, pairs: &[[u16; 2]]) -> bool {
    let halves = |pair: &[u16; 2]| if order == ByteOrder::Abcd { (pair[0], pair[1]) } else { (pair[1], pair[0]) };
    let rises = pairs.windows(2).all(|two| {
        let ((old_high, old_low), (high, low)) = (halves(&two[0]), halves(&two[1]));
        let carried = old_high.checked_add(1) == Some(high) && low < old_low;
        (high == old_high && old_low < low || carried) && low.wrapping_sub(old_low) < JUMP
    });
    let carried = || pairs.first().map(|pair| halves(pair).0) != pairs.last().map(|pair| halves(pair).0);
    RISES_MIN < pairs.len() && rises && carried()
}

/// Digits of the shortest decimal number that is this float, without zeros at its ends.
fn digits(value: f32) -> usize {
    let text: String = format!("{value}").chars().filter(char::is_ascii_digit).collect();
    text.trim_matches('0').len()
}

#[cfg(test)]
mod tests {
    use super::*;

    const FLOAT: DataType = DataType::F32;
    const COUNT: DataType = DataType::U32;

    #[test]
    fn value_and_change_hint_the_type() {
        type Case = (&'static str, &'static [[u16; 2]], Option<(DataType, ByteOrder)>);
        let cases: [Case; 12] = [
            ("100 that stands still", &[[0x42C8, 0]], Some((FLOAT, ByteOrder::Abcd))),
            ("104.69399 that stands still", &[[0x42D1, 0x6353]], None),
            ("104.694 then 104.71", &[[0x42D1, 0x6353], [0x42D1, 0x6B85]], None),
            ("104.694 then 104.8", &[[0x42D1, 0x6353], [0x42D1, 0x999A]], Some((FLOAT, ByteOrder::Abcd))),
            ("104.694 then 105.3", &[[0x6353, 0x42D1], [0x999A, 0x42D2]], Some((FLOAT, ByteOrder::Cdab))),
            ("bytes swapped", &[[0xD142, 0x5363], [0xD242, 0x9A99]], Some((FLOAT, ByteOrder::Badc))),
            ("words and bytes swapped", &[[0x5363, 0xD142], [0x9A99, 0xD242]], Some((FLOAT, ByteOrder::Dcba))),
            ("no step of a measured value", &[[0x42D1, 0x6353], [0x47D1, 0x1111]], None),
            ("a carry", &[[1, 65_500], [1, 65_530], [2, 20], [2, 50]], Some((COUNT, ByteOrder::Abcd))),
            ("a carry, swapped", &[[65_500, 1], [65_530, 1], [20, 2], [50, 2]], Some((COUNT, ByteOrder::Cdab))),
            ("two of 16 bits", &[[700, 10], [700, 11], [700, 12], [700, 13]], None),
            ("nothing", &[], None),
        ];
        for (what, pairs, expect) in cases {
            assert_eq!(likely(pairs), expect, "{what}");
        }
    }

    #[test]
    fn of_two_likely_readings_that_share_a_register_one_is_marked() {
        // 100 at 10, from 11 on the same with its words swapped; 50 at 12.
        let words = [0x42C8, 0, 0x4248, 0];
        let part = crate::plant::live::LivePart {
            at: jiff::Timestamp::UNIX_EPOCH,
            span: crate::plant::live::AddressSpan { table: Table::Holding, address: 10, count: 4 },
            words: Ok(words.to_vec()),
        };
        let mut cells = Cells::default();
        cells.on_reading(&crate::plant::live::LiveReading { parts: vec![part], ..Default::default() });
        let all = |of: &dyn Fn(u16) -> Option<(DataType, ByteOrder)>| (10..14).map(of).collect::<Vec<_>>();
        let float = |order| Some((FLOAT, order));
        let (abcd, cdab) = (float(ByteOrder::Abcd), float(ByteOrder::Cdab));
        assert_eq!(all(&|address| cells.likely(Table::Holding, address)), [abcd, cdab, abcd, None]);
        assert_eq!(all(&|address| cells.marked(Table::Holding, address)), [abcd, None, abcd, None]);
    }

    #[test]
    fn random_words_give_no_hint() {
        let mut state = 1u64;
        let mut word = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            u16::try_from(state >> 48).expect("16 bits")
        };
        let mut hints = |reads: usize| {
            (0..10_000).filter(|_| likely(&(0..reads).map(|_| [word(), word()]).collect::<Vec<_>>()).is_some()).count()
        };
        let (still, once, thrice) = (hints(1), hints(2), hints(4));
        assert!(still <= 50 && once <= 10 && thrice == 0, "of 10000: {still}, {once}, {thrice}");
    }
}
