//! Tests of the messages: for each mistake the file, the line, what is wrong, and what was probably meant.
#![allow(clippy::unwrap_used)]

mod alarms;
mod batches;
mod calculated;
mod foreign_maps;
mod inline;
mod listening;
mod interlocks;
mod messages;
mod new_plants;
mod north;
mod pictures;
mod reports;
mod text_tags;
mod texts;

use proptest::prelude::*;

use super::{
    diagnostic::{Errors, render},
    plant::{Library, Text, build},
};
use crate::plant::{
    def::{Condition, DeviceId, HistoryDef, LineId, ParquetVersion, PlantDef, Priority, Role, Subject},
    interlock::InterlockCondition,
    station_fault::StationFault,
    tag::{Bound, DataType, PollClass},
};

/// A small plant that is right. Each case changes some words of it.
pub(super) const PLANT: &str = r#"title = "Small"
time_zone = "Asia/Bangkok"

[[line]]
name = "L1"
mode = "rtu"
port = "/dev/ttyS0"
baud = 9600
parity = "N"

[[device]]
name = "D1"
profile = "meter"
line = "L1"
unit = 1
fast = "1s"

[[device]]
name = "PLC"
profile = "plc"
line = "L1"
unit = 2

[[alarm]]
tag = "D1.T"
high = 80.0
deadband = 1.0
priority = "high"
message = "hot"

[mimic]
picture = '''
 {D1.T  }
'''
"#;

pub(super) const METER: &str = r#"vendor = "ACME"
model = "M1"
status = "manual"
source = "manual"

[limits]
read_registers_max = 60
alignment = 1

[[tag]]
name = "T"
table = "holding"
address = 1002
modicon = 41003
type = "int16"
unit = "°C"
decimals_from = "DP"
min = 0
max = 100

[[tag]]
name = "DP"
table = "holding"
address = 1004
type = "uint16"

[[tag]]
name = "MODE"
table = "holding"
address = 1005
type = "uint16"
access = "rw"
enum = { 0 = "off", 1 = "on" }

[[action]]
name = "START"
tag = "MODE"
value = "on"
confirm = "Start?"
"#;

pub(super) const PLC: &str = r#"vendor = "KOYO"
model = "DL06"
status = "manual"
source = "manual"
scheme = "directlogic"

[[tag]]
name = "STEP"
address = "V2000"
type = "bcd16"

[[tag]]
name = "OUT"
address = "Y17"
"#;

pub(super) fn load(plant: &[u8], meter: &str, plc: &str) -> Result<PlantDef, Errors> {
    load_warned(plant, meter, plc).map(|(def, _)| def)
}

fn load_warned(plant: &[u8], meter: &str, plc: &str) -> Result<(PlantDef, Errors), Errors> {
    let find = |name: &str| {
        let text = match name {
            "meter" => meter,
            "plc" => plc,
            _ => return Ok(None),
        };
        Ok(Some(Text { file: format!("{name}.toml"), bytes: text.as_bytes().to_vec() }))
    };
    let library =
        Library { find: &find, names: vec!["meter".to_owned(), "plc".to_owned()], is_program: &|name| name == "curl" };
    build("small", &Text { file: "small.toml".to_owned(), bytes: plant.to_vec() }, &library)
}

/// Replaces `from` by `to` in the text that has it; the rendering must contain all of `expect`, and exactly one problem.
pub(super) fn check(from: &str, to: &str, expect: &[&str]) {
    let errors = changed(&[(from, to)]);
    let text = errors.to_string();
    for piece in expect {
        assert!(text.contains(piece), "`{from}` -> `{to}`: no `{piece}` in\n{text}");
    }
    assert_eq!(errors.count(), 1, "`{from}` -> `{to}`: one mistake, one message\n{text}");
}

fn changed(changes: &[(&str, &str)]) -> Errors {
    let mut texts = [PLANT.to_owned(), METER.to_owned(), PLC.to_owned()];
    for (from, to) in changes {
        let text = texts.iter_mut().find(|text| text.contains(from)).unwrap_or_else(|| panic!("no text has `{from}`"));
        *text = text.replacen(from, to, 1);
    }
    load(texts[0].as_bytes(), &texts[1], &texts[2]).expect_err("the change must be a mistake")
}

