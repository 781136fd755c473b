//! Lists with a column of function codes, whose coils have lost the leading 0 of their numbers.

use super::{doubtful::check, list_of, read, shown};
use crate::{
    plant::{
        address::AddressBase,
        tag::{Access, Table},
    },
    register_map::list::ListContext,
};

/// A list of a controller with a row of each table.
fn controller(rows: &str) -> String {
    format!("Address;Data Type;Modbus Address;Function Code;Nickname\n{rows}")
}

#[test]
fn coils_of_a_list_of_six_digits_count_from_one() {
    let rows = "X1;BIT;100001;FC=02;IN\nC1;BIT;16385;FC=01,05,15;PUMP\nY1;BIT;8193;FC=01,05,15;VALVE\n\
                DS1;INT;400100;FC=03,06,16;SP\nSD1;INT;361441;FC=04;STATE\n";
    let taken = [
        "10001 IN bool ABCD x1",
        "016385 PUMP bool ABCD x1 rw",
        "08193 VALVE bool ABCD x1 rw",
        "40100 SP int16 ABCD x1 rw",
        "361441 STATE int16 ABCD x1",
    ];
    check(&controller(rows), &taken, &[], &[]);
    let list = list_of(&controller(rows));
    let places: Vec<(Table, u16)> = list.named.iter().map(|named| (named.table, named.address)).collect();
    assert_eq!(places[..3], [(Table::Discrete, 0), (Table::Coil, 16_384), (Table::Coil, 8192)]);
    assert_eq!(list.assumed.len(), 0, "{:?}", list.assumed);
}

#[test]
fn a_number_of_another_table_than_its_codes_is_left_out() {
    let rows = "X1;BIT;100001;FC=02;IN\nC1;BIT;16385;FC=01,05,15;PUMP\nSD1;INT;361441;FC=03,06,16;STATE\n";
    let taken = ["10001 IN bool ABCD x1", "016385 PUMP bool ABCD x1 rw"];
    check(&controller(rows), &taken, &["`361441` and `holding` differ"], &[]);
    check(&controller("DS1;INT;5;FC=03,04;SP\n"), &[], &["`FC=03,04` is not a table"], &[]);
}

#[test]
fn coils_that_may_count_from_one_are_asked_about() {
    let readings = [(AddressBase::One, (Table::Coil, 16_384)), (AddressBase::Zero, (Table::Coil, 16_385))];
    let alone = "C1;BIT;16385;FC=01,05,15;PUMP\n";
    for rows in [alone.to_owned(), format!("{alone}X1;BIT;100001;FC=02;IN\nDS1;INT;7;FC=03;SP\n")] {
        let unclear = list_of(&controller(&rows)).unclear.expect("it is asked");
        assert_eq!((unclear.written.as_str(), unclear.readings), ("16385", readings), "{rows}");
    }
    for (base, expect) in [(AddressBase::One, 16_384), (AddressBase::Zero, 16_385)] {
        let context = ListContext { base: Some(base), ..ListContext::default() };
        let list = super::super::read(controller(alone).as_bytes(), &context);
        assert_eq!((list.unclear, list.named[0].address, list.named[0].access), (None, expect, Access::ReadWrite));
    }
}

#[test]
fn coils_beside_modicon_numbers_of_five_digits_count_from_one() {
    let text = "Address;Function Code;Name\n40001;3;a\n1;1;b\n10001;2;c\n";
    assert!(list_of(text).unclear.is_some(), "40001 may be as sent");
    let modicon = ListContext { base: Some(AddressBase::Modicon), ..ListContext::default() };
    let of = |text: &str| {
        let list = super::super::read(text.as_bytes(), &modicon);
        list.named.iter().map(shown).collect::<Vec<_>>()
    };
    assert_eq!(of(text), ["40001 a uint16 ABCD x1", "00001 b bool ABCD x1", "10001 c bool ABCD x1"]);
    let from_zero = "Address;Function Code;Name\n400001;3;a\n0;1;b\n5;1;c\n";
    let expect = ["40001 a uint16 ABCD x1", "00001 b bool ABCD x1", "00006 c bool ABCD x1"];
    assert_eq!(read(from_zero).0, expect, "no number from 1 is 0");
}

#[test]
fn a_code_that_writes_several_registers_is_the_one_used() {
    let text = "Address;Name;Type;Function Code\n0x5;a;int16;03/16\n0x6;b;int16;03,06\n0x7;c;int16;03\n0x8;d;int32;03/06\n0xA;e;uint32be;3, 16\n";
    let list = list_of(text);
    let writes: Vec<_> = list.named.iter().map(|named| (named.access, named.write_fc)).collect();
    let (read, both) = (Access::Read, Access::ReadWrite);
    assert_eq!(
        writes,
        [(both, Some(16)), (both, None), (read, None), (read, None), (both, None)],
        "no code writes both registers of d"
    );
}
