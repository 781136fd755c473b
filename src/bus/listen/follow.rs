//! The values of devices as another master reads them, by the maps of their profiles.

use std::{sync::Arc, time::Duration};

use jiff::Timestamp;

use super::{Heard, Role};
use crate::{
    bus::{
        codec, frame,
        meaning::{self, Span},
    },
    plant::{
        Plant, PlantDef, Snapshot,
        def::DeviceId,
        event::{Event, Fault},
        id::TagId,
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

    /// Takes what was heard; gives the tags that it is about. A response that may be a late one to another request gives
    /// no values, and what was written is uncertain until it is read.
    pub fn follow(&mut self, at: Timestamp, heard: &Heard) -> Vec<TagId> {
        let (request, response, time, fault) = match heard {
            Heard::Lost { request, fault, .. } => (request, None, None, Some(*fault)),
            Heard::Frame(heard) => {
                let Role::Response { request, time, proven } = &heard.role else { return Vec::new() };
                let Ok(response) = frame::unwrap(heard.frame.framing, &heard.frame.bytes) else { return Vec::new() };
                let fault = frame::check_answer(request, &response).err();
                (request, Some(response), *time, fault.or((!proven).then_some(Fault::OutOfSync)))
            }
        };
        let def = self.plant.def().clone();
        let devices = def.devices.iter().filter(|device| Some(&device.unit) == request.first());
        let spans = meaning::spans(request, response.as_deref()).unwrap_or_default();
        let pairs = devices.flat_map(|device| spans.iter().map(|span| (device.id, span)));
        pairs.flat_map(|(device, span)| self.follow_span(at, device, span, time, fault)).collect()
    }

    fn follow_span(
        &mut self,
        at: Timestamp,
        device: DeviceId,
        span: &Span,
        time: Option<Duration>,
        fault: Option<Fault>,
    ) -> Vec<TagId> {
        let def = self.plant.def().clone();
        let tags: Vec<TagId> = span.tags(&def, device).map(|tag| tag.id).collect();
        if span.writes {
            self.plant.on_foreign_write(&tags, fault, at);
        } else if let Some(fault) = fault {
            self.plant.on_event(Event::Failed { at, device, tags: tags.clone(), fault, exchange: None });
        } else {
            let (mut values, mut texts, mut unreadable) = (Vec::new(), Vec::new(), Vec::new());
            for tag in span.tags(&def, device) {
                let Some(words) = span.words_of(tag.point) else { continue };
                match (codec::decode_text(tag.point, words), codec::decode(tag.point, words)) {
                    (Some(text), _) => texts.push((tag.id, text.into())),
                    (None, Some(value)) => values.push((tag.id, value)),
                    (None, None) => unreadable.push(tag.id),
                }
            }
            let response_time = time.unwrap_or_default();
            self.plant.on_event(Event::Read { at, device, values, texts, response_time, exchange: None });
            let fault = Fault::NotANumber;
            self.plant.on_event(Event::Failed { at, device, tags: unreadable, fault, exchange: None });
        }
        tags
    }
}
