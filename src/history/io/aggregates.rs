//! Curves and figures over any span: aggregates where closed hours keep them, samples elsewhere.

use std::{collections::BTreeSet, ops::Range};

use duckdb::{
    arrow::{
        array::{Array, AsArray, StructArray},
        datatypes::{Float64Type, TimestampMicrosecondType, UInt16Type, UInt32Type},
    },
    params,
};
use jiff::Timestamp;

use super::{
    archive::any_rests,
    read::SAMPLES_MAX,
    samples::Wanted,
    sql,
    store::{Store, engine, instant, utc},
};
use crate::{
    history::{
        ArchiveFile, HistoryError,
        recorded::{Epochs, Leg},
        tiers::{Aggregate, CurvePart, HOUR, Piece, Tier, floor, pieces},
    },
    plant::{def::TagId, exact::Exact},
    report::{
        Gap,
        step_series::{IntervalStats, StepSeries},
    },
};

/// What of aggregates is asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Detail {
    /// What a curve shows: neither the first value nor what was counted. The rest is not read: a third less to do.
    Curve,
    /// All of it.
    Whole,
}

impl Store {
    /// Hands over the good values of some different tags in a span, each tag's parts in order of time, with the place of
    /// the tag in `tags`; aggregates of `widest` at most. Returns what could not be read.
    pub(super) fn each_part(
        &self,
        tags: &[TagId],
        (from, to): (Timestamp, Timestamp),
        (widest, detail): (Tier, Detail),
        mut each: impl FnMut(usize, CurvePart),
    ) -> Result<Vec<Gap>, HistoryError> {
        let pieces = self.pieces(from.as_microsecond()..to.as_microsecond(), widest)?;
        // Before anything is read. Those of aggregates are few in any period.
        let of_samples = pieces.iter().filter(|piece| piece.tier == Tier::Raw);
        if let Some(longest) = of_samples.max_by_key(|piece| piece.to - piece.from)
            && let (Some(from), Some(until)) = (instant(longest.from), instant(longest.to))
        {
            self.bounded(tags.len(), from, until, to, SAMPLES_MAX)?;
        }
        let mut gaps = Vec::new();
        for piece in pieces {
            let (Some(from), Some(to)) = (instant(piece.from), instant(piece.to)) else { continue };
            gaps.extend(self.each_part_of(tags, (from, to), (piece.tier, detail), &mut each)?);
        }
        Ok(gaps)
    }

    /// What answers for a span, in pieces in order of time. A row of aggregates has no order in it: where the clock was set back
    /// the samples answer, for as long as they are kept.
    pub(super) fn pieces(&self, span: Range<i64>, widest: Tier) -> Result<Vec<Piece>, HistoryError> {
        let avoided = self.avoided.borrow().clone();
        let files = self.files(None)?;
        let end = files.iter().map(|file| file.to).max().unwrap_or(span.start).min(span.end);
        let deleted = self.deleted_until(Tier::Raw)?.map_or(i64::MIN, Timestamp::as_microsecond);
        let doubled = self.doubled()?.into_iter().map(|doubled| doubled.span).filter(|span| deleted <= span.start);
        let apart = doubled.map(|span| floor(span.start, HOUR)..floor(span.end + HOUR - 1, HOUR));
        let apart: Vec<Range<i64>> = apart.chain(self.late(deleted.max(span.start - HOUR)..end)?).collect();
        Ok(pieces(span.start, span.end, widest, &|tier| without(kept(&files, tier, &avoided), &apart)))
    }

    /// The hours of a span that came late, by an import or after a clock that was set back, and what was formed of them still
    /// lacks, each with the next one, which begins with its values.
    fn late(&self, span: Range<i64>) -> Result<Vec<Range<i64>>, HistoryError> {
        let (Some(since), Some(end)) = (instant(span.start), instant(span.end)) else { return Ok(Vec::new()) };
        let hours: Vec<i64> = self.list(sql::HOURS_IN_TABLE, params![utc(since), utc(end)], |row| row.get(0))?;
        Ok(hours.into_iter().map(|hour| hour * HOUR..(hour + 2) * HOUR).collect())
    }

