//! Columns and cells of lists that are odd: read as they mean it, asked about, or left out with a reason.

use super::{list_of, shown};
use crate::{
    plant::address::AddressBase,
    register_map::{
        list::{Column, ListContext, Said},
        read,
    },
};

/// What of a file is taken, what is left out, and what is asked: each reason holds its words, in this order.
pub fn check(text: &str, taken: &[&str], left_out: &[&str], asked: &[&str]) {
    let list = list_of(text);
    assert_eq!(list.refused, None, "{text}");
    let named: Vec<String> = list.named.iter().map(shown).collect();
    assert_eq!(named, taken, "{text}\n{:?}", list.problems);
    let matches = |all: &[String], words: &[&str]| {
        all.len() == words.len() && all.iter().zip(words).all(|(one, words)| one.contains(words))
    };
    assert!(matches(&list.problems, left_out), "{text}\n{:?}", list.problems);
    let questions: Vec<String> = list.questions.iter().map(|question| question.words()).collect();
    assert!(matches(&questions, asked), "{text}\n{questions:?}");
}

/// The same as its reader has said what a column means.
pub fn said(text: &str, heading: &str, means: Option<Column>, taken: &[&str]) {
    let means = Said::from([(heading.to_owned(), means)]);
    let list = read(text.as_bytes(), &ListContext { means, ..ListContext::default() });
    let named: Vec<String> = list.named.iter().map(shown).collect();
    assert_eq!((named, list.questions), (taken.iter().map(|row| (*row).to_owned()).collect(), Vec::new()), "{text}");
}

#[test]
fn headings_of_other_languages_are_known() {
    let text =
        "Registeradresse;Bezeichnung;Datentyp;Einheit;Faktor\n5;Vorlauf;int16;°C;0,1\n6;Rücklauf;int16;°C;0,01\n";
    check(text, &["40006 Vorlauf int16 ABCD x0.1 °C", "40007 Rücklauf int16 ABCD x0.01 °C"], &[], &[]);
    check("Adresse;Name;Typ;Skalierung\n5;a;uint32;0.1\n", &["40006 a uint32 ABCD x0.1"], &[], &[]);
    for heading in [
        "Adresse;Désignation;Type;Échelle;Unité",
        "Dirección;Nombre;Tipo;Escala;Unidad",
        "Indirizzo;Nome;Tipo;Fattore;Unità",
        "Endereço;Descrição;Tipo;Fator;Unidade",
        "Adres;Naam;Type;Schaal;Eenheid",
        "Adres;Nazwa;Typ;Mnożnik;Jednostka",
        "Adress;Benämning;Datatyp;Skalfaktor;Enhet",
        "Адрес;Название;Тип;Множитель;Единица",
        "地址;名称;类型;系数;单位",
        "ที่อยู่;ชื่อ;ชนิด;ตัวคูณ;หน่วย",
    ] {
        check(&format!("{heading}\n5;a;int16;0,1;°C\n"), &["40006 a int16 ABCD x0.1 °C"], &[], &[]);
    }
}

