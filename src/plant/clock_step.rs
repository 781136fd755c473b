//! What leaves the plant after the system clock was set: its times, moved from the plant's steady time to UTC.
//!
//! Inside, time never jumps, so that no delay ends early and no value grows old by a clock that was set. `by` is what the
//! steady time lacks of UTC: zero until the first step.

use std::sync::Arc;

use jiff::{SignedDuration, Timestamp};

use super::{
    alarm::{ActiveAlarm, AlarmCommand, SuppressedAlarm, state::OperatorNote},
    command::CommandKind,
    control_run::ControlRun,
    line_state::{DeviceState, LineState},
    record::{AlarmRecord, FirstOut, Record},
    restore::Restore,
    snapshot::{DeviceStatus, LineStatus, Snapshot},
    tuning::Tuning,
};

impl ControlRun {
    fn move_by(&mut self, by: SignedDuration) {
        [&mut self.from, &mut self.until].into_iter().for_each(|at| move_by(at, by));
    }
    /// The same in the plant's own time, of which UTC is so much ahead.
    pub fn move_from_utc(&mut self, by: SignedDuration) {
        self.move_by(-by);
    }
}

/// Moves an instant; one that would leave the calendar stays.
fn move_by(at: &mut Timestamp, by: SignedDuration) {
    *at = at.checked_add(by).unwrap_or(*at);
}

impl Record {
    /// The same in UTC.
    pub fn move_to_utc(&mut self, by: SignedDuration) {
        match self {
            Record::Sample(_, sample) => move_by(&mut sample.at, by),
            Record::Alarm(event) => event.move_to_utc(by),
            Record::Action(action) => move_by(&mut action.at, by),
            Record::Line(minute) => move_by(&mut minute.at, by),
            Record::Batch(batch) => move_by(&mut batch.at, by),
            Record::Run(run) => run.move_by(by),
            Record::Report(report) => move_by(&mut report.at, by),
            Record::ClockSet => {}
        }
    }
}

impl AlarmRecord {
    /// The same in UTC.
    pub fn move_to_utc(&mut self, by: SignedDuration) {
        move_by(&mut self.at, by);
        self.until.iter_mut().for_each(|until| move_by(until, by));
        move_first_out(&mut self.first_out, by);
    }
}

fn move_first_out(first_out: &mut Option<FirstOut>, by: SignedDuration) {
    first_out.iter_mut().for_each(|first_out| move_by(&mut first_out.began, by));
}

fn move_note(note: &mut OperatorNote, by: SignedDuration) {
    move_by(&mut note.at, by);
}

impl CommandKind {
    /// The same in the plant's own time: what names an alarm by the instant that a snapshot showed.
    pub fn move_from_utc(&mut self, by: SignedDuration) {
        let CommandKind::Alarm(command) = self else { return };
        match command {
            AlarmCommand::Acknowledge { annunciated_at: at, .. } | AlarmCommand::Tick { raised_at: at, .. } => {
                move_by(at, -by);
            }
            AlarmCommand::AcknowledgeAll { .. }
            | AlarmCommand::Silence
            | AlarmCommand::Reset(_)
            | AlarmCommand::Shelve { .. }
            | AlarmCommand::Unshelve(_)
            | AlarmCommand::OutOfService(_)
            | AlarmCommand::InService(_) => {}
        }
    }
}

impl Snapshot {
    /// The same in UTC. What the bus has noted (frames, requests, last bytes) is in UTC already.
    pub fn move_to_utc(&mut self, by: SignedDuration) {
        if by.is_zero() {
            return;
        }
        self.stepped = self.stepped.saturating_add(by);
        move_by(&mut self.at, by);
        self.samples.iter_mut().for_each(|sample| move_by(&mut sample.at, by));
        self.lines.iter_mut().for_each(|line| line.move_to_utc(by));
        self.devices.iter_mut().for_each(|device| device.move_to_utc(by));
        Arc::make_mut(&mut self.alarms).iter_mut().for_each(|alarm| alarm.move_to_utc(by));
        Arc::make_mut(&mut self.suppressed).iter_mut().for_each(|alarm| alarm.move_to_utc(by));
        self.alarm_metrics.flood_since.iter_mut().for_each(|since| move_by(since, by));
        let day = Arc::make_mut(&mut self.alarm_metrics.day);
        move_by(&mut day.from, by);
        move_by(&mut day.until, by);
        self.commands.iter_mut().for_each(|status| {
            move_by(&mut status.at, by);
            move_by(&mut status.outcome_at, by);
            status.command.kind.move_from_utc(-by);
        });
        self.actuators.times().for_each(|since| move_by(since, by));
        self.restores.iter_mut().for_each(|run| {
            let at: &mut Restore = Arc::make_mut(run);
            move_by(&mut at.at, by);
        });
        self.tunings.iter_mut().flatten().for_each(|tuning| {
            let tuning: &mut Tuning = Arc::make_mut(tuning);
            tuning.times().for_each(|at| move_by(at, by));
        });
        self.runs.iter_mut().flatten().for_each(|run| Arc::make_mut(run).move_by(by));
        self.procedures.iter_mut().flatten().for_each(|run| {
            Arc::make_mut(run).times().for_each(|at| move_by(at, by));
        });
    }
}

