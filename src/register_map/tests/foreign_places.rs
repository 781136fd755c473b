//! Columns of makers that say where a value stands, how long it is and what is done with it.

use super::{
    doubtful::{check, said},
    list_of,
};
use crate::register_map::{
    self,
    list::{Column, ListContext},
};

#[test]
fn words_for_tables_make_their_column_that_of_tables() {
    for (heading, [input, holding]) in [
        ("Register Type", ["IR", "HR"]),
        ("reg_type", ["i", "h"]),
        ("Register_type", ["AI", "AO"]),
        ("Type", ["Input", "Holding"]),
        ("Art", ["IR", "HR"]),
        ("Kind", ["3x", "4x"]),
        ("Table", ["I", "H"]),
        ("RegType", ["3x", "4x"]),
        ("Space", ["input register", "holding register"]),
    ] {
        let text = format!("{heading};Address;Name;Data Type\n{input};0;Flow;UINT16\n{holding};10;Setpoint;INT16\n");
        check(&text, &["30001 Flow uint16 ABCD x1", "40011 Setpoint int16 ABCD x1"], &[], &[]);
    }
    check("Type;Address;Name\nI;0;a\nI;1;b\n", &[], &["`I` is not a known type", "`I`"], &[]);
    let bits = "Kind;Address;Name\nDI;0;a\nDO;1;b\nCO;2;c\n";
    check(bits, &["10001 a bool ABCD x1", "00002 b bool ABCD x1", "00003 c bool ABCD x1"], &[], &[]);
}

#[test]
fn a_column_of_tables_is_never_ignored() {
    for heading in ["Table", "Space", "Area", "RegType"] {
        let text = format!("{heading};Address;Name;Type\nMain;0;a;int16\nHR;1;b;int16\n");
        check(&text, &["40002 b int16 ABCD x1"], &["`Main` is not a table"], &[]);
        let access = format!("{heading};Address;Name;Type\nRO;0x10;a;int16\nRW;0x11;b;int16\n");
        let (taken, why) = match heading {
            "RegType" | "Area" => (&["40017 a int16 ABCD x1", "40018 b int16 ABCD x1 rw"][..], &[][..]),
            _ => (&[][..], &["`RO` is not a table", "`RW` is not a table"][..]),
        };
        check(&access, taken, why, &[]);
        let digits = format!("{heading};Address;Name;Type\n3;0;a;int16\n4;1;b;int16\n");
        check(&digits, &[], &["(3)", "(4)"], &["table / area?"]);
    }
}

#[test]
fn a_heading_that_speaks_of_a_table_is_not_that_of_tables() {
    let text = "Address;Name;Type;Alarm table\n0x10;a;int16;see 4\n";
    check(text, &["40017 a int16 ABCD x1"], &[], &[]);
    assert!(list_of(text).notes.contains_key("Alarm table"));
}

#[test]
fn a_second_column_of_types_that_is_not_used_is_said() {
    let text = "Address;Name;Data Type;Type\n0x10;a;UINT16;Measurement\n";
    check(text, &["40017 a uint16 ABCD x1"], &[], &[]);
    assert!(list_of(text).notes.contains_key("Type"), "{:?}", list_of(text).notes);
    let partly = "Address;Name;Data Type;Type\n0x10;a;UINT16;Holding\n0x11;b;UINT16;Holding\n0x12;c;UINT16;quux\n";
    check(partly, &["40017 a uint16 ABCD x1", "40018 b uint16 ABCD x1"], &["`quux` is not a table"], &[]);
}

#[test]
fn offsets_that_move_with_the_addresses_are_not_added() {
    let text = "Register;Offset;Name;Type\n0x10;0;A;int16\n0x11;1;B;int16\n";
    check(text, &["40017 A int16 ABCD x1", "40018 B int16 ABCD x1"], &[], &[]);
    let blocks = "Register;Offset;Name;Type\n0x10;0;A;int16\n0x11;1;B;int16\n0x20;0;C;int16\n0x21;1;D;int16\n";
    let taken = ["40017 A int16 ABCD x1", "40018 B int16 ABCD x1", "40033 C int16 ABCD x1", "40034 D int16 ABCD x1"];
    check(blocks, &taken, &[], &[]);
    for offsets in [["0", "4", "8"], ["0", "4", "0"], ["-10", "0", "10"]] {
        let row = |(n, offset): (usize, &&str)| format!("0x{};{offset};n{n};int16\n", 10 + 2 * n);
        let rows: String = offsets.iter().enumerate().map(row).collect();
        check(&format!("Register;Offset;Name;Type\n{rows}"), &[], &["Offset"; 3], &["offset?"]);
    }
    let value = "Register;Offset;Name;Type\n0x10;-40;A;int16\n0x11;0;B;int16\n0x12;-40;C;int16\n";
    let taken = ["40017 A int16 ABCD x1 -40", "40018 B int16 ABCD x1", "40019 C int16 ABCD x1 -40"];
    check(value, &taken, &[], &[]);
}

