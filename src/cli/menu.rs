//! What to do where nothing was said: `sightglass` without a station, and `sightglass open` without a port.

use std::{
    ffi::OsString,
    fs,
    io::{self, BufRead, IsTerminal, Write},
    net::IpAddr,
    path::{Path, PathBuf},
};

use super::{CliError, paths, say};
use crate::{
    bus::io::{network::Network, ports},
    plant::def::Transport,
    profile::io::atomic,
};

/// Devices that are remembered.
const OPENED_MAX: usize = 9;

/// Something to choose.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Choice {
    /// What is shown.
    words: String,
    /// The arguments that it stands for.
    args: Vec<String>,
}

impl Choice {
    fn new(words: impl Into<String>, args: &[&str]) -> Choice {
        Choice { words: words.into(), args: args.iter().map(|word| (*word).to_owned()).collect() }
    }

    fn open(words: String, place: &str) -> Choice {
        let args = std::iter::once("open").chain(place.split_whitespace());
        Choice::new(words, &args.collect::<Vec<_>>())
    }
}

/// The arguments of this process with what was left out: a bare port, address or log means `open`, and `open` alone asks which
/// port.
pub fn completed(args: Vec<OsString>) -> Result<Vec<OsString>, CliError> {
    let words: Vec<Option<&str>> = args.iter().map(|word| word.to_str()).collect();
    match words.as_slice() {
        [_, Some("open")] if is_asked() => {
            let choices: Vec<Choice> = devices().into_iter().chain(networks()).collect();
            let chosen = ask("which device? a number, HOST[:TCPPORT], /dev/… or a network 10.0.0.0/24", &choices)?;
            Ok(args.into_iter().take(1).chain(chosen.into_iter().map(OsString::from)).collect())
        }
        [Some(_), Some(word), ..] if is_log(word) || (is_port(word) && !Path::new(word).is_file()) => {
            let mut args = args;
            args.insert(1, "open".into());
            Ok(args)
        }
        _ => Ok(args),
    }
}

/// Asks what to do where no station runs; `None` without a terminal to ask on.
pub fn without_station() -> Result<Option<Vec<String>>, CliError> {
    if !is_asked() {
        return Ok(None);
    }
    let mut choices = vec![Choice::new("the demonstration: a simulated plant", &["demo"])];
    choices.extend(plants(Path::new(".")));
    choices.extend(devices());
    choices.extend(networks());
    choices.push(Choice::new("a new plant file, from your answers and the devices found", &["new"]));
    say("no station is running here");
    ask("what to show? a number, HOST[:TCPPORT] or /dev/…", &choices).map(Some)
}

/// Remembers a device that has answered, the latest first.
pub fn remember(place: &str) {
    let path = opened_file();
    let mut all = opened(&path);
    all.retain(|old| old != place);
    all.insert(0, place.to_owned());
    all.truncate(OPENED_MAX);
    // What is not remembered is only typed again.
    if let Some(folder) = path.parent() {
        let _ = fs::create_dir_all(folder);
    }
    let _ = atomic::write_for_user(&path, (all.join("\n") + "\n").as_bytes());
}

/// Can something be asked?
pub fn is_asked() -> bool {
    io::stdin().is_terminal() && io::stdout().is_terminal()
}

fn opened_file() -> PathBuf {
    paths::state_folder().join("opened")
}

fn opened(path: &Path) -> Vec<String> {
    let text = fs::read_to_string(path).unwrap_or_default();
    text.lines().filter(|line| !line.trim().is_empty()).map(str::to_owned).take(OPENED_MAX).collect()
}

/// Devices opened before, and the serial ports of this machine.
pub fn devices() -> Vec<Choice> {
    let before = opened(&opened_file());
    let again = before.iter().map(|place| Choice::open(format!("{place}, opened before"), place));
    let ports = ports::list();
    let new = ports.iter().filter(|port| !before.iter().any(|place| place.split_whitespace().next() == Some(port)));
    again.chain(new.map(|port| Choice::open(format!("{port}{}", ports::driver_words(port)), port))).collect()
}

/// The networks of this machine, to be scanned after a query.
fn networks() -> impl Iterator<Item = Choice> {
    Network::neighbours().into_iter().map(|network| {
        let network = network.to_string();
        Choice::new(format!("look for devices in the network {network}; asks first"), &["scan", &network])
    })
}

/// The plant files of a folder.
fn plants(folder: &Path) -> Vec<Choice> {
    let files = fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    let mut names: Vec<String> = files
        .filter(|path| path.extension().is_some_and(|extension| extension == "toml"))
        .filter(|path| fs::read_to_string(path).is_ok_and(|text| text.contains("[[line]]")))
        .filter_map(|path| Some(path.file_name()?.to_str()?.to_owned()))
        .collect();
    names.sort();
    names.iter().map(|name| Choice::new(format!("the plant {name}"), &[name])).collect()
}

