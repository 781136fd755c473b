//! The terminal's loop: keys, snapshots, answers and ticks become messages; effects become commands, queries and frames.

mod append;
mod files;
mod paint;
mod preferences;
mod question;
mod screen;
mod frame_backend;
#[cfg(test)]
mod tests;

use std::{io, path::PathBuf, sync::Arc, time::Duration};

use crossterm::event::{Event, EventStream, MouseButton, MouseEvent, MouseEventKind};
use futures_util::{StreamExt, stream::BoxStream};
use ratatui::layout::Position;
use tokio::{
    signal::unix::{SignalKind, signal},
    sync::{mpsc, oneshot},
    task::AbortHandle,
    time::{Instant, MissedTickBehavior, interval, sleep_until},
};

use super::{
    Effect, Leaving, Model, Msg, QueryId, TICK,
    extension::{Extension, ExtensionMessage},
    graphics::Graphics,
    msg::{Pointer, Start},
    preferences::{Kept, PreferencesFile},
    tabs::Tab,
    theme::Theme,
    update,
};
use crate::{
    access::SessionRequest,
    history::{HistoryError, Query, io::QueryRequest},
    profile::OwnProfiles,
    station::{Request, Session},
    t,
    text::Language,
};
use screen::{Screen, own};

/// Least time between two frames without a key.
const FRAME: Duration = Duration::from_millis(250);
/// Least time between two frames while keys come in.
const ECHO: Duration = Duration::from_millis(30);
/// Answers that may wait to be taken in; the history's own queue bounds the queries.
const INBOX: usize = 32;

/// What can be chosen about a terminal.
pub struct Options {
    /// What the terminal can show.
    pub theme: Theme,
    /// What its users have chosen.
    pub preferences: PreferencesFile,
    /// The language that it begins with, if the terminal has its letters.
    pub language: Language,
    /// The command line says so: it goes before what the user has kept.
    pub language_is_chosen: bool,
    /// What ends with it.
    pub leaving: Leaving,
    /// It begins with the tour of a demonstration.
    pub tour: bool,
    /// What the embedding command adds.
    pub extension: Option<ExtensionPort>,
    /// What the registers of a bench begin with.
    pub start: Start,
    /// The user's own device profiles, which are recognised too.
    pub profiles: OwnProfiles,
}

/// The embedding command's end of an [`Extension`].
pub struct ExtensionPort {
    /// Its states, the first at once; may be polled after its end.
    pub states: BoxStream<'static, Arc<dyn Extension>>,
    /// Receives the messages of its tab; must not block.
    pub send: Box<dyn Fn(ExtensionMessage) + Send>,
}

impl Options {
    /// Looks chosen by the environment and by the users of this account.
    pub fn new(leaving: Leaving) -> Options {
        let env = |name: &str| std::env::var(name).ok();
        let (theme, language) = (Theme::detect(env), Language::detect(env));
        let preferences = preferences::load();
        let (extension, start, profiles) = Default::default();
        let language_is_chosen = false;
        Options { theme, preferences, language, language_is_chosen, leaving, tour: false, extension, start, profiles }
    }
}

