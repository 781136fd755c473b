//! What an operator looks at: `update` turns messages into state and effects, `view` draws state; both are pure.

pub(crate) mod layout;
pub(crate) mod graphics;
pub mod theme;
pub(crate) mod preferences;
pub(crate) mod extension;
mod context;
pub(crate) mod keys;
pub(crate) mod rights;
pub(crate) mod tab;
pub(crate) mod msg;
pub(crate) mod bell;
pub(crate) mod line_state;
pub(crate) mod glyph_filter;
pub(crate) mod widgets;
mod bus_text;
pub(crate) mod line_view;
pub(crate) mod interlock;
pub(crate) mod modal;
pub(crate) mod key_table;
pub(crate) mod screen_dump;
mod alarm_text;
mod command_text;
pub(crate) mod tabs;
pub(crate) mod replay;
mod model_context;
pub(crate) mod last_frame;
pub(crate) mod global;
mod replay_keys;
mod effects;
mod tour;
mod visited;
pub(crate) mod session_lock;
pub(crate) mod last_command;
pub(crate) mod plain;
pub(crate) mod chrome;
mod dispatch;
pub(crate) mod mouse;
pub(crate) mod io;

#[cfg(test)]
pub(crate) mod fixture;
#[cfg(test)]
mod tests;

pub use context::{QueryNumbers, ViewContext};
use dispatch::on_key;
use effects::perform;
use model_context::{in_words, with_replay, with_tabs};
use std::{borrow::Cow, sync::Arc, time::Duration};

use crossterm::event::{KeyCode, KeyEvent, KeyEventKind};
use ratatui::{Frame, layout::Rect};

use crate::{
    access::SessionStatus,
    history::{Answer, HistoryError},
    plant::{sample::Cause, snapshot::Snapshot},
    t,
    text::Locale,
};
use extension::Extension;
use graphics::Picture;
pub use last_command::LastCommand;
use last_frame::LastFrame;
use layout::Size;
pub use modal::UiAction;
use modal::{Confirm, Modal, Target, palette};
pub use msg::{Effect, Leaving, Msg, QueryId};
use preferences::{Bell, Preferences, PreferencesFile};
use replay::Replay;
use screen_dump::ScreenDump;
pub(crate) use screen_dump::text as text_of;
use session_lock::SessionLock;
pub use tabs::mimic::preview;
use tabs::{Tab, Tabs};
use theme::Theme;
pub(crate) use tour::Tour;
use tour::TourEvent;
use visited::Visited;

/// A station that has said nothing for so long (real time) is silent: its values are doubted.
pub const SILENCE: Duration = Duration::from_secs(3);

/// Real time between two ticks: flashing, motion, clock.
pub(crate) const TICK: Duration = Duration::from_millis(500);

/// All that a terminal knows.
#[derive(Debug)]
pub struct Model {
    /// The plant as last heard; values doubted while the station is silent.
    pub snapshot: Arc<Snapshot>,
    /// The tabs and which one is shown.
    pub tabs: Tabs,
    /// The past that the tabs show instead of the present.
    pub replay: Replay,
    /// The window on top, which gets every key.
    pub modal: Option<Modal>,
    /// How things look: as preferred, within the limits.
    pub theme: Theme,
    /// What the terminal can show.
    pub limits: Theme,
    /// The language of its texts and how it writes dates, where its user has kept none.
    pub locale: Locale,
    /// That which a key or the command line has chosen: goes before what is kept, until the user changes.
    pub chosen_locale: Option<Locale>,
    /// What the user has chosen, or tries.
    pub preferences: Preferences,
    /// What all users have chosen.
    pub preferences_file: PreferencesFile,
    /// The tick at which the bell rang last.
    pub rang_at: u32,
    /// The whole screen.
    pub screen: Rect,
    /// What time it is and how the animation stands.
    pub clock: Clock,
    /// The last command of this terminal and its outcome.
    pub last_command: Option<LastCommand>,
    /// Number of this terminal.
    pub terminal: u32,
    /// The session: user, role and lock.
    pub session: Arc<SessionStatus>,
    /// The lock, its warning, and requests on their way.
    pub session_lock: SessionLock,
    /// Tabs that were shown, for back and forward.
    pub visited: Visited,
    /// What was last gone to by the palette, the latest first.
    pub recent: Vec<Target>,
    /// Of the queries that the tabs ask.
    pub numbers: QueryNumbers,
    /// The window with work in it that waits for an unlock, and the tab that it stood on.
    pub kept: Option<(Tab, Modal)>,
    /// Commands given so far.
    pub commands_sent: u32,
    /// How often the station has come with another plant file: an answer to what was asked before is not heard.
    pub plants: u32,
    /// State that the embedding command adds.
    pub extension: Option<Arc<dyn Extension>>,
    /// What the last frame showed; `None` before the first one.
    pub last_frame: Option<LastFrame>,
    /// What the last key did, or why it did nothing; until the next one.
    pub note: Option<Cow<'static, str>>,
    /// Files of the screen that are being saved.
    pub screen_dump: ScreenDump,
    /// What ends when its operator leaves.
    pub leaving: Leaving,
    /// The tour of a demonstration.
    pub tour: Option<Tour>,
}

