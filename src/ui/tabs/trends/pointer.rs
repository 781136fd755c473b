//! The cursor under the mouse, and what is copied of the tab.

use super::{
    Pen, Trends,
    view::{at_cursor, placed_chart},
};
use crate::ui::tabs::prelude::*;

/// The time of the column of the chart at this place of the screen.
pub fn moment_at(trends: &Trends, cx: &ViewContext, at: Position) -> Option<Timestamp> {
    let (chart, area) = placed_chart(trends, cx).filter(|(_, area)| area.contains(at))?;
    let plot = chart.plan(area).plot;
    let column = at.x.clamp(plot.x, plot.right().saturating_sub(1).max(plot.x)) - plot.x;
    let share = (f64::from(column) + 0.5) / f64::from(plot.width.max(1));
    let span = chart.to.duration_since(chart.from).as_secs_f64();
    chart.from.checked_add(SignedDuration::from_secs_f64(span * share)).ok()
}

/// The readout of the cursor, else the selected value as it is now.
pub fn copied(trends: &Trends, cx: &ViewContext) -> Vec<String> {
    if let (false, Some(at)) = (trends.listed, trends.cursor(cx)) {
        let time = text::stamp(at, &cx.def().time_zone);
        let line = |(_, pen): (usize, Pen)| {
            let value = at_cursor(trends, cx, pen.tag, at).unwrap_or_else(|| "----".to_owned());
            [&cx.def().tag(pen.tag).name, value.as_str(), cx.snapshot.unit(pen.tag), &time].join("\t")
        };
        return trends.drawn(cx).into_iter().map(line).collect();
    }
    if let Some(list) = trends.list(cx) {
        return list.copied(cx);
    }
    trends.pens(cx).get(trends.selected).map(|pen| value::line(cx, pen.tag)).into_iter().collect()
}
