//! Batches with their figures, each by the settings of the clock in which it was recorded.

use std::ops::Range;

use duckdb::params;
use jiff::Timestamp;

use super::{
    read::{ROWS_MAX, check_span, within},
    store::{Store, instant, utc},
    stored::Stored,
};
use crate::{
    history::{
        BATCHES_MAX, HistoryError,
        legs::{Position, between, clip, end_of_period, is_by, time, widened},
        recorded::{Doubled, Leg},
    },
    plant::{
        batch::{self as rules, Batch, BatchRecord},
        record::AlarmEvent,
    },
    report::batch::{self, BatchReport},
};

/// The records of the batches that ran in a span, newest batch first, of a limited number of batches, each with the epoch of its clock.
fn records_of() -> String {
    format!(
        "SELECT {}, epoch FROM batch JOIN (
    SELECT name, number, first(epoch ORDER BY place) AS since, first(utc ORDER BY place) AS begun,
        last(utc ORDER BY place) AS changed, bool_or(event IN ('ended', 'found ended')) AS over
    FROM batch GROUP BY name, number HAVING begun < $2 AND (NOT over OR $1 < changed)
    ORDER BY since DESC, begun DESC, name, number LIMIT $3) USING (name, number)
    ORDER BY since DESC, begun DESC, name, number, place",
        BatchRecord::columns()
    )
}

/// The last record of each name.
fn latest() -> String {
    format!(
        "SELECT {} FROM batch QUALIFY row_number() OVER (PARTITION BY name ORDER BY number DESC, place DESC) = 1",
        BatchRecord::columns()
    )
}

/// A record with the epoch of its clock.
type Dated = (u16, BatchRecord);

impl Store {
    /// The batches that ran between two instants, newest first, up to a limit; without figures where these are more than
    /// [`BATCHES_MAX`].
    pub(super) fn batches(
        &self,
        (from, to, limit): (Timestamp, Timestamp, u64),
        now: Timestamp,
    ) -> Result<Vec<BatchReport>, HistoryError> {
        check_span(from, to)?;
        let found = self.batches_in((from, to), limit, &|_| true, now)?;
        Ok(found.into_iter().map(|(whole, _)| whole).collect())
    }

    /// The batches that ran in a period, as they were at its end: the same whenever it is asked.
    pub(super) fn batches_of(&self, from: Timestamp, until: Timestamp) -> Result<Vec<BatchReport>, HistoryError> {
        // Its own end is that of its period.
        let doubled = self.doubled()?;
        let end = end_of_period(&doubled, until.as_microsecond());
        let is_known = |(epoch, record): &Dated| is_by(&doubled, (*epoch, record.at.as_microsecond()), end);
        let found = self.batches_in((from, until), ROWS_MAX, &is_known, until)?;
        Ok(found.into_iter().map(|(whole, part)| BatchReport { part: part.map(Box::new), ..whole }).collect())
    }

    /// The batches that ran in a span, as far as their records are known, each with the part of it that lies in the span where
    /// that is not all of it.
    fn batches_in(
        &self,
        (from, until): (Timestamp, Timestamp),
        limit: u64,
        is_known: &dyn Fn(&Dated) -> bool,
        now: Timestamp,
    ) -> Result<Vec<(BatchReport, Option<BatchReport>)>, HistoryError> {
        let doubled = self.doubled()?;
        let period = from.as_microsecond()..until.as_microsecond();
        let asked = widened(&doubled, period.clone());
        let (Some(begin), Some(end)) = (instant(asked.start), instant(asked.end)) else { return Ok(Vec::new()) };
        let mut records = self.list(&records_of(), params![utc(begin), utc(end), limit], BatchRecord::read_dated)?;
        within(records.len() as u64, ROWS_MAX)?;
        records.retain(is_known);
        let now = end_of_period(&doubled, now.as_microsecond());
        let of_one = records.chunk_by(|(_, one), (_, next)| one.number == next.number && one.batch == next.batch);
        let found = of_one.filter_map(|records| {
            let whole = Span::new(&doubled, records, now)?;
            let part = whole.within(&period);
            let is_there = |part: &Span| !clip(&part.legs, &period).is_empty();
            (whole.legs.is_empty() || part.as_ref().is_none_or(is_there)).then_some((whole, part))
        });
        let found: Vec<(Span, Option<Span>)> = found.collect();
        let with_figures = found.len() <= BATCHES_MAX;
        let report = |span: Span| if with_figures { self.batch(span) } else { Ok(span.without_figures()) };
        found.into_iter().map(|(whole, part)| Ok((report(whole)?, part.map(report).transpose()?))).collect()
    }