#[test]
fn the_small_plant_is_right() {
    let plant = load(PLANT.as_bytes(), METER, PLC).unwrap_or_else(|errors| panic!("{errors}"));
    assert_eq!(plant.name, "small");
    let own = plant.alarms.iter().filter(|alarm| alarm.subject != Subject::Station).count();
    assert_eq!(own, 5, "one written, not responding for two devices, overloaded and another master for the line");
    assert_eq!(plant.alarms.len(), 5 + StationFault::ALL.len(), "and the faults of the station");
    assert!(matches!(plant.alarms[1].condition, Condition::NotResponding));
    assert!(matches!(plant.alarms[3].condition, Condition::Overloaded));
    assert_eq!(plant.trends.len(), 1, "a group of pens is made up");
}

#[test]
fn an_address_that_cannot_be_is_shown_to_the_digit() {
    check(
        "V2000",
        "V40508",
        &[
            "[plc.toml:9:17]",
            "`V40508` does not exist: DirectLOGIC counts in octal",
            "`8` is not an octal digit",
            "after V7 comes V10",
        ],
    );
    check("Y17", "Y18", &["[plc.toml:14:14]", "`Y18` does not exist", "after Y7 comes Y10"]);
    check("Y17", "Q1", &["`Q1` is not a DirectLOGIC address"]);
    check("1004", "\"V2000\"", &["[meter.toml:24:11]", "`V2000` is not an address", "scheme = \"directlogic\""]);
    check("1004", "70000", &["70000 is out of range", "a whole number from 0 to 65535"]);
    check(
        "1004",
        "\"0x3EC\"\nmodicon = 41006",
        &[
            "modicon 41006 does not fit address 1004",
            "holding 1004 (0x03EC) is 41005",
            "41006 is holding 1005 (0x03ED)",
        ],
    );
    check(
        "address = 1004\ntype = \"uint16\"",
        "address = 65535\ntype = \"float32\"",
        &["extends past the last address"],
    );
}

#[test]
fn two_tags_cannot_see_one_register_with_different_eyes() {
    check(
        "address = 1004\ntype = \"uint16\"",
        "address = 1004\ntype = \"float32\"",
        &["[meter.toml:30:11]", "D1.DP and D1.MODE overlap with different types", "D1.DP begins at 1004"],
    );
    check(
        "alignment = 1",
        "alignment = 2\n[[tag]]\nname = 'E'\ntable = 'input'\naddress = 7\ntype = 'float32'",
        &["a value of 2 registers at address 7 breaks alignment = 2", "expected a multiple of 2"],
    );
    check(
        "read_registers_max = 60",
        "read_registers_max = 200",
        &["[meter.toml:7:22]", "read_registers_max = 200 is not possible", "the Modbus standard allows 1 to 125"],
    );
}

#[test]
fn a_mistyped_word_brings_the_right_one() {
    check(
        "deadband = 1.0",
        "deadbnd = 1.0\ndeadband = 1.0",
        &["[small.toml:27:1]", "unknown key `deadbnd` in an alarm", "did you mean `deadband`?"],
    );
    check("type = \"bcd16\"", "type = \"bdc16\"", &["unknown type `bdc16`", "did you mean `bcd16`?"]);
    check(
        "profile = \"meter\"",
        "profile = \"metr\"",
        &["[small.toml:13:11]", "unknown profile `metr`", "did you mean `meter`?"],
    );
    check(
        "tag = \"D1.T\"\nhigh",
        "tag = \"D1.DPP\"\nhigh",
        &["[small.toml:25:7]", "unknown tag `D1.DPP`", "did you mean `D1.DP`?"],
    );
    check("{D1.T  }", "{D1.MOD}", &["[small.toml:33:3]", "unknown tag `D1.MOD`", "did you mean `D1.MODE`?"]);
    check("decimals_from = \"DP\"", "decimals_from = \"PD\"", &["unknown tag `PD` in D1", "did you mean `DP`?"]);
    check(
        "line = \"L1\"\nunit = 2",
        "line = \"L2\"\nunit = 2",
        &["[small.toml:21:8]", "unknown line `L2`", "did you mean `L1`?"],
    );
    check(
        "Asia/Bangkok",
        "Asia/Bankok",
        &["[small.toml:2:13]", "unknown time zone `Asia/Bankok`", "did you mean `Asia/Bangkok`?"],
    );
    check("value = \"on\"", "value = \"onn\"", &["`onn` is not a state of D1.MODE", "did you mean `on`?"]);
    check("mode = \"rtu\"", "mode = \"asci\"", &["unknown mode `asci`", "did you mean `ascii`?"]);
    check(
        "priority = \"high\"",
        "priority = \"urgent\"",
        &["unknown priority `urgent`", "known: critical, high, medium, low"],
    );
}