/// Why a terminal ended, other than by its operator or a signal.
#[derive(Debug, thiserror::Error)]
pub enum UiError {
    /// Standard input or output is no terminal, or a dumb one.
    #[error("no terminal: run in a terminal, or use --headless to run without screens")]
    NotATerminal,
    /// The terminal has gone or does not take what it is sent.
    #[error("the terminal is closed: {0}")]
    Lost(#[from] io::Error),
    /// No snapshot will come any more.
    #[error("the station has stopped")]
    StationGone,
}

/// An error unless there is a terminal to draw on: to be asked before anything is started.
pub fn require_terminal() -> Result<(), UiError> {
    if Screen::exists() { Ok(()) } else { Err(UiError::NotATerminal) }
}

/// Runs a terminal until its operator leaves it, a signal ends it, or the terminal or the station goes.
/// The terminal is restored before this returns.
pub async fn run(session: Session, options: Options) -> Result<(), UiError> {
    require_terminal()?;
    let (outbox, inbox) = mpsc::channel(INBOX);
    let mut session = session;
    let snapshot = session.snapshots.borrow_and_update().clone();
    let status = session.status.borrow_and_update().clone();
    let mut model = Model::new(snapshot, options.theme, session.terminal, status);
    model.locale = options.language.locale();
    model.chosen_locale = Some(model.locale).filter(|_| options.language_is_chosen);
    model.leaving = options.leaving;
    model.tour = options.tour.then(super::Tour::default);
    let why = options.preferences.problem.as_ref();
    model.note = why.map(|why| t!("A preference is not used: {why}", why).into());
    model.preferences_file = options.preferences;
    model.tabs.registers.profiles = options.profiles;
    let mut extension = options.extension;
    if let Some(port) = &mut extension {
        model.extension = port.states.next().await;
    }
    let env = |name: &str| std::env::var(name).ok();
    let unasked = Graphics::unasked(env, model.preferences_file.of(None).pictures);
    model.limits.graphics = Graphics { unasked, cell: question::cell_of_line(), ..Graphics::NONE };
    let screen = Screen::raise(unasked.is_none())?;
    let heard_at = Instant::now();
    let appender = append::Appender::new(outbox.clone());
    Loop {
        session,
        model,
        screen,
        painter: paint::Painter::default(),
        late: None,
        extension,
        outbox,
        appender,
        asked: Vec::new(),
        redraw_at: None,
        drawn_at: None,
        heard_at,
    }
    .run(inbox, options.start)
    .await
}

struct Loop {
    session: Session,
    model: Model,
    screen: Screen,
    painter: paint::Painter,
    /// The answer to the question of the start may still come.
    late: Option<question::LateAnswer>,
    extension: Option<ExtensionPort>,
    /// For answers and saved reports, which come from other tasks, with the plant (its count) that they were asked of.
    outbox: mpsc::Sender<(u32, Msg)>,
    /// Queries on their way, and what waits for their answers.
    asked: Vec<(QueryId, AbortHandle)>,
    /// Writes logs.
    appender: append::Appender,
    /// When the next frame is due; `None` while the screen is up to date.
    redraw_at: Option<Instant>,
    drawn_at: Option<Instant>,
    /// When the last snapshot came.
    heard_at: Instant,
}

impl Loop {
    async fn run(mut self, mut inbox: mpsc::Receiver<(u32, Msg)>, start: Start) -> Result<(), UiError> {
        let mut hangup = signal(SignalKind::hangup())?;
        let mut terminate = signal(SignalKind::terminate())?;
        let mut interrupt = signal(SignalKind::interrupt())?;
        let mut ticks = interval(TICK);
        ticks.set_missed_tick_behavior(MissedTickBehavior::Skip);
        let (width, height) = self.screen.size();
        self.handle(Msg::Resize(width, height), Duration::ZERO)?;
        if start != Start::default() {
            self.handle(Msg::Begin(start), Duration::ZERO)?;
        }
        if self.hear_answers()? {
            return Ok(());
        }
        let mut events = EventStream::new();
        loop {
            let due = self.redraw_at.unwrap_or_else(|| Instant::now() + FRAME);
            let leave = tokio::select! {
                // In this order: leaving before anything, keys before news.
                biased;
                _ = hangup.recv() => true,
                _ = terminate.recv() => true,
                _ = interrupt.recv() => true,
                event = events.next() => match event {
                    Some(event) => self.on_event(event?)?,
                    None => return Err(UiError::Lost(io::ErrorKind::UnexpectedEof.into())),
                },
                () = sleep_until(due), if self.redraw_at.is_some() => {
                    self.draw()?;
                    false
                }
                encoded = self.painter.encoded() => {
                    match encoded {
                        Some((picture, bytes)) => self.screen.paint(picture, &bytes)?,
                        // Another one may be due.
                        None => self.redraw_at = self.redraw_at.or(Some(Instant::now() + FRAME)),
                    }
                    false
                }
                changed = self.session.snapshots.changed() => {
                    changed.map_err(|_| UiError::StationGone)?;
                    self.heard_at = Instant::now();
                    let snapshot = self.session.snapshots.borrow_and_update().clone();
                    self.handle(Msg::Snapshot(snapshot), FRAME)?
                }
                Ok(()) = self.session.status.changed() => {
                    let status = self.session.status.borrow_and_update().clone();
                    self.handle(Msg::SessionStatus(status), ECHO)?
                }
                state = next_state(&mut self.extension) => self.handle(Msg::Extension(state), FRAME)?,
                Some((plants, msg)) = inbox.recv() => {
                    // Ids of one plant mean something else in another.
                    let fits = plants == self.model.plants || matches!(msg, Msg::RequestDone(..) | Msg::Preferences(_));
                    if fits { self.handle(msg, FRAME)? } else { false }
                }
                _ = ticks.tick() => {
                    let silent = self.heard_at.elapsed();
                    self.handle(Msg::Tick { silent }, FRAME)?
                }
            };
            if leave {
                return Ok(());
            }
        }
    }

    fn on_event(&mut self, event: Event) -> Result<bool, UiError> {
        if self.late.as_mut().is_some_and(|late| late.holds(&event, Instant::now())) {
            return Ok(false);
        }
        match event {
            Event::Key(key) => self.handle(Msg::Key(key), ECHO),
            Event::Paste(text) => self.handle(Msg::Paste(text), ECHO),
            Event::Resize(_, _) => {
                self.painter.forget();
                self.screen.renew()?;
                let cell = question::cell_of_line().or(self.model.limits.graphics.cell);
                self.model.limits.graphics.cell = cell;
                let (width, height) = self.screen.size();
                self.handle(Msg::Resize(width, height), ECHO)
            }
            Event::Mouse(event) => match pointer(event) {
                Some(pointer) => self.handle(Msg::Pointer(pointer), ECHO),
                None => Ok(false),
            },
            Event::FocusGained | Event::FocusLost => Ok(false),
        }
    }

