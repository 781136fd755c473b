//! Saves settings into the plant file, parameter sets into their folder and what was found of devices, on threads of their own.

use tokio::{task::JoinHandle, time::timeout};

use super::{FILES_MAX, PlantTask};
use crate::{
    bus::io::worker::spawn_blocking,
    plant::{SetWork, command::CommandId, def::LineDef},
    profile::PlantFile,
    station::sets,
};

/// Said where there is nothing to save into.
const NO_FILE: &str =
    "this plant is built into the program; write it to a file with `sightglass profiles NAME` and start that file";

/// The plant file on its way to the disk, and for whom.
pub(super) struct Saving {
    command: CommandId,
    settings: LineDef,
    work: JoinHandle<(PlantFile, Result<(), String>)>,
}

/// For whom, and how it ended.
pub(super) type Saved = (CommandId, LineDef, Result<(PlantFile, Result<(), String>), tokio::task::JoinError>);

/// Waits for the end of a save; for ever without one.
pub(super) async fn saved(saving: &mut Option<Saving>) -> Saved {
    let Some(Saving { command, settings, work }) = saving else { return std::future::pending().await };
    let saved = (*command, settings.clone(), work.await);
    *saving = None;
    saved
}

/// Waits for the end of the work with the sets; for ever without any.
pub(super) async fn filed(filing: &mut Option<JoinHandle<sets::Done>>) -> Result<sets::Done, tokio::task::JoinError> {
    let Some(work) = filing else { return std::future::pending().await };
    let done = work.await;
    *filing = None;
    done
}

impl PlantTask {
    /// Has what was found of devices written down beside the loop, if it is news.
    pub(super) fn keep_found(&mut self) {
        if let Some(found) = &mut self.persistence.found {
            found.update(self.plant.def(), self.plant.lines());
        }
    }

    /// The same at the end.
    pub(super) async fn finish_found(&mut self) {
        self.keep_found();
        if let Some(found) = self.persistence.found.take()
            && timeout(FILES_MAX, found.written()).await.is_err()
        {
            tracing::error!("the folder of the history does not respond: what was found of devices is not kept");
        }
    }

    /// Has the folder of parameter sets worked on beside the loop, one work at a time.
    pub(super) fn file_sets(&mut self, work: SetWork) {
        let refused = match (&self.persistence.sets, &self.filing) {
            (Some(folder), None) => {
                let (folder, def) = (folder.clone(), self.plant.def().clone());
                self.filing = Some(spawn_blocking(move || sets::work(&folder, &def, work)));
                return;
            }
            (Some(_), Some(_)) => "another set is being saved, try again",
            (None, _) => "this station stores nothing",
        };
        // What is being done ends with the folder read, so a request to read is granted already.
        if let SetWork::Write { command, .. } = work {
            let effects = self.plant.on_set_written(command, Err(refused.to_owned()));
            self.dispatch(effects.records);
        }
    }

    pub(super) fn on_filed(&mut self, done: Result<sets::Done, tokio::task::JoinError>) {
        let (written, sets) = match done {
            Ok(done) => done,
            // The command times out, which its operator sees.
            Err(error) => return tracing::error!(%error, "the parameter set task failed"),
        };
        self.plant.on_sets(sets);
        if let Some((command, result)) = written {
            let effects = self.plant.on_set_written(command, result);
            self.dispatch(effects.records);
        }
    }

    /// Has the plant file written beside the loop; the outcome comes to [`PlantTask::on_saved`].
    pub(super) fn save(&mut self, command: CommandId, settings: LineDef) {
        match (self.file.take(), &self.saving) {
            (Some(mut file), _) => {
                let saved = settings.clone();
                let work = spawn_blocking(move || {
                    let result = file.save(&settings);
                    (file, result)
                });
                self.saving = Some(Saving { command, settings: saved, work });
            }
            (None, Some(_)) => self.report_saved(command, &settings, Err("other settings are being saved".into())),
            (None, None) => self.report_saved(command, &settings, Err(NO_FILE.into())),
        }
    }

    pub(super) fn on_saved(&mut self, (command, settings, done): Saved) {
        let result = match done {
            Ok((file, result)) => {
                let now = self.clock.utc();
                let changed = self.persistence.audit.as_mut().and_then(|audit| audit.files().plant_file(&file, now));
                self.send_to_audit_log(changed.into_iter().collect(), Vec::new());
                // A file that was reloaded meanwhile is the newer one.
                self.file.get_or_insert(file);
                result
            }
            Err(error) => {
                tracing::error!(%error, "saving settings failed");
                Err("internal error, see the log".to_owned())
            }
        };
        self.report_saved(command, &settings, result);
    }

    fn report_saved(&mut self, command: CommandId, settings: &LineDef, result: Result<(), String>) {
        let effects = self.plant.on_saved(command, settings, result);
        self.dispatch(effects.records);
    }
}
