//! The file of the report: written as it is shown, after the station has recorded it.

use std::path::PathBuf;

use super::{Outgoing, Reports};
use crate::{
    report::{self, ShiftReport, Style},
    ui::tabs::prelude::*,
};

#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Export {
    /// Nothing written of this period.
    Not,
    /// On its way to the disk.
    Writing,
    Done(PathBuf),
    Failed(String),
}

impl Reports {
    /// Clears the note about the last file.
    pub(super) fn dismiss(&mut self) {
        if matches!(self.export, Export::Done(_) | Export::Failed(_)) {
            self.export = Export::Not;
        }
    }

    /// Writes exactly the figures that are shown.
    pub(super) fn export(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        let style = Style { csv: self.dialect, ..Style::of(cx.def()) };
        let Some(report) = &self.report.answered.value else { return self.send(None) };
        match report::render(self.format, report, cx.def(), &style) {
            Ok(bytes) => self.send(Some((self.path(cx, report), bytes))),
            Err(why) => {
                self.export = Export::Failed(why);
                Vec::new()
            }
        }
    }

    /// Asks the station to record a file, which is then written.
    pub(super) fn send(&mut self, file: Option<(PathBuf, Vec<u8>)>) -> Vec<UiAction> {
        let Some((path, bytes)) = file else {
            self.export = Export::Failed(t!("nothing to export yet").to_owned());
            return Vec::new();
        };
        if self.outgoing.is_some() {
            return Vec::new();
        }
        let outgoing = Outgoing { tab: Tab::Reports, path, bytes, new: false };
        let request = outgoing.export_request();
        (self.export, self.outgoing) = (Export::Writing, Some(outgoing));
        vec![request]
    }

    /// `2026-11-24-batches.csv`: the list as it is on that day.
    pub(super) fn batches_path(&self, cx: &ViewContext) -> PathBuf {
        let day = cx.now.to_zoned(cx.def().time_zone.clone()).date();
        cx.def().report.folder.join(format!("{day}-batches.csv"))
    }

    pub(super) fn path(&self, cx: &ViewContext, report: &ShiftReport) -> PathBuf {
        cx.def().report.folder.join(self.format.file_name(cx.def(), &report.period, report.until))
    }
}
