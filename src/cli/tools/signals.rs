//! `sightglass signals`: RTS and DTR set by hand, CTS, DSR, DCD and RI as they change, breaks counted.

use std::{
    io::{BufRead, IsTerminal},
    time::Duration,
};

use tokio::sync::mpsc;

use super::PortArgs;
use crate::{
    bus::io::signals::{Signal, SignalPort},
    cli::{CliError, in_runtime, run::signalled, say, span},
    plant::line::Transport,
};

/// How often the inputs are looked at.
const LOOK: Duration = Duration::from_millis(20);

/// Arguments of `signals`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    port: PortArgs,
    /// Set RTS
    #[arg(long, value_name = "STATE", value_parser = ["on", "off"])]
    rts: Option<String>,
    /// Set DTR
    #[arg(long, value_name = "STATE", value_parser = ["on", "off"])]
    dtr: Option<String>,
    /// Send a break
    #[arg(long = "break")]
    send_break: bool,
    /// Stop after this time: 0s shows them once [default: Ctrl-C ends]
    #[arg(long = "for", value_name = "TIME", value_parser = span)]
    time: Option<Duration>,
}

/// Shows the signals, and each change, until Ctrl-C; on a terminal they are set by typing.
pub fn main(args: Args) -> Result<(), CliError> {
    let line = args.port.line()?;
    let Transport::Serial { port, serial, .. } = &line.transport else {
        return Err(CliError::Usage("a TCP connection has no such signals: a serial port is needed".to_owned()));
    };
    in_runtime(async {
        let mut port = SignalPort::open(port, *serial)?;
        if port.read().is_none() {
            let why = "this port has no RTS, DTR, CTS, DSR, DCD and RI: a pseudo-terminal, or a driver without them";
            if args.rts.is_some() || args.dtr.is_some() || args.send_break {
                return Err(CliError::Failed(why.to_owned()));
            }
            say(why);
            return Ok(());
        }
        let asked = [(Signal::Rts, &args.rts), (Signal::Dtr, &args.dtr)];
        for (signal, state) in asked.into_iter().filter_map(|(signal, state)| Some((signal, state.as_ref()?))) {
            set(&mut port, signal, state == "on")?;
        }
        if args.send_break {
            set(&mut port, Signal::Break, true)?;
        }
        watch(&mut port, args.time).await
    })
}

fn set(port: &mut SignalPort, signal: Signal, on: bool) -> Result<(), CliError> {
    port.set(signal, on).map_err(CliError::io(format!("cannot set {}", name(signal))))
}

/// As it is typed.
fn name(signal: Signal) -> &'static str {
    match signal {
        Signal::Rts => "rts",
        Signal::Dtr => "dtr",
        Signal::Break => "break",
    }
}

/// Prints what has changed.
async fn watch(port: &mut SignalPort, time: Option<Duration>) -> Result<(), CliError> {
    let end = time.map(|time| tokio::time::Instant::now() + time);
    let mut typed = commands();
    let mut shown = String::new();
    let stopped = signalled();
    tokio::pin!(stopped);
    loop {
        let words = state(port)?;
        if words != shown {
            say(&words);
            shown = words;
        }
        if end.is_some_and(|end| end <= tokio::time::Instant::now()) {
            return Ok(());
        }
        tokio::select! {
            () = &mut stopped => return Ok(()),
            Some(line) = typed.recv() => match command(&line) {
                Some((signal, on)) => set(port, signal, on)?,
                None => say("expected rts on, rts off, dtr on, dtr off or break"),
            },
            () = tokio::time::sleep(LOOK) => {}
        }
    }
}

/// The signals, and the breaks that were received.
fn state(port: &SignalPort) -> Result<String, CliError> {
    let signals = port.read().ok_or_else(|| CliError::Failed("the port is gone".to_owned()))?;
    Ok(match port.uart() {
        Some(uart) => format!("{signals}   {} breaks received", uart.breaks),
        None => signals.to_string(),
    })
}

/// What a typed line sets.
fn command(line: &str) -> Option<(Signal, bool)> {
    match line.trim().to_ascii_lowercase().as_str() {
        "rts on" => Some((Signal::Rts, true)),
        "rts off" => Some((Signal::Rts, false)),
        "dtr on" => Some((Signal::Dtr, true)),
        "dtr off" => Some((Signal::Dtr, false)),
        "break" => Some((Signal::Break, true)),
        _ => None,
    }
}

/// The lines that are typed on a terminal; none from anything else.
fn commands() -> mpsc::Receiver<String> {
    let (sender, typed) = mpsc::channel(1);
    if std::io::stdin().is_terminal() {
        say("type rts on, rts off, dtr on, dtr off or break; Ctrl-C ends");
        // A thread of its own, which nothing waits for when the program is left.
        std::thread::spawn(move || {
            for line in std::io::stdin().lock().lines().map_while(Result::ok) {
                if sender.blocking_send(line).is_err() {
                    break;
                }
            }
        });
    }
    typed
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signals_are_set_by_typing() {
        assert_eq!(command(" RTS off "), Some((Signal::Rts, false)));
        assert_eq!(command("break"), Some((Signal::Break, true)));
        assert_eq!(command("cts on"), None);
    }
}
