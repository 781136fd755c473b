//! Two units, and two moments of one.

use super::*;

/// Rows of holding registers 1000 to 1003, as they are on the screen.
fn rows(bench: &mut Bench, width: u16) -> Vec<String> {
    let shown = bench.screen(width, 24);
    let place = |n| shown.lines().find(|row| row.contains(&format!("4100{n} /"))).expect("a row").to_owned();
    (1..=4).map(place).collect()
}

/// The last query to a unit.
fn asked(bench: &mut Bench, unit: u8) -> (QueryId, LiveRead) {
    let last = bench.asked.iter().rposition(|(_, read)| read.unit == unit).expect("a query");
    bench.asked.remove(last)
}

/// Both units answer; the second has no register 1001, and 7 in 1002.
fn answer(bench: &mut Bench) {
    let (id, read) = asked(bench, 1);
    bench.respond(0, id, &read, |_, address| device(address));
    let (id, read) = asked(bench, 2);
    bench.respond(0, id, &read, |_, address| match address {
        1001 => None,
        1002 => Some(7),
        _ => device(address),
    });
}

#[test]
fn two_units_stand_side_by_side_and_differences_are_marked() {
    let mut bench = Bench::new();
    bench.keys("j1000⏎c2⏎");
    answer(&mut bench);
    let shown = rows(&mut bench, 80);
    assert!(!shown[0].contains('≠') && !shown[0].contains('?'), "equal: {}", shown[0]);
    assert!(shown[1].contains('?') && shown[1].contains('–'), "not given, not equal: {}", shown[1]);
    assert!(shown[2].contains('≠') && shown[2].contains("02BC") && shown[2].contains("0007"), "{}", shown[2]);
    assert!(bench.screen(80, 24).contains("unit 1 and unit 2: 1 differ"), "{}", bench.screen(80, 24));
    for (width, height) in [(80, 24), (120, 40)] {
        insta::assert_snapshot!(format!("compared_{width}x{height}"), bench.screen(width, height));
    }
    bench.keys("c");
    assert!(!rows(&mut bench, 80)[2].contains('≠'), "the same key ends it");
}

#[test]
fn a_unit_that_falls_silent_is_no_longer_compared() {
    let mut bench = Bench::new();
    bench.keys("j1000⏎c2⏎");
    answer(&mut bench);
    let (id, read) = asked(&mut bench, 1);
    bench.respond(1, id, &read, |_, address| device(address));
    let (id, read) = asked(&mut bench, 2);
    let part = LivePart { at: now(), span: read.spans[0], words: Err(Fault::Timeout) };
    let reading = LiveReading { parts: vec![part], requests: 1, ..LiveReading::default() };
    bench.send(Msg::Answer(id, Ok(Answer::Registers(reading))));
    let shown = rows(&mut bench, 80);
    assert!(shown.iter().all(|row| row.contains('–') && !row.contains('≠')), "{shown:?}");
}

#[test]
fn a_moment_is_compared_with_what_comes_later() {
    let mut bench = Bench::new();
    bench.keys("j1000⏎");
    bench.answer(0, |address| device(address).filter(|_| address != 1001));
    bench.keys("cnow⏎");
    assert!(bench.asked.iter().all(|(_, read)| read.unit == 1), "nothing more is read");
    bench.answer(1, |address| if address == 1002 { Some(701) } else { device(address) });
    let shown = rows(&mut bench, 80);
    assert!(shown[2].contains('≠') && shown[2].contains("02BD") && shown[2].contains("02BC"), "{}", shown[2]);
    assert!(shown[1].contains('?') && shown[1].contains('–'), "not known then: {}", shown[1]);
}

#[test]
fn a_unit_is_not_compared_with_itself() {
    let mut bench = Bench::new();
    bench.keys("c1⏎");
    assert!(bench.screen(80, 24).contains("expected another"));
    bench.keys("⎋c256⏎");
    assert!(bench.screen(80, 24).contains("found `256`"));
}
