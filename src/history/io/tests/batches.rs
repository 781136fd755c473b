//! Batches, stored by a station that is killed now and then.

use super::*;
use crate::{
    history::{BATCHES_MAX, io::tables::Tables},
    plant::{
        Plant,
        batch::{BatchDef, BatchEvent, BatchRecord},
        event::Event,
        expr::{Compare, Expr},
        fault::Fault,
        fixture::{self, DP, FAULT, PLC, PV, RUN, TIC},
    },
    report::batch::BatchReport,
};

/// The fixture, which makes a batch while it is switched on.
fn making() -> Arc<PlantDef> {
    let mut def = fixture::plant();
    def.tags.iter_mut().for_each(|tag| tag.deadband = Some(0.0));
    def.batches = vec![BatchDef {
        name: "soup".into(),
        start: Expr::test(RUN, Compare::Equal, 1.0),
        end: Expr::test(RUN, Compare::Equal, 0.0),
        phase: Some(RUN),
        energy: None,
        tags: vec![PV],
    }];
    Arc::new(def)
}

fn batches(store: &Store, from: i64, to: i64, limit: usize, now: i64) -> Vec<BatchReport> {
    match store.answer(&Query::Batches { from: sec(from), to: sec(to), limit }, sec(now)).unwrap() {
        Answer::Batches(batches) => batches,
        other => panic!("{other:?}"),
    }
}

/// A station from one second to another; its PLC is on for 40 of 60 s, and answers nothing in `silent`.
fn station(db: &Path, def: &Arc<PlantDef>, seconds: std::ops::Range<i64>, silent: std::ops::Range<i64>) {
    let opened = Store::open_at_start(db, def, sec(seconds.start)).unwrap();
    let mut plant = Plant::new(def.clone(), sec(seconds.start), 1.0);
    let store = opened.store;
    store.append(&plant.restore_batches(&opened.read.batches, opened.read.off)).unwrap();
    for second in seconds {
        let at = sec(second);
        let read = |device, values| Event::Read {
            at,
            device,
            values,
            texts: Vec::new(),
            response_time: Duration::from_millis(9),
            exchange: None,
        };
        let mut records = plant
            .on_event(read(TIC, vec![(DP, 0.0.into()), (FAULT, 0.0.into()), (PV, ((second % 17) as f64).into())]))
            .records;
        let on = f64::from(u8::from(second % 60 < 40));
        let plc = match silent.contains(&second) {
            true => Event::Failed { at, device: PLC, tags: vec![RUN], fault: Fault::NotConnected, exchange: None },
            false => read(PLC, vec![(RUN, on.into())]),
        };
        records.extend(plant.on_event(plc).records);
        store.append(&records).unwrap();
    }
}