#[test]
fn a_column_that_may_change_values_is_asked_about() {
    let text = "address;name;type;Ratio\n5;a;int16;10\n6;b;int16;1\n";
    check(text, &["40007 b int16 ABCD x1"], &["Ratio (10)"], &["Ratio (10): factor / divisor?"]);
    said(text, "Ratio", Some(Column::Divisor), &["40006 a int16 ABCD x0.1", "40007 b int16 ABCD x1"]);
    said(text, "ratio", Some(Column::Scale), &["40006 a int16 ABCD x10", "40007 b int16 ABCD x1"]);
    said(text, "Ratio", None, &["40006 a int16 ABCD x1", "40007 b int16 ABCD x1"]);
    let unknown = "address;name;type;Wert pro Digit\n5;a;int16;0.1\n6;b;int16;\n";
    check(unknown, &["40007 b int16 ABCD x1"], &["Wert pro Digit (0.1)"], &["factor / divisor"]);
    let words = "address;name;Art\n5;a;float\n6;b;\n";
    check(words, &["40007 b uint16 ABCD x1"], &["Art (float)"], &["Art (float): type?"]);
    said(words, "Art", Some(Column::Type), &["40006 a float32 ABCD x1"]);
    let places = "address;name;type;Decimals\n5;a;int16;1\n6;b;int16;0\n";
    check(places, &["40007 b int16 ABCD x1"], &["Decimals (1)"], &["implied decimals / decimals"]);
    said(places, "Decimals", Some(Column::Places), &["40006 a int16 ABCD x0.1", "40007 b int16 ABCD x1"]);
    check("address;name;type;divisor\n5;a;int16;0.1\n", &[], &["divisor (0.1)"], &["divisor / factor"]);
    check("address;name;type;scale\n5;a;int16;1,000\n", &[], &["`1,000` is not a scale"], &[]);
    let mixed = "address;name;type;scale\n5;a;int16;10\n6;b;int16;0.1\n";
    check(mixed, &[], &["scale (10)", "scale (0.1)"], &["scale (10): factor / divisor?"]);
    check("address;name;type;multiplier\n5;a;int16;10\n", &["40006 a int16 ABCD x10"], &[], &[]);
}

#[test]
fn a_column_that_is_not_used_is_said() {
    let text = "address;name;type;Default value;Comment;Description\n5;a;int16;2.5;see 4;long\n6;b;int16;3.5;;\n";
    check(text, &["40006 a int16 ABCD x1", "40007 b int16 ABCD x1"], &[], &[]);
    let notes: Vec<String> = list_of(text).said_of_rows().collect();
    let expect = [
        "assumed: plain numbers are addresses as sent, from 0 (2 rows)",
        "not kept: `Comment` of 1 rows, first in line 2",
        "not kept: `Default value` of 2 rows, first in line 2",
        "not kept: `Description` of 1 rows, first in line 2",
    ];
    assert_eq!(notes, expect);
}

#[test]
fn a_sign_and_a_width_make_a_type() {
    let text = "address;name;signed;bits\n5;a;yes;16\n6;b;no;32\n8;c;;32\n";
    check(text, &["40006 a int16 ABCD x1", "40007 b uint32 ABCD x1"], &["32 bits, and no type"], &[]);
    check(
        "address;name;type;signed\n5;a;uint16;yes\n6;b;int;no\n",
        &["40007 b uint16 ABCD x1"],
        &["contradicts its sign"],
        &[],
    );
}

#[test]
fn a_factor_in_front_of_a_unit_counts() {
    let text = "address;name;type;unit\n5;a;uint16;0.1 kW\n6;b;uint16;V\n7;c;uint16;V/10\n8;d;uint16;1/min\n";
    let taken = ["40006 a uint16 ABCD x0.1 kW", "40007 b uint16 ABCD x1 V", "40009 d uint16 ABCD x1 1/min"];
    check(text, &taken, &["7: `V/10`: does its unit have a factor?"], &[]);
    check("address;name;type;unit;scale\n5;a;uint16;0.1 kW;0.1\n", &[], &["it has another"], &[]);
    let resolution = "address;name;type;resolution;unit\n5;a;int16;0.1 V;V\n6;b;int16;0.1°C;\n7;c;int16;0.1 V;mV\n";
    let taken = ["40006 a int16 ABCD x0.1 V", "40007 b int16 ABCD x0.1 °C"];
    check(resolution, &taken, &["7: `0.1 V` and `mV` differ"], &[]);
    check("address;name;type;factor\n5;a;int16;1%\n6;b;int16;0.1\n", &["40007 b int16 ABCD x0.1"], &["`1%`"], &[]);
}

