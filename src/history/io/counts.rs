//! What counters counted in a span, and how often what is on or off was switched on, by readings and by what is kept of them.
//!
//! ```text
//!   a week before          the span
//!   ├──────────── hours ┼──┼─────── hours ──────┼── samples ──┤
//!     how fast it counts  what it showed last   │
//!                                     └─ samples of an hour that did not only count up
//! ```

use std::ops::Range;

use duckdb::params;
use jiff::Timestamp;

use super::{
    aggregates::Detail,
    read::SAMPLES_MAX,
    sql,
    store::{Store, instant, utc},
    stored::Stored,
};
use crate::{
    history::{
        HistoryError,
        legs::clip,
        recorded::{self, Epochs, Leg},
        tiers::{Aggregate, CurvePart, HOUR, Piece, Tier, floor, rise},
    },
    plant::{
        counter::{Counter, CounterEvent, CounterRule, CounterStep, Reading, pace},
        def::TagId,
        exact::Exact,
        record::ActionRecord,
        recorded_action::RecordedAction,
    },
};

/// How far back the last value of a counter is looked for that was not read for a week.
const LATEST: i64 = 400 * 24 * HOUR;
/// Samples before a span that are read without aggregates at most.
const SAMPLES_BEFORE: i64 = 24 * HOUR;
/// What was read in the hours before a span is read as the span is.
const CLOSELY: i64 = 2 * HOUR;

/// How a tag counts.
#[derive(Debug, Clone)]
pub(super) enum Counts {
    /// A counter.
    Counter(Box<Counter>),
    /// On or off: what counts is that it is switched on. Its last value.
    Starts(Option<Exact>),
}

/// What a tag counted in a span.
#[derive(Debug, Clone)]
pub(super) struct CountedTag {
    counts: Counts,
    /// What is read outside of it, where the clock was set back, is counted there.
    span: Range<i64>,
    /// In the span.
    pub gain: Exact,
    /// What was not plain counting, by the time when that was known; of a correction with who made it, and why.
    pub steps: Vec<(CounterStep, String)>,
}

impl CountedTag {
    pub fn counter(rule: CounterRule) -> CountedTag {
        CountedTag::new(Counts::Counter(Box::new(Counter::new(rule))))
    }

    pub fn starts() -> CountedTag {
        CountedTag::new(Counts::Starts(None))
    }

    fn new(counts: Counts) -> CountedTag {
        CountedTag { counts, span: i64::MIN..i64::MAX, gain: Exact::default(), steps: Vec::new() }
    }

    /// What it showed last says nothing of what comes now.
    fn forget(&mut self) {
        match &mut self.counts {
            Counts::Counter(counter) => counter.forget(),
            Counts::Starts(last) => *last = None,
        }
    }

    /// The span begins: what was counted before is not in it.
    fn begin(&mut self) {
        (self.gain, self.steps) = (Exact::default(), Vec::new());
    }

    /// Books what was counted at an instant.
    fn book(&mut self, at: i64, gain: Exact, steps: impl IntoIterator<Item = CounterStep>) {
        if self.span.contains(&at) {
            self.gain = self.gain + gain;
            self.steps.extend(steps.into_iter().map(unsaid));
        }
    }

    fn is_counter(&self) -> bool {
        matches!(self.counts, Counts::Counter(_))
    }

    fn is_known(&self) -> bool {
        match &self.counts {
            Counts::Counter(counter) => counter.is_known(),
            Counts::Starts(last) => last.is_some(),
        }
    }

    /// A user's correction.
    fn correct(&mut self, correction: &ActionRecord, amount: Exact) {
        let (event, none) = (CounterEvent::Corrected, Exact::default());
        let step = CounterStep { at: correction.at, event, old: none, new: none, counted: amount };
        let reason = correction.note.as_deref().unwrap_or_default();
        self.gain = self.gain + amount;
        self.steps.push((step, format!("{}: {reason}", correction.by)));
    }

    /// The span is over.
    fn end(&mut self) {
        if let Counts::Counter(counter) = &self.counts {
            self.steps.extend(counter.held().map(unsaid));
        }
    }

