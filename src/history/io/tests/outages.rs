//! When no station recorded, when devices did not answer, and what is not kept any more.

use super::{
    archive::{HOUR_S, archive_all},
    counts::{self, counted, report},
    *,
};
use crate::{
    history::{io::archive::LeftOut, tiers::Tier},
    plant::{
        def::{Condition, HistoryDef, Subject},
        fixture,
    },
    report::{
        Outage,
        coarse::{Coarse, Kept},
    },
};

fn off(outages: &[Outage]) -> Vec<(i64, i64)> {
    let station = outages.iter().filter(|outage| outage.what.is_none());
    station.map(|outage| (outage.from.as_second(), outage.to.as_second())).collect()
}

#[test]
fn a_station_that_was_off_stands_in_the_report_to_the_second() {
    let (_folder, db) = folder();
    let minutes = |from: i64, to: i64| (from..to).map(|minute| good(PV, 60 * minute, 1.0)).collect::<Vec<_>>();
    let store = open(&db, 0);
    store.append(&minutes(0, 61)).unwrap();
    // It ends in order after 1:00:07, is off for 19 minutes, then it is killed, and starts again within a minute.
    store.mark_station_off(sec(3_607)).unwrap();
    drop(store);
    let store = open(&db, 4_747);
    store.append(&[vec![good(PV, 4_747, 1.0)], minutes(80, 100)].concat()).unwrap();
    drop(store);
    let outages = |store: &Store, from, to| off(&report(store, from, to).outages);
    let all = [(3_607, 4_747)];
    let read_only = Store::open_read_only(&db, &def()).unwrap();
    assert_eq!(outages(&read_only, 0, 7_200), [all[0], (5_941, 7_200)]);
    drop(read_only);
    let store = open(&db, 5_961);
    store.append(&minutes(100, 240)).unwrap();
    for archived in [0, 6] {
        archive_all(&store, archived);
        assert_eq!(outages(&store, 0, 4 * HOUR_S), [all[0], (5_941, 6_000)], "archived to hour {archived}");
        assert_eq!(outages(&store, 4_000, 4_500), [(4_000, 4_500)]);
    }
    // A computer that slept writes nothing either.
    store.append(&minutes(300, 310)).unwrap();
    assert_eq!(outages(&store, 14_000, 18_600), [(14_340, 18_000)]);
}

#[test]
fn an_overview_lists_when_no_station_recorded() {
    let (_folder, db) = folder();
    let store = open(&db, 0);
    store.append(&[good(PV, 10, 1.0), good(PV, 70, 1.0), good(PV, 1_210, 1.0)]).unwrap();
    let Answer::Overview(overview) = store.answer(&Query::Overview, sec(1_300)).unwrap() else { panic!() };
    assert_eq!(overview.pauses, [(sec(70), sec(1_210))]);
}

#[test]
fn a_silent_device_is_listed_with_its_cause_to_the_second() {
    use AlarmEvent::{Raised, ReturnedToNormal};
    let mut def = fixture::plant();
    let device = &def.devices[0];
    let (subject, name) = (Subject::Device(device.id), device.name.clone());
    let alarm = def.alarms.iter_mut().find(|alarm| alarm.condition == Condition::NotResponding).unwrap();
    (alarm.subject, alarm.on_delay) = (subject, Duration::from_secs(3));
    let message = alarm.message.clone();
    let tags: Vec<TagId> = def.tags_of(device.id).filter(|tag| tag.is_stored()).map(|tag| tag.id).collect();
    let (_folder, db) = folder();
    let store = Store::open(&db, &Arc::new(def), sec(0)).unwrap().store;
    let all = |at: i64, quality: Option<Cause>| {
        let sample = quality.map_or(Sample::good(1.0, sec(at)), |cause| Sample::bad(cause, sec(at)));
        tags.iter().map(|tag| Record::Sample(*tag, sample)).collect::<Vec<_>>()
    };
    let event = |at: i64, event| {
        let subject = name.as_str().into();
        Record::Alarm(AlarmRecord { subject, message: message.as_str().into(), ..step(at, "", event) })
    };
    let records = [
        (0..10).flat_map(|minute| all(60 * minute, None)).collect(),
        // It is silent from 601 on, and its line is lost from 2,001 on.
        [all(601, Some(Cause::Timeout)), all(605, Some(Cause::DeviceDown)), vec![event(609, Raised)]].concat(),
        [all(1_000, None), vec![event(1_000, ReturnedToNormal)], all(1_060, None)].concat(),
        [all(2_001, Some(Cause::NotConnected)), vec![event(2_004, Raised)]].concat(),
        (34..60).map(|minute| Record::Line(minute_of(60 * minute))).collect(),
        [vec![event(3_600, ReturnedToNormal)], all(3_600, None)].concat(),
    ];
    store.append(&records.concat()).unwrap();
    let Answer::Report(report) =
        store.answer(&Query::Report { period: Period::free(sec(0), sec(3_660)) }, sec(3_660)).unwrap()
    else {
        panic!()
    };
    let devices = report.outages.iter().filter(|outage| outage.what.is_some());
    let got: Vec<_> =
        devices.map(|outage| (outage.from.as_second(), outage.to.as_second(), outage.why.as_str())).collect();
    assert_eq!(got, [(601, 1_000, message.as_str()), (2_001, 3_600, "line not connected")]);
}

