//! What came of a test, in words.

use super::{
    LineView, broken, bytes_text, ms,
    rows::{Spans, plain},
    short_ms,
};
use crate::ui::{
    command_text::outcome_words,
    modal::bus::{dissection_rows, exchange_rows},
    tabs::prelude::*,
};
use crate::{
    bus::{
        diagnostics::tally,
        dissect::{self, Direction},
        framing::{self, Reply},
        meaning, names,
    },
    plant::{
        diagnostics::{Diagnostic, DiagnosticRun, DiagnosticState, Finding, PatternTally},
        fault::Fault,
        number::to_u32,
        port_signals::PortSignals,
        sweep::{SweptOutcome, SweptRange},
    },
};

/// The last test of a line, or how to begin.
pub fn rows(cx: &ViewContext, at: &LineView, width: u16) -> Vec<Spans> {
    let theme = cx.theme;
    let room = width.saturating_sub(3);
    let Some(run) = &at.status.test else {
        return vec![plain(t!("no test run yet: ⏎ starts the selected test; polling continues"), theme.dim())];
    };
    let mut rows = heading(cx, run, room);
    let bare = matches!(run.diagnostic, Diagnostic::Send(_));
    if let Diagnostic::Send(bytes) = &run.diagnostic {
        let framing = at.settings.transport.framing();
        let dissection = dissect::dissect(bytes, Some(framing), Some(Direction::Request), None);
        let sent = broken(&t!("TX {bytes_text}", bytes_text = bytes_text(framing, bytes)), room);
        rows.extend(sent.into_iter().map(|line| plain(line, theme.dim())));
        rows.extend(
            wrap(&dissection.summary, room - 3).into_iter().map(|line| plain(format!("   {line}"), theme.dim())),
        );
    }
    for (n, finding) in run.findings.iter().enumerate() {
        match finding {
            Finding::Bytes { bytes, response_time: reply } => {
                if let Diagnostic::Pattern { bits, .. } = run.diagnostic {
                    rows.extend(pattern_row(cx, n, tally(to_u32(n), bits, bytes)));
                } else {
                    rows.extend(came_back(cx, at, run, bytes, *reply, room));
                }
            }
            Finding::Exchange(exchange) if matches!(run.diagnostic, Diagnostic::Loopback { .. }) => {
                let reply = exchange
                    .response_time
                    .map_or("–".to_owned(), |reply| t!("{short_ms} ms", short_ms = short_ms(reply)));
                rows.push(match exchange.outcome {
                    Ok(()) => plain(t!("✓ returned after {reply}", reply), theme.normal()),
                    Err(fault) => plain(format!("✗ {fault}"), theme.trouble()),
                });
            }
            Finding::Exchange(exchange) => rows.extend(exchange_rows(cx, exchange, room)),
            Finding::Unit { unit, serial, reply } => {
                let serial = serial.map_or(String::new(), |serial| t!(" at {serial}", serial));
                rows.push(plain(t!("● unit {unit}{serial}: {words}", unit, serial, words = reply), theme.strong()));
            }
            Finding::Object { id, text } => {
                rows.push(vec![(pad(&names::identity(*id), 21), theme.dim()), (text.clone(), theme.strong())]);
            }
            Finding::Values { table, address, words } => {
                let from = format!("{} / 0x{address:04X}", table.modicon(*address));
                let values = words.iter().map(ToString::to_string).collect::<Vec<_>>().join(" ");
                rows.extend(
                    wrap(&format!("{from}: {values}"), room).into_iter().map(|line| plain(line, theme.strong())),
                );
            }
            // The exchange before it has said so already.
            Finding::Failed { .. } if !bare => {}
            Finding::Failed { what, fault } => rows.push(plain(format!("✗ {what}: {fault}"), theme.trouble())),
            Finding::Written(outcome) => {
                let (words, trouble) = outcome_words(outcome);
                rows.push(plain(words, if trouble { theme.trouble() } else { theme.strong() }));
            }
            Finding::Signals { after, signals } => rows.push(signal_row(cx, *after, *signals)),
            Finding::Swept(range) => {
                let answers = range.outcome == SweptOutcome::Answers;
                rows.push(plain(swept(range), if answers { theme.strong() } else { theme.dim() }));
            }
            Finding::Conclusion(conclusion) => {
                rows.extend(wrap(&conclusion.to_string(), room).into_iter().map(|line| plain(line, theme.strong())));
            }
        }
    }
    rows
}

/// How the signals of the port stood, and when.
fn signal_row(cx: &ViewContext, after: std::time::Duration, signals: PortSignals) -> Spans {
    let after = format!("{:5.2} s  ", after.as_secs_f64());
    vec![(after, cx.theme.dim()), (signals.to_string(), cx.theme.strong())]
}

/// What became of a pattern, unless all of it came back.
fn pattern_row(cx: &ViewContext, n: usize, tally: PatternTally) -> Option<Spans> {
    let words = || t!("✗ pattern {number}: {tally}", number = n + 1, tally);
    (0 < tally.faults()).then(|| plain(words(), cx.theme.trouble()))
}

