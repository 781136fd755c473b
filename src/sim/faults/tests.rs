//! The effect of each fault on the line, and what it leaves unchanged.

use super::*;
use crate::{bus::frame::crc16, sim::rig::Rig};

const L1: LineId = LineId(0);
const TIC: FaultTarget = FaultTarget::Unit(L1, 1);
const READ_SV: [u8; 5] = [3, 0x03, 0xEA, 0, 1];
const WRITE_SV: [u8; 5] = [6, 0x03, 0xEA, 0x01, 0xF4];
const SINCE: Timestamp = Timestamp::UNIX_EPOCH;

fn simulator() -> (Simulator, Faults) {
    (Simulator::tank(Rig::new()), Faults::default())
}

fn check(fault: Option<InjectedFault>, expect: Option<(usize, bool)>, written: bool) {
    let (mut simulator, mut faults) = simulator();
    if let Some(fault) = fault {
        faults.inject(&mut simulator, TIC, fault, SINCE);
    }
    let answer = faults.answer(&mut simulator, L1, 1, &READ_SV);
    let seen = answer.map(|answer| answer.rtu()).map(|frame| (frame.len(), crc16(&frame) == 0));
    assert_eq!(seen, expect, "{fault:?}: length and check");
    let answered = faults.answer(&mut simulator, L1, 1, &WRITE_SV).is_some();
    assert_eq!(answered, expect.is_some());
    assert_eq!(simulator.respond(L1, 1, &READ_SV) == Some(vec![3, 2, 0x01, 0xF4]), written, "{fault:?}");
    assert!(faults.answer(&mut simulator, L1, 2, &[1, 8, 0, 0, 1]).is_some(), "{fault:?} of another unit");
    faults.clear_all(&mut simulator);
    let well = faults.answer(&mut simulator, L1, 1, &READ_SV).expect("an answer");
    assert_eq!((well.rtu().len(), well.delay), (7, Duration::from_millis(5)), "well again after {fault:?}");
}

#[test]
fn each_fault_looks_as_it_does_on_the_line() {
    check(None, Some((7, true)), true);
    check(Some(InjectedFault::Silent), None, false);
    check(Some(InjectedFault::Late(Duration::from_secs(1))), Some((7, true)), true);
    check(Some(InjectedFault::BadCrc), Some((7, false)), true);
    check(Some(InjectedFault::Cut), Some((3, false)), true);
    check(Some(InjectedFault::Exception(4)), Some((5, true)), false);
    check(Some(InjectedFault::SensorBurnout), Some((7, true)), true);
}

#[test]
fn the_same_answer_in_ascii() {
    let (mut simulator, mut faults) = simulator();
    let mut frame = |fault: Option<InjectedFault>| {
        faults.clear_all(&mut simulator);
        fault.into_iter().for_each(|fault| faults.inject(&mut simulator, TIC, fault, SINCE));
        faults.answer(&mut simulator, L1, 1, &READ_SV).map(|answer| answer.ascii())
    };
    assert_eq!(frame(None).as_deref(), Some(&b":01030202BC3C\r\n"[..]));
    assert_eq!(frame(Some(InjectedFault::BadCrc)).as_deref(), Some(&b":01030202BC30\r\n"[..]));
    assert_eq!(frame(Some(InjectedFault::Cut)).as_deref(), Some(&b":010302"[..]));
}

#[test]
fn a_broadcast_passes_by_a_silent_unit() {
    let (mut simulator, mut faults) = simulator();
    faults.inject(&mut simulator, TIC, InjectedFault::Silent, SINCE);
    assert_eq!(faults.answer(&mut simulator, L1, 0, &WRITE_SV), None);
    assert_eq!(simulator.respond(L1, 1, &READ_SV), Some(vec![3, 2, 0x02, 0xBC]));
    assert_eq!(simulator.respond(L1, 2, &READ_SV), Some(vec![3, 2, 0x01, 0xF4]));
}

#[test]
fn a_late_answer_says_how_late() {
    let (mut simulator, mut faults) = simulator();
    faults.inject(&mut simulator, TIC, InjectedFault::Late(Duration::from_millis(700)), SINCE);
    let delay = faults.answer(&mut simulator, L1, 1, &READ_SV).map(|answer| answer.delay);
    assert_eq!(delay, Some(Duration::from_millis(705)));
}

