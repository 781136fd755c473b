//! What the store answers: curves, values, journal, operator actions, and the alarms to restore.

use std::{collections::HashMap, sync::Arc, time::Duration};

use duckdb::{Row, params};
use jiff::Timestamp;

use super::{
    aggregates::Detail,
    sql,
    store::{Store, engine, utc},
    stored::Stored,
};
use crate::{
    history::{
        Answer, HistoryError, Query, Series,
        series::{self, Curve},
    },
    plant::{
        counter,
        def::TagId,
        line_minute::LineMinute,
        record::{ActionRecord, AlarmRecord},
        time::instant_of_grid,
    },
    report::step_series::{HeldValue, ValuesAt},
};

/// Rows of a list or of a record in one answer; an answer that would be longer is refused, never cut.
pub const ROWS_MAX: u64 = 200_000;
/// Stored samples behind one answer: what is read in some seconds (see the bench `history`).
pub const SAMPLES_MAX: u64 = 100_000_000;

/// A query is answered once more so often at most, where the archive changed or a file of it could not be read.
const CHANGES_MAX: u32 = 8;

impl Store {
    /// Answers a query; nothing after `now` is known.
    pub fn answer(&self, query: &Query, now: Timestamp) -> Result<Answer, HistoryError> {
        let mut answer = self.look_up(query, now);
        for _ in 0..CHANGES_MAX {
            if !self.changed.take() {
                break;
            }
            answer = self.look_up(query, now);
        }
        if self.changed.take() && answer.is_ok() {
            // It may lack an hour that moved meanwhile, without a sign of it.
            answer = Err(HistoryError::Engine("the archive changed each time that it was read: try again".into()));
        }
        if let Err(error) = &answer
            && error.is_damage()
        {
            self.unreadable.replace(Some(format!("it cannot be read: {}", error.words())));
        }
        answer
    }

    fn look_up(&self, query: &Query, now: Timestamp) -> Result<Answer, HistoryError> {
        match query {
            Query::Series { tags, from, to, buckets } => {
                self.curves(tags, series::Span { from: *from, to: *to, until: now }, *buckets).map(Answer::Series)
            }
            Query::Values { tags, from, every, count } => {
                self.values(tags, *from, *every, *count, now).map(Answer::Values)
            }
            Query::Batches { from, to, limit } => self.batches((*from, *to, *limit as u64), now).map(Answer::Batches),
            Query::ControlRuns { controller, from, to, limit } => {
                self.control_runs(controller.as_deref(), (*from, *to, *limit as u64)).map(Answer::ControlRuns)
            }
            Query::SampleTime { tags, from, to, latest } => {
                self.sample_time(tags, (*from, *to), *latest).map(Answer::SampleTime)
            }
            Query::Reports { limit } => self.made_reports(*limit).map(Answer::Reports),
            Query::Past { at } => self.past(*at, now).map(|past| Answer::Past(Box::new(past))),
            Query::Samples { epoch, from, to } => self.stored(*epoch, (*from, *to)).map(Answer::Samples),
            Query::Unarchived { from, to } => self.unarchived(*from, *to).map(Answer::Unarchived),
            Query::Overview => self.overview(now).map(|overview| Answer::Overview(Box::new(overview))),
            Query::Registers(_) => Err(HistoryError::Engine("registers are read by the line".to_owned())),
            Query::Journal { from, to, limit } => self
                .span_list(&sql::journal("", sql::NEWEST), (*from, *to, *limit), &[], AlarmRecord::read)
                .map(Answer::Journal),
            Query::Actions { from, to, limit } => self
                .span_list(&sql::actions(sql::NEWEST), (*from, *to, *limit), &[], ActionRecord::read)
                .map(Answer::Actions),
            Query::Audit { from, to, words, by, action: what, limit } => self
                .span_list(&sql::audit(), (*from, *to, *limit), params![by, what, words], ActionRecord::read)
                .map(Answer::Actions),
            Query::LineMinutes { line, from, to, limit } => {
                let name = self.def.lines.get(line.index()).map_or("", |line| &line.name);
                self.span_list(&sql::line_minutes(), (*from, *to, *limit), params![name], LineMinute::read)
                    .map(Answer::LineMinutes)
            }
            Query::Report { period } => self.report(period, now).map(|report| Answer::Report(Box::new(report))),
            Query::AlarmMetrics { from, to } => {
                self.alarm_metrics(*from, *to, now).map(|figures| Answer::AlarmMetrics(Box::new(figures)))
            }
        }
    }

    /// Of each alarm the last event of every kind, oldest first: from these the plant restores what is active and
    /// what is acknowledged.
    pub fn restore(&self) -> Result<Vec<AlarmRecord>, HistoryError> {
        self.whole_list(&sql::restore(), params![ROWS_MAX + 1, utc(Timestamp::MAX)], AlarmRecord::read)
    }

    pub(super) fn curves(
        &self,
        tags: &[TagId],
        span: series::Span,
        buckets: usize,
    ) -> Result<Vec<Series>, HistoryError> {
        check_span(span.from, span.to)?;
        let tags = Distinct::new(tags);
        let (span, buckets, tier) = series::grid(span, buckets, self.finest(span.from)?);
        let mut curves: Vec<Curve> = tags.each.iter().map(|tag| Curve::new(*tag, span, buckets)).collect();
        let known = (span.from, span.to.min(span.until));
        if known.0 < known.1 {
            self.each_part(&tags.each, known, (tier, Detail::Curve), |place, part| curves[place].add(part))?;
        }
        let mut series: Vec<Series> = curves.into_iter().map(Curve::end).collect();
        if buckets == 1 && known.0 < known.1 {
            self.add_counted(&mut series, known)?;
        }
        Ok(tags.all(series.into_iter()))
    }

