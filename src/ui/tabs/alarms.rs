//! The alarms tab: what is wrong, how urgent, since when, and what to do about it; and the journal of what was.

use crossterm::event::KeyCode;
use jiff::SignedDuration;
use ratatui::{Frame, layout::Rect, style::Style};

use super::Tab;
use crate::{
    history::{Answer, HistoryError, Question},
    plant::{
        alarm::AlarmState,
        def::{AlarmId, Condition, Level, Subject},
        record::{ActionRecord, AlarmRecord},
        snapshot::{ActiveAlarm, Snapshot},
    },
    ui::{
        Act, Cx,
        keys::{Key, char, code},
        modal::{
            Faceplate, Modal, Why,
            confirm::subject,
            faceplate::{device_words, line_state_words},
        },
        widgets::{
            text::{self, Canvas, between, fit, fit_words, moment, pad, pad_left, running, wrap},
            value,
        },
    },
};

/// What a key means here.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Action {
    /// Select so many rows further on.
    Move(isize),
    /// Show the alarms, or the journal.
    Journal,
    /// Open the faceplate of what the alarm watches.
    Open,
    /// Show the device of the alarm on the controllers tab.
    Controller,
    /// Say why the value that the alarm watches is what it is.
    Why,
}

/// Keys of this tab.
pub const KEYS: &[Key<Action>] = &[
    Key { chord: code(KeyCode::Up), label: "", help: "select the row above", action: Action::Move(-1) },
    Key { chord: code(KeyCode::Down), label: "select", help: "select the row below", action: Action::Move(1) },
    Key { chord: code(KeyCode::PageUp), label: "", help: "ten rows up", action: Action::Move(-10) },
    Key { chord: code(KeyCode::PageDown), label: "", help: "ten rows down", action: Action::Move(10) },
    Key { chord: code(KeyCode::Home), label: "", help: "first row", action: Action::Move(-9_999) },
    Key { chord: code(KeyCode::End), label: "", help: "last row", action: Action::Move(9_999) },
    Key {
        chord: code(KeyCode::Enter),
        label: "open",
        help: "faceplate of what the alarm watches",
        action: Action::Open,
    },
    Key {
        chord: char('j'),
        label: "journal",
        help: "journal of alarms and operator actions, and back",
        action: Action::Journal,
    },
    Key {
        chord: char('w'),
        label: "why",
        help: "why the value is what it is: quality, scaling, bytes",
        action: Action::Why,
    },
    Key { chord: char('c'), label: "controller", help: "parameters of the alarm's device", action: Action::Controller },
];

/// The journal reaches back so far.
const JOURNAL_SPAN: SignedDuration = SignedDuration::from_hours(24);
/// Rows of each kind that the journal holds at most; more are said to be left out.
const JOURNAL_ROWS: usize = 500;
/// The journal is asked again after so many ticks (half seconds).
const JOURNAL_TICKS: u32 = 10;

/// State of this tab.
#[derive(Debug, Default)]
pub struct Alarms {
    /// The selected alarm; it stays selected when the list moves.
    selected: Option<AlarmId>,
    /// The journal while it is shown.
    journal: Option<Journal>,
    /// Questions asked so far: even numbers ask for alarms, odd ones for actions.
    asked: u32,
    /// The bell of the terminal rings for new alarms.
    pub bell: bool,
}

#[derive(Debug, Default)]
struct Journal {
    alarms: Vec<AlarmRecord>,
    actions: Vec<ActionRecord>,
    answered: bool,
    trouble: Option<String>,
    /// First row shown.
    first: usize,
    /// Tick of the last question.
    asked_at: Option<u32>,
}

impl Alarms {
    /// As it is at the start.
    pub fn new(_snapshot: &Snapshot) -> Alarms {
        Alarms::default()
    }

