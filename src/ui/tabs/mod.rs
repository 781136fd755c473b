//! The tabs: which there are, which one is shown, and the calls that each of them answers.
//!
//! The contract of a tab is a struct with `KEYS`, `on_key`, `on_snapshot` (called on every snapshot, tick and resize, and
//! when it is shown, only while it is shown: ask here what is due), `on_answer`, `view`, and where it opens a text entry, `on_text`.

pub mod alarms;
pub mod bus;
pub mod controllers;
mod periodic_query;
pub mod faults;
pub mod login;
pub mod mimic;
pub mod reports;
pub mod trends;
pub mod users;

use std::path::PathBuf;

use crossterm::event::KeyEvent;
use ratatui::{Frame, layout::Rect};

use super::{
    Effect, QueryId, UiAction, ViewContext,
    keys::{self, Hint},
    last_frame::Rows,
    session_lock,
};
use crate::{
    access::{SessionRequest, book::sha256},
    history::{Answer, HistoryError},
    plant::{role::Role, snapshot::Snapshot},
};

/// A file that is written once the station has put on record that it is.
#[derive(Debug, Clone, PartialEq)]
struct Outgoing {
    tab: Tab,
    path: PathBuf,
    bytes: Vec<u8>,
}

impl Outgoing {
    /// Asks for it.
    fn export_request(&self) -> UiAction {
        let file = self.path.display().to_string();
        UiAction::SessionRequest(self.tab, SessionRequest::Exported { file, sha256: sha256(&self.bytes) })
    }
    /// Writes it.
    fn write(self) -> UiAction {
        UiAction::Do(Effect::SaveReport { tab: self.tab, path: self.path, bytes: self.bytes })
    }
}

/// A tab.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Tab {
    /// Who sits here.
    Login,
    /// The mimic.
    Mimic,
    /// Curves.
    Trends,
    /// Alarms and journal.
    Alarms,
    /// Parameters of the devices.
    Controllers,
    /// Shift reports.
    Reports,
    /// Lines, their plan, frames and tests.
    Bus,
    /// Users, terminals, and the audit list.
    Users,
    /// Faults of a simulated plant.
    Faults,
}

impl Tab {
    /// Every tab, in the order of its number key.
    pub const ALL: [Tab; 9] = [
        Tab::Login,
        Tab::Mimic,
        Tab::Trends,
        Tab::Alarms,
        Tab::Controllers,
        Tab::Reports,
        Tab::Bus,
        Tab::Users,
        Tab::Faults,
    ];

    /// Those that there are here. Before a login only the login page, unless the plant file lets everybody look; users
    /// only for a Supervisor; faults only where the plant is simulated, and not in an exam.
    pub fn offered(cx: &ViewContext) -> Vec<Tab> {
        let closed = session_lock::is_closed(cx.session);
        let supervisor = cx.session.who.as_ref().is_some_and(|who| who.role == Role::Supervisor);
        let there = |tab: &Tab| match tab {
            Tab::Login => true,
            Tab::Mimic | Tab::Trends | Tab::Alarms | Tab::Controllers | Tab::Reports | Tab::Bus => !closed,
            Tab::Users => !closed && supervisor,
            Tab::Faults => !closed && cx.drill.is_some_and(|status| status.is_open()),
        };
        Tab::ALL.into_iter().filter(there).collect()
    }

    /// The number key that shows it.
    pub fn number(self) -> usize {
        Tab::ALL.iter().position(|tab| *tab == self).unwrap_or(0)
    }

    /// Its heading.
    pub fn title(self) -> &'static str {
        match self {
            Tab::Login => "Login",
            Tab::Mimic => "Mimic",
            Tab::Trends => "Trends",
            Tab::Alarms => "Alarms",
            Tab::Controllers => "Controllers",
            Tab::Reports => "Reports",
            Tab::Bus => "Bus",
            Tab::Users => "Users",
            Tab::Faults => "Faults",
        }
    }
    /// The tab so many further on among those that are offered, around the end.
    pub fn step(self, offered: &[Tab], by: isize) -> Tab {
        let place = offered.iter().position(|tab| *tab == self).unwrap_or(0) as isize;
        offered[(place + by).rem_euclid(offered.len() as isize) as usize]
    }
}

