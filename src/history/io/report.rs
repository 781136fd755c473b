//! The report of a period: figures from hours, minutes and samples, of which the units and decimals that a device chooses come
//! too, and the record from the samples of its controller.

use std::{
    collections::{HashMap, HashSet},
    sync::Arc,
    time::Duration,
};

use duckdb::params;
use jiff::Timestamp;

use super::{
    counts::CountedTag,
    read::{ROWS_MAX, SAMPLES_MAX, action, chain_hash, check_span},
    sql,
    store::{Store, utc},
};
use crate::{
    history::{
        HistoryError,
        series::Span,
        tiers::{Aggregate, CurvePart, Tier},
    },
    plant::{
        PlantDef,
        counter::{self, CounterRule, CounterStep},
        def::{Section, TagId, TrendGroup},
        exact::Exact,
        record::AlarmRecord,
        report::PeriodKind,
        tag::DataType,
        time::elapsed,
    },
    report::{
        Compared, Gap, Outage, Period, RecordRow, RunFigures, ShiftReport, TagFigures, calendar,
        chart::{Chart, ChartCurve},
        counters::CounterRow,
        figures::{self, Figures, TagDescription},
        step_series::ValuesAt,
    },
};

/// Charts of a report whose plant file names none.
const CHARTS: usize = 6;
/// Columns of a curve.
const COLUMNS: usize = 240;

/// What is gathered of one tag.
struct Gathered {
    figures: Option<Figures>,
    latest_good: Option<Exact>,
}

impl Gathered {
    fn add(&mut self, part: CurvePart) {
        let (first, stats) = match part {
            CurvePart::Held(held) => (held.value, held.into()),
            CurvePart::Aggregate(Aggregate { stats, first, .. }) => (first, stats),
        };
        if let Some(figures) = &mut self.figures {
            figures.add(first, stats);
        }
        self.latest_good = Some(stats.last);
    }
}

/// What is gathered of some tags over a span.
pub(super) struct GatheredTags {
    span: (Timestamp, Timestamp),
    of: HashMap<TagId, Gathered>,
    latest: HashMap<TagId, f64>,
    counted: HashMap<TagId, CountedTag>,
    pub unreadable: Vec<Gap>,
}

impl GatheredTags {
    /// The figures of some of them, each once. `events` are those of the span in order, after the raising events of the
    /// alarms that were active at its begin.
    pub(super) fn rows<'a>(
        &self,
        def: &PlantDef,
        tags: &[TagId],
        events: impl Iterator<Item = &'a AlarmRecord>,
    ) -> Vec<TagFigures> {
        let mut by_subject: HashMap<&str, Vec<&AlarmRecord>> = HashMap::new();
        events.for_each(|event| by_subject.entry(&event.subject).or_default().push(event));
        let (from, until) = self.span;
        let row = |tag: &TagId| {
            let label = TagDescription::new(def.tag(*tag), &self.latest);
            let events = by_subject.get(label.tag.as_str()).into_iter().flatten().copied();
            let in_alarm = figures::time_in_alarm(events, from, until);
            Some(self.of.get(tag)?.figures?.end(label, self.gain(*tag), in_alarm))
        };
        tags.iter().filter_map(row).collect()
    }

    /// The run hours of the actuators.
    fn runs(&self, def: &PlantDef) -> Vec<RunFigures> {
        let row = |tag: TagId| Some(self.of.get(&tag)?.figures?.runs(def.tag(tag).name.clone(), self.gain(tag)));
        outputs(def).filter_map(row).collect()
    }

    /// What counters did beside counting, in order of time.
    fn counters(&self, def: &PlantDef) -> Vec<CounterRow> {
        let rows = self.counted.iter().flat_map(|(tag, counted)| {
            let TagDescription { tag, unit, decimals, counts } = TagDescription::new(def.tag(*tag), &self.latest);
            let row = move |(step, note): &(CounterStep, String)| CounterRow {
                tag: tag.clone(),
                unit: unit.clone(),
                decimals,
                step: *step,
                note: note.clone(),
            };
            counted.steps.iter().filter(move |_| counts).map(row)
        });
        let mut rows: Vec<CounterRow> = rows.collect();
        rows.sort_by(|one, other| (one.step.at, &one.tag).cmp(&(other.step.at, &other.tag)));
        rows
    }

    fn gain(&self, tag: TagId) -> Exact {
        self.counted.get(&tag).map_or(Exact::default(), |counted| counted.gain)
    }
}

