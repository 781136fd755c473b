//! Files of other programs: what is read of them, what is refused, and what is left out.

use std::time::Duration;

use super::*;
use crate::{
    plant::{data_type::DataType, def::CsvDialect},
    report::{
        export::{Column, export_csv},
        step_series::HeldValue,
        testing::{THREE, at, plant, sec},
    },
};

const NOW: &str = "2026-11-23T12:00:00Z";

fn read(text: &str) -> Result<Rows, Vec<String>> {
    let mut def = plant("Europe/Berlin", &THREE);
    def.tags[1].enum_labels = vec![(0, "OFF".into()), (1, "ON".into())];
    def.tags[2].point.kind = DataType::U16;
    crate::history::io::import::parse(&def, text.as_bytes(), Timestamp::UNIX_EPOCH, at(NOW))
}

fn names() -> [String; 3] {
    let def = plant("Europe/Berlin", &THREE);
    [0, 1, 2].map(|place: usize| def.tags[place].name.clone())
}

#[test]
fn rows_are_read_whatever_their_order_and_marks() {
    let [pv, sv, _] = names();
    let expect = [(TagId(0), vec![Sample::good(1.5, at("2026-11-21T05:00Z"))])];
    for text in [
        format!("tag,time,value\n{pv},2026-11-21T06:00:00,1.5\n"),
        format!("\u{feff}Time;Value;Tag\r\n2026-11-21 06:00;1,5;{pv}\r\n"),
        format!("time_utc,time_local,tag,value,quality\n2026-11-21T05:00:00.0004Z,x,{pv},1.5,good\n"),
        format!("value,quality,tag,time\n1.5,,{pv},2026-11-21T07:00+02:00\n"),
    ] {
        assert_eq!(read(&text), Ok(Rows::from(expect.clone())), "{text}");
    }
    let text = format!(
        "tag,time,value,quality\n{sv},2026-11-21T05:00:01Z,on,uncertain: stale\n{sv},2026-11-21T05:00Z,,bad: response timeout"
    );
    let first = Sample::bad(Cause::Timeout, at("2026-11-21T05:00Z"));
    let second = Sample::good(1.0, at("2026-11-21T05:00:01Z")).uncertain(Cause::Stale);
    assert_eq!(read(&text), Ok(Rows::from([(TagId(1), vec![first, second])])));
}

#[test]
fn what_is_wrong_is_said_with_line_and_expectation() {
    let [pv, sv, run] = names();
    for (rows, expect) in [
        ("X,2026-11-21T05:00Z,1".to_owned(), "line 2: found the tag `X`, which "),
        (format!("{pv},soon,1"), "line 2: found the time `soon`, expected 2026-"),
        (format!("{pv},2026-10-25T02:30:00,1"), "which was twice or never"),
        (format!("{pv},2026-03-29T02:30:00,1"), "which was twice or never"),
        (format!("{pv},2026-11-23T12:00:01Z,1"), "expected one from 1970-01-01T00:00:00Z to 2026-11-23T12:00:00Z"),
        (format!("{pv},1969-12-31T23:59:59Z,1"), "expected one from 1970"),
        (format!("{pv},2026-11-21T05:00Z,high"), "found `high`, expected a number"),
        (format!("{pv},2026-11-21T05:00Z,NaN"), "found `NaN`, expected a number"),
        (format!("{pv},2026-11-21T05:00Z,"), "found ``, expected a number"),
        (format!("{sv},2026-11-21T05:00Z,7"), "found `7`, expected OFF, ON"),
        (format!("{run},2026-11-21T05:00Z,99999999"), "expected a number that its type can hold"),
        (format!("{pv},2026-11-21T05:00Z"), "line 2: found 2 cells, expected 3"),
        (
            format!("{pv},2026-11-21T05:00Z,\"1,5\""),
            "found `1,5`, expected a decimal point, as cells stand between commas",
        ),
        (format!("{pv},2026-11-21 05:00:00 -07:00,1"), "found the time `2026-11-21 05:00:00 -07:00`, expected 2026-"),
    ] {
        let problems = read(&format!("tag,time,value\n{rows}\n")).unwrap_err();
        assert!(problems[0].contains(expect), "{problems:?}, expected {expect}");
    }
    for (header, expect) in [
        ("tag,value", "found no column time_utc or utc"),
        ("tag,time,value,price", "line 1: column 4 is none of samples, expected time_utc"),
        ("argon2id$secret", "line 1: column 1 is none of samples, expected time_utc"),
        ("time,value", "found no column `tag`"),
        ("time,TIC-1.PV,price", "column 3: expected a time or the name of a tag"),
        ("time,TIC-1.PV °F", "TIC-1.PV: found the unit `°F`, expected `°C`"),
        ("time,TIC-1.PV °C,TIC-1.PV", "column 3: found TIC-1.PV twice"),
        ("time,TIC-1.PV quality", "found no column of values of TIC-1.PV"),
        ("TIC-1.PV", "found no column time_utc or utc"),
        ("tag,time,value", "found no row behind the header"),
    ] {
        let problems = read(header).unwrap_err();
        assert!(problems[0].contains(expect), "{problems:?}");
        assert!(!problems.concat().contains("secret"), "{problems:?}");
    }
    for (rest, expect) in [
        ("1,worse,", "found the quality `worse`"),
        ("1,bad: stale,", "which is bad: expected none"),
        ("1,good,furlong", "found the unit `furlong`, expected "),
        ("1,bad: not stored,", "found the quality `bad: not stored`"),
    ] {
        let text = format!("tag,time,value,quality,unit\n{pv},2026-11-21T05:00Z,{rest}");
        assert!(read(&text).unwrap_err()[0].contains(expect), "{rest}");
    }
    let many = format!("tag,time,value\n{}", "X,soon,1\n".repeat(25));
    let problems = read(&many).unwrap_err();
    assert_eq!((problems.len(), problems[10].as_str()), (11, "and 15 more"));
}

