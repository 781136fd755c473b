//! A terminal at a device without a plant file, and a scripted unit behind it.

mod compare;
mod keep;
mod lists;
mod map;
mod named;
mod watch;

use std::sync::Arc;

use super::*;
use crate::register_map::named::Named;
use crate::{
    plant::{
        PlantDef,
        def::{LineDef, Transport},
        diagnostics::{Diagnostic, RegisterWrite},
        fault::{ExceptionCode, Fault},
        line_state::LineState,
        live::{LivePart, LiveRead},
        tag::DataType,
    },
    ui::{
        Effect, Model, Msg, QueryId,
        fixture::{now, session},
        tests::{screen, sent_kind, type_keys},
        theme::Theme,
        update,
    },
};

/// The terminal, and what it has asked.
struct Bench {
    model: Model,
    asked: Vec<(QueryId, LiveRead)>,
    /// What the signatures ask.
    probed: Vec<(QueryId, LiveRead)>,
    rows: Vec<String>,
}

impl Bench {
    fn new() -> Bench {
        let line = LineDef::new(LineId(0), "line", Transport::tcp("10.0.0.7", 502));
        let device = DeviceDef::new(DeviceId(0), "device", LineId(0));
        let title = "10.0.0.7:502".to_owned();
        let def = PlantDef { title, lines: vec![line], devices: vec![device], ..PlantDef::default() };
        let mut snapshot = Snapshot { at: now(), ..Snapshot::blank(Arc::new(def)) };
        snapshot.lines[0].state = LineState::Connected;
        let model = Model::new(Arc::new(snapshot), Theme::FULL, 1, session());
        let mut bench = Bench { model, asked: Vec::new(), probed: Vec::new(), rows: Vec::new() };
        bench.send(Msg::Resize(80, 24));
        bench
    }

    fn send(&mut self, msg: Msg) {
        let effects = update(&mut self.model, msg);
        self.note(effects);
    }

    /// The line is in this state, so many seconds later.
    fn snapshot(&mut self, seconds: i64, state: LineState) {
        let mut snapshot = Snapshot::clone(&self.model.snapshot);
        snapshot.at = now() + SignedDuration::from_secs(seconds);
        snapshot.lines[0].state = state;
        self.send(Msg::Snapshot(Arc::new(snapshot)));
    }

    fn keys(&mut self, keys: &str) {
        let effects = type_keys(&mut self.model, keys);
        self.note(effects);
    }

    fn note(&mut self, effects: Vec<Effect>) {
        let rows = effects.iter().filter_map(|effect| match effect {
            Effect::Append { bytes, .. } => Some(String::from_utf8_lossy(bytes).trim_end().to_owned()),
            _ => None,
        });
        self.rows.extend(rows);
        let reads = effects.into_iter().filter_map(|effect| match effect {
            Effect::Query(id, Query::Registers(read)) => Some((id, read)),
            _ => None,
        });
        let sent = &self.model.tabs.registers.sent;
        let is_probe = |number| sent.iter().any(|read| read.number == number && read.what == ReadFor::Recognition);
        let (probes, reads): (Vec<_>, Vec<_>) = reads.partition(|(id, _)| is_probe(id.number));
        self.probed.extend(probes);
        self.asked.extend(reads);
    }

    /// The unit answers the last query after so many seconds: each register has its value, `None` does not exist.
    fn answer(&mut self, seconds: i64, value: impl Fn(u16) -> Option<u16>) -> LiveRead {
        let (id, read) = self.asked.pop().expect("a query");
        self.asked.clear();
        self.respond(seconds, id, &read, |_, address| value(address));
        read
    }

    fn respond(&mut self, seconds: i64, id: QueryId, read: &LiveRead, value: impl Fn(Table, u16) -> Option<u16>) {
        self.respond_or_lose(seconds, id, read, |table, address| {
            value(table, address).ok_or(Fault::Exception(ExceptionCode(2)))
        });
    }

    fn respond_or_lose(
        &mut self,
        seconds: i64,
        id: QueryId,
        read: &LiveRead,
        value: impl Fn(Table, u16) -> Result<u16, Fault>,
    ) {
        let at = now() + SignedDuration::from_secs(seconds);
        let part = |span: &AddressSpan, address: u32| LivePart {
            at,
            span: AddressSpan { address: to_u16(address), count: 1, ..*span },
            words: value(span.table, to_u16(address)).map(|word| vec![word]),
        };
        let parts = read.spans.iter().flat_map(|span| span.range().map(|address| part(span, address))).collect();
        let reading = LiveReading { began: at, parts, response_time: Some(Duration::from_micros(6_600)), requests: 2 };
        self.send(Msg::Answer(id, Ok(Answer::Registers(reading))));
    }

