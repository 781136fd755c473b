//! What is deleted by the rules of the plant.

use duckdb::params;
use jiff::Timestamp;

use crate::{
    history::{
        ArchiveFile, HistoryError,
        io::{
            files, sql,
            store::{Store, engine, instant, utc},
        },
        retention::{self, Deletion},
        tiers::Tier,
    },
    report::coarse::{Coarse, Kept},
};

impl Store {
    /// What is deleted next; it is due if its time has come.
    pub(super) fn next_deletion(&self, files: &[ArchiveFile], now: Timestamp) -> Option<Deletion> {
        let used = self.file_bytes() + files.iter().map(|file| file.bytes).sum::<u64>();
        retention::next_deletion(files, used, files::disk(&self.path), self.def.history, now.as_microsecond())
    }

    /// Deletes a file: from then on what wider tiers have of its time answers.
    pub(super) fn delete(&self, deletion: &Deletion) -> Result<(), HistoryError> {
        let file = &deletion.file;
        tracing::warn!(path = file.path, why = ?deletion.why, "a file of the archive is deleted");
        self.enter(&[], std::slice::from_ref(file), || self.enter_deleted(file.tier, &file.path, file.to))?;
        self.remove_files(std::slice::from_ref(file));
        Ok(())
    }

    pub(super) fn enter_deleted(&self, tier: Tier, path: &str, until: i64) -> duckdb::Result<()> {
        self.db.execute(sql::ENTER_DELETED, params![tier.word(), path, instant(until).map(utc)]).map(drop)
    }

    /// Until when the rows of a tier were deleted.
    pub(in crate::history::io) fn deleted_until(&self, tier: Tier) -> Result<Option<Timestamp>, HistoryError> {
        let until: Option<i64> =
            self.db.query_row(sql::DELETED_UNTIL, params![tier.word()], |row| row.get(0)).map_err(engine)?;
        Ok(until.and_then(instant))
    }

    /// Are samples of an instant not kept any more?
    pub(in crate::history::io) fn is_deleted(&self, at: i64) -> Result<bool, HistoryError> {
        Ok(self.deleted_until(Tier::Raw)?.is_some_and(|until| at < until.as_microsecond()))
    }

    /// Where samples are not kept any more, and what is.
    pub(in crate::history::io) fn coarse(
        &self,
        (from, until): (Timestamp, Timestamp),
    ) -> Result<Vec<Coarse>, HistoryError> {
        let (mut next, mut coarse) = (from, Vec::new());
        for (tier, kept) in [(Tier::Hour, Kept::Nothing), (Tier::Minute, Kept::Hours), (Tier::Raw, Kept::Minutes)] {
            let to = self.deleted_until(tier)?.map_or(next, |deleted| deleted.min(until));
            if next < to {
                coarse.push(Coarse { from: next, to, kept });
                next = to;
            }
        }
        Ok(coarse)
    }

    /// The finest tier that has what was stored from an instant on.
    pub(in crate::history::io) fn finest(&self, from: Timestamp) -> Result<Tier, HistoryError> {
        for tier in Tier::ALL {
            if self.deleted_until(tier)?.is_none_or(|until| until <= from) {
                return Ok(tier);
            }
        }
        Ok(Tier::Hour)
    }
}
