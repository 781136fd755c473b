//! Where a command reads the history: from the station while it runs, else from the file.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

use jiff::{SignedDuration, Timestamp};
use tokio::sync::oneshot;

use crate::{
    access::{SessionRequest, audit_log::sha256, io::audit_log},
    history::{
        Answer, HistoryError, Query,
        io::{QueryRequest, archive::sync_and_hash, store::Store},
    },
    plant::{PlantDef, def::CsvDialect},
    profile::io::atomic::{copy_for_user, write_for_user},
    report::{Period, period_parser},
    station::Session,
};

use super::{CliError, StationArgs, client, load, own_files, paths, put_out, put_out_file, say, say_error};

/// The plant, the period and the login of a command that reads the history.
#[derive(Debug, clap::Args)]
pub struct HistoryArgs {
    /// A plant file, or the name of a shipped plant
    plant: String,
    /// Which shift: last, current, NAME or NAME@YYYY-MM-DD [default: last]
    #[arg(long, value_name = "SHIFT")]
    shift: Option<String>,
    /// Which day, week or month: the last one, or with @DATE the one of a date: week@2026-11-21, week@2026-W47, month@2026-11
    #[arg(long, value_name = "PERIOD", conflicts_with_all = ["shift", "from", "to"])]
    period: Option<String>,
    /// From this local time (2026-11-21T06:00) or instant with offset
    #[arg(long, value_name = "TIME")]
    from: Option<String>,
    /// To this local time or instant [default: now]
    #[arg(long, value_name = "TIME")]
    to: Option<String>,
    #[command(flatten)]
    login: client::Login,
    #[command(flatten)]
    station: StationArgs,
}

/// Settings of CSV files, instead of those of the plant.
#[derive(Debug, clap::Args)]
pub struct CsvArgs {
    /// Separator of cells: `,` or `;` (then the decimal mark is a comma)
    #[arg(long, value_name = "MARK", value_parser = [",", ";"])]
    separator: Option<String>,
    /// Begin with a byte order mark, for spreadsheets
    #[arg(long)]
    bom: bool,
}

impl HistoryArgs {
    /// The plant.
    pub fn load(&self) -> Result<Arc<PlantDef>, CliError> {
        Ok(Arc::new(load(&self.plant, &self.station)?))
    }

    /// Refuses to write to a file of the station.
    pub fn refuse_own_file(&self, def: &PlantDef, out: &Path) -> Result<(), CliError> {
        own_files::refuse(out, &paths::history_file(def, &self.station))
    }

    /// Opens the history and resolves the period.
    pub async fn open(&self, def: &Arc<PlantDef>) -> Result<(Source, Period), CliError> {
        let source = Source::open(def, &self.station, &self.login).await?;
        let (shift, from, to) = (self.shift.as_deref(), self.from.as_deref(), self.to.as_deref());
        let period = match &self.period {
            Some(period) => period_parser::of_calendar(def, period, source.now()),
            None => period_parser::period(def, shift, from, to, source.now()),
        };
        Ok((source, period.map_err(|error| CliError::Usage(error.to_string()))?))
    }
}

impl HistoryArgs {
    /// The same, but without a period it is the time before now.
    pub async fn open_latest(&self, def: &Arc<PlantDef>, time: SignedDuration) -> Result<(Source, Period), CliError> {
        if [&self.shift, &self.period, &self.from, &self.to].iter().any(|given| given.is_some()) {
            return self.open(def).await;
        }
        let source = Source::open(def, &self.station, &self.login).await?;
        let to = source.now();
        let from = to.checked_sub(time).unwrap_or(Timestamp::MIN);
        Ok((source, Period::free(from, to)))
    }
}

impl CsvArgs {
    /// Refuses settings that nothing would obey.
    pub fn refuse_unless(&self, is_csv: bool) -> Result<(), CliError> {
        match is_csv || !(self.bom || self.separator.is_some()) {
            true => Ok(()),
            false => Err(CliError::Usage("--bom and --separator are for CSV: found another format".to_owned())),
        }
    }

    /// The dialect to write.
    pub fn dialect(&self, def: &PlantDef) -> CsvDialect {
        def.report.csv.with(self.separator.as_deref(), self.bom)
    }
}

/// A history that can be asked.
pub enum Source {
    /// Through its station.
    Station(Box<Session>),
    /// From the file, which no other process has open.
    File {
        /// The file.
        store: Box<Store>,
        /// The audit log beside it.
        log: PathBuf,
        /// Up to when it is read: now, or what a demonstration that ran ahead of time has stored.
        until: Timestamp,
    },
}