    /// Takes in a message; a frame follows no sooner than `pause` after the last one. `true`: leave.
    fn handle(&mut self, msg: Msg, pause: Duration) -> Result<bool, UiError> {
        let effects = own(|| update(&mut self.model, msg));
        let due = self.drawn_at.map_or_else(Instant::now, |at| at + pause);
        self.redraw_at = Some(self.redraw_at.map_or(due, |planned| planned.min(due)));
        self.cancel();
        self.screen.set_mouse(self.model.preferences.mouse)?;
        for effect in effects {
            match effect {
                Effect::Command(command, credentials) => {
                    let id = command.id;
                    if let Err(why) = self.session.send(Request::Command(command, credentials)) {
                        own(|| update(&mut self.model, Msg::Undelivered(id, why)));
                    }
                }
                Effect::SessionRequest(id, request) => self.send_request(id, request),
                Effect::Query(id, query) => self.ask(id, query),
                Effect::Extension(message) => self.extension.iter().for_each(|port| (port.send)(message.clone())),
                Effect::SaveReport { tab, path, bytes, new } => self.save(tab, path, bytes, new),
                Effect::SaveNew { tab, files } => self.save_new(tab, files),
                Effect::Load { tab, path } => self.load(tab, path),
                Effect::Append { tab, path, bytes, new } => self.appender.append(tab, path, bytes, new),
                Effect::KeepPreferences(user, chosen) => self.keep_preferences(user, chosen),
                Effect::Copy(text) => self.screen.copy(&text)?,
                Effect::Bell => self.screen.ring()?,
                Effect::Redraw => {
                    self.painter.forget();
                    self.screen.renew()?;
                }
                Effect::Quit => return Ok(true),
            }
        }
        Ok(false)
    }

    /// Cancels the queries whose answers are not awaited any more.
    fn cancel(&mut self) {
        let Model { tabs, replay, .. } = &mut self.model;
        let mut awaits = |id: &QueryId| id.tab.map_or(replay.awaits(id.number), |tab| tabs.awaits(tab, id.number));
        self.asked.extract_if(.., |(id, _)| !awaits(id)).for_each(|(_, waiting)| waiting.abort());
        self.asked.retain(|(_, waiting)| !waiting.is_finished());
    }

    fn ask(&mut self, id: QueryId, query: Query) {
        let (reply, answer) = oneshot::channel();
        let sent = self.session.ask(QueryRequest { query, reply });
        let (outbox, plants) = (self.outbox.clone(), self.model.plants);
        let waiting = tokio::spawn(async move {
            let answer = match sent {
                Ok(()) => {
                    answer.await.unwrap_or_else(|_| Err(HistoryError::Engine("the history is closed".to_owned())))
                }
                Err(why) => Err(HistoryError::Engine(why.to_string())),
            };
            // A terminal that has left needs no answer.
            let _ = outbox.send((plants, Msg::Answer(id, answer))).await;
        });
        self.asked.push((id, waiting.abort_handle()));
    }

    fn send_request(&self, id: QueryId, request: SessionRequest) {
        let (session, outbox, plants) = (self.session.clone(), self.outbox.clone(), self.model.plants);
        tokio::spawn(async move {
            let answer = session.request(request).await;
            // A terminal that has left needs no answer.
            let _ = outbox.send((plants, Msg::RequestDone(id, answer))).await;
        });
    }

    fn load(&self, tab: Tab, path: PathBuf) {
        let (outbox, plants) = (self.outbox.clone(), self.model.plants);
        tokio::task::spawn_blocking(move || {
            let loaded = files::load(&path).map_err(|error| format!("{}: {error}", path.display()));
            let _ = outbox.blocking_send((plants, Msg::Loaded(tab, loaded)));
        });
    }

    fn keep_preferences(&self, user: Option<String>, kept: Kept) {
        let outbox = self.outbox.clone();
        let plants = self.model.plants;
        tokio::task::spawn_blocking(move || {
            let kept = preferences::keep(user.as_deref(), kept);
            let _ = outbox.blocking_send((plants, Msg::Preferences(kept)));
        });
    }
}

/// What the mouse did; `None` for what means nothing here.
fn pointer(event: MouseEvent) -> Option<Pointer> {
    let at = Position::new(event.column, event.row);
    match event.kind {
        MouseEventKind::Down(MouseButton::Left) => Some(Pointer::Press(at)),
        MouseEventKind::Drag(MouseButton::Left) => Some(Pointer::Drag(at)),
        MouseEventKind::ScrollUp => Some(Pointer::Wheel { down: false }),
        MouseEventKind::ScrollDown => Some(Pointer::Wheel { down: true }),
        _ => None,
    }
}

/// The next state of the extension; never without one.
async fn next_state(port: &mut Option<ExtensionPort>) -> Arc<dyn Extension> {
    if let Some(port) = port
        && let Some(state) = port.states.next().await
    {
        return state;
    }
    std::future::pending().await
}
