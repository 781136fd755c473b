//! Saved traffic, opened by Wireshark's own reader.

use std::{fs, process::Command, sync::Arc};

use jiff::{SignedDuration, Timestamp};
use sightglass::api::{
    bus::{ascii, capture, frame},
    plant::{Fault, Frame, FrameFault, FrameResult, Framing},
};

use crate::support::{folder, have};

/// A read, a write, a write of several, and a refusal; each with its answer.
const EXCHANGES: [(&[u8], &[u8]); 4] = [
    (&[1, 3, 0x03, 0xEA, 0, 1], &[1, 3, 2, 0, 50]),
    (&[1, 6, 0x03, 0xEA, 0, 50], &[1, 6, 0x03, 0xEA, 0, 50]),
    (&[17, 16, 0, 1, 0, 2, 4, 0, 10, 1, 2], &[17, 16, 0, 1, 0, 2]),
    (&[10, 1, 0x04, 0xA1, 0, 1], &[10, 0x81, 2]),
];

fn traffic(framing: Framing) -> Vec<Frame> {
    let mut frames = Vec::new();
    for (number, message) in EXCHANGES.iter().flat_map(|(request, answer)| [*request, *answer]).enumerate() {
        let bytes = match framing {
            Framing::Rtu => frame::with_crc(message),
            Framing::Ascii => ascii::encode(message),
            Framing::Mbap => frame::with_mbap(number as u16 / 2, message),
        };
        frames.push(Frame {
            at: Timestamp::UNIX_EPOCH + SignedDuration::from_micros(1_700_000_000_000_001 + 20_000 * number as i64),
            sent: number % 2 == 0,
            bytes: bytes.into(),
            framing,
            result: if number % 2 == 0 { FrameResult::Sent } else { FrameResult::Good },
            unit: Some(message[0]),
            number: number as u64,
        });
    }
    frames
}

fn tshark(frames: &[Frame], args: &[&str]) -> Vec<String> {
    let folder = folder();
    let file = folder.path().join("line.pcapng");
    fs::write(&file, capture::pcapng(frames)).unwrap();
    let output = Command::new("tshark").arg("-r").arg(&file).args(args).output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{said}");
    String::from_utf8(output.stdout).unwrap().lines().map(str::to_owned).collect()
}

fn check(lines: &[String], expect: &[&[&str]]) {
    assert_eq!(lines.len(), expect.len(), "{lines:#?}");
    for (line, words) in lines.iter().zip(expect) {
        for word in *words {
            assert!(line.contains(word), "no `{word}` in `{line}`");
        }
    }
}

const NAMED: [&[&str]; 8] = [
    &["Query", "Read Holding Registers"],
    &["Response", "Read Holding Registers"],
    &["Query", "Write Single Register"],
    &["Response", "Write Single Register"],
    &["Query", "Write Multiple Registers"],
    &["Response", "Write Multiple Registers"],
    &["Query", "Read Coils"],
    &["Response", "Read Coils", "Exception returned"],
];

#[test]
fn wireshark_reads_tcp_traffic_without_settings() {
    if !have("tshark", "tshark") {
        return;
    }
    let frames = traffic(Framing::Mbap);
    check(&tshark(&frames, &[]), &NAMED);
    // Right checksums, no retransmission, nothing missing; the value of the register is there.
    let strict =
        ["-o", "ip.check_checksum:TRUE", "-o", "tcp.check_checksum:TRUE", "-Y", "_ws.expert.severity >= warning"];
    let suspicious = tshark(&frames, &strict);
    assert!(suspicious.iter().all(|line| line.contains("Exception returned")), "{suspicious:#?}");
    let values = tshark(
        &frames,
        &["-Y", "frame.number == 2", "-T", "fields", "-e", "modbus.regval_uint16", "-e", "frame.time_epoch"],
    );
    check(&values, &[&["50", "1700000000.020001"]]);
}

#[test]
fn wireshark_reads_serial_traffic_without_settings() {
    if !have("tshark", "tshark") {
        return;
    }
    for framing in [Framing::Rtu, Framing::Ascii] {
        let frames = traffic(framing);
        let mut plain = NAMED;
        // Their response repeats them: without ports the two directions look the same.
        (plain[2], plain[3]) = (&["Write Single Register"], &["Write Single Register"]);
        check(&tshark(&frames, &[]), &plain);
        let with_port = tshark(&frames, &["-o", "mbrtu.tcp.port:1502", "-o", "mbrtu.crc_verification:TRUE"]);
        check(&with_port, &NAMED);
        assert!(with_port.iter().all(|line| !line.contains("Incorrect CRC")), "{with_port:#?}");
    }
}

#[test]
fn what_was_corrupt_is_no_modbus_and_says_why() {
    if !have("tshark", "tshark") {
        return;
    }
    let mut frames = traffic(Framing::Rtu);
    Arc::make_mut(&mut frames[1].bytes)[4] ^= 1;
    frames[1].result = FrameResult::Wrong(FrameFault::NoResponse(Fault::Crc { got: 0x9139, computed: 0x5138 }));
    let lines = tshark(&frames[..2], &["-T", "fields", "-e", "frame.protocols", "-e", "frame.comment"]);
    check(&lines, &[&["mbrtu"], &["data", "CRC error"]]);
}
