//! Tables: pages, workbooks, and lists of makers.

use rust_xlsxwriter::Workbook;

use super::{list_of, read, shown};
use crate::{
    plant::{
        address::AddressBase,
        tag::{Access, ByteOrder, Table},
    },
    register_map::{
        self,
        list::{Column, ListContext, Said},
    },
};

#[test]
fn a_list_of_a_heat_pump_divides_and_has_its_types() {
    let text = "Title;Register type;Register;Division factor;Unit;Size of variable;Min value;Max value;Default value\n\
                Outdoor (BT1);MODBUS_INPUT_REGISTER;1;10;°C;s16;0;0;0\n\
                Degree minutes;MODBUS_HOLDING_REGISTER;11;10;;s16;-30000;30000;0\n\
                Alarm;MODBUS_INPUT_REGISTER;2195;1;;u8;0;0;0\n";
    let expect =
        ["30002 Outdoor (BT1) int16 ABCD x0.1 °C", "40012 Degree minutes int16 ABCD x0.1", "32196 Alarm uint8 ABCD x1"];
    assert_eq!(read(text), (expect.map(str::to_owned).to_vec(), Vec::new()));
}

#[test]
fn sizes_of_a_heat_pump_may_be_the_codes_of_its_types() {
    let head = "Title\tRegister type\tRegister\tDivision factor\tUnit\tSize of variable\tMin value\tMax value\tDefault value\t";
    let rows: String =
        (1..=6).map(|code| format!("T{code}\tMODBUS_INPUT_REGISTER\t{}\t10\t\t{code}\t0\t0\t0\n", 2 * code)).collect();
    let kinds = ["int8 ABCD", "int16 ABCD", "int32 CDAB", "uint8 ABCD", "uint16 ABCD", "uint32 CDAB"];
    let expect: Vec<String> =
        kinds.iter().zip(1..).map(|(kind, code)| format!("{:05} T{code} {kind} x0.1", 30_001 + 2 * code)).collect();
    let text = format!("{head}\n{rows}");
    assert_eq!(read(&text), (expect.clone(), Vec::new()));
    let said = |means: Column| {
        let means = Said::from([("size of variable".to_owned(), Some(means))]);
        register_map::read(text.as_bytes(), &ListContext { means, ..ListContext::default() })
    };
    assert_eq!(said(Column::Type).named.iter().map(shown).collect::<Vec<_>>(), expect);
    assert_eq!(said(Column::Length).named.len(), 1, "registers, where its reader says so");
    let other = text.replacen("\t1\t0\t0\t0", "\t7\t0\t0\t0", 1);
    assert_eq!(read(&other).0.len(), 0, "7 is no code: nothing shows that the others are");
    for heading in ["Size (registers)", "Words", "Length", "Size"] {
        let list = format!("Register;Name;{heading}\n1;a;1\n2;b;2\n");
        assert_eq!(read(&list).0, ["40002 a uint16 ABCD x1"], "{heading}");
    }
}

#[test]
fn an_export_of_modbusmanager_is_asked_for_its_base_alone() {
    let rows = "\"BT1 Outdoor\";\"outdoor temperature\";40004;\"°C\";s16;10;0;0;0;R;\n\
                \"Total hours\";\"all of them\";43416;\"h\";u32;1;0;9999999;0;R;\n\
                \"Offset S1\";\"of the \n curve\";47011;\"\";s16;1;-10;10;0;R/W;\n";
    let plain = format!("Title;Info;ID;Unit;Size;Factor;Min;Max;Default;Mode\n{rows}");
    let above = format!("ModbusManager 1.0.9\n20200624\nProduct: F1\nDatabase: 1R2\n{plain}");
    for (text, left_out) in [(plain, 0), (above, 4)] {
        let asked = list_of(&text);
        assert_eq!((asked.refused, asked.questions.len()), (None, 0), "{text}");
        assert_eq!(asked.unclear.map(|unclear| unclear.written).as_deref(), Some("40004"));
        let context = ListContext { base: Some(AddressBase::Zero), ..ListContext::default() };
        let list = register_map::read(text.as_bytes(), &context);
        let shown: Vec<String> = list.named.iter().map(shown).collect();
        let first = format!("{} BT1 Outdoor int16 ABCD x0.1 °C", Table::Holding.modicon(40_004));
        assert_eq!((shown.len(), &shown[0], list.problems.len()), (3, &first, left_out), "{:?}", list.problems);
        assert_eq!((list.named[1].order, list.named[1].count()), (ByteOrder::Cdab, 2));
        assert_eq!((list.named[2].access, list.named[2].write_fc), (Access::ReadWrite, Some(16)));
    }
}

