//! What the form about users says: keys, headings and explanations.

use super::*;

impl UserForm {
    /// What Enter does at the end.
    pub(super) fn verb(&self) -> &'static str {
        match &self.purpose {
            Purpose::First => "create",
            Purpose::Login => "log in",
            Purpose::Change(_) => "change it",
            Purpose::Unlock(_) => "unlock",
            Purpose::Add => "add",
            Purpose::Reset(_) => "set it",
            Purpose::Role(_) => "change it",
            Purpose::Disable(_, true) => "disable",
            Purpose::Disable(_, false) => "enable",
            Purpose::Delete(_) => "delete",
        }
    }

    /// The keys of the moment; Esc is told by whoever shows the form.
    pub fn hints(&self) -> Vec<Hint> {
        let hint = |key: &str, label: &str| Hint::new(key, label, "");
        let mut hints = vec![hint("⏎", self.verb())];
        if self.form.rows() > 1 {
            hints.push(hint("Tab", "next line"));
        }
        if self.form.has_secret() {
            hints.push(hint("Ctrl-R", "show password"));
        }
        if matches!(self.purpose, Purpose::Unlock(_)) {
            hints.push(hint("Ctrl-O", "other user"));
        }
        hints
    }

    /// Its heading.
    pub fn title(&self) -> String {
        match &self.purpose {
            Purpose::First => "the first Supervisor".to_owned(),
            Purpose::Login => "log in".to_owned(),
            Purpose::Change(_) => "choose a new password".to_owned(),
            Purpose::Unlock(user) => format!("locked by {user}"),
            Purpose::Add => "add a user".to_owned(),
            Purpose::Reset(user) => format!("new password for {user}"),
            Purpose::Role(user) => format!("role of {user}"),
            Purpose::Disable(user, true) => format!("disable {user}"),
            Purpose::Disable(user, false) => format!("enable {user}"),
            Purpose::Delete(user) => format!("delete {user}"),
        }
    }

    pub(super) fn words(&self, cx: &ViewContext) -> Vec<String> {
        let least = cx.session.password_chars_min;
        let rule = format!("A password has at least {least} characters. A phrase is good, in any language, Thai too.");
        let first = "It must be changed at the first login.".to_owned();
        let own = |user: &Arc<str>| cx.session.who.as_ref().is_some_and(|who| who.user == *user);
        let you = |user: &Arc<str>| {
            own(user).then_some(
                "This is your own account: you are logged out at once, and only another Supervisor can undo it.",
            )
        };
        match &self.purpose {
            Purpose::First => vec![
                "No users exist. Create the first Supervisor account: it may do everything, and adds the others."
                    .to_owned(),
                rule,
            ],
            Purpose::Login => Vec::new(),
            Purpose::Change(Some(_)) => {
                vec!["Another user set your present password: choose one that only you know.".to_owned(), rule]
            }
            Purpose::Change(None) => vec![rule],
            Purpose::Unlock(_) => vec!["Process and alarms stay visible. Your open window is kept.".to_owned()],
            Purpose::Add => vec![rule, first],
            Purpose::Reset(_) => vec![rule, first],
            Purpose::Role(_) => vec![],
            Purpose::Disable(user, true) => {
                let words = format!("{user} is logged out everywhere and cannot log in until enabled again.");
                you(user).map(str::to_owned).into_iter().chain([words]).collect()
            }
            Purpose::Disable(user, false) => vec![format!("{user} may log in again; a lockout ends too.")],
            Purpose::Delete(user) => {
                let words =
                    format!("{user} is removed; all that {user} did stays in the audit log. Type the name to be sure.");
                you(user).map(str::to_owned).into_iter().chain([words]).collect()
            }
        }
    }

    /// Seconds that one must still wait, as the station has said.
    pub(super) fn wait(&self, cx: &ViewContext) -> u32 {
        let told = self.problem.as_ref().and_then(|(words, at)| Some((seconds(words)?.1, *at)));
        told.map_or(0, |(wait, at)| wait.saturating_sub(cx.phase.wrapping_sub(at) / 2))
    }

    pub(super) fn problem_text(&self, cx: &ViewContext) -> Option<String> {
        if self.waiting {
            return Some("asking the station …".to_owned());
        }
        let (words, _) = self.problem.as_ref()?;
        Some(match (seconds(words), self.wait(cx)) {
            (None, _) => words.clone(),
            (Some(_), 0) => format!("{}; try again now", words.split(';').next().unwrap_or_default()),
            (Some((place, _)), left) => {
                let rest = words[place..].find(" s").map_or("", |end| &words[place + end + 2..]);
                let start = words[..place].trim_end_matches([' ', ';', ',']);
                format!("{start}; wait {left} s{rest}")
            }
        })
    }
}

/// Where the station's words tell a wait in seconds (`wait 8 s`, `in 8 s`), and how many.
pub(super) fn seconds(words: &str) -> Option<(usize, u32)> {
    ["wait ", "in "].iter().find_map(|lead| {
        words.match_indices(lead).find_map(|(place, _)| {
            let rest = &words[place + lead.len()..];
            let digits = rest.len() - rest.trim_start_matches(|c: char| c.is_ascii_digit()).len();
            let after = &rest[digits..];
            let unit = after.strip_prefix(" s")?;
            let ends = !unit.starts_with(|c: char| c.is_alphanumeric());
            (ends && digits > 0).then(|| rest[..digits].parse().ok()).flatten().map(|n| (place, n))
        })
    })
}
