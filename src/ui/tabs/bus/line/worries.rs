//! What is wrong on a line, in sentences, the worst first.

use super::*;

/// What is wrong and what to do about it, a sentence each.
pub(super) fn worries(cx: &ViewContext, at: &LineView) -> Vec<String> {
    let mut worries = Vec::new();
    if let Some(before) = &at.status.settings_before {
        worries.push(t!("settings under test, not saved; before: {transport}", transport = before.transport));
    }
    let Some(report) = at.report else { return worries };
    if let Some(heard) = report.other_master {
        worries.push(t!("another master polls this line: {heard}", heard));
    }
    worries.extend(report.findings.iter().map(|finding| match finding.device() {
        Some(device) => format!("{}: {finding}", cx.snapshot.def.device(device).name),
        None => finding.to_string(),
    }));
    if let Some(strain) = &report.strain {
        worries.push(t!("{strain}. Poll less often, or increase the baud rate", strain));
    } else if !report.admission.schedulability.fits() {
        worries.push(report.admission.schedulability.to_string());
    }
    if report.strain.is_none() && missed_lately(report) {
        worries.push(t!(
            "line overloaded: {grouped} polls skipped. Poll less often, or increase the baud rate",
            grouped = grouped(report.counters.missed)
        ));
    }
    for device in cx.def().devices.iter().filter(|device| device.line == at.id) {
        let Some(stats) = report.device(device.id) else { continue };
        worries.extend(
            of_device(cx, at.settings, report, device, stats).into_iter().map(|why| format!("{}: {why}", device.name)),
        );
    }
    let uart = report.counters.uart.unwrap_or_default();
    if 0 < uart.parity + uart.framing && DeviceStats::new(report).lately {
        worries
            .push(t!("parity or framing errors at the port: compare baud rate and parity with the devices").to_owned());
    }
    worries
}

pub(super) fn of_device(
    cx: &ViewContext,
    line: &LineDef,
    report: &LineReport,
    device: &DeviceDef,
    stats: &RequestStats,
) -> Vec<String> {
    let mut worries = Vec::new();
    if let Some(p99) = near(stats, line.timeout).filter(|_| !line.listens) {
        worries.push(t!(
            "replies take {p99} of {timeout} ms: increase the timeout",
            p99 = p99.as_millis(),
            timeout = line.timeout.as_millis()
        ));
    }
    let status = cx.snapshot.device(device.id);
    let (true, Some((when, fault))) = (0 < stats.recent().0 && is_ill(cx, device), status.last_fault) else {
        return worries;
    };
    let when = clock(when, &cx.def().time_zone);
    let advice = match fault {
        Fault::Timeout => {
            let cost = report
                .admission
                .dead_cost(device.id)
                .map(|cost| t!("; each probe takes {ms} of the line", ms = ms(cost)));
            t!("check its power, wiring and unit address{cost}", cost = cost.unwrap_or_default())
        }
        Fault::Crc { .. } | Fault::Lrc { .. } | Fault::Truncated { .. } | Fault::NotHex(_) => {
            t!("check baud rate, parity, termination and shield of the line").to_owned()
        }
        Fault::Exception(code) => names::advice(code.0).to_owned(),
        Fault::WrongTransaction { .. } | Fault::NoHeader | Fault::Hangup => {
            translate(crate::bus::source_frame::advice(fault)).to_owned()
        }
        Fault::WrongUnit { got, .. } => {
            t!("is its unit address {got}? Else check for a second master, or a gateway that changes the address", got)
        }
        Fault::WrongFunction { .. } | Fault::WrongLength { .. } | Fault::WrongEcho | Fault::OutOfSync => {
            t!("check for a second master or a duplicate unit address").to_owned()
        }
        Fault::NotHeard => t!("check wires, ground and position of the tap").to_owned(),
        Fault::NotANumber | Fault::NotConnected | Fault::BackedOff | Fault::Unproven => String::new(),
    };
    worries.push(t!("{fault} at {when}: {advice}", fault, when, advice).trim_end_matches(": ").to_owned());
    worries
}