    /// What counters counted from the value in force at one instant to that at another.
    fn add_counted(&self, series: &mut [Series], (from, to): (Timestamp, Timestamp)) -> Result<(), HistoryError> {
        let after = |at: Timestamp| at.checked_add(Duration::from_micros(1)).unwrap_or(at);
        let counters: Vec<TagId> =
            series.iter().map(|series| series.tag).filter(|tag| counter::may_count(self.def.tag(*tag))).collect();
        if counters.is_empty() {
            return Ok(());
        }
        let gathered = self.gather(&counters, std::iter::empty(), (after(from), after(to)))?;
        for series in series.iter_mut().filter(|series| counters.contains(&series.tag)) {
            let figures = gathered.rows(&self.def, &[series.tag], &[]);
            series.counted = figures.first().and_then(|figures| figures.difference);
        }
        Ok(())
    }

    /// The values at equal distances: the first instant is one `every` after `from`. Nothing stands after `now`.
    fn values(
        &self,
        tags: &[TagId],
        from: Timestamp,
        every: Duration,
        count: usize,
        now: Timestamp,
    ) -> Result<Vec<Vec<Option<HeldValue>>>, HistoryError> {
        let instants = (1..=count).map_while(|number| instant_of_grid(from, every, number)).take_while(|at| *at <= now);
        let instants: Arc<[Timestamp]> = instants.collect();
        let Some(last) = instants.last() else { return Ok(vec![vec![None; count]; tags.len()]) };
        let to = last.checked_add(Duration::from_micros(1)).unwrap_or(*last);
        check_span(from, to)?;
        self.bounded(tags.len(), from, to, now, SAMPLES_MAX)?;
        let tags = Distinct::new(tags);
        let mut as_of: Vec<ValuesAt> = tags.each.iter().map(|_| ValuesAt::new(instants.clone())).collect();
        self.each_sample(&tags.each, from, to, |place, sample| as_of[place].next(sample))?;
        let column = |as_of: ValuesAt| {
            let as_of = as_of.end().into_iter().map(|sample| sample.map(HeldValue::from));
            as_of.chain(std::iter::repeat(None)).take(count).collect()
        };
        Ok(tags.all(as_of.into_iter().map(column)))
    }

    pub(super) fn id(&self, tag: TagId) -> Option<u16> {
        self.ids.get(tag.index()).copied().flatten()
    }

    /// The rows between two instants, up to a limit; the parameters after these three are `more`.
    pub(super) fn span_list<T>(
        &self,
        sql: &str,
        (from, to, limit): (Timestamp, Timestamp, usize),
        more: &[&dyn duckdb::ToSql],
        read: fn(&Row) -> duckdb::Result<T>,
    ) -> Result<Vec<T>, HistoryError> {
        check_span(from, to)?;
        let capped = (limit as u64).min(ROWS_MAX);
        self.list(sql, &[params![utc(from), utc(to), capped], more].concat(), read)
    }

    pub(super) fn list<T>(
        &self,
        sql: &str,
        params: &[&dyn duckdb::ToSql],
        read: fn(&Row) -> duckdb::Result<T>,
    ) -> Result<Vec<T>, HistoryError> {
        // Not from the cache: after a change of the catalog, as by a temporary table, a cached statement reads garbage
        // (measured).
        let mut statement = self.db.prepare(sql).map_err(engine)?;
        let rows = statement.query_map(params, read).map_err(engine)?;
        rows.collect::<duckdb::Result<_>>().map_err(engine)
    }

    /// A list that must not be cut; its SQL asks for one row more than is permitted.
    pub(super) fn whole_list<T>(
        &self,
        sql: &str,
        params: &[&dyn duckdb::ToSql],
        read: fn(&Row) -> duckdb::Result<T>,
    ) -> Result<Vec<T>, HistoryError> {
        let rows = self.list(sql, params, read)?;
        within(rows.len() as u64, ROWS_MAX)?;
        Ok(rows)
    }
}

/// Tags without repetition, so that each sample has one place, and where each that was asked for stands among them.
struct Distinct {
    each: Vec<TagId>,
    asked: Vec<usize>,
}

impl Distinct {
    fn new(asked: &[TagId]) -> Distinct {
        let mut places = HashMap::new();
        let mut each = Vec::new();
        let place = |tag: &TagId| {
            *places.entry(*tag).or_insert_with(|| {
                each.push(*tag);
                each.len() - 1
            })
        };
        let asked = asked.iter().map(place).collect();
        Distinct { each, asked }
    }

    /// What was found for each, in the order asked for.
    fn all<T: Clone>(&self, found: impl Iterator<Item = T>) -> Vec<T> {
        let found: Vec<T> = found.collect();
        self.asked.iter().map(|place| found[*place].clone()).collect()
    }
}

pub(super) fn check_span(from: Timestamp, to: Timestamp) -> Result<(), HistoryError> {
    if from < to { Ok(()) } else { Err(HistoryError::EmptyPeriod) }
}

pub(super) fn within(rows: u64, max: u64) -> Result<(), HistoryError> {
    if rows <= max { Ok(()) } else { Err(HistoryError::TooManyRows { rows, max, asked: None }) }
}
