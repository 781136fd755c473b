//! Devices and gateways as people have reported them in public; each test names its sources.

use std::collections::BTreeSet;

use super::{
    oddities::{asked, reads_until, touches},
    slave::{Line, correct},
    *,
};
use crate::plant::PlantDef;

/// Modes whose frames are cut by their own bytes and a CRC.
const CRC_MODES: [Mode; 2] = [Mode::Rtu, Mode::RtuOverTcp];
/// Modes of Modbus TCP.
const MBAP_MODES: [Mode; 2] = [Mode::Tcp, Mode::Tcp16];
/// An acknowledgement of a write.
type Form = fn(&[u8]) -> Vec<u8>;

/// Good reads by block address of each of the two devices until a second, and the faults of the first.
async fn play(line: &mut Line, def: &PlantDef, until: i64) -> ([BTreeMap<u16, u32>; 2], Vec<Fault>) {
    let end = Timestamp::from_second(until).expect("a small number");
    let (mut reads, mut faults) = ([BTreeMap::new(), BTreeMap::new()], Vec::new());
    loop {
        match line.next(def).await {
            Event::Read { at, .. } | Event::Failed { at, .. } | Event::Line { at, .. } if end <= at => {
                return (reads, faults);
            }
            Event::Read { device, values, .. } => {
                for (tag, _) in values {
                    *reads[usize::from(device.0)].entry(def.tag(tag).point.address).or_insert(0) += 1;
                }
            }
            Event::Failed { device: DeviceId(0), fault, .. } => faults.push(fault),
            _ => {}
        }
    }
}

/// Writes register 10 once the line is read; gives the result and the number of writes on the wire.
async fn written(
    mode: Mode,
    function: u8,
    raw: f64,
    reply: impl Fn(&[u8]) -> SlaveAction + Send + 'static,
) -> (WriteResult, usize) {
    let mut def = plant(mode);
    def.tags[0].write_fc = Some(function);
    if function == 5 || function == 15 {
        // Coil 1 holds 1.
        (def.tags[0].point.table, def.tags[0].point.kind, def.tags[0].point.address) = (Table::Coil, DataType::Bool, 1);
    }
    let mut line = line(def.clone());
    let writes = Arc::new(AtomicUsize::new(0));
    let count = writes.clone();
    line.plug(mode, move |_, message| match message {
        [_, 1, ..] => SlaveAction::Instead(vec![message[0], 1, 1, 1]),
        [1, 5 | 6 | 15 | 16, ..] => {
            count.fetch_add(1, Ordering::Relaxed);
            reply(message)
        }
        _ => SlaveAction::Answer,
    });
    line.read(&def).await;
    let job = WriteJob {
        id: WriteId(7),
        tag: TagId(0),
        raw: raw.into(),
        unlock: None,
        verify: true,
        urgent: false,
        over: None,
        unscaled_by: None,
    };
    line.requests.send(BusRequest::Write(job)).await.expect("the line runs");
    let ended = |event: &Event| match event {
        Event::Wrote { id: WriteId(7), result, .. } => Some(result.clone()),
        _ => None,
    };
    let result = line.until(&def, ended).await;
    for _ in 0..20 {
        line.next(&def).await;
    }
    (result, writes.load(Ordering::Relaxed))
}

/// A device that hears nothing for 100 ms after its own answer: "Modbus RTU times out if I donot wait 100ms between reads"
/// (github.com/NModbus/NModbus, issue 188), Daikin (ioBroker/ioBroker.modbus, issue 39), Carlo Gavazzi's "T delay" (eModbus/eModbus,
/// issue 223).
#[tokio::test(start_paused = true)]
async fn a_device_that_is_deaf_after_each_answer_is_read() {
    for mode in Mode::ALL {
        let def = plant(mode);
        let mut line = line(def.clone());
        let mut deaf_until = tokio::time::Instant::now();
        line.plug(mode, move |_, message| {
            let now = tokio::time::Instant::now();
            if message[0] != 1 {
                return SlaveAction::Answer;
            }
            if now < deaf_until {
                return SlaveAction::Silent;
            }
            deaf_until = now + 100 * MS;
            SlaveAction::Answer
        });
        let (reads, _) = play(&mut line, &def, 60).await;
        for block in [10, 20, 400] {
            let count = reads[0].get(&block).copied().unwrap_or_default();
            assert!(40 <= count, "{mode:?}: {count} reads of {block} in 60 s");
        }
        assert!(50 <= reads[1].get(&10).copied().unwrap_or_default(), "{mode:?}: the other device");
    }
}

