//! Tab 0: log in, create the first Supervisor, change the password; shows the user and its rights.

mod view;

use std::sync::Arc;

use crate::ui::tabs::prelude::*;
use crate::{
    access::{SessionRequest, SessionStatus, session_request::Secret},
    plant::request_refusal::RequestRefusal,
    ui::modal::user_form::{Purpose, UserForm},
};

type Key = crate::ui::key_table::Key<Login>;

/// Keys of this tab while a user is logged in.
const KEYS: &[Key] = &[
    Key::change(char('p'), "password", "change your password", Login::change_password),
    Key::new(char('k'), "lock", "lock this terminal, as Ctrl-K does on every tab", |login, cx| {
        login.request(cx, SessionRequest::Lock)
    }),
    Key::new(char('o'), "log out", "log out of this terminal", |login, cx| login.request(cx, SessionRequest::Logout)),
];

/// A form takes every key but those that lead out of it.
const FORM: Below<Login> =
    Below { hints: |login, _| login.form.as_ref().map_or(Vec::new(), UserForm::hints), press: Login::on_typed };
const LEAVE: &[Key] = &[
    Key::elsewhere(code(KeyCode::Esc), "back", "").when(|login, cx| Offer::only_if(login.leads_back(cx))),
    Key::elsewhere(code(KeyCode::Esc), "clear", "").when(|login, cx| Offer::only_if(!login.leads_back(cx))),
    Key::elsewhere(keys::ctrl('c'), "quit", ""),
];

#[derive(Debug, Default)]
pub struct Login {
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
    fn on_paste(&mut self, text: &str) {
        if let Some(form) = &mut self.form {
            form.paste(text);
        }
    }

    fn on_request_done(&mut self, cx: &ViewContext, answer: Result<(), RequestRefusal>) -> Vec<UiAction> {
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
            Some(_) | None => self.outcome = answer.err().map(|why| Err(why.to_string())),
        }
        Vec::new()
    }

    fn view(&self, cx: &ViewContext, frame: &mut Frame, area: Rect) {
        view::draw(self, cx, frame, area);
    }

    fn new(_snapshot: &Snapshot) -> Login {
        Login::default()
    }
}

impl KeyTable for Login {
    fn keys(&self, _cx: &ViewContext) -> Keys<Login> {
        if self.form.is_some() { Keys::below(&FORM).and(Keys::of(&[LEAVE])) } else { Keys::of(&[KEYS]) }
    }

    #[cfg(test)]
    fn chords() -> key_table::PageChords {
        vec![("login", Keys::of(&[KEYS]).chords())]
    }
}

impl Login {
    fn change_password(&mut self, cx: &ViewContext) {
        if cx.session.who.is_some() {
            (self.outcome, self.changing) = (None, true);
            self.fit(cx.session);
        }
    }

    fn request(&mut self, cx: &ViewContext, request: SessionRequest) -> Vec<UiAction> {
        if cx.session.who.is_none() {
            return Vec::new();
        }
        self.outcome = None;
        vec![UiAction::SessionRequest(Tab::Login, request)]
    }

    fn on_typed(&mut self, cx: &ViewContext, event: KeyEvent) -> Option<Vec<UiAction>> {
        let Some(request) = self.form.as_mut()?.press(cx, event) else { return Some(Vec::new()) };
        if let SessionRequest::Login { password, .. } = &request {
            self.given = Some(password.clone());
        }
        Some(vec![UiAction::SessionRequest(Tab::Login, request)])
    }

    /// Does Esc lead out of the form? Else it is emptied.
    fn leads_back(&self, cx: &ViewContext) -> bool {
        self.changing || cx.session.may_view || cx.session.locked
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

pub fn is_leave(event: KeyEvent) -> bool {
    keys::code(KeyCode::Esc).is(event)
}
