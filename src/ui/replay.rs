//! Replay: the plant as it was at past instants, on every tab that has a past; commands are refused meanwhile.
//!
//! What stands above the tab, header and banner, stays that of the present.

mod page;
mod refusal;
mod search;

use std::{collections::VecDeque, sync::Arc};

use jiff::{SignedDuration, Timestamp};

use super::{UiAction, ViewContext, modal::instant::stamp};
use crate::{
    history::{Answer, HistoryError, Query},
    plant::{
        def::Pen,
        past::Past,
        record::{ActionRecord, AlarmRecord},
        snapshot::Snapshot,
    },
    t,
};
pub use page::EventPage;
pub(super) use refusal::{gives_command, refuse_commands, refused};
use search::Search;
pub use search::Searched;

/// Half a second of playing is this many times as long in the plant; 0 is paused.
const SPEEDS: [i32; 5] = [0, 1, 10, 60, 600];
/// Snapshots that are fetched ahead while playing.
const PREFETCH_MAX: usize = 3;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Direction {
    /// Towards the past.
    Earlier,
    /// Towards the present.
    Later,
}

/// A past instant of the plant.
#[derive(Debug)]
pub struct Shown {
    pub at: Timestamp,
    /// The plant at it.
    pub snapshot: Arc<Snapshot>,
}

#[derive(Debug, Clone, PartialEq)]
pub enum Event {
    Alarm(AlarmRecord),
    Action(ActionRecord),
    /// A batch began, or it ended.
    Batch {
        at: Timestamp,
        label: String,
        ended: bool,
    },
    /// A value was stored.
    Sample(Timestamp),
}

impl Event {
    pub fn at(&self) -> Timestamp {
        match self {
            Event::Alarm(record) => record.at,
            Event::Action(record) => record.at,
            Event::Batch { at, .. } | Event::Sample(at) => *at,
        }
    }
}

/// Which past is shown, if any, and where it goes from there.
#[derive(Debug, Default)]
pub struct Replay {
    shown: Option<Shown>,
    /// The query for the instant that is to be shown next, and the instant.
    requested: Option<(u32, Timestamp)>,
    /// Where steps lead that were made meanwhile.
    next: Option<Timestamp>,
    search: Option<Search>,
    /// The query for the time of a stored value.
    sample: Option<u32>,
    event: Option<Event>,
    /// Place in [`SPEEDS`].
    speed: usize,
    /// The last instant before the present is among those that will be played.
    ends: bool,
    /// Instants that will be played, each with its query and its answer.
    prefetched: VecDeque<(Timestamp, u32, Option<Shown>)>,
    /// The page that is shown instead of a tab.
    page: Option<EventPage>,
    /// Why the last query led nowhere.
    trouble: Option<String>,
}

impl Replay {
    /// The past that is shown; `None` is the present.
    pub fn shown(&self) -> Option<&Shown> {
        self.shown.as_ref()
    }

    /// How many times as fast as the plant it plays; 0 is paused.
    pub fn speed(&self) -> i32 {
        SPEEDS[self.speed]
    }

    /// The event that was gone to, while its instant is shown.
    pub fn event(&self) -> Option<&Event> {
        self.event.as_ref().filter(|event| self.shown().is_some_and(|shown| shown.at == event.at()))
    }

    /// What it waits for, or why it did not get there.
    pub fn words(&self) -> Option<String> {
        let waits = self.requested.is_some() || self.search.is_some() || self.sample.is_some();
        self.trouble.clone().or_else(|| waits.then(|| t!("reading the history …").to_owned()))
    }

    pub fn awaits(&mut self, number: u32) -> bool {
        self.requested.is_some_and(|(requested, _)| requested == number)
            || self.sample == Some(number)
            || self.search.as_ref().is_some_and(|search| search.queries.contains(&number))
            || self.prefetched.iter().any(|(_, query, shown)| *query == number && shown.is_none())
            || self.page.as_mut().is_some_and(|page| page.awaits(number))
    }

    /// The event page, if it is shown.
    pub fn page(&self) -> Option<&EventPage> {
        self.page.as_ref().filter(|_| self.shown.is_some())
    }

    pub fn page_mut(&mut self) -> Option<&mut EventPage> {
        self.page.as_mut().filter(|_| self.shown.is_some())
    }

    /// Asks for an instant, which is shown on the event page.
    pub fn open_page(&mut self, at: Timestamp, present: &ViewContext) -> Vec<UiAction> {
        self.page.get_or_insert_default();
        self.go_to(at, present)
    }

    /// The event page instead of the tab, or the tab again; does nothing in the present.
    pub fn toggle_page(&mut self, present: &ViewContext) -> Vec<UiAction> {
        if self.page.take().is_none() && self.shown.is_some() {
            self.page = Some(EventPage::default());
        }
        self.ask_page(present)
    }

    fn drawn(&self) -> Vec<Pen> {
        let of_page = self.page().map(|page| page.pens().to_vec());
        of_page.or_else(|| self.shown().map(|shown| page::pens(&shown.snapshot, shown.at))).unwrap_or_default()
    }

    /// A tab was chosen: it is shown.
    pub fn close_page(&mut self) {
        self.page = None;
    }

    /// Asks for what the event page shows around the instant, if it lacks that.
    fn ask_page(&mut self, present: &ViewContext) -> Vec<UiAction> {
        let (Some(page), Some(shown)) = (&mut self.page, &self.shown) else { return Vec::new() };
        page.follow(shown, present)
    }