/// The terminal's sense of time, fed by ticks.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Clock {
    /// Real time since the last snapshot came.
    pub silent: Duration,
    /// Counts ticks, two a second: drives flashing and motion.
    pub phase: u32,
}

impl Model {
    /// A terminal that has just attached.
    pub fn new(snapshot: Arc<Snapshot>, theme: Theme, terminal: u32, session: Arc<SessionStatus>) -> Model {
        let tabs = Tabs::new(&snapshot);
        let mut model = Model {
            snapshot,
            tabs,
            replay: Replay::default(),
            modal: None,
            theme,
            limits: theme,
            locale: Locale::ENGLISH,
            chosen_locale: None,
            preferences: Preferences::default(),
            preferences_file: PreferencesFile::default(),
            rang_at: 0,
            screen: Rect::default(),
            clock: Clock::default(),
            last_command: None,
            terminal,
            session: Arc::default(),
            session_lock: SessionLock::default(),
            visited: Visited::default(),
            recent: Vec::new(),
            numbers: QueryNumbers::default(),
            kept: None,
            commands_sent: 0,
            plants: 0,
            extension: None,
            last_frame: None,
            note: None,
            screen_dump: ScreenDump::default(),
            leaving: Leaving::default(),
            tour: None,
        };
        update(&mut model, Msg::SessionStatus(session));
        model
    }

    /// The size that the shown tab needs, where the screen has only room for the banner.
    pub fn lacks_room(&self) -> Option<(u16, u16)> {
        match Size::of(self.screen) {
            Size::Tiny if self.tabs.shown.is_compact() => Some(Size::Compact.least()),
            Size::Compact if self.tabs.shown.is_compact() && self.replay.shown().is_none() => None,
            // There is no row here that says that a past is shown.
            Size::Tiny | Size::Compact => Some(Size::Narrow.least()),
            Size::Narrow | Size::Normal | Size::Wide | Size::Overview => None,
        }
    }

    /// Is the screen too small for more than the banner?
    pub fn small(&self) -> bool {
        self.lacks_room().is_some()
    }

    /// Shows all texts in this language, if the terminal has its letters.
    pub fn set_locale(&mut self, locale: Locale) {
        if !self.can_show(locale) {
            self.note = Some(t!("This terminal cannot show the letters of that language").into());
        } else if let Some(Modal::TerminalSettings(window)) = &mut self.modal {
            window.chosen.language = Some(locale.language);
        } else {
            self.chosen_locale = Some(locale);
        }
    }

    /// Doubts every value: nothing has been heard of them for too long.
    fn doubt(&mut self) {
        if self.snapshot.samples.iter().any(|sample| sample.quality.is_good()) {
            let doubted = Arc::make_mut(&mut self.snapshot);
            for sample in doubted.samples.iter_mut().filter(|sample| sample.quality.is_good()) {
                *sample = sample.uncertain(Cause::Stale);
            }
        }
    }
}

/// Takes in one message. The only place where a terminal's state changes.
pub fn update(model: &mut Model, msg: Msg) -> Vec<Effect> {
    let effects = in_words(model.words(), || on_msg(model, msg));
    // In the language that the message may have chosen.
    in_words(model.words(), || dispatch::list_keys(model));
    effects
}

fn on_msg(model: &mut Model, msg: Msg) -> Vec<Effect> {
    let event = TourEvent::of(&msg);
    let keyed = matches!(msg, Msg::Key(_) | Msg::Pointer(_)) && model.is_as_drawn();
    if msg.is_news() {
        model.note_news();
    }
    let actions = match msg {
        Msg::Key(event) if event.kind == KeyEventKind::Release => Vec::new(),
        Msg::Key(event) => on_input(model, |model| on_key(model, event)),
        Msg::Pointer(pointer) => on_input(model, |model| mouse::on_pointer(model, pointer)),
        Msg::Paste(text) => {
            on_paste(model, &text);
            Vec::new()
        }
        Msg::Resize(width, height) => {
            model.screen = Rect::new(0, 0, width, height);
            dispatch::fit_screen(model);
            with_tabs(model, |tabs, cx| tabs.shown_mut().on_snapshot(cx))
        }
        Msg::Begin(start) => with_tabs(model, |tabs, cx| tabs.registers.begin(cx, start)),
        Msg::Snapshot(snapshot) => on_snapshot(model, snapshot),
        Msg::SessionStatus(session) => session_lock::on_session_status(model, session),
        Msg::RequestDone(id, answer) => session_lock::on_request_done(model, id, answer),
        Msg::Extension(state) => {
            model.extension = Some(state);
            Vec::new()
        }
        Msg::Answer(QueryId { tab: Some(tab), number }, answer) => {
            with_tabs(model, |tabs, cx| tabs.of_mut(tab).on_answer(cx, number, answer))
        }
        Msg::Answer(QueryId { tab: None, number }, answer) => on_replayed(model, number, answer),
        Msg::LogFailed(tab, why) => {
            model.tabs.of_mut(tab).on_log_failed(&why);
            Vec::new()
        }
        Msg::Saved(Some(tab), result) => with_tabs(model, |tabs, cx| tabs.of_mut(tab).on_saved(cx, result)),
        Msg::Saved(None, result) => {
            screen_dump::on_saved(model, result);
            Vec::new()
        }
        Msg::ExportFailed(file, why) => vec![session_lock::export_failed(file, why)],
        Msg::Loaded(tab, result) => with_tabs(model, |tabs, cx| tabs.of_mut(tab).on_loaded(cx, result)),
        Msg::Undelivered(id, why) => {
            model.note_undelivered(id, why);
            Vec::new()
        }
        Msg::Tick { silent } => on_tick(model, silent),
        Msg::Preferences(kept) => {
            model.on_kept(kept);
            Vec::new()
        }
        Msg::Drawn => {
            model.note_drawn();
            Vec::new()
        }
    };
    let actions = session_lock::hold_back(model, actions);
    let actions = replay::refuse_commands(model, actions);
    let mut effects = perform(model, actions);
    let actions = tour::follow(model, event);
    effects.extend(perform(model, actions));
    dispatch::close_unseen(model);
    model.close_confirmation();
    model.apply_preferences();
    if keyed {
        model.note_keyed();
    }
    effects
}

