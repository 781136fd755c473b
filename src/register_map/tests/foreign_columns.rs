//! Columns of makers that mean something else than their heading says elsewhere: factors and bounds.

use super::{
    doubtful::{check, said},
    list_of,
};
use crate::register_map::list::Column;

/// What is said of the rows of a list.
fn notes(text: &str) -> String {
    list_of(text).said_of_rows().collect::<Vec<_>>().join("\n")
}

#[test]
fn sf_without_a_negative_power_is_asked_about() {
    let text = "Address;Name;Data Type;SF\n0x10;a;U16;10\n0x11;b;U32;1\n";
    let asked = ["SF (10): power of ten / divisor / factor?"];
    check(text, &[], &["SF (10)", "SF (1)"], &asked);
    said(text, "SF", Some(Column::Divisor), &["40017 a uint16 ABCD x0.1", "40018 b uint32 ABCD x1"]);
    let proved = "Address;Name;Data Type;SF\n0x10;a;U16;-1\n0x11;b;U16;2\n";
    check(proved, &["40017 a uint16 ABCD x0.1", "40018 b uint16 ABCD x100"], &[], &[]);
    check("Address;Name;Type;Exponent\n0x10;a;U16;2\n", &["40017 a uint16 ABCD x100"], &[], &[]);
}

#[test]
fn a_power_beyond_ten_is_none() {
    let text = "Address;Name;Type;Exponent\n0x10;a;U16;-2\n0x11;b;U16;100\n0x12;c;U16;0\n";
    check(text, &["40017 a uint16 ABCD x0.01", "40019 c uint16 ABCD x1"], &["`100` is not a scale"], &[]);
}

#[test]
fn formats_of_decimals_scale() {
    let words = "Address;Name;Type;Format\n0x10;a;uint16;hex\n0x11;b;uint16;0.0\n";
    check(words, &["40017 a uint16 ABCD x1"], &["Format (0.0)"], &["Format (0.0)"]);
    let text = "Adresse;Name;Typ;Format\n0x10;a;U32;FIX2\n0x12;b;S32;FIX0\n0x14;c;S32;TEMP\n0x16;d;U32;ENUM\n";
    let taken =
        ["40017 a uint32 ABCD x0.01", "40019 b int32 ABCD x1", "40021 c int32 ABCD x0.1", "40023 d uint32 ABCD x1"];
    check(text, &taken, &[], &[]);
    assert!(notes(text).contains("not kept: `Format` of 1 rows, first in line 5"), "{}", notes(text));
    let beside = "Address;Name;Data type;Data format\n0x10;a;uint16;FIX1\n";
    check(beside, &["40017 a uint16 ABCD x0.1"], &[], &[]);
    for (pattern, scale) in [("0.00", "0.01"), ("####.#", "0.1"), ("XX.XX", "0.01"), ("##0,0", "0.1")] {
        let text = format!("Address;Name;Type;Format\n0x10;a;uint16;{pattern}\n0x11;b;uint16;0\n");
        check(&text, &["40018 b uint16 ABCD x1"], &[pattern], &["implied decimals / decimals"]);
        let taken = [format!("40017 a uint16 ABCD x{scale}"), "40018 b uint16 ABCD x1".to_owned()];
        said(&text, "Format", Some(Column::Places), &[&taken[0], &taken[1]]);
        said(&text, "Format", Some(Column::Decimals), &["40017 a uint16 ABCD x1", "40018 b uint16 ABCD x1"]);
    }
    check(
        "Address;Name;Type;Format\n0x10;a;uint16;FIX1\n0x11;b;uint16;/10\n",
        &["40017 a uint16 ABCD x0.1"],
        &["`/10`"],
        &[],
    );
}

#[test]
fn a_marked_divisor_says_itself_what_it_does() {
    for (cell, scale) in
        [("/10", "0.1"), ("1/100", "0.01"), (":10", "0.1"), ("÷ 100", "0.01"), ("10", "0.1"), ("10^2", "0.01")]
    {
        let text = format!("Address;Name;Type;Divisor\n0x10;a;int16;{cell}\n");
        check(&text, &[&format!("40017 a int16 ABCD x{scale}")], &[], &[]);
    }
    for cell in ["x10", "10/1", "10^-1"] {
        check(&format!("Address;Name;Type;Divisor\n0x10;a;int16;{cell}\n"), &[], &["is not a scale"], &[]);
    }
}

#[test]
fn scale_factors_that_may_divide_are_asked_about() {
    let text = "description;Address;Type;Scalefactor;dbus-unit\nVoltage;3;uint16;10;V AC\nPower;12;int16;0.1;W\nCode;20;uint16;1;\n";
    check(text, &["40021 Code uint16 ABCD x1"], &["Scalefactor (10)", "Scalefactor (0.1)"], &["factor / divisor?"]);
    let divided = ["40004 Voltage uint16 ABCD x0.1 V AC", "40013 Power int16 ABCD x10 W", "40021 Code uint16 ABCD x1"];
    said(text, "Scalefactor", Some(Column::Divisor), &divided);
    for heading in ["Scale factor", "Gain"] {
        let text = format!("Address;Name;Type;{heading}\n0x10;a;int16;0.1\n");
        check(&text, &[], &[heading], &["factor / divisor?"]);
    }
    check("Address;Name;Type;Factor\n0x10;a;int16;10\n0x11;b;int16;0.1\n", &[], &["10", "0.1"], &["factor / divisor?"]);
}

