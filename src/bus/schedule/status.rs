//! The state of polls, devices and load, as reports show it.

use jiff::Timestamp;

use super::{
    Load, PollInfo, Schedule,
    device::Health,
    poll::{Pace, ScheduledPoll},
};
use crate::plant::{def::DeviceId, number::to_f32};

impl Schedule {
    /// How the line copes: what is shed, and by what normal polls are stretched.
    pub fn load(&self) -> Load {
        self.overload.load()
    }

    /// How each poll stands, in the order of the blocks.
    pub fn polls(&self) -> impl Iterator<Item = PollInfo> {
        self.polls.iter().map(|poll| self.info(poll))
    }

    /// How a poll stands.
    fn info(&self, poll: &ScheduledPoll) -> PollInfo {
        let pace = self.pace_of(poll);
        let factor = match (self.overload.load(), pace) {
            (Load::Overload { factor }, Pace::Stretched(_)) => to_f32(factor),
            (Load::Overload { .. }, Pace::Normal | Pace::Shed) | (Load::Normal, _) => 1.0,
        };
        PollInfo {
            class: poll.class,
            period: poll.period,
            factor,
            shed: pace == Pace::Shed,
            next: poll.wanted(),
            missed: poll.missed,
        }
    }

    /// Is the device given up?
    pub fn is_down(&self, device: DeviceId) -> bool {
        self.health(device).is_some_and(Health::is_down)
    }

    /// Must the device be left alone now (it is settling, or replies are outstanding)?
    pub fn is_resting(&self, device: DeviceId, now: Timestamp) -> bool {
        self.health(device).is_some_and(|health| now < health.rests_until)
    }

    /// The devices that do not answer, each with the moment when it is asked next.
    pub fn retries(&self) -> Vec<(DeviceId, Timestamp)> {
        let retry = |health: &Health| Some((health.device, self.probe_from(health)?));
        self.devices.iter().filter_map(retry).collect()
    }
}