    fn screen(&mut self, width: u16, height: u16) -> String {
        screen(&mut self.model, width, height)
    }
}

fn device(address: u16) -> Option<u16> {
    match address {
        1002 => Some(700),
        1012 => Some(0x42D1),
        1013 => Some(0x6353),
        1000..=1020 => Some(address % 10),
        _ => None,
    }
}

#[test]
fn a_bench_shows_registers_and_bus_only() {
    let mut bench = Bench::new();
    let shown = bench.screen(80, 24);
    assert!(shown.contains("6 Bus") && shown.contains("9 Registers") && !shown.contains("Mimic"), "{shown}");
    assert!(shown.contains("no plant file"), "{shown}");
    bench.answer(0, device);
    assert!(bench.screen(80, 24).contains("no such address"));
}

#[test]
fn values_holes_and_a_likely_float_are_shown() {
    let mut bench = Bench::new();
    bench.keys("j1000⏎");
    let read = bench.answer(0, |address| device(address).filter(|_| address != 1011));
    assert_eq!(read.spans[0].address, 1000);
    assert!(read.spans[0].count >= 10);
    for (width, height) in [(80, 24), (120, 40), (160, 50)] {
        insta::assert_snapshot!(format!("registers_{width}x{height}"), bench.screen(width, height));
    }
}

#[test]
fn each_answer_brings_the_next_query_one_period_later() {
    let mut bench = Bench::new();
    assert_eq!(bench.answer(0, device).not_before, None, "at once");
    let next = now() + SignedDuration::from_secs(1);
    assert_eq!(bench.asked.last().map(|(_, read)| read.not_before), Some(Some(next)));
    bench.send(Msg::Tick { silent: Duration::ZERO });
    assert_eq!(bench.asked.len(), 1, "one is on its way");
    bench.keys("+");
    bench.answer(1, device);
    let next = now() + SignedDuration::from_millis(1_500);
    assert_eq!(bench.asked.last().map(|(_, read)| read.not_before), Some(Some(next)), "twice a second");
    bench.keys(" ");
    assert!(bench.screen(80, 24).contains("PAUSED"));
    bench.asked.clear();
    bench.send(Msg::Tick { silent: Duration::ZERO });
    assert!(bench.asked.is_empty(), "nothing is asked while it pauses");
    bench.keys(" ");
    assert_eq!(bench.asked.len(), 1);
}

#[test]
fn an_old_answer_is_not_shown_at_a_new_address() {
    let mut bench = Bench::new();
    let (old, _) = bench.asked[0].clone();
    bench.keys("j1000⏎");
    let reading = LiveReading::default();
    bench.send(Msg::Answer(old, Ok(Answer::Registers(reading))));
    assert!(bench.screen(80, 24).contains("reading"), "the old answer does not count");
    assert_eq!(bench.answer(0, device).spans[0].address, 1000);
}

#[test]
fn a_change_is_marked_and_a_failed_read_is_not_shown_as_good() {
    let mut bench = Bench::new();
    bench.keys("j1000⏎");
    bench.answer(0, device);
    bench.answer(1, |address| device(address).map(|word| if address == 1002 { 701 } else { word }));
    let shown = bench.screen(80, 24);
    let row = shown.lines().find(|row| row.contains("41003 /")).expect("the row is on the screen");
    assert!(row.starts_with('*') && row.contains("701") && row.contains("now"), "{row}");
    let (id, read) = bench.asked.pop().expect("a query");
    let words = Err(Fault::Timeout);
    let part = LivePart { at: now() + SignedDuration::from_secs(5), span: read.spans[0], words };
    let reading = LiveReading { parts: vec![part], requests: 1, ..LiveReading::default() };
    bench.send(Msg::Answer(id, Ok(Answer::Registers(reading))));
    let shown = bench.screen(80, 24);
    let row = shown.lines().find(|row| row.contains("41003 /")).expect("the row is on the screen");
    assert!(row.contains("02BD?"), "an old value is marked: {row}");
    assert!(shown.contains("response timeout"), "{shown}");
}

