//! The state of the tabs, and the trait that each of them implements.

pub(crate) mod alarms;
pub(crate) mod bus;
pub(crate) mod controllers;
pub(super) mod draw;
mod line_switch;
mod listing;
mod overlay;
mod periodic_query;
mod prelude;
mod rows;
pub(crate) mod registers;
pub(crate) mod faults;
pub(crate) mod login;
pub(crate) mod mimic;
pub(crate) mod reports;
pub(crate) mod trends;
pub(crate) mod users;

use std::path::PathBuf;

use crossterm::event::KeyEvent;
use jiff::Timestamp;
use ratatui::{
    Frame,
    layout::{Position, Rect},
};

#[cfg(test)]
use super::key_table::PageChords;
pub use super::tab::Tab;
pub use listing::ListPage;
pub use periodic_query::{Answered, Queries};
pub use rows::Rows;

use super::{
    Effect, UiAction, ViewContext,
    key_table::Keys,
    keys::Hint,
    modal::{Asked, Modal, Next},
};
use crate::{
    access::{SessionRequest, audit_log::sha256},
    history::{Answer, HistoryError},
    plant::{request_refusal::RequestRefusal, snapshot::Snapshot},
};

/// A file that is written once the station has put on record that it is.
#[derive(Debug, Clone, PartialEq)]
struct Outgoing {
    tab: Tab,
    path: PathBuf,
    bytes: Vec<u8>,
    /// Never over a file that is there.
    new: bool,
}

impl Outgoing {
    fn export_request(&self) -> UiAction {
        let file = self.path.display().to_string();
        UiAction::SessionRequest(self.tab, SessionRequest::Exported { file, sha256: Ok(sha256(&self.bytes)) })
    }
    fn write(self) -> UiAction {
        UiAction::Do(Effect::SaveReport { tab: Some(self.tab), path: self.path, bytes: self.bytes, new: self.new })
    }
}

/// What every tab answers. A new tab is a file with this trait and [`KeyTable`], and a row of `tabs!` and of [`Tab`].
pub trait TabView: Keyed {
    /// The tab as it is at the start.
    fn new(snapshot: &Snapshot) -> Self
    where
        Self: Sized;

    fn view(&self, cx: &ViewContext, frame: &mut Frame, area: Rect);

    /// The list that is shown, if the page is one.
    fn list(&self, _cx: &ViewContext) -> Option<&dyn ListPage> {
        None
    }

    /// The same, to change it.
    fn list_mut(&mut self, _cx: &ViewContext) -> Option<&mut dyn ListPage> {
        None
    }

    /// The list whose rows keys act on, each row with what an operator should have seen of it; nothing where rows stand
    /// where they are in the plant file.
    fn fingerprint(&self, cx: &ViewContext) -> Rows {
        self.list(cx).map_or(Rows::default(), |list| list.fingerprint(cx))
    }

    /// What is selected, a line each, to be copied; its parts are separated by tabs, as for a spreadsheet.
    fn copied(&self, cx: &ViewContext) -> Vec<String> {
        self.list(cx).map_or(Vec::new(), |list| list.copied(cx))
    }

    /// The past moment that is selected, for a replay to begin at.
    fn moment(&self, cx: &ViewContext) -> Option<Timestamp> {
        self.list(cx).and_then(|list| list.moment(cx))
    }

    /// The mouse is pressed at this place of the screen: selects what stands there; `false` where arrow keys do that.
    fn on_point(&mut self, _cx: &ViewContext, _at: Position) -> bool {
        false
    }

    /// Esc: a step back, `false` where there is none.
    fn back(&mut self, _cx: &ViewContext) -> bool {
        false
    }

    /// Pasted text, where a form of the tab takes it.
    fn on_paste(&mut self, _text: &str) {}

    /// A snapshot, a tick or a new size came, or the tab was just shown; only while it is shown. It queries what is due.
    fn on_snapshot(&mut self, _cx: &ViewContext) -> Vec<UiAction> {
        Vec::new()
    }

    /// What it asks the history again and again.
    fn queries(&mut self) -> Queries<'_> {
        Vec::new()
    }

    /// Is the answer to query `number` still waited for?
    fn awaits(&mut self, number: u32) -> bool {
        self.queries().iter().any(|asked| asked.query().awaits(number))
    }

    /// The history answered query `number`; an answer to an older one is ignored.
    fn on_answer(&mut self, cx: &ViewContext, number: u32, answer: Result<Answer, HistoryError>) -> Vec<UiAction> {
        self.queries().into_iter().for_each(|asked| asked.on_answer(cx, number, &answer));
        Vec::new()
    }

    /// The station answered the last request of the tab.
    fn on_request_done(&mut self, _cx: &ViewContext, _answer: Result<(), RequestRefusal>) -> Vec<UiAction> {
        Vec::new()
    }

    /// The text that was entered in a window which the tab had opened; `Err` keeps the window open and says why.
    fn on_text(&mut self, _cx: &ViewContext, _text: &str) -> Result<Vec<UiAction>, String> {
        Ok(Vec::new())
    }

    /// The text of a file that the tab wanted, or why not.
    fn on_loaded(&mut self, _cx: &ViewContext, _result: Result<Vec<u8>, String>) -> Vec<UiAction> {
        Vec::new()
    }

    /// A log of the tab could not be written.
    fn on_log_failed(&mut self, _why: &str) {}

    /// A file of the tab was written, or why not.
    fn on_saved(&mut self, _cx: &ViewContext, _result: Result<PathBuf, String>) -> Vec<UiAction> {
        Vec::new()
    }
}

