//! The session of this terminal: what is open to its user, the idle lock and its warning, and activity messages to the station.

use crate::t;
use std::{mem, sync::Arc, time::Duration};

use crossterm::event::{KeyCode, KeyEvent};

use super::{
    Effect, Model, QueryId, UiAction,
    global::{self, Reach},
    keys,
    modal::{Modal, Notice, Scope, UserForm, user_form::Purpose},
    model_context::with_tabs,
    replay::Replay,
    rights, screen_dump,
    tabs::{Keyed, Tab, Tabs, login},
    visited::Visited,
};
use crate::{
    access::{Durability, SessionRequest, SessionStatus},
    plant::{request_refusal::RequestRefusal, snapshot::Snapshot},
};

/// Ticks between two words that keys are pressed: 30 s of real time.
const ACTIVE_TICKS: u32 = 60;
/// The same once the station has said that it will lock.
const WARNED_TICKS: u32 = 4;

/// Times of the session and the lock, in ticks, and the number of the last request.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct SessionLock {
    /// Number of the last request; only its answer counts, and those of exports.
    pub last_request: u32,
    /// Requests to record a file, which waits for its own answer, whatever was requested since.
    exports: Vec<(Tab, u32)>,
    /// When the present session status came.
    status_at: u32,
    /// When the last activity message was sent.
    active_at: Option<u32>,
    /// When the connection to the station was lost.
    gone_at: Option<u32>,
}

impl SessionLock {
    /// The number of a request that goes out. 0 means no request: numbers start at 1.
    pub(super) fn next_request(&mut self, tab: Tab, request: &SessionRequest) -> u32 {
        self.last_request = self.last_request.checked_add(1).unwrap_or(1);
        if matches!(request, SessionRequest::Exported { sha256: Ok(_), .. }) {
            self.exports.push((tab, self.last_request));
        }
        self.last_request
    }
}

impl Model {
    /// How long ago the station went.
    pub fn gone(&self) -> Option<Duration> {
        let at = self.session.gone.as_ref().and(self.session_lock.gone_at)?;
        Some(Duration::from_millis(500) * self.clock.phase.wrapping_sub(at))
    }

    /// Time until the terminal is locked, once the station has said that this is near.
    pub fn locks_in(&self) -> Option<Duration> {
        let passed = Duration::from_millis(500) * self.clock.phase.wrapping_sub(self.session_lock.status_at);
        self.session.locks_in.filter(|_| !self.session.locked).map(|left| left.saturating_sub(passed))
    }
}

/// The station tells how this terminal stands.
pub(super) fn on_session_status(model: &mut Model, session: Arc<SessionStatus>) -> Vec<UiAction> {
    let before = mem::replace(&mut model.session, session);
    let (now, phase) = (model.session.clone(), model.clock.phase);
    model.session_lock.status_at = phase;
    now.undelivered.iter().for_each(|(id, why)| model.note_undelivered(*id, why.clone()));
    match (&before.gone, &now.gone) {
        (None, Some(_)) => {
            model.session_lock.gone_at = Some(phase);
            model.doubt();
        }
        (_, None) => model.session_lock.gone_at = None,
        (Some(_), Some(_)) => {}
    }
    // A window closes when the user changes. A user who only unlocks finds the open window again.
    let user = |session: &SessionStatus| session.who.as_ref().map(|who| who.user.clone());
    if user(&before) != user(&now) || rights::is_closed(&now) {
        model.modal.take_if(|modal| !modal.is_quit());
        model.last_command = model.last_command.take_if(|_| user(&before) == user(&now));
        model.kept = None;
        (model.visited, model.recent) = (Visited::default(), Vec::new());
    }
    if user(&before) != user(&now) {
        model.locale = model.chosen_locale.take().unwrap_or(model.locale);
    }
    if user(&before) != user(&now) || now.locked && !before.locked {
        // What one user has begun is not done for another.
        for (tab, _) in mem::take(&mut model.session_lock.exports) {
            give_up_export(model, tab);
        }
    }
    let back = keep_work(model, &before, &now);
    with_tabs(model, |tabs, cx| tabs.login.on_session_status(cx));
    let shown = model.tabs.shown;
    let let_in = shown == Tab::Login && now.who.is_some() && user(&before) != user(&now);
    let opened = shown == Tab::Login && rights::is_closed(&before);
    // The login page has every letter for itself: a locked terminal is for looking.
    let locked = shown == Tab::Login && !before.locked && now.locked;
    // Where everything may be seen without a user, the first one is made when someone wants to act.
    if rights::is_closed(&now) {
        return vec![UiAction::Show(Tab::Login)];
    }
    let offered = Tab::offered(&model.cx()).contains(&shown);
    match back {
        Some(tab) => vec![UiAction::Show(tab)],
        None if let_in || opened || locked || !offered => vec![UiAction::Show(Tab::home(&model.snapshot.def))],
        None => Vec::new(),
    }
}

