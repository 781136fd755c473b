//! Figures of tags over a span, or over the legs of one: from hours, minutes and samples, and what counters counted.

use std::{
    collections::{HashMap, HashSet},
    ops::Range,
    time::Duration,
};

use jiff::Timestamp;

use super::{
    counts::CountedTag,
    report::outputs,
    store::{Store, instant},
};
use crate::{
    history::{
        HistoryError,
        legs::clip,
        recorded::{self, Epochs, Leg},
        tiers::{Aggregate, CurvePart, Tier},
    },
    plant::{
        PlantDef,
        counter::{self, CounterRule, CounterStep},
        def::TagId,
        exact::Exact,
    },
    report::{
        Gap, RunFigures, TagFigures,
        counters::CounterRow,
        figures::{self, EventLeg, Figures, TagDescription},
    },
};

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
    of: HashMap<TagId, Gathered>,
    pub latest: HashMap<TagId, f64>,
    counted: HashMap<TagId, CountedTag>,
    pub unreadable: Vec<Gap>,
    /// How long the span was: more than its ends show where the clock was set back in it.
    pub time: Duration,
}

impl GatheredTags {
    /// The figures of some of them, each once, with the events of the span.
    pub(super) fn rows(&self, def: &PlantDef, tags: &[TagId], events: &[EventLeg]) -> Vec<TagFigures> {
        let in_alarm = figures::times_in_alarm(events);
        let row = |tag: &TagId| {
            let label = TagDescription::new(def.tag(*tag), &self.latest);
            let in_alarm = in_alarm.get(label.tag.as_str()).copied().unwrap_or_default();
            Some(self.of.get(tag)?.figures?.end(label, self.gain(*tag), in_alarm))
        };
        tags.iter().filter_map(row).collect()
    }

    /// The run hours of the actuators.
    pub(super) fn runs(&self, def: &PlantDef) -> Vec<RunFigures> {
        let row = |tag: TagId| Some(self.of.get(&tag)?.figures?.runs(def.tag(tag).name.clone(), self.gain(tag)));
        outputs(def).filter_map(row).collect()
    }

    /// What counters did beside counting, in order of time.
    pub(super) fn counters(&self, def: &PlantDef) -> Vec<CounterRow> {
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

impl Store {
    /// Gathers the figures of some tags over a span, and the latest good values of those that choose their units and
    /// decimals and of `more`.
    pub(super) fn gather(
        &self,
        shown: &[TagId],
        more: impl Iterator<Item = TagId>,
        (from, until): (Timestamp, Timestamp),
    ) -> Result<GatheredTags, HistoryError> {
        let (from, until) = (from.as_microsecond(), until.as_microsecond());
        self.gather_of(shown, more, &[Leg::whole(from, until)], &(from..until))
    }

    /// The same of what lies in a period of legs that follow each other.
    pub(super) fn gather_of(
        &self,
        shown: &[TagId],
        more: impl Iterator<Item = TagId>,
        legs: &[Leg],
        period: &Range<i64>,
    ) -> Result<GatheredTags, HistoryError> {
        let tags = tags_to_read(&self.def, shown, more);
        let (within, mut seconds) = (clip(legs, period), 0.0);
        for leg in &within {
            seconds += match (&leg.epochs, instant(leg.from), instant(leg.to)) {
                (Epochs::All, Some(from), Some(to)) => recorded::seconds(&self.legs(from, to)?),
                _ => recorded::seconds(std::slice::from_ref(leg)),
            };
        }
        let shown: HashSet<TagId> = shown.iter().copied().collect();
        let gather =
            |tag: &TagId| Gathered { figures: shown.contains(tag).then(|| Figures::new(seconds)), latest_good: None };
        let mut gathered: Vec<Gathered> = tags.iter().map(gather).collect();
        let mut unreadable = Vec::new();
        for leg in &within {
            unreadable.extend(self.each_part_in(&tags, leg, Tier::Hour, |place, part| gathered[place].add(part))?);
        }
        let latest = tags
            .iter()
            .zip(&gathered)
            .filter_map(|(tag, gathered)| Some((*tag, gathered.latest_good?.near())))
            .collect();
        let counted = self.count(counting(&self.def, &shown, &latest), legs, period)?.into_iter().collect();
        let of = tags.into_iter().zip(gathered).collect();
        let time = Duration::from_secs_f64(seconds);
        Ok(GatheredTags { of, latest, counted, unreadable, time })
    }
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

/// Some tags, those that choose their units and decimals, and `more`.
fn tags_to_read(def: &PlantDef, shown: &[TagId], more: impl Iterator<Item = TagId>) -> Vec<TagId> {
    let mut tags: Vec<TagId> = shown.iter().copied().chain(more).collect();
    let scaling_tags: Vec<TagId> = tags.iter().flat_map(|tag| figures::scaling_tags(def.tag(*tag))).collect();
    tags.extend(scaling_tags);
    tags.sort_unstable_by_key(|tag| tag.index());
    tags.dedup();
    tags
}
