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

#[test]
fn an_array_of_bits_of_home_assistant_has_a_register_each() {
    let text = "homeassistant:
  packages:
    plant:
      modbus:
        - binary_sensors:
            - { name: Door, address: 200, input_type: input, virtual_count: 2 }
";
    let expect =
        ["30201 Door uint16[0+1] ABCD x1", "30202 Door 1 uint16[0+1] ABCD x1", "30203 Door 2 uint16[0+1] ABCD x1"];
    check(text, &expect, &[]);
}

#[test]
fn what_a_bit_means_beside_itself_is_not_dropped() {
    let gateway = "device: { manufacturer: a, model: b }
read_write_boolean:
  pump: { name: Pump, address: 1, control: switch, switch: { on: 0, off: 1 } }
  fan: { name: Fan, address: 2, control: switch, switch: { on: 1, off: 0 } }
read_only_boolean:
  door: { name: Door, address: 3, control: binary_sensor, on: false, off: true }
  lock: { name: Lock, address: 4, control: binary_sensor, on: 1 }
  hall: { name: Hall, address: 5, map: { 0: dark, 1: bright } }
read_write_word:
  level: { name: Level, address: 20, control: switch, multiplier: 0.1, switch: { on: 10, off: 0 } }
  low: { name: Low, address: 21, signed: true, bits: 8 }
";
    let expect = ["00003 Fan bool ABCD x1 rw", "10005 Lock bool ABCD x1", "40022 Low uint16[0+8] ABCD x1"];
    let left_out = ["pump: a profile cannot express `on`", "door: a profile", "`map`", "level: a profile cannot"];
    let (mut named, problems) = read(gateway);
    named.sort();
    assert_eq!(named, expect, "{problems:?}");
    assert_eq!(problems.len(), left_out.len(), "{problems:?}");
    assert!(left_out.iter().all(|of| problems.iter().any(|why| why.contains(of))), "{problems:?}");
    let scope = "<modbusscope><scope>
<register><text>Closed</text><expression>${00005} * -1 + 1</expression></register>
<register><text>Open</text><expression>${00006}</expression></register></scope></modbusscope>";
    check(scope, &["00007 Open bool ABCD x1"], &["Closed: "]);
    let solarman = "parameters:
  - group: g
    items:
      - { name: Lost, rule: 1, code: 2, registers: [5], lookup: [{ key: 0, value: lost }, { key: 1, value: fine }] }
      - { name: Turned, rule: 1, code: 1, registers: [6], inverted: 1 }
      - { name: Plain, rule: 1, code: 1, registers: [7] }
";
    check(solarman, &["00008 Plain bool ABCD x1"], &["Lost: ", "Turned: "]);
}

#[test]
fn two_numbers_in_two_lines_of_a_cell_are_not_one() {
    let rows = "Address,Name,Type\n\"450\n451\",Energy,uint32\n\"300\n305\",Odd,uint16\n12,Plain,uint16\n";
    let list = super::list_of(rows);
    let named: Vec<String> = list.named.iter().map(super::shown).collect();
    assert!(named[0].contains("Energy uint32") && named[1].contains("Plain") && named.len() == 2, "{named:?}");
    assert!(!named[0].contains("50450") && list.problems[0].contains("300, 305"), "{named:?} {:?}", list.problems);
}

#[test]
fn an_offset_with_a_unit_or_another_minus_counts() {
    for cell in ["-40 °C", "−40", "- 40", "-40"] {
        let rows =
            format!("Address,Name,Type,Scale,Offset,Unit\n0x1,A,uint16,0.1,{cell},°C\n0x2,B,uint16,0.1,{cell},°C\n");
        let (named, problems) = read(&rows);
        assert!(
            named.len() == 2 && named.iter().all(|row| row.contains(" x0.1 -40 ")),
            "{cell}: {named:?} {problems:?}"
        );
    }
    let thousands = "Address;Name;Type;Scale;Offset\n0x1;A;uint16;0,1;1,000\n";
    check(thousands, &[], &["`1,000` is not an offset"]);
}

#[test]
fn a_number_whose_range_begins_below_zero_has_a_sign() {
    let rows =
        "Address,Name,Range,Unit\n0x10,Temperature,-400…1500,°C\n0x11,Humidity,0…1000,%\n0x12,Dew,−10 to 40,°C\n";
    let (named, problems) = read(rows);
    let kinds: Vec<&str> = named.iter().filter_map(|row| row.split(' ').nth(2)).collect();
    assert_eq!(kinds, ["int16", "uint16", "int16"], "{named:?} {problems:?}");
}