#[test]
fn a_row_of_an_instant_has_a_sample_of_each_tag() {
    let [pv, sv, _] = names();
    let unreadable = Quality::Bad(Cause::Unreadable).word();
    let text = format!(
        "time,{pv} °C,{pv} quality,{sv}\n2026-11-21T06:00:00,1.5,good,on\n2026-11-21T06:00:10,,bad: response timeout,\n\
         2026-11-21T06:00:20,,none,OFF\n2026-11-21T06:00:30,,{unreadable},\n2026-11-21T06:00:40,2,uncertain: stale,\n\
         2026-11-21T06:00:45,,none,\n2026-11-21T06:00:46,,none,\n\
         2026-11-21T06:00:50,,uncertain: stale,\n"
    );
    let at = |second: &str| at(&format!("2026-11-21T05:00:{second}Z"));
    let expect = [
        Sample::good(1.5, at("00")),
        Sample::bad(Cause::Timeout, at("10")),
        Sample::good(2.0, at("40")).uncertain(Cause::Stale),
        // Where nothing was stored the value is held no longer.
        Sample::bad(Cause::StationOff, at("45")),
        Sample::bad(Cause::Stale, at("50")),
    ];
    let other = vec![Sample::good(1.0, at("00")), Sample::good(0.0, at("20"))];
    assert_eq!(read(&text), Ok(Rows::from([(TagId(0), expect.to_vec()), (TagId(1), other)])));
    for (cells, expect) in [
        ("x,good,", "line 2: TIC-1.PV: found `x`, expected a number"),
        (",good,", "line 2: TIC-1.PV: found ``, expected a number"),
        ("1,worse,", "line 2: found the quality `worse`"),
        ("1,bad: stale,", "line 2: TIC-1.PV: found the value `1`, which is bad"),
        ("1,good,7", "found `7`, expected OFF, ON"),
    ] {
        let problems = read(&format!("time,{pv},{pv} quality,{sv}\n2026-11-21T06:00:00,{cells}\n")).unwrap_err();
        assert!(problems[0].contains(expect), "{problems:?}, expected {expect}");
    }
}

#[test]
fn an_export_at_intervals_is_read_as_it_was_written() {
    let def = plant("Europe/Berlin", &THREE);
    let of = |cause| [Quality::Good, Quality::Bad(cause), Quality::Uncertain(cause)];
    let qualities: Vec<Quality> = Cause::ALL.into_iter().flat_map(of).collect();
    let column = |tag: &TagDef| Column {
        tag: tag.name.clone(),
        unit: tag.unit.clone(),
        decimals: 1,
        values: (0..60)
            .map(|n| {
                let quality = qualities[n * 7 % qualities.len()];
                let value = (!quality.is_bad()).then(|| (n as f64 / 10.0).into());
                (n % 5 > 0).then_some(HeldValue { value, quality })
            })
            .collect(),
    };
    let columns: Vec<Column> = def.tags[..2].iter().map(column).collect();
    // Over the night in which the clocks are set back.
    let (from, every) = (at("2026-10-25T00:30:00Z"), Duration::from_secs(60));
    for (separator, decimal) in [(',', '.'), (';', ','), ('\t', ',')] {
        let dialect = CsvDialect { separator, decimal, bom: separator == ';' };
        let bytes = export_csv(&def, from, every, &columns, dialect);
        let rows = crate::history::io::import::parse(&def, &*bytes, Timestamp::UNIX_EPOCH, at(NOW)).unwrap();
        for (tag, column) in def.tags.iter().zip(&columns) {
            let mut held = false;
            let stored = (1u32..).zip(&column.values).filter_map(|(row, stood)| {
                let at = from + every * row;
                let was_held = std::mem::replace(&mut held, stood.is_some_and(|stood| stood.quality.is_good()));
                match stood.filter(|stood| is_stored(stood.quality)) {
                    None => was_held.then(|| Sample::bad(Cause::StationOff, at)),
                    // Of what is not good an export has no value.
                    Some(HeldValue { value, quality }) => Some(match quality.cause() {
                        None => Sample::new(value, quality, at),
                        Some(cause) => Sample::bad(cause, at),
                    }),
                }
            });
            assert_eq!(rows[&tag.id], stored.collect::<Vec<_>>(), "{dialect:?}");
        }
    }
}

