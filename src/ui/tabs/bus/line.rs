//! Page Line: settings, load, how requests ended, how each device answers, and what to do about what is wrong.

mod worries;

use worries::worries;

use super::{
    LineView, lines, ms,
    rows::{self, Spans, flow, number, plain, words},
    short_ms,
};
use crate::ui::tabs::prelude::*;
use crate::{
    bus::names,
    plant::{fault::Fault, line_report::LineReport, line_state::LineState, request_stats::RequestStats},
    ui::{modal::faceplate::retry_text, tabs::controllers::signal_mark, widgets::spark},
};

/// A reply that takes this share of the timeout is near it.
const NEAR: f64 = 0.8;

pub fn rows(cx: &ViewContext, at: &LineView, width: u16) -> Vec<Spans> {
    if cx.is_past() {
        return past(cx, at);
    }
    let mut rows = lines::rows(cx, at);
    rows.extend(worries(cx, at).iter().flat_map(|worry| sentence(cx, worry, width)));
    rows.extend(settings(cx, at, width));
    let Some(report) = at.report else {
        rows.push(plain(t!("no data from this line yet"), cx.theme.trouble()));
        return rows;
    };
    rows.extend(load(cx, report, width));
    rows.push(Spans::new());
    rows.extend(devices(cx, at, report, width));
    rows.push(Spans::new());
    if !at.settings.listens {
        rows.extend(cycle(cx, report, width));
    }
    rows.extend(counters(cx, at, report, width));
    if let Some(north) = &cx.snapshot.north {
        let until = moment(north.sent_until, cx.now, &cx.def().time_zone);
        let style = if north.error.is_none() && north.connected { cx.theme.normal() } else { cx.theme.trouble() };
        rows.extend(flow(t!("data out"), cx.theme.dim(), width, [plain(north.words(&until), style)]));
        if let Some(requests) = &north.requests {
            let words = requests.words(|at| moment(at, cx.now, &cx.def().time_zone));
            let style = if requests.error.is_none() { cx.theme.normal() } else { cx.theme.trouble() };
            rows.extend(flow(t!("data in"), cx.theme.dim(), width, words.into_iter().map(|words| plain(words, style))));
        }
    }
    if let Some(load) = cx.snapshot.load {
        rows.extend(flow(t!("program"), cx.theme.dim(), width, [plain(load.words(), cx.theme.normal())]));
    }
    rows
}

/// What the history has of a line: the minute in which the instant lies.
fn past(cx: &ViewContext, at: &LineView) -> Vec<Spans> {
    let counters = &at.status.counters;
    let words = match counters.requests {
        0 => t!("no request is on record for this minute").to_owned(),
        requests => t!(
            "in this minute {requests} requests: {ok} answered, {timeouts} timeouts, {corrupt} corrupt, {exceptions} exceptions",
            requests,
            ok = counters.ok,
            timeouts = counters.timeouts,
            corrupt = counters.corrupt,
            exceptions = counters.exceptions
        ),
    };
    let kept = t!("Plan, frames, tests and registers are not kept in the history.");
    vec![plain(words, cx.theme.normal()), plain(kept, cx.theme.dim())]
}

/// `! what is wrong`, over as many rows as it needs.
fn sentence(cx: &ViewContext, words: &str, width: u16) -> Vec<Spans> {
    let lines = wrap(words, width.saturating_sub(5)).into_iter().enumerate();
    lines.map(|(n, line)| plain(format!("{} {line}", if n == 0 { "!" } else { " " }), cx.theme.trouble())).collect()
}