#[test]
fn the_columns_of_an_iobroker_list_say_its_table() {
    let of = |more: &str, row: &str| format!("_address\tname\tdescription\t{more}\n5\tRun\tpump\t{row}\n");
    let typed = "unit\ttype\tlen\tfactor\toffset\tformula\trole\troom";
    let row = "W\tuint16be\t1\t1\t0\t\tvalue\t";
    check(
        &of(&format!("{typed}\tpoll\twp\tcw\tisScale"), &format!("{row}\ttrue\tfalse\tfalse\tfalse")),
        &["40006 Run uint16 ABCD x1 W"],
        &[],
    );
    check(&of(&format!("{typed}\tcw\tisScale"), &format!("{row}\tfalse\tfalse")), &["30006 Run uint16 ABCD x1 W"], &[]);
    check(&of("formula\trole\troom\tpoll\twp", "\tswitch\t\ttrue\tfalse"), &["00006 Run bool ABCD x1"], &[]);
    check(&of("formula\trole\troom", "\tindicator\t"), &["10006 Run bool ABCD x1"], &[]);
}

#[test]
fn a_resolution_in_the_name_of_a_row_scales_it() {
    let rows = "Address,Name,Type\n0x10,Frequency (0.01 Hz),uint16\n0x11,Voltage (x10),uint16\n0x12,Power (L1),uint16\n0x13,Current(0.1A),uint16\n";
    let expect = [
        "40017 Frequency (0.01 Hz) uint16 ABCD x0.01 Hz",
        "40019 Power (L1) uint16 ABCD x1",
        "40020 Current(0.1A) uint16 ABCD x0.1 A",
    ];
    check(rows, &expect, &["`x10` in its name"]);
}

#[test]
fn what_esphome_makes_of_bits_is_kept_or_left_out() {
    let text = "modbus:
  - id: bus
modbus_controller:
  - { id: one, address: 1, modbus_id: bus }
binary_sensor:
  - { platform: modbus_controller, name: Turned, register_type: coil, address: 1, filters: [{ invert: }] }
  - { platform: modbus_controller, name: Slow, register_type: coil, address: 2, filters: [{ delayed_on: 1s }] }
sensor:
  - { platform: modbus_controller, name: Part, register_type: holding, address: 3, value_type: S_WORD, bitmask: 0xF0 }
output:
  - { platform: modbus_controller, id: valve, register_type: holding, address: 9 }
";
    let expect = ["40004 Part uint16[4+4] ABCD x1", "00003 Slow bool ABCD x1"];
    check(text, &expect, &["Turned: a profile cannot express `invert`", "valve: a profile cannot express `output`"]);
}

#[test]
fn halves_of_a_number_and_an_order_that_can_be_two_are_named() {
    let halves = "Address,Name,Type\n0x35,Eac today H,uint16\n0x36,Eac today L,uint16\n0x37,Other,uint16\n";
    let warnings = super::list_of(halves).warnings;
    assert!(warnings.len() == 1 && warnings[0].contains("may be the halves"), "{warnings:?}");
    let orders = "Address,Name,Type\n0x10,A,float32 LE\n0x12,B,float32 BE\n";
    let list = super::list_of(orders);
    let named: Vec<String> = list.named.iter().map(super::shown).collect();
    assert!(named.len() == 1 && named[0].contains("B float32 ABCD"), "{named:?} {:?}", list.problems);
}

#[test]
fn the_same_number_of_bits_in_every_row_is_no_bit() {
    let list = super::list_of("Address,Name,Bits,Scale\n0x10,Voltage,8,0.1\n0x11,Current,8,0.1\n");
    assert!(
        list.named.iter().all(|named| named.field.is_none()),
        "{:?}",
        list.named.iter().map(super::shown).collect::<Vec<_>>()
    );
}

#[test]
fn what_only_looks_like_a_factor_or_a_width_is_none() {
    let rows = "Address,Name,Type\n0x10,Voltage (*1),uint16\n0x11,Energy (0.5S),uint16\n0x12,Relay (x2),uint16\n";
    let (named, problems) = read(rows);
    assert!(problems.is_empty() && named.iter().all(|row| row.contains(" x1")), "{named:?} {problems:?}");
    let list = super::list_of("Address,Name,Bit\n0x10,Alarm 1,8\n0x11,Alarm 2,8\n");
    assert!(list.named.iter().all(|named| named.field == Some((8, 1))), "{:?}", list.problems);
    let grouped = "Address,Name,Type\n400.401,Energy,uint16\n400.003,Other,uint16\n";
    check(grouped, &["40401 Energy uint16 ABCD x1", "40003 Other uint16 ABCD x1"], &[]);
    let solarman = "parameters:
  - group: g
    items:
      - { name: Plain, rule: 1, code: 1, registers: [7], scale: 1, offset: 0, inverted: 0 }
";
    check(solarman, &["00008 Plain bool ABCD x1"], &[]);
}
