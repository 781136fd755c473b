//! Another definition of the plant while its history is written: no value is stored under the tag of another.

use super::*;

/// The plant without its first tag: every other one has another id.
fn without_pv() -> Arc<PlantDef> {
    let mut def = PlantDef::clone(&def());
    def.tags.remove(PV.index());
    (0..).map(TagId).zip(&mut def.tags).for_each(|(id, tag)| tag.id = id);
    Arc::new(def)
}

/// Ends the writer; what was stored of PV and of SV, as they were, in each of the first two seconds, and how many records
/// were lost.
fn stored(mut writer: Writer, db: &Path) -> ([Option<f64>; 2], [Option<f64>; 2], u64) {
    writer.finish(sec(2));
    let lost = writer.status().lost;
    drop(writer);
    let store = Store::open_read_only(db, &def()).unwrap();
    let of = |tag| means(&store, tag, 0, 2, 2).try_into().unwrap();
    (of(PV), of(SV), lost)
}

#[test]
fn what_follows_another_definition_is_stored_under_its_ids() {
    let (_folder, db) = folder();
    let mut writer = Writer::open(db.clone(), def(), sec(0)).unwrap();
    writer.accept(vec![good(PV, 0, 27.0), good(SV, 0, 70.0)]);
    writer.redefine(without_pv(), None, sec(1));
    writer.accept(vec![good(PV, 1, 71.0)]);
    assert_eq!(stored(writer, &db), ([Some(27.0); 2], [Some(70.0), Some(71.0)], 0));
}

#[test]
fn what_waits_for_a_store_keeps_its_tag() {
    let (_folder, db) = folder();
    let mut writer = Writer::new(db.clone(), def(), sec(0));
    // It is being opened for the plant as it was.
    let opener = writer.opener(sec(0));
    writer.accept(vec![good(PV, 0, 27.0), good(SV, 0, 70.0)]);
    writer.redefine(without_pv(), None, sec(1));
    writer.opened(opener(), sec(1));
    writer.accept(vec![good(PV, 1, 71.0)]);
    // There is no such tag as PV any more.
    assert_eq!(stored(writer, &db), ([None; 2], [Some(70.0), Some(71.0)], 1));
}

#[test]
fn a_tag_that_is_new_is_stored() {
    let (_folder, db) = folder();
    let mut writer = Writer::open(db.clone(), without_pv(), sec(0)).unwrap();
    writer.accept(vec![good(PV, 0, 70.0)]);
    writer.redefine(def(), None, sec(1));
    writer.accept(vec![good(PV, 1, 27.0), good(SV, 1, 71.0)]);
    assert_eq!(stored(writer, &db), ([None, Some(27.0)], [Some(70.0), Some(71.0)], 0));
}
