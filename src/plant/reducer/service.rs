//! Commands of a technician for a line: settings and diagnostics.

use std::sync::Arc;

use jiff::Timestamp;

use super::{Effects, Plant};
use crate::{
    plant::{
        command::{BusRequest, CommandId, CommandKind, CommandStatus, Outcome, Refusal},
        def::{LineDef, LineId},
        diagnostics::{DiagnosticRun, DiagnosticState},
        line_check::valid,
        line_trouble::LineTrouble,
        record::{ActionRecord, Record},
    },
    t,
};

impl Plant {
    /// Accepts a command for a line: settings and diagnostics. `None`: it is pending.
    pub(super) fn line_command(&mut self, status: &CommandStatus, effects: &mut Effects) -> Option<Outcome> {
        let refused = |refusal| Some(Outcome::Refused(refusal));
        match &status.command.kind {
            CommandKind::Configure(settings) => {
                if self.def.lines.get(settings.id.index()).is_none_or(|line| line.name != settings.name) {
                    return refused(Refusal::NotALine);
                }
                if let Err(why) = valid(settings) {
                    return refused(Refusal::NotValid(why));
                }
                self.remember_settings(settings);
                self.mark_restores_line_changed(settings.id);
                effects.bus.push((settings.id, BusRequest::Configure(settings.clone())));
            }
            CommandKind::Test(line, diagnostic) => {
                if let Err(why) = diagnostic.check_on(self.settings(*line)) {
                    return refused(Refusal::NotValid(why));
                }
                let (id, by, diagnostic) = (status.command.id, status.by.clone(), diagnostic.clone());
                effects.bus.push((*line, BusRequest::Test { id, by, diagnostic }));
            }
            CommandKind::StopTest(line) => effects.bus.push((*line, BusRequest::StopTest)),
            CommandKind::SaveSettings(line) => {
                effects.save = Some((status.command.id, self.settings(*line).clone()));
            }
            CommandKind::Write { .. }
            | CommandKind::WriteText { .. }
            | CommandKind::Alarm(_)
            | CommandKind::Refresh(_)
            | CommandKind::Connect(..)
            | CommandKind::ReadSets
            | CommandKind::SaveSet { .. }
            | CommandKind::Restore(_)
            | CommandKind::StopRestore(_)
            | CommandKind::StartProcedure(_)
            | CommandKind::AbortProcedure(_)
            | CommandKind::CorrectCounter { .. }
            | CommandKind::HandOver
            | CommandKind::TakeOver => {}
        }
        None
    }

    /// The plant file was written, or `Err` says why not.
    pub fn on_saved(&mut self, command: CommandId, saved: &LineDef, result: Result<(), String>) -> Effects {
        if result.is_ok() {
            let tried_since = self.settings(saved.id) != saved;
            self.lines[saved.id.index()].settings_before = tried_since.then(|| Arc::new(saved.clone()));
        }
        Effects::of_actions(self.commands.complete(
            command,
            result.map_err(Refusal::NotSaved).into(),
            &self.image,
            self.at,
        ))
    }

    /// A line reports on its test.
    pub(super) fn tested(&mut self, line: LineId, run: Arc<DiagnosticRun>, at: Timestamp) -> Option<ActionRecord> {
        let ended = self.commands.tested(&run, &self.image, at);
        self.lines[line.index()].test = Some(run);
        ended
    }

    /// Ends the tests of lines that report nothing more.
    pub(super) fn end_tests(&mut self, is_meant: impl Fn(LineId) -> bool, why: &LineTrouble) -> Vec<Record> {
        let lines = &self.lines;
        let outcome = |line: LineId, id: CommandId| {
            let run = lines[line.index()].test.as_deref().filter(|run| run.id == id);
            let ended = run.map(|run| DiagnosticRun { state: DiagnosticState::Failed(why.clone()), ..run.clone() });
            ended.map_or_else(|| format!("{}: {why}", t!("failed")), |run| run.outcome_text())
        };
        let ended = self.commands.end_tests(is_meant, outcome, &self.image, self.at);
        ended.into_iter().map(Record::Action).collect()
    }

