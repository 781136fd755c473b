//! Default paths of files, and the ports of lines given on the command line.

use std::{env, path::PathBuf};

use super::StationArgs;
use crate::plant::{
    PlantDef,
    def::{Framing, Protocol, Rs485, Serial, Transport},
};

/// Histories and logs: `$STATE_DIRECTORY` (set by an init system), `$XDG_STATE_HOME/sightglass`,
/// `~/.local/state/sightglass`, or `/var/lib/sightglass` for a service without a home. Never a temporary folder: what is
/// kept there is gone at the next start.
pub fn state_folder() -> PathBuf {
    if let Some(given) = env::var_os("STATE_DIRECTORY").filter(|given| !given.is_empty()) {
        return PathBuf::from(given);
    }
    let absolute = |path: std::ffi::OsString| Some(PathBuf::from(path)).filter(|path| path.is_absolute());
    let state = env::var_os("XDG_STATE_HOME").and_then(absolute);
    let home = || env::var_os("HOME").and_then(absolute).map(|home| home.join(".local/state"));
    state.or_else(home).unwrap_or_else(|| PathBuf::from("/var/lib")).join("sightglass")
}

pub fn history_of(plant: &str) -> PathBuf {
    state_folder().join(format!("{plant}.duckdb"))
}

/// The history file that the arguments name, or the plant's own.
pub fn history_file(def: &PlantDef, args: &StationArgs) -> PathBuf {
    args.history.clone().unwrap_or_else(|| history_of(&def.name))
}

/// The login name of the user of this terminal.
pub fn operator() -> String {
    ["USER", "LOGNAME"].into_iter().find_map(|name| env::var(name).ok()).unwrap_or_else(|| "operator".into())
}

/// Puts a line of the plant on another port: `L1=/dev/ttyUSB0` or `L1=host:502`.
pub fn replace_port(def: &mut PlantDef, text: &str) -> Result<(), String> {
    let (name, port) = text
        .split_once('=')
        .ok_or_else(|| format!("--port: found `{text}`, expected LINE=/dev/… or LINE=HOST:TCPPORT"))?;
    let names: Vec<String> = def.lines.iter().map(|line| line.name.clone()).collect();
    let line = def
        .lines
        .iter_mut()
        .find(|line| line.name == name)
        .ok_or_else(|| format!("--port: no line `{name}`, the plant has {}", names.join(", ")))?;
    line.transport = if port.starts_with('/') {
        let (framing, rs485) = match &line.transport {
            Transport::Serial { framing, rs485, .. } => (*framing, *rs485),
            Transport::Network { .. } => (Framing::Rtu, Rs485::Off),
        };
        let serial = line.transport.serial().unwrap_or(Serial::USUAL);
        Transport::Serial { port: port.to_owned(), serial, framing, rs485 }
    } else {
        let parsed = Transport::host_and_port(port).and_then(|(host, port)| Some((host.to_owned(), port?)));
        let (host, port) =
            parsed.ok_or_else(|| format!("--port: found `{port}`, expected an absolute path or HOST:TCPPORT"))?;
        let (protocol, framing) = match &line.transport {
            Transport::Network { protocol, framing, .. } => (*protocol, *framing),
            Transport::Serial { .. } => (Protocol::Tcp, Framing::Mbap),
        };
        Transport::Network { protocol, host, port, framing }
    };
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::fixture;

    #[test]
    fn a_line_moves_to_another_port_and_keeps_its_baud_rate() {
        let mut def = fixture::plant();
        replace_port(&mut def, "L1=/dev/ttyUSB0").expect("a good port");
        let Transport::Serial { port, serial, .. } = &def.lines[0].transport else { panic!("not serial") };
        assert_eq!((port.as_str(), serial.baud), ("/dev/ttyUSB0", 9600));
        replace_port(&mut def, "L1=localhost:1502").expect("a good port");
        assert_eq!(def.lines[0].transport, Transport::tcp("localhost", 1502));
        replace_port(&mut def, "L1=[::1]:1502").expect("a good port");
        assert_eq!(def.lines[0].transport, Transport::tcp("::1", 1502));
    }

    #[test]
    fn a_wrong_port_is_reported_with_what_was_expected() {
        for (text, part) in [
            ("L1", "expected LINE=/dev/"),
            ("L9=/dev/ttyUSB0", "no line `L9`, the plant has L1"),
            ("L1=ttyUSB0", "expected an absolute path or HOST:TCPPORT"),
            ("L1=host:99999", "expected an absolute path or HOST:TCPPORT"),
        ] {
            let error = replace_port(&mut fixture::plant(), text).expect_err(text);
            assert!(error.contains(part), "{error}");
        }
    }
}