fn minute_of(at: i64) -> LineMinute {
    minute("L1", at, 60)
}

#[test]
fn beyond_retention_a_report_says_so_and_edges_keep_their_share() {
    let (_folder, db) = folder();
    let def = |rule| {
        let mut def = PlantDef::clone(&counts::def());
        def.history = rule;
        Arc::new(def)
    };
    let day = 24 * HOUR_S;
    let rule = HistoryDef {
        keep_samples_days: Some(7),
        keep_minutes_days: Some(9),
        disk_free_mib_min: 0,
        ..HistoryDef::default()
    };
    let store = Store::open(&db, &def(rule), sec(0)).unwrap().store;
    let values = |minute: i64| [good(PV, 60 * minute, 1_000.0 + minute as f64), good(SV, 60 * minute, 1.0)];
    store.append(&(0..60 * 74).flat_map(values).collect::<Vec<_>>()).unwrap();
    archive_all(&store, 74);
    let before = report(&store, 0, 74 * HOUR_S);
    assert_eq!(before.coarse, []);
    let now = sec(10 * day);
    while let Some(job) = store.archive_due(now, &LeftOut::default()).unwrap() {
        store.archive(&job).unwrap();
    }
    let [raw, minutes] = [Tier::Raw, Tier::Minute].map(|tier| store.deleted_until(tier).unwrap().unwrap());
    assert_eq!((raw, minutes), (sec(3 * day), sec(day)));
    let whole = report(&store, 0, 74 * HOUR_S);
    let coarse = |from, to, kept| Coarse { from: sec(from), to: sec(to), kept };
    assert_eq!(
        whole.coarse,
        [coarse(0, day, Kept::Hours), coarse(day, 3 * day, Kept::Minutes)],
        "the last hours have samples"
    );
    assert_eq!((counted(&whole, PV), counted(&before, PV)), (60.0 * 74.0 - 1.0, 60.0 * 74.0 - 1.0));
    // Edges within minutes that are kept, and within hours where minutes are not.
    for edge in [day + 5 * HOUR_S + 30, 5 * HOUR_S + 30, 5 * HOUR_S + 1_845] {
        let parts = [report(&store, HOUR_S, edge), report(&store, edge, 70 * HOUR_S)];
        assert_eq!(parts.iter().map(|part| counted(part, PV)).sum::<f64>(), 60.0 * 69.0, "cut at {edge}");
        for part in parts {
            let good = [part.tags[0].good, part.runs[0].good];
            assert!(good.iter().all(|good| 1.0 - good < 1e-9), "cut at {edge}: {good:?}");
        }
    }
    let gone = HistoryDef { keep_hours_days: Some(31), ..rule };
    drop(store);
    let store = Store::open(&db, &def(gone), sec(70 * day)).unwrap().store;
    while let Some(job) = store.archive_due(sec(70 * day), &LeftOut::default()).unwrap() {
        store.archive(&job).unwrap();
    }
    assert_eq!(report(&store, 0, day).coarse, [coarse(0, day, Kept::Nothing)]);
}

#[test]
fn what_a_clock_was_set_forward_over_is_no_time_in_alarm() {
    let (_folder, db) = folder();
    let store = open(&db, 0);
    let minutes = |from: i64, to: i64| (from..to).map(|minute| good(PV, 60 * minute, 1.0));
    let event = |minute: i64, event| Record::Alarm(step(60 * minute, "high", event));
    let mut records: Vec<Record> = minutes(0, 10).collect();
    records.extend([event(8, AlarmEvent::Raised), Record::ClockSet]);
    records.extend(minutes(70, 80));
    records.push(event(72, AlarmEvent::ReturnedToNormal));
    store.append(&records).unwrap();
    let report = report(&store, 0, 4_800);
    let of = report.tags.iter().find(|figures| figures.tag == "TIC-1.PV").expect("it is in the report");
    // From minute 8 to the last sample before the step, and from the first one after it.
    assert_eq!(of.in_alarm.as_secs(), 60 + 120);
}

#[test]
fn a_clock_that_is_set_forward_is_no_station_that_was_off() {
    let (_folder, db) = folder();
    let store = open(&db, 0);
    let minutes = |from: i64, to: i64| (from..to).map(|minute| good(PV, 60 * minute, 1.0));
    let records = minutes(0, 10).chain([Record::ClockSet]).chain(minutes(70, 80));
    store.append(&records.collect::<Vec<_>>()).unwrap();
    let outages = report(&store, 0, 4_800).outages;
    let got: Vec<_> = outages.iter().map(|of| (of.from.as_second(), of.to.as_second(), of.why.as_str())).collect();
    assert_eq!(got, [(540, 4_200, "clock set forward")]);
    let Answer::Overview(overview) = store.answer(&Query::Overview, sec(4_800)).unwrap() else { panic!() };
    assert_eq!(overview.pauses, []);
}