#[test]
fn a_number_sign_heads_a_column_and_marks_a_comment() {
    let rows = "1;40005;a\n2;40007;b\n";
    let taken = ["40005 a uint16 ABCD x1", "40007 b uint16 ABCD x1"];
    for heading in ["#;Register;Name\n", "# a map\n#;Register;Name\n"] {
        let list = list_of(&format!("{heading}{rows}"));
        assert_eq!(list.named.iter().map(shown).collect::<Vec<_>>(), taken, "{heading}{:?}", list.problems);
    }
    check("#Register;Name\n# 5;off\n5;a\n", &["40006 a uint16 ABCD x1"], &[], &[]);
    check("# Register;Name\nRegister;Name\n5;a\n", &["40006 a uint16 ABCD x1"], &[], &[]);
}

#[test]
fn plain_numbers_without_a_heading_are_no_factors() {
    check("40005  Voltage  2  0.1  V\n", &[], &["what is `2`?"], &[]);
    check("40005  Voltage  10\n", &[], &["what is `10`?"], &[]);
    check("40005  Voltage  0.1  /10\n", &[], &["second factor"], &[]);
    check("40005 Zone 2 temperature int16 0.1 °C\n", &["40005 Zone 2 temperature int16 ABCD x0.1 °C"], &[], &[]);
    check("4x0005  Voltage  x10  V\n", &["40005 Voltage uint16 ABCD x10 V"], &[], &[]);
}

#[test]
fn a_cell_that_does_not_fit_leaves_out_its_row_alone() {
    let rows = "0x5;a;int16;0.1;0;10;1;rw\n6;b;int16;;0;ten;1;rw\n7;c;int16;;0;30;1;?\n8;d;int16;;1;30;one;r\n";
    let text = format!("address;name;type;scale;min;max;decimals;access\n{rows}");
    let left_out = ["6: `ten` is not understood in the column greatest", "7: `?`", "8: `one`"];
    check(&text, &["40006 a int16 ABCD x0.1 rw min0 max10"], &left_out, &[]);
    let bad = "address;name;type;bad if\n5;a;float32;-9999.5 0x7F7FFFFF\n7;b;uint16;65535\n8;c;uint16;n/a\n";
    check(
        bad,
        &["40006 a float32 ABCD x1 !-9999.5 !340282346638528860000000000000000000000", "40008 b uint16 ABCD x1 !65535"],
        &["8: `n/a`"],
        &[],
    );
    let length = "address;name;type;registers\n5;a;int16;1\n6;b;int16;one\n7;c;int;2\n";
    check(length, &["40006 a int16 ABCD x1", "40008 c int32 ABCD x1"], &["6: `one`"], &[]);
    let units: String = (5..10).map(|n| format!("{n};a{n};3\n")).collect();
    let list = list_of(&format!("address;name;unit\n{units}10;b;2 (option)\n"));
    assert_eq!((list.named.len(), list.problems.len()), (5, 1), "{:?}", list.problems);
    assert!(list.problems[0].contains("`2 (option)`"), "{:?}", list.problems);
}

#[test]
fn areas_of_modicon_are_not_function_codes() {
    let text = "area;address;name\n4x;5;a\n3x;6;b\n1x;7;c\n0x;8;d\n";
    let taken = ["40006 a uint16 ABCD x1", "30007 b uint16 ABCD x1", "10008 c bool ABCD x1", "00009 d bool ABCD x1"];
    check(text, &taken, &[], &[]);
    let marked = "address;name\n4x0005;a\n3X0006;b\n0x0007;c\n";
    check(marked, &["40005 a uint16 ABCD x1", "30006 b uint16 ABCD x1", "00007 c bool ABCD x1"], &[], &[]);
    check("address;name\n0x0010;a\n0x0011;b\n", &["40017 a uint16 ABCD x1", "40018 b uint16 ABCD x1"], &[], &[]);
    let digits = "area;address;name\n4;5;a\n3;6;b\n";
    check(digits, &[], &["area (4)", "area (3)"], &["table / area"]);
    said(digits, "area", Some(Column::Area), &["40006 a uint16 ABCD x1", "30007 b uint16 ABCD x1"]);
    check(
        "function code;address;name\n4;5;a\n3;6;b\n",
        &["30006 a uint16 ABCD x1", "40007 b uint16 ABCD x1"],
        &[],
        &[],
    );
}

