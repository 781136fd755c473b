//! A line on which another master polls: its keys, and what makes no sense there.

use super::*;

const HEARD: &str = r#"title = "Heard"
time_zone = "UTC"

[[line]]
name = "L1"
mode = "listen"
port = "/dev/ttyUSB0"
baud = 9600
parity = "N"

[[device]]
name = "M1"
profile = "meter"
line = "L1"
unit = 1
"#;

fn heard(from: &str, to: &str) -> Result<PlantDef, Errors> {
    assert!(HEARD.contains(from), "no `{from}`");
    load(HEARD.replacen(from, to, 1).as_bytes(), METER, PLC)
}

#[test]
fn a_listening_line_is_a_serial_port_or_a_mirror() {
    let tcp = "host = \"mirror\"\ntcp_port = 1502";
    let serial = "port = \"/dev/ttyUSB0\"\nbaud = 9600\nparity = \"N\"";
    for (to, mode) in [
        (serial.to_owned(), "RTU /dev/ttyUSB0 9600 8N1"),
        (format!("{serial}\nframing = \"ascii\""), "ASCII /dev/ttyUSB0 9600 7N1"),
        (tcp.to_owned(), "TCP mirror:1502"),
        (format!("{tcp}\nframing = \"rtu-over-tcp\""), "RTU over TCP mirror:1502"),
    ] {
        let plant = heard(serial, &to).unwrap_or_else(|errors| panic!("{errors}"));
        let line = &plant.lines[0];
        assert!(line.listens && line.transport.to_string() == mode, "{to}: {}", line.transport);
        let own: Vec<&str> = plant.alarms.iter().map(|alarm| &*alarm.message).collect();
        assert!(own.contains(&"no traffic heard") && !own.contains(&"line overloaded"), "{own:?}");
    }
}

#[test]
fn two_lines_never_have_one_serial_port() {
    for mode in ["listen", "rtu"] {
        let second = "[[line]]\nname = \"L2\"\nmode = \"MODE\"\nport = \"/dev/ttyUSB0\"\nbaud = 9600\nparity = \"N\"\n\n[[device]]";
        let errors = heard("[[device]]", &second.replace("MODE", mode)).expect_err(mode).to_string();
        assert!(errors.contains("small.toml:14:8") && errors.contains("another line has the port"), "{errors}");
    }
}

#[test]
fn what_makes_no_sense_on_a_listening_line_has_a_place() {
    for (to, expect) in [
        ("parity = \"N\"\ntimeout_ms = 500", &["small.toml:10:1", "unknown key `timeout_ms`", "a listening line"][..]),
        ("parity = \"N\"\nturnaround_ms = 500", &["small.toml:10:1", "unknown key `turnaround_ms`"]),
        ("parity = \"N\"\nframing = \"tcp\"", &["small.toml:10:11", "framing `tcp` on a serial port", "rtu or ascii"]),
        ("parity = \"N\"\nframe_timeout_ms = 1", &["small.toml:10:", "too short"]),
    ] {
        let errors = heard("parity = \"N\"", to).expect_err(to).to_string();
        for piece in expect {
            assert!(errors.contains(piece), "no `{piece}` in\n{errors}");
        }
    }
}

#[test]
fn addresses_of_32_bits_cannot_be_heard() {
    let meter = METER.replace("address = 1005\ntype = \"uint16\"", "address = 1005\ntype = \"enron_uint32\"");
    let plant = |mode: &str| load(HEARD.replace("mode = \"listen\"", mode).as_bytes(), &meter, PLC);
    let errors = plant("mode = \"listen\"").expect_err("it is not known what each address holds").to_string();
    for piece in ["small.toml:14:8", "M1.MODE is enron_uint32, which cannot be heard on a line that only listens"] {
        assert!(errors.contains(piece), "no `{piece}` in\n{errors}");
    }
    assert!(plant("mode = \"rtu\"").is_ok());
}

const PROCEDURE: &str = r#"
[[procedure]]
name = "heat"
steps = [{ write = "M1.MODE", value = "on" }]
safe = [{ write = "M1.MODE", value = "off" }]
"#;