#[test]
fn a_name_is_used_once() {
    check(
        "name = \"DP\"",
        "name = \"DP\"\ntable = \"input\"\naddress = 1\ntype = \"uint16\"\n[[tag]]\nname = \"DP\"",
        &["duplicate tag `DP`", "first here"],
    );
    check("name = \"PLC\"", "name = \"D1\"", &["[small.toml:19:8]", "duplicate device `D1`", "first here"]);
    check("[[device]]", "[[line]]\nname = \"L1\"\nmode = \"tcp\"\nhost = \"a\"\n[[device]]", &["duplicate line `L1`"]);
    check("unit = 2", "unit = 1", &["[small.toml:22:8]", "unit 1 is used twice on line L1", "first here"]);
    check("unit = 2", "unit = 0", &["unit 0 is a broadcast", "PLC.STEP can never be read", "expected 1 to 247"]);
}

#[test]
fn a_value_of_the_wrong_kind_is_named() {
    check(
        "baud = 9600",
        "baud = \"9600\"",
        &["[small.toml:8:8]", "found a string, expected a whole number from 0 to 4294967295"],
    );
    check("high = 80.0", "high = \"80\"", &["found a string, expected a number"]);
    check("fast = \"1s\"", "fast = \"1 sek\"", &["[small.toml:16:8]", "`1 sek` is not a duration", "\"500ms\""]);
    check("fast = \"1s\"", "fast = 1", &["found a whole number, expected a duration"]);
    check("fast = \"1s\"", "fast = \"0s\"", &["not a poll period"]);
    for (count, why) in [("", "string"), ("(0)", "string(0)"), ("(251)", "string(251)"), ("(x)", "string(x)")] {
        check(
            "type = \"uint16\"\n\n[[tag]]\nname = \"MODE\"",
            &format!("type = \"string{count}\"\n\n[[tag]]\nname = \"MODE\""),
            &[&format!("`{why}` does not say how long the text is"), "N bytes, 1 to 250"],
        );
    }
    check(
        "1 = \"on\"",
        "1 = \"on\", 70000 = \"far\"",
        &["enum value 70000 (far) does not fit the type", "the type holds 0 to 65535"],
    );
    check("name = \"OUT\"", "", &["a tag needs `name`"]);
    check("line = \"L1\"\nunit = 2", "unit = 2", &["a device needs `line`"]);
}

#[test]
fn the_disk_space_that_the_history_needs_is_read_and_checked() {
    let with =
        |keys: &str| load(PLANT.replace("\n[mimic]", &format!("\n[history]\n{keys}\n[mimic]")).as_bytes(), METER, PLC);
    let read = |keys: &str| with(keys).unwrap_or_else(|errors| panic!("{errors}")).history;
    let usual = HistoryDef::default();
    assert_eq!(load(PLANT.as_bytes(), METER, PLC).unwrap().history, usual, "without the table");
    assert_eq!(read("disk_free_percent_min = 5"), HistoryDef { disk_free_percent_min: 5, ..usual });
    assert_eq!(read("disk_free_mib_min = 0"), HistoryDef { disk_free_mib_min: 0, ..usual });
    assert_eq!(
        read("keep_samples_days = 730\nparquet = \"v2\"\ndisk_share_percent_max = 20"),
        HistoryDef { keep_samples_days: Some(730), parquet: ParquetVersion::V2, disk_share_percent_max: 20, ..usual }
    );
    for (key, expect) in [
        ("keep_minutes_days = 6", ["[small.toml:32:21]", "6 cannot be used here", "expected 7 … 36500"]),
        ("disk_share_percent_max = 0", ["[small.toml:32:26]", "0 cannot be used here", "expected 1 … 95"]),
        ("parquet = \"v3\"", ["[small.toml:32:11]", "`v3`", "`v1`"]),
        ("disk_free_percent_min = 51", ["[small.toml:32:25]", "51 cannot be used here", "expected 0 … 50"]),
        ("disk_free_mib_min = 1048577", ["[small.toml:32:21]", "1048577 cannot be used here", "expected 0 … 1048576"]),
        ("disk_free_mib_min = \"1 GiB\"", ["[small.toml:32:21]", "found a string", "expected a whole number"]),
        (
            "disk_free_percent = 5",
            ["[small.toml:32:1]", "unknown key `disk_free_percent` in the history", "disk_free_percent_min"],
        ),
    ] {
        let text = with(key).expect_err(key).to_string();
        expect.iter().for_each(|piece| assert!(text.contains(piece), "{key}: no `{piece}` in\n{text}"));
    }
}

