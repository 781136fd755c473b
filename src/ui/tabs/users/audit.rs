//! The audit list: who did what, from where, when, and how it ended; newest first, with a search that the history does.

use super::{Key, Users};
use crate::ui::tabs::prelude::*;
use crate::{plant::record::ActionRecord, report::Period, ui::modal::AuditEntryDialog};

/// What can be searched.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SearchField {
    /// Words anywhere.
    Words,
    /// Who.
    Who,
    /// Which action.
    Action,
    /// When.
    Time,
}

/// Keys of the audit list.
pub const KEYS: &[&[Key]] = &[
    &motions!("select", |users: &mut Users, cx: &ViewContext, motion| users.in_audit(|audit| audit.step(cx, motion))),
    &[
        Key::new(code(KeyCode::Enter), "open", "entry details", |users, _| users.in_audit(Audit::open)),
        Key::new(char('/'), "search", "only rows with some words", |users, _| ask(users, SearchField::Words)),
        Key::new(char('b'), "by", "only actions of a user", |users, _| ask(users, SearchField::Who)),
        Key::new(char('w'), "what", "only an action: write, login …", |users, _| ask(users, SearchField::Action)),
        Key::new(char('t'), "time", "another day or period", |users, _| ask(users, SearchField::Time)),
        Key::change(char('d'), "terminals", "show or fold attach and detach", |users, _| {
            users.in_audit(|audit| audit.unfold(!audit.unfolded));
        }),
        Key::change(char('c'), "all", "clear the search, show the last 7 days", |users, _| {
            users.in_audit(|audit| *audit = Audit::default());
        }),
        Key::change(char('j'), "users", "the list of users", |users, _| users.audit = None),
    ],
];

fn ask(users: &mut Users, field: SearchField) -> Vec<UiAction> {
    users.in_audit(|audit| audit.ask_for(field))
}

/// Rows of one answer; more are said to be left out.
const ROWS: usize = 1_000;
/// By default the list reaches back so far.
const SPAN: SignedDuration = SignedDuration::from_hours(24 * 7);
/// How often the list is refreshed, and when an answer counts as lost (real time).
const EVERY_S: f64 = 10.0;
const TIMEOUT_S: f64 = 20.0;

/// State of the list.
#[derive(Debug, Default)]
pub struct Audit {
    pub rows: Answered<Vec<ActionRecord>>,
    selected: usize,
    /// Terminals that came and went are listed one by one.
    unfolded: bool,
    /// What is searched; empty for anything.
    words: String,
    who: String,
    action: String,
    period: Option<Period>,
    /// What the open window asks for.
    asking: Option<SearchField>,
}

impl Audit {
    fn rows(&self) -> &[ActionRecord] {
        self.rows.value.as_deref().unwrap_or_default()
    }

    /// The rows of the list: each entry, or those in a row that say only that terminals came and went. A search for an
    /// action folds nothing.
    fn groups(&self) -> Vec<&[ActionRecord]> {
        let folds = !self.unfolded && self.action.is_empty();
        self.rows().chunk_by(|entry, next| folds && is_terminal(entry) && is_terminal(next)).collect()
    }

    /// The list that keys act on.
    pub fn drawn_rows(&self) -> Rows {
        let groups = self.groups();
        let rows = groups.iter().flat_map(|group| group.first().map(|row| (row, group.len())));
        Rows::of(rows.map(|(row, count)| (row.at, &row.by, &row.action, &row.target, count)), self.selected)
    }

    fn step(&mut self, cx: &ViewContext, motion: Motion) {
        self.selected = motion.to(self.selected, self.groups().len(), rows_on(cx.area.height));
    }

    /// All fields of the selected entry, or the entries that are folded into it.
    fn open(&mut self) -> Vec<UiAction> {
        let groups = self.groups();
        match groups.get(self.selected).copied() {
            Some([entry]) => open(Modal::AuditEntry(Box::new(AuditEntryDialog(entry.clone())))),
            Some(_) => {
                self.unfold(true);
                Vec::new()
            }
            None => Vec::new(),
        }
    }

