//! The forms of a request: addresses and fields become bytes.

use super::*;

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
    check("41003", Table::Coil, Err("address: 41003 belongs to the table holding, this is coil"));
    check("40000", Table::Holding, Err("address: 40000 does not exist, the first is 40001"));
    check("465537", Table::Holding, Err("address: 465537 does not exist, the first is 40001"));
    check("x", Table::Holding, Err("address: found `x`, expected 0 to 65535"));
}

#[test]
fn fields_become_the_bytes_of_the_standard() {
    let check = |function, place: &str, rest: &str, expect: &str| {
        let bytes = message(17, function, place, rest);
        assert_eq!(bytes.map(|bytes| hex(&bytes)).as_deref(), Ok(expect), "{function} {place} {rest}");
    };
    // Modbus application protocol V1.1b3, sections 6.3, 6.5, 6.6, 6.11 and 6.12.
    check(3, "40108", "3", "11 03 00 6B 00 03");
    check(5, "00173", "on", "11 05 00 AC FF 00");
    check(6, "40002", "3", "11 06 00 01 00 03");
    check(6, "40002", "-2", "11 06 00 01 FF FE");
    check(15, "00020", "1 0 1 1 0 0 1 1 1 0", "11 0F 00 13 00 0A 02 CD 01");
    check(16, "40002", "0x000A, 0x0102", "11 10 00 01 00 02 04 00 0A 01 02");
    assert!(message(1, 6, "40002", "65536").is_err_and(|why| why.contains("expected -32768 to 65535")));
}
