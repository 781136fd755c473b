//! The figures of a run at work: each value holds until the next one.

use std::time::Duration;

use jiff::Timestamp;

use super::{BAND, ControlRun, Figure, GAP_MAX, RunDef, View};
use crate::plant::{
    counter::{Counter, CounterRule, Reading},
    energy::Measures,
    exact::Exact,
    time::elapsed,
};

/// Rise time is measured between these shares of the way from PV to SV.
const RISE: [f64; 2] = [0.1, 0.9];

/// What the next value is added to.
#[derive(Debug, Clone)]
pub(super) struct Figures {
    /// The last update, and the error then; `None` where SV or PV was not good.
    last: Timestamp,
    error: Option<f64>,
    /// Time with SV and PV good.
    good: Duration,
    /// Since when they have not been.
    gap_from: Option<Timestamp>,
    /// Since when PV is seen at SV, and when it came there: unknown where that was in a gap.
    in_band: Option<(Timestamp, Figure)>,
    /// +1 where PV comes to SV from below, -1 from above; `None` while it has not been away from SV.
    toward: Option<f64>,
    /// When PV had done 10 % and 90 % of its way; `None` for a way that cannot be measured.
    rise: Option<[Figure; 2]>,
    energy: Meter,
}

/// Energy so far.
#[derive(Debug, Clone, Default)]
struct Meter {
    /// The last good value.
    last: Option<f64>,
    /// Of what counts.
    counter: Option<Counter>,
    /// It was good at the last update.
    known: bool,
    kwh: f64,
    good: Duration,
}

impl Figures {
    pub(super) fn new(at: Timestamp) -> Figures {
        Figures {
            last: at,
            error: None,
            good: Duration::ZERO,
            gap_from: Some(at),
            in_band: None,
            toward: None,
            rise: None,
            energy: Meter::default(),
        }
    }

    /// Time passes with what was known before.
    pub(super) fn pass(&mut self, run: &mut ControlRun, at: Timestamp) {
        let time = elapsed(self.last, at);
        if let Some(error) = self.error {
            self.good += time;
            run.iae += error.abs() * time.as_secs_f64() / 60.0;
        }
        (self.last, run.until) = (self.last.max(at), run.until.max(at));
        run.good = share(self.good, run.lasted());
    }

    /// What is known now; `target` is the setpoint where it is known.
    pub(super) fn update(&mut self, run: &mut ControlRun, def: &RunDef, target: Option<f64>, view: &View) {
        let time = elapsed(self.last, view.at);
        self.pass(run, view.at);
        if let Some((tag, measures)) = def.energy {
            if let Measures::Energy(kwh) = measures {
                let decimals = view.plant.tag(tag).scaling_decimals(|tag| view.good(tag));
                self.energy.count(view.good(tag), kwh, view.at, || CounterRule::of(view.plant.tag(tag), decimals));
            }
            self.energy.add(view.good(tag), measures, time);
            run.energy = self.energy.last.map(|_| (self.energy.kwh, share(self.energy.good, run.lasted())));
        }
        let pv = view.good(def.pv).filter(|_| target == Some(run.sv));
        self.error = pv.map(|pv| run.sv - pv);
        match pv {
            Some(pv) => {
                let gap = self.gap_from.take().is_some_and(|from| GAP_MAX < elapsed(from, view.at));
                self.on_value(run, def, pv, gap, view);
            }
            None => {
                let from = *self.gap_from.get_or_insert(view.at);
                if GAP_MAX < elapsed(from, view.at) {
                    (self.in_band, run.steady, run.offset) = (None, Figure::NotYet, None);
                }
            }
        }
    }

    /// PV is good; `gap` where it was not for so long that what happened meanwhile is not known.
    fn on_value(&mut self, run: &mut ControlRun, def: &RunDef, pv: f64, gap: bool, view: &View) {
        let error = run.sv - pv;
        run.offset = Some(error);
        if run.pv.is_none() {
            run.pv = Some(pv);
            run.band = def.band.unwrap_or_else(|| default_band(error, def, view));
            self.rise = (run.band < error.abs()).then_some([Figure::NotYet; 2]);
        }
        let now = if gap { Figure::Unknown } else { Figure::After(elapsed(run.from, view.at)) };
        let inside = error.abs() <= run.band;
        if self.toward.is_none() && !inside {
            // A run that began at SV counts from where PV left it.
            (self.toward, run.at_sv) = (Some(error.signum()), Figure::NotYet);
        }
        let beyond = self.toward.map_or(0.0, |toward| -error * toward);
        if run.at_sv == Figure::NotYet && (inside || 0.0 < beyond) {
            run.at_sv = now;
        }
        self.rise_to(run, pv, now);
        run.overshoot = Some(run.overshoot.unwrap_or_default().max(beyond));
        // In a gap it may have been anywhere, also at SV all the time: the end of the gap is not when it became steady.
        self.in_band = inside.then(|| self.in_band.filter(|_| !gap).unwrap_or((view.at, now)));
        run.steady = match self.in_band {
            Some((since, from)) if def.steady_for <= elapsed(since, view.at) => from,
            Some(_) | None => Figure::NotYet,
        };
    }

    fn rise_to(&mut self, run: &mut ControlRun, pv: f64, now: Figure) {
        let (Some(passed), Some(begin)) = (&mut self.rise, run.pv) else { return };
        let way = (pv - begin) / (run.sv - begin);
        for (passed, share) in passed.iter_mut().zip(RISE) {
            if *passed == Figure::NotYet && share <= way {
                *passed = now;
            }
        }
        run.rise = match passed {
            [_, Figure::NotYet] => Figure::NotYet,
            [Figure::After(from), Figure::After(to)] => Figure::After(to.saturating_sub(*from)),
            [_, Figure::After(_) | Figure::Unknown] => Figure::Unknown,
        };
    }
}

impl Meter {
    /// What a counter shows now; it counts on while it is not read.
    fn count(&mut self, now: Option<f64>, kwh: f64, at: Timestamp, rule: impl Fn() -> CounterRule) {
        let Some(value) = now.map(Exact::from) else { return };
        let counter = self.counter.get_or_insert_with(|| Counter::new(rule()));
        self.kwh += kwh * counter.read(Reading { value, at, until: at }).gain.near();
    }

    fn add(&mut self, now: Option<f64>, measures: Measures, time: Duration) {
        if let (Measures::Power(kw), Some(before), true) = (measures, self.last, self.known) {
            self.kwh += before * kw * time.as_secs_f64() / 3_600.0;
        }
        if self.known {
            self.good += time;
        }
        (self.last, self.known) = (now.or(self.last), now.is_some());
    }
}

fn default_band(error: f64, def: &RunDef, view: &View) -> f64 {
    let limits = view.plant.tag(def.pv).limits(|tag| view.good(tag).map(Exact::from)).ok();
    let range = limits.and_then(|(min, max)| Some((max? - min?).near()));
    (error.abs() * BAND.0).max(range.unwrap_or_default() * BAND.1)
}

fn share(part: Duration, whole: Duration) -> f64 {
    if whole.is_zero() { 1.0 } else { (part.as_secs_f64() / whole.as_secs_f64()).min(1.0) }
}
