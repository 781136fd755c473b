//! From a key to the drawn frame, for a plant of many tags and for a small one, tab by tab.
//!
//! `cargo bench --bench ui -- 10000`: each key goes through `update`, the whole frame is drawn into a buffer and compared with
//! the frame before, as in a terminal of 160x50. No history answers: curves are empty.
#![allow(clippy::print_stdout, clippy::unwrap_used, missing_docs)]
#![allow(clippy::cast_lossless, clippy::cast_possible_truncation, clippy::cast_sign_loss)]

#[path = "support/many.rs"]
mod many;

use std::{sync::Arc, time::Instant};

use crossterm::event::{KeyCode, KeyEvent, KeyModifiers};
use jiff::Timestamp;
use many::{TAGS_EACH, plant, tags_of};
use ratatui::{Terminal, backend::TestBackend};
use sightglass::api::{
    access::{LoggedInUser, SessionStatus},
    plant::{Event, LineState, Pen, Plant, PlantDef, Role, TrendGroup},
    ui::{Model, Msg, Theme, update, view},
};

const ROUNDS: usize = 300;
const SMALL: u16 = 100;
const GOAL_MS: f64 = 16.0;

/// What is measured: its name, the keys that lead there, and the keys that are pressed in turn.
const PLACES: [(&str, &str, [KeyCode; 2]); 10] = [
    ("mimic", "1", [KeyCode::Down, KeyCode::Up]),
    ("trends", "2", [KeyCode::Left, KeyCode::Right]),
    ("trends, values", "2v", [KeyCode::PageDown, KeyCode::Down]),
    ("alarms", "3", [KeyCode::Down, KeyCode::Up]),
    ("controllers", "4", [KeyCode::Down, KeyCode::Up]),
    ("reports", "5", [KeyCode::Down, KeyCode::Up]),
    ("bus", "6", [KeyCode::Down, KeyCode::Up]),
    ("users", "7", [KeyCode::Down, KeyCode::Up]),
    ("palette, opened", "1", [KeyCode::Char(':'), KeyCode::Esc]),
    ("palette, typed", "1:", [KeyCode::Char('r'), KeyCode::Backspace]),
];

fn main() {
    let tags = std::env::args().filter_map(|word| word.parse::<u16>().ok()).next().unwrap_or(10_000);
    println!("key to frame in ms at 160x50: {tags} tags p50 p99 max, {SMALL} tags p50 p99, ratio of p50");
    for (name, to, keys) in PLACES {
        let [many, few] = [tags, SMALL].map(|tags| measure(tags / TAGS_EACH, to, keys));
        let [p50, p99, max] = many;
        let mark = if p99 > GOAL_MS { "  OVER" } else { "" };
        println!(
            "{name:16} {p50:8.2} {p99:8.2} {max:8.2}   {:8.2} {:8.2}   {:6.1}{mark}",
            few[0],
            few[1],
            p50 / few[0]
        );
    }
    let [p50, p99, max] = snapshots(tags / TAGS_EACH);
    println!("{:16} {p50:8.2} {p99:8.2} {max:8.2}", "snapshot, mimic");
}

fn def(devices: u16) -> Arc<PlantDef> {
    let mut def = PlantDef::clone(&plant(devices, 4.min(devices)));
    let group = |device: u16| TrendGroup {
        name: format!("D{device}"),
        pens: tags_of(device).take(4).map(|tag| Pen { tag, scale: None }).collect(),
    };
    def.trends = (0..devices).map(group).collect();
    Arc::new(def)
}

/// The plant with a value of each tag.
fn running(def: &Arc<PlantDef>, round: u32) -> Plant {
    let at = Timestamp::from_second(1_790_000_000 + i64::from(round)).unwrap();
    let mut plant = Plant::new(def.clone(), at, 1.0);
    for line in &def.lines {
        plant.on_event(Event::Line { at, line: line.id, state: LineState::Connected });
    }
    for device in &def.devices {
        let raw = |tag: u16| f64::from((u32::from(tag) * 7 + round) % 60_000);
        let values = tags_of(device.id.0).map(|tag| (tag, raw(tag.0).into())).collect();
        let response_time = std::time::Duration::from_millis(12);
        plant.on_event(Event::Read { at, device: device.id, values, texts: Vec::new(), response_time, exchange: None });
    }
    plant
}

fn model(devices: u16) -> (Model, Terminal<TestBackend>) {
    let snapshot = running(&def(devices), 0).snapshot();
    let who = LoggedInUser { user: "bench".into(), role: Role::Supervisor, must_change: false };
    let session = SessionStatus { who: Some(who), may_view: true, ..SessionStatus::default() };
    let mut model = Model::new(Arc::new(snapshot), Theme::FULL, 1, Arc::new(session));
    update(&mut model, Msg::Resize(160, 50));
    (model, Terminal::new(TestBackend::new(160, 50)).unwrap())
}

fn draw(model: &mut Model, terminal: &mut Terminal<TestBackend>) {
    terminal.draw(|frame| view(model, frame)).unwrap();
    update(model, Msg::Drawn);
}

fn press(model: &mut Model, code: KeyCode) {
    update(model, Msg::Key(KeyEvent::new(code, KeyModifiers::NONE)));
}

fn measure(devices: u16, to: &str, keys: [KeyCode; 2]) -> [f64; 3] {
    let (mut model, mut terminal) = model(devices);
    for key in to.chars() {
        press(&mut model, KeyCode::Char(key));
        draw(&mut model, &mut terminal);
    }
    timed(|round| {
        press(&mut model, keys[round % 2]);
        draw(&mut model, &mut terminal);
    })
}

/// News of every tag on the mimic.
fn snapshots(devices: u16) -> [f64; 3] {
    let (mut model, mut terminal) = model(devices);
    let def = model.snapshot.def.clone();
    let mut news: Vec<_> = (0..ROUNDS as u32).map(|round| running(&def, round % 20).snapshot()).collect();
    timed(|_| {
        update(&mut model, Msg::Snapshot(Arc::new(news.pop().unwrap())));
        draw(&mut model, &mut terminal);
    })
}

/// p50, p99 and the longest in milliseconds.
fn timed(mut round: impl FnMut(usize)) -> [f64; 3] {
    let mut times: Vec<f64> = (0..ROUNDS)
        .map(|n| {
            let began = Instant::now();
            round(n);
            began.elapsed().as_secs_f64() * 1e3
        })
        .collect();
    times.sort_by(f64::total_cmp);
    [times[ROUNDS / 2], times[ROUNDS * 99 / 100], times[ROUNDS - 1]]
}
