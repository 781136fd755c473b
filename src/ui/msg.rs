//! What happens to a terminal, and what it wants done.

use std::{path::PathBuf, sync::Arc, time::Duration};

use crossterm::event::KeyEvent;
use jiff::SignedDuration;
use ratatui::layout::Position;

use super::{
    extension::{Extension, ExtensionMessage},
    preferences::{Kept, PreferencesFile},
    tab::Tab,
};
use crate::{
    access::{Credentials, Durability, SessionRequest, SessionStatus},
    history::{Answer, HistoryError, Query},
    plant::{
        command::{Command, CommandId},
        request_refusal::RequestRefusal,
        snapshot::Snapshot,
    },
    register_map::named::Named,
    report::value_log::reader::ValueLog,
};

/// What happens to a terminal.
#[derive(Debug)]
pub enum Msg {
    /// The tab of the registers begins: once, before anything else.
    Begin(Start),
    /// A key.
    Key(KeyEvent),
    /// The mouse.
    Pointer(Pointer),
    /// Pasted text: never acts as keys.
    Paste(String),
    /// The screen has a new size.
    Resize(u16, u16),
    /// News of the plant.
    Snapshot(Arc<Snapshot>),
    /// The session has changed.
    SessionStatus(Arc<SessionStatus>),
    /// The reply to a request, or why it failed.
    RequestDone(QueryId, Result<Durability, RequestRefusal>),
    /// The extension has a new state.
    Extension(Arc<dyn Extension>),
    /// The history answered.
    Answer(QueryId, Result<Answer, HistoryError>),
    /// A file of this tab (`None`: of the screen) was written, or why not.
    Saved(Option<Tab>, Result<PathBuf, String>),
    /// A file that is on record as an export was not written, and why.
    ExportFailed(String, String),
    /// A log of this tab could not be written, and why.
    LogFailed(Tab, String),
    /// The text of a file that this tab wanted, or why not.
    Loaded(Tab, Result<Vec<u8>, String>),
    /// The station did not take this command: its queue is full, or it has gone.
    Undelivered(CommandId, RequestRefusal),
    /// The preferences were kept, and what the file holds now; or why not.
    Preferences(Result<PreferencesFile, String>),
    /// A frame was drawn: what it showed may be meant by the next key.
    Drawn,
    /// Half a second passed; so long ago (real time) came the last snapshot.
    Tick {
        /// Real time since the last snapshot.
        silent: Duration,
    },
}

impl Msg {
    /// Whether it may change what is shown without the user.
    pub const fn is_news(&self) -> bool {
        matches!(
            self,
            Self::Snapshot(_) | Self::SessionStatus(_) | Self::Answer(..) | Self::Extension(_) | Self::Tick { .. }
        )
    }
}

/// What the tab of the registers begins with.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Start {
    pub watch: Vec<Named>,
    /// Where it is logged.
    pub log: Option<PathBuf>,
    /// Time between two reads.
    pub every: Option<SignedDuration>,
    /// A log to look at instead of a device, and what it is called.
    pub shown: Option<(String, ValueLog)>,
}

/// What the mouse does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pointer {
    /// Its left button went down.
    Press(Position),
    /// It moved with the left button down.
    Drag(Position),
    /// The wheel turned towards the user, or away.
    Wheel {
        /// Towards.
        down: bool,
    },
}

/// What a terminal wants done.
#[derive(Debug, Clone, PartialEq)]
pub enum Effect {
    /// Give the station a command.
    Command(Command, Option<Credentials>),
    /// Send the station a request; answered by [`Msg::RequestDone`].
    SessionRequest(QueryId, SessionRequest),
    /// Ask the history.
    Query(QueryId, Query),
    /// A message to the command that added the extension.
    Extension(ExtensionMessage),
    /// Write a report or a capture; answered by [`Msg::Saved`].
    SaveReport {
        /// The tab that wants it; `None` is a screen dump.
        tab: Option<Tab>,
        /// Where, relative to the working folder.
        path: PathBuf,
        /// What.
        bytes: Vec<u8>,
        /// Never over a file that is there.
        new: bool,
    },
    /// Write files that are not there yet, all or none; answered by [`Msg::Saved`] with the last of them.
    SaveNew {
        /// The tab that wants them.
        tab: Tab,
        /// Where, relative to the working folder, and what.
        files: Vec<(PathBuf, Vec<u8>)>,
    },
    /// Read a file of the user; answered by [`Msg::Loaded`].
    Load {
        /// The tab that wants it.
        tab: Tab,
        /// Where, relative to the working folder.
        path: PathBuf,
    },
    /// Write bytes behind those of a file, in the order of these effects; only a failure is answered, by
    /// [`Msg::LogFailed`].
    Append {
        /// The tab that wants it.
        tab: Tab,
        /// Where, relative to the working folder.
        path: PathBuf,
        /// What.
        bytes: Vec<u8>,
        /// The file begins with them: it must not be there yet.
        new: bool,
    },
    /// Keep what this user has chosen; answered by [`Msg::Preferences`].
    KeepPreferences(Option<String>, Kept),
    /// Put a text into the clipboard of the terminal.
    Copy(String),
    /// Ring the bell of the terminal once.
    Bell,
    /// Forget what the terminal shows and draw everything.
    Redraw,
    /// Leave.
    Quit,
}

/// Identifies a query: who asked, and its running count. An answer to an older query is ignored.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct QueryId {
    /// The tab that asked; `None` is the replay, for a request a screen dump: they are of all tabs.
    pub tab: Option<Tab>,
    /// Chosen by who asked.
    pub number: u32,
}

/// What ends when an operator leaves the terminal.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Leaving {
    /// The station too: it runs in this process.
    #[default]
    Station,
    /// The station and the simulated plant.
    Demo,
    /// Reading a device without a plant file.
    Bench,
    /// Looking at a log.
    Log,
    /// Nothing else: the terminal is attached.
    Terminal,
}
