//! Commands of operators: checked, sent on, followed to their outcome and put on record.

use std::{collections::VecDeque, sync::Arc, time::Duration};

use jiff::Timestamp;

use super::{
    alarm::{AlarmCommand, manager::subject_name},
    command::{BusRequest, Command, CommandId, CommandKind, CommandStatus, NotConfirmed, Outcome, Refusal, WriteId},
    def::{AlarmId, LineId, PlantDef, TagId},
    event::{Fault, WriteResult},
    interlock,
    process_image::ProcessImage,
    record::{ActionRecord, WRITE_REQUESTED},
    scale,
    tag::TagDef,
};

/// The word on record for a plant that was handed over to the next shift.
pub const HAND_OVER: &str = "hand over";
/// The word on record for a plant that was taken over from the shift before.
pub const TAKE_OVER: &str = "take over";

/// Commands that a snapshot shows.
const SHOWN: usize = 32;
/// A write that has heard nothing for so long is given up: it may or may not have taken effect.
const PENDING_MAX: Duration = Duration::from_secs(120);

/// A write that may go to the bus: its raw number, what must be written first, and whether it is a stop.
struct Checked {
    raw: f64,
    unlock: Option<(TagId, f64)>,
    urgent: bool,
}

/// Tracks commands from request to outcome.
#[derive(Debug, Clone)]
pub struct CommandTracker {
    def: Arc<PlantDef>,
    /// Newest first.
    commands: VecDeque<CommandStatus>,
    /// Writes under way: id on the bus, command, tag, raw number sent.
    writes: Vec<(WriteId, CommandId, TagId, f64)>,
    last_write: u64,
}

impl CommandTracker {
    /// No command yet.
    pub fn new(def: Arc<PlantDef>) -> CommandTracker {
        CommandTracker { def, commands: VecDeque::new(), writes: Vec::new(), last_write: 0 }
    }

    /// The latest commands, newest first.
    pub fn commands(&self) -> impl Iterator<Item = &CommandStatus> {
        self.commands.iter()
    }

    /// The same, for a snapshot.
    pub fn shown(&self) -> Vec<CommandStatus> {
        self.commands.iter().cloned().collect()
    }

    /// Checks a write. `Ok` is the request for the bus; a command that needs none, or may not be, is closed at once.
    pub fn write(
        &mut self,
        image: &ProcessImage,
        command: &Command,
        tag: TagId,
        value: f64,
        at: Timestamp,
    ) -> Result<BusRequest, Option<Box<ActionRecord>>> {
        let old = image.sample(tag).value;
        let checked = self.check(image, tag, value);
        let checked = checked.and_then(|checked| self.not_overtaken(image, command, tag, checked));
        // What is shown and recorded is what the device will hold, not what was typed.
        let def = self.def.tag(tag);
        let held = image.scaling_decimals(def).and_then(|decimals| scale::held(def, value, decimals));
        let kind = CommandKind::Write { tag, value: held.unwrap_or(value) };
        self.open(&Command { kind, ..command.clone() }, old, at);
        match checked {
            Err(outcome) => Err(self.close(command.id, outcome, image).map(Box::new)),
            Ok(Checked { raw, unlock, urgent }) => {
                self.last_write += 1;
                let id = WriteId(self.last_write);
                self.writes.push((id, command.id, tag, raw));
                let verify = self.def.tag(tag).access != super::tag::Access::Write;
                Ok(BusRequest::Write { id, tag, raw, unlock, verify, urgent })
            }
        }
    }

    /// Takes a command whose outcome somebody else will tell.
    pub fn take(&mut self, command: &Command, at: Timestamp) {
        self.open(command, None, at);
    }

    /// A command has come to its end.
    pub fn end(&mut self, id: CommandId, outcome: Outcome, image: &ProcessImage) -> Option<ActionRecord> {
        self.close(id, outcome, image)
    }

    /// A line is open (or trying to be) or closed: commands that asked for it are done.
    pub fn connected(&mut self, line: LineId, open: bool, image: &ProcessImage) -> Option<ActionRecord> {
        let requested = CommandKind::Connect(line, open);
        let waits = |status: &&CommandStatus| status.kind == requested && status.outcome == Outcome::Pending;
        let id = self.commands.iter().find(waits)?.id;
        self.close(id, Outcome::Verified, image)
    }

    /// How a command stands, unless it is forgotten.
    pub fn outcome_of(&self, id: CommandId) -> Option<&Outcome> {
        self.commands.iter().find(|status| status.id == id).map(|status| &status.outcome)
    }

