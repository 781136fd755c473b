//! Where a command reads the history: from the station while it runs, else from the file.

use std::{path::PathBuf, sync::Arc};

use jiff::Timestamp;
use tokio::sync::oneshot;

use crate::{
    history::{
        Answer, HistoryError, Question,
        io::{Query, store::Store},
    },
    plant::PlantDef,
    report::{Period, ask},
    station::Session,
};

use super::{CliError, StationArgs, client, run};

/// A history that can be asked.
pub enum Source {
    /// Through its station.
    Station(Box<Session>),
    /// From the file, which nobody else has open.
    File {
        /// The file.
        store: Box<Store>,
        /// Up to when it is read: now, or what a demonstration that ran ahead of time has stored.
        until: Timestamp,
    },
}

impl Source {
    /// The history of a plant. A file that is named is read as a file.
    pub async fn open(def: &Arc<PlantDef>, args: &StationArgs, login: &client::Login) -> Result<Source, CliError> {
        if args.history.is_none() && client::place(Some(&def.name)).await.is_ok() {
            let session = client::attach(Some(&def.name), login).await?;
            if !session.standing.borrow().view {
                let why = "the station of this plant runs: log in to ask it, --user NAME asks for the password";
                return Err(CliError::Failed(why.to_owned()));
            }
            return Ok(Source::Station(Box::new(session)));
        }
        let path: PathBuf = run::history_file(def, args);
        let store = Store::open_read_only(&path, def).map_err(|error| match error {
            error @ HistoryError::Locked { .. } => CliError::InUse(error),
            other => CliError::History(other),
        })?;
        let now = Timestamp::now();
        let until = store.extent().map_or(now, |(_, last)| last.max(now));
        Ok(Source::File { store: Box::new(store), until })
    }

    /// The time of the plant: a demonstration may have run ahead of time.
    pub fn now(&self) -> Timestamp {
        match self {
            Source::Station(session) => session.snapshots.borrow().at,
            Source::File { until, .. } => *until,
        }
    }

    /// The period that was asked for.
    pub fn period(
        &self,
        def: &PlantDef,
        shift: Option<&str>,
        from: Option<&str>,
        to: Option<&str>,
    ) -> Result<Period, CliError> {
        ask::period(def, shift, from, to, self.now()).map_err(|error| CliError::Usage(error.to_string()))
    }

    /// Asks.
    pub async fn ask(&self, question: Question) -> Result<Answer, CliError> {
        match self {
            Source::File { store, until } => Ok(store.answer(&question, *until)?),
            Source::Station(session) => {
                let (reply, answer) = oneshot::channel();
                session.ask(Query { question, reply }).map_err(|why| CliError::Failed(why.to_owned()))?;
                Ok(answer.await.map_err(|_| CliError::StationGone)??)
            }
        }
    }

    /// Tells the station that a file was written out of what it holds; a history without a station has nobody to tell.
    pub async fn exported(&self, file: &str, bytes: &[u8]) -> Result<(), CliError> {
        let Source::Station(session) = self else { return Ok(()) };
        let sha256 = crate::access::book::sha256(bytes);
        let wish = crate::access::Wish::Exported { file: file.to_owned(), sha256 };
        let durability = session.wish(wish).await.map_err(CliError::Failed)?;
        client::warn_not_recorded(&format!("exported to {file}"), durability);
        Ok(())
    }
}