    /// The selected alarm: the chosen one while it lives, else the first; none while the journal is shown.
    pub fn selected<'a>(&self, cx: &Cx<'a>) -> Option<&'a ActiveAlarm> {
        cx.snapshot.alarms.get(self.place(cx)).filter(|_| self.journal.is_none())
    }

    /// A key of [`KEYS`].
    pub fn on_key(&mut self, cx: &Cx, action: Action) -> Vec<Act> {
        match action {
            Action::Move(by) => {
                self.step(cx, by);
                Vec::new()
            }
            Action::Journal => {
                self.journal = if self.journal.is_some() { None } else { Some(Journal::default()) };
                self.on_snapshot(cx)
            }
            Action::Open => {
                self.faceplate(cx).map(|faceplate| Act::Open(Modal::Faceplate(faceplate))).into_iter().collect()
            }
            Action::Why => Why::open(self.selected(cx).and_then(|alarm| match cx.def().alarm(alarm.id).subject {
                Subject::Tag(tag) => Why::new(vec![tag], 0),
                Subject::Device(device) => Why::of_device(cx, device),
                Subject::Line(_) => None,
            })),
            Action::Controller => match self.selected(cx).map(|alarm| cx.def().alarm(alarm.id).subject) {
                Some(Subject::Device(device)) => vec![Act::ShowDevice(device)],
                Some(Subject::Tag(tag)) => vec![Act::ShowDevice(cx.def().tag(tag).device)],
                Some(Subject::Line(_)) | None => Vec::new(),
            },
        }
    }

    /// News, or time has passed: the journal is asked again every few seconds while it is shown.
    pub fn on_snapshot(&mut self, cx: &Cx) -> Vec<Act> {
        let Some(journal) = &mut self.journal else { return Vec::new() };
        if journal.asked_at.is_some_and(|at| cx.phase.wrapping_sub(at) < JOURNAL_TICKS) {
            return Vec::new();
        }
        journal.asked_at = Some(cx.phase);
        self.asked = self.asked.wrapping_add(2) & !1;
        let to = cx.now + SignedDuration::from_secs(1);
        let (from, limit) = (to - JOURNAL_SPAN, JOURNAL_ROWS);
        vec![
            Act::ask(Tab::Alarms, self.asked, Question::Journal { from, to, limit }),
            Act::ask(Tab::Alarms, self.asked + 1, Question::Actions { from, to, limit }),
        ]
    }

    /// The history answered question `number`.
    pub fn on_answer(&mut self, _cx: &Cx, number: u32, answer: Result<Answer, HistoryError>) -> Vec<Act> {
        let current = number & !1 == self.asked;
        if let Some(journal) = self.journal.as_mut().filter(|_| current) {
            journal.answered = true;
            journal.trouble = None;
            match answer {
                Ok(Answer::Journal(rows)) => journal.alarms = rows,
                Ok(Answer::Actions(rows)) => journal.actions = rows,
                Ok(Answer::Series(_) | Answer::LineMinutes(_) | Answer::Report(_) | Answer::AlarmQuality(_)) => {}
                Err(error) => journal.trouble = Some(error.to_string()),
            }
        }
        Vec::new()
    }

    /// Draws it.
    pub fn view(&self, cx: &Cx, frame: &mut Frame, area: Rect) {
        let mut canvas = Canvas::new(frame.buffer_mut(), area);
        let top = history_trouble(cx, &mut canvas);
        let (width, height) = (canvas.width(), canvas.height());
        let mut rest = canvas.part(0, top, width, height.saturating_sub(top));
        match &self.journal {
            Some(journal) => journal.view(cx, &mut rest),
            None => self.list(cx, &mut rest),
        }
    }

    fn place(&self, cx: &Cx) -> usize {
        cx.snapshot.alarms.iter().position(|alarm| Some(alarm.id) == self.selected).unwrap_or(0)
    }

    fn step(&mut self, cx: &Cx, by: isize) {
        if let Some(journal) = &mut self.journal {
            let last = (journal.alarms.len() + journal.actions.len()).saturating_sub(1);
            journal.first = journal.first.saturating_add_signed(by).min(last);
            return;
        }
        let last = cx.snapshot.alarms.len().saturating_sub(1);
        let place = self.place(cx).saturating_add_signed(by).min(last);
        self.selected = cx.snapshot.alarms.get(place).map(|alarm| alarm.id);
    }

    fn faceplate(&self, cx: &Cx) -> Option<Faceplate> {
        let alarm = self.selected(cx)?;
        match cx.def().alarm(alarm.id).subject {
            Subject::Tag(tag) => Faceplate::new(cx.def().tag(tag).label.clone(), vec![tag]),
            Subject::Device(device) => {
                let tags = cx.def().tags_of(device).take(8).map(|tag| tag.id).collect();
                Faceplate::new(format!("{} {}", cx.def().device(device).name, device_words(cx, device)), tags)
            }
            Subject::Line(_) => None,
        }
    }

    fn list(&self, cx: &Cx, canvas: &mut Canvas) {
        let theme = cx.theme;
        let alarms = &cx.snapshot.alarms;
        let count = |state| alarms.iter().filter(|alarm| alarm.state == state).count();
        let summary = format!(
            "{} unacknowledged   {} acknowledged   {} returned",
            count(AlarmState::Unacknowledged),
            count(AlarmState::Acknowledged),
            count(AlarmState::Returned)
        );
        let latched = count(AlarmState::LatchedUnacknowledged) + count(AlarmState::LatchedAcknowledged);
        let rare = [(latched, "latched"), (cx.snapshot.aside.len(), "put aside")];
        let rare: String = rare.iter().filter(|(n, _)| 0 < *n).map(|(n, word)| format!("   {n} {word}")).collect();
        let summary = summary + &rare;
        let x = canvas.text(1, 0, "Alarms  ", theme.strong());
        canvas.text(x, 0, &summary, theme.normal());
        let columns = Columns::of(cx, canvas.width());
        canvas.text(1, 1, &columns.row(["", "time", "tag", "what", "value", "state", "for"]), theme.dim());
        if alarms.is_empty() {
            canvas.text(6, 3, "No alarm is active. j shows what was.", theme.normal());
            return;
        }
        let guide = canvas.height().saturating_sub(4).min(6);
        let room = usize::from(canvas.height().saturating_sub(2 + guide)).max(1);
        let place = self.place(cx);
        let first = place.saturating_sub(room - 1);
        for (y, (n, alarm)) in alarms.iter().enumerate().skip(first).take(room).enumerate() {
            let y = y as u16 + 2;
            let def = cx.def().alarm(alarm.id);
            let style = theme.alarm(def.priority, alarm.state, false);
            let style = if n == place { style.patch(theme.focus()).fg(style.fg.unwrap_or_default()) } else { style };
            canvas.text(1, y, &columns.row(cells(cx, alarm).each_ref().map(String::as_str)), style);
            if n != place {
                canvas.text(
                    1,
                    y,
                    theme.priority_mark(def.priority),
                    theme.alarm(def.priority, alarm.state, cx.flash()),
                );
            }
        }
        if alarms.len() > first + room {
            let end = canvas.width().saturating_sub(2);
            canvas.text_right(end, 0, &format!("{} more below", alarms.len() - first - room), theme.strong());
        }
        let (width, top) = (canvas.width(), canvas.height().saturating_sub(guide));
        self.guidance(cx, &alarms[place.min(alarms.len() - 1)], &mut canvas.part(0, top, width, guide));
    }

    fn guidance(&self, cx: &Cx, alarm: &ActiveAlarm, canvas: &mut Canvas) {
        let theme = cx.theme;
        let def = cx.def().alarm(alarm.id);
        let length = canvas.width();
        canvas.run(0, 0, length, '─', theme.dim());
        let condition = condition_words(cx, alarm.id);
        let title =
            format!(" {} {} {} {condition} ", theme.priority_tag(def.priority), subject(cx, alarm.id), def.text);
        canvas.text(1, 0, &fit(&title, length.saturating_sub(2)), theme.strong());
        let guidance = &def.guidance;
        let respond = guidance
            .respond
            .map(|span| format!(" (respond within {} min)", span.as_secs().div_ceil(60)))
            .unwrap_or_default();
        let now = match def.subject {
            Subject::Tag(tag) => format!("{}, raised at {}", value::show(cx, tag).whole(), raised_value(cx, alarm)),
            Subject::Device(device) => device_words(cx, device),
            Subject::Line(line) => line_state_words(cx, line),
        };
        let rows: [(&str, &str); 4] = [
            ("now", &now),
            ("cause", &guidance.cause),
            ("effect", &guidance.effect),
            ("action", &format!("{}{respond}", guidance.action)),
        ];
        let mut y = 1;
        for (label, text) in rows {
            let text = if text.is_empty() { "–" } else { text };
            canvas.text(1, y, label, theme.dim());
            for line in wrap(text, length.saturating_sub(10)) {
                canvas.text(9, y, &line, if label == "action" { theme.strong() } else { theme.normal() });
                y += 1;
            }
        }
    }
}

