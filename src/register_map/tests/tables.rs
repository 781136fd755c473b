//! Tables: pages, workbooks, and lists of makers.

use rust_xlsxwriter::Workbook;

use super::{list_of, read, shown};
use crate::register_map::list::ListContext;

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
