//! Keys of other programs that change what a number means: taken as they mean it, or the row is left out.

use super::read;

/// Reads a file; the registers, and the names of the rows that are left out.
fn check(text: &str, expect: &[&str], left_out: &[&str]) {
    let (named, problems) = read(text);
    assert_eq!(named, expect, "{text}\n{problems:?}");
    let matches = problems.len() == left_out.len() && problems.iter().zip(left_out).all(|(why, of)| why.contains(of));
    assert!(matches, "{text}\n{problems:?}");
}

#[test]
fn home_assistant_hubs_and_units_are_not_mixed() {
    let two = "modbus:
  - { name: a, sensors: [{ name: One, address: 1 }] }
  - { name: b, sensors: [{ name: Two, address: 2 }] }
";
    check(two, &["40002 One int16 ABCD x1"], &["another connection with unit 1"]);
    let units = "modbus:
  - { name: a, sensors: [{ name: One, address: 1, slave: 7 }, { name: Two, address: 2 }, { name: Odd, address: 3, slave: x }] }
";
    check(units, &["40002 One int16 ABCD x1"], &["to unit 1", "Odd: `slave`"]);
}

#[test]
fn home_assistant_temperatures_have_scales_of_their_own() {
    let text = "modbus:
  - climates:
      - { name: Room, address: 30, current_temp_scale: 0.5, current_temp_offset: -10, target_temp_scale: 0.01, target_temp_register: 31 }
      - { name: Same, address: 40, target_temp_scale: 0.01, target_temp_register: 40 }
    sensors:
      - { name: Gone, address: 50, nan_value: 9999 }
      - { name: Turned, address: 60, data_type: uint32, reverse_order: true }
";
    let expect = [
        "40051 Gone int16 ABCD x1 !9999 !-9999",
        "40031 Room int16 ABCD x0.5 -10 °C",
        "40032 Room target int16 ABCD x0.01 °C rw",
    ];
    check(
        text,
        &expect,
        &["Turned: a profile cannot express `reverse_order`", "Same: a profile cannot express `target_temp_scale`"],
    );
}

#[test]
fn a_bit_that_means_the_contrary_is_left_out() {
    let ha = "modbus:
  - switches:
      - { name: Odd, address: 5, write_type: coil, command_on: 0, command_off: 1 }
      - { name: Even, address: 6, write_type: coil }
    covers:
      - { name: Gate, address: 7, input_type: coil, state_open: 0, state_closed: 1 }
";
    check(
        ha,
        &["00007 Even bool ABCD x1 rw"],
        &["Odd: a profile cannot express `command_on`", "Gate: a profile cannot express `state_open`"],
    );
    let wb = r#"{ "device": { "channels": [
        { "name": "Odd", "reg_type": "coil", "address": 0, "type": "switch", "on_value": 0, "off_value": 1 },
        { "name": "Even", "reg_type": "coil", "address": 1, "type": "switch" } ] } }"#;
    check(wb, &["00002 Even bool ABCD x1 rw"], &["Odd: a profile cannot express `on_value`"]);
}

#[test]
fn telegraf_inputs_bits_and_texts_mean_what_it_makes_of_them() {
    let two = r#"
[[inputs.modbus]]
  controller = "tcp://10.0.0.1:502"
  holding_registers = [{ name = "one", byte_order = "AB", data_type = "UINT16", address = [1] }]
[[inputs.modbus]]
  controller = "tcp://10.0.0.2:502"
  holding_registers = [{ name = "two", byte_order = "AB", data_type = "UINT16", address = [1] }]
"#;
    check(two, &["40002 one uint16 ABCD x1"], &["another connection"]);
    let bits = r#"
[[inputs.modbus]]
  slave_id = 1
  holding_registers = [
    { name = "plain", byte_order = "AB", data_type = "BIT", bit = 3, address = [1] },
    { name = "swapped", byte_order = "BA", data_type = "BIT", bit = 3, address = [2] },
    { name = "text", byte_order = "AB", data_type = "STRING", address = [3, 4] },
  ]
  [inputs.modbus.workarounds]
    string_register_location = "upper"
"#;
    let expect = ["40002 plain uint16[3+1] ABCD x1", "40003 swapped uint16[3+1] BADC x1"];
    check(bits, &expect, &["text: a profile cannot express `string_register_location`"]);
}

#[test]
fn modbusscope_numbers_name_the_tables_of_that_program() {
    let rows = ["0", "5", "10000", "10001", "30001", "40001", "50001", "100001", "110000", "h7"];
    let row = |of: &&str| format!("<register><expression>${{{of}}}</expression></register>");
    let sums = "<register><text>sum</text><expression>${40021} - 5 + 5 * 2</expression></register>";
    let rows: String = rows.iter().map(row).collect();
    let text = format!("<modbusscope><scope>{rows}{sums}</scope></modbusscope>");
    let expect = ["00001 0 bool ABCD x1", "00006 5 bool ABCD x1", "010001 10000 bool ABCD x1"];
    let (named, problems) = read(&text);
    assert_eq!(named[..3], expect, "{problems:?}");
    let places: Vec<&str> = named[3..].iter().map(|row| row.split(' ').next().unwrap_or_default()).collect();
    assert_eq!(places, ["10001", "30001", "40001", "410001", "460001", "40008"], "{named:?} {problems:?}");
    assert!(problems.iter().any(|why| why.contains("`110000` is not an address")), "{problems:?}");
    assert!(problems.iter().any(|why| why.contains("sum: the formula")), "{problems:?}");
}

#[test]
fn wiren_board_texts_and_conditions_are_as_it_means_them() {
    let text = r#"{ "device": { "channels": [
        { "name": "Serial", "reg_type": "input", "address": 1, "format": "string", "string_data_size": 6 },
        { "name": "Old", "reg_type": "input", "address": 20, "scale": 0.1, "condition": "fw==1" },
        { "name": "New", "reg_type": "input", "address": 20, "condition": "fw==2" },
        { "name": "Half", "reg_type": "input", "address": "11:4" } ] } }"#;
    check(
        text,
        &["30002 Serial chars(6) ABCD x1"],
        &["Old: a profile cannot express `condition`", "New: a profile cannot express `condition`", "Half: `address`"],
    );
}

#[test]
fn solarman_groups_give_their_keys_and_parts_are_not_guessed() {
    let text = "parameters:
  - group: Battery
    scale: 0.1
    items:
      - { name: Inherits, rule: 1, registers: [1] }
      - { name: Own, rule: 1, registers: [2], scale: 10 }
      - { name: Both, rule: 1, registers: [3], mask: 0x0F00, bit: 9 }
      - { name: Turned, rule: 1, registers: [4], inverted: true }
      - { name: Signed, rule: 2, registers: [5], inverted: true }
";
    let expect = ["40002 Inherits uint16 ABCD x0.1", "40003 Own uint16 ABCD x10", "40006 Signed int16 ABCD x-0.1"];
    check(text, &expect, &["Both: a profile cannot express `bit`", "Turned: a profile cannot express `inverted`"]);
}
