//! The rig as a whole: golden frames, batches, auto-tuning, faults.

use proptest::prelude::*;

use super::*;
use crate::{bus::frame::with_crc, sim::slave::Unit};

/// The units of the thesis.
const PXR_UNIT: u8 = 1;
const DL06_UNIT: u8 = 2;

impl Rig {
    fn respond(&mut self, unit: u8, pdu: &[u8]) -> Option<Vec<u8>> {
        match unit {
            PXR_UNIT => self.pxr.respond(pdu),
            DL06_UNIT => self.plc.respond(pdu),
            _ => None,
        }
    }
}

fn bytes(hex: &str) -> Vec<u8> {
    hex.split(' ').map(|byte| u8::from_str_radix(byte, 16).expect("two hex digits")).collect()
}

/// Sends a frame as it is written in the manuals and notes, and compares what a master would see.
fn assert_reply(rig: &mut Rig, sent: &str, answered: &str) {
    let frame = bytes(sent);
    let (message, _) = frame.split_at(frame.len() - 2);
    assert_eq!(with_crc(message), frame, "{sent} has a wrong check");
    let reply = rig.respond(message[0], &message[1..]).map(|pdu| with_crc(&[&message[..1], &pdu].concat()));
    assert_eq!(reply, Some(bytes(answered)), "{sent}");
}

#[test]
fn the_golden_frames_are_answered_byte_for_byte() {
    let rig = &mut Rig::new();
    rig.advance(Duration::from_secs(1));
    let mut echo = |sent| assert_reply(rig, sent, sent);
    echo("01 06 03 EB 00 00 F9 BA");
    echo("01 06 03 EB 00 01 38 7A");
    echo("01 06 03 E8 00 01 C8 7A");
    echo("02 05 08 00 FF 00 8E 69");
    assert_reply(rig, "02 01 08 00 00 10 3F 95", "02 01 02 01 00 FC 6C");
    assert_reply(rig, "02 02 08 00 00 14 7A 56", "02 02 03 00 00 00 78 7D");
    assert_reply(rig, "02 03 41 40 00 01 91 D1", "02 03 02 00 01 3D 84");
    assert_reply(rig, "02 03 41 00 00 02 D0 04", "02 03 04 00 00 00 00 C9 33");
    assert_reply(rig, "02 03 04 00 00 01 85 09", "02 03 02 00 00 FC 44");
    assert_reply(rig, "01 03 03 EA 00 01 A5 BA", "01 03 02 02 BC B8 95");
    let measured = "01 04 14 01 0E 02 BC 01 AE 27 10 00 00 00 01 00 00 00 00 00 00 00 00";
    assert_reply(rig, "01 04 03 E8 00 0A F0 7D", &spell(measured));
    let settings = "01 03 14 00 00 02 BC 00 01 00 00 00 32 09 60 02 58 00 0A 00 0A 00 00";
    assert_reply(rig, "01 03 03 E9 00 0A 14 7D", &spell(settings));
    assert_reply(rig, "01 03 03 F7 00 05 34 7F", &spell("01 03 0A 00 01 00 00 00 00 07 3A 00 01"));
    assert_reply(rig, &spell("01 03 07 D0 00 01"), "01 83 02 C0 F1");
    assert_reply(rig, &spell("01 04 07 D0 00 01"), "01 84 02 C2 C1");
}

fn spell(message: &str) -> String {
    with_crc(&bytes(message)).iter().map(|byte| format!("{byte:02X}")).collect::<Vec<_>>().join(" ")
}

#[test]
fn the_two_recorded_exchanges_happen_again() {
    let rig = &mut Rig::new();
    // The thesis's controller showed no decimals, so its 50 is 5.0 °C on our face.
    assert_reply(rig, "01 06 03 EA 00 32 29 AF", "01 06 03 EA 00 32 29 AF");
    assert_reply(rig, "02 06 41 40 FF FF 9D A1", "02 06 41 40 FF FF 9D A1");
    rig.advance(Duration::from_secs(2));
    assert_eq!(rig.state().sv_c, 5.0);
    assert_eq!(rig.respond(2, &[1, 8, 0, 0, 16]), Some(vec![1, 2, 0xFF, 0xFF]));
}

/// Advances second by second until the sequence has left a step; says how long that took.
fn until_left(rig: &mut Rig, step: Step, longest_s: u64) -> u64 {
    let left = (0..longest_s).find(|_| {
        rig.advance(Duration::from_secs(1));
        rig.state().step != step
    });
    left.unwrap_or_else(|| panic!("still {step:?} after {longest_s} s: {:?}", rig.state()))
}

