//! The search for the next event: an alarm event or an action of an operator, before or after the shown instant.

use jiff::{SignedDuration, Timestamp};

use super::{Direction, Event, Replay};
use crate::{
    history::Query,
    plant::record::{ActionRecord, AlarmRecord},
    t,
    ui::{Effect, ViewContext},
};

/// An event is searched for in spans that grow: 1 h, a day, a month, a year.
const SEARCHED_H: [i64; 4] = [1, 24, 24 * 31, 24 * 366];
/// Rows of one search; where a span has more, a shorter one is searched.
const SEARCHED_ROWS: usize = 200;

/// A search for the next event.
#[derive(Debug)]
pub(super) struct Search {
    direction: Direction,
    from: Timestamp,
    to: Timestamp,
    /// Place in [`SEARCHED_H`].
    span: usize,
    /// The queries, and what came.
    pub(super) queries: [u32; 2],
    pub(super) alarms: Option<Vec<AlarmRecord>>,
    pub(super) actions: Option<Vec<ActionRecord>>,
}

impl Replay {
    /// Asks for the events of the next span in a direction.
    pub(super) fn search(
        &mut self,
        direction: Direction,
        at: Timestamp,
        present: Timestamp,
        span: usize,
    ) -> Vec<Effect> {
        self.pause();
        (self.goal, self.trouble) = (None, None);
        let by = SignedDuration::from_hours(SEARCHED_H[span]);
        // The instant itself was gone to: it is neither next nor previous.
        let (from, to) = match direction {
            Direction::Earlier => (at.checked_sub(by).unwrap_or(Timestamp::MIN), at),
            Direction::Later => {
                let from = after(at);
                (from, from.checked_add(by).unwrap_or(present).min(after(present)))
            }
        };
        self.search_in(direction, (from, to), span)
    }

    fn search_in(&mut self, direction: Direction, (from, to): (Timestamp, Timestamp), span: usize) -> Vec<Effect> {
        if to <= from {
            self.trouble = Some(t!("no later event").to_owned());
            return Vec::new();
        }
        let limit = SEARCHED_ROWS;
        let alarms = self.ask(Query::Journal { from, to, limit });
        let first = self.asked;
        let actions = self.ask(Query::Actions { from, to, limit });
        let queries = [first, self.asked];
        self.search = Some(Search { direction, from, to, span, queries, alarms: None, actions: None });
        vec![alarms, actions]
    }

    /// Both answers of a search: goes to the nearest event, or searches on.
    pub(super) fn on_found(&mut self, present: &ViewContext) -> Vec<Effect> {
        let both = |search: &mut Search| search.alarms.is_some() && search.actions.is_some();
        let Some(search) = self.search.take_if(both) else { return Vec::new() };
        let (alarms, actions) = (search.alarms.unwrap_or_default(), search.actions.unwrap_or_default());
        // The newest rows came: of too many, the oldest are missing.
        let cut = SEARCHED_ROWS <= alarms.len().max(actions.len());
        let events = alarms.into_iter().map(Event::Alarm).chain(actions.into_iter().map(Event::Action));
        let events = events.filter(|event| (search.from..search.to).contains(&event.at()));
        let (direction, from, to) = (search.direction, search.from, search.to);
        let nearest = match direction {
            Direction::Earlier => events.max_by_key(Event::at),
            Direction::Later if cut => {
                let half = to.duration_since(from) / 2;
                return self.search_in(direction, (from, from.checked_add(half).unwrap_or(to)), search.span);
            }
            Direction::Later => events.min_by_key(Event::at),
        };
        if let Some(event) = nearest {
            let effect = self.go_to(event.at());
            self.event = Some(event);
            return vec![effect];
        }
        let longest = SEARCHED_H.len() - 1;
        match direction {
            Direction::Earlier if search.span == longest => {
                self.trouble = Some(t!("no earlier event within a year").to_owned());
                Vec::new()
            }
            Direction::Earlier => self.search(direction, from, present.now, search.span + 1),
            Direction::Later => {
                let before = to.checked_sub(SignedDuration::from_micros(1)).unwrap_or(to);
                self.search(direction, before, present.now, (search.span + 1).min(longest))
            }
        }
    }
}

fn after(at: Timestamp) -> Timestamp {
    at.checked_add(SignedDuration::from_micros(1)).unwrap_or(at)
}
