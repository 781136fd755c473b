//! The checks of a write before it goes to the bus.

use std::time::Duration;

use jiff::Timestamp;

use super::{CommandTracker, WriteOrigin};
use crate::plant::{
    command::{CommandStatus, Outcome, Refusal, WriteId, WriteJob},
    commands::record::value_text,
    def::TagId,
    exact::Exact,
    interlock,
    process_image::ProcessImage,
    sample::Quality,
    scale,
    tag::{Access, Bound},
    tag_value::TagValue,
    text_value::{self, ExpectedText},
    time::elapsed,
};

/// What was read longer ago may have been changed at the device: it is read again before it is called unchanged, or written over.
const FRESH: Duration = Duration::from_secs(5);

fn is_fresh(image: &ProcessImage, tag: TagId, at: Timestamp) -> bool {
    !image.is_waiting(tag) && elapsed(image.sample(tag).at, at) <= FRESH
}

impl CommandTracker {
    /// Checks a write against access, choices, bounds, type, what is under way, and the value that the operator saw.
    pub(super) fn check(
        &self,
        image: &ProcessImage,
        status: &CommandStatus,
        written: (TagId, Exact),
        origin: WriteOrigin,
    ) -> Result<WriteJob, Outcome> {
        let job = self.check_value(image, written, origin, status.at)?;
        self.check_expected(image, status, &job)?;
        Ok(job)
    }

    /// Refuses a write over a value that the operator has not seen. A stop is right whatever the value is.
    fn check_expected(&self, image: &ProcessImage, status: &CommandStatus, job: &WriteJob) -> Result<(), Outcome> {
        let def = self.def.tag(job.tag);
        let now = image.good_raw(job.tag).zip(image.scaling_decimals(def)).filter(|_| !job.urgent);
        let Some((raw, decimals)) = now else { return Ok(()) };
        let now = scale::to_value(def, raw, decimals);
        let same_raw = |seen| scale::to_raw(def, seen, decimals).is_some_and(|seen| scale::same_raw(def, seen, raw));
        match status.command.expected_value {
            Some(seen) if same_raw(seen) => Ok(()),
            Some(_) => Err(Outcome::Refused(Refusal::ChangedTo(value_text(image, def, now)))),
            None => Err(Outcome::Refused(Refusal::NotSeen(value_text(image, def, now)))),
        }
    }

    fn check_value(
        &self,
        image: &ProcessImage,
        (tag, value): (TagId, Exact),
        origin: WriteOrigin,
        at: Timestamp,
    ) -> Result<WriteJob, Outcome> {
        let refuse = |refusal| Err(Outcome::Refused(refusal));
        let def = self.def.tag(tag);
        if !def.writable() {
            return refuse(Refusal::ReadOnly);
        }
        if def.is_text() {
            return refuse(Refusal::NotAText(ExpectedText(def.point.kind)));
        }
        let decimals = image.scaling_decimals(def);
        let sent = decimals.and_then(|decimals| scale::to_raw(def, value, decimals));
        let urgent = interlock::is_stop(&self.def, tag, value, decimals);
        let mut under_way = self.writes.iter().filter(|(_, job)| job.tag == tag).map(|(_, job)| &job.raw).peekable();
        let is_busy = under_way.peek().is_some();
        // A stop need not wait for the start under way; the same stop twice would only take the line's time.
        let same = |raw: &TagValue| raw.number().zip(sent).is_some_and(|(raw, sent)| scale::same_raw(def, raw, sent));
        if is_busy && (!urgent || under_way.any(same)) {
            return refuse(Refusal::UnderWay);
        }
        let held = decimals.zip(sent).map(|(decimals, sent)| scale::to_value(def, sent, decimals));
        if !def.enum_labels.is_empty()
            && [Some(value), held].iter().flatten().any(|value| def.label_of(*value).is_none())
        {
            return refuse(Refusal::NotAChoice);
        }
        if let Some(lock) = interlock::refusal(&self.def, tag, value, decimals, |tag| image.sample(tag)) {
            return refuse(Refusal::Interlock(lock.message.clone()));
        }
        let unknown = |tag: TagId| Outcome::Refused(Refusal::Unknown(self.def.tag(tag).name.clone()));
        let known = |tag: TagId| image.sample(tag).good_exact();
        let bounds = match origin {
            WriteOrigin::Person | WriteOrigin::Unconditional if !urgent => def.limits(known).map_err(unknown)?,
            WriteOrigin::Person | WriteOrigin::Unconditional | WriteOrigin::SafeState => {
                let now = |bound: Option<Bound>| bound?.now(known).ok();
                (now(def.min), now(def.max))
            }
        };
        let Some(decimals) = decimals else {
            let source = def.decimals.source().map_or(&def.name, |source| &self.def.tag(source).name);
            return refuse(Refusal::Unknown(source.clone()));
        };
        let Some(raw) = scale::raw_within(def, value, decimals, bounds) else {
            let (min, max) = scale::bounds_text(def, bounds, decimals, Some(image.shown_decimals(def)));
            return refuse(Refusal::OutOfRange { min, max });
        };
        // What makes safe is written as near as it can be; else only what was asked for is written.
        let held = scale::to_value(def, raw, decimals);
        if origin != WriteOrigin::SafeState && !urgent && !scale::is_held(def, value, held) {
            return refuse(Refusal::Resolution(value_text(image, def, held)));
        }
        // What was read before the write under way says nothing about the time after it.
        if !is_busy && is_fresh(image, tag, at) && image.good_raw(tag).is_some_and(|now| scale::same_raw(def, now, raw))
        {
            return Err(Outcome::Unchanged);
        }
        let job = self.job(image, tag, raw.into(), urgent);
        let is_old = origin == WriteOrigin::Person && !urgent && !is_fresh(image, tag, at);
        let seen = image.good_raw(tag).filter(|_| is_old);
        Ok(WriteJob { over: seen.filter(|_| job.verify).map(TagValue::Number), ..job })
    }

