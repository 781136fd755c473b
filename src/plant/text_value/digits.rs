//! What devices keep as digits and persons read in groups: versions, and addresses of networks.

// As data: nothing is opened.
use core::net::{Ipv4Addr, Ipv6Addr};

use crate::plant::data_type::NetworkAddress;

/// `1.0.A.2`, of several registers `1.0.A.2-0.0.0.7`.
pub(super) fn version(words: &[u16]) -> String {
    let digits = |word: &u16| {
        let [a, b, c, d] = [12, 8, 4, 0].map(|place| word >> place & 0xF);
        format!("{a:X}.{b:X}.{c:X}.{d:X}")
    };
    words.iter().map(digits).collect::<Vec<_>>().join("-")
}

/// The address in bytes, the highest first; all 0, or all 1 of a port, is none.
pub(super) fn address(kind: NetworkAddress, bytes: &[u8]) -> Option<String> {
    let is_none = bytes.iter().all(|byte| *byte == 0);
    let shown = match kind {
        NetworkAddress::Eui48 => {
            let port = bytes.get(2..8).filter(|port| port.iter().any(|byte| *byte != 0xFF))?;
            port.iter().map(|byte| format!("{byte:02X}")).collect::<Vec<_>>().join(":")
        }
        NetworkAddress::Ipv4 => bytes.get(..4)?.iter().map(u8::to_string).collect::<Vec<_>>().join("."),
        NetworkAddress::Ipv6 => {
            let pair = |pair: &[u8]| format!("{:02x}{:02x}", pair[0], pair[1]);
            bytes.get(..16)?.chunks_exact(2).map(pair).collect::<Vec<_>>().join(":")
        }
    };
    (!is_none).then_some(shown)
}

/// The words of an address as it is shown.
pub(super) fn words(kind: NetworkAddress, text: &str) -> Option<Vec<u16>> {
    let bytes = match kind {
        NetworkAddress::Eui48 => [&[0, 0][..], &port(text)?].concat(),
        NetworkAddress::Ipv4 => text.parse::<Ipv4Addr>().ok()?.octets().to_vec(),
        NetworkAddress::Ipv6 => text.parse::<Ipv6Addr>().ok()?.octets().to_vec(),
    };
    Some(bytes.chunks_exact(2).map(|pair| u16::from_be_bytes([pair[0], pair[1]])).collect())
}

/// A typed address as it is shown.
pub(super) fn typed(kind: NetworkAddress, typed: &str) -> Option<String> {
    let words = words(kind, typed)?;
    address(kind, &words.into_iter().flat_map(u16::to_be_bytes).collect::<Vec<_>>())
}

/// The six bytes of the address of a port.
fn port(text: &str) -> Option<[u8; 6]> {
    let byte = |pair: &str| u8::from_str_radix(pair, 16).ok().filter(|_| pair.len() == 2);
    let bytes = text.split([':', '-']).map(byte).collect::<Option<Vec<u8>>>()?;
    bytes.try_into().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digits_are_shown_in_groups_and_no_address_as_none() {
        assert_eq!((version(&[0x10A2]).as_str(), version(&[0x1000, 7]).as_str()), ("1.0.A.2", "1.0.0.0-0.0.0.7"));
        let check = |kind, bytes: &[u8], expect: Option<&str>| {
            assert_eq!(address(kind, bytes).as_deref(), expect, "{bytes:?}");
        };
        check(NetworkAddress::Eui48, &[0, 0, 0, 0x1B, 0x44, 0x11, 0x3A, 0xB7], Some("00:1B:44:11:3A:B7"));
        check(NetworkAddress::Eui48, &[0, 0, 255, 255, 255, 255, 255, 255], None);
        check(NetworkAddress::Eui48, &[0; 8], None);
        check(NetworkAddress::Ipv4, &[192, 168, 0, 7], Some("192.168.0.7"));
        check(NetworkAddress::Ipv4, &[0; 4], None);
        let mut local = [0; 16];
        (local[0], local[1], local[15]) = (0xFE, 0x80, 7);
        check(NetworkAddress::Ipv6, &local, Some("fe80:0000:0000:0000:0000:0000:0000:0007"));
        check(NetworkAddress::Ipv6, &local[..8], None);
    }
}
