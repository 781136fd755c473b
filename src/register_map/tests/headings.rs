//! Headings in words that few manuals use, tables of something else beside them, and what is said of prose.

use super::{doubtful::check, list_of, read, shown};
use crate::register_map::{
    self,
    list::{Column, ListContext, Said},
};

/// What is taken once its reader has said what columns mean.
fn said(text: &str, means: &[(&str, Column)]) -> Vec<String> {
    let means: Said = means.iter().map(|(heading, means)| ((*heading).to_owned(), Some(*means))).collect();
    let list = register_map::read(text.as_bytes(), &ListContext { means, ..ListContext::default() });
    assert_eq!(list.refused, None, "{text}");
    list.named.iter().map(shown).collect()
}

/// A table of Markdown.
fn markdown(heading: &[&str], rows: &[&[&str]]) -> String {
    let line = |cells: &[&str]| format!("| {} |\n", cells.join(" | "));
    let rule = line(&vec!["---"; heading.len()]);
    format!("{}{rule}{}\n", line(heading), rows.iter().map(|row| line(row)).collect::<String>())
}

#[test]
fn what_is_said_of_columns_makes_a_heading() {
    let text = markdown(&["Register", "Quux"], &[&["500", "Version"], &["504", "Volts"]]);
    let why = list_of(&text).refused.expect("nothing says which are the names");
    assert!(why.starts_with("its heading has no column of names: Register, Quux"), "{why}");
    let expect = ["40501 Version uint16 ABCD x1", "40505 Volts uint16 ABCD x1"];
    assert_eq!(said(&text, &[("quux", Column::Name)]), expect);
    let odd = "Place;Words;More\n500;Version;a\n504;Volts;b\n";
    assert!(list_of(odd).refused.is_some_and(|why| why.starts_with("its heading has no column of addresses: Place")));
    assert_eq!(said(odd, &[("Place", Column::Address), ("Words", Column::Name)]), expect);
}

#[test]
fn names_stand_below_the_word_that_says_so_most() {
    let rows: [&[&str]; 2] = [&["500", "Version", "1"], &["504", "Volts", "2"]];
    let expect = ["40501 Version uint16 ABCD x1", "40505 Volts uint16 ABCD x1"];
    for heading in ["Purpose", "Meaning", "Function", "Signal", "Item", "Field", "Nickname"] {
        assert_eq!(read(&markdown(&["Register", heading, "Nr"], &rows)).0, expect, "{heading}");
    }
    for (first, second) in [
        ("Field", "Description"),
        ("Purpose", "Beschreibung"),
        ("Name", "Function"),
        ("Tag", "Item"),
        ("Signal", "Meaning"),
        ("Meaning", "Description"),
    ] {
        let text = format!("Address;{second};{first}\n500;long words;Version\n504;more of them;Volts\n");
        assert_eq!(read(&text).0, expect, "{first} {second}");
    }
    check("Item;Address;Text;Name\n1;500;a;Version\n2;504;b;Volts\n", &expect, &[], &[]);
    let counted = "Item;Address;Description\n1;500;Version\n2;504;Volts\n";
    check(counted, &expect, &[], &[]);
}

#[test]
fn a_column_that_says_what_is_done_is_no_type() {
    for (heading, cells, access) in [
        ("Type", ["R", "R/W"], "rw"),
        ("Type", ["RO", "RW"], "rw"),
        ("Mode", ["R", "W"], "w"),
        ("Typ", ["r", "rw"], "rw"),
    ] {
        let text = format!("Address;Name;{heading};Unit\n0x5;a;{};V\n0x6;b;{};V\n", cells[0], cells[1]);
        let taken = ["40006 a uint16 ABCD x1 V", &format!("40007 b uint16 ABCD x1 V {access}")];
        check(&text, &taken, &[], &[]);
    }
    check("Address;Name;Type\n5;a;quux\n", &[], &["`quux` is not a known type"], &[]);
}

#[test]
fn names_of_registers_are_addresses() {
    let flow = markdown(
        &["Register", "Field", "Type", "Description"],
        &[&["R1", "Flow", "Float32", "long"], &["R1442", "Modbus address", "Uint16", "Slave ID of the device"]],
    );
    let prose = "---\n\n- **Float32**: two registers\n\n";
    let settings = markdown(&["Setting", "Value", "Where"], &[&["Slave ID", "1", "M90"], &["Baud", "9600", "M91"]]);
    let list = list_of(&format!("{flow}{prose}{settings}"));
    let taken: Vec<String> = list.named.iter().map(shown).collect();
    assert_eq!(taken, ["40002 Flow float32 ABCD x1", "41443 Modbus address uint16 ABCD x1"], "{:?}", list.problems);
    let other = "its heading has no column of addresses: Setting, Value, Where";
    assert_eq!(list.problems.iter().filter(|problem| problem.ends_with(other)).count(), 2, "{:?}", list.problems);
    assert_eq!(list.problems.len(), 3, "{:?}", list.problems);
    let tables = "Address;Name\nHR5;a\nIR5;b\nHR 6;c\n";
    check(tables, &["40006 a uint16 ABCD x1", "30006 b uint16 ABCD x1", "40007 c uint16 ABCD x1"], &[], &[]);
    let stated = "Register;Name;FC\nHR5;a;4\nIR6;b;4\n";
    check(stated, &["30007 b uint16 ABCD x1"], &["`HR5` and `input` differ"], &[]);
    let mixed = "Register;Name\nR1;a\n5;b\n6;c\n";
    check(mixed, &["40006 b uint16 ABCD x1", "40007 c uint16 ABCD x1"], &["`R1` is not an address"], &[]);
    assert_eq!(said("Place;Name\nR7;a\n", &[("Place", Column::Address)]), ["40008 a uint16 ABCD x1"]);
}

#[test]
fn rows_of_another_table_are_no_registers() {
    let registers = markdown(&["Address", "Name", "Type"], &[&["0", "Status", "uint16"]]);
    let bits = markdown(&["Bit", "Name", "Text"], &[&["1", "Charging", "yes"], &["2", "Full", "no"]]);
    let why = "its heading has no column of addresses: Bit, Name, Text";
    check(&format!("{registers}{bits}{registers}"), &["40001 Status uint16 ABCD x1"], &[why, why, "name already"], &[]);
}

#[test]
fn prose_is_not_quoted_as_a_heading() {
    let prose = "This project polls registers, and publishes them, as the tables below say.\n\n";
    let why = |heading: &[&str]| {
        let text = format!("{prose}{}", markdown(heading, &[&["500", "Version"], &["504", "Volts"]]));
        list_of(&text).refused.expect("it is none")
    };
    let (codes, quux) = (why(&["Code", "Text"]), why(&["Register", "Quux"]));
    assert!(codes.starts_with("its heading has no column of addresses: Code, Text."), "{codes}");
    assert!(quux.starts_with("its heading has no column of names: Register, Quux."), "{quux}");
}

#[test]
fn the_title_of_a_table_may_name_function_codes() {
    let table = |n: u16| markdown(&["Register", "Name"], &[&[&n.to_string(), "a"]]);
    let text = format!("## Polled registers (FC04)\n\n{}## Settings, FC 03/06\n\n{}", table(5), table(6));
    assert_eq!(read(&text).0, ["30006 a uint16 ABCD x1", "40007 a uint16 ABCD x1"]);
}