    fn read(&mut self, value: Exact, at: Timestamp, until: Timestamp) {
        let (gain, step) = match &mut self.counts {
            Counts::Counter(counter) => {
                let counted = counter.read(Reading { value, at, until });
                (counted.gain, counted.step)
            }
            Counts::Starts(last) => (last.replace(value).map_or(Exact::default(), |last| rise(last, value)), None),
        };
        self.book(at.as_microsecond(), gain, step);
    }

    /// A row of a tier; `false` where its readings are needed.
    fn read_row(&mut self, row: &Aggregate, step: i64) -> bool {
        let gain = match &mut self.counts {
            // How long ago it was read last is known of a whole row only.
            Counts::Counter(_) if !row.is_whole(step) => None,
            Counts::Counter(counter) => counter.read_plain(&row.summary()),
            Counts::Starts(last) => {
                let first = last.replace(row.stats.last).map_or(Exact::default(), |last| rise(last, row.first));
                Some(first + row.gain)
            }
        };
        self.book(row.at, gain.unwrap_or_default(), None);
        gain.is_some()
    }

    /// A row of which no readings are kept.
    fn read_kept(&mut self, row: &Aggregate) {
        if let Counts::Counter(counter) = &mut self.counts {
            let (gain, steps) = counter.read_rows(&row.summary());
            self.book(row.at, gain, steps);
        }
    }

    fn skim(&mut self, row: &Aggregate) {
        match &mut self.counts {
            Counts::Counter(counter) => counter.skim(&row.summary()),
            Counts::Starts(last) => *last = Some(row.stats.last),
        }
    }
}

fn is_in(spans: &[Range<i64>], row: Range<i64>) -> bool {
    spans.iter().any(|span| span.start < row.end && row.start < span.end)
}

fn unsaid(step: CounterStep) -> (CounterStep, String) {
    (step, String::new())
}

impl Store {
    /// Counts in what lies of legs in a period, each tag from what it showed before it.
    pub(super) fn count(
        &self,
        mut tags: Vec<(TagId, CountedTag)>,
        legs: &[Leg],
        period: &Range<i64>,
    ) -> Result<Vec<(TagId, CountedTag)>, HistoryError> {
        let within = clip(legs, period);
        // What lies between two legs in the period was counted in another one.
        let legs = if let [Leg { epochs: Epochs::All, .. }] = legs { within.as_slice() } else { legs };
        let Some(first) = legs.first() else { return Ok(tags) };
        // Of a time to which the clock came back all is read: each epoch goes on from what the one before it ended with.
        let doubled = self.doubled()?;
        let around = |at: i64| doubled.iter().map(|of| of.span.clone()).find(|span| span.start <= at && at < span.end);
        let begin = around(first.from).map_or(first.from, |around| around.start);
        let week = floor(begin - pace::HOURS * HOUR, HOUR);
        self.count_before(&mut tags, week, begin)?;
        let (known, mut unknown): (Vec<_>, Vec<_>) = tags.into_iter().partition(|(_, tag)| tag.is_known());
        tags = known;
        if !unknown.is_empty() {
            self.count_before(&mut unknown, floor(begin - LATEST, HOUR), week)?;
            tags.append(&mut unknown);
        }
        if let Some(around) = around(first.from).filter(|_| first.epochs != Epochs::All) {
            // What other clocks showed before, in the same time.
            let before = recorded::legs(&doubled, around.start, around.end);
            let before = before.into_iter().take_while(|leg| leg.epochs != first.epochs);
            let own = Leg { from: around.start, to: first.from, ..first.clone() };
            if self.is_deleted(around.start)? {
                tags.iter_mut().for_each(|(_, tag)| tag.forget());
            }
            for leg in before.chain([own]) {
                self.count_leg(&mut tags, &leg)?;
            }
        }
        tags.iter_mut().for_each(|(_, tag)| tag.begin());
        for leg in legs {
            tags.iter_mut().for_each(|(_, tag)| tag.span = leg.from.max(period.start)..leg.to.min(period.end));
            match leg.epochs {
                Epochs::All => {
                    let start = around(leg.from).map_or(leg.from, |around| around.start);
                    let end = around(leg.to).filter(|around| around.start < leg.to).map_or(leg.to, |around| around.end);
                    for piece in self.pieces(start..end, Tier::Hour)? {
                        self.count_piece(&mut tags, piece, i64::MIN)?;
                    }
                }
                Epochs::One(_) | Epochs::Without(_) => self.count_leg(&mut tags, leg)?,
            }
        }
        tags.iter_mut().for_each(|(_, tag)| tag.end());
        for leg in &within {
            self.correct(&mut tags, leg)?;
        }
        Ok(tags)
    }