#[test]
fn tables_of_a_page_are_lists() {
    let page = "<html><body><h1>Map</h1>\n<table><tr><th>Mode</th><th>Code</th></tr><tr><td>Wait</td><td>0</td></tr></table>\n\
                <table>\n<thead><tr><th>Address</th><th>Name</th><th>Type</th><th>Unit</th></tr></thead>\n\
                <tr><td>5</td><td>Flow</td><td rowspan=\"2\">uint16</td><td>m&sup3;/h</td></tr>\n\
                <tr><td>6</td><td>Level</td><td>cm</td></tr>\n</table></body></html>";
    let expect = ["40006 Flow uint16 ABCD x1 m³/h", "40007 Level uint16 ABCD x1 cm"];
    assert_eq!(read(page), (expect.map(str::to_owned).to_vec(), Vec::new()));
    assert_eq!(list_of(page).named[1].line, 6);
}

/// A workbook of sheets of rows.
fn workbook(sheets: &[(&str, &[[&str; 4]])]) -> Vec<u8> {
    let mut book = Workbook::new();
    for (name, rows) in sheets {
        let sheet = book.add_worksheet();
        sheet.set_name(*name).expect("a name");
        for (y, row) in (0..).zip(*rows) {
            for (x, cell) in (0..).zip(row) {
                let cell: &str = cell;
                match cell.parse::<f64>() {
                    Ok(number) => sheet.write(y, x, number),
                    Err(_) => sheet.write(y, x, cell),
                }
                .expect("it fits");
            }
        }
    }
    book.save_to_buffer().expect("a buffer")
}

#[test]
fn every_sheet_of_a_workbook_is_a_list() {
    let values: &[[&str; 4]] =
        &[["Address", "Name", "Scale", "Unit"], ["5", "Flow", "0.1", "l/h"], ["6", "Level", "x", "cm"]];
    let settings: &[[&str; 4]] = &[["Register", "Parameter", "Type", ""], ["100", "Limit", "int32", ""]];
    let notes: &[[&str; 4]] = &[["Mode", "Code", "", ""], ["Wait", "0", "", ""]];
    let bytes = workbook(&[("Values", values), ("Settings", settings), ("Notes", notes)]);
    let list = crate::register_map::read(&bytes, &ListContext::default());
    let named: Vec<String> = list.named.iter().map(shown).collect();
    assert_eq!(named, ["40006 Flow uint16 ABCD x0.1 l/h", "40101 Limit int32 ABCD x1"]);
    assert_eq!(list.problems, ["Values: line 3: 6: `x` is not a scale"]);
    assert!(list.warnings[0].starts_with("sheet Notes: its heading has no column"), "{:?}", list.warnings);
    let alone = crate::register_map::read(&workbook(&[("Notes", notes)]), &ListContext::default());
    assert!(
        alone.refused.is_some_and(|why| why.contains("no column of addresses") && why.contains("What can be read"))
    );
}

