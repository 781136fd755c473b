//! `sightglass stop` and `sightglass reload`: wishes for a running station as a whole.

use crate::access::Wish;

use super::{CliError, client, in_runtime, say};

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
        let mut session = client::attach(args.plant.as_deref(), &args.login).await?;
        let granted = session.wish(Wish::Stop).await;
        // It tells that it goes by going, sometimes before its answer has left.
        if granted.is_ok() || session.standing.borrow().gone.is_some() {
            let _ = session.standing.wait_for(|standing| standing.gone.is_some()).await;
        } else {
            granted.map_err(CliError::Failed)?;
        }
        say("stopped");
        Ok(())
    })
}

/// Has the station take up its plant file anew; a bad file changes nothing.
pub fn reload(args: Args) -> Result<(), CliError> {
    in_runtime(async {
        let session = client::attach(args.plant.as_deref(), &args.login).await?;
        session.wish(Wish::Reload).await.map_err(CliError::Profile)?;
        say("reloaded");
        Ok(())
    })
}
