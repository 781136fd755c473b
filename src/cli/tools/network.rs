//! `sightglass scan 10.0.0.0/24`: which hosts of a network speak Modbus. Asks before it connects to anything.

use std::{net::Ipv4Addr, time::Duration};

use super::show_progress;
use crate::{
    bus::io::{
        network::{self, AT_ONCE, CONNECT_MAX, HostAnswer, Network, UNITS},
        testing::DEAF_MAX,
    },
    cli::{CliError, in_runtime, menu, prompt, say},
    plant::{
        def::{LineDef, Transport},
        number::to_u32,
    },
    profile,
};

/// Asks, connects to every host, shows who answers, and offers to open one: in words of `open`.
pub fn main(network: Network, line: &LineDef, yes: bool) -> Result<Option<Vec<String>>, CliError> {
    if !yes && !menu::is_asked() {
        let words = "a scan of a network connects to every host of it: --yes does so without asking";
        return Err(CliError::Usage(words.to_owned()));
    }
    in_runtime(async {
        if !yes && !permitted(network, line).await? {
            return Err(CliError::Usage("nothing was connected to".to_owned()));
        }
        let found = scanned(network, line).await?;
        if found.is_empty() {
            return Err(CliError::Failed(format!("no host of {network} answers on this TCP port")));
        }
        let units: Vec<Vec<String>> = found.iter().filter_map(|(host, answer)| words_of(*host, answer, line)).collect();
        if yes || units.is_empty() {
            return Ok(None);
        }
        let query = format!("open which one, 1 to {}, or none", units.len());
        let chosen = prompt::ask_until(&query, "none", |answer| match answer.parse::<usize>() {
            _ if answer == "none" => Ok(None),
            Ok(number @ 1..) if number <= units.len() => Ok(units.get(number - 1).cloned()),
            _ => Err(format!("found `{answer}`, expected none or 1 to {}", units.len())),
        });
        chosen.await
    })
}

/// Says what will be connected to, how many, and how long; was it agreed to?
async fn permitted(network: Network, line: &LineDef) -> Result<bool, CliError> {
    let hosts = network.hosts();
    let rounds = to_u32(hosts.len().div_ceil(AT_ONCE));
    let worst: Duration = (CONNECT_MAX + DEAF_MAX + line.timeout * to_u32(UNITS.len())) * rounds;
    let (Some(first), Some(last)) = (hosts.first(), hosts.last()) else { return Ok(false) };
    say(&format!(
        "This connects to {} hosts, {first} to {last},\non TCP port {}, {AT_ONCE} at once, and reads one register of each \
         that accepts.\nIt takes {} s at worst. On a network of others, ask its owner first.",
        hosts.len(),
        port_of(line),
        worst.as_secs()
    ));
    prompt::is_agreed("scan it").await
}

async fn scanned(network: Network, line: &LineDef) -> Result<Vec<(Ipv4Addr, HostAnswer)>, CliError> {
    let count = network.hosts().len();
    let found = tokio::select! {
        found = network::scan(network, line, |done| show_progress(&format!("{done} of {count} hosts"))) => found,
        _ = tokio::signal::ctrl_c() => return Err(CliError::Failed("stopped".into())),
    };
    show_progress("");
    let mut number = 0;
    for (host, answer) in &found {
        match answer {
            HostAnswer::Unit(unit, words) => {
                number += 1;
                say(&format!("{number:>4}  {host}  unit {unit}: {words}"));
            }
            HostAnswer::Open => say(&format!("   -  {host}  accepts connections; none of its usual units answers")),
        }
    }
    Ok(found)
}

/// The arguments that open a host.
fn words_of(host: Ipv4Addr, answer: &HostAnswer, line: &LineDef) -> Option<Vec<String>> {
    let HostAnswer::Unit(unit, _) = answer else { return None };
    let mode = profile::line::mode_word(&line.transport).unwrap_or("tcp");
    let words = ["open", &format!("{host}:{}", port_of(line)), "--unit", &unit.to_string(), "--mode", mode];
    Some(words.map(str::to_owned).to_vec())
}

fn port_of(line: &LineDef) -> u16 {
    if let Transport::Network { port, .. } = line.transport { port } else { 0 }
}
