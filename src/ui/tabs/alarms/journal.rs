//! The journal: alarm events and actions of operators in one list, searched by words and by time.

use super::{filter, span};
use crate::ui::tabs::prelude::*;
use crate::{
    plant::{
        PlantDef,
        alarm::manager::subject_name,
        def::AlarmDef,
        record::{ActionRecord, AlarmRecord},
    },
    report::Period,
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

/// State of the page.
#[derive(Debug, Default)]
pub struct Journal {
    pub alarms: Answered<Vec<AlarmRecord>>,
    pub actions: Answered<Vec<ActionRecord>>,
    scroll: Scroll,
    /// Words that must all be found in a row.
    words: Words,
    /// Alarms of this area, and actions on the devices that have them.
    area: Option<String>,
    /// The chosen period; `None` is the last 24 hours.
    period: Option<Period>,
    /// Also the events of which nothing was annunciated.
    quiet: bool,
}

impl Journal {
    /// Searches for these words in the last 24 hours.
    pub fn search_for(&mut self, words: &str) {
        self.words = Words::parse(words);
        self.show(None);
    }

    /// What was typed: words, and what looks like a time is the period.
    pub fn search(&mut self, cx: &ViewContext, text: &str) -> Result<(), String> {
        let is_time = |word: &&str| word.starts_with(|c: char| c.is_ascii_digit()) && word.contains([':', '-']);
        let (times, words): (Vec<&str>, Vec<&str>) = text.split_whitespace().partition(is_time);
        let period = match times.is_empty() {
            true => None,
            false => Some(period::typed(cx.def(), &times.join(" "), cx.now)?),
        };
        self.words = Words::parse(&words.join(" "));
        self.show(period);
        Ok(())
    }

    /// What is searched for.
    pub fn typed(&self) -> String {
        self.words.to_string()
    }

    /// So many shifts later; `0` is everything of the last 24 hours.
    pub fn shift(&mut self, cx: &ViewContext, by: isize) {
        if by == 0 {
            (self.words, self.area) = (Words::default(), None);
        }
        self.show(period::step(cx, self.period.as_ref(), by));
    }

    /// Shows the next area, and all of them after the last.
    pub fn next_area(&mut self, cx: &ViewContext) {
        (self.area, self.scroll) = (filter::area_after(cx.def(), self.area.as_ref()), Scroll::default());
    }

    /// Shows the events of which nothing was annunciated, or hides them.
    pub fn toggle_quiet(&mut self) {
        (self.quiet, self.scroll) = (!self.quiet, Scroll::default());
    }

    /// Scrolls.
    pub fn step(&mut self, cx: &ViewContext, motion: Motion, room: usize) {
        self.scroll.on(motion, self.rows(cx).len(), room);
    }

    /// The instant of the first row on the screen: rows are not selected.
    pub fn moment(&self, cx: &ViewContext) -> Option<Timestamp> {
        let (rows, room) = (self.rows(cx), usize::from(cx.area.height.saturating_sub(2)));
        rows.get(self.scroll.first(rows.len(), room)).map(|(at, ..)| *at)
    }

    /// Other rows are wanted; those of before must not stand under their heading.
    fn show(&mut self, period: Option<Period>) {
        let (words, area) = (std::mem::take(&mut self.words), self.area.take());
        *self = Journal { words, area, period, quiet: self.quiet, ..Journal::default() };
    }

    fn limit(&self) -> usize {
        if self.words.is_empty() { ROWS } else { SEARCHED_ROWS }
    }

    /// Asks the history if it is time.
    pub fn ask(&mut self, cx: &ViewContext, number: &mut u32) -> Vec<UiAction> {
        let to = cx.now + SignedDuration::from_secs(1);
        let end = |period: &Period| if cx.is_past() { period.to.min(to) } else { period.to };
        let (from, to) = self.period.as_ref().map_or((to - SPAN, to), |period| (period.from, end(period)));
        let limit = self.limit();
        let (alarms, actions) = (Query::Journal { from, to, limit }, Query::Actions { from, to, limit });
        let alarms = span::ask(cx, &mut self.alarms, number, EVERY_S, self.period.as_ref(), alarms);
        let actions = span::ask(cx, &mut self.actions, number, EVERY_S, self.period.as_ref(), actions);
        alarms.into_iter().chain(actions).collect()
    }

    /// Draws it.
    pub fn view(&self, cx: &ViewContext, canvas: &mut Canvas) {
        let theme = cx.theme;
        let x = canvas.text(1, 0, t!("Journal  "), theme.strong());
        let rows = self.rows(cx);
        let (alarms, actions) = self.records();
        let all = alarms.iter().filter(|row| self.quiet || !row.event.is_quiet()).count() + actions.len();
        let period = self.period.as_ref().map_or(t!("last 24 hours").to_owned(), |period| period::words(cx, period));
        let mut what = vec![period];
        what.extend(self.area.as_ref().map(|area| t!("area {area}", area)));
        if !self.words.is_empty() {
            what.push(t!("\"{typed}\": {count} of {all}, / changes it", typed = self.typed(), count = rows.len(), all));
        }
        if alarms.len() >= self.limit() || actions.len() >= self.limit() {
            what.push(t!("the oldest omitted").to_owned());
        }
        if let times @ 1.. = cx.snapshot.history.epoch {
            let often = if times == 1 { t!("once").to_owned() } else { t!("{times} times", times) };
            what.push(t!("clock set {often} (epoch {times})", often, times));
        }
        if let hidden @ 1.. = self.hidden(cx) {
            what.push(t!("{hidden} not annunciated hidden, d shows them", hidden));
        }
        let x = canvas.text(x, 0, &what.join(", "), theme.normal());
        if let Some(trouble) = self.alarms.trouble.as_ref().or(self.actions.trouble.as_ref()) {
            canvas.text(x + 2, 0, trouble, theme.trouble());
        }
        if rows.is_empty() {
            let answered = self.alarms.value.is_some() || self.actions.value.is_some();
            let words = match (answered, self.words.is_empty() && self.area.is_none()) {
                (false, _) => t!("collecting data"),
                (true, true) => t!("No entries."),
                (true, false) => t!("No matching entries."),
            };
            canvas.text(6, 2, words, theme.normal());
            return;
        }
        let (width, room) = (canvas.width(), usize::from(canvas.height().saturating_sub(1)));
        let first = self.scroll.first(rows.len(), room);
        for (y, _, (at, text, style)) in on_screen(&rows, first, room) {
            let x = canvas.text(1, y + 1, &pad(&moment(*at, cx.now, &cx.def().time_zone), 10), theme.dim());
            canvas.text(x, y + 1, &fit_words(text, width.saturating_sub(x + 1)), *style);
        }
    }

    /// How many events are hidden because nothing of them was annunciated.
    fn hidden(&self, cx: &ViewContext) -> usize {
        if self.quiet { 0 } else { self.alarm_rows(cx).filter(|(row, _)| row.event.is_quiet()).count() }
    }

    fn records(&self) -> (&[AlarmRecord], &[ActionRecord]) {
        (self.alarms.value.as_deref().unwrap_or_default(), self.actions.value.as_deref().unwrap_or_default())
    }

    /// The alarm events that are searched for, with their words.
    fn alarm_rows<'a>(&'a self, cx: &'a ViewContext) -> impl Iterator<Item = (&'a AlarmRecord, String)> {
        let area = self.area.as_ref().map(|area| InArea::new(cx.def(), area));
        let alarms = self.records().0.iter();
        let alarms = alarms.filter(move |row| area.as_ref().is_none_or(|area| area.has_alarm(row)));
        alarms.filter_map(|row| {
            let text = alarm_text(cx, row);
            // What is cut off is found too.
            let whole = format!("{text} {} {}", row.subject, translate(&row.message));
            self.words.fit(&whole).then_some((row, text))
        })
    }

    /// Alarms and operator actions in one list, newest first.
    fn rows(&self, cx: &ViewContext) -> Vec<(Timestamp, String, Style)> {
        let (_, actions) = self.records();
        let area = self.area.as_ref().map(|area| InArea::new(cx.def(), area));
        let actions = actions.iter().filter(|row| area.as_ref().is_none_or(|area| area.has_action(row)));
        let alarms = self.alarm_rows(cx).filter(|(row, _)| self.quiet || !row.event.is_quiet());
        let alarms = alarms.map(|(row, text)| (row.at, text, cx.theme.normal()));
        let actions = actions.map(|row| (row.at, action_text(cx, row), cx.theme.strong()));
        let mut rows: Vec<_> = alarms.chain(actions.filter(|(_, text, _)| self.words.fit(text))).collect();
        rows.sort_by_key(|row| std::cmp::Reverse(row.0));
        rows
    }
}

/// What belongs to an area.
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
        action = row.action,
        change,
        outcome = row.outcome,
        by = row.by,
        note
    )
}
