//! What is typed, taken back and sent with which function.

use super::*;
use crate::plant::data_type::{Clock, NetworkAddress};

fn sv() -> Named {
    let plain = Named::new(Table::Holding, 1_002, DataType::I16, ByteOrder::Abcd, "SV");
    Named { scale: 0.1, decimals: 1, unit: "°C".into(), ..plain }
}

/// On 2026-11-30 at 14:05:07.
fn words_of(text: &str, named: &Named, held: &[u16]) -> Result<Vec<u16>, String> {
    let now = "2026-11-30T14:05:07Z".parse::<Timestamp>().expect("a time").to_zoned(jiff::tz::TimeZone::UTC);
    typed_as(text, named, held, &now)
}

#[test]
fn a_named_value_is_typed_as_it_is_shown() {
    assert_eq!(words_of("70.2", &sv(), &[700]), Ok(vec![702]));
    assert_eq!(words_of("+0.5", &sv(), &[700]), Ok(vec![705]));
    assert_eq!(words_of("-5", &sv(), &[700]), Ok(vec![0xFFCE]));
    for wrong in ["70.25", "3276.8", "x", "1 2", "", "inf"] {
        assert!(words_of(wrong, &sv(), &[700]).is_err(), "{wrong}");
    }
    let state = Named { enum_labels: vec![(0, "RUN".into()), (1, "STOP".into())], scale: 1.0, ..sv() };
    assert_eq!(words_of("stop", &state, &[0]), Ok(vec![1]));
    let bcd = Named { kind: DataType::Bcd16, scale: 1.0, ..sv() };
    assert_eq!((words_of("1234", &bcd, &[0]), next_step(&bcd, &[0x0999], 1)), (Ok(vec![0x1234]), Some(vec![0x1000])));
    assert!(words_of("12345", &bcd, &[0]).is_err());
    let long = Named { kind: DataType::U64, scale: 1.0, ..sv() };
    assert_eq!(words_of("4294967296", &long, &[0; 4]), Ok(vec![0, 1, 0, 0]));
    let text = Named { kind: DataType::Text(4), ..sv() };
    assert_eq!(words_of("AB", &text, &[0; 2]), Ok(vec![0x4142, 0]));
    let why = "found `ABCDE`, expected printable characters in at most 4 bytes, no blank at the end".to_owned();
    assert_eq!(words_of("ABCDE", &text, &[0; 2]), Err(why));
    let clock = Named { kind: DataType::Clock(Clock::Bcd), ..sv() };
    assert_eq!(words_of("now", &clock, &[0; 3]), Ok(vec![0x2611, 0x3014, 0x0507]));
    assert_eq!(words_of("2027-01-02 03:04", &clock, &[0; 3]), Ok(vec![0x2701, 0x0203, 0x0400]));
    let address = Named { kind: DataType::NetworkAddress(NetworkAddress::Ipv4), ..sv() };
    assert_eq!(words_of("192.168.0.7", &address, &[0; 2]), Ok(vec![0xC0A8, 7]));
    assert_eq!((next_step(&sv(), &[700], 1), next_step(&sv(), &[0x7FFF], 1)), (Some(vec![701]), None));
}

fn write(old: u16, new: u16, multiple: bool, outcome: Outcome) -> ListedWrite {
    let write = RegisterWrite {
        unit: 1,
        table: Table::Holding,
        address: 5,
        words: vec![new],
        expected: vec![old],
        multiple,
        clock: None,
    };
    ListedWrite { id: CommandId::default(), at: Timestamp::UNIX_EPOCH, write, outcome }
}

#[test]
fn undo_walks_back_through_all_writes() {
    let mut writing = Writing::default();
    for (old, new) in [(1, 2), (2, 3), (3, 2)] {
        writing.list.push(write(old, new, false, Outcome::Verified));
    }
    assert_eq!(writing.undoable().map(|write| write.expected[0]), Some(1), "the second was taken back");
    writing.list.push(write(2, 1, false, Outcome::Verified));
    assert_eq!(writing.undoable(), None);
}

#[test]
fn a_unit_without_function_6_is_written_with_16() {
    let unknown = Outcome::Refused(Refusal::Exception(ExceptionCode::ILLEGAL_FUNCTION));
    let mut writing = Writing::default();
    assert!(!writing.multiple(1, Table::Holding));
    writing.list.push(write(1, 2, false, unknown));
    assert!(writing.multiple(1, Table::Holding) && !writing.multiple(2, Table::Holding));
    writing.list.push(write(1, 2, true, Outcome::Verified));
    assert!(writing.multiple(1, Table::Holding));
}

#[test]
fn what_is_typed_becomes_words() {
    let words = |text: &str| typed(text, Table::Holding, ByteOrder::Abcd, 700);
    assert_eq!(words("601"), Ok(vec![601]));
    assert_eq!(words("-5"), Ok(vec![0xFFFB]));
    assert_eq!(words("0x2BC 1"), Ok(vec![700, 1]));
    assert_eq!(words("+10"), Ok(vec![710]));
    assert_eq!(words("104.0"), Ok(vec![0x42D0, 0]));
    assert_eq!(words("70000"), Ok(vec![1, 4464]));
    assert_eq!(typed("70000", Table::Holding, ByteOrder::Cdab, 0), Ok(vec![4464, 1]));
    for wrong in ["", "x", "+x", "99999999999", "NaN", "+65000"] {
        assert!(words(wrong).is_err(), "{wrong}");
    }
    assert_eq!(typed("1 0", Table::Coil, ByteOrder::Abcd, 0), Ok(vec![1, 0]));
    assert!(typed("2", Table::Coil, ByteOrder::Abcd, 0).is_err());
}
