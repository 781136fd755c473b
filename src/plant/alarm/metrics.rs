//! The figures of an alarm system, and the targets and limits that they are held against: one table in one place.
//!
//! Targets and limits are those of ISA-18.2 and IEC 62682 for one operator's position, meant for at least 30 days; the
//! plant is one position. Only *annunciated* activations count: an event `raised` of an alarm that is not suppressed.

use crate::t;
use std::{sync::Arc, time::Duration};

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

use crate::plant::{def::Priority, keyword::keyword_enum};

/// How many of the most frequent alarms are named.
pub const TOP: usize = 10;
/// Shares of fewer activations than this say nothing and are not evaluated.
pub const SHARED_MIN: u64 = 20;

/// Rates of less watched time than this say nothing and are not evaluated.
pub const WATCHED_MIN: Duration = Duration::from_secs(3_600);

/// The alarm system as it is now: the rates of this moment, and the figures of the last 24 hours.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct AlarmMetrics {
    /// Activations in the last 10 minutes.
    pub last_10_min: u32,
    /// Activations in the last hour.
    pub last_hour: u32,
    /// Since when there is a flood: it begins above 10 in 10 minutes and ends below 5.
    pub flood_since: Option<Timestamp>,
    /// The running hour and the 23 before it; some seconds old, `until` says how old.
    pub day: Arc<PeriodMetrics>,
}

/// The figures of a span of time. Windows are 10 minutes of the UTC clock, those without an alarm included, but not those in
/// which no station ran; one that lies only partly in the span counts with what is in it.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct PeriodMetrics {
    /// From, inclusive.
    pub from: Timestamp,
    /// Until, exclusive.
    pub until: Timestamp,
    /// Activations by priority, the most urgent first.
    pub by_priority: [u64; 4],
    /// Windows that the span touches and in which a station ran.
    pub windows: u64,
    /// The time of the span that lies in these windows: what rates are formed over.
    pub watched: Duration,
    /// Windows with more than 10 activations.
    pub windows_over: u64,
    /// Activations in the worst window.
    pub most: u64,
    /// Time in flood, in whole seconds.
    pub flood: Duration,
    /// The most frequent alarms, the most frequent first; at most `TOP`.
    pub top: Vec<Frequent>,
    /// Alarms that chattered: raised three times or more within 60 s.
    pub chattering: Vec<Named>,
    /// Alarms that were fleeting: gone within 10 s, before anybody had acknowledged them.
    pub fleeting: Vec<Named>,
    /// The most alarms at one time that had been active for over 24 hours.
    pub stale: u64,
    /// Activations that were not annunciated, because the alarm was suppressed, shelved or out of service.
    pub suppressed: u64,
}

/// An alarm by its names, as the journal has them.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct Named {
    /// Full name of the tag or device: `TIC-1.PV`.
    pub subject: Arc<str>,
    /// `temperature high`.
    pub message: Arc<str>,
}

/// An alarm and how often it was raised.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Frequent {
    /// Which.
    pub alarm: Named,
    /// Activations in the span.
    pub raised: u64,
}

/// What is measured, in the order of the table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Metric {
    /// Activations a day, on average.
    PerDay,
    /// Activations an hour, on average.
    PerHour,
    /// Activations in 10 minutes, on average.
    PerWindow,
    /// Percent of the windows with more than 10.
    WindowsOver,
    /// Most in a window.
    Most,
    /// Percent of the time in flood.
    Flood,
    /// Percent of the activations that come from the most frequent alarms.
    Top,
    /// Alarms that chattered.
    Chattering,
    /// Alarms that were fleeting.
    Fleeting,
    /// Alarms active for over 24 hours, the most at one time.
    Stale,
    /// Percent of the activations with this priority.
    Share(Priority),
}

/// How a figure comes from the activations.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MetricKind {
    /// So much in a time.
    Rate,
    /// A part of all activations.
    Share,
    Count,
}

impl Metric {
    pub fn kind(self) -> MetricKind {
        match self {
            Metric::PerDay | Metric::PerHour | Metric::PerWindow | Metric::WindowsOver | Metric::Flood => {
                MetricKind::Rate
            }
            Metric::Top | Metric::Share(_) => MetricKind::Share,
            Metric::Most | Metric::Chattering | Metric::Fleeting | Metric::Stale => MetricKind::Count,
        }
    }
}

/// What a figure should be, and what it must not pass.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MetricTarget {
    /// What is measured.
    pub measure: Metric,
    /// In words, with its unit last.
    pub words: &'static str,
    /// The target.
    pub target: Bound,
    /// The limit, where there is one.
    pub limit: Option<Bound>,
}

