//! Messages of the socket: what can be read can be sent again, and what the station accepts does the plant no harm.

use std::sync::{Arc, LazyLock};

use jiff::SignedDuration;
use sightglass::api::{
    access::right,
    attach::{
        check,
        protocol::{
            ClientMessage, LENGTH_BYTES, ServerMessage, client_handshake, decode, encode, handshake_reply, length,
        },
        redact,
    },
    plant::{Command, CommandStatus, Plant, is_control_or_bidi},
};

use super::common::{TANK, now};

static MAX: usize = 1 << 20;
static FRESH: LazyLock<Arc<sightglass::api::plant::PlantDef>> = LazyLock::new(|| TANK.clone());

/// A byte for the kind of message, then the message.
pub fn run(data: &[u8]) {
    let [kind, bytes @ ..] = data else { return };
    match kind % 4 {
        0 => {
            if let Ok(origin) = client_handshake(bytes) {
                let words = origin.words(Some("panel"), Some(1));
                assert!(!words.contains(is_control_or_bidi), "{words:?}");
            }
        }
        1 => {
            if let Ok(Err(why)) = handshake_reply(bytes) {
                assert!(!why.contains(is_control_or_bidi), "{why:?}");
            }
        }
        2 => client(bytes),
        _ => server(bytes),
    }
}

fn client(bytes: &[u8]) {
    let Ok(message) = decode::<ClientMessage>(bytes, "message of a terminal") else { return };
    let sent = encode(&message, MAX).expect("no longer than it came");
    let head = *sent.first_chunk::<LENGTH_BYTES>().expect("a length");
    assert_eq!(length(head, MAX), Ok(sent.len() - LENGTH_BYTES));
    let again = decode::<ClientMessage>(&sent[LENGTH_BYTES..], "message of a terminal").expect("as it was sent");
    // Numbers that are none differ from themselves.
    assert_eq!(format!("{again:?}"), format!("{message:?}"));
    match message {
        ClientMessage::Command(command, _) => give(*command),
        ClientMessage::Ask { query, .. } => {
            right::needs_for_query(&query);
            _ = check::query(&FRESH, &query);
        }
        ClientMessage::SessionRequest { request, .. } => _ = right::needs_for_request(&request),
        ClientMessage::Cancel { .. } => {}
    }
}

/// What passes the check is given to a plant.
fn give(command: Command) {
    if check::command(&FRESH, &command.kind).is_err() {
        return;
    }
    right::needs(&FRESH, &command.kind);
    let mut plant = Plant::new(FRESH.clone(), now(), 1.0);
    plant.on_command(CommandStatus::new(command, "anna", now()), now());
    for seconds in [1, 60, 86_400] {
        plant.on_tick(now() + SignedDuration::from_secs(seconds));
    }
    redact(&plant.snapshot());
}

fn server(bytes: &[u8]) {
    let Ok(message) = decode::<ServerMessage>(bytes, "message of a station") else { return };
    let sent = encode(&message, MAX).expect("no longer than it came");
    let again = decode::<ServerMessage>(&sent[LENGTH_BYTES..], "message of a station").expect("as it was sent");
    assert_eq!(format!("{again:?}"), format!("{message:?}"));
}
