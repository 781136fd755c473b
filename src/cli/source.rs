//! Where a command reads the history: from the station while it runs, else from the file.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

use jiff::Timestamp;
use tokio::sync::oneshot;

use crate::{
    access::{SessionRequest, book::sha256},
    history::{
        Answer, HistoryError, Query,
        io::{QueryRequest, store::Store},
    },
    plant::PlantDef,
    profile::io::atomic::write_for_user,
    report::{Period, period_parser},
    station::Session,
};

use super::{CliError, StationArgs, client, put_out, run, say};

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
            if !session.status.borrow().view {
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
        period_parser::period(def, shift, from, to, self.now()).map_err(|error| CliError::Usage(error.to_string()))
    }

    /// Asks.
    pub async fn ask(&self, query: Query) -> Result<Answer, CliError> {
        match self {
            Source::File { store, until } => Ok(store.answer(&query, *until)?),
            Source::Station(session) => {
                let (reply, answer) = oneshot::channel();
                session.ask(QueryRequest { query, reply }).map_err(|why| CliError::Failed(why.to_owned()))?;
                Ok(answer.await.map_err(|_| CliError::StationGone)??)
            }
        }
    }

    /// Writes a file with what the history holds, `-` to standard output. The station has it recorded before anything is
    /// written, or refuses: an export needs a right.
    pub async fn export(&self, path: &Path, bytes: &[u8]) -> Result<(), CliError> {
        if let Source::Station(session) = self {
            let (file, sha256) = (path.display().to_string(), sha256(bytes));
            let exported = format!("exported to {file}");
            let durability =
                session.request(SessionRequest::Exported { file, sha256 }).await.map_err(CliError::Failed)?;
            client::warn_not_recorded(&exported, durability);
        }
        let failed = |error| CliError::Io { what: format!("cannot write {}", path.display()), error };
        if path.as_os_str() == "-" {
            return put_out(bytes).map_err(failed);
        }
        write_for_user(path, bytes).map_err(failed)?;
        say(&path.display().to_string());
        Ok(())
    }
}