/// How far a figure may go.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Bound {
    /// So much or less.
    AtMost(f64),
    /// Less than this.
    Below(f64),
    /// So much or more.
    AtLeast(f64),
}

/// Targets and limits (ISA-18.2-2016, clause 16.5; the command of the screens).
pub const METRIC_TARGETS: [MetricTarget; 14] = {
    use Bound::{AtLeast, AtMost, Below};
    use Metric::{Chattering, Fleeting, Flood, Most, PerDay, PerHour, PerWindow, Share, Stale, Top, WindowsOver};
    const fn goal(measure: Metric, words: &'static str, target: Bound, limit: Option<Bound>) -> MetricTarget {
        MetricTarget { measure, words, target, limit }
    }
    [
        goal(PerDay, "alarms per day", AtMost(150.0), Some(AtMost(300.0))),
        goal(PerHour, "alarms per hour", AtMost(6.0), Some(AtMost(12.0))),
        goal(PerWindow, "alarms per 10 min", AtMost(1.0), Some(AtMost(2.0))),
        goal(WindowsOver, "10-min windows above 10 (%)", Below(1.0), None),
        goal(Most, "peak in a 10-min window", AtMost(10.0), None),
        goal(Flood, "time in flood (%)", Below(1.0), None),
        goal(Top, "share of the 10 most frequent (%)", AtMost(5.0), None),
        goal(Chattering, "chattering alarms", AtMost(0.0), None),
        goal(Fleeting, "fleeting alarms", AtMost(0.0), None),
        goal(Stale, "active over 24 h (peak)", Below(5.0), None),
        goal(Share(Priority::Critical), "priority critical (%)", Below(1.0), None),
        goal(Share(Priority::High), "priority high (%)", AtMost(5.0), None),
        goal(Share(Priority::Medium), "priority medium (%)", AtMost(15.0), None),
        goal(Share(Priority::Low), "priority low (%)", AtLeast(80.0), None),
    ]
};

keyword_enum! {
    /// How a figure stands.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
    pub enum TargetStatus: "verdict" {
        /// As it should be.
        Good => "good",
        /// Beyond the target.
        Beyond => "beyond target",
        /// Beyond the limit.
        Over => "over limit",
        /// Too few alarms, or less than [`WATCHED_MIN`] of running time.
        InsufficientData => "insufficient data",
    }
}

impl Bound {
    /// Is it kept?
    pub fn holds(self, value: f64) -> bool {
        match self {
            Bound::AtMost(bound) => value <= bound,
            Bound::Below(bound) => value < bound,
            Bound::AtLeast(bound) => bound <= value,
        }
    }
}

impl std::fmt::Display for Bound {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Bound::AtMost(bound) => f.write_str(&t!("at most {bound}", bound)),
            Bound::Below(bound) => f.write_str(&t!("below {bound}", bound)),
            Bound::AtLeast(bound) => f.write_str(&t!("at least {bound}", bound)),
        }
    }
}

impl MetricTarget {
    /// How a figure stands against it; `None` is a figure that could not be formed.
    pub fn verdict(&self, figures: &PeriodMetrics) -> TargetStatus {
        if self.measure.kind() == MetricKind::Rate && figures.watched < WATCHED_MIN {
            return TargetStatus::InsufficientData;
        }
        let Some(value) = figures.value(self.measure) else { return TargetStatus::InsufficientData };
        if self.measure.kind() == MetricKind::Share && figures.annunciated() < SHARED_MIN {
            TargetStatus::InsufficientData
        } else if self.target.holds(value) {
            TargetStatus::Good
        } else if self.limit.is_some_and(|limit| !limit.holds(value)) {
            TargetStatus::Over
        } else {
            TargetStatus::Beyond
        }
    }
}

impl PeriodMetrics {
    /// Activations of all priorities.
    pub fn annunciated(&self) -> u64 {
        self.by_priority.iter().sum()
    }
    /// A figure; `None` if it cannot be formed, as a share of nothing.
    pub fn value(&self, measure: Metric) -> Option<f64> {
        let all = self.annunciated() as f64;
        let seconds = self.watched.as_secs_f64();
        let of = |part: f64, whole: f64| (0.0 < whole).then(|| part / whole);
        match measure {
            Metric::PerDay => of(all * 86_400.0, seconds),
            Metric::PerHour => of(all * 3_600.0, seconds),
            Metric::PerWindow => of(all * 600.0, seconds),
            Metric::WindowsOver => of(self.windows_over as f64 * 100.0, self.windows as f64),
            Metric::Most => Some(self.most as f64),
            Metric::Flood => of(self.flood.as_secs_f64() * 100.0, seconds),
            Metric::Top => of(self.top.iter().map(|alarm| alarm.raised).sum::<u64>() as f64 * 100.0, all),
            Metric::Chattering => Some(self.chattering.len() as f64),
            Metric::Fleeting => Some(self.fleeting.len() as f64),
            Metric::Stale => Some(self.stale as f64),
            Metric::Share(priority) => of(self.by_priority[place(priority)] as f64 * 100.0, all),
        }
    }
}

