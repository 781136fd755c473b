//! A line that is listened to: the same is heard however the bytes come in pieces, and every byte is heard once.

use jiff::{SignedDuration, Timestamp};
use sightglass::api::{
    bus::listen::{Follower, Heard, Listener, Losses, events},
    plant::LineId,
};

use super::common::{TANK, framing, line, now};

/// A byte for the framing, then pieces: a byte for the pause before it, one for its length, its bytes.
pub fn run(data: &[u8]) {
    let [kind, rest @ ..] = data else { return };
    let pieces = pieces(rest);
    let (framing, mut heard) = (framing(*kind), Vec::new());
    let (mut whole, mut bytewise) = (Listener::new(&line(framing)), Listener::new(&line(framing)));
    let mut follower = Follower::new(TANK.clone(), now());
    let mut losses = Losses::new(&TANK);
    let mut follow = |at: Timestamp, heard: &[Heard]| {
        for heard in heard {
            follower.follow(at, heard);
            events(&TANK, LineId(0), at, heard).iter().for_each(|event| _ = losses.observe(&TANK, event));
        }
    };
    for (at, bytes) in &pieces {
        let in_one = whole.hear(*at, bytes);
        let mut one_by_one = bytewise.rest(*at);
        bytes.iter().for_each(|byte| one_by_one.extend(bytewise.hear(*at, &[*byte])));
        assert_eq!(in_one, one_by_one, "{framing:?} {bytes:02X?}");
        follow(*at, &in_one);
        heard.extend(in_one);
    }
    let end = pieces.last().map_or_else(now, |(at, _)| *at);
    let ended = whole.end();
    assert_eq!(ended, bytewise.end());
    follow(end, &ended);
    heard.extend(ended);
    let came: Vec<u8> = pieces.iter().flat_map(|(_, bytes)| bytes.iter().copied()).collect();
    let frames = heard.iter().filter_map(|heard| match heard {
        Heard::Frame(heard) => Some(&heard.frame.bytes[..]),
        Heard::Ended(_) => None,
    });
    assert_eq!(frames.collect::<Vec<_>>().concat(), came, "{framing:?}");
}

fn pieces(mut rest: &[u8]) -> Vec<(Timestamp, &[u8])> {
    let (mut at, mut pieces) = (now(), Vec::new());
    while let [pause, length, behind @ ..] = rest {
        // Up to 4 s, most of them short.
        at += SignedDuration::from_micros(i64::from(*pause) * i64::from(*pause) * 64);
        let (bytes, behind) = behind.split_at(usize::from(*length).min(behind.len()));
        pieces.push((at, bytes));
        rest = behind;
    }
    pieces
}
