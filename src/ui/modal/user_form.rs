//! A form about users: login, password, a user. It carries a request to the station and waits for the answer.

mod text;

use crate::t;
use std::sync::Arc;

use crossterm::event::KeyEvent;
use ratatui::{Frame, layout::Rect, style::Style};

use super::{
    Modal, Next,
    form::{Field, Form, KeyOutcome},
    window,
};
use crate::{
    access::{
        SessionRequest,
        session_request::{Secret, UserRow},
    },
    plant::{number::to_u16, request_refusal::RequestRefusal, role::Role},
    text::translate,
    ui::{
        UiAction, ViewContext,
        keys::{self, Hint},
        tab::Tab,
        widgets::text::{Canvas, width, wrap},
    },
};

#[derive(Debug, Clone, PartialEq)]
pub enum Purpose {
    /// The first Supervisor of a plant without users.
    First,
    Login,
    /// A password of one's own; the present one is asked for unless it has just been given.
    Change(Option<Secret>),
    /// The one who locked the terminal is back.
    Unlock(Arc<str>),
    Add,
    /// A new first password.
    Reset(Arc<str>),
    Role(Arc<str>),
    /// Disable, or enable.
    Disable(Arc<str>, bool),
    Delete(Arc<str>),
}

/// A form and how its request stands.
#[derive(Debug, Clone, PartialEq)]
pub struct UserForm {
    pub purpose: Purpose,
    form: Form,
    /// The request is on its way.
    waiting: bool,
    /// The number of that request; 0 before it has one.
    number: u32,
    /// Why the last Enter led to nothing, and at which tick that was said.
    problem: Option<(RequestRefusal, u32)>,
    /// The window that waits below, with all that was typed in it.
    below: Option<Box<Modal>>,
}

impl UserForm {
    pub fn new(purpose: Purpose) -> UserForm {
        let twice = || [Field::secret(t!("password")), Field::secret(t!("repeat password"))];
        let fields = match &purpose {
            Purpose::First => [Field::name(t!("name"))].into_iter().chain(twice()).collect(),
            Purpose::Login => vec![Field::name(t!("name")), Field::secret(t!("password"))],
            Purpose::Change(given) => {
                let present = given.is_none().then(|| Field::secret(t!("current password")));
                present
                    .into_iter()
                    .chain([Field::secret(t!("new password")), Field::secret(t!("repeat new password"))])
                    .collect()
            }
            Purpose::Unlock(_) => vec![Field::secret(t!("password"))],
            // What is given already stands above: Enter leads through what must be typed.
            Purpose::Add => {
                [role_field(Role::Technician), Field::name(t!("name"))].into_iter().chain(twice()).collect()
            }
            Purpose::Reset(_) => twice().to_vec(),
            Purpose::Role(_) => vec![role_field(Role::Technician)],
            Purpose::Disable(..) => Vec::new(),
            Purpose::Delete(_) => vec![Field::name(t!("name"))],
        };
        UserForm { purpose, form: Form::new(fields), waiting: false, number: 0, problem: None, below: None }
    }

    /// Another role for this user; the present one is shown first.
    pub fn role_of(row: &UserRow) -> UserForm {
        let form = Form::new(vec![role_field(row.role)]);
        UserForm { form, ..UserForm::new(Purpose::Role(row.user.clone())) }
    }

    /// Asks for the password of the user who locked this terminal, above the open window.
    pub fn unlock(user: Arc<str>, below: Option<Modal>) -> UserForm {
        UserForm { below: below.map(Box::new), ..UserForm::new(Purpose::Unlock(user)) }
    }

    pub fn below(self) -> Option<Modal> {
        self.below.map(|below| *below)
    }

    pub fn is_waiting(&self) -> bool {
        self.waiting
    }

    /// The request has this number.
    pub fn sent(&mut self, number: u32) {
        if self.waiting && self.number == 0 {
            self.number = number;
        }
    }

    /// Does it wait for the answer to the request of this number?
    pub fn waits_for(&self, number: u32) -> bool {
        self.waiting && self.number == number
    }

    /// A key: the request, once the form is finished and nothing is wrong with it.
    pub fn press(&mut self, cx: &ViewContext, event: KeyEvent) -> Option<SessionRequest> {
        if self.waiting {
            return None;
        }
        match self.form.on_key(event) {
            KeyOutcome::Submitted if self.wait(cx) == 0 => match self.request(cx) {
                Ok(request) => {
                    (self.waiting, self.problem) = (true, None);
                    return Some(request);
                }
                Err(problem) => self.problem = Some((RequestRefusal::Failed(problem), cx.phase)),
            },
            // How long one must wait stays to be read.
            KeyOutcome::Taken if self.wait(cx) == 0 => self.problem = None,
            KeyOutcome::Submitted | KeyOutcome::Taken | KeyOutcome::Ignored => {}
        }
        None
    }

    /// The station's answer; `true` if the form has done its work.
    pub fn answered(&mut self, cx: &ViewContext, answer: Result<(), RequestRefusal>) -> bool {
        (self.waiting, self.number) = (false, 0);
        match answer {
            Ok(()) => return true,
            Err(problem) => {
                self.problem = Some((problem, cx.phase));
                self.form.forget();
            }
        }
        false
    }