    /// Asks what to search.
    fn ask_for(&mut self, field: SearchField) -> Vec<UiAction> {
        self.asking = Some(field);
        let (title, hint, text) = match field {
            SearchField::Words => (t!("search"), t!("words of any column; empty for all"), self.words.as_str()),
            SearchField::Who => {
                (t!("only by"), t!("name of a user, or a part of it; empty for all"), self.who.as_str())
            }
            SearchField::Action => {
                (t!("only this action"), t!("write, acknowledge, login …; empty for all"), &*self.action)
            }
            SearchField::Time => (t!("time"), period::FORMS, ""),
        };
        open(Modal::Prompt(Prompt::new(title, hint, text)))
    }

    /// Lists terminals one by one, or folds them; the selected entry stays selected.
    fn unfold(&mut self, unfolded: bool) {
        let entry = self.groups().get(self.selected).and_then(|group| group.first()).cloned();
        self.unfolded = unfolded;
        self.select(entry.as_ref());
    }

    /// Selects an entry, or the first one where it is gone.
    fn select(&mut self, entry: Option<&ActionRecord>) {
        let place = entry.and_then(|entry| self.groups().iter().position(|group| group.contains(entry)));
        self.selected = place.unwrap_or(0);
    }

    /// What was typed for the search.
    pub fn on_text(&mut self, cx: &ViewContext, text: &str) -> Result<(), String> {
        let text = text.trim().to_owned();
        match self.asking {
            Some(SearchField::Words) => self.words = text,
            Some(SearchField::Who) => self.who = text,
            Some(SearchField::Action) => self.action = text,
            Some(SearchField::Time) if text.is_empty() => self.period = None,
            Some(SearchField::Time) => self.period = Some(period::typed(cx.def(), &text, cx.now)?),
            None => return Ok(()),
        }
        self.asking = None;
        self.restart();
        Ok(())
    }

    /// Rows of another search must not stand under this one.
    fn restart(&mut self) {
        (self.rows, self.selected) = (Answered::default(), 0);
    }

    /// Asks the history when it is time to.
    pub fn ask(&mut self, cx: &ViewContext, number: &mut u32) -> Option<UiAction> {
        let until = cx.now + SignedDuration::from_secs(1);
        let (from, to) = self.period.as_ref().map_or((until - SPAN, until), |period| (period.from, period.to));
        let (words, by, action) = (self.words.clone(), self.who.clone(), self.action.clone());
        let query = Query::Audit { from, to, words, by, action, limit: ROWS };
        self.rows.ask(cx, (Tab::Users, number), real(cx, EVERY_S), real(cx, TIMEOUT_S), query)
    }

    /// The history answered query `number`; the selected entry stays selected, but at the top the newest one is.
    pub fn on_answer(&mut self, cx: &ViewContext, number: u32, answer: &Result<Answer, HistoryError>) {
        let groups = self.groups();
        let selected = groups.get(self.selected).and_then(|group| group.first()).filter(|_| 0 < self.selected).cloned();
        self.rows.on_answer(cx, number, answer);
        self.select(selected.as_ref());
    }

    /// Draws it.
    pub fn view(&self, cx: &ViewContext, frame: &mut Frame, area: Rect) {
        let theme = cx.theme;
        let mut canvas = Canvas::new(frame.buffer_mut(), area);
        let columns = canvas.width();
        let x = canvas.text(1, 0, t!("Audit log  "), theme.strong());
        let room = columns.saturating_sub(x + 1);
        match &self.rows.trouble {
            Some(trouble) => canvas.text(x, 0, &fit(trouble, room), theme.trouble()),
            None => canvas.text(x, 0, &fit(&self.summary(cx), room), theme.normal()),
        };
        let names = [t!("no."), t!("time"), t!("who"), t!("from"), t!("action"), t!("target")];
        let names = draw::columns(widths(columns), names);
        canvas.text(1, 1, &format!("{names} {}", t!("old → new, outcome")), theme.dim());
        if self.rows().is_empty() {
            let words = if self.rows.value.is_some() { t!("No matching entries.") } else { t!("collecting data") };
            canvas.text(2, 3, words, theme.dim());
            return;
        }
        let (rows, groups) = (rows_on(canvas.height()), self.groups());
        for (y, n, group) in on_screen(&groups, first(self.selected, groups.len(), rows), rows) {
            let style = if n == self.selected { theme.focus() } else { theme.normal() };
            let words = match group {
                [entry] => row(cx, entry, columns),
                group => folded(cx, group),
            };
            canvas.text(0, y + 2, &pad(&words, columns), style);
        }
    }