/// What was under way when the terminal was locked is kept, so that nothing hides process and alarms, and comes back
/// as it was when it is unlocked: then the tab that it stood on.
fn keep_work(model: &mut Model, before: &SessionStatus, now: &SessionStatus) -> Option<Tab> {
    match (before.locked, now.locked) {
        (false, true) => {
            let work = model.modal.take_if(|modal| !modal.only_shows());
            // What was filled in before a past was shown is not meant for it, nor for the present after it.
            model.kept = work.filter(|_| model.replay.shown().is_none()).map(|work| (model.tabs.shown, work));
            None
        }
        (true, false) => {
            if let Some(Modal::UserForm(form)) = model.modal.take_if(|modal| modal.is_unlock()) {
                model.modal = form.below();
            }
            let (tab, work) = model.kept.take()?;
            model.modal = Some(work);
            Some(tab)
        }
        (false, false) | (true, true) => None,
    }
}

/// A key of the login page while a form has every letter.
pub(super) fn on_typed(model: &mut Model, event: KeyEvent) -> Vec<UiAction> {
    if login::is_leave(event) {
        let session = model.session.clone();
        let changing = session.who.is_some() && !session.locked;
        model.tabs.login.leave_form(&session);
        let leads = !changing && !rights::is_closed(&session);
        return if leads { vec![UiAction::Show(Tab::home(&model.snapshot.def))] } else { Vec::new() };
    }
    match global::find(&global::keys(), event).filter(|key| key.reaches(Reach::Typed)) {
        Some(key) => key.press(model),
        None => with_tabs(model, |tabs, cx| tabs.login.press(cx, event).unwrap_or_default()),
    }
}

/// A key on a locked terminal that is meant for a window with work in it, as a faceplate opens one: the password is asked
/// for above it.
pub(super) fn ask_before_work(model: &mut Model, event: KeyEvent) -> bool {
    let work = model.modal.as_ref().is_some_and(|modal| !modal.only_looks() && !modal.is_unlock());
    let leaves = keys::ctrl('c').is(event) || login::is_leave(event);
    if !model.session.locked || !work || leaves {
        return false;
    }
    let below = model.modal.take();
    model.modal = unlock(model, below);
    true
}

/// While the terminal is locked nothing is done: the password is asked for, and what was to be opened waits below.
pub(super) fn hold_back(model: &mut Model, actions: Vec<UiAction>) -> Vec<UiAction> {
    if !model.session.locked {
        return actions;
    }
    let mut held = None;
    let mut rest = Vec::new();
    for action in actions {
        let waits = match action.scope() {
            Scope::Plant | Scope::Files => true,
            Scope::Window(modal) => !modal.only_looks() && !modal.is_unlock(),
            Scope::View | Scope::Station => false,
        };
        if !waits {
            rest.push(action);
        } else if let UiAction::Open(modal) = action {
            held = Some(Some(modal));
        } else {
            if let UiAction::SessionRequest(tab, _) | UiAction::Do(Effect::SaveReport { tab: Some(tab), .. }) = action {
                give_up_export(model, tab);
            }
            held = held.or(Some(None));
        }
    }
    if let Some(wanted) = held {
        let below = wanted.or_else(|| model.modal.take());
        rest.extend(unlock(model, below).map(UiAction::Open));
    }
    rest
}

/// A file that waits to be recorded is not.
fn give_up_export(model: &mut Model, tab: Tab) {
    let why = RequestRefusal::Failed(t!("the terminal was locked, or its user changed").to_owned());
    with_tabs(model, |tabs, cx| tabs.of_mut(tab).on_request_done(cx, Err(why)));
}

fn unlock(model: &Model, below: Option<Modal>) -> Option<Modal> {
    let who = model.session.who.as_ref()?;
    Some(Modal::UserForm(Box::new(UserForm::unlock(who.user.clone(), below))))
}

/// The activity message to the station: at most twice a minute, at once when the lock is near.
pub(super) fn active(model: &mut Model) -> Option<Effect> {
    let session = &model.session;
    if session.who.is_none() || session.locked || session.gone.is_some() {
        return None;
    }
    let pause = if session.locks_in.is_some() { WARNED_TICKS } else { ACTIVE_TICKS };
    if model.session_lock.active_at.is_some_and(|at| model.clock.phase.wrapping_sub(at) < pause) {
        return None;
    }
    model.session_lock.active_at = Some(model.clock.phase);
    Some(Effect::SessionRequest(QueryId { tab: Some(Tab::Login), number: 0 }, SessionRequest::Active))
}

