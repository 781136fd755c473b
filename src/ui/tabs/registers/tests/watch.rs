//! The watch list and its log.

use super::*;

#[test]
fn what_is_watched_is_read_wherever_the_window_is() {
    let mut bench = Bench::new();
    bench.keys("j1002⏎");
    bench.answer(0, device);
    bench.keys("eSV int16 0.1 °C⏎");
    bench.keys("pj0⏎");
    let spans = bench.asked.last().map(|(_, read)| read.spans.clone()).expect("a query");
    assert_eq!((spans[0].address, spans[1].address, spans[1].count), (0, 1002, 1));
    bench.answer(1, device);
    bench.answer(2, |address| if address == 1002 { Some(720) } else { device(address) });
    let shown = bench.screen(120, 40);
    let row = shown.lines().find(|row| row.contains("SV")).expect("the list is on the screen");
    for part in ["72.0 °C", "70.0 to 72.0", "mean 71.0"] {
        assert!(row.contains(part), "{part} in {row}");
    }
    bench.keys("j1002⏎p");
    assert!(!bench.screen(120, 40).contains("watch ──"), "p takes it off again");
}

#[test]
fn a_log_has_a_row_for_every_read_and_no_old_value() {
    let mut bench = Bench::new();
    bench.keys("R");
    assert!(bench.screen(80, 24).contains("Nothing is watched"));
    bench.keys("⎋j1002⏎");
    bench.answer(0, device);
    bench.keys("eSV int16 0.1 °C⏎p");
    bench.keys("R⏎");
    bench.answer(1, device);
    bench.answer(2, |address| if address == 1002 { Some(701) } else { device(address) });
    let (id, read) = bench.asked.pop().expect("a query");
    let at = now() + SignedDuration::from_secs(3);
    let parts = read.spans.iter().map(|span| LivePart { at, span: *span, words: Err(Fault::Timeout) }).collect();
    let reading = LiveReading { parts, requests: 1, ..LiveReading::default() };
    bench.send(Msg::Answer(id, Ok(Answer::Registers(reading))));
    assert!(bench.screen(120, 40).contains("3 rows"));
    bench.keys("p");
    assert!(bench.screen(120, 40).contains("cannot change while it is logged"));
    bench.keys("⎋R");
    bench.answer(4, device);
    let values: Vec<_> = bench.rows.iter().map(|row| row.split_once(',').unwrap_or_default().1).collect();
    let expect = ["SV °C,SV quality", "70.0,good", "70.1,good", ",uncertain: response timeout"];
    assert_eq!(values, expect, "no row before, none after, none invented");
    assert!(bench.rows[0].starts_with("\u{feff}time_utc,"), "a spreadsheet reads °C");
    assert!(bench.rows[1].starts_with("20") && bench.rows[1].contains('T'), "{:?}", bench.rows);
}

#[test]
fn a_read_for_a_key_adds_no_row_and_keeps_the_rhythm() {
    let mut bench = Bench::new();
    bench.keys("j1002⏎");
    bench.answer(0, device);
    bench.keys("eSV int16 0.1 °C⏎pR⏎");
    bench.answer(1, device);
    for _ in 0..3 {
        bench.keys("j1010⏎");
        bench.answer(1, device);
    }
    let due = bench.asked.last().and_then(|(_, read)| read.not_before);
    assert_eq!(due, Some(now() + SignedDuration::from_secs(2)), "the next one is read when it was due");
    bench.answer(2, device);
    assert_eq!(bench.rows.len(), 3, "a header and two rows: {:?}", bench.rows);
}

