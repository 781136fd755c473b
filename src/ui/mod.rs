//! What an operator looks at: `update` turns messages into state and effects, `view` draws state; both are pure.

mod context;
mod effects;
pub(crate) mod bell;
pub(crate) mod chrome;
pub(crate) mod last_frame;
pub(crate) mod extension;
pub(crate) mod glyph_filter;
pub(crate) mod io;
pub(crate) mod interlock;
pub(crate) mod keys;
pub(crate) mod modal;
pub(crate) mod msg;
pub(crate) mod session_lock;
pub(crate) mod replay;
pub(crate) mod rights;
pub(crate) mod tabs;
pub(crate) mod theme;
pub(crate) mod last_command;
pub(crate) mod widgets;

#[cfg(test)]
pub(crate) mod fixture;
#[cfg(test)]
mod tests;

pub use context::ViewContext;
use context::{past_context, view_context, with_tabs};
use effects::perform;
use std::{sync::Arc, time::Duration};

use crossterm::event::{KeyEvent, KeyEventKind};
use ratatui::{Frame, layout::Rect};

use crate::{
    access::SessionStatus,
    history::{Answer, HistoryError},
    plant::{alarm::AlarmCommand, command::CommandKind, sample::Cause, snapshot::Snapshot},
    text::Language,
};
use extension::Extension;
use keys::Global;
pub use last_command::LastCommand;
use last_frame::LastFrame;
use modal::{Confirm, Modal};
pub use msg::{Effect, Leaving, Msg, QueryId, UiAction};
use replay::Replay;
use session_lock::SessionLock;
use tabs::{Tab, Tabs, alarms::actions};
use theme::Theme;

/// A station that has said nothing for so long (real time) is silent: its values are doubted.
pub const SILENCE: Duration = Duration::from_secs(3);

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
    /// How things look.
    pub theme: Theme,
    /// The language of its texts.
    pub language: Language,
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
    /// Why the last key did nothing; until the next one.
    pub note: Option<&'static str>,
    /// What ends when its operator leaves.
    pub leaving: Leaving,
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
            language: Language::default(),
            screen: Rect::default(),
            clock: Clock::default(),
            last_command: None,
            terminal,
            session: Arc::default(),
            session_lock: SessionLock::default(),
            kept: None,
            commands_sent: 0,
            plants: 0,
            extension: None,
            last_frame: None,
            note: None,
            leaving: Leaving::default(),
        };
        update(&mut model, Msg::SessionStatus(session));
        model
    }

    /// Is the screen too small for more than the banner?
    pub fn small(&self) -> bool {
        chrome::layout(self.screen).small
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
    model.language.within(|| on_msg(model, msg))
}

