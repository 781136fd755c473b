//! `sightglass status`: how the station and its plant stand, for people and for scripts.

use std::{sync::Arc, time::Duration};

use jiff::Timestamp;
use serde_json::{Value, json};

use crate::{
    history::{Answer, Query},
    plant::{
        PlantDef, Snapshot,
        alarm::{ActiveAlarm, SuppressedAlarm, manager::subject_name},
        def::DeviceDef,
        line::LineDef,
        line_minute::LineMinute,
        line_report::{LineReport, PollReport},
        line_state::{DeviceState, LineCounters, LineState},
        north_status::NorthStatus,
        sample::{Quality, Sample},
        snapshot::LineStatus,
        tag::Poll,
    },
    report::period_parser,
};

use super::{
    CliError, StationArgs, client, in_runtime, load, local, say,
    source::{Source, unexpected},
};

/// Arguments of `status`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The plant, if stations of more than one run here
    plant: Option<String>,
    /// As it was at a past time (03:12, 2026-11-21T06:00 or an instant with offset), from its history: PLANT must be given
    #[arg(long, value_name = "TIME", requires = "plant")]
    at: Option<String>,
    /// For scripts: everything, as JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    login: client::Login,
    #[command(flatten)]
    station: StationArgs,
}

/// Asks the running station and prints; of a past time its history.
pub fn main(args: Args) -> Result<(), CliError> {
    in_runtime(async {
        if let (Some(at), Some(plant)) = (&args.at, &args.plant) {
            return past(&args, plant, at).await;
        }
        let session = client::attach(args.plant.as_deref(), &args.login).await?;
        let snapshot = session.snapshots.borrow().clone();
        match args.json {
            true => say(&format!("{:#}", in_json(&snapshot))),
            false => in_words(&snapshot, true).iter().for_each(|line| say(line)),
        }
        Ok(())
    })
}

/// Prints a past instant.
async fn past(args: &Args, plant: &str, at: &str) -> Result<(), CliError> {
    let def = Arc::new(load(plant, &args.station)?);
    let source = Source::open(&def, &args.station, &args.login).await?;
    let at = period_parser::past_instant(&def, at, source.now()).map_err(|error| CliError::Usage(error.to_string()))?;
    let Answer::Past(past) = source.query(Query::Past { at }).await? else { return Err(unexpected()) };
    let snapshot = past.snapshot(def.clone());
    if args.json {
        let mut json = in_json(&snapshot);
        // What the station itself was like is not kept.
        json["history"] = Value::Null;
        json["past"] = Value::Bool(true);
        say(&format!("{json:#}"));
        return Ok(());
    }
    let now = source.now().duration_since(at).as_secs();
    say(&format!("PAST     {} h {:02} min {:02} s ago", now / 3_600, now / 60 % 60, now % 60));
    in_words(&snapshot, false).iter().for_each(|line| say(line));
    for (line, minute) in def.lines.iter().zip(&past.minutes) {
        let Some(minute) = minute else { continue };
        let LineMinute { requests, ok, timeouts, corrupt, exceptions, .. } = minute;
        say(&format!(
            "minute   {:12} {requests} requests, {ok} ok, {timeouts} timeouts, {corrupt} corrupt, {exceptions} exceptions",
            line.name
        ));
    }
    Ok(())
}