/// Where a priority stands in a list, the most urgent first.
pub fn place(priority: Priority) -> usize {
    usize::from(priority.number() - 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn figures(by_priority: [u64; 4]) -> PeriodMetrics {
        let until = Timestamp::UNIX_EPOCH + Duration::from_secs(86_400);
        let watched = Duration::from_secs(86_400);
        PeriodMetrics { by_priority, until, windows: 144, watched, ..PeriodMetrics::default() }
    }

    fn verdict(figures: &PeriodMetrics, measure: Metric) -> TargetStatus {
        METRIC_TARGETS.iter().find(|goal| goal.measure == measure).expect("every measure has a goal").verdict(figures)
    }

    #[test]
    fn a_rate_is_good_up_to_its_target_and_over_beyond_its_limit() {
        for (a_day, expect) in [
            (0, TargetStatus::Good),
            (144, TargetStatus::Good),
            (151, TargetStatus::Beyond),
            (300, TargetStatus::Beyond),
            (301, TargetStatus::Over),
        ] {
            assert_eq!(verdict(&figures([0, 0, 0, a_day]), Metric::PerDay), expect, "{a_day}");
        }
        assert_eq!(figures([0, 0, 0, 144]).value(Metric::PerWindow), Some(1.0));
        assert_eq!(figures([0, 0, 0, 144]).value(Metric::PerHour), Some(6.0));
    }

    #[test]
    fn a_rate_is_per_watched_time_of_at_least_an_hour() {
        let hours =
            |hours: u64| PeriodMetrics { watched: Duration::from_secs(hours * 3_600), ..figures([0, 0, 0, 24]) };
        assert_eq!(hours(2).value(Metric::PerHour), Some(12.0));
        assert_eq!(verdict(&hours(1), Metric::PerHour), TargetStatus::Over);
        let short = PeriodMetrics { watched: Duration::from_secs(3_599), ..hours(1) };
        assert_eq!(verdict(&short, Metric::PerHour), TargetStatus::InsufficientData);
        assert_eq!(verdict(&short, Metric::Most), TargetStatus::Good, "that much is certain");
        assert_eq!(verdict(&hours(0), Metric::PerDay), TargetStatus::InsufficientData);
    }

    #[test]
    fn the_split_is_judged_from_a_handful_of_alarms_up() {
        let split = figures([0, 5, 15, 80]);
        for priority in Priority::ALL {
            assert_eq!(verdict(&split, Metric::Share(priority)), TargetStatus::Good, "{}", priority.word());
        }
        let urgent = figures([2, 10, 10, 10]);
        for priority in Priority::ALL {
            assert_eq!(verdict(&urgent, Metric::Share(priority)), TargetStatus::Beyond, "{}", priority.word());
        }
        assert_eq!(verdict(&figures([0, 19, 0, 0]), Metric::Share(Priority::High)), TargetStatus::InsufficientData);
        assert_eq!(verdict(&figures([0, 20, 0, 0]), Metric::Share(Priority::High)), TargetStatus::Beyond);
        assert_eq!(verdict(&figures([0; 4]), Metric::Share(Priority::Low)), TargetStatus::InsufficientData);
    }

    #[test]
    fn the_most_frequent_have_their_share_of_all_alarms() {
        let alarm = Named { subject: "TIC-1.PV".into(), message: "high".into() };
        let frequent = |raised| Frequent { alarm: alarm.clone(), raised };
        let figures = PeriodMetrics { top: vec![frequent(3), frequent(2)], ..figures([0, 0, 0, 10]) };
        assert_eq!(figures.value(Metric::Top), Some(50.0));
    }

    #[test]
    fn few_stale_alarms_and_little_flood_are_good() {
        for (stale, flood, expect) in [(4, 863, TargetStatus::Good), (5, 864, TargetStatus::Beyond)] {
            let figures = PeriodMetrics { stale, flood: Duration::from_secs(flood), ..figures([0; 4]) };
            assert_eq!([Metric::Stale, Metric::Flood].map(|measure| verdict(&figures, measure)), [expect; 2]);
        }
    }
}
