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
fn the_words_of_a_type_say_its_kind_sign_size_and_order() {
    let (big, low) = (Some(ByteOrder::Abcd), Some(ByteOrder::Cdab));
    for (word, kind, order) in [
        ("U_WORD", DataType::U16, None),
        ("S_WORD", DataType::I16, None),
        ("U_DWORD", DataType::U32, None),
        ("S_DWORD", DataType::I32, None),
        ("INTEGER", DataType::I16, None),
        ("INT32U", DataType::U32, None),
        ("INT16S", DataType::I16, None),
        ("unsigned long", DataType::U32, None),
        ("16-bit unsigned integer", DataType::U16, None),
        ("Signed Int 32", DataType::I32, None),
        ("Unsigned 32 bits", DataType::U32, None),
        ("unsignedint", DataType::U16, None),
        ("FLOAT32 (IEEE-754)", DataType::F32, None),
        ("32-bit IEEE float", DataType::F32, None),
        ("double precision floating point", DataType::F64, None),
        ("UINT (16 bit)", DataType::U16, None),
        ("UINT32 big-endian", DataType::U32, big),
        ("u32 (LSW first)", DataType::U32, low),
        ("int32 word swapped", DataType::I32, low),
        ("FLOAT (CDAB)", DataType::F32, low),
        ("string(8) (CDAB)", DataType::Text(8), low),
        ("enum16", DataType::U16, None),
        ("bitfield32", DataType::U32, None),
        ("acc64", DataType::U64, None),
        ("sunssf", DataType::I16, None),
        ("BITMAP", DataType::U16, None),
        ("E16", DataType::U16, None),
        ("INT16 SM", DataType::Sm16, None),
        ("REAL32", DataType::F32, None),
        ("REAL64", DataType::F64, None),
    ] {
        assert_eq!(type_of(word, None), Ok((kind, order)), "{word}");
    }
    assert_eq!(type_of("BITMAP", Some(2)), Ok((DataType::U32, None)));
    assert_eq!(type_of("UTF8", Some(4)), Ok((DataType::Text(8), None)));
    assert_eq!(type_of("STR", Some(4)), Ok((DataType::Text(8), None)));
    for word in [
        "long long",
        "double word",
        "word 32",
        "signed uint16",
        "unsigned float",
        "16 bit",
        "2 x uint16",
        "int7",
        "u",
        "acc",
        "sm",
        "int16 uint32",
        "uint32 little endian",
        "set point",
        "int16 quux",
        "magnitude",
    ] {
        assert!(type_of(word, None).is_err(), "{word}");
    }
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

#[test]
fn names_of_numbers_are_parted_as_manuals_part_them() {
    let read = |cell: &str| {
        let read = written_labels_of(cell)?;
        Some(read.into_iter().map(|(number, text)| format!("{number} {text}")).collect::<Vec<_>>().join("+"))
    };
    for (cell, expect) in [
        ("0=Off, 1=Heat, 2=Cool", "0 Off+1 Heat+2 Cool"),
        ("0: Off, 1: On", "0 Off+1 On"),
        ("0=Off/1=On", "0 Off+1 On"),
        ("0 = Off | 1 = On", "0 Off+1 On"),
        ("0=Off 1=On", "0 Off+1 On"),
        ("0=off; 1=on, always; -1=at 12:30", "0 off+1 on, always+-1 at 12:30"),
        ("0x01=One, 0x10=Sixteen", "1 One+16 Sixteen"),
        ("0=Off\\; really; 1=On", "0 Off; really+1 On"),
        ("5=five", "5 five"),
    ] {
        assert_eq!(read(cell).as_deref(), Some(expect), "{cell}");
    }
    for cell in ["", "Off", "see 0=Off", "0=Off, 0=On", "0=, 1=On", "a=b"] {
        assert_eq!(read(cell), None, "{cell}");
    }
    assert_eq!(
        labels_of("0=Off, 1=On"),
        Some(vec![(0, "Off, 1=On".to_owned())]),
        "as an export of this program has it"
    );
}
