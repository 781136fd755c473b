//! Lanes of states under the chart: what a switch, an enumeration or a status word was, on the time axis of the chart.

use super::*;
use crate::{
    plant::tag::{DataType, TagDef},
    ui::{
        theme::Glyphs,
        widgets::chart::{mark, trace::Span},
    },
};

/// Is it drawn as a lane? Between two states lies nothing, so that a curve would mean nothing.
pub(super) fn is_state(def: &TagDef) -> bool {
    !def.enum_labels.is_empty() || !def.bit_labels.is_empty() || def.point.kind == DataType::Bool
}

/// A stretch of a lane: first cell, cells, and the state; `None` where it changed within its only cell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Run {
    pub first: usize,
    pub cells: usize,
    pub state: Option<f64>,
}

/// The stretches of equal states; cells without a good value are in none.
pub(super) fn runs(columns: &[Option<Span>]) -> Vec<Run> {
    let mut runs: Vec<Run> = Vec::new();
    for (first, span) in columns.iter().enumerate() {
        let Some(span) = span else { continue };
        let state = (span.min == span.max).then_some(span.last);
        match runs.last_mut().filter(|run| run.first + run.cells == first && run.state == state && state.is_some()) {
            Some(run) => run.cells += 1,
            None => runs.push(Run { first, cells: 1, state }),
        }
    }
    runs
}

impl Trends {
    /// The pens that are drawn as lanes.
    pub(super) fn lanes(&self, cx: &ViewContext) -> Vec<(usize, Pen)> {
        self.drawn(cx).into_iter().filter(|(_, pen)| is_state(cx.def().tag(pen.tag))).collect()
    }

    /// The pens that are drawn as curves.
    pub(super) fn curved(&self, cx: &ViewContext) -> Vec<(usize, Pen)> {
        self.drawn(cx).into_iter().filter(|(_, pen)| !is_state(cx.def().tag(pen.tag))).collect()
    }
}

/// Draws a lane of a pen: its mark in the margin, each state with its name where there is room, a stroke at each change.
pub(super) fn draw_lane(trends: &Trends, cx: &ViewContext, canvas: &mut Canvas, (n, pen): (usize, Pen), left: u16) {
    let (theme, view) = (cx.theme, trends.span(cx));
    let name = format!("{} {}", mark(theme, n), cx.def().tag(pen.tag).short);
    canvas.text(0, 0, &fit(&name, left.saturating_sub(1)), theme.pen(n));
    let Some(trace) = trends.traces.get(&pen.tag) else { return };
    let count = usize::from(canvas.width().saturating_sub(left));
    let columns = trace.columns(view.from, view.to, cx.present(), count);
    // Console fonts lack these lines.
    let line = |full, plain| if theme.glyphs == Glyphs::Braille { full } else { plain };
    let end = |run: &Run| run.first + run.cells;
    let runs = runs(&columns);
    for (place, run) in runs.iter().enumerate() {
        let x = left + to_u16(run.first);
        let Some(state) = run.state else {
            canvas.text(x, 0, theme.pick("│", "|"), theme.pen(n));
            continue;
        };
        let (line, style) = match state == 0.0 {
            true => (line("┈", "."), theme.dim()),
            false => (line("━", "="), theme.pen(n)),
        };
        let begins = place > 0 && end(&runs[place - 1]) == run.first && runs[place - 1].state.is_some();
        let stroke = if begins { theme.pick("│", "|") } else { line };
        let rest = run.cells - 1;
        let label = fit(&cx.snapshot.format(pen.tag, state), to_u16(rest));
        let label = if usize::from(width(&label)) + 1 < rest { label } else { String::new() };
        let fill = line.repeat(rest - usize::from(width(&label)));
        canvas.text(x, 0, &format!("{stroke}{label}{fill}"), style);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_states_are_one_stretch_and_gaps_are_none() {
        let at = |min: f64, max: f64| Some(Span { min, max, last: max });
        let run = |first, cells, state| Run { first, cells, state };
        let columns = [at(0., 0.), at(0., 0.), at(0., 1.), at(1., 1.), None, at(1., 1.), at(2., 2.)];
        let expect =
            [run(0, 2, Some(0.)), run(2, 1, None), run(3, 1, Some(1.)), run(5, 1, Some(1.)), run(6, 1, Some(2.))];
        assert_eq!(runs(&columns), expect);
        assert_eq!(runs(&[None, None]), []);
    }
}