    /// The settings in use.
    fn settings(&self, line: LineId) -> &LineDef {
        self.lines[line.index()].report.as_ref().map_or(self.def.line(line), |report| &report.settings)
    }

    /// Keeps the settings before the first of several tries.
    fn remember_settings(&mut self, tried: &LineDef) {
        let in_use = Arc::new(self.settings(tried.id).clone());
        let before = &mut self.lines[tried.id.index()].settings_before;
        *before = Some(before.take().unwrap_or(in_use)).filter(|before| **before != *tried);
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::{super::tests::recorded, *};
    use crate::plant::{
        PlantDef,
        command::Command,
        def::{Serial, Transport},
        diagnostics::{Conclusion, Diagnostic, Finding, Scan},
        event::Event,
        fixture,
        line_report::LineReport,
        port_signals::{OutputSignal, SignalTest},
    };

    const L1: LineId = LineId(0);

    fn at(second: i64) -> Timestamp {
        Timestamp::from_second(second).expect("a small number")
    }

    fn baud(baud: u32) -> LineDef {
        let transport = Transport::rtu("/dev/null", Serial { baud, ..Serial::USUAL });
        LineDef { transport, ..fixture::plant().lines[0].clone() }
    }

    fn plant() -> Plant {
        Plant::new(fixture::shared(), at(0), 1.0)
    }

    /// The line reports these settings.
    fn works_with(plant: &mut Plant, settings: &LineDef) {
        let report = Arc::new(LineReport::new(settings.clone()));
        plant.on_event(Event::Report { at: at(1), line: L1, report });
    }

    fn command(plant: &mut Plant, number: u32, kind: CommandKind) -> Effects {
        let id = CommandId { terminal: 1, number };
        plant.on_command(CommandStatus::new(Command::new(1, id, kind), "anna", at(1)), at(i64::from(number)))
    }

    /// Sends other settings, which the line accepts.
    fn try_out(plant: &mut Plant, number: u32, settings: LineDef) -> Effects {
        let mut effects = command(plant, number, CommandKind::Configure(Box::new(settings.clone())));
        assert_eq!(actions(&effects), [], "not before the line has it");
        effects.records.extend(plant.on_delivered(L1, &effects.bus[0].1).records);
        works_with(plant, &settings);
        effects
    }

    fn before(plant: &Plant) -> Option<LineDef> {
        plant.snapshot().line(L1).settings_before.as_deref().cloned()
    }

    fn actions(effects: &Effects) -> Vec<(String, String, String, String)> {
        let words = |action: &ActionRecord| {
            let new = action.new.as_deref().unwrap_or("").to_owned();
            (action.by.to_string(), action.action.to_string(), new, action.outcome.to_string())
        };
        recorded(effects).map(words).collect()
    }

    #[test]
    fn several_tries_are_taken_back_to_what_was_before_the_first() {
        let mut plant = plant();
        let at_first = plant.def.line(L1).clone();
        try_out(&mut plant, 1, baud(19_200));
        try_out(&mut plant, 2, baud(38_400));
        try_out(&mut plant, 3, LineDef { timeout: Duration::from_secs(2), ..baud(38_400) });
        assert_eq!(before(&plant), Some(at_first.clone()));
        let effects = try_out(&mut plant, 4, at_first.clone());
        assert_eq!(effects.bus, [(L1, BusRequest::Configure(Box::new(at_first)))]);
        assert_eq!(before(&plant), None, "there is nothing more to take back");
    }

    /// The station refuses what the form of the terminal and the plant file refuse.
    #[test]
    fn what_no_line_can_carry_is_refused_and_never_sent() {
        let used = fixture::plant().lines[0].clone();
        let scan = Scan { first: 1, last: 2, serials: Vec::new(), timeout: Duration::MAX };
        let rts = SignalTest { signal: OutputSignal::Rts, on: true, seconds: 10 };
        for kind in [
            CommandKind::Configure(Box::new(LineDef { timeout: Duration::MAX, ..used.clone() })),
            CommandKind::Configure(Box::new(LineDef { timeout: Duration::ZERO, ..used })),
            CommandKind::Configure(Box::new(baud(0))),
            CommandKind::Test(L1, Diagnostic::Scan(scan)),
            CommandKind::Test(L1, Diagnostic::Signal(SignalTest { seconds: 61, ..rts })),
            // As the settings in use have it, not those of the plant file.
            CommandKind::Test(L1, Diagnostic::Signal(rts)),
        ] {
            let mut plant = plant();
            if matches!(&kind, CommandKind::Test(_, Diagnostic::Signal(test)) if *test == rts) {
                let tcp = LineDef { transport: Transport::tcp("host", 502), ..plant.def.line(L1).clone() };
                let report = Arc::new(LineReport::new(tcp));
                plant.on_event(Event::Report { at: at(1), line: L1, report });
            }
            let effects = command(&mut plant, 1, kind.clone());
            assert_eq!(effects.bus, [], "{kind:?} goes to the line");
            let refused = actions(&effects);
            assert!(refused.len() == 1 && refused[0].3.starts_with("refused: "), "{refused:?}");
            assert_eq!(before(&plant), None, "nothing to take back");
        }
    }

    #[test]
    fn it_is_on_record_who_changed_a_line_and_to_what() {
        let mut plant = plant();
        let record = actions(&try_out(&mut plant, 1, baud(19_200)));
        let new = "RTU /dev/null 19200 8N1";
        assert_eq!(record, [("anna".into(), "configure".into(), new.into(), "in use".into())]);
        let effects = command(&mut plant, 2, CommandKind::StopTest(L1));
        let record = actions(&plant.on_delivered(L1, &effects.bus[0].1));
        assert_eq!(record, [("anna".into(), "stop test".into(), String::new(), "done".into())]);
        let test = CommandKind::Test(L1, crate::plant::diagnostics::Diagnostic::Send(vec![1, 3, 0, 0]));
        let effects = command(&mut plant, 3, test);
        let record = actions(&plant.on_delivered(L1, &effects.bus[0].1));
        assert_eq!((record.len(), &*record[0].3), (1, "started"), "nothing was read back");
    }

    /// A loopback that its line has taken.
    fn test_at_work(plant: &mut Plant) -> DiagnosticRun {
        let (id, diagnostic) =
            (CommandId { terminal: 1, number: 1 }, Diagnostic::Loopback { unit: 1, data: 0, count: 3 });
        let effects = command(plant, 1, CommandKind::Test(L1, diagnostic.clone()));
        let started = actions(&plant.on_delivered(L1, &effects.bus[0].1));
        assert_eq!((started.len(), &*started[0].3), (1, "started"));
        let (by, started, state, findings) = ("anna".into(), at(1), DiagnosticState::Running, Vec::new());
        let (done, total, requests, errors, now) = (2, 4, 2, 1, None);
        DiagnosticRun { id, by, diagnostic, started, done, total, requests, errors, now, state, findings }
    }

    fn report(plant: &mut Plant, run: &DiagnosticRun) -> Vec<(String, String, String, String)> {
        actions(&plant.on_event(Event::Diagnostic { at: at(5), line: L1, run: Arc::new(run.clone()) }))
    }

    #[test]
    fn a_test_has_an_outcome_of_its_own_once_it_ends() {
        let times = (Duration::from_millis(3), Duration::from_millis(4));
        let back = |back| vec![Finding::Conclusion(Conclusion::Loopback { back, sent: 3, times })];
        let why = DiagnosticState::Failed(LineTrouble::LineClosed);
        for (state, requests, errors, findings, expect) in [
            (DiagnosticState::Done, 4, 0, back(3), "passed: 4 requests, no errors; 3 of 3 came back, 3.0 to 4.0 ms"),
            (DiagnosticState::Done, 4, 1, back(2), "failed: 4 requests, 1 error; 2 of 3 came back, 3.0 to 4.0 ms"),
            (DiagnosticState::Cancelled, 1, 0, Vec::new(), "cancelled: 1 request, no errors"),
            (why, 3, 2, Vec::new(), "failed: 3 requests, 2 errors; the line was closed"),
        ] {
            let mut plant = plant();
            let run = test_at_work(&mut plant);
            assert_eq!(report(&mut plant, &run), [], "it is at work");
            let ended = report(&mut plant, &DiagnosticRun { state, requests, errors, findings, ..run.clone() });
            let (by, action, new) = ("anna".to_owned(), "end test".to_owned(), "loopback unit 1, 3 times".to_owned());
            assert_eq!(ended, [(by, action, new, expect.to_owned())]);
            let again = DiagnosticRun { state: DiagnosticState::Cancelled, ..run };
            assert_eq!(report(&mut plant, &again), [], "once");
        }
    }

    #[test]
    fn a_test_ends_with_its_line_and_with_its_station() {
        let mut plant = plant();
        let run = test_at_work(&mut plant);
        report(&mut plant, &run);
        let other = Arc::new(PlantDef { title: "Another".into(), ..fixture::plant() });
        assert_eq!(actions(&plant.redefine(&other, 2, at(6)).ended), [], "its line keeps running");
        let outcome = |effects: &Effects| actions(effects).into_iter().map(|action| action.3).collect::<Vec<_>>();
        let stopped = outcome(&plant.clone().on_stop());
        assert_eq!(stopped, ["failed: 2 requests, 1 error; the station stopped"]);
        let mut slower = fixture::plant();
        slower.lines[0].timeout += Duration::from_secs(1);
        let ended = outcome(&plant.redefine(&Arc::new(slower), 3, at(7)).ended);
        assert_eq!(ended, ["failed: 2 requests, 1 error; the plant file was reloaded"]);
        assert_eq!(outcome(&plant.on_stop()), [] as [&str; 0]);
    }

    #[test]
    fn a_command_refused_by_a_full_line_is_recorded() {
        let mut plant = plant();
        let test = CommandKind::Test(L1, crate::plant::diagnostics::Diagnostic::Identify { unit: 1 });
        for (number, kind) in
            [(1, CommandKind::Configure(Box::new(baud(19_200)))), (2, test), (3, CommandKind::StopTest(L1))]
        {
            let effects = command(&mut plant, number, kind);
            assert_eq!(actions(&effects), []);
            let refused = actions(&plant.on_undeliverable(L1, &effects.bus[0].1));
            assert!(refused.len() == 1 && refused[0].3.starts_with("refused"), "{refused:?}");
        }
    }

    #[test]
    fn what_is_saved_is_what_the_line_works_with() {
        let mut plant = plant();
        try_out(&mut plant, 1, baud(19_200));
        let effects = command(&mut plant, 2, CommandKind::SaveSettings(L1));
        let id = CommandId { terminal: 1, number: 2 };
        assert_eq!(effects.save, Some((id, baud(19_200))));
        assert_eq!(actions(&effects), [], "not before it is done");
        assert!(before(&plant).is_some());
        let saved = plant.on_saved(id, &baud(19_200), Ok(()));
        let action = ("anna".to_owned(), "save settings".to_owned(), String::new(), "saved to plant file".to_owned());
        assert_eq!(actions(&saved), [action]);
        assert_eq!(before(&plant), None);
    }

    #[test]
    fn settings_that_were_not_saved_can_still_be_taken_back() {
        let mut plant = plant();
        try_out(&mut plant, 1, baud(19_200));
        command(&mut plant, 2, CommandKind::SaveSettings(L1));
        let effects =
            plant.on_saved(CommandId { terminal: 1, number: 2 }, &baud(19_200), Err("the disk is full".into()));
        assert_eq!(actions(&effects)[0].3, "refused: not saved: the disk is full");
        assert!(before(&plant).is_some());
    }
}
