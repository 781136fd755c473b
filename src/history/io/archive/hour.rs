//! A closed hour: its samples into a file, its minutes and hours beside it, and out of the database.

use std::{collections::HashMap, ops::Range};

use duckdb::{ToSql, params};

use super::{NewFile, overlapping};
use crate::{
    history::{
        ArchiveFile, HistoryError,
        io::{
            sql,
            store::{Store, engine, instant, utc},
        },
        tiers::{Aggregate, HOUR, Hours, Minutes, Tier},
    },
    plant::{exact::Exact, sample::Sample},
};

/// The aggregates of one tag under way.
struct Forming {
    minutes: Minutes,
    hours: Hours,
}

impl Store {
    /// Archives the samples of an hour. Where files have it already, those came late, after a clock that was set back or
    /// by an import: they get a file of their own, and what was formed of the hour is formed again. Where its samples were
    /// deleted meanwhile, what was formed of them stays, and only what it lacks is added.
    pub(super) fn archive_hour(&self, hour: i64) -> Result<(), HistoryError> {
        let span = hour..hour + HOUR;
        let deleted = self.is_deleted(hour)?;
        let replace = if deleted { sql::added } else { sql::others };
        let rests = self.any_rests(Tier::Raw, &span)?;
        let samples = sql::samples_of(&span, rests);
        let raw = self.write_file((Tier::Raw, rests), span.clone(), &samples, "ORDER BY tag, utc, rowid")?;
        let rows = raw.as_ref().map_or(0, |raw| raw.file.rows);
        // The first minutes of the next hour begin with values of this one: unless it is formed with its own samples later,
        // they are formed now.
        let next = span.end..span.end + HOUR;
        let later: u64 = self.db.query_row(&sql::count_samples(&next), [], |row| row.get(0)).map_err(engine)?;
        let formed = if deleted || 0 < later { span.clone() } else { hour..next.end };
        self.form(formed.clone())?;
        let (mut new, mut old) = (Vec::from_iter(raw), Vec::new());
        for tier in [Tier::Minute, Tier::Hour] {
            let replaced = self.files(Some((tier, formed.clone())))?;
            new.extend(self.write_aggregates(tier, &formed, &replaced, replace)?);
            old.extend(replaced);
        }
        self.write_tags()?;
        // The samples last: with their file an hour is whole, see `adopt`.
        new.reverse();
        let new: Vec<ArchiveFile> = new.into_iter().map(NewFile::rename).collect::<Result<_, _>>()?;
        let within = [span.start, span.end].map(|at| instant(at).map(utc));
        self.enter(&new, &old, || {
            let deleted = self.db.execute(sql::DELETE_SAMPLES, params![within[0], within[1]])?;
            // What came meanwhile is not in the file: all of it once more.
            if deleted as u64 == rows { Ok(()) } else { Err(duckdb::Error::StatementChangedRows(deleted)) }
        })?;
        self.remove_files(&old);
        Ok(())
    }

    /// Forms the minutes and hours of a span in two tables of this connection.
    fn form(&self, span: Range<i64>) -> Result<(), HistoryError> {
        let (Some(from), Some(to)) = (instant(span.start), instant(span.end)) else { return Ok(()) };
        self.db.execute_batch(&sql::form_tables()).map_err(engine)?;
        let mut minutes = self.db.appender(sql::FORMED[0]).map_err(engine)?;
        let mut hours = self.db.appender(sql::FORMED[1]).map_err(engine)?;
        let mut failed = None;
        let mut append = |to: &mut duckdb::Appender, tag: u16, row: Aggregate| {
            let Aggregate { at, stats, first, gain, samples } = row;
            let (at, good_ms) = (instant(at).map(utc), (stats.seconds * 1_000.0).round());
            let [min, max, first, last, gain] = [stats.min, stats.max, first, stats.last, gain];
            let [least, most, began, ended, gained] = [min, max, first, last, gain].map(Exact::near);
            let row = params![at, tag, least, most, stats.mean, began, ended, gained, good_ms, samples];
            let rests = [min, max, first, last, gain].map(Exact::rest);
            let rests: Vec<&dyn ToSql> = rests.iter().map(|rest| rest as &dyn ToSql).collect();
            let appended = to.append_row(&*[row, &rests].concat());
            failed = failed.take().or(appended.err());
        };
        let mut tags: HashMap<u16, Forming> = HashMap::new();
        let begin = || Forming { minutes: Minutes::new(from, to), hours: Hours::default() };
        let gaps = self.each_stored(from, to, |tag: u16, sample: Sample| {
            let Forming { minutes: forming, hours: formed } = tags.entry(tag).or_insert_with(begin);
            forming.next(sample, |minute| {
                append(&mut minutes, tag, minute);
                formed.next(minute).into_iter().for_each(|hour| append(&mut hours, tag, hour));
            });
        })?;
        for (tag, Forming { minutes: forming, hours: mut formed }) in tags {
            forming.end(|minute| {
                append(&mut minutes, tag, minute);
                formed.next(minute).into_iter().for_each(|hour| append(&mut hours, tag, hour));
            });
            formed.end().into_iter().for_each(|hour| append(&mut hours, tag, hour));
        }
        match failed {
            Some(error) => return Err(engine(error)),
            None => minutes.flush().and_then(|()| hours.flush()).map_err(engine)?,
        }
        drop((minutes, hours));
        if self.doubled()?.iter().any(|doubled| doubled.span.start < span.end && span.start < doubled.span.end) {
            self.db.execute_batch(&sql::unite_epochs()).map_err(engine)?;
        }
        match gaps.first() {
            None => Ok(()),
            Some(gap) => Err(HistoryError::Engine(format!("{:.0} cannot be read: {}", gap.from, gap.why))),
        }
    }

    /// What was formed of an hour, and perhaps of the next one, as files: one of its own each, or those that have it already
    /// written again.
    fn write_aggregates(
        &self,
        tier: Tier,
        formed: &Range<i64>,
        replaced: &[ArchiveFile],
        replace: fn(Tier, &str, &Range<i64>, bool) -> String,
    ) -> Result<Vec<NewFile>, HistoryError> {
        let mut written = Vec::new();
        for file in replaced {
            let within = formed.start.max(file.from)..formed.end.min(file.to);
            let rests = file.rests || self.any_rests(tier, &within)?;
            let others = replace(tier, &self.parquet(std::slice::from_ref(file), rests), &within, rests);
            let others = self.sorted((tier, rests), &others)?;
            written.extend(self.write_file((tier, rests), file.from..file.to, &others, "")?);
        }
        let hours =
            std::iter::successors(Some(formed.start), |hour| Some(hour + HOUR).filter(|next| *next < formed.end));
        for hour in hours.map(|hour| hour..hour + HOUR) {
            if overlapping(replaced, &hour).is_empty() {
                let rests = self.any_rests(tier, &hour)?;
                let rows = sql::formed(tier, &hour, rests);
                written.extend(self.write_file((tier, rests), hour, &rows, "ORDER BY tag, utc")?);
            }
        }
        Ok(written)
    }

    fn any_rests(&self, tier: Tier, span: &Range<i64>) -> Result<bool, HistoryError> {
        self.db.query_row(&sql::any_rests(tier, span), [], |row| row.get(0)).map_err(engine)
    }
}