    /// The same as [`Store::each_part`], all of one tier.
    pub(super) fn each_part_of(
        &self,
        tags: &[TagId],
        (from, to): (Timestamp, Timestamp),
        (tier, detail): (Tier, Detail),
        mut each: impl FnMut(usize, CurvePart),
    ) -> Result<Vec<Gap>, HistoryError> {
        if tier != Tier::Raw {
            self.each_aggregate(tags, (tier, detail), (from, to), &mut each)?;
            return Ok(Vec::new());
        }
        let finest = self.finest(from)?;
        if let Some(step) = finest.step() {
            // An edge within a minute or an hour of which no samples are kept has its share of it.
            let (begin, end) = (from.as_microsecond(), to.as_microsecond());
            let whole = (instant(floor(begin, step)), instant(floor(end + step - 1, step)));
            let (Some(whole_from), Some(whole_to)) = whole else { return Ok(Vec::new()) };
            self.each_aggregate(tags, (finest, detail), (whole_from, whole_to), &mut |place, part| {
                if let CurvePart::Aggregate(row) = part {
                    each(place, CurvePart::Aggregate(row.share(begin..end, step)));
                }
            })?;
            return Ok(Vec::new());
        }
        self.each_held(tags, (from, to), &Epochs::All, each)
    }

    /// The same of a leg. Of one setting of the clock among others only samples tell: where they are deleted nothing is known.
    pub(super) fn each_part_in(
        &self,
        tags: &[TagId],
        leg: &Leg,
        widest: Tier,
        each: impl FnMut(usize, CurvePart),
    ) -> Result<Vec<Gap>, HistoryError> {
        let (Some(from), Some(to)) = (instant(leg.from), instant(leg.to)) else { return Ok(Vec::new()) };
        match &leg.epochs {
            Epochs::All => self.each_part(tags, (from, to), (widest, Detail::Whole), each),
            _ if self.is_deleted(leg.from)? => Ok(Vec::new()),
            of @ (Epochs::One(_) | Epochs::Without(_)) => self.each_held(tags, (from, to), of, each),
        }
    }

    fn each_held(
        &self,
        tags: &[TagId],
        (from, to): (Timestamp, Timestamp),
        of: &Epochs,
        mut each: impl FnMut(usize, CurvePart),
    ) -> Result<Vec<Gap>, HistoryError> {
        let mut steps = vec![StepSeries::new(from, to); tags.len()];
        let gaps = self.each_sample_of(tags, (from, to), of, |place, sample| {
            if let Some(held) = steps[place].next(sample) {
                each(place, CurvePart::Held(held));
            }
        })?;
        for (place, steps) in steps.into_iter().enumerate() {
            if let Some(held) = steps.end() {
                each(place, CurvePart::Held(held));
            }
        }
        Ok(gaps)
    }

    fn each_aggregate(
        &self,
        tags: &[TagId],
        (tier, detail): (Tier, Detail),
        (from, to): (Timestamp, Timestamp),
        each: &mut impl FnMut(usize, CurvePart),
    ) -> Result<(), HistoryError> {
        let wanted = self.wanted(tags);
        let files = self.files(Some((tier, from.as_microsecond()..to.as_microsecond())))?;
        let read = self.read_aggregates(&files, (&wanted, detail), (from, to), each);
        if let Err(error) = &read
            && error.is_damage_of_file()
        {
            self.avoid_damaged(&files, (&wanted, detail), (from, to))?;
            // The query is answered once more, from what lies beneath.
            self.changed.set(true);
        }
        read
    }

    /// Finds the files that cannot be read: the engine need not say which of several it was.
    fn avoid_damaged(
        &self,
        files: &[ArchiveFile],
        wanted: (&Wanted, Detail),
        span: (Timestamp, Timestamp),
    ) -> Result<(), HistoryError> {
        for file in files {
            if let Err(error) = self.read_aggregates(std::slice::from_ref(file), wanted, span, &mut |_, _| {})
                && error.is_damage_of_file()
                && self.is_known(file)?
            {
                tracing::error!(?error, path = file.path, "a file of the archive cannot be read");
                self.unreadable.replace(Some(format!("{} cannot be read: {}", file.path, error.words())));
                self.avoided.borrow_mut().insert(file.path.clone());
            }
        }
        Ok(())
    }

