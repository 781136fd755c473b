//! How long the history keeps what, and what it may take of its disk.

use serde::{Deserialize, Serialize};

use super::keyword::keyword_enum;

/// What the history may take of its disk, and for how long it keeps what.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct HistoryDef {
    /// The disk is nearly full when less than this share of it is free, percent, and less than `disk_free_mib_min`.
    pub disk_free_percent_min: u8,
    /// MiB.
    pub disk_free_mib_min: u32,
    /// Share of the disk that the history takes before its oldest samples go, percent.
    pub disk_share_percent_max: u8,
    /// Days for which samples are kept; `None` for as long as the disk has room.
    pub keep_samples_days: Option<u32>,
    /// The same of minutes; `None` for ever.
    pub keep_minutes_days: Option<u32>,
    /// The same of hours; `None` for ever.
    pub keep_hours_days: Option<u32>,
    /// How its archive is written.
    pub parquet: ParquetVersion,
}

impl HistoryDef {
    /// Nothing younger is ever deleted, however full the disk is.
    pub const DAYS_MIN: u32 = 7;
}

impl Default for HistoryDef {
    /// A tenth of a large disk is plenty, and a small disk never has 1 GiB free.
    fn default() -> HistoryDef {
        HistoryDef {
            disk_free_percent_min: 10,
            disk_free_mib_min: 1_024,
            disk_share_percent_max: 50,
            keep_samples_days: None,
            keep_minutes_days: None,
            keep_hours_days: None,
            parquet: ParquetVersion::V1,
        }
    }
}

keyword_enum! {
    /// A version of the Parquet format.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
    pub enum ParquetVersion: "Parquet version" {
        /// Every engine reads it.
        V1 => "v1",
        /// Smaller where values come at regular times.
        V2 => "v2",
    }
}
