//! Frames of every framing: wrapped and unwrapped, decoded, checked, searched for a response and for a tag.

use std::sync::{Arc, LazyLock};

use jiff::Timestamp;
use sightglass::api::{
    bus::{
        check_request,
        dissect::{Direction, Dissection, dissect},
        frame, framing, meaning,
        paste::{self, Asked},
        source_frame,
    },
    plant::{Exchange, Framing, LineId, Plant, Snapshot},
};

use super::common::{TANK, framing as framing_of};

static SNAPSHOT: LazyLock<Snapshot> = LazyLock::new(|| Plant::new(TANK.clone(), Timestamp::UNIX_EPOCH, 1.0).snapshot());

/// A byte for what is known of the bytes, one for the length of the request among them, then the bytes.
pub fn run(data: &[u8]) {
    let [options, length, bytes @ ..] = data else { return };
    let (request, response) = bytes.split_at(usize::from(*length).min(bytes.len()));
    let known = framing_of(*options);
    let given = (options & 0x40 != 0).then_some(known);
    let direction = [None, Some(Direction::Request), Some(Direction::Answer)][usize::from(options / 3 % 3)];
    let asked = (options & 0x80 != 0).then_some(request);
    check_fields(bytes, &dissect(bytes, given, direction, None));
    check_fields(response, &dissect(response, given, direction, asked));
    check_paste(bytes, given, direction);
    for framing in [Framing::Rtu, Framing::Ascii, Framing::Mbap] {
        check_wrapping(framing, bytes);
        check_request(bytes, framing);
        frame::unit_of(framing, bytes);
    }
    check_reply(known, request, response);
    meaning::of_request(&SNAPSHOT, LineId(0), request);
    meaning::of_answer(&SNAPSHOT, LineId(0), request, response);
    find_tags(known, request, response);
}

/// A field lies within the bytes.
fn check_fields(bytes: &[u8], found: &Dissection) {
    for field in &found.fields {
        let range = &field.range;
        assert!(range.start <= range.end && range.end <= bytes.len(), "{field:?} of {} bytes", bytes.len());
    }
    assert!(!found.summary.is_empty(), "nothing is said of {bytes:02X?}");
}

/// Every byte has its place, in order, once.
fn check_paste(bytes: &[u8], framing: Option<Framing>, direction: Option<Direction>) {
    let paste = paste::read(bytes, framing, direction, &mut Asked::default());
    let mut end = 0;
    for part in &paste.parts {
        assert_eq!(part.range.start, end, "{:?}", paste.parts);
        end = part.range.end;
    }
    assert_eq!(end, bytes.len());
}

/// What is read from a frame is that frame when it is written, and the other way round.
fn check_wrapping(framing: Framing, bytes: &[u8]) {
    if let Ok(message) = frame::unwrap(framing, bytes) {
        let transaction = bytes.first_chunk().map_or(0, |id| u16::from_be_bytes(*id));
        let again = frame::wrap(framing, transaction, &message);
        assert_eq!(again.len(), frame::wrapped_length(framing, message.len()));
        assert!(
            bytes.get(..again.len()).is_some_and(|same| same.eq_ignore_ascii_case(&again)),
            "{framing:?} {bytes:02X?}"
        );
    }
    let is_message = (2..=frame::MESSAGE_MAX).contains(&bytes.len());
    if is_message {
        let wrapped = frame::wrap(framing, 7, bytes);
        assert_eq!(frame::unwrap(framing, &wrapped).as_deref(), Ok(bytes), "{framing:?}");
    }
}

/// A response that is found lies within the bytes, and its frame holds its message.
fn check_reply(known: Framing, request: &[u8], response: &[u8]) {
    for ended in [false, true] {
        let Ok(reply) = framing::find_reply(known, request, response, ended) else { continue };
        let frame = &response[reply.range.clone()];
        assert!(frame.len() >= reply.message.len(), "{reply:?}");
    }
}

/// The bytes of a tag lie within the response.
fn find_tags(known: Framing, request: &[u8], response: &[u8]) {
    let exchange = Exchange {
        at: Timestamp::UNIX_EPOCH,
        framing: known,
        request: Arc::from(request),
        answer: Arc::from(response),
        outcome: Ok(()),
        response_time: None,
        tries: 1,
    };
    for tag in &TANK.tags {
        if let Some(found) = source_frame::find(tag.point, &exchange) {
            assert!(found.range.end <= response.len(), "{}: {found:?}", tag.name);
        }
    }
}
