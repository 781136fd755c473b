//! Words of manuals that mean other things than they seem to: titles, types, labels and forms of addresses.

use super::{doubtful::check, list_of};
use crate::{
    plant::address::AddressBase,
    register_map::{list::ListContext, read},
};

#[test]
fn a_title_of_a_part_of_a_plant_names_no_table() {
    let list = "Address;Name;Type;Unit;Scale\nCooling coil;;;;\n0x20;Water temperature;int16;°C;0.1\nInputs;;;;\n0x30;AI1;uint16;V;0.01\n\
                Holding time settings;;;;\n0x40;Hold;uint16;s;\n";
    let taken =
        ["40033 Water temperature int16 ABCD x0.1 °C", "40049 AI1 uint16 ABCD x0.01 V", "40065 Hold uint16 ABCD x1 s"];
    check(list, &taken, &["`Cooling coil` is not", "`Inputs` is not", "`Holding time settings` is not"], &[]);
    let page = "Fan coil unit 2\n\n## Discrete manufacturing counters\n\n| Address | Name | Type |\n|---|---|---|\n| 0x5 | Count | uint16 |\n";
    check(page, &["40006 Count uint16 ABCD x1"], &["no address"], &[]);
}

#[test]
fn a_title_names_outputs_and_status_as_manuals_do() {
    let list = "Address;Name\nDiscrete outputs;\n0x1;a\nInput status;\n0x2;b\nCoil status;\n0x3;c\n";
    check(list, &["00002 a bool ABCD x1", "10003 b bool ABCD x1", "00004 c bool ABCD x1"], &[], &[]);
    let cells = "Table;Address;Name\nDiscrete output;0x1;a\nInput status;0x2;b\n";
    check(cells, &["00002 a bool ABCD x1", "10003 b bool ABCD x1"], &[], &[]);
}

#[test]
fn a_number_below_a_title_of_bits_is_left_out() {
    let list = "Address;Name;Type\nCoils;;\n0x1;a;bool\n0x2;b;int16\n";
    check(list, &["00002 a bool ABCD x1"], &["`int16` is more than a bit, and the title above says coil"], &[]);
}

#[test]
fn a_stated_base_leaves_rows_in_the_table_of_their_title() {
    let text = "Input registers;;\nAddress;Name;Type\n30775;Power;S32\n40029;Status;U32\n400011;More;S16\n";
    for (base, first) in [(AddressBase::Zero, 0), (AddressBase::One, 1)] {
        let context = ListContext { base: Some(base), ..ListContext::default() };
        let list = read(text.as_bytes(), &context);
        let places: Vec<_> = list.named.iter().map(|named| (named.table.word(), named.address)).collect();
        assert_eq!(places, [("input", 30_775 - first), ("input", 40_029 - first), ("holding", 10)], "{list:?}");
    }
    let asked = list_of(&text.replace("400011;More;S16\n", "")).unclear;
    assert!(asked.is_some(), "nothing says how its five digits count");
}