fn settings(cx: &ViewContext, at: &LineView, width: u16) -> Vec<Spans> {
    let (theme, line) = (cx.theme, at.settings);
    let mut parts = vec![plain(line.transport.to_string(), theme.strong())];
    parts.push(match line.listens {
        true => plain(t!("nothing is sent").to_owned(), theme.normal()),
        false => value(cx, t!("timeout"), &ms(line.timeout)),
    });
    if let Some(serial) = line.transport.serial() {
        parts.push(value(cx, t!("silence"), &ms(serial.silent_interval().max(line.gap))));
        parts.push(value(cx, t!("end of response"), &ms(line.frame_timeout)));
    }
    let lamp = |on: bool| if on { theme.pick("●", "@") } else { theme.pick("○", "o") };
    let counters = &at.status.counters;
    let recent = |at: Option<Timestamp>| {
        at.is_some_and(|at| elapsed(at, cx.now).as_secs_f64() < 3.0 * cx.snapshot.speed.max(1.0))
    };
    let (tx, rx) = (recent(counters.last_tx), recent(counters.last_rx));
    let deaf = tx && !rx;
    let nothing = if deaf { t!(" no response") } else { "" };
    let lamps = match line.listens {
        true => t!("RX {lamp}", lamp = lamp(rx)),
        false => t!("TX {lamp} RX {lamp2}{value}", lamp = lamp(tx), lamp2 = lamp(rx), value = nothing),
    };
    parts.push(plain(lamps, if deaf { theme.trouble() } else { theme.normal() }));
    flow(t!("settings"), theme.dim(), width, parts)
}

fn load(cx: &ViewContext, report: &LineReport, width: u16) -> Vec<Spans> {
    let (theme, counters) = (cx.theme, &report.counters);
    let (now, minute) = (f64::from(counters.utilisation), f64::from(counters.utilisation_minute));
    let (style, mark) = if now < 0.9 { (theme.normal(), "") } else { (theme.trouble(), "! ") };
    let part = vec![
        (format!("{mark}{:>3.0} % ", now * 100.0), style),
        (draw::bar(cx, now, 12), style),
        (t!(" {minute} % of the last minute ", minute = format!("{:>3.0}", minute * 100.0)), theme.normal()),
        (spark::shares(&report.busy, usize::from(width.saturating_sub(60)).min(60), theme.glyphs), theme.dim()),
    ];
    flow(t!("load"), theme.dim(), width, [part])
}

fn cycle(cx: &ViewContext, report: &LineReport, width: u16) -> Vec<Spans> {
    let plan = report.scan();
    let measured = plan.measured.map_or(t!("not yet").to_owned(), ms);
    let parts = [
        value(cx, t!("blocks"), &plan.blocks.to_string()),
        value(cx, t!("worst-case scan time"), &t!("{ms}, measured {measured}", ms = ms(plan.worst), measured)),
        value(cx, t!("worst-case load"), &format!("{:.0} %", plan.load * 100.0)),
        count(cx, t!("missed"), report.counters.missed, missed_lately(report)),
        value(cx, t!("dispatch p99"), &report.dispatch.p99().map_or("–".to_owned(), ms)),
    ];
    flow(t!("cycle"), cx.theme.dim(), width, parts)
}

fn missed_lately(report: &LineReport) -> bool {
    0.9 <= report.counters.utilisation && 0 < report.counters.missed
}

fn counters(cx: &ViewContext, at: &LineView, report: &LineReport, width: u16) -> Vec<Spans> {
    let (dim, counters) = (cx.theme.dim(), &report.counters);
    let (sum, listens) = (DeviceStats::new(report), at.settings.listens);
    let count = |name: &str, times| count(cx, name, times, sum.lately);
    let mut parts = vec![
        plain(grouped(counters.requests), cx.theme.normal()),
        value(cx, t!("ok"), &grouped(counters.ok)),
        count(t!("timeouts"), counters.timeouts),
        count(t!("corrupt"), counters.corrupt),
    ];
    let kinds = [(t!("check"), sum.check), (t!("length"), sum.length), (t!("foreign"), sum.foreign)];
    parts.extend(kinds.into_iter().filter(|(_, times)| 0 < *times).map(|(name, times)| count(name, times)));
    parts.push(count(t!("refused"), counters.exceptions));
    for (code, times) in &sum.exceptions {
        parts.push(count(&format!("{:02X} {}", code.0, translate(code.label())), *times));
    }
    if listens {
        parts.push(value(cx, t!("pairs"), &grouped(counters.ok + counters.exceptions)));
    } else {
        parts.push(value(cx, t!("retries"), &grouped(sum.retries)));
    }
    parts.extend([count(t!("late"), counters.late), count(t!("unexpected"), counters.unexpected)]);
    let mut rows = flow(if listens { t!("heard") } else { t!("requests") }, dim, width, parts);
    let lost = at.status.state != LineState::Connected;
    let bytes = match listens {
        true => vec![value(cx, t!("bytes in"), &grouped(counters.received_bytes))],
        false => vec![
            value(cx, t!("bytes out"), &grouped(counters.sent_bytes)),
            value(cx, t!("in"), &grouped(counters.received_bytes)),
        ],
    };
    let parts = bytes.into_iter().chain([
        value(cx, t!("frames"), &grouped(counters.frames)),
        self::count(cx, t!("reconnects"), counters.opens.saturating_sub(1), lost),
    ]);
    rows.extend(flow(t!("traffic"), dim, width, parts));
    if let Some(uart) = counters.uart {
        let kinds = [
            (t!("parity"), uart.parity),
            (t!("framing"), uart.framing),
            (t!("overrun"), uart.overrun),
            (t!("break"), uart.breaks),
        ];
        rows.extend(flow(t!("port"), dim, width, kinds.map(|(name, times)| count(name, u64::from(times)))));
    }
    if let Some(signals) = counters.signals {
        let state = |on| if on { t!("on") } else { t!("off") };
        rows.extend(flow(t!("signals"), dim, width, signals.all().map(|(name, on)| value(cx, name, state(on)))));
    }
    if counters.echoes {
        let words = t!("local echo: the adapter gives back what it sends (removed from responses)");
        rows.extend(flow(t!("port"), dim, width, [plain(words, cx.theme.normal())]));
    }
    rows
}

