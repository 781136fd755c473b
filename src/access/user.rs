//! The users of a plant, their roles, and permitted changes. At least one Supervisor always remains.

use std::sync::Arc;

use jiff::Timestamp;

use super::{audit_log::sha256, password::one_form};
use crate::plant::{
    recorded_action::RecordedAction,
    request_refusal::{Alphabet, RequestRefusal},
    role::Role,
};

/// Most users of a plant.
pub const USERS_MAX: usize = 200;
/// Most characters of a name.
pub const NAME_MAX: usize = 32;

/// A user who can log in.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct User {
    /// The user name.
    pub name: Arc<str>,
    /// The role.
    pub role: Role,
    /// Argon2id, as [`super::password::hash`] makes it.
    pub hash: Arc<str>,
    /// Disabled by a Supervisor.
    pub disabled: bool,
    /// A new password must be chosen before anything else.
    pub must_change: bool,
    /// The last login.
    pub last_login: Option<Timestamp>,
}

/// All users, in the order of creation.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Users {
    list: Vec<User>,
}

/// A change of who may what.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum UserChange {
    /// The first Supervisor, only while no users exist.
    First {
        /// Name.
        user: Arc<str>,
        /// The hash of the password.
        hash: Arc<str>,
    },
    /// A new user, who must change the password.
    Add {
        /// Name.
        user: Arc<str>,
        /// The role.
        role: Role,
        /// The hash of the first password.
        hash: Arc<str>,
    },
    /// Change the role of a user.
    Role(Arc<str>, Role),
    /// Disable, or enable.
    Disable(Arc<str>, bool),
    /// Removed.
    Delete(Arc<str>),
    /// Another password.
    Password {
        /// Whose.
        user: Arc<str>,
        /// The hash.
        hash: Arc<str>,
        /// The user did not choose it.
        must_change: bool,
    },
}

impl UserChange {
    /// Whom it is about.
    pub fn user(&self) -> &Arc<str> {
        match self {
            UserChange::First { user, .. }
            | UserChange::Add { user, .. }
            | UserChange::Role(user, _)
            | UserChange::Disable(user, _)
            | UserChange::Delete(user)
            | UserChange::Password { user, .. } => user,
        }
    }

    /// What it is called in the audit log.
    pub fn action(&self) -> RecordedAction {
        match self {
            UserChange::First { .. } | UserChange::Add { .. } => RecordedAction::AddUser,
            UserChange::Role(..) => RecordedAction::SetRole,
            UserChange::Disable(_, true) => RecordedAction::DisableUser,
            UserChange::Disable(_, false) => RecordedAction::EnableUser,
            UserChange::Delete(_) => RecordedAction::DeleteUser,
            UserChange::Password { must_change: true, .. } => RecordedAction::ResetPassword,
            UserChange::Password { must_change: false, .. } => RecordedAction::ChangePassword,
        }
    }

    /// With this hash of the password, where it sets one.
    pub fn with_hash(mut self, new: Arc<str>) -> UserChange {
        if let UserChange::First { hash, .. } | UserChange::Add { hash, .. } | UserChange::Password { hash, .. } =
            &mut self
        {
            *hash = new;
        }
        self
    }
}

impl Users {
    /// The SHA-256 of names, roles and hashes, as text. A login does not change it.
    pub fn digest(&self) -> String {
        let row = |User { name, role, hash, disabled, must_change, last_login: _ }: &User| {
            // None of these holds an end of line.
            format!("{name}\n{}\n{hash}\n{disabled}\n{must_change}\n", role.word())
        };
        sha256(self.iter().map(row).collect::<String>().as_bytes())
    }

    /// These users. `Err` says what is wrong with which of them, by its place.
    pub fn new(list: Vec<User>) -> Result<Users, (usize, RequestRefusal)> {
        let mut users = Users::default();
        for (place, user) in list.into_iter().enumerate() {
            users.check_new(&user.name).map_err(|why| (place, why))?;
            users.list.push(user);
        }
        if !users.list.is_empty() && !users.has_supervisor() {
            return Err((0, RequestRefusal::LastSupervisor));
        }
        Ok(users)
    }

