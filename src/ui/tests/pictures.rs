//! The pictures of the README, made by the program's own screen dump: `SIGHTGLASS_WRITE=1 cargo test --release pictures_of`
//! writes them again.

use std::{fs, path::Path};

use crate::{
    history::{Answer, Bucket, Query, Series},
    plant::record::{AlarmEvent, AlarmRecord},
    ui::{
        Effect, Model, Msg,
        fixture::Fixture,
        screen_dump::drawing,
        tabs::Tab,
        tests::{draw, model, type_keys},
        theme::Theme,
        update,
    },
};

/// A curve that climbs to its value now, and swings around it.
fn climbing(model: &Model, query: &Query) -> Vec<Series> {
    let Query::Series { tags, from, to, buckets } = query else { return Vec::new() };
    let step = to.duration_since(*from).unsigned_abs() / (*buckets).max(1) as u32;
    let curve = |tag| {
        let last = model.snapshot.sample(tag).good_value()?;
        let value = |n: usize| {
            let share = n as f64 / *buckets as f64;
            last * (1.0 - 0.6 * (-6.0 * share).exp()) + 0.02 * last * (12.0 * share).sin()
        };
        let bucket = |n| Bucket { min: value(n), max: value(n), mean: value(n), last: value(n).into() };
        let buckets = (0..*buckets).map(|n| Some(bucket(n))).collect();
        Some(Series {
            tag,
            from: *from,
            step,
            buckets,
            summary: Some(((0.4 * last).into(), (0.9 * last).into(), last.into())),
            counted: None,
            good: 1.0,
        })
    };
    tags.iter().filter_map(|tag| curve(*tag)).collect()
}

fn journal(model: &Model) -> Vec<AlarmRecord> {
    let raised = model.snapshot.alarms.iter().map(|alarm| {
        let def = model.snapshot.def.alarm(alarm.id);
        AlarmRecord::new(alarm.raised_at, "TIC-1.PV", &def.message, def.priority, AlarmEvent::Raised)
    });
    raised.collect()
}

/// A tab at 120x40 when the history has answered it.
fn shown(fixture: &Fixture, tab: Tab, keys: &str) -> String {
    let mut model = model(fixture, Theme::FULL);
    model.tabs.shown = tab;
    type_keys(&mut model, keys);
    let mut effects = update(&mut model, Msg::Resize(120, 40));
    effects.extend(update(&mut model, Msg::Tick { silent: std::time::Duration::ZERO }));
    for effect in effects {
        let Effect::Query(id, query) = effect else { continue };
        let answer = match &query {
            Query::Series { .. } => Answer::Series(climbing(&model, &query)),
            Query::Journal { .. } => Answer::Journal(journal(&model)),
            Query::Actions { .. } => Answer::Actions(Vec::new()),
            _ => continue,
        };
        update(&mut model, Msg::Answer(id, Ok(answer)));
    }
    String::from_utf8(drawing(&draw(&mut model, 120, 40)).svg()).expect("SVG is text")
}

#[test]
fn the_pictures_of_the_readme_are_those_of_the_program() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/pictures");
    let readme = include_str!("../../../README.md");
    for (name, fixture, tab, keys) in [
        ("mimic", Fixture::normal(), Tab::Mimic, ""),
        ("alarms", Fixture::alarm(), Tab::Alarms, ""),
        ("bus", Fixture::traffic_trouble(), Tab::Bus, "F"),
    ] {
        let (path, made) = (folder.join(format!("{name}.svg")), shown(&fixture, tab, keys));
        assert!(readme.contains(&format!("(tests/pictures/{name}.svg)")), "{name}");
        if std::env::var_os("SIGHTGLASS_WRITE").is_some() {
            fs::create_dir_all(&folder).expect("a folder for the pictures");
            fs::write(&path, &made).expect("a picture");
        }
        let there = fs::read_to_string(&path).unwrap_or_default();
        assert!(there == made, "{} is another one: SIGHTGLASS_WRITE=1 writes it again", path.display());
    }
}