    /// The last record of the batches of each name.
    pub(super) fn latest_batches(&self) -> Result<Vec<BatchRecord>, HistoryError> {
        self.list(&latest(), &[], BatchRecord::read)
    }

    fn batch(&self, span: Span) -> Result<BatchReport, HistoryError> {
        let mut report = span.without_figures();
        let rule = self.def.batches.iter().find(|rule| rule.name == report.batch.name);
        let legs = clip(&span.legs, &span.period);
        let Some(rule) = rule.filter(|_| !legs.is_empty()) else { return Ok(report) };
        let events = self.events_of(legs)?;
        report.alarms =
            Some(events.iter().flat_map(|leg| &leg.events).filter(|event| event.event == AlarmEvent::Raised).count()
                as u64);
        let mut tags = rule.tags.clone();
        tags.extend(rule.energy.filter(|energy| !tags.contains(energy)));
        let gathered = self.gather_of(&tags, std::iter::empty(), &span.legs, &span.period)?;
        report.tags = gathered.rows(&self.def, &tags, &events);
        let energy = rule.energy.map(|energy| self.def.tag(energy).name.as_str());
        let energy = report.tags.iter().find(|figures| Some(figures.tag.as_str()) == energy);
        report.energy = energy.and_then(|figures| batch::energy(figures, gathered.time));
        report.unreadable = gathered.unreadable;
        Ok(report)
    }
}

/// A batch, or the part of one, and where it lies.
struct Span<'a> {
    batch: Batch,
    until: Timestamp,
    records: &'a [Dated],
    /// Those of each record.
    of_records: Vec<Vec<Leg>>,
    legs: Vec<Leg>,
    /// What of them counts.
    period: Range<i64>,
}

impl Span<'_> {
    /// From the records of one batch; one that runs lasts until `now`.
    fn new<'a>(doubled: &[Doubled], records: &'a [Dated], now: Position) -> Option<Span<'a>> {
        let positions = records.iter().map(|(epoch, record)| (*epoch, record.at.as_microsecond()));
        let ends = positions.clone().skip(1).chain([now]);
        let of_records: Vec<Vec<Leg>> =
            positions.clone().zip(ends).map(|(from, to)| between(doubled, from, to)).collect();
        let batch = batch_of(records, &of_records)?;
        let (first, last) = (positions.clone().next()?, positions.clone().next_back().filter(|_| batch.to.is_some()));
        let legs = between(doubled, first, last.unwrap_or(now));
        let until = batch.to.or_else(|| instant(now.1))?;
        Some(Span { batch, until, records, of_records, legs, period: i64::MIN..i64::MAX })
    }

    /// The part that lies in a period; `None` if it is all.
    fn within(&self, period: &Range<i64>) -> Option<Self> {
        if clip(&self.legs, period) == self.legs {
            return None;
        }
        let of_records: Vec<Vec<Leg>> = self.of_records.iter().map(|legs| clip(legs, period)).collect();
        let mut batch = batch_of(self.records, &of_records)?;
        batch.from = batch.from.max(instant(period.start)?);
        let until = self.until.min(instant(period.end)?);
        let legs = self.legs.clone();
        Some(Span { batch, until, records: self.records, of_records, legs, period: period.clone() })
    }

    fn without_figures(&self) -> BatchReport {
        BatchReport::new(self.batch.clone(), self.until)
    }
}

fn batch_of(records: &[Dated], legs: &[Vec<Leg>]) -> Option<Batch> {
    let of: Vec<BatchRecord> = records.iter().map(|(_, record)| record.clone()).collect();
    rules::batch(&of, |place| time(&legs[place]))
}
