//! What the history takes of its disk, and what it deletes when: the table `[history]` of a plant file.

use super::{
    diagnostic::Problems,
    reader::{At, OptionalKey, within},
    schema::HistoryTable,
};
use crate::plant::def::HistoryDef;

/// A disk that must always be emptier than half warns for ever.
const PERCENT_MOST: u8 = 50;
/// 1 TiB.
const MIB_MOST: u32 = 1 << 20;
/// Share of the disk, percent.
const SHARE_MOST: u8 = 95;
/// A hundred years.
const DAYS_MOST: u32 = 36_500;

/// The rules; without the table the usual ones.
pub(super) fn history(table: Option<&HistoryTable>, problems: &mut Problems) -> HistoryDef {
    let usual = HistoryDef::default();
    let Some(table) = table else { return usual };
    let mut days = |given: Option<At<u32>>| {
        given.is_some().then(|| within(given, HistoryDef::DAYS_MIN..=DAYS_MOST, HistoryDef::DAYS_MIN, problems))
    };
    let keep_samples_days = days(table.keep_samples_days);
    let keep_minutes_days = days(table.keep_minutes_days);
    let keep_hours_days = days(table.keep_hours_days);
    HistoryDef {
        disk_free_percent_min: within(
            table.disk_free_percent_min,
            0..=PERCENT_MOST,
            usual.disk_free_percent_min,
            problems,
        ),
        disk_free_mib_min: within(table.disk_free_mib_min, 0..=MIB_MOST, usual.disk_free_mib_min, problems),
        disk_share_percent_max: within(
            table.disk_share_percent_max,
            1..=SHARE_MOST,
            usual.disk_share_percent_max,
            problems,
        ),
        keep_samples_days,
        keep_minutes_days,
        keep_hours_days,
        parquet: table.parquet.value_or(usual.parquet),
    }
}
