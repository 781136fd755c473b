//! What stands on the topics, as JSON. Times are UTC, numbers are in the tag's unit, `null` is "unknown".

use serde_json::{Map, Value, json};

use super::request::ReplyTo;
use crate::plant::{
    Snapshot,
    def::{DeviceDef, MqttDef, PlantDef, TagId},
    north_def::{STATUS_TOPIC, topic_level},
    sample::{Quality, Sample},
};

/// Samples of a message at most: about 50 kB, which every broker takes.
pub const SAMPLES_MAX: usize = 500;

/// What is published.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Message {
    /// Where.
    pub topic: String,
    /// JSON.
    pub payload: Vec<u8>,
    /// The broker keeps it for who subscribes later.
    pub retained: bool,
    /// By which a client knows the answer to its request.
    pub correlation: Option<Vec<u8>>,
}

impl Message {
    fn new(topic: String, payload: &Value, retained: bool) -> Message {
        Message { topic, payload: payload.to_string().into_bytes(), retained, correlation: None }
    }

    /// The answer to a request.
    pub fn answer(to: &ReplyTo, payload: &Value) -> Message {
        Message { correlation: to.correlation.clone(), ..Message::new(to.topic.clone(), payload, false) }
    }
}

/// Whether the station is there. The broker itself says `offline` when it is not any more.
pub fn status(def: &MqttDef, online: bool) -> Message {
    let payload = json!({ "state": if online { "online" } else { "offline" } });
    Message::new(format!("{}/{STATUS_TOPIC}", def.topic), &payload, true)
}

/// What holds now: all tags of a device.
pub fn state(def: &MqttDef, snapshot: &Snapshot, device: &DeviceDef) -> Message {
    let tags = snapshot.def.tags.iter().filter(|tag| tag.device == device.id);
    let values: Map<String, Value> = tags
        .map(|tag| {
            let mut value = fields(snapshot.sample(tag.id));
            value.insert("unit".into(), snapshot.unit(tag.id).into());
            value.insert("text".into(), snapshot.text(tag.id).into());
            (tag.name.clone(), value.into())
        })
        .collect();
    let payload = json!({ "device": device.name, "at": snapshot.at.to_string(), "values": values });
    Message::new(format!("{}/{}", def.topic, topic_level(&device.name)), &payload, true)
}

/// Stored samples, each device's on its topic, in the order given.
pub fn samples(def: &MqttDef, plant: &PlantDef, rows: &[(TagId, Sample)]) -> Vec<Message> {
    let of_device = |device: &DeviceDef| {
        let topic = format!("{}/{}/samples", def.topic, topic_level(&device.name));
        let rows: Vec<Value> = rows
            .iter()
            .filter(|(tag, _)| plant.tag(*tag).device == device.id)
            .map(|(tag, sample)| {
                let mut row = fields(*sample);
                row.insert("tag".into(), plant.tag(*tag).name.clone().into());
                row.into()
            })
            .collect();
        let message = |rows: &[Value]| Message::new(topic.clone(), &json!({ "samples": rows }), false);
        rows.chunks(SAMPLES_MAX).map(message).collect::<Vec<_>>()
    };
    plant.devices.iter().flat_map(of_device).collect()
}

/// Value, quality and time, which never travel alone.
fn fields(sample: Sample) -> Map<String, Value> {
    let (quality, cause) = match sample.quality {
        Quality::Good => ("good", None),
        Quality::Uncertain(cause) => ("uncertain", Some(cause.word())),
        Quality::Bad(cause) => ("bad", Some(cause.word())),
    };
    let fields = [
        ("value", sample.exact().into()),
        ("quality", quality.into()),
        ("cause", cause.into()),
        ("at", sample.at.to_string().into()),
    ];
    fields.map(|(name, value): (&str, Value)| (name.to_owned(), value)).into_iter().collect()
}

#[cfg(test)]
pub(super) mod tests {
    use std::time::Duration;

    use jiff::Timestamp;

    use super::*;
    use crate::plant::{fixture, sample::Cause};

    /// A broker without anything special.
    pub fn mqtt() -> MqttDef {
        MqttDef {
            host: "broker".into(),
            port: 1_883,
            client_id: "sightglass-tank".into(),
            user: None,
            password: None,
            tls: None,
            topic: "sightglass/tank".into(),
            commands_as: None,
            deadbands: Vec::new(),
            max_interval: Duration::from_secs(60),
            lag_max: Duration::from_secs(120),
        }
    }

    fn json(message: &Message) -> Value {
        serde_json::from_slice(&message.payload).expect("JSON")
    }

    #[test]
    fn a_value_that_is_not_known_is_null_with_its_cause() {
        let snapshot = Snapshot::blank(fixture::shared());
        let device = &snapshot.def.devices[0];
        let message = state(&mqtt(), &snapshot, device);
        assert_eq!(message.topic, format!("sightglass/tank/{}", device.name));
        assert!(message.retained);
        let values = json(&message)["values"].clone();
        let expect = snapshot.def.tags.iter().filter(|tag| tag.device == device.id).count();
        assert_eq!(values.as_object().map(Map::len), Some(expect));
        let value = &values["TIC-1.PV"];
        assert_eq!((&value["value"], &value["quality"]), (&Value::Null, &json!("bad")));
        assert_eq!(value["cause"], json!(Cause::NotRead.word()));
    }

    #[test]
    fn samples_keep_their_order_in_messages_of_one_device() {
        let plant = fixture::shared();
        let at = |n: usize| Timestamp::from_millisecond(n as i64).expect("in range");
        let rows: Vec<_> =
            (0..1_200).map(|n| (plant.tags[n % plant.tags.len()].id, Sample::good(n as f64, at(n)))).collect();
        let messages = samples(&mqtt(), &plant, &rows);
        let mut found = Vec::new();
        for message in &messages {
            let of_message = json(message)["samples"].as_array().expect("a list").clone();
            assert!(!message.retained && of_message.len() <= SAMPLES_MAX);
            let device = message.topic.split('/').nth(2).expect("a device").to_owned();
            for row in of_message {
                assert!(row["tag"].as_str().is_some_and(|tag| tag.starts_with(&device)), "{row}");
                found.push((device.clone(), row["value"].as_f64().expect("a number")));
            }
        }
        assert_eq!(found.len(), rows.len());
        assert!(found.is_sorted_by(|a, b| a.0 != b.0 || a.1 < b.1));
    }

    #[test]
    fn the_state_of_the_station_is_retained() {
        let online = status(&mqtt(), true);
        assert_eq!((online.topic.as_str(), online.retained), ("sightglass/tank/status", true));
        assert_eq!(json(&status(&mqtt(), false)), json!({ "state": "offline" }));
    }
}