/// The state of all tabs.
#[derive(Debug)]
pub struct Tabs {
    /// Which one is shown.
    pub shown: Tab,
    /// Tab 0.
    pub login: login::Login,
    /// Tab 1.
    pub mimic: mimic::Mimic,
    /// Tab 2.
    pub trends: trends::Trends,
    /// Tab 3.
    pub alarms: alarms::Alarms,
    /// Tab 4.
    pub controllers: controllers::Controllers,
    /// Tab 5.
    pub reports: reports::Reports,
    /// Tab 6.
    pub bus: bus::Bus,
    /// Tab 7, of Supervisors.
    pub users: users::Users,
    /// Tab 8, of simulated plants.
    pub faults: faults::Faults,
}

impl Tabs {
    /// All tabs as they are at the start.
    pub fn new(snapshot: &Snapshot) -> Tabs {
        Tabs {
            shown: Tab::Mimic,
            login: login::Login::default(),
            mimic: mimic::Mimic::new(snapshot),
            trends: trends::Trends::new(snapshot),
            alarms: alarms::Alarms::new(snapshot),
            controllers: controllers::Controllers::new(snapshot),
            reports: reports::Reports::new(snapshot),
            bus: bus::Bus::new(snapshot),
            users: users::Users::default(),
            faults: faults::Faults::default(),
        }
    }

    /// A key for the shown tab; one that is in no table does nothing.
    pub fn on_key(&mut self, cx: &ViewContext, event: KeyEvent) -> Vec<UiAction> {
        fn act<A: Copy>(
            table: &[keys::Key<A>],
            event: KeyEvent,
            on_key: impl FnOnce(A) -> Vec<UiAction>,
        ) -> Vec<UiAction> {
            keys::find(table, event).map(on_key).unwrap_or_default()
        }
        match self.shown {
            Tab::Login => self.login.on_key(cx, event),
            Tab::Mimic => match keys::find(mimic::KEYS, event) {
                Some(action) => self.mimic.on_key(cx, action),
                None => self.mimic.on_command_key(cx, event),
            },
            Tab::Trends => act(trends::KEYS, event, |action| self.trends.on_key(cx, action)),
            Tab::Alarms => self.alarms.on_key(cx, event),
            Tab::Controllers => self.controllers.on_key(cx, event),
            Tab::Reports => {
                self.reports.dismiss();
                act(reports::KEYS, event, |action| self.reports.on_key(cx, action))
            }
            Tab::Bus => self.bus.on_key(cx, event),
            Tab::Users => self.users.on_key(cx, event),
            Tab::Faults => act(faults::KEYS, event, |action| self.faults.on_key(cx, action)),
        }
    }

    /// The list of the shown tab whose rows keys act on, each row with what an operator should have seen of it.
    pub fn rows(&self, cx: &ViewContext) -> Rows {
        match self.shown {
            Tab::Alarms => self.alarms.drawn_rows(cx),
            Tab::Controllers => self.controllers.drawn_rows(cx),
            Tab::Bus => self.bus.drawn_rows(cx),
            Tab::Users => self.users.drawn_rows(cx),
            Tab::Faults => self.faults.drawn_rows(cx),
            // What can be selected here stands where it is in the plant file.
            Tab::Login | Tab::Mimic | Tab::Trends | Tab::Reports => Rows::default(),
        }
    }

    /// The keys of the shown tab.
    pub fn hints(&self, cx: &ViewContext) -> Vec<Hint> {
        match self.shown {
            Tab::Login => self.login.hints(cx),
            Tab::Mimic => self.mimic.hints(cx),
            Tab::Trends => keys::hints(trends::KEYS),
            Tab::Alarms => self.alarms.hints(cx),
            Tab::Controllers => self.controllers.hints(cx),
            Tab::Reports => keys::hints(reports::KEYS),
            Tab::Bus => self.bus.hints(cx),
            Tab::Users => self.users.hints(),
            Tab::Faults => self.faults.hints(cx),
        }
    }

    /// Esc on the shown tab: a step back, `false` where there is none.
    pub fn back(&mut self, cx: &ViewContext) -> bool {
        match self.shown {
            Tab::Controllers => self.controllers.back(cx),
            Tab::Users => self.users.back(),
            Tab::Alarms => self.alarms.back(),
            Tab::Bus => self.bus.back(cx),
            Tab::Login | Tab::Mimic | Tab::Trends | Tab::Reports | Tab::Faults => false,
        }
    }

