//! The journal: alarm events and actions of operators in one list, searched by words and by time.

use super::{filter, span, view};
use crate::ui::tabs::prelude::*;
use crate::{
    plant::{
        PlantDef,
        alarm::manager::subject_name,
        def::AlarmDef,
        record::{ActionRecord, AlarmRecord},
        recorded_action::RecordedAction,
    },
    report::Period,
    text::recorded,
    ui::layout::Size,
};

/// Without a chosen period the journal reaches back so far.
const SPAN: SignedDuration = SignedDuration::from_hours(24);
/// Rows of each kind that the journal holds at most; more are said to be left out.
const ROWS: usize = 500;
/// The same while something is searched for.
const SEARCHED_ROWS: usize = 2_000;
/// How often it is queried again, real time.
const EVERY_S: f64 = 5.0;
/// What may be typed, for the entry window.
pub const FORMS: &str = "words of tag, message, user; a time or a day:  TIC-1 anna   06:00-14:00   2026-11-20";

pub type Journal = List<Events>;

#[derive(Debug, Default)]
pub struct Events {
    pub alarms: Answered<Vec<AlarmRecord>>,
    pub actions: Answered<Vec<ActionRecord>>,
    /// Alarms of this area, and actions on the devices that have them.
    area: Option<String>,
    /// The chosen period; `None` is the last 24 hours.
    period: Option<Period>,
    /// Also the events of which nothing was annunciated.
    quiet: bool,
    /// Rows of each kind that were asked for.
    limit: Option<usize>,
}

/// An alarm event or an action in words.
#[derive(Debug, Clone)]
pub struct JournalEntry {
    at: Timestamp,
    text: String,
    /// What is searched beside the text: what is cut off is found too.
    whole: String,
    is_action: bool,
    /// Nothing of it was annunciated.
    is_quiet: bool,
}

impl Listing for Events {
    type Answer = ();
    type Row = JournalEntry;
    type Id = (Timestamp, String);

    const MARKS: bool = true;
    const SORTS: bool = false;
    const ACTS: bool = false;

    fn heading<'a>(&self, cx: &ViewContext<'a>, _: Option<&'a ()>) -> Heading<'a> {
        let period = self.period.as_ref().map_or(t!("last 24 hours").to_owned(), |period| period::words(cx, period));
        let mut what = vec![period];
        what.extend(self.area.as_ref().map(|area| t!("area {area}", area)));
        let (alarms, actions) = (self.alarms.value.as_ref(), self.actions.value.as_ref());
        if [alarms.map_or(0, Vec::len), actions.map_or(0, Vec::len)]
            .iter()
            .any(|count| self.limit.is_some_and(|most| most <= *count))
        {
            what.push(t!("the oldest omitted").to_owned());
        }
        if let times @ 1.. = cx.snapshot.history.epoch {
            let often = if times == 1 { t!("once").to_owned() } else { t!("{times} times", times) };
            what.push(t!("clock set {often} (epoch {times})", often, times));
        }
        if let hidden @ 1.. = self.hidden(cx) {
            what.push(t!("{hidden} not annunciated hidden, d shows them", hidden));
        }
        let is_answered = alarms.is_some() || actions.is_some();
        let trouble = self.alarms.trouble.as_ref().or(self.actions.trouble.as_ref());
        let empty = if self.area.is_none() { t!("No entries.") } else { t!("No matching entries.") };
        Heading::new(t!("Journal"), empty).words(what.join(", "), cx.theme.normal()).asked(trouble, !is_answered)
    }

