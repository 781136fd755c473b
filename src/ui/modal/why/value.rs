//! The value with quality and cause, what to do about a doubt, and the number that it was made from.

use super::{facts::span, service::line_words};
use crate::t;
use crate::text::translate;
use crate::ui::modal::sheet::Fact;
use crate::{
    bus::{
        codec,
        source_frame::{self, TagBytes},
    },
    plant::{
        def::TagId,
        fault::Fault,
        identity::IdentityTest,
        line_state::LineState,
        sample::{Cause, Quality},
        scale,
        tag::{Access, Decimals, Poll, TagDef},
        text_value,
        traffic::Exchange,
    },
    ui::{
        ViewContext,
        widgets::{
            text::{age, clock},
            value,
        },
    },
};

/// The value with its quality and age, the reason for a doubt, and what to do about it.
pub(super) fn value_rows(
    cx: &ViewContext,
    def: &TagDef,
    exchange: Option<&Exchange>,
    found: Option<&TagBytes>,
) -> Vec<Fact> {
    let sample = cx.snapshot.sample(def.id);
    let shown = value::show(cx, def.id);
    let at = clock(sample.at, &cx.def().time_zone);
    let quality = match sample.quality {
        _ if def.access == Access::Write => t!("write only: it cannot be read").to_owned(),
        Quality::Good if cx.is_past() => t!("good, stored {age} before, at {at}", age = age(cx.age(def.id)), at),
        Quality::Good => t!("good, read {age} ago at {at}", age = age(cx.age(def.id)), at),
        Quality::Uncertain(cause) => {
            t!(
                "uncertain: {cause}; read {age} ago at {at}",
                cause = translate(cause.word()),
                age = age(cx.age(def.id)),
                at
            )
        }
        Quality::Bad(cause) => t!("bad: {cause}, since {at}", cause = translate(cause.word()), at),
    };
    let mut rows = vec![Fact::new(t!("value"), format!("{}  {quality}", shown.with_unit()), shown.style)];
    let Some(cause) = sample.quality.cause().filter(|_| def.access != Access::Write) else { return rows };
    if let Some(because) = because(cx, def, cause, exchange, found) {
        rows.push(Fact::new(t!("cause"), because, cx.theme.normal()));
    }
    if let Some(advice) = advice(cx, def, cause, exchange) {
        rows.push(Fact::new(t!("action"), advice, cx.theme.strong()));
    }
    rows
}

/// What the cause does not say by itself: the other tag, the number that means "no value".
fn because(
    cx: &ViewContext,
    def: &TagDef,
    cause: Cause,
    exchange: Option<&Exchange>,
    found: Option<&TagBytes>,
) -> Option<String> {
    let line = cx.def().device(def.device).line;
    let words_of = |tag| words_of(cx, tag);
    match cause {
        Cause::NotConnected => line_words(cx, &cx.snapshot.line(line).state),
        Cause::SensorFault => {
            let raw = found.and_then(|found| found.raw);
            if let Some(raw) = raw.filter(|raw| def.is_bad(*raw)) {
                return Some(t!("raw {raw} means \"no value\" for this device", raw));
            }
            match (exchange.and_then(|exchange| exchange.outcome.err()), def.quality_from) {
                (Some(Fault::NotANumber), _) => Some(Fault::NotANumber.to_string()),
                (_, Some((word, mask))) => Some(t!(
                    "{words_of} (bits 0x{mask}: any bit set = fault)",
                    words_of = words_of(word),
                    mask = format!("{mask:X}")
                )),
                (_, None) => None,
            }
        }
        Cause::Unscaled => match def.decimals {
            Decimals::From(from) => {
                Some(t!("its decimals come from another value: {words_of}", words_of = words_of(from)))
            }
            Decimals::PowerFrom(from) => {
                Some(t!("its power of ten comes from another value: {words_of}", words_of = words_of(from)))
            }
            Decimals::Fixed(_) => None,
        },
        Cause::Stale => match def.poll {
            Poll::Every(period) => {
                Some(t!("polled every {span}, but not read for longer than that", span = span(period)))
            }
            Poll::Once | Poll::Never => Some(t!("it is read on request only").to_owned()),
        },
        Cause::OnRequest => Some(t!("it is read on request only").to_owned()),
        Cause::NotPresent => Some(t!("the device does not have it: {words_of}", words_of = wanted(cx, def).join(", "))),
        Cause::NotHeard => {
            let heard = exchange.map_or(cx.snapshot.sample(def.id).at, |exchange| exchange.at);
            Some(t!("not heard for {seconds} s", seconds = crate::plant::time::elapsed(heard, cx.now).as_secs()))
        }
        // The verdict on the last answer says it all.
        Cause::Corrupt | Cause::Exception | Cause::Timeout | Cause::DeviceDown | Cause::Undefined => None,
        Cause::NotRead
        | Cause::StationOff
        | Cause::Reloaded
        | Cause::NotAuthorised
        | Cause::Unreadable
        | Cause::NotStored
        | Cause::NotReadBack
        | Cause::Stated
        | Cause::Unproven => None,
    }
}

