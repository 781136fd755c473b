//! Where values are sent to: the table `[north]` of a plant file.

use std::time::Duration;

use super::{
    diagnostic::Problems,
    names::{Defs, Unique},
    reader::{At, OptionalKey},
    schema::{DeadbandTable, MqttTable, NorthTable},
};
use crate::plant::{
    def::{MqttDef, NorthDef, PasswordSource, TlsRoots},
    north_def::{STATUS_TOPIC, topic_level},
    tag::{Bound, TagDef},
};

/// The ports that brokers have, without and with TLS.
const PORT: u16 = 1_883;
const PORT_TLS: u16 = 8_883;
/// Bytes of a text that a broker gets; MQTT itself ends at 65,535 for a topic with what is added to it.
const TEXT_MAX: usize = 1_024;
/// A subscriber that has just come knows every value after so long.
const MAX_INTERVAL: Duration = Duration::from_secs(60);
const LAG_MAX: Duration = Duration::from_secs(120);
/// The last ten seconds count as on their way, and a broker that is restarted takes some more.
const LAG_LEAST: Duration = Duration::from_secs(15);

/// What is sent where; without the table, nothing.
pub(super) fn north(plant: &str, table: Option<&NorthTable>, defs: &Defs, problems: &mut Problems) -> NorthDef {
    let mqtt = table.and_then(|table| table.mqtt.as_ref());
    NorthDef { mqtt: mqtt.and_then(|table| mqtt_of(plant, &table.value, defs, problems)) }
}

fn mqtt_of(plant: &str, table: &MqttTable, defs: &Defs, problems: &mut Problems) -> Option<MqttDef> {
    let usual = format!("sightglass/{}", topic_level(plant));
    let topic = table.topic.as_ref().map_or(usual, |topic| topic_of(topic, problems));
    check_levels(table, defs, problems);
    let password = password(table, problems);
    let tls = tls(table, problems);
    let (max_interval, lag_max) = (table.max_interval, table.lag_max);
    for (given, least) in [(max_interval, Duration::from_secs(1)), (lag_max, LAG_LEAST)] {
        if let Some(given) = given.filter(|given| given.value < least) {
            problems.add(given.at, "this is too short").label(format!("expected {}s or more", least.as_secs()));
        }
    }
    let texts = [&table.host, &table.client_id, &table.user, &table.topic, &table.commands_as];
    for text in texts.into_iter().flatten().filter(|text| TEXT_MAX < text.value.len()) {
        problems.add(text.at, "this is too long for a broker").label(format!("expected at most {TEXT_MAX} bytes"));
    }
    if let Some(port) = table.port.filter(|port| port.value == 0) {
        problems.add(port.at, "no broker has port 0").label("expected 1 to 65535");
    }
    let client_id = table.client_id.as_ref();
    if let Some(id) = client_id.filter(|id| id.value.is_empty()) {
        problems.add(id.at, "the broker must know this station by a name").label("expected a text");
    }
    Some(MqttDef {
        host: host(table.host.as_ref()?, problems),
        port: table.port.value_or(if tls.is_some() { PORT_TLS } else { PORT }),
        client_id: client_id.map_or_else(|| format!("sightglass-{plant}"), |id| id.value.clone()),
        user: table.user.as_ref().map(|user| user.value.clone()),
        password,
        commands_as: table
            .commands_as
            .as_ref()
            .map(|user| commands_as(user, tls.is_some() || is_local(table), defs, problems)),
        tls,
        topic,
        deadbands: deadbands(table, defs, problems),
        max_interval: max_interval.value_or(MAX_INTERVAL),
        lag_max: lag_max.value_or(LAG_MAX),
    })
}

/// The user as whom requests from outside act. Whether that user exists is known to the station alone, which says so.
fn commands_as(user: &At<String>, is_private: bool, defs: &Defs, problems: &mut Problems) -> String {
    if !defs.lines.is_empty() && defs.lines.iter().all(|line| line.listens) {
        let problem = problems.warn(user.at, "every line only listens: no request is ever carried out");
        problem.label("other masters poll them: nothing can be written");
    }
    if user.value.trim().is_empty() {
        problems.add(user.at, "requests need a user to act as").label("expected the name of a user of the station");
    } else if !is_private {
        let problem = problems.warn(user.at, "requests are taken over a connection without TLS");
        problem.label("anyone on the network can read and forge them").help("set `tls = true`");
    }
    user.value.clone()
}

/// Is the broker on this computer?
fn is_local(table: &MqttTable) -> bool {
    table.host.as_ref().is_some_and(|host| matches!(host.value.as_str(), "localhost" | "127.0.0.1" | "::1"))
}

