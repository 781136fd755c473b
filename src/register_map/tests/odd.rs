//! Files that are odd: each is named, bounded, and no panic.

use super::list_of;
use crate::register_map::{Format, list::ListContext, read};

#[test]
fn what_is_no_register_map_is_refused_with_a_reason() {
    let deep = format!("modbus: {}", "[".repeat(5_000));
    let json = format!("{{ \"channels\": {}", "[".repeat(5_000));
    let xml = format!("<modbusscope>{}", "<a>".repeat(5_000));
    let cases: Vec<(&[u8], &str)> = vec![
        (b"", "it is empty"),
        (b"\xEF\xBB\xBF", "it is empty"),
        (b"\r\n\r\n", "it is empty"),
        (b"\x89PNG\r\n\x1a\n\x00\x00\x00", "it is not text"),
        (b"PK\x03\x04 and nothing behind", "not an Excel workbook"),
        (b"modbus:\n  - sensors: []\n", "it is empty"),
        (b"modbus:\n  - sensors:\n   - a: [1\n", "line "),
        (b"[[inputs.modbus]]\nname = \n", "line 2"),
        (b"{ \"group\": { \"points\": [ }", "line 1"),
        (b"<html><p>no table</p></html>", "it is empty"),
        (deep.as_bytes(), "line 1"),
        (json.as_bytes(), "line 1"),
        (xml.as_bytes(), "line 1"),
    ];
    for (bytes, why) in cases {
        let list = read(bytes, &ListContext::default());
        let refused = list.refused.unwrap_or_default();
        let shown = String::from_utf8_lossy(&bytes[..bytes.len().min(40)]).into_owned();
        assert!(
            refused.contains(why) && refused.contains("What can be read"),
            "{shown}: {refused} {:?}",
            list.problems
        );
    }
}

#[test]
fn any_bytes_as_any_form_are_no_panic() {
    let texts = [
        "modbus:\n - sensors:\n    - {}\n    - 5\n    - { address: { a: 1 }, name: [x] }\n",
        "parameters:\n - group: a\n   items:\n    - { name: a, rule: 1, registers: [99999] }\n    - x\n",
        "read_only_word:\n  a: 5\n  b: { address: -1, bits: 99 }\n  c: { address: 1, shift_bits: 15, bits: 9 }\n",
        "{ \"device\": { \"channels\": [ 5, { \"address\": \"1:2:3:4\" }, { \"name\": \"a\", \"address\": \"1:60:9\" } ] } }",
        "{ \"group\": { \"points\": [ 1, { \"name\": \"a\", \"type\": \"int16\", \"size\": 70000 } ], \"groups\": [{ \"count\": 200 }] } }",
        "[[inputs.modbus]]\nholding_registers = [{ name = \"a\" }, 5]\n[[inputs.modbus.request]]\nfields = [{ address = 70000, name = \"a\" }]\n",
        "<modbusscope><scope><register><expression>${</expression></register><register><address>0</address><text/></register></scope></modbusscope>",
        "a,b\n\"",
        "\u{0}\u{1}",
    ];
    for text in texts {
        for format in [None].into_iter().chain(Format::ALL.map(Some)) {
            let list = read(text.as_bytes(), &ListContext { format, ..ListContext::default() });
            assert!(list.named.len() < 3, "{text}: {:?}", list.named);
        }
    }
}

#[test]
fn a_file_with_more_rows_than_are_read_says_so() {
    let rows = |count: usize| (0..count).map(|n| format!("{n};n{n}\n")).collect::<String>();
    let list = list_of(&format!("address;name\n{}", rows(10_050)));
    assert_eq!((list.named.len(), &list.warnings[..]), (9_999, &["only the first 10000 rows are read".to_owned()][..]));
    assert_eq!(list_of(&format!("address;name\n{}", rows(50))).warnings, Vec::<String>::new());
}

#[test]
fn line_ends_marks_and_encodings_change_nothing() {
    let text = "address;name;unit\n5;Flow;°C\n6;Level;cm\n";
    let plain = list_of(text);
    assert_eq!(plain.named.len(), 2);
    let utf16: Vec<u8> = std::iter::once(0xFEFF).chain(text.encode_utf16()).flat_map(u16::to_le_bytes).collect();
    let latin: Vec<u8> = text.chars().map(|sign| u8::try_from(u32::from(sign)).expect("Latin-1")).collect();
    for bytes in [
        text.replace('\n', "\r\n").into_bytes(),
        format!("\u{FEFF}{text}").into_bytes(),
        format!("{text}\u{1A}").into_bytes(),
        utf16,
        latin,
    ] {
        let list = read(&bytes, &ListContext::default());
        assert_eq!((list.named, list.problems), (plain.named.clone(), plain.problems.clone()), "{bytes:?}");
    }
}

#[test]
fn tags_anchors_and_doubled_keys_of_yaml_are_read() {
    let text = "modbus:\n  - sensors:\n    - &a { name: One, address: 5, scale: 0.1 }\n    - { <<: *a, name: Two, address: 6, address: 7 }\n    - { name: Three, address: !secret nine }\n    - *a\n";
    let list = list_of(text);
    let named: Vec<(&str, u16, f64)> =
        list.named.iter().map(|named| (named.name.as_str(), named.address, named.scale)).collect();
    assert_eq!(named, [("One", 5, 0.1), ("Two", 7, 0.1)]);
    assert_eq!(list.warnings, ["line 4: `address` is given twice: the last one counts"]);
    assert_eq!(list.problems.len(), 2, "{:?}", list.problems);
    assert!(list.problems[0].contains("`nine` is not understood"), "{:?}", list.problems);
}