/// The station's answer to a request: for the window that waits for it, also one that a lock has hidden, else for the tab,
/// which waits for its last request only.
pub(super) fn on_request_done(
    model: &mut Model,
    id: QueryId,
    answer: Result<Durability, RequestRefusal>,
) -> Vec<UiAction> {
    if answer == Ok(Durability::NotRecorded) {
        model.note = Some(t!("Done, but NOT RECORDED: the station cannot write to its disk").into());
    }
    let answer = answer.map(drop);
    let Some(tab) = id.tab else { return screen_dump::on_request_done(model, id.number, answer) };
    let exports = &mut model.session_lock.exports;
    if let Some(place) = exports.iter().position(|export| *export == (tab, id.number)) {
        exports.remove(place);
        return with_tabs(model, |tabs, cx| tabs.of_mut(tab).on_request_done(cx, answer));
    }
    let waits = |modal: &Modal| matches!(modal, Modal::UserForm(form) if form.waits_for(id.number));
    let shown = model.modal.take_if(|modal| waits(modal));
    let kept = model.kept.take_if(|(_, modal)| waits(modal));
    match (shown, kept) {
        (Some(Modal::UserForm(form)), _) => model.modal = answered(model, form, answer),
        (_, Some((tab, Modal::UserForm(form)))) => {
            model.kept = answered(model, form, answer).map(|modal| (tab, modal));
        }
        _ if id.number != 0 && id.number == model.session_lock.last_request => {
            return with_tabs(model, |tabs, cx| tabs.of_mut(tab).on_request_done(cx, answer));
        }
        _ => {}
    }
    Vec::new()
}

/// A file that was on record could not be written: that is put on record too.
pub(super) fn export_failed(file: String, why: String) -> UiAction {
    let request = SessionRequest::Exported { file, sha256: Err(why) };
    UiAction::Do(Effect::SessionRequest(QueryId { tab: None, number: 0 }, request))
}

fn answered(model: &Model, mut form: Box<UserForm>, answer: Result<(), RequestRefusal>) -> Option<Modal> {
    let done = form.answered(&model.cx(), answer);
    if done { form.below() } else { Some(Modal::UserForm(form)) }
}

/// The station runs another plant file: nothing that was known of the old one may stay.
pub(super) fn on_other_plant(model: &mut Model, snapshot: Arc<Snapshot>) -> Vec<UiAction> {
    let shown = model.tabs.shown;
    model.tabs = Tabs::new(&snapshot);
    (model.snapshot, model.last_command, model.kept) = (snapshot, None, None);
    (model.replay, model.visited) = (Replay::default(), Visited::default());
    model.recent.clear();
    model.plants = model.plants.wrapping_add(1);
    let words = vec![
        t!("The plant file changed").to_owned(),
        t!("The station has loaded another plant file. Open windows were closed; nothing was sent.").to_owned(),
    ];
    with_tabs(model, |tabs, cx| {
        tabs.login.on_session_status(cx);
        tabs.shown = if Tab::offered(cx).contains(&shown) { shown } else { Tab::home(cx.def()) };
    });
    let closed = rights::is_closed(&model.session);
    model.modal = (!closed).then(|| Modal::Notice(Notice::new(t!("plant file"), words)));
    if closed { vec![UiAction::Show(Tab::Login)] } else { Vec::new() }
}

/// A key that the password of a locked terminal has no use for, and that leads to what there is to be seen below it.
pub(super) fn is_past_unlock(model: &Model, event: KeyEvent) -> bool {
    let moves = [KeyCode::Tab, KeyCode::BackTab, KeyCode::Up, KeyCode::Down, KeyCode::PageUp, KeyCode::PageDown];
    model.modal.as_ref().is_some_and(Modal::is_unlock) && moves.into_iter().any(|code| keys::code(code).is(event))
}

impl Modal {
    /// Does it at most choose what is seen, so that a locked terminal may open it?
    pub fn only_looks(&self) -> bool {
        self.only_shows() || matches!(self, Modal::Prompt(_) | Modal::Palette(_) | Modal::TerminalSettings(_))
    }

    /// Does it ask for the password of a locked terminal?
    pub fn is_unlock(&self) -> bool {
        matches!(self, Modal::UserForm(form) if matches!(form.purpose, Purpose::Unlock(_)))
    }
}
