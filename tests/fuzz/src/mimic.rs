//! The picture of a mimic: it is refused with reasons, or drawn.

use super::{common::checked, expression::quoted, plant::draw};

const PLANT: &str = r#"
title = "P"
time_zone = "UTC"
[[line]]
name = "L1"
mode = "tcp"
host = "plc"
[[device]]
name = "D"
profile = "fuji_pxr"
line = "L1"
unit = 1
[[device.tag]]
name = "PV"
min = 0
max = 100
[mimic]
name = "one"
[mimic.alias]
V = "value D.PV"
L = "level D.PV"
[[mimic.page]]
name = "two"
picture = "{page one}"
"#;

/// The picture.
pub fn run(data: &[u8]) {
    let Ok(picture) = std::str::from_utf8(data) else { return };
    let text = PLANT.replace("[mimic]\n", &format!("[mimic]\npicture = {}\n", quoted(picture)));
    if let Some(def) = checked(&text) {
        draw(&def);
    }
}
