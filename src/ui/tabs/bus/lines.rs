//! The list of lines at the top of page Line: those with trouble first.

use super::{
    LineView,
    rows::{Spans, plain},
};
use crate::{
    plant::line_state::LineState,
    ui::{line_state::is_well, tabs::prelude::*},
};

/// Lines that are listed at once: what is below belongs to one of them.
const ROWS_MAX: usize = 8;

/// All lines: those that are not well, then those with a device that does not respond, then the others, each in the order of the
/// plant file.
pub fn order(cx: &ViewContext) -> Vec<LineId> {
    let mut lines: Vec<&LineDef> = cx.def().lines.iter().collect();
    lines.sort_by_cached_key(|line| (is_well(cx, line), down(cx, line.id) == 0));
    lines.into_iter().map(|line| line.id).collect()
}

/// So many places on in that order, around the end.
pub fn next(cx: &ViewContext, line: LineId, by: isize) -> LineId {
    let order = order(cx);
    let place = order.iter().position(|id| *id == line).unwrap_or_default();
    order.get(around(place, by, order.len())).copied().unwrap_or(line)
}

/// Devices of a line that do not respond.
fn down(cx: &ViewContext, line: LineId) -> usize {
    let down = |device: &&DeviceDef| {
        device.line == line && matches!(cx.snapshot.device(device.id).state, DeviceState::Down { .. })
    };
    cx.def().devices.iter().filter(down).count()
}

/// Each with its state, to choose one; nothing where there is only one.
pub fn rows(cx: &ViewContext, at: &LineView) -> Vec<Spans> {
    let (order, theme) = (order(cx), cx.theme);
    if order.len() < 2 {
        return Vec::new();
    }
    let row = |id: &LineId| {
        let (place, down) = (LineView::new(cx, *id)?, down(cx, *id));
        let (busy, line) = (f64::from(place.status.counters.utilisation) * 100.0, cx.def().line(*id));
        let devices = if down == 0 { String::new() } else { t!("  ! {down} not responding", down) };
        let words =
            format!("{:8} {}  {busy:.0} %  {}{devices}", line.name, place.settings.transport, state_text(cx, &place));
        let style = row_style(cx, *id == at.id, !is_well(cx, line) || 0 < down);
        Some(plain(format!("{} {words}", if *id == at.id { "▸" } else { " " }), style))
    };
    let chosen = order.iter().position(|id| *id == at.id).unwrap_or_default();
    let first = first(chosen, order.len(), ROWS_MAX);
    let shown = order.iter().skip(first).take(ROWS_MAX).filter_map(row);
    let hidden = order.len().saturating_sub(ROWS_MAX);
    let trouble = cx.def().lines.iter().filter(|line| !is_well(cx, line)).count();
    let count = t!("  {hidden} more ▼▲; of {count} lines {trouble} failed", hidden, count = order.len(), trouble);
    let count = (0 < hidden).then(|| plain(count, if trouble == 0 { theme.dim() } else { theme.trouble() }));
    shown.chain(count).chain([Spans::new()]).collect()
}

/// `connected since 13:02:11`, `DOWN 00:12: No such file or directory, next try in 4s`.
pub fn state_text(cx: &ViewContext, at: &LineView) -> String {
    let zone = &cx.def().time_zone;
    let since = at
        .status
        .since
        .map_or(String::new(), |since| t!(" since {moment}", moment = text::moment(since, cx.now, zone)));
    match &at.status.state {
        LineState::Connected if at.settings.listens => t!("listening{since}", since),
        LineState::Connected => t!("connected{since}", since),
        LineState::NoTraffic => t!("NO TRAFFIC HEARD{since}", since),
        LineState::Connecting => t!("connecting").to_owned(),
        LineState::Waiting { why, retry_at } => {
            let lost =
                at.status.lost_since.map_or(String::new(), |lost| format!(" {}", running(elapsed(lost, cx.now))));
            t!("DOWN{lost}, next try in {between}s: {why}", lost, between = elapsed(cx.now, *retry_at).as_secs(), why)
        }
        LineState::Disconnected => t!("DISCONNECTED by an operator{since}", since),
        LineState::Testing => t!("TEST{since}, polling stopped", since),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ui::fixture::{Fixture, with_cx};

    #[test]
    fn of_many_lines_those_with_trouble_come_first() {
        let mut fixture = Fixture::normal();
        for n in 1..64 {
            let line = LineDef { id: LineId(n), name: format!("L{}", n + 1), ..fixture.def.lines[0].clone() };
            fixture.def.lines.push(line);
        }
        fixture.def.devices[1].line = LineId(40);
        fixture.devices[1].state = DeviceState::Down { since: crate::ui::fixture::now() };
        let mut snapshot = (*fixture.snapshot()).clone();
        snapshot.lines = vec![fixture.line.clone(); 64];
        snapshot.lines[17].state = LineState::Disconnected;
        with_cx(&snapshot, |cx| {
            assert_eq!(order(cx)[..4], [17, 40, 0, 1].map(LineId));
            assert_eq!([next(cx, LineId(17), 1), next(cx, LineId(17), -1)], [40, 63].map(LineId));
            let at = LineView::new(cx, LineId(17)).expect("the line is there");
            let text = |row: &Spans| row.iter().map(|(words, _)| words.as_str()).collect::<String>();
            let shown: Vec<String> = rows(cx, &at).iter().map(text).collect();
            assert_eq!(shown.len(), ROWS_MAX + 2, "{shown:?}");
            assert!(shown[0].starts_with("▸ L18 ") && shown[1].ends_with("! 1 not responding"), "{shown:?}");
            assert_eq!(shown[ROWS_MAX], "  56 more ▼▲; of 64 lines 1 failed");
        });
    }
}
