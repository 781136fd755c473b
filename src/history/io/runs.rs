//! Control runs as they are stored.

use std::ops::Range;

use duckdb::params;
use jiff::{SignedDuration, Timestamp};

use super::{
    read::check_span,
    store::{Store, instant, utc},
    stored::Stored,
};
use crate::{
    history::{
        HistoryError,
        legs::{Position, back, between, clip, end_of_period, joined, time, widened},
        recorded::{Doubled, Leg, micros},
    },
    plant::control_run::{ControlRun, RunState, STORED},
    report::{
        Gap, batch,
        control_runs::{RUNS_MAX, RunPart},
    },
};

/// The last record of each run.
const LATEST: &str = "rowid IN (SELECT max(rowid) FROM control_run GROUP BY controller, number)";
/// Runs of a period, what lies in it of those that do not lie in it as a whole, and the span of those that are left out.
type RunsOfPeriod = (Vec<ControlRun>, Vec<RunPart>, Option<Gap>);

impl Store {
    /// The runs of a span, of one controller or of all, newest first, up to a limit.
    pub(super) fn control_runs(
        &self,
        controller: Option<&str>,
        (from, to, limit): (Timestamp, Timestamp, u64),
    ) -> Result<Vec<ControlRun>, HistoryError> {
        check_span(from, to)?;
        let sql = format!(
            "SELECT {} FROM control_run WHERE {LATEST} AND utc < ? AND until_utc >= ? AND controller = coalesce(?, controller)
             ORDER BY utc DESC, controller, number DESC LIMIT ?",
            ControlRun::columns()
        );
        self.list(&sql, params![utc(to), utc(from), controller, limit], ControlRun::read)
    }

    /// The runs of a period for its report as they stood at its end, whenever it is made: newest first; of too many the span
    /// of those that are left out. With what lies in the period of those that do not lie in it as a whole.
    pub(super) fn control_runs_of(&self, from: Timestamp, until: Timestamp) -> Result<RunsOfPeriod, HistoryError> {
        check_span(from, until)?;
        let sql = format!(
            "SELECT {}, epoch FROM control_run
             WHERE rowid IN (SELECT max(rowid) FROM control_run
                WHERE until_utc <= ?1 OR epoch < ?7 AND until_utc < ?6 GROUP BY controller, number)
             AND utc < ?6 AND (until_utc >= ?2 OR state = ?3 AND until_utc >= ?4)
             ORDER BY utc DESC, controller, number DESC LIMIT ?5",
            ControlRun::columns()
        );
        let doubled = self.doubled()?;
        let period = from.as_microsecond()..until.as_microsecond();
        let (asked, now) = (widened(&doubled, period.clone()), end_of_period(&doubled, period.end));
        let (begin, end) = (instant(asked.start).unwrap_or(from), instant(asked.end).unwrap_or(until));
        let at_work = begin.saturating_sub(SignedDuration::try_from(STORED.1).unwrap_or_default()).unwrap_or(begin);
        let most = RUNS_MAX as u64 + 1;
        let values = params![utc(until), utc(begin), RunState::Running.word(), utc(at_work), most, utc(end), now.0];
        let mut runs = self.list(&sql, values, ControlRun::read_dated)?;
        let left_out = runs.drain(RUNS_MAX.min(runs.len())..).next().map(|(_, first)| {
            let why = format!("only the latest {RUNS_MAX} control runs are listed");
            Gap { from: from.min(first.from), to: first.until, why }
        });
        let (mut found, mut parts) = (Vec::new(), Vec::new());
        for (epoch, run) in runs {
            let (run, legs) = self.as_of(run, epoch, &doubled, now)?;
            let within = clip(&legs, &period);
            if !legs.is_empty() && within.is_empty() {
                continue;
            }
            if within != legs {
                let energy = self.run_energy(&run, &legs, &period)?;
                parts.push(RunPart { run: run.label(), lasted: time(&within), energy });
            }
            found.push(run);
        }
        Ok((found, parts, left_out))
    }

    /// A run as it was at an instant, and where it lies. It lasted as long as it says, whatever clocks showed since it began.
    fn as_of(
        &self,
        mut run: ControlRun,
        epoch: u16,
        doubled: &[Doubled],
        now: Position,
    ) -> Result<(ControlRun, Vec<Leg>), HistoryError> {
        let stored = (epoch, run.until.as_microsecond());
        let lasted = i64::try_from(run.lasted().as_micros()).unwrap_or(i64::MAX);
        let mut legs = back(doubled, stored, lasted);
        let Some(until) = instant(now.1).filter(|_| run.is_running()) else { return Ok((run, legs)) };
        match self.ended {
            // The next station will say so, too.
            Some(ended) if ended <= until => run = run.interrupted().unwrap_or(run),
            // It was stored some minutes before.
            Some(_) | None => {
                legs.extend(between(doubled, stored, now));
                legs = joined(legs);
                let lasted = SignedDuration::from_micros(micros(&legs));
                (run.from, run.until) = (until.saturating_sub(lasted).unwrap_or(run.from), until);
                run.energy = self.run_energy(&run, &legs, &(i64::MIN..i64::MAX))?.or(run.energy);
            }
        }
        Ok((run, legs))
    }

    /// The energy of what lies of a run in a period, and the share of that time in which it is known.
    fn run_energy(
        &self,
        run: &ControlRun,
        legs: &[Leg],
        period: &Range<i64>,
    ) -> Result<Option<(f64, f64)>, HistoryError> {
        let rule = self.def.runs.iter().find(|rule| *self.def.device(rule.controller).name == *run.controller);
        let energy = rule.and_then(|rule| rule.energy).filter(|_| !clip(legs, period).is_empty());
        let Some((tag, _)) = energy else { return Ok(None) };
        let gathered = self.gather_of(&[tag], std::iter::empty(), legs, period)?;
        let figures = gathered.rows(&self.def, &[tag], &[]);
        Ok(figures.first().and_then(|figures| batch::energy(figures, gathered.time)))
    }

    /// The latest run of each controller.
    pub(super) fn latest_runs(&self) -> Result<Vec<ControlRun>, HistoryError> {
        let sql = format!(
            "SELECT {} FROM control_run WHERE {LATEST}
             QUALIFY row_number() OVER (PARTITION BY controller ORDER BY number DESC) = 1",
            ControlRun::columns()
        );
        self.list(&sql, &[], ControlRun::read)
    }
}
