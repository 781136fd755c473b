//! Saves traffic as a capture that Wireshark opens (pcapng), and as text.
//!
//! Modbus TCP is written as packets of one TCP connection to port 502, which Wireshark decodes by itself. RTU frames, of a
//! serial line or passed on over TCP, are written as "Wireshark Upper PDU", which names its dissector (`mbrtu`): no link
//! type for RS-485 is decoded as Modbus without a user's own settings, this one is. Nothing needs to be set:
//!
//! ```text
//! wireshark line.pcapng          tshark -r line.pcapng
//! ```
//!
//! Requests whose answer repeats them (functions 05, 06, 08) look alike, and only ports tell Wireshark which is which. With
//! `-o mbrtu.tcp.port:1502` (Preferences, Protocols, Modbus RTU) these become Query and Response too.
//!
//! ASCII frames are written in their RTU form, since Wireshark has no dissector for ASCII. Whatever is no whole frame with a
//! good check is written as plain data, never as if it were good; a comment on the packet says what was wrong.

use jiff::Timestamp;

use super::{
    ascii, dissect,
    frame::{self, Mbap, hex},
    wide_addresses::WideAddresses,
};
use crate::plant::{
    line::Framing,
    number::{to_u16, to_u32},
    traffic::{Frame, FrameResult},
};

/// Link types (www.tcpdump.org/linktypes.html), each an interface of the capture.
const LINKS: [(u16, &str); 2] = [(1, "Modbus TCP"), (252, "serial line")];
/// The TCP port of Modbus, the port that stands for devices on a serial line, and that of the master.
const PORT_TCP: u16 = 502;
const PORT_RTU: u16 = 1502;
const PORT_MASTER: u16 = 49_152;
/// Master and device, in a network for documentation (RFC 5737).
const MASTER: [u8; 4] = [192, 0, 2, 1];
const DEVICE: [u8; 4] = [192, 0, 2, 2];

/// The frames of a line, oldest first, as a pcapng file.
pub fn pcapng(frames: &[Frame]) -> Vec<u8> {
    let (mut capture, head) = Capture::begin();
    let packets = frames.iter().flat_map(|frame| capture.packet(frame));
    head.into_iter().chain(packets).collect()
}

/// A pcapng file as it grows.
pub struct Capture {
    connection: Connection,
}

impl Capture {
    /// A new file, and what it begins with.
    pub fn begin() -> (Capture, Vec<u8>) {
        let mut head = block(0x0A0D_0D0A, &[&0x1A2B_3C4D_u32.to_le_bytes()[..], &[1, 0, 0, 0], &[0xFF; 8]].concat());
        for (link, name) in LINKS {
            let body = [&link.to_le_bytes()[..], &[0; 6], &option(2, name.as_bytes()), &option(0, &[])].concat();
            head.extend(block(1, &body));
        }
        (Capture { connection: Connection { sent: 1, received: 1, packets: 0 } }, head)
    }

    /// What is appended for a frame: one whole block.
    pub fn packet(&mut self, frame: &Frame) -> Vec<u8> {
        let tcp = frame.framing == Framing::Mbap
            && matches!(frame::mbap(&frame.bytes), Mbap::Whole { end, .. } if end == frame.bytes.len());
        let packet = if tcp { self.connection.packet(frame.sent, &frame.bytes) } else { upper_pdu(frame) };
        packet_block(frame, u32::from(!tcp), &packet)
    }
}

/// One line a frame: time, direction, bytes, meaning, result. `sightglass decode` reads it back.
pub fn text(frames: &[Frame]) -> String {
    let mut lines = String::new();
    for (index, frame) in frames.iter().enumerate() {
        let dissection = dissect::in_traffic(&WideAddresses::default(), frame, frames[..index].iter().rev());
        let bytes = match frame.framing {
            Framing::Ascii if ascii::open(&frame.bytes).is_ok() => frame.bytes.escape_ascii().to_string(),
            Framing::Ascii | Framing::Rtu | Framing::Mbap => hex(&frame.bytes),
        };
        let direction = if frame.sent { "TX" } else { "RX" };
        lines += &format!("{} {direction} {bytes} | {} | {}\n", micros(frame.at), dissection.summary, frame.result);
    }
    lines
}

/// `2026-11-21T06:00:00.123456Z`.
fn micros(at: Timestamp) -> String {
    at.strftime("%Y-%m-%dT%H:%M:%S%.6fZ").to_string()
}

/// A pcapng block: type, length, body filled up to 32 bits, length (draft-ietf-opsawg-pcapng, 3.1).
fn block(kind: u32, body: &[u8]) -> Vec<u8> {
    let body = padded(body);
    let length = (to_u32(body.len()) + 12).to_le_bytes();
    [&kind.to_le_bytes()[..], &length, &body, &length].concat()
}

fn option(code: u16, value: &[u8]) -> Vec<u8> {
    [&code.to_le_bytes()[..], &to_u16(value.len()).to_le_bytes(), &padded(value)].concat()
}

fn padded(bytes: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    bytes.resize(bytes.len().next_multiple_of(4), 0);
    bytes
}