    /// The times that came twice and of which no samples are kept any more: their minutes and hours hold both, in no order, and
    /// would look like a counter that jumps. It goes on behind them.
    fn mixed(&self) -> Result<Vec<Range<i64>>, HistoryError> {
        let deleted = self.deleted_until(Tier::Raw)?.map_or(i64::MIN, Timestamp::as_microsecond);
        Ok(self.doubled()?.into_iter().map(|doubled| doubled.span).filter(|span| span.start < deleted).collect())
    }

    /// Counts what one setting of the clock stored in a time that others stored in, too.
    fn count_leg(&self, tags: &mut [(TagId, CountedTag)], leg: &Leg) -> Result<(), HistoryError> {
        let ids: Vec<TagId> = tags.iter().map(|(id, _)| *id).collect();
        self.each_part_in(&ids, leg, Tier::Raw, |place, part| {
            if let CurvePart::Held(held) = part {
                tags[place].1.read(held.value, held.from, held.to);
            }
        })?;
        Ok(())
    }

    /// Applies the corrections of users that were entered in a leg.
    fn correct(&self, tags: &mut [(TagId, CountedTag)], leg: &Leg) -> Result<(), HistoryError> {
        let (Some(from), Some(to)) = (instant(leg.from), instant(leg.to)) else { return Ok(()) };
        let sql = sql::corrections(&leg.epochs.condition());
        for correction in
            self.list(&sql, params![RecordedAction::CorrectCounter.word(), utc(from), utc(to)], ActionRecord::read)?
        {
            let amount = correction.new.as_deref().and_then(|new| new.split(' ').next()?.parse().ok());
            let tag = tags.iter_mut().find(|(id, _)| *self.def.tag(*id).name == *correction.target);
            if let (Some((_, tag)), Some(amount)) = (tag, amount) {
                tag.correct(&correction, amount);
            }
        }
        Ok(())
    }

    /// Finds what tags show at the end of a span.
    fn count_before(&self, tags: &mut [(TagId, CountedTag)], from: i64, to: i64) -> Result<(), HistoryError> {
        for mut piece in self.pieces(from..to, Tier::Hour)? {
            if piece.tier == Tier::Raw
                && SAMPLES_BEFORE < piece.to - piece.from
                && !self.is_bounded(tags.len(), piece)?
            {
                piece.from = piece.to - SAMPLES_BEFORE;
            }
            self.count_piece(tags, piece, to - CLOSELY)?;
        }
        Ok(())
    }

    fn is_bounded(&self, tags: usize, piece: Piece) -> Result<bool, HistoryError> {
        let (Some(from), Some(to)) = (instant(piece.from), instant(piece.to)) else { return Ok(true) };
        match self.bounded(tags, from, to, to, SAMPLES_MAX) {
            Ok(()) => Ok(true),
            Err(HistoryError::TooManyRows { .. }) => Ok(false),
            Err(error) => Err(error),
        }
    }

