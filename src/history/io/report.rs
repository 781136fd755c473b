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
    read::{ROWS_MAX, SAMPLES_MAX, check_span},
    sql,
    store::{Store, utc},
    stored::{Stored, chain_hash},
};
use crate::{
    history::{HistoryError, series::Span},
    plant::{
        PlantDef,
        def::{DeviceDef, Section, TagId, TrendGroup},
        record::ActionRecord,
        report::PeriodKind,
        tag::{Access, DataType, Poll, TagDef},
        time::elapsed,
    },
    report::{
        Compared, Outage, Period, RecordRow, ShiftReport, calendar,
        chart::{Chart, ChartCurve},
        figures::{self, EventLeg, TagDescription, Trace},
        step_series::ValuesAt,
    },
};

/// Charts of a report whose plant file names none.
const CHARTS: usize = 6;
/// Outages of devices that are traced to their samples, and by how many tags each.
const TRACED_MAX: usize = 100;
const TRACED_TAGS_MAX: usize = 8;
/// Columns of a curve.
const COLUMNS: usize = 240;

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
        let events = self.event_legs(from, until)?;
        let suppressed = figures::suppressed_in(&events);
        let actions = self.whole_list(
            &sql::actions(sql::OLDEST),
            params![utc(from), utc(until), ROWS_MAX + 1],
            ActionRecord::read,
        )?;
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
        let tags = gathered.rows(def, &reported, &events);
        let (counters, runs) = (gathered.counters(def), gathered.runs(def));
        let charts = self.charts((from, until), &gathered.latest)?;
        let (control_runs, run_parts, left_out) = self.control_runs_of(from, until)?;
        let mut unreadable = gathered.unreadable;
        unreadable.extend(left_out);
        let compared = self.compared(&reported, period, until)?;
        let outages = self.outages((from, until), &events)?;
        let coarse = self.coarse((from, until))?;
        let alarms = events.into_iter().flat_map(|leg| leg.events).collect();
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
            unstored: Some(0),
            unreadable,
            tags,
            compared,
            counters,
            runs,
            outages,
            coarse,
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
            Ok(Compared { tags: gathered.rows(&self.def, tags, &[]), period })
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

    /// When devices did not answer, and when no station recorded.
    fn outages(&self, (from, until): (Timestamp, Timestamp), events: &[EventLeg]) -> Result<Vec<Outage>, HistoryError> {
        let off = |(from, to, is_of_clock)| {
            let why = if is_of_clock { figures::CLOCK_SET_FORWARD } else { figures::NOT_RUNNING };
            Outage { from, to, what: None, why: why.to_owned() }
        };
        let mut outages: Vec<Outage> = self.pauses(from, until)?.into_iter().map(off).collect();
        let mut traced = 0;
        for leg in events {
            for outage in figures::not_responding(&self.def, leg.all(), leg.from, leg.until) {
                traced += 1;
                outages.push(if traced <= TRACED_MAX { self.traced(outage, leg.from)? } else { outage });
            }
        }
        outages.sort_by_key(|outage| outage.from);
        Ok(outages)
    }

    /// An outage as the samples of its device show it, where they are kept: since when it has no values, and whether its line was
    /// lost.
    fn traced(&self, outage: Outage, not_before: Timestamp) -> Result<Outage, HistoryError> {
        let named = |device: &&DeviceDef| Some(&device.name) == outage.what.as_ref();
        let Some(device) = self.def.devices.iter().find(named) else { return Ok(outage) };
        let is_read = |tag: &&TagDef| tag.is_stored() && tag.poll != Poll::Never && tag.access != Access::Write;
        let tags: Vec<TagId> =
            self.def.tags_of(device.id).filter(is_read).map(|tag| tag.id).take(TRACED_TAGS_MAX).collect();
        // Each tag has a row in every hour.
        let (Some(begin), Some(end)) = (
            outage.from.checked_sub(Duration::from_secs(3_600)).ok(),
            outage.from.checked_add(Duration::from_micros(1)).ok(),
        ) else {
            return Ok(outage);
        };
        let mut traces = vec![Trace::default(); tags.len()];
        self.each_sample(&tags, begin, end, |place, sample| traces[place].next(sample))?;
        Ok(outage.traced(&traces, not_before))
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
pub(super) fn outputs(def: &PlantDef) -> impl Iterator<Item = TagId> {
    let outputs = def.logic.actuators.iter().map(|actuator| actuator.output);
    let outputs = outputs.filter(|tag| def.tag(*tag).point.kind == DataType::Bool);
    let asked = def.tags.iter().filter(|tag| tag.hours).map(|tag| tag.id);
    let mut seen = HashSet::new();
    outputs.chain(asked).filter(|tag| def.tag(*tag).is_stored()).filter(move |tag| seen.insert(*tag))
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
