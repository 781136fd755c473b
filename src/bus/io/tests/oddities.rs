//! Devices as they are: one bad block, request or connection costs nothing but itself.

use std::collections::BTreeSet;

use super::{slave::Line, *};
use crate::plant::PlantDef;

/// Good reads by block address of the first device until a second.
pub(super) async fn reads_until(
    line: &mut Line,
    def: &PlantDef,
    second: i64,
) -> (BTreeMap<u16, u32>, Vec<Fault>, usize) {
    let end = Timestamp::from_second(second).expect("a small number");
    let (mut reads, mut faults, mut lost) = (BTreeMap::new(), Vec::new(), 0);
    loop {
        match line.next(def).await {
            Event::Read { at, .. } | Event::Failed { at, .. } | Event::Line { at, .. } if end <= at => {
                return (reads, faults, lost);
            }
            Event::Read { device: DeviceId(0), values, .. } => {
                for (tag, _) in values {
                    *reads.entry(def.tag(tag).point.address).or_insert(0) += 1;
                }
            }
            Event::Failed { device: DeviceId(0), fault, .. } => faults.push(fault),
            Event::Line { state: LineState::Waiting { .. }, .. } => lost += 1,
            _ => {}
        }
    }
}

/// The addresses that a read asks the first device for.
pub(super) fn asked(message: &[u8]) -> Option<std::ops::Range<u16>> {
    match *message {
        [1, 3, high, low, many, few] => {
            let (start, count) = (u16::from_be_bytes([high, low]), u16::from_be_bytes([many, few]));
            Some(start..start + count)
        }
        _ => None,
    }
}

pub(super) fn touches(message: &[u8], address: u16) -> bool {
    asked(message).is_some_and(|asked| asked.contains(&address))
}

/// A hole is refused with whatever code: what is around it is read.
#[tokio::test(start_paused = true)]
async fn a_refused_block_is_split_in_every_mode_and_with_every_code() {
    for mode in Mode::ALL {
        for code in 1..=4 {
            let def = plant(mode);
            let mut line = line(def.clone());
            line.plug(mode, move |_, message| match touches(message, 11) {
                true => SlaveAction::Exception(code),
                false => SlaveAction::Answer,
            });
            let (reads, _, _) = reads_until(&mut line, &def, 20).await;
            let good: BTreeSet<u16> = reads.keys().copied().collect();
            let expect = BTreeSet::from([10, 12, 13, 20, 21, 22, 23, 400, 600]);
            assert_eq!(good, expect, "{mode:?}, exception {code}");
            assert!(12 < reads[&12], "{mode:?}, exception {code}: {reads:?}");
        }
    }
}

/// A block, or two of three, are silent, corrupt or refused: the others are read all the same, and the device is not given up.
#[tokio::test(start_paused = true)]
async fn bad_blocks_do_not_take_their_device_down() {
    for mode in Mode::ALL {
        for bad in [&[10][..], &[20], &[400], &[10, 20], &[10, 400], &[20, 400]] {
            for what in [
                SlaveAction::Silent,
                SlaveAction::BadCheck,
                SlaveAction::Exception(4),
                SlaveAction::Instead(vec![1, 3, 10, 0, 1, 0, 2, 0, 3, 0, 4, 0, 5]),
            ] {
                if mode.has_ids() && what == SlaveAction::BadCheck {
                    continue;
                }
                let def = plant(mode);
                let mut line = line(def.clone());
                let action = what.clone();
                line.plug(mode, move |_, message| match asked(message) {
                    // Parts of the block as well.
                    Some(asked) if bad.iter().any(|bad| (*bad..bad + 4).contains(&asked.start)) => action.clone(),
                    _ => SlaveAction::Answer,
                });
                let (reads, faults, _) = reads_until(&mut line, &def, 30).await;
                for good in [10, 20, 400].into_iter().filter(|block| !bad.contains(block)) {
                    let count = reads.get(&good).copied().unwrap_or_default();
                    assert!(15 <= count, "{mode:?}, {bad:?} are bad ({what:?}): {count} reads of {good} in 30 s");
                }
                // Good frames of a wrong length are noise to the others for a timeout: there it may be given up for a moment.
                let is_noise = matches!(what, SlaveAction::Instead(_)) && !mode.has_ids();
                assert!(is_noise || !faults.contains(&Fault::BackedOff), "{mode:?}, {bad:?} are bad ({what:?})");
            }
        }
    }
}

