//! Tests of the messages: for each mistake the file, the line, what is wrong, and what was probably meant.
#![allow(clippy::unwrap_used)]

use proptest::prelude::*;

use super::{
    diagnostic::{Errors, render},
    plant::{Library, Text, build},
};
use crate::plant::{
    def::{Condition, HistoryDef, LineId, PlantDef, Subject},
    interlock::InterlockCondition,
    station::StationFault,
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
item = [
    { kind = "value", x = 1, y = 1, tag = "D1.T" },
]
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
    let find = |name: &str| {
        let text = match name {
            "meter" => meter,
            "plc" => plc,
            _ => return Ok(None),
        };
        Ok(Some(Text { file: format!("{name}.toml"), bytes: text.as_bytes().to_vec() }))
    };
    let library = Library { find: &find, names: vec!["meter".to_owned(), "plc".to_owned()] };
    build("small", &Text { file: "small.toml".to_owned(), bytes: plant.to_vec() }, &library).map(|(def, _)| def)
}

/// Replaces `from` by `to` in whichever of the three texts has it; the rendering must then contain all of `expect`,
/// and hold exactly one problem.
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
    assert_eq!(own, 4, "one written, not answering for two devices, and overloaded for the line");
    assert_eq!(plant.alarms.len(), 4 + StationFault::ALL.len(), "and the faults of the station");
    assert!(matches!(plant.alarms[1].condition, Condition::NotAnswering));
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
        &["reaches past the last address"],
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
    check("°C", "degC", &["unknown unit `degC`", "did you mean `°C`?"]);
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
    check(
        "tag = \"D1.T\" }",
        "tag = \"D1.MOD\" }",
        &["[small.toml:33:43]", "unknown tag `D1.MOD`", "did you mean `D1.MODE`?"],
    );
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
    check("kind = \"value\"", "kind = \"valve_\"", &["unknown kind `valve_`", "did you mean `valve`?"]);
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
        "name = \"DP\"\ntable = \"input\"\naddress = 1\ntype = \"int16\"\n[[tag]]\nname = \"DP\"",
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
    let usual = HistoryDef { disk_free_percent_min: 10, disk_free_mib_min: 1_024 };
    assert_eq!(load(PLANT.as_bytes(), METER, PLC).unwrap().history, usual, "without the table");
    assert_eq!(read("disk_free_percent_min = 5"), HistoryDef { disk_free_percent_min: 5, ..usual });
    assert_eq!(read("disk_free_mib_min = 0"), HistoryDef { disk_free_mib_min: 0, ..usual });
    for (key, expect) in [
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

/// A tag that holds text, added to the small plant's meter.
fn with_text(keys: &str) -> Result<PlantDef, Errors> {
    let text = "\n[[tag]]\nname = \"MODEL\"\ntable = \"holding\"\naddress = 2000\n";
    load(PLANT.as_bytes(), &format!("{METER}{text}{keys}\n"), PLC)
}

#[test]
fn a_text_is_read_and_never_stored() {
    let plant = with_text("type = \"string(9)\"\norder = \"BADC\"").unwrap();
    let tag = plant.tag(plant.tag_named("D1.MODEL").unwrap());
    assert_eq!((tag.point.kind, tag.point.len()), (DataType::Text(9), 5));
    assert!(tag.is_text() && !tag.store && !tag.writable());
}

#[test]
fn a_text_takes_no_key_that_is_for_numbers() {
    for (key, expect) in [
        ("scale = 0.1", "`scale` is for numbers, this is a text"),
        ("unit = \"s\"", "`unit` is for numbers"),
        ("max = 5", "`max` is for numbers"),
        ("enum = { 0 = \"a\" }", "`enum` is for numbers"),
        ("bad_if = [0]", "`bad_if` is for numbers"),
        ("field = 3", "this is not a field of bits"),
        ("order = \"CDAB\"", "the words of a text are never reversed"),
        ("access = \"rw\"", "a text can only be read"),
        ("store = true", "the history keeps numbers, this is a text"),
    ] {
        let text = with_text(&format!("type = \"string(8)\"\n{key}")).expect_err(key).to_string();
        assert!(text.contains(expect), "{key}: {text}");
    }
    let long = with_text("type = \"string(250)\"").expect_err("60 registers are read at most").to_string();
    assert!(long.contains("the value takes 125 registers, the device reads at most 60"), "{long}");
}

#[test]
fn nothing_counts_with_a_text() {
    let text = "\n[[tag]]\nname = \"MODEL\"\ntable = \"holding\"\naddress = 2000\ntype = \"string(8)\"\n";
    let meter = format!("{METER}{text}");
    for (from, to) in [
        ("tag = \"D1.T\"\nhigh", "tag = \"D1.MODEL\"\nhigh"),
        ("\n[mimic]", "\n[[trend]]\nname = \"t\"\npens = [{ tag = \"D1.MODEL\" }]\n\n[mimic]"),
        ("\n[mimic]", "\n[report]\ntags = [\"D1.MODEL\"]\n\n[mimic]"),
    ] {
        assert!(PLANT.contains(from), "{from}");
        let text = load(PLANT.replace(from, to).as_bytes(), &meter, PLC).expect_err(to).to_string();
        assert!(text.contains("D1.MODEL is a text"), "{to}: {text}");
    }
    let shown = PLANT.replace("y = 1, tag = \"D1.T\"", "y = 1, tag = \"D1.MODEL\"");
    assert!(load(shown.as_bytes(), &meter, PLC).is_ok(), "the mimic may show it");
    let scaled = meter.replace("decimals_from = \"DP\"", "decimals_from = \"MODEL\"");
    let text = load(PLANT.as_bytes(), &scaled, PLC).expect_err("no decimals").to_string();
    assert!(text.contains("D1.MODEL is a text"), "{text}");
}

/// The small plant with more tables before its mimic.
fn interlocked(tables: &str) -> Result<PlantDef, Errors> {
    load(PLANT.replace("[mimic]", &format!("{tables}\n[mimic]")).as_bytes(), METER, PLC)
}

#[test]
fn an_interlock_says_what_blocks_which_value() {
    let lock = "[[interlock]]\ntag = \"D1.MODE\"\nvalue = \"on\"\nof = \"D1.T\"\nabove = 80\nmessage = \"too hot\"\n";
    let plant = interlocked(lock).unwrap();
    let found = &plant.logic.interlocks[0];
    assert_eq!((found.value, found.when, found.refuse), (1.0, InterlockCondition::Above(80.0), false));
    let off = interlocked(&lock.replace("\"on\"", "\"off\"")).unwrap();
    assert!(!off.logic.interlocks[0].refuse, "switching off is told, never refused");
    for (from, to, expect) in [
        ("value = \"on\"", "value = \"off\"\nrefuse = true", "switching off is never refused"),
        ("value = \"on\"", "value = \"full\"", "`full` is not a state of D1.MODE"),
        ("above = 80", "", "an interlock needs a condition"),
        ("above = 80", "above = 80\nbelow = 3", "an interlock has one condition"),
        ("above = 80", "bit = 16", "D1.T has no bit 16"),
        ("of = \"D1.T\"", "of = \"D1.X\"", "unknown tag `D1.X`"),
        ("tag = \"D1.MODE\"", "tag = \"D1.T\"", "D1.T cannot be commanded"),
        ("message = \"too hot\"", "", "an interlock needs `message`"),
    ] {
        let text = interlocked(&lock.replace(from, to)).expect_err(to).to_string();
        assert!(text.contains(expect), "{to}: {text}");
    }
}

#[test]
fn only_a_binary_number_that_is_not_scaled_has_bits() {
    let lock = "[[interlock]]\ntag = \"D1.MODE\"\nvalue = \"on\"\nof = \"D1.W\"\nbit = 3\nmessage = \"locked\"\n";
    let plant = PLANT.replace("[mimic]", &format!("{lock}\n[mimic]"));
    for (kind, fits) in [
        ("type = \"int16\"", true),
        ("type = \"uint32\"", true),
        ("type = \"bcd16\"", false),
        ("type = \"float32\"", false),
        ("type = \"string(4)\"", false),
        ("type = \"uint16\"\nscale = 0.1", false),
        ("type = \"uint16\"\noffset = 1", false),
        ("type = \"uint16\"\ndecimals_from = \"DP\"", false),
        ("type = \"uint16\"\nfield = \"6-4\"", false),
        ("type = \"uint16\"\nfield = \"7-4\"", true),
    ] {
        let tag = format!("\n[[tag]]\nname = \"W\"\ntable = \"holding\"\naddress = 2000\n{kind}\n");
        match (load(plant.as_bytes(), &format!("{METER}{tag}"), PLC), fits) {
            (Ok(_), true) => {}
            (Err(errors), false) => assert!(errors.to_string().contains("D1.W has no bit 3"), "{kind}: {errors}"),
            (Ok(_), false) => panic!("{kind}: taken"),
            (Err(errors), true) => panic!("{kind}: {errors}"),
        }
    }
}

#[test]
fn an_actuator_has_one_command_and_one_output() {
    let table = "[[actuator]]\noutput = \"PLC.OUT\"\ncommand = \"D1.MODE\"\nneeds = [{ tag = \"PLC.STEP\", is = 1 }]\n";
    let plant = interlocked(table).unwrap();
    assert_eq!(plant.logic.actuators[0].needs, [(plant.tag_named("PLC.STEP").unwrap(), 1.0)]);
    assert_eq!(plant.logic.actuators[0].travel, None);
    let unsaid = "[[interlock]]\ntag = \"D1.MODE\"\nvalue = \"on\"\nof = \"D1.T\"\nabove = 80\nmessage = \"hot\"\n";
    for (tables, refuse) in [
        (unsaid.to_owned(), false),
        (format!("{unsaid}refuse = true\n"), true),
        (format!("{table}{unsaid}"), true),
        (format!("{table}off = \"on\"\n{unsaid}"), false),
        (format!("{table}off = \"on\"\n{}", unsaid.replace("\"on\"", "\"off\"")), true),
    ] {
        assert_eq!(interlocked(&tables).unwrap().logic.interlocks[0].refuse, refuse, "{tables}");
    }
    // Where another value switches off, that one is never refused.
    let lock = "[[interlock]]\ntag = \"D1.MODE\"\nvalue = \"on\"\nof = \"D1.T\"\nabove = 80\nmessage = \"hot\"\nrefuse = true\n";
    let text = interlocked(&format!("{table}off = \"on\"\n{lock}")).expect_err("off is on").to_string();
    assert!(text.contains("switching off is never refused"), "{text}");
    assert!(interlocked(&format!("{table}{lock}")).is_ok());
    let text = interlocked(&format!("{table}{table}")).expect_err("twice").to_string();
    assert!(text.contains("PLC.OUT belongs to another actuator"), "{text}");
    let text = interlocked(&table.replace("D1.MODE", "D1.T")).expect_err("read only").to_string();
    assert!(text.contains("D1.T cannot be commanded"), "{text}");
}

#[test]
fn an_alarm_that_could_never_come_or_never_go_is_refused() {
    check(
        "high = 80.0",
        "high = 120.0",
        &["[small.toml:26:8]", "the limit 120 is outside the range of D1.T", "it goes from 0 to 100"],
    );
    check("deadband = 1.0", "", &["a limit needs a `deadband`", "temperature 1 %"]);
    check("high = 80.0", "high = 80.0\nlow = 3.0", &["an alarm has one condition"]);
    check("high = 80.0\n", "", &["an alarm needs a condition"]);
    check("decimals_from", "poll = \"fast\"\nquality_from = \"Q\"\ndecimals_from", &["unknown tag `Q`"]);
    check("address = 1004", "address = 1004\npoll = \"never\"", &["D1.DP is never read, so D1.T can never be shown"]);
}

#[test]
fn the_alarm_of_an_overloaded_line_may_be_written() {
    let own = "[[alarm]]\nline = \"L1\"\noverloaded = true\npriority = \"high\"\nmessage = \"slow\"\n[mimic]";
    let plant = load(PLANT.replacen("[mimic]", own, 1).as_bytes(), METER, PLC).expect("a good plant");
    let found: Vec<_> = plant.alarms.iter().filter(|alarm| alarm.condition == Condition::Overloaded).collect();
    assert!(matches!(found[..], [alarm] if alarm.message == "slow" && alarm.subject == Subject::Line(LineId(0))));
    check("[mimic]", &own.replace("true", "false"), &["only a `line` can be overloaded", "expected `true`"]);
    check("[mimic]", &own.replace("line = \"L1\"", "device = \"D1\""), &["only a `line` can be overloaded"]);
    let own = own.replace("overloaded = true\n", "").replace("slow", "line overloaded");
    check("[mimic]", &own, &["duplicate alarm `line overloaded` of L1", "expected another text"]);
}

#[test]
fn two_alarms_of_one_name_would_share_their_state_and_are_refused() {
    let second = "[[alarm]]\ntag = \"D1.T\"\nlow = 5.0\ndeadband = 1.0\npriority = \"low\"\nmessage = \"hot\"\n[mimic]";
    check("[mimic]", second, &["[small.toml:36:11]", "duplicate alarm `hot` of D1.T", "first here"]);
    let own = "[[alarm]]\ndevice = \"D1\"\nne107 = \"F\"\npriority = \"low\"\nmessage = \"not responding\"\n[mimic]";
    check("[mimic]", own, &["duplicate alarm `not responding` of D1", "expected another text"]);
}

#[test]
fn every_condition_says_what_it_lacks() {
    for (condition, expect) in [
        ("rate = 5.0", "`rate` needs `over`"),
        ("rate = 0.0\nover = \"1min\"", "a limit of 0 always holds"),
        ("rate = 0.5\nover = \"1min\"", "the alarm would never return"),
        ("changes = 10", "`changes` needs `within`"),
        ("changes = 1\nwithin = \"1min\"", "not a count of changes"),
        ("no_change = \"1ms\"", "nothing can be told in so short a time"),
        ("no_update = \"30s\"\nover = \"1min\"", "`over` belongs to `rate`"),
        ("bit = 3", "D1.T has no bit 3"),
        ("high = 80.0\nclass = \"proces\"", "did you mean `process`?"),
        ("high = 80.0\nre_alarm = \"5s\"", "an alarm that reminds so soon is a nuisance"),
    ] {
        check("high = 80.0", condition, &[expect]);
    }
    check("[mimic]", "[alarms]\nshelve_max = \"1s\"\n\n[mimic]", &["not a time to shelve alarms for"]);
    check("tag = \"D1.T\"\nhigh = 80.0\ndeadband = 1.0", "line = \"L9\"", &["unknown line `L9`", "did you mean `L1`?"]);
}

#[test]
fn what_enables_an_alarm_is_read_and_every_slip_is_shown_at_its_place() {
    use crate::plant::expr::{Compare, Expr};
    let enabled = |words: &str| {
        let text = PLANT.replacen("high = 80.0", &format!("high = 80.0\nenabled_when = '{words}'"), 1);
        load(text.as_bytes(), METER, PLC).unwrap_or_else(|errors| panic!("{errors}")).alarms[0].enabled_when.clone()
    };
    let test = |compare, value| Expr::Test { tag: crate::plant::def::TagId(0), compare, value };
    let (above, below) = (test(Compare::Above, 5.0), test(Compare::AtMost, 2.5));
    for (words, expect) in [
        ("D1.T > 5", above.clone()),
        ("D1.T>5 °C", above.clone()),
        ("not D1.T > 5", Expr::Not(Box::new(above.clone()))),
        ("D1.T > 5 and D1.T <= 2.5", Expr::All(vec![above.clone(), below.clone()])),
        ("D1.T > 5 or D1.T <= 2.5 and D1.T > 5", {
            Expr::Any(vec![above.clone(), Expr::All(vec![below.clone(), above.clone()])])
        }),
        ("(D1.T > 5 or D1.T <= 2.5) and D1.T > 5", { Expr::All(vec![Expr::Any(vec![above.clone(), below]), above]) }),
    ] {
        assert_eq!(enabled(words), Some(expect), "{words}");
    }
    for (words, expect) in [
        ("D1.X > 5", &["unknown tag `D1.X`", "[small.toml:27:17]"][..]),
        ("D1.T > 5 cm", &["`cm` is not the unit of D1.T", "expected °C"]),
        ("D1.T > warm", &["`warm` is not a state of D1.T"]),
        ("D1.T", &["how is D1.T compared?"]),
        ("D1.T > ", &["D1.T is compared with nothing"]),
        ("D1.T > 5 and", &["a tag is missing"]),
        ("(D1.T > 5", &["a parenthesis is not closed"]),
        ("D1.T > 5)", &["`)` is one too many"]),
        ("", &["a tag is missing"]),
    ] {
        check("high = 80.0", &format!("high = 80.0\nenabled_when = '{words}'"), expect);
    }
    let deep = format!("{}D1.T > 5", "not ".repeat(50));
    check("high = 80.0", &format!("high = 80.0\nenabled_when = '{deep}'"), &["too many parentheses"]);
}

#[test]
fn limits_of_one_tag_stand_in_order() {
    let second = "[[alarm]]\ntag = \"D1.T\"\nhigh_high = 70.0\ndeadband = 1.0\npriority = \"critical\"\nmessage = \"very hot\"\n[mimic]";
    check("[mimic]", second, &["[small.toml:26:8]", "high 80 is not below high_high 70 of D1.T"]);
    // However many there are, each is named once for each level above it.
    let alarm = |level: &str, limit: f64, n: i32| {
        format!(
            "[[alarm]]\ntag = \"D1.T\"\n{level} = {limit:.1}\ndeadband = 1.0\npriority = \"low\"\nmessage = \"{level} {n}\"\n"
        )
    };
    let many =
        (0..50).map(|n| alarm("low", 90.0, n) + &alarm("high_high", 85.0, n) + &alarm("high_high", 95.0, n + 50));
    let text = PLANT.replace("[mimic]", &(many.collect::<String>() + "[mimic]"));
    let errors = load(text.as_bytes(), METER, PLC).expect_err("50 are above the high and the high high");
    assert_eq!(errors.count(), 100, "{errors}");
}

#[test]
fn a_plant_file_changes_a_tag_and_says_so_only_where_it_contradicts_itself() {
    let moved = "fast = \"1s\"\n[[device.tag]]\nname = \"T\"\naddress = 1010\nmax = 90";
    let plant =
        load(PLANT.replacen("fast = \"1s\"", moved, 1).as_bytes(), METER, PLC).unwrap_or_else(|e| panic!("{e}"));
    let tag = plant.tag(plant.tag_named("D1.T").unwrap());
    assert_eq!((tag.point.address, tag.max, tag.min), (1010, Some(Bound::Fixed(90.0)), Some(Bound::Fixed(0.0))));
    assert_eq!(tag.unit, "°C", "what the plant file does not say stays as the profile has it");
    let both = "fast = \"1s\"\n[[device.tag]]\nname = \"T\"\nmax = 90\nmax_from = \"DP\"";
    check("fast = \"1s\"", both, &["`max` and `max_from` exclude each other"]);
    check("unit = \"°C\"", "unit_from = \"MODE\"", &["D1.MODE does not tell a unit: `off` is no unit"]);
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
fn a_program_names_tags_that_can_be_told_what_to_do() {
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
    let enumeration = "enum = { 0 = \"off\", 1 = \"on\" }\n";
    check(
        enumeration,
        &format!("{enumeration}default = \"of\"\n"),
        &["`of` is not a state of D1.MODE", "did you mean"],
    );
}

#[test]
fn a_file_that_is_no_toml_is_told_from_one_that_is_wrong() {
    let check = |bytes: &[u8], expect: &[&str]| {
        let text = load(bytes, METER, PLC).expect_err("it is no plant").to_string();
        for piece in expect {
            assert!(text.contains(piece), "no `{piece}` in\n{text}");
        }
    };
    check(b"", &["small.toml is empty"]);
    check(b"# nothing\n\n", &["small.toml is empty"]);
    check(b"title = \"K\xE4se\"\n", &["small.toml is not UTF-8", "[small.toml:1:11]", "byte 0xE4"]);
    check(b"title = \"a\"\nline = [\n", &["small.toml:2:", "here the TOML breaks"]);
    check(b"title = \"a\"\ntitle = \"b\"\n", &["small.toml:2:1", "duplicate key"]);
}

#[test]
fn a_key_of_every_screen_is_no_command_of_a_plant() {
    for key in ["a", "q", "w"] {
        let from = "[mimic]\n";
        let to = format!("[mimic]\ncommand = [{{ key = \"{key}\", label = \"go\", tag = \"D1.MODE\" }}]\n");
        check(from, &to, &[&format!("key `{key}` is taken"), "`a` acknowledges an alarm, `q` quits and `w` says why"]);
    }
}

#[test]
fn a_missing_file_names_the_plants_there_are() {
    let check = |argument: &str, expect: &str| {
        let errors = super::load(std::path::Path::new(argument), &super::Search::shipped()).expect_err("no such plant");
        assert!(errors.to_string().contains(expect), "{errors}");
    };
    check("nowhere.toml", "the plant file nowhere.toml does not exist");
    check("nowhere.toml", "known plants: inverter, lab, tank");
    check("tnk", "did you mean `tank`?");
    check("/", "the plant file / is not a file");
}

#[test]
fn all_problems_come_at_once_and_in_file_order() {
    let errors = changed(&[
        ("deadband = 1.0", "deadbnd = 1.0"),
        ("Asia/Bangkok", "Mars/Base"),
        ("unit = 2", "unit = 0"),
        ("V2000", "V2008"),
        ("°C", "C"),
        ("baud = 9600", "baud = 9601"),
    ]);
    let lines: Vec<String> = errors.lines().collect();
    insta::assert_snapshot!(lines.join("\n"), @"
    small.toml:2:13: unknown time zone `Mars/Base`
    small.toml:8:8: 9601 is not a usual baud rate
    small.toml:22:8: unit 0 is a broadcast, which nobody answers: PLC.STEP can never be read
    small.toml:27:1: unknown key `deadbnd` in an alarm
    meter.toml:16:8: unknown unit `C`
    plc.toml:9:16: `V2008` does not exist: DirectLOGIC counts in octal
    ");
}

#[test]
fn a_message_shows_the_line_and_a_caret() {
    insta::assert_snapshot!(changed(&[("profile = \"meter\"", "profile = \"metr\"")]).to_string(), @r#"
      × unknown profile `metr`
        ╭─[small.toml:13:11]
     12 │ name = "D1"
     13 │ profile = "metr"
        ·           ───┬──
        ·              ╰── no such profile
     14 │ line = "L1"
        ╰────
      help: did you mean `meter`?

    1 problem
    "#);
}

#[test]
fn colours_are_for_terminals_only() {
    let errors = changed(&[("unit = 2", "unit = 1")]);
    assert!(render(&errors, true).contains('\u{1b}'));
    assert!(!render(&errors, false).contains('\u{1b}'));
}

#[test]
fn a_thousand_mistakes_do_not_flood_the_terminal() {
    let errors = changed(&[("title = \"Small\"", &(0..1000).map(|n| format!("wrong{n} = 1\n")).collect::<String>())]);
    let text = errors.to_string();
    assert!(text.contains("more problems") && text.lines().count() < 600, "{} lines", text.lines().count());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    /// However a plant file is torn, the loader answers with a plant or with problems, never with a panic.
    #[test]
    fn a_torn_file_is_reported_and_never_panics(start in 0usize..PLANT.len(), length in 0usize..200, junk in "[a-z0-9=\\[\\]{}\"., \\n°-]{0,12}") {
        let end = (start + length).min(PLANT.len());
        let mut bytes = PLANT.as_bytes()[..start].to_vec();
        bytes.extend_from_slice(junk.as_bytes());
        bytes.extend_from_slice(&PLANT.as_bytes()[end..]);
        if let Err(errors) = load(&bytes, METER, PLC) {
            prop_assert!(errors.count() > 0 && errors.lines().count() == errors.count());
            prop_assert!(!errors.to_string().is_empty());
        }
    }

    /// The same for a device profile.
    #[test]
    fn a_torn_profile_is_reported_and_never_panics(start in 0usize..METER.len(), length in 0usize..200, junk in "[a-z0-9=\\[\\]{}\"., \\n-]{0,12}") {
        // METER holds a degree sign, so the cut is made on bytes and mended like a file that is not UTF-8.
        let end = (start + length).min(METER.len());
        let mut bytes = METER.as_bytes()[..start].to_vec();
        bytes.extend_from_slice(junk.as_bytes());
        bytes.extend_from_slice(&METER.as_bytes()[end..]);
        let meter = String::from_utf8_lossy(&bytes);
        if let Err(errors) = load(PLANT.as_bytes(), &meter, PLC) {
            prop_assert!(errors.count() > 0 && !errors.to_string().is_empty());
        }
    }
}

/// What one reads in an editor or on a screen is what the file says.
#[test]
fn characters_that_hide_or_move_the_cursor_are_refused_where_they_stand() {
    let named = "title = \"Small\"";
    for (to, expect) in [
        ("title = \"Sm\\u001b[2Jall\"", ["[small.toml:1:9]", "U+001B"]),
        ("title = \"Sm\\u202Eall\"", ["[small.toml:1:9]", "U+202E"]),
        ("title = \"Sm\u{202E}all\"", ["[small.toml:1:12]", "U+202E"]),
        ("title = \"Small\" # \u{2066}a comment", ["[small.toml:1:19]", "U+2066"]),
    ] {
        let text = load(PLANT.replace(named, to).as_bytes(), METER, PLC).expect_err("it is refused").to_string();
        for piece in expect {
            assert!(text.contains(piece), "no `{piece}` in\n{text}");
        }
        assert!(!text.contains(['\u{1b}', '\u{202E}', '\u{2066}']), "{text:?}");
    }
    check("priority = \"high\"", "priority = \"high\"\n\"a\\u0007\" = 1", &["[small.toml:", "U+0007"]);
    check("message = \"hot\"", "message = \"hot\\u200f\"", &["[small.toml:29:11]", "U+200F"]);
    let meter = METER.replace("ACME", "AC\\u009BME");
    let text = load(PLANT.as_bytes(), &meter, PLC).expect_err("a profile too").to_string();
    assert!(text.contains("U+009B") && text.contains("[meter.toml:1:10]"), "{text}");
}

#[test]
fn a_plant_that_is_too_large_is_refused_before_it_is_made() {
    let large = |tables: &str| {
        let text = load(format!("{PLANT}\n{tables}").as_bytes(), METER, PLC).expect_err("it is refused");
        assert_eq!(text.count(), 1, "one word about the size, none about what is in it");
        text.full_lines().next().unwrap()
    };
    let device = |n: usize| format!("[[device]]\nname = \"M{n}\"\nprofile = \"meter\"\nline = \"L1\"\nunit = 3\n");
    let errors = large(&(0..20_000).map(device).collect::<String>());
    assert!(errors.starts_with("small.toml:") && errors.contains("20002 times [[device]]"), "{errors}");
    assert!(errors.ends_with("(expected at most 2000)"), "{errors}");
    let errors = large(&"[[alarm]]\ntag = \"D1.T\"\n".repeat(10_000));
    assert!(errors.contains("10001 times [[alarm]]"), "{errors}");
    let errors = large(&"[[line]]\nname = \"L\"\n".repeat(70));
    assert!(errors.contains("71 times [[line]]"), "{errors}");

    // Few devices of a profile with many tags.
    let tag = |n: usize| format!("[[tag]]\nname = \"R{n}\"\ntable = \"holding\"\naddress = {n}\ntype = \"uint16\"\n");
    let many = format!("{METER}\n{}", (2_000..10_000).map(tag).collect::<String>());
    let plant = format!("{PLANT}\n{}", (0..2).map(device).collect::<String>());
    let text = load(plant.as_bytes(), &many, PLC).expect_err("it is refused").to_string();
    assert!(text.contains("too many tags: M1 has number 20001") && text.contains("at most 20000 in all"), "{text}");
}

#[test]
fn endless_lines_and_problems_are_reported_in_bounded_text() {
    let long = format!("{PLANT}\n[x]\na = [{}]\n", "[],".repeat(100_000));
    let keys: String = (0..50_000).map(|n| format!("k{n} = 1\n")).collect();
    let devices = "[[device]]\nname = \"\"\n".repeat(1_900);
    for text in [long, format!("{keys}\n{PLANT}"), format!("{PLANT}\n{devices}")] {
        let errors = load(text.as_bytes(), METER, PLC).expect_err("it is refused");
        assert!(
            errors.count() <= 1_000 && errors.to_string().len() < 100_000,
            "{} {}",
            errors.count(),
            errors.to_string().len()
        );
    }
}
