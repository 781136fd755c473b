//! The overview at every size, with good and other values, and of a plant without a mimic.

use super::*;
use crate::{
    history::{Bucket, Series},
    plant::{
        def::{DeviceDef, DeviceId, MimicDef, Priority},
        record::{ActionRecord, AlarmEvent, AlarmRecord},
        recorded_action::RecordedAction,
        sample::Sample,
        tag::TagDef,
    },
    ui::{
        Effect, Model, Msg,
        fixture::{Fixture, now},
        tests::{model, screen, type_keys},
        theme::Theme,
        update,
    },
};

/// Answers everything that the mimic has asked for: a morning of steps, a rising PV, an alarm and a command.
fn answer(model: &mut Model, effects: Vec<Effect>) {
    let ago = |minutes| now() - SignedDuration::from_mins(minutes);
    for effect in effects {
        let Effect::Query(id, query) = effect else { continue };
        let answer = match query {
            Query::Journal { .. } => {
                let raised = |minutes, priority| {
                    AlarmRecord::new(ago(minutes), "TIC-1.PV", "temperature high", priority, AlarmEvent::Raised)
                };
                Answer::Journal(vec![raised(1, Priority::High), raised(100, Priority::Low)])
            }
            Query::Actions { .. } => {
                let new = Some("70.0 °C".into());
                let write = ActionRecord::new(ago(90), "anna", RecordedAction::Write, "TIC-1.SV", "verified");
                Answer::Actions(vec![ActionRecord { new, ..write }])
            }
            Query::Series { tags, from, to, buckets } => {
                let step = Duration::try_from(to.duration_since(from)).expect("a span") / buckets as u32;
                let series = |tag: TagId| {
                    let is_step = model.snapshot.def.tag(tag).short == "STEP";
                    let of = |n: usize| {
                        let share = n as f64 / buckets as f64;
                        if is_step { (share * 3.0).floor() } else { 50.0 + 20.0 * share }
                    };
                    let bucket = |n| {
                        let value = of(n);
                        // A gap stays a gap.
                        (n * 10 / buckets != 2).then_some(Bucket {
                            min: value,
                            max: value,
                            mean: value,
                            last: value.into(),
                        })
                    };
                    Series {
                        tag,
                        from,
                        step,
                        buckets: (0..buckets).map(bucket).collect(),
                        summary: None,
                        counted: None,
                        good: 1.0,
                    }
                };
                Answer::Series(tags.into_iter().map(series).collect())
            }
            _ => continue,
        };
        update(model, Msg::Answer(id, Ok(answer)));
    }
}

/// The fixture at noon of its shift, with the overview on a screen of this size.
fn overview(fixture: &Fixture, theme: Theme, (width, height): (u16, u16)) -> Model {
    let mut model = model(fixture, theme);
    let mut effects = update(&mut model, Msg::Resize(width, height));
    effects.extend(type_keys(&mut model, "v"));
    answer(&mut model, effects);
    model
}

#[test]
fn the_overview_at_every_size() {
    let mut fixture = Fixture::alarm();
    let step = fixture.tag("PLC-1.STEP");
    fixture.def.tags[step.index()].store = crate::plant::tag::StorePolicy::Change;
    // The afternoon has just begun: the morning says more.
    fixture.def.shifts.retain(|shift| shift.name != "afternoon");
    for (width, height) in [(80, 24), (120, 40), (160, 50), (200, 60)] {
        let mut model = overview(&fixture, Theme::FULL, (width, height));
        insta::assert_snapshot!(format!("overview_{width}x{height}"), screen(&mut model, width, height));
    }
    let mut model = overview(&fixture, Theme::PLAIN, (80, 24));
    let shown = screen(&mut model, 80, 24);
    assert!(shown.is_ascii(), "{shown}");
}

#[test]
fn small_screens_keep_the_list_of_values() {
    let mut model = model(&Fixture::normal(), Theme::FULL);
    let before = screen(&mut model, 60, 20);
    type_keys(&mut model, "v");
    let after = screen(&mut model, 60, 20);
    assert_eq!(before.lines().skip(4).take(14).collect::<Vec<_>>(), after.lines().skip(4).take(14).collect::<Vec<_>>());
}

#[test]
fn values_that_are_not_good_have_no_place_on_their_range() {
    let mut model = overview(&Fixture::line_down(), Theme::FULL, (120, 40));
    let shown = screen(&mut model, 120, 40);
    assert!(!shown.contains('◆') && shown.contains("64.2?") && shown.contains("----"), "{shown}");
    assert!(shown.contains("not connected"), "{shown}");
}

/// So many controllers without a mimic.
fn many(count: u16) -> Fixture {
    let mut fixture = Fixture::normal();
    let (device, pv) = (fixture.def.devices[0].clone(), fixture.def.tags[0].clone());
    let faceplate = device.faceplate.clone().expect("a controller");
    let place = |n: u16| (DeviceId(n), TagId(n));
    fixture.def.mimic = MimicDef::default();
    (fixture.def.alarms, fixture.def.logic, fixture.def.trends) = (Vec::new(), Default::default(), Vec::new());
    fixture.def.batches = Vec::new();
    fixture.def.devices = (0..count)
        .map(|n| {
            let (id, pv) = place(n);
            let faceplate = crate::plant::def::Faceplate {
                pv,
                sv: pv,
                mv: None,
                run: None,
                mode: None,
                tune: None,
                ..faceplate.clone()
            };
            DeviceDef {
                id,
                name: format!("TIC-{n}"),
                faceplate: Some(faceplate),
                actions: Vec::new(),
                ..device.clone()
            }
        })
        .collect();
    fixture.def.tags = (0..count)
        .map(|n| {
            let (device, id) = place(n);
            TagDef { id, device, name: format!("TIC-{n}.PV"), ..pv.clone() }
        })
        .collect();
    fixture.samples = (0..count).map(|n| Sample::good(40.0 + f64::from(n), now())).collect();
    fixture.devices = vec![fixture.devices[0]; usize::from(count)];
    fixture.source_frames = vec![None; usize::from(count)];
    fixture.tunings = vec![None; usize::from(count)];
    fixture
}

#[test]
fn a_plant_without_a_mimic_has_the_overview() {
    let fixture = many(64);
    for (width, height, seen) in [(60, 20, 14), (80, 24, 18), (120, 40, 56), (160, 50, 64)] {
        let mut model = model(&fixture, Theme::FULL);
        update(&mut model, Msg::Resize(width, height));
        let shown = screen(&mut model, width, height);
        let found = (0..64).filter(|n| shown.contains(&format!("TIC-{n} "))).count();
        assert!(seen <= found, "{found} at {width}x{height}\n{shown}");
        type_keys(&mut model, &"↓".repeat(63));
        assert!(screen(&mut model, width, height).contains("TIC-63 "), "the last one can be reached");
    }
    let mut model = model(&fixture, Theme::FULL);
    update(&mut model, Msg::Resize(160, 50));
    insta::assert_snapshot!("overview_64_units_160x50", screen(&mut model, 160, 50));
}

#[test]
fn enter_opens_the_device_and_v_leads_back_to_the_mimic() {
    let mut model = overview(&Fixture::normal(), Theme::FULL, (120, 40));
    assert!(screen(&mut model, 120, 40).contains("needs action"));
    type_keys(&mut model, "v");
    assert!(screen(&mut model, 120, 40).contains("last events"));
    type_keys(&mut model, ":overview⏎");
    type_keys(&mut model, "↓⏎");
    assert_eq!(model.tabs.shown, Tab::Controllers);
}