/// An enhanced packet block: interface, microseconds since 1970, lengths, packet, direction, comment.
fn packet_block(frame: &Frame, interface: u32, packet: &[u8]) -> Vec<u8> {
    let micros = u64::try_from(frame.at.as_microsecond()).unwrap_or(0);
    let length = to_u32(packet.len());
    let head = [interface, (micros >> 32) as u32, (micros & 0xFFFF_FFFF) as u32, length, length]
        .map(u32::to_le_bytes)
        .concat();
    let direction: u32 = if frame.sent { 2 } else { 1 };
    let mut options = option(2, &direction.to_le_bytes());
    if let FrameResult::Wrong(why) = &frame.result {
        options.extend(option(1, why.to_string().as_bytes()));
    }
    options.extend(option(0, &[]));
    block(6, &[head, padded(packet), options].concat())
}

/// RTU form behind the tags of an exported PDU, which are big-endian (Wireshark, epan/exported_pdu.h).
fn upper_pdu(frame: &Frame) -> Vec<u8> {
    let tag = |code: u16, value: &[u8]| {
        let value = padded(value);
        [&code.to_be_bytes()[..], &to_u16(value.len()).to_be_bytes(), &value].concat()
    };
    let word = |value: u16| u32::from(value).to_be_bytes();
    let ends = [(MASTER, PORT_MASTER), (DEVICE, PORT_RTU)];
    let [from, to] = if frame.sent { ends } else { [ends[1], ends[0]] };
    let rtu = match frame.framing {
        Framing::Rtu => frame::without_crc(&frame.bytes).ok().map(frame::with_crc),
        Framing::Ascii => ascii::open(&frame.bytes).ok().map(|message| frame::with_crc(&message)),
        Framing::Mbap => None,
    };
    let mut packet = match &rtu {
        Some(_) => tag(12, b"mbrtu"),
        // Plain data leaves the protocol column empty; tag 33 fills it.
        None => [tag(12, b"data"), tag(33, b"not Modbus")].concat(),
    };
    packet.extend(
        [tag(20, &from.0), tag(21, &to.0), tag(24, &word(2)), tag(25, &word(from.1)), tag(26, &word(to.1))].concat(),
    );
    packet.extend(tag(0, &[]));
    packet.extend(rtu.as_deref().unwrap_or(&frame.bytes));
    packet
}

/// The TCP connection that frames are put into: bytes so far in each direction, plus one.
struct Connection {
    sent: u32,
    received: u32,
    packets: u16,
}

impl Connection {
    /// Ethernet, IPv4, TCP and the bytes.
    fn packet(&mut self, sent: bool, bytes: &[u8]) -> Vec<u8> {
        let ends = [(MASTER, PORT_MASTER), (DEVICE, PORT_TCP)];
        let [from, to] = if sent { ends } else { [ends[1], ends[0]] };
        let (sequence, acknowledged) = if sent { (self.sent, self.received) } else { (self.received, self.sent) };
        let count = if sent { &mut self.sent } else { &mut self.received };
        *count = count.wrapping_add(to_u32(bytes.len()));
        self.packets = self.packets.wrapping_add(1);
        // Data offset 5 words, PSH and ACK; the widest window; checksum, then no urgent pointer.
        let mut tcp = [from.1, to.1].map(u16::to_be_bytes).concat();
        tcp.extend([sequence, acknowledged].map(u32::to_be_bytes).concat());
        tcp.extend([0x50, 0x18, 0xFF, 0xFF, 0, 0, 0, 0]);
        tcp.extend(bytes);
        let pseudo = [&from.0[..], &to.0, &[0, 6], &to_u16(tcp.len()).to_be_bytes(), &tcp].concat();
        tcp[16..18].copy_from_slice(&checksum(&pseudo).to_be_bytes());
        // Version 4, header of 5 words; 64 hops, protocol 6 (TCP), checksum, addresses.
        let mut ip = vec![0x45, 0];
        ip.extend([20 + to_u16(tcp.len()), self.packets].map(u16::to_be_bytes).concat());
        ip.extend([0x40, 0, 64, 6, 0, 0]);
        ip.extend([from.0, to.0].concat());
        let header = checksum(&ip).to_be_bytes();
        ip[10..12].copy_from_slice(&header);
        let station = |address: [u8; 4]| [0x02, 0, address[0], address[1], address[2], address[3]];
        [&station(to.0)[..], &station(from.0), &[0x08, 0x00], &ip, &tcp].concat()
    }
}

