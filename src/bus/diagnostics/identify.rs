//! The identification of a device: lists of its objects, single ones where it gives them, else the server id of function 11.

use std::collections::BTreeSet;

use super::{Ask, Job, Step, StepResult, read, step, text_of};
use crate::{
    bus::pdu::{self, MEI_IDENTIFICATION, READ_ONE_OBJECT},
    plant::{
        diagnostics::Finding,
        fault::{ExceptionCode, Fault},
        identity,
        tag::Table,
    },
};

/// The objects that each level of conformity adds, by the read code of their list (V1.1b3, 6.21).
const LISTS: [(u8, u8); 3] = [(1, 0), (2, 3), (3, 0x80)];
/// The first object of a maker's own.
const EXTENDED: u8 = 0x80;

/// Most requests for the objects that a profile asks for: a list that goes on and on is none.
const REQUESTS_MAX: usize = 12;

/// What is known of a device while it is identified.
#[derive(Debug, Clone, Default)]
pub(in crate::bus) struct IdentifyJob {
    /// Only these objects are of interest, if not all.
    wanted: Option<BTreeSet<u8>>,
    found: BTreeSet<u8>,
    /// Read code and object of each request: none is made twice.
    asked: BTreeSet<(u8, u8)>,
    /// Where a list goes on, or begins again.
    next: Option<(u8, u8)>,
    /// Level of conformity: 1 to 3, and whether single objects can be asked for.
    conformity: Option<(u8, bool)>,
    /// It has refused the first list, but not the function.
    refuses_lists: bool,
}

impl IdentifyJob {
    /// Asks for these objects, and for no more than it takes.
    pub fn wanting(wanted: BTreeSet<u8>) -> IdentifyJob {
        IdentifyJob { wanted: Some(wanted), ..IdentifyJob::default() }
    }

    /// Takes the outcome of a request, the first of which is [`FIRST`]; gives the objects that are new, with their texts.
    pub fn on_outcome(&mut self, asked: (u8, u8), outcome: Result<&[u8], Fault>) -> Vec<(u8, String)> {
        self.asked.insert(asked);
        match outcome {
            Ok(answer) => self.on_answer(asked, answer).into_iter().map(|(id, text)| (id, text_of(text))).collect(),
            Err(fault) => {
                self.on_failure(asked, fault);
                Vec::new()
            }
        }
    }

    /// What is asked next of the objects that are wanted.
    pub fn next_wanted(&mut self) -> Option<(u8, u8)> {
        let is_open = self.wanted.as_ref().is_some_and(|wanted| !wanted.is_subset(&self.found));
        (is_open && self.asked.len() < REQUESTS_MAX).then(|| self.advance()).flatten()
    }

    /// Does the list of objects from this one on hold one that is of interest?
    fn is_of_interest(&self, (_, first): (u8, u8)) -> bool {
        let last = LISTS.iter().map(|(_, next)| *next).find(|next| first < *next).map_or(u8::MAX, |next| next - 1);
        self.wanted.as_ref().is_none_or(|wanted| wanted.range(first..=last).any(|id| !self.found.contains(id)))
    }

