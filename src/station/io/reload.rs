//! A reload: what is as it was keeps running, all else ends and starts again.
//!
//! ```text
//!   prepare ──> lines that change end ──> lines with other ──> sessions ──> plant ──> history      lines and outlets that
//!               (the others are polled)   devices pause        go         goes on under the new    changed start or go on
//!                                                                         definition
//! ```

use std::sync::Arc;

use futures_util::future::join_all;
use tokio::sync::{mpsc, oneshot};

use super::{Line, Outlet, Station};
use crate::{
    access::Users,
    bus::io::{transport::Connector, worker::spawn_blocking},
    history::io::{
        QueryRequest,
        reader::Queries,
        thread::{HistoryInput, QUERIES_MAX},
    },
    plant::{
        PlantDef,
        def::{DeviceId, LineId},
        line_finding::DeviceFinding,
        losses::Loss,
    },
    profile::PlantFile,
    station::{
        found::FoundFile,
        plant_task,
        session_server::{self, NewUsers},
    },
};

/// This many of what ends are named in the audit log; the journal of alarms has them all.
const NAMED_MAX: usize = 50;

/// What was read from plant file and users file.
#[derive(Debug)]
pub struct Reloaded {
    /// The plant.
    pub def: Arc<PlantDef>,
    /// How each line is opened, by [`LineId`].
    pub connectors: Vec<Connector>,
    /// The file that settings are saved into.
    pub file: Option<PlantFile>,
    /// The users, and the digest of those of the station before they were read; `None` without login.
    pub users: Option<(Option<String>, Users)>,
}

/// A reload that can be carried out.
#[derive(Debug)]
pub struct PreparedReload {
    new: Reloaded,
    /// The plant has another definition.
    changes: bool,
    /// A place in the queue to the history.
    place: Option<mpsc::OwnedPermit<HistoryInput>>,
    /// What keeps running and what starts again, in words.
    pub summary: String,
}

impl Station {
    /// Compares what was read with what runs; `None`: it is the same, nothing is to be done. `Err` says why it cannot be done
    /// now.
    pub fn prepare_reload(&self, new: Reloaded) -> Result<Option<PreparedReload>, String> {
        let changes = *new.def != *self.def;
        let is_news = |(before, users): &(Option<String>, Users)| *before != Some(users.digest());
        let users = new.users.as_ref().is_some_and(is_news);
        if !changes && !users {
            return Ok(None);
        }
        let store = self.senders.store.as_ref().filter(|_| changes);
        let place = store.map(|(records, _)| records.clone().try_reserve_owned());
        let place = place.transpose().map_err(|_| "not reloaded: the history is too busy, try again".to_owned())?;
        let mut summary = self.def.changed_lines(&new.def);
        summary.push_str(&named(&self.acceptor.snapshots.borrow().losses(&new.def)));
        if users {
            summary.push_str("; the users file is read again");
        }
        Ok(Some(PreparedReload { new, changes, place, summary }))
    }

    /// Ends what changes; the rest keeps running. A procedure that cannot go on gets its safe state first. May be given up for
    /// a stop.
    pub async fn end_what_changes(&mut self, prepared: &PreparedReload) {
        let (before, def) = (self.def.clone(), &prepared.new.def);
        let at_work = self.acceptor.snapshots.borrow().procedure_at_work().map(|(id, _)| id);
        if at_work.is_some_and(|id| !before.keeps_procedure(def, id)) {
            self.abort_procedure().await;
        }
        self.north.iter().filter(|_| !keeps_north(&before, def)).for_each(Outlet::stop);
        let ids = (0..).map(LineId);
        let changed = self.lines.iter_mut().zip(ids).filter(|(_, id)| !before.keeps_line(def, *id));
        let ports: Vec<LineId> = def.lines.iter().filter_map(|line| before.same_port(def, line.id)).collect();
        let (pausing, ending): (Vec<_>, Vec<_>) = changed.partition(|(_, id)| ports.contains(id));
        ending.iter().for_each(|(line, _)| line.stop());
        for (line, _) in ending {
            line.ended().await;
        }
        // These are polled until the others have ended.
        join_all(pausing.into_iter().map(|(line, _)| line.pause())).await;
    }

