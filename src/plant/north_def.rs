//! Where values are sent to: the broker, how it is reached, and how much of what changes.

use std::{path::PathBuf, time::Duration};

use serde::{Deserialize, Serialize};

use super::id::TagId;

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
    /// As the broker knows this station; two clients of one name disconnect each other.
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
