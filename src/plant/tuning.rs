//! What is seen of an auto-tuning: since when, how far the process swings, and which parameters it has found.

use std::{sync::Arc, time::Duration};

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

use super::{
    def::{DeviceDef, Faceplate, TagId},
    sample::Sample,
};
use crate::plant::time::elapsed;

/// Most extrema of PV that are kept; later ones are only counted.
const EXTREMA_MAX: usize = 24;
/// PV has turned when it has come back from its extreme by this share of its range.
const TURN_SHARE: f64 = 0.002;

/// An auto-tuning, at work or ended.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Tuning {
    /// When it was first seen on.
    pub began: Timestamp,
    /// Its beginning was seen; else it was on already when it was first read.
    pub seen: bool,
    /// The setpoint that it swings around.
    pub sv: Option<f64>,
    /// When it was seen off again.
    pub ended: Option<Timestamp>,
    /// What it finds: tag, value before, value after (`None`: not read since, or not known).
    pub found: Vec<TunedParameter>,
    /// Where PV has turned, oldest first.
    pub extrema: Vec<Extremum>,
    /// Turns beyond those that are kept.
    pub more: u32,
    /// The furthest PV since the last extremum, and the least change that counts as one.
    extreme: Option<Extremum>,
    least: f64,
}

/// A parameter that auto-tuning finds.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct TunedParameter {
    pub tag: TagId,
    /// Before.
    pub old: Option<f64>,
    /// After, once it was read again.
    pub new: Option<f64>,
}

/// A place where PV has turned.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Extremum {
    pub at: Timestamp,
    /// The extreme.
    pub pv: f64,
    /// From rising to falling.
    pub high: bool,
}

impl Tuning {
    pub(super) fn times(&mut self) -> impl Iterator<Item = &mut Timestamp> {
        let extrema = self.extrema.iter_mut().chain(&mut self.extreme).map(|extremum| &mut extremum.at);
        [&mut self.began].into_iter().chain(&mut self.ended).chain(extrema)
    }

    /// How long it took, or has taken by now.
    pub fn elapsed(&self, now: Timestamp) -> Duration {
        elapsed(self.began, self.ended.unwrap_or(now))
    }
    /// All parameters were read after the end.
    pub fn is_known(&self) -> bool {
        self.ended.is_some() && self.found.iter().all(|found| found.new.is_some())
    }
    /// Time from one high extremum to the next, of the last two.
    pub fn period(&self) -> Option<Duration> {
        let mut highs = self.extrema.iter().rev().filter(|extremum| extremum.high);
        let (last, before) = (highs.next()?, highs.next()?);
        Duration::try_from(last.at.duration_since(before.at)).ok()
    }
}

/// Watches one device for auto-tuning.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct TuningTracker {
    on: Option<bool>,
    /// The latest one.
    pub tuning: Option<Arc<Tuning>>,
}

/// What the watch has noticed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Noticed {
    /// Nothing that anybody must act on.
    Nothing,
    /// It has ended: what it has found should be read at once.
    Ended,
}

impl TuningTracker {
    /// The samples of a device as they stand at `at`; `span` is the range of PV.
    pub fn observe(
        &mut self,
        device: &DeviceDef,
        sample: &dyn Fn(TagId) -> Sample,
        span: Option<f64>,
        at: Timestamp,
    ) -> Noticed {
        let Some(plate) = &device.faceplate else { return Noticed::Nothing };
        let Some(on) = plate.tune.and_then(|tune| sample(tune).good_value()).map(|value| value != 0.0) else {
            return Noticed::Nothing;
        };
        let before = self.on.replace(on);
        let mut noticed = Noticed::Nothing;
        match (&mut self.tuning, on) {
            (Some(tuning), true) if tuning.ended.is_none() => Arc::make_mut(tuning).follow(sample(plate.pv)),
            (_, true) => self.tuning = Some(Arc::new(begin(plate, sample, span, before == Some(false), at))),
            (Some(tuning), false) if tuning.ended.is_none() => {
                Arc::make_mut(tuning).ended = Some(at);
                noticed = Noticed::Ended;
            }
            (Some(tuning), false) if !tuning.is_known() => Arc::make_mut(tuning).read_again(sample),
            (Some(_), false) | (None, false) => {}
        }
        noticed
    }
}

fn begin(plate: &Faceplate, sample: &dyn Fn(TagId) -> Sample, span: Option<f64>, seen: bool, at: Timestamp) -> Tuning {
    let found = plate.tunes.iter().map(|tag| TunedParameter { tag: *tag, old: sample(*tag).good_value(), new: None });
    let mut tuning = Tuning {
        began: at,
        seen,
        sv: sample(plate.sv).good_value(),
        ended: None,
        found: found.collect(),
        extrema: Vec::new(),
        more: 0,
        extreme: None,
        least: span.filter(|span| span.is_finite()).map_or(0.0, |span| span.abs() * TURN_SHARE),
    };
    tuning.follow(sample(plate.pv));
    tuning
}

