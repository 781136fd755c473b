//! A line in virtual time: what it takes for a request, and how long all of it takes.

use jiff::Timestamp;
use tokio::io::{DuplexStream, duplex};

use super::*;
use crate::bus::frame::with_crc;
use crate::plant::def::LineId;
use crate::plant::def::Parity;
use crate::sim::faults::InjectedFault;
use crate::sim::io::{SimulatorHandle, serving::FOR_EVER};
use crate::sim::rig::Rig;
use crate::sim::simulator::Simulator;

const L1: LineId = LineId(0);
const READ_TEN: &[u8] = &[1, 4, 0x03, 0xE8, 0, 10];
const READ_STEP: &[u8] = &[2, 3, 4, 0, 0, 1];

fn line(baud: u32, parity: Parity, speed: f64) -> (DuplexStream, SimulatorHandle) {
    serve(Serial { baud, data_bits: 8, parity, stop_bits: 1 }, false, speed)
}

fn serve(serial: Serial, ascii: bool, speed: f64) -> (DuplexStream, SimulatorHandle) {
    let simulator =
        SimulatorHandle::spawn(Simulator::tank(Rig::demo()), Clock::starting_at(Timestamp::UNIX_EPOCH, speed));
    let (master, slave) = duplex(1024);
    tokio::spawn(serve_line(slave, simulator.line(L1), Wire { serial, ascii }, FOR_EVER));
    (master, simulator)
}

/// What arrives until nothing has come for two seconds, and when its last byte came.
async fn gather(master: &mut DuplexStream) -> (Vec<u8>, Duration) {
    let (asked, mut frame, mut took) = (Instant::now(), Vec::new(), Duration::ZERO);
    let mut bytes = [0; 256];
    while let Ok(Ok(count)) = timeout(Duration::from_secs(2), master.read(&mut bytes)).await {
        if count == 0 {
            break;
        }
        frame.extend_from_slice(&bytes[..count]);
        took = asked.elapsed();
    }
    (frame, took)
}

async fn ask(master: &mut DuplexStream, message: &[u8]) -> (Vec<u8>, Duration) {
    master.write_all(&with_crc(message)).await.expect("the line takes requests");
    gather(master).await
}

async fn check(baud: u32, parity: Parity, speed: f64, expect_ms: f64) {
    let (mut master, _simulator) = line(baud, parity, speed);
    let (frame, took) = ask(&mut master, READ_TEN).await;
    assert_eq!(frame.len(), 25);
    let took_ms = took.as_secs_f64() * 1e3;
    assert!((expect_ms..expect_ms + 2.0).contains(&took_ms), "{took_ms} ms at {baud}, expected {expect_ms} ms");
}

/// (8 + 25) characters, one silence before the answer, 5 ms of the device; the second silence is the master's.
#[tokio::test(start_paused = true)]
async fn an_answer_takes_the_time_of_the_wire() {
    check(9600, Parity::None, 1.0, 330.0 / 9.6 + 35.0 / 9.6 + 5.0).await;
    check(9600, Parity::Even, 1.0, 45.8 - 4.01 + 5.0).await;
    check(19_200, Parity::Even, 1.0, 22.9 - 2.0 + 5.0).await;
    check(115_200, Parity::Even, 1.0, 6.7 - 1.75 + 5.0).await;
    check(9600, Parity::None, 10.0, 4.3).await;
}

#[tokio::test(start_paused = true)]
async fn the_grain_of_the_timers_does_not_add_up() {
    let (mut master, _simulator) = line(115_200, Parity::None, 1.0);
    let (began, mut reply, rounds) = (Instant::now(), [0; 25], 200);
    for _ in 0..rounds {
        master.write_all(&with_crc(READ_TEN)).await.expect("the line takes requests");
        master.read_exact(&mut reply).await.expect("the line answers");
    }
    let each_ms = began.elapsed().as_secs_f64() * 1e3 / f64::from(rounds);
    let wire_ms = 330.0 / 115.2 + 1.75 + 5.0;
    assert!((each_ms / wire_ms - 1.0).abs() < 0.01, "{each_ms} ms each, the wire needs {wire_ms} ms");
}

