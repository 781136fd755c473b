//! What was heard, in lines of text: frames, values, the statistics of each unit.

use std::{collections::BTreeMap, time::Duration};

use jiff::{Timestamp, tz::TimeZone};

use crate::{
    bus::{
        dissect::{self, Direction},
        frame,
        listen::{Ended, Heard, HeardFrame, Listener, Role},
    },
    cli::tools::shown,
    plant::{
        Snapshot,
        fault::Fault,
        id::TagId,
        line::{Framing, LineDef},
        line_state::UartCounters,
        request_stats::RequestStats,
        sample::{Cause, Quality},
    },
};

/// Columns before the text of a frame.
const INDENT: usize = 23;

pub(super) struct Words {
    time_zone: TimeZone,
    verbose: bool,
    /// The values as they were shown last.
    values: BTreeMap<TagId, String>,
}

impl Words {
    pub fn new(time_zone: TimeZone, verbose: bool) -> Words {
        Words { time_zone, verbose, values: BTreeMap::new() }
    }

    fn line(&self, at: Timestamp, what: &str, text: &str) -> String {
        let at = at.to_zoned(self.time_zone.clone());
        format!("{} {what:9} {text}", at.strftime("%H:%M:%S%.3f"))
    }

    /// `12:01:05.135 response  1 register: 0032, after 12.1 ms`, and its bytes.
    pub fn frame_lines(&self, heard: &Heard) -> Vec<String> {
        match heard {
            Heard::Ended(Ended { outcome: Ok(()) | Err(Fault::Exception(_) | Fault::Unproven), .. }) => Vec::new(),
            Heard::Ended(Ended { outcome: Err(fault), at, request, response, .. }) => {
                let asked = frame::with_crc(request);
                let asked = dissect::dissect(&asked, Some(Framing::Rtu), Some(Direction::Request), None).summary;
                let what = if response.is_some() { "doubtful" } else { "lost" };
                vec![self.line(*at, what, &format!("{asked}: {fault}"))]
            }
            Heard::Frame(heard) => {
                let (what, text) = words_of(heard);
                let mut lines = vec![self.line(heard.frame.at, what, &text)];
                if self.verbose && heard.role != Role::Noise {
                    lines.push(format!("{:INDENT$}{}", "", shown(&heard.frame.bytes, heard.frame.framing)));
                }
                lines
            }
        }
    }

    /// Of these values those that are not as they were shown last.
    pub fn changed_values(&mut self, at: Timestamp, snapshot: &Snapshot, tags: &[TagId]) -> Vec<String> {
        let mut lines = Vec::new();
        for tag in tags {
            let text = value(snapshot, *tag);
            if self.values.get(tag) != Some(&text) {
                lines.push(self.line(at, "value", &text));
                self.values.insert(*tag, text);
            }
        }
        lines
    }

    /// The values that are known, with the time at which each was heard.
    pub fn value_table(&self, snapshot: &Snapshot) -> Vec<String> {
        let known =
            snapshot.def.tags.iter().filter(|tag| {
                tag.calculation.is_none() && snapshot.sample(tag.id).quality != Quality::Bad(Cause::NotRead)
            });
        let rows: Vec<(String, Timestamp)> =
            known.map(|tag| (value(snapshot, tag.id), snapshot.sample(tag.id).at)).collect();
        let width = rows.iter().map(|(text, _)| text.chars().count()).max().unwrap_or_default();
        let time = |at: &Timestamp| at.to_zoned(self.time_zone.clone()).strftime("%H:%M:%S").to_string();
        let title = if rows.is_empty() { "values: none heard" } else { "values, and when each was heard:" };
        let row = |(text, at): &(String, Timestamp)| format!("  {text:width$}  {}", time(at));
        std::iter::once(title.to_owned()).chain(rows.iter().map(row)).collect()
    }
}

