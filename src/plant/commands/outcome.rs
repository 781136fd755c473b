//! What the result of a write on the wire means.

use std::time::Duration;

use crate::plant::{
    command::{NotConfirmed, Outcome, Refusal, WriteJob, WriteResult},
    commands::value_text,
    process_image::ProcessImage,
    scale,
    tag::TagDef,
    tag_value::TagValue,
    text_value,
};

/// The outcome of a write, accepted this long ago.
pub(super) fn of_write(
    def: &TagDef,
    job: &WriteJob,
    result: WriteResult,
    image: &ProcessImage,
    ago: Duration,
) -> Outcome {
    let value = |back| match back {
        TagValue::Number(raw) => scale::to_value(def, raw, image.scaling_decimals(def).unwrap_or(0)).into(),
        TagValue::Text(_) => back,
    };
    // What scales it may be another by now: the same raw number is then another value.
    let is_meant = job.unscaled_by.is_none_or(|by| image.scaling_decimals(def).is_none_or(|now| now == by));
    let is_held = |back: &TagValue| match (&job.raw, back) {
        _ if !is_meant => false,
        (TagValue::Number(raw), TagValue::Number(back)) => scale::same_raw(def, *raw, *back),
        (TagValue::Text(text), TagValue::Text(back)) => text_value::is_held(def.point.kind, text, back, ago),
        (TagValue::Number(_), TagValue::Text(_)) | (TagValue::Text(_), TagValue::Number(_)) => false,
    };
    match result {
        WriteResult::ReadBack(back) | WriteResult::ReadBackAfterFault(_, back) if is_held(&back) => {
            if image.is_waiting(def.id) { Outcome::NotConfirmed(NotConfirmed::NoReadBack) } else { Outcome::Verified }
        }
        WriteResult::Held(back) if is_held(&back) => Outcome::Unchanged,
        WriteResult::Held(back) => Outcome::Refused(Refusal::ChangedTo(match value(back) {
            TagValue::Number(value) => value_text(image, def, value),
            TagValue::Text(text) => text_value::quoted(&text),
        })),
        WriteResult::ReadBack(back) => Outcome::NotConfirmed(NotConfirmed::Different(value(back))),
        WriteResult::ReadBackAfterFault(fault, back) => {
            Outcome::NotConfirmed(NotConfirmed::NotApplied(fault, value(back)))
        }
        unread => without_read_back(&unread),
    }
}

/// The outcome of a write whose value was not read back.
pub(super) fn without_read_back(result: &WriteResult) -> Outcome {
    match result {
        WriteResult::Refused(code) => Outcome::Refused(Refusal::Exception(*code)),
        WriteResult::NotSent(fault) => Outcome::Refused(Refusal::NotSent(*fault)),
        WriteResult::Superseded => Outcome::Refused(Refusal::Superseded),
        WriteResult::NoValidResponse(fault) => Outcome::NotConfirmed(NotConfirmed::NotAnswered(*fault)),
        WriteResult::NotRead(fault) => Outcome::NotConfirmed(NotConfirmed::NotRead(*fault)),
        WriteResult::Sent => Outcome::Sent,
        WriteResult::Held(_) => Outcome::Refused(Refusal::Changed),
        WriteResult::Accepted | WriteResult::ReadBack(_) | WriteResult::ReadBackAfterFault(..) => {
            Outcome::NotConfirmed(NotConfirmed::NoReadBack)
        }
    }
}