#[test]
fn a_counter_of_64_bits_is_imported_to_its_last_digit() {
    let mut def = plant("Europe/Berlin", &THREE);
    (def.tags[0].point.kind, def.tags[0].scale) = (DataType::U64, 0.001);
    let pv = def.tags[0].name.clone();
    let read = |text: &str| {
        let rows = crate::history::io::import::parse(&def, text.as_bytes(), Timestamp::UNIX_EPOCH, at(NOW));
        rows.map(|rows| rows[&TagId(0)][0].exact().map(|value| value.to_string()))
    };
    let text = Ok(Some("9007199254740993.001".to_owned()));
    assert_eq!(read(&format!("tag,time,value\n{pv},2026-11-21T05:00Z,9007199254740993.001\n")), text);
    assert_eq!(read(&format!("tag;time;value\n{pv};2026-11-21T05:00Z;9007199254740993,001\n")), text);
    // What SQL gives of it.
    assert_eq!(read(&format!("utc,tag,value,exact\n2026-11-21T05:00Z,{pv},,9007199254740993.001000\n")), text);
    assert_eq!(read(&format!("utc,tag,value,exact\n2026-11-21T05:00Z,{pv},1.5,\n")), Ok(Some("1.5".to_owned())));
    assert!(
        read(&format!("tag,time,value\n{pv},2026-11-21T05:00Z,18446744073709551.616\n")).is_err(),
        "beyond its type"
    );
}

#[test]
fn only_rows_without_a_value_in_force_are_accepted() {
    let hold = HOLD_MAX.as_secs() as i64;
    let row = |second: i64| Sample::good(second as f64, sec(second));
    let decide = |stored: &[Stored], seconds: &[i64]| -> Vec<i64> {
        let mut filler = Filler::new(seconds.iter().copied().map(row).collect());
        stored.iter().for_each(|stored| filler.stored(*stored));
        filler.end().iter().map(|sample| sample.at.as_second()).collect()
    };
    let recorded = |second: i64| Stored { sample: row(second), imported: false };
    let imported = |second: i64| Stored { sample: row(second), imported: true };
    let off = Stored { sample: Sample::bad(Cause::StationOff, sec(100)), imported: false };
    for (stored, seconds, expect) in [
        (vec![], vec![1, 2], vec![1, 2]),
        (vec![recorded(10)], vec![9, 10, 11, 9 + hold, 10 + hold], vec![9, 10 + hold]),
        (vec![recorded(90), off, recorded(200)], vec![95, 100, 101, 199, 200, 201], vec![101, 199]),
        (vec![recorded(10), recorded(10)], vec![10, 12], vec![]),
        (vec![imported(10), imported(20)], vec![9, 10, 15, 20, 21], vec![9, 21]),
        (vec![imported(10), recorded(9 + hold)], vec![11, 8 + hold], vec![]),
        (vec![imported(10), recorded(10 + hold)], vec![11, 9 + hold], vec![11, 9 + hold]),
    ] {
        assert_eq!(decide(&stored, &seconds), expect, "{seconds:?} beside {stored:?}");
        let again: Vec<Stored> = expect.iter().copied().map(imported).collect();
        let mut all = [stored, again].concat();
        all.sort_by_key(|stored| stored.sample.at);
        assert_eq!(decide(&all, &seconds), Vec::<i64>::new(), "once more");
    }
}

