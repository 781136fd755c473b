//! Puts the settings of a line into the text of a plant file: only what differs changes, comments and order stay.

use toml_edit::{DocumentMut, Item, TableLike, Value};

use super::{
    diagnostic::Problems,
    line::{self, TCP_PORT},
    reader,
    schema::PlantFile,
};
use crate::plant::{
    def::{LineDef, Protocol, Rs485, Transport},
    line_check::check_settings,
};

/// The text with these settings for the line of their name; `Err` says why not, in words for the operator.
pub(super) fn with_line(text: &str, settings: &LineDef) -> Result<String, String> {
    if let Some(error) = check_settings(settings).into_iter().next() {
        return Err(format!("{}, {}", error.what, error.expected));
    }
    let mut document: DocumentMut = text.parse().map_err(|error| format!("the file is not valid TOML: {error}"))?;
    let table = table_of(&mut document, &settings.name)?;
    set(table, settings)?;
    let edited = document.to_string();
    // The editor and the reader know the file each in their own way: what counts is what is read next time.
    match reread(&edited, settings) {
        Some(read) if read == *settings => Ok(edited),
        Some(_) | None => Err("the file would not be read as these settings; nothing was written".to_owned()),
    }
}

/// The table of the line of a name.
fn table_of<'a>(document: &'a mut DocumentMut, name: &str) -> Result<&'a mut dyn TableLike, String> {
    let missing = || format!("the file has no line `{name}` any more");
    let is_it = |table: &dyn TableLike| table.get("name").and_then(Item::as_str) == Some(name);
    match document.get_mut("line") {
        Some(Item::ArrayOfTables(tables)) => {
            let found = tables.iter_mut().find(|table| is_it(*table));
            found.map(|table| table as &mut dyn TableLike).ok_or_else(missing)
        }
        Some(Item::Value(Value::Array(tables))) => {
            let mut tables = tables.iter_mut().filter_map(Value::as_inline_table_mut);
            let found = tables.find(|table| is_it(*table));
            found.map(|table| table as &mut dyn TableLike).ok_or_else(missing)
        }
        Some(_) | None => Err(missing()),
    }
}

/// A key of a line, the value it shall have, and the value it has when it is left out.
struct Entry {
    key: &'static str,
    value: Value,
    usual: Option<Value>,
}

fn entry(key: &'static str, value: impl Into<Value>) -> Entry {
    Entry { key, value: value.into(), usual: None }
}

fn or_usual<T: Into<Value>>(key: &'static str, value: T, usual: T) -> Entry {
    Entry { key, value: value.into(), usual: Some(usual.into()) }
}

/// Keys that only a serial line has, keys that only a TCP line has, and keys that only a UDP line has.
const SERIAL: [&str; 7] = ["port", "baud", "data_bits", "parity", "stop_bits", "rs485", "turnaround_ms"];
const TCP: [&str; 2] = ["tcp_port", "connect_delay_ms"];
const UDP: [&str; 1] = ["udp_port"];
const HOST: [&str; 1] = ["host"];

fn entries(settings: &LineDef) -> Option<Vec<Entry>> {
    if settings.listens {
        return None;
    }
    let usual = LineDef::new(settings.id, "", settings.transport.clone());
    let ms = |span: std::time::Duration| i64::try_from(span.as_millis()).unwrap_or(i64::MAX);
    let mut entries = vec![entry("mode", line::mode_word(&settings.transport)?)];
    match &settings.transport {
        Transport::Serial { port, serial, framing, rs485 } => entries.extend([
            entry("port", port.as_str()),
            entry("baud", i64::from(serial.baud)),
            or_usual(
                "data_bits",
                i64::from(serial.data_bits),
                i64::from(line::usual_data_bits(*framing == crate::plant::def::Framing::Ascii)),
            ),
            entry("parity", serial.parity.word()),
            or_usual("stop_bits", i64::from(serial.stop_bits), 1),
            or_usual("rs485", rs485.word(), Rs485::Off.word()),
            or_usual("turnaround_ms", ms(settings.turnaround), ms(usual.turnaround)),
        ]),
        Transport::Network { protocol: Protocol::Tcp, host, port, framing: _ } => entries.extend([
            entry("host", host.as_str()),
            or_usual("tcp_port", i64::from(*port), i64::from(TCP_PORT)),
            or_usual("connect_delay_ms", ms(settings.connect_delay), ms(usual.connect_delay)),
        ]),
        Transport::Network { protocol: Protocol::Udp, host, port, framing: _ } => {
            entries.extend([entry("host", host.as_str()), or_usual("udp_port", i64::from(*port), i64::from(TCP_PORT))])
        }
    }
    entries.extend([
        or_usual("timeout_ms", ms(settings.timeout), ms(usual.timeout)),
        or_usual("request_gap_ms", ms(settings.gap), ms(usual.gap)),
        or_usual("frame_timeout_ms", ms(settings.frame_timeout), ms(usual.frame_timeout)),
    ]);
    Some(entries)
}

