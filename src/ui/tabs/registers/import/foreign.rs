//! Files that describe registers in a form that is not read: known by what only that form has, and called by its name.

use crate::t;

/// What a text is, where it is something that cannot be read as a list; `None` for what may be one.
pub fn form(text: &str) -> Option<&'static str> {
    let lines = || text.lines().map(str::trim).take(400);
    let has = |wanted: &[&str]| wanted.iter().all(|word| lines().any(|line| line.starts_with(word)));
    let in_json = |wanted: &[&str]| text.starts_with(['{', '[']) && wanted.iter().all(|word| text.contains(word));
    Some(if text.starts_with("PK\u{3}\u{4}") {
        t!("a workbook or an archive: save its sheet as CSV")
    } else if in_json(&["\"group\"", "\"points\""]) {
        t!("a model of SunSpec (JSON)")
    } else if in_json(&["\"channels\""]) {
        t!("a template of wb-mqtt-serial (JSON)")
    } else if text.starts_with('[') && text.trim_end().ends_with(']') && !text.contains("[[") {
        t!("JSON that is no list of registers")
    } else if has(&["[[inputs.modbus"]) {
        t!("a configuration of Telegraf (TOML)")
    } else if has(&["[[tag]]"]) || has(&["[[device]]"]) {
        t!("a device profile or a plant file: put it into the folder of profiles, or open it with sightglass FILE")
    } else if text.starts_with('<') {
        t!("HTML or XML: copy its table, or save it as CSV")
    } else if has(&["parameters:"]) && has(&["- group:"]) {
        t!("a device of ha-solarman (YAML)")
    } else if ["read_only_word:", "read_write_word:", "read_only_boolean:", "read_write_boolean:"]
        .iter()
        .any(|key| has(&[key]))
    {
        t!("a device of modbus_local_gateway (YAML)")
    } else if has(&["modbus:"]) || has(&["input_type:"]) {
        t!("a configuration of Home Assistant (YAML)")
    } else if is_yaml(text) {
        t!("YAML, which is no list of registers")
    } else {
        return None;
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
    fn a_foreign_form_is_called_by_its_name() {
        for (text, name) in [
            ("{ \"group\": { \"points\": [] }, \"id\": 101 }", "SunSpec"),
            ("{ \"device_type\": \"x\", \"device\": { \"channels\": [] } }", "wb-mqtt"),
            ("[[inputs.modbus]]\nname = \"a\"\n", "Telegraf"),
            ("title = \"a\"\n[[device]]\nname = \"b\"\n", "plant file"),
            ("<table><tr><td>40001</td></tr></table>", "HTML"),
            ("default:\n  update_interval: 5\nparameters:\n  - group: PV\n    items:\n", "solarman"),
            ("device:\n  model: A\nread_only_word:\n  power:\n    address: 84\n", "local_gateway"),
            ("modbus:\n  - name: hub\n    type: tcp\n", "Home Assistant"),
            ("a: 1\nb: 2\nc:\n  - d: 3\n", "YAML"),
            ("PK\u{3}\u{4}rest", "workbook"),
            ("[1, 2]", "JSON"),
        ] {
            assert!(form(text).is_some_and(|form| form.contains(name)), "{text}: {:?}", form(text));
        }
        for list in [
            "40001  Voltage L1  float  V\n",
            "address,name\n5,a\n",
            "{ \"registers\": { \"holdings\": [] } }",
            "",
            "5 a\n",
        ] {
            assert_eq!(form(list), None, "{list}");
        }
    }
}