    /// The tag that a write under way writes.
    pub fn tag_of(&self, id: WriteId) -> Option<TagId> {
        self.writes.iter().find(|write| write.0 == id).map(|write| write.2)
    }

    /// Takes a command that needs nothing but to be on record.
    pub fn note(
        &mut self,
        command: &Command,
        outcome: Outcome,
        image: &ProcessImage,
        at: Timestamp,
    ) -> Option<ActionRecord> {
        self.open(command, None, at);
        self.close(command.id, outcome, image)
    }

    /// The key that a write needs was sent before it, which is an action of its own.
    pub fn unlocked(
        &mut self,
        id: WriteId,
        key: TagId,
        result: &WriteResult,
        image: &ProcessImage,
        at: Timestamp,
    ) -> Option<ActionRecord> {
        let (_, command, tag, _) = self.writes.iter().find(|write| write.0 == id)?;
        let status = self.commands.iter().find(|status| status.id == *command)?;
        let (key, tag) = (self.def.tag(key), self.def.tag(*tag));
        let outcome = match result {
            WriteResult::Refused(code) => Outcome::Refused(Refusal::Exception(*code)),
            WriteResult::Lost(fault) => Outcome::NotConfirmed(NotConfirmed::NotAnswered(*fault)),
            WriteResult::NotSent(fault) => Outcome::Refused(Refusal::NotSent(*fault)),
            WriteResult::Overtaken => Outcome::Refused(Refusal::Overtaken),
            WriteResult::Accepted | WriteResult::ReadBack(_) | WriteResult::Held(_) | WriteResult::NotRead(_) => {
                Outcome::NotConfirmed(NotConfirmed::NoReadBack)
            }
        };
        Some(ActionRecord {
            at,
            by: status.by.clone(),
            from: status.from.clone(),
            action: "unlock".into(),
            target: key.name.as_str().into(),
            old: image.sample(key.id).value.map(|old| value_words(image, key, old).into()),
            new: tag.write_unlock.map(|(_, new)| value_words(image, key, new).into()),
            outcome: format!("{}; for {}", outcome_words(&outcome), tag.name).into(),
            note: None,
            chain_hash: None,
        })
    }

    /// A write came to its end on the wire.
    pub fn wrote(&mut self, id: WriteId, result: WriteResult, image: &ProcessImage) -> Option<ActionRecord> {
        let index = self.writes.iter().position(|write| write.0 == id)?;
        let (_, command, tag, raw) = self.writes.swap_remove(index);
        let def = self.def.tag(tag);
        let value = |back| scale::to_value(def, back, image.scaling_decimals(def).unwrap_or(0));
        let outcome = match result {
            WriteResult::ReadBack(back) | WriteResult::Held(back) if scale::same_raw(def, raw, back) => {
                Outcome::Verified
            }
            WriteResult::ReadBack(back) => Outcome::NotConfirmed(NotConfirmed::Different(value(back))),
            WriteResult::Held(back) => Outcome::NotConfirmed(NotConfirmed::NotApplied(value(back))),
            WriteResult::NotRead(fault) => Outcome::NotConfirmed(NotConfirmed::NotRead(fault)),
            WriteResult::Accepted => Outcome::NotConfirmed(NotConfirmed::NoReadBack),
            WriteResult::Refused(code) => Outcome::Refused(Refusal::Exception(code)),
            WriteResult::Lost(fault) => Outcome::NotConfirmed(NotConfirmed::NotAnswered(fault)),
            WriteResult::NotSent(fault) => Outcome::Refused(Refusal::NotSent(fault)),
            WriteResult::Overtaken => Outcome::Refused(Refusal::Overtaken),
        };
        self.close(command, outcome, image)
    }

    /// A line has taken a request: what asks for no answer is done.
    pub fn delivered(&mut self, line: LineId, request: &BusRequest, image: &ProcessImage) -> Option<ActionRecord> {
        let id = self.of_line(line, request)?;
        self.close(id, Outcome::Verified, image)
    }

    /// The command under way behind a request to a line that asks for no answer.
    fn of_line(&self, line: LineId, request: &BusRequest) -> Option<CommandId> {
        let asks = |status: &&CommandStatus| match (request, &status.kind) {
            (BusRequest::Test { id, .. }, _) => status.id == *id,
            (BusRequest::Configure(requested), CommandKind::Configure(settings)) => requested == settings,
            (BusRequest::StopTest, CommandKind::StopTest(tested)) => *tested == line,
            _ => false,
        };
        let mut under_way = self.commands.iter().filter(|status| status.outcome == Outcome::Pending);
        under_way.find(asks).map(|status| status.id)
    }

