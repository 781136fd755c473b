//! The bytes of whole reports, and what a spreadsheet would take for a formula.

use std::time::Duration;

use super::*;
use crate::{
    plant::record::{AlarmEvent, ChainHash},
    report::{
        Period, RecordRow,
        record_csv::RecordCsv,
        testing::{THREE, at, named, plant},
    },
};

fn report() -> ShiftReport {
    let from = at("2026-11-21T06:00+07");
    ShiftReport {
        period: Period { name: named("morning 2026-11-21"), from, to: at("2026-11-21T14:00+07") },
        until: at("2026-11-21T13:59:30+07"),
        audit: Some(ChainHash { number: 17, hash: [0xA5; 32] }),
        unreadable: vec![Gap {
            from: from + Duration::from_secs(3_600),
            to: from + Duration::from_secs(3_720),
            why: "checksum".into(),
        }],
        batches: Vec::new(),
        tags: vec![
            TagFigures {
                tag: "TIC-1.PV".into(),
                unit: "°C".into(),
                decimals: 1,
                min: Some(-0.04),
                mean: Some(54.3219),
                max: Some(71.2),
                last: Some(70.0),
                difference: None,
                in_alarm: Duration::from_secs(90),
                good: 0.99999,
            },
            TagFigures {
                tag: "TIC-1.MV".into(),
                unit: "%".into(),
                decimals: 0,
                min: None,
                mean: None,
                max: None,
                last: None,
                difference: None,
                in_alarm: Duration::ZERO,
                good: 0.0,
            },
            TagFigures {
                tag: "PM-1.E".into(),
                unit: "kWh".into(),
                decimals: 2,
                min: Some(1250.0),
                mean: None,
                max: Some(1262.5),
                last: Some(1262.5),
                difference: Some(12.5),
                in_alarm: Duration::ZERO,
                good: 1.0,
            },
        ],
        suppressed: vec![SuppressedSummary {
            subject: "PLC-1.LT-1".into(),
            message: "level low".into(),
            priority: Priority::Low,
            raised: 2,
            active: Duration::from_secs(486),
        }],
        alarms: vec![AlarmRecord {
            at: at("2026-11-21T06:12:45.5+07"),
            subject: "TIC-1.PV".into(),
            message: "temperature high; \"check\" heater".into(),
            priority: Priority::High,
            event: AlarmEvent::Raised,
            value: Some(-85.25),
            limit: Some(85.0),
            by: None,
            reason: None,
            until: None,
            first_out: None,
        }],
        alarm_metrics: alarm_metrics::tests::figures(),
        actions: vec![ActionRecord {
            at: at("2026-11-21T06:13+07"),
            by: "=cmd|' /C calc'!A0".into(),
            action: "write".into(),
            target: "TIC-1.SV".into(),
            old: Some("-70.0 °C".into()),
            new: Some("60.0 °C".into()),
            outcome: "verified".into(),
            from: "".into(),
            note: None,
            chain_hash: None,
        }],
        record: vec![
            RecordRow { at: from, sv: Some(70.0), pv: Some(72.5), er: Some(-2.5) },
            RecordRow { at: from + Duration::from_secs(10), sv: Some(70.0), pv: None, er: None },
        ],
        record_of: Some(("TIC-1".into(), "°C".into())),
    }
}

fn dialect(separator: char, decimal: char, bom: bool) -> CsvDialect {
    CsvDialect { separator, decimal, bom }
}

