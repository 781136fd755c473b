//! How the device and its line do, and how the value's poll keeps its time.

use crate::t;
use std::time::Duration;

use super::facts::span;
use crate::ui::modal::sheet::Fact;
use crate::{
    plant::{
        def::DeviceDef,
        line_state::{DeviceState, LineState},
        sample::Cause,
        tag::{Poll, TagDef},
        time::elapsed,
        traffic::Exchange,
    },
    ui::{
        ViewContext,
        modal::faceplate::device_text,
        widgets::text::{age, running},
    },
};

/// How the device stands, how fast it answers, what went wrong last; and its line, if that is not well.
pub(super) fn device_rows(
    cx: &ViewContext,
    def: &TagDef,
    device: &DeviceDef,
    exchange: Option<&Exchange>,
) -> Vec<Fact> {
    let theme = cx.theme;
    let status = cx.snapshot.device(device.id);
    let line = cx.snapshot.line(device.line);
    let stats = line.report.as_ref().and_then(|report| report.device(device.id));
    let mut text = device_text(cx, device.id);
    if let Some(p99) = stats.and_then(|stats| stats.response_time.p99()) {
        text += &t!(", 99 % within {span}", span = span(p99));
    }
    if let Some((failed, of)) = stats.map(|stats| stats.recent()).filter(|(failed, _)| 0 < *failed) {
        text += &t!(", {failed} of the last {of} failed", failed, of);
    }
    let well = matches!(status.state, DeviceState::Responding | DeviceState::Unknown);
    let mut rows = vec![Fact::new(t!("device"), text, if well { theme.normal() } else { theme.trouble() })];
    rows.extend(status.diagnosis.map(|reason| {
        let signal = reason.signal();
        Fact::new(
            "",
            format!("{} {}: {reason}", signal.word(), crate::text::translate(signal.label())),
            theme.trouble(),
        )
    }));
    // What stands above already is not said again.
    let notes = cx.snapshot.sample(def.id).quality.cause() == Some(Cause::NotConnected);
    rows.extend(
        line_words(cx, &line.state).filter(|_| !notes).map(|words| Fact::new(t!("line"), words, theme.trouble())),
    );
    let verdict = exchange.and_then(|exchange| exchange.outcome.err());
    if let Some((at, fault)) = status.last_fault.filter(|(_, fault)| Some(*fault) != verdict) {
        let ago = age(elapsed(at, cx.now));
        rows.push(Fact::new("", t!("last fault {ago} ago: {fault}", ago, fault), theme.dim()));
    }
    rows
}

/// When it is read, with whom, and whether that works out.
pub(super) fn poll_rows(cx: &ViewContext, def: &TagDef) -> Vec<Fact> {
    let line = cx.snapshot.line(cx.def().device(def.device).line);
    let Some(report) = &line.report else { return Vec::new() };
    if report.refused.contains(&def.id) {
        return vec![Fact::new(
            t!("poll"),
            t!("no longer polled: the device refuses this address"),
            cx.theme.trouble(),
        )];
    }
    let Some(poll) = report.poll_of(def.id) else { return Vec::new() };
    let period = match poll.poll {
        Poll::Every(period) => t!("every {span}", span = span(period)),
        Poll::Once => t!("once, and on refresh").to_owned(),
        Poll::Never => t!("on request only").to_owned(),
    };
    let next = poll.next.map(|next| match elapsed(cx.now, next) {
        Duration::ZERO => t!(", due now").to_owned(),
        wait => t!(", next in {span}", span = span(wait)),
    });
    let busy = match (poll.shed, poll.factor) {
        (true, _) => t!(", skipped while the line is overloaded").to_owned(),
        (false, factor) if factor < 1.05 => String::new(),
        (false, factor) => t!(", now every {factor} periods: the line is overloaded", factor = format!("{factor:.1}")),
    };
    let mut text = t!(
        "{period}{busy}{next}, {missed} missed",
        period,
        busy,
        next = next.unwrap_or_default(),
        missed = poll.stats.missed
    );
    if let Some(p99) = poll.stats.jitter.p99() {
        text += &t!(", jitter {span}", span = span(p99));
    }
    text += &t!(", takes {span}", span = span(poll.cost));
    vec![Fact::new(
        t!("poll"),
        text,
        if poll.stats.missed == 0 && busy.is_empty() { cx.theme.normal() } else { cx.theme.trouble() },
    )]
}

/// What is the matter with a line; `None` while it is connected.
pub(super) fn line_words(cx: &ViewContext, state: &LineState) -> Option<String> {
    match state {
        LineState::Connected => None,
        LineState::NoTraffic => Some(t!("no traffic heard").to_owned()),
        LineState::Connecting => Some(t!("connecting").to_owned()),
        LineState::Disconnected => Some(t!("disconnected by an operator").to_owned()),
        LineState::Testing => Some(t!("in use by a test").to_owned()),
        LineState::Waiting { why, retry_at } => {
            Some(t!("not connected: {why}; retry in {running}", why, running = running(elapsed(cx.now, *retry_at))))
        }
    }
}
