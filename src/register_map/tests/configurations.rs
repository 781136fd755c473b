//! Configurations of other programs.

use std::time::Duration;

use super::{list_of, read};
use crate::plant::tag::Poll;

#[test]
fn home_assistant_sensors_keep_type_order_scale_and_unit() {
    let text = "modbus:
  - name: hub
    type: tcp
    sensors:
      - name: Voltage
        slave: 3
        address: 0x10
        input_type: input
        data_type: float32
        swap: word
        precision: 1
        unit_of_measurement: V
      - { name: Outside, slave: 3, address: 20, scale: 0.1, offset: -40, nan_value: 0x8000, max_value: 60 }
      - { name: Serial, slave: 3, address: 30, data_type: string, count: 4 }
      - { name: Row, slave: 3, address: 40, data_type: uint32, slave_count: 1 }
      - { name: Own, slave: 3, address: 50, data_type: custom, structure: \">hh\", count: 2 }
      - { name: Other, slave: 4, address: 60 }
    binary_sensors:
      - { name: Door, slave: 3, address: 7, input_type: discrete_input }
      - { name: Low, slave: 3, address: 8, input_type: holding }
";
    let (named, problems) = read(text);
    let expect = [
        "30017 Voltage float32 CDAB x1 V",
        "40021 Outside int16 ABCD x0.1 -40 !-32768",
        "40031 Serial cstring(8) ABCD x1",
        "40041 Row uint32 ABCD x1",
        "40043 Row 1 uint32 ABCD x1",
        "10008 Door bool ABCD x1",
        "40009 Low uint16[0+1] ABCD x1",
    ];
    assert_eq!(named, expect);
    let expect = [
        "line 16: Own: a profile cannot express `structure`",
        "line 17: it belongs to unit 4, the registers of unit 3 are taken",
    ];
    assert_eq!(problems, expect);
    assert_eq!(list_of(text).notes.get("max_value"), Some(&(1, 13)));
}

#[test]
fn home_assistant_entities_are_written_and_verified_elsewhere() {
    let text = "modbus:
  - switches:
      - { name: Pump, address: 5, write_type: coil }
      - { name: Fan, address: 6, command_on: 2, command_off: 3 }
      - { name: Valve, address: 7, verify: { address: 9, input_type: input } }
      - { name: Odd, address: 8, verify: { address: 8, state_on: 4 } }
    covers:
      - { name: Shutter, address: 20, status_register: 21 }
    climates:
      - name: Room
        address: 30
        input_type: input
        scale: 0.1
        target_temp_register: 31
        min_temp: 10
        max_temp: 30
        hvac_mode_register: { address: 32, values: { state_off: 0, state_heat: [1, 2] } }
";
    let (named, problems) = read(text);
    let expect = [
        "00006 Pump bool ABCD x1 rw",
        "40007 Fan uint16 ABCD x1 3=off 2=on rw",
        "30010 Valve uint16 ABCD x1 0=off 1=on rw ->40008",
        "40022 Shutter uint16 ABCD x1 0=closed 1=open 2=opening 3=closing rw ->40021",
        "30031 Room int16 ABCD x0.1 °C",
        "40032 Room target int16 ABCD x0.1 °C rw min10 max30",
        "40033 Room mode uint16 ABCD x1 0=off 1=heat 2=heat rw",
    ];
    assert_eq!(named, expect);
    assert_eq!(problems, ["line 6: Odd: a profile cannot express `verify`"]);
}

#[test]
fn telegraf_is_read_in_all_its_styles() {
    let text = r#"
[[inputs.modbus]]
  controller = "tcp://10.0.0.7:502"
  slave_id = 1
  coils = [{ name = "run", address = [0] }]
  holding_registers = [
    { name = "power", byte_order = "CDAB", data_type = "FIXED", scale = 0.1, address = [8, 9] },
    { name = "level", byte_order = "BA", data_type = "UFIXED", address = [10] },
    { name = "apart", byte_order = "ABCD", data_type = "UINT32", address = [12, 15] },
    { name = "odd", byte_order = "AB", data_type = "DECIMAL", address = [16] },
  ]
[[inputs.modbus]]
  controller = "tcp://10.0.0.7:502"
  [[inputs.modbus.request]]
    slave_id = 1
    byte_order = "DCBA"
    register = "input"
    fields = [
      { address = 0, name = "volt", type = "FLOAT32", scale = 0.001, output = "FLOAT64" },
      { address = 2, type = "INT16", omit = true },
      { address = 3, name = "temp", type = "INT16" },
      { address = 4, name = "bit", type = "BIT", bit = 3 },
      { address = 5, name = "half", type = "UINT8H" },
      { address = 6, name = "text", type = "STRING", length = 3 },
    ]
  [[inputs.modbus.request]]
    slave_id = 2
    fields = [{ address = 9, name = "second", type = "UINT16" }]
"#;
    let (named, problems) = read(text);
    let expect = [
        "00001 run bool ABCD x1",
        "40009 power int32 CDAB x0.1",
        "40011 level uint16 BADC x1",
        "30001 volt float32 DCBA x0.001",
        "30004 temp int16 BADC x1",
        "30005 bit uint16[3+1] BADC x1",
        "30006 half uint8 BADC x1",
        "30007 text cstring(6) BADC x1",
    ];
    assert_eq!(named, expect);
    let expect = [
        "line 9: apart: its registers are not consecutive",
        "line 10: odd: `DECIMAL` is not a known type",
        "line 28: it belongs to unit 2, the registers of unit 1 are taken",
    ];
    assert_eq!(problems, expect);
}

#[test]
fn a_local_gateway_keeps_fields_flags_and_options() {
    let text = "device: { manufacturer: Rekall, model: Hub 310 }
read_write_word:
  mode: { address: 28, control: select, options: { 0: slow, 1: fast } }
  heat: { address: 29, bits: 1, shift_bits: 4, control: switch }
  limit: { address: 30, multiplier: 0.1, offset: 5, control: number, number: { min: 5, max: 20 } }
  text: { address: 31, string: true, size: 2 }
  digits: { address: 34, size: 2, sum_scale: [1, 10000] }
  sum: { address: 36, size: 2, sum_scale: [1, 1000] }
read_only_word:
  faults: { address: 0, flags: { 1: pump, 16: mill }, unavailable_values: [65535] }
  named: { address: 1, multiplier: 2, map: { 0: low } }
read_only_boolean:
  door: { address: 3 }
";
    let (named, problems) = read(text);
    let expect = [
        "40029 mode uint16 ABCD x1 0=slow 1=fast rw",
        "40030 heat uint16[4+1] ABCD x1 0=off 1=on rw",
        "40031 limit uint16 ABCD x0.1 +5 rw min5 max20",
        "40032 text cstring(4) ABCD x1",
        "40035 digits mod10k(2) CDAB x1",
        "30001 faults uint16 ABCD x1 #0=pump #15=mill !65535",
        "10004 door bool ABCD x1",
    ];
    assert_eq!(named, expect);
    let why = |key| format!("a profile cannot express `{key}`");
    assert_eq!(problems, [format!("line 8: sum: {}", why("sum_scale")), format!("line 11: named: {}", why("map"))]);
    assert_eq!(list_of(text).about, ["Rekall", "Hub 310"]);
}

#[test]
fn solarman_rules_signs_offsets_masks_and_lookups_are_kept() {
    let text = "default: { code: 4 }
parameters:
  - group: Battery
    update_interval: 60
    items:
      - { name: Temperature, rule: 2, registers: [0x10], offset: 1000, scale: 0.1, uom: °C }
      - { name: Energy, rule: 3, registers: [0x12, 0x13], scale: 0.1, uom: kWh }
      - { name: Turned, rule: 4, registers: [0x15, 0x14] }
      - { name: Signed, rule: 2, registers: [0x16], magnitude: true, inverted: true }
      - { name: Strings, rule: 1, registers: [0x17], mask: 0x0F00, divide: 256 }
      - { name: Phase, rule: 1, registers: [0x17], mask: 0x000F, lookup: [{ key: [0, 1], value: One }, { key: 3, value: Three }] }
      - { name: Faults, rule: 1, registers: [0x18], lookup: [{ key: 0, value: OK }, { bit: 3, value: Fan }] }
      - { name: Serial, rule: 5, registers: [0x20, 0x21] }
      - { name: Clock, rule: 8, registers: [0x22, 0x23, 0x24] }
      - { name: Set, rule: 8, registers: [0x25, 0x26, 0x27], platform: datetime, code: { read: 3, write: 16 } }
      - { name: Limit, rule: 1, registers: [0x30], platform: number, code: { read: 3, write: 16 }, configurable: { max: 9 } }
      - { name: Version, rule: 7, registers: [0x31] }
      - { name: Parts, rule: 7, registers: [0x35, 0x34], hex: }
      - { name: Start, rule: 9, registers: [0x36] }
      - { name: Stop, rule: 9, registers: [0x37], dec: 256 }
      - { name: Charge, rule: 9, registers: [0x38, 0x39] }
      - { name: Signs, rule: 9, registers: [0x3A, 0x3B], hex: , offset: 0x3030 }
      - { name: Odd, rule: 9, registers: [0x3C], dec: 60 }
      - { name: Sum, rule: 1, sensors: [{ registers: [1] }] }
      - { name: Gap, rule: 3, registers: [0x40, 0x42] }
      - { name: Model, rule: 1, registers: [[0x50], [0x51]], scale: [1, 10] }
";
    let (named, problems) = read(text);
    let expect = [
        "30017 Temperature int16 ABCD x0.1 -100 °C",
        "30019 Energy uint32 CDAB x0.1 kWh",
        "30021 Turned int32 ABCD x1",
        "30023 Signed sm16 ABCD x-1",
        "30024 Strings uint16[8+4] ABCD x1",
        "30024 Phase uint16[0+4] ABCD x1 0=One 1=One 3=Three",
        "30025 Faults uint16 ABCD x1 #3=Fan",
        "30033 Serial string(4) ABCD x1",
        "30035 Clock clock_bytes ABCD x1",
        "40038 Set clock_bytes ABCD x1 rw",
        "40049 Limit uint16 ABCD x1 rw max9",
        "30050 Version version(1) ABCD x1",
        "30053 Parts version(2) CDAB x1",
        "30055 Start time_decimal ABCD x1",
        "30056 Stop time_bytes ABCD x1",
        "30057 Charge time_words ABCD x1",
        "30059 Signs string(4) ABCD x1",
    ];
    assert_eq!(named, expect);
    assert_eq!(problems.len(), 3, "{problems:?}");
    assert!(problems[0].contains("cannot express `rule: 9`"), "{problems:?}");
    assert!(problems[2].contains("differs between 2 models"), "{problems:?}");
    let second = super::ListContext { variant: Some(1), ..Default::default() };
    let list = crate::register_map::read(text.as_bytes(), &second);
    assert_eq!(list.named.last().map(super::shown).as_deref(), Some("30082 Model uint16 ABCD x10"));
    assert_eq!(
        (list.named[0].group.as_str(), list.named[0].poll),
        ("Battery", Some(Poll::Every(Duration::from_secs(60))))
    );
}

#[test]
fn solarman_numbers_outside_their_range_are_no_value() {
    let text = "parameters:
  - group: Settings
    items:
      - { name: Charge, rule: 1, registers: [10], scale: 0.1, range: { min: 0000, max: 1000 }, platform: number }
      - { name: Float, rule: 2, registers: [11], range: { min: 38, max: 61 } }
      - { name: Energy, rule: 3, registers: [13, 12], range: { max: 0xFFFFFFF9 } }
      - { name: Size, rule: 2, registers: [14], magnitude: true, range: { min: 5 } }
      - { name: Mode, rule: 1, registers: [15], range: { min: 0, max: 5 }, lookup: [{ key: 0, value: Off }] }
      - { name: Part, rule: 1, registers: [16], mask: 0x0F, range: { min: 257 } }
      - { name: Heat, rule: 2, registers: [17], scale: 0.1, offset: 1000, validation: { min: -40, max: 99.5, invalidate_all: } }
      - { name: Turned, rule: 2, registers: [18], inverted: true, validation: { min: 1 } }
      - { name: Open, rule: 1, registers: [19], range: { min: 1, max: [5, 9] } }
";
    let (named, problems) = read(text);
    let expect = [
        "40011 Charge uint16 ABCD x0.1 !1001..65535 rw min0 max100",
        "40012 Float int16 ABCD x1 !-32768..37 !62..32767",
        "40013 Energy uint32 ABCD x1 !4294967290..4294967295",
        "40015 Size sm16 ABCD x1 !0..4",
        "40016 Mode uint16 ABCD x1 0=Off !6..65535",
        "40018 Heat int16 ABCD x0.1 -100 !-32768..599 !1996..32767",
        "40019 Turned int16 ABCD x-1 !0..32767",
        "40020 Open uint16 ABCD x1 !0",
    ];
    assert_eq!(named, expect);
    assert_eq!(problems, ["line 9: Part: a profile cannot express `range`"]);
    let list = list_of(text);
    let written = crate::register_map::profile::written(&list, "inverter", "a file").expect("it is a profile");
    let charge = &written.checked.plant.tags[0];
    assert!(charge.is_bad(1_001.0.into()) && !charge.is_bad(1_000.0.into()), "{}", written.text);
    assert!(written.text.contains("bad_if = [[1001, 65535]]"), "{}", written.text);
}

#[test]
fn a_template_of_wiren_board_is_read_without_its_setup() {
    let text = r#"{ // of a maker
 "title": "Relay", "device_type": "relay", "device": { "word_order": "little_endian",
  "channels": [
   { "name": "Temp", "reg_type": "input", "address": 4, "type": "temperature", "format": "s16", "scale": 0.1, "error_value": "0x7FFF" },
   { "name": "Energy", "reg_type": "input", "address": "0x10", "type": "power_consumption", "format": "u32" },
   { "name": "K1", "reg_type": "coil", "address": 0, "type": "switch" },
   { "name": "Bits", "reg_type": "holding", "address": "7:4:2", "type": "value", "readonly": true },
   { "name": "Mode", "reg_type": "holding", "address": 8, "enum": [0, 2], "enum_titles": ["off", "auto"], "max": 2 },
   { "name": "Press", "reg_type": "press_counter", "address": 9 } ],
  "parameters": { "delay": { "title": "Delay", "address": 20, "min": 0, "max": 100 } },
  "setup": [{ "title": "Unlock", "address": 99, "value": 1 }] } }"#;
    let (named, problems) = read(text);
    let expect = [
        "30005 Temp int16 ABCD x0.1 °C !32767",
        "30017 Energy uint32 CDAB x1 kWh",
        "00001 K1 bool ABCD x1 rw",
        "40008 Bits uint16[4+2] ABCD x1",
        "40009 Mode uint16 ABCD x1 0=off 2=auto rw max2",
        "40021 Delay uint16 ABCD x1 rw min0 max100",
    ];
    assert_eq!(named, expect);
    assert_eq!(
        problems,
        ["line 9: Press: `press_counter` is not a table", "line 11: a profile cannot express `setup`"]
    );
}

