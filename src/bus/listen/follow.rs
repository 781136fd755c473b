//! What was heard of devices, as events for their plant: the same that a poll gives, by the maps of their profiles.

use std::sync::Arc;

use jiff::{SignedDuration, Timestamp};

use super::{Ended, Heard, HeardFrame, Role};
use crate::{
    bus::{
        codec, frame,
        meaning::{self, Span},
    },
    plant::{
        Plant, PlantDef, Snapshot,
        def::{DeviceDef, DeviceId, Framing, LineId},
        event::Event,
        fault::{Fault, FaultKind},
        id::TagId,
        traffic::{Exchange, Frame},
    },
};

/// Follows the devices of a plant, whose tags are never asked for here.
pub struct Follower {
    plant: Plant,
}

impl Follower {
    /// Nothing is known yet.
    pub fn new(def: Arc<PlantDef>, at: Timestamp) -> Follower {
        Follower { plant: Plant::new(def, at, 1.0) }
    }

    /// Every value as of what was heard last, with its quality.
    pub fn snapshot(&self) -> Snapshot {
        self.plant.snapshot()
    }

    /// Takes what was heard on the only line of the plant; gives the tags that it is about.
    pub fn follow(&mut self, at: Timestamp, heard: &Heard) -> Vec<TagId> {
        let mut tags = Vec::new();
        for event in events(&self.plant.def().clone(), LineId(0), at, heard) {
            if let Event::Read { values, texts, .. } = &event {
                tags.extend(values.iter().map(|(tag, _)| *tag).chain(texts.iter().map(|(tag, _)| *tag)));
            } else if let Event::Failed { tags: about, .. } | Event::ForeignWrite { tags: about, .. } = &event {
                tags.extend(about);
            }
            self.plant.on_event(event);
        }
        tags
    }
}

/// A device does not respond after three requests in a row without a response, or nine with none but corrupt ones, which some
/// noise can do to a device that lives.
const LOST_MAX: u32 = 9;

/// What came of the requests to each device since its last response: see `LOST_MAX`.
pub struct Losses(Vec<u32>);

impl Losses {
    /// None yet.
    pub fn new(def: &PlantDef) -> Losses {
        Losses(vec![0; def.devices.len()])
    }

    /// Follows an event of a device; gives the event that it does not respond, once it has been silent too often.
    pub fn observe(&mut self, def: &PlantDef, event: &Event) -> Option<Event> {
        if let Event::Read { device, .. } = event {
            self.0[device.index()] = 0;
        }
        let Event::Failed { at, device, fault, exchange, .. } = event else { return None };
        let lost = &mut self.0[device.index()];
        let before = *lost;
        *lost = match fault.kind() {
            FaultKind::Exception(code) if !code.is_of_gateway() => 0,
            // It has responded, perhaps to another request.
            FaultKind::NotHeard if exchange.as_ref().is_some_and(|exchange| !exchange.answer.is_empty()) => 0,
            FaultKind::Timeout => before.saturating_add(LOST_MAX / 3),
            FaultKind::Corrupt => before.saturating_add(1),
            // Anything else says nothing of the device.
            FaultKind::Exception(_)
            | FaultKind::OutOfSync
            | FaultKind::NotANumber
            | FaultKind::NotConnected
            | FaultKind::BackedOff
            | FaultKind::NotHeard
            | FaultKind::Unproven => before,
        };
        let tags = def.tags_of(*device).map(|tag| tag.id).collect();
        let (at, device, fault) = (*at, *device, Fault::BackedOff);
        (before < LOST_MAX && LOST_MAX <= *lost).then_some(Event::Failed { at, device, tags, fault, exchange: None })
    }
}

/// What was heard on a line until `now`, for its devices. A response that may be that of another request gives no values, and what
/// the master writes is uncertain until it is read.
pub fn events(def: &PlantDef, line: LineId, now: Timestamp, heard: &Heard) -> Vec<Event> {
    match heard {
        Heard::Frame(HeardFrame { frame, role: Role::Request }) => writes(def, line, now, frame),
        Heard::Frame(_) => Vec::new(),
        Heard::Ended(ended) => {
            let at = now.checked_sub(SignedDuration::try_from(ended.held).unwrap_or_default()).unwrap_or(now);
            let (exchange, response) = exchange_of(ended);
            let spans = meaning::spans((&ended.request).into(), response.as_deref()).unwrap_or_default();
            let devices = devices_of(def, line, &ended.request);
            let pairs = devices.flat_map(|device| spans.iter().map(move |span| (device, span)));
            pairs.flat_map(|(device, span)| events_of(def, at, device, span, &exchange)).collect()
        }
    }
}