/// A unit without function 08 that answers whole blocks only is up within seconds.
#[tokio::test(start_paused = true)]
async fn a_unit_that_answers_exact_blocks_only_is_read_within_seconds() {
    for mode in [Mode::Rtu, Mode::Ascii, Mode::RtuOverTcp] {
        for other in [SlaveAction::Silent, SlaveAction::Exception(3), SlaveAction::Exception(4)] {
            let def = plant(mode);
            let mut line = line(def.clone());
            let action = other.clone();
            line.plug(mode, move |_, message| match asked(message) {
                Some(asked) if [10..14, 20..24, 400..401, 600..601].contains(&asked) => SlaveAction::Answer,
                _ if message[0] == 1 => action.clone(),
                _ => SlaveAction::Answer,
            });
            let first = |event: &Event| match event {
                Event::Read { at, device: DeviceId(0), .. } => Some(*at),
                _ => None,
            };
            let first = line.until(&def, first).await.as_millisecond();
            assert!(first < 20_000, "{mode:?}, {other:?}: first value after {first} ms");
        }
    }
}

/// A device that refuses everything while it starts up is read soon after.
#[tokio::test(start_paused = true)]
async fn a_refusal_of_everything_while_starting_is_not_believed() {
    for mode in Mode::ALL {
        for code in [2, 4] {
            let def = plant(mode);
            let mut line = line(def.clone());
            let since = tokio::time::Instant::now();
            line.plug(mode, move |_, message| match message {
                [1, 3, ..] if since.elapsed() < Duration::from_secs(12) => SlaveAction::Exception(code),
                _ => SlaveAction::Answer,
            });
            let (reads, _, _) = reads_until(&mut line, &def, 40).await;
            for block in [10, 13, 23, 400] {
                let count = reads.get(&block).copied().unwrap_or_default();
                assert!(15 <= count, "{mode:?}, exception {code}: {count} reads of {block} after it was up");
            }
        }
    }
}

/// Blocks of one register of which all but one are refused: that one is found, whichever it is.
#[tokio::test(start_paused = true)]
async fn one_register_that_is_there_is_read_beside_refused_ones() {
    for mode in Mode::ALL {
        for there in [10, 12, 20, 22, 400] {
            let mut def = plant(mode);
            let every_second = |address: u16| [10, 12, 20, 22, 400].contains(&address);
            def.tags.iter_mut().filter(|tag| !every_second(tag.point.address)).for_each(|tag| tag.poll = Poll::Never);
            let mut line = line(def.clone());
            line.plug(mode, move |_, message| match asked(message) {
                Some(asked) if asked != (there..there + 1) => SlaveAction::Exception(2),
                _ => SlaveAction::Answer,
            });
            let (reads, _, _) = reads_until(&mut line, &def, 30).await;
            let count = reads.get(&there).copied().unwrap_or_default();
            assert!(15 <= count, "{mode:?}: {count} reads of {there} in 30 s");
        }
    }
}

/// A slave whose connection ends on some requests; each opening takes the next of its ports.
fn hang_up_on(line: &Line, mode: Mode, ports: usize, hangs_up: fn(usize, &[u8]) -> bool) {
    for _ in 0..ports {
        let (mut number, mut over) = (0, false);
        line.plug(mode, move |_, message| {
            number += 1;
            over |= hangs_up(number, message);
            if over { SlaveAction::HangUp } else { SlaveAction::Answer }
        });
    }
}

/// The connection ends on one block: the others are read, that block is named, and the line is not called lost.
#[tokio::test(start_paused = true)]
async fn a_block_that_ends_the_connection_waits_alone() {
    for mode in [Mode::Tcp, Mode::Tcp16, Mode::RtuOverTcp] {
        for bad in [10, 400] {
            let def = plant(mode);
            let mut line = line(def.clone());
            let hangs_up: fn(usize, &[u8]) -> bool =
                if bad == 10 { |_, message| touches(message, 10) } else { |_, message| touches(message, 400) };
            hang_up_on(&line, mode, 60, hangs_up);
            let (reads, faults, lost) = reads_until(&mut line, &def, 30).await;
            let others = reads.get(&20).copied().unwrap_or_default();
            assert!(25 <= others, "{mode:?}, {bad}: {others} reads of another block in 30 s");
            assert!(!reads.contains_key(&bad) && faults.contains(&Fault::Hangup), "{mode:?}, {bad}: {faults:?}");
            assert_eq!(lost, 0, "{mode:?}, {bad}: the line was called lost");
            assert!(!faults.contains(&Fault::BackedOff), "{mode:?}, {bad}: the device was given up");
        }
    }
}

