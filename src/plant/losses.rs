//! What of a running plant would be lost under another plant file, and what would go on under another name.

use super::{
    PlantDef, Snapshot,
    alarm::{manager::name_of, state::OperatorNote, succession::successors},
    def::AlarmId,
    id::ProcedureId,
    number::to_u16,
    snapshot::SuppressedAlarm,
};

/// What becomes of something that stands.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Loss {
    /// What it is, and how it stands: `alarm TIC-1.PV temperature high (UNACK)`.
    pub what: String,
    /// Its name from then on; `None` where it ends.
    pub becomes: Option<String>,
}

impl std::fmt::Display for Loss {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match &self.becomes {
            Some(name) => write!(f, "{} goes on as {name}", self.what),
            None => write!(f, "{} ends", self.what),
        }
    }
}

impl Snapshot {
    /// What of it another definition would end or rename: alarms that stand, shelvings, alarms out of service, the control
    /// runs, restores and procedures at work. What is suppressed by design stands for nothing.
    pub fn losses(&self, def: &PlantDef) -> Vec<Loss> {
        let before = &*self.def;
        let successors = successors(before, def);
        let alarm = |id: AlarmId, stands: String| {
            let was = before.alarm(id);
            let words = |(subject, message): (&str, &str)| format!("{subject} {message}");
            let (name, successor) =
                (name_of(before, was), successors[id.index()].map(|id| name_of(def, def.alarm(id))));
            (successor != Some(name))
                .then(|| Loss { what: format!("alarm {} ({stands})", words(name)), becomes: successor.map(words) })
        };
        let active = self.alarms.iter().filter_map(|active| alarm(active.id, active.state.word().to_owned()));
        let noted = self.suppressed.iter().filter(|suppressed| suppressed.note.by.is_some() || suppressed.active);
        let suppressed = noted.filter_map(|suppressed| alarm(suppressed.id, suppression(suppressed)));
        let at_work = active.chain(suppressed).collect::<Vec<_>>();
        let ends = |what: String| Loss { what, becomes: None };
        at_work.into_iter().chain(self.ended_work(def).into_iter().map(ends)).collect()
    }

    /// What is at work and ends.
    fn ended_work(&self, def: &PlantDef) -> Vec<String> {
        let before = &*self.def;
        let is_controlled = |name: &str| def.runs.iter().any(|run| def.device(run.controller).name == name);
        let runs = self.runs.iter().flatten().filter(|run| run.is_running() && !is_controlled(&run.controller));
        let restores =
            self.restores.iter().filter(|run| run.at_work() && !before.keeps_line(def, before.device(run.device).line));
        let procedures = self.procedures.iter().enumerate().filter_map(|(place, run)| {
            let (run, name) = (run.as_ref()?, &before.procedures[place].name);
            if run.at_work() {
                return (!before.keeps_procedure(def, ProcedureId(to_u16(place)))).then(|| format!("procedure {name}"));
            }
            let is_open = run.missing().next().is_some() && !def.procedures.iter().any(|other| other.name == *name);
            is_open.then(|| format!("procedure {name}, whose safe state is not written,"))
        });
        let runs = runs.map(|run| format!("control run {}", run.label()));
        let restores = restores.map(|run| format!("restore of {}", before.device(run.device).name));
        runs.chain(restores).chain(procedures).collect()
    }
}

/// `shelved by anna: sensor is being changed`.
fn suppression(alarm: &SuppressedAlarm) -> String {
    let OperatorNote { by, reason, .. } = &alarm.note;
    let by = by.as_ref().map(|by| format!(" by {by}")).unwrap_or_default();
    let reason = reason.as_ref().map(|reason| format!(": {reason}")).unwrap_or_default();
    format!("{}{by}{reason}", alarm.state.word())
}