fn words_of(cx: &ViewContext, tag: TagId) -> String {
    t!("{name} is {whole}", name = cx.def().tag(tag).name, whole = value::show(cx, tag).whole())
}

/// What a tag depends on, and what its device says of it.
fn wanted(cx: &ViewContext, def: &TagDef) -> Vec<String> {
    let test = |test: &IdentityTest| match cx.snapshot.identities.said(test.device, test.object) {
        Some(said) => t!("{test}, the device says \"{said}\"", test, said),
        None => test.to_string(),
    };
    let when = def.when.iter();
    let tests = when.clone().flat_map(|when| when.identity_tests()).map(test);
    when.flat_map(|when| when.tags()).map(|tag| words_of(cx, tag)).chain(tests).collect()
}

/// One sentence: what a technician does.
fn advice(cx: &ViewContext, def: &TagDef, cause: Cause, exchange: Option<&Exchange>) -> Option<String> {
    let device = cx.def().device(def.device);
    let fault = exchange.and_then(|exchange| exchange.outcome.err());
    let last = cx.snapshot.device(device.id).last_fault.map(|(_, fault)| fault);
    let of = |fault: Fault| Some(translate(source_frame::advice(fault)).to_owned());
    match cause {
        Cause::NotConnected => match cx.snapshot.line(device.line).state {
            LineState::Disconnected => Some(t!("connect the line again: tab 4, D").to_owned()),
            LineState::Testing => Some(t!("wait for the end of the test, or stop it").to_owned()),
            LineState::Waiting { .. } | LineState::Connecting | LineState::Connected | LineState::NoTraffic => {
                of(Fault::NotConnected)
            }
        },
        Cause::Timeout | Cause::DeviceDown => of(fault.or(last).unwrap_or(Fault::Timeout)),
        Cause::Corrupt => of(fault.unwrap_or(Fault::Crc { got: 0, computed: 0 })),
        Cause::Exception => fault.or(last).and_then(of),
        Cause::SensorFault if fault == Some(Fault::NotANumber) => of(Fault::NotANumber),
        Cause::SensorFault => Some(t!("check the sensor, its wires and the input range of the device").to_owned()),
        Cause::NotHeard if last == Some(Fault::NotHeard) => of(Fault::NotHeard),
        Cause::NotHeard => Some(t!("see whether the other master still reads it").to_owned()),
        Cause::Unproven => of(Fault::Unproven),
        Cause::Unscaled => Some(t!("correct the other value first: press w on it for the cause").to_owned()),
        Cause::Stale => match def.poll {
            Poll::Every(_) => {
                Some(t!("the line may be overloaded: see missed polls below, poll less often").to_owned())
            }
            Poll::Once | Poll::Never => Some(t!("read it now: tab 4, u").to_owned()),
        },
        Cause::OnRequest => Some(t!("read it now: tab 4, u").to_owned()),
        Cause::NotRead => match def.poll {
            Poll::Every(_) | Poll::Once => None,
            Poll::Never => Some(t!("read it now: tab 4, u").to_owned()),
        },
        Cause::NotAuthorised => Some(t!("log in: tab 0").to_owned()),
        Cause::Stated => {
            Some(t!("compare it with the device: the other master of this line has not read it").to_owned())
        }
        Cause::Undefined => Some(t!("see its inputs: a division by zero, or a number that is too large").to_owned()),
        Cause::StationOff
        | Cause::Reloaded
        | Cause::Unreadable
        | Cause::NotStored
        | Cause::NotReadBack
        | Cause::NotPresent => None,
    }
}