impl Journal {
    fn view(&self, cx: &Cx, canvas: &mut Canvas) {
        let theme = cx.theme;
        let x = canvas.text(1, 0, "Journal  ", theme.strong());
        let full = self.alarms.len() >= JOURNAL_ROWS || self.actions.len() >= JOURNAL_ROWS;
        let what = if full { "last 24 hours, the oldest left out" } else { "last 24 hours" };
        let x = canvas.text(x, 0, what, theme.normal());
        if let Some(trouble) = &self.trouble {
            canvas.text(x + 2, 0, trouble, theme.trouble());
        }
        let rows = self.rows(cx);
        if rows.is_empty() {
            canvas.text(6, 2, if self.answered { "Nothing happened." } else { "reading …" }, theme.normal());
            return;
        }
        let width = canvas.width();
        for (y, (at, text, style)) in rows.iter().skip(self.first).enumerate() {
            let y = y as u16 + 1;
            let x = canvas.text(1, y, &pad(&moment(*at, cx.now, &cx.def().time_zone), 10), theme.dim());
            canvas.text(x, y, &fit_words(text, width.saturating_sub(x + 1)), *style);
        }
    }

    /// Alarms and deeds in one list, newest first.
    fn rows(&self, cx: &Cx) -> Vec<(jiff::Timestamp, String, Style)> {
        let alarms = self.alarms.iter().map(|row| {
            let number = |value: Option<f64>| value.map(|value| format!(" {value}")).unwrap_or_default();
            let by = row.by.as_ref().map(|by| format!(" by {by}")).unwrap_or_default();
            let mark = cx.theme.priority_mark(row.priority);
            let text = format!(
                "{mark} {} {} {}{}{by}",
                pad(&row.subject, 12),
                pad(&row.text, 22),
                pad(row.step.word(), 12),
                number(row.value)
            );
            (row.at, text, cx.theme.normal())
        });
        let actions = self.actions.iter().map(|row| {
            let change = match (&row.old, &row.new) {
                (old, Some(new)) => format!("{} → {new}  ", old.as_deref().unwrap_or("?")),
                (_, None) => String::new(),
            };
            let text = format!(
                "  {}  {} {} {change}{} by {}",
                cx.theme.pick("·", "."),
                pad(&row.target, 12),
                row.action,
                row.outcome,
                row.by
            );
            (row.at, text, cx.theme.strong())
        });
        let mut rows: Vec<_> = alarms.chain(actions).collect();
        rows.sort_by_key(|row| std::cmp::Reverse(row.0));
        rows
    }
}

