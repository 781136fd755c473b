//! One request from outside: a write of one tag, as JSON, and what it must be before the plant is asked.
//!
//! ```json
//! {"id": "mes-4711", "tag": "TIC-1.SV", "value": 50.0, "reason": "recipe 7", "expires": "2026-11-20T06:00:30Z"}
//! ```

use std::time::Duration;

use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::plant::{
    PlantDef,
    def::{DeviceDef, MqttDef, TagId},
    exact::Exact,
    mqtt_request::MqttRefusal,
    north_def::topic_level,
    visible::is_control_or_bidi,
};

/// The last levels of the topics of requests and of their answers.
const REQUEST: &str = "request";
const RESPONSE: &str = "response";
/// Bytes of a request at most.
pub const PAYLOAD_MAX: usize = 4_096;
/// Bytes of a message at most; the broker does not deliver longer ones.
pub const PACKET_MAX: u32 = 65_536;
/// A request must expire within this time: its id is kept for so long.
pub const EXPIRES_MAX: Duration = Duration::from_secs(600);
const ID_MAX: usize = 64;
const RESPONSE_TOPIC_MAX: usize = 256;
const CORRELATION_MAX: usize = 256;
/// Characters of what a client wrote that are said back and shown at most.
const WORDS_MAX: usize = 160;

/// A message on a topic of requests, as the broker delivered it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Received {
    /// Its topic.
    pub topic: String,
    /// Anything.
    pub payload: Vec<u8>,
    /// The broker keeps it for later subscribers.
    pub retained: bool,
    /// Where the client wants the answer: a property of MQTT 5.
    pub response_topic: Option<String>,
    /// What the client knows the answer by: another one.
    pub correlation: Option<Vec<u8>>,
}

/// Where the answer to a request goes.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ReplyTo {
    /// The topic.
    pub topic: String,
    /// Sent back as it came.
    pub correlation: Option<Vec<u8>>,
}

/// A request that can be read, not yet held against the plant.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Request {
    /// Chosen by the client, of its own for each request.
    pub id: String,
    /// `TIC-1.SV`.
    pub tag: String,
    /// The new value in the tag's unit.
    pub value: Exact,
    /// For the audit log.
    pub reason: Option<String>,
    /// The value that the client saw: over another one nothing is written.
    pub expected: Option<Exact>,
    /// From then on it is refused.
    pub expires: Timestamp,
}

/// The topics of the requests of all devices.
pub fn filter(mqtt: &MqttDef) -> String {
    format!("{}/+/{REQUEST}", mqtt.topic)
}

/// Where the answer goes; `false`: not to where the client wants it.
pub fn reply_to(mqtt: &MqttDef, received: &Received) -> (ReplyTo, bool) {
    let above = received.topic.strip_suffix(REQUEST).unwrap_or_default();
    let usual = format!("{above}{RESPONSE}");
    let is_permitted = received.response_topic.as_ref().is_none_or(|topic| is_for_answers(mqtt, topic))
        && received.correlation.as_ref().is_none_or(|data| data.len() <= CORRELATION_MAX);
    if !is_permitted {
        return (ReplyTo { topic: usual, correlation: None }, false);
    }
    let topic = received.response_topic.clone().unwrap_or(usual);
    (ReplyTo { topic, correlation: received.correlation.clone() }, true)
}

/// An answer must not pass for a value, a state or a request of this station.
fn is_for_answers(mqtt: &MqttDef, topic: &str) -> bool {
    let is_own = topic.strip_prefix(&mqtt.topic).is_some_and(|rest| rest.is_empty() || rest.starts_with('/'));
    let is_answer = topic.rsplit('/').next() == Some(RESPONSE);
    let is_plain = !topic.starts_with('$') && !topic.contains(['+', '#']) && !topic.contains(char::is_control);
    !topic.is_empty() && topic.len() <= RESPONSE_TOPIC_MAX && is_plain && (!is_own || is_answer)
}

/// The id of a message, even of one that is no request, if it can be sent back.
pub fn id_of(received: &Received) -> Option<String> {
    if PAYLOAD_MAX < received.payload.len() {
        return None;
    }
    let value: Value = serde_json::from_slice(&received.payload).ok()?;
    value.get("id")?.as_str().filter(|id| is_id(id)).map(str::to_owned)
}