    /// Alarms and operator actions in one list, newest first.
    fn rows<'a>(&'a self, cx: &ViewContext<'a>, _: Option<&'a ()>) -> Vec<Cow<'a, JournalEntry>> {
        let mut rows = self.entries(cx);
        rows.retain(|row| self.quiet || !row.is_quiet);
        rows.into_iter().map(Cow::Owned).collect()
    }

    fn id(row: &JournalEntry) -> (Timestamp, String) {
        (row.at, row.text.clone())
    }

    fn holds(row: &JournalEntry, (at, text): &(Timestamp, String)) -> bool {
        row.at == *at && row.text == *text
    }

    fn columns(&self, _cx: &ViewContext, _room: u16) -> Vec<Column<JournalEntry>> {
        vec![
            left(9, "", |cx, row: &JournalEntry| moment(row.at, cx.now, &cx.def().time_zone)).dim(),
            rest(0, "", |_, row, room| fit_words(&row.text, room.saturating_sub(1))),
        ]
    }

    fn searched(&self, _cx: &ViewContext, row: &JournalEntry) -> Option<String> {
        Some(row.whole.clone())
    }

    fn style(&self, cx: &ViewContext, row: &JournalEntry) -> Style {
        if row.is_action { cx.theme.strong() } else { cx.theme.normal() }
    }

    fn height(&self, cx: &ViewContext) -> u16 {
        view::body(cx)
    }

    fn moment(&self, row: &JournalEntry) -> Option<Timestamp> {
        Some(row.at)
    }
}

impl Events {
    fn entries(&self, cx: &ViewContext) -> Vec<JournalEntry> {
        let area = self.area.as_ref().map(|area| InArea::new(cx.def(), area));
        let alarms = self.alarms.value.iter().flatten();
        let alarms = alarms.filter(|row| area.as_ref().is_none_or(|area| area.has_alarm(row))).map(|row| {
            let text = alarm_text(cx, row);
            let whole = format!("{text} {} {}", row.subject, translate(&row.message));
            JournalEntry { at: row.at, text, whole, is_action: false, is_quiet: row.event.is_quiet() }
        });
        let actions = self.actions.value.iter().flatten();
        let actions = actions.filter(|row| area.as_ref().is_none_or(|area| area.has_action(row))).map(|row| {
            let text = action_text(cx, row);
            JournalEntry { at: row.at, whole: text.clone(), text, is_action: true, is_quiet: false }
        });
        let mut rows: Vec<JournalEntry> = alarms.chain(actions).collect();
        rows.sort_by_key(|row| std::cmp::Reverse(row.at));
        rows
    }

    /// How many events are hidden because nothing of them was annunciated.
    fn hidden(&self, cx: &ViewContext) -> usize {
        if self.quiet { 0 } else { self.entries(cx).iter().filter(|row| row.is_quiet).count() }
    }
}

impl Journal {
    /// Searches for these words in the last 24 hours.
    pub fn search_for(&mut self, cx: &ViewContext, words: &str) {
        self.show(cx, words, None);
    }

    /// What was typed: words, and what looks like a time is the period.
    pub fn search(&mut self, cx: &ViewContext, text: &str) -> Result<(), String> {
        let is_time = |word: &&str| word.starts_with(|c: char| c.is_ascii_digit()) && word.contains([':', '-']);
        let (times, words): (Vec<&str>, Vec<&str>) = text.split_whitespace().partition(is_time);
        let period = match times.is_empty() {
            true => None,
            false => Some(period::typed(cx.def(), &times.join(" "), cx.now)?),
        };
        self.show(cx, &words.join(" "), period);
        Ok(())
    }

    /// So many shifts later; `0` is everything of the last 24 hours.
    pub fn shift(&mut self, cx: &ViewContext, by: isize) {
        let words = if by == 0 { String::new() } else { self.filter() };
        if by == 0 {
            self.of.area = None;
        }
        self.show(cx, &words, period::step(cx, self.of.period.as_ref(), by));
    }

    /// Shows the next area, and all of them after the last.
    pub fn next_area(&mut self, cx: &ViewContext) {
        self.of.area = filter::area_after(cx.def(), self.of.area.as_ref());
    }

    /// Shows the events of which nothing was annunciated, or hides them.
    pub fn toggle_quiet(&mut self) {
        self.of.quiet = !self.of.quiet;
    }

    /// Other rows are wanted; those of before must not stand under their heading.
    fn show(&mut self, cx: &ViewContext, words: &str, period: Option<Period>) {
        let (area, quiet) = (self.of.area.take(), self.of.quiet);
        *self = List::new(Events { area, period, quiet, ..Events::default() });
        self.set_filter(cx, words);
    }

