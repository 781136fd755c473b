//! Tab 7, for a Supervisor: its users, the terminals that are attached, and the audit list.

mod audit;
mod view;

use audit::Audit;

use crate::ui::tabs::prelude::*;
use crate::{
    access::UserRow,
    ui::{
        modal::{UserForm, user_form::Purpose},
        session_lock,
    },
};

/// A row of the tables here.
type Key = crate::ui::keys::Key<Users>;

const MOVE: [Key; 6] = motions!("select", Users::select);
/// Keys of the list of users.
const LIST: &[Key] = &[
    Key::new(char('n'), "new", "add a user", Users::add)
        .when(|_, cx| if cx.session.users.is_empty() { Offer::Unlisted } else { Offer::Footer }),
    Key::new(char('r'), "role", "another role for the selected user", |users, cx| users.form(cx, UserForm::role_of))
        .when(has_users),
    Key::new(char('d'), "disable", "disable or enable the selected user (clears a lockout)", Users::disable)
        .when(has_users),
    Key::new(char('p'), "password", "a new first password for the selected user", |users, cx| {
        users.form(cx, |row| UserForm::new(Purpose::Reset(row.user.clone())))
    })
    .when(has_users),
    Key::new(char('x'), "delete", "delete the selected user (asks for the name)", |users, cx| {
        users.form(cx, |row| UserForm::new(Purpose::Delete(row.user.clone())))
    })
    .when(has_users),
    Key::change(char('j'), "audit log", "all operator actions: what, by whom, from where", |users, _| {
        users.audit = Some(Audit::default());
    }),
];

fn has_users(_: &Users, cx: &ViewContext) -> Offer {
    Offer::only_if(!cx.session.users.is_empty())
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
}

impl KeyTable for Users {
    fn keys(&self, cx: &ViewContext) -> Keys<Users> {
        match (&self.audit, cx.session.users.as_slice()) {
            (Some(_), _) => Keys::of(audit::KEYS),
            (None, []) => Keys::of(&[LIST]),
            (None, _) => Keys::of(&[&MOVE, LIST]),
        }
    }

    #[cfg(test)]
    fn chords() -> keys::PageChords {
        vec![("users", Keys::of(&[&MOVE, LIST]).chords()), ("audit", Keys::of(audit::KEYS).chords())]
    }
}

impl Users {
    fn select(&mut self, cx: &ViewContext, motion: Motion) {
        let room = usize::from(cx.area.height.saturating_sub(1));
        self.selected.on(motion, cx.session.users.iter().map(|row| row.user.clone()), room);
    }

    fn add(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        if !cx.session.users.is_empty() {
            return self.form(cx, |_| UserForm::new(Purpose::Add));
        }
        // Only a Supervisor sees this page: a station with users has at least one.
        let words = [
            t!("This station has no users."),
            t!("A demonstration needs no login; a station started with `sightglass run` has users."),
        ];
        open(Modal::Notice(Notice::new(t!("add a user"), words.map(str::to_owned).to_vec())))
    }

    fn disable(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        self.form(cx, |row| {
            let locked_out = row.locked_until.is_some_and(|until| until > cx.now);
            UserForm::new(Purpose::Disable(row.user.clone(), !row.disabled && !locked_out))
        })
    }

    /// Opens a form about the selected user.
    fn form(&self, cx: &ViewContext, form: impl FnOnce(&UserRow) -> UserForm) -> Vec<UiAction> {
        let row = cx.session.users.get(self.place(cx));
        open(row.map(|row| Modal::UserForm(Box::new(form(row)))))
    }

    /// Lets the audit list act, while it is shown.
    fn in_audit<T: Default>(&mut self, act: impl FnOnce(&mut Audit) -> T) -> T {
        self.audit.as_mut().map(act).unwrap_or_default()
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