impl LineStatus {
    fn move_to_utc(&mut self, by: SignedDuration) {
        if let LineState::Waiting { retry_at, .. } = &mut self.state {
            move_by(retry_at, by);
        }
        self.since.iter_mut().chain(&mut self.lost_since).for_each(|at| move_by(at, by));
    }
}

impl DeviceStatus {
    fn move_to_utc(&mut self, by: SignedDuration) {
        if let DeviceState::Down { since } = &mut self.state {
            move_by(since, by);
        }
        self.last_fault.iter_mut().for_each(|(at, _)| move_by(at, by));
    }
}

impl ActiveAlarm {
    fn move_to_utc(&mut self, by: SignedDuration) {
        let times = [&mut self.raised_at, &mut self.annunciated_at].into_iter().chain(&mut self.returned_at);
        times.for_each(|at| move_by(at, by));
        self.acknowledged.iter_mut().chain(&mut self.steps).for_each(|note| move_note(note, by));
        move_first_out(&mut self.first_out, by);
    }
}

impl SuppressedAlarm {
    fn move_to_utc(&mut self, by: SignedDuration) {
        move_note(&mut self.note, by);
        self.until.iter_mut().for_each(|until| move_by(until, by));
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::plant::{
        Plant,
        command::{Command, CommandId, CommandStatus, Outcome},
        event::Event,
        fault::Fault,
        fixture::{self, DP, FAULT, PV, SV, TIC},
    };

    const YEARS: SignedDuration = SignedDuration::from_hours(24 * 365 * 56);

    fn at(second: i64) -> Timestamp {
        Timestamp::from_second(second).expect("a small number")
    }

    fn values(second: i64) -> Event {
        let values = fixture::raw([(PV, 700.0), (SV, 700.0), (DP, 1.0), (FAULT, 0.0)]);
        let response_time = Duration::from_millis(12);
        Event::Read { at: at(second), device: TIC, values, texts: Vec::new(), response_time, exchange: None }
    }

    #[test]
    fn a_set_clock_ages_no_value_and_keeps_acknowledgements() {
        for by in [YEARS, -YEARS] {
            let mut plant = Plant::new(fixture::shared(), at(1_000_000), 1.0);
            plant.on_event(values(1_000_000));
            plant.on_tick(at(1_000_003));
            let (age, good) = (plant.snapshot().age(PV), plant.snapshot().sample(PV).quality);
            let mut snapshot = plant.snapshot();
            snapshot.move_to_utc(by);
            assert_eq!(snapshot.at, at(1_000_003) + by);
            assert_eq!((snapshot.age(PV), snapshot.sample(PV).quality), (age, good));
            let tags = fixture::plant().tags_of(TIC).map(|tag| tag.id).collect();
            let silent =
                Event::Failed { at: at(1_000_004), device: TIC, tags, fault: Fault::BackedOff, exchange: None };
            let mut records = plant.on_event(silent).records;
            records.iter_mut().for_each(|record| record.move_to_utc(by));
            let Some(Record::Alarm(raised)) = records.iter().find(|record| matches!(record, Record::Alarm(_))) else {
                panic!("no alarm: {records:?}")
            };
            let mut snapshot = plant.snapshot();
            snapshot.move_to_utc(by);
            assert_eq!((raised.at, snapshot.alarms[0].raised_at), (at(1_000_004) + by, at(1_000_004) + by));
            // What a terminal sends is what it was shown.
            let mut kind = snapshot.alarms[0].acknowledge();
            kind.move_from_utc(by);
            let id = CommandId { terminal: 1, number: 1 };
            plant.on_command(CommandStatus::new(Command::new(1, id, kind), "anna", at(0)), at(1_000_005));
            let mut snapshot = plant.snapshot();
            snapshot.move_to_utc(by);
            assert_eq!(snapshot.commands[0].outcome, Outcome::Verified);
            assert_eq!(snapshot.alarms[0].acknowledged.as_ref().map(|note| note.at), Some(at(1_000_005) + by));
        }
    }
}
