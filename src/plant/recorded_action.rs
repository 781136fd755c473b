//! What an action is called on record: in the history, the audit log, reports and SQL.

use std::sync::Arc;

use super::keyword::{Keyword, keyword_enum};
use crate::text::translate;

keyword_enum! {
    /// An action by what it is called on record.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
    #[allow(missing_docs, reason = "the words say it")]
    pub enum RecordedAction: "action" {
        Write => "write",
        /// A write that is about to be sent; its outcome has a line of its own.
        WriteRequested => "write requested",
        /// What must be written before a tag takes a write.
        Unlock => "unlock",
        Refresh => "refresh",
        Connect => "connect",
        Disconnect => "disconnect",
        Configure => "configure",
        SaveSettings => "save settings",
        Test => "test",
        StopTest => "stop test",
        EndTest => "end test",
        ReadSets => "read sets",
        SaveSet => "save set",
        RestoreSet => "restore set",
        StopRestore => "stop restore",
        StartProcedure => "start procedure",
        AbortProcedure => "abort procedure",
        /// However it ended.
        EndProcedure => "end procedure",
        /// What is written before the end of a procedure: a station that is killed meanwhile leaves that to its successor.
        WriteSafeState => "write safe state",
        /// A step of a counter that is not plain counting; its outcome says what it was.
        Counter => "counter",
        /// A correction of what a counter counted; its new value is what is added.
        CorrectCounter => "correct counter",
        HandOver => "hand over",
        TakeOver => "take over",
        Acknowledge => "acknowledge",
        Silence => "silence",
        Reset => "reset",
        Shelve => "shelve",
        Unshelve => "unshelve",
        OutOfService => "out of service",
        InService => "in service",
        StepDone => "step done",
        StepUndone => "step undone",
        Attach => "attach",
        Detach => "detach",
        Login => "login",
        LoginFailed => "login failed",
        Logout => "logout",
        Lock => "lock terminal",
        Unlocked => "unlock terminal",
        UnlockFailed => "unlock failed",
        Lockout => "lockout",
        ReauthenticationFailed => "reauthentication failed",
        /// Never refused, so never on record.
        Active => "active",
        AddUser => "add user",
        ChangePassword => "change password",
        SetRole => "set role",
        DisableUser => "disable user",
        EnableUser => "enable user",
        DeleteUser => "delete user",
        ResetPassword => "reset password",
        /// A file was written out of what the station holds.
        Export => "export",
        DeleteReport => "delete report",
        /// A backup of the history: permitted, then done or failed.
        BackUpHistory => "back up history",
        /// A backup took the place of the history.
        RestoreHistory => "restore history",
        ImportSamples => "import samples",
        /// Requests from outside that were refused before the plant saw them.
        OutsideRequest => "request from outside",
        TooManyRequests => "too many requests",
        AuditLog => "audit log",
        ReadAuditLog => "read audit log",
        SealAuditLog => "seal audit log",
        PlantFile => "plant file",
        UsersFile => "users file",
        StartStation => "start station",
        StopStation => "stop station",
        Reload => "reload",
        /// The system clock was set.
        ClockStep => "clock step",
    }
}

/// Words of earlier versions for actions that are not on the process: write requested, lockout, reauthentication failed, audit
/// log, and its reading.
const EARLIER: [&str; 5] = ["order", "lock-out", "signature failed", "audit trail", "read audit trail"];

impl RecordedAction {
    /// Is it on the plant? Those on users, terminals and the station are for the audit log and the list of a Supervisor, not for
    /// shift reports and curves. So it is with the request of a write, whose outcome is there already.
    pub fn is_on_process(self) -> bool {
        !matches!(
            self,
            RecordedAction::WriteRequested
                | RecordedAction::Attach
                | RecordedAction::Detach
                | RecordedAction::Login
                | RecordedAction::LoginFailed
                | RecordedAction::Logout
                | RecordedAction::Lock
                | RecordedAction::Unlocked
                | RecordedAction::UnlockFailed
                | RecordedAction::Lockout
                | RecordedAction::ReauthenticationFailed
                | RecordedAction::Active
                | RecordedAction::AddUser
                | RecordedAction::ChangePassword
                | RecordedAction::SetRole
                | RecordedAction::DisableUser
                | RecordedAction::EnableUser
                | RecordedAction::DeleteUser
                | RecordedAction::ResetPassword
                | RecordedAction::Export
                | RecordedAction::DeleteReport
                | RecordedAction::BackUpHistory
                | RecordedAction::RestoreHistory
                | RecordedAction::ImportSamples
                | RecordedAction::OutsideRequest
                | RecordedAction::TooManyRequests
                | RecordedAction::AuditLog
                | RecordedAction::ReadAuditLog
                | RecordedAction::SealAuditLog
                | RecordedAction::StartStation
                | RecordedAction::StopStation
                | RecordedAction::Reload
        )
    }

    /// The words of all that are not, those of earlier versions with them.
    pub fn words_beside_process() -> impl Iterator<Item = &'static str> {
        let known = Self::ALL.into_iter().filter(|action| !action.is_on_process()).map(RecordedAction::word);
        known.chain(EARLIER)
    }

    /// Does it change the plant, or is it meant to?
    pub fn changes_plant(self) -> bool {
        !matches!(
            self,
            RecordedAction::Acknowledge
                | RecordedAction::Silence
                | RecordedAction::Login
                | RecordedAction::Logout
                | RecordedAction::Lock
                | RecordedAction::Unlocked
                | RecordedAction::Export
                | RecordedAction::DeleteReport
                | RecordedAction::ReadSets
                | RecordedAction::HandOver
                | RecordedAction::TakeOver
        )
    }

    /// A word on record in the language of this thread; as it is where another version wrote it.
    pub fn translated(word: &str) -> &str {
        Self::from_word(word).map_or(word, |action| translate(action.word()))
    }
}

impl From<RecordedAction> for Arc<str> {
    fn from(action: RecordedAction) -> Arc<str> {
        action.word().into()
    }
}
