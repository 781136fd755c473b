//! What has a name: whole texts, what is not implemented, and the lists that it is chosen from.

use super::{lists::inverter, *};

/// The rows of a list between its heading and the end of the screen.
fn names(shown: &str) -> Vec<String> {
    let rows = shown.lines().skip_while(|row| !row.contains("address")).skip(1);
    let name = |row: &str| row.split_whitespace().find(|word| word.chars().any(char::is_alphabetic)).map(str::to_owned);
    rows.take_while(|row| !row.trim().is_empty()).filter_map(name).collect()
}

#[test]
fn every_list_is_filtered_while_words_are_typed() {
    let mut bench = Bench::at(inverter);
    assert!(bench.screen(110, 40).contains("AphB"), "{}", bench.screen(110, 40));
    bench.keys("/phvphb");
    let shown = bench.screen(110, 40);
    assert!(shown.contains("PhVphB") && !shown.contains("AphB"), "{shown}");
    bench.keys("⏎⎋⎋f");
    let shown = bench.screen(110, 40);
    let first = shown.lines().find(|row| row.starts_with('▸'));
    assert!(first.is_some_and(|row| row.contains("ACME Sun 5") && row.contains("in use")), "{shown}");
    bench.keys("/eastron_sdm630");
    let shown = bench.screen(110, 40);
    assert!(shown.contains("eastron_sdm630") && !shown.contains("fuji_pxr"), "{shown}");
    bench.keys("⏎⎋⎋/411⏎");
    assert!(bench.screen(110, 40).contains("uint16 ABCD"), "{}", bench.screen(110, 40));
    bench.keys("/float");
    let shown = bench.screen(110, 40);
    assert!(shown.contains("where 411 may be") && !shown.contains("uint16 ABCD"), "{shown}");
}

#[test]
fn a_text_is_shown_whole_in_the_last_row() {
    let mut bench = Bench::new();
    let last = bench.asked.last().map(|(_, read)| read.spans[0].count - 4).expect("a query");
    let named = Named::new(Table::Holding, last, DataType::Text(40), ByteOrder::Abcd, "model");
    bench.model.tabs.registers.names.put(named);
    bench.keys("oooo");
    bench.answer(0, |address| Some(if address < last { 0 } else { 0x4142 }));
    let shown = bench.screen(120, 24);
    assert!(shown.contains("model  ABABAB"), "{shown}");
}

#[test]
fn what_is_not_implemented_has_no_value() {
    let mut bench = Bench::at(inverter);
    bench.answer(1, |address| inverter(Table::Holding, address));
    let shown = bench.screen(110, 60);
    let row = shown.lines().find(|row| row.split_whitespace().any(|word| word == "AphB"));
    assert!(row.is_some_and(|row| row.contains("no value")), "{shown}");
    let scale = shown.lines().find(|row| row.split_whitespace().any(|word| word == "A_SF"));
    assert!(scale.is_some_and(|row| row.contains("no value")), "{shown}");
}

#[test]
fn values_have_their_labels_and_powers_of_ten_stand_last() {
    let mut bench = Bench::at(inverter);
    bench.answer(1, |address| inverter(Table::Holding, address));
    let shown = bench.screen(120, 90);
    let row = shown.lines().find(|row| row.contains("PhVphA")).unwrap_or_default();
    assert!(row.contains("Phase Voltage AN"), "{shown}");
    let at = |name: &str| {
        shown
            .lines()
            .position(|row| row.split_whitespace().any(|word| word == name))
            .unwrap_or_else(|| panic!("{name}: {shown}"))
    };
    assert!(at("PhVphA") < at("V_SF") && at("St") < at("A_SF") && at("A_SF") < at("V_SF"), "{shown}");
    let narrow = bench.screen(80, 24);
    assert!(narrow.lines().any(|row| row.contains("PhVphA") && row.contains("230.2 V")), "{narrow}");
    assert!(!names(&narrow).is_empty());
}