#[test]
fn batches_survive_kills_and_have_the_figures_of_a_report() {
    let (_folder, db) = folder();
    let def = making();
    // From the middle of a batch; killed in one, and off over the whole next one; then silent over an end.
    station(&db, &def, 1_030..1_150, 0..0);
    station(&db, &def, 1_270..1_420, 1_295..1_305);
    let store = Store::open_read_only(&db, &def).unwrap();
    let found = batches(&store, 0, 2_000, 50, 1_420);
    let facts = |report: &BatchReport| {
        let batch = &report.batch;
        let second = |at: Timestamp| at.as_second();
        (batch.number, second(batch.from), batch.to.map(second), batch.seen, batch.unknown.as_secs())
    };
    let found: Vec<_> = found.iter().rev().map(|report| (facts(report), report)).collect();
    // PLC-1 is on in the first 40 s of each minute: 1020 to 1060, 1080 to 1120, 1140 to 1180, 1260 to 1300, 1320 to 1360.
    let expect = [
        (1, 1_030, Some(1_060), (false, true), 0),
        (2, 1_080, Some(1_120), (true, true), 0),
        // It goes on: that another one began in the two minutes between cannot be known.
        (3, 1_140, Some(1_305), (true, false), 1_270 - 1_150 + 1_305 - 1_295),
        (4, 1_320, Some(1_360), (true, true), 0),
        (5, 1_380, None, (true, true), 0),
    ];
    assert_eq!(found.iter().map(|(facts, _)| *facts).collect::<Vec<_>>(), expect);
    let Answer::Overview(overview) = store.answer(&Query::Overview, sec(1_420)).unwrap() else { panic!() };
    let scratch = tempfile::tempdir().unwrap();
    let tables = Tables::new(&def, &overview, scratch.path()).unwrap();
    tables.add_batches(found.iter().map(|(_, report)| report.batch.clone()).collect()).unwrap();
    let sql =
        "SELECT number, minutes, until IS NULL, (SELECT round(sum(minutes), 3) FROM phase p WHERE p.number = b.number
        AND phase = 'unknown'), begin_seen, end_seen FROM batch b WHERE number IN (2, 3, 5) ORDER BY number";
    let text = |row: &Vec<Option<String>>| {
        row.iter().map(|cell| cell.as_deref().unwrap_or("-").to_owned()).collect::<Vec<_>>().join(" ")
    };
    let rows: Vec<String> = tables.rows(sql, 9).unwrap().1.iter().map(text).collect();
    assert_eq!(
        rows,
        [
            "2 0.6666666666666666 false - true true",
            "3 2.75 false 2.167 true false",
            "5 0.6666666666666666 true - true true"
        ]
    );
    for (_, report) in found {
        let period = report.period();
        let Answer::Report(all) = store.answer(&Query::Report { period }, sec(1_420)).unwrap() else { panic!() };
        let expect = all.tags.into_iter().find(|tag| tag.tag == "TIC-1.PV");
        assert_eq!(report.tags, expect.into_iter().collect::<Vec<_>>());
        assert_eq!(
            report.batch.phases.iter().map(|(_, time)| *time).sum::<Duration>() + report.batch.unknown,
            report.batch.lasted
        );
        assert!(all.batches.iter().any(|of_report| of_report == report), "the report lists it as well");
    }
}

#[test]
fn a_span_has_the_batches_that_ran_in_it_newest_first() {
    let (_folder, db) = folder();
    let def = making();
    let store = Store::open(&db, &def, sec(0)).unwrap().store;
    let record = |number: u32, place, at, event| {
        Record::Batch(BatchRecord { at: sec(at), batch: "soup".into(), number, place, event, phase: None })
    };
    let one = |number: u32| {
        let begin = i64::from(number) * 100;
        [record(number, 0, begin, BatchEvent::Started), record(number, 1, begin + 60, BatchEvent::Ended)]
    };
    let many = u32::try_from(BATCHES_MAX).unwrap() + 5;
    store.append(&(1..=many).flat_map(one).collect::<Vec<_>>()).unwrap();
    let numbers = |found: &[BatchReport]| found.iter().map(|report| report.batch.number).collect::<Vec<_>>();
    let now = i64::from(many) * 100 + 99;
    assert_eq!(numbers(&batches(&store, 250, 401, 9, now)), [4, 3, 2]);
    assert_eq!(numbers(&batches(&store, 260, 400, 9, now)), [3], "its end is not in it, nor its begin");
    assert_eq!(numbers(&batches(&store, 0, now, 2, now)), [many, many - 1]);
    let figures = |limit| batches(&store, 0, now, limit, now).iter().all(|report| report.alarms.is_some());
    assert_eq!((figures(BATCHES_MAX), figures(BATCHES_MAX + 1)), (true, false));
    let refused = store.answer(&Query::Batches { from: sec(9), to: sec(9), limit: 1 }, sec(now));
    assert_eq!(refused, Err(HistoryError::EmptyPeriod));
}

#[test]
fn a_batch_whose_rule_is_taken_away_does_not_run_for_ever() {
    let (_folder, db) = folder();
    station(&db, &making(), 1_030..1_050, 0..0);
    let def = Arc::new(PlantDef { batches: Vec::new(), ..PlantDef::clone(&making()) });
    station(&db, &def, 1_100..1_110, 0..0);
    let store = Store::open_read_only(&db, &def).unwrap();
    let found = batches(&store, 0, 2_000, 50, 2_000);
    let end = found[0].batch.to.map(|at| at.as_second());
    assert!((1_049..=1_050).contains(&end.unwrap()) && !found[0].batch.seen.1, "when its station ended: {end:?}");
    assert_eq!(batches(&store, 1_500, 2_000, 50, 2_000), []);
}
