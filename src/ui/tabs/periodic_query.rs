//! A query that is sent again and again: one at a time is on its way, and only its answer counts.

use jiff::{SignedDuration, Timestamp};

use super::Tab;
use crate::{
    history::{Answer, HistoryError, MadeReports, QUERY_TIME_MAX, Query, Series},
    plant::{
        alarm::PeriodMetrics,
        control_run::ControlRun,
        line_minute::LineMinute,
        live::LiveReading,
        record::{ActionRecord, AlarmRecord},
    },
    report::{ShiftReport, batch::BatchReport, step_series::HeldValue},
    t,
    ui::{UiAction, ViewContext},
};

/// Seconds of waiting that an operator notices.
const NOTICED_S: f64 = 0.5;
/// Between two queries passes at least this many times as long as the last answer took.
const REST: i32 = 4;
/// An answer that was not there after this many timeouts is lost: the station answers each query, and says so
/// where it cannot.
const LOST: i32 = 4;

/// One kind of query of a tab. All times are those of [`monotonic_now`](crate::ui::ViewContext::monotonic_now).
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct PeriodicQuery {
    on_way: Option<(u32, Timestamp)>,
    asked: Option<Timestamp>,
    took: SignedDuration,
    wanted: bool,
    /// The operator did not wait for the last one.
    cancelled: bool,
    /// The past that the last one was for.
    past: Option<Timestamp>,
}

impl PeriodicQuery {
    /// Is it time to ask: something changed, or the last query is `every` old, and the history has rested from it?
    /// While one is on its way, its answer is waited for; only where it is no longer what is wanted not longer than
    /// `timeout`, so that fast keys never pile up queries before the history.
    pub fn due(&self, now: Timestamp, every: SignedDuration, timeout: SignedDuration) -> bool {
        // A station that was started again with a clock set back must not silence the query for good; a small step back
        // is only the difference between the time of a snapshot and what was guessed before it came.
        let set_back = |at: Timestamp| at.duration_since(now) >= timeout;
        let every = every.max(self.took * REST);
        match self.on_way {
            Some((_, at)) => {
                let timeout = if self.wanted { timeout } else { timeout * LOST };
                now.duration_since(at) >= timeout || set_back(at)
            }
            None => self.wanted || self.asked.is_none_or(|at| now.duration_since(at) >= every || set_back(at)),
        }
    }

    /// The query, if it is due.
    pub fn ask(
        &mut self,
        cx: &ViewContext,
        tab: impl Into<Option<Tab>>,
        every: SignedDuration,
        timeout: SignedDuration,
        query: Query,
    ) -> Option<UiAction> {
        let past = cx.is_past().then_some(cx.now);
        if past.is_some() != self.past.is_some() {
            // What is on its way is of the present, and a past is shown, or the other way round.
            self.on_way = None;
        }
        self.wanted |= past != self.past;
        self.past = past;
        self.due(cx.monotonic_now(), every, timeout).then(|| {
            let number = cx.numbers.next();
            self.asked(number, cx.monotonic_now());
            UiAction::query(tab, number, query)
        })
    }

    /// What is shown has changed: ask as soon as possible.
    pub fn want(&mut self) {
        self.wanted = true;
    }

    /// Gives up the query on its way, if it has been waited for long enough to be seen; `false` if there is none. The next
    /// one goes out when it would have gone out anyway.
    pub fn cancel(&mut self, cx: &ViewContext) -> bool {
        let noticed = self.noticed(cx).is_some();
        if noticed {
            (self.on_way, self.wanted, self.cancelled) = (None, false, true);
        }
        noticed
    }

    fn noticed(&self, cx: &ViewContext) -> Option<SignedDuration> {
        self.waiting(cx.monotonic_now()).filter(|waiting| real(cx, NOTICED_S) <= *waiting)
    }

    /// What is said while an answer is waited for; `None` for as long as it is not noticed.
    pub fn shown_waiting(&self, cx: &ViewContext) -> Option<String> {
        if self.cancelled {
            return Some(t!("cancelled").to_owned());
        }
        let waiting = self.noticed(cx)?;
        let (seconds, most) = ((waiting.as_secs_f64() / cx.snapshot.speed.max(0.01)).round(), QUERY_TIME_MAX.as_secs());
        Some(t!("reading for {seconds} s of at most {most} s, Esc cancels", seconds, most))
    }

    /// Query `number` goes out.
    pub fn asked(&mut self, number: u32, now: Timestamp) {
        *self = PeriodicQuery {
            on_way: Some((number, now)),
            asked: Some(now),
            took: self.took,
            wanted: false,
            cancelled: false,
            past: self.past,
        };
    }

    /// An answer has come: when it was asked for, or `None` if it is the answer to an older query.
    pub fn answered(&mut self, number: u32, now: Timestamp) -> Option<Timestamp> {
        let (_, at) = self.on_way.take_if(|(on_way, _)| *on_way == number)?;
        self.took = now.duration_since(at).max(SignedDuration::ZERO);
        Some(at)
    }

    /// Does the answer to this query count? The history need not work on another.
    pub fn awaits(&self, number: u32) -> bool {
        self.on_way.is_some_and(|(on_way, _)| on_way == number)
    }

    pub fn is_on_way(&self) -> bool {
        self.on_way.is_some()
    }

    /// Has what is shown changed since the last query went out?
    pub fn is_wanted(&self) -> bool {
        self.wanted
    }

    /// How long the query on its way has been waiting.
    pub fn waiting(&self, now: Timestamp) -> Option<SignedDuration> {
        self.on_way.map(|(_, at)| now.duration_since(at))
    }
}

