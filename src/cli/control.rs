//! `sightglass stop` and `sightglass reload`: requests for a running station as a whole.

use std::time::Duration;

use crate::{
    access::{Durability, SessionRequest},
    attach::io::find::{self, FoundStation},
};

use super::{CliError, client, in_runtime, say};

/// A station ends within this time, whatever its disk does.
const END_MAX: Duration = Duration::from_secs(30);
/// Interval of the checks whether it has ended.
const LOOK_EVERY: Duration = Duration::from_millis(50);

/// Arguments of both.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The plant, if stations of more than one run here
    plant: Option<String>,
    #[command(flatten)]
    login: client::Login,
}

/// Ends the station: what is stored is stored, the socket is gone.
pub fn stop(args: Args) -> Result<(), CliError> {
    in_runtime(async {
        let station = client::find_station(args.plant.as_deref()).await?;
        let mut session = client::attach(Some(&station.name), &args.login).await?;
        let reply = session.request(SessionRequest::Stop).await;
        // The connection may close before the reply arrives.
        if reply.is_ok() || session.status.borrow().gone.is_some() {
            let _ = session.status.wait_for(|status| status.gone.is_some()).await;
            drop(session);
            gone(&station).await?;
        } else {
            reply?;
        }
        say("stopped");
        Ok(())
    })
}

/// Waits until the station has closed its socket: then the last record is on disk.
async fn gone(station: &FoundStation) -> Result<(), CliError> {
    let end = tokio::time::Instant::now() + END_MAX;
    while find::SocketFolders::here().living().await.contains(station) {
        if end < tokio::time::Instant::now() {
            return Err(CliError::Failed(format!("it still stores what it has after {} s", END_MAX.as_secs())));
        }
        tokio::time::sleep(LOOK_EVERY).await;
    }
    Ok(())
}

/// Reloads the plant file of the station: what is as it was keeps running; a bad file changes nothing.
pub fn reload(args: Args) -> Result<(), CliError> {
    in_runtime(async {
        let session = client::attach(args.plant.as_deref(), &args.login).await?;
        let done = session.complete(SessionRequest::Reload).await.map_err(|why| CliError::Usage(why.to_string()))?;
        let recorded = client::recorded_words(done.durability == Durability::Recorded);
        say(&format!("reloaded{recorded}: {}", done.summary.as_deref().unwrap_or("done")));
        Ok(())
    })
}
