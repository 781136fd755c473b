//! Cells of files that other programs write: quotes, comments, marks, formulas, dates, spans and encodings.

use std::io::{Cursor, Read, Write};

use rust_xlsxwriter::{ExcelDateTime, Format, Formula, Workbook};

use super::{doubtful::check, list_of, read, shown};
use crate::register_map::{self, list::ListContext};

#[test]
fn a_quote_that_is_never_closed_leaves_out_its_row() {
    check("address;name\n0x1;\"abc\n0x2;def\n0x3;ghi\n", &[], &["a quote is never closed"], &[]);
    let paired = "address;name\n0x1;\"abc\n0x2;\"def\"\n0x3;ghi\n";
    check(paired, &["40004 ghi uint16 ABCD x1"], &["a quote is never closed"], &[]);
    let closed = "address;name\n0x1;\"two\nlines\"\n0x2;\"10\"\" pipe\"\n0x3;10\" pipe\n0x4;\"a;b\"\n";
    let taken = ["two lines", "10\" pipe", "10\" pipe", "a;b"];
    let taken: Vec<String> = (2..).zip(taken).map(|(n, name)| format!("4000{n} {name} uint16 ABCD x1")).collect();
    assert_eq!(read(closed), (taken, Vec::new()));
}

#[test]
fn a_name_that_begins_with_a_number_sign_is_no_comment() {
    let text = "Name;Address;Type\n#1 pump speed;0x10;uint16\n# of starts;0x11;uint16\n# a comment;;\n#one more\n";
    check(text, &["40017 #1 pump speed uint16 ABCD x1", "40018 # of starts uint16 ABCD x1"], &[], &[]);
    check("Nr;Address;Name\n#1;0x10;a\n#2;0x11;b\n", &["40017 a uint16 ABCD x1", "40018 b uint16 ABCD x1"], &[], &[]);
    check("Address;Name;Type\n#0x10;a;uint16\n0x11;b;uint16\n", &["40018 b uint16 ABCD x1"], &[], &[]);
}

#[test]
fn cells_of_markdown_lose_the_marks_around_them() {
    let text = "| Address | Name | Type |\n|---|---|---|\n| `0x0001` | **a** | `int16` |\n| **0x0002** | b `c` | **`uint16`** |\n";
    check(text, &["40002 a int16 ABCD x1", "40003 b `c` uint16 ABCD x1"], &[], &[]);
}

#[test]
fn a_point_of_thousands_beside_decimal_commas_is_left_out() {
    let text = "address;name;type;divisor\n0x5;a;int16;1.000\n0x6;b;int16;10\n";
    let commas = text.replace("divisor", "divisor;max").replace("1.000", "1.000;0").replace(";10\n", ";10;2,5\n");
    check(
        &commas,
        &["40007 b int16 ABCD x0.1 max2.5"],
        &["`1.000` is a number with three decimals, or thousands"],
        &[],
    );
    check(text, &["40006 a int16 ABCD x1", "40007 b int16 ABCD x0.1"], &[], &[]);
}

#[test]
fn labels_with_commas_are_names_of_their_own() {
    let text = "address;name;type;enum\n0x5;a;uint16;\"0=Off, 1=Heat, 2=Cool\"\n0x6;b;uint16;0: Off / 1: On\n";
    check(text, &["40006 a uint16 ABCD x1 0=Off 1=Heat 2=Cool", "40007 b uint16 ABCD x1 0=Off 1=On"], &[], &[]);
}

/// A workbook whose formulas that are `none` have no value, as openpyxl writes them.
fn without_results(book: &[u8]) -> Vec<u8> {
    let mut archive = zip::ZipArchive::new(Cursor::new(book)).expect("an archive");
    let mut written = zip::ZipWriter::new(Cursor::new(Vec::new()));
    for n in 0..archive.len() {
        let mut entry = archive.by_index(n).expect("an entry");
        let mut text = String::new();
        entry.read_to_string(&mut text).expect("XML");
        written.start_file(entry.name().expect("a name"), zip::write::SimpleFileOptions::default()).expect("an entry");
        written.write_all(text.replace("<v>none</v>", "<v></v>").as_bytes()).expect("it fits");
    }
    written.finish().expect("an archive").into_inner()
}

