//! The search for the next event: an alarm event or an action of an operator, before or after the shown instant.

use jiff::{SignedDuration, Timestamp};

use super::{Direction, Event, Replay};
use crate::{
    history::Query,
    plant::record::{ActionRecord, AlarmRecord},
    t,
    ui::Effect,
};

/// An event is searched for in spans that grow: 1 h, a day, a month, a year.
const SEARCHED_H: [i64; 4] = [1, 24, 24 * 31, 24 * 366];
/// Rows of one search; where a span has more, a shorter one is searched.
const SEARCHED_ROWS: usize = 200;

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

/// A search for the next event.
#[derive(Debug)]
pub(super) struct Search {
    span: Span,
    /// The queries, and what came.
    pub(super) queries: [u32; 2],
    pub(super) alarms: Option<Vec<AlarmRecord>>,
    pub(super) actions: Option<Vec<ActionRecord>>,
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
    pub(super) fn search(&mut self, direction: Direction, at: Timestamp, present: Timestamp) -> Vec<Effect> {
        self.pause();
        (self.requested, self.trouble) = (None, None);
        let span = Span::new(direction, at, 0, present);
        self.search_in(Some(span).filter(|span| span.from < span.to), direction)
    }

    fn search_in(&mut self, span: Option<Span>, direction: Direction) -> Vec<Effect> {
        let Some(span @ Span { from, to, .. }) = span else {
            self.trouble = Some(match direction {
                Direction::Earlier => t!("no earlier event within a year").to_owned(),
                Direction::Later => t!("no later event").to_owned(),
            });
            return Vec::new();
        };
        let limit = SEARCHED_ROWS;
        let alarms = self.ask(Query::Journal { from, to, limit });
        let first = self.asked;
        let actions = self.ask(Query::Actions { from, to, limit });
        let queries = [first, self.asked];
        self.search = Some(Search { span, queries, alarms: None, actions: None });
        vec![alarms, actions]
    }

    /// Both answers of a search: goes to the nearest event, or searches on.
    pub(super) fn on_found(&mut self) -> Vec<Effect> {
        let both = |search: &mut Search| search.alarms.is_some() && search.actions.is_some();
        let Some(Search { span, alarms, actions, .. }) = self.search.take_if(both) else { return Vec::new() };
        let (alarms, actions) = (alarms.unwrap_or_default(), actions.unwrap_or_default());
        // The newest rows came: of too many, the oldest are missing.
        let cut = SEARCHED_ROWS <= alarms.len().max(actions.len());
        let events = alarms.into_iter().map(Event::Alarm).chain(actions.into_iter().map(Event::Action));
        let events = events.filter(|event| (span.from..span.to).contains(&event.at()));
        let nearest = match span.direction {
            Direction::Earlier => events.max_by_key(Event::at),
            Direction::Later => {
                let half = span.half(span.from, span.to);
                if cut && half.overfull.is_some() {
                    return self.search_in(Some(half), span.direction);
                }
                events.min_by_key(Event::at)
            }
        };
        let Some(event) = nearest else { return self.search_in(span.next(), span.direction) };
        let effect = self.go_to(event.at());
        self.event = Some(event);
        vec![effect]
    }
}

fn after(at: Timestamp) -> Timestamp {
    at.checked_add(SignedDuration::from_micros(1)).unwrap_or(at)
}
