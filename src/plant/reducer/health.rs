//! Health over time: a minute of each line for the history, the diagnosis of each device.

use jiff::Timestamp;

use super::Plant;
use crate::plant::{
    command::{BusRequest, CommandKind, Outcome},
    def::{DeviceId, LineId, TagId},
    ne107::{self, DiagnosisInput},
    record::Record,
    scale,
    snapshot::DeviceStatus,
    time::elapsed,
    tuning::Noticed,
};

impl Plant {
    /// The minutes of lines that end now.
    pub(super) fn minutes(&mut self, at: Timestamp) -> Vec<Record> {
        let lines = self.def.lines.iter().zip(&self.lines).zip(&mut self.line_minutes);
        let minutes = lines.filter_map(|((def, line), tracker)| tracker.tick(at, &def.name, line.report.as_ref()?));
        minutes.map(Record::Line).collect()
    }

    /// Follows auto-tunings and programs; reads the result of a tuning as soon as it ends.
    pub(super) fn watch_controllers(&mut self) -> Vec<(LineId, BusRequest)> {
        let (image, at) = (&self.image, self.at);
        let sample = |tag: TagId| image.sample(tag);
        let mut asked = Vec::new();
        for device in &self.def.devices {
            let pv = device.faceplate.as_ref().map(|plate| self.def.tag(plate.pv));
            let limits = pv.and_then(|pv| pv.limits(|tag| sample(tag).good_exact()).ok());
            let span = limits.and_then(|(min, max)| Some((max? - min?).near()));
            if self.tunings[device.id.index()].observe(device, &sample, span, at) == Noticed::Ended {
                asked.push((device.line, BusRequest::Refresh { device: device.id, command: None }));
            }
            if let Some(program) = &device.program {
                let (position, command) = (sample(program.position).good_value(), sample(program.command).good_value());
                self.programs[device.id.index()].observe(program, position, command, at);
            }
        }
        asked
    }

    /// Every device with its diagnosis.
    pub(super) fn diagnosed(&self) -> Vec<DeviceStatus> {
        let diagnosed = |(def, status): (&crate::plant::def::DeviceDef, &DeviceStatus)| {
            let line = &self.lines[def.line.index()];
            let tracker = &self.line_minutes[def.line.index()];
            let report = line.report.as_deref();
            let lately = report.map(|report| tracker.lately(report, def.id)).unwrap_or_default();
            let settings = report.map_or(self.def.line(def.line), |report| &report.settings);
            let timeout = (!settings.listens).then_some(settings.timeout);
            let settling = self.settling(def.id);
            let time = report.and_then(|report| report.device_time(def.id));
            let input =
                DiagnosisInput { device: status.state, line: &line.state, settling, lately: &lately, timeout, time };
            DeviceStatus { diagnosis: ne107::evaluate(input), ..*status }
        };
        self.def.devices.iter().zip(&self.devices).map(diagnosed).collect()
    }

    /// Is a device busy with an action (saving its settings)?
    fn settling(&self, device: DeviceId) -> bool {
        let actions = &self.def.device(device).actions;
        self.commands.commands().any(|status| match (&status.command.kind, &status.outcome) {
            (
                CommandKind::Write { tag, value },
                Outcome::Verified | Outcome::Sent | Outcome::NotConfirmed(_) | Outcome::Failed(_),
            ) => {
                let age = elapsed(status.at, self.at);
                let (def, decimals) =
                    (self.def.tag(*tag), self.image.scaling_decimals(self.def.tag(*tag)).unwrap_or(0));
                let is_it = |rule: f64| scale::is_sent_as(def, *value, rule.into(), decimals);
                actions.iter().any(|action| action.tag == *tag && is_it(action.value) && age < action.settle)
            }
            _ => false,
        })
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use std::sync::Arc;

    use super::*;
    use crate::plant::{
        command::{Command, CommandId, CommandStatus},
        def::{ActionDef, LineId},
        event::{Event, WriteResult},
        fixture::{self, DP, PLC, PV, SV, TIC},
        id::WriteId,
        line_state::LineState,
        ne107::Reason,
    };

    fn at(second: i64) -> Timestamp {
        Timestamp::from_second(second).expect("a small number")
    }

    #[test]
    fn a_device_that_saves_its_settings_is_not_broken() {
        let mut def = fixture::plant();
        let settle = Duration::from_secs(5);
        def.devices[0].actions = vec![ActionDef {
            name: "FIX".into(),
            tag: SV,
            value: 1.0,
            settle,
            confirm: String::new(),
            stop: false,
            saves: true,
            role: None,
        }];
        let mut plant = Plant::new(Arc::new(def), at(0), 1.0);
        plant.on_event(Event::Line { at: at(0), line: LineId(0), state: LineState::Connected });
        let values = fixture::raw([(PV, 700.0), (DP, 1.0)]);
        let response_time = Duration::from_millis(12);
        plant.on_event(Event::Read {
            at: at(0),
            device: TIC,
            values,
            texts: Vec::new(),
            response_time,
            exchange: None,
        });
        assert_eq!(plant.snapshot().device(TIC).diagnosis, None);
        let id = CommandId { terminal: 1, number: 1 };
        let command = Command::new(1, id, CommandKind::Write { tag: SV, value: 1.0.into() });
        plant.on_command(CommandStatus::new(command, "anna", at(1)), at(1));
        plant.on_event(Event::Wrote { at: at(1), id: WriteId(1), result: WriteResult::ReadBack(10.0.into()) });
        assert_eq!(plant.snapshot().device(TIC).diagnosis, Some(Reason::Settling));
        assert_eq!(plant.snapshot().device(PLC).diagnosis, None);
        plant.on_tick(at(7));
        assert_eq!(plant.snapshot().device(TIC).diagnosis, None);
    }
}
