//! Rows that say two things at once: none is shown as a value that it is not.

use super::{doubtful::check, list_of, read, shown};
use crate::register_map::list::ListContext;

#[test]
fn a_span_of_addresses_says_how_long_a_row_is() {
    let text = "address;name;type\n0-1;a;uint16\n2-3;b;uint32\n4-7;c;string\n8–9;d;float\n";
    let taken = ["40003 b uint32 ABCD x1", "40005 c string(8) ABCD x1", "40009 d float32 ABCD x1"];
    check(text, &taken, &["0-1: `uint16` does not take 2 registers"], &[]);
    check("address;name\n16-17;a\n18;b\n", &["40019 b uint16 ABCD x1"], &["2 registers, and no type"], &[]);
    check("address;name;type\n9-0007;a;int16\n18;b;int16\n", &["40019 b int16 ABCD x1"], &["not an address"], &[]);
    check("address;name;type;registers\n2-3;a;int;2\n4-5;b;int;1\n", &["40003 a int32 ABCD x1"], &["differ"], &[]);
}

#[test]
fn two_addresses_of_a_row_agree_as_in_the_others() {
    let text = "Address dec;Address hex;name;type\n10;0x0A;a;int16\n16;0x11;b;int16\n17;0x11;c;int16\n";
    check(text, &["40011 a int16 ABCD x1", "40018 c int16 ABCD x1"], &["`0x11` and `16` differ"], &[]);
    let text = "Modbus address;PDU address;name\n400001;0;a\n400002;1;b\n400003;7;c\n";
    check(text, &["40001 a uint16 ABCD x1", "40002 b uint16 ABCD x1"], &["`7` and `400003` differ"], &[]);
}

#[test]
fn a_bit_known_by_its_digits_alone_has_no_number() {
    let text = "address;name;type\n100123;a;uint16\n100124;b;bool\n400005;c;uint16\n";
    check(text, &["10124 b bool ABCD x1", "40005 c uint16 ABCD x1"], &["100123: `uint16` does not have 1 bits"], &[]);
    check("table;address;name;type\ncoil;7;a;uint16\n", &["00008 a bool ABCD x1"], &[], &[]);
}

#[test]
fn labels_of_a_masked_number_are_those_of_its_bits() {
    let text = "parameters:
  - group: State
    items:
      - { name: High, rule: 1, mask: 0xF0, registers: [1], lookup: [{ key: 0x10, value: on }, { key: 0x15, value: never }] }
      - { name: Bit, rule: 1, mask: 0x10, registers: [2], lookup: [{ key: 0, value: off }, { key: 0x10, value: on }] }
      - { name: Word, rule: 1, mask: 0xFF00, registers: [3], lookup: [{ bit: 8, value: F1 }, { bit: 15, value: F2 }, { bit: 2, value: F3 }] }
      - { name: Signed, rule: 2, scale: 0.1, registers: [4], lookup: [{ key: 1, value: one }] }
";
    let (named, problems) = read(text);
    let expect = [
        "40002 High uint16[4+4] ABCD x1 1=on",
        "40003 Bit uint16[4+1] ABCD x1 0=off 1=on",
        "40004 Word uint16[8+8] ABCD x1 #0=F1 #7=F2",
        "40005 Signed int16 ABCD x0.1",
    ];
    assert_eq!((named, problems), (expect.map(str::to_owned).to_vec(), Vec::new()));
}

#[test]
fn limits_of_several_models_hold_for_the_one_that_is_meant() {
    let text = "parameters:
  - group: Settings
    items:
      - { name: Limit, rule: 1, registers: [1], configurable: { min: 0, max: [6300, 8000] } }
";
    let of = |variant| {
        let context = ListContext { variant, ..ListContext::default() };
        super::super::read(text.as_bytes(), &context).named.iter().map(shown).collect::<Vec<_>>()
    };
    assert_eq!(of(Some(1)), ["40002 Limit uint16 ABCD x1 rw min0 max8000"]);
    assert_eq!(of(None), ["40002 Limit uint16 ABCD x1"], "which greatest value holds is not known");
    assert_eq!(list_of(text).problems, [""; 0]);
}