fn host(host: &At<String>, problems: &mut Problems) -> String {
    let is_plain = |letter: char| !letter.is_whitespace() && letter != '/';
    if host.value.is_empty() || !host.value.chars().all(is_plain) {
        problems.add(host.at, format!("`{}` is not a host", host.value)).label("expected a name or an address");
    }
    host.value.clone()
}

fn topic_of(topic: &At<String>, problems: &mut Problems) -> String {
    let levels = || topic.value.split('/');
    if levels().any(|level| level.is_empty() || topic_level(level) != level) {
        let problem = problems.add(topic.at, format!("`{}` is not a topic to send to", topic.value));
        problem.label("expected levels such as plant/line1, without + # $");
    }
    topic.value.clone()
}

/// Each device has a topic of its own, and the station has one.
fn check_levels(table: &MqttTable, defs: &Defs, problems: &mut Problems) {
    let mut known = Unique::default();
    known.insert(STATUS_TOPIC, table.at, "", problems);
    for device in defs.devices {
        let level = topic_level(&device.name);
        let words = format!("the topic `{level}` of the device `{}` is used twice", device.name);
        known.insert(&level, table.at, words, problems);
    }
}

fn password(table: &MqttTable, problems: &mut Problems) -> Option<PasswordSource> {
    let (file, variable) = (table.password_file.as_ref(), table.password_env.as_ref());
    if let (Some(file), Some(variable)) = (file, variable) {
        problems.exclusive(("password_file", file.at), ("password_env", variable.at));
    }
    let given = file.or(variable)?;
    if table.user.is_none() {
        problems.add(given.at, "a password needs a `user`").label("for which user?");
    }
    Some(match file {
        Some(file) => PasswordSource::File(file.value.clone().into()),
        None => PasswordSource::Environment(given.value.clone()),
    })
}

/// A file of certificates means TLS.
fn tls(table: &MqttTable, problems: &mut Problems) -> Option<TlsRoots> {
    let off = table.tls.filter(|tls| !tls.value);
    if let (Some(off), Some(file)) = (off, &table.ca_file) {
        problems.exclusive(("tls", off.at), ("ca_file", file.at));
    }
    match &table.ca_file {
        Some(file) => Some(TlsRoots::File(file.value.clone().into())),
        None => table.tls.filter(|tls| tls.value).map(|_| TlsRoots::System),
    }
}

/// The deadband of each tag in its unit.
fn deadbands(table: &MqttTable, defs: &Defs, problems: &mut Problems) -> Vec<f64> {
    let share = table.deadband_percent.map_or(0.0, |percent| percent_of(percent, problems));
    let mut bands: Vec<f64> = defs.tags.iter().map(|tag| range(tag).map_or(0.0, |range| range * share)).collect();
    let mut known = Unique::default();
    for DeadbandTable { tag: name, value, percent, .. } in table.deadbands.iter().map(|table| &table.value) {
        let Some(name) = name else { continue };
        known.insert(&name.value, name.at, format!("{} has two deadbands", name.value), problems);
        let Some(tag) = defs.tag(name, problems) else { continue };
        match (value, percent) {
            (Some(value), Some(percent)) => problems.exclusive(("value", value.at), ("percent", percent.at)),
            (Some(value), None) if value.value < 0.0 => {
                problems.add(value.at, "a deadband is not negative").label("expected 0 or more");
            }
            (Some(value), None) => bands[tag.id.index()] = value.value,
            (None, Some(percent)) => match range(tag) {
                Some(range) => bands[tag.id.index()] = range * percent_of(*percent, problems),
                None => {
                    let problem = problems.add(percent.at, format!("{} has no fixed `min` and `max`", tag.name));
                    problem.label("expected `value` in the tag's unit");
                }
            },
            (None, None) => {
                problems.add(name.at, "the deadband needs `value` or `percent`").label("missing here");
            }
        }
    }
    bands
}

fn percent_of(percent: At<f64>, problems: &mut Problems) -> f64 {
    if !(0.0..=100.0).contains(&percent.value) {
        problems.add(percent.at, "this is not a share").label("expected 0 to 100 percent");
    }
    percent.value / 100.0
}

/// How far a quantity goes, where its profile says so. A number that names a state has no deadband.
fn range(tag: &TagDef) -> Option<f64> {
    match (tag.min, tag.max) {
        (Some(Bound::Fixed(min)), Some(Bound::Fixed(max))) if tag.enum_labels.is_empty() => Some((max - min).near()),
        _ => None,
    }
}
