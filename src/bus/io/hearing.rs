//! Hears a line: the bytes of a tap as requests, responses and noise. For `sightglass listen` and for a line of the plant.

use tokio::io::AsyncReadExt;

use super::{clock::Clock, tap::Tap};
use crate::{
    bus::listen::{Ended, Heard, HeardFrame, Listener},
    plant::{line::LineDef, line_trouble::LineTrouble, traffic::Frame},
};

/// A tap, and what has been heard there.
pub struct Hearing {
    tap: Tap,
    listener: Listener,
    clock: Clock,
    buffer: [u8; 4096],
}

impl Hearing {
    /// Nothing has been heard yet.
    pub fn new(tap: Tap, line: &LineDef, clock: Clock) -> Hearing {
        Hearing { tap, listener: Listener::new(line), clock, buffer: [0; 4096] }
    }

    /// What comes next, in UTC; perhaps nothing yet. The error says why nothing more will come. May be dropped before.
    pub async fn next(&mut self) -> Result<Vec<Heard>, LineTrouble> {
        let (clock, silent) = (self.clock, self.listener.silent_at());
        let heard = tokio::select! {
            // What has come is heard before a silence is.
            biased;
            read = self.tap.bytes.read(&mut self.buffer) => match read {
                Ok(count @ 1..) => self.listener.hear(clock.now(), &self.buffer[..count]),
                Ok(0) => return Err(LineTrouble::PortClosed),
                Err(error) => return Err(LineTrouble::PortLost(error.to_string())),
            },
            () = clock.sleep_until(silent.unwrap_or_default()), if silent.is_some() => self.listener.rest(clock.now()),
        };
        Ok(self.in_utc(heard))
    }

    /// Nothing more comes: what has begun has ended.
    pub fn end(&mut self) -> Vec<Heard> {
        let heard = self.listener.end();
        self.in_utc(heard)
    }

    /// What it has counted.
    pub fn listener(&self) -> &Listener {
        &self.listener
    }

    /// The port.
    pub fn tap(&self) -> &Tap {
        &self.tap
    }

    fn in_utc(&self, mut heard: Vec<Heard>) -> Vec<Heard> {
        for heard in &mut heard {
            let (Heard::Frame(HeardFrame { frame: Frame { at, .. }, .. }) | Heard::Ended(Ended { at, .. })) = heard;
            *at = self.clock.to_utc(*at);
        }
        heard
    }
}