/// One fact a line: plant, lines, devices, alarms, history (of a running station), tags.
fn in_words(snapshot: &Snapshot, with_history: bool) -> Vec<String> {
    let def = &snapshot.def;
    let time = local(snapshot.at, def);
    let mut lines = vec![format!("plant    {} ({}) at {time}", def.title, def.name)];
    for (line, status) in def.lines.iter().zip(&snapshot.lines) {
        let scan = status.report.as_ref().map_or(String::new(), |report| scan_words(report));
        lines.push(format!("line     {:12} {}{scan}", line.name, line_words(line, &status.state)));
        lines.extend(found(def, status).into_iter().map(|found| format!("found    {:12} {found}", line.name)));
    }
    for (device, status) in def.devices.iter().zip(&snapshot.devices) {
        let why = status.diagnosis.map(|reason| format!(": {reason}")).unwrap_or_default();
        lines.push(format!("device   {:12} {}{why}", device.name, device_word(def, device, status.state)));
    }
    lines.extend(snapshot.alarms.iter().map(|alarm| format!("alarm    {}", alarm_words(snapshot, alarm))));
    if snapshot.alarms.is_empty() {
        lines.push("alarm    none".to_owned());
    }
    if with_history {
        let trouble = snapshot.history.words().unwrap_or_else(|| "good".into());
        let epoch = match snapshot.history.epoch {
            0 => String::new(),
            times => format!(", epoch {times}"),
        };
        let (rows, lost) = (snapshot.history.rows, snapshot.history.lost);
        lines.push(format!("history  {trouble}, {rows} rows, {lost} lost{epoch}"));
    }
    lines.extend(snapshot.load.iter().map(|load| format!("program  {}", load.words())));
    let until = |north: &NorthStatus| local(north.sent_until, def);
    lines.extend(snapshot.north.iter().map(|north| format!("data out {}", north.words(&until(north)))));
    let requests = snapshot.north.iter().filter_map(|north| north.requests.as_ref());
    lines.extend(requests.map(|requests| format!("requests {}", requests.words(|at| local(at, def)).join(", "))));
    lines.extend(snapshot.suppressed.iter().map(|alarm| format!("suppressed {}", suppressed_words(snapshot, alarm))));
    if client::is_withheld(snapshot) {
        lines.push("tag      values are shown after a login: --user NAME".to_owned());
        return lines;
    }
    lines.extend(tag_lines(snapshot).into_iter().map(|line| format!("tag      {line}")));
    lines
}

/// One line a tag: name, value with unit, quality, age.
pub fn tag_lines(snapshot: &Snapshot) -> Vec<String> {
    let row = |tag: &crate::plant::tag::TagDef| {
        let sample = snapshot.sample(tag.id);
        let value =
            snapshot.text(tag.id).map_or_else(|| "----".into(), |text| format!("{text} {}", snapshot.unit(tag.id)));
        let (value, age) = (value.trim_end(), snapshot.age(tag.id).as_secs_f64());
        format!("{:20} {value:>14}  {}  {age:.1} s", tag.name, sample.quality)
    };
    snapshot.def.tags.iter().map(row).collect()
}

fn alarm_words(snapshot: &Snapshot, alarm: &ActiveAlarm) -> String {
    let def = snapshot.def.alarm(alarm.id);
    let since = alarm.raised_at.to_zoned(snapshot.def.time_zone.clone()).strftime("%m-%d %H:%M:%S");
    let subject = subject_name(&snapshot.def, def.subject);
    format!("{} {:10} {subject} {} since {since}", def.priority.number(), alarm.state.word(), def.message)
}

fn suppressed_words(snapshot: &Snapshot, alarm: &SuppressedAlarm) -> String {
    let def = snapshot.def.alarm(alarm.id);
    let local = |at: Timestamp| at.to_zoned(snapshot.def.time_zone.clone()).strftime("%m-%d %H:%M:%S").to_string();
    let until = alarm.until.map(|at| format!(" until {}", local(at))).unwrap_or_default();
    let active = if alarm.active { ", ACTIVE" } else { "" };
    let subject = subject_name(&snapshot.def, def.subject);
    format!("{} {:10} {subject} {}{until}{active}", def.priority.number(), alarm.state.word(), def.message)
}

fn line_words(line: &LineDef, state: &LineState) -> String {
    match state {
        LineState::Connecting => "connecting".to_owned(),
        LineState::Connected if line.listens => "listening".to_owned(),
        LineState::Connected => "connected".to_owned(),
        LineState::NoTraffic => "no traffic heard".to_owned(),
        LineState::Disconnected => "disconnected by an operator".to_owned(),
        LineState::Testing => "in use by a test".to_owned(),
        LineState::Waiting { why, .. } => format!("not connected: {why}"),
    }
}

