//! The plant under another definition of itself: what is as it was goes on, all else begins.

#[cfg(test)]
mod tests;

use std::{
    collections::{BTreeMap, HashMap},
    mem::take,
    sync::Arc,
};

use jiff::Timestamp;

use super::{Effects, Plant};
use crate::plant::{
    PlantDef,
    command::{CommandKind, NotConfirmed},
    counter_watch::CounterWatch,
    def::{DeviceDef, LineDef, LineId, ProcedureId, TagId},
    line::Transport,
    line_trouble::LineTrouble,
    number::to_u16,
    procedure::{ProcedureEnd, ProcedureRun},
    record::{AlarmRecord, Record},
    redefinition::{Redefinition, Renamed},
    snapshot::LineStatus,
};

/// What follows from another definition.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Redefined {
    /// What has ended, under the ids of before.
    pub ended: Effects,
    /// What has begun, under the new ones.
    pub begun: Effects,
    /// What stands of alarms that are called otherwise, for the state file.
    pub standing: Vec<AlarmRecord>,
}

impl Plant {
    /// Goes on under another definition, in another run. Lines that it does not [keep](PlantDef::keeps_line) have ended by now.
    pub fn redefine(&mut self, def: &Arc<PlantDef>, run: u64, at: Timestamp) -> Redefined {
        self.at = self.at.max(at);
        let change = Redefinition::new(&self.def, def, |line| self.transport(self.def.line(line)));
        let mut ended = self.end_what_changes(&change, def);
        ended.records.extend(self.image.redefine(def, &change, self.at));
        ended.records.extend(self.redefine_batches(def));
        ended.records.extend(self.redefine_runs(def));
        let succession = self.alarm_manager.redefine(def, self.at);
        ended.records.extend(succession.journal(self.at, None).into_iter().map(Record::Alarm));
        self.count_alarms(&ended.records);
        self.redefine_devices(&change, def);
        self.counters = CounterWatch::default();
        let before = std::mem::replace(&mut self.def, def.clone());
        self.actuators.redefine(&before.logic, &def.logic, |tag| change.tag(tag));
        self.run = run;
        let mut begun = self.evaluate(self.at);
        self.advance_work(self.at, &mut begun);
        self.count_alarms(&begun.records);
        Redefined { ended, begun, standing: succession.state() }
    }

    /// How a line is connected, whatever its plant file says.
    fn transport<'a>(&'a self, line: &'a LineDef) -> &'a Transport {
        let report = self.lines[line.id.index()].report.as_ref();
        report.map_or(&line.transport, |report| &report.settings.transport)
    }

    /// Ends commands, restores and the procedure at work where their lines or what they mean have changed.
    fn end_what_changes(&mut self, change: &Redefinition, def: &Arc<PlantDef>) -> Effects {
        let (before, at, why) = (self.def.clone(), self.at, NotConfirmed::Reloaded);
        let goes_on = |kind: &CommandKind| kind.line(&before).is_some_and(|line| change.keeps_line(line));
        for line in before.lines.iter().filter(|line| !change.keeps_line(line.id)) {
            self.mark_restores_line_changed(line.id);
        }
        // A restore ends after the write that it waits for.
        let is_first = |kind: &CommandKind| !matches!(kind, CommandKind::Restore(_)) && !goes_on(kind);
        let mut effects = Effects::of_actions(self.commands.end_pending(is_first, why.clone(), &self.image, at));
        self.advance_restores(at, &mut effects);
        let rest = self.commands.end_pending(|kind| !goes_on(kind), why, &self.image, at);
        effects.records.extend(rest.into_iter().map(Record::Action));
        let untested = self.end_tests(|line| !change.keeps_line(line), &LineTrouble::Reloaded);
        effects.records.extend(untested);
        if self.procedure_at_work().is_some_and(|place| !before.keeps_procedure(def, ProcedureId(to_u16(place)))) {
            self.stop_procedures(&mut effects);
        }
        self.restores.retain(|run| change.keeps_line(before.device(run.device).line));
        // A command is shown as long as its tag, device or line has the same id.
        let keeps_ids = before.keeps_ids(def);
        self.commands.redefine(def, |kind| goes_on(kind) || keeps_ids && kind.line(&before).is_some());
        self.procedures = self.procedures_under(change, def);
        effects
    }