    /// Counts in a piece. Of what lies before `closely` only the last rows of a tag are read closely, in which may lie what
    /// is not decided at its end.
    fn count_piece(&self, tags: &mut [(TagId, CountedTag)], piece: Piece, closely: i64) -> Result<(), HistoryError> {
        let (Some(from), Some(to)) = (instant(piece.from), instant(piece.to)) else { return Ok(()) };
        let ids: Vec<TagId> = tags.iter().map(|(id, _)| *id).collect();
        let finest = if piece.tier == Tier::Raw { self.finest(from)? } else { piece.tier };
        if piece.tier != finest {
            return self.count_edge(tags, piece, finest);
        }
        let Some(step) = piece.tier.step() else {
            self.each_part_of(&ids, (from, to), (Tier::Raw, Detail::Whole), |place, part| {
                if let CurvePart::Held(held) = part {
                    tags[place].1.read(held.value, held.from, held.to);
                }
            })?;
            return Ok(());
        };
        let mut rows: Vec<Vec<Aggregate>> = vec![Vec::new(); tags.len()];
        let mixed = self.mixed()?;
        self.each_part_of(&ids, (from, to), (piece.tier, Detail::Whole), |place, part| {
            if let CurvePart::Aggregate(row) = part
                && !(tags[place].1.is_counter() && is_in(&mixed, row.at..row.at + step))
            {
                rows[place].push(row);
            }
        })?;
        for ((id, tag), rows) in tags.iter_mut().zip(rows) {
            let near = rows.iter().position(|row| closely <= row.at).unwrap_or(rows.len());
            let skimmed = near.min(rows.len().saturating_sub(2));
            rows[..skimmed].iter().for_each(|row| tag.skim(row));
            self.count_each(*id, tag, &rows[skimmed..], step)?;
        }
        Ok(())
    }

    /// Counts at an edge within a minute or an hour of which no samples are kept: it counts whole where it begins.
    fn count_edge(&self, tags: &mut [(TagId, CountedTag)], piece: Piece, tier: Tier) -> Result<(), HistoryError> {
        let Some(step) = tier.step() else { return Ok(()) };
        let ids: Vec<TagId> = tags.iter().map(|(id, _)| *id).collect();
        let first = floor(piece.from + step - 1, step);
        let (Some(from), Some(to)) = (instant(first), instant(floor(piece.to + step - 1, step))) else { return Ok(()) };
        if from < to {
            let mixed = self.mixed()?;
            self.each_part_of(&ids, (from, to), (tier, Detail::Whole), |place, part| {
                if let CurvePart::Aggregate(row) = part
                    && !(tags[place].1.is_counter() && is_in(&mixed, row.at..row.at + step))
                    && !tags[place].1.read_row(&row, step)
                {
                    tags[place].1.read_kept(&row);
                }
            })?;
        }
        Ok(())
    }

    fn count_each(&self, id: TagId, tag: &mut CountedTag, rows: &[Aggregate], step: i64) -> Result<(), HistoryError> {
        let mut rows = rows.iter().peekable();
        while let Some(row) = rows.next() {
            if tag.read_row(row, step) {
                continue;
            }
            // What follows at once and did not count plainly either is read with it.
            let mut span = row.at..row.at + step;
            let mut together = vec![*row];
            while let Some(next) = rows.next_if(|next| next.at == span.end && !next.only_rises(step)) {
                span.end = next.at + step;
                together.push(*next);
            }
            self.count_closely(id, tag, span, &together, step)?;
        }
        Ok(())
    }

    /// Counts by the samples of a span, or by minutes where these are not kept.
    fn count_closely(
        &self,
        id: TagId,
        tag: &mut CountedTag,
        span: Range<i64>,
        rows: &[Aggregate],
        step: i64,
    ) -> Result<(), HistoryError> {
        let (Some(from), Some(to)) = (instant(span.start), instant(span.end)) else { return Ok(()) };
        if !self.is_deleted(span.start)? {
            self.each_part_of(&[id], (from, to), (Tier::Raw, Detail::Whole), |_, part| {
                if let CurvePart::Held(held) = part {
                    tag.read(held.value, held.from, held.to);
                }
            })?;
            return Ok(());
        }
        let mut kept = Vec::new();
        if step == HOUR {
            self.each_part_of(&[id], (from, to), (Tier::Minute, Detail::Whole), |_, part| {
                if let CurvePart::Aggregate(minute) = part {
                    kept.push(minute);
                }
            })?;
        }
        let rows = if kept.is_empty() { rows } else { kept.as_slice() };
        rows.iter().for_each(|row| tag.read_kept(row));
        Ok(())
    }
}
