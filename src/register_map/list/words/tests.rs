//! The words of cells.

use super::*;

#[test]
fn a_type_fits_its_number_of_registers_or_is_refused() {
    let check = |word: &str, length, expect: Option<(DataType, Option<ByteOrder>)>| {
        assert_eq!(type_of(word, length).ok(), expect, "{word} {length:?}");
    };
    check("int16", None, Some((DataType::I16, None)));
    check("int16", Some(2), None);
    check("signed", Some(2), Some((DataType::I32, None)));
    check("unsigned", Some(3), None);
    check("string", Some(4), Some((DataType::Text(8), None)));
    check("string", None, None);
    check("uint16be", Some(1), Some((DataType::U16, Some(ByteOrder::Abcd))));
    check("uint32sw", Some(2), Some((DataType::U32, Some(ByteOrder::Cdab))));
    check("floatle", Some(2), Some((DataType::F32, Some(ByteOrder::Dcba))));
    check("int16le", Some(1), Some((DataType::I16, Some(ByteOrder::Badc))));
    check("uint32sb", Some(2), Some((DataType::U32, Some(ByteOrder::Badc))));
    check("uint16sb", Some(1), None);
    check("s8", None, Some((DataType::I8, None)));
    check("uint8le", Some(1), Some((DataType::U8, Some(ByteOrder::Badc))));
    check("int8be", None, Some((DataType::I8, Some(ByteOrder::Abcd))));
    check("uint48", Some(3), Some((DataType::U48, None)));
    check("cstring(8)", None, Some((DataType::TextToNul(8), None)));
    check("mod10k(2)", Some(2), Some((DataType::Mod10k(2), None)));
}

#[test]
fn tables_are_known_by_words_and_function_codes() {
    for (word, table) in [
        ("MODBUS_INPUT_REGISTER", Table::Input),
        ("MODBUS_HOLDING_REGISTER", Table::Holding),
        ("03/06/16", Table::Holding),
        ("FC04", Table::Input),
        ("Coil (0x)", Table::Coil),
        ("4x", Table::Holding),
        ("4xxxx", Table::Holding),
        ("4X0001", Table::Holding),
        ("4x (Holding)", Table::Holding),
        ("3x", Table::Input),
        ("3X Input register", Table::Input),
        ("1x", Table::Discrete),
        ("0x", Table::Coil),
        ("0x03", Table::Holding),
        ("0x04", Table::Input),
        ("3 - Input register", Table::Input),
        ("4: holding", Table::Holding),
        ("06", Table::Holding),
    ] {
        assert_eq!(table_of(word), Some(table), "{word}");
    }
    for word in ["measured value", "03/04", "4xy", "7", "holding and input registers"] {
        assert_eq!(table_of(word), None, "{word}");
    }
    assert_eq!([number_of("10^-2"), number_of("0,1"), number_of("/10")], [Some(0.01), Some(0.1), Some(0.1)]);
    assert_eq!([number_of("1,000"), number_of("0,001"), number_of("1,25")], [None, Some(0.001), Some(1.25)]);
}

#[test]
fn a_unit_with_a_factor_is_both_and_a_doubtful_one_is_none() {
    for (cell, factor, unit) in [
        ("0.1 kW", 0.1, "kW"),
        ("0,1°C", 0.1, "°C"),
        ("1/10 V", 0.1, "V"),
        ("x0.01 A", 0.01, "A"),
        ("10 kWh", 10.0, "kWh"),
        ("10^-1 %", 0.1, "%"),
        ("1/min", 1.0, "1/min"),
        ("m3/h", 1.0, "m³/h"),
        ("0-100 %", 1.0, "0-100 %"),
        ("0=off, 1=on", 1.0, "0=off, 1=on"),
        ("steps", 1.0, "steps"),
    ] {
        assert_eq!(unit_with_factor(cell), Ok((factor, unit.to_owned())), "{cell}");
    }
    for cell in ["2 (option)", "0.1", "50 Hz", "V/10", "°C*10", "kWh x 0.1", "0.1 quux"] {
        assert!(unit_with_factor(cell).is_err(), "{cell}");
    }
}

#[test]
fn lengths_and_bits_are_read_as_manuals_write_them() {
    for (cell, registers, bytes) in
        [("2", 2, 1), ("2 registers", 2, 2), ("4 bytes", 2, 2), ("32 bit", 2, 2), ("1 word", 1, 1)]
    {
        assert_eq!((length_of(cell, false), length_of(cell, true)), (Some(registers), Some(bytes)), "{cell}");
    }
    assert_eq!([length_of("3", true), length_of("2 (option)", false), length_of("n", false)], [None; 3]);
    for (cell, field) in [("3", (3, 1)), ("Bit 3", (3, 1)), ("0..3", (0, 4)), ("7:4", (4, 4)), ("b15", (15, 1))] {
        assert_eq!(bit_field_of(cell), Some(field), "{cell}");
    }
    assert_eq!(bit_field_of("all"), None);
}

#[test]
fn names_of_numbers_are_read_as_they_are_written() {
    let labels = [(0, "off; really"), (2, "a\\b, c = d"), (-1, "two\nlines")];
    let text = labels_text(labels.into_iter());
    let read = labels_of(&text).expect("it is read");
    assert_eq!(read.iter().map(|(number, text)| (*number, text.as_str())).collect::<Vec<_>>(), labels);
}
