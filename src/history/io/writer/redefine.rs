//! The plant has another definition: what is stored from here on has its ids.

use std::{mem::replace, sync::Arc};

use jiff::Timestamp;

use super::{HandedOver, Queries, Writer};
use crate::plant::{
    def::{PlantDef, TagId},
    record::Record,
};

impl Writer {
    /// Goes on with another definition. What came before it is stored under the ids that it has; where it cannot be stored now,
    /// it waits under the new ones. `queries` have these ids, those before had others.
    pub fn redefine(&mut self, def: Arc<PlantDef>, queries: Option<Queries>, now: Timestamp) {
        self.commit(now);
        let before = replace(&mut self.def, def);
        let waited = self.pending.len();
        self.pending.retain_mut(|record| renumber(record, &before, &self.def));
        self.status.lost += (waited - self.pending.len()) as u64;
        self.redefine_store();
        self.send_to_reader(HandedOver { store: self.clone_for_reader(), queries });
        self.describe();
    }

    /// Gives the store the definition, if it has another one: it may have been opened meanwhile.
    pub(super) fn redefine_store(&mut self) {
        let Some(store) = self.store.as_mut().filter(|store| !Arc::ptr_eq(&store.def, &self.def)) else { return };
        if let Err(error) = store.redefine(&self.def) {
            // It is opened again, and asked for the same.
            self.close();
            self.fail(&error);
        }
    }
}

/// Gives a sample the id that its tag has in another definition; `false` if it has none there.
fn renumber(record: &mut Record, before: &PlantDef, def: &PlantDef) -> bool {
    let Record::Sample(tag, _) = record else { return true };
    let was = before.tag(*tag);
    // The history knows a tag by name and unit.
    let is_it = |id: &TagId| def.tag(*id).unit == was.unit;
    match def.tag_named(&was.name).filter(is_it) {
        Some(id) => {
            *tag = id;
            true
        }
        None => false,
    }
}