#[test]
fn modbusscope_is_read_in_both_its_forms() {
    let text = "<?xml version=\"1.0\"?>
<modbusscope datalevel=\"4\">
 <modbus><connection><connectionid>0</connectionid><slaveid>2</slaveid><int32littleendian>false</int32littleendian></connection></modbus>
 <scope>
  <register active=\"true\"><text>A &amp; B</text><expression><![CDATA[${40001: s16b} * 0.1 - 5]]></expression></register>
  <register><text>wide</text><expression>${30003:0:32b}</expression></register>
  <register><text>sum</text><expression>${40001} + ${40002}</expression></register>
  <register><address>40010</address><text>old</text><unsigned>true</unsigned><bitmask>0xFF00</bitmask><shift>-8</shift><divide>2</divide></register>
  <register><text>none</text></register>
 </scope>
</modbusscope>";
    let (named, problems) = read(text);
    let expect = ["40001 A & B int16 ABCD x0.1 -5", "30003 wide uint32 ABCD x1", "40010 old uint16[8+8] ABCD x0.5"];
    assert_eq!(named, expect);
    assert_eq!(problems.len(), 2, "{problems:?}");
    assert!(problems[0].starts_with("line 7: sum: the formula"), "{problems:?}");
}

#[test]
fn a_model_of_sunspec_follows_its_sizes_and_factors() {
    let text = r#"{ "id": 901, "group": { "name": "m", "label": "Made up", "points": [
  { "name": "ID", "type": "uint16", "size": 1, "value": 901 }, { "name": "L", "type": "uint16", "size": 1 },
  { "name": "W", "type": "int16", "size": 1, "sf": "W_SF", "units": "W" },
  { "name": "W_SF", "type": "sunssf", "size": 1 }, { "name": "Pad", "type": "pad", "size": 1 },
  { "name": "Mn", "type": "string", "size": 4 },
  { "name": "St", "type": "enum16", "size": 1, "access": "RW", "symbols": [{ "name": "OFF", "value": 1 }] },
  { "name": "Evt", "type": "bitfield32", "size": 2, "symbols": [{ "name": "FAN", "label": "Fan", "value": 4 }] } ],
 "groups": [{ "name": "Str", "count": 2, "points": [{ "name": "V", "type": "uint16", "size": 1, "sf": -1 }] },
  { "name": "End", "count": 0, "points": [{ "name": "A", "type": "acc32", "size": 2 }] }] } }"#;
    let (named, problems) = read(text);
    let expect = [
        "440071 ID uint16 ABCD x1 !65535",
        "440072 L uint16 ABCD x1 !65535",
        "440073 W int16 ABCD x1 W !-32768 ^40073",
        "440074 W_SF int16 ABCD x1 !-32768",
        "440076 Mn cstring(8) ABCD x1",
        "440080 St uint16 ABCD x1 1=OFF !65535 rw",
        "440081 Evt uint32 ABCD x1 #4=Fan !4294967295",
        "440083 Str1.V uint16 ABCD x0.1 !65535",
        "440084 Str2.V uint16 ABCD x0.1 !65535",
        "440085 End1.A uint32 ABCD x1 !0",
    ];
    assert_eq!((named, problems), (expect.map(str::to_owned).to_vec(), Vec::new()));
    let warnings = list_of(text).warnings;
    assert!(warnings[0].contains("40070") && warnings[1].contains("at most 16 are taken"), "{warnings:?}");
}

#[test]
fn what_stands_in_another_place_of_a_configuration_is_said() {
    let text = "read_only_word:\n  a: { address: 1 }\ncomposite:\n  clock: { type: datetime, fields: { year: { address: 10 } } }\n";
    assert_eq!(read(text).1, ["line 4: clock: a profile cannot express `composite`"]);
    assert_eq!(list_of("modbus: !include modbus.yaml\n").problems, ["line 1: `modbus` is in another file"]);
}