#[test]
fn hexadecimal_digits_are_those_of_a_whole_column() {
    check(
        "address;name\n0A;a\n1F;b\n10;c\n",
        &["40011 a uint16 ABCD x1", "40032 b uint16 ABCD x1", "40017 c uint16 ABCD x1"],
        &[],
        &[],
    );
    let list = list_of("address;name\nA0;a\n10;b\n11;c\n");
    assert!(list.named.is_empty() && list.questions[0].may_be == [Column::Address, Column::HexAddress], "{list:?}");
    said(
        "address;name\nA0;a\n10;b\n",
        "address",
        Some(Column::HexAddress),
        &["40161 a uint16 ABCD x1", "40017 b uint16 ABCD x1"],
    );
}

#[test]
fn a_bit_is_a_part_of_its_register() {
    let text = "address;bit;name\n5;0;a\n5;7-4;b\n5;..;c\n6;;d\n";
    check(
        text,
        &["40006 a uint16[0+1] ABCD x1", "40006 b uint16[4+4] ABCD x1", "40007 d uint16 ABCD x1"],
        &["5: `..`"],
        &[],
    );
    check(
        "address;bit;name;type\n5;3;a;bool\n5;20;b;uint16\n",
        &["40006 a uint16[3+1] ABCD x1"],
        &["no bits 20 to 20"],
        &[],
    );
    let from_one: String = (1..=16).map(|bit| format!("5;{bit};b{bit}\n")).collect();
    let list = list_of(&format!("address;bit;name\n{from_one}"));
    assert!(list.named.is_empty() && list.questions.len() == 1, "{list:?}");
}

#[test]
fn lengths_in_bytes_are_known_or_asked_about() {
    let bytes = "address;name;type;length\n5;a;uint16;2\n6;b;uint32;4\n8;c;string;8\n";
    check(bytes, &["40006 a uint16 ABCD x1", "40007 b uint32 ABCD x1", "40009 c string(8) ABCD x1"], &[], &[]);
    let open = "address;name;type;length\n5;a;int;2\n7;b;int;4\n";
    check(open, &[], &["length (2)", "length (4)"], &["registers / bytes"]);
    said(open, "length", Some(Column::Bytes), &["40006 a int16 ABCD x1", "40008 b int32 ABCD x1"]);
    check("address;name;type;size (bytes)\n5;a;int;2\n", &["40006 a int16 ABCD x1"], &[], &[]);
}

#[test]
fn a_number_of_no_table_proves_nothing_of_others() {
    for other in ["70000", "50001"] {
        let list = list_of(&format!("address;name;type\n40080;W;int16\n{other};E;int16\n"));
        assert_eq!(list.unclear.map(|unclear| unclear.written).as_deref(), Some("40080"), "{other}");
    }
}

#[test]
fn a_padded_number_may_count_from_one() {
    let unclear = |text: &str| list_of(text).unclear.map(|unclear| (unclear.written, unclear.readings[0].0));
    let asked = Some(("0005".to_owned(), AddressBase::One));
    assert_eq!(unclear("area;address;name;type\n4x;0005;a;int16\n4x;0012;b;int16\n"), asked);
    assert_eq!(unclear("address;name;type\n0005;a;int16\n12;b;int16\n"), asked);
    assert_eq!(unclear("address;name;type\n0005;a;int16\n0000;b;int16\n"), None, "it counts from 0");
    assert_eq!(unclear("address (1-based);name;type\n0005;a;int16\n"), None);
    assert_eq!(unclear("address;name;type\n5;a;int16\n"), None);
}

