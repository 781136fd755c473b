//! A plant file: it is read or refused with reasons; what is read can run, passes the socket and has a mimic.

use std::sync::Arc;

use sightglass::api::{
    attach::protocol::{Handshake, HandshakeReply, LENGTH_BYTES, encode, handshake_reply},
    plant::PlantDef,
    ui::{Theme, preview},
};

use super::common::{checked, run_plant};

/// The text.
pub fn run(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    let Some(def) = checked(text) else { return };
    run_plant(&def);
    check_socket(&def);
    draw(&def);
}

fn check_socket(def: &Arc<PlantDef>) {
    let reply = HandshakeReply { run: 7, terminal: 3, def: def.clone() };
    let bytes = encode(&(Handshake::current(), reply), usize::MAX).expect("no limit");
    let received = handshake_reply(&bytes[LENGTH_BYTES..]).expect("of this version").expect("not refused");
    assert!(encode(&received.def, usize::MAX) == encode(def, usize::MAX), "the plant that a terminal gets");
}

/// Draws every page of the mimic, on a small terminal and on a large one.
pub fn draw(def: &Arc<PlantDef>) {
    let theme = Theme::detect(|_| None);
    for page in 0..def.mimic.pages.len().clamp(1, 4) {
        for (phase, size) in [(0, (80, 18)), (7, (20, 4)), (99, (200, 60))] {
            let drawn = preview(def, page, size, phase, &theme);
            assert_eq!(drawn.content.len(), usize::from(size.0) * usize::from(size.1));
        }
    }
}