#[test]
fn hexadecimal_headings_are_known_in_many_words() {
    for heading in [
        "Adresse (hexadezimal)",
        "Address (Hex.)",
        "Address (0x)",
        "地址(十六进制)",
        "Address hexadecimal",
        "Adresse hexadécimale",
        "Address (h)",
        "Address hex",
    ] {
        let text = format!("{heading};Name;Type\n1010;a;int16\n1011-1012;b;int32\n");
        check(&text, &["44113 a int16 ABCD x1", "44114 b int32 ABCD x1"], &[], &[]);
    }
    check("Address (hex);Name;Type\n40001;a;int16\n00010;b;int16\n", &["40017 b int16 ABCD x1"], &["40001"], &[]);
    check("Address (dezimal);Name;Type\n1010;a;int16\n", &["41011 a int16 ABCD x1"], &[], &[]);
}

#[test]
fn one_odd_cell_does_not_make_a_column_hexadecimal() {
    let text = "Address;Name;Type\n101;a;int16\n102;b;int16\n102a;c;int16\n103;d;int16\n";
    check(text, &[], &["Address (101)", "(102)", "(102a)", "(103)"], &["address / hex address?"]);
    said(
        &text.replace("102a", "104"),
        "Address",
        Some(Column::Address),
        &["40102 a int16 ABCD x1", "40103 b int16 ABCD x1", "40105 c int16 ABCD x1", "40104 d int16 ABCD x1"],
    );
    let most = "Address;Name;Type\n10A;a;int16\n10B;b;int16\n10CH;c;int16\n10;d;int16\n";
    let taken = ["40267 a int16 ABCD x1", "40268 b int16 ABCD x1", "40269 c int16 ABCD x1", "40017 d int16 ABCD x1"];
    check(most, &taken, &[], &[]);
}

#[test]
fn decimals_before_the_register_are_no_address() {
    let text = "Name;Dec;Register;Type\nTemp;1;0x0100;int16\nFlow;0;0x0101;int16\n";
    check(text, &["40258 Flow int16 ABCD x1"], &["Dec (1)"], &["Dec (1): implied decimals / decimals?"]);
    said(text, "Dec", Some(Column::Places), &["40257 Temp int16 ABCD x0.1", "40258 Flow int16 ABCD x1"]);
    let rising = "Name;Dec;Register;Type\nTemp;1;0x0100;int16\nFlow;2;0x0101;int16\n";
    check(rising, &[], &["Dec (1)", "Dec (2)"], &["implied decimals / decimals?"]);
    let both = "Name;Dec;Register;Type\nTemp;256;0x0100;int16\nFlow;257;0x0101;int16\n";
    check(both, &["40257 Temp int16 ABCD x1", "40258 Flow int16 ABCD x1"], &[], &[]);
    check("Dec;Hex;Address;Name;Type\n16;10;0x10;a;int16\n", &["40017 a int16 ABCD x1"], &[], &[]);
}

#[test]
fn a_length_of_a_byte_is_none_of_registers() {
    let text = "Address;Name;Type;Length (Byte)\n0x10;A;UINT;1\n0x11;B;UINT;2\n";
    check(text, &["40017 A uint16 ABCD x1", "40018 B uint16 ABCD x1"], &[], &[]);
    let mixed = "Address;Name;Type;Length\n0x10;A;UINT16;2\n0x11;B;UINT8;1\n0x12;C;INT;2\n";
    check(mixed, &["40017 A uint16 ABCD x1", "40018 B uint8 ABCD x1", "40019 C int16 ABCD x1"], &[], &[]);
    let floats = "Address;Name;Type;Length\n0x10;A;float;2\n0x12;B;INT;2\n";
    check(floats, &["40017 A float32 ABCD x1", "40019 B int32 ABCD x1"], &[], &[]);
    let open = "Address;Name;Type;Length\n0x10;A;UINT;1\n0x11;B;UINT;2\n";
    check(open, &["40017 A uint16 ABCD x1"], &["Length (2)"], &["Length (2): registers / bytes?"]);
}

#[test]
fn codes_to_read_and_to_write_may_have_a_column_each() {
    let text = "Address;Name;Type;Read FC;Write FC\n0x10;a;int16;3;16\n0x11;b;int16;3;N/A\n0x12;c;int16;3;6\n";
    let taken = ["40017 a int16 ABCD x1 rw fc16", "40018 b int16 ABCD x1", "40019 c int16 ABCD x1 rw"];
    check(text, &taken, &[], &[]);
}

