//! Stores samples of a file, marked as such.

use std::collections::HashMap;

use duckdb::params;
use jiff::Timestamp;

use super::{
    sql,
    store::{Store, engine, instant, utc},
};
use crate::{
    history::{
        HistoryError,
        import::{Filler, Import, Rows},
        tiers::Tier,
    },
    plant::sample::Sample,
};

impl Store {
    /// The first instant of which samples can be imported: what was deleted before it would be deleted again, and the
    /// aggregates that remain of it are not formed again.
    pub fn importable_from(&self) -> Result<Timestamp, HistoryError> {
        Ok(self.deleted_until(Tier::Raw)?.unwrap_or_default().max(Timestamp::UNIX_EPOCH))
    }

    /// Stores the samples of a file that fill a gap, all of them or none; returns what was stored, `None` for nothing. They
    /// are archived with the hours that they belong to.
    pub fn import(&self, rows: Rows, file: &str, now: Timestamp) -> Result<Option<Import>, HistoryError> {
        let times = || rows.values().flatten().map(|sample| sample.at);
        let (Some(from), Some(to)) = (times().min(), times().max()) else { return Ok(None) };
        let mut fillers: HashMap<u16, Filler> = HashMap::new();
        for (tag, rows) in rows {
            fillers.extend(self.id(tag).map(|id| (id, Filler::new(rows))));
        }
        let end = to.checked_add(jiff::Span::new().microseconds(1)).unwrap_or(to);
        let gaps = self.each_stored(from, end, |tag: u16, sample: Sample| {
            if let Some(filler) = fillers.get_mut(&tag) {
                filler.stored(sample);
            }
        })?;
        if let Some(gap) = gaps.first() {
            let why = format!("{:.0} to {:.0} cannot be read, so what to import there is unknown", gap.from, gap.to);
            return Err(HistoryError::Refused(why));
        }
        let accepted: Vec<(u16, Vec<Sample>)> = fillers.into_iter().map(|(id, filler)| (id, filler.end())).collect();
        let samples = || accepted.iter().flat_map(|(id, samples)| samples.iter().map(move |sample| (*id, *sample)));
        let times = || samples().map(|(_, sample)| sample.at);
        let (Some(from), Some(to)) = (times().min(), times().max()) else { return Ok(None) };
        let import = Import { at: now, file: file.to_owned(), from, to, rows: samples().count() as u64 };
        self.commit(times(), self.epoch(), || {
            let mut appender = self.db.appender("sample")?;
            for (id, Sample { at, value, quality }) in samples() {
                appender.append_row((utc(at), id, value, quality.code(), sql::IMPORTED))?;
            }
            appender.flush()?;
            drop(appender);
            let Import { at, file, from, to, rows } = &import;
            self.db.execute(sql::ENTER_IMPORT, params![utc(*at), file, utc(*from), utc(*to), rows])?;
            Ok(true)
        })?;
        Ok(Some(import))
    }

    /// What was imported, the oldest import first.
    pub(super) fn imports(&self) -> Result<Vec<Import>, HistoryError> {
        let mut statement = self.db.prepare(sql::IMPORTS).map_err(engine)?;
        let row = |row: &duckdb::Row| {
            let time = |column| Ok::<_, duckdb::Error>(instant(row.get(column)?).unwrap_or_default());
            Ok(Import { at: time(0)?, file: row.get(1)?, from: time(2)?, to: time(3)?, rows: row.get(4)? })
        };
        let rows = statement.query_map([], row).map_err(engine)?;
        rows.collect::<duckdb::Result<Vec<_>>>().map_err(engine)
    }
}