#[test]
fn a_title_says_the_table_of_the_rows_below_it() {
    let expect = ["30001 V float32 ABCD x1", "00011 A bool ABCD x1"].map(str::to_owned).to_vec();
    for text in [
        "# Meter\n\n## Input registers (FC 04)\n\n| Address | Name | Type |\n|---|---|---|\n| 0 | V | float32 |\n\n## Coils\n\n| Address | Name | Type |\n|---|---|---|\n| 10 | A | bool |\n",
        "Input registers;;\nAddress;Name;Type\n0;V;float32\nCoils;;\nAddress;Name;Type\n10;A;bool\n",
        "Address;Name;Type\nInput registers;;\n0;V;float32\nCoils;;\n10;A;bool\n",
        "<h2>Input registers</h2><table><tr><th>Address</th><th>Name</th><th>Type</th></tr><tr><td>0</td><td>V</td><td>float32</td></tr></table><table><caption>Coils</caption><tr><th>Address</th><th>Name</th><th>Type</th></tr><tr><td>10</td><td>A</td><td>bool</td></tr></table>",
    ] {
        assert_eq!(read(text), (expect.clone(), Vec::new()), "{text}");
    }
    let other = "Input registers;;\nAddress;Name;Type\n300001;V;float32\nMore;;\n400011;A;int16\n";
    assert_eq!(read(other).0, ["30001 V float32 ABCD x1", "40011 A int16 ABCD x1"], "a number says more");
    let chapters =
        "Address;Name;Type\n4. Diagnostics;;\n5;A;int16\n2 Alarms;;\n6;B;int16\n3.1 Input registers;;\n7;C;int16\n";
    let expect = ["40006 A int16 ABCD x1", "40007 B int16 ABCD x1", "30008 C int16 ABCD x1"];
    assert_eq!(read(chapters).0, expect, "the number of a chapter is no function code");
    let table = |n: u16| format!("| Address | Name | Type |\n|---|---|---|\n| {n} | T{n} | int16 |\n\n");
    let parts = ["## Input registers", "### Phases", "## Configuration", "### Clock"];
    let text: String = parts.iter().zip(1..).map(|(part, n)| format!("{part}\n\n{}", table(n))).collect();
    let expect = ["30002 T1", "30003 T2", "40004 T3", "40005 T4"].map(|row| format!("{row} int16 ABCD x1"));
    assert_eq!(read(&text).0, expect, "another part of the list ends it");
    let rows: &[[&str; 4]] = &[["Address", "Name", "Type", ""], ["5", "A", "int16", ""]];
    let bytes = workbook(&[("Input registers", rows), ("Holding", rows), ("Coils", rows)]);
    let list = crate::register_map::read(&bytes, &ListContext::default());
    let named: Vec<String> = list.named.iter().map(shown).collect();
    assert_eq!(named, ["30006 A int16 ABCD x1", "40006 A int16 ABCD x1"]);
    assert!(list.problems[0].contains("`int16` is more than a bit"), "{:?}", list.problems);
}

#[test]
fn a_gap_in_the_column_of_tables_is_no_holding_register() {
    let text = "FC;Address;Name;Type\n4;0;A;int16\n;1;B;int16\n3;10;C;int16\n";
    let (named, problems) = read(text);
    assert_eq!(named, ["30001 A int16 ABCD x1", "40011 C int16 ABCD x1"]);
    assert_eq!(problems, ["line 3: 1: `` is not a table"]);
    let mut book = Workbook::new();
    let sheet = book.add_worksheet();
    let format = rust_xlsxwriter::Format::new();
    for (y, row) in (0..).zip([["FC", "Address", "Name"], ["", "0", "A"], ["", "1", "B"], ["3", "10", "C"]]) {
        for (x, cell) in (0..).zip(row).filter(|(_, cell)| !cell.is_empty()) {
            sheet.write(y, x, cell).expect("it fits");
        }
    }
    sheet.merge_range(1, 0, 2, 0, "4", &format).expect("it fits");
    let list = crate::register_map::read(&book.save_to_buffer().expect("a buffer"), &ListContext::default());
    let named: Vec<String> = list.named.iter().map(shown).collect();
    assert_eq!(named, ["30001 A uint16 ABCD x1", "30002 B uint16 ABCD x1", "40011 C uint16 ABCD x1"]);
}
