//! The plant at a past instant.

use std::collections::HashMap;

use duckdb::params;
use jiff::{SignedDuration, Timestamp};

use super::{
    read::ROWS_MAX,
    sql,
    store::{Store, after, engine, instant, utc},
    stored::Stored,
};
use crate::{
    history::{
        HistoryError,
        tiers::{HOUR, MINUTE, Tier, floor},
    },
    plant::{
        def::{LineDef, TagId},
        line_minute::LineMinute,
        past::Past,
        record::AlarmRecord,
        sample::{Cause, Quality, Sample},
        tag::TagDef,
    },
    report::step_series::{HOLD_MAX, expiry},
};

/// A total that has had no value for this many days of records begins at 0.
const TOTALS_DAYS: i64 = 32;

impl Store {
    /// What was in force at an instant. Every tag has a row in each hour that the station ran, and a good value one in
    /// [`HOLD_MAX`]: few tags need the whole hour.
    pub(super) fn past(&self, at: Timestamp, now: Timestamp) -> Result<Past, HistoryError> {
        self.refuse_unknown(at, now)?;
        let after = at.checked_add(SignedDuration::from_micros(1)).unwrap_or(at);
        let mut found: Vec<Option<Sample>> = vec![None; self.def.tags.len()];
        let stored: Vec<TagId> = self.def.tags.iter().filter(|tag| tag.is_stored()).map(|tag| tag.id).collect();
        self.latest(&stored, at, (at, after), &mut found)?;
        let missing: Vec<TagId> = stored.into_iter().filter(|tag| found[tag.index()].is_none()).collect();
        let hour = instant(floor(at.as_microsecond(), HOUR)).unwrap_or(at);
        let held = at.checked_sub(HOLD_MAX).unwrap_or(hour);
        if hour < held && !missing.is_empty() {
            self.latest(&missing, at, (hour, held), &mut found)?;
        }
        // A station that ends writes a row for each tag.
        let off = found.iter().flatten().filter(|sample| sample.quality == Quality::Bad(Cause::StationOff));
        let off = off.map(|sample| sample.at).max().unwrap_or(Timestamp::MIN);
        let ran = found.iter().flatten().any(|sample| off < sample.at);
        let in_force = |(tag, sample): (&TagDef, Option<Sample>)| match sample {
            _ if !tag.is_stored() => Sample::bad(Cause::NotStored, at),
            Some(sample) if sample.at <= off => Sample::bad(Cause::StationOff, off),
            Some(sample) if sample.quality.is_good() && expiry(sample) <= at => {
                Sample::bad(Cause::StationOff, sample.at)
            }
            Some(sample) => sample,
            None if ran => Sample::bad(Cause::NotStored, at),
            None => Sample::bad(Cause::StationOff, at),
        };
        let samples = self.def.tags.iter().zip(found).map(in_force).collect();
        Ok(Past { at, samples, events: self.events_until(after)?, minutes: self.minutes_at(at)? })
    }

    /// When the first or the latest value of these tags was stored in a span.
    pub(super) fn sample_time(
        &self,
        tags: &[TagId],
        (from, to): (Timestamp, Timestamp),
        latest: bool,
    ) -> Result<Option<Timestamp>, HistoryError> {
        let mut found: Option<Timestamp> = None;
        self.each_sample(tags, from, to, |_, sample| {
            if (from..to).contains(&sample.at) {
                let at = found.get_or_insert(sample.at);
                *at = if latest { sample.at.max(*at) } else { sample.at.min(*at) };
            }
        })?;
        Ok(found)
    }

    /// An instant that the samples do not reach.
    fn refuse_unknown(&self, at: Timestamp, now: Timestamp) -> Result<(), HistoryError> {
        self.read_last_commit().map_err(engine)?;
        let deleted = self.deleted_until(Tier::Raw)?.unwrap_or(Timestamp::MIN);
        let first = self.extent().map(|(first, _)| first.max(deleted));
        match first {
            Some(first) if first <= at && at <= now => Ok(()),
            Some(first) => Err(HistoryError::NotKept { at, first, last: now }),
            // Nothing is stored yet: nothing is known.
            None => Ok(()),
        }
    }