#[test]
fn addresses_are_taken_in_every_form_and_wrong_ones_refused() {
    let mut bench = Bench::new();
    for (typed, table, address) in [
        ("1002", Table::Holding, 1002),
        ("0x3EA", Table::Holding, 1002),
        ("31001", Table::Input, 1000),
        ("coil:7", Table::Coil, 7),
        ("holding:32080", Table::Holding, 32_080),
        ("03EAH", Table::Holding, 1002),
    ] {
        bench.model.tabs.registers.table = Table::Holding;
        bench.keys(&format!("j{typed}⏎"));
        let tab = &bench.model.tabs.registers;
        assert_eq!((tab.table, tab.selected), (table, address), "{typed}");
    }
    bench.keys("⎋bj40080⏎");
    assert_eq!(bench.model.tabs.registers.selected, 40_080, "from 0, five digits are as sent");
    bench.keys("bj0X10⏎");
    assert_eq!(bench.model.tabs.registers.selected, 16, "hexadecimal is as sent, also where numbers count from 1");
    bench.keys("j70000⏎");
    assert!(bench.screen(80, 24).contains("found `70000`"));
    bench.keys("⎋");
    assert_eq!(bench.model.modal, None);
}

#[test]
fn units_are_those_that_can_answer_on_the_line() {
    let mut bench = Bench::new();
    bench.keys("U0⏎");
    assert_eq!((bench.model.tabs.registers.unit, &bench.model.modal), (0, &None), "0 is a unit on TCP");
    let rtu = Transport::rtu("/dev/ttyUSB0", crate::plant::def::Serial::USUAL);
    assert_eq!((rtu.units(), Transport::tcp("plc", 502).units()), (1..=247, 0..=255));
    bench.keys("U256⏎");
    assert!(bench.screen(80, 24).contains("found `256`, expected 0 to 255"));
}

#[test]
fn a_value_is_found_raw_scaled_and_as_a_float() {
    let mut bench = Bench::new();
    bench.keys("j1000⏎");
    bench.send(Msg::Resize(120, 40));
    bench.answer(0, device);
    for (typed, address) in [("700", 1002), ("70.0", 1002), ("0x2BC", 1002), ("104.69", 1012)] {
        bench.model.tabs.registers.selected = 1000;
        bench.keys(&format!("/{typed}⏎"));
        assert!(bench.screen(120, 40).contains(&format!("where {typed} may be")), "{}", bench.screen(120, 40));
        bench.keys("⏎");
        assert_eq!((bench.model.tabs.registers.selected, &bench.model.modal), (address, &None), "{typed}");
    }
    bench.keys("/4711⏎");
    assert!(bench.screen(120, 40).contains("in none of the registers"));
}

#[test]
fn a_named_register_shows_its_name_and_value() {
    let mut bench = Bench::new();
    bench.keys("j1000⏎");
    let sv = Named::new(Table::Holding, 1002, DataType::I16, ByteOrder::Abcd, "SV");
    bench.model.tabs.registers.names.put(Named { scale: 0.1, decimals: 1, unit: "°C".into(), ..sv });
    assert!(bench.screen(80, 24).contains("name and value"));
    bench.answer(0, device);
    for width in [80, 120] {
        let shown = bench.screen(width, 24);
        let row = shown.lines().find(|row| row.contains("41003 /")).expect("the row is on the screen");
        assert!(row.contains("SV  70.0 °C"), "{width}: {row}");
    }
}

#[test]
fn nothing_is_written_before_it_was_enabled_and_confirmed() {
    let mut bench = Bench::new();
    bench.keys("j1002⏎");
    bench.answer(0, device);
    assert!(bench.screen(80, 24).contains("READ ONLY"));
    bench.keys("w601⏎");
    assert!(bench.screen(80, 24).contains("expected yes"), "the first entry only enables");
    bench.keys("⎋wyes⏎");
    assert!(bench.screen(80, 24).contains("WRITING ENABLED"));
    bench.keys("w");
    let shown = bench.screen(80, 24);
    assert!(shown.contains("write 41003, now 700") && !shown.contains("│ 700"), "the entry is empty: {shown}");
    assert_eq!(type_keys(&mut bench.model, "601⏎⏎"), [], "Enter does not confirm");
    assert!(bench.screen(80, 24).contains("700 to 601"), "{}", bench.screen(80, 24));
    let effects = type_keys(&mut bench.model, "y");
    let write = RegisterWrite::holding(1002, 700, 601);
    assert_eq!(sent_kind(&effects), Some(&CommandKind::Test(LineId(0), Diagnostic::Write(write))));
}

#[test]
fn what_is_not_known_is_not_written_over() {
    let mut bench = Bench::new();
    bench.keys("wyes⏎");
    bench.keys("w");
    assert!(bench.screen(80, 24).contains("The current value of this address is unknown"));
    bench.keys("⎋j1002⏎");
    bench.answer(0, |address| Some(address).filter(|address| *address == 1002));
    bench.keys("w1 2⏎");
    assert!(bench.screen(80, 24).contains("not all of their current values"), "{}", bench.screen(80, 24));
}

