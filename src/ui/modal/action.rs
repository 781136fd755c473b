//! What tabs and windows ask of the terminal: to open a window, too, so that an action and a window hold each other.

use jiff::{SignedDuration, Timestamp};

use super::{Modal, bus};
use crate::{
    access::{Credentials, SessionRequest},
    history::Query,
    plant::{
        command::{Command, CommandKind},
        def::{DeviceId, LineId, ProcedureId, TagId},
    },
    text::Locale,
    ui::{
        msg::{Effect, QueryId},
        preferences::Preferences,
        tab::Tab,
    },
};

/// What a tab or window asks of the terminal.
#[derive(Debug, Clone, PartialEq)]
pub enum UiAction {
    /// Put a window on top.
    Open(Modal),
    /// Show a tab.
    Show(Tab),
    /// Show all devices at a glance.
    ShowOverview,
    /// Show a device on the controllers tab.
    ShowDevice(DeviceId),
    /// Show a procedure there.
    ShowProcedure(ProcedureId),
    /// Show a device with one of its parameters selected.
    ShowParameter(TagId),
    /// Show the first of these tags that the mimic has there.
    ShowOnMimic(Vec<TagId>),
    /// Show the curve of a tag over a stretch of time; a moment, which begins as it ends, with the cursor on it.
    ShowOnTrends(TagId, (Timestamp, Timestamp)),
    /// Show the plant so long after the past that is shown.
    ReplayStep(SignedDuration),
    /// Show the plant as it was at an instant.
    Replay(Timestamp),
    /// The same on the event page.
    EventPage(Timestamp),
    /// Keep a past instant under a name; without one its bookmark is removed.
    Bookmark(Timestamp, Option<String>),
    /// Give a command and watch its outcome.
    Command(CommandKind),
    /// The same with the confirmed value and the credentials.
    SendCommand(Command, Option<Credentials>),
    /// Send the station a request; the answer goes to the window that waits for one, else to this tab.
    SessionRequest(Tab, SessionRequest),
    /// Keep what the user has chosen about the terminal.
    KeepPreferences(Preferences),
    /// Show all texts in this language.
    SetLocale(Locale),
    /// Keep what is filled in for a test of a line for the next time.
    KeepTest(Box<bus::Window>),
    /// Show what comes of a test of this line.
    ShowTest(LineId),
    /// Say this until the next key.
    Note(&'static str),
    /// Ask whether to leave.
    Leave,
    /// Pass on an effect as it is.
    Do(Effect),
}

/// What an action reaches: the rules of the past and of a locked terminal go by it.
#[derive(Debug, Clone, Copy)]
pub enum Scope<'a> {
    /// What the terminal shows.
    View,
    /// A window: what comes of it depends on the window.
    Window(&'a Modal),
    /// The plant, or the simulated one.
    Plant,
    /// Files and preferences of the user.
    Files,
    /// Queries, requests of a session, and the terminal itself.
    Station,
}

impl UiAction {
    /// What it reaches.
    pub fn scope(&self) -> Scope<'_> {
        match self {
            UiAction::Open(modal) => Scope::Window(modal),
            UiAction::Command(_)
            | UiAction::SendCommand(..)
            | UiAction::Do(Effect::Command(..) | Effect::Extension(_)) => Scope::Plant,
            UiAction::KeepPreferences(_)
            | UiAction::Bookmark(..)
            | UiAction::SessionRequest(_, SessionRequest::Exported { .. })
            | UiAction::Do(
                Effect::SaveReport { .. }
                | Effect::SaveNew { .. }
                | Effect::Append { new: true, .. }
                | Effect::Load { .. },
            ) => Scope::Files,
            UiAction::Show(_)
            | UiAction::ShowOverview
            | UiAction::ShowDevice(_)
            | UiAction::ShowProcedure(_)
            | UiAction::ShowParameter(_)
            | UiAction::ShowOnMimic(_)
            | UiAction::ShowOnTrends(..)
            | UiAction::Replay(_)
            | UiAction::EventPage(_)
            | UiAction::ReplayStep(_)
            | UiAction::SetLocale(_)
            | UiAction::KeepTest(_)
            | UiAction::ShowTest(_)
            | UiAction::Note(_)
            | UiAction::Leave => Scope::View,
            UiAction::SessionRequest(..) | UiAction::Do(_) => Scope::Station,
        }
    }

    /// Queries the history on behalf of a tab; `None` is the replay.
    pub fn query(tab: impl Into<Option<Tab>>, number: u32, query: Query) -> UiAction {
        UiAction::Do(Effect::Query(QueryId { tab: tab.into(), number }, query))
    }
}
