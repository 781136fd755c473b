//! Tab 7, for a Supervisor: its users, the terminals that are attached, and the audit list.

mod audit;

use std::sync::Arc;

use audit::Audit;

use crate::ui::tabs::prelude::*;
use crate::{
    access::UserRow,
    ui::{
        modal::{UserForm, user_form::Purpose},
        rights,
    },
};

type Key = crate::ui::key_table::Key<Users>;

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

#[derive(Debug, Default)]
pub struct Users {
    list: List<UserList>,
    /// The audit list while it is shown.
    audit: Option<Audit>,
}

impl TabView for Users {
    fn back(&mut self, cx: &ViewContext) -> bool {
        self.list_mut(cx).is_some_and(|list| list.back(cx)) || self.audit.take().is_some()
    }

    fn list(&self, _cx: &ViewContext) -> Option<&dyn ListPage> {
        Some(self.audit.as_ref().map_or(&self.list as &dyn ListPage, |audit| audit))
    }

    fn list_mut(&mut self, _cx: &ViewContext) -> Option<&mut dyn ListPage> {
        Some(self.audit.as_mut().map_or(&mut self.list as &mut dyn ListPage, |audit| audit))
    }

    fn on_snapshot(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        let Some(audit) = &mut self.audit else { return Vec::new() };
        audit.ask(cx, Tab::Users).into_iter().collect()
    }

    fn queries(&mut self) -> Queries<'_> {
        self.audit.iter_mut().map(|audit| &mut audit.answered as &mut dyn Asked).collect()
    }

    fn on_text(&mut self, cx: &ViewContext, text: &str) -> Result<Vec<UiAction>, String> {
        let Some(audit) = &mut self.audit else { return Ok(Vec::new()) };
        audit.on_text(cx, text)?;
        Ok(self.on_snapshot(cx))
    }

    fn view(&self, cx: &ViewContext, frame: &mut Frame, area: Rect) {
        let mut canvas = Canvas::new(frame.buffer_mut(), area);
        match &self.audit {
            Some(audit) => audit.view(cx, &mut canvas),
            None => {
                let (width, height, users) = (canvas.width(), canvas.height(), self.list.of.height(cx));
                self.list.view(cx, &mut canvas.part(0, 0, width, users));
                sessions(cx, &mut canvas.part(0, users, width, height.saturating_sub(users)));
            }
        }
    }

    fn new(_snapshot: &Snapshot) -> Users {
        Users::default()
    }
}

impl KeyTable for Users {
    fn keys(&self, _cx: &ViewContext) -> Keys<Users> {
        Keys::of(if self.audit.is_some() { &[audit::KEYS] } else { &[LIST] })
    }

    #[cfg(test)]
    fn chords() -> key_table::PageChords {
        vec![("users", Keys::of(&[LIST]).chords()), ("audit", Keys::of(&[audit::KEYS]).chords())]
    }
}

impl Users {
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
        open(self.list.selected(cx).map(|row| Modal::UserForm(Box::new(form(&row)))))
    }

    /// Lets the audit list act, while it is shown.
    fn in_audit<T: Default>(&mut self, act: impl FnOnce(&mut Audit) -> T) -> T {
        self.audit.as_mut().map(act).unwrap_or_default()
    }
}

#[derive(Debug, Default)]
struct UserList;

impl Listing for UserList {
    type Answer = ();
    type Row = UserRow;
    type Id = Arc<str>;

    fn heading<'a>(&self, cx: &ViewContext<'a>, _: Option<&'a ()>) -> Heading<'a> {
        let none = match cx.def().access.trusted.as_slice() {
            [] => t!("No users: a demonstration needs no login."),
            _ => t!("No users with a password: the plant file trusts users of this computer. n adds one"),
        };
        Heading::new(t!("Users"), none)
    }

    fn rows<'a>(&'a self, cx: &ViewContext<'a>, _: Option<&'a ()>) -> Vec<Cow<'a, UserRow>> {
        cx.session.users.iter().map(Cow::Borrowed).collect()
    }

    fn id(row: &UserRow) -> Arc<str> {
        row.user.clone()
    }

    fn columns(&self, _cx: &ViewContext, room: u16) -> Vec<Column<UserRow>> {
        let name = (room / 4).clamp(14, 34);
        vec![
            left(name - 1, t!("user"), |_, row| row.user.to_string()),
            left(12, t!("role"), |_, row| rights::title(row.role).to_owned()),
            left(26, t!("state"), state),
            left(16, t!("last login"), |cx, row| {
                row.last_login.map_or(t!("never").to_owned(), |at| cx.local(at, "%Y-%m-%d %H:%M"))
            }),
        ]
    }

    fn style(&self, cx: &ViewContext, row: &UserRow) -> Style {
        if row.disabled { cx.theme.dim() } else { cx.theme.normal() }
    }

    fn state(&self, cx: &ViewContext, row: &UserRow) -> String {
        state(cx, row)
    }

    /// The terminals have the lower third at the most.
    fn height(&self, cx: &ViewContext) -> u16 {
        let (height, terminals) = (cx.area.height, to_u16(cx.session.sessions.len()) + 2);
        height.saturating_sub(terminals.min(height / 3).max(3.min(height)))
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

fn sessions(cx: &ViewContext, canvas: &mut Canvas) {
    let theme = cx.theme;
    let all = &cx.session.sessions;
    let width = canvas.width();
    canvas.run(0, 0, width, '─', theme.dim());
    canvas.text(1, 0, &t!(" terminals attached {count} ", count = all.len()), theme.dim());
    let rows = usize::from(canvas.height().saturating_sub(1));
    let shown = draw::shown(cx, canvas, all.len(), rows);
    for (y, row) in all.iter().take(shown).enumerate() {
        let user = row.user.as_deref().unwrap_or("–");
        let locked = if row.locked { t!("  LOCKED") } else { "" };
        let text = t!(
            "{terminal}  {pad}since {clock}  {from}{locked}",
            terminal = format!("{:>4}", row.terminal),
            pad = pad(&fit(user, 15), 16),
            clock = clock(row.since, &cx.def().time_zone),
            from = if &*row.from == "this process" { t!("this process") } else { &row.from },
            locked
        );
        canvas.text(0, to_u16(y) + 1, &fit(&text, width), theme.normal());
    }
}