/// Lists choices by number.
pub fn show(choices: &[Choice]) {
    for (n, choice) in choices.iter().enumerate() {
        say(&format!("  {:2}  {}", n + 1, choice.words));
    }
}

/// Shows the choices until one is taken; an empty line leaves.
fn ask(query: &str, choices: &[Choice]) -> Result<Vec<String>, CliError> {
    show(choices);
    loop {
        let _ = write!(io::stdout(), "{query}: ");
        let _ = io::stdout().flush();
        let mut line = String::new();
        let read = io::stdin().lock().read_line(&mut line).map_err(CliError::io("cannot read the answer"))?;
        if read == 0 || line.trim().is_empty() {
            return Err(CliError::Usage("nothing was chosen; `sightglass --help` lists all commands".to_owned()));
        }
        match chosen(line.trim(), choices) {
            Ok(args) => return Ok(args),
            Err(why) => say(&why),
        }
    }
}

/// What an answer means: a number of the list, or a port or address.
pub fn chosen(answer: &str, choices: &[Choice]) -> Result<Vec<String>, String> {
    if let Ok(number) = answer.parse::<usize>() {
        let choice = number.checked_sub(1).and_then(|n| choices.get(n));
        let wrong = || format!("found {number}, expected 1 to {}", choices.len());
        return choice.map(|choice| choice.args.clone()).ok_or_else(wrong);
    }
    if answer.split(':').next().is_some_and(|network| network.parse::<Network>().is_ok()) {
        return Ok(Choice::new("", &["scan", answer]).args);
    }
    let place = answer.strip_prefix("open ").unwrap_or(answer);
    let word = place.split_whitespace().next().unwrap_or_default();
    let plain = word.chars().all(|letter| letter.is_ascii_alphanumeric() || "-._:[]/".contains(letter));
    if !plain || Transport::host_and_port(word).is_none() {
        return Err(format!("found `{answer}`, expected a number of the list, HOST, HOST:TCPPORT or /dev/…"));
    }
    Ok(Choice::open(String::new(), place).args)
}

/// Is it the file of a log?
pub fn is_log(word: &str) -> bool {
    Path::new(word).extension().is_some_and(|extension| extension.eq_ignore_ascii_case("csv"))
}

/// Is it a port or an address, and no name of a plant?
fn is_port(word: &str) -> bool {
    let has_tcp_port = || matches!(Transport::host_and_port(word), Some((host, Some(_))) if !host.is_empty());
    word.starts_with("/dev/") || word.parse::<IpAddr>().is_ok() || has_tcp_port()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ports_and_addresses_are_known_from_plants() {
        for port in ["/dev/ttyUSB0", "10.0.0.7", "10.0.0.7:1502", "plc:502", "::1", "[fe80::1]:502"] {
            assert!(is_port(port), "{port}");
        }
        for other in ["tank", "tank.toml", "./plant.toml", "demo", "--help", "L1=plc", ":502", "plc:http"] {
            assert!(!is_port(other), "{other}");
        }
    }

    #[test]
    fn a_bare_port_means_open_with_all_its_options() {
        let words = |text: &str| text.split(' ').map(OsString::from).collect::<Vec<_>>();
        let completed = |text: &str| completed(words(text)).expect("nothing is asked");
        assert_eq!(completed("sightglass 10.0.0.7 --unit 5"), words("sightglass open 10.0.0.7 --unit 5"));
        assert_eq!(completed("sightglass bench.csv"), words("sightglass open bench.csv"));
        assert_eq!(completed("sightglass demo"), words("sightglass demo"));
        assert_eq!(completed("sightglass"), words("sightglass"));
    }

    #[test]
    fn an_answer_is_a_number_or_an_address() {
        let choices = [Choice::new("demo", &["demo"]), Choice::open("again".into(), "plc --unit 7")];
        assert_eq!(chosen("1", &choices), Ok(vec!["demo".to_owned()]));
        assert_eq!(chosen("2", &choices).map(|args| args.join(" ")), Ok("open plc --unit 7".to_owned()));
        assert_eq!(chosen("plc:1502", &choices).map(|args| args.join(" ")), Ok("open plc:1502".to_owned()));
        assert_eq!(
            chosen("10.0.0.0/24:1502", &choices).map(|args| args.join(" ")),
            Ok("scan 10.0.0.0/24:1502".to_owned())
        );
        assert_eq!(chosen("3", &choices), Err("found 3, expected 1 to 2".to_owned()));
        assert!(chosen("what?", &choices).is_err());
    }

    #[test]
    fn plant_files_are_found_and_other_files_are_not() {
        let folder = tempfile::tempdir().expect("a folder");
        for (name, text) in [("b.toml", "[[line]]\n"), ("a.toml", "[[line]]\n"), ("Cargo.toml", "[package]\n")] {
            fs::write(folder.path().join(name), text).expect("a small file");
        }
        let names: Vec<String> = plants(folder.path()).into_iter().map(|choice| choice.args.join(" ")).collect();
        assert_eq!(names, ["a.toml", "b.toml"]);
    }
}
