//! A line, as it is drawn and tested.

use super::ViewContext;
use crate::plant::{
    def::{LineDef, LineId},
    diagnostics::DiagnosticState,
    line_report::LineReport,
    snapshot::LineStatus,
};

/// A line and all that is known of it.
#[derive(Debug, Clone, Copy)]
pub struct LineView<'a> {
    pub id: LineId,
    pub status: &'a LineStatus,
    /// In use now.
    pub settings: &'a LineDef,
    /// `None` until the line has reported.
    pub report: Option<&'a LineReport>,
}

impl<'a> LineView<'a> {
    pub fn new(cx: &ViewContext<'a>, id: LineId) -> Option<LineView<'a>> {
        let def = cx.def().lines.get(id.index())?;
        let status = cx.snapshot.lines.get(id.index())?;
        let report = status.report.as_deref();
        Some(LineView { id, status, settings: report.map_or(def, |report| &report.settings), report })
    }

    pub fn is_testing(&self) -> bool {
        self.status.test.as_ref().is_some_and(|run| run.state == DiagnosticState::Running)
    }
}