#[test]
fn a_log_says_when_its_values_became_old() {
    let mut bench = Bench::new();
    bench.keys("j1002⏎");
    bench.answer(0, device);
    bench.keys("pR⏎");
    bench.answer(1, device);
    bench.snapshot(2, LineState::Connected);
    assert_eq!(bench.rows.len(), 2, "a heading and a value: {:?}", bench.rows);
    bench.snapshot(3, LineState::Connecting);
    assert_eq!(bench.rows.len(), 2, "a line may connect after its first answer: {:?}", bench.rows);
    bench.keys("g");
    bench.snapshot(4, LineState::Connecting);
    assert!(bench.screen(80, 24).contains("700?"), "{}", bench.screen(80, 24));
    bench.snapshot(30, LineState::Connecting);
    assert_eq!(bench.rows.len(), 3, "one row for the whole time: {:?}", bench.rows);
    assert!(bench.rows[2].ends_with("Z,,uncertain: stale"), "{:?}", bench.rows);
}

#[test]
fn a_log_that_cannot_be_written_ends_and_says_why() {
    let mut bench = Bench::new();
    bench.keys("j1002⏎");
    bench.answer(0, device);
    bench.keys("pR⏎");
    bench.send(Msg::Saved(Some(Tab::Registers), Err("bench.toml: exists".to_owned())));
    assert!(bench.screen(120, 40).contains("nothing was saved"), "another file than the log");
    bench.keys("⎋");
    assert!(bench.screen(120, 40).contains("logging"), "the log goes on");
    bench.send(Msg::LogFailed(Tab::Registers, "x.csv: no space left".to_owned()));
    assert!(bench.screen(120, 40).contains("LOG ENDED: x.csv: no space left"));
}

#[test]
fn the_graph_shows_what_was_read_and_where_nothing_was() {
    let mut bench = Bench::new();
    bench.keys("j1002⏎");
    bench.answer(0, device);
    bench.keys("eSV int16 0.1 °C⏎pj1005⏎");
    bench.answer(1, device);
    bench.keys("eP int16 %⏎p");
    let rising = |seconds: i64| {
        move |address: u16| match address {
            1002 => Some(700 + to_u16(usize::try_from(seconds).unwrap_or(0)) * 2),
            1005 if (40..60).contains(&seconds) => None,
            _ => device(address),
        }
    };
    for seconds in 2..100 {
        bench.answer(seconds, rising(seconds));
    }
    bench.keys("g");
    bench.snapshot(100, LineState::Connected);
    for (width, height) in [(80, 24), (120, 40)] {
        insta::assert_snapshot!(format!("graph_{width}x{height}"), bench.screen(width, height));
    }
    let asked = bench.asked.len();
    bench.keys("c←←←←←←←←");
    assert_eq!(bench.asked.len(), asked, "its keys read nothing");
    assert!(bench.screen(80, 24).contains("at 07:0"), "{}", bench.screen(80, 24));
    bench.keys("clp");
    assert!(bench.screen(80, 24).contains("past"), "p holds the picture");
    bench.keys("p");
    bench.snapshot(130, LineState::Connected);
    let shown = bench.screen(80, 24);
    assert!(shown.contains("89.8?") && shown.contains("live"), "nothing was read for 30 s: {shown}");
    bench.keys("⎋");
    assert!(bench.screen(80, 24).contains("watch ──"), "Esc leads back");
}

#[test]
fn without_a_list_the_graph_is_of_the_selected_register() {
    let mut bench = Bench::new();
    bench.keys("j1002⏎");
    bench.answer(0, device);
    bench.keys("g");
    bench.answer(1, device);
    bench.snapshot(1, LineState::Connected);
    let shown = bench.screen(80, 24);
    assert!(shown.contains("41003") && shown.contains("700"), "{shown}");
}

#[test]
fn values_without_a_unit_do_not_share_an_axis() {
    let mut bench = Bench::new();
    bench.keys("j1002⏎");
    bench.answer(0, device);
    bench.keys("pj1006⏎");
    bench.answer(1, device);
    bench.keys("pg");
    bench.answer(2, |address| if address == 1006 { Some(7) } else { device(address) });
    bench.snapshot(2, LineState::Connected);
    let shown = bench.screen(80, 24);
    let axes = shown.lines().nth(5).unwrap_or_default();
    assert!(axes.contains("41003") && axes.contains("41007"), "{shown}");
}
