//! Totals go on over restarts of the station.

use super::*;
use crate::plant::{
    Plant,
    event::Event,
    expr::{Compare, Expr},
    fixture::{self, PLC, RUN},
    tag::Calculation,
    totalizer::Total,
};

/// The fixture with the hours of its PLC, stored at every change.
fn def() -> (Arc<PlantDef>, TagId) {
    let mut def = fixture::plant();
    let id = TagId(u16::try_from(def.tags.len()).unwrap());
    let expr = Expr::test(RUN, Compare::Equal, 1.0);
    let calculation = Calculation {
        text: String::new(),
        over_time: Some(crate::plant::calculation_def::OverTime::Total(Total::OnTime)),
        expr,
    };
    let tag = def.tags[RUN.index()].clone();
    let tag = crate::plant::tag::TagDef { id, name: "PLC-1.HOURS".into(), ..tag };
    def.tags.push(crate::plant::tag::TagDef { calculation: Some(Arc::new(calculation)), deadband: Some(0.0), ..tag });
    (Arc::new(def), id)
}

/// A station that reads the PLC as running each minute; its total at the end.
fn station(db: &Path, minutes: std::ops::Range<i64>, restores: bool) -> Sample {
    let (def, hours) = def();
    let opened = Store::open_at_start(db, &def, sec(minutes.start * 60)).unwrap();
    let mut plant = Plant::new(def, sec(minutes.start * 60), 1.0);
    for minute in minutes {
        let (at, values, texts, response_time) =
            (sec(minute * 60), vec![(RUN, 1.0.into())], Vec::new(), Duration::ZERO);
        opened
            .store
            .append(
                &plant.on_event(Event::Read { at, device: PLC, values, texts, response_time, exchange: None }).records,
            )
            .unwrap();
        if restores {
            plant.restore_totals(&opened.read.totals);
        }
    }
    let sample = plant.snapshot().samples[hours.index()];
    // Sums of hours are exact to some digits only.
    Sample { value: sample.value.map(|value| (value * 1e9).round() / 1e9), ..sample }
}

#[test]
fn a_total_goes_on_over_restarts_and_runs_that_did_not_know_it() {
    let (_folder, db) = folder();
    assert_eq!(station(&db, 0..61, true), Sample::good(1.0, sec(3_600)), "it begins at 0");
    assert_eq!(station(&db, 100..131, true), Sample::good(1.5, sec(7_800)), "the time off is not counted");
    // A station that ended before it had read its history; then one that comes three days later.
    let unknown = station(&db, 200..500, false);
    assert_eq!(unknown, Sample::bad(Cause::NotRead, unknown.at));
    assert_eq!(station(&db, 4_320..4_381, true), Sample::good(2.5, sec(4_380 * 60)));
}

#[test]
fn a_total_goes_on_from_what_was_stored_last_by_any_clock() {
    let total = |tag, at, value| Record::Sample(tag, Sample::good(value, sec(at)));
    let day = 86_400;
    // The clock was an hour, or a year, ahead and is set right; it is set forward, for good or for an hour.
    for (before, steps, expect) in [
        (7_200, vec![(3_600, 100.1), (5_400, 100.5)], 100.5),
        (365 * day, vec![(3_600, 100.1), (5_400, 100.5)], 100.5),
        (3_600, vec![(400 * day, 100.5)], 100.5),
        (7_200, vec![], 100.0),
    ] {
        for archived in [false, true] {
            let (_folder, db) = folder();
            let (def, hours) = def();
            let store = Store::open_at_start(&db, &def, sec(0)).unwrap().store;
            store.append(&[total(hours, before, 100.0)]).unwrap();
            let now = steps.last().map_or(before, |(at, _)| *at) + 60;
            if !steps.is_empty() {
                let after = steps.iter().map(|(at, value)| total(hours, *at, *value));
                store.append(&[Record::ClockSet].into_iter().chain(after).collect::<Vec<_>>()).unwrap();
            }
            if archived {
                store
                    .archive(&crate::history::io::archive::Job::Hour(before / 3_600 * crate::history::tiers::HOUR))
                    .unwrap();
            }
            drop(store);
            let totals = Store::open_at_start(&db, &def, sec(now)).unwrap().read.totals;
            assert_eq!(totals, [("PLC-1.HOURS".to_owned(), expect)], "{before} {steps:?} {archived}");
        }
    }
}