    /// The line had no room for a request: nothing was sent, and the command is refused.
    pub fn undeliverable(&mut self, line: LineId, request: &BusRequest, image: &ProcessImage) -> Option<ActionRecord> {
        let busy = Outcome::Refused(Refusal::Busy);
        match request {
            BusRequest::Write { id, .. } => {
                let index = self.writes.iter().position(|write| write.0 == *id)?;
                let (_, command, ..) = self.writes.swap_remove(index);
                self.close(command, busy, image)
            }
            BusRequest::Connect(open) => {
                let requested = CommandKind::Connect(line, *open);
                let id = self.commands.iter().find(|status| status.kind == requested)?.id;
                self.close(id, busy, image)
            }
            // One that nobody requested is nobody's: the device is read again in its turn.
            BusRequest::Refresh { command, .. } => {
                let command = (*command)?;
                self.commands.iter_mut().find(|status| status.id == command)?.outcome = busy;
                None
            }
            BusRequest::Configure(_) | BusRequest::Test { .. } | BusRequest::StopTest => {
                let id = self.of_line(line, request)?;
                self.close(id, busy, image)
            }
        }
    }

    /// Gives up commands that nobody has answered for. The bus waits in real time, so `speed` is plant seconds per real one.
    pub fn expire(&mut self, at: Timestamp, speed: f64, image: &ProcessImage) -> Vec<ActionRecord> {
        let late = |status: &CommandStatus| {
            status.outcome == Outcome::Pending
                // Its writes are given up one by one.
                && !matches!(status.kind, CommandKind::Restore(_))
                && PENDING_MAX.mul_f64(speed) < Duration::try_from(at.duration_since(status.at)).unwrap_or_default()
        };
        let outcome = |status: &CommandStatus| match status.kind.written() {
            Some(_) => Outcome::NotConfirmed(NotConfirmed::NotAnswered(Fault::Timeout)),
            None => Outcome::Failed(Fault::Timeout),
        };
        let late = self.commands.iter().filter(|status| late(status)).map(|status| (status.id, outcome(status)));
        let late: Vec<(CommandId, Outcome)> = late.collect();
        self.writes.retain(|write| late.iter().all(|(id, _)| *id != write.1));
        late.into_iter().filter_map(|(id, outcome)| self.close(id, outcome, image)).collect()
    }

    /// The station ends: nobody can answer for what is still under way.
    pub fn stop(&mut self, image: &ProcessImage) -> Vec<ActionRecord> {
        self.writes.clear();
        let pending = self.commands.iter().rev().filter(|status| status.outcome == Outcome::Pending);
        let ids: Vec<CommandId> = pending.map(|status| status.id).collect();
        let stopped = || Outcome::NotConfirmed(NotConfirmed::StationStopped);
        ids.into_iter().filter_map(|id| self.close(id, stopped(), image)).collect()
    }

    /// The record that a write is about to be sent: whatever ends the station then, it was tried.
    pub fn intent(&self, request: &BusRequest, image: &ProcessImage) -> Option<ActionRecord> {
        let BusRequest::Write { id, .. } = request else { return None };
        let command = self.writes.iter().find(|write| write.0 == *id)?.1;
        let status = self.commands.iter().find(|status| status.id == command)?;
        Some(ActionRecord {
            action: WRITE_REQUESTED.into(),
            outcome: outcome_word(&Outcome::Pending).into(),
            ..record(&self.def, status, image)
        })
    }

    /// Refuses a write over a value that its operator has not seen. A stop is right whatever stood there.
    fn not_overtaken(
        &self,
        image: &ProcessImage,
        command: &Command,
        tag: TagId,
        checked: Checked,
    ) -> Result<Checked, Outcome> {
        let def = self.def.tag(tag);
        let now = image.good_raw(tag).zip(image.scaling_decimals(def)).filter(|_| !checked.urgent);
        let Some((raw, decimals)) = now else { return Ok(checked) };
        let now = scale::to_value(def, raw, decimals);
        let same_raw = |seen| scale::to_raw(def, seen, decimals).is_some_and(|seen| scale::same_raw(def, seen, raw));
        match command.seen {
            Some(seen) if same_raw(seen) => Ok(checked),
            Some(_) => Err(Outcome::Refused(Refusal::ChangedTo(value_words(image, def, now)))),
            None => Err(Outcome::Refused(Refusal::NotSeen(value_words(image, def, now)))),
        }
    }