#[test]
fn what_was_read_before_the_line_was_lost_is_marked_as_old() {
    let mut bench = Bench::new();
    bench.keys("j1002⏎");
    bench.answer(0, device);
    bench.keys("p");
    bench.answer(1, device);
    let row = |bench: &mut Bench| {
        let shown = bench.screen(120, 40);
        let rows = shown.lines().filter(|row| row.contains("41003")).map(str::to_owned).collect::<Vec<_>>();
        (rows[0].clone(), rows[rows.len() - 1].clone())
    };
    assert!(!row(&mut bench).0.contains("02BC?"), "good while it is read");
    bench.snapshot(2, LineState::Waiting { why: "refused".into(), retry_at: now() });
    let (grid, watched) = row(&mut bench);
    assert!(grid.contains("02BC?") && watched.contains("700?"), "{grid}\n{watched}");
    bench.snapshot(60, LineState::Connected);
    assert!(row(&mut bench).0.contains("02BC?"), "nothing was read for a minute");
    bench.answer(60, device);
    let (grid, watched) = row(&mut bench);
    assert!(!grid.contains('?') && !watched.contains('?'), "{grid}\n{watched}");
}

#[test]
fn where_nothing_answers_the_tab_says_what_to_check() {
    let mut bench = Bench::new();
    let silent = |bench: &mut Bench, fault| {
        let (id, read) = bench.asked.pop().expect("a query");
        let part = LivePart { at: now(), span: read.spans[0], words: Err(fault) };
        let reading = LiveReading { parts: vec![part], requests: 1, ..LiveReading::default() };
        bench.send(Msg::Answer(id, Ok(Answer::Registers(reading))));
        bench.screen(80, 24)
    };
    bench.snapshot(0, LineState::Waiting { why: "closed by the other side".into(), retry_at: now() });
    let shown = bench.screen(80, 24);
    assert!(shown.contains("--mode rtu-over-tcp") && shown.contains("another program holds it"), "{shown}");
    bench.snapshot(0, LineState::Connected);
    let shown = silent(&mut bench, Fault::Timeout);
    assert!(shown.contains("another unit address") && shown.contains("response timeout"), "{shown}");
    let shown = silent(&mut bench, Fault::Exception(ExceptionCode(0x0B)));
    assert!(shown.contains("the gateway answers"), "{shown}");
    let shown = silent(&mut bench, Fault::WrongUnit { got: 9, asked: 1 });
    let expect = ["unit 9 answered in place of unit 1", "the device has unit address 9"];
    assert!(expect.iter().all(|words| shown.contains(words)), "{shown}");
    bench.answer(1, Some);
    assert!(!silent(&mut bench, Fault::Timeout).contains("likelihood"), "it has answered before");
}

#[test]
fn a_system_clock_that_was_set_does_not_stop_reading() {
    let mut bench = Bench::new();
    let (id, read) = bench.asked.pop().expect("a query");
    let at = now() - SignedDuration::from_hours(1);
    let part = LivePart { at, span: read.spans[0], words: Err(Fault::Timeout) };
    let reading = LiveReading { began: now(), parts: vec![part], requests: 1, ..LiveReading::default() };
    bench.send(Msg::Answer(id, Ok(Answer::Registers(reading))));
    let next = now() + SignedDuration::from_secs(1);
    assert_eq!(bench.asked.last().map(|(_, read)| read.not_before), Some(Some(next)));
}

#[test]
fn a_bench_has_no_alarms_that_could_not_be_evaluated() {
    let mut bench = Bench::new();
    bench.snapshot(2, LineState::Connecting);
    let shown = bench.screen(80, 24);
    assert!(shown.contains("no plant file") && !shown.contains("not evaluated"), "{shown}");
}

#[test]
fn a_time_stamp_is_whole_on_a_small_screen() {
    let mut bench = Bench::new();
    let seconds: jiff::Timestamp = "2026-11-21T07:00:00Z".parse().expect("a time");
    let words = seconds.as_second().to_be_bytes();
    bench.answer(0, |address| match address {
        0 => Some(u16::from_be_bytes([words[4], words[5]])),
        1 => Some(u16::from_be_bytes([words[6], words[7]])),
        _ => Some(0),
    });
    for (width, height) in [(80, 24), (120, 40)] {
        let shown = bench.screen(width, height);
        assert!(shown.contains("ABCD 2026-11-21T07:00:00Z"), "{shown}");
    }
}
