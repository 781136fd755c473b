//! Reads a log of values back: a damaged line costs only what is damaged in it, and is named.

use jiff::{SignedDuration, Timestamp};

use crate::{
    plant::sample::{Cause, Quality, Sample},
    report::{
        decimal_mark::{DecimalMark, NumberError},
        export::QUALITY,
    },
    t,
};

/// Problems that are kept in words; all are counted.
const PROBLEMS_MAX: usize = 100;
/// A value holds for this many usual times between two rows; beyond, rows are missing.
const HOLD: i32 = 3;

/// A log of values.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ValueLog {
    /// The values, by name.
    pub columns: Vec<LoggedValue>,
    /// One usual time behind the last row.
    pub end: Timestamp,
    /// Rows that were read.
    pub rows: usize,
    /// What is damaged: `line 7: found 3 cells, expected 5`.
    pub problems: Vec<String>,
    /// All that is damaged, those without words too.
    pub damaged: usize,
}

/// What was logged of one value.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct LoggedValue {
    /// `SV`.
    pub name: String,
    /// `°C`; empty for none.
    pub unit: String,
    /// The most that a value has.
    pub decimals: u8,
    /// In order of time.
    pub samples: Vec<Sample>,
}

/// Reads a log, or the table of `sightglass export`, as it was written or as a spreadsheet with commas in its numbers
/// saves it. `Err`: it is none.
pub fn parse(bytes: &[u8]) -> Result<ValueLog, String> {
    let bytes = bytes.strip_prefix("\u{feff}".as_bytes()).unwrap_or(bytes);
    let mut lines = bytes.split(|byte| *byte == b'\n').enumerate();
    let first = lines.next().map_or(&[][..], |(_, line)| line);
    let begins = |separator: &u8| {
        [&b"time_utc"[..], b"time"]
            .iter()
            .any(|time| first.strip_prefix(*time).and_then(<[u8]>::first) == Some(separator))
    };
    let separator = [b';', b'\t'].into_iter().find(begins).unwrap_or(b',');
    let mut mark = DecimalMark::of(separator);
    let mut log = ValueLog { columns: columns(first, separator)?, ..ValueLog::default() };
    // When each row was, the line before it was lost where `true`.
    let mut rows: Vec<(Timestamp, bool)> = Vec::new();
    let mut lost = false;
    for (n, line) in lines.filter(|(_, line)| !line.trim_ascii().is_empty()) {
        match row(n as u64 + 1, line, (separator, &mut mark), &log.columns) {
            Ok((at, cells)) => {
                rows.push((at, std::mem::take(&mut lost)));
                for (column, cell) in log.columns.iter_mut().zip(cells) {
                    let sample = cell.unwrap_or_else(|why| {
                        log.damaged += 1;
                        if log.problems.len() < PROBLEMS_MAX {
                            log.problems.push(t!("line {line}, {name}: {why}", line = n + 1, name = column.name, why));
                        }
                        (Sample::bad(Cause::Unreadable, at), 0)
                    });
                    column.decimals = column.decimals.max(sample.1);
                    column.samples.push(sample.0);
                }
            }
            Err(why) => {
                lost = true;
                log.damaged += 1;
                if log.problems.len() < PROBLEMS_MAX {
                    log.problems.push(t!("line {line}: {why}", line = n + 1, why));
                }
            }
        }
    }
    log.rows = rows.len();
    end_what_is_not_followed(&mut log, &rows);
    Ok(log)
}