    /// In one statement: one for each file took a quarter longer (measured).
    fn read_aggregates(
        &self,
        files: &[ArchiveFile],
        (wanted, detail): (&Wanted, Detail),
        (from, to): (Timestamp, Timestamp),
        each: &mut impl FnMut(usize, CurvePart),
    ) -> Result<(), HistoryError> {
        if files.is_empty() {
            return Ok(());
        }
        let rests = any_rests(files);
        let sql = sql::aggregates(&self.parquet(files, rests), &wanted.tags, rests, detail == Detail::Whole);
        let mut statement = self.db.prepare(&sql).map_err(engine)?;
        // By `step`, see `samples`.
        let _ = statement.stream_arrow(params![utc(from), utc(to)]).map_err(engine)?;
        while let Some(batch) = statement.step().map_err(engine)? {
            let handed = hand_over(&batch, wanted, each);
            handed.ok_or_else(|| HistoryError::Engine("unexpected columns of aggregates".into()))?;
        }
        Ok(())
    }
}

/// The spans that the files of a tier cover, sorted; without those that could not be read.
fn kept(files: &[ArchiveFile], tier: Tier, avoided: &BTreeSet<String>) -> Vec<Range<i64>> {
    let files = files.iter().filter(|file| file.tier == tier && !avoided.contains(&file.path));
    let mut spans: Vec<Range<i64>> = Vec::new();
    for file in files {
        match spans.last_mut().filter(|last| file.from <= last.end) {
            Some(last) => last.end = last.end.max(file.to),
            None => spans.push(file.from..file.to),
        }
    }
    spans
}

/// Spans without what lies in others, in order.
fn without(mut spans: Vec<Range<i64>>, apart: &[Range<i64>]) -> Vec<Range<i64>> {
    for apart in apart {
        let cut = |span: Range<i64>| {
            let parts = [span.start..span.end.min(apart.start), span.start.max(apart.end)..span.end];
            parts.into_iter().filter(|part| part.start < part.end)
        };
        spans = spans.into_iter().flat_map(cut).collect();
    }
    spans
}

/// Hands over the rows of a batch; `None` if its columns are not those of aggregates.
fn hand_over(batch: &StructArray, wanted: &Wanted, each: &mut impl FnMut(usize, CurvePart)) -> Option<()> {
    let [utc, tags, min, max, mean, first, last, gain, good, samples, rests @ ..] = batch.columns() else {
        return None;
    };
    let micros = utc.as_primitive_opt::<TimestampMicrosecondType>()?.values();
    let tags = tags.as_primitive_opt::<UInt16Type>()?.values();
    let mut numbers = Vec::new();
    for column in [min, max, mean, first, last, gain] {
        numbers.push(column.as_primitive_opt::<Float64Type>()?.values());
    }
    let [min, max, mean, first, last, gain] = numbers[..] else { return None };
    // Of min, max, first, last and gain.
    let rests: Vec<_> = rests.iter().map(|rest| rest.as_primitive_opt::<Float64Type>()).collect::<Option<_>>()?;
    let good = good.as_primitive_opt::<UInt32Type>()?.values();
    let samples = samples.as_primitive_opt::<UInt32Type>()?.values();
    for (row, tag) in tags.iter().enumerate() {
        let Some(place) = wanted.place(*tag) else { continue };
        let seconds = f64::from(good[row]) / 1_000.0;
        let rest = |place: usize| rests.get(place).filter(|rests| rests.is_valid(row)).map(|rests| rests.value(row));
        let exact = |numbers: &[f64], place: usize| Exact::of_parts(numbers[row], rest(place));
        let (min, max, last) = (exact(min, 0), exact(max, 1), exact(last, 3));
        let stats = IntervalStats { min, max, mean: mean[row], last, seconds };
        let (first, gain) = (exact(first, 2), exact(gain, 4));
        let aggregate = Aggregate { at: micros[row], stats, first, gain, samples: samples[row] };
        each(place, CurvePart::Aggregate(aggregate));
    }
    Some(())
}