impl Source {
    /// The history of a plant. A file that is named is read as a file.
    pub async fn open(def: &Arc<PlantDef>, args: &StationArgs, login: &client::Login) -> Result<Source, CliError> {
        if args.history.is_none() && client::find_station(Some(&def.name)).await.is_ok() {
            let session = client::attach(Some(&def.name), login).await?;
            if !session.status.borrow().may_view {
                let why = "the station of this plant runs: log in to ask it, --user NAME asks for the password";
                return Err(CliError::Failed(why.to_owned()));
            }
            return Ok(Source::Station(Box::new(session)));
        }
        let path: PathBuf = paths::history_file(def, args);
        let store = Store::open_read_only(&path, def).map_err(|error| match error {
            error @ HistoryError::Locked { .. } => CliError::InUse(error),
            other => CliError::History(other),
        })?;
        let now = Timestamp::now();
        let until = store.extent().map_or(now, |(_, last)| last.max(now));
        Ok(Source::File { store: Box::new(store), log: audit_log::beside(&path), until })
    }

    /// The time of the plant: a demonstration may have run ahead of time.
    pub fn now(&self) -> Timestamp {
        match self {
            Source::Station(session) => session.snapshots.borrow().at,
            Source::File { until, .. } => *until,
        }
    }

    /// Queries the history.
    pub async fn query(&self, query: Query) -> Result<Answer, CliError> {
        match self {
            Source::File { store, log, until } => {
                let mut answer = store.answer(&query, *until)?;
                if let Answer::Report(report) = &mut answer {
                    let number = report.audit.map_or(0, |last| last.number);
                    let behind = audit_log::count_behind(log, number, report.until);
                    report.unstored = behind.inspect_err(|error| say_error(&error.to_string())).ok();
                }
                Ok(answer)
            }
            Source::Station(session) => query_station(session, query).await,
        }
    }

    /// Writes a file with what the history holds, `-` to standard output. The station has it recorded before anything is
    /// written, or refuses: an export needs a right.
    pub async fn export(&self, path: &Path, bytes: &[u8]) -> Result<(), CliError> {
        let is_out = path.as_os_str() == "-";
        let failed = CliError::io(format!("cannot write {}", path.display()));
        let write = || if is_out { put_out(bytes) } else { write_for_user(path, bytes) }.map_err(failed);
        self.write_recorded(path, sha256(bytes), write).await?;
        if !is_out {
            say(&path.display().to_string());
        }
        Ok(())
    }

    /// The same with a file that may be too large for the memory.
    pub async fn export_file(&self, path: &Path, from: &Path) -> Result<(), CliError> {
        let (_, sha256) = sync_and_hash(from).map_err(CliError::io(format!("cannot read {}", from.display())))?;
        let failed = CliError::io(format!("cannot write {}", path.display()));
        let is_out = path.as_os_str() == "-";
        let write = || if is_out { put_out_file(from) } else { copy_for_user(from, path) }.map_err(failed);
        self.write_recorded(path, sha256, write).await
    }

    /// Writes once that is on record; what then fails is on record too.
    async fn write_recorded(
        &self,
        path: &Path,
        sha256: String,
        write: impl FnOnce() -> Result<(), CliError>,
    ) -> Result<(), CliError> {
        let file = path.display().to_string();
        let Source::Station(session) = self else { return write() };
        let exported = SessionRequest::Exported { file: file.clone(), sha256: Ok(sha256) };
        let durability = session.request(exported).await?;
        let written = write();
        match &written {
            Ok(()) => client::warn_not_recorded(&format!("exported to {file}"), durability),
            Err(error) => {
                let failed = SessionRequest::Exported { file, sha256: Err(error.to_string()) };
                // Where that cannot be put on record either, why nothing was written is said all the same.
                drop(session.request(failed).await);
            }
        }
        written
    }
}

/// Queries the history of a station.
pub async fn query_station(session: &Session, query: Query) -> Result<Answer, CliError> {
    let (reply, answer) = oneshot::channel();
    session.ask(QueryRequest { query, reply })?;
    Ok(answer.await.map_err(|_| CliError::StationGone)??)
}

/// An answer of another kind than the query.
pub fn unexpected() -> CliError {
    CliError::History(HistoryError::Engine("answered another query".into()))
}