/// A key or the mouse; now and then it is reported to the station that the terminal is in use.
fn on_input(model: &mut Model, act: impl FnOnce(&mut Model) -> Vec<UiAction>) -> Vec<UiAction> {
    let active = session_lock::active(model);
    active.map(UiAction::Do).into_iter().chain(act(model)).collect()
}

/// Draws the terminal as it stands.
pub fn view(model: &Model, frame: &mut Frame) {
    in_words(model.words(), || chrome::view(model, frame));
    glyph_filter::apply(frame.buffer_mut(), &model.theme);
    model.theme.paint_ground(frame.buffer_mut());
}

/// The terminal's own picture over the cells, while one is wanted.
pub fn picture(model: &Model) -> Option<Picture> {
    in_words(model.words(), || model.tabs.trends.picture(&model.cx()))
}

fn on_paste(model: &mut Model, text: &str) {
    dispatch::close_picture(model);
    match model.modal.take() {
        Some(mut modal) => {
            if !model.session.locked || modal.is_unlock() {
                modal.on_paste(&model.cx(), text);
            }
            model.modal = Some(modal);
        }
        None => model.tabs.shown_mut().on_paste(text),
    }
}

fn on_snapshot(model: &mut Model, snapshot: Arc<Snapshot>) -> Vec<UiAction> {
    model.clock.silent = Duration::ZERO;
    if !Arc::ptr_eq(&snapshot.def, &model.snapshot.def) && snapshot.def != model.snapshot.def {
        let actions = session_lock::on_other_plant(model, snapshot);
        return actions.into_iter().chain(with_tabs(model, |tabs, cx| tabs.shown_mut().on_snapshot(cx))).collect();
    }
    let rings = model.preferences.bell != Bell::Off && bell::rings(&model.snapshot, &snapshot);
    model.snapshot = snapshot;
    model.follow();
    if model.session.gone.is_some() {
        // What still came through is as old as all the rest.
        model.doubt();
    }
    let bell = rings.then(|| ring(model));
    bell.into_iter().chain(with_tabs(model, |tabs, cx| tabs.shown_mut().on_snapshot(cx))).collect()
}

fn ring(model: &mut Model) -> UiAction {
    model.rang_at = model.clock.phase;
    UiAction::Do(Effect::Bell)
}

fn on_tick(model: &mut Model, silent: Duration) -> Vec<UiAction> {
    model.clock.phase = model.clock.phase.wrapping_add(1);
    model.clock.silent = silent;
    let phase = model.clock.phase;
    model.last_command.take_if(|pending| pending.is_over(phase));
    if silent >= SILENCE {
        model.doubt();
    }
    let rings = model.preferences.bell == Bell::Repeated
        && bell::rings_again(&model.snapshot, phase.wrapping_sub(model.rang_at));
    let bell = rings.then(|| ring(model));
    let played = with_replay(model, Replay::on_tick);
    bell.into_iter().chain(played).chain(with_tabs(model, |tabs, cx| tabs.on_tick(cx))).collect()
}

/// The history has answered the replay. A tab that has no past gives way to the one that the terminal begins with.
fn on_replayed(model: &mut Model, number: u32, answer: Result<Answer, HistoryError>) -> Vec<UiAction> {
    if model.modal.as_ref().is_some_and(replay::gives_command) {
        // What is being filled in is of the present.
        model.replay.cancel();
    }
    let asked = with_replay(model, |replay, present| replay.on_answer(number, answer, present));
    let Model { snapshot, replay, tabs, visited, .. } = model;
    if replay.shown().is_some() && !tabs.shown.has_past() {
        let home = Tab::home(&snapshot.def);
        visited.note(tabs.shown, home);
        tabs.shown = home;
    }
    asked.into_iter().chain(with_tabs(model, |tabs, cx| tabs.shown_mut().on_snapshot(cx))).collect()
}