/// The controller of the record.
struct Recorded {
    name: String,
    sv: TagId,
    pv: TagId,
    instants: Arc<[Timestamp]>,
}

impl Store {
    /// The report of a period, up to `now`.
    pub fn report(&self, period: &Period, now: Timestamp) -> Result<ShiftReport, HistoryError> {
        let (from, until) = (period.from, period.to.min(now));
        check_span(from, until)?;
        let (def, reported) = (&*self.def, reported_tags(&self.def));
        let recorded = match period.name.kind() {
            // Its rows are seconds apart: too many to read for a week.
            Some(PeriodKind::Week | PeriodKind::Month) => None,
            Some(PeriodKind::Shift | PeriodKind::Day) | None => self.recorded((from, until), now)?,
        };
        let active = self.active_at(from)?;
        let alarms = self.events(from, until)?;
        let suppressed = figures::suppressed(&active, &self.suppressing_at(from)?, &alarms, from, until);
        let actions =
            self.whole_list(&sql::actions(sql::OLDEST), params![utc(from), utc(until), ROWS_MAX + 1], action)?;
        let audit = self.list(sql::LAST_ENTRY, params![utc(until)], |row| Ok(chain_hash(row.get(0)?, row.get(1)?)))?;
        let audit = audit.into_iter().flatten().next();
        let more = recorded.iter().flat_map(|recorded| [recorded.sv, recorded.pv]);
        let shown: Vec<TagId> = reported.iter().copied().chain(outputs(def)).collect();
        let gathered = self.gather(&shown, more, (from, until))?;
        let (record, record_of) = match recorded {
            Some(recorded) => {
                let rows = self.record(&recorded, (from, until))?;
                (rows, Some((recorded.name, TagDescription::new(def.tag(recorded.pv), &gathered.latest).unit)))
            }
            None => (Vec::new(), None),
        };
        let tags = gathered.rows(def, &reported, active.iter().chain(&alarms));
        let (counters, runs) = (gathered.counters(def), gathered.runs(def));
        let charts = self.charts((from, until), &gathered.latest)?;
        let (control_runs, left_out) = self.control_runs_of(from, until)?;
        let run_parts = self.run_parts(&control_runs, (from, until))?;
        let mut unreadable = gathered.unreadable;
        unreadable.extend(left_out);
        let compared = self.compared(&reported, period, until)?;
        let outages = self.outages((from, until), &active, &alarms)?;
        let alarm_metrics = self.alarm_metrics(from, until, now)?;
        let batches = match def.batches.as_slice() {
            [] => Vec::new(),
            [..] => self.batches_of(from, until)?,
        };
        let period = period.clone();
        Ok(ShiftReport {
            period,
            until,
            audit,
            unreadable,
            tags,
            compared,
            counters,
            runs,
            outages,
            charts,
            batches,
            control_runs,
            run_parts,
            suppressed,
            alarms,
            alarm_metrics,
            actions,
            record,
            record_of,
        })
    }

    /// The figures of the periods that a closed one is compared with, where anything of them is kept.
    fn compared(&self, tags: &[TagId], period: &Period, until: Timestamp) -> Result<Vec<Compared>, HistoryError> {
        let periods = if until < period.to { Vec::new() } else { calendar::comparable(&self.def, period) };
        let figures = |period: Period| {
            let gathered = self.gather(tags, std::iter::empty(), (period.from, period.to))?;
            Ok(Compared { tags: gathered.rows(&self.def, tags, std::iter::empty()), period })
        };
        let mut compared = periods.into_iter().map(figures).collect::<Result<Vec<_>, HistoryError>>()?;
        compared.retain(|compared| compared.tags.iter().any(|tag| 0.0 < tag.good));
        Ok(compared)
    }