    pub fn leave(&mut self) {
        *self = Replay::default();
    }

    /// Asks for an instant, which is shown when the answer comes; what is played stops.
    pub fn go_to(&mut self, at: Timestamp, present: &ViewContext) -> Vec<UiAction> {
        self.pause();
        (self.search, self.sample, self.trouble, self.next) = (None, None, None, None);
        let (number, action) = ask(present, Query::Past { at });
        self.requested = Some((number, at));
        vec![action]
    }

    /// Steps from where it is, or from where it goes: while an instant is on its way it is waited for, so that fast keys
    /// neither outrun the history nor get lost.
    pub fn step(&mut self, by: SignedDuration, present: &ViewContext) -> Vec<UiAction> {
        let on_way = self.requested.map(|(_, at)| self.next.unwrap_or(at));
        let Some(from) = on_way.or(self.shown().map(|shown| shown.at)) else { return Vec::new() };
        let to = from.checked_add(by).unwrap_or(from).min(present.now);
        if on_way.is_none() {
            return self.go_to(to, present);
        }
        self.next = Some(to);
        Vec::new()
    }

    /// A key was pressed: why the last query led nowhere has been read.
    pub fn dismiss(&mut self) {
        self.trouble = None;
    }

    /// What is on its way is not waited for, where nothing of the past is shown yet.
    pub fn cancel(&mut self) {
        if self.shown.is_none() {
            self.leave();
        }
    }

    fn pause(&mut self) {
        self.speed = 0;
        self.forget_prefetched();
    }

    fn forget_prefetched(&mut self) {
        self.prefetched.clear();
        self.ends = false;
    }

    /// Plays, faster with each call, then pauses.
    pub fn play(&mut self, present: &ViewContext) -> Vec<UiAction> {
        self.speed = (self.speed + 1) % SPEEDS.len();
        (self.requested, self.search, self.sample, self.trouble) = (None, None, None, None);
        self.forget_prefetched();
        self.prefetch(present)
    }

    /// Half a second has passed: the next instant is shown if it has come. At the present the playing stops.
    pub fn on_tick(&mut self, present: &ViewContext) -> Vec<UiAction> {
        if let Some((.., shown @ Some(_))) = self.prefetched.front_mut() {
            self.shown = shown.take();
            self.prefetched.pop_front();
        }
        let asked = self.prefetch(present);
        if self.prefetched.is_empty() {
            self.speed = 0;
        }
        asked.into_iter().chain(self.ask_page(present)).collect()
    }

    fn prefetch(&mut self, present: &ViewContext) -> Vec<UiAction> {
        let step = SignedDuration::from_millis(500) * self.speed();
        let mut asked = Vec::new();
        while step > SignedDuration::ZERO && self.prefetched.len() < PREFETCH_MAX && !self.ends {
            let last = self.prefetched.back().map(|(at, ..)| *at).or_else(|| self.shown().map(|shown| shown.at));
            let Some(last) = last.filter(|last| *last < present.now) else { break };
            // The last step is as long as there is time: a fast pace would end minutes before the present.
            let at = last.checked_add(step).unwrap_or(present.now).min(present.now);
            self.ends = at == present.now;
            let (number, action) = ask(present, Query::Past { at });
            self.prefetched.push_back((at, number, None));
            asked.push(action);
        }
        asked
    }

    /// An answer has come; `present` is the plant now.
    pub fn on_answer(
        &mut self,
        number: u32,
        answer: Result<Answer, HistoryError>,
        present: &ViewContext,
    ) -> Vec<UiAction> {
        if !self.awaits(number) {
            return Vec::new();
        }
        if let Some(page) = &mut self.page
            && page.awaits(number)
        {
            page.on_answer(present, number, &answer);
            return Vec::new();
        }
        match answer {
            Err(error) => {
                let why = match error {
                    HistoryError::NotKept { first, .. } => {
                        t!("no data: the history begins {at}", at = stamp(present, first))
                    }
                    other => other.to_string(),
                };
                self.pause();
                (self.requested, self.search, self.sample, self.trouble) = (None, None, None, Some(why));
                self.page.take_if(|_| self.shown.is_none());
            }
            Ok(Answer::Past(past)) => return self.on_past(number, &past, present),
            Ok(answer) => return self.on_found(number, answer, present),
        }
        Vec::new()
    }

    fn on_past(&mut self, number: u32, past: &Past, present: &ViewContext) -> Vec<UiAction> {
        let mut snapshot = past.snapshot(present.snapshot.def.clone());
        // Waiting and refreshing go by the time of the present.
        (snapshot.speed, snapshot.stepped) = (present.snapshot.speed, present.snapshot.stepped);
        let shown = Shown { at: past.at, snapshot: Arc::new(snapshot) };
        if self.requested.is_some_and(|(requested, _)| requested == number) {
            (self.requested, self.shown) = (None, Some(shown));
            let next = self.next.take().map(|at| self.go_to(at, present));
            return self.ask_page(present).into_iter().chain(next.into_iter().flatten()).collect();
        } else if let Some((.., place)) = self.prefetched.iter_mut().find(|(_, query, _)| *query == number) {
            *place = Some(shown);
        }
        Vec::new()
    }
}

/// Asks the history, and under which number.
fn ask(present: &ViewContext, query: Query) -> (u32, UiAction) {
    let number = present.numbers.next();
    (number, UiAction::query(None, number, query))
}