    /// Checks a write against access, choices, bounds, type and what is under way.
    fn check(&self, image: &ProcessImage, tag: TagId, value: f64) -> Result<Checked, Outcome> {
        let refuse = |refusal| Err(Outcome::Refused(refusal));
        let def = self.def.tag(tag);
        if !def.writable() {
            return refuse(Refusal::ReadOnly);
        }
        let decimals = image.scaling_decimals(def);
        let held = decimals.and_then(|decimals| scale::held(def, value, decimals));
        let urgent = held.is_some_and(|held| interlock::is_stop(&self.def, tag, held));
        let mut under_way = self.writes.iter().filter(|write| write.2 == tag).map(|write| write.3).peekable();
        let is_busy = under_way.peek().is_some();
        // A stop need not wait for the start under way; the same stop twice would only take the line's time.
        let same = |raw| decimals.map(|decimals| scale::to_value(def, raw, decimals)) == held;
        if is_busy && (!urgent || under_way.any(same)) {
            return refuse(Refusal::UnderWay);
        }
        if !def.labels.is_empty() && def.label_of(value).is_none() {
            return refuse(Refusal::NotAChoice);
        }
        if let Some(lock) = self.def.logic.refusal(tag, held.unwrap_or(value), |tag| image.sample(tag)) {
            return refuse(Refusal::Interlock(lock.message.clone()));
        }
        let bound = |bound: Option<super::tag::Bound>| bound.map(|bound| image.bound(bound)).transpose();
        let unknown = |tag: TagId| Outcome::Refused(Refusal::Unknown(self.def.tag(tag).name.clone()));
        let (min, max) = (bound(def.min).map_err(unknown)?, bound(def.max).map_err(unknown)?);
        let Some(decimals) = decimals else {
            return refuse(Refusal::Unknown("number of decimals".into()));
        };
        // A limit holds for what is sent: rounding must not lead beyond it, nor hide that more was asked for.
        let inside = scale::is_inside(min, max, value) && held.is_none_or(|held| scale::is_inside(min, max, held));
        let raw = scale::to_raw(def, value, decimals).filter(|_| inside);
        let Some(raw) = raw else {
            let shown = usize::from(image.shown_decimals(def));
            let text = |bound: Option<f64>, none: &str| bound.map_or(none.into(), |bound| format!("{bound:.shown$}"));
            return refuse(Refusal::OutOfRange { min: text(min, "−∞"), max: text(max, "∞") });
        };
        // What was read before the write under way says nothing about the time after it.
        if !is_busy && image.good_raw(tag).is_some_and(|now| scale::same_raw(def, now, raw)) {
            return Err(Outcome::Unchanged);
        }
        let raw_of = |key, value| scale::to_raw(self.def.tag(key), value, 0).unwrap_or(value);
        let unlock = def.write_unlock.map(|(key, value)| (key, raw_of(key, value)));
        // A key that is turned already stays so, unless somebody is just turning it.
        let unlock = unlock.filter(|(key, turned)| {
            let moving = self.writes.iter().any(|write| write.2 == *key);
            let now = image.good_raw(*key).filter(|_| !moving);
            now.is_none_or(|now| !scale::same_raw(self.def.tag(*key), now, *turned))
        });
        Ok(Checked { raw, unlock, urgent })
    }

    fn open(&mut self, command: &Command, old: Option<f64>, at: Timestamp) {
        self.commands.push_front(CommandStatus {
            id: command.id,
            by: command.by.clone(),
            from: command.from.clone(),
            note: command.note.clone(),
            kind: command.kind.clone(),
            at,
            old,
            outcome: Outcome::Pending,
            recorded: true,
        });
        // A command under way is never forgotten, however many come after it.
        while SHOWN < self.commands.len() {
            let Some(index) = self.commands.iter().rposition(|status| status.outcome != Outcome::Pending) else {
                break;
            };
            self.commands.remove(index);
        }
    }

    fn close(&mut self, id: CommandId, outcome: Outcome, image: &ProcessImage) -> Option<ActionRecord> {
        let status = self.commands.iter_mut().find(|status| status.id == id && status.outcome == Outcome::Pending)?;
        status.outcome = outcome;
        Some(record(&self.def, status, image))
    }
}

/// The words of an outcome, the same on screen, in the history and in CSV.
pub fn outcome_words(outcome: &Outcome) -> String {
    let word = outcome_word(outcome);
    match outcome {
        Outcome::Pending | Outcome::Verified => word.into(),
        Outcome::Unchanged => format!("{word}, not written"),
        Outcome::Refused(why) => format!("{word}: {why}"),
        Outcome::NotConfirmed(why) => format!("{word}: {why}"),
        Outcome::Failed(fault) => format!("{word}: {fault}"),
    }
}