    /// `last 7 days   by anna   more than 1000: choose a time`.
    fn summary(&self, cx: &ViewContext) -> String {
        let time = self.period.as_ref().map_or(t!("last 7 days").to_owned(), |period| period::words(cx, period));
        let part = |name: &str, text: &str| (!text.is_empty()).then(|| format!("{name} \"{text}\""));
        let parts = [part(t!("by"), &self.who), part(t!("action"), &self.action), part(t!("with"), &self.words)];
        let count = match self.rows().len() {
            ROWS.. => t!("the newest {ROWS}; choose a time for others", ROWS),
            1 => t!("1 row").to_owned(),
            n => t!("{n} rows", n),
        };
        [Some(time), Some(count)].into_iter().chain(parts).flatten().collect::<Vec<_>>().join("   ")
    }
}

/// Does an entry only say that a terminal came or went? One that was refused is never folded.
fn is_terminal(entry: &ActionRecord) -> bool {
    matches!(&*entry.action, "attach" | "detach") && &*entry.outcome == "done"
}

/// Entries in a row about terminals that came and went, as one.
fn folded(cx: &ViewContext, group: &[ActionRecord]) -> String {
    let zone = &cx.def().time_zone;
    let at = |entry: Option<&ActionRecord>| entry.map_or(String::new(), |entry| moment(entry.at, cx.now, zone));
    let (newest, oldest, count) = (at(group.first()), at(group.last()), group.len());
    let attached = group.iter().filter(|entry| &*entry.action == "attach").count();
    let number = cx.theme.pick("…", "..");
    let words =
        t!("{count} entries since {oldest}: terminals attached {attached} ×, d shows them", count, oldest, attached);
    format!(" {} {words}", draw::columns([-5, 9], [number, &newest]))
}

/// Rows of the list on a tab of this height.
fn rows_on(height: u16) -> usize {
    usize::from(height.saturating_sub(2)).max(1)
}

/// Widths of the columns; none for where it was done from on a narrow screen, where the window of the entry shows it.
fn widths(columns: u16) -> [i16; 6] {
    let (from, action) = if columns >= 110 {
        (21, 13)
    } else if columns >= 80 {
        (0, 13)
    } else {
        (0, 11)
    };
    [-5, 9, 9, from, action, 11]
}

/// An entry in one row; where it is too long, its outcome is kept.
fn row(cx: &ViewContext, entry: &ActionRecord, columns: u16) -> String {
    let number = entry.chain_hash.map_or("–".to_owned(), |chain_hash| chain_hash.number.to_string());
    let at = moment(entry.at, cx.now, &cx.def().time_zone);
    let cells = [&number, &at, &*entry.by, &entry.from, &entry.action, &entry.target];
    let head = format!(" {} ", draw::columns(widths(columns), cells));
    let change = draw::change(cx, entry);
    let change = if change.is_empty() { change } else { format!("{change}  ") };
    let room = columns.saturating_sub(width(&head) + 1);
    let note = entry.note.as_ref().map_or(String::new(), |note| format!("  {note}"));
    let outcome = fit(&format!("{}{note}", entry.outcome), room.saturating_sub(width(&change)).max(room / 2));
    let change = match room.saturating_sub(width(&outcome)) {
        left if width(&change) > left => format!("{} ", fit(change.trim_end(), left.saturating_sub(1))),
        _ => change,
    };
    format!("{head}{change}{outcome}")
}