#[test]
fn the_same_answer_on_tcp() {
    let (mut simulator, mut faults) = simulator();
    let frame = |answer: Option<Answer>| answer.map(|answer| answer.tcp(0x1234));
    let well = frame(faults.answer(&mut simulator, L1, 1, &READ_SV));
    assert_eq!(well, Some(vec![0x12, 0x34, 0, 0, 0, 5, 1, 3, 2, 0x02, 0xBC]));
    faults.inject(&mut simulator, TIC, InjectedFault::BadCrc, SINCE);
    let wrong = frame(faults.answer(&mut simulator, L1, 1, &READ_SV));
    assert_eq!(wrong.map(|frame| frame[..2].to_vec()), Some(vec![0xED, 0x34]));
}

#[test]
fn noise_corrupts_its_share_of_messages_reproducibly() {
    let corrupt = |percent| {
        let (mut simulator, mut faults) = simulator();
        faults.inject(&mut simulator, FaultTarget::Line(L1), InjectedFault::Noise(percent), SINCE);
        let ask = |_| faults.answer(&mut simulator, L1, 1, &READ_SV).map(|answer| (answer.rtu(), answer.ascii()));
        (0..1_000).map(ask).collect::<Vec<_>>()
    };
    let answers = corrupt(20);
    assert_eq!(answers, corrupt(20), "a replay has the same noise");
    let good = |frame: &[u8]| crc16(frame) == 0;
    let whole = answers.iter().flatten().filter(|(rtu, _)| good(rtu)).count();
    // A query and its answer both come through in 0.8 × 0.8 of all cases.
    assert!((590..690).contains(&whole), "{whole} of 1000");
    for (rtu, characters) in answers.iter().flatten().filter(|(rtu, _)| !good(rtu)) {
        assert_eq!(rtu.len(), 7);
        assert_ne!(characters.as_slice(), b":01030202BC3C\r\n");
    }
}

/// X0 to X3 of the PLC, which no command turns.
#[test]
fn a_panel_switch_is_an_input_of_the_plc_until_it_is_cleared() {
    let (mut simulator, mut faults) = simulator();
    let inputs = |simulator: &mut Simulator| simulator.respond(LineId(0), 2, &[2, 0x08, 0x00, 0, 4]).map(|pdu| pdu[2]);
    for (fault, on) in [("switch X0 on", 0b0001), ("switch X3 on", 0b1001)] {
        let fault = fault.parse().expect("a fault");
        faults.inject(&mut simulator, FaultTarget::Process, fault, SINCE);
        assert_eq!(inputs(&mut simulator), Some(on), "{fault}");
    }
    faults.clear(&mut simulator, FaultTarget::Process, "switch X0 on".parse().expect("a fault"));
    assert_eq!(inputs(&mut simulator), Some(0b1000));
    faults.clear_all(&mut simulator);
    assert_eq!(inputs(&mut simulator), Some(0));
}

#[test]
fn a_later_fault_takes_the_place_of_one_that_it_excludes() {
    let (mut simulator, mut faults) = simulator();
    let list = |faults: &Faults| faults.list().iter().map(|f| f.fault.to_string()).collect::<Vec<_>>();
    for fault in [InjectedFault::Silent, InjectedFault::BadCrc, InjectedFault::Stuck] {
        faults.inject(&mut simulator, TIC, fault, SINCE);
    }
    assert_eq!(list(&faults), ["bad crc", "stuck value"]);
    faults.inject(&mut simulator, FaultTarget::Process, InjectedFault::Leak(500), SINCE);
    faults.inject(
        &mut simulator,
        FaultTarget::Process,
        InjectedFault::Leak(2_000),
        SINCE + jiff::SignedDuration::from_secs(9),
    );
    assert_eq!(list(&faults), ["bad crc", "stuck value", "leak 2 l/min"]);
    assert_eq!(faults.list()[2].since, SINCE, "it is the same leak");
    faults.clear(&mut simulator, FaultTarget::Process, InjectedFault::Leak(1));
    assert_eq!(list(&faults), ["bad crc", "stuck value"]);
}