    /// The last values of the tags that are totals, of those that have one in the last [`TOTALS_DAYS`]. A good one has a row
    /// an hour; but it may have had none in the runs of the station that came last.
    pub(super) fn last_totals(&self) -> Result<Vec<(String, f64)>, HistoryError> {
        let of_tag = |tag: &TagDef| Some((self.id(tag.id)?, tag.id));
        let totals: Vec<(u16, TagId)> = self.def.tags.iter().filter(|tag| tag.is_total()).filter_map(of_tag).collect();
        let Some((_, end)) = self.extent().filter(|_| !totals.is_empty()) else { return Ok(Vec::new()) };
        let mut found = HashMap::new();
        // Not from the whole: where a part of it cannot be read, the rest tells, in the order of the clock.
        if let Err(error) = self.read_totals(&totals, &mut found) {
            tracing::warn!(?error, "totals go on from what can be read");
            let tags: Vec<TagId> = totals.iter().map(|(_, tag)| *tag).collect();
            let begin = end.checked_sub(SignedDuration::from_hours(TOTALS_DAYS * 24)).unwrap_or(Timestamp::MIN);
            let mut values = vec![None; tags.len()];
            self.each_sample(&tags, begin, after(end).unwrap_or(end), |place, sample| {
                values[place] = sample.value.or(values[place]);
            })?;
            let read = totals.iter().zip(values).filter_map(|((number, _), value)| Some((*number, value?)));
            for (number, value) in read {
                found.entry(number).or_insert(value);
            }
        }
        let named = |(number, tag): &(u16, TagId)| Some((self.def.tag(*tag).name.clone(), *found.get(number)?));
        Ok(totals.iter().filter_map(named).collect())
    }

    fn read_totals(&self, totals: &[(u16, TagId)], found: &mut HashMap<u16, f64>) -> Result<(), HistoryError> {
        let row = |row: &duckdb::Row| row.get::<_, Option<i64>>(0);
        let last = self.db.query_row(sql::LAST_OF_EPOCH, [self.epoch()], row).map_err(engine)?;
        let Some(last) = last.or_else(|| Some(self.extent()?.1.as_microsecond())) else { return Ok(()) };
        for hours in [2, 48, TOTALS_DAYS * 24] {
            let missing: Vec<u16> = totals.iter().map(|(id, _)| *id).filter(|id| !found.contains_key(id)).collect();
            if missing.is_empty() {
                break;
            }
            // What lies ahead was stored before the clock was set back.
            let span = last.saturating_sub(hours * HOUR)..i64::MAX;
            let files = self.files(Some((Tier::Raw, span.clone())))?;
            let files = (!files.is_empty()).then(|| self.parquet(&files, false));
            let sql = sql::last_written(files.as_deref(), missing.into_iter());
            let row = |row: &duckdb::Row| Ok((row.get(0)?, row.get(1)?));
            let values: Vec<(u16, f64)> = self.list(&sql, params![span.start], row)?;
            found.extend(values);
        }
        Ok(())
    }

    /// The latest sample of each tag until an instant, of those that matter in a span.
    fn latest(
        &self,
        tags: &[TagId],
        at: Timestamp,
        (from, to): (Timestamp, Timestamp),
        found: &mut [Option<Sample>],
    ) -> Result<(), HistoryError> {
        self.each_sample(tags, from, to, |place, sample| {
            if sample.at <= at {
                found[tags[place].index()] = Some(sample);
            }
        })?;
        Ok(())
    }

    fn minutes_at(&self, at: Timestamp) -> Result<Vec<Option<LineMinute>>, HistoryError> {
        let end = instant(at.as_microsecond().saturating_add(MINUTE)).unwrap_or(at);
        let minute = |line: &LineDef| {
            let found = self.span_list(&sql::line_minutes(), (at, end, 1), params![line.name], LineMinute::read)?;
            Ok(found.into_iter().next())
        };
        self.def.lines.iter().map(minute).collect()
    }

    fn events_until(&self, end: Timestamp) -> Result<Vec<AlarmRecord>, HistoryError> {
        self.whole_list(&sql::restore(), params![ROWS_MAX + 1, utc(end)], AlarmRecord::read)
    }
}
