//! Which form a text has: known by what only that form has. One that is not read is called by its name.

use crate::{
    register_map::{Format, format::modmaster},
    t,
};

/// The form of a text; `Err` is what it is, where that is nothing that can be read.
pub fn format_of(text: &str) -> Result<Format, &'static str> {
    let lines = || text.lines().map(str::trim).take(2_000);
    let has = |word: &str| lines().any(|line| line.starts_with(word));
    let in_json = |wanted: &[&str]| text.starts_with(['{', '[']) && wanted.iter().all(|word| text.contains(word));
    let is_toml = has("[[inputs.modbus") || has("[inputs.modbus");
    Ok(if in_json(&["\"group\"", "\"points\""]) {
        Format::SunSpec
    } else if in_json(&["\"channels\""]) {
        Format::WirenBoard
    } else if text.starts_with('{') && !is_toml {
        Format::Mtui
    } else if text.starts_with('[') && text.trim_end().ends_with(']') && !text.contains("[[") {
        return Err(t!("JSON that is not a list of registers"));
    } else if is_toml {
        Format::Telegraf
    } else if has("[[tag]]") || has("[[device]]") {
        return Err(t!(
            "a device profile or a plant file: put it into the folder of profiles, or open it with sightglass FILE"
        ));
    } else if text.starts_with('<') && text.contains("<modbusscope") {
        Format::ModbusScope
    } else if text.starts_with('<') {
        Format::Html
    } else if has("parameters:") && has("- group:") {
        Format::Solarman
    } else if ["read_only_word:", "read_write_word:", "read_only_boolean:", "read_write_boolean:"]
        .iter()
        .any(|key| has(key))
    {
        Format::LocalGateway
    } else if ["", "- ", "- {", "- { "].into_iter().any(|dash| has(&format!("{dash}platform: modbus_controller"))) {
        // It has a section `modbus:` as well.
        Format::EspHome
    } else if has("modbus:") || has("input_type:") {
        Format::HomeAssistant
    } else if is_yaml(text) {
        return Err(t!("YAML that is not a list of registers"));
    } else if modmaster::is_one(text) {
        Format::ModMaster
    } else {
        Format::List
    })
}

/// Are most of its lines keys?
fn is_yaml(text: &str) -> bool {
    let lines: Vec<&str> =
        text.lines().filter(|line| !line.trim().is_empty() && !line.starts_with('#')).take(100).collect();
    let is_key = |line: &&&str| {
        let line = line.trim_start().trim_start_matches("- ");
        let key = line.split(": ").next().unwrap_or_default().trim_end_matches(':');
        key.len() < line.len() && key.chars().all(|sign| sign.is_ascii_alphanumeric() || "_-".contains(sign))
    };
    3 <= lines.len() && lines.len() <= 2 * lines.iter().filter(is_key).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_form_is_known_by_what_only_it_has() {
        for (text, format) in [
            ("{ \"group\": { \"points\": [] }, \"id\": 101 }", Format::SunSpec),
            ("{ \"device_type\": \"x\", \"device\": { \"channels\": [] } }", Format::WirenBoard),
            ("[[inputs.modbus]]\nname = \"a\"\n", Format::Telegraf),
            ("<table><tr><td>40001</td></tr></table>", Format::Html),
            ("<?xml version=\"1.0\"?>\n<modbusscope datalevel=\"2\"/>", Format::ModbusScope),
            ("default:\n  update_interval: 5\nparameters:\n  - group: PV\n    items:\n", Format::Solarman),
            ("device:\n  model: A\nread_only_word:\n  power:\n    address: 84\n", Format::LocalGateway),
            ("modbus:\n  - name: hub\n    type: tcp\n", Format::HomeAssistant),
            ("modbus:\n  id: bus\nsensor:\n  - platform: modbus_controller\n    address: 5\n", Format::EspHome),
            ("sensor:\n  - { platform: modbus_controller, address: 5 }\n", Format::EspHome),
            ("{ \"registers\": { \"holdings\": [] } }", Format::Mtui),
            ("\"Address\",\"Name\",\"Type\",\"Value\",\"Unit\",\"Radix\",\"Offset\",\"Scale\"\n", Format::ModMaster),
            ("40001  Voltage L1  float  V\n", Format::List),
            ("address,name\n5,a\n", Format::List),
            ("", Format::List),
        ] {
            assert_eq!(format_of(text), Ok(format), "{text}");
        }
        for (text, name) in [
            ("title = \"a\"\n[[device]]\nname = \"b\"\n", "plant file"),
            ("a: 1\nb: 2\nc:\n  - d: 3\n", "YAML"),
            ("[1, 2]", "JSON"),
        ] {
            assert!(format_of(text).is_err_and(|form| form.contains(name)), "{text}");
        }
    }
}