/// The other side allows one answer, or three, on each connection.
#[tokio::test(start_paused = true)]
async fn short_lived_connections_are_a_mode_that_works() {
    for mode in [Mode::Tcp, Mode::Tcp16, Mode::RtuOverTcp] {
        for most in [1, 3] {
            let def = plant(mode);
            let mut line = line(def.clone());
            let hangs_up: fn(usize, &[u8]) -> bool = if most == 1 { |n, _| 1 < n } else { |n, _| 3 < n };
            hang_up_on(&line, mode, 900, hangs_up);
            let (reads, faults, lost) = reads_until(&mut line, &def, 30).await;
            for block in [10, 20, 400] {
                let count = reads.get(&block).copied().unwrap_or_default();
                assert!(25 <= count, "{mode:?}, {most} a connection: {count} reads of {block} in 30 s");
            }
            assert_eq!((faults, lost), (Vec::new(), 0), "{mode:?}, {most} a connection");
        }
    }
}

/// n failures in a row, of whatever kind, are "not responding".
#[tokio::test(start_paused = true)]
async fn a_unit_that_only_ever_fails_is_given_up_whatever_the_fault() {
    for mode in [Mode::Rtu, Mode::Ascii, Mode::RtuOverTcp] {
        for what in [SlaveAction::BadCheck, SlaveAction::Cut(4), SlaveAction::Instead(vec![9, 3, 2, 0, 1])] {
            let def = plant(mode);
            let mut line = line(def.clone());
            let action = what.clone();
            line.plug(mode, move |_, message| if message[0] == 1 { action.clone() } else { SlaveAction::Answer });
            let given_up = |event: &Event| match event {
                Event::Failed { at, fault: Fault::BackedOff, device: DeviceId(0), .. } => Some(*at),
                _ => None,
            };
            let at = line.until(&def, given_up).await.as_second();
            assert!(at < 30, "{mode:?}, {what:?}: given up after {at} s");
        }
    }
}

/// Two seconds of silence of a living unit beside a dead block of another cost two seconds and a timeout.
#[tokio::test(start_paused = true)]
async fn a_unit_that_blinks_beside_a_dead_block_is_back_at_once() {
    for mode in Mode::ALL {
        let def = plant(mode);
        let mut line = line(def.clone());
        let since = tokio::time::Instant::now();
        line.plug(mode, move |_, message| match (message, since.elapsed().as_secs()) {
            ([1, 3, 0, 20, ..], _) | ([2, ..], 30..33) => SlaveAction::Silent,
            _ => SlaveAction::Answer,
        });
        let (from, until) = (30, 60);
        let mut last = Timestamp::from_second(from).expect("a small number");
        let mut longest = Duration::ZERO;
        while last < Timestamp::from_second(until).expect("a small number") {
            if let Event::Read { at, device: DeviceId(1), .. } = line.next(&def).await
                && last < at
            {
                longest = longest.max(Duration::try_from(at.duration_since(last)).expect("not negative"));
                last = at;
            }
        }
        assert!(longest < Duration::from_millis(4_500), "{mode:?}: dark for {longest:?}");
    }
}

/// An answer that carries another transaction is no silence: it is named.
#[tokio::test(start_paused = true)]
async fn a_strange_transaction_is_named() {
    let mode = Mode::Tcp;
    let def = plant(mode);
    let mut line = line(def.clone());
    line.plug(mode, |number, message| {
        let answer = [1, 3, 2, 0, 7];
        let strange = if message[0] == 1 { frame::with_mbap(number as u16 + 20, &answer) } else { Vec::new() };
        SlaveAction::Bytes(strange)
    });
    let named = |event: &Event| match event {
        Event::Failed { fault: Fault::WrongTransaction { .. }, .. } => Some(()),
        _ => None,
    };
    line.until(&def, named).await;
}

/// A gateway that closes each connection after a while, with a unit behind it that never answers: of the other nothing is lost.
#[tokio::test(start_paused = true)]
async fn a_dead_unit_is_not_why_a_gateway_closes_its_connections() {
    for mode in [Mode::Tcp, Mode::Tcp16, Mode::RtuOverTcp] {
        let def = plant(mode);
        let mut line = line(def.clone());
        for _ in 0..100 {
            let mut since = None;
            line.plug(mode, move |_, message| {
                let since = *since.get_or_insert_with(tokio::time::Instant::now);
                match message[0] {
                    _ if Duration::from_secs(6) <= since.elapsed() => SlaveAction::HangUp,
                    2 => SlaveAction::Silent,
                    _ => SlaveAction::Answer,
                }
            });
        }
        let (reads, faults, lost) = reads_until(&mut line, &def, 120).await;
        assert!(100 < reads[&12], "{mode:?}: {reads:?}");
        assert_eq!((faults, lost), (vec![], 0), "{mode:?}");
    }
}