#[tokio::test(start_paused = true)]
async fn a_request_in_pieces_and_one_after_noise_are_understood() {
    let (mut master, _simulator) = line(9600, Parity::None, 1.0);
    let request = with_crc(READ_STEP);
    master.write_all(&request[..3]).await.expect("the line takes bytes");
    tokio::time::advance(Duration::from_millis(5)).await;
    master.write_all(&request[3..]).await.expect("the line takes bytes");
    assert_eq!(gather(&mut master).await.0.len(), 7);
    master.write_all(&[0xFF, 0x00, 0x55]).await.expect("the line takes bytes");
    assert_eq!(gather(&mut master).await.0, Vec::<u8>::new());
    assert_eq!(ask(&mut master, READ_STEP).await.0.len(), 7);
    assert_eq!(ask(&mut master, &[1, 0x2B, 14, 1, 0]).await.0, with_crc(&[1, 0xAB, 1]));
}

/// Longer than its function says, with a right check: refused. Without one, or two at once: no request at all.
#[tokio::test(start_paused = true)]
async fn only_silence_ends_a_request() {
    let (mut master, _simulator) = line(9600, Parity::None, 1.0);
    for (message, answer) in [
        (&[2, 3, 4, 0, 0, 1, 0][..], &[2, 0x83, 3][..]),
        (&[2, 3, 4, 0, 0], &[2, 0x83, 3]),
        (&[2, 6, 4, 0x10, 0, 1, 0, 1], &[2, 0x86, 3]),
        (&[2, 0x42, 1], &[2, 0xC2, 1]),
    ] {
        assert_eq!(ask(&mut master, message).await.0, with_crc(answer), "{message:02X?}");
    }
    let read = with_crc(READ_STEP);
    for bytes in [[&read[..], &[7]].concat(), [&read[..], &read].concat(), [&[0][..], &read].concat()] {
        master.write_all(&bytes).await.expect("the line takes bytes");
        assert_eq!(gather(&mut master).await.0, Vec::<u8>::new(), "{bytes:02X?}");
    }
    // What comes before the silence is over belongs to the frame.
    master.write_all(&read).await.expect("the line takes bytes");
    tokio::time::sleep(Duration::from_millis(9)).await;
    master.write_all(&[7]).await.expect("the line takes bytes");
    assert_eq!(gather(&mut master).await.0, Vec::<u8>::new());
    assert_eq!(ask(&mut master, &[2, 8, 0, 0x0C, 0, 0]).await.0, with_crc(&[2, 8, 0, 0x0C, 0, 4]));
    assert_eq!(ask(&mut master, READ_STEP).await.0.len(), 7);
}

#[tokio::test(start_paused = true)]
async fn faults_look_as_they_do_on_a_line() {
    let (mut master, simulator) = line(9600, Parity::None, 1.0);
    simulator.inject_into_unit(L1, 1, InjectedFault::Silent).await;
    assert_eq!(ask(&mut master, READ_TEN).await.0, Vec::<u8>::new());
    assert_eq!(ask(&mut master, READ_STEP).await.0.len(), 7);
    simulator.inject_into_unit(L1, 1, InjectedFault::Cut).await;
    assert_eq!(ask(&mut master, READ_TEN).await.0.len(), 12);
    simulator.inject_into_unit(L1, 1, InjectedFault::Late(Duration::from_millis(700))).await;
    let (frame, took) = ask(&mut master, READ_TEN).await;
    assert!(frame.len() == 25 && took > Duration::from_millis(743), "{took:?}");
}

#[tokio::test(start_paused = true)]
async fn another_unit_answers_while_one_is_late() {
    let (mut master, simulator) = line(9600, Parity::None, 1.0);
    simulator.inject_into_unit(L1, 1, InjectedFault::Late(Duration::from_millis(500))).await;
    master.write_all(&with_crc(READ_TEN)).await.expect("the line takes requests");
    tokio::time::sleep(Duration::from_millis(100)).await;
    let (frames, _) = ask(&mut master, READ_STEP).await;
    assert_eq!((frames.len(), frames[0], frames[7]), (32, 2, 1));
}

