//! Why the station does not do what a terminal asks: of access control, of the station itself, of the way to it.

use serde::{Deserialize, Serialize};

use crate::{plant::role::Role, t, text::translate};

/// Why a request, or a command before it reached the plant, was refused. English in the log and on record, translated where
/// a terminal shows it.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error, Serialize, Deserialize)]
pub enum RequestRefusal {
    /// A wrong name, a wrong password or a disabled user: the same for each.
    #[error("{}", wrong(*.wait))]
    WrongPassword {
        /// Seconds until the next attempt; 0 for none.
        wait: u64,
    },
    /// Attempts before this one were wrong.
    #[error("{}", not_checked(*.wait))]
    NotChecked {
        /// Seconds until the next attempt.
        wait: u64,
    },
    /// The terminal asks more than it may.
    #[error("{}", t!("too many requests from this terminal, wait a moment"))]
    TooManyRequests,
    /// Too many passwords are being checked.
    #[error("{}", t!("the station is busy with other logins, try again"))]
    BusyWithLogins,
    /// The password was right, but the session or the stored hash has changed since.
    #[error("{}", t!("the login or the password has changed in the meantime, try again"))]
    LoginChanged,
    /// One change of users at a time.
    #[error("{}", t!("another change is being saved, try again"))]
    BeingSaved,
    /// The users file cannot be read, which says why.
    #[error("{}", t!("login is disabled: {why}", why = .0))]
    LoginDisabled(String),
    /// No user is logged in.
    #[error("{}", t!("log in first"))]
    LogInFirst,
    /// No user is logged in, or the terminal is locked.
    #[error("{}", t!("log in, or unlock this terminal, first"))]
    LogInOrUnlockFirst,
    /// The password was set by another user.
    #[error("{}", t!("choose a new password first"))]
    ChoosePasswordFirst,
    /// Until its user unlocks it.
    #[error("{}", t!("this terminal is locked"))]
    Locked,
    /// The role is not enough.
    #[error("{}", t!("this needs a {needed}, you are a {role}", needed = translate(.needed.word()), role = translate(.role.word())))]
    Role {
        /// The least that is enough.
        needed: Role,
        /// That of the user.
        role: Role,
    },
    /// The station runs without users.
    #[error("{}", t!("this station has no users"))]
    WithoutUsers,
    /// No user has this name.
    #[error("{}", t!("there is no user {name}", name = .0))]
    UnknownUser(String),
    /// The name is taken.
    #[error("{}", t!("user {name} already exists", name = .0))]
    UserExists(String),
    /// A first user only exists once.
    #[error("{}", t!("users already exist"))]
    UsersExist,
    /// This was the last one.
    #[error("{}", t!("at least one enabled supervisor must remain"))]
    LastSupervisor,
    /// Anyone else could make themselves Supervisor.
    #[error("{}", t!("only the user who started the station creates the first Supervisor"))]
    NotStationOwner,
    /// A name of another length than it may have.
    #[error("{}", t!("a name has 1 to {most} characters, this has {count}", most = .most, count = .count))]
    NameLength {
        /// The most it may have.
        most: usize,
        /// What it has.
        count: usize,
    },
    /// A character that no name may have.
    #[error("{}", t!("a name has letters, digits, `.`, `_` and `-`, found {letter}", letter = format!("{:?}", .0)))]
    NameLetter(char),
    /// A name of letters that look alike.
    #[error("{}", t!("a name uses one alphabet, found {letter} of {other} beside {first}", letter = format!("{:?}", .letter), other = .other.name(), first = .first.name()))]
    NameAlphabets {
        /// The first that is not of the first alphabet.
        letter: char,
        /// Its alphabet.
        other: Alphabet,
        /// That of the letters before it.
        first: Alphabet,
    },
    /// Most users are there.
    #[error("{}", t!("there are {most} users, no more can be added", most = .0))]
    UsersFull(usize),
    /// The plant file trusts this user of the operating system.
    #[error("{}", t!("{name} is a user of the operating system who needs no password here", name = .0))]
    TrustedUser(String),
    /// The new password is the old one.
    #[error("{}", t!("this is the current password, choose another one"))]
    SamePassword,
    /// Who is trusted has no password.
    #[error("{}", t!("the operating system identifies you here; there is no password to change"))]
    NoPasswordToChange,
    /// Who is trusted could not unlock.
    #[error("{}", t!("the operating system identifies you here; no password is needed"))]
    NoPasswordNeeded,
    /// What an attacker tries first.
    #[error("{}", t!("the password is little more than the name of the user or of the plant"))]
    PasswordIsName,
    /// Too few different letters.
    #[error("{}", t!("the password repeats itself; several different words are best"))]
    PasswordRepeats,
    /// It is on every list.
    #[error("{}", t!("this password is too common"))]
    PasswordCommon,
    /// A short password.
    #[error("{}", t!("the password has {chars} characters, at least {least} are needed; several words are best", chars = .chars, least = .least))]
    PasswordShort {
        /// What it has.
        chars: usize,
        /// What is needed.
        least: u16,
    },
    /// A long one.
    #[error("{}", t!("the password has {chars} characters, at most {most} are allowed", chars = .chars, most = .most))]
    PasswordLong {
        /// What it has.
        chars: usize,
        /// What can be.
        most: usize,
    },
    /// A control character.
    #[error("{}", t!("the password has a character that cannot be typed"))]
    PasswordUntypable,
    /// No login that could end.
    #[error("{}", t!("no user is logged in here"))]
    NotLoggedIn,
    /// The first Supervisor is missing.
    #[error("{}", t!("no users exist: the user who started the station creates the first Supervisor"))]
    NoUsersYet,
    /// Everyone may act without a user.
    #[error("{}", t!("this station does not require login"))]
    NoLogin,
    /// It is locked.
    #[error("{}", t!("this terminal is already locked"))]
    AlreadyLocked,
    /// Nothing to unlock.
    #[error("{}", t!("this terminal is not locked"))]
    NotLocked,
    /// It has no session.
    #[error("{}", t!("this terminal is not attached"))]
    NotAttached,
    /// Requests from outside act as a user who may not.
    #[error("{}", t!("{user} is not a user of this station, or is disabled", user = .0))]
    NoSuchDelegate(String),
    /// A tag asks for the password of the user who writes.
    #[error("{}", t!("this tag requires your password again"))]
    PasswordAgain,
    /// It is not that of another.
    #[error("{}", t!("this tag requires your own password"))]
    OwnPassword,
    /// Who is trusted has none.
    #[error("{}", t!("this tag requires a password, and your account has none"))]
    AccountWithoutPassword,
    /// A tag asks for a second user.
    #[error("{}", t!("this tag requires a second user"))]
    SecondUser,
    /// Who is not the one who writes.
    #[error("{}", t!("the second user must be another user"))]
    SecondUserIsFirst,
    /// The second user has a password that another user has set.
    #[error("{}", t!("{name} must choose a new password first", name = .0))]
    ApproverMustChange(String),
    /// The role of the second user is not enough.
    #[error("{}", t!("{name} cannot approve this: it needs a {needed}", name = .name, needed = translate(.needed.word())))]
    ApproverRole {
        /// The second user.
        name: String,
        /// The least that is enough.
        needed: Role,
    },
    /// The station stands in a folder of its own.
    #[error("{}", t!("found the path `{path}`, expected an absolute one", path = .0))]
    PathNotAbsolute(String),
    /// A path that leads out of the import folder.
    #[error("{}", t!("found the path `{path}`, expected the name of a file in the import folder", path = .0))]
    PathNotName(String),
    /// The command was made in another run of the station.
    #[error("{}", t!("the station was restarted, or its plant file reloaded, since this was shown: check and confirm again"))]
    OtherRun,
    /// Its outcome would be taken for that of the command that had the number first.
    #[error("{}", t!("this command repeats an earlier number: send it again"))]
    RepeatedNumber,
    /// A queue of the station is full.
    #[error("{}", t!("station too busy"))]
    StationBusy,
    /// The station has ended while the terminal was in its process.
    #[error("{}", t!("station has ended"))]
    StationEnded,
    /// The connection to the station is lost.
    #[error("{}", t!("station is gone"))]
    StationGone,
    /// The station was gone when the command was given.
    #[error("{}", t!("the station is disconnected"))]
    Disconnected,
    /// The station ended before it answered.
    #[error("{}", t!("the station has stopped"))]
    StationStopped,
    /// In the words of what failed: the history, the plant file, the operating system.
    #[error("{0}")]
    Failed(String),
}