    /// The curves of the trend groups that the plant file asks for, or of the first ones.
    fn charts(
        &self,
        (from, until): (Timestamp, Timestamp),
        latest: &HashMap<TagId, f64>,
    ) -> Result<Vec<Chart>, HistoryError> {
        let def = &*self.def;
        if !def.report.sections.contains(&Section::Curves) {
            return Ok(Vec::new());
        }
        let groups: Vec<&TrendGroup> = match def.report.curves.as_slice() {
            [] => def.trends.iter().take(CHARTS).collect(),
            places => places.iter().filter_map(|place| def.trends.get(*place)).collect(),
        };
        let chart = |group: &&TrendGroup| {
            let tags: Vec<TagId> =
                group.pens.iter().map(|pen| pen.tag).filter(|tag| def.tag(*tag).is_stored()).collect();
            let span = Span { from, to: until, until };
            let series = if tags.is_empty() { Vec::new() } else { self.curves(&tags, span, COLUMNS)? };
            let curves = series.into_iter().map(|series| {
                let label = TagDescription::new(def.tag(series.tag), latest);
                let (name, unit, decimals) = (label.tag, label.unit, label.decimals);
                ChartCurve {
                    name,
                    unit,
                    decimals,
                    from: series.from,
                    step: series.step.as_secs_f64(),
                    columns: series.buckets,
                }
            });
            Ok(Chart { title: group.name.clone(), from, to: until, curves: curves.collect() })
        };
        let mut charts = groups.iter().map(chart).collect::<Result<Vec<_>, HistoryError>>()?;
        charts.retain(|chart| !chart.is_empty());
        Ok(charts)
    }

    /// When devices did not answer, and the 10-minute windows in which nothing was stored.
    fn outages(
        &self,
        (from, until): (Timestamp, Timestamp),
        active: &[AlarmRecord],
        alarms: &[AlarmRecord],
    ) -> Result<Vec<Outage>, HistoryError> {
        let mut outages = figures::not_running(&self.watched(from, until)?, from, until);
        outages.extend(figures::not_responding(&self.def, active.iter().chain(alarms), from, until));
        outages.sort_by_key(|outage| outage.from);
        Ok(outages)
    }

    /// Gathers the figures of some tags over a span, and the latest good values of those that choose their units and
    /// decimals and of `more`.
    pub(super) fn gather(
        &self,
        shown: &[TagId],
        more: impl Iterator<Item = TagId>,
        (from, until): (Timestamp, Timestamp),
    ) -> Result<GatheredTags, HistoryError> {
        let tags = tags_to_read(&self.def, shown, more);
        let shown: HashSet<TagId> = shown.iter().copied().collect();
        let gather = |tag: &TagId| Gathered {
            figures: shown.contains(tag).then(|| Figures::new(from, until)),
            latest_good: None,
        };
        let mut gathered: Vec<Gathered> = tags.iter().map(gather).collect();
        let unreadable = self.each_part(&tags, (from, until), Tier::Hour, |place, part| gathered[place].add(part))?;
        let latest = tags
            .iter()
            .zip(&gathered)
            .filter_map(|(tag, gathered)| Some((*tag, gathered.latest_good?.near())))
            .collect();
        let counted = self.count(counting(&self.def, &shown, &latest), (from, until))?.into_iter().collect();
        let of = tags.into_iter().zip(gathered).collect();
        Ok(GatheredTags { span: (from, until), of, latest, counted, unreadable })
    }

    fn record(
        &self,
        recorded: &Recorded,
        (from, until): (Timestamp, Timestamp),
    ) -> Result<Vec<RecordRow>, HistoryError> {
        let Recorded { sv, pv, instants, .. } = recorded;
        let tags = if sv == pv { vec![*sv] } else { vec![*sv, *pv] };
        let mut values_at: Vec<ValuesAt> = tags.iter().map(|_| ValuesAt::new(instants.clone())).collect();
        self.each_sample(&tags, from, until, |place, sample| values_at[place].next(sample))?;
        let values_at: Vec<_> = values_at.into_iter().map(ValuesAt::end).collect();
        let [sv, pv] = [values_at.first(), values_at.last()].map(|values_at| values_at.map_or(&[][..], Vec::as_slice));
        Ok(figures::record(instants, sv, pv))
    }