/// The keys of a tab.
pub trait KeyTable: TabView + Sized + 'static {
    /// Those of the moment.
    fn keys(&self, cx: &ViewContext) -> Keys<Self>;

    /// The chords of each page, for the test that no key means two things.
    #[cfg(test)]
    fn chords() -> PageChords;

    /// A key was pressed: what the last one led to has been read.
    fn before_key(&mut self) {}

    /// A key of the table has changed the tab, which queries what it now shows.
    fn after_key(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        self.on_snapshot(cx)
    }

    /// Are keys that write not offered?
    fn reads_only(&self, _cx: &ViewContext) -> bool {
        false
    }
}

/// A tab that is driven by the rows of its tables, and by nothing else.
pub trait Keyed {
    /// A key that no window and no key of every tab has taken; `None` where it is none of the tab.
    fn press(&mut self, cx: &ViewContext, event: KeyEvent) -> Option<Vec<UiAction>>;

    /// The keys of the moment, for footer, help and palette.
    fn hints(&self, cx: &ViewContext) -> Vec<Hint>;
}

impl<T: KeyTable> Keyed for T {
    fn press(&mut self, cx: &ViewContext, event: KeyEvent) -> Option<Vec<UiAction>> {
        self.before_key();
        all_keys(self, cx).press(self, cx, event, T::after_key)
    }

    fn hints(&self, cx: &ViewContext) -> Vec<Hint> {
        all_keys(self, cx).hints(self, cx, self.reads_only(cx))
    }
}

/// The keys of a page, among those of every list where it is one.
fn all_keys<T: KeyTable>(page: &T, cx: &ViewContext) -> Keys<T> {
    let own = page.keys(cx);
    if page.list(cx).is_some() { listing::all_keys(own) } else { own }
}

/// The state of each tab: its name, field and type.
macro_rules! tabs {
    ($($tab:ident $field:ident $state:ty;)+) => {
        #[allow(missing_docs)]
        #[derive(Debug)]
        pub struct Tabs {
            pub shown: Tab,
            $(pub $field: $state),+
        }

        impl Tabs {
            pub fn new(snapshot: &Snapshot) -> Tabs {
                Tabs { shown: Tab::home(&snapshot.def), $($field: <$state>::new(snapshot)),+ }
            }
            fn of(&self, tab: Tab) -> &dyn TabView {
                match tab { $(Tab::$tab => &self.$field),+ }
            }
            pub fn of_mut(&mut self, tab: Tab) -> &mut dyn TabView {
                match tab { $(Tab::$tab => &mut self.$field),+ }
            }
            #[cfg(test)]
            pub fn chords(tab: Tab) -> PageChords {
                match tab { $(Tab::$tab => <$state as KeyTable>::chords()),+ }
            }
        }
    };
}

tabs! {
    Login login login::Login;
    Mimic mimic mimic::Mimic;
    Trends trends trends::Trends;
    Alarms alarms alarms::Alarms;
    Controllers controllers controllers::Controllers;
    Reports reports reports::Reports;
    Bus bus bus::Bus;
    Users users users::Users;
    Faults faults faults::Faults;
    Registers registers registers::Registers;
}

impl Tabs {
    pub fn shown(&self) -> &dyn TabView {
        self.of(self.shown)
    }
    pub fn shown_mut(&mut self) -> &mut dyn TabView {
        self.of_mut(self.shown)
    }
    /// Time passes: the shown tab asks for what is due; a log goes on wherever its operator looks.
    pub fn on_tick(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        let logging = self.shown != Tab::Registers && self.registers.is_logging();
        let logged = if logging { self.registers.on_snapshot(cx) } else { Vec::new() };
        logged.into_iter().chain(self.shown_mut().on_snapshot(cx)).collect()
    }
    /// What a window asks of the tab below it, which then asks for what it shows.
    pub fn on_asked(&mut self, cx: &ViewContext, asked: Asked) -> Next {
        let list = self.shown_mut().list_mut(cx);
        let prompt = match asked {
            Asked::Take(prompt) => match self.shown_mut().on_text(cx, &prompt.line.text()) {
                Ok(actions) => return Next::Do(actions),
                Err(problem) => return prompt.refused(problem),
            },
            Asked::Filter(prompt, text) => {
                list.into_iter().for_each(|list| list.set_filter(cx, &text));
                prompt
            }
            Asked::Step(prompt, motion) => {
                list.into_iter().for_each(|list| list.step(cx, motion));
                Some(prompt)
            }
        };
        let actions = self.shown_mut().on_snapshot(cx);
        match prompt {
            Some(prompt) => Next::Both(Modal::Prompt(prompt), actions),
            None => Next::Do(actions),
        }
    }
    /// Does a tab still wait for the answer to its query?
    pub fn awaits(&mut self, tab: Tab, number: u32) -> bool {
        self.of_mut(tab).awaits(number)
    }
}