fn words_of(heard: &HeardFrame) -> (&'static str, String) {
    let frame = &heard.frame;
    let dissected = |direction, asked: Option<&[u8]>| {
        dissect::dissect(&frame.bytes, Some(frame.framing), Some(direction), asked).summary
    };
    match &heard.role {
        Role::Request => ("request", dissected(Direction::Request, None)),
        Role::Response { request, time } => {
            let after = time.map(|time| format!(", after {}", millis(Some(time)))).unwrap_or_default();
            ("response", format!("{}{after}", dissected(Direction::Answer, Some(request))))
        }
        Role::Unmatched => {
            let unit = frame.unit.map(|unit| format!("unit {unit}: ")).unwrap_or_default();
            ("unmatched", format!("{unit}{}", dissected(Direction::Answer, None)))
        }
        Role::Noise => ("noise", format!("{} ({})", frame::hex(&frame.bytes), frame.result)),
    }
}

/// `PV = 70.3 °C`; what is not good says why.
fn value(snapshot: &Snapshot, tag: TagId) -> String {
    let def = snapshot.def.tag(tag);
    let name = if snapshot.def.devices.len() == 1 { &def.short } else { &def.name };
    let quality = snapshot.sample(tag).quality;
    let text = match snapshot.text(tag) {
        Some(text) => format!("{name} = {text} {}", snapshot.unit(tag)),
        None => format!("{name} = no value"),
    };
    let text = text.trim_end();
    if quality == Quality::Good { text.to_owned() } else { format!("{text} ({})", quality.word()) }
}

/// What was heard in all, and of each unit.
pub(super) fn summary(listener: &Listener, line: &LineDef, time: Duration) -> Vec<String> {
    let totals = listener.totals();
    let mut lines = vec![format!(
        "listened for {:.1} s: {} requests, {} responses, {} responses without request, {} bytes of noise",
        time.as_secs_f64(),
        totals.requests,
        totals.responses,
        totals.unmatched,
        totals.noise_bytes,
    )];
    match (totals.requests + totals.unmatched, totals.noise_bytes, line.transport.serial()) {
        (0, 0, _) => lines.push("nothing was heard: no master polls, or this is not its line".to_owned()),
        (0, _, Some(serial)) => {
            lines.push(format!(
                "no frame at {serial}: other serial settings (--baud, --parity), A and B swapped, or --mode"
            ));
        }
        (0, _, None) => lines.push("no frame: another --mode (tcp, rtu-over-tcp), or no Modbus".to_owned()),
        (1.., ..) => {}
    }
    if !listener.units().is_empty() {
        lines.push(
            "  unit  requests        ok  refused  no response  corrupt  unmatched     median        max".to_owned(),
        );
    }
    lines.extend(listener.units().iter().map(|(unit, stats)| match line.transport.framing().is_broadcast(*unit) {
        true => format!("   all  {:8}  broadcasts, to which no unit responds", stats.requests),
        false => row(*unit, stats),
    }));
    if 0 < listener.waiting() {
        lines.push(format!("{} without a response at the end, not counted above", listener.waiting()));
    }
    lines
}

fn row(unit: u8, stats: &RequestStats) -> String {
    let refused: u64 = stats.exceptions.iter().map(|(_, count)| count).sum();
    format!(
        "  {unit:4}  {:8}  {:8}  {refused:7}  {:11}  {:7}  {:9}  {:>9}  {:>9}",
        stats.requests,
        stats.ok,
        stats.timeouts,
        stats.corrupt(),
        stats.late,
        millis(stats.response_time.median()),
        millis(stats.response_time.max()),
    )
}

fn millis(time: Option<Duration>) -> String {
    time.map_or_else(|| "–".to_owned(), |time| format!("{:.1} ms", time.as_secs_f64() * 1e3))
}

/// What the driver of the port has counted.
pub(super) fn uart(uart: UartCounters) -> String {
    let UartCounters { parity, framing, overrun, breaks } = uart;
    format!("errors of the port: {parity} parity, {framing} framing, {overrun} overrun, {breaks} breaks")
}
