//! The task that makes reports by itself, one step at a time: what it does next is decided by `automatic::next_step` from the
//! record, which it reads again after each step. It waits for the disk and for queries, and no other task waits for it.
//!
//! ```text
//!   query ──> render ──> file, checksum ──> audit log ──> record ──> command ──> record
//!          killed here: made again, with the same bytes   │          └ killed: run again
//! ```

use std::{path::Path, sync::Arc, time::Duration};

use jiff::Timestamp;
use tokio::{
    sync::{mpsc, oneshot, watch},
    task::{AbortHandle, JoinError},
    time::{sleep, timeout},
};

use super::{delivery, report_files};
use crate::{
    access::audit_log::sha256,
    bus::io::{clock::Clock, worker::spawn_blocking},
    history::{
        Answer, HistoryError, MadeReports, Query,
        io::{
            QueryRequest,
            reader::STATION,
            thread::{HistoryInput, offer},
        },
        words::joined,
    },
    plant::{
        PlantDef,
        event::Event,
        record::{ActionRecord, Record},
        report::{ReportEvent, ReportRecord},
        snapshot::HistoryStatus,
        station_fault::{FaultState, StationFault},
        time::elapsed,
    },
    report::{
        self, ShiftReport, Style,
        automatic::{self, Due, Failures, Step},
    },
    station::{audit_queue::AuditMessage, entries},
    text::file,
};

/// Reports on record that are looked at: nine years of three a day.
pub const REPORTS_MAX: usize = 10_000;
/// Real time between two looks at the clock, which may be set.
const LOOK_EVERY: Duration = Duration::from_secs(30);
/// Real time until a history that does not answer is asked again.
const ASK_EVERY: Duration = Duration::from_secs(5);
/// The audit log is waited for so long.
const AUDIT_TIME_MAX: Duration = Duration::from_secs(5);
/// A step in the folder of reports takes so long at most; what takes longer hangs.
const DISK_MAX: Duration = Duration::from_secs(10);
/// Said of that folder.
const SILENT: &str = "the folder of reports does not respond";
/// A report that takes too long is tried so often.
const TOO_LONG_MAX: usize = 3;
/// And one of which it is not known what it lacks: then it is made, and says so. An audit log that is never opened again
/// costs no shift its report.
const UNKNOWN_MAX: usize = 5;

/// Everything that the task needs.
pub(crate) struct ReportTask {
    /// The plant.
    pub def: Arc<PlantDef>,
    /// Plant time.
    pub clock: Clock,
    /// To the history.
    pub queries: mpsc::Sender<(u32, QueryRequest)>,
    /// To the history.
    pub records: mpsc::Sender<HistoryInput>,
    /// To the audit log.
    pub audit: mpsc::Sender<AuditMessage>,
    /// To the plant: its alarm.
    pub events: mpsc::Sender<Event>,
    /// How the history stands.
    pub status: watch::Receiver<HistoryStatus>,
}

/// Runs until the station stops; a step that is not done yet is done by the next station.
pub(crate) async fn run(task: ReportTask, mut stopped: watch::Receiver<bool>) {
    let mut made = Maker { task, failures: Failures::default(), fault: None, unsent: None, hung: None };
    tokio::select! {
        _ = stopped.wait_for(|stopped| *stopped) => {}
        () = made.follow() => {}
    }
}

/// Why a report was not made.
enum NotMade {
    /// It is tried again.
    Yet(String),
    /// It cannot be made.
    Ever(String),
}

/// What the task knows beside the record.
struct Maker {
    task: ReportTask,
    failures: Failures,
    /// The words of the alarm that is active.
    fault: Option<String>,
    /// A state of the alarm that the plant had no room for.
    unsent: Option<FaultState>,
    /// What hangs in the folder of reports: nothing more is begun there before it has ended.
    hung: Option<AbortHandle>,
}

impl Maker {
    async fn follow(&mut self) {
        loop {
            // What waits in memory would be missing.
            let failing = self.task.status.borrow().failing.is_some();
            let made = if failing { Err(HistoryError::NotOpen) } else { self.made().await };
            match made {
                Ok(made) => self.step(made).await,
                Err(error) => {
                    tracing::debug!(%error, "automatic reports wait for the history");
                    sleep(ASK_EVERY).await;
                }
            }
        }
    }

    async fn ask(&self, query: Query) -> Result<Answer, HistoryError> {
        let (reply, answer) = oneshot::channel();
        let request = (STATION, QueryRequest { query, reply });
        self.task.queries.try_send(request).map_err(|_| HistoryError::NotOpen)?;
        answer.await.unwrap_or(Err(HistoryError::NotOpen))
    }

    async fn made(&self) -> Result<MadeReports, HistoryError> {
        match self.ask(Query::Reports { limit: REPORTS_MAX }).await? {
            Answer::Reports(made) => Ok(made),
            _ => Err(HistoryError::NotOpen),
        }
    }