    /// Asks the history if it is time.
    pub fn ask_both(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        let limit = if self.is_filtered() { SEARCHED_ROWS } else { ROWS };
        self.of.limit = Some(limit);
        let Events { alarms, actions, period, .. } = &mut self.of;
        let to = cx.now + SignedDuration::from_secs(1);
        let end = |period: &Period| if cx.is_past() { period.to.min(to) } else { period.to };
        let (from, to) = period.as_ref().map_or((to - SPAN, to), |period| (period.from, end(period)));
        let queries = (Query::Journal { from, to, limit }, Query::Actions { from, to, limit });
        let of_alarms = span::ask(cx, alarms, EVERY_S, period.as_ref(), queries.0);
        let of_actions = span::ask(cx, actions, EVERY_S, period.as_ref(), queries.1);
        of_alarms.into_iter().chain(of_actions).collect()
    }
}

struct InArea<'a> {
    def: &'a PlantDef,
    alarms: Vec<&'a AlarmDef>,
}

impl<'a> InArea<'a> {
    fn new(def: &'a PlantDef, area: &str) -> InArea<'a> {
        InArea { def, alarms: def.alarms.iter().filter(|alarm| *area == alarm.area).collect() }
    }

    fn has_alarm(&self, row: &AlarmRecord) -> bool {
        let name = (&*row.subject, &*row.message);
        self.alarms.iter().any(|alarm| (subject_name(self.def, alarm.subject), &*alarm.message) == name)
    }

    /// An action on a device that has alarms of the area.
    fn has_action(&self, row: &ActionRecord) -> bool {
        let device_of = |name: &str| {
            let of_tag = self.def.tag_named(name).map(|tag| self.def.tag(tag).device);
            of_tag.or_else(|| self.def.devices.iter().find(|device| *device.name == *name).map(|device| device.id))
        };
        let device = device_of(&row.target);
        device.is_some() && self.alarms.iter().any(|alarm| device_of(subject_name(self.def, alarm.subject)) == device)
    }
}

fn alarm_text(cx: &ViewContext, row: &AlarmRecord) -> String {
    // A state by its word, a number with its decimals, as everywhere else.
    let shown = |value: Exact| match cx.def().tag_named(&row.subject) {
        Some(tag) => format!(" {}", value::number(cx, tag, value)),
        None => format!(" {value}"),
    };
    let number = row.value.map(shown).unwrap_or_default();
    let by = row.by.as_ref().map(|by| t!(" by {by}", by)).unwrap_or_default();
    let reason = row.reason.as_ref().map(|reason| format!(": {reason}")).unwrap_or_default();
    let mark = cx.theme.priority_mark(row.priority);
    // Texts are cut only where there is no room, what happened last.
    let (message, event) = match cx.area.width {
        ..80 => (14, 12),
        _ if cx.size < Size::Wide => (22, 12),
        _ => (44, 22),
    };
    let word = translate(row.event.word());
    format!(
        "{mark} {} {} {}{number}{by}{reason}",
        pad(&row.subject, 12),
        pad(translate(&row.message), message),
        pad(word, event.max(width(word)))
    )
}

/// An alarm event in words: `‹2›! TIC-1.PV temperature high  raised`.
pub fn event_text(cx: &ViewContext, row: &AlarmRecord) -> String {
    let by = row.by.as_ref().map(|by| t!(" by {by}", by)).unwrap_or_default();
    let (mark, event) = (cx.theme.priority_mark(row.priority), translate(row.event.word()));
    format!("{mark} {} {}  {event}{by}", row.subject, translate(&row.message))
}

/// An action in one line: `TIC-1.SV write 60.0 → 70.0 °C  verified by anna`.
pub fn action_text(cx: &ViewContext, row: &ActionRecord) -> String {
    let change = match (&row.old, &row.new) {
        (Some(old), Some(new)) => format!("{old} → {new}  "),
        (None, Some(new)) => format!("? → {new}  "),
        (_, None) => String::new(),
    };
    let note = row.note.as_ref().map(|note| format!(": {note}")).unwrap_or_default();
    let dot = cx.theme.pick("·", ".");
    t!(
        "  {dot}  {pad} {action} {change}{outcome} by {by}{note}",
        dot,
        pad = pad(&row.target, 12),
        action = RecordedAction::translated(&row.action),
        change,
        outcome = recorded(&row.outcome),
        by = row.by,
        note
    )
}
