//! A plant file or a users file that was reloaded.

use std::sync::Arc;

use tokio::sync::{mpsc, oneshot};

use super::SessionServer;
use crate::{
    access::Users, bus::io::live_reads::LiveRequest, history::io::QueryRequest, plant::PlantDef,
    station::session::Request,
};

/// What a reload has for the sessions.
#[derive(Debug)]
pub struct Reload {
    /// Another definition of the plant.
    pub plant: Option<NewPlant>,
    /// The users of the file.
    pub users: Option<NewUsers>,
    /// Gets the digest of the users, if they were taken.
    pub done: oneshot::Sender<Option<String>>,
}

/// Another definition of the plant, and where its requests go.
#[derive(Debug)]
pub struct NewPlant {
    /// The definition.
    pub def: Arc<PlantDef>,
    /// The run of it.
    pub run: u64,
    /// Live reads, to each line.
    pub live: Vec<mpsc::Sender<LiveRequest>>,
    /// Queries with the ids of the definition; `None` where these are those of before.
    pub queries: Option<mpsc::Sender<(u32, QueryRequest)>>,
    /// Requests from outside go on.
    pub keeps_delegate: bool,
}

/// Users that were read from their file.
#[derive(Debug)]
pub struct NewUsers {
    /// The digest of the users of the station before they were read.
    pub before: Option<String>,
    /// They.
    pub users: Users,
}

impl SessionServer {
    /// Goes on with what was reloaded, once everything that was asked of the plant as it was has been taken in.
    pub(super) async fn reload(
        &mut self,
        Reload { plant, users, done }: Reload,
        requests: &mut mpsc::Receiver<(u32, Request)>,
    ) {
        if plant.as_ref().is_some_and(|plant| !plant.keeps_delegate) {
            self.delegate_left().await;
        }
        for _ in 0..requests.len() {
            let Ok((terminal, request)) = requests.try_recv() else { break };
            self.on_session_message(terminal, request);
        }
        let now = self.clock.now();
        if let Some(NewPlant { def, run, live, queries, keeps_delegate }) = plant {
            let effects = self.access.redefine(def, run, keeps_delegate, now);
            self.outputs.live = live;
            if let Some(queries) = queries {
                self.outputs.queries = queries;
            }
            self.apply_effects(effects);
        }
        let taken = users.and_then(|NewUsers { before, users }| {
            let effects = self.access.take_users(before.as_deref(), users, now)?;
            self.apply_effects(effects);
            self.access.users_digest()
        });
        // A station that stops meanwhile waits for nothing.
        let _ = done.send(taken);
    }
}
