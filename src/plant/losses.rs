//! What of a running plant would be lost under another plant file, and what would go on under another name.

use super::{
    PlantDef, Snapshot,
    alarm::{SuppressedAlarm, manager::name_of, state::OperatorNote, succession::successors},
    def::{AlarmId, ProcedureDef},
    id::ProcedureId,
    number::to_u16,
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
        let ended = self.ended_work(def).into_iter().map(ends);
        at_work.into_iter().chain(ended).chain(self.open_procedures(def)).collect()
    }

    /// What is at work and ends.
    fn ended_work(&self, def: &PlantDef) -> Vec<String> {
        let before = &*self.def;
        let is_controlled = |name: &str| def.runs.iter().any(|run| def.device(run.controller).name == name);
        let runs = self.runs.iter().flatten().filter(|run| run.is_running() && !is_controlled(&run.controller));
        let restores =
            self.restores.iter().filter(|run| run.at_work() && !before.keeps_line(def, before.device(run.device).line));
        let procedures = self.procedures.iter().enumerate().filter_map(|(place, run)| {
            let ends = run.as_ref()?.at_work() && !before.keeps_procedure(def, ProcedureId(to_u16(place)));
            ends.then(|| format!("procedure {}", before.procedures[place].name))
        });
        let runs = runs.map(|run| format!("control run {}", run.label()));
        let restores = restores.map(|run| format!("restore of {}", before.device(run.device).name));
        runs.chain(restores).chain(procedures).collect()
    }

    /// What becomes of procedures whose safe state is not written, where they have not the same name.
    fn open_procedures(&self, def: &PlantDef) -> Vec<Loss> {
        let was = self.def.procedures_before(def);
        let open = |(id, own): (ProcedureId, &ProcedureDef)| {
            let run = self.procedures.get(id.index())?.as_ref().filter(|run| !run.at_work())?;
            run.missing().next()?;
            let successor = was.iter().position(|was| *was == Some(id)).map(|place| &def.procedures[place].name);
            let what = format!("procedure {}, whose safe state is not written,", own.name);
            (successor != Some(&own.name)).then(|| Loss { what, becomes: successor.map(|name| name.to_string()) })
        };
        (0..).map(ProcedureId).zip(&self.def.procedures).filter_map(open).collect()
    }
}

/// `shelved by anna: sensor is being changed`.
fn suppression(alarm: &SuppressedAlarm) -> String {
    let OperatorNote { by, reason, .. } = &alarm.note;
    let by = by.as_ref().map(|by| format!(" by {by}")).unwrap_or_default();
    let reason = reason.as_ref().map(|reason| format!(": {reason}")).unwrap_or_default();
    format!("{}{by}{reason}", alarm.state.word())
}
