//! A plant file or a users file that was reloaded: the plant goes on under its new definition.

use std::sync::Arc;

use tokio::sync::{mpsc, oneshot};

use super::PlantTask;
use crate::{
    access::Users,
    history::io::{
        open::Restored,
        reader::Queries,
        thread::{Definition, HistoryInput},
    },
    plant::{
        PlantDef, Redefined, SetWork,
        command::{BusRequest, CommandStatus},
        event::Event,
        station_fault::{FaultState, StationFault},
    },
    profile::PlantFile,
    station::{audit_queue::AuditMessage, entries, past::Past},
};

/// Said of the users file where the audit log knows of users.
pub(in crate::station) const USERS_MISSING: &str =
    "the users file is missing although users existed: restore it from a backup";

/// What comes to the task.
pub(in crate::station) struct Inputs {
    pub events: mpsc::Receiver<Event>,
    pub commands: mpsc::Receiver<CommandStatus>,
    pub messages: mpsc::Receiver<AuditMessage>,
    pub reloads: mpsc::Receiver<Reload>,
}

/// What a reload has for the plant.
pub(in crate::station) struct Reload {
    /// Another definition.
    pub plant: Option<NewPlant>,
    /// The digest of the users that were taken from their file.
    pub users: Option<String>,
    /// Answered when the plant goes on with both.
    pub done: oneshot::Sender<()>,
}

/// Another definition of the plant, and what goes with it.
pub(in crate::station) struct NewPlant {
    /// The definition.
    pub def: Arc<PlantDef>,
    /// The run of it.
    pub run: u64,
    /// By line; those of lines that keep running are what they were.
    pub links: Vec<mpsc::Sender<BusRequest>>,
    /// The plant file.
    pub file: Option<PlantFile>,
    /// A place in the queue to the history, and the queries that know the definition.
    pub history: Option<(mpsc::OwnedPermit<HistoryInput>, Option<Queries>)>,
    /// What follows, for the record.
    pub summary: String,
}

impl PlantTask {
    /// Goes on with what was reloaded, once everything that was said of the plant as it was has been taken in.
    pub(super) fn reload(&mut self, Reload { plant, users, done }: Reload, inputs: &mut Inputs) {
        for _ in 0..inputs.events.len() {
            let Ok(event) = inputs.events.try_recv() else { break };
            let effects = self.plant.on_event(event);
            self.apply_effects(effects);
        }
        for _ in 0..inputs.commands.len() {
            let Ok(status) = inputs.commands.try_recv() else { break };
            self.on_command(status);
        }
        if let Some(digest) = users {
            let had_users = self.persistence.audit.as_mut().is_some_and(|audit| audit.files().had_users());
            let missing = had_users && digest == Users::default().digest();
            let state = if missing { FaultState::Occurred(USERS_MISSING.into()) } else { FaultState::Cleared };
            self.plant.on_fault(StationFault::UsersFile, state);
            let now = self.clock.utc();
            let found = self.persistence.audit.as_mut().and_then(|audit| audit.files().users_file(digest, now));
            self.send_to_audit_log(found.into_iter().collect(), Vec::new());
        }
        if let Some(plant) = plant {
            self.redefine(plant);
        }
        // A station that stops meanwhile waits for nothing.
        let _ = done.send(());
    }

    fn redefine(&mut self, NewPlant { def, run, links, file, history, summary }: NewPlant) {
        let Redefined { ended, begun, standing } = self.plant.redefine(&def, run, self.clock.now());
        self.apply_effects(ended);
        self.keep_standing(standing);
        self.links = links;
        match history {
            Some((place, queries)) => {
                let restored = self.await_followed();
                place.send(HistoryInput::Definition(Definition { def: def.clone(), queries, restored }));
            }
            // There is no history that they could go on from.
            None => self.plant.restore_totals(&[]),
        }
        self.apply_effects(begun);
        let now = self.clock.utc();
        let changed = file.as_ref().zip(self.persistence.audit.as_mut());
        let changed = changed.and_then(|(file, audit)| audit.files().plant_file(file, now));
        let entries = [entries::reloaded(&def.name, &summary, now)].into_iter().chain(changed).collect();
        self.send_to_audit_log(entries, Vec::new());
        self.file = file;
        self.file_sets(SetWork::Read);
    }

    /// Lets the history say what the plant goes on from in what it follows from here on. What a start still awaits says the same.
    fn await_followed(&mut self) -> Option<oneshot::Sender<Restored>> {
        if self.persistence.past.is_some() {
            return None;
        }
        let (sender, restored) = oneshot::channel();
        self.persistence.past = Some(Past::of_new_definition(restored));
        Some(sender)
    }
}