#[test]
fn a_thousands_mark_is_no_decimal_mark() {
    let [pv, ..] = names();
    let check = |values: [&str; 2], separator: &str, expect: &str| {
        let [one, other] = values;
        let row = |value: &str| [pv.as_str(), "2026-11-21T05:00Z", value].join(separator);
        let text = [["tag", "time", "value"].join(separator), row(one), row(other)].join("\r\n");
        assert_eq!(read(&text), Err(vec![format!("line 3: {pv}: found `{other}`, expected {expect}")]), "{values:?}");
    };
    check(["1,5", "1.234"], ";", "a decimal comma, as on line 2");
    check(["1.5", "1,234"], ";", "a decimal point, as on line 2");
    check(["1.5", "1,234"], "\t", "a decimal point, as on line 2");
    for grouped in ["1.234,5", "1 234", "1'234", "1\u{a0}234,5"] {
        check(["1,5", grouped], ";", "a number without marks between thousands");
    }
}

#[test]
fn a_column_that_says_utc_is_utc() {
    let [pv, ..] = names();
    // Berlin had its clocks set back at 01:00 UTC, and forward on 2026-03-29.
    for (time, expect) in [
        ("2026-11-21 05:00:00.123", "2026-11-21T05:00:00.123Z"),
        ("2026-11-21T05:00:00Z", "2026-11-21T05:00:00Z"),
        ("2026-11-21T05:00:00-02:00", "2026-11-21T07:00:00Z"),
        ("2026-10-25 00:30:00", "2026-10-25T00:30:00Z"),
        ("2026-10-25 02:30:00", "2026-10-25T02:30:00Z"),
        ("2026-03-29 02:30:00", "2026-03-29T02:30:00Z"),
    ] {
        for column in ["utc", "time_utc", "UTC", "Time (UTC)", "timestamp_utc"] {
            let text = format!("time_local,{column},tag,value\nx,{time},{pv},1\n");
            assert_eq!(read(&text), Ok(Rows::from([(TagId(0), vec![Sample::good(1.0, at(expect))])])), "{text}");
        }
    }
    // A local time with its offset is known in the doubled hour.
    let text = format!("time,tag,value\n2026-10-25T02:30:00+02:00,{pv},1\n2026-10-25T02:30:00+01:00,{pv},2\n");
    let times = read(&text).map(|rows| rows[&TagId(0)].iter().map(|sample| sample.at).collect::<Vec<_>>());
    assert_eq!(times, Ok(vec![at("2026-10-25T00:30:00Z"), at("2026-10-25T01:30:00Z")]));
}

#[test]
fn every_quality_that_is_stored_is_imported() {
    let [pv, ..] = names();
    let of = |cause| [Quality::Uncertain(cause), Quality::Bad(cause)];
    for quality in Cause::ALL.into_iter().flat_map(of).chain([Quality::Good]) {
        let value = if quality.is_bad() { "" } else { "1.5" };
        let read = read(&format!("utc,tag,value,quality\n2026-11-21T05:00:00Z,{pv},{value},\"{}\"\n", quality.word()));
        let expect = Sample::new(Some(1.5.into()).filter(|_| !quality.is_bad()), quality, at("2026-11-21T05:00:00Z"));
        match quality.cause().is_none_or(Cause::is_stored) {
            true => assert_eq!(read, Ok(Rows::from([(TagId(0), vec![expect])])), "{quality:?}"),
            false => assert!(read.is_err(), "{quality:?} is of no stored sample"),
        }
    }
}

#[test]
fn rows_of_one_instant_keep_their_order() {
    let [pv, ..] = names();
    let row = |value: &str| format!("2026-11-21T05:00:00Z,{pv},{value}\n");
    let text = format!("utc,tag,value\n{}{}{}2026-11-21T04:00:00Z,{pv},0\n", row("3"), row("1"), row("2"));
    let values = read(&text).map(|rows| rows[&TagId(0)].iter().map(|sample| sample.value).collect::<Vec<_>>());
    assert_eq!(values, Ok(vec![Some(0.0), Some(3.0), Some(1.0), Some(2.0)]));
}

#[test]
fn a_line_has_its_number_whatever_ends_it() {
    let [pv, ..] = names();
    let good = format!("2026-11-21T05:00:00Z,{pv},1,");
    let quoted = format!("\"2026-11-21T05:00:00Z\n\",{pv},\"\n1\",\"\n\"");
    for end in ["\n", "\r\n", "\r"] {
        for last in ["", end] {
            let text =
                ["utc,tag,value,quality", &good, "", &quoted, &good, "2026-11-21T05:00:00Z,X,1,"].join(end) + last;
            // The quoted row has three line ends within.
            let problems = read(&text).unwrap_err();
            assert!(
                problems[0].starts_with("line 9: found the tag `X`") && problems.len() == 1,
                "{text:?}: {problems:?}"
            );
        }
    }
}
