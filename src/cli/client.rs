//! Commands that speak to a running station: finding it, attaching, saying who one is.

use std::{io::IsTerminal, time::Duration};

use crate::{
    access::{
        Credentials, Durability, SessionRequest, SessionStatus, control::reauthentication, session_request::Secret,
    },
    attach::io::{connect, find},
    plant::{
        Snapshot,
        command::{Command, CommandId, CommandKind, CommandStatus},
        role::Reauthentication,
        sample::{Cause, Quality},
    },
    station::Session,
};

use super::CliError;

/// A command that has no outcome after so long is left; the station follows it further.
const OUTCOME_MAX: Duration = Duration::from_secs(150);

/// A login is seen everywhere within this time.
const LOGIN_SEEN_MAX: Duration = Duration::from_secs(5);

/// Who acts.
#[derive(Debug, Clone, Default, clap::Args)]
pub struct Login {
    /// Who acts; the password is asked for, or is the first line of standard input. Without it: the user of the operating
    /// system, where the plant file trusts it
    #[arg(long, value_name = "NAME")]
    user: Option<String>,
}

/// Station, note and login of an action.
#[derive(Debug, clap::Args)]
pub struct ActionArgs {
    /// The plant, if stations of more than one run here
    #[arg(long, value_name = "PLANT")]
    plant: Option<String>,
    /// Reason, for the audit log
    #[arg(long, value_name = "TEXT")]
    note: Option<String>,
    #[command(flatten)]
    login: Login,
}

/// The station of a plant, or of the only one that runs here.
pub async fn find_station(plant: Option<&str>) -> Result<find::FoundStation, CliError> {
    let mut running = find::SocketFolders::here().living().await;
    if let Some(plant) = plant {
        let name = std::path::Path::new(plant).file_stem().map_or(plant.into(), |stem| stem.to_string_lossy());
        running.retain(|found| found.name == name);
    }
    match (running.len(), plant) {
        (1, _) => Ok(running.remove(0)),
        (0, Some(plant)) => Err(CliError::NotRunning(format!("no station of {plant} is running here"))),
        (0, None) => Err(CliError::NotRunning(match find::SocketFolders::here().closed() {
            Some(folder) => {
                format!("no station is running here that this user may reach; {} is not accessible", folder.display())
            }
            None => "no station is running here".to_owned(),
        })),
        (_, _) => {
            let names: Vec<String> = running.into_iter().map(|found| found.name).collect();
            let names = names.join(", ");
            Err(CliError::Usage(format!(
                "stations of several plants run here, name one (`write` and `ack`: --plant): {names}"
            )))
        }
    }
}

/// Attaches to a station and logs in.
pub async fn attach(plant: Option<&str>, login: &Login) -> Result<Session, CliError> {
    Ok(attach_with_password(plant, login).await?.0)
}

/// The same, and the password that was given.
async fn attach_with_password(plant: Option<&str>, login: &Login) -> Result<(Session, Option<Secret>), CliError> {
    let mut session = open(plant).await?;
    let Some(user) = login.user.clone() else { return Ok((session, None)) };
    let password = Secret(password(&user)?);
    let reply = session.request(SessionRequest::Login { user, password: password.clone() }).await?;
    warn_not_recorded("logged in", reply);
    let seen = async {
        // The answer may come before the status, and the status before the snapshot that belongs to it.
        let _ = session.status.wait_for(|status| status.who.is_some()).await;
        let view = session.status.borrow().may_view;
        if view {
            let _ = session.snapshots.wait_for(|snapshot| !is_withheld(snapshot)).await;
        }
    };
    let silent = |_| CliError::Failed("no reply from the station".to_owned());
    tokio::time::timeout(LOGIN_SEEN_MAX, seen).await.map_err(silent)?;
    Ok((session, Some(password)))
}

/// Are the values shown after a login only?
pub fn is_withheld(snapshot: &Snapshot) -> bool {
    snapshot.samples.iter().any(|sample| sample.quality == Quality::Bad(Cause::NotAuthorised))
}