/// More registers than it can send are answered with silence: "Timeout error when requesting more than 28 registers"
/// (github.com/emelianov/modbus-esp8266, issue 370).
#[tokio::test(start_paused = true)]
async fn a_block_too_long_for_a_silent_device_is_read_in_parts() {
    for mode in Mode::ALL {
        let def = plant(mode);
        let mut line = line(def.clone());
        line.plug(mode, |_, message| match asked(message) {
            Some(asked) if 2 < asked.len() => SlaveAction::Silent,
            _ => SlaveAction::Answer,
        });
        let (reads, _) = play(&mut line, &def, 60).await;
        for address in [10, 11, 12, 13, 20, 21, 22, 23, 400] {
            let count = reads[0].get(&address).copied().unwrap_or_default();
            assert!(50 <= count, "{mode:?}: {count} reads of {address} in 60 s");
        }
        assert!(50 <= reads[1].get(&10).copied().unwrap_or_default(), "{mode:?}: the other device");
    }
}

/// Zero bytes before and behind each answer, where a transceiver changes its direction: home-assistant/core, issue 69742 (three
/// behind, over the network), eModbus/eModbus, issue 40 (both), favalex/modbus-cli, issue 41 (both).
#[tokio::test(start_paused = true)]
async fn zeros_around_answers_cost_nothing() {
    for mode in CRC_MODES {
        for (before, behind) in [(0, 3), (1, 1), (2, 0), (0, 1)] {
            let def = plant(mode);
            let mut line = line(def.clone());
            line.plug(mode, move |_, message| {
                let answer = frame::with_crc(&correct(message));
                SlaveAction::Bytes([vec![0; before], answer, vec![0; behind]].concat())
            });
            let (reads, faults) = play(&mut line, &def, 30).await;
            assert!(faults.is_empty(), "{mode:?}, {before} before, {behind} behind: {faults:?}");
            assert!(29 <= reads[0][&10] && 29 <= reads[1][&400], "{mode:?}, {before} and {behind}: {reads:?}");
        }
    }
}

/// A converter that puts its MAC address before everything that it sends: pymodbus-dev/pymodbus, issue 554. The address may look
/// like the beginning of an answer.
#[tokio::test(start_paused = true)]
async fn an_address_before_each_answer_costs_nothing() {
    for mac in [
        [0, 0x30, 0xF9, 0x12, 0x34, 0x56],
        [0, 0x30, 0xF9, 1, 3, 8],
        [0, 0x30, 0xF9, 4, 1, 3],
        [0, 0x30, 0xF9, 1, 3, 0xFF],
    ] {
        let mode = Mode::RtuOverTcp;
        let def = plant(mode);
        let mut line = line(def.clone());
        line.plug(mode, move |_, _| SlaveAction::Noise(mac.to_vec()));
        let (reads, faults) = play(&mut line, &def, 30).await;
        assert!(29 <= reads[0][&10] && faults.is_empty(), "{mac:?}: {reads:?}, {faults:?}");
    }
}

/// Refusals that mean nothing, of requests that were answered before and are afterwards, while a motor starts nearby:
/// wirenboard/wb-mqtt-serial, issue 806 ("illegal data value" ended the reading of that register for ever).
#[tokio::test(start_paused = true)]
async fn refusals_by_chance_end_no_reading() {
    for mode in Mode::ALL {
        for code in 1..=4 {
            let def = plant(mode);
            let mut line = line(def.clone());
            let mut random = 12_345_u32;
            line.plug(mode, move |_, _| {
                random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                if random >> 24 < 13 { SlaveAction::Exception(code) } else { SlaveAction::Answer }
            });
            let (reads, _) = play(&mut line, &def, 300).await;
            for address in [10, 11, 12, 13, 20, 21, 22, 23, 400] {
                let count = reads[0].get(&address).copied().unwrap_or_default();
                assert!(270 <= count, "{mode:?}, exception {code}: {count} reads of {address} in 300 s");
            }
        }
    }
}

