//! Failed requests and states of lines: what they mean for devices and values.

use std::mem::discriminant;

use jiff::Timestamp;

use super::Plant;
use crate::plant::{
    def::{DeviceId, LineId, TagId},
    fault::{Fault, FaultKind},
    line_state::{DeviceState, LineState},
    record::ActionRecord,
    sample::Cause,
};

impl Plant {
    /// Applies a failed request to the tags and the state of its device.
    pub(super) fn failed(&mut self, device: DeviceId, tags: &[TagId], fault: Fault, at: Timestamp) {
        self.image.failed(tags, fault, at);
        let status = &mut self.devices[device.index()];
        let down = matches!(status.state, DeviceState::Down { .. });
        match fault.kind() {
            // The device is in backoff; these are its other tags.
            FaultKind::BackedOff => {
                if !down {
                    status.state = DeviceState::Down { since: at };
                }
                self.image.gone(device, Cause::DeviceDown, at);
                return;
            }
            FaultKind::NotConnected => return,
            // Its master has heard it, for all that is known.
            FaultKind::NotHeard | FaultKind::Unproven => {}
            // An exception proves that the device is there, unless a gateway sent it.
            FaultKind::Exception(code) if !code.is_of_gateway() => status.state = DeviceState::Responding,
            FaultKind::NotANumber => status.state = DeviceState::Responding,
            FaultKind::Exception(_) | FaultKind::Timeout | FaultKind::Corrupt | FaultKind::OutOfSync => {
                status.state = match status.state {
                    DeviceState::Down { since } => DeviceState::Down { since },
                    DeviceState::Failing(n) => DeviceState::Failing(n.saturating_add(1)),
                    DeviceState::Unknown | DeviceState::Responding => DeviceState::Failing(1),
                };
            }
        }
        status.failed += 1;
        status.last_fault = Some((at, fault));
    }

    /// Applies a new state of a line to its devices.
    pub(super) fn line_changed(&mut self, line: LineId, state: LineState, at: Timestamp) -> Option<ActionRecord> {
        let status = &mut self.lines[line.index()];
        let before = std::mem::take(&mut status.state);
        status.lost_since = match &state {
            LineState::Waiting { .. } | LineState::NoTraffic => status.lost_since.or(Some(at)),
            LineState::Connecting => status.lost_since,
            LineState::Connected | LineState::Disconnected | LineState::Testing => None,
        };
        if status.since.is_none() || discriminant(&before) != discriminant(&state) {
            status.since = Some(at);
        }
        let open = state != LineState::Disconnected;
        // An operator closed the line: its devices are not polled, so their silence is no fault.
        let gone = match &state {
            LineState::Waiting { .. } => Some(DeviceState::Down { since: at }),
            LineState::Disconnected | LineState::Testing => Some(DeviceState::Unknown),
            // Reopened at once, perhaps with other settings: the values may be of another device.
            LineState::Connecting if matches!(before, LineState::Connected | LineState::NoTraffic) => {
                Some(DeviceState::Unknown)
            }
            LineState::Connecting | LineState::Connected | LineState::NoTraffic => None,
        };
        self.lines[line.index()].state = state;
        let action = self.commands.connected(line, open, &self.image, at);
        let silent = self.lines[line.index()].state == LineState::NoTraffic;
        for device in self.def.devices.iter().filter(|device| silent && device.line == line) {
            self.devices[device.id.index()].state = DeviceState::Unknown;
            self.image.not_heard(device.id);
        }
        let Some(gone) = gone else { return action };
        for device in self.def.devices.iter().filter(|device| device.line == line) {
            // Of all units of a line together nothing is ever heard that could say that they are back.
            let to_all = self.def.line(line).transport.framing().is_broadcast(device.unit);
            let device_state = if to_all { DeviceState::Unknown } else { gone };
            let status = &mut self.devices[device.id.index()];
            if !matches!((status.state, device_state), (DeviceState::Down { .. }, DeviceState::Down { .. })) {
                status.state = device_state;
            }
            self.image.gone(device.id, Cause::NotConnected, at);
        }
        action
    }
}