    /// Does what is next.
    async fn step(&mut self, made: MadeReports) {
        let (def, now) = (self.task.def.clone(), self.task.clock.utc());
        let since = made.extent.map(|(first, _)| first);
        let record: automatic::Record = made.reports.into_iter().map(|report| (report.key(), report)).collect();
        let hangs = self.hangs().then(|| SILENT.to_owned());
        self.alarm(joined([&hangs, &self.failures.words(&def, &record)]));
        match automatic::next_step(&def, &record, &self.failures, since, now) {
            Step::Make(due) => self.make(due).await,
            Step::Deliver(report, rule) => {
                let words: Vec<String> =
                    rule.after.iter().map(|word| automatic::filled(word, report, &def.name)).collect();
                let folder = Path::new(&*report.file).parent().unwrap_or(Path::new(".")).to_owned();
                let inside = folder.clone();
                let Some(Ok(is_there)) = self.on_disk(move || inside.is_dir()).await else {
                    return sleep(ASK_EVERY).await;
                };
                let result = delivery::run(&words, is_there.then_some(&*folder)).await;
                self.delivered(report, result);
            }
            Step::Delete(report) => {
                let (path, sha) = (report.file.clone(), report.sha256.clone());
                let deleted = self.on_disk(move || report_files::delete(Path::new(&*path), &sha)).await;
                let Some(deleted) = deleted else { return sleep(ASK_EVERY).await };
                let event = match deleted {
                    Ok(Ok(true)) => ReportEvent::Deleted,
                    Ok(Ok(false)) => ReportEvent::LeftAlone,
                    Ok(Err(error)) => {
                        // A file that cannot be deleted is one that cannot be looked at: it is not tried without end.
                        tracing::error!(%error, file = &*report.file, "an old report cannot be deleted");
                        ReportEvent::LeftAlone
                    }
                    Err(_) => ReportEvent::LeftAlone,
                };
                let is_deleted = event == ReportEvent::Deleted;
                self.audit(entries::report_deleted(&report.file, &report.sha256, is_deleted, now)).await;
                self.record(report.then(now, event));
            }
            Step::Wait(until) => self.wait(now, until).await,
        }
    }

