//! The devices as small faceplates.

use super::*;
use crate::{
    history::{Answer, Bucket, HistoryError, Query, Series},
    ui::fixture::now,
};

#[test]
fn a_wide_screen_shows_devices_as_faceplates_and_v_the_table() {
    let mut model = model(&trouble(8), Theme::FULL);
    screen(&mut model, 160, 50);
    type_keys(&mut model, "4");
    let wall = screen(&mut model, 160, 50);
    let top = wall.lines().find(|line| line.starts_with("┌─ TIC-1  zone 1")).unwrap_or_default();
    assert!(["TIC-2  zone 2", "TIC-3", "‹2›!", "✗F"].iter().all(|words| top.contains(words)), "{wall}");
    assert!(wall.contains("PV-SV    +2.4 °C") && wall.contains("TIC-8"), "{wall}");
    type_keys(&mut model, "v");
    assert!(screen(&mut model, 160, 50).contains("device model"), "the table is one key away");
    // A usual screen has the table, and the faceplates one key away.
    let mut model = super::super::super::super::tests::model(&trouble(8), Theme::FULL);
    type_keys(&mut model, "4");
    assert!(screen(&mut model, 80, 24).contains("device model"));
    type_keys(&mut model, "v");
    assert!(screen(&mut model, 80, 24).contains("PV-SV"));
}

#[test]
fn arrows_lead_from_faceplate_to_faceplate_and_enter_opens() {
    let mut model = model(&many(8), Theme::FULL);
    screen(&mut model, 160, 50);
    type_keys(&mut model, "4→↓");
    let foot = screen(&mut model, 160, 50).lines().rev().nth(2).map(str::to_owned).unwrap_or_default();
    assert!(foot.contains("TIC-5"), "three stand in a row: {foot}");
    type_keys(&mut model, "⏎");
    assert!(screen(&mut model, 160, 50).contains("‹ TIC-5 ›"));
    type_keys(&mut model, "⎋");
    assert!(screen(&mut model, 160, 50).contains("PV-SV"), "back to the faceplates");
}

#[test]
fn each_faceplate_has_the_curve_of_its_own_value() {
    let mut model = model(&many(2), Theme::FULL);
    screen(&mut model, 160, 50);
    let effects = type_keys(&mut model, "4");
    let Some(Effect::Query(id, Query::Series { tags, from, buckets, .. })) = effects.last() else {
        panic!("{effects:?}")
    };
    assert_eq!(tags.len(), 2);
    let step = Duration::try_from(now().duration_since(*from)).expect("a span") / *buckets as u32;
    let series = |(n, tag): (usize, &crate::plant::def::TagId)| {
        let bucket = |mean: f64| Some(Bucket { min: mean, max: mean, mean, last: mean.into() });
        let (low, high) = (n as f64 * 100.0, n as f64 * 100.0 + 9.0);
        let buckets = (0..*buckets).map(|n| bucket(low + n as f64 % 9.0)).collect();
        Series {
            tag: *tag,
            from: *from,
            step,
            buckets,
            summary: Some((low.into(), low.into(), high.into())),
            counted: None,
            good: 1.0,
        }
    };
    let answer = Answer::Series(tags.iter().enumerate().map(series).collect());
    update(&mut model, Msg::Answer(*id, Ok(answer)));
    let shown = screen(&mut model, 160, 50);
    let row = shown.lines().find(|line| line.contains("109.0")).unwrap_or_default();
    assert!(row.contains("9.0 ││"), "each has its own scale: {shown}");
}

#[test]
fn only_the_curves_on_the_screen_are_asked_for() {
    let mut model = model(&many(80), Theme::FULL);
    screen(&mut model, 160, 50);
    let asked = |effects: &[Effect]| match effects.last() {
        Some(Effect::Query(id, Query::Series { tags, .. })) => (*id, tags.clone()),
        _ => panic!("{effects:?}"),
    };
    let (id, first) = asked(&type_keys(&mut model, "4"));
    assert!((1..=64).contains(&first.len()), "{} curves", first.len());
    update(&mut model, Msg::Answer(id, Err(HistoryError::Engine("disk is full".to_owned()))));
    let shown = screen(&mut model, 160, 50);
    assert!(shown.contains("no curves: history: "), "{shown}");
    let (_, next) = asked(&type_keys(&mut model, &"↓".repeat(8)));
    assert_ne!(first, next, "others have come onto the screen");
}

#[test]
fn bars_of_one_scale_are_equally_long() {
    let mut fixture = trouble(8);
    fixture.set("TIC-1.SV", 66.0);
    let mut model = model(&fixture, Theme::FULL);
    type_keys(&mut model, "4⏎");
    let shown = screen(&mut model, 60, 20);
    let ends = |name: &str| {
        let row = shown.lines().find(|row| row.starts_with(name)).unwrap_or_default();
        ['├', '┤'].map(|end| row.chars().position(|letter| letter == end))
    };
    let [pv, sv] = [" PV", " SV"].map(ends);
    assert_eq!(pv, sv, "{shown}");
    assert!(pv[0].zip(pv[1]).is_some_and(|(begin, end)| end - begin >= 10), "{shown}");
    assert!(shown.contains("setpoint"), "labels are no stumps: {shown}");
}

#[test]
fn the_keys_that_send_are_hidden_on_a_listening_line() {
    for (listens, expect) in [(false, true), (true, false)] {
        let mut fixture = Fixture::normal();
        fixture.def.lines[0].listens = listens;
        let mut model = model(&fixture, Theme::FULL);
        type_keys(&mut model, "4");
        let shown = screen(&mut model, 200, 60);
        let footer = shown.lines().last().expect("a footer");
        for key in ["u refresh", "c settings"] {
            assert_eq!(footer.contains(key), expect, "{key}:\n{shown}");
        }
        type_keys(&mut model, "⏎↓");
        let shown = screen(&mut model, 200, 60);
        let footer = shown.lines().last().expect("a footer");
        for (place, key) in [(footer, "⏎ edit"), (footer, "T tune"), (&*shown, "✎ SV")] {
            assert_eq!(place.contains(key), expect, "{key}:\n{shown}");
        }
    }
}