#[test]
fn a_batch_runs_through_and_begins_again() {
    let rig = &mut Rig::demo();
    rig.advance(Duration::from_secs(1));
    assert_eq!(rig.state().step, Step::Fill);
    assert!(until_left(rig, Step::Fill, 60) > 5);
    let heating_s = until_left(rig, Step::Heat, 1500);
    assert!((9 * 60..16 * 60).contains(&heating_s), "heating took {heating_s} s");
    assert!((rig.state().pv_c - 70.0).abs() <= 1.1);
    let holding_s = until_left(rig, Step::Hold, 200);
    assert!((178..182).contains(&holding_s));
    assert!((rig.state().pv_c - 70.0).abs() < 3.0, "{:?}", rig.state());
    for (step, longest_s) in [(Step::Drain, 900), (Step::Cool, 65), (Step::Return, 300)] {
        assert_eq!(rig.state().step, step);
        until_left(rig, step, longest_s);
    }
    assert_eq!(rig.state().step, Step::Fill);
    assert_eq!(rig.respond(2, &[3, 4, 2, 0, 1]), Some(vec![3, 2, 0, 1]));
    assert!(!rig.state().fault);
}

#[test]
fn a_batch_of_twenty_litres_is_filled_and_heated_too() {
    let rig = &mut Rig::new();
    assert!(rig.respond(2, &[6, 4, 4, 2, 0]).is_some());
    rig.plc.device.start();
    rig.advance(Duration::from_secs(1));
    until_left(rig, Step::Fill, 2400);
    let RigState { readings, step, .. } = rig.state();
    assert!((39.0..40.1).contains(&readings.level_cm) && step == Step::Heat, "{:?}", rig.state());
    // 20 l by 43 °C at 1600 W are 37 minutes and a half, without loss.
    let heating_s = until_left(rig, Step::Heat, 5000);
    assert!((38 * 60..60 * 60).contains(&heating_s), "heating took {heating_s} s");
    until_left(rig, Step::Hold, 200);
    until_left(rig, Step::Drain, 2400);
    assert!(!rig.state().fault);
}

#[test]
fn many_batches_do_not_warm_up_the_cold_water() {
    let mut rig = Rig::demo();
    rig.advance(Duration::from_secs(24 * 3600));
    let batches = rig.respond(2, &[3, 4, 2, 0, 1]).expect("the PLC answers");
    assert!(u16::from_be_bytes([batches[2], batches[3]]) >= 0x30, "batches (BCD) {batches:02X?}");
    assert!(rig.tank.cold.temperature_c < 40.0, "cold water at {} °C", rig.tank.cold.temperature_c);
}

#[test]
fn it_does_not_matter_in_what_pieces_time_passes() {
    let (mut whole, mut pieces) = (Rig::demo(), Rig::demo());
    whole.advance(Duration::from_millis(70_000));
    (0..10_000).for_each(|_| pieces.advance(Duration::from_millis(7)));
    assert_eq!(whole.state(), pieces.state());
}

/// The controller of the thesis found P 1.2 %, I 70 s and D 13.5 s.
#[test]
fn both_types_of_auto_tuning_meet_the_thesis_and_hold_sv() {
    for kind in [1, 2] {
        let rig = &mut Rig::filled(5.0);
        // Manual, running, agitator and heater on.
        assert!(rig.respond(2, &[15, 0x0C, 0, 0, 7, 1, 0b100_1001]).is_some());
        assert!(rig.respond(1, &[6, 0x03, 0xEC, 0, kind]).is_some());
        rig.advance(Duration::from_secs(90 * 60));
        let reply = rig.respond(1, &[3, 0x03, 0xEC, 0, 4]).expect("the controller answers");
        let [tune, tuned @ ..] = [2, 4, 6, 8].map(|at| u16::from_be_bytes([reply[at], reply[at + 1]]));
        assert_eq!(tune, 0, "type {kind} is still tuning");
        for (tuned, thesis) in tuned.into_iter().zip([12.0, 700.0, 135.0]) {
            assert!((f64::from(tuned) / thesis - 1.0).abs() < 0.15, "type {kind}: {tuned}, thesis {thesis} (tenths)");
        }
        for _ in 0..1800 {
            rig.advance(Duration::from_secs(1));
            assert!((rig.state().pv_c - 70.0).abs() < 0.8, "type {kind}: {:?}", rig.state());
        }
    }
}

#[test]
fn a_broken_sensor_stops_the_heating_and_in_time_the_sequence() {
    let rig = &mut Rig::demo();
    rig.advance(Duration::from_secs(300));
    assert!(rig.state().readings.heater_w > 1500.0);
    rig.set_sensor_open(true);
    rig.advance(Duration::from_secs(60));
    assert!(rig.state().readings.heater_w < 1.0);
    rig.advance(Duration::from_secs(2 * 3600));
    assert!(rig.state().fault);
    assert_eq!(rig.state().outputs, Outputs::default());
}