fn is_id(id: &str) -> bool {
    (1..=ID_MAX).contains(&id.len()) && id.bytes().all(|byte| byte.is_ascii_graphic())
}

/// Reads a request.
pub fn read(received: &Received) -> Result<Request, MqttRefusal> {
    if received.retained {
        return Err(MqttRefusal::Retained);
    }
    if PAYLOAD_MAX < received.payload.len() {
        return Err(MqttRefusal::TooLong(PAYLOAD_MAX));
    }
    let request: Request = serde_json::from_slice(&received.payload)
        .map_err(|error| MqttRefusal::NotARequest(shown(&error.to_string())))?;
    if !is_id(&request.id) {
        return Err(MqttRefusal::Id(ID_MAX));
    }
    Ok(request)
}

/// Holds a request against the clock and the plant: is it still valid, and of the device of its topic?
pub fn check(
    plant: &PlantDef,
    mqtt: &MqttDef,
    topic: &str,
    request: &Request,
    now: Timestamp,
) -> Result<TagId, MqttRefusal> {
    if request.expires <= now {
        return Err(MqttRefusal::Expired);
    }
    if EXPIRES_MAX < request.expires.duration_since(now).unsigned_abs() {
        return Err(MqttRefusal::ExpiresLate(EXPIRES_MAX.as_secs()));
    }
    let Some(tag) = plant.tag_named(&request.tag) else {
        return Err(MqttRefusal::UnknownTag(shown(&request.tag)));
    };
    if topic != topic_of(mqtt, plant.device(plant.tag(tag).device)) {
        return Err(MqttRefusal::OtherDevice);
    }
    Ok(tag)
}

/// What a client wrote, as it can be shown anywhere.
pub(super) fn shown(words: &str) -> String {
    let mut letters = words.chars().filter(|letter| !is_control_or_bidi(*letter));
    let shown: String = letters.by_ref().take(WORDS_MAX).collect();
    if letters.next().is_none() { shown } else { shown + "…" }
}