    /// Works in the folder of reports. `None` where it does not respond.
    async fn on_disk<T>(&mut self, work: impl FnOnce() -> T + Send + 'static) -> Option<Result<T, JoinError>>
    where
        T: Send + 'static,
    {
        if self.hangs() {
            return None;
        }
        let mut work = spawn_blocking(work);
        let done = timeout(DISK_MAX, &mut work).await.ok();
        self.hung = done.is_none().then(|| work.abort_handle());
        done
    }

    fn hangs(&self) -> bool {
        self.hung.as_ref().is_some_and(|hung| !hung.is_finished())
    }

    fn delivered(&mut self, report: &ReportRecord, result: Result<(), String>) {
        let (event, error) = match result {
            Ok(()) => (ReportEvent::Delivered, None),
            Err(why) => (ReportEvent::DeliveryFailed, Some(why.into())),
        };
        let next = report.then(self.task.clock.utc(), event);
        self.record(ReportRecord { attempts: report.attempts + 1, error, ..next });
    }

    async fn make(&mut self, due: Due<'_>) {
        match self.make_file(&due).await {
            Ok((report, is_new)) => {
                tracing::info!(file = &*report.file, "report written");
                let entry = entries::report_exported(&report.file, &report.sha256, is_new, report.at);
                self.audit(entry).await;
                if self.record(report) {
                    self.failures.clear(&due.sequence());
                } else {
                    let why = "the queue to the history is full".to_owned();
                    self.failures.fail(due.sequence(), why, self.task.clock.utc());
                }
            }
            Err(NotMade::Yet(why)) => {
                tracing::warn!(why, period = %due.period.name, "a report is not made yet");
                self.failures.fail(due.sequence(), why, self.task.clock.utc());
            }
            Err(NotMade::Ever(why)) => {
                tracing::error!(why, period = %due.period.name, "a report cannot be made");
                self.failures.clear(&due.sequence());
                let words = format!("{} ({}) not made: {why}", due.period.name, due.format);
                self.unsent = Some(FaultState::Occurred(words.into()));
                let report = self.about(&due, "", "", ReportEvent::NotMade);
                self.record(ReportRecord { error: Some(why.into()), ..report });
            }
        }
    }

    fn about(&self, due: &Due, file: &str, sha256: &str, event: ReportEvent) -> ReportRecord {
        let Due { rule, period, format } = due;
        ReportRecord {
            at: self.task.clock.utc(),
            period: rule.period,
            name: period.name.to_string().into(),
            from: period.from,
            to: period.to,
            format: (*format).into(),
            file: file.into(),
            sha256: sha256.into(),
            event,
            attempts: 0,
            error: None,
        }
    }

    /// Asks for the figures, renders them and writes the file; also whether it is new.
    async fn make_file(&mut self, due: &Due<'_>) -> Result<(ReportRecord, bool), NotMade> {
        let report = match self.ask(Query::Report { period: due.period.clone() }).await {
            Ok(Answer::Report(report)) => report,
            Ok(_) => return Err(NotMade::Yet("the history answered another query".to_owned())),
            Err(error) => return Err(self.unanswered(due, &error)),
        };
        if report.until < due.period.to {
            return Err(NotMade::Yet("the clock was set back".to_owned()));
        }
        // Its file would stay as it is.
        let is_last = self.failures.attempts(&due.sequence()) + 1 >= UNKNOWN_MAX;
        if report.unstored.map_or(!is_last, |records| records > 0) {
            return Err(NotMade::Yet("records wait for the disk of the history, or for the audit log".to_owned()));
        }
        let (def, rule) = (self.task.def.clone(), due.rule);
        let format = report::format(due.format).map_err(NotMade::Ever)?;
        let folder = rule.folder.clone().unwrap_or_else(|| def.report.folder.clone());
        let (stem, ending) = due.file_name(&def, format);
        let render = move || {
            let report: &ShiftReport = &report;
            file(|| report::render(format, report, &def, &Style::of(&def)))
        };
        let bug = || "internal error, see the log".to_owned();
        let bytes = spawn_blocking(render).await.unwrap_or_else(|_| Err(bug())).map_err(NotMade::Ever)?;
        let write = move || -> Result<_, NotMade> {
            let failed = |error: std::io::Error| NotMade::Yet(format!("{}: {error}", folder.display()));
            // A list of reports names files for whoever reads it, wherever that is.
            let folder = std::path::absolute(&folder).map_err(failed)?;
            let (path, is_new) = report_files::place(&folder, &stem, &ending, &bytes).map_err(failed)?;
            Ok((path.display().to_string(), sha256(&bytes), is_new))
        };
        let written = self.on_disk(write).await.ok_or_else(|| NotMade::Yet(SILENT.to_owned()))?;
        let (path, sha, is_new) = written.unwrap_or_else(|_| Err(NotMade::Ever(bug())))?;
        Ok((self.about(due, &path, &sha, ReportEvent::Made), is_new))
    }

    fn unanswered(&self, due: &Due, error: &HistoryError) -> NotMade {
        let why = error.to_string();
        match error {
            HistoryError::TooManyRows { .. } | HistoryError::EmptyPeriod | HistoryError::Refused(_) => {
                NotMade::Ever(why)
            }
            HistoryError::TooLong { .. } if self.failures.attempts(&due.sequence()) + 1 >= TOO_LONG_MAX => {
                NotMade::Ever(why)
            }
            HistoryError::TooLong { .. }
            | HistoryError::Locked { .. }
            | HistoryError::Engine(_)
            | HistoryError::Foreign { .. }
            | HistoryError::Missing { .. }
            | HistoryError::OtherSchema { .. }
            | HistoryError::NotKept { .. }
            | HistoryError::Sql(_)
            | HistoryError::NotOpen => NotMade::Yet(why),
        }
    }

    /// Has a file in the audit log before the history: a report on record is one that can be verified. A station that is killed
    /// in between finds the file, which its entry says.
    async fn audit(&self, entry: ActionRecord) {
        let file = entry.target.clone();
        let (reply, recorded) = oneshot::channel();
        if self.task.audit.try_send(AuditMessage::Entry(entry)).is_err()
            || self.task.audit.try_send(AuditMessage::Reply(reply, Ok(None))).is_err()
        {
            tracing::error!(file = &*file, "the audit log has no room for a report");
            return;
        }
        // What is not recorded yet waits in the queue of the audit log, which has an alarm of its own.
        let _ = timeout(AUDIT_TIME_MAX, recorded).await;
    }

    /// Puts an event on record; `false` where there is no room.
    fn record(&self, report: ReportRecord) -> bool {
        offer(&self.task.records, vec![Record::Report(report)]) == 0
    }

    /// Raises or clears the alarm, in words that have changed.
    fn alarm(&mut self, words: Option<String>) {
        if words != self.fault {
            self.unsent = Some(FaultState::lasting(words.clone()));
            self.fault = words;
        }
        let Some(state) = self.unsent.take() else { return };
        let event = Event::Station { at: self.task.clock.now(), fault: StationFault::Reports, state };
        if let Err(mpsc::error::TrySendError::Full(Event::Station { state, .. })) = self.task.events.try_send(event) {
            self.unsent = Some(state);
        }
    }

    /// Waits until an instant, or until the clock is set.
    async fn wait(&mut self, since: Timestamp, until: Timestamp) {
        let mut last = since;
        loop {
            let now = self.task.clock.utc();
            if until <= now || now < last || self.unsent.is_some() {
                // A full queue is tried again after a while.
                if self.unsent.is_some() {
                    sleep(ASK_EVERY).await;
                }
                return;
            }
            last = now;
            sleep(self.task.clock.real_span(elapsed(now, until)).min(LOOK_EVERY)).await;
        }
    }
}

#[cfg(test)]
mod tests;