impl Tuning {
    /// A extremum is an extreme that PV has left by more than noise.
    fn follow(&mut self, pv: Sample) {
        let Some(value) = pv.good_value() else { return };
        let here = |high| Extremum { at: pv.at, pv: value, high };
        let Some(extreme) = self.extreme else {
            // Which way it goes is known when it has moved: around SV it rises to it first.
            let high = self.sv.is_none_or(|sv| value < sv);
            self.extreme = Some(here(high));
            return;
        };
        let ahead = if extreme.high { value - extreme.pv } else { extreme.pv - value };
        if ahead > 0.0 {
            self.extreme = Some(here(extreme.high));
        } else if -ahead > self.least.max(f64::EPSILON) {
            if self.extrema.len() < EXTREMA_MAX {
                self.extrema.push(extreme);
            } else {
                self.more = self.more.saturating_add(1);
            }
            self.extreme = Some(here(!extreme.high));
        }
    }

    /// What was read after the end is what it has found.
    fn read_again(&mut self, sample: &dyn Fn(TagId) -> Sample) {
        let Some(ended) = self.ended else { return };
        for found in self.found.iter_mut().filter(|found| found.new.is_none()) {
            let now = sample(found.tag);
            found.new = now.good_value().filter(|_| ended < now.at);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::{fixture, sample::Cause};

    const PV: TagId = TagId(0);
    const SV: TagId = TagId(1);
    const AT: TagId = TagId(2);
    const P: TagId = TagId(3);

    fn device() -> DeviceDef {
        let plate = Faceplate {
            pv: PV,
            sv: SV,
            sv_used: None,
            mv: None,
            run: None,
            mode: None,
            tune: Some(AT),
            tunes: vec![P],
        };
        DeviceDef { faceplate: Some(plate), ..fixture::plant().devices[0].clone() }
    }

    fn second(second: i64) -> Timestamp {
        Timestamp::from_second(second).expect("a small number")
    }

    /// PV, AT (`None`: not known) and P at a second.
    fn observe(watch: &mut TuningTracker, at: i64, pv: f64, tune: Option<f64>, p: f64) -> Noticed {
        let sample = |tag: TagId| match tag {
            PV => Sample::good(pv, second(at)),
            SV => Sample::good(70.0, second(at)),
            AT => tune.map_or(Sample::bad(Cause::Timeout, second(at)), |tune| Sample::good(tune, second(at))),
            _ => Sample::good(p, second(at)),
        };
        watch.observe(&device(), &sample, Some(100.0), second(at))
    }

    #[test]
    fn swings_are_counted_beside_old_and_new_parameters() {
        let mut watch = TuningTracker::default();
        observe(&mut watch, 0, 60.0, Some(0.0), 5.0);
        assert_eq!(watch.tuning, None);
        let swing = [(1, 60.0), (2, 65.0), (3, 72.0), (4, 71.9), (5, 72.4), (6, 69.0), (7, 68.0), (8, 73.0), (9, 70.0)];
        for (at, pv) in swing {
            assert_eq!(observe(&mut watch, at, pv, Some(1.0), 5.0), Noticed::Nothing);
        }
        let extrema = |watch: &TuningTracker| -> Vec<(f64, bool)> {
            watch
                .tuning
                .iter()
                .flat_map(|tuning| &tuning.extrema)
                .map(|extremum| (extremum.pv, extremum.high))
                .collect()
        };
        assert_eq!(extrema(&watch), [(72.4, true), (68.0, false), (73.0, true)], "0.1 °C of noise is no extremum");
        assert_eq!(observe(&mut watch, 10, 69.0, Some(0.0), 5.0), Noticed::Ended);
        observe(&mut watch, 11, 69.0, Some(0.0), 1.2);
        let tuning = watch.tuning.expect("one has ended");
        assert!(tuning.seen && tuning.is_known());
        assert_eq!(tuning.found, [TunedParameter { tag: P, old: Some(5.0), new: Some(1.2) }]);
        assert_eq!((tuning.elapsed(second(99)).as_secs(), tuning.period()), (9, Some(Duration::from_secs(3))));
    }

    #[test]
    fn a_silent_controller_neither_begins_nor_ends_a_tuning() {
        let mut watch = TuningTracker::default();
        observe(&mut watch, 0, 60.0, Some(1.0), 5.0);
        assert!(watch.tuning.as_ref().is_some_and(|tuning| !tuning.seen), "it was on when first read");
        observe(&mut watch, 1, 60.0, None, 5.0);
        assert!(watch.tuning.as_ref().is_some_and(|tuning| tuning.ended.is_none()));
    }
}