    /// No users.
    pub fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// All users.
    pub fn iter(&self) -> impl Iterator<Item = &User> {
        self.list.iter()
    }

    /// A user by name, in any spelling of its letters.
    pub fn get(&self, name: &str) -> Option<&User> {
        let key = key(name);
        self.list.iter().find(|user| self::key(&user.name) == key)
    }

    /// Notes a login.
    pub fn logged_in(&mut self, name: &str, at: Timestamp) {
        if let Some(user) = self.place(name).map(|place| &mut self.list[place]) {
            user.last_login = Some(at);
        }
    }

    /// The users after a change. `Err`: why the change is not permitted, for the operator.
    pub fn with(&self, change: &UserChange) -> Result<Users, RequestRefusal> {
        let mut users = self.clone();
        users.change(change)?;
        if users.has_supervisor() { Ok(users) } else { Err(RequestRefusal::LastSupervisor) }
    }

    fn change(&mut self, change: &UserChange) -> Result<(), RequestRefusal> {
        let new = |user: &Arc<str>, role, hash: &Arc<str>, must_change| User {
            name: one_form(user).into(),
            role,
            hash: hash.clone(),
            disabled: false,
            must_change,
            last_login: None,
        };
        if let UserChange::First { .. } | UserChange::Add { .. } = change {
            self.check_new(change.user())?;
        }
        let place = self.place(change.user());
        let place = place.ok_or_else(|| RequestRefusal::UnknownUser(change.user().to_string()));
        match change {
            UserChange::First { .. } if !self.list.is_empty() => return Err(RequestRefusal::UsersExist),
            UserChange::First { user, hash } => self.list.push(new(user, Role::Supervisor, hash, false)),
            UserChange::Add { user, role, hash } => self.list.push(new(user, *role, hash, true)),
            UserChange::Role(_, role) => self.list[place?].role = *role,
            UserChange::Disable(_, disabled) => self.list[place?].disabled = *disabled,
            UserChange::Delete(_) => drop(self.list.remove(place?)),
            UserChange::Password { hash, must_change, .. } => {
                let user = &mut self.list[place?];
                (user.hash, user.must_change) = (hash.clone(), *must_change);
            }
        }
        Ok(())
    }

    fn check_new(&self, name: &str) -> Result<(), RequestRefusal> {
        check_name(name)?;
        if self.get(name).is_some() {
            return Err(RequestRefusal::UserExists(name.to_owned()));
        }
        if USERS_MAX <= self.list.len() {
            return Err(RequestRefusal::UsersFull(USERS_MAX));
        }
        Ok(())
    }

    fn place(&self, name: &str) -> Option<usize> {
        let key = key(name);
        self.list.iter().position(|user| self::key(&user.name) == key)
    }

    fn has_supervisor(&self) -> bool {
        self.list.iter().any(|user| user.role == Role::Supervisor && !user.disabled)
    }
}

/// The form in which names are compared: however the letters are written.
pub fn key(name: &str) -> String {
    one_form(&name.to_lowercase())
}

/// Checks a name: letters of any script, digits, `.`, `_` and `-`.
pub fn check_name(name: &str) -> Result<(), RequestRefusal> {
    let chars = one_form(name).chars().count();
    if !(1..=NAME_MAX).contains(&chars) {
        return Err(RequestRefusal::NameLength { most: NAME_MAX, count: chars });
    }
    let permitted = |letter: char| letter.is_alphanumeric() || is_mark(letter) || "._-".contains(letter);
    match one_form(name).chars().find(|letter| !permitted(*letter)) {
        Some(letter) => Err(RequestRefusal::NameLetter(letter)),
        None => one_alphabet(name),
    }
}