/// The keys of a line in a new file, those that are usual left out; nothing for a mode that has no keyword.
pub(super) fn line_text(settings: &LineDef) -> String {
    let entries = entries(settings).unwrap_or_default().into_iter();
    let written = entries.filter(|entry| !entry.usual.as_ref().is_some_and(|usual| same(usual, &entry.value)));
    written.map(|Entry { key, value, .. }| format!("{key} = {}\n", value.to_string().trim())).collect()
}

fn set(table: &mut dyn TableLike, settings: &LineDef) -> Result<(), String> {
    let entries = entries(settings).ok_or("a plant file has no keyword for this mode")?;
    let others: [&[&str]; 3] = match settings.transport.protocol() {
        None => [&HOST, &TCP, &UDP],
        Some(Protocol::Tcp) => [&SERIAL, &UDP, &[]],
        Some(Protocol::Udp) => [&SERIAL, &TCP, &[]],
    };
    let mut comments: String = others.concat().iter().filter_map(|key| remove(table, key)).collect();
    for Entry { key, value, usual } in entries {
        match table.get_mut(key) {
            Some(item) => {
                let Some(old) = item.as_value_mut() else { return Err(format!("`{key}` is not a value")) };
                if !same(old, &value) {
                    // The blanks and the comment around the old value stay.
                    let decor = old.decor().clone();
                    *old = value;
                    *old.decor_mut() = decor;
                }
            }
            None if usual.as_ref().is_some_and(|usual| same(usual, &value)) => {}
            None => {
                table.insert(key, Item::Value(value));
                // What was said above a key that has gone is said above the first one that has come.
                if let Some(mut key) = table.key_mut(key).filter(|_| !comments.is_empty()) {
                    key.leaf_decor_mut().set_prefix(std::mem::take(&mut comments));
                }
            }
        }
    }
    Ok(())
}

/// Removes a key; gives the lines of comment that stood above it.
fn remove(table: &mut dyn TableLike, key: &str) -> Option<String> {
    let above = table.key(key).and_then(|key| key.leaf_decor().prefix()?.as_str()).map(str::to_owned);
    table.remove(key)?;
    above.filter(|above| above.contains('#'))
}

fn same(one: &Value, other: &Value) -> bool {
    match (one, other) {
        (Value::Integer(one), Value::Integer(other)) => one.value() == other.value(),
        (Value::String(one), Value::String(other)) => one.value() == other.value(),
        _ => false,
    }
}

