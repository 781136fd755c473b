//! The audit list: who did what, from where, when, and how it ended; newest first, with a search that the history does.

use std::sync::Arc;

use super::{Key, Users};
use crate::ui::tabs::prelude::*;
use crate::{
    plant::{record::ActionRecord, recorded_action::RecordedAction},
    report::Period,
    ui::modal::AuditEntryDialog,
};

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SearchField {
    Words,
    Who,
    Action,
    Time,
}

pub const KEYS: &[Key] = &[
    Key::new(code(KeyCode::Enter), "open", "entry details", |users, cx| users.in_audit(|audit| audit.open(cx))),
    Key::new(char('/'), "search", "only rows with some words", |users, _| ask(users, SearchField::Words)),
    Key::new(char('b'), "by", "only the actions of a user", |users, _| ask(users, SearchField::Who)),
    Key::new(char('w'), "what", "only an action: write, login …", |users, _| ask(users, SearchField::Action)),
    Key::new(char('t'), "time", "another day or period", |users, _| ask(users, SearchField::Time)),
    Key::change(char('d'), "terminals", "show or fold attach and detach", |users, _| {
        users.in_audit(|audit| audit.of.unfolded = !audit.of.unfolded);
    }),
    Key::change(char('c'), "all", "clear the search, show the last 7 days", |users, _| {
        users.in_audit(|audit| *audit = Audit::default());
    }),
    Key::change(char('j'), "users", "the list of users", |users, _| users.audit = None),
];

fn ask(users: &mut Users, field: SearchField) -> Vec<UiAction> {
    users.in_audit(|audit| audit.ask_for(field))
}

/// Rows of one answer; more are said to be left out.
const ROWS: usize = 1_000;
/// By default the list reaches back so far.
const SPAN: SignedDuration = SignedDuration::from_hours(24 * 7);

pub type Audit = List<AuditLog>;

/// The audit log, as far as it is searched.
#[derive(Debug, Default)]
pub struct AuditLog {
    /// Terminals that came and went are listed one by one.
    unfolded: bool,
    /// What is searched; empty for anything.
    words: String,
    who: String,
    action: String,
    period: Option<Period>,
    asking: Option<SearchField>,
}

impl Listing for AuditLog {
    type Answer = Vec<ActionRecord>;
    /// An entry, or those in a row that say only that terminals came and went.
    type Row = [ActionRecord];
    type Id = (Timestamp, [Arc<str>; 3]);

    const MARKS: bool = true;

    fn heading<'a>(&self, cx: &ViewContext<'a>, entries: Option<&'a Vec<ActionRecord>>) -> Heading<'a> {
        let words = self.summary(cx, entries.map_or(0, Vec::len));
        Heading::new(t!("Audit log"), t!("No matching entries.")).words(words, cx.theme.normal())
    }

    fn query(&self, cx: &ViewContext) -> Option<Query> {
        let until = cx.now + SignedDuration::from_secs(1);
        let (from, to) = self.period.as_ref().map_or((until - SPAN, until), |period| (period.from, period.to));
        let (words, by, action) = (self.words.clone(), self.who.clone(), self.action.clone());
        Some(Query::Audit { from, to, words, by, action, limit: ROWS })
    }

    /// A search for an action folds nothing.
    fn rows<'a>(
        &'a self,
        _cx: &ViewContext<'a>,
        entries: Option<&'a Vec<ActionRecord>>,
    ) -> Vec<Cow<'a, [ActionRecord]>> {
        let folds = !self.unfolded && self.action.is_empty();
        let entries = entries.map_or(&[][..], Vec::as_slice);
        let groups = entries.chunk_by(|entry, next| folds && is_terminal(entry) && is_terminal(next));
        groups.map(Cow::Borrowed).collect()
    }

    fn id(group: &[ActionRecord]) -> Self::Id {
        id(&group[0])
    }

    fn holds(group: &[ActionRecord], wanted: &Self::Id) -> bool {
        group.iter().any(|entry| entry.at == wanted.0 && id(entry) == *wanted)
    }

    /// On a narrow screen its window shows where it was done from.
    fn columns(&self, _cx: &ViewContext, room: u16) -> Vec<Column<[ActionRecord]>> {
        vec![
            right(5, t!("no."), |_, group| number(&group[0])),
            left(9, t!("time"), |cx, group: &[ActionRecord]| moment(group[0].at, cx.now, &cx.def().time_zone))
                .by(|a, b| a[0].at.cmp(&b[0].at)),
            left(9, t!("who"), |_, group| group[0].by.to_string()),
            left(21, t!("from"), |_, group: &[ActionRecord]| group[0].from.to_string()).rank(1),
            left(if room < 80 { 11 } else { 13 }, t!("action"), |_, group| group[0].action.to_string()),
            left(11, t!("target"), |_, group| group[0].target.to_string()),
            rest(35, t!("old → new, outcome"), |cx, group, room| outcome(cx, &group[0], room)),
        ]
    }

    /// Entries in a row about terminals that came and went, as one.
    fn words(&self, cx: &ViewContext, group: &[ActionRecord]) -> Option<String> {
        let [newest, .., oldest] = group else { return None };
        let at = |entry: &ActionRecord| moment(entry.at, cx.now, &cx.def().time_zone);
        let (newest, oldest, count) = (at(newest), at(oldest), group.len());
        let attached = group.iter().filter(|entry| entry.is(RecordedAction::Attach)).count();
        let number = cx.theme.pick("…", "..");
        let words = t!(
            "{count} entries since {oldest}: terminals attached {attached} ×, d shows them",
            count,
            oldest,
            attached
        );
        Some(format!("{} {words}", draw::columns([-5, 9], [number, &newest])))
    }

    fn state(&self, _cx: &ViewContext, group: &[ActionRecord]) -> String {
        group.len().to_string()
    }
}

