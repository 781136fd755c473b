//! The forms of a request: addresses and fields become bytes.

use super::{fields::address, *};
use crate::bus::pdu;

#[test]
fn addresses_are_read_as_manuals_write_them() {
    let check = |text: &str, table, expect: Result<u16, &str>| {
        assert_eq!(address(text, table), expect.map_err(str::to_owned), "{text}");
    };
    check("41003", Table::Holding, Ok(1002));
    check("400001", Table::Holding, Ok(0));
    check("31008", Table::Input, Ok(1007));
    check("00017", Table::Coil, Ok(16));
    check("1002", Table::Holding, Ok(1002));
    check("0x3EA", Table::Holding, Ok(1002));
    check("0xA02B", Table::Holding, Ok(41_003));
    check("20000", Table::Holding, Ok(20_000));
    check("holding:41003", Table::Holding, Ok(41_003));
    check(
        "41003",
        Table::Coil,
        Err("address: 41003 belongs to the table holding, this is coil; as sent it is coil:41003"),
    );
    check("40000", Table::Holding, Err("address: 40000 does not exist, the first is 40001"));
    check("465537", Table::Holding, Err("address: found `465537`, expected 0 to 65535"));
    check("x", Table::Holding, Err("address: found `x`, expected 0 to 65535"));
}

#[test]
fn fields_become_the_bytes_of_the_standard() {
    let message = |function, entries: &[&str]| {
        let entries: Vec<String> = entries.iter().map(|entry| (*entry).to_owned()).collect();
        functions::message(17, function, &entries)
    };
    // Modbus application protocol V1.1b3, sections 6.3, 6.5, 6.6, 6.8, 6.9, 6.11 to 6.13, 6.16, 6.17 and 6.21.
    let cases: [(u8, &[&str], &str); 12] = [
        (3, &["40108", "3"], "11 03 00 6B 00 03"),
        (5, &["00173", "on"], "11 05 00 AC FF 00"),
        (6, &["40002", "3"], "11 06 00 01 00 03"),
        (6, &["40002", "-2"], "11 06 00 01 FF FE"),
        (15, &["00020", "1 0 1 1 0 0 1 1 1 0"], "11 0F 00 13 00 0A 02 CD 01"),
        (16, &["40002", "0x000A, 0x0102"], "11 10 00 01 00 02 04 00 0A 01 02"),
        (22, &["40005", "0x00F2", "0x0025"], "11 16 00 04 00 F2 00 25"),
        (23, &["40004", "6", "40015", "0xFF 0xFF 0xFF"], "11 17 00 03 00 06 00 0E 00 03 06 00 FF 00 FF 00 FF"),
        (8, &["0", "0xA537"], "11 08 00 00 A5 37"),
        (11, &[], "11 0B"),
        (17, &[], "11 11"),
        (43, &["0", "0"], "11 2B 0E 01 00"),
    ];
    for (function, entries, expect) in cases {
        let bytes = message(function, entries);
        assert_eq!(bytes.as_ref().map(|bytes| hex(bytes)).as_deref(), Ok(expect), "{function} {entries:?}");
        let errors = bytes.map(|bytes| request_lint::check_request(&bytes, Framing::Rtu));
        assert_eq!(errors, Ok(vec![]), "{function} {entries:?}");
    }
    assert!(message(6, &["40002", "65536"]).is_err_and(|why| why.contains("expected -32768 to 65535")));
    assert!(message(3, &["40002", "126"]).is_err_and(|why| why.contains("count")));
    for function in functions::FUNCTIONS {
        assert!(pdu::name(function).is_some(), "{function}");
    }
    let words = request_text(&[17, 8, 0, 4, 0, 0], Framing::Rtu).expect("a request");
    assert!(words.last().is_some_and(|words| words.starts_with("Effect: the unit listens only")), "{words:?}");
    assert_eq!(names::effect(&[17, 8, 0, 0, 0xA5, 0x37]), None, "a loopback changes nothing");
}