/// The line of a text as the program reads it; `None` if it finds something wrong.
fn reread(text: &str, settings: &LineDef) -> Option<LineDef> {
    let mut problems = Problems::default();
    let raw = reader::parse("the plant file", text.as_bytes(), &mut problems)?;
    // Other parts of the file are not what is saved here: only problems of the lines count.
    let file = PlantFile::of(&[raw], &mut Problems::default());
    let lines = line::lines(&file.lines, &mut problems);
    let line = lines.into_iter().find(|line| line.name == settings.name)?;
    problems.finish(line).ok()
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use proptest::prelude::*;

    use super::*;
    use crate::plant::{
        def::{Framing, LineId, Parity, Serial},
        line_check::BAUDS,
    };

    const FILE: &str = "\
# The plant of a test.
title = \"Small\"

# Two lines.
[[line]]
name = \"L1\"
mode = \"rtu\"   # not ascii
# the blue adapter
port = \"/dev/ttyUSB0\" # by-id is better
baud = 9_600
parity = 'N'

timeout_ms = 500 # long

[[line]]
name = \"L2\" # the other
mode = \"tcp\"
host = \"10.0.0.5\"

[[device]]
name = \"TIC-1\"
profile = \"fuji_pxr\"
line = \"L1\"
unit = 1
";

    fn l1() -> LineDef {
        reread(FILE, &LineDef::new(LineId(0), "L1", Transport::tcp("", 1))).expect("the file has a line L1")
    }

    fn serial(change: impl Fn(&mut Serial)) -> LineDef {
        let mut serial = Serial::USUAL;
        change(&mut serial);
        LineDef { transport: Transport::rtu("/dev/ttyUSB0", serial), ..l1() }
    }

    fn check(settings: &LineDef, changes: &[(&str, &str)]) {
        let expect = changes.iter().fold(FILE.to_owned(), |text, (from, to)| {
            assert!(text.contains(from), "no `{from}` in\n{text}");
            text.replacen(from, to, 1)
        });
        let edited = with_line(FILE, settings).expect("it can be edited");
        assert_eq!(edited, expect);
    }

    #[test]
    fn only_what_differs_is_touched() {
        check(&l1(), &[]);
        check(&serial(|serial| serial.baud = 19_200), &[("baud = 9_600", "baud = 19200")]);
        check(&serial(|serial| serial.parity = Parity::Even), &[("parity = 'N'", "parity = \"E\"")]);
        let slow = LineDef { timeout: Duration::from_millis(900), ..l1() };
        check(&slow, &[("timeout_ms = 500 # long", "timeout_ms = 900 # long")]);
    }

    #[test]
    fn a_left_out_key_is_added_once_it_is_not_usual() {
        let end = "timeout_ms = 500 # long\n";
        check(&serial(|serial| serial.stop_bits = 2), &[(end, &format!("{end}stop_bits = 2\n"))]);
        let gap = LineDef { gap: Duration::from_millis(20), ..l1() };
        check(&gap, &[(end, &format!("{end}request_gap_ms = 20\n"))]);
    }

    #[test]
    fn another_kind_of_line_leaves_no_keys_of_the_first_behind() {
        let tcp = LineDef { transport: Transport::tcp("10.0.0.9", 502), ..l1() };
        let edited = with_line(FILE, &tcp).expect("it can be edited");
        let (own, rest) = edited.split_once("[[line]]\nname = \"L2\"").expect("the other line is there");
        for key in SERIAL {
            assert!(!own.contains(&format!("{key} =")), "{key} in\n{own}");
        }
        for words in ["mode = \"tcp\"   # not ascii", "# the blue adapter\nhost = \"10.0.0.9\"", "# Two lines."] {
            assert!(own.contains(words), "no `{words}` in\n{own}");
        }
        assert!(rest.contains("host = \"10.0.0.5\""), "{rest}");
        let back = with_line(&edited, &l1()).expect("and back");
        assert_eq!(reread(&back, &l1()), Some(l1()));
        assert!(back.contains("# the blue adapter"), "{back}");
    }

    #[test]
    fn lines_in_one_row_can_be_edited_too() {
        let file = "line = [{ name = \"L1\", mode = \"tcp\", host = \"a\" }] # one\n";
        let settings = LineDef::new(LineId(0), "L1", Transport::tcp("b", 502));
        assert_eq!(with_line(file, &settings).as_deref(), Ok(&*file.replace("\"a\"", "\"b\"")));
    }

    #[test]
    fn what_cannot_be_saved_is_reported() {
        let check = |text: &str, settings: &LineDef, expect: &str| {
            let refused = with_line(text, settings);
            assert!(refused.as_ref().is_err_and(|why| why.contains(expect)), "{refused:?}");
        };
        check(FILE, &LineDef { name: "L9".into(), ..l1() }, "no line `L9`");
        check("title = ", &l1(), "not valid TOML");
        check(FILE, &serial(|serial| serial.baud = 49), "49 baud is out of range");
        check(FILE, &serial(|serial| serial.data_bits = 7), "Modbus RTU sends 8 data bits");
    }

    fn transports() -> impl Strategy<Value = Transport> {
        let parity = prop_oneof![Just(Parity::None), Just(Parity::Even), Just(Parity::Odd)];
        let rs485 = prop_oneof![Just(Rs485::Off), Just(Rs485::RtsHigh), Just(Rs485::RtsLow)];
        let serial = (0..BAUDS.len(), any::<bool>(), 7u8..=8, parity, 1u8..=2, rs485, "[ -~]{1,20}[!-~]");
        let serial = serial.prop_map(|(baud, ascii, bits, parity, stop_bits, rs485, port)| Transport::Serial {
            port,
            serial: Serial { baud: BAUDS[baud], data_bits: if ascii { bits } else { 8 }, parity, stop_bits },
            framing: if ascii { Framing::Ascii } else { Framing::Rtu },
            rs485,
        });
        let framing = prop_oneof![Just(Framing::Rtu), Just(Framing::Ascii), Just(Framing::Mbap)];
        let protocol = prop_oneof![Just(Protocol::Tcp), Just(Protocol::Udp)];
        let tcp = (protocol, "[ -9;-~]{0,20}[!-9;-~]", 1u16.., framing);
        let tcp = tcp.prop_map(|(protocol, host, port, framing)| Transport::Network { protocol, host, port, framing });
        prop_oneof![serial, tcp]
    }

    proptest! {
        #[test]
        fn whatever_is_saved_is_read_back(
            first in transports(),
            second in transports(),
            timeout in 10u64..=10_000,
            gap in 0u64..=10_000,
        ) {
            let millis = Duration::from_millis;
            let line = |transport| LineDef { transport, timeout: millis(timeout), gap: millis(gap), ..l1() };
            let usual = LineDef::new(LineId(0), "", Transport::tcp("", 1)).turnaround;
            let (first, second) = (line(first), LineDef { turnaround: usual, ..line(second) });
            let once = with_line(FILE, &first).expect("it can be edited");
            let twice = with_line(&once, &second).expect("and once more");
            prop_assert_eq!(reread(&twice, &second), Some(second));
            for comment in ["# The plant of a test.", "# Two lines.", "# not ascii", "# the other"] {
                prop_assert!(twice.contains(comment), "no `{}` in\n{}", comment, twice);
            }
        }
    }
}