/// What is wrong with the history, whole, in at most a third of the tab; returns the rows taken. The header has no room
/// for it.
fn history_trouble(cx: &Cx, canvas: &mut Canvas) -> u16 {
    let Some(trouble) = &cx.snapshot.history.trouble else { return 0 };
    let lines = wrap(&format!("history: {trouble}"), canvas.width().saturating_sub(2));
    let lines = lines.iter().take(usize::from(canvas.height() / 3).max(1));
    lines.enumerate().fold(0, |_, (y, line)| {
        canvas.text(1, y as u16, line, cx.theme.trouble());
        y as u16 + 1
    })
}

/// Widths of the columns between mark and state; wider screens give room to tag and words.
struct Columns {
    tag: u16,
    what: u16,
}

impl Columns {
    fn of(cx: &Cx, width: u16) -> Columns {
        let free = width.saturating_sub(1 + 5 + 10 + 11 + 9 + 10);
        let longest = cx.snapshot.alarms.iter().map(|alarm| text::width(&subject(cx, alarm.id))).max().unwrap_or(8);
        let tag = longest.min(free / 2);
        Columns { tag, what: free.saturating_sub(tag + 1).min(44) }
    }
    fn row(&self, [mark, time, tag, what, value, state, since]: [&str; 7]) -> String {
        let (tag, what) = (pad(tag, self.tag), pad(what, self.what));
        format!(
            "{} {} {tag} {what} {} {} {}",
            pad(mark, 4),
            pad(time, 9),
            pad_left(value, 10),
            pad(state, 8),
            pad_left(since, 8)
        )
    }
}