    /// Takes an answer; gives the objects that were not known.
    fn on_answer<'a>(&mut self, (code, _): (u8, u8), answer: &'a [u8]) -> Vec<(u8, &'a [u8])> {
        let (Some(pdu), [_, _, _, _, conformity, more, next, ..]) = (answer.get(1..), answer) else {
            return Vec::new();
        };
        let level = conformity & 0x7F;
        // A level that the standard does not have may be any.
        let level = if (1..=3).contains(&level) { level } else { 3 };
        self.conformity = Some((level, 0x80 <= *conformity));
        self.next = (*more != 0 && code != READ_ONE_OBJECT).then_some((code, *next));
        pdu::identification_objects(pdu).filter(|(id, _)| self.found.insert(*id)).collect()
    }

    /// Takes a refusal. A list that does not begin there may begin at 0.
    fn on_failure(&mut self, (code, object): (u8, u8), fault: Fault) {
        let is_refused = matches!(fault, Fault::Exception(why) if why != ExceptionCode::ILLEGAL_FUNCTION);
        self.refuses_lists |= is_refused && (code, object) == LISTS[0];
        self.next = (is_refused && code != READ_ONE_OBJECT && object != 0).then_some((code, 0));
    }

    /// What is asked next: read code and object.
    fn advance(&mut self) -> Option<(u8, u8)> {
        let (level, is_single) = match self.conformity {
            Some(known) => known,
            None if self.refuses_lists => (0, true),
            None => (0, false),
        };
        let lists = LISTS.into_iter().take(usize::from(level)).filter(|list| self.is_of_interest(*list));
        let lists: Vec<(u8, u8)> = lists.collect();
        // Some devices say less of themselves than they have.
        let regular = (0 < level && self.is_of_interest(LISTS[1])).then_some(LISTS[1]);
        let known = match level {
            0 => 0..=0,
            1 => 0..=2,
            2.. => 0..=6,
        };
        let extended = (2 < level).then(|| (EXTENDED..=u8::MAX).find(|id| !self.found.contains(id))).flatten();
        // One by one only those that no list has given.
        let is_unlisted = self.asked.contains(&(READ_ONE_OBJECT, EXTENDED)) || !self.found.contains(&EXTENDED);
        let missing = known.filter(|id| !self.found.contains(id)).chain(extended.filter(|_| is_unlisted));
        let missing: Vec<u8> = match &self.wanted {
            Some(wanted) => wanted.difference(&self.found).copied().collect(),
            None => missing.collect(),
        };
        let single = missing.into_iter().filter(|_| is_single).map(|id| (READ_ONE_OBJECT, id));
        let next = self.next.take().into_iter().chain(lists).chain(regular).chain(single);
        let next = { next }.find(|request| !self.asked.contains(request));
        self.asked.extend(next);
        next
    }
}

/// Read code and object of the first request.
pub(in crate::bus) const FIRST: (u8, u8) = LISTS[0];

/// A request of an identification by read code and object.
pub(in crate::bus) fn objects_from(unit: u8, (code, object): (u8, u8)) -> Step {
    step(vec![unit, identity::FUNCTION, MEI_IDENTIFICATION, code, object])
}

/// The first request.
pub(super) fn first(unit: u8) -> Step {
    objects_from(unit, FIRST)
}

impl Job {
    /// Handles an answer while a device is identified.
    pub(super) fn on_identified(&mut self, step: &Step, result: StepResult) {
        let (Ask::Message(request), StepResult::Answer(answer, exchange)) = (&step.ask, result) else { return };
        self.found(Finding::Exchange(exchange));
        match (&request[..], answer) {
            (&[unit, 0x2B, _, code, object], answer) => self.on_objects(unit, (code, object), request, answer),
            (&[_, 0x11], Ok(answer)) => {
                let text = text_of(answer.get(3..).unwrap_or_default());
                self.found(Finding::Object { id: None, text });
            }
            (&[unit, 0x11], Err(fault)) => {
                self.failed(request, fault);
                // It may be silent where it does not know a function: a read shows whether it is there.
                if fault == Fault::Timeout {
                    self.queued.push_back(super::step(read(unit, Table::Holding, 0, 1)));
                }
            }
            (_, Err(fault)) => self.failed(request, fault),
            (_, Ok(_)) => {}
        }
    }

    fn on_objects(&mut self, unit: u8, asked: (u8, u8), request: &[u8], answer: Result<Vec<u8>, Fault>) {
        let identify = &mut self.identify;
        identify.asked.insert(asked);
        let (is_first, mut objects) = (asked == LISTS[0], Vec::new());
        match answer {
            Ok(answer) => {
                let new = identify.on_answer(asked, &answer);
                objects.extend(new.into_iter().map(|(id, text)| Finding::Object { id: Some(id), text: text_of(text) }));
            }
            Err(fault) => {
                identify.on_failure(asked, fault);
                // What else it has was only a question.
                if is_first || fault == Fault::Timeout {
                    self.failed(request, fault);
                }
            }
        }
        objects.into_iter().for_each(|object| self.found(object));
        let identify = &mut self.identify;
        match identify.advance() {
            Some(next) => self.queued.push_back(objects_from(unit, next)),
            None if identify.found.is_empty() => self.queued.push_back(step(vec![unit, 0x11])),
            None => {}
        }
    }
}

#[cfg(test)]
mod tests;
