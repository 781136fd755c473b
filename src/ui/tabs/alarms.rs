//! Tab 3: what is wrong, how urgent and what to do about it; what is suppressed; what was; how good the alarm system is;
//! and what the next shift must know.

mod go;
pub(crate) mod actions;
mod columns;
mod filter;
pub(crate) mod guidance;
mod handover;
mod journal;
mod keys;
mod list;
mod metrics;
mod recent;
mod select;
mod side;
mod span;
mod suppressed;
mod view;

#[cfg(test)]
mod tests;

use crate::ui::tabs::prelude::*;
use crate::{
    plant::{
        alarm::{ActiveAlarm, SuppressedAlarm},
        def::{AlarmClass, AlarmId, Priority, Subject},
    },
    ui::{layout::Size, modal::Guidance},
};
use filter::{Filter, Sort};
use handover::Handover;
use journal::{Events, Journal};
pub use journal::{action_text, event_text};
use metrics::Metrics;
use recent::Recent;
use suppressed::Suppressed;

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Page {
    /// Alarms of the process, and the urgent ones of the system.
    #[default]
    Active,
    /// Shelved, out of service, suppressed.
    Suppressed,
    /// Alarms of what watches the process.
    System,
    Journal,
    Metrics,
    /// What the next shift must know.
    Handover,
}

impl Page {
    /// Every view, in the order of the key.
    pub const ALL: [Page; 6] =
        [Page::Active, Page::Suppressed, Page::System, Page::Journal, Page::Metrics, Page::Handover];

    pub fn title(self) -> &'static str {
        match self {
            Page::Active => t!("active"),
            Page::Suppressed => t!("suppressed"),
            Page::System => t!("system"),
            Page::Journal => t!("journal"),
            Page::Metrics => t!("metrics"),
            Page::Handover => t!("handover"),
        }
    }
}

#[derive(Debug, Default)]
pub struct Alarms {
    page: Page,
    /// The selected alarm; it stays selected when the list moves.
    selected: Selected<AlarmId>,
    /// Alarms that were marked, for what is done with several; only those that are in the list.
    marked: Vec<AlarmId>,
    /// First-out groups that were folded or expanded, by their beginning; only those that are in the list.
    folds: Vec<(Timestamp, bool)>,
    filter: Filter,
    sort: Sort,
    recent: Recent,
    suppressed: Suppressed,
    journal: Journal,
    metrics: Metrics,
    handover: Handover,
}

impl TabView for Alarms {
    fn new(_snapshot: &Snapshot) -> Alarms {
        Alarms::default()
    }

    fn list(&self, _cx: &ViewContext) -> Option<&dyn ListPage> {
        match self.page {
            Page::Active | Page::System => Some(self),
            Page::Suppressed => Some(&self.suppressed),
            Page::Journal => Some(&self.journal),
            Page::Metrics | Page::Handover => None,
        }
    }

    fn list_mut(&mut self, _cx: &ViewContext) -> Option<&mut dyn ListPage> {
        match self.page {
            Page::Active | Page::System => Some(self),
            Page::Suppressed => Some(&mut self.suppressed),
            Page::Journal => Some(&mut self.journal),
            Page::Metrics | Page::Handover => None,
        }
    }

    fn back(&mut self, cx: &ViewContext) -> bool {
        // What the journal was opened for is not in the way back.
        let taken = match self.page {
            Page::Journal => self.journal.unmark(),
            _ => self.list_mut(cx).is_some_and(|list| list.back(cx)),
        };
        taken || std::mem::take(&mut self.page) != Page::Active
    }

    fn on_snapshot(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        self.forget_gone(cx);
        match self.page {
            Page::Active | Page::System => {
                let subject = self.selected(cx).map(|alarm| cx.def().alarm(alarm.id).subject);
                self.recent.ask(cx, subject)
            }
            Page::Suppressed => Vec::new(),
            Page::Journal => self.journal.ask_both(cx),
            Page::Metrics => self.metrics.ask(cx).into_iter().collect(),
            Page::Handover => self.handover.ask(cx).into_iter().collect(),
        }
    }

    fn queries(&mut self) -> Queries<'_> {
        let Events { alarms, actions, .. } = &mut self.journal.of;
        let own: Queries = vec![alarms, actions, &mut self.metrics.figures, &mut self.handover.actions];
        own.into_iter().chain(self.recent.queries()).collect()
    }

    fn on_text(&mut self, cx: &ViewContext, text: &str) -> Result<Vec<UiAction>, String> {
        if self.page == Page::Journal {
            self.journal.search(cx, text)?;
        }
        Ok(self.on_snapshot(cx))
    }

    fn view(&self, cx: &ViewContext, frame: &mut Frame, area: Rect) {
        view::draw(self, cx, frame, area);
    }
}

impl KeyTable for Alarms {
    fn keys(&self, _cx: &ViewContext) -> Keys<Alarms> {
        keys::table(self.page)
    }

    #[cfg(test)]
    fn chords() -> crate::ui::key_table::PageChords {
        Page::ALL.map(|page| (page.title(), keys::table(page).chords())).to_vec()
    }
}

impl Alarms {
    /// The selected alarm of the list: the chosen one while it is there, else the first; none on other pages.
    pub fn selected<'a>(&self, cx: &ViewContext<'a>) -> Option<&'a ActiveAlarm> {
        let rows = self.rows(cx);
        rows.get(self.place(&rows)).map(|row| row.alarm)
    }

    /// Shows the first view.
    pub fn front(&mut self) {
        self.page = Page::Active;
    }

    /// The alarms that the filter lets through, in the order of the list; `None` on pages without a list of them.
    pub fn listed<'a>(&self, cx: &ViewContext<'a>) -> Option<Vec<&'a ActiveAlarm>> {
        let list = matches!(self.page, Page::Active | Page::System);
        let mut listed: Vec<_> = self.of_page(cx).filter(|alarm| self.filter.holds(cx, alarm)).collect();
        self.sort.sort(cx.def(), &mut listed);
        list.then_some(listed)
    }
}

