//! The header: plant, lines, simulation, user and clock.

use crate::text::of_plant;
use std::sync::Arc;

use super::*;
use crate::plant::{procedure::ProcedureRun, time::elapsed};
use crate::{
    t,
    ui::{
        line_state::{is_overloaded, is_well, replies},
        rights,
    },
};

pub(super) fn header(model: &Model, cx: &ViewContext, canvas: &mut Canvas) {
    let theme = cx.theme;
    // On a narrow screen the plant and its lines count for more than the name of the program.
    let x = if cx.size < Size::Normal { 1 } else { canvas.text(1, 0, "sightglass", theme.dim()) + 2 };
    let start = canvas.text(x, 0, &fit(of_plant(&cx.def().title), canvas.width() / 3), theme.strong()) + 2;
    let mut end = canvas.width().saturating_sub(1);
    let fits = |parts: &[(usize, String, Style)]| {
        parts.iter().map(|(_, text, _)| width(text) + 2).sum::<u16>() <= end.saturating_sub(start) + 2
    };
    let shorter = [
        (true, Lines::Whole),
        (false, Lines::Whole),
        (false, Lines::Short),
        (false, Lines::Count),
        (false, Lines::Total),
    ];
    let mut parts = shorter.iter().map(|(role, lines)| header_parts(model, cx, *role, *lines));
    let mut parts = parts.find(|parts| fits(parts)).unwrap_or_else(|| header_parts(model, cx, false, Lines::Total));
    while !fits(&parts) {
        let Some(least) = parts.iter().map(|(need, _, _)| *need).max() else { break };
        parts.retain(|(need, _, _)| *need != least);
    }
    for (_, text, style) in parts {
        canvas.text_right(end, 0, &text, style);
        end = end.saturating_sub(width(&text) + 2);
    }
}

/// How much the header says of lines; what is wrong with one is said in words where there is room for them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Lines {
    /// `L1 load 62 %`.
    Whole,
    /// `L1 62 %`.
    Short,
    /// `3 lines OK`, one part for all of them.
    Count,
    /// `64 lines, 2 failed`: what is wrong with each is on tab Bus.
    Total,
}

/// What the header tells, from the right, each with its need: the greatest number is the first to be left out.
/// The role of the user is shown only where everything fits.
pub(super) fn header_parts(model: &Model, cx: &ViewContext, role: bool, lines: Lines) -> Vec<(usize, String, Style)> {
    let theme = cx.theme;
    let time = if let Some(gone) = model.gone() {
        (0, t!("STATION LOST {gone} s: reconnecting", gone = gone.as_secs()), theme.trouble())
    } else if model.clock.silent >= SILENCE {
        (0, t!("STATION SILENT {running}", running = running(model.clock.silent)), theme.trouble())
    } else {
        (0, clock(cx.now, &cx.def().time_zone), theme.normal())
    };
    let mut parts = vec![time, who_text(model, cx, role)];
    parts.extend(cx.extension.iter().flat_map(|extension| extension.header(cx.theme)));
    if cx.snapshot.speed != 1.0 {
        parts.push((8, t!("speed ×{speed}", speed = cx.snapshot.speed), theme.strong()));
    }
    let procedures = cx.def().procedures.iter().zip(&cx.snapshot.procedures);
    let at_work = |run: &Option<Arc<ProcedureRun>>| run.as_ref().is_some_and(|run| run.at_work());
    parts.extend(procedures.filter(|(_, run)| at_work(run)).map(|(def, _)| {
        let words = t!("procedure {name}", name = fit(&def.name, 12));
        (4, words, theme.strong())
    }));
    let history = &cx.snapshot.history;
    if history.lost > 0 {
        parts.push((1, t!("{lost} records lost", lost = history.lost), theme.trouble()));
    }
    if history.failing.is_some() {
        let share = history.waiting * 100 / history.waiting_max.max(1);
        parts.push((2, t!("not recording, buffer {share} %", share), theme.trouble()));
    } else if history.trouble.is_some() {
        parts.push((2, t!("history: see 3").to_owned(), theme.trouble()));
    }
    let count = cx.def().lines.len();
    let (well, other): (Vec<&LineDef>, Vec<&LineDef>) = cx.def().lines.iter().rev().partition(|line| is_well(cx, line));
    if lines == Lines::Total && 1 < other.len() {
        parts.push((3, t!("{count} lines, {failed} failed", count, failed = other.len()), theme.trouble()));
        return parts;
    }
    parts.extend(other.into_iter().map(|line| {
        let (text, style) = line_words(cx, line);
        (3, text, style)
    }));
    match (lines, well.as_slice()) {
        (Lines::Count | Lines::Total, [_, _, ..]) => {
            parts.push((10, t!("{count} lines OK", count = well.len()), theme.normal()))
        }
        (Lines::Whole, _) => parts.extend(well.into_iter().map(|line| {
            let (text, style) = line_words(cx, line);
            (10, text, style)
        })),
        (Lines::Short | Lines::Count | Lines::Total, _) => parts.extend(well.into_iter().map(|line| {
            let busy = cx.snapshot.line(line.id).counters.utilisation * 100.0;
            (10, t!("{name} {busy} %", name = line.name, busy = format!("{busy:.0}")), theme.normal())
        })),
    }
    parts
}

