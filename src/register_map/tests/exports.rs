//! An export, read again, is the same registers.

use super::list_of;
use crate::{
    plant::{
        PlantDef,
        tag::{Access, Bound, DataType, TagDef},
    },
    profile::{self, Kind, Search},
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
        let (bad, unit) = (&tag.bad_if, if tag.unit_from.is_some() { "" } else { &tag.unit });
        words.push_str(&format!(" {unit} {:?} {bad:?}", tag.decimals));
    }
    if target == Target::Csv {
        let (labels, bits) = (&tag.enum_labels, &tag.bit_labels);
        let is_sent = is_written(tag);
        let access = if is_sent { tag.access } else { Access::Read };
        let (place, function) = (tag.write_at.filter(|_| is_sent), tag.write_fc.filter(|_| is_sent));
        let fixed = |bound: Option<Bound>| bound.filter(|bound| matches!(bound, Bound::Fixed(_)));
        words.push_str(&format!(" {access:?} {:?} {:?} {place:?} {function:?}", fixed(tag.min), fixed(tag.max)));
        words.push_str(&format!(" {} {} {labels:?} {bits:?} {} {:?}", tag.short, tag.label, tag.group, tag.poll));
    }
    words
}

/// Is it written without another register, or limits that one gives?
fn is_written(tag: &TagDef) -> bool {
    let is_open = |bound: Option<Bound>| matches!(bound, Some(bound) if !matches!(bound, Bound::Fixed(_)));
    tag.writable() && tag.write_unlock.is_none() && !is_open(tag.min) && !is_open(tag.max)
}

/// What is left out of an export as a list, and what it is once it is read again.
fn round_trip(name: &str, plant: &PlantDef) {
    let exported = export(plant, Target::Csv);
    let list = list_of(&exported.text);
    let said: Vec<String> = list.problems.iter().cloned().chain(list.said_of_rows()).collect();
    assert_eq!((&list.refused, &said, &list.questions), (&None, &Vec::new(), &Vec::new()), "{name}\n{}", exported.text);
    let left_out: Vec<&str> = exported.left_out.iter().filter_map(|line| line.split(": ").next()).collect();
    let kept = plant.tags.iter().filter(|tag| !left_out.contains(&tag.short.as_str()));
    let read: Vec<String> = list.named.iter().map(|named| essence(&named.tag(&named.name), Target::Csv)).collect();
    for (read, tag) in read.iter().zip(kept) {
        assert_eq!(*read, essence(tag, Target::Csv), "{name}");
    }
    assert_eq!(read.len(), exported.count, "{name}");
}

#[test]
fn every_shipped_profile_comes_back_from_a_list() {
    let shipped = profile::list(&Search::shipped());
    let devices = shipped.iter().filter(|listed| listed.kind == Kind::Device);
    let mut count = 0;
    for device in devices {
        let text = profile::text_of(&device.name, &Search::shipped()).expect("it is shipped");
        let checked = profile::check_text(&device.name, &text).unwrap_or_else(|errors| panic!("{errors}"));
        if export(&checked.plant, Target::Csv).count != 0 {
            round_trip(&device.name, &checked.plant);
            count += 1;
        }
    }
    assert!(100 < count, "{count} profiles");
}

#[test]
fn a_list_keeps_what_a_spreadsheet_or_a_write_could_change() {
    let text = r#"
vendor = "a"
model = "b"
status = "manual"
source = "none"
address_base = 0
[[tag]]
name = "-1"
table = "holding"
address = 1
type = "float32"
scale = 10
unit = "=A1"
label = "@odd; 'label', and more"
group = "+x"
bad_if = [0x7FC00000, 0x7F7FFFFF, -9999, [10000, 20000]]
poll = "once"
[[tag]]
name = "SET"
table = "input"
address = 2
type = "uint16"
access = "rw"
write_address = "holding:7"
write_fc = 16
enum = { 0 = "off; on", 1 = 'a\b = c', 2 = "d,e" }
poll = "500ms"
[[tag]]
name = "UNLOCK"
table = "holding"
address = 8
type = "uint16"
access = "rw"
[[tag]]
name = "LOCKED"
table = "holding"
address = 9
type = "uint16"
access = "rw"
max_from = "UNLOCK"
"#;
    let plant = profile::check_text("made_up", text).unwrap_or_else(|errors| panic!("{errors}")).plant;
    round_trip("made_up", &plant);
    let exported = export(&plant, Target::Csv);
    let formulas = exported.text.split([',', '\n']).filter(|cell| cell.starts_with(['=', '@', '+']));
    assert_eq!(formulas.count(), 0, "{}", exported.text);
    assert!(exported.text.contains("input:2,") && exported.text.contains("holding:7"), "{}", exported.text);
    assert!(
        exported.text.lines().all(|line| !line.ends_with(',')),
        "each says how often it is read: {}",
        exported.text
    );
    assert_eq!(exported.lost, ["LOCKED: writing it, which needs more than a list can say, limits from another tag"]);
}

#[test]
fn home_assistant_takes_whole_numbers_for_no_value() {
    let of = |bad: &str| {
        let text = format!(
            "vendor = 'a'\nmodel = 'b'\nstatus = 'manual'\nsource = 'none'\naddress_base = 0\n[[tag]]\nname = 'F'\ntable = 'input'\naddress = 1\ntype = 'float32'\nbad_if = [{bad}]\n"
        );
        let plant = profile::check_text("made_up", &text).unwrap_or_else(|errors| panic!("{errors}")).plant;
        let exported = export(&plant, Target::HomeAssistant);
        (
            exported.text.lines().find_map(|line| line.trim().strip_prefix("nan_value: ").map(str::to_owned)),
            exported.lost,
        )
    };
    assert_eq!(of("-9999"), (Some("-9999".to_owned()), Vec::new()));
    assert_eq!(of("0x7FC00000, 7"), (Some("7".to_owned()), Vec::new()));
    assert_eq!(of("0x3FC00000"), (None, vec!["F: a number that means \"no value\" and is not whole".to_owned()]));
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
