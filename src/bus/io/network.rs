//! Modbus devices on a network: who answers of at most 254 hosts.

use std::{fs, net::Ipv4Addr, str::FromStr, time::Duration};

use futures_util::{StreamExt, stream};
use jiff::Timestamp;

use super::testing::{self, Hearing};
use crate::{
    bus::diagnostics::Job,
    plant::{
        command::CommandId,
        def::{LineDef, Transport},
        diagnostics::{Diagnostic, Finding, Scan},
    },
};

/// Hosts that are asked at once.
pub const AT_ONCE: usize = 32;
/// How long a connection may take: that of a neighbour takes milliseconds.
pub const CONNECT_MAX: Duration = Duration::from_secs(1);
/// Units that are asked of a host, the most frequent first.
pub const UNITS: [u8; 3] = [1, 255, 0];

/// An IPv4 network of at most 256 addresses.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Network {
    first: u32,
    prefix: u8,
}

impl FromStr for Network {
    type Err = String;

    /// `10.0.0.0/24`, or smaller.
    fn from_str(text: &str) -> Result<Network, String> {
        let wrong = || format!("found `{text}`, expected a network of at most 256 addresses such as 10.0.0.0/24");
        let (address, prefix) = text.split_once('/').ok_or_else(wrong)?;
        let address: Ipv4Addr = address.parse().map_err(|_| wrong())?;
        let prefix: u8 = prefix.parse().map_err(|_| wrong())?;
        if !(24..=32).contains(&prefix) {
            return Err(wrong());
        }
        Ok(Network { first: u32::from(address) & (u32::MAX << (32 - prefix)), prefix })
    }
}

impl std::fmt::Display for Network {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}/{}", Ipv4Addr::from(self.first), self.prefix)
    }
}

impl Network {
    /// Its hosts: neither the address of the network itself nor its broadcast address.
    pub fn hosts(self) -> Vec<Ipv4Addr> {
        let last = self.first | (1u32 << (32 - self.prefix)).wrapping_sub(1);
        let inner = if self.prefix < 31 { self.first + 1..=last - 1 } else { self.first..=last };
        inner.map(Ipv4Addr::from).collect()
    }

    /// Networks that this machine is connected to, as far as they are small enough.
    pub fn neighbours() -> Vec<Network> {
        let routes = fs::read_to_string("/proc/net/route").unwrap_or_default();
        routes.lines().skip(1).filter_map(neighbour).collect()
    }
}

/// A line of the routing table; its addresses have their last byte first.
fn neighbour(route: &str) -> Option<Network> {
    let columns: Vec<&str> = route.split_whitespace().collect();
    let number = |at: usize| u32::from_str_radix(columns.get(at)?, 16).ok();
    let (first, mask) = (number(1)?.swap_bytes(), number(7)?.swap_bytes());
    let prefix = u8::try_from(mask.leading_ones()).ok()?;
    (24..=30).contains(&prefix).then_some(Network { first, prefix })
}

/// What a host has answered.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum HostAnswer {
    /// A unit behind it, and its words.
    Unit(u8, String),
    /// It accepts connections, and no unit of [`UNITS`] answers.
    Open,
}

/// Asks each host of a network for one register of its usual units; `done` hears of every host. In the order of the hosts.
pub async fn scan(network: Network, line: &LineDef, mut done: impl FnMut(usize)) -> Vec<(Ipv4Addr, HostAnswer)> {
    let asked = network.hosts().into_iter().map(|host| async move { (host, ask(host, line).await) });
    let mut answers = stream::iter(asked).buffer_unordered(AT_ONCE);
    let (mut found, mut count) = (Vec::new(), 0);
    while let Some((host, answer)) = answers.next().await {
        count += 1;
        done(count);
        found.extend(answer.map(|answer| (host, answer)));
    }
    found.sort_by_key(|(host, _)| *host);
    found
}

async fn ask(host: Ipv4Addr, line: &LineDef) -> Option<HostAnswer> {
    let Transport::Network { protocol, port, framing, .. } = line.transport else { return None };
    let transport = Transport::Network { protocol, host: host.to_string(), port, framing };
    let line = LineDef { transport, ..line.clone() };
    let mut connection = tokio::time::timeout(CONNECT_MAX, testing::open(&line)).await.ok()??;
    let hearing = Hearing::default();
    // Datagrams are taken by any address, whether anyone is there or not.
    let is_open = line.transport.has_connection().then_some(HostAnswer::Open);
    for unit in UNITS.into_iter().filter(|unit| line.transport.units().contains(unit)) {
        let scan = Scan { first: unit, last: unit, serials: Vec::new(), timeout: line.timeout };
        let mut job = Job::new(CommandId::default(), "cli".into(), Diagnostic::Scan(scan), Timestamp::UNIX_EPOCH);
        while let Some(step) = job.next().cloned() {
            match connection.step(&hearing, &step).await {
                Ok((result, _)) => job.on_result(result),
                // It has hung up: it is there, and not willing.
                Err(_) => return is_open,
            }
        }
        let words = job.run().findings.iter().find_map(|finding| match finding {
            Finding::Unit { reply, .. } if reply.is_certain() => Some(reply.to_string()),
            _ => None,
        });
        if let Some(words) = words {
            return Some(HostAnswer::Unit(unit, words));
        }
    }
    is_open
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::def::{Framing, LineId, Protocol};

    #[tokio::test]
    async fn an_address_that_takes_datagrams_is_no_host_that_answers() {
        let socket = tokio::net::UdpSocket::bind("127.0.0.1:0").await.expect("a port is free");
        let port = socket.local_addr().expect("it has an address").port();
        let transport =
            Transport::Network { protocol: Protocol::Udp, host: String::new(), port, framing: Framing::Mbap };
        let line = LineDef { timeout: Duration::from_millis(20), ..LineDef::new(LineId(0), "line", transport) };
        assert_eq!(ask(Ipv4Addr::LOCALHOST, &line).await, None);
    }

    #[test]
    fn a_network_has_its_hosts_and_is_small() {
        let hosts = |text: &str| text.parse::<Network>().map(|network| network.hosts());
        let home = hosts("10.0.0.77/24").expect("a network");
        assert_eq!((home.len(), home[0], home[253]), (254, Ipv4Addr::new(10, 0, 0, 1), Ipv4Addr::new(10, 0, 0, 254)));
        assert_eq!(hosts("10.0.0.7/32"), Ok(vec![Ipv4Addr::new(10, 0, 0, 7)]));
        assert_eq!(hosts("10.0.0.4/30").map(|hosts| hosts.len()), Ok(2));
        for wrong in ["10.0.0.0/16", "10.0.0.0/33", "10.0.0.0", "plc/24", "10.0.0.0/24/1"] {
            assert!(hosts(wrong).is_err_and(|why| why.contains("at most 256 addresses")), "{wrong}");
        }
        let route = "eth0 000200C0 00000000 0001 0 0 0 00FFFFFF 0 0 0";
        assert_eq!(neighbour(route).map(|network| network.to_string()).as_deref(), Some("192.0.2.0/24"));
        assert_eq!(neighbour("eth0 00000000 010200C0 0003 0 0 0 00000000 0 0 0"), None, "the default route");
    }
}
