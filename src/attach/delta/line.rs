//! What has changed on a line: its state, the test at work, its report and the frames since.

use std::sync::Arc;

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

use super::{DeltaMismatch, List};
use crate::plant::{
    admission::Admission,
    def::{DeviceId, LineDef, TagId},
    diagnostics::DiagnosticRun,
    event::LineCounters,
    line_report::{LineReport, PollReport},
    request_stats::RequestStats,
    snapshot::LineStatus,
    traffic::{Frame, Frames},
};

/// One line.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LineDelta {
    /// All but test and report.
    state: Option<Box<LineStatus>>,
    test: Option<Option<Arc<DiagnosticRun>>>,
    report: Option<Option<ReportDelta>>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct ReportDelta {
    settings: Option<Box<LineDef>>,
    counters: Option<LineCounters>,
    polls: List<PollReport>,
    refused: Option<Vec<TagId>>,
    retries: Option<Vec<(DeviceId, Timestamp)>>,
    strain: Option<Option<String>>,
    admission: Option<Box<Admission>>,
    devices: List<(DeviceId, RequestStats)>,
    busy: List<f32>,
    frames: Option<NewFrames>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct NewFrames {
    /// Frames before this number are let go; `None`: all of them.
    from: Option<u64>,
    newer: Vec<Frame>,
}

impl LineDelta {
    /// What makes `new` of `old`; `None` if that is nothing.
    pub fn between(def: &LineDef, old: &LineStatus, new: &LineStatus) -> Option<LineDelta> {
        let (was, is) = (bare(old), bare(new));
        let state = (was != is).then(|| Box::new(is));
        let test = (old.test != new.test).then(|| new.test.clone());
        let report = match (&old.report, &new.report) {
            (None, None) => None,
            (Some(old), Some(new)) if Arc::ptr_eq(old, new) || old == new => None,
            (Some(old), Some(new)) => Some(Some(ReportDelta::between(old, new))),
            (None, Some(new)) => Some(Some(ReportDelta::between(&LineReport::new(def.clone()), new))),
            (Some(_), None) => Some(None),
        };
        let is_change = state.is_some() || test.is_some() || report.is_some();
        is_change.then_some(LineDelta { state, test, report })
    }

    /// Makes the old line the new one.
    pub fn apply(self, def: &LineDef, line: &mut LineStatus) -> Result<(), DeltaMismatch> {
        let LineDelta { state, test, report } = self;
        if let Some(state) = state {
            let (test, report) = (line.test.take(), line.report.take());
            *line = LineStatus { test, report, ..*state };
        }
        if let Some(test) = test {
            line.test = test;
        }
        match report {
            None => {}
            Some(None) => line.report = None,
            Some(Some(delta)) => {
                let before = line.report.take().unwrap_or_else(|| Arc::new(LineReport::new(def.clone())));
                let mut report = Arc::unwrap_or_clone(before);
                delta.apply(&mut report)?;
                line.report = Some(Arc::new(report));
            }
        }
        Ok(())
    }
}

/// A line without test and report, which travel separately.
fn bare(line: &LineStatus) -> LineStatus {
    LineStatus { test: None, report: None, ..line.clone() }
}

impl ReportDelta {
    fn between(old: &LineReport, new: &LineReport) -> ReportDelta {
        let LineReport { settings, counters, polls, refused, retries, strain, admission, devices, busy, frames } = new;
        ReportDelta {
            settings: (old.settings != *settings).then(|| Box::new(settings.clone())),
            counters: (old.counters != *counters).then_some(*counters),
            polls: List::between(&old.polls, polls),
            refused: (old.refused != *refused).then(|| refused.clone()),
            retries: (old.retries != *retries).then(|| retries.clone()),
            strain: (old.strain != *strain).then(|| strain.clone()),
            admission: (old.admission != *admission).then(|| Box::new(admission.clone())),
            devices: List::between(&old.devices, devices),
            busy: List::between(&old.busy, busy),
            frames: NewFrames::between(&old.frames, frames),
        }
    }

    fn apply(self, report: &mut LineReport) -> Result<(), DeltaMismatch> {
        let ReportDelta { settings, counters, polls, refused, retries, strain, admission, devices, busy, frames } =
            self;
        set(&mut report.settings, settings.map(|settings| *settings));
        set(&mut report.counters, counters);
        set(&mut report.refused, refused);
        set(&mut report.retries, retries);
        set(&mut report.strain, strain);
        set(&mut report.admission, admission.map(|admission| *admission));
        polls.apply(&mut report.polls)?;
        devices.apply(&mut report.devices)?;
        busy.apply(&mut report.busy)?;
        if let Some(NewFrames { from, newer }) = frames {
            report.frames.follow(from.unwrap_or(u64::MAX), newer);
        }
        Ok(())
    }
}

impl NewFrames {
    /// The new elements, by number; `None` without a change.
    fn between(old: &Frames, new: &Frames) -> Option<NewFrames> {
        let first = new.iter().next().map(|frame| frame.number);
        let last = old.iter().next_back();
        let is_newer = |frame: &&Frame| last.is_none_or(|last| last.number < frame.number);
        let newer = new.iter().rev().take_while(is_newer).count();
        let kept = new.len() - newer;
        let stay = old.iter().filter(|frame| first.is_some_and(|first| first <= frame.number)).count();
        // A line that counts from the beginning again shows here: it has other frames of these numbers.
        let goes_on = kept == stay && (kept == 0 || new.iter().nth(kept - 1) == last);
        if goes_on && newer == 0 && kept == old.len() {
            return None;
        }
        let (from, known) = if goes_on { (first, kept) } else { (None, 0) };
        Some(NewFrames { from, newer: new.iter().skip(known).cloned().collect() })
    }
}

fn set<T>(place: &mut T, new: Option<T>) {
    if let Some(new) = new {
        *place = new;
    }
}
