//! Control runs as they are stored.

use std::time::Duration;

use duckdb::{Appender, Row, params};
use jiff::{SignedDuration, Timestamp};

use super::{
    read::{check_span, maybe_time, shared, time},
    store::{Store, utc},
};
use crate::{
    history::HistoryError,
    plant::{
        control_run::{ControlRun, Figure, RunCause, RunState, STORED},
        keyword::Keyword,
        time::elapsed,
    },
    report::{
        Gap, batch,
        control_runs::{RUNS_MAX, RunPart},
    },
};

const COLUMNS: &str =
    "utc, controller, number, place, state, cause, detail, begin_seen, until_utc, sv_before, sv, pv, unit,
    decimals, band, settings, settings_changed, at_sv, steady, rise, overshoot, final_offset, iae, kwh, kwh_good, good";
/// The last record of each run.
const LATEST: &str = "rowid IN (SELECT max(rowid) FROM control_run GROUP BY controller, number)";
/// A time that is not known.
const UNKNOWN: f64 = -1.0;

impl Store {
    /// The runs of a span, of one controller or of all, newest first, at most so many.
    pub(super) fn control_runs(
        &self,
        controller: Option<&str>,
        (from, to, limit): (Timestamp, Timestamp, u64),
    ) -> Result<Vec<ControlRun>, HistoryError> {
        check_span(from, to)?;
        let sql = format!(
            "SELECT {COLUMNS} FROM control_run WHERE {LATEST} AND utc < ? AND until_utc >= ? AND controller = coalesce(?, controller)
             ORDER BY utc DESC, controller, number DESC LIMIT ?"
        );
        self.list(&sql, params![utc(to), utc(from), controller, limit], run)
    }

    /// The runs of a period for its report as they stood at its end, whenever it is made: newest first; of too many the span
    /// of those that are left out.
    pub(super) fn control_runs_of(
        &self,
        from: Timestamp,
        until: Timestamp,
    ) -> Result<(Vec<ControlRun>, Option<Gap>), HistoryError> {
        check_span(from, until)?;
        let sql = format!(
            "SELECT {COLUMNS} FROM control_run
             WHERE rowid IN (SELECT max(rowid) FROM control_run WHERE until_utc <= ?1 GROUP BY controller, number)
             AND utc < ?1 AND (until_utc >= ?2 OR state = ?3 AND until_utc >= ?4)
             ORDER BY utc DESC, controller, number DESC LIMIT ?5"
        );
        let at_work = from.saturating_sub(SignedDuration::try_from(STORED.1).unwrap_or_default()).unwrap_or(from);
        let values = params![utc(until), utc(from), RunState::Running.word(), utc(at_work), RUNS_MAX as u64 + 1];
        let mut runs = self.list(&sql, values, run)?;
        let left_out = runs.drain(RUNS_MAX.min(runs.len())..).next().map(|first| {
            let why = format!("only the latest {RUNS_MAX} control runs are listed");
            Gap { from: from.min(first.from), to: first.until, why }
        });
        for run in runs.iter_mut().filter(|run| run.is_running()) {
            match self.ended {
                // The next station will say so, too.
                Some(ended) if ended <= until => *run = run.interrupted().unwrap_or_else(|| run.clone()),
                // It was stored some minutes before.
                Some(_) | None => {
                    run.until = until;
                    run.energy = self.run_energy(run, (run.from, until))?.or(run.energy);
                }
            }
        }
        Ok((runs, left_out))
    }

    /// What lies in a period of the runs that began before it.
    pub(super) fn run_parts(&self, runs: &[ControlRun], from: Timestamp) -> Result<Vec<RunPart>, HistoryError> {
        let part = |run: &ControlRun| {
            let energy = self.run_energy(run, (from, run.until))?;
            Ok(RunPart { run: run.label(), lasted: elapsed(from, run.until), energy })
        };
        runs.iter().filter(|run| run.from < from).map(part).collect()
    }

    /// The energy of a run in a span, and the share of it in which it is known.
    fn run_energy(
        &self,
        run: &ControlRun,
        (from, until): (Timestamp, Timestamp),
    ) -> Result<Option<(f64, f64)>, HistoryError> {
        let rule = self.def.runs.iter().find(|rule| *self.def.device(rule.controller).name == *run.controller);
        let Some((tag, _)) = rule.and_then(|rule| rule.energy).filter(|_| from < until) else { return Ok(None) };
        let gathered = self.gather(&[tag], std::iter::empty(), (from, until))?;
        let figures = gathered.rows(&self.def, &[tag], &[]);
        Ok(figures.first().and_then(|figures| batch::energy(figures, elapsed(from, until))))
    }

    /// The latest run of each controller.
    pub(super) fn latest_runs(&self) -> Result<Vec<ControlRun>, HistoryError> {
        let sql = format!(
            "SELECT {COLUMNS} FROM control_run WHERE {LATEST}
             QUALIFY row_number() OVER (PARTITION BY controller ORDER BY number DESC) = 1"
        );
        self.list(&sql, &[], run)
    }
}

pub(super) fn append_run(to: &mut Appender, run: &ControlRun, epoch: u16) -> duckdb::Result<()> {
    let (kwh, kwh_good) = run.energy.unzip();
    let (begin, until) = (utc(run.from), utc(run.until));
    to.append_row(params![
        begin,
        run.controller,
        run.number,
        run.place,
        run.state.word(),
        run.cause.word(),
        run.detail,
        run.seen,
        until,
        run.sv_before,
        run.sv,
        run.pv,
        run.unit,
        run.decimals,
        run.band,
        run.settings,
        run.settings_changed,
        seconds(run.at_sv),
        seconds(run.steady),
        seconds(run.rise),
        run.overshoot,
        run.offset,
        run.iae,
        kwh,
        kwh_good,
        run.good,
        epoch
    ])
}

pub(super) fn seconds(figure: Figure) -> Option<f64> {
    match figure {
        Figure::NotYet => None,
        Figure::After(time) => Some(time.as_secs_f64()),
        Figure::Unknown => Some(UNKNOWN),
    }
}

fn figure(row: &Row, column: usize) -> duckdb::Result<Figure> {
    Ok(match row.get::<_, Option<f64>>(column)? {
        None => Figure::NotYet,
        Some(seconds) => Duration::try_from_secs_f64(seconds).map_or(Figure::Unknown, Figure::After),
    })
}

fn run(row: &Row) -> duckdb::Result<ControlRun> {
    let state: String = row.get(4)?;
    let cause: String = row.get(5)?;
    Ok(ControlRun {
        from: time(row)?,
        controller: shared(row, 1)?,
        number: row.get(2)?,
        place: row.get(3)?,
        state: RunState::from_word(&state).ok_or(duckdb::Error::InvalidQuery)?,
        cause: RunCause::from_word(&cause).ok_or(duckdb::Error::InvalidQuery)?,
        detail: shared(row, 6)?,
        seen: row.get(7)?,
        until: maybe_time(row, 8)?.ok_or(duckdb::Error::InvalidQuery)?,
        sv_before: row.get(9)?,
        sv: row.get(10)?,
        pv: row.get(11)?,
        unit: shared(row, 12)?,
        decimals: row.get(13)?,
        band: row.get(14)?,
        settings: shared(row, 15)?,
        settings_changed: row.get(16)?,
        at_sv: figure(row, 17)?,
        steady: figure(row, 18)?,
        rise: figure(row, 19)?,
        overshoot: row.get(20)?,
        offset: row.get(21)?,
        iae: row.get(22)?,
        energy: row.get::<_, Option<f64>>(23)?.zip(row.get(24)?),
        good: row.get(25)?,
    })
}