/// `; load 12 %, scan at worst 664 ms, measured 511 ms; dispatch p99 1.1 ms`
fn scan_words(report: &LineReport) -> String {
    let (scan, load) = (report.scan(), report.counters.utilisation_minute * 100.0);
    if report.settings.listens {
        let LineCounters { frames, ok, exceptions, timeouts, corrupt, unexpected, .. } = report.counters;
        let (pairs, errors) = (ok + exceptions, timeouts + corrupt + unexpected);
        return format!("; load {load:.0} %, {frames} frames heard, {pairs} pairs, {errors} errors");
    }
    let span = |span: Option<Duration>| span.map_or("-".to_owned(), |span| format!("{:.1} ms", in_ms(span)));
    let (worst, measured, late) = (span(Some(scan.worst)), span(scan.measured), span(report.dispatch.p99()));
    format!("; load {load:.0} %, scan at worst {worst}, measured {measured}; dispatch p99 {late}")
}

fn in_ms(span: Duration) -> f64 {
    span.as_secs_f64() * 1e3
}

/// A block of the read plan with what its reads take in milliseconds; `null` until it was read.
fn poll_json(def: &PlantDef, poll: &PollReport) -> Value {
    let (read, ms) = (&poll.stats.read_time, |span: Option<Duration>| span.map(in_ms));
    let period = if let Poll::Every(period) = poll.poll { Some(period) } else { None };
    json!({
        "device": def.device(poll.device).name, "function": poll.table.read_fc(), "address": poll.address,
        "count": poll.count, "reads": poll.stats.ok, "period_ms": ms(period), "worst_ms": in_ms(poll.cost), "median_ms": ms(read.median()),
        "p99_ms": ms(read.p99()), "max_ms": ms(read.max()), "margin_ms": ms(poll.margin()),
    })
}

/// What a line was found to do other than its plant file says.
fn found(def: &PlantDef, status: &LineStatus) -> Vec<String> {
    let Some(report) = &status.report else { return Vec::new() };
    let heard = report.other_master.map(|heard| format!("another master polls this line: {heard}"));
    let findings = report.findings.iter().map(|finding| match finding.device() {
        Some(device) => format!("{}: {finding}", def.device(device).name),
        None => finding.to_string(),
    });
    heard.into_iter().chain(findings).collect()
}

fn line_json(def: &PlantDef, line: &LineDef, status: &LineStatus, visible: bool) -> Value {
    let (counters, report) = (&status.counters, status.report.as_ref());
    let count = |count: u64| visible.then_some(count);
    json!({
        "name": line.name, "connected": status.state == LineState::Connected, "state": line_words(line, &status.state),
        "requests": count(counters.requests), "ok": count(counters.ok), "timeouts": count(counters.timeouts),
        "corrupt": count(counters.corrupt), "exceptions": count(counters.exceptions),
        "polls": report.map(|report| report.polls.iter().map(|poll| poll_json(def, poll)).collect::<Vec<_>>()),
        "found": found(def, status),
        "dispatch_p99_ms": report.and_then(|report| report.dispatch.p99()).map(in_ms),
    })
}

fn device_word(def: &PlantDef, device: &DeviceDef, state: DeviceState) -> &'static str {
    match state {
        DeviceState::Unknown if def.listens_on(device.line) => "not heard yet",
        DeviceState::Unknown => "not polled yet",
        DeviceState::Responding => "responding",
        DeviceState::Failing(_) => "fails",
        DeviceState::Down { .. } => "not responding",
    }
}