/// What an operator may write: a coil of the PLC, all outputs at once, a setting of the controller.
fn any_write() -> impl Strategy<Value = (u8, Vec<u8>)> {
    let coil = |first: u16| {
        (0..8_u16, any::<bool>()).prop_map(move |(number, on)| {
            let [high, low] = (first + number).to_be_bytes();
            (DL06_UNIT, vec![5, high, low, if on { 0xFF } else { 0 }, 0])
        })
    };
    let setting = (1000..1083_u16, any::<u16>()).prop_map(|(address, value)| {
        let [[a, b], [c, d]] = [address.to_be_bytes(), value.to_be_bytes()];
        (PXR_UNIT, vec![6, a, b, c, d])
    });
    prop_oneof![coil(3072), coil(2048), setting, Just((DL06_UNIT, vec![6, 0x41, 0x40, 0xFF, 0xFF]))]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    #[test]
    fn whatever_is_written_nothing_boils_dry_or_overflows(
        demo in any::<bool>(),
        writes in prop::collection::vec((any_write(), 1_u64..900), 1..25),
    ) {
        let mut rig = if demo { Rig::demo() } else { Rig::new() };
        for ((unit, pdu), seconds) in writes {
            // While it saves, the controller holds writes back.
            prop_assert!(rig.respond(unit, &pdu).is_some() || unit == PXR_UNIT);
            for _ in 0..seconds {
                rig.advance(Duration::from_secs(1));
                let Readings { level_cm, heater_w, .. } = rig.state().readings;
                // The heating element needs some seconds to cool after the interlock has opened.
                prop_assert!(level_cm >= 4.5 || heater_w < 500.0, "{heater_w} W at {level_cm} cm");
                prop_assert!(level_cm <= 28.1, "{level_cm} cm");
                prop_assert!(rig.tank.control.temperature_c < 100.0);
                prop_assert!((0.0..=100.0).contains(&rig.state().mv_percent));
            }
        }
    }
}

proptest! {
    #[test]
    fn no_request_breaks_the_rig(
        requests in prop::collection::vec(
            (
                1..3_u8,
                prop::sample::select(vec![1_u8, 2, 3, 4, 5, 6, 8, 15, 16, 22, 23, 24, 43]),
                prop::sample::select(vec![0_u16, 990, 1024, 2040, 3072, 16_384, 65_500]),
                0..60_u16,
                prop::collection::vec(any::<u8>(), 2..40),
            ),
            1..60,
        ),
    ) {
        let mut rig = Rig::demo();
        for (unit, function, base, above, mut rest) in requests {
            if matches!(function, 15 | 16) {
                // A block that fits its own counts reaches the registers, not only the parser.
                let words = rest.len() / 2;
                rest.truncate(2 * words);
                rest.splice(0..0, [0, if function == 16 { words } else { words * 16 } as u8, 2 * words as u8]);
            }
            let pdu = [&[function], &(base + above.min(35)).to_be_bytes()[..], &rest].concat();
            prop_assert!(rig.respond(unit, &pdu).is_some() || unit == PXR_UNIT);
            rig.advance(Duration::from_secs(2));
        }
    }
}

#[test]
fn only_the_first_device_of_a_profile_belongs_to_the_rig() {
    let check = |simulation: Option<&str>, profiles: [&str; 2], expect: [Option<RigDevice>; 2]| {
        let mut def = crate::plant::fixture::plant();
        def.simulation = simulation.map(str::to_owned);
        for (device, profile) in def.devices.iter_mut().zip(profiles) {
            device.profile = profile.to_owned();
        }
        let parts: Vec<_> = def.devices.iter().map(|device| part(&def, device.id)).collect();
        assert_eq!(parts, expect, "{simulation:?} {profiles:?}");
        // The simulator serves what this says.
        let Ok(simulator) = super::super::simulator::Simulator::new(&def) else { panic!("{simulation:?} is known") };
        let answers: Vec<_> =
            def.devices.iter().map(|device| simulator.is_controller(device.line, device.unit)).collect();
        assert_eq!(answers, expect.map(|part| part == Some(RigDevice::Controller)));
    };
    let (controller, plc) = (Some(RigDevice::Controller), Some(RigDevice::Plc));
    check(Some("tank"), [CONTROLLER, PLC], [controller, plc]);
    check(Some("tank"), [CONTROLLER, CONTROLLER], [controller, None]);
    check(Some("tank"), [PLC, PLC], [plc, None]);
    check(None, [CONTROLLER, PLC], [None, None]);
}