    /// What is requested, or what is wrong with the form.
    fn request(&mut self, cx: &ViewContext) -> Result<SessionRequest, String> {
        if let Some(why) = self.form.lacking() {
            return Err(why);
        }
        let name = self.form.text(usize::from(self.purpose == Purpose::Add));
        Ok(match &self.purpose {
            Purpose::First => SessionRequest::FirstSupervisor { user: name, password: self.new_password(cx, 1)? },
            Purpose::Login => SessionRequest::Login { user: name, password: self.form.secret(1) },
            Purpose::Change(Some(old)) => {
                SessionRequest::ChangePassword { old: old.clone(), new: self.new_password(cx, 0)? }
            }
            Purpose::Change(None) => {
                SessionRequest::ChangePassword { old: self.form.secret(0), new: self.new_password(cx, 1)? }
            }
            Purpose::Unlock(_) => SessionRequest::Unlock(self.form.secret(0)),
            Purpose::Add => SessionRequest::AddUser {
                user: name,
                role: Role::ALL[self.form.chosen(0)],
                password: self.new_password(cx, 2)?,
            },
            Purpose::Reset(user) => {
                SessionRequest::ResetPassword { user: user.to_string(), password: self.new_password(cx, 0)? }
            }
            Purpose::Role(user) => {
                SessionRequest::SetRole { user: user.to_string(), role: Role::ALL[self.form.chosen(0)] }
            }
            Purpose::Disable(user, disabled) => SessionRequest::Disable { user: user.to_string(), disabled: *disabled },
            Purpose::Delete(user) if name == **user => SessionRequest::DeleteUser { user: name },
            Purpose::Delete(user) => return Err(t!("\"{name}\" is not \"{user}\"", name, user)),
        })
    }

    /// The password in line `n`, which must stand in the next line too. Courtesy: the station judges it again.
    fn new_password(&self, cx: &ViewContext, n: usize) -> Result<Secret, String> {
        let (password, again) = (self.form.secret(n), self.form.secret(n + 1));
        let (chars, least) = (password.0.chars().count(), cx.session.password_chars_min);
        if password != again {
            return Err(t!("the two passwords differ").to_owned());
        }
        if chars < usize::from(least) {
            return Err(t!("{chars} characters; at least {least}", chars, least));
        }
        Ok(password)
    }

    pub(super) fn on_key(mut self, cx: &ViewContext, event: KeyEvent) -> Next {
        if matches!(self.purpose, Purpose::Unlock(_)) && keys::ctrl('o').is(event) {
            return Next::Do(vec![UiAction::Show(Tab::Login)]);
        }
        match self.press(cx, event) {
            Some(request) => {
                let tab = self.tab();
                Next::Both(Modal::UserForm(Box::new(self)), vec![UiAction::SessionRequest(tab, request)])
            }
            None => Next::Stay(Modal::UserForm(Box::new(self))),
        }
    }

    /// The tab that the answer is for.
    fn tab(&self) -> Tab {
        match self.purpose {
            Purpose::First | Purpose::Login | Purpose::Change(_) | Purpose::Unlock(_) => Tab::Login,
            Purpose::Add | Purpose::Reset(_) | Purpose::Role(_) | Purpose::Disable(..) | Purpose::Delete(_) => {
                Tab::Users
            }
        }
    }

    pub fn paste(&mut self, text: &str) {
        if !self.waiting {
            self.form.paste(text);
        }
    }

    /// Rows of a form in so many columns.
    fn rows(&self, cx: &ViewContext, room: u16) -> Vec<(String, Style)> {
        let notes = self.words(cx).into_iter().flat_map(|words| wrap(&words, room));
        notes.map(|words| (words, cx.theme.normal())).collect()
    }

    /// Rows that all of it takes in so many columns.
    pub fn height(&self, cx: &ViewContext, room: u16) -> u16 {
        to_u16(self.rows(cx, room).len()) + self.form.rows() + 1
    }

    /// Draws words, form and answer; returns the rows that it took.
    pub fn draw(&self, cx: &ViewContext, canvas: &mut Canvas) -> u16 {
        let mut y = 0;
        // Where there is no room for all of it, what must be filled in comes before what there is to read.
        let most = canvas.height().saturating_sub(self.form.rows() + 1);
        for (words, style) in self.rows(cx, canvas.width()).into_iter().take(usize::from(most)) {
            canvas.text(0, y, &words, style);
            y += 1;
        }
        let rows = y..y + self.form.rows();
        self.form.view(cx, canvas, self.form.labels(), rows.clone());
        y = rows.end;
        let style = if self.waiting { cx.theme.dim() } else { cx.theme.trouble() };
        let room = canvas.width();
        for words in self.problem_text(cx).iter().flat_map(|words| wrap(words, room)) {
            canvas.text(0, y, &words, style);
            y += 1;
        }
        y
    }

    pub(super) fn view(&self, cx: &ViewContext, frame: &mut Frame, body: Rect) {
        let keys: Vec<String> = self.hints().iter().map(|hint| format!("{} {}", hint.key, hint.label)).collect();
        let keys = cx.theme.enter(&t!("{join}   Esc cancel", join = keys.join("   ")));
        let inner = self.form.width().max(width(&keys)).clamp(40, body.width.saturating_sub(8).clamp(40, 72));
        let problem = self.problem_text(cx).map_or(1, |words| to_u16(wrap(&words, inner).len()));
        let height = to_u16(self.rows(cx, inner).len()) + self.form.rows() + problem + 2;
        let mut canvas = window(cx, frame, body, &self.title(), (inner, height));
        self.draw(cx, &mut canvas);
        let last = canvas.height().saturating_sub(1);
        canvas.text(0, last, &keys, cx.theme.strong());
    }
}

fn role_field(role: Role) -> Field {
    Field::one_of(t!("role"), &Role::ALL, role, |role| translate(role.word()))
}