/// Alphabets with letters that look the same.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Alphabet {
    /// a
    Latin,
    /// α
    Greek,
    /// а
    Cyrillic,
}

impl Alphabet {
    /// The name of its script in Unicode.
    fn name(self) -> &'static str {
        match self {
            Alphabet::Latin => "Latin",
            Alphabet::Greek => "Greek",
            Alphabet::Cyrillic => "Cyrillic",
        }
    }
}

impl RequestRefusal {
    /// Seconds until a password is checked again; 0 where nothing is to be waited for.
    pub fn wait(&self) -> u64 {
        if let RequestRefusal::WrongPassword { wait } | RequestRefusal::NotChecked { wait } = self { *wait } else { 0 }
    }

    /// The same with so many seconds left.
    pub fn with_wait(&self, left: u64) -> RequestRefusal {
        let mut refusal = self.clone();
        if let RequestRefusal::WrongPassword { wait } | RequestRefusal::NotChecked { wait } = &mut refusal {
            *wait = left;
        }
        refusal
    }
}

fn wrong(wait: u64) -> String {
    match wait {
        0 => t!("wrong name or password").to_owned(),
        seconds => t!("wrong name or password; wait {seconds} s", seconds),
    }
}

fn not_checked(wait: u64) -> String {
    match wait {
        0 => t!("too many wrong passwords: not checked").to_owned(),
        seconds => t!("too many wrong passwords: not checked; wait {seconds} s", seconds),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::text::Language;

    #[test]
    fn a_refusal_is_english_on_record_and_read_on_a_terminal() {
        let thai = |refusal: &RequestRefusal| Language::THAI.locale().within(|| refusal.to_string());
        let wrong = RequestRefusal::WrongPassword { wait: 8 };
        assert_eq!(wrong.to_string(), "wrong name or password; wait 8 s");
        assert_eq!(thai(&wrong), "ชื่อผู้ใช้\u{200b}หรือรหัสผ่าน\u{200b}ไม่ถูกต้อง; รอ 8 s");
        let role = RequestRefusal::Role { needed: Role::Supervisor, role: Role::Viewer };
        assert_eq!(role.to_string(), "this needs a supervisor, you are a viewer");
        assert!(!thai(&role).contains("this is"), "{}", thai(&role));
        assert_eq!(thai(&RequestRefusal::Failed("the disk is full".into())), "the disk is full");
    }

    #[test]
    fn a_wait_counts_down_to_nothing() {
        let refusal = RequestRefusal::NotChecked { wait: 16 };
        assert_eq!((refusal.wait(), refusal.with_wait(3).wait()), (16, 3));
        assert_eq!(refusal.with_wait(0).to_string(), "too many wrong passwords: not checked");
        assert_eq!(RequestRefusal::Locked.wait(), 0);
        assert_eq!(RequestRefusal::Locked.with_wait(9), RequestRefusal::Locked);
    }
}
