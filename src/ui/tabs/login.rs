//! Tab 0: log in, create the first Supervisor, change the password; shows the user and its rights.

mod view;

use std::sync::Arc;

use crate::ui::tabs::prelude::*;
use crate::{
    access::{SessionRequest, SessionStatus, session_request::Secret},
    ui::modal::user_form::{Purpose, UserForm},
};

/// What a key means while a user is logged in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Action {
    /// Another password for oneself.
    Password,
    /// Lock this terminal.
    Lock,
    /// Log out.
    Leave,
}

/// Keys of this tab while a user is logged in; a form takes every letter.
const KEYS: &[Key<Action>] = &[
    Key::new(char('p'), "password", "change your password", Action::Password),
    Key::new(char('k'), "lock", "lock this terminal, as Ctrl-K does on every tab", Action::Lock),
    Key::new(char('o'), "log out", "log out of this terminal", Action::Leave),
];

/// State of this tab.
#[derive(Debug, Default)]
pub struct Login {
    /// The form that is filled in.
    form: Option<UserForm>,
    /// The password of the last login, kept while it may have to be changed.
    given: Option<Secret>,
    /// The password is being changed.
    changing: bool,
    /// Who is in, and since when as far as this terminal knows.
    since: Option<(Arc<str>, Timestamp)>,
    /// What came of the last request that had no form.
    outcome: Option<Result<&'static str, String>>,
}

impl TabView for Login {
    fn on_key(&mut self, cx: &ViewContext, event: KeyEvent) -> Vec<UiAction> {
        let Some(form) = &mut self.form else {
            return keys::find(KEYS, event).map(|action| self.act(cx, action)).unwrap_or_default();
        };
        let Some(request) = form.press(cx, event) else { return Vec::new() };
        if let SessionRequest::Login { password, .. } = &request {
            self.given = Some(password.clone());
        }
        vec![UiAction::SessionRequest(Tab::Login, request)]
    }

    fn on_paste(&mut self, text: &str) {
        if let Some(form) = &mut self.form {
            form.paste(text);
        }
    }

    fn hints(&self, cx: &ViewContext) -> Vec<Hint> {
        let Some(form) = &self.form else { return keys::hints(KEYS) };
        let leads = if self.changing || cx.session.may_view || cx.session.locked { t!("back") } else { t!("clear") };
        let quit = Hint::new("Ctrl-C", t!("quit"), "");
        form.hints().into_iter().chain([Hint::new("Esc", leads, ""), quit]).collect()
    }

    fn on_request_done(&mut self, cx: &ViewContext, answer: Result<(), String>) -> Vec<UiAction> {
        match &mut self.form {
            Some(form) if form.is_waiting() => {
                if answer.is_err() {
                    self.given = self.given.take_if(|_| form.purpose != Purpose::Login);
                }
                if form.answered(cx, answer) {
                    if matches!(form.purpose, Purpose::Change(_)) {
                        self.outcome = Some(Ok(t!("The password is changed.")));
                    }
                    self.changing = false;
                    self.form = None;
                    self.fit(cx.session);
                }
            }
            Some(_) | None => self.outcome = answer.err().map(Err),
        }
        Vec::new()
    }

    fn view(&self, cx: &ViewContext, frame: &mut Frame, area: Rect) {
        view::draw(self, cx, frame, area);
    }

    fn new(_snapshot: &Snapshot) -> Login {
        Login::default()
    }

    fn is_offered(_cx: &ViewContext) -> bool {
        true
    }

    #[cfg(test)]
    fn chords() -> keys::PageChords {
        vec![("login", keys::chords_of(KEYS))]
    }
}

impl Login {
    fn act(&mut self, cx: &ViewContext, action: Action) -> Vec<UiAction> {
        if cx.session.who.is_none() {
            return Vec::new();
        }
        self.outcome = None;
        match action {
            Action::Password => {
                self.changing = true;
                self.fit(cx.session);
                Vec::new()
            }
            Action::Lock => vec![UiAction::SessionRequest(Tab::Login, SessionRequest::Lock)],
            Action::Leave => vec![UiAction::SessionRequest(Tab::Login, SessionRequest::Logout)],
        }
    }

    /// Does a form take every key?
    pub fn is_typing(&self) -> bool {
        self.form.is_some()
    }

    /// Esc: out of the form, where that leads somewhere; else the form is emptied. `false`: there was nothing to leave.
    pub fn leave_form(&mut self, session: &SessionStatus) -> bool {
        let typing = self.form.take().is_some();
        self.changing = false;
        self.fit(session);
        typing
    }

    /// The session has changed.
    pub fn on_session_status(&mut self, cx: &ViewContext) {
        let session = cx.session;
        let user = session.who.as_ref().map(|who| &who.user);
        if self.since.as_ref().map(|(user, _)| user) != user {
            self.since = user.map(|user| (user.clone(), cx.now));
            (self.changing, self.outcome) = (false, None);
        }
        if session.who.as_ref().is_some_and(|who| !who.must_change) {
            self.given = None;
        }
        self.fit(session);
    }

    /// The form that fits how things stand; one that fits stays as it is.
    fn fit(&mut self, session: &SessionStatus) {
        let purpose = match &session.who {
            Some(_) if session.locked => Some(Purpose::Login),
            Some(who) if who.must_change => Some(Purpose::Change(self.given.clone())),
            Some(_) if self.changing => Some(Purpose::Change(None)),
            Some(_) => None,
            None if session.needs_first_supervisor => Some(Purpose::First),
            None => Some(Purpose::Login),
        };
        let fits = self.form.as_ref().map(|form| &form.purpose) == purpose.as_ref();
        if !fits {
            self.form = purpose.map(UserForm::new);
        }
    }
}

/// Is this the key that leaves a form?
pub fn is_leave(event: KeyEvent) -> bool {
    keys::code(KeyCode::Esc).is(event)
}
