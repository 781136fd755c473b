//! Commands that speak to a running station: finding it, attaching, saying who one is.

use std::{io::IsTerminal, time::Duration};

use crate::{
    access::{Wish, wish::Secret},
    attach::io::{connect, find},
    plant::{
        Snapshot,
        command::{Command, OrderId, OrderStatus, Outcome},
    },
    station::Session,
};

use super::CliError;

/// An order that has no outcome after so long is left; the station follows it further.
const OUTCOME_MAX: Duration = Duration::from_secs(150);

/// Who acts.
#[derive(Debug, Clone, Default, clap::Args)]
pub struct Login {
    /// Who acts; the password is asked for, or is the first line of standard input. Without it: the user of the operating
    /// system, where the plant file trusts him
    #[arg(long, value_name = "NAME")]
    user: Option<String>,
}

/// The place of the station of a plant, or of the only one that runs here.
pub async fn place(plant: Option<&str>) -> Result<find::Found, CliError> {
    let mut running = find::Places::here().living().await;
    if let Some(plant) = plant {
        let name = std::path::Path::new(plant).file_stem().map_or(plant.into(), |stem| stem.to_string_lossy());
        running.retain(|found| found.name == name);
    }
    match (running.len(), plant) {
        (1, _) => Ok(running.remove(0)),
        (0, Some(plant)) => Err(CliError::NotRunning(format!("no station of {plant} runs here"))),
        (0, None) => Err(CliError::NotRunning("no station runs here".to_owned())),
        (_, _) => {
            let names: Vec<String> = running.into_iter().map(|found| found.name).collect();
            Err(CliError::Usage(format!("stations of several plants run here, name one: {}", names.join(", "))))
        }
    }
}

/// Attaches to a station and logs in.
pub async fn attach(plant: Option<&str>, login: &Login) -> Result<Session, CliError> {
    let session = open(plant).await?;
    if let Some(user) = login.user.clone() {
        let password = Secret(password(&user)?);
        session.wish(Wish::Login { user, password }).await.map_err(CliError::Failed)?;
    }
    Ok(session)
}

/// The same for somebody who wants to act: nobody may without a login.
pub async fn attach_to_act(plant: Option<&str>, login: &Login) -> Result<Session, CliError> {
    let session = attach(plant, login).await?;
    if session.standing.borrow().who.is_none() {
        return Err(CliError::Failed("log in to act: --user NAME asks for the password".to_owned()));
    }
    Ok(session)
}

/// Attaches to a station.
pub async fn open(plant: Option<&str>) -> Result<Session, CliError> {
    let found = place(plant).await?;
    connect::connect(&found.path).await.map_err(|error| CliError::Failed(error.to_string()))
}

/// The password as it is typed, or a line of standard input.
fn password(user: &str) -> Result<String, CliError> {
    let failed = |error| CliError::Io { what: "cannot read the password".into(), error };
    if std::io::stdin().is_terminal() {
        return rpassword::prompt_password(format!("password of {user}: ")).map_err(failed);
    }
    let mut line = String::new();
    std::io::stdin().read_line(&mut line).map_err(failed)?;
    Ok(line.trim_end_matches(['\r', '\n']).to_owned())
}

/// Gives an order and waits for its outcome. `Err` unless it was done.
pub async fn ordered(
    session: &mut Session,
    number: u32,
    command: Command,
    seen: Option<f64>,
    note: Option<&str>,
) -> Result<OrderStatus, CliError> {
    let id = OrderId { terminal: session.terminal, number };
    let request = crate::access::OrderRequest {
        seen,
        note: note.map(Into::into),
        ..crate::access::OrderRequest::new(id, command)
    };
    session.send(crate::station::Request::Order(request)).map_err(|why| CliError::Failed(why.to_owned()))?;
    let ended = |snapshot: &Snapshot| {
        snapshot.orders.iter().find(|order| order.id == id && order.outcome != Outcome::Pending).cloned()
    };
    let wait = async {
        let snapshot = session.snapshots.wait_for(|snapshot| ended(snapshot).is_some()).await;
        snapshot.ok().and_then(|snapshot| ended(&snapshot))
    };
    match tokio::time::timeout(OUTCOME_MAX, wait).await {
        Ok(Some(status)) => Ok(status),
        Ok(None) => Err(CliError::StationGone),
        Err(_) => Err(CliError::Failed("no outcome yet; it may or may not take effect".to_owned())),
    }
}
