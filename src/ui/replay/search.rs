//! The search for the next event: an alarm event or an action of an operator, before or after the shown instant.

use jiff::{SignedDuration, Timestamp};

use super::{Direction, Event, Replay, ask};
use crate::{
    history::{Answer, Query},
    plant::{batch::Batch, def::TagId},
    t,
    ui::{UiAction, ViewContext},
};

/// An event is searched for in spans that grow: 1 h, a day, a month, a year.
const SEARCHED_H: [i64; 4] = [1, 24, 24 * 31, 24 * 366];
/// A stored value is searched for within this: each tag has one an hour.
const SAMPLES: SignedDuration = SignedDuration::from_mins(61);

/// Where the next event is searched for.
#[derive(Debug, Clone, Copy)]
struct Span {
    direction: Direction,
    from: Timestamp,
    to: Timestamp,
    /// Until there are more events than one answer holds: then the span is the first half of that.
    overfull: Option<Timestamp>,
    /// Place in [`SEARCHED_H`].
    place: usize,
    /// The end of time, as it was when the key was pressed.
    present: Timestamp,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Searched {
    /// Alarm events and actions of operators.
    Events,
    /// Begins and ends of batches.
    Batches,
}

impl Searched {
    /// Rows of one search; where a span has more, a shorter one is searched.
    fn rows(self) -> usize {
        match self {
            Searched::Events => 200,
            // Each is as much work as a small report.
            Searched::Batches => 10,
        }
    }
}

#[derive(Debug)]
pub(super) struct Search {
    what: Searched,
    span: Span,
    /// The queries whose answers have not come.
    pub(super) queries: Vec<u32>,
    /// What came.
    found: Vec<Event>,
    /// There is more than came.
    cut: bool,
}

impl Span {
    /// The first span before or after an instant, which itself is neither next nor previous.
    fn new(direction: Direction, at: Timestamp, place: usize, present: Timestamp) -> Span {
        let by = SignedDuration::from_hours(SEARCHED_H[place]);
        let (from, to) = match direction {
            Direction::Earlier => (at.checked_sub(by).unwrap_or(Timestamp::MIN), at),
            Direction::Later => {
                let from = after(at);
                (from, from.checked_add(by).unwrap_or(present).min(after(present)))
            }
        };
        Span { direction, from, to, overfull: None, place, present }
    }

    /// The first half of an overfull span; all of it where it cannot be halved.
    fn half(self, from: Timestamp, end: Timestamp) -> Span {
        let half = from.checked_add(end.duration_since(from) / 2).unwrap_or(end);
        // Events are stored with microseconds.
        let (to, overfull) = if after(from) < half { (half, Some(end)) } else { (end, None) };
        Span { from, to, overfull, ..self }
    }

    /// Nothing was found: where to search on; `None` at the end of time.
    fn next(self) -> Option<Span> {
        let longest = SEARCHED_H.len() - 1;
        match (self.direction, self.overfull) {
            (Direction::Later, Some(end)) => Some(self.half(self.to, end)),
            (Direction::Later, None) => {
                let before = self.to.checked_sub(SignedDuration::from_micros(1)).unwrap_or(self.to);
                Some(Span::new(self.direction, before, (self.place + 1).min(longest), self.present))
            }
            (Direction::Earlier, _) if self.place == longest => None,
            (Direction::Earlier, _) => Some(Span::new(self.direction, self.from, self.place + 1, self.present)),
        }
        .filter(|next| next.from < next.to)
    }
}

impl Replay {
    /// Asks for the next event in a direction.
    pub fn search(
        &mut self,
        what: Searched,
        direction: Direction,
        at: Timestamp,
        present: &ViewContext,
    ) -> Vec<UiAction> {
        self.pause();
        (self.requested, self.trouble) = (None, None);
        let span = Span::new(direction, at, 0, present.now);
        self.search_in(what, Some(span).filter(|span| span.from < span.to), direction, present)
    }

    fn search_in(
        &mut self,
        what: Searched,
        span: Option<Span>,
        direction: Direction,
        present: &ViewContext,
    ) -> Vec<UiAction> {
        let Some(span @ Span { from, to, .. }) = span else {
            self.trouble = Some(match (what, direction) {
                (Searched::Events, Direction::Earlier) => t!("no earlier event within a year").to_owned(),
                (Searched::Events, Direction::Later) => t!("no later event").to_owned(),
                (Searched::Batches, Direction::Earlier) => t!("no earlier batch within a year").to_owned(),
                (Searched::Batches, Direction::Later) => t!("no later batch").to_owned(),
            });
            return Vec::new();
        };
        let limit = what.rows();
        let asked = match what {
            Searched::Events => vec![Query::Journal { from, to, limit }, Query::Actions { from, to, limit }],
            Searched::Batches => vec![Query::Batches { from, to, limit }],
        };
        let (queries, actions) = asked.into_iter().map(|query| ask(present, query)).unzip();
        self.search = Some(Search { what, span, queries, found: Vec::new(), cut: false });
        actions
    }