/// The devices that a request asks: on a serial line unit 0 is all of them.
fn devices_of<'a>(def: &'a PlantDef, line: LineId, request: &[u8]) -> impl Iterator<Item = DeviceId> + use<'a> {
    let unit = request.first().copied();
    let all = unit == Some(0) && def.line(line).transport.framing() != Framing::Mbap;
    let asked = move |device: &&DeviceDef| device.line == line && (all || Some(device.unit) == unit);
    def.devices.iter().filter(asked).map(|device| device.id)
}

/// What a request writes, as soon as it is heard.
fn writes(def: &PlantDef, line: LineId, at: Timestamp, frame: &Frame) -> Vec<Event> {
    let Ok(request) = frame::unwrap(frame.framing, &frame.bytes) else { return Vec::new() };
    let spans = meaning::spans((&request).into(), None).unwrap_or_default();
    let written = spans.iter().filter(|span| span.writes);
    let tags: Vec<TagId> = written
        .flat_map(|span| devices_of(def, line, &request).map(move |device| (span, device)))
        .flat_map(|(span, device)| span.tags(def, device).map(|tag| tag.id))
        .collect();
    if tags.is_empty() { Vec::new() } else { vec![Event::ForeignWrite { at, tags, fault: None }] }
}

/// The request and what came back, as a poll would have it, and the response message.
fn exchange_of(ended: &Ended) -> (Arc<Exchange>, Option<Vec<u8>>) {
    let answer: Arc<[u8]> = ended.response.clone().unwrap_or_else(|| [].into());
    // The number of the transaction is that of the response.
    let transaction = answer.first_chunk().map_or(0, |id| u16::from_be_bytes(*id));
    let response = ended.response.as_ref().and_then(|frame| frame::unwrap(ended.framing, frame).ok());
    let exchange = Exchange {
        at: ended.at,
        framing: ended.framing,
        request: frame::wrap(ended.framing, transaction, &ended.request).into(),
        answer,
        outcome: ended.outcome,
        response_time: ended.time,
        tries: 1,
    };
    (Arc::new(exchange), response)
}

fn events_of(def: &PlantDef, at: Timestamp, device: DeviceId, span: &Span, exchange: &Arc<Exchange>) -> Vec<Event> {
    let fault = exchange.outcome.err();
    let tags = || span.tags(def, device).map(|tag| tag.id).collect();
    match fault {
        // What a write that was answered has done is known when it is read.
        None | Some(Fault::Unproven) if span.writes => return Vec::new(),
        Some(_) if span.writes => return vec![Event::ForeignWrite { at, tags: tags(), fault }],
        // A value all the same, which is uncertain.
        None | Some(Fault::Unproven) => {}
        Some(fault) => {
            return vec![Event::Failed { at, device, tags: tags(), fault, exchange: Some(exchange.clone()) }];
        }
    }
    let exchange = Some(exchange.clone());
    let (mut values, mut texts, mut unreadable) = (Vec::new(), Vec::new(), Vec::new());
    for tag in span.tags(def, device) {
        let Some(words) = span.words_of(tag.point) else { continue };
        match (codec::decode_text(tag.point, words), codec::decode(tag.point, words)) {
            (Some(text), _) => texts.push((tag.id, text.into())),
            (None, Some(value)) => values.push((tag.id, value)),
            (None, None) => unreadable.push(tag.id),
        }
    }
    let response_time = exchange.as_ref().and_then(|exchange| exchange.response_time).unwrap_or_default();
    let mut events = vec![Event::Read { at, device, values, texts, response_time, exchange: exchange.clone() }];
    if !unreadable.is_empty() {
        events.push(Event::Failed { at, device, tags: unreadable, fault: Fault::NotANumber, exchange });
    }
    events
}