    /// Goes on with what was read, once what changes has ended.
    pub async fn reload(&mut self, prepared: PreparedReload) {
        let PreparedReload { new: Reloaded { def, connectors, file, users }, changes, place, summary } = prepared;
        let before = self.def.clone();
        let (mut for_sessions, mut for_plant) = (None, None);
        if changes {
            let run = self.clock.now().as_microsecond().cast_unsigned().max(self.run + 1);
            self.take_lines(&def);
            let queries = self.queries_for(&def);
            let (sender, queue) = queries.unzip();
            let live = self.lines.iter().map(|line| line.live.clone()).collect();
            let keeps_delegate = keeps_north(&before, &def);
            for_sessions =
                Some(session_server::NewPlant { def: def.clone(), run, live, queries: sender, keeps_delegate });
            let links = self.lines.iter().map(|line| line.requests.clone()).collect();
            let history = place.map(|place| (place, queue));
            for_plant = Some(plant_task::NewPlant { def: def.clone(), run, links, file, history, summary });
            (self.def, self.run) = (def, run);
        }
        // In this order: no request is permitted for the plant as it was once the plant is another.
        let users = users.map(|(before, users)| NewUsers { before, users });
        let (done, sessions_done) = oneshot::channel();
        let to_sessions = session_server::Reload { plant: for_sessions, users, done };
        // Tasks that have ended go on with nothing.
        let _ = self.senders.sessions.send(to_sessions).await;
        let users = sessions_done.await.ok().flatten();
        let (done, plant_done) = oneshot::channel();
        let _ = self.senders.plant.send(plant_task::Reload { plant: for_plant, users, done }).await;
        let _ = plant_done.await;
        if changes {
            let found = self.found().await;
            for ((line, def), connector) in self.lines.iter_mut().zip(&self.def.lines).zip(connectors) {
                line.start(&self.def, def.id, self.clock, connector, &self.senders.events, &found);
            }
            self.start_outlets(keeps_north(&before, &self.def));
        }
    }

    /// What is kept of what was found of devices.
    async fn found(&self) -> Vec<(DeviceId, DeviceFinding)> {
        let history = self.senders.history_file.clone();
        let file = spawn_blocking(move || FoundFile::open(&history)).await;
        file.map(|file| file.of(&self.def)).unwrap_or_default()
    }

    /// The lines of another definition: those that keep running, those that pause, and others that are not started yet.
    fn take_lines(&mut self, def: &PlantDef) {
        let mut before: Vec<Option<Line>> = self.lines.drain(..).map(Some).collect();
        let mut kept = |id: LineId| {
            if self.def.keeps_line(def, id) {
                return before.get_mut(id.index())?.take();
            }
            before.get_mut(self.def.same_port(def, id)?.index())?.take()?.with_other_queues()
        };
        self.lines = def.lines.iter().map(|line| line.id).map(&mut kept).map(Option::unwrap_or_default).collect();
    }

    /// Another queue to the history, where the queries of before would mean other tags.
    fn queries_for(&mut self, def: &PlantDef) -> Option<(mpsc::Sender<(u32, QueryRequest)>, Queries)> {
        let history = self.history.as_mut().filter(|_| !self.def.keeps_ids(def))?;
        let (sender, queries) = mpsc::channel(QUERIES_MAX);
        self.senders.queries = sender.clone();
        history.queries = sender.clone();
        Some((sender, queries))
    }
}

/// What ends or goes on under another name, after what becomes of the lines.
fn named(losses: &[Loss]) -> String {
    let more = losses.len().saturating_sub(NAMED_MAX);
    let mut words: String = losses.iter().take(NAMED_MAX).map(|loss| format!("; {loss}")).collect();
    if 0 < more {
        words.push_str(&format!("; and {more} more, see the journal"));
    }
    words
}

/// Does the data out go on as it is?
pub(super) fn keeps_north(before: &PlantDef, def: &PlantDef) -> bool {
    before.north == def.north && before.devices == def.devices && before.tags == def.tags
}
