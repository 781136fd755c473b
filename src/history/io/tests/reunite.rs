//! What was set aside comes back, with what was recorded since.

use std::fs;

use super::{
    super::{files::SetAside, restore, reunite},
    *,
};

fn entry(at: i64, number: u64) -> Record {
    Record::Action(ActionRecord { chain_hash: Some(ChainHash { number, hash: [7; 32] }), ..action(at) })
}

#[test]
fn what_was_set_aside_comes_back_with_what_followed() {
    let (folder, db) = folder();
    let alarm = |at, event| Record::Alarm(step(at, "high", event));
    let other = TagId(2);
    // Set aside twice, the second time in the same second; something that is none is set aside with them.
    for at in [0, 100] {
        open_anyhow(&db)
            .append(&[good(PV, at, 20.0), alarm(at, AlarmEvent::Raised), entry(at, at as u64 + 1)])
            .unwrap();
        files::set_aside(&db, SetAside::Everything, sec(150)).unwrap();
    }
    fs::write(&db, "nonsense").unwrap();
    let nonsense = files::set_aside(&db, SetAside::Everything, sec(150)).unwrap();
    // The audit log has completed what it knew of.
    let store = open_anyhow(&db);
    let since = [good(other, 200, 5.0), good(PV, 200, 30.0), alarm(200, AlarmEvent::ReturnedToNormal)];
    store.append(&since).unwrap();
    store.append(&[entry(100, 101), entry(200, 201)]).unwrap();
    drop(store);
    let before = fs::read(&db).unwrap();
    let reunited = reunite::prepare(&db, sec(300)).unwrap();
    assert_eq!(fs::read(&db).unwrap(), before);
    assert_eq!((reunited.sound.len(), reunited.rows), (2, 6));
    assert_eq!(reunited.damaged.iter().map(|(path, _)| path).collect::<Vec<_>>(), [&nonsense]);
    restore::commit(&db).unwrap();
    assert_eq!(restore::finish(&db).unwrap(), Some(reunited.aside.clone()));
    let store = open(&db, 300);
    // Each ended where it was set aside.
    assert_eq!(means(&store, PV, 0, 10, 10)[..3], [Some(20.0), None, None]);
    assert_eq!([100, 200].map(|at| means(&store, PV, at, at + 1, 1)), [[Some(20.0)], [Some(30.0)]]);
    assert_eq!(means(&store, other, 200, 201, 1), [Some(5.0)]);
    assert!(store.restore().unwrap().iter().any(|event| event.at == sec(200)), "the latest event counts");
    let numbers = "SELECT string_agg(number::VARCHAR, ' ' ORDER BY rowid) FROM operator_action";
    assert_eq!(store.db.query_row(numbers, [], |row| row.get::<_, String>(0)).unwrap(), "1 101 201");
    // The old files are kept, and nothing comes back twice.
    assert_eq!(fs::read_dir(&reunited.aside).unwrap().count(), 4, "three files and a last commit");
    drop(store);
    assert!(reunite::prepare(&db, sec(400)).unwrap().sound.is_empty());
    assert!(folder.path().read_dir().unwrap().flatten().all(|entry| !entry.path().ends_with("tank.restoring.new")));
}

/// Whatever is said of the file before.
fn open_anyhow(db: &Path) -> Store {
    let store = Store::open(db, &def(), sec(0)).unwrap().store;
    store.checkpoint().unwrap();
    store
}
