//! What the archive deletes, when, and why; pure.

use serde::{Deserialize, Serialize};

use super::{ArchiveFile, tiers::Tier};
use crate::plant::{def::HistoryDef, number::to_i64};

const DAY: i64 = 86_400_000_000;
/// How fast the history grows is seen from its last month.
const GROWTH_DAYS: i64 = 30;

/// The disk that a history lies on, in bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Disk {
    /// What may still be written.
    pub free: u64,
    /// All of it.
    pub all: u64,
}

impl Disk {
    /// Whether less is free than the history wants: in bytes and in percent.
    pub fn is_nearly_full(self, rule: HistoryDef) -> bool {
        self.free < u64::from(rule.disk_free_mib_min) << 20
            && self.free < self.all / 100 * u64::from(rule.disk_free_percent_min)
    }

    /// What the history may take of it.
    pub fn share(self, rule: HistoryDef) -> u64 {
        self.all / 100 * u64::from(rule.disk_share_percent_max)
    }
}

/// Why a file is deleted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Why {
    /// How many days it is kept.
    Age(u32),
    /// The history has more than its share of the disk.
    Share,
    /// The disk is nearly full.
    DiskFull,
}

/// A file of the archive that is deleted next.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Deletion {
    /// Which.
    pub file: ArchiveFile,
    /// Why.
    pub why: Why,
    /// When; microseconds since 1970. Of a share that is not reached yet it is an estimate.
    pub at: i64,
}

/// What is deleted next: what is too old, and the oldest samples where the disk has no room for them. `files` are in order of
/// time, `used` are the bytes of the whole history.
pub fn next_deletion(
    files: &[ArchiveFile],
    used: u64,
    disk: Option<Disk>,
    rule: HistoryDef,
    now: i64,
) -> Option<Deletion> {
    let oldest = |tier: Tier| files.iter().find(|file| file.tier == tier);
    let too_old = Tier::ALL.into_iter().filter_map(|tier| {
        let (file, days) = (oldest(tier)?, rule.keep_days(tier)?);
        Some(Deletion { at: file.to + i64::from(days) * DAY, why: Why::Age(days), file: file.clone() })
    });
    let no_room = || {
        let (file, disk) = (oldest(Tier::Raw)?, disk?);
        let (why, at) = match disk.share(rule).checked_sub(used) {
            _ if disk.is_nearly_full(rule) => (Why::DiskFull, now),
            None => (Why::Share, now),
            Some(left) => (Why::Share, now.saturating_add(to_i64(left as f64 / growth(files)? * DAY as f64))),
        };
        // Never what is young, however full the disk is.
        let at = at.max(file.to + i64::from(HistoryDef::DAYS_MIN) * DAY);
        Some(Deletion { file: file.clone(), why, at })
    };
    too_old.chain(no_room()).min_by_key(|deletion| deletion.at)
}

/// Bytes by which the archive grows in a day; `None` before there is a day of it.
pub fn growth(files: &[ArchiveFile]) -> Option<f64> {
    let last = files.iter().filter(|file| file.tier == Tier::Raw).map(|file| file.to).max()?;
    let recent = files.iter().filter(|file| file.tier == Tier::Raw && last - GROWTH_DAYS * DAY <= file.from);
    let (first, samples) = recent.fold((last, 0), |(first, bytes), file| (first.min(file.from), bytes + file.bytes));
    let formed = files.iter().filter(|file| file.tier != Tier::Raw && first <= file.from);
    let bytes = samples + formed.map(|file| file.bytes).sum::<u64>();
    (DAY <= last - first && bytes > 0).then(|| bytes as f64 * DAY as f64 / (last - first) as f64)
}

impl HistoryDef {
    fn keep_days(self, tier: Tier) -> Option<u32> {
        match tier {
            Tier::Raw => self.keep_samples_days,
            Tier::Minute => self.keep_minutes_days,
            Tier::Hour => self.keep_hours_days,
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    const GIB: u64 = 1 << 30;

    /// A file of a day; of hours a month.
    fn file(tier: Tier, day: i64, bytes: u64) -> ArchiveFile {
        let days = if tier == Tier::Hour { 30 } else { 1 };
        let path = format!("{} {day}", tier.word());
        let (from, to) = (day * DAY, (day + days) * DAY);
        ArchiveFile { tier, path, from, to, rows: 1, bytes, sha256: String::new(), rests: false }
    }

    /// Days of samples and minutes, 1 GiB and 0 bytes each.
    fn days(days: std::ops::Range<i64>) -> Vec<ArchiveFile> {
        days.flat_map(|day| [file(Tier::Raw, day, GIB), file(Tier::Minute, day, 0)]).collect()
    }

    #[test]
    fn the_oldest_file_goes_when_its_time_has_come() {
        let usual = HistoryDef::default();
        let roomy = Some(Disk { free: 900 * GIB, all: 1_000 * GIB });
        let short = Some(Disk { free: GIB / 2, all: 1_000 * GIB });
        let samples = HistoryDef { keep_samples_days: Some(20), ..usual };
        let both = HistoryDef { keep_minutes_days: Some(10), ..samples };
        let check = |files: &[ArchiveFile], used, disk, rule, expect: Option<(&str, Why, i64)>| {
            let got = next_deletion(files, used, disk, rule, 50 * DAY);
            let got = got.as_ref().map(|next| (next.file.path.as_str(), next.why, next.at / DAY));
            assert_eq!(got, expect, "{used} {disk:?} {rule:?}");
        };
        let month = days(20..50);
        check(&[], 0, short, both, None);
        check(&month, 30 * GIB, None, usual, None);
        check(&month, 30 * GIB, None, samples, Some(("raw 20", Why::Age(20), 41)));
        check(&month, 30 * GIB, None, both, Some(("m1 20", Why::Age(10), 31)));
        // 1 GiB a day: in 470 days it will have half of the disk.
        check(&month, 30 * GIB, roomy, usual, Some(("raw 20", Why::Share, 520)));
        check(&month, 501 * GIB, roomy, usual, Some(("raw 20", Why::Share, 50)));
        check(&month, 30 * GIB, short, usual, Some(("raw 20", Why::DiskFull, 50)));
        check(&month, 30 * GIB, roomy, samples, Some(("raw 20", Why::Age(20), 41)));
        // The last days stay, however full the disk is; so do minutes.
        check(&days(46..50), 4 * GIB, short, usual, Some(("raw 46", Why::DiskFull, 54)));
        check(&[file(Tier::Minute, 1, GIB)], 900 * GIB, short, usual, None);
    }

    #[test]
    fn growth_is_that_of_the_last_month() {
        let mut files = days(0..100);
        files.push(file(Tier::Hour, 60, 3 * GIB));
        assert_eq!(growth(&files[..1]), Some(GIB as f64));
        let of_a_month = growth(&files).unwrap();
        assert_eq!(of_a_month, GIB as f64, "what began before does not count");
        files.push(file(Tier::Minute, 99, 3 * GIB));
        assert_eq!(growth(&files), Some(1.1 * GIB as f64));
        assert_eq!(growth(&[]), None);
        assert_eq!(growth(&[ArchiveFile { to: DAY / 2, ..file(Tier::Raw, 0, GIB) }]), None);
    }
}