#[test]
fn a_procedure_writes_nothing_on_a_listening_line() {
    let meter = format!("{METER}\n[faceplate]\npv = \"T\"\nsv = \"MODE\"\n");
    let plant = |from: &str, to: &str| load((HEARD.replace(from, to) + PROCEDURE).as_bytes(), &meter, PLC);
    let errors = plant("", "").expect_err("it writes").to_string();
    for piece in ["small.toml:19:20", "M1.MODE is on a line that only listens", "nothing can be written"] {
        assert!(errors.contains(piece), "no `{piece}` in\n{errors}");
    }
    assert_eq!(errors.matches("only listens").count(), 2, "the step and the safe state:\n{errors}");
    let polled = plant("mode = \"listen\"", "mode = \"rtu\"");
    assert!(polled.is_ok(), "{:?}", polled.err().map(|errors| errors.to_string()));
}

#[test]
fn an_interlock_on_a_listening_line_is_a_warning() {
    let interlock =
        "\n[[interlock]]\ntag = \"M1.MODE\"\nvalue = \"on\"\nof = \"M1.T\"\nabove = 80.0\nmessage = \"hot\"\n";
    let plant = HEARD.to_owned() + interlock;
    let warned = |plant: &str| pictures::warnings(plant, METER).join("\n");
    let words = warned(&plant);
    assert!(words.contains("small.toml:18:7: M1.MODE is on a line that only listens"), "{words}");
    let polled = warned(&plant.replace("mode = \"listen\"", "mode = \"rtu\""));
    assert!(!polled.contains("only listens"), "{polled}");
}

#[test]
fn only_what_is_polled_has_alarms_about_its_polls() {
    let meter = METER.replace("[limits]", "[limits]\nresponse_time_ms = 30");
    let own = |from: &str, to: &str| -> Vec<String> {
        let plant = load(HEARD.replace(from, to).as_bytes(), &meter, PLC).unwrap_or_else(|errors| panic!("{errors}"));
        plant.alarms.iter().map(|alarm| alarm.message.clone()).collect()
    };
    let slow = "slower than its profile states".to_owned();
    assert!(!own("", "").contains(&slow));
    assert!(own("mode = \"listen\"", "mode = \"rtu\"").contains(&slow));
}

#[test]
fn what_is_never_heard_is_stated_for_a_listening_line_only() {
    let plant = |stated: &str, mode: &str| {
        let text = format!("{}stated = {{ {stated} }}\n", HEARD.replace("mode = \"listen\"", mode));
        load(text.as_bytes(), METER, PLC)
    };
    let known = plant("DP = 2", "mode = \"listen\"").unwrap_or_else(|errors| panic!("{errors}"));
    let stated: Vec<_> = known.tags.iter().filter_map(|tag| Some((tag.name.as_str(), tag.stated?))).collect();
    assert_eq!(stated, [("M1.DP", 2.0)]);
    assert!(known.alarms.iter().any(|alarm| alarm.message == "other than the plant file states"));
    for (stated, mode, expect) in [
        ("DP = 2", "mode = \"rtu\"", ["small.toml:16:12", "M1.DP is read from the device"]),
        ("DP = 9", "mode = \"listen\"", ["small.toml:16:17", "9 is not a number of decimals"]),
        ("DP = 0.5", "mode = \"listen\"", ["small.toml:16:17", "is not a number of decimals"]),
        ("MODE = 1", "mode = \"listen\"", ["small.toml:16:12", "no value is scaled by M1.MODE"]),
        ("X = 1", "mode = \"listen\"", ["small.toml:16:12", "unknown tag `X`"]),
    ] {
        let errors = plant(stated, mode).expect_err(stated).to_string();
        for piece in expect {
            assert!(errors.contains(piece), "{stated}: no `{piece}` in\n{errors}");
        }
    }
}

#[test]
fn requests_where_every_line_only_listens_are_a_warning() {
    let plant = format!("{HEARD}\n[north.mqtt]\nhost = \"localhost\"\ncommands_as = \"anna\"\n");
    let warned = |plant: &str| pictures::warnings(plant, METER).join("\n");
    let words = warned(&plant);
    assert!(words.contains("small.toml:19:15: every line only listens"), "{words}");
    let polled = warned(&plant.replace("mode = \"listen\"", "mode = \"rtu\""));
    assert!(!polled.contains("only listens"), "{polled}");
}