#[test]
fn the_report_reads_as_a_technician_expects() {
    let def = plant("Asia/Bangkok", &THREE);
    let csv = String::from_utf8(shift_csv(&report(), &def, CsvDialect::default())).unwrap();
    let expect = "\
shift report,,,,,,,,
plant,shift,from,to,until,program,audit entry,audit hash,
Water tank,morning 2026-11-21,2026-11-21T06:00:00+07:00,2026-11-21T14:00:00+07:00,2026-11-21T13:59:30+07:00,sightglass VERSION,17,a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5,
,,,,,,,,
tags,,,,,,,,
tag,unit,min,mean,max,last,minutes in alarm,good %,difference
TIC-1.PV,°C,0.0,54.32,71.2,70.0,1.5,99.9,
TIC-1.MV,%,,,,,0.0,0.0,
PM-1.E,kWh,1250.00,,1262.50,1262.50,0.0,100.0,12.50
,,,,,,,,
\"not readable, not counted\",,,,,,,,
from,to,why,,,,,,
2026-11-21T07:00:00+07:00,2026-11-21T07:02:00+07:00,checksum,,,,,,
,,,,,,,,
alarm counts,,,,,,,,
priority,raised,raised while suppressed,,,,,,
critical,0,0,,,,,,
high,1,0,,,,,,
medium,0,0,,,,,,
low,0,2,,,,,,
,,,,,,,,
suppressed alarms,,,,,,,,
priority,subject,alarm,raised,minutes active,,,,
low,PLC-1.LT-1,level low,2,8.1,,,,
,,,,,,,,
alarm metrics,,,,,,,,
metric,value,target,limit,result,,,,
alarms per day,72.0,at most 150,at most 300,good,,,,
alarms per hour,3.0,at most 6,at most 12,good,,,,
alarms per 10 min,0.5,at most 1,at most 2,good,,,,
10-min windows above 10 (%),2.1,below 1,,beyond target,,,,
peak in a 10-min window,12,at most 10,,beyond target,,,,
time in flood (%),2.1,below 1,,beyond target,,,,
share of the 10 most frequent (%),100.0,at most 5,,beyond target,,,,
chattering alarms,1,at most 0,,beyond target,,,,
fleeting alarms,0,at most 0,,good,,,,
active over 24 h (peak),0,below 5,,good,,,,
priority critical (%),0.0,below 1,,good,,,,
priority high (%),25.0,at most 5,,beyond target,,,,
priority medium (%),12.5,at most 15,,good,,,,
priority low (%),62.5,at least 80,,beyond target,,,,
,,,,,,,,
alarms to investigate,,,,,,,,
kind,subject,alarm,raised,,,,,
frequent,'=PLC-1,not responding,18,,,,,
frequent,TIC-1.PV,temperature high,6,,,,,
chattering,TIC-1.PV,temperature high,,,,,,
,,,,,,,,
alarms,,,,,,,,
time,priority,subject,alarm,event,value,limit,by,reason
2026-11-21T06:12:45.500+07:00,high,TIC-1.PV,\"temperature high; \"\"check\"\" heater\",raised,-85.25,85,,
,,,,,,,,
operator actions,,,,,,,,
time,by,action,target,old,new,outcome,,
2026-11-21T06:13:00.000+07:00,'=cmd|' /C calc'!A0,write,TIC-1.SV,'-70.0 °C,60.0 °C,verified,,
,,,,,,,,
record TIC-1 in °C,,,,,,,,
date,time,SV,PV,ER,,,,
2026-11-21,06:00:00+07:00,70.0,72.5,-2.5,,,,
2026-11-21,06:00:10+07:00,70.0,,,,,,
";
    assert_eq!(csv, expect.replace("VERSION", env!("CARGO_PKG_VERSION")).replace('\n', "\r\n"));
}

#[test]
fn every_dialect_gives_the_same_cells_to_a_strict_reader() {
    let def = plant("Asia/Bangkok", &THREE);
    let rows = |dialect: CsvDialect| -> Vec<Vec<String>> {
        let bytes = shift_csv(&report(), &def, dialect);
        let body = bytes.strip_prefix("\u{feff}".as_bytes());
        assert_eq!(body.is_some(), dialect.bom);
        csv::ReaderBuilder::new()
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
    let def = plant("Asia/Bangkok", &THREE);
    let csv = String::from_utf8(RecordCsv.render(&report(), &def, dialect(';', ',', false))).unwrap();
    let expect =
        "date;time;SV;PV;ER\r\n2026-11-21;06:00:00+07:00;70,0;72,5;-2,5\r\n2026-11-21;06:00:10+07:00;70,0;;\r\n";
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