impl Audit {
    /// All fields of the selected entry, or the entries that are folded into it.
    fn open(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        match self.selected(cx).as_deref() {
            Some([entry]) => open(Modal::AuditEntry(Box::new(AuditEntryDialog(entry.clone())))),
            Some(_) => {
                self.of.unfolded = true;
                Vec::new()
            }
            None => Vec::new(),
        }
    }

    fn ask_for(&mut self, field: SearchField) -> Vec<UiAction> {
        let of = &mut self.of;
        of.asking = Some(field);
        let (title, hint, text) = match field {
            SearchField::Words => (t!("search"), t!("words of any column; empty for all"), of.words.as_str()),
            SearchField::Who => (t!("only by"), t!("name of a user, or a part of it; empty for all"), of.who.as_str()),
            SearchField::Action => {
                (t!("only this action"), t!("write, acknowledge, login …; empty for all"), &*of.action)
            }
            SearchField::Time => (t!("time"), period::FORMS, ""),
        };
        open(Modal::Prompt(Prompt::new(title, hint, text)))
    }

    /// What was typed for the search.
    pub fn on_text(&mut self, cx: &ViewContext, text: &str) -> Result<(), String> {
        let (text, of) = (text.trim().to_owned(), &mut self.of);
        match of.asking {
            Some(SearchField::Words) => of.words = text,
            Some(SearchField::Who) => of.who = text,
            Some(SearchField::Action) => of.action = text,
            Some(SearchField::Time) if text.is_empty() => of.period = None,
            Some(SearchField::Time) => of.period = Some(period::typed(cx.def(), &text, cx.now)?),
            None => return Ok(()),
        }
        of.asking = None;
        // Rows of another search must not stand under this one.
        *self = List::new(std::mem::take(of));
        Ok(())
    }
}

impl AuditLog {
    /// `last 7 days   by anna   more than 1000: choose a time`.
    fn summary(&self, cx: &ViewContext, count: usize) -> String {
        let time = self.period.as_ref().map_or(t!("last 7 days").to_owned(), |period| period::words(cx, period));
        let part = |name: &str, text: &str| (!text.is_empty()).then(|| format!("{name} \"{text}\""));
        let parts = [part(t!("by"), &self.who), part(t!("action"), &self.action), part(t!("with"), &self.words)];
        let count = match count {
            ROWS.. => t!("the newest {ROWS}; choose a time for others", ROWS),
            1 => t!("1 row").to_owned(),
            n => t!("{n} rows", n),
        };
        [Some(time), Some(count)].into_iter().chain(parts).flatten().collect::<Vec<_>>().join("   ")
    }
}

fn id(entry: &ActionRecord) -> (Timestamp, [Arc<str>; 3]) {
    (entry.at, [&entry.by, &entry.action, &entry.target].map(Arc::clone))
}

fn number(entry: &ActionRecord) -> String {
    entry.chain_hash.map_or("–".to_owned(), |chain_hash| chain_hash.number.to_string())
}

/// Does an entry only say that a terminal came or went? One that was refused is never folded.
fn is_terminal(entry: &ActionRecord) -> bool {
    (entry.is(RecordedAction::Attach) || entry.is(RecordedAction::Detach)) && &*entry.outcome == "done"
}

/// The change and the outcome of an entry; where it is too long, its outcome is kept.
fn outcome(cx: &ViewContext, entry: &ActionRecord, room: u16) -> String {
    let change = draw::change(cx, entry);
    let change = if change.is_empty() { change } else { format!("{change}  ") };
    let note = entry.note.as_ref().map_or(String::new(), |note| format!("  {note}"));
    let outcome = fit(&format!("{}{note}", entry.outcome), room.saturating_sub(width(&change)).max(room / 2));
    let change = match room.saturating_sub(width(&outcome)) {
        left if width(&change) > left => format!("{} ", fit(change.trim_end(), left.saturating_sub(1))),
        _ => change,
    };
    format!("{change}{outcome}")
}
