//! What is asked while an hour moves from the database into the archive, and of what moved.

use super::{
    archive::{HOUR_S, archive_all, filled},
    *,
};
use crate::history::{io::archive::Job, tiers::HOUR};

#[test]
fn an_hour_is_never_missing_while_it_is_archived() {
    let (_folder, db) = folder();
    let hours = 60;
    let records: Vec<Record> = (0..hours * HOUR_S / 30).map(|n| good(PV, 30 * n, n as f64)).collect();
    let store = filled(&db, &records);
    let reader = store.try_clone().unwrap();
    use std::sync::atomic::{AtomicI64, Ordering::Relaxed};
    let done = Arc::new(AtomicI64::new(0));
    let at_work = Arc::clone(&done);
    let asking = std::thread::spawn(move || {
        let (mut asked, mut wrong) = (0, Vec::new());
        loop {
            let hour = at_work.load(Relaxed);
            if hour >= hours - 1 {
                return (asked, wrong);
            }
            let (from, to) = (sec(hour * HOUR_S), sec((hour + 1) * HOUR_S));
            // One that is refused while the archive changes is asked again.
            let answer = reader.answer(&Query::Samples { epoch: None, from, to }, sec(hours * HOUR_S));
            let Ok(Answer::Samples(samples)) = answer else { continue };
            asked += 1;
            wrong.extend((samples.samples.len() != 120).then_some((hour, samples.samples.len())));
        }
    });
    for hour in 0..hours - 1 {
        done.store(hour, Relaxed);
        store.archive(&Job::Hour(hour * HOUR)).unwrap();
    }
    done.store(hours, Relaxed);
    let (asked, wrong) = asking.join().unwrap();
    assert!(0 < asked && wrong.is_empty(), "of {asked} answers {} lack their hour: {wrong:?}", wrong.len());
}

#[test]
fn sql_gives_each_sample_the_unit_that_it_was_stored_in() {
    use crate::history::io::tables::Tables;
    let (_folder, db) = folder();
    let store = open(&db, 0);
    store.append(&(0..30).map(|n| good(PV, 60 * n, 20.0)).collect::<Vec<_>>()).unwrap();
    drop(store);
    // The plant file changes the unit of PV.
    let mut other = plant("Asia/Bangkok", &THREE);
    let (name, old) = (other.tags[0].name.clone(), other.tags[0].unit.clone());
    other.tags[0].unit = "°F".into();
    let other = Arc::new(other);
    let store = Store::open(&db, &other, sec(1_900)).unwrap().store;
    store.append(&(0..30).map(|n| good(PV, 2_000 + 60 * n, 68.0)).collect::<Vec<_>>()).unwrap();
    archive_all(&store, 3);
    let Answer::Overview(overview) = store.answer(&Query::Overview, sec(3 * HOUR_S)).unwrap() else { panic!() };
    let scratch = tempfile::tempdir().unwrap();
    let tables = Tables::new(&other, &overview, scratch.path()).unwrap();
    let select = format!("SELECT DISTINCT value || ' ' || unit FROM sample WHERE tag = '{name}' ORDER BY 1");
    let rows: Vec<_> = tables.rows(&select, 9).unwrap().1.into_iter().flatten().flatten().collect();
    assert_eq!(rows, [format!("20.0 {old}"), "68.0 °F".to_owned()]);
}