#[test]
fn a_plant_file_may_change_a_tag_but_not_contradict_itself() {
    let moved = "fast = \"1s\"\n[[device.tag]]\nname = \"T\"\naddress = 1010\nmax = 90";
    let plant =
        load(PLANT.replacen("fast = \"1s\"", moved, 1).as_bytes(), METER, PLC).unwrap_or_else(|e| panic!("{e}"));
    let tag = plant.tag(plant.tag_named("D1.T").unwrap());
    let fixed = |bound: f64| Some(Bound::Fixed(bound.into()));
    assert_eq!((tag.point.address, tag.max, tag.min), (1010, fixed(90.0), fixed(0.0)));
    assert_eq!(tag.unit, "°C", "what the plant file does not say stays as the profile has it");
    let both = "fast = \"1s\"\n[[device.tag]]\nname = \"T\"\nmax = 90\nmax_from = \"DP\"";
    check("fast = \"1s\"", both, &["`max` and `max_from` exclude each other"]);
    check("unit = \"°C\"", "unit_from = \"MODE\"", &["D1.MODE gives no unit: `off` is not a unit"]);
}

#[test]
fn alarm_inputs_are_hard_unless_a_file_says_otherwise() {
    let class_of = |plant: &str, tag: &str| {
        let def = load(plant.as_bytes(), METER, PLC).unwrap();
        def.tag(def.tag_named(tag).unwrap()).class
    };
    for (tag, class) in [("D1.T", PollClass::Critical), ("D1.DP", PollClass::Critical), ("D1.MODE", PollClass::Normal)]
    {
        assert_eq!(class_of(PLANT, tag), class, "{tag}: an alarm watches T, and DP says where its point is");
    }
    let written =
        PLANT.replace("fast = \"1s\"\n", "fast = \"1s\"\n[[device.tag]]\nname = \"T\"\npoll_class = \"background\"\n");
    assert_eq!(class_of(&written, "D1.T"), PollClass::Background);
    let wrong = written.replace("background", "backgroun");
    let error = load(wrong.as_bytes(), METER, PLC).unwrap_err().to_string();
    assert!(error.contains("did you mean `background`?"), "{error}");
}

#[test]
fn files_of_other_systems_are_read() {
    let windows = format!("\u{feff}{}", PLANT.replace('\n', "\r\n"));
    assert!(load(windows.as_bytes(), METER, PLC).is_ok(), "byte order mark and CR LF");
}

#[test]
fn an_action_asks_before_it_acts() {
    check("confirm = \"Start?\"\n", "", &["an action needs `confirm`"]);
    check("access = \"rw\"\n", "", &["D1.MODE cannot be written"]);
}

#[test]
fn a_program_names_tags_that_take_commands() {
    let with = |program: &str| {
        let text = format!("status = \"manual\"\nsource = \"manual\"\n\n[program]\n{program}\n\n[limits]");
        move |expect: &[&str]| check("status = \"manual\"\nsource = \"manual\"\n\n[limits]", &text, expect)
    };
    let whole = "position = \"DP\"\ncommand = \"MODE\"\nrun = \"on\"\noff = \"off\"\n";
    let step = "steps = [{ sv = \"MODE\", ramp = \"MODE\", soak = \"MODE\" }]\n";
    with(&format!("{whole}steps = []"))(&["a program needs `steps`"]);
    with(&format!("{step}{}", whole.replace("\"on\"", "\"go\"")))(&["`go` is not a state of D1.MODE"]);
    with(&format!("{step}{}", whole.replace("MODE", "MOD")))(&["unknown tag `MOD` in D1", "did you mean `MODE`?"]);
    with(&format!("{whole}steps = [{{ sv = \"T\", ramp = \"MODE\", soak = \"MODE\" }}]"))(&["D1.T cannot be written"]);
    with(&format!("{whole}{step}patterns = [[1, 2]]"))(&["from step 1 to step 2", "within 1 to 1"]);
}

#[test]
fn a_setting_can_be_written_and_a_default_be_held() {
    check("min = 0\nmax = 100\n", "min = 0\nmax = 100\nset = true\n", &["D1.T cannot be part of a parameter set"]);
    let labels = "enum = { 0 = \"off\", 1 = \"on\" }\n";
    check(labels, &format!("{labels}default = \"of\"\n"), &["`of` is not a state of D1.MODE", "did you mean"]);
}