/// A value ends where rows are missing behind it: nothing says that it was still so.
fn end_what_is_not_followed(log: &mut ValueLog, rows: &[(Timestamp, bool)]) {
    let mut steps: Vec<SignedDuration> = rows.windows(2).map(|two| two[1].0.duration_since(two[0].0)).collect();
    steps.sort();
    let usual = steps.get(steps.len() / 2).copied().unwrap_or(SignedDuration::from_secs(1));
    let usual = usual.max(SignedDuration::from_millis(1));
    let after = |at: Timestamp| at.checked_add(usual).unwrap_or(at);
    let gaps: Vec<Timestamp> = rows
        .windows(2)
        .filter(|two| two[1].1 || usual * HOLD < two[1].0.duration_since(two[0].0))
        .map(|two| two[0].0.checked_add(usual.min(two[1].0.duration_since(two[0].0) / 2)).unwrap_or(two[0].0))
        .collect();
    for column in &mut log.columns {
        column.samples.extend(gaps.iter().map(|at| Sample::bad(Cause::Unreadable, *at)));
        // A clock that was set back has written its rows all the same.
        column.samples.sort_by_key(|sample| sample.at);
        // A float is logged with all its digits; a screen shows seven.
        let most =
            column.samples.iter().filter_map(|sample| sample.good_value()).fold(0.0_f64, |most, v| most.max(v.abs()));
        let whole = u8::try_from(format!("{most:.0}").len()).unwrap_or(u8::MAX);
        column.decimals = column.decimals.min(6_u8.saturating_sub(whole));
    }
    log.end = rows.iter().map(|(at, _)| *at).max().map_or(Timestamp::UNIX_EPOCH, after);
}

/// The columns, by the heading.
fn columns(line: &[u8], separator: u8) -> Result<Vec<LoggedValue>, String> {
    let cells = cells(line, separator).unwrap_or_default();
    let wrong = || {
        let found = short(line);
        t!(
            "line 1: found `{found}`, expected time_utc, then of each value its name and its name with ` quality`",
            found
        )
    };
    let [time, rest @ ..] = cells.as_slice() else { return Err(wrong()) };
    if !matches!(time.as_str(), "time" | "time_utc") || rest.is_empty() || rest.len() % 2 != 0 {
        return Err(wrong());
    }
    let column = |pair: &[String]| {
        let [value, quality] = [&pair[0], &pair[1]].map(|cell| cell.strip_prefix('\'').unwrap_or(cell));
        let name = quality.strip_suffix(QUALITY)?;
        let unit = value.strip_prefix(name)?.trim_start();
        Some(LoggedValue { name: name.to_owned(), unit: unit.to_owned(), ..LoggedValue::default() })
    };
    rest.chunks_exact(2).map(|pair| column(pair).ok_or_else(wrong)).collect()
}

type Cell = Result<(Sample, u8), String>;

/// A row: its time, and of each value what was read and its decimals, or what is damaged.
fn row(
    n: u64,
    line: &[u8],
    (separator, mark): (u8, &mut DecimalMark),
    columns: &[LoggedValue],
) -> Result<(Timestamp, Vec<Cell>), String> {
    let cells = cells(line, separator).ok_or_else(|| t!("found `{found}`, expected text", found = short(line)))?;
    let expected = 1 + 2 * columns.len();
    if cells.len() != expected {
        let (found, count) = (short(line), cells.len());
        return Err(t!("found {count} cells in `{found}`, expected {expected}", count, found, expected));
    }
    let at: Timestamp = cells[0].parse().map_err(|_| {
        let found = short(cells[0].as_bytes());
        t!("found the time `{found}`, expected one such as 2026-11-23T14:05:12.000Z", found)
    })?;
    Ok((at, cells[1..].chunks_exact(2).map(|pair| cell(at, (&pair[0], n), &pair[1], mark)).collect()))
}

fn cell(at: Timestamp, (value, line): (&str, u64), quality: &str, mark: &mut DecimalMark) -> Cell {
    let expected = || {
        let found = short(quality.as_bytes());
        t!("found the quality `{found}`, expected good, or uncertain or bad with a cause", found)
    };
    match (quality_of(quality).ok_or_else(expected)?, value) {
        (Quality::Good, value) => {
            let number = mark.read(value, line).map_err(|error| {
                let found = short(value.as_bytes());
                match error {
                    NumberError::OtherMark { mark, .. } => {
                        t!("found `{found}`, expected the decimal mark `{mark}`", found, mark)
                    }
                    NumberError::Thousands => {
                        t!("found `{found}`, expected a number without marks between thousands", found)
                    }
                    NumberError::NotANumber => t!("found `{found}`, expected a number", found),
                }
            })?;
            let decimals = value.split_once(['.', ',']).map_or(0, |(_, digits)| digits.len().min(6));
            Ok((Sample::good(number, at), u8::try_from(decimals).unwrap_or(0)))
        }
        (quality, "") => Ok((Sample::bad(quality.cause().unwrap_or(Cause::NotRead), at), 0)),
        (quality, value) => {
            let found = short(value.as_bytes());
            Err(t!("found `{found}` with the quality `{quality}`, expected no value", found, quality = quality.word()))
        }
    }
}

