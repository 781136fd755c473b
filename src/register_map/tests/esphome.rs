//! The `modbus_controller` items of ESPHome.

use super::read;

#[test]
fn items_of_esphome_keep_type_order_filters_and_bits() {
    let of = |row: &str| format!("  - {{ platform: modbus_controller, modbus_controller_id: meter, {row} }}\n");
    let sensors = [
        "name: Energy, register_type: holding, address: 18, value_type: S_DWORD_R, filters: [{ offset: 2 }, { multiply: 10 }, { throttle: 5s }]",
        "name: Power, register_type: holding, address: 20, value_type: FP32_R, accuracy_decimals: 1",
        "name: High, register_type: holding, address: 22, value_type: U_WORD, bitmask: 0xFF00",
        "name: Turned, register_type: holding, address: 23, lambda: return x / 2;",
        "name: Curve, register_type: holding, address: 24, filters: [{ calibrate_linear: [1] }]",
    ];
    let head = "modbus:
  - id: bus
modbus_controller:
  - { id: meter, address: 0x05, modbus_id: bus }
  - { id: other, address: 6, modbus_id: bus }
sensor:
  - platform: modbus_controller
    modbus_controller_id: meter
    name: Voltage
    register_type: read
    address: 0x10
    value_type: U_WORD
    unit_of_measurement: V
    filters:
      - multiply: 0.1
  - { platform: uptime, name: Uptime }
";
    let far = of("name: Far, register_type: holding, address: 25").replace("meter", "other");
    let sections = [
        ("binary_sensor", "name: Door, register_type: discrete_input, address: 3"),
        ("binary_sensor", "name: Fault, register_type: read, address: 30, bitmask: 0x8"),
        ("switch", "name: Pump, register_type: coil, address: 1"),
        ("number", "name: Limit, address: 40, value_type: S_WORD, multiply: 10, min_value: -5, max_value: 50"),
        ("select", "name: Mode, address: 41, optionsmap: { Heat: 1, Cool: 2 }"),
        ("text_sensor", "name: Serial, register_type: holding, address: 50, response_size: 8"),
    ];
    let mut text = head.to_owned() + &sensors.map(of).concat() + &far;
    let mut last = "";
    for (section, row) in sections {
        text += &format!("{}{}", if section == last { String::new() } else { format!("{section}:\n") }, of(row));
        last = section;
    }
    let (named, problems) = read(&text);
    let expect = [
        "30017 Voltage uint16 ABCD x0.1 V",
        "40019 Energy int32 CDAB x10 +20",
        "40021 Power float32 CDAB x1",
        "40023 High uint16[8+8] ABCD x1",
        "10004 Door bool ABCD x1",
        "30031 Fault uint16[3+1] ABCD x1",
        "00002 Pump bool ABCD x1 rw",
        "40041 Limit int16 ABCD x0.1 rw min-5 max50",
        "40042 Mode uint16 ABCD x1 1=Heat 2=Cool rw",
        "40051 Serial cstring(8) ABCD x1",
    ];
    assert_eq!(named, expect, "{problems:?}");
    let expect = ["Turned: a profile cannot express `lambda`", "cannot express `calibrate_linear`", "to unit 6"];
    let matches = problems.len() == expect.len() && problems.iter().zip(expect).all(|(why, of)| why.contains(of));
    assert!(matches, "{problems:?}");
}