#[test]
fn what_may_be_written_is_taken_where_that_is_sure() {
    let list = |text: &str| list_of(&format!("{text}\n"));
    let access = |text: &str| list(text).named.iter().map(|named| named.access.word()).collect::<Vec<_>>();
    for (heading, cells, expect) in [
        ("Access", ["R", "R/W", "W"], ["r", "rw", "w"]),
        ("R/W", ["read only", "Read/Write", "write-only"], ["r", "rw", "w"]),
        ("Zugriff", ["Lesen", "Lesen/Schreiben", "Schreiben"], ["r", "rw", "w"]),
    ] {
        let rows = |first: &str| {
            let row = |(n, cell): (usize, &&str)| format!("{first}{n};n{n};int16;{cell}");
            let rows: Vec<String> = cells.iter().enumerate().map(row).collect();
            format!("address;name;type;{heading}\n{}", rows.join("\n"))
        };
        assert_eq!(access(&rows("0x1")), expect, "{heading}");
        assert_eq!(access(&rows("1")), ["r", "r", "r"], "the base is assumed: {heading}");
        assert!(list(&rows("1")).said_of_rows().any(|said| said.contains("read only")), "{heading}");
        assert_eq!(access(&rows("input:")), ["r", "r", "r"], "{heading}");
    }
    assert_eq!(access("address;name;type;access\n0x1;a;int32;RW"), ["r"], "the order is assumed");
    assert_eq!(access("address;name;type;access\n0x1;a;int16;RW\n0x2;b;int16;level 2"), ["r", "r"], "said, not kept");
}

#[test]
fn what_is_assumed_is_said() {
    let warnings = |text: &str| list_of(text).said_of_rows().collect::<Vec<_>>();
    let plain = "assumed: plain numbers are addresses as sent, from 0 (1 rows)".to_owned();
    assert_eq!(warnings("address;name;type\n5;a;int16\n"), std::slice::from_ref(&plain));
    assert_eq!(warnings("address;name;type\n0x5;a;int32\n"), ["assumed: byte order ABCD (1 rows)"]);
    assert_eq!(warnings("address;name\n0x5;a\n"), ["assumed: type uint16 (1 rows)"]);
    let both = "address;name;type;scale;offset\n0x5;a;int16;0.1;-40\n";
    assert_eq!(warnings(both), ["assumed: the offset is added after the factor (1 rows)"]);
    check("address (1-based);name\n5;a\n", &["40005 a uint16 ABCD x1"], &[], &[]);
    assert_eq!(warnings("address (1-based);name;type\n5;a;int16\n"), Vec::<String>::new());
    check("PDU address;name;type\n40001;a;int16\n", &["440002 a int16 ABCD x1"], &[], &[]);
    check("address;name;type\n5;a;int16\n6;b;\n", &["40006 a int16 ABCD x1"], &["6: no type"], &[]);
}

#[test]
fn orders_in_words_are_known_where_they_can_mean_one_thing() {
    let text = "address;name;type;word order\n0;a;int32;Low word first\n2;b;int32;big-endian\n4;c;int32;little endian\n6;d;int32;CDAB\n8;e;int32;word swapped\n10;f;int16;little endian\n";
    let taken = ["40001 a int32 CDAB x1", "40003 b int32 ABCD x1", "40007 d int32 CDAB x1", "40009 e int32 CDAB x1"];
    check(text, &taken, &["4: `little endian` is not a byte order", "10: `little endian`"], &[]);
    let typed = "address;name;type\n0;a;FLOAT (CDAB)\n2;b;FLOAT32-ABCD\n4;c;float inverse\n";
    check(
        typed,
        &["40001 a float32 CDAB x1", "40003 b float32 ABCD x1"],
        &["`float inverse` is not a known type"],
        &[],
    );
}
