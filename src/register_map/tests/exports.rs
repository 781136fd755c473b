//! An export, read again, is the same registers.

use super::list_of;
use crate::{
    plant::{
        exact::Exact,
        tag::{DataType, TagDef},
    },
    register_map::export::{Target, export},
};

const PROFILE: &str = r#"
vendor = "a"
model = "b"
status = "manual"
source = "none"
address_base = 0
[[tag]]
name = "PV"
table = "input"
address = 40001
type = "int16"
scale = 0.1
offset = 2.5
decimals = 1
unit = "°C"
bad_if = [0x8000]
[[tag]]
name = "W"
table = "holding"
address = 10
type = "float32"
order = "CDAB"
unit = "W"
decimals = 1
[[tag]]
name = "E"
table = "holding"
address = 12
type = "uint64"
order = "DCBA"
scale = 0.001
decimals = 3
[[tag]]
name = "MODE"
table = "holding"
address = 20
type = "uint16"
access = "rw"
min = 0
max = 2
enum = { 0 = "off", 2 = "on; always" }
group = "Set"
[[tag]]
name = "BIT"
table = "holding"
address = 21
type = "uint16"
field = 3
[[tag]]
name = "FIELD"
table = "holding"
address = 21
type = "uint16"
field = "7-4"
[[tag]]
name = "WORD"
table = "holding"
address = 22
type = "uint16"
order = "BADC"
bits = { 0 = "a", 15 = "b" }
[[tag]]
name = "BYTE"
table = "holding"
address = 23
type = "int8"
order = "BADC"
[[tag]]
name = "SER"
table = "holding"
address = 30
type = "cstring(8)"
[[tag]]
name = "BCD"
table = "holding"
address = 40
type = "bcd16"
[[tag]]
name = "RUN"
table = "coil"
address = 1
access = "rw"
[[tag]]
name = "DOOR"
table = "discrete"
address = 2
[[tag]]
name = "SUM"
expr = "PV + W"
"#;

/// What a register is, of whatever program.
fn essence(tag: &TagDef, target: Target) -> String {
    let point = tag.point;
    let order = if point.len() == 1 && point.table.is_bits() { "" } else { point.order.word() };
    let mut words = format!(
        "{}:{} {} {order} {:?} {} {}",
        point.table.word(),
        point.address,
        point.kind,
        point.field,
        tag.scale,
        tag.offset
    );
    if target != Target::Telegraf && point.kind != DataType::Bool {
        let bad: Vec<Exact> = tag.bad_if.clone();
        words.push_str(&format!(" {} {:?} {bad:?}", tag.unit, tag.decimals));
    }
    if target == Target::Csv {
        words.push_str(&format!(" {:?} {:?} {:?} {:?} {}", tag.access, tag.min, tag.max, tag.bit_labels, tag.group));
    }
    words
}

#[test]
fn an_export_that_is_imported_has_the_same_registers() {
    let plant = crate::profile::check_text("made_up", PROFILE).unwrap_or_else(|errors| panic!("{errors}")).plant;
    for (target, left_out) in [
        (Target::HomeAssistant, &["SUM", "BIT", "FIELD", "BYTE", "BCD"][..]),
        (Target::Telegraf, &["SUM", "PV", "FIELD", "BCD"]),
        (Target::Csv, &["SUM"]),
    ] {
        let exported = export(&plant, target);
        let names: Vec<&str> = exported.left_out.iter().filter_map(|line| line.split(':').next()).collect();
        assert_eq!(names, left_out, "{target:?}");
        let list = list_of(&exported.text);
        assert_eq!((&list.refused, &list.problems), (&None, &Vec::new()), "{}", exported.text);
        let mut read: Vec<String> = list.named.iter().map(|named| essence(&named.tag(&named.name), target)).collect();
        let kept = plant.tags.iter().filter(|tag| !left_out.contains(&tag.short.as_str()));
        let mut expect: Vec<String> = kept.map(|tag| essence(tag, target)).collect();
        read.sort();
        expect.sort();
        assert_eq!(read, expect, "{target:?}\n{}", exported.text);
        assert_eq!(exported.count, expect.len());
    }
}

#[test]
fn what_the_other_program_cannot_say_is_listed() {
    let plant = crate::profile::check_text("made_up", PROFILE).unwrap_or_else(|errors| panic!("{errors}")).plant;
    let lost = export(&plant, Target::HomeAssistant).lost;
    assert_eq!(lost, ["MODE: writing it, names of its numbers", "WORD: names of its bits"]);
    let lost = export(&plant, Target::Telegraf).lost;
    assert!(lost.contains(&"MODE: writing it, names of its numbers".to_owned()), "{lost:?}");
}
