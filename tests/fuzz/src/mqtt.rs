//! Requests from outside: a message is a request or refused in words, and its answer goes where no value stands.

use sightglass::api::{
    north::request::{self, Received},
    plant::{Command, CommandId, CommandKind, CommandStatus, Plant, is_control_or_bidi},
};

use super::common::{TANK, now};

/// The payload; or, parted by bytes of 0, where the answer shall go, what it is known by, and the payload.
pub fn run(data: &[u8]) {
    let parts: Vec<&[u8]> = data.splitn(3, |byte| *byte == 0).collect();
    let (to, correlation, payload) = match parts[..] {
        [to, correlation, payload] => (Some(to), Some(correlation.to_vec()), payload),
        _ => (None, None, data),
    };
    let response_topic = to.map(|to| String::from_utf8_lossy(to).into_owned());
    let topic = "sightglass/tank/TIC-1/request".to_owned();
    let received = Received { topic, payload: payload.to_vec(), retained: false, response_topic, correlation };
    let mqtt = TANK.north.mqtt.as_ref().expect("data out");
    let (reply, _) = request::reply_to(mqtt, &received);
    assert!(!reply.topic.is_empty() && !reply.topic.contains(['+', '#']), "{reply:?}");
    let id = request::id_of(&received);
    match request::read(&received) {
        Err(refusal) => {
            let words = refusal.to_string();
            assert!(words.len() < 1_000 && !words.contains(is_control_or_bidi), "{words:?}");
        }
        Ok(request) => {
            assert_eq!(id.as_ref(), Some(&request.id));
            assert!(request.value.is_finite(), "{request:?}");
            let Ok(tag) = request::check(&TANK, mqtt, &received.topic, &request, now()) else { return };
            let mut plant = Plant::new(TANK.clone(), now(), 1.0);
            let kind = CommandKind::Write { tag, value: request.value };
            sightglass::api::access::right::needs(&TANK, &kind);
            let id = CommandId { terminal: 1, number: 1 };
            let command = Command { expected_value: request.expected, ..plant.snapshot().command(id, kind) };
            plant.on_command(CommandStatus::new(command, "mes", now()), now());
        }
    }
}