impl Alarms {
    fn of_page<'a>(&self, cx: &ViewContext<'a>) -> impl Iterator<Item = &'a ActiveAlarm> {
        on_page(cx, self.page)
    }

    fn rows<'a>(&self, cx: &ViewContext<'a>) -> Vec<list::AlarmRow<'a>> {
        let listed = self.listed(cx).unwrap_or_default().into_iter();
        match self.sort {
            // A wide screen shows the tree of a first-out group until it is folded.
            Sort::Urgency => {
                let chosen = |began| self.folds.iter().find(|(of, _)| *of == began).map(|(_, folded)| *folded);
                list::rows(cx.def(), listed, |began| chosen(began).unwrap_or(cx.size < Size::Wide))
            }
            Sort::Time | Sort::Name => listed.map(list::AlarmRow::plain).collect(),
        }
    }

    fn place(&self, rows: &[list::AlarmRow]) -> usize {
        self.selected.place(rows.iter().map(|row| row.alarm.id))
    }

    fn suppressed<'a>(&'a self, cx: &ViewContext<'a>) -> Option<Cow<'a, SuppressedAlarm>> {
        self.suppressed.selected(cx).filter(|_| self.page == Page::Suppressed)
    }

    /// The alarm that the keys of the page are about.
    fn target(&self, cx: &ViewContext) -> Option<AlarmId> {
        self.selected(cx).map(|alarm| alarm.id).or_else(|| self.suppressed(cx).map(|suppressed| suppressed.id))
    }

    /// Does Esc lead back here?
    fn leads_back(&self) -> bool {
        self.page != Page::Active || !self.marked.is_empty() || !self.filter.is_off()
    }

    fn turn(&mut self, by: isize) {
        self.page = Page::ALL[around(self.page as usize, by, Page::ALL.len())];
    }

    fn shift(&mut self, cx: &ViewContext, by: isize) {
        match self.page {
            Page::Journal => self.journal.shift(cx, by),
            Page::Metrics => self.metrics.shift(cx, by),
            Page::Handover => self.handover.shift(cx, by),
            Page::Active | Page::Suppressed | Page::System => {}
        }
    }

    fn turn_to_journal(&mut self, cx: &ViewContext) {
        if self.page == Page::Journal {
            self.page = Page::Active;
            return;
        }
        let of = self.target(cx).map(|alarm| guidance::journal_of(cx, cx.def().alarm(alarm).subject));
        self.journal.search_for(cx, of.unwrap_or_default());
        self.page = Page::Journal;
    }
}

/// The list of active alarms.
impl ListPage for Alarms {
    fn step(&mut self, cx: &ViewContext, motion: Motion) {
        let room = view::room(cx, cx.area.width, cx.area.height);
        let ids: Vec<AlarmId> = self.rows(cx).iter().map(|row| row.alarm.id).collect();
        self.selected.on(motion, ids, room);
    }

    fn back(&mut self, _cx: &ViewContext) -> bool {
        if !self.marked.is_empty() {
            self.marked.clear();
            return true;
        }
        std::mem::take(&mut self.filter) != Filter::default()
    }

    fn copied(&self, cx: &ViewContext) -> Vec<String> {
        let meant = self.meant(cx);
        let alarms = cx.snapshot.alarms.iter().filter(|alarm| meant.contains(&alarm.id));
        alarms.map(|alarm| actions::line(cx, alarm)).collect()
    }

    fn filter(&self) -> String {
        self.filter.typed()
    }

    fn set_filter(&mut self, _cx: &ViewContext, text: &str) {
        self.filter.type_words(text);
    }

    fn filter_hint(&self) -> &'static str {
        filter::FORMS
    }

    fn fingerprint(&self, cx: &ViewContext) -> Rows {
        let rows = self.rows(cx);
        let seen = |row: &list::AlarmRow| (row.alarm.id, row.alarm.annunciated_at, row.alarm.state);
        Rows::of(rows.iter().map(seen), self.place(&rows))
    }

    fn moment(&self, cx: &ViewContext) -> Option<Timestamp> {
        self.selected(cx).map(|alarm| alarm.raised_at)
    }
}

/// The alarms of a page. The one that every page names is on the first, whatever it is.
fn on_page<'a>(cx: &ViewContext<'a>, page: Page) -> impl Iterator<Item = &'a ActiveAlarm> {
    let (def, snapshot) = (cx.def(), cx.snapshot);
    let named = snapshot.foremost_alarm().filter(|_| page == Page::Active).map(|alarm| alarm.id);
    snapshot.alarms.iter().filter(move |alarm| Some(alarm.id) == named || is_on(page, def.alarm(alarm.id)))
}

/// Does an alarm stand on this page? Urgent trouble of the system is not kept from whoever looks at the process.
fn is_on(page: Page, def: &crate::plant::def::AlarmDef) -> bool {
    let urgent = match def.priority {
        Priority::Critical | Priority::High => true,
        Priority::Medium | Priority::Low => false,
    };
    match page {
        Page::Active => def.class == AlarmClass::Process || urgent,
        Page::System => def.class == AlarmClass::System,
        Page::Suppressed | Page::Journal | Page::Metrics | Page::Handover => false,
    }
}