fn on_msg(model: &mut Model, msg: Msg) -> Vec<Effect> {
    let keyed = matches!(msg, Msg::Key(_)) && model.is_as_drawn();
    if matches!(msg, Msg::Snapshot(_) | Msg::SessionStatus(_) | Msg::Answer(..) | Msg::Extension(_) | Msg::Tick { .. })
    {
        model.note_news();
    }
    let actions = match msg {
        Msg::Key(event) if event.kind == KeyEventKind::Release => Vec::new(),
        Msg::Key(event) => {
            let active = session_lock::active(model);
            let actions = on_key(model, event);
            active.map(UiAction::Do).into_iter().chain(actions).collect()
        }
        Msg::Paste(text) => {
            match &mut model.modal {
                Some(modal) if model.session.locked && !modal.is_unlock() => {}
                Some(modal) => modal.on_paste(&text),
                None => model.tabs.shown_mut().on_paste(&text),
            }
            Vec::new()
        }
        Msg::Resize(width, height) => {
            model.screen = Rect::new(0, 0, width, height);
            if model.small() {
                // A window that cannot be seen must not take keys. What it held is dropped, nothing is done.
                model.modal.take_if(|modal| !modal.is_quit());
            }
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
        Msg::Saved(tab, result) => with_tabs(model, |tabs, cx| tabs.of_mut(tab).on_saved(cx, result)),
        Msg::Loaded(tab, result) => with_tabs(model, |tabs, cx| tabs.of_mut(tab).on_loaded(cx, result)),
        Msg::Undelivered(id, why) => {
            model.note_undelivered(id, why.into());
            Vec::new()
        }
        Msg::Tick { silent } => on_tick(model, silent),
        Msg::Drawn => {
            model.note_drawn();
            Vec::new()
        }
    };
    let actions = session_lock::hold_back(model, actions);
    let actions = replay::refuse_commands(model, actions);
    let effects = perform(model, actions);
    model.close_confirmation();
    if keyed {
        model.note_keyed();
    }
    effects
}

/// Draws the terminal as it stands.
pub fn view(model: &Model, frame: &mut Frame) {
    model.language.within(|| chrome::view(model, frame));
    glyph_filter::apply(frame.buffer_mut(), &model.theme);
}

fn on_key(model: &mut Model, event: KeyEvent) -> Vec<UiAction> {
    model.note = None;
    if keys::find(&keys::global(), event) == Some(Global::Lock) {
        return session_lock::lock(model);
    }
    if session_lock::ask_before_work(model, event) {
        return Vec::new();
    }
    let past = session_lock::is_past_unlock(model, event);
    if let Some(show @ Global::Show(tab)) = keys::find(&keys::global(), event)
        && model.modal.as_ref().is_some_and(|modal| !modal.takes_text())
        && Tab::offered(&model.cx()).contains(&tab)
    {
        // The number of a tab leads there from every window that has no use for it.
        model.modal = None;
        return on_global(model, show);
    }
    if let Some(modal) = model.modal.take_if(|_| !past) {
        let Model { snapshot, theme, clock, extension, session, screen, tabs, replay, .. } = model;
        let cx = past_context(view_context(snapshot, theme, *clock, *screen, extension, session), replay);
        let (rest, actions) = modal.on_key(&cx, tabs, event);
        model.modal = rest;
        return actions;
    }
    if model.tabs.shown == Tab::Login && model.tabs.login.is_typing() && !model.small() {
        return session_lock::on_typed(model, event);
    }
    if let Some(action) = keys::find(replay::KEYS, event).filter(|_| model.replay.shown().is_some()) {
        let present = model.present_cx().now;
        let actions = match action {
            replay::Action::GoTo => on_global(model, Global::Replay),
            _ => model.replay.on_key(action, present).into_iter().map(UiAction::Do).collect(),
        };
        return actions.into_iter().chain(with_tabs(model, |tabs, cx| tabs.shown_mut().on_snapshot(cx))).collect();
    }
    match keys::find(&keys::global(), event) {
        Some(global @ (Global::Quit | Global::Acknowledge | Global::Redraw)) => on_global(model, global),
        // No command goes to what is not visible.
        Some(_) | None if model.small() => Vec::new(),
        Some(global) => on_global(model, global),
        None if !model.may_act(event) => Vec::new(),
        None => with_tabs(model, |tabs, cx| tabs.shown_mut().on_key(cx, event)),
    }
}

fn on_global(model: &mut Model, global: Global) -> Vec<UiAction> {
    match global {
        Global::Show(tab) if Tab::offered(&model.cx()).contains(&tab) => {
            if tab == Tab::Alarms && model.tabs.shown != tab {
                model.tabs.alarms.front();
            }
            vec![UiAction::Show(tab)]
        }
        Global::Show(_) => Vec::new(),
        Global::Next => vec![UiAction::Show(model.tabs.shown.step(&Tab::offered(&model.cx()), 1))],
        Global::Previous => vec![UiAction::Show(model.tabs.shown.step(&Tab::offered(&model.cx()), -1))],
        Global::Lock => session_lock::lock(model),
        Global::Acknowledge | Global::AcknowledgeAll | Global::Silence if model.replay.shown().is_some() => {
            model.note = Some(replay::refused());
            Vec::new()
        }
        // A bench has no history.
        Global::Replay if model.snapshot.def.is_bench() || session_lock::is_closed(&model.session) => Vec::new(),
        Global::Replay => vec![UiAction::Open(replay::ask_instant(&model.cx(), model.tabs.shown()))],
        Global::Help => vec![UiAction::Open(Modal::Help(0))],
        Global::Quit => vec![UiAction::Leave],
        Global::Acknowledge => last_frame::acknowledge(model),
        Global::AcknowledgeAll => {
            let cx = model.cx();
            let listed = (model.tabs.shown == Tab::Alarms).then(|| model.tabs.alarms.listed(&cx)).flatten();
            match listed {
                Some(listed) => actions::acknowledge_all(&cx, listed.into_iter()),
                None => actions::acknowledge_all(&cx, cx.snapshot.alarms.iter()),
            }
        }
        // Where nothing sounds there is nothing to silence.
        Global::Silence if model.snapshot.sound => vec![UiAction::Command(CommandKind::Alarm(AlarmCommand::Silence))],
        Global::Silence => Vec::new(),
        Global::Redraw => vec![UiAction::Do(Effect::Redraw)],
        Global::Dismiss => {
            // A failure that is being read is dismissed first; everything else does not hold up the way back.
            let failed = model.last_command.take().is_some_and(|pending| pending.is_trouble());
            if !failed {
                with_tabs(model, |tabs, cx| {
                    tabs.shown_mut().back(cx);
                    Vec::new()
                });
            }
            Vec::new()
        }
    }
}

fn on_snapshot(model: &mut Model, snapshot: Arc<Snapshot>) -> Vec<UiAction> {
    model.clock.silent = Duration::ZERO;
    if !Arc::ptr_eq(&snapshot.def, &model.snapshot.def) && snapshot.def != model.snapshot.def {
        let actions = session_lock::on_other_plant(model, snapshot);
        return actions.into_iter().chain(with_tabs(model, |tabs, cx| tabs.shown_mut().on_snapshot(cx))).collect();
    }
    let rings = model.tabs.alarms.bell && bell::rings(&model.snapshot, &snapshot);
    model.snapshot = snapshot;
    model.follow();
    if model.session.gone.is_some() {
        // What still came through is as old as all the rest.
        model.doubt();
    }
    let bell = rings.then_some(UiAction::Do(Effect::Bell));
    bell.into_iter().chain(with_tabs(model, |tabs, cx| tabs.shown_mut().on_snapshot(cx))).collect()
}

fn on_tick(model: &mut Model, silent: Duration) -> Vec<UiAction> {
    model.clock.phase = model.clock.phase.wrapping_add(1);
    model.clock.silent = silent;
    let phase = model.clock.phase;
    model.last_command.take_if(|pending| pending.is_over(phase));
    if silent >= SILENCE {
        model.doubt();
    }
    let present = model.present_cx().now;
    let played = model.replay.on_tick(present).into_iter().map(UiAction::Do);
    played.chain(with_tabs(model, |tabs, cx| tabs.on_tick(cx))).collect()
}

/// The history has answered the replay. A tab that has no past gives way to the one that the terminal begins with.
fn on_replayed(model: &mut Model, number: u32, answer: Result<Answer, HistoryError>) -> Vec<UiAction> {
    let Model { snapshot, theme, clock, extension, session, screen, replay, tabs, .. } = model;
    let present = view_context(snapshot, theme, *clock, *screen, extension, session);
    let asked = replay.on_answer(number, answer, &present);
    if replay.shown().is_some() && !tabs.shown.has_past() {
        tabs.shown = Tab::home(&snapshot.def);
    }
    let asked = asked.into_iter().map(UiAction::Do);
    asked.chain(with_tabs(model, |tabs, cx| tabs.shown_mut().on_snapshot(cx))).collect()
}