/// A logged-in user who sends commands.
pub struct Actor {
    /// The station.
    pub session: Session,
    password: Option<Secret>,
    note: Option<String>,
}

impl ActionArgs {
    /// Attaches to the station and logs in; without a login nothing may be done.
    pub async fn attach(self) -> Result<Actor, CliError> {
        let (session, password) = attach_with_password(self.plant.as_deref(), &self.login).await?;
        if session.status.borrow().who.is_none() {
            return Err(CliError::Failed("log in to act: --user NAME asks for the password".to_owned()));
        }
        Ok(Actor { session, password, note: self.note })
    }
}

/// Appended to an outcome that could not be recorded.
pub fn recorded_words(recorded: bool) -> &'static str {
    if recorded { "" } else { " (not recorded: the station cannot write to its disk)" }
}

/// Warns where an action was done but not recorded.
pub fn warn_not_recorded(what: &str, durability: Durability) {
    if durability == Durability::NotRecorded {
        super::say_error(&format!("{what}{}", recorded_words(false)));
    }
}

/// Attaches to a station.
pub async fn open(plant: Option<&str>) -> Result<Session, CliError> {
    let found = find_station(plant).await?;
    connect::connect(&found.path).await.map_err(|error| CliError::Failed(error.to_string()))
}

/// The password as it is typed, or a line of standard input.
fn password(user: &str) -> Result<String, CliError> {
    let failed = CliError::io("cannot read the password");
    if std::io::stdin().is_terminal() {
        return rpassword::prompt_password(format!("password of {user}: ")).map_err(failed);
    }
    let mut line = String::new();
    std::io::stdin().read_line(&mut line).map_err(failed)?;
    let line = line.trim_end_matches(['\r', '\n']);
    if line.is_empty() {
        // Not even tried: it would count as a wrong one.
        return Err(CliError::Usage("no password: enter it, or pass it as the first line of standard input".into()));
    }
    Ok(line.to_owned())
}

impl Actor {
    /// Sends a command and waits for its outcome.
    pub async fn send_command(&mut self, number: u32, kind: CommandKind) -> Result<CommandStatus, CliError> {
        let id = CommandId { terminal: self.session.terminal, number };
        // The password was just entered: where a tag requires it again, this is it.
        let required =
            reauthentication::required(&self.session.snapshots.borrow().def, &kind) == Some(Reauthentication::Password);
        let credentials =
            self.password.clone().filter(|_| required).map(|password| Credentials { user: None, password });
        let note = self.note.as_deref().map(Into::into);
        let command = Command { note, ..self.session.snapshots.borrow().command(id, kind) };
        self.session.send(crate::station::Request::Command(command, credentials))?;
        let ended = |snapshot: &Snapshot| {
            snapshot.commands.iter().find(|status| status.command.id == id && !status.is_pending()).cloned()
        };
        let undelivered = |status: &SessionStatus| {
            status.undelivered.iter().find(|(undelivered, _)| *undelivered == id).map(|(_, why)| why.clone())
        };
        let Session { snapshots, status, .. } = &mut self.session;
        let wait = async {
            tokio::select! {
                snapshot = snapshots.wait_for(|snapshot| ended(snapshot).is_some()) => {
                    snapshot.ok().and_then(|snapshot| ended(&snapshot)).ok_or(CliError::StationGone)
                }
                status = status.wait_for(|status| undelivered(status).is_some()) => {
                    let why = status.ok().and_then(|status| undelivered(&status));
                    Err(why.map_or(CliError::StationGone, |why| CliError::Failed(format!("not sent: {why}"))))
                }
            }
        };
        match tokio::time::timeout(OUTCOME_MAX, wait).await {
            Ok(ended) => ended,
            Err(_) => Err(CliError::Failed("no outcome yet; it may or may not take effect".to_owned())),
        }
    }
}
