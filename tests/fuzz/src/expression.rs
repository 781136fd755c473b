//! An expression over tags: of a calculated tag, and as a condition.

use super::common::{checked, run_plant};

const PLANT: &str = r#"
title = "P"
time_zone = "UTC"
[[line]]
name = "L1"
mode = "tcp"
host = "plc"
[[device]]
name = "D"
profile = "koyo_dl06"
line = "L1"
unit = 1
[[device.tag]]
name = "A"
address = "C0"
poll = "fast"
label = "a"
meaning = "a"
enum = { 0 = "OFF", 1 = "ON" }
[[device.tag]]
name = "B-1"
address = "V2010"
type = "uint16"
scale = 0.1
unit = "cm"
min = 0
max = 40
poll = "fast"
label = "b"
meaning = "b"
"#;

/// The words of the expression, without a quote of TOML around them.
pub fn run(data: &[u8]) {
    let Ok(words) = std::str::from_utf8(data) else { return };
    let words = quoted(words);
    let tag = "[[device.tag]]\nname = \"X\"\nlabel = \"x\"\nmeaning = \"x\"\nexpr = ";
    let alarm = "[[alarm]]\ntag = \"D.B-1\"\nhigh = 30\npriority = \"high\"\nmessage = \"m\"\ncause = \"c\"\neffect = \"e\"\n\
                 action = \"a\"\nresponse_time = \"10min\"\ndeadband = 1.0\non_delay = \"5s\"\nenabled_when = ";
    for part in [tag, alarm] {
        if let Some(def) = checked(&format!("{PLANT}{part}{words}\n")) {
            run_plant(&def);
        }
    }
}

/// As TOML holds it: as it is where it can be, else escaped.
pub fn quoted(words: &str) -> String {
    let is_plain = !words.contains("'''") && !words.ends_with('\'') && !words.contains('\r');
    if is_plain { format!("'''{words}'''") } else { serde_json::to_string(words).expect("a text") }
}