#[test]
fn a_write_address_of_its_own_is_kept() {
    let text =
        "Read address;Write address;Name;Type\n0x10;0x20;a;int16\n0x11;-;b;int16\n0x12;0x12;c;int16\n0x13;x;d;int16\n";
    let taken = ["40017 a int16 ABCD x1 rw ->40033", "40018 b int16 ABCD x1", "40019 c int16 ABCD x1 rw"];
    check(text, &taken, &["`x` is not an address"], &[]);
    let input = "Read address;Write address;Name;Type\n30017;40033;a;int16\n30018;40034;b;int16\n";
    let modicon = ListContext { base: Some(crate::plant::address::AddressBase::Modicon), ..ListContext::default() };
    let list = register_map::read(input.as_bytes(), &modicon);
    let shown: Vec<String> = list.named.iter().map(super::shown).collect();
    assert_eq!(shown, ["30017 a int16 ABCD x1 rw ->40033", "30018 b int16 ABCD x1 rw ->40034"], "{:?}", list.problems);
}

#[test]
fn a_register_that_cannot_be_does_not_take_the_place_of_another() {
    let text = "Address;Name;Type\n0xFFFF;a;uint32\n0xFFFF;b;uint16\n";
    check(text, &["465536 b uint16 ABCD x1"], &["a: it ends beyond the last address"], &[]);
}

#[test]
fn first_and_last_address_are_a_span() {
    for heading in
        ["Start address;End address", "Start;End", "From;To", "From address;To address", "Startadresse;Endadresse"]
    {
        let text = format!("{heading};Size;Name;Type\n70;71;2;a;uint32\n72;72;1;b;uint16\n");
        check(&text, &["40071 a uint32 ABCD x1", "40073 b uint16 ABCD x1"], &[], &[]);
    }
    let hex = "Start address (hex);End address (hex);Name;Type\n100A;100B;a;uint32\n100C;100D;b;uint16\n";
    check(hex, &["44107 a uint32 ABCD x1"], &["`uint16` does not take 2 registers"], &[]);
    let text = "Start;End;Name;Type\n70;73;a;uint32\n74;75;b;uint32\n";
    check(text, &["40075 b uint32 ABCD x1"], &["`uint32` does not take 4 registers"], &[]);
}

#[test]
fn start_and_offset_alone_are_addresses() {
    for heading in ["Start", "Offset"] {
        let text = format!("{heading};Name;Type\n70;a;uint16\n72;b;uint16\n");
        let said = [format!("`{heading}` is taken for the address of a register")];
        assert_eq!(list_of(&text).warnings, said);
        check(&text, &["40071 a uint16 ABCD x1", "40073 b uint16 ABCD x1"], &[], &[]);
    }
    for heading in ["Quantity", "Content", "Variable"] {
        let text = format!("Address;{heading};Type\n70;Flow;uint16\n72;Level;uint16\n");
        check(&text, &["40071 Flow uint16 ABCD x1", "40073 Level uint16 ABCD x1"], &[], &[]);
    }
}

#[test]
fn a_column_that_counts_rows_is_no_byte_order() {
    let text = "Order;Address;Name;Type\n1;0x10;a;int16\n2;0x11;b;int32\n";
    check(text, &["40017 a int16 ABCD x1", "40018 b int32 ABCD x1"], &[], &[]);
    check("Order;Address;Name;Type\nCDAB;0x10;a;int32\n", &["40017 a int32 CDAB x1"], &[], &[]);
}

#[test]
fn access_is_known_in_more_words() {
    for (read, both) in [
        ("RD", "RD/WR"),
        ("Read", "Read/Write"),
        ("只读", "读写"),
        ("Lecture", "Lecture/Écriture"),
        ("Lectura", "Lectura/Escritura"),
        ("Lesen", "Lesen/Schreiben"),
    ] {
        let text = format!("Address;Name;Type;Access\n0x10;a;int16;{read}\n0x11;b;int16;{both}\n");
        check(&text, &["40017 a int16 ABCD x1", "40018 b int16 ABCD x1 rw"], &[], &[]);
    }
}

#[test]
fn a_row_that_is_left_out_says_what_is_odd_about_it() {
    let text = "Address;Name;Type\n0x10;a;int16\n;b;int16;x;y\n";
    check(text, &["40017 a int16 ABCD x1"], &["5 cells, the heading has 3"], &[]);
    check("Address;Name;Type\nA-17;a;int16\nA-18;b;int16\n", &[], &["`A-17` is not an address", "`A-18`"], &[]);
    let list = list_of("Register;Quux;Type\n0x10;a;int16\n");
    assert_eq!(list.problems, ["line 2: 0x10: no name"]);
    assert!(list.warnings[0].contains("`--column \"Quux=name\"`"), "{:?}", list.warnings);
    let why = list_of("Register;Quux\n0x10;a\n").refused.expect("it has no names");
    assert!(why.contains("`--column \"Quux=name\"`"), "{why}");
}
