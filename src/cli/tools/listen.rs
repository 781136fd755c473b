//! `sightglass listen`: the line of another master, frame by frame, without sending a byte.

mod capture_file;
mod words;

use std::{path::PathBuf, sync::Arc, time::Duration};

use jiff::tz::TimeZone;

use self::{capture_file::CaptureFile, words::Words};
use super::PortArgs;
use crate::{
    bus::{
        io::{clock::Clock, hearing::Hearing, tap::Tap},
        listen::{Ended, Follower, Heard, Listener},
    },
    cli::{CliError, in_runtime, is_read, run::signalled, say, span},
    plant::{PlantDef, line::LineDef, time::elapsed},
    profile::{self, Search},
};

/// Arguments of `listen`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The port is read only; a TCP port must forward the bytes of both sides (a mirror)
    #[command(flatten)]
    port: PortArgs,
    /// Follow the values of a device profile (with --unit), or of a plant file of one line
    #[arg(long, value_name = "PROFILE")]
    profile: Option<PathBuf>,
    /// Show the frames of this unit only; it is the one that the profile describes [default: all units; 1 for a profile]
    #[arg(long, short)]
    unit: Option<u8>,
    /// Save every frame for Wireshark, in a new file
    #[arg(long, value_name = "FILE")]
    pcap: Option<PathBuf>,
    /// Stop after this time: 10s, 5m [default: Ctrl-C ends]
    #[arg(long = "for", value_name = "TIME", value_parser = span)]
    time: Option<Duration>,
    /// Show no frames: only the summary, and with --profile what has changed
    #[arg(long, short, conflicts_with = "verbose")]
    quiet: bool,
    /// Show every byte
    #[arg(long, short)]
    verbose: bool,
    /// Leave RTS on, for an adapter that is powered by it; others may hold the line with it
    #[arg(long)]
    rts: bool,
}

/// Listens until Ctrl-C, the end of the time, or that of the port, and prints the summary.
pub fn main(args: Args) -> Result<(), CliError> {
    let line = args.port.line()?;
    let def = args.profile.is_some().then(|| followed(&args)).transpose()?;
    in_runtime(async {
        let tap = Tap::open(&line.transport, args.rts).await?;
        let capture = args.pcap.as_deref().map(CaptureFile::create).transpose()?;
        say(&format!("listening on {}, nothing is sent; Ctrl-C ends", line.transport));
        let clock = Clock::real();
        let began = clock.utc();
        let mut session = Session {
            follower: def.map(|def| Follower::new(def, began)),
            words: Words::new(TimeZone::system(), args.verbose),
            capture,
            args: &args,
        };
        let mut hearing = Hearing::new(tap, &line, clock);
        let ended = session.listen(&mut hearing).await;
        session.summary(hearing.listener(), &line, elapsed(began, clock.utc())).iter().for_each(|line| say(line));
        let saved = session.capture.map_or(Ok(()), CaptureFile::end);
        ended.and(saved)
    })
}

/// The plant of the profile: a device on its unit, or the only line of a plant file.
fn followed(args: &Args) -> Result<Arc<PlantDef>, CliError> {
    let path = args.profile.as_deref().unwrap_or_else(|| "".as_ref());
    let checked = profile::check(path, &Search::usual()).map_err(|errors| CliError::Profile(Box::new(errors)))?;
    let mut def = Arc::unwrap_or_clone(checked.plant);
    match (&mut def.devices[..], def.lines.len()) {
        // As it is checked, a device profile is unit 1 of a plant of its own.
        ([device], 1) if args.unit.is_some() || device.unit == 1 => device.unit = args.unit.unwrap_or(1),
        (_, 1) => {}
        (_, lines) => {
            let path = path.display();
            return Err(CliError::Usage(format!("--profile: {path} has {lines} lines, expected a plant of one line")));
        }
    }
    Ok(Arc::new(def))
}

struct Session<'a> {
    follower: Option<Follower>,
    capture: Option<CaptureFile>,
    words: Words,
    args: &'a Args,
}

impl Session<'_> {
    async fn listen(&mut self, hearing: &mut Hearing) -> Result<(), CliError> {
        let end = self.args.time.map(|time| tokio::time::Instant::now() + time);
        let stopped = signalled();
        tokio::pin!(stopped);
        let result = loop {
            let heard = tokio::select! {
                // The end comes also where bytes never end.
                biased;
                () = &mut stopped => break Ok(()),
                () = tokio::time::sleep_until(end.unwrap_or_else(tokio::time::Instant::now)), if end.is_some() => break Ok(()),
                heard = hearing.next() => heard,
            };
            match heard {
                Ok(heard) => heard.iter().for_each(|heard| self.on_heard(heard)),
                Err(why) => break Err(why.into()),
            }
            if !is_read() && self.capture.is_none() {
                break Ok(());
            }
        };
        hearing.end().iter().for_each(|heard| self.on_heard(heard));
        if let Some(uart) = hearing.tap().uart() {
            say(&words::uart(uart));
        }
        result
    }

    fn on_heard(&mut self, heard: &Heard) {
        if let (Heard::Frame(heard), Some(capture)) = (heard, &mut self.capture) {
            capture.add(&heard.frame);
        }
        let (at, unit) = match heard {
            Heard::Frame(heard) => (heard.frame.at, heard.frame.unit),
            Heard::Ended(Ended { at, held, request, .. }) => {
                (at.checked_add(*held).unwrap_or(*at), request.first().copied())
            }
        };
        let shown = !self.args.quiet && (self.args.unit.is_none() || unit.is_none() || unit == self.args.unit);
        if shown {
            self.words.frame_lines(heard).iter().for_each(|line| say(line));
        }
        let Some(follower) = &mut self.follower else { return };
        let tags = follower.follow(at, heard);
        if !tags.is_empty() {
            self.words.changed_values(at, &follower.snapshot(), &tags).iter().for_each(|line| say(line));
        }
    }

    fn summary(&self, listener: &Listener, line: &LineDef, time: Duration) -> Vec<String> {
        let mut lines = words::summary(listener, line, time);
        if let Some(follower) = &self.follower {
            lines.extend(self.words.value_table(&follower.snapshot()));
        }
        lines
    }
}
