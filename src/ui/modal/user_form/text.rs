//! What the form about users says: keys, headings and explanations.

use super::*;
use crate::t;

impl UserForm {
    /// What Enter does at the end.
    pub(super) fn verb(&self) -> &'static str {
        match &self.purpose {
            Purpose::First => t!("create"),
            Purpose::Login => t!("log in"),
            Purpose::Change(_) => t!("change password"),
            Purpose::Unlock(_) => t!("unlock"),
            Purpose::Add => t!("add"),
            Purpose::Reset(_) => t!("set password"),
            Purpose::Role(_) => t!("change password"),
            Purpose::Disable(_, true) => t!("disable"),
            Purpose::Disable(_, false) => t!("enable"),
            Purpose::Delete(_) => t!("delete"),
        }
    }

    /// The keys of the moment; Esc is added by whoever shows the form.
    pub fn hints(&self) -> Vec<Hint> {
        let mut hints = vec![Hint::in_window("⏎", self.verb())];
        if self.form.rows() > 1 {
            hints.push(Hint::in_window(t!("Tab"), t!("next line")));
        }
        if self.form.has_secret() {
            hints.push(Hint::in_window(t!("Ctrl-R"), t!("show password")));
        }
        if matches!(self.purpose, Purpose::Unlock(_)) {
            hints.push(Hint::in_window(t!("Ctrl-O"), t!("other user")));
        }
        hints
    }

    pub fn title(&self) -> String {
        match &self.purpose {
            Purpose::First => t!("the first Supervisor").to_owned(),
            Purpose::Login => t!("log in").to_owned(),
            Purpose::Change(_) => t!("choose a new password").to_owned(),
            Purpose::Unlock(user) => t!("locked by {user}", user),
            Purpose::Add => t!("add a user").to_owned(),
            Purpose::Reset(user) => t!("new password for {user}", user),
            Purpose::Role(user) => t!("role of {user}", user),
            Purpose::Disable(user, true) => t!("disable {user}", user),
            Purpose::Disable(user, false) => t!("enable {user}", user),
            Purpose::Delete(user) => t!("delete {user}", user),
        }
    }

    pub(super) fn words(&self, cx: &ViewContext) -> Vec<String> {
        let least = cx.session.password_chars_min;
        let rule = t!("At least {least} characters. Best a phrase, in any language, Thai too.", least);
        let first = t!("It must be changed at the first login.").to_owned();
        let own = |user: &Arc<str>| cx.session.who.as_ref().is_some_and(|who| who.user == *user);
        let you = |user: &Arc<str>| {
            own(user).then_some(t!(
                "This is your own account: you are logged out at once, and only another Supervisor can undo it."
            ))
        };
        match &self.purpose {
            Purpose::First => vec![
                t!("No users exist. Create the first Supervisor account: it has all rights and adds the other users.")
                    .to_owned(),
                rule,
            ],
            Purpose::Login => Vec::new(),
            Purpose::Change(Some(_)) => {
                vec![t!("Another user set your password: choose one that only you know.").to_owned(), rule]
            }
            Purpose::Change(None) => vec![rule],
            Purpose::Unlock(_) => vec![t!("Process and alarms stay visible. Your open window is kept.").to_owned()],
            Purpose::Add => vec![rule, first],
            Purpose::Reset(_) => vec![rule, first],
            Purpose::Role(_) => vec![],
            Purpose::Disable(user, true) => {
                let words = t!("{user} is logged out everywhere and cannot log in until enabled again.", user);
                you(user).map(str::to_owned).into_iter().chain([words]).collect()
            }
            Purpose::Disable(user, false) => vec![t!("{user} can log in again; this also clears a lockout.", user)],
            Purpose::Delete(user) => {
                let words = t!(
                    "{user} is deleted; the actions of {user} stay in the audit log. Type the name to confirm.",
                    user
                );
                you(user).map(str::to_owned).into_iter().chain([words]).collect()
            }
        }
    }

    /// Seconds that one must still wait, as the station has said.
    pub(super) fn wait(&self, cx: &ViewContext) -> u64 {
        let left = |(refusal, at): &(RequestRefusal, u32)| {
            refusal.wait().saturating_sub(u64::from(cx.phase.wrapping_sub(*at) / 2))
        };
        self.problem.as_ref().map_or(0, left)
    }

    pub(super) fn problem_text(&self, cx: &ViewContext) -> Option<String> {
        if self.waiting {
            return Some(t!("waiting for the station …").to_owned());
        }
        let (refusal, _) = self.problem.as_ref()?;
        let left = self.wait(cx);
        let now = refusal.with_wait(left);
        let is_over = left == 0 && refusal.wait() > 0;
        Some(if is_over { t!("{next}; try again now", next = now) } else { now.to_string() })
    }
}
