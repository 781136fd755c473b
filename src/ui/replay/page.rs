//! The event page: mimic, values, curves, journal, frames and people of one past instant, instead of a tab.

mod view;

use jiff::{SignedDuration, Timestamp};

use super::Shown;
use crate::{
    access::right::needs_for_query,
    history::{Answer, HistoryError, Query, Series},
    plant::{
        alarm::AlarmState,
        def::{Pen, Subject},
        number::to_u16,
        record::{ActionRecord, AlarmRecord},
        snapshot::Snapshot,
    },
    ui::{
        Effect, ViewContext, rights,
        tabs::{
            alarms::{action_text, event_text},
            draw::local,
            trends::span::View,
        },
        widgets::{chart, list::Motion},
    },
};

/// The curves reach so far before and after the instant.
const CURVES: SignedDuration = SignedDuration::from_mins(5);
/// The journal reaches so far before and after it.
const EVENTS: SignedDuration = SignedDuration::from_hours(1);
/// Events of each kind that are read; where there are more, the page says so.
const EVENTS_MAX: usize = 500;
/// Who was logged in is looked for in the day before.
const LOGINS: SignedDuration = SignedDuration::from_hours(24);
/// An alarm that was raised so long before is what the page is about.
const CAUSE: SignedDuration = SignedDuration::from_mins(10);
/// Curves that are drawn at most.
const PENS_MAX: usize = 3;
/// Rows of a page when the list is scrolled.
const PAGE: usize = 10;

/// What a query is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Part {
    Curves,
    Alarms,
    Actions,
    Logins,
    Detached,
}

/// What the history knows around the instant.
#[derive(Debug, Default)]
pub struct EventPage {
    /// The instant that was asked about.
    centre: Option<Timestamp>,
    /// Queries on their way.
    queries: Vec<(u32, Part)>,
    pens: Vec<Pen>,
    curves: Vec<Series>,
    alarms: Option<Vec<AlarmRecord>>,
    actions: Option<Vec<ActionRecord>>,
    /// Logins and logouts of the day before, and terminals that were closed; `None` where the user may not see them.
    logins: Option<Vec<ActionRecord>>,
    detached: Option<Vec<ActionRecord>>,
    trouble: Option<String>,
    /// Rows that the journal is scrolled away from the instant.
    scroll: isize,
}

/// An event of the journal.
#[derive(Debug, Clone, PartialEq)]
struct Entry {
    at: Timestamp,
    text: String,
    style: ratatui::style::Style,
}

impl EventPage {
    /// Is the answer to this query waited for?
    pub fn awaits(&self, number: u32) -> bool {
        self.queries.iter().any(|(query, _)| *query == number)
    }

    /// Asks for what is around an instant, unless it is known or on its way already.
    pub fn follow(
        &mut self,
        shown: &Shown,
        present: &ViewContext,
        mut ask: impl FnMut(Query) -> (u32, Effect),
    ) -> Vec<Effect> {
        let near = |centre: Timestamp| shown.at.duration_since(centre).abs() <= CURVES / 2;
        if self.centre.is_some_and(near) || !self.queries.is_empty() && self.centre.is_some() {
            return Vec::new();
        }
        let (at, now) = (shown.at, present.present());
        let span = |around: SignedDuration| {
            (at.checked_sub(around).unwrap_or(at), at.checked_add(around).unwrap_or(at).min(now))
        };
        let pens = pens(&shown.snapshot, at);
        *self = EventPage { centre: Some(at), pens, ..EventPage::default() };
        let (view, (from, to)) = (self.window(present, present.area.width), span(EVENTS));
        let limit = EVENTS_MAX;
        let day = at.checked_sub(LOGINS).unwrap_or(at);
        let audit = |action: &str| {
            let (words, by, action) = (String::new(), String::new(), action.to_owned());
            Query::Audit { from: day, to: at, words, by, action, limit }
        };
        let tags = self.pens.iter().map(|pen| pen.tag).collect();
        let mut queries = vec![
            (Part::Curves, Query::Series { tags, from: view.from, to: view.to, buckets: view.columns }),
            (Part::Alarms, Query::Journal { from, to, limit }),
            (Part::Actions, Query::Actions { from, to, limit }),
        ];
        if rights::lacks(present, needs_for_query(&audit(""))).is_none() {
            queries.extend([(Part::Logins, audit("log")), (Part::Detached, audit("detach"))]);
        }
        let asked = queries.into_iter().map(|(part, query)| {
            let (number, effect) = ask(query);
            self.queries.push((number, part));
            effect
        });
        asked.collect()
    }

    /// The history has answered.
    pub fn on_answer(&mut self, number: u32, answer: Result<Answer, HistoryError>) {
        let Some(place) = self.queries.iter().position(|(query, _)| *query == number) else { return };
        let (_, part) = self.queries.swap_remove(place);
        match (part, answer) {
            (_, Err(error)) => self.trouble = Some(error.to_string()),
            (Part::Curves, Ok(Answer::Series(series))) => self.curves = series,
            (Part::Alarms, Ok(Answer::Journal(rows))) => self.alarms = Some(rows),
            (Part::Actions, Ok(Answer::Actions(rows))) => self.actions = Some(rows),
            (Part::Logins, Ok(Answer::Actions(rows))) => self.logins = Some(rows),
            (Part::Detached, Ok(Answer::Actions(rows))) => self.detached = Some(rows),
            (Part::Curves | Part::Alarms | Part::Actions | Part::Logins | Part::Detached, Ok(_)) => {}
        }
    }