/// What, by whom, when, how it stands; and how far it has come.
fn heading(cx: &ViewContext, run: &DiagnosticRun, room: u16) -> Vec<Spans> {
    let theme = cx.theme;
    let at = clock(run.started, &cx.def().time_zone);
    let (state, style) = match &run.state {
        DiagnosticState::Running => (t!("running").to_owned(), theme.strong()),
        DiagnosticState::Done => (t!("done").to_owned(), theme.normal()),
        DiagnosticState::Cancelled => (t!("STOPPED").to_owned(), theme.trouble()),
        DiagnosticState::Failed(_) => (t!("FAILED").to_owned(), theme.trouble()),
    };
    let what = match &run.diagnostic {
        Diagnostic::Send(_) => t!("sent").to_owned(),
        diagnostic @ (Diagnostic::Loopback { .. }
        | Diagnostic::Pattern { .. }
        | Diagnostic::Identify { .. }
        | Diagnostic::Read { .. }
        | Diagnostic::Write(_)
        | Diagnostic::Sweep(_)
        | Diagnostic::Signal(_)
        | Diagnostic::Scan(_)) => diagnostic.to_string(),
    };
    let mut rows = vec![vec![(t!("{at} {what} by {by}   ", at, what, by = run.by), theme.normal()), (state, style)]];
    if let DiagnosticState::Failed(why) = &run.state {
        rows.extend(wrap(&why.to_string(), room).into_iter().map(|line| plain(line, theme.trouble())));
    }
    if run.state == DiagnosticState::Running && 1 < run.total {
        let share = f64::from(run.done) / f64::from(run.total);
        let left = remaining(cx, run).map_or(String::new(), |left| t!(", {ms} left", ms = ms(left)));
        let now = run.now.map(|now| now.to_string()).unwrap_or_default();
        let words = t!(" {done} of {total}{left}   {now}", done = run.done, total = run.total, left, now);
        rows.push(vec![(draw::bar(cx, share, 20), theme.normal()), (words, theme.normal())]);
    }
    rows
}

/// `1000 to 1029 / 0x03E8 to 0x0405   answer`.
fn swept(range: &SweptRange) -> String {
    let SweptRange { first, last, outcome } = *range;
    let words = outcome_label(outcome);
    format!("{first:>5} – {last:<5}  0x{first:04X} – 0x{last:04X}   {words}")
}

/// What became of an address, in words.
pub fn outcome_label(outcome: SweptOutcome) -> String {
    match outcome {
        SweptOutcome::Answers => t!("answers").to_owned(),
        SweptOutcome::Refused(code) => t!("refused: {fault}", fault = Fault::Exception(code)),
        SweptOutcome::Silent(fault) => t!("not known: {fault}", fault),
    }
}

/// Time left, if the steps to come take as long as those before.
pub fn remaining(cx: &ViewContext, run: &DiagnosticRun) -> Option<std::time::Duration> {
    let spent = elapsed(run.started, cx.now).as_secs_f64() / cx.snapshot.speed.clamp(0.01, 1e6);
    let each = spent / f64::from((0 < run.done).then_some(run.done)?);
    SignedDuration::try_from_secs_f64(each * f64::from(run.total.saturating_sub(run.done))).ok()?.try_into().ok()
}

/// What came back for bytes, decoded.
fn came_back(
    cx: &ViewContext,
    at: &LineView,
    run: &DiagnosticRun,
    bytes: &[u8],
    reply: Option<std::time::Duration>,
    room: u16,
) -> Vec<Spans> {
    let theme = cx.theme;
    let framing = at.settings.transport.framing();
    let to_all = |sent: &Vec<u8>| {
        framing != crate::plant::def::Framing::Mbap
            && dissect::message_of(sent, framing).is_some_and(|message| message.first() == Some(&0))
    };
    if bytes.is_empty() && matches!(&run.diagnostic, Diagnostic::Send(sent) if to_all(sent)) {
        return vec![plain(t!("sent to all units; a broadcast has no response"), theme.normal())];
    }
    if bytes.is_empty() {
        return vec![plain(t!("✗ no response within {ms}", ms = ms(at.settings.timeout)), theme.trouble())];
    }
    let sent = match &run.diagnostic {
        Diagnostic::Send(sent) => Some(sent),
        Diagnostic::Loopback { .. }
        | Diagnostic::Pattern { .. }
        | Diagnostic::Identify { .. }
        | Diagnostic::Read { .. }
        | Diagnostic::Write(_)
        | Diagnostic::Sweep(_)
        | Diagnostic::Signal(_)
        | Diagnostic::Scan(_) => None,
    };
    let asked = sent.and_then(|sent| dissect::message_of(sent, framing));
    let answer = sent.filter(|_| asked.is_some()).map(|sent| framing::find_reply(framing, sent, bytes, true));
    let part =
        answer.as_ref().and_then(|answer| answer.as_ref().ok()).map_or(bytes, |reply| &bytes[reply.range.clone()]);
    let dissection = dissect::dissect(part, Some(framing), Some(Direction::Answer), asked.as_deref());
    let mut rows: Vec<Spans> = broken(&t!("RX {bytes_text}", bytes_text = bytes_text(framing, bytes)), room)
        .into_iter()
        .map(|line| plain(line, theme.normal()))
        .collect();
    let reply = reply.map_or(String::new(), |reply| t!("   after {short_ms} ms", short_ms = short_ms(reply)));
    let (mark, style) = match answer {
        Some(Ok(Reply { exception: None, .. })) => (t!("✓ ok").to_owned(), theme.normal()),
        Some(Ok(Reply { exception: Some(_), .. })) => (t!("✗ refused by the device").to_owned(), theme.trouble()),
        Some(Err(fault)) => (format!("✗ {fault}"), theme.trouble()),
        None => (t!("received").to_owned(), theme.normal()),
    };
    rows.push(plain(format!("{mark}{reply}"), style));
    let means = asked.map(|asked| meaning::of_answer(cx.snapshot, at.id, &asked, &dissection.message));
    rows.extend(means.iter().flatten().flat_map(|means| wrap(means, room)).map(|line| plain(line, theme.strong())));
    rows.extend(dissection_rows(cx, &dissection, room));
    rows
}