#[test]
fn two_columns_that_say_one_factor_count_once() {
    let text = "Address;Name;Type;Factor;Divisor\n0x10;a;int16;0.1;10\n0x11;b;int16;0.1;100\n0x12;c;int16;1;10\n";
    let taken = ["40017 a int16 ABCD x0.1", "40019 c int16 ABCD x0.1"];
    check(text, &taken, &["`0.1` and `100` differ"], &[]);
    let index = "Address;Name;Type;Conversion exponent;Conversion factor\n0x10;a;int16;-1;0.1\n0x11;b;int16;-2;0.1\n";
    check(index, &["40017 a int16 ABCD x0.1"], &["differ"], &[]);
}

#[test]
fn a_factor_proves_what_another_column_means() {
    let text = "Address;Name;Type;Factor;Gain\n0x10;a;int16;0.1;10\n0x11;b;int16;1;1\n0x12;c;int16;0.01;100\n";
    check(text, &["40017 a int16 ABCD x0.1", "40018 b int16 ABCD x1", "40019 c int16 ABCD x0.01"], &[], &[]);
    let other = text.replace("0.01;100", "0.01;10");
    check(&other, &["40018 b int16 ABCD x1"], &["Gain (10)", "Gain (10)"], &["Gain (10): factor / divisor?"]);
    let index = "Address;Name;Type;Conversion index;Divisor\n0x10;a;int16;-1;10\n0x11;b;int16;0;1\n";
    check(index, &["40017 a int16 ABCD x0.1", "40018 b int16 ABCD x1"], &[], &[]);
    let dates = "Address;Name;Type;Default (dec)\n0x10;a;int16;1\n";
    check(dates, &["40017 a int16 ABCD x1"], &[], &[]);
}

#[test]
fn no_factor_may_be_written_in_words() {
    let text = "Address;Name;Type;Scale\n0x10;a;int16;N/A\n0x11;b;int16;n.a.\n0x12;c;int16;0.1\n0x13;d;int16;—\n";
    let taken = ["40017 a int16 ABCD x1", "40018 b int16 ABCD x1", "40019 c int16 ABCD x0.1", "40020 d int16 ABCD x1"];
    check(text, &taken, &[], &[]);
}

#[test]
fn factors_in_brackets_of_a_unit_count() {
    for (cell, expect) in [
        ("[0.1 V]", "x0.1 V"),
        ("(0.1 V)", "x0.1 V"),
        ("W [0.1]", "x0.1 W"),
        ("W (0.1)", "x0.1 W"),
        ("V×10⁻¹", "x0.1 V"),
        ("V×10-1", "x0.1 V"),
        ("V x 0.1", "x0.1 V"),
        ("tenths of °C", "x0.1 °C"),
        ("hundredths of V", "x0.01 V"),
        ("Zehntel Grad", "x0.1 Grad"),
        ("m³/h [0.1]", "x0.1 m³/h"),
        ("[V]", "x1 V"),
        ("0.1 V", "x0.1 V"),
    ] {
        let text = format!("Address;Name;Type;Unit\n0x10;a;int16;{cell}\n");
        check(&text, &[&format!("40017 a int16 ABCD {expect}")], &[], &[]);
    }
}

#[test]
fn an_accuracy_is_no_factor_beside_one() {
    for heading in ["Accuracy", "Step"] {
        let text = format!("Address;Name;Type;Factor;{heading}\n0x10;a;int16;0.1;0.5\n");
        check(&text, &["40017 a int16 ABCD x0.1"], &[], &[]);
        let alone = format!("Address;Name;Type;{heading}\n0x10;a;int16;0.1\n");
        check(&alone, &[], &[heading], &["factor / divisor?"]);
    }
    check("Address;Name;Type;Risoluzione;Unidades\n0x10;a;int16;0.1;V\n", &["40017 a int16 ABCD x0.1 V"], &[], &[]);
}

#[test]
fn bounds_beside_a_factor_are_said_or_left_out() {
    let text = "Address;Name;Type;Scale;Min;Max\n0x10;a;int16;0.1;0;300\n0x11;b;uint16;0.1;0;65535\n";
    check(text, &["40017 a int16 ABCD x0.1 min0 max300"], &["`65535`"], &[]);
    assert!(notes(text).contains("bounds are values after the factor (1 rows)"), "{}", notes(text));
    let plain = "Address;Name;Type;Min;Max\n0x10;a;int16;0;300\n";
    assert!(!notes(plain).contains("bounds"), "{}", notes(plain));
}