/// Answers to reads whose byte count is missing (CIRCUITSTATE/CSE_ModbusRTU, issue 4), has two bytes (a drive SKI 780:
/// pymodbus-dev/pymodbus, issue 1542), or is another number (esphome/issues, issue 2893): no value, and no fault of the wiring.
#[tokio::test(start_paused = true)]
async fn a_wrong_byte_count_under_a_good_check_is_named() {
    for mode in Mode::ALL {
        for form in ["missing", "two bytes", "too many", "too few"] {
            let def = plant(mode);
            let mut line = line(def.clone());
            line.plug(mode, move |_, message| {
                if !touches(message, 10) {
                    return SlaveAction::Answer;
                }
                let mut answer = correct(message);
                match form {
                    "missing" => drop(answer.remove(2)),
                    "two bytes" => answer.insert(2, 0),
                    "too many" => answer[2] = 74,
                    _ => answer[2] /= 2,
                }
                SlaveAction::Instead(answer)
            });
            let (reads, faults) = play(&mut line, &def, 60).await;
            let named = faults.iter().filter(|fault| matches!(fault, Fault::WrongLength { .. })).count();
            let others = faults.iter().filter(|fault| !matches!(fault, Fault::WrongLength { .. } | Fault::OutOfSync));
            assert_eq!(others.collect::<Vec<_>>(), Vec::<&Fault>::new(), "{mode:?}, {form}");
            assert!(0 < named && !reads[0].contains_key(&10), "{mode:?}, {form}: {faults:?}");
            for (device, block) in [(0, 20), (0, 400), (1, 10)] {
                let count = reads[device].get(&block).copied().unwrap_or_default();
                assert!(40 <= count, "{mode:?}, {form}: {count} reads of {block} of {device}");
            }
        }
    }
}

/// Writes that were done, and acknowledged in a wrong form: with all that was written (eModbus/eModbus, issue 62), with another
/// state of the coil (ClassicDIY/ModbusTool, issue 4), with the function alone (luizcantoni/mudbus, issue 1), with a byte too many
/// (IndustrialShields/arduino-Tools40, issue 7), with address 0 (NModbus/NModbus, issue 89), of no register. What the device holds is
/// said, whether that is what was written or not.
#[tokio::test(start_paused = true)]
async fn a_write_that_is_acknowledged_in_a_wrong_form_is_read_back() {
    let forms: [(u8, Form); 7] = [
        (16, |message| message.to_vec()),
        (16, |message| [&message[..4], &[0, 0]].concat()),
        (6, |message| [message, &[6]].concat()),
        (6, |message| [&message[..2], &[0, 0], &message[4..]].concat()),
        (6, |message| message[..2].to_vec()),
        (5, |message| [&message[..4], &[0, 1]].concat()),
        (5, |message| message[..2].to_vec()),
    ];
    for mode in Mode::ALL {
        for (n, (function, form)) in forms.into_iter().enumerate() {
            let (holds, other) = if function == 5 { (1.0, 0.0) } else { (10.0, 11.0) };
            for raw in [holds, other] {
                let ended = written(mode, function, raw, move |message| SlaveAction::Instead(form(message))).await;
                let (WriteResult::ReadBackAfterFault(fault, held), 1) = ended else {
                    panic!("{mode:?}, form {n}, {raw}: {ended:?}")
                };
                assert_eq!(held, holds.into(), "{mode:?}, form {n}, {raw}");
                assert!(!matches!(fault, Fault::Exception(_)), "{mode:?}, form {n}, {raw}: {fault}");
            }
        }
    }
}

/// Refusals with a code of the maker's own: 80 for a write without permission (Huawei: slowtec/tokio-modbus, issue 278), 0C
/// (worrajak/PICmodbus, issue 3).
#[tokio::test(start_paused = true)]
async fn a_refusal_with_a_code_of_its_own_is_a_refusal() {
    for mode in Mode::ALL {
        for code in [0x00, 0x0C, 0x80, 0xFF] {
            let ended = written(mode, 6, 11.0, move |_| SlaveAction::Exception(code)).await;
            assert_eq!(ended, (WriteResult::Refused(ExceptionCode(code)), 1), "{mode:?}, {code:02X}");
            check_hole(mode, SlaveAction::Exception(code)).await;
        }
    }
}

/// Register 11 is refused like this: what is around it is read.
async fn check_hole(mode: Mode, refusal: SlaveAction) {
    let def = plant(mode);
    let mut line = line(def.clone());
    let action = refusal.clone();
    line.plug(mode, move |_, message| if touches(message, 11) { action.clone() } else { SlaveAction::Answer });
    let (reads, _, _) = reads_until(&mut line, &def, 20).await;
    let good: BTreeSet<u16> = reads.keys().copied().collect();
    assert_eq!(good, BTreeSet::from([10, 12, 13, 20, 21, 22, 23, 400, 600]), "{mode:?}, {refusal:?}");
    assert!(12 < reads[&12], "{mode:?}, {refusal:?}: {reads:?}");
}

