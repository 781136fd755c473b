//! How much of the disk the history leaves free before it warns: the table `[history]` of a plant file.

use super::{diagnostic::Problems, reader::within, schema::HistoryTable};
use crate::plant::def::HistoryDef;

/// A disk that must always be emptier than half warns for ever.
const PERCENT_MOST: u8 = 50;
/// 1 TiB.
const MIB_MOST: u32 = 1 << 20;

/// The thresholds; without the table the usual ones.
pub(super) fn history(table: Option<&HistoryTable>, problems: &mut Problems) -> HistoryDef {
    let usual = HistoryDef::default();
    let Some(table) = table else { return usual };
    let percent = within(table.disk_free_percent_min, 0..=PERCENT_MOST, usual.disk_free_percent_min, problems);
    let mib = within(table.disk_free_mib_min, 0..=MIB_MOST, usual.disk_free_mib_min, problems);
    HistoryDef { disk_free_percent_min: percent, disk_free_mib_min: mib }
}