    /// Checks a write of a text against access, what is under way, and the text that the operator saw.
    pub(super) fn check_text(
        &self,
        image: &ProcessImage,
        (tag, held, seen): (TagId, Result<String, ExpectedText>, Option<&str>),
        at: Timestamp,
    ) -> Result<WriteJob, Outcome> {
        let refuse = |refusal| Err(Outcome::Refused(refusal));
        let def = self.def.tag(tag);
        if !def.writable() {
            return refuse(Refusal::ReadOnly);
        }
        let held = held.map_err(|expected| Outcome::Refused(Refusal::NotAText(expected)))?;
        if self.writes.iter().any(|(_, job)| job.tag == tag) {
            return refuse(Refusal::UnderWay);
        }
        let good = image.sample(tag).quality == Quality::Good;
        let now = image.texts[tag.index()].as_deref().filter(|_| good && !text_value::is_running(def.point.kind));
        match now {
            Some(now) if seen.is_none() => refuse(Refusal::NotSeen(now.to_owned())),
            Some(now) if seen != Some(now) => refuse(Refusal::ChangedTo(now.to_owned())),
            Some(now) if now == held && is_fresh(image, tag, at) => Err(Outcome::Unchanged),
            seen => {
                let job = self.job(image, tag, TagValue::Text(held.into()), false);
                let seen = seen.filter(|_| job.verify && !is_fresh(image, tag, at));
                Ok(WriteJob { over: seen.map(|seen| TagValue::Text(seen.into())), ..job })
            }
        }
    }

    fn job(&self, image: &ProcessImage, tag: TagId, raw: TagValue, urgent: bool) -> WriteJob {
        let def = self.def.tag(tag);
        let raw_of = |unlock_tag, value: f64| scale::to_raw(self.def.tag(unlock_tag), value, 0).unwrap_or(value.into());
        let unlock = def.write_unlock.map(|(unlock_tag, value)| (unlock_tag, raw_of(unlock_tag, value)));
        // An unlock register that has its value keeps it, unless a write is just changing it.
        let unlock = unlock.filter(|(unlock_tag, unlock_value)| {
            let moving = self.writes.iter().any(|(_, job)| job.tag == *unlock_tag);
            let now = image.good_raw(*unlock_tag).filter(|_| !moving);
            now.is_none_or(|now| !scale::same_raw(self.def.tag(*unlock_tag), now, *unlock_value))
        });
        let verify = def.access != Access::Write;
        let unscaled_by = def.decimals.source().and_then(|_| image.scaling_decimals(def));
        WriteJob { id: WriteId(self.last_write + 1), tag, raw, unlock, verify, urgent, over: None, unscaled_by }
    }
}
