//! Plants for the targets, and what every plant must stand.

use std::{
    path::Path,
    sync::{Arc, LazyLock},
    time::Duration,
};

use jiff::{SignedDuration, Timestamp};
use sightglass::api::{
    plant::{Event, Exact, Framing, LineDef, Plant, PlantDef, Serial, TagDef, Transport},
    profile::{self, Errors, OwnProfiles, Search},
};

/// The tank of the program, with data out and requests from outside.
pub static TANK: LazyLock<Arc<PlantDef>> = LazyLock::new(|| {
    let shipped = profile::text_of("tank", &Search::shipped()).expect("shipped");
    let text =
        format!("{shipped}\n[north.mqtt]\nhost = \"broker\"\ntopic = \"sightglass/tank\"\ncommands_as = \"mes\"\n");
    checked(&text).expect("a plant with data out")
});

/// 2026-11-21, about noon.
pub fn now() -> Timestamp {
    Timestamp::from_second(1_795_262_400).expect("in range")
}

/// The framing that a byte stands for.
pub fn framing(byte: u8) -> Framing {
    [Framing::Rtu, Framing::Ascii, Framing::Mbap][usize::from(byte % 3)]
}

/// A line with this framing.
pub fn line(framing: Framing) -> LineDef {
    let transport = match framing {
        Framing::Mbap => Transport::tcp("plc", 502),
        Framing::Rtu | Framing::Ascii => {
            Transport::Serial { port: "p".into(), serial: Serial::USUAL, framing, rs485: Default::default() }
        }
    };
    LineDef { timeout: Duration::from_millis(500), ..LineDef::new(sightglass::api::plant::LineId(0), "L", transport) }
}

/// The plant of a text; what is wrong with it can be shown.
pub fn checked(text: &str) -> Option<Arc<PlantDef>> {
    verdict(OwnProfiles::default().check("fuzz", text))
}

/// The plant of a file of this name, as `sightglass check` reads it.
pub fn checked_file(name: &str, bytes: &[u8]) -> Option<Arc<PlantDef>> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).expect("a file");
    verdict(profile::check(Path::new(&path), &Search::shipped()))
}

fn verdict(found: Result<profile::Checked, Errors>) -> Option<Arc<PlantDef>> {
    match found {
        Ok(checked) => {
            show(&checked.warnings);
            Some(checked.plant)
        }
        Err(errors) => {
            assert_ne!(errors.count(), 0, "refused without a reason");
            show(&errors);
            None
        }
    }
}

fn show(errors: &Errors) {
    if errors.count() == 0 {
        return;
    }
    assert!(!profile::render(errors, true).is_empty());
    assert_eq!(errors.lines().count(), errors.count(), "one line for each");
    errors.full_lines().for_each(|line| assert!(!line.is_empty()));
}

/// Lets a plant run: its devices answer with odd numbers, and time passes in odd steps.
pub fn run_plant(def: &Arc<PlantDef>) {
    const RAWS: [f64; 5] = [0.0, 1.0, 65_535.0, -32_768.0, 7.5];
    let mut plant = Plant::new(def.clone(), now(), 1.0);
    let mut at = now();
    for (turn, step) in (0..).zip([0, 1, 1_000, 3_600_000, 86_400_000]) {
        at += SignedDuration::from_millis(step);
        for device in &def.devices {
            let raw = |tag: &TagDef| Exact::from(RAWS[(turn + tag.id.index()) % RAWS.len()]);
            let polled = def.tags_of(device.id).filter(|tag| tag.calculation.is_none() && !tag.is_text());
            plant.on_event(Event::Read {
                at,
                device: device.id,
                values: polled.map(|tag| (tag.id, raw(tag))).collect(),
                texts: Vec::new(),
                response_time: Duration::from_millis(20),
                exchange: None,
            });
        }
        plant.on_tick(at);
        let snapshot = plant.snapshot();
        assert!(
            snapshot.samples.iter().all(|sample| sample.exact().is_none_or(Exact::is_finite)),
            "a value is a number"
        );
    }
}