fn topic_of(mqtt: &MqttDef, device: &DeviceDef) -> String {
    format!("{}/{}/{REQUEST}", mqtt.topic, topic_level(&device.name))
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::{north::payload::tests::mqtt, plant::fixture};

    pub fn at(second: i64) -> Timestamp {
        Timestamp::from_second(1_000_000 + second).expect("in range")
    }

    pub fn message(payload: &str) -> Received {
        let topic = "sightglass/tank/TIC-1/request".into();
        Received { topic, payload: payload.into(), retained: false, response_topic: None, correlation: None }
    }

    pub fn json(id: &str, value: &str) -> String {
        format!(r#"{{"id":"{id}","tag":"TIC-1.SV","value":{value},"expires":"{}"}}"#, at(30))
    }

    #[test]
    fn a_request_that_is_none_is_refused_with_the_reason() {
        let check = |payload: &str, expect: &str| {
            let found = read(&message(payload)).expect_err(payload).to_string();
            assert!(found.contains(expect), "{payload}: {found}");
        };
        check("", "not a request: EOF");
        check("on", "not a request: expected");
        check("[1]", "not a request");
        check(&json("1", "\"50\""), "invalid type: string");
        check(&json("1", "true"), "invalid type: boolean");
        check(&json("1", "null"), "invalid type: null");
        check(&json("1", "NaN"), "not a request: expected value");
        check(&json("1", "1e999"), "number out of range");
        check(&json("1", "50,\"value\":90"), "duplicate field `value`");
        check(&json("1", "50,\"valeu\":90"), "unknown field `valeu`");
        check(&json("", "50"), "the id must have");
        check(&json("two words", "50"), "the id must have");
        check(&json(&"x".repeat(65), "50"), "the id must have");
        check(&json("1", "50").replace("Z\"", "\""), "not a request");
        check(r#"{"id":"1","tag":"TIC-1.SV","value":50}"#, "missing field `expires`");
        check(&"[".repeat(4_000), "not a request");
        check(&" ".repeat(PAYLOAD_MAX + 1), "longer than 4096 bytes");
        let not_text = Received { payload: vec![b'"', 0xff, 0xfe, b'"'], ..message("") };
        assert!(read(&not_text).is_err_and(|why| why.to_string().contains("not a request")));
        let kept = Received { retained: true, ..message(&json("1", "50")) };
        assert_eq!(read(&kept), Err(MqttRefusal::Retained));
        assert_eq!(read(&message(&json("1", "50"))).map(|request| request.value), Ok(50.0.into()));
        let counter = read(&message(&json("1", "18446744073709551.615"))).map(|request| request.value.to_string());
        assert_eq!(counter.as_deref(), Ok("18446744073709551.615"));
    }

    #[test]
    fn an_id_is_sent_back_even_of_what_is_no_request() {
        let check = |payload: &str, expect: Option<&str>| assert_eq!(id_of(&message(payload)).as_deref(), expect);
        check(&json("a-1", "\"hot\""), Some("a-1"));
        check(r#"{"id":7}"#, None);
        check(r#"{"id":"a b"}"#, None);
        check("{", None);
    }

    #[test]
    fn time_tag_and_topic_of_a_request_are_checked() {
        let plant = fixture::shared();
        let check = |topic: &str, change: &dyn Fn(&mut Request), expect: Result<TagId, MqttRefusal>| {
            let mut request = read(&message(&json("1", "50"))).expect("a request");
            change(&mut request);
            assert_eq!(super::check(&plant, &mqtt(), topic, &request, at(0)), expect);
        };
        const TOPIC: &str = "sightglass/tank/TIC-1/request";
        check(TOPIC, &|_| {}, Ok(fixture::SV));
        check(TOPIC, &|request| request.expires = at(0), Err(MqttRefusal::Expired));
        check(TOPIC, &|request| request.expires = at(600), Ok(fixture::SV));
        check(TOPIC, &|request| request.expires = at(601), Err(MqttRefusal::ExpiresLate(600)));
        check(TOPIC, &|request| request.expires = Timestamp::MAX, Err(MqttRefusal::ExpiresLate(600)));
        check(TOPIC, &|request| request.tag = "TIC-9.SV".into(), Err(MqttRefusal::UnknownTag("TIC-9.SV".into())));
        check("sightglass/tank/PLC-1/request", &|_| {}, Err(MqttRefusal::OtherDevice));
    }

    #[test]
    fn what_a_client_wrote_is_never_said_at_length() {
        let check = |words: &str, expect: &str| assert_eq!(shown(words), expect);
        check("TIC-9.SV", "TIC-9.SV");
        check("a\u{1b}[2J\u{202e}b\nc", "a[2Jbc");
        check(&"x".repeat(160), &"x".repeat(160));
        check(&"x".repeat(4_000), &("x".repeat(160) + "…"));
        let refusal = read(&message(&format!(r#"{{"{}":1}}"#, "y".repeat(3_000)))).expect_err("no request");
        assert!(refusal.to_string().len() < 200, "{refusal}");
    }

    #[test]
    fn an_answer_goes_where_no_value_or_request_of_the_station_is() {
        let check = |topic: Option<&str>, expect: &str, is_permitted: bool| {
            let received = Received { response_topic: topic.map(str::to_owned), ..message("") };
            let (reply, permitted) = reply_to(&mqtt(), &received);
            assert_eq!((reply.topic.as_str(), permitted), (expect, is_permitted));
        };
        const USUAL: &str = "sightglass/tank/TIC-1/response";
        check(None, USUAL, true);
        check(Some("mes/answers"), "mes/answers", true);
        check(Some("sightglass/tank/mes/response"), "sightglass/tank/mes/response", true);
        check(Some("sightglass/tanker"), "sightglass/tanker", true);
        check(Some("sightglass/tank"), USUAL, false);
        check(Some("sightglass/tank/status"), USUAL, false);
        check(Some("sightglass/tank/TIC-1"), USUAL, false);
        check(Some("sightglass/tank/TIC-1/request"), USUAL, false);
        check(Some("mes/#"), USUAL, false);
        check(Some("$SYS/broker"), USUAL, false);
        check(Some(""), USUAL, false);
        check(Some(&"x".repeat(257)), USUAL, false);
    }
}