#[test]
fn a_formula_without_its_value_and_a_date_are_left_out() {
    let mut book = Workbook::new();
    let sheet = book.add_worksheet();
    for (y, row) in (0..).zip([["Address", "Name", "Scale"], ["0x10", "A", ""], ["0x11", "B", ""], ["", "C", ""]]) {
        for (x, cell) in (0..).zip(row) {
            sheet.write(y, x, cell).expect("it fits");
        }
    }
    sheet.write_formula(1, 2, Formula::new("=1/10").set_result("none")).expect("it fits");
    sheet.write_formula(2, 2, Formula::new("=1/10").set_result("0.1")).expect("it fits");
    let date = ExcelDateTime::from_ymd(2024, 1, 1).expect("a day");
    sheet.write_with_format(3, 0, &date, &Format::new().set_num_format("yyyy-mm-dd")).expect("it fits");
    let bytes = without_results(&book.save_to_buffer().expect("a buffer"));
    let list = register_map::read(&bytes, &ListContext::default());
    let named: Vec<String> = list.named.iter().map(shown).collect();
    assert_eq!(named, ["40018 B uint16 ABCD x0.1"], "{list:?}");
    assert!(list.problems[0].contains("`=1/10` is a formula without its value: open and save"), "{:?}", list.problems);
    assert!(list.problems[1].contains("`2024-01-01 00:00:00` is not an address"), "{:?}", list.problems);
}

#[test]
fn a_sheet_that_is_hidden_is_left_out_and_said() {
    let mut book = Workbook::new();
    for (name, is_hidden) in [("Map", false), ("Old", true)] {
        let sheet = book.add_worksheet();
        sheet.set_name(name).expect("a name").set_hidden(is_hidden);
        for (y, row) in (0..).zip([["Address", "Name"], ["0x10", name]]) {
            sheet.write_row(y, 0, row).expect("it fits");
        }
    }
    let list = register_map::read(&book.save_to_buffer().expect("a buffer"), &ListContext::default());
    assert_eq!(list.named.iter().map(shown).collect::<Vec<_>>(), ["40017 Map uint16 ABCD x1"]);
    assert_eq!(list.warnings, ["sheet Old is hidden, and not read"]);
}

#[test]
fn spans_of_a_page_beyond_all_bounds_are_cut() {
    let row = "<tr><td rowspan=99999 colspan=99999>x</td></tr>\n";
    let page = format!("<table><tr><th>Address</th><th>Name</th></tr>{}</table>", row.repeat(3_000));
    assert_eq!(list_of(&page).named.len(), 0);
}

#[test]
fn addresses_are_understood_as_manuals_write_them() {
    let text = "Address;Name;Type\n40009~40010;a;uint32\n40011 to 40012;b;float\n40013/4;c;int32\n[40028];d;int16\n40029*;e;int16\n";
    let taken = [
        "40009 a uint32 ABCD x1",
        "40011 b float32 ABCD x1",
        "40013 c int32 ABCD x1",
        "40028 d int16 ABCD x1",
        "40029 e int16 ABCD x1",
    ];
    let context = ListContext { base: Some(crate::plant::address::AddressBase::Modicon), ..ListContext::default() };
    let list = register_map::read(text.as_bytes(), &context);
    assert_eq!(list.named.iter().map(shown).collect::<Vec<_>>(), taken, "{:?}", list.problems);
    let hex = "Address;Name\nFF00H;a\n1008 h;b\n&H1001;c\n16#1003;d\nH1004;e\n";
    let places: Vec<u16> = list_of(hex).named.iter().map(|named| named.address).collect();
    assert_eq!(places, [0xFF00, 0x1008, 0x1001, 0x1003, 0x1004]);
    check("Address;Name\n1!400001;a\n2!400002;b\n", &["40001 a uint16 ABCD x1"], &["to unit 2"], &[]);
}

#[test]
fn an_array_of_flat_objects_is_a_table() {
    let rows = r#"[{ "address": "0x10", "name": "Flow", "type": "int16", "scale": 0.1 }, { "address": 17, "name": "Level", "unit": "cm" }]"#;
    let taken = ["Flow int16 ABCD x0.1", "Level uint16 ABCD x1 cm"];
    let of = |first: u32| taken.iter().zip(first..).map(|(row, place)| format!("{place} {row}")).collect::<Vec<_>>();
    assert_eq!(read(&rows.replace("cm", "cm\", \"type\": \"uint16")), (of(40_017), Vec::new()));
    let named = format!(r#"{{ "version": 3, "input_registers": {} }}"#, rows.replace("cm", "cm\", \"type\": \"uint16"));
    assert_eq!(read(&named), (of(30_017), Vec::new()));
    for none in [
        "[1, 2]",
        r#"[{ "a": { "b": 1 } }]"#,
        r#"{ "a": [{ "address": 1, "name": "x" }], "b": [{ "address": 1, "name": "y" }] }"#,
    ] {
        assert!(list_of(none).refused.is_some(), "{none}");
    }
}
