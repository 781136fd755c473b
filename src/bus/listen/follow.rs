//! What was heard of devices, as events for their plant: the same that a poll gives, by the maps of their profiles.

use std::{sync::Arc, time::Duration};

use jiff::Timestamp;

use super::{Heard, HeardFrame, Role};
use crate::{
    bus::{
        codec, frame,
        meaning::{self, Span},
    },
    plant::{
        Plant, PlantDef, Snapshot,
        def::{DeviceId, Framing, LineId},
        event::{Event, Fault},
        id::TagId,
        tag::Poll,
        traffic::Exchange,
    },
};

/// No line is without traffic before this time.
const SILENT_MIN: Duration = Duration::from_secs(10);

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

/// How a request of the other master has ended.
pub struct Ending {
    /// The unit that was asked.
    pub unit: u8,
    /// As a poll would have it.
    pub outcome: Result<(), Fault>,
    /// From the request to the response, if one came.
    pub response_time: Option<Duration>,
}

/// How a request has ended, if one has.
pub fn ending(heard: &Heard) -> Option<Ending> {
    let (exchange, (request, _)) = exchange_of(heard)?;
    Some(Ending { unit: *request.first()?, outcome: exchange.outcome, response_time: exchange.response_time })
}

/// A device that did not answer so many requests in a row does not respond.
const LOST_MAX: u32 = 3;

/// The requests to each device that had no response, since its last.
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
        let Event::Failed { at, device, fault, .. } = event else { return None };
        let lost = &mut self.0[device.index()];
        if matches!(fault, Fault::Exception(code) if !code.is_of_gateway()) {
            *lost = 0;
        }
        // Anything else says nothing of the device.
        if *fault != Fault::Timeout && !fault.is_corrupt() {
            return None;
        }
        *lost = lost.saturating_add(1);
        let tags = def.tags_of(*device).map(|tag| tag.id).collect();
        let (at, device, fault) = (*at, *device, Fault::BackedOff);
        (*lost == LOST_MAX).then_some(Event::Failed { at, device, tags, fault, exchange: None })
    }
}

/// A line on which no frame is heard for so long has no traffic: three of the shortest poll periods of its profiles, and not
/// less than ten seconds.
pub fn silent_after(def: &PlantDef, line: LineId) -> Duration {
    let devices = def.devices.iter().filter(|device| device.line == line);
    let periods = devices.flat_map(|device| def.tags_of(device.id)).filter_map(|tag| match tag.poll {
        Poll::Every(period) if tag.calculation.is_none() => Some(period),
        Poll::Every(_) | Poll::Once | Poll::Never => None,
    });
    (periods.min().unwrap_or_default() * 3).max(SILENT_MIN)
}

/// What was heard on a line, for its devices. A response that may be a late one to another request gives no values, and what
/// was written is uncertain until it is read.
pub fn events(def: &PlantDef, line: LineId, at: Timestamp, heard: &Heard) -> Vec<Event> {
    if let Some(request) = broadcast(heard) {
        let spans = meaning::spans(&request, None).unwrap_or_default();
        let devices = def.devices.iter().filter(|device| device.line == line);
        let pairs = devices.flat_map(|device| spans.iter().filter(|span| span.writes).map(|span| (device.id, span)));
        let tags: Vec<TagId> = pairs.flat_map(|(device, span)| span.tags(def, device).map(|tag| tag.id)).collect();
        return vec![Event::ForeignWrite { at, tags, fault: None }];
    }
    let Some((exchange, message)) = exchange_of(heard) else { return Vec::new() };
    let (request, response) = message;
    let spans = meaning::spans(&request, response.as_deref()).unwrap_or_default();
    let devices = def.devices.iter().filter(|device| device.line == line && Some(&device.unit) == request.first());
    let pairs = devices.flat_map(|device| spans.iter().map(|span| (device.id, span)));
    let exchange = Arc::new(exchange);
    pairs.flat_map(|(device, span)| events_of(def, at, device, span, &exchange)).collect()
}

/// A request to all devices of a serial line, which none of them answers.
fn broadcast(heard: &Heard) -> Option<Vec<u8>> {
    let Heard::Frame(HeardFrame { frame, role: Role::Request }) = heard else { return None };
    if frame.framing == Framing::Mbap {
        return None;
    }
    frame::unwrap(frame.framing, &frame.bytes).ok().filter(|message| message.first() == Some(&0))
}

/// A request and its response, without frames.
type Messages = (Vec<u8>, Option<Vec<u8>>);

/// The request and what came back, as a poll would have it, and both as messages; `None` for what is no end of a request.
fn exchange_of(heard: &Heard) -> Option<(Exchange, Messages)> {
    let (at, framing, request, answer, response_time, outcome) = match heard {
        Heard::Lost { at, framing, request, fault } => (*at, *framing, request, None, None, Err(*fault)),
        Heard::Frame(heard) => {
            let Role::Response { request, time, proven } = &heard.role else { return None };
            let message = frame::unwrap(heard.frame.framing, &heard.frame.bytes).ok()?;
            let checked = frame::check_answer(heard.frame.framing, request, &message);
            let outcome = if *proven { checked } else { checked.and(Err(Fault::OutOfSync)) };
            (heard.frame.at, heard.frame.framing, request, Some((&heard.frame, message)), *time, outcome)
        }
    };
    // The number of the transaction is that of the response.
    let transaction =
        answer.as_ref().and_then(|(frame, _)| frame.bytes.first_chunk()).map_or(0, |id| u16::from_be_bytes(*id));
    let exchange = Exchange {
        at,
        framing,
        request: frame::wrap(framing, transaction, request).into(),
        answer: answer.as_ref().map_or_else(|| [].into(), |(frame, _)| frame.bytes.clone()),
        outcome,
        response_time,
        tries: 1,
    };
    Some((exchange, (request.clone(), answer.map(|(_, message)| message))))
}

fn events_of(def: &PlantDef, at: Timestamp, device: DeviceId, span: &Span, exchange: &Arc<Exchange>) -> Vec<Event> {
    let fault = exchange.outcome.err();
    let tags = || span.tags(def, device).map(|tag| tag.id).collect();
    if span.writes {
        return vec![Event::ForeignWrite { at, tags: tags(), fault }];
    }
    let exchange = Some(exchange.clone());
    if let Some(fault) = fault {
        return vec![Event::Failed { at, device, tags: tags(), fault, exchange }];
    }
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
