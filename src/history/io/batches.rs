//! Batches with their figures.

use duckdb::{Row, params};
use jiff::Timestamp;

use super::{
    read::{ROWS_MAX, check_span, maybe_shared, shared, time, within},
    store::{Store, utc},
};
use crate::{
    history::{BATCHES_MAX, HistoryError},
    plant::{
        batch::{Batch, BatchEvent, BatchRecord, batches, records_since},
        keyword::Keyword,
        record::AlarmEvent,
        time::elapsed,
    },
    report::batch::{self, BatchReport},
};

/// The records of the batches that ran in a span, newest batch first, of at most so many batches.
const BATCHES: &str = "SELECT utc, name, number, place, event, phase FROM batch JOIN (
    SELECT name, number, first(utc ORDER BY place) AS begun, last(utc ORDER BY place) AS changed,
        bool_or(event IN ('ended', 'found ended')) AS over
    FROM batch GROUP BY name, number HAVING begun < $2 AND (NOT over OR $1 < changed)
    ORDER BY begun DESC, name, number LIMIT $3) USING (name, number)
    ORDER BY begun DESC, name, number, place";
/// The last record of each name.
const LATEST_BATCHES: &str = "SELECT utc, name, number, place, event, phase FROM batch
    QUALIFY row_number() OVER (PARTITION BY name ORDER BY number DESC, place DESC) = 1";

impl Store {
    /// The batches that ran between two instants, newest first, at most so many; without figures where these are more than
    /// [`BATCHES_MAX`].
    pub(super) fn batches(
        &self,
        (from, to, limit): (Timestamp, Timestamp, u64),
        now: Timestamp,
    ) -> Result<Vec<BatchReport>, HistoryError> {
        check_span(from, to)?;
        let records = self.list(BATCHES, params![utc(from), utc(to), limit], record)?;
        within(records.len() as u64, ROWS_MAX)?;
        self.with_figures(batches(&records, now), now)
    }

    /// The batches that ran in a period, as they were at its end: the same whenever it is asked.
    pub(super) fn batches_of(&self, from: Timestamp, until: Timestamp) -> Result<Vec<BatchReport>, HistoryError> {
        let mut records = self.list(BATCHES, params![utc(from), utc(until), ROWS_MAX], record)?;
        within(records.len() as u64, ROWS_MAX)?;
        // Its own end is that of its period.
        records.retain(|record| record.at <= until);
        let mut reports = self.with_figures(batches(&records, until), until)?;
        let parts = batches(&records_since(&records, from), until);
        let with_figures = parts.len() <= BATCHES_MAX;
        for (report, part) in reports.iter_mut().zip(parts).filter(|(report, _)| report.batch.from < from) {
            let end = part.until(until);
            let part = if with_figures { self.batch(part, end)? } else { BatchReport::new(part, end) };
            report.part = Some(Box::new(part));
        }
        Ok(reports)
    }

    fn with_figures(&self, batches: Vec<Batch>, now: Timestamp) -> Result<Vec<BatchReport>, HistoryError> {
        let with_figures = batches.len() <= BATCHES_MAX;
        let report = |batch: Batch| {
            let until = batch.until(now);
            match with_figures {
                true => self.batch(batch, until),
                false => Ok(BatchReport::new(batch, until)),
            }
        };
        batches.into_iter().map(report).collect()
    }

    /// The last record of the batches of each name.
    pub(super) fn latest_batches(&self) -> Result<Vec<BatchRecord>, HistoryError> {
        self.list(LATEST_BATCHES, &[], record)
    }

    fn batch(&self, batch: Batch, until: Timestamp) -> Result<BatchReport, HistoryError> {
        let from = batch.from;
        let mut report = BatchReport::new(batch, until);
        let rule = self.def.batches.iter().find(|rule| rule.name == report.batch.name);
        // The clock may have been set back since it began.
        let Some(rule) = rule.filter(|_| from < until) else { return Ok(report) };
        let events = self.event_legs(from, until)?;
        report.alarms =
            Some(events.iter().flat_map(|leg| &leg.events).filter(|event| event.event == AlarmEvent::Raised).count()
                as u64);
        let mut tags = rule.tags.clone();
        tags.extend(rule.energy.filter(|energy| !tags.contains(energy)));
        let gathered = self.gather(&tags, std::iter::empty(), (from, until))?;
        report.tags = gathered.rows(&self.def, &tags, &events);
        let energy = rule.energy.map(|energy| self.def.tag(energy).name.as_str());
        let energy = report.tags.iter().find(|figures| Some(figures.tag.as_str()) == energy);
        report.energy = energy.and_then(|figures| batch::energy(figures, elapsed(from, until)));
        report.unreadable = gathered.unreadable;
        Ok(report)
    }
}

fn record(row: &Row) -> duckdb::Result<BatchRecord> {
    Ok(BatchRecord {
        at: time(row)?,
        batch: shared(row, 1)?,
        number: row.get(2)?,
        place: row.get(3)?,
        event: BatchEvent::from_word(&row.get::<_, String>(4)?).ok_or(duckdb::Error::InvalidQuery)?,
        phase: maybe_shared(row, 5)?,
    })
}