    /// Its curves.
    pub fn pens(&self) -> &[Pen] {
        &self.pens
    }

    /// Scrolls the journal away from the instant; the first and the last row are those at the instant again.
    pub fn scroll(&mut self, motion: Motion) {
        let most = self.alarms.as_ref().map_or(0, Vec::len) + self.actions.as_ref().map_or(0, Vec::len);
        let most = most.cast_signed();
        self.scroll = match motion {
            Motion::Rows(by) => self.scroll + by,
            Motion::Pages(by) => self.scroll + by * PAGE.cast_signed(),
            Motion::First | Motion::Last => 0,
        }
        .clamp(-most, most);
    }

    /// The journal around the instant, to be copied.
    pub fn copied(&self, cx: &ViewContext) -> Vec<String> {
        self.entries(cx).iter().map(|entry| format!("{}\t{}", local(cx, entry.at, "%F %T%.3f"), entry.text)).collect()
    }

    /// The window of the curves, in columns of a chart of this width.
    fn window(&self, cx: &ViewContext, width: u16) -> View {
        let centre = self.centre.unwrap_or(cx.now);
        let end = centre.checked_add(CURVES).unwrap_or(centre);
        View::ending(end, 2 * CURVES.as_secs(), chart::dots(cx.theme, width, 1))
    }

    /// Alarm events and actions, oldest first.
    fn entries(&self, cx: &ViewContext) -> Vec<Entry> {
        let alarms = self.alarms.iter().flatten().map(|row| Entry {
            at: row.at,
            text: event_text(cx, row),
            style: cx.theme.normal(),
        });
        let actions = self.actions.iter().flatten().map(|row| Entry {
            at: row.at,
            text: action_text(cx, row).split_whitespace().collect::<Vec<_>>().join(" "),
            style: cx.theme.strong(),
        });
        let mut entries: Vec<Entry> = alarms.chain(actions).collect();
        entries.sort_by_key(|entry| entry.at);
        entries
    }

    /// Are older events missing, because there were too many?
    fn is_cut(&self) -> bool {
        let full = |rows: usize| EVENTS_MAX <= rows;
        full(self.alarms.as_ref().map_or(0, Vec::len)) || full(self.actions.as_ref().map_or(0, Vec::len))
    }

    /// Who was logged in at the instant, and where from; `None` until it is known, or where it may not be.
    fn logged_in(&self) -> Option<Vec<(String, String)>> {
        let (logins, detached) = (self.logins.as_ref()?, self.detached.as_ref()?);
        let mut entries: Vec<&ActionRecord> =
            logins.iter().chain(detached).filter(|row| &*row.outcome == "done" || &*row.action == "logout").collect();
        entries.sort_by_key(|row| row.at);
        let mut sessions: Vec<(String, String)> = Vec::new();
        for row in entries {
            match &*row.action {
                "login" => {
                    sessions.retain(|(_, from)| *from != *row.from);
                    sessions.push((row.target.to_string(), row.from.to_string()));
                }
                "logout" | "detach" => sessions.retain(|(_, from)| *from != *row.from),
                _ => {}
            }
        }
        Some(sessions)
    }

    /// Who acted in the minutes around the instant, and how often.
    fn acted(&self) -> Vec<(String, usize)> {
        let Some(centre) = self.centre else { return Vec::new() };
        let near = |row: &&ActionRecord| row.at.duration_since(centre).abs() <= CURVES && !row.by.is_empty();
        let mut people: Vec<(String, usize)> = Vec::new();
        for row in self.actions.iter().flatten().filter(near) {
            match people.iter_mut().find(|(name, _)| *name == *row.by) {
                Some((_, count)) => *count += 1,
                None => people.push((row.by.to_string(), 1)),
            }
        }
        people
    }
}

/// The curves of an instant: what the alarm is about that was raised last, and its group; else the first group.
pub(super) fn pens(snapshot: &Snapshot, at: Timestamp) -> Vec<Pen> {
    let since = at.checked_sub(CAUSE).unwrap_or(at);
    let raised = snapshot.alarms.iter().filter(|alarm| since <= alarm.raised_at && alarm.state != AlarmState::Shelved);
    let about = raised.max_by_key(|alarm| alarm.raised_at).map(|alarm| snapshot.def.alarm(alarm.id).subject);
    let about = match about {
        Some(Subject::Tag(tag)) => Some(tag),
        Some(Subject::Device(_) | Subject::Line(_) | Subject::Station) | None => None,
    };
    let groups = &snapshot.def.trends;
    let holds = |tag| move |pen: &Pen| pen.tag == tag;
    let of_tag = about.and_then(|tag| groups.iter().find(|group| group.pens.iter().any(holds(tag))));
    let pens = of_tag.or(groups.first()).map_or(&[][..], |group| &group.pens);
    let of_cause = about.filter(|tag| !pens.iter().any(holds(*tag)) && snapshot.def.tag(*tag).is_stored());
    // The curve of the cause is drawn however far behind it stands in its group.
    let mut pens: Vec<Pen> =
        of_cause.map(|tag| Pen { tag, scale: None }).into_iter().chain(pens.iter().copied()).collect();
    pens.sort_by_key(|pen| about != Some(pen.tag));
    pens.truncate(PENS_MAX);
    pens
}

/// So many rows, as an area has them.
fn rows(count: usize) -> u16 {
    to_u16(count)
}