#[tokio::test(start_paused = true)]
async fn a_broadcast_is_obeyed_but_not_answered_nor_is_a_stranger() {
    let (mut master, _simulator) = line(9600, Parity::None, 1.0);
    assert_eq!(ask(&mut master, &[0, 6, 0x03, 0xEA, 0, 1]).await.0, Vec::<u8>::new());
    assert_eq!(ask(&mut master, &[9, 3, 0, 0, 0, 1]).await.0, Vec::<u8>::new());
    for unit in [1, 2] {
        assert_eq!(ask(&mut master, &[unit, 3, 0x03, 0xEA, 0, 1]).await.0, with_crc(&[unit, 3, 2, 0, 1]));
    }
}

/// The counter of bus communication errors (08/0C) of unit 2.
#[tokio::test(start_paused = true)]
async fn a_slave_counts_the_frames_that_it_could_not_read() {
    let (mut master, _simulator) = line(9600, Parity::None, 1.0);
    for corrupt in [&[1, 3, 0, 0, 0, 1, 0, 0][..], &[0xFF], &[2; 300]] {
        master.write_all(corrupt).await.expect("the line takes bytes");
        assert_eq!(gather(&mut master).await.0, Vec::<u8>::new());
    }
    let answer = ask(&mut master, &[2, 8, 0, 0x0C, 0, 0]).await.0;
    assert_eq!(answer, with_crc(&[2, 8, 0, 0x0C, 0, 3]));
}

const SEVEN_BITS: Serial = Serial { baud: 9600, data_bits: 7, parity: Parity::Even, stop_bits: 1 };

async fn ask_ascii(master: &mut DuplexStream, frame: &str) -> (String, Duration) {
    master.write_all(frame.as_bytes()).await.expect("the line takes requests");
    let (answer, took) = gather(master).await;
    (String::from_utf8(answer).expect("ASCII"), took)
}

/// 17 characters there, 15 back, 5 ms of the device, no silence between.
#[tokio::test(start_paused = true)]
async fn ascii_takes_its_own_time() {
    let (mut master, _simulator) = serve(SEVEN_BITS, true, 1.0);
    let (answer, took) = ask_ascii(&mut master, ":010303EA00010E\r\n").await;
    assert_eq!(answer, ":01030202BC3C\r\n");
    let (took_ms, wire_ms) = (took.as_secs_f64() * 1e3, 320.0 / 9.6 + 5.0);
    assert!((wire_ms..wire_ms + 2.0).contains(&took_ms), "{took_ms} ms, the wire needs {wire_ms} ms");
}

#[tokio::test(start_paused = true)]
async fn ascii_waits_a_second_and_restarts_at_a_colon() {
    let (mut master, simulator) = serve(SEVEN_BITS, true, 1.0);
    master.write_all(b":010303EA").await.expect("the line takes bytes");
    tokio::time::advance(Duration::from_millis(900)).await;
    assert_eq!(ask_ascii(&mut master, "00010E\r\n").await.0, ":01030202BC3C\r\n");
    // `gather` waits two seconds: too long for a frame.
    assert_eq!(ask_ascii(&mut master, ":010303EA").await.0, "");
    assert_eq!(ask_ascii(&mut master, "00010E\r\n").await.0, "");
    assert_eq!(ask_ascii(&mut master, ":0103:010303EA00010E\r\n").await.0, ":01030202BC3C\r\n");
    assert_eq!(ask_ascii(&mut master, ":010303EA00010F\r\n").await.0, "");
    assert_eq!(ask_ascii(&mut master, ":0208000C0000EA\r\n").await.0, ":0208000C0003E7\r\n");
    simulator.inject_into_unit(L1, 1, InjectedFault::BadCrc).await;
    assert_eq!(ask_ascii(&mut master, ":010303EA00010E\r\n").await.0, ":01030202BC30\r\n");
}
