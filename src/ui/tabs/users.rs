//! Tab 7, for a Supervisor: its users, the terminals that are attached, and the audit list.

mod audit;
mod view;

use audit::{Action as AuditAction, Audit};

use crate::ui::tabs::prelude::*;
use crate::{
    access::UserRow,
    ui::{
        modal::{UserForm, user_form::Purpose},
        session_lock,
    },
};

/// What a key means on the list of users.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Action {
    /// Select another row.
    Move(Motion),
    /// Add a user.
    Add,
    /// Another role.
    Role,
    /// Disable, or enable.
    Disable,
    /// A new first password.
    Reset,
    /// Remove.
    Delete,
    /// The list of all that was done.
    Audit,
}

/// Keys of the list of users.
const LIST: &[Key<Action>] = &[
    Key::new(char('n'), "new", "add a user", Action::Add),
    Key::new(char('r'), "role", "another role for the selected user", Action::Role),
    Key::new(char('d'), "disable", "disable or enable the selected user (clears a lockout)", Action::Disable),
    Key::new(char('p'), "password", "a new first password for the selected user", Action::Reset),
    Key::new(char('x'), "delete", "delete the selected user (asks for the name)", Action::Delete),
    Key::new(char('j'), "audit log", "all operator actions: what, by whom, from where", Action::Audit),
];

fn list_keys() -> Vec<Key<Action>> {
    [&motions!("select", Action::Move), LIST].concat()
}

/// State of this tab.
#[derive(Debug, Default)]
pub struct Users {
    /// The selected user; the selection stays when the list moves.
    selected: Selected<std::sync::Arc<str>>,
    /// The audit list while it is shown.
    audit: Option<Audit>,
    /// Queries asked so far.
    asked: u32,
}

impl TabView for Users {
    fn on_key(&mut self, cx: &ViewContext, event: KeyEvent) -> Vec<UiAction> {
        match &mut self.audit {
            Some(audit) => match keys::find(&audit::keys(), event) {
                Some(AuditAction::Back) => {
                    self.audit = None;
                    Vec::new()
                }
                Some(action) => {
                    let mut acts = audit.on_key(cx, action);
                    acts.extend(self.on_snapshot(cx));
                    acts
                }
                None => Vec::new(),
            },
            None => keys::find(&list_keys(), event).map(|action| self.act(cx, action)).unwrap_or_default(),
        }
    }

    fn hints(&self, cx: &ViewContext) -> Vec<Hint> {
        if self.audit.is_some() {
            return keys::hints(&audit::keys());
        }
        let mut keys = list_keys();
        if cx.session.users.is_empty() {
            keys.retain(|key| key.action == Action::Audit);
        }
        keys::hints(&keys)
    }

    fn back(&mut self, _cx: &ViewContext) -> bool {
        self.audit.take().is_some()
    }

    fn fingerprint(&self, cx: &ViewContext) -> Rows {
        match &self.audit {
            Some(audit) => audit.drawn_rows(),
            None => Rows::of(cx.session.users.iter().map(|row| (&row.user, state(cx, row))), self.place(cx)),
        }
    }

    fn on_snapshot(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        let Some(audit) = &mut self.audit else { return Vec::new() };
        audit.ask(cx, &mut self.asked).into_iter().collect()
    }

    fn awaits(&self, number: u32) -> bool {
        self.audit.as_ref().is_some_and(|audit| audit.rows.query.awaits(number))
    }

    fn on_answer(&mut self, cx: &ViewContext, number: u32, answer: Result<Answer, HistoryError>) -> Vec<UiAction> {
        if let Some(audit) = &mut self.audit {
            audit.on_answer(cx, number, &answer);
        }
        Vec::new()
    }

    fn on_text(&mut self, cx: &ViewContext, text: &str) -> Result<Vec<UiAction>, String> {
        let Some(audit) = &mut self.audit else { return Ok(Vec::new()) };
        audit.on_text(cx, text)?;
        Ok(self.on_snapshot(cx))
    }

    fn view(&self, cx: &ViewContext, frame: &mut Frame, area: Rect) {
        match &self.audit {
            Some(audit) => audit.view(cx, frame, area),
            None => view::draw(cx, self.place(cx), frame, area),
        }
    }

    fn new(_snapshot: &Snapshot) -> Users {
        Users::default()
    }

    fn is_offered(cx: &ViewContext) -> bool {
        let supervisor = cx.session.who.as_ref().is_some_and(|who| who.role == Role::Supervisor);
        !session_lock::is_closed(cx.session) && supervisor
    }

    #[cfg(test)]
    fn chords() -> keys::PageChords {
        vec![("users", keys::chords_of(&list_keys())), ("audit", keys::chords_of(&audit::keys()))]
    }
}

impl Users {
    fn act(&mut self, cx: &ViewContext, action: Action) -> Vec<UiAction> {
        let users = &cx.session.users;
        let place = self.place(cx);
        let row = users.get(place);
        let form = match (action, row) {
            (Action::Move(motion), _) => {
                let room = usize::from(cx.area.height.saturating_sub(1));
                self.selected.on(motion, users.iter().map(|row| row.user.clone()), room);
                None
            }
            (Action::Audit, _) => {
                self.audit = Some(Audit::default());
                return self.on_snapshot(cx);
            }
            // Only a Supervisor sees this page: a station with users has at least one.
            (Action::Add, None) => {
                let words = [
                    t!("This station has no users."),
                    t!("A demonstration needs no login; a station started with `sightglass run` has users."),
                ];
                let notice = Notice::new(t!("add a user"), words.map(str::to_owned).to_vec());
                return open(Modal::Notice(notice));
            }
            (Action::Add, Some(_)) => Some(UserForm::new(Purpose::Add)),
            (Action::Role, Some(row)) => Some(UserForm::role_of(row)),
            (Action::Disable, Some(row)) => {
                let locked_out = row.locked_until.is_some_and(|until| until > cx.now);
                let disable = !row.disabled && !locked_out;
                Some(UserForm::new(Purpose::Disable(row.user.clone(), disable)))
            }
            (Action::Reset, Some(row)) => Some(UserForm::new(Purpose::Reset(row.user.clone()))),
            (Action::Delete, Some(row)) => Some(UserForm::new(Purpose::Delete(row.user.clone()))),
            (Action::Role | Action::Disable | Action::Reset | Action::Delete, None) => None,
        };
        open(form.map(|form| Modal::UserForm(Box::new(form))))
    }

    /// The place of the selected user.
    fn place(&self, cx: &ViewContext) -> usize {
        self.selected.place(cx.session.users.iter().map(|row| row.user.clone()))
    }
}

/// How a user stands: `must change password`.
fn state(cx: &ViewContext, row: &UserRow) -> String {
    let locked = row.locked_until.filter(|until| *until > cx.now);
    match (row.disabled, locked, row.must_change) {
        (true, ..) => t!("disabled").to_owned(),
        (false, Some(until), _) => {
            t!("locked out until {clock}", clock = text::clock(until, &cx.def().time_zone))
        }
        (false, None, true) => t!("must change password").to_owned(),
        (false, None, false) => t!("active").to_owned(),
    }
}