    /// The controller of the record and the instants of its rows; an error if these, or its samples, are too many.
    fn recorded(
        &self,
        (from, until): (Timestamp, Timestamp),
        now: Timestamp,
    ) -> Result<Option<Recorded>, HistoryError> {
        let Some((device, interval)) = self.def.report.record else { return Ok(None) };
        let device = self.def.device(device);
        let Some(face) = &device.faceplate else { return Ok(None) };
        let rows = rows(from, until, interval);
        if ROWS_MAX < rows {
            return Err(HistoryError::TooManyRows { rows, max: ROWS_MAX, asked: Some(elapsed(from, until).as_secs()) });
        }
        let sv = face.sv_to_show();
        self.bounded(if sv == face.pv { 1 } else { 2 }, from, until, now, SAMPLES_MAX)?;
        let instants = figures::record_grid(interval, &self.def.time_zone, from, until).into();
        Ok(Some(Recorded { name: device.name.clone(), sv, pv: face.pv, instants }))
    }
}

/// The stored outputs of actuators that are on or off, and what else has its hours given; each once.
fn outputs(def: &PlantDef) -> impl Iterator<Item = TagId> {
    let outputs = def.logic.actuators.iter().map(|actuator| actuator.output);
    let outputs = outputs.filter(|tag| def.tag(*tag).point.kind == DataType::Bool);
    let asked = def.tags.iter().filter(|tag| tag.hours).map(|tag| tag.id);
    let mut seen = HashSet::new();
    outputs.chain(asked).filter(|tag| def.tag(*tag).is_stored()).filter(move |tag| seen.insert(*tag))
}

/// Those of some tags that count, and how.
fn counting(def: &PlantDef, tags: &HashSet<TagId>, latest: &HashMap<TagId, f64>) -> Vec<(TagId, CountedTag)> {
    let switched: HashSet<TagId> = outputs(def).collect();
    let of_tag = |tag: &TagId| {
        let of = def.tag(*tag);
        let rule = || CounterRule::of(of, of.scaling_decimals(|tag| latest.get(&tag).copied()));
        let counter = counter::may_count(of).then(|| CountedTag::counter(rule()));
        Some((*tag, counter.or_else(|| switched.contains(tag).then(CountedTag::starts))?))
    };
    tags.iter().filter_map(of_tag).collect()
}

fn rows(from: Timestamp, until: Timestamp, interval: Duration) -> u64 {
    let rows =
        until.duration_since(from).as_millis() / i128::try_from(interval.as_millis().max(1)).unwrap_or(i128::MAX);
    u64::try_from(rows).unwrap_or(u64::MAX)
}

/// The tags that the plant file asks for, or every stored tag with a unit; each once.
fn reported_tags(def: &PlantDef) -> Vec<TagId> {
    let mut tags = match def.report.tags.as_slice() {
        [] => def.tags.iter().filter(|tag| tag.is_stored() && !tag.unit.is_empty()).map(|tag| tag.id).collect(),
        tags => tags.to_vec(),
    };
    let mut seen = HashSet::new();
    tags.retain(|tag| seen.insert(*tag));
    tags
}

/// Some tags, those that choose their units and decimals, and `more`.
fn tags_to_read(def: &PlantDef, shown: &[TagId], more: impl Iterator<Item = TagId>) -> Vec<TagId> {
    let mut tags: Vec<TagId> = shown.iter().copied().chain(more).collect();
    let scaling_tags: Vec<TagId> = tags.iter().flat_map(|tag| figures::scaling_tags(def.tag(*tag))).collect();
    tags.extend(scaling_tags);
    tags.sort_unstable_by_key(|tag| tag.index());
    tags.dedup();
    tags
}