fn cells(cx: &Cx, alarm: &ActiveAlarm) -> [String; 7] {
    let def = cx.def().alarm(alarm.id);
    [
        cx.theme.priority_mark(def.priority).to_owned(),
        moment(alarm.raised_at, cx.now, &cx.def().time_zone),
        subject(cx, alarm.id),
        format!("{} {}", def.text, condition_words(cx, alarm.id)),
        match def.subject {
            Subject::Tag(tag) => value::show(cx, tag).within(10),
            Subject::Device(_) | Subject::Line(_) => "–".to_owned(),
        },
        alarm.state.word().to_owned(),
        running(between(alarm.raised_at, cx.now)),
    ]
}

/// The limit of an alarm: `> 72.0`; empty where there is none.
fn condition_words(cx: &Cx, alarm: AlarmId) -> String {
    let def = cx.def().alarm(alarm);
    let number = |value| match def.subject {
        Subject::Tag(tag) => cx.snapshot.format(tag, value),
        Subject::Device(_) | Subject::Line(_) => value.to_string(),
    };
    match def.condition {
        Condition::Limit { level: Level::HighHigh | Level::High, limit, .. } => format!("> {}", number(limit)),
        Condition::Limit { level: Level::Low | Level::LowLow, limit, .. } => format!("< {}", number(limit)),
        Condition::Deviation { from, limit, .. } => format!("> {} off {}", number(limit), cx.def().tag(from).short),
        Condition::State { is } => format!("= {}", number(is)),
        Condition::Rate { limit, .. } => format!("{} {limit}/min", if limit < 0.0 { "<" } else { ">" }),
        Condition::Bit { .. }
        | Condition::NoChange { .. }
        | Condition::NoUpdate { .. }
        | Condition::Changes { .. }
        | Condition::NotAnswering
        | Condition::Health { .. }
        | Condition::NotConnected => String::new(),
    }
}

fn raised_value(cx: &Cx, alarm: &ActiveAlarm) -> String {
    match (alarm.value, cx.def().alarm(alarm.id).subject) {
        (Some(value), Subject::Tag(tag)) => cx.snapshot.format(tag, value),
        (Some(_) | None, Subject::Tag(_) | Subject::Device(_) | Subject::Line(_)) => "–".to_owned(),
    }
}