/// The same without the reason.
pub fn outcome_word(outcome: &Outcome) -> &'static str {
    match outcome {
        Outcome::Pending => "pending",
        Outcome::Verified => "verified",
        Outcome::Unchanged => "unchanged",
        Outcome::Refused(_) => "refused",
        Outcome::NotConfirmed(_) => "not confirmed",
        Outcome::Failed(_) => "failed",
    }
}

fn record(def: &PlantDef, status: &CommandStatus, image: &ProcessImage) -> ActionRecord {
    let (action, target, new): (&str, String, Option<String>) = match &status.kind {
        CommandKind::Write { tag, value } => {
            let tag = def.tag(*tag);
            ("write", tag.name.clone(), Some(value_words(image, tag, *value)))
        }
        CommandKind::Alarm(alarm_command) => alarm_words(def, alarm_command),
        CommandKind::Refresh(device) => ("refresh", def.device(*device).name.clone(), None),
        CommandKind::Connect(line, true) => ("connect", def.line(*line).name.clone(), None),
        CommandKind::Connect(line, false) => ("disconnect", def.line(*line).name.clone(), None),
        CommandKind::Configure(settings) => ("configure", settings.name.clone(), Some(settings.transport.to_string())),
        CommandKind::SaveSettings(line) => ("save settings", def.line(*line).name.clone(), None),
        CommandKind::Test(line, diagnostic) => ("test", def.line(*line).name.clone(), Some(diagnostic.to_string())),
        CommandKind::StopTest(line) => ("stop test", def.line(*line).name.clone(), None),
        CommandKind::ReadSets => ("read sets", "parameter sets".into(), None),
        CommandKind::SaveSet { device, name, .. } => {
            ("save set", def.device(*device).name.clone(), Some(name.to_string()))
        }
        CommandKind::Restore(request) => {
            let new = format!("{}: {} changes", request.from, request.changes.len());
            ("restore set", def.device(request.device).name.clone(), Some(new))
        }
        CommandKind::StopRestore(device) => ("stop restore", def.device(*device).name.clone(), None),
        CommandKind::HandOver => (HAND_OVER, def.name.clone(), None),
        CommandKind::TakeOver => (TAKE_OVER, def.name.clone(), None),
    };
    let old = status.old.zip(status.kind.written());
    let old = old.map(|(old, (tag, _))| value_words(image, def.tag(tag), old));
    ActionRecord {
        at: status.at,
        by: status.by.clone(),
        from: status.from.clone(),
        action: action.into(),
        target: target.into(),
        old: old.map(Into::into),
        new: new.map(Into::into),
        outcome: outcome_words(&status.outcome).into(),
        note: status.note.clone(),
        chain_hash: None,
    }
}

/// Action, target and new state of an action on alarms.
pub fn alarm_words(def: &PlantDef, alarm_command: &AlarmCommand) -> (&'static str, String, Option<String>) {
    let name = |alarm: &AlarmId| match def.alarms.get(alarm.index()) {
        Some(alarm) => format!("{} {}", subject_name(def, alarm.subject), alarm.message),
        None => format!("alarm {}", alarm.0),
    };
    match alarm_command {
        AlarmCommand::Acknowledge { alarm, .. } => ("acknowledge", name(alarm), None),
        AlarmCommand::AcknowledgeAll { seen } => {
            let target = if let [(one, _)] = &**seen { name(one) } else { format!("{} alarms", seen.len()) };
            ("acknowledge", target, None)
        }
        AlarmCommand::Silence => ("silence", "alarms".into(), None),
        AlarmCommand::Reset(alarm) => ("reset", name(alarm), None),
        AlarmCommand::Shelve { alarm, lasts } => {
            ("shelve", name(alarm), Some(format!("for {} min", lasts.as_secs().div_ceil(60))))
        }
        AlarmCommand::Unshelve(alarm) => ("unshelve", name(alarm), None),
        AlarmCommand::OutOfService(alarm) => ("out of service", name(alarm), None),
        AlarmCommand::InService(alarm) => ("in service", name(alarm), None),
    }
}

/// A value as text with label or unit.
fn value_words(image: &ProcessImage, tag: &TagDef, value: f64) -> String {
    match tag.label_of(value) {
        Some(label) => label.to_owned(),
        None => {
            let unit = tag.unit_now(|tag| image.sample(tag));
            format!("{value:.*} {unit}", usize::from(image.shown_decimals(tag))).trim_end().to_owned()
        }
    }
}
