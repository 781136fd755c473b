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
        recorded_action::RecordedAction,
        snapshot::Snapshot,
    },
    ui::{
        UiAction, ViewContext, rights,
        tabs::{
            Answered, Queries,
            alarms::{action_text, event_text},
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

/// What the history knows around the instant.
#[derive(Debug, Default)]
pub struct EventPage {
    /// The instant that was asked about.
    centre: Option<Timestamp>,
    pens: Vec<Pen>,
    curves: Answered<Vec<Series>>,
    alarms: Answered<Vec<AlarmRecord>>,
    actions: Answered<Vec<ActionRecord>>,
    /// Logins and logouts of the day before, and terminals that were closed; not asked where the user may not see them.
    logins: Answered<Vec<ActionRecord>>,
    detached: Answered<Vec<ActionRecord>>,
    /// Rows that the journal is scrolled away from the instant.
    scroll: isize,
}

/// An event of the journal.
#[derive(Debug, Clone, PartialEq)]
struct NearbyEvent {
    at: Timestamp,
    text: String,
    style: ratatui::style::Style,
}

impl EventPage {
    /// Is the answer to this query waited for?
    pub fn awaits(&mut self, number: u32) -> bool {
        self.queries().iter().any(|asked| asked.query().awaits(number))
    }

    fn queries(&mut self) -> Queries<'_> {
        vec![&mut self.curves, &mut self.alarms, &mut self.actions, &mut self.logins, &mut self.detached]
    }

    /// Asks for what is around an instant, unless it is known or on its way already.
    pub fn follow(&mut self, shown: &Shown, present: &ViewContext) -> Vec<UiAction> {
        let near = |centre: Timestamp| shown.at.duration_since(centre).abs() <= CURVES / 2;
        if self.centre.is_some_and(near) || self.queries().iter().any(|asked| asked.query().is_on_way()) {
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
        let curves = Query::Series { tags, from: view.from, to: view.to, buckets: view.columns };
        let mut asked = vec![
            self.curves.ask_once(present, curves),
            self.alarms.ask_once(present, Query::Journal { from, to, limit }),
            self.actions.ask_once(present, Query::Actions { from, to, limit }),
        ];
        if rights::lacks(present, needs_for_query(&audit(""))).is_none() {
            asked.extend([
                self.logins.ask_once(present, audit("log")),
                self.detached.ask_once(present, audit("detach")),
            ]);
        }
        asked
    }

    pub fn on_answer(&mut self, present: &ViewContext, number: u32, answer: &Result<Answer, HistoryError>) {
        self.queries().into_iter().for_each(|asked| asked.on_answer(present, number, answer));
    }

    /// Why something could not be read.
    fn trouble(&self) -> Option<&str> {
        let alarms = self.curves.trouble.as_ref().or(self.alarms.trouble.as_ref());
        let of_people = self.logins.trouble.as_ref().or(self.detached.trouble.as_ref());
        alarms.or(self.actions.trouble.as_ref()).or(of_people).map(String::as_str)
    }

    /// The rows of the journal that were read.
    fn journal_rows(&self) -> [usize; 2] {
        [self.alarms.value.as_ref().map_or(0, Vec::len), self.actions.value.as_ref().map_or(0, Vec::len)]
    }

    pub fn pens(&self) -> &[Pen] {
        &self.pens
    }

    /// Scrolls the journal away from the instant; the first and the last row are those at the instant again.
    pub fn scroll(&mut self, motion: Motion) {
        let most = self.journal_rows().iter().sum::<usize>().cast_signed();
        self.scroll = match motion {
            Motion::Rows(by) => self.scroll + by,
            Motion::Pages(by) => self.scroll + by * PAGE.cast_signed(),
            Motion::First | Motion::Last => 0,
        }
        .clamp(-most, most);
    }

    /// The journal around the instant, to be copied.
    pub fn copied(&self, cx: &ViewContext) -> Vec<String> {
        self.entries(cx).iter().map(|entry| format!("{}\t{}", cx.local(entry.at, "%F %T%.3f"), entry.text)).collect()
    }

    /// The window of the curves, in columns of a chart of this width.
    fn window(&self, cx: &ViewContext, width: u16) -> View {
        let centre = self.centre.unwrap_or(cx.now);
        let end = centre.checked_add(CURVES).unwrap_or(centre);
        View::ending(end, 2 * CURVES.as_secs(), chart::dots(cx.theme, width, 1))
    }

    /// Alarm events and actions, oldest first.
    fn entries(&self, cx: &ViewContext) -> Vec<NearbyEvent> {
        let alarms = self.alarms.value.iter().flatten().map(|row| NearbyEvent {
            at: row.at,
            text: event_text(cx, row),
            style: cx.theme.normal(),
        });
        let actions = self.actions.value.iter().flatten().map(|row| NearbyEvent {
            at: row.at,
            text: action_text(cx, row).split_whitespace().collect::<Vec<_>>().join(" "),
            style: cx.theme.strong(),
        });
        let mut entries: Vec<NearbyEvent> = alarms.chain(actions).collect();
        entries.sort_by_key(|entry| entry.at);
        entries
    }

    /// Are older events missing, because there were too many?
    fn is_cut(&self) -> bool {
        self.journal_rows().iter().any(|rows| EVENTS_MAX <= *rows)
    }

    /// Who was logged in at the instant, and where from; `None` until it is known, or where it may not be.
    fn logged_in(&self) -> Option<Vec<(String, String)>> {
        let (logins, detached) = (self.logins.value.as_ref()?, self.detached.value.as_ref()?);
        let mut entries: Vec<&ActionRecord> = logins
            .iter()
            .chain(detached)
            .filter(|row| &*row.outcome == "done" || row.is(RecordedAction::Logout))
            .collect();
        entries.sort_by_key(|row| row.at);
        let mut sessions: Vec<(String, String)> = Vec::new();
        for row in entries {
            match row.known_action() {
                Some(RecordedAction::Login) => {
                    sessions.retain(|(_, from)| *from != *row.from);
                    sessions.push((row.target.to_string(), row.from.to_string()));
                }
                Some(RecordedAction::Logout | RecordedAction::Detach) => {
                    sessions.retain(|(_, from)| *from != *row.from)
                }
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
        for row in self.actions.value.iter().flatten().filter(near) {
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
