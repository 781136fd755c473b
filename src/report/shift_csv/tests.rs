//! The bytes of whole reports, and what a spreadsheet would take for a formula.

use super::*;
use crate::{
    report::{
        csv::{floor_percent, number},
        record_csv::RecordCsv,
        testing::{THREE, plant, shift_report},
    },
    text::Locale,
};

fn document(locale: Locale) -> Document {
    let def = plant("Asia/Bangkok", &THREE);
    crate::report::content::document(&shift_report(), &def, locale)
}

fn style(csv: CsvDialect) -> Style {
    Style { csv, ..Style::of(&plant("Asia/Bangkok", &THREE)) }
}

fn dialect(separator: char, decimal: char, bom: bool) -> CsvDialect {
    CsvDialect { separator, decimal, bom }
}

#[test]
fn the_report_reads_as_a_technician_expects() {
    let csv = String::from_utf8(stacked(&document(Locale::ENGLISH), CsvDialect::default())).unwrap();
    insta::assert_snapshot!(csv.replace(env!("CARGO_PKG_VERSION"), "VERSION").replace("\r\n", "\n"));
    assert!(csv.lines().count() > 60 && csv.ends_with("\r\n"));
}

#[test]
fn every_dialect_gives_the_same_cells_to_a_strict_reader() {
    let rows = |dialect: CsvDialect| -> Vec<Vec<String>> {
        let bytes = stacked(&document(Locale::ENGLISH), dialect);
        let body = bytes.strip_prefix("\u{feff}".as_bytes());
        assert_eq!(body.is_some(), dialect.bom);
        ::csv::ReaderBuilder::new()
            .has_headers(false)
            .delimiter(dialect.separator as u8)
            .from_reader(body.unwrap_or(&bytes))
            .records()
            .map(|row| row.unwrap().iter().map(str::to_owned).collect())
            .collect()
    };
    let english = rows(dialect(',', '.', false));
    let german = rows(dialect(';', ',', true));
    assert!(german.iter().any(|row| row.contains(&"54,32".to_owned())));
    assert_eq!(english.len(), german.len());
    let tags = |rows: &[Vec<String>]| rows[6].join("|");
    assert_eq!(tags(&german).replace(',', "."), tags(&english));
}

#[test]
fn the_record_alone_is_a_plain_table() {
    let bytes = RecordCsv.render(&document(Locale::ENGLISH), &style(dialect(';', ',', false))).unwrap();
    let csv = String::from_utf8(bytes).unwrap();
    let expect = "time;offset;SV;PV;ER\r\n2026-11-21 06:00:00;UTC+07:00;70,0;72,5;-2,5\r\n\
        2026-11-21 06:00:10;UTC+07:00;70,0;;\r\n";
    assert_eq!(csv, expect);
}

#[test]
fn text_that_a_spreadsheet_would_run_stays_text() {
    for (cell, expect) in [
        ("=1+1", "'=1+1"),
        ("+66 2", "'+66 2"),
        ("-", "'-"),
        ("@SUM", "'@SUM"),
        ("\tx", "'\tx"),
        ("\rx", "'\rx"),
        ("", ""),
        ("TIC-1", "TIC-1"),
        (" =1", " =1"),
    ] {
        assert_eq!(text(cell), expect);
    }
    assert_eq!(number(Some(-1.25), 1, CsvDialect::default()), "-1.2");
    assert_eq!(number(Some(f64::NAN), 1, CsvDialect::default()), "");
    assert_eq!(floor_percent(1.0), 100.0);
}