/// Refusals that end before their code: emelianov/modbus-esp8266, issue 268. Over Modbus TCP the header says that this is all.
#[tokio::test(start_paused = true)]
async fn a_refusal_without_a_code_is_a_refusal() {
    for mode in MBAP_MODES {
        let ended = written(mode, 6, 11.0, |_| SlaveAction::Instead(vec![1, 0x86])).await;
        assert_eq!(ended, (WriteResult::Refused(ExceptionCode(0)), 1), "{mode:?}");
        check_hole(mode, SlaveAction::Instead(vec![1, 0x83])).await;
    }
    for mode in [Mode::Rtu, Mode::Ascii, Mode::RtuOverTcp] {
        let ended = written(mode, 6, 11.0, |_| SlaveAction::Instead(vec![1, 0x86])).await;
        let (WriteResult::ReadBackAfterFault(fault, held), 1) = ended else { panic!("{mode:?}: {ended:?}") };
        assert_eq!(held, 10.0.into(), "{mode:?}");
        assert!(fault == Fault::Timeout || fault.is_corrupt(), "{mode:?}: {fault}");
    }
}

/// Each header of Modbus TCP counts one byte less than there is: steveohara/j2mod, issue 157. Nothing of it is a value, and what that
/// does to the stream costs the other unit nothing.
#[tokio::test(start_paused = true)]
async fn a_header_that_counts_too_few_bytes_costs_only_its_device() {
    for mode in MBAP_MODES {
        let def = plant(mode);
        let mut line = line(def.clone());
        let mut last = 0;
        for _ in 0..200 {
            line.plug(mode, move |_, message| {
                last += 1;
                let mut bytes = frame::with_mbap(last, &correct(message));
                bytes[5] -= u8::from(message[0] == 1);
                SlaveAction::Bytes(bytes)
            });
        }
        let (reads, faults) = play(&mut line, &def, 30).await;
        assert!(reads[0].is_empty(), "{mode:?}: {reads:?}");
        let misfits = faults.iter().filter(|fault| **fault != Fault::BackedOff);
        assert!(misfits.clone().next().is_some(), "{mode:?}: said of nothing");
        let is_named = |fault: &Fault| matches!(fault, Fault::WrongLength { .. });
        assert!(misfits.clone().all(is_named), "{mode:?}: {faults:?}");
        assert!(25 <= reads[1].get(&10).copied().unwrap_or_default(), "{mode:?}: the other device: {reads:?}");
    }
}

/// Connections are refused for a while after one was closed: WillCodeForCats/solaredge-modbus-multi, issue 159 (right after a write).
/// A write whose answer is lost closes the connection: it is never called done, nor sent again, and the values are back soon.
#[tokio::test(start_paused = true)]
async fn a_lost_write_to_a_refusing_host_is_not_called_done() {
    for mode in [Mode::Tcp, Mode::Tcp16, Mode::RtuOverTcp] {
        let def = plant(mode);
        let mut line = line(def.clone());
        let writes = Arc::new(AtomicUsize::new(0));
        let count = writes.clone();
        line.plug(mode, move |_, message| {
            if message[1] != 6 {
                return SlaveAction::Answer;
            }
            count.fetch_add(1, Ordering::Relaxed);
            SlaveAction::Silent
        });
        line.read(&def).await;
        let (id, raw) = (WriteId(7), 10.0.into());
        let job = WriteJob {
            id,
            tag: TagId(0),
            raw,
            unlock: None,
            verify: true,
            urgent: false,
            over: None,
            unscaled_by: None,
        };
        line.requests.send(BusRequest::Write(job)).await.expect("the line runs");
        let ended = |event: &Event| match event {
            Event::Wrote { id: WriteId(7), result, .. } => Some(result.clone()),
            _ => None,
        };
        assert_eq!(line.until(&def, ended).await, WriteResult::NoValidResponse(Fault::Timeout), "{mode:?}");
        let waits = |event: &Event| matches!(event, Event::Line { state: LineState::Waiting { .. }, .. }).then_some(());
        line.until(&def, waits).await;
        let (count, refused) = (writes.clone(), tokio::time::Instant::now());
        line.plug(mode, move |_, message| {
            count.fetch_add(usize::from(message[1] == 6), Ordering::Relaxed);
            SlaveAction::Answer
        });
        line.read(&def).await;
        assert!(refused.elapsed() < Duration::from_secs(5), "{mode:?}: back after {:?}", refused.elapsed());
        assert_eq!(writes.load(Ordering::Relaxed), 1, "{mode:?}");
    }
}