/// The same and more: times are UTC, numbers are in the tag's unit, `null` is "unknown".
fn in_json(snapshot: &Snapshot) -> Value {
    let def = &snapshot.def;
    // What is not authorised is `null`, never 0.
    let visible = !client::is_withheld(snapshot);
    let count = |count: u64| visible.then_some(count);
    let lines = def.lines.iter().zip(&snapshot.lines).map(|(line, status)| line_json(def, line, status, visible));
    let devices = def.devices.iter().zip(&snapshot.devices).map(|(device, status)| {
        json!({
            "name": device.name, "unit": device.unit, "state": device_word(def, device, status.state),
            "responding": status.state == DeviceState::Responding,
            "ne107": status.diagnosis.map(|reason| reason.to_string()),
            "reply_ms": status.response_time.map(in_ms),
            "ok": count(status.ok), "failed": count(status.failed),
        })
    });
    let alarms = snapshot.alarms.iter().map(|alarm| {
        let found = def.alarm(alarm.id);
        json!({
            "subject": subject_name(def, found.subject), "message": found.message, "priority": found.priority.number(),
            "state": alarm.state.word(), "raised_at": alarm.raised_at.to_string(),
            "returned_at": alarm.returned_at.map(|at| at.to_string()), "value": alarm.value,
        })
    });
    let suppressed = snapshot.suppressed.iter().map(|alarm| {
        let found = def.alarm(alarm.id);
        json!({
            "subject": subject_name(def, found.subject), "message": found.message, "priority": found.priority.number(),
            "state": alarm.state.word(), "active": alarm.active, "until": alarm.until.map(|at| at.to_string()),
        })
    });
    let tags = def.tags.iter().map(|tag| {
        let sample @ Sample { quality, at, .. } = snapshot.sample(tag.id);
        let (word, cause) = match quality {
            Quality::Good => ("good", None),
            Quality::Uncertain(cause) => ("uncertain", Some(cause.word())),
            Quality::Bad(cause) => ("bad", Some(cause.word())),
        };
        json!({
            "name": tag.name, "value": sample.exact(), "text": snapshot.text(tag.id), "unit": snapshot.unit(tag.id),
            "quality": word, "cause": cause, "at": at.to_string(), "age_s": snapshot.age(tag.id).as_secs_f64(),
        })
    });
    json!({
        "plant": def.name, "title": def.title, "at": snapshot.at.to_string(), "speed": snapshot.speed,
        "lines": lines.collect::<Vec<_>>(), "devices": devices.collect::<Vec<_>>(),
        "alarms": alarms.collect::<Vec<_>>(), "suppressed": suppressed.collect::<Vec<_>>(),
        "tags": visible.then(|| tags.collect::<Vec<_>>()),
        "history": {
            "rows": snapshot.history.rows, "lost": snapshot.history.lost, "trouble": snapshot.history.trouble,
            "epoch": snapshot.history.epoch, "recording": snapshot.history.failing.is_none(),
            "waiting": snapshot.history.waiting, "waiting_max": snapshot.history.waiting_max,
            "committed_at": snapshot.history.committed_at.map(|at| at.to_string()),
        },
        "program": snapshot.load.map(|load| json!({
            "cpu": load.cpu, "wake_ups_per_s": load.wake_ups, "memory_bytes": load.memory, "computer_idle": load.idle,
        })),
        "north": snapshot.north.as_ref().map(|north| json!({
            "connected": north.connected, "sent": north.sent, "refused": north.refused,
            "sent_until": north.sent_until.to_string(), "error": north.error,
            "requests": north.requests.as_ref().map(|requests| json!({
                "as": requests.user, "accepted": requests.accepted, "refused": requests.refused,
                "unanswered": requests.unanswered, "error": requests.error,
                "last": requests.last.as_ref().map(|last| json!({
                    "at": last.at.to_string(), "what": last.what, "result": last.result.to_string(),
                })),
            })),
        })),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::{Plant, fixture};

    #[test]
    fn a_value_that_is_not_known_is_null_and_said_so() {
        let snapshot = Plant::new(fixture::shared(), Timestamp::UNIX_EPOCH, 1.0).snapshot();
        let found = in_json(&snapshot);
        let pv = found["tags"].as_array().and_then(|tags| tags.iter().find(|tag| tag["name"] == "TIC-1.PV"));
        let pv = pv.expect("the tag is there");
        assert_eq!((&pv["value"], &pv["quality"]), (&Value::Null, &json!("bad")));
        let words = in_words(&snapshot, true);
        assert!(words.iter().any(|line| line.starts_with("tag      TIC-1.PV") && line.contains("----")), "{words:?}");
        assert!(words.contains(&"alarm    none".to_owned()));
    }
}