    /// The procedures as another definition shows them: one whose steps are others is shown only where its safe state is still
    /// to be written.
    fn procedures_under(&self, change: &Redefinition, def: &PlantDef) -> Vec<Option<Arc<ProcedureRun>>> {
        let before = &self.def;
        let keeps_ids = before.keeps_ids(def);
        let tags: HashMap<TagId, TagId> =
            def.tags.iter().filter_map(|tag| Some((change.tag(tag.id)?, tag.id))).collect();
        let shown = def.procedures.iter().zip(before.procedures_before(def)).map(|(own, was)| {
            let was = was?;
            let run = self.procedures[was.index()].as_ref()?;
            if keeps_ids && *before.procedure(was) == *own {
                return Some(run.clone());
            }
            let run = run.without_step(|tag| tags.get(&tag).copied());
            let is_shown = run.end() == Some(&ProcedureEnd::Interrupted) || run.missing().next().is_some();
            is_shown.then(|| Arc::new(run))
        });
        shown.collect()
    }

    fn redefine_batches(&mut self, def: &PlantDef) -> Vec<Record> {
        let names = self.def.batches.iter().map(|batch| batch.name.clone());
        let mut before: BTreeMap<Arc<str>, _> = names.zip(take(&mut self.batches)).collect();
        self.batches = def.batches.iter().map(|batch| before.remove(&batch.name).unwrap_or_default()).collect();
        before.into_values().filter_map(|tracker| tracker.remove(self.at)).map(Record::Batch).collect()
    }

    fn redefine_runs(&mut self, def: &PlantDef) -> Vec<Record> {
        let was = self.def.clone();
        let names = was.runs.iter().map(|run| was.device(run.controller).name.as_str());
        let mut before: BTreeMap<&str, _> = names.zip(take(&mut self.runs)).collect();
        let name = |controller| def.device(controller).name.as_str();
        self.runs = def.runs.iter().map(|run| before.remove(name(run.controller)).unwrap_or_default()).collect();
        let ended = before.into_values().filter_map(|mut tracker| tracker.stop(self.at));
        ended.map(|run| Record::Run(Box::new(run))).collect()
    }

    /// Lines that keep running, devices that are asked where they were, and the last request for each tag.
    fn redefine_devices(&mut self, change: &Redefinition, def: &PlantDef) {
        let lines = def.lines.iter().map(|line| change.port(line.id).map(LineId::index));
        self.line_minutes =
            lines.clone().map(|was| was.map(|was| take(&mut self.line_minutes[was])).unwrap_or_default()).collect();
        let renamed = |line: &LineDef| {
            let was = change.port(line.id)?;
            let status = self.lines[was.index()].clone();
            Some(if change.keeps_line(line.id) {
                status
            } else {
                renamed_status(status, line.id, &Renamed::new((&self.def, was), (def, line.id)))
            })
        };
        self.lines = def.lines.iter().map(|line| renamed(line).unwrap_or_default()).collect();
        let was = |device: &DeviceDef| change.device(device.id).map(|was| was.index());
        let devices = def.devices.iter().map(was);
        let programs = devices.clone().map(|was| was.map(|was| self.programs[was]).unwrap_or_default());
        self.programs = programs.collect();
        self.devices = devices.map(|was| was.map(|was| self.devices[was]).unwrap_or_default()).collect();
        // What was found names tags by their ids.
        let tuning = |device: &DeviceDef| {
            let was = self.tunings.get(device.id.index()).filter(|_| change.keeps_line(device.line));
            was.cloned().unwrap_or_default()
        };
        self.tunings = def.devices.iter().map(tuning).collect();
        let frame = |id| change.source(id).and_then(|was| self.source_frames[was.index()].clone());
        self.source_frames = Arc::new(def.tags.iter().map(|tag| frame(tag.id)).collect());
    }
}

/// The status of a line under other ids.
fn renamed_status(status: LineStatus, line: LineId, renamed: &Renamed) -> LineStatus {
    let report = status.report.as_ref().map(|report| Arc::new(report.renamed(line, renamed)));
    let before = status.settings_before.as_deref();
    let settings_before = before.map(|before| Arc::new(LineDef { id: line, ..before.clone() }));
    LineStatus { report, settings_before, ..status }
}