    /// News, or time has passed, or the tab was just shown.
    pub fn on_snapshot(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        match self.shown {
            Tab::Mimic => self.mimic.on_snapshot(cx),
            Tab::Trends => self.trends.on_snapshot(cx),
            Tab::Alarms => self.alarms.on_snapshot(cx),
            Tab::Controllers => self.controllers.on_snapshot(cx),
            Tab::Reports => self.reports.on_snapshot(cx),
            Tab::Bus => self.bus.on_snapshot(cx),
            Tab::Users => self.users.on_snapshot(cx),
            Tab::Login | Tab::Faults => Vec::new(),
        }
    }

    /// Does the tab that asked still wait for the answer?
    pub fn awaits(&self, id: QueryId) -> bool {
        match id.tab {
            Tab::Mimic => self.mimic.awaits(id.number),
            Tab::Trends => self.trends.awaits(id.number),
            Tab::Alarms => self.alarms.awaits(id.number),
            Tab::Controllers => self.controllers.awaits(id.number),
            Tab::Reports => self.reports.awaits(id.number),
            Tab::Bus => self.bus.awaits(id.number),
            Tab::Users => self.users.awaits(id.number),
            Tab::Login | Tab::Faults => false,
        }
    }

    /// An answer goes to the tab that asked, shown or not.
    pub fn on_answer(&mut self, cx: &ViewContext, id: QueryId, answer: Result<Answer, HistoryError>) -> Vec<UiAction> {
        match id.tab {
            Tab::Mimic => self.mimic.on_answer(cx, id.number, answer),
            Tab::Trends => self.trends.on_answer(cx, id.number, answer),
            Tab::Alarms => self.alarms.on_answer(cx, id.number, answer),
            Tab::Users => {
                self.users.on_answer(cx, id.number, answer);
                Vec::new()
            }
            Tab::Login | Tab::Faults => Vec::new(),
            Tab::Controllers => {
                self.controllers.on_answer(cx, id.number, answer);
                Vec::new()
            }
            Tab::Bus => {
                self.bus.on_answer(cx, id.number, answer);
                Vec::new()
            }
            Tab::Reports => self.reports.on_answer(cx, id.number, answer),
        }
    }

    /// A reply goes to the tab that asked, shown or not.
    pub fn on_request_done(&mut self, cx: &ViewContext, id: QueryId, answer: Result<(), String>) -> Vec<UiAction> {
        match id.tab {
            Tab::Login => self.login.on_request_done(cx, answer),
            Tab::Reports => return self.reports.on_request_done(answer),
            Tab::Bus => return self.bus.on_request_done(answer),
            Tab::Mimic | Tab::Trends | Tab::Alarms | Tab::Controllers | Tab::Users | Tab::Faults => {}
        }
        Vec::new()
    }

    /// The text that was entered in a window which the shown tab had opened; `Err` keeps the window open and says why.
    pub fn on_text(&mut self, cx: &ViewContext, text: &str) -> Result<Vec<UiAction>, String> {
        match self.shown {
            Tab::Trends => self.trends.on_text(cx, text),
            Tab::Reports => self.reports.on_text(cx, text),
            Tab::Bus => self.bus.on_text(cx, text),
            Tab::Controllers => self.controllers.on_text(cx, text),
            Tab::Users => self.users.on_text(cx, text),
            Tab::Alarms => self.alarms.on_text(cx, text),
            Tab::Login | Tab::Mimic | Tab::Faults => Ok(Vec::new()),
        }
    }

    /// A file was written, or why not: told to the tab that wanted it, shown or not.
    pub fn on_saved(&mut self, cx: &ViewContext, tab: Tab, result: Result<PathBuf, String>) -> Vec<UiAction> {
        match tab {
            Tab::Reports => return self.reports.on_saved(cx, result),
            Tab::Bus => self.bus.on_saved(result),
            Tab::Login | Tab::Mimic | Tab::Trends | Tab::Alarms | Tab::Controllers | Tab::Users | Tab::Faults => {}
        }
        Vec::new()
    }

    /// Draws the shown tab.
    pub fn view(&self, cx: &ViewContext, frame: &mut Frame, area: Rect) {
        match self.shown {
            Tab::Login => self.login.view(cx, frame, area),
            Tab::Mimic => self.mimic.view(cx, frame, area),
            Tab::Trends => self.trends.view(cx, frame, area),
            Tab::Alarms => self.alarms.view(cx, frame, area),
            Tab::Controllers => self.controllers.view(cx, frame, area),
            Tab::Reports => self.reports.view(cx, frame, area),
            Tab::Bus => self.bus.view(cx, frame, area),
            Tab::Users => self.users.view(cx, frame, area),
            Tab::Faults => self.faults.view(cx, frame, area),
        }
    }
}