    /// Asks when the next value of what is drawn was stored, or the previous one.
    pub fn search_sample(&mut self, direction: Direction, at: Timestamp, present: &ViewContext) -> Vec<UiAction> {
        self.pause();
        (self.requested, self.search, self.trouble) = (None, None, None);
        let tags: Vec<TagId> = self.drawn().iter().map(|pen| pen.tag).collect();
        let (from, to) = match direction {
            Direction::Earlier => (at.checked_sub(SAMPLES).unwrap_or(Timestamp::MIN), at),
            Direction::Later => (after(at), at.checked_add(SAMPLES).unwrap_or(present.now).min(after(present.now))),
        };
        if tags.is_empty() || to <= from {
            return Vec::new();
        }
        let query = Query::SampleTime { tags, from, to, latest: direction == Direction::Earlier };
        let (number, action) = ask(present, query);
        self.sample = Some(number);
        vec![action]
    }

    /// An answer of a search: goes to the nearest event once all have come, or searches on.
    pub(super) fn on_found(&mut self, number: u32, answer: Answer, present: &ViewContext) -> Vec<UiAction> {
        if self.sample.take_if(|sample| *sample == number).is_some() {
            return self.on_sample(answer, present);
        }
        let Some(search) = &mut self.search else { return Vec::new() };
        search.queries.retain(|query| *query != number);
        // The newest rows came: of too many, the oldest are missing.
        let rows = match answer {
            Answer::Journal(rows) => rows.into_iter().map(Event::Alarm).collect(),
            Answer::Actions(rows) => rows.into_iter().map(Event::Action).collect(),
            Answer::Batches(rows) => {
                search.cut |= search.what.rows() <= rows.len();
                rows.iter().flat_map(|report| of_batch(&report.batch)).collect::<Vec<_>>()
            }
            Answer::Series(_)
            | Answer::ControlRuns(_)
            | Answer::LineMinutes(_)
            | Answer::Report(_)
            | Answer::AlarmMetrics(_)
            | Answer::Values(_)
            | Answer::Past(_)
            | Answer::SampleTime(_)
            | Answer::Reports(_)
            | Answer::Samples(_)
            | Answer::Unarchived(_)
            | Answer::Overview(_)
            | Answer::Registers(_) => Vec::new(),
        };
        search.cut |= search.what == Searched::Events && search.what.rows() <= rows.len();
        search.found.extend(rows);
        let Some(Search { what, span, found, cut, .. }) = self.search.take_if(|search| search.queries.is_empty())
        else {
            return Vec::new();
        };
        let events = found.into_iter().filter(|event| (span.from..span.to).contains(&event.at()));
        let nearest = match span.direction {
            Direction::Earlier => events.max_by_key(Event::at),
            Direction::Later => {
                let half = span.half(span.from, span.to);
                if cut && half.overfull.is_some() {
                    return self.search_in(what, Some(half), span.direction, present);
                }
                events.min_by_key(Event::at)
            }
        };
        let Some(event) = nearest else { return self.search_in(what, span.next(), span.direction, present) };
        let asked = self.go_to(event.at(), present);
        self.event = Some(event);
        asked
    }

    fn on_sample(&mut self, answer: Answer, present: &ViewContext) -> Vec<UiAction> {
        let Answer::SampleTime(found) = answer else { return Vec::new() };
        let Some(at) = found else {
            self.trouble = Some(t!("no other stored value within an hour").to_owned());
            return Vec::new();
        };
        self.event = Some(Event::Sample(at));
        self.go_to(at, present)
    }
}

/// Begin and end of a batch, as far as they were seen.
fn of_batch(batch: &Batch) -> Vec<Event> {
    let event = |at, ended| Event::Batch { at, label: batch.label(), ended };
    [Some(event(batch.from, false)), batch.to.map(|to| event(to, true))].into_iter().flatten().collect()
}

fn after(at: Timestamp) -> Timestamp {
    at.checked_add(SignedDuration::from_micros(1)).unwrap_or(at)
}
