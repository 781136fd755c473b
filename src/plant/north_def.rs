//! Where values are sent to: the broker, how it is reached, and how much of what changes.

use std::{path::PathBuf, time::Duration};

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

use super::{id::TagId, mqtt_request::MqttRequestStatus};
use crate::t;

/// What the table `[north]` of a plant file says.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct NorthDef {
    /// The MQTT broker, if values are sent to one.
    pub mqtt: Option<MqttDef>,
}

/// An MQTT broker and what it gets.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MqttDef {
    /// Name or address.
    pub host: String,
    /// TCP port.
    pub port: u16,
    /// As the broker knows this station; two clients of one name throw each other out.
    pub client_id: String,
    /// User name at the broker.
    pub user: Option<String>,
    /// Where the password is; it never stands in the plant file.
    pub password: Option<PasswordSource>,
    /// How the broker proves who it is; `None` for a connection without TLS.
    pub tls: Option<TlsRoots>,
    /// The topic above those of the devices: `sightglass/tank`.
    pub topic: String,
    /// The user as whom requests from outside act; `None`: none are taken.
    pub commands_as: Option<String>,
    /// A value is sent when it differs from the last one sent by more than this, in the tag's unit; by [`TagId`], 0 for
    /// every stored sample.
    pub deadbands: Vec<f64>,
    /// A good value within its deadband is sent again after this time.
    pub max_interval: Duration,
    /// An alarm is raised when what is stored has waited this long.
    pub lag_max: Duration,
}

impl MqttDef {
    /// The deadband of a tag.
    pub fn deadband(&self, tag: TagId) -> f64 {
        self.deadbands.get(tag.index()).copied().unwrap_or(0.0)
    }
}

/// Where a password is read from, at each connection.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub enum PasswordSource {
    /// The first line of a file.
    File(PathBuf),
    /// A variable of the environment of the station.
    Environment(String),
}

/// Which certificates are trusted to sign that of the broker.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub enum TlsRoots {
    /// Those of the operating system.
    System,
    /// Those of a PEM file.
    File(PathBuf),
}

/// The last level of the topic on which the station says whether it is there.
pub const STATUS_TOPIC: &str = "status";

/// A name as one level of a topic: what has a meaning there is replaced.
pub fn topic_level(name: &str) -> String {
    let level =
        |letter: char| if matches!(letter, '/' | '+' | '#' | '$') || letter.is_control() { '_' } else { letter };
    name.chars().map(level).collect()
}

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