/// `none` is what an export says where nothing was stored.
fn quality_of(word: &str) -> Option<Quality> {
    if word == "none" { Some(Quality::Bad(Cause::NotRead)) } else { Quality::from_word(word) }
}

/// The cells of one line; a quote that is never closed ends with its line. `None`: it is no text.
fn cells(line: &[u8], separator: u8) -> Option<Vec<String>> {
    let mut reader = csv::ReaderBuilder::new();
    let reader = reader.has_headers(false).delimiter(separator).buffer_capacity(line.len().clamp(64, 4_096));
    let record = reader.from_reader(line).into_records().next()?.ok()?;
    Some(record.iter().map(str::to_owned).collect())
}

/// The beginning of what was found, with every byte that cannot be shown as its number.
fn short(found: &[u8]) -> String {
    let text = String::from_utf8_lossy(found.trim_ascii());
    let mut letters = text.chars();
    let begin: String = letters.by_ref().take(40).collect::<String>().escape_debug().collect();
    if letters.next().is_some() { begin + "…" } else { begin }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LOG: &str = "time_utc,SV °C,SV quality,run,run quality\r\n\
        2026-11-23T14:00:00.000Z,70.0,good,1,good\r\n\
        2026-11-23T14:00:01.000Z,70.25,good,,uncertain: response timeout\r\n\
        2026-11-23T14:00:02.000Z,71.0,good,0,good\r\n";

    fn values(log: &ValueLog, column: usize) -> Vec<Option<f64>> {
        log.columns[column].samples.iter().map(|sample| sample.good_value()).collect()
    }

    #[test]
    fn a_log_is_read_back_as_it_was_written() {
        let log = parse(LOG.as_bytes()).expect("a log");
        assert_eq!(
            (log.columns[0].name.as_str(), log.columns[0].unit.as_str(), log.columns[0].decimals),
            ("SV", "°C", 2)
        );
        assert_eq!((values(&log, 0), log.rows), (vec![Some(70.0), Some(70.25), Some(71.0)], 3));
        assert_eq!(values(&log, 1), [Some(1.0), None, Some(0.0)]);
        assert_eq!(log.end, "2026-11-23T14:00:03Z".parse().expect("a time"));
        assert!(log.problems.is_empty());
        let spreadsheet = LOG.replace(',', ";").replace("70.", "70,").replace("71.", "71,");
        assert_eq!(parse(format!("\u{feff}{spreadsheet}").as_bytes()), Ok(log.clone()));
        // What a plant with these marks exports.
        for separator in [";", "\t"] {
            assert_eq!(parse(LOG.replace(',', separator).as_bytes()), Ok(log.clone()), "{separator}");
        }
    }

    #[test]
    fn another_decimal_mark_than_before_is_damage() {
        let text = LOG.replace(',', ";").replace("70.0;", "70,0;").replace("70.25", "1.234");
        let log = parse(text.as_bytes()).expect("a log");
        assert_eq!(log.problems[0], "line 3, SV: found `1.234`, expected the decimal mark `,`");
        assert_eq!(values(&log, 0)[..2], [Some(70.0), None]);
    }

    #[test]
    fn every_quality_that_is_written_is_read() {
        let all = Cause::ALL.into_iter().flat_map(|cause| [Quality::Uncertain(cause), Quality::Bad(cause)]);
        for quality in all {
            let text = format!("time_utc,SV,SV quality\r\n2026-11-23T14:00:00.000Z,,\"{}\"\r\n", quality.word());
            let log = parse(text.as_bytes()).expect("a log");
            let read = log.columns[0].samples.first().map(|sample| sample.quality.cause());
            assert_eq!((read, log.problems), (Some(quality.cause()), vec![]));
        }
    }

    #[test]
    fn a_damaged_line_is_named_and_costs_nothing_else() {
        let whole = parse(LOG.as_bytes()).expect("a log");
        let check = |from: &str, to: &str, expect: &str| {
            assert!(LOG.contains(from), "{from}");
            let log = parse(LOG.replacen(from, to, 1).as_bytes()).expect("a log");
            assert_eq!((log.problems.join("; "), log.damaged), (expect.to_owned(), 1), "{to}");
            log
        };
        let log = check("70.25", "7x.25", "line 3, SV: found `7x.25`, expected a number");
        assert_eq!((values(&log, 0), values(&log, 1)), (vec![Some(70.0), None, Some(71.0)], values(&whole, 1)));
        check(
            ",,uncertain",
            ",5,uncertain",
            "line 3, run: found `5` with the quality `uncertain: response timeout`, expected no value",
        );
        check(
            "1,good",
            "1,goo",
            "line 2, run: found the quality `goo`, expected good, or uncertain or bad with a cause",
        );
    }

    #[test]
    fn a_line_that_was_cut_off_ends_what_stood_before_it() {
        let cut = LOG.strip_suffix("1.0,good,0,good\r\n").expect("the end");
        let log = parse(cut.as_bytes()).expect("a log");
        assert_eq!(log.problems, ["line 4: found 2 cells in `2026-11-23T14:00:02.000Z,7`, expected 5"]);
        assert_eq!(values(&log, 0), [Some(70.0), Some(70.25)]);
        let zeros = LOG.replacen("2026-11-23T14:00:01", "\0\0\0\"", 1);
        let log = parse(zeros.as_bytes()).expect("a log");
        assert_eq!((values(&log, 0), log.damaged), (vec![Some(70.0), None, Some(71.0)], 1), "{:?}", log.problems);
    }

    #[test]
    fn a_hundred_problems_are_kept_in_words_and_all_are_counted() {
        for damage in ["2026-11-23T14:00:00.000Z,7x,good\n", "2026-11-23T14:00:00.000Z,7\n"] {
            let text = format!("time_utc,SV,SV quality\n{}", damage.repeat(150));
            let log = parse(text.as_bytes()).expect("a log");
            assert_eq!((log.problems.len(), log.damaged), (100, 150), "{damage}");
        }
    }

    #[test]
    fn a_float_has_no_more_decimals_than_a_screen_shows() {
        for (value, decimals) in [("0.123456", 5), ("1234.56789", 2), ("-1234.56789", 2), ("1234567.89", 0)] {
            let text = format!("time_utc,SV,SV quality\n2026-11-23T14:00:00.000Z,{value},good\n");
            assert_eq!(parse(text.as_bytes()).expect("a log").columns[0].decimals, decimals, "{value}");
        }
    }

    #[test]
    fn what_is_no_log_is_said() {
        for (text, expect) in [
            ("", "line 1: found ``"),
            ("a,b\n1,2\n", "found `a,b`, expected time_utc"),
            ("time,SV\n", "found `time,SV`"),
            ("time_utc\n", "found `time_utc`"),
            ("a,SV,SV quality\n1,2,good\n", "found `a,SV,SV quality`"),
        ] {
            assert!(parse(text.as_bytes()).is_err_and(|why| why.contains(expect)), "{text}");
        }
    }

    #[test]
    fn a_value_does_not_stand_over_rows_that_are_missing() {
        let text = LOG.replace("14:00:02", "14:09:00") + "2026-11-23T14:09:01.000Z,72.0,good,0,good\n";
        let log = parse(text.as_bytes()).expect("a log");
        assert_eq!(values(&log, 0), [Some(70.0), Some(70.25), None, Some(71.0), Some(72.0)]);
        assert_eq!(log.columns[0].samples[2].at, "2026-11-23T14:00:02Z".parse().expect("a time"));
    }
}
