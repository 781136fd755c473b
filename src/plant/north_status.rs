//! How the data out of a running station stands.

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

use super::mqtt_request::MqttRequestStatus;
use crate::t;

/// How far the data out has come.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct NorthStatus {
    /// The broker has accepted the station.
    pub connected: bool,
    /// Samples that the broker has acknowledged since the start.
    pub sent: u64,
    /// What the broker refused since the start: it is not sent again.
    pub refused: u64,
    /// Everything that was stored before this instant is at the broker.
    pub sent_until: Timestamp,
    /// What went wrong last; `None` while all is well.
    pub error: Option<String>,
    /// The requests from outside, where the plant file permits them.
    pub requests: Option<MqttRequestStatus>,
}

impl NorthStatus {
    /// `connected, 5192 samples sent, 0 refused, complete until 14:02:30`; `until` is the instant in words.
    pub fn words(&self, until: &str) -> String {
        let NorthStatus { connected, sent, refused, sent_until: _, error, requests: _ } = self;
        let state = if *connected { t!("connected") } else { t!("not connected") };
        let why = error.as_ref().map(|why| format!(": {why}")).unwrap_or_default();
        t!(
            "{state}{why}, {sent} samples sent, {refused} refused, complete until {until}",
            state,
            why,
            sent,
            refused,
            until
        )
    }
}