/// Latin, Greek and Cyrillic have letters that look the same: together they make a name that looks like another one.
fn one_alphabet(name: &str) -> Result<(), RequestRefusal> {
    let alphabet = |letter: char| match letter {
        'A'..='Z' | 'a'..='z' | '\u{aa}' | '\u{ba}' | '\u{c0}'..='\u{2af}' | '\u{1e00}'..='\u{1eff}' => {
            Some(Alphabet::Latin)
        }
        '\u{370}'..='\u{3ff}' | '\u{1f00}'..='\u{1fff}' => Some(Alphabet::Greek),
        '\u{400}'..='\u{52f}' | '\u{1c80}'..='\u{1c8f}' => Some(Alphabet::Cyrillic),
        _ => None,
    };
    let mut found = name.chars().filter_map(|letter| Some((letter, alphabet(letter)?)));
    let Some((_, first)) = found.next() else { return Ok(()) };
    match found.find(|(_, alphabet)| *alphabet != first) {
        Some((letter, other)) => Err(RequestRefusal::NameAlphabets { letter, other, first }),
        None => Ok(()),
    }
}

/// Vowels and tones that stand above or below a letter belong to a name in Thai and many other scripts.
fn is_mark(letter: char) -> bool {
    unicode_normalization::char::is_combining_mark(letter)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn first() -> Users {
        Users::default().with(&UserChange::First { user: "anna".into(), hash: "h".into() }).unwrap()
    }

    #[test]
    fn names_may_be_in_any_script_and_differ_by_more_than_case() {
        for name in ["anna", "ÉRIC", "สมชาย", "น้ำ", "Ольга", "Ελένη", "a.b_c-9", &"x".repeat(32)]
        {
            assert_eq!(check_name(name), Ok(()), "{name}");
        }
        for name in ["", " ", "a b", "a/b", "a\n", "a\u{202e}b", "аnna", "ann\u{3b1}", &"x".repeat(33)] {
            assert!(check_name(name).is_err(), "{name:?}");
        }
        let again = first().with(&UserChange::Add { user: "ANNA".into(), role: Role::Viewer, hash: "h".into() });
        assert_eq!(again.unwrap_err().to_string(), "user ANNA already exists");
        let mixed = check_name("ann\u{3b1}").unwrap_err().to_string();
        assert_eq!(mixed, "a name uses one alphabet, found '\u{3b1}' of Greek beside Latin");
    }

    #[test]
    fn the_last_supervisor_always_remains() {
        let anna: Arc<str> = "anna".into();
        for change in [
            UserChange::Delete(anna.clone()),
            UserChange::Disable(anna.clone(), true),
            UserChange::Role(anna, Role::Technician),
        ] {
            assert_eq!(first().with(&change).unwrap_err(), RequestRefusal::LastSupervisor, "{change:?}");
        }
        assert!(first().with(&UserChange::First { user: "bert".into(), hash: "h".into() }).is_err());
    }

    fn change() -> impl Strategy<Value = UserChange> {
        let user = prop::sample::select(vec!["anna", "bert", "cleo", "dora"]).prop_map(Arc::<str>::from);
        let role = prop::sample::select(Role::ALL.to_vec());
        let hash: Arc<str> = "h".into();
        let other = hash.clone();
        prop_oneof![
            (user.clone(), role.clone()).prop_map(move |(user, role)| UserChange::Add {
                user,
                role,
                hash: hash.clone()
            }),
            (user.clone(), role).prop_map(|(user, role)| UserChange::Role(user, role)),
            (user.clone(), any::<bool>()).prop_map(|(user, disabled)| UserChange::Disable(user, disabled)),
            user.clone().prop_map(UserChange::Delete),
            user.prop_map(move |user| UserChange::Password { user, hash: other.clone(), must_change: true }),
        ]
    }

    proptest! {
        #[test]
        fn a_plant_is_never_without_a_supervisor(changes in prop::collection::vec(change(), 0..40)) {
            let mut users = first();
            for change in changes {
                if let Ok(after) = users.with(&change) {
                    users = after;
                }
                prop_assert!(users.iter().any(|user| user.role == Role::Supervisor && !user.disabled));
                prop_assert!(Users::new(users.list.clone()).is_ok(), "what is kept can be read again");
            }
        }
    }
}