/// The Internet checksum (RFC 1071).
fn checksum(bytes: &[u8]) -> u16 {
    let words = bytes.chunks(2).map(|pair| u32::from(u16::from_be_bytes([pair[0], *pair.get(1).unwrap_or(&0)])));
    let mut sum: u32 = words.sum();
    while 0xFFFF < sum {
        sum = (sum & 0xFFFF) + (sum >> 16);
    }
    !((sum & 0xFFFF) as u16)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::traffic::FrameFault;

    fn frame(sent: bool, framing: Framing, bytes: Vec<u8>, result: FrameResult) -> Frame {
        let at = Timestamp::UNIX_EPOCH + jiff::SignedDuration::from_micros(1_700_000_000_123_456);
        Frame { at, sent, bytes: bytes.into(), framing, result, unit: Some(1), number: 1 }
    }

    /// Types and bodies of the blocks; panics when lengths do not lead from one to the next.
    fn blocks(file: &[u8]) -> Vec<(u32, &[u8])> {
        let word = |at: usize| u32::from_le_bytes([file[at], file[at + 1], file[at + 2], file[at + 3]]);
        let (mut at, mut found) = (0, Vec::new());
        while at < file.len() {
            let length = word(at + 4) as usize;
            assert_eq!((length % 4, word(at + length - 4) as usize), (0, length));
            found.push((word(at), &file[at + 8..at + length - 4]));
            at += length;
        }
        found
    }

    #[test]
    fn every_frame_is_a_packet_with_its_time_to_the_microsecond() {
        let request = frame::with_mbap(1, &[1, 3, 0, 10, 0, 1]);
        let frames = [
            frame(true, Framing::Mbap, request.clone(), FrameResult::Sent),
            frame(true, Framing::Rtu, frame::with_crc(&[1, 3, 0, 10, 0, 1]), FrameResult::Sent),
            frame(false, Framing::Rtu, vec![0xFF, 0, 0x55], FrameResult::Wrong(FrameFault::NoFrame)),
        ];
        let file = pcapng(&frames);
        let blocks = blocks(&file);
        assert_eq!(blocks.iter().map(|block| block.0).collect::<Vec<_>>(), [0x0A0D_0D0A, 1, 1, 6, 6, 6]);
        let (_, packet) = blocks[3];
        let micros = 1_700_000_000_123_456_u64;
        let head = [0, (micros >> 32) as u32, micros as u32, 66, 66].map(u32::to_le_bytes).concat();
        assert_eq!(packet[..20], head);
        assert_eq!(packet[20 + 54..20 + 66], request);
        // A header with its checksum sums up to nothing.
        assert_eq!(checksum(&packet[20 + 14..20 + 34]), 0);
        let said = |packet: &[u8], words: &[u8]| packet.windows(words.len()).any(|part| part == words);
        assert!(said(blocks[4].1, b"mbrtu") && !said(blocks[5].1, b"mbrtu"));
        assert!(said(blocks[5].1, b"no frame"));
    }

    #[test]
    fn a_corrupt_ascii_frame_does_not_become_a_good_one() {
        let corrupt =
            frame(false, Framing::Ascii, b":01030200010A\r\n".to_vec(), FrameResult::Wrong(FrameFault::CutShort));
        assert!(upper_pdu(&corrupt).ends_with(b":01030200010A\r\n"));
        let good = frame(false, Framing::Ascii, ascii::encode(&[1, 3, 2, 0, 1]), FrameResult::Good);
        assert!(upper_pdu(&good).ends_with(&frame::with_crc(&[1, 3, 2, 0, 1])));
    }

    #[test]
    fn sequence_numbers_go_on_in_both_directions() {
        let mut connection = Connection { sent: 1, received: 1, packets: 0 };
        let numbers = |packet: &[u8]| (packet[38..42].to_vec(), packet[42..46].to_vec());
        assert_eq!(numbers(&connection.packet(true, &[0; 12])), (vec![0, 0, 0, 1], vec![0, 0, 0, 1]));
        assert_eq!(numbers(&connection.packet(false, &[0; 11])), (vec![0, 0, 0, 1], vec![0, 0, 0, 13]));
        assert_eq!(numbers(&connection.packet(true, &[0; 12])), (vec![0, 0, 0, 13], vec![0, 0, 0, 12]));
    }

    #[test]
    fn the_text_form_says_all_in_a_line_and_can_be_read_back() {
        let frames = [
            frame(true, Framing::Rtu, frame::with_crc(&[1, 3, 3, 0xEA, 0, 1]), FrameResult::Sent),
            frame(false, Framing::Rtu, frame::with_crc(&[1, 3, 2, 0, 50]), FrameResult::Good),
            frame(false, Framing::Ascii, ascii::encode(&[1, 0x83, 2]), FrameResult::Good),
        ];
        let lines = text(&frames);
        assert_eq!(
            lines,
            "2023-11-14T22:13:20.123456Z TX 01 03 03 EA 00 01 A5 BA | unit 1 read holding registers 41003 (0x03EA, 1) | sent\n\
             2023-11-14T22:13:20.123456Z RX 01 03 02 00 32 39 91 | 1 register: 0032 | ok\n\
             2023-11-14T22:13:20.123456Z RX :0183027A\\r\\n | exception 02 illegal data address | ok\n"
        );
        for (line, frame) in lines.lines().zip(&frames) {
            let typed = crate::bus::hex_input::parse(line, None);
            assert!(
                typed.is_ok_and(|typed| typed.bytes[..] == frame.bytes[..] && typed.sent == Some(frame.sent)),
                "{line}"
            );
        }
    }
}