/// What the history answered last to a periodic query, or why it could not.
#[derive(Debug)]
pub struct Answered<T> {
    pub query: PeriodicQuery,
    /// The last good answer.
    pub value: Option<T>,
    /// Why the last query failed.
    pub trouble: Option<String>,
}

impl<T> Default for Answered<T> {
    fn default() -> Answered<T> {
        Answered { query: PeriodicQuery::default(), value: None, trouble: None }
    }
}

impl<T: FromAnswer> Answered<T> {
    /// The query, if it is due; what was answered of the present does not stay on the screen in the past.
    pub fn ask(
        &mut self,
        cx: &ViewContext,
        tab: impl Into<Option<Tab>>,
        every: SignedDuration,
        timeout: SignedDuration,
        query: Query,
    ) -> Option<UiAction> {
        if cx.is_past() != self.query.past.is_some() {
            (self.value, self.trouble) = (None, None);
        }
        self.query.ask(cx, tab, every, timeout, query)
    }

    /// Asks for the replay, what is on its way or not.
    pub fn ask_once(&mut self, cx: &ViewContext, query: Query) -> UiAction {
        let number = cx.numbers.next();
        self.query.asked(number, cx.monotonic_now());
        UiAction::query(None, number, query)
    }
}

/// A query of a tab, and who takes its answer.
pub trait Asked {
    fn query(&self) -> &PeriodicQuery;

    /// Takes the answer to query `number` if it is waited for.
    fn on_answer(&mut self, cx: &ViewContext, number: u32, answer: &Result<Answer, HistoryError>);
}

/// Queries of a tab, whether they are on their way or not.
pub type Queries<'a> = Vec<&'a mut dyn Asked>;

impl<T: FromAnswer> Asked for Answered<T> {
    fn query(&self) -> &PeriodicQuery {
        &self.query
    }

    fn on_answer(&mut self, cx: &ViewContext, number: u32, answer: &Result<Answer, HistoryError>) {
        if self.query.answered(number, cx.monotonic_now()).is_none() {
            return;
        }
        match answer {
            Ok(answer) => (self.value, self.trouble) = (T::from_answer(answer), None),
            Err(error) => self.trouble = Some(error.to_string()),
        }
    }
}

/// What a query of one kind is answered with.
pub trait FromAnswer: Sized {
    /// `None` for the answer to a query of another kind.
    fn from_answer(answer: &Answer) -> Option<Self>;
}

/// Nothing is asked for.
impl FromAnswer for () {
    fn from_answer(_: &Answer) -> Option<()> {
        None
    }
}

macro_rules! from_answer {
    ($($kind:ident: $value:ty;)+) => {$(
        impl FromAnswer for $value {
            fn from_answer(answer: &Answer) -> Option<$value> {
                if let Answer::$kind(value) = answer { Some(value.clone()) } else { None }
            }
        }
    )+};
}

from_answer! {
    Series: Vec<Series>;
    Journal: Vec<AlarmRecord>;
    Actions: Vec<ActionRecord>;
    LineMinutes: Vec<LineMinute>;
    Report: Box<ShiftReport>;
    AlarmMetrics: Box<PeriodMetrics>;
    Batches: Vec<BatchReport>;
    ControlRuns: Vec<ControlRun>;
    Reports: MadeReports;
    Values: Vec<Vec<Option<HeldValue>>>;
    Registers: LiveReading;
}

/// Seconds of the operator as plant time, which runs faster in demonstrations.
pub fn real(cx: &ViewContext, seconds: f64) -> SignedDuration {
    SignedDuration::from_secs_f64(seconds * cx.snapshot.speed.clamp(0.01, 1e6))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(second: i64) -> Timestamp {
        Timestamp::from_second(second).expect("a small number of seconds")
    }

    fn due(periodic: &PeriodicQuery, second: i64) -> bool {
        periodic.due(at(second), SignedDuration::from_secs(2), SignedDuration::from_secs(10))
    }

    #[test]
    fn questions_do_not_pile_up_and_old_answers_do_not_count() {
        let mut periodic = PeriodicQuery::default();
        assert!(due(&periodic, 0), "at first");
        periodic.asked(1, at(0));
        periodic.want();
        assert!(!due(&periodic, 5), "while one is on its way");
        assert!(due(&periodic, 10), "when it is not what is wanted any more");
        periodic.asked(2, at(10));
        assert!(periodic.awaits(2) && !periodic.awaits(1), "an older query can be cancelled");
        assert_eq!(periodic.answered(1, at(10)), None, "an older answer");
        assert_eq!(periodic.answered(2, at(10)), Some(at(10)));
        assert_eq!(periodic.answered(2, at(10)), None, "twice");
        assert!(!due(&periodic, 11) && due(&periodic, 12), "at its rate");
        periodic.want();
        assert!(due(&periodic, 11), "after a change");
        periodic.asked(3, at(20));
        assert!(!due(&periodic, 19), "guessed time may run a little ahead");
        assert!(due(&periodic, 10), "after the clock was set back");
    }

    #[test]
    fn a_late_answer_counts_and_the_history_rests_after_it() {
        let mut periodic = PeriodicQuery::default();
        periodic.asked(1, at(0));
        assert!(!due(&periodic, 30), "no second query while the first is answered");
        assert_eq!(periodic.answered(1, at(30)), Some(at(0)), "late, but what was asked for");
        assert!(!due(&periodic, 119) && due(&periodic, 120), "a quarter of the time at most");
        periodic.asked(2, at(120));
        assert!(!due(&periodic, 159) && due(&periodic, 160), "an answer may be lost");
        periodic.answered(2, at(121));
        assert!(due(&periodic, 124), "a fast answer is asked for at its own rate again");
    }
}