/// The statistics of all devices together.
#[derive(Debug, Default)]
struct DeviceStats {
    check: u64,
    length: u64,
    foreign: u64,
    retries: u64,
    exceptions: Vec<(crate::plant::fault::ExceptionCode, u64)>,
    /// Has one of the latest requests failed?
    lately: bool,
}

impl DeviceStats {
    fn new(report: &LineReport) -> DeviceStats {
        let mut sum = DeviceStats::default();
        for (_, stats) in &report.devices {
            sum.check += stats.check;
            sum.length += stats.length;
            sum.foreign += stats.foreign;
            sum.retries += stats.retries;
            sum.lately |= 0 < stats.recent().0;
            for (code, times) in &stats.exceptions {
                match sum.exceptions.iter_mut().find(|(known, _)| known == code) {
                    Some((_, count)) => *count += times,
                    None => sum.exceptions.push((*code, *times)),
                }
            }
        }
        sum
    }
}

fn devices(cx: &ViewContext, at: &LineView, report: &LineReport, width: u16) -> Vec<Spans> {
    let columns = [
        words("", 0),
        words(t!("device"), 0),
        number(t!("unit"), 0),
        words(t!("state"), 0),
        number(t!("ok"), 2),
        number(t!("failed"), 1),
        number(t!("of last"), 4),
        number(t!("reply"), 1),
        number("p99", 3),
        number(t!("max"), 3),
        // How long the other master waits is not known.
        words(if at.settings.listens { "" } else { t!("of the timeout") }, 5),
    ];
    let mut styles = Vec::new();
    let mut lines = Vec::new();
    for device in cx.def().devices.iter().filter(|device| device.line == at.id) {
        let Some(stats) = report.device(device.id) else { continue };
        let diagnosed = cx.snapshot.device(device.id).diagnosis.is_some();
        let ill =
            diagnosed || is_ill(cx, device) || (!at.settings.listens && near(stats, report.settings.timeout).is_some());
        let mark = match cx.snapshot.device(device.id).diagnosis {
            Some(reason) => signal_mark(reason.signal()),
            None if cx.snapshot.device(device.id).state == DeviceState::Unknown => "?".to_owned(),
            None => if ill { "!" } else { "✓" }.to_owned(),
        };
        styles.push(if ill { cx.theme.trouble() } else { cx.theme.normal() });
        let span = |span: Option<Duration>| span.map_or("–".to_owned(), short_ms);
        let (failed, of) = stats.recent();
        let p99 = stats.response_time.p99().filter(|_| !at.settings.listens);
        let share = p99.map(|p99| p99.as_secs_f64() / report.settings.timeout.as_secs_f64());
        lines.push([
            mark,
            device.name.clone(),
            device.unit.to_string(),
            state(cx, device),
            grouped(stats.ok),
            grouped(stats.requests - stats.ok),
            format!("{failed}/{of}"),
            span(stats.response_time.last()),
            span(stats.response_time.p99()),
            span(stats.response_time.max()),
            share.map_or(String::new(), |share| draw::bar(cx, share, 8)),
        ]);
    }
    let (heading, lines) = rows::table(&columns, &lines, width.saturating_sub(2));
    let mut rows = vec![plain(heading, cx.theme.dim())];
    rows.extend(lines.into_iter().zip(styles).map(|(line, style)| plain(line, style)));
    rows
}