/// Who sits here: `user: tech1 (Technician)`, `LOCKED by anna`, and when it will be locked.
pub(super) fn who_text(model: &Model, cx: &ViewContext, role: bool) -> (usize, String, Style) {
    let theme = cx.theme;
    let Some(who) = &model.session.who else { return (9, t!("not logged in").to_owned(), theme.strong()) };
    let user = fit(&who.user, 12);
    match model.locks_in() {
        _ if model.session.locked => (2, t!("LOCKED by {user}", user), theme.trouble()),
        Some(left) => (1, t!("locks in {left} s: press a key", left = left.as_secs()), theme.trouble()),
        None if role => (9, t!("user: {user} ({title})", user, title = rights::title(who.role)), theme.dim()),
        None => (9, user, theme.dim()),
    }
}

/// A line in the header: `L1 load 62 %`, or why it is not connected and when it is tried again.
pub(super) fn line_words(cx: &ViewContext, line: &LineDef) -> (String, Style) {
    let status = cx.snapshot.line(line.id);
    match &status.state {
        LineState::Connected => {
            let replies = replies(cx, status);
            let busy = status.counters.utilisation * 100.0;
            let overloaded = is_overloaded(status);
            let style = if replies && !overloaded { cx.theme.normal() } else { cx.theme.trouble() };
            let overload = if overloaded { t!(" OVERLOADED") } else { "" };
            let silent = if replies { "" } else { t!("no reply, ") };
            let listens = if line.listens { t!(" listening,") } else { "" };
            let name = format!("{}{listens}", line.name);
            (t!("{name} {silent}load {busy} %{overload}", name, silent, busy = format!("{busy:.0}"), overload), style)
        }
        LineState::NoTraffic => (t!("{name} NO TRAFFIC", name = line.name), cx.theme.trouble()),
        LineState::Connecting => (t!("{name} connecting", name = line.name), cx.theme.trouble()),
        LineState::Waiting { retry_at, .. } => {
            let left = elapsed(cx.now, *retry_at).as_secs();
            (t!("{name} DOWN retry {left}s", name = line.name, left), cx.theme.trouble())
        }
        LineState::Disconnected => (t!("{name} DISCONNECTED", name = line.name), cx.theme.trouble()),
        LineState::Testing => (t!("{name} TEST", name = line.name), cx.theme.trouble()),
    }
}

#[cfg(test)]
mod tests {
    use jiff::SignedDuration;

    use super::*;
    use crate::{
        plant::procedure::ProcedureDef,
        ui::fixture::{Fixture, with_cx},
    };

    #[test]
    fn every_line_has_its_state_in_the_header() {
        let mut fixture = Fixture::normal();
        for n in 1..8u16 {
            let name = format!("L{}", n + 1);
            fixture.def.lines.push(LineDef { id: crate::plant::def::LineId(n), name, ..fixture.def.lines[0].clone() });
        }
        let check = |down: &[usize], width: u16, expect: &[&str]| {
            let mut snapshot = (*fixture.snapshot()).clone();
            snapshot.lines = vec![fixture.line.clone(); 8];
            down.iter().for_each(|line| snapshot.lines[*line].state = LineState::Disconnected);
            let mut model = Model::new(
                std::sync::Arc::new(snapshot),
                crate::ui::theme::Theme::FULL,
                1,
                crate::ui::fixture::session(),
            );
            let shown = crate::ui::tests::screen(&mut model, width, 24);
            let header = shown.lines().next().unwrap_or_default();
            assert!(expect.iter().all(|words| header.contains(words)), "{width}: {header}");
        };
        check(&[], 200, &["L1 load 62 %", "L8 load 62 %"]);
        check(&[], 120, &["L1 62 %", "L8 62 %"]);
        check(&[], 80, &["8 lines OK"]);
        check(&[], 60, &["8 lines OK"]);
        check(&[2], 80, &["7 lines OK", "L3 DISCONNECTED"]);
        check(&[2, 3, 5], 80, &["8 lines, 3 failed"]);
        check(&[2, 3, 5], 60, &["8 lines, 3 failed"]);
    }

    #[test]
    fn a_procedure_at_work_is_named() {
        let mut fixture = Fixture::normal();
        let at = crate::ui::fixture::now();
        let (name, about) = ("fill".into(), String::new());
        fixture.def.procedures =
            vec![ProcedureDef { name, about, steps: Vec::new(), safe: Vec::new(), reference: None }];
        fixture.procedures = vec![Some(Arc::new(ProcedureRun::new("anna".into(), "tty1".into(), at)))];
        for width in [80, 120] {
            let snapshot = fixture.snapshot();
            let mut model = Model::new(snapshot, crate::ui::theme::Theme::FULL, 1, crate::ui::fixture::session());
            let shown = crate::ui::tests::screen(&mut model, width, 24);
            assert!(shown.lines().next().unwrap_or_default().contains("procedure fill"), "{shown}");
        }
    }

    #[test]
    fn only_a_line_with_requests_misses_replies() {
        let check = |sent_s: i64, replied_s: i64, silent: bool| {
            let mut fixture = Fixture::normal();
            let at = |ago: i64| Some(crate::ui::fixture::now() - SignedDuration::from_secs(ago));
            let (sent, replied) = (at(sent_s), at(replied_s));
            let counters = &mut fixture.line.counters;
            (counters.last_tx, counters.last_rx) = (sent, replied);
            with_cx(&fixture.snapshot(), |cx| {
                let (words, _) = line_words(cx, &cx.def().lines[0]);
                assert_eq!(words.contains("no reply"), silent, "sent {sent_s} s, replied {replied_s} s ago: {words}");
            });
        };
        check(1, 1, false);
        check(10, 10, false);
        check(10, 9, false);
        check(1, 10, true);
        check(5, 10, true);
    }
}