/// `5058 5234 = "PXR4", blanks at the end left out`.
fn text(cx: &ViewContext, def: &TagDef, found: Option<&TagBytes>) -> String {
    let in_answer = found.and_then(|found| codec::decode_text(def.point, &found.words));
    match (in_answer, found, cx.snapshot.text(def.id)) {
        (Some(text), Some(found), _) => {
            let hex: Vec<String> = found.words.iter().map(|word| format!("{word:04X}")).collect();
            let odd = text.contains(text_value::UNPRINTABLE);
            let note = if odd { t!(", · = unprintable byte") } else { "" };
            t!("\"{text}\"{note}, from {join}", text, note, join = hex.join(" "))
        }
        (_, _, Some(text)) => t!("\"{text}\", earlier response", text),
        (..) => t!("none").to_owned(),
    }
}

/// `raw 724 (02D4) × 10^-1 = 72.4 °C, decimals from TIC-1.DP`.
pub(super) fn number(cx: &ViewContext, def: &TagDef, exchange: Option<&Exchange>, found: Option<&TagBytes>) -> String {
    if def.is_text() {
        return text(cx, def, found);
    }
    let scaling = cx.snapshot.scaling_decimals(def.id);
    let from_answer = found.and_then(|found| found.raw);
    // Without an answer that holds it: the number behind the value that is still shown.
    let shown = cx.snapshot.sample(def.id).exact().and_then(|value| scale::to_raw(def, value, scaling));
    let hex = found.map(|found| found.words.iter().map(|word| format!(" {word:04X}")).collect::<String>());
    let Some(raw) = from_answer.or(shown) else {
        return match hex {
            Some(hex) => t!("none:{hex} is not a valid {kind}", hex, kind = def.point.kind),
            None => t!("none").to_owned(),
        };
    };
    let hex = hex.filter(|_| !def.point.table.is_bits()).map(|hex| format!(" ({})", hex.trim_start()));
    let mut words = t!("raw {raw}{hex}", raw, hex = hex.unwrap_or_default());
    if scaling != 0 {
        words += &format!(" × 10^{}", -scaling);
    }
    if def.scale != 1.0 {
        words += &format!(" × {}", def.scale);
    }
    if def.offset != 0.0 {
        words += &format!(" {} {}", if def.offset < 0.0 { '−' } else { '+' }, def.offset.abs());
    }
    let result = cx.snapshot.format(def.id, scale::to_value(def, raw, scaling));
    words += &format!(" = {result} {}", cx.snapshot.unit(def.id));
    let mut words = words.trim_end().to_owned();
    match def.decimals {
        Decimals::From(from) if cx.snapshot.sample(from).is_stated() => {
            words += &t!(", decimals as the plant file states {name}", name = cx.def().tag(from).name);
        }
        Decimals::From(from) => words += &t!(", decimals from {name}", name = cx.def().tag(from).name),
        Decimals::PowerFrom(from) => words += &t!(", power of ten from {name}", name = cx.def().tag(from).name),
        Decimals::Fixed(_) if def.scale == 1.0 && def.offset == 0.0 && def.enum_labels.is_empty() => {
            words += t!(", not scaled")
        }
        Decimals::Fixed(_) => {}
    }
    if from_answer.is_none() && exchange.is_some() {
        words += t!(", earlier response");
    }
    words
}