fn state(cx: &ViewContext, device: &DeviceDef) -> String {
    match cx.snapshot.device(device.id).state {
        DeviceState::Unknown if cx.def().listens_on(device.line) => t!("not heard").to_owned(),
        DeviceState::Unknown => t!("not polled").to_owned(),
        DeviceState::Responding => t!("OK").to_owned(),
        DeviceState::Failing(times) => t!("failing {times}×", times),
        DeviceState::Down { since } => {
            let (running, retry_text) = (running(elapsed(since, cx.now)), retry_text(cx, device.id));
            t!("DOWN {running}{retry_text}", running, retry_text)
        }
    }
}

fn is_ill(cx: &ViewContext, device: &DeviceDef) -> bool {
    matches!(cx.snapshot.device(device.id).state, DeviceState::Failing(_) | DeviceState::Down { .. })
}

/// The longest usual reply, if it comes near the timeout.
fn near(stats: &RequestStats, timeout: Duration) -> Option<Duration> {
    stats.response_time.p99().filter(|p99| timeout.mul_f64(NEAR) <= *p99)
}

fn value(cx: &ViewContext, label: &str, text: &str) -> Spans {
    vec![(format!("{label} "), cx.theme.dim()), (text.to_owned(), cx.theme.normal())]
}

/// A count of what should not happen: quiet at zero and when it is long ago.
fn count(cx: &ViewContext, label: &str, times: u64, lately: bool) -> Spans {
    match (times, lately) {
        (0, _) | (_, false) => value(cx, label, &grouped(times)),
        (_, true) => plain(format!("!{label} {}", grouped(times)), cx.theme.trouble()),
    }
}

/// `12 345`: a thin look for long counts.
pub fn grouped(count: u64) -> String {
    let digits = count.to_string();
    let parts: Vec<&str> =
        digits.as_bytes().rchunks(3).rev().map(|part| std::str::from_utf8(part).unwrap_or_default()).collect();
    parts.join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        plant::{
            command::Outcome,
            mqtt_request::{LastMqttRequest, MqttRequestStatus, MqttResult},
            north_status::NorthStatus,
        },
        ui::fixture::{Fixture, with_cx},
    };

    #[test]
    fn the_data_out_and_the_load_of_the_program_are_said() {
        let mut snapshot = (*Fixture::traffic().snapshot()).clone();
        let words = |snapshot: &Snapshot| -> String {
            with_cx(snapshot, |cx| {
                let at = LineView::new(cx, LineId(0)).expect("the line is there");
                rows(cx, &at, 120).iter().flatten().map(|(words, _)| words.as_str()).collect()
            })
        };
        assert!(words(&snapshot).contains("140 wake-ups/s") && !words(&snapshot).contains("data out"));
        let sent_until = crate::ui::fixture::now();
        let error = Some("refused".to_owned());
        let north = NorthStatus { connected: false, sent: 12, refused: 3, sent_until, error, requests: None };
        snapshot.north = Some(north.clone().into());
        let found = words(&snapshot);
        assert!(found.contains("not connected: refused, 12 samples sent, 3 refused, complete until 14:02:"), "{found}");
        assert!(!found.contains("data in"), "{found}");

        let result = MqttResult::Outcome(Outcome::Verified);
        let last = Some(LastMqttRequest { at: sent_until, what: "4711 TIC-1.SV = 50".into(), result });
        let requests = MqttRequestStatus { user: "mes".into(), accepted: 3, refused: 2, last, ..Default::default() };
        snapshot.north = Some(NorthStatus { requests: Some(requests), ..north }.into());
        let found = words(&snapshot);
        assert!(
            found.contains("as mes, 3 accepted, 2 refused, 0 unanswered") && found.contains("last at 14:02:"),
            "{found}"
        );
        assert!(found.contains("4711 TIC-1.SV = 50: verified"), "{found}");
    }

    #[test]
    fn numbers_read_easily() {
        assert_eq!([0, 12, 1_234, 1_234_567].map(grouped), ["0", "12", "1 234", "1 234 567"]);
    }
}
