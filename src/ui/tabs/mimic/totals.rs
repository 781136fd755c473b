//! What the running shift has counted so far: energy, batches, run hours, starts.

use super::attention::AttentionRow;
use crate::report::{RunFigures, ShiftReport, TagFigures, text::mean_or_difference};
use crate::ui::tabs::prelude::*;

/// The counters that have counted and the actuators that have run, as `heater energy +2.31 kWh` and `PLC-1.P-1 1.2 h, 14 starts`.
pub fn rows(cx: &ViewContext, report: &ShiftReport) -> Vec<AttentionRow> {
    let name = |tag: &str| {
        let label = cx.def().tag_named(tag).map(|id| cx.def().tag(id).label.as_str()).unwrap_or_default();
        if label.is_empty() { tag.to_owned() } else { of_plant(label).to_owned() }
    };
    let counted = |figures: &TagFigures| {
        figures.difference.filter(|counted| *counted > Exact::default())?;
        Some(format!("{} {} {}", name(&figures.tag), mean_or_difference(figures), figures.unit).trim_end().to_owned())
    };
    let ran = |figures: &RunFigures| {
        let (on, starts) = (figures.on.filter(|on| !on.is_zero())?, figures.starts.unwrap_or_default());
        let (minutes, hours) = (on.as_secs_f64() / 60.0, on.as_secs_f64() / 3_600.0);
        let on =
            if hours < 1.0 { t!("{minutes} min", minutes = format!("{minutes:.0}")) } else { format!("{hours:.1} h") };
        Some(t!("{name} {on}, {starts} starts", name = figures.tag, on, starts))
    };
    let counters = report.tags.iter().filter_map(counted);
    let rows = counters.chain(report.runs.iter().filter_map(ran));
    rows.map(|words| (words, cx.theme.normal())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        report::testing::shift_report,
        ui::fixture::{Fixture, with_cx},
    };

    #[test]
    fn only_what_has_counted_or_run_is_listed() {
        let said = |report: &ShiftReport| -> Vec<String> {
            with_cx(&Fixture::normal().snapshot(), |cx| rows(cx, report)).into_iter().map(|(words, _)| words).collect()
        };
        let mut report = shift_report();
        assert_eq!(said(&report), ["PM-1.E +12.50 kWh", "PLC-1.P-1 1.5 h, 3 starts"]);
        report.runs[0].on = Some(Duration::from_secs(200));
        assert_eq!(said(&report)[1], "PLC-1.P-1 3 min, 3 starts");
        report.runs[0].on = None;
        report.tags.iter_mut().for_each(|tag| tag.difference = tag.difference.map(|_| Exact::default()));
        assert_eq!(said(&report), [""; 0]);
    }
}
