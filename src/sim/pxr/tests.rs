//! What an operator and a master notice of the controller.

use proptest::prelude::*;

use super::*;
use crate::sim::{pdu::serve, slave::Unit};

fn read(pxr: &mut Pxr, function: u8, address: u16) -> i16 {
    let [high, low] = address.to_be_bytes();
    let reply = serve(pxr, &[function, high, low, 0, 1]).expect("a request has an answer");
    i16::from_be_bytes([reply[2], reply[3]])
}

fn write(pxr: &mut Pxr, address: u16, value: u16) {
    let [[a, b], [c, d]] = [address.to_be_bytes(), value.to_be_bytes()];
    assert_eq!(serve(pxr, &[6, a, b, c, d]), Some(vec![6, a, b, c, d]));
}

fn samples(pxr: &mut Pxr, sensor: Sensor, count: usize) {
    (0..count).for_each(|_| pxr.sample(sensor, 0.0));
}

#[test]
fn a_broken_sensor_shows_as_a_fault_and_takes_the_output_away() {
    let pxr = &mut Pxr::new(27.0);
    samples(pxr, Sensor::Pt100(30.0), 2);
    assert_eq!((pxr.mv_percent(), read(pxr, 4, 1007)), (100.0, 0));
    samples(pxr, Sensor::Open, 1);
    assert_eq!((pxr.mv_percent(), read(pxr, 4, 1007), read(pxr, 4, 1000)), (0.0, 0b1010, 1943));
    assert!(!pxr.at_sv());
    samples(pxr, Sensor::Pt100(70.0), 1);
    assert_eq!((read(pxr, 4, 1007), read(pxr, 4, 1000)), (0, 700));
}

#[test]
fn standby_means_no_output() {
    let pxr = &mut Pxr::new(27.0);
    write(pxr, 1003, 1);
    samples(pxr, Sensor::Pt100(30.0), 1);
    assert_eq!(read(pxr, 4, 1003), 0);
    write(pxr, 1003, 0);
    samples(pxr, Sensor::Pt100(30.0), 1);
    assert_eq!(read(pxr, 4, 1003), 10_000);
}

#[test]
fn saving_takes_a_while_and_is_counted() {
    let pxr = &mut Pxr::new(27.0);
    write(pxr, 1000, 1);
    samples(pxr, Sensor::Pt100(27.0), 9);
    assert_eq!((read(pxr, 3, 1000), pxr.saves()), (1, 0));
    samples(pxr, Sensor::Pt100(27.0), 1);
    assert_eq!((read(pxr, 3, 1000), pxr.saves()), (0, 1));
}

#[test]
fn the_deviation_alarm_has_a_deadband() {
    let pxr = &mut Pxr::new(27.0);
    for (pv_c, alarm) in [(74.9, 0), (75.1, 1), (74.2, 1), (73.9, 0), (74.9, 0)] {
        samples(pxr, Sensor::Pt100(pv_c), 1);
        assert_eq!(read(pxr, 4, 1006), alarm, "at {pv_c} °C");
    }
}

#[test]
fn auto_tuning_ends_by_writing_p_i_and_d() {
    let pxr = &mut Pxr::new(60.0);
    write(pxr, 1004, 1);
    // A tank that warms by 0.07 °C/s and cools by 0.02 °C/s, seen 15 s late.
    let (mut water_c, mut late) = (60.0, std::collections::VecDeque::from(vec![60.0; 30]));
    let ended = (0..7200).any(|_| {
        water_c += if pxr.mv_percent() > 50.0 { 0.035 } else { -0.01 };
        late.push_back(water_c);
        let seen_c = late.pop_front().expect("the line is never empty");
        pxr.sample(Sensor::Pt100(seen_c), 0.0);
        read(pxr, 3, 1004) == 0
    });
    assert!(ended, "tuning goes on after an hour");
    let tuned = [1005, 1006, 1007].map(|address| read(pxr, 3, address));
    assert!((1..50).contains(&tuned[0]) && (200..2000).contains(&tuned[1]) && tuned[2] < tuned[1], "{tuned:?}");
}

#[test]
fn a_programme_moves_the_set_value_in_use_and_ends() {
    let pxr = &mut Pxr::new(30.0);
    for (address, value) in [(1056, 500), (1064, 1), (1065, 1), (1081, 1)] {
        write(pxr, address, value);
    }
    // Steps 2 to 4 go down to 0 °C at once.
    samples(pxr, Sensor::Pt100(30.0), 60);
    assert_eq!((read(pxr, 4, 1001), read(pxr, 4, 1008), read(pxr, 3, 1002)), (400, 1, 700));
    samples(pxr, Sensor::Pt100(30.0), 240);
    assert_eq!((read(pxr, 3, 1081), read(pxr, 4, 1008), read(pxr, 4, 1001)), (3, 17, 0));
    write(pxr, 1081, 0);
    samples(pxr, Sensor::Pt100(30.0), 1);
    assert_eq!((read(pxr, 4, 1001), read(pxr, 4, 1008)), (700, 0));
}

#[test]
fn a_broken_sensor_drives_the_output_as_configured() {
    for (action, output) in [(0, 0.0), (1, 100.0), (2, 0.0), (3, 100.0)] {
        let pxr = &mut Pxr::new(27.0);
        write(pxr, 1013, action);
        samples(pxr, Sensor::Open, 1);
        assert_eq!(pxr.mv_percent(), output, "action {action}");
        write(pxr, 1003, 1);
        samples(pxr, Sensor::Open, 1);
        assert_eq!(pxr.mv_percent(), 0.0, "standby is off, whatever the sensor says");
    }
}

#[test]
fn while_it_saves_it_holds_writes_back_and_answers_reads() {
    let mut slave = crate::sim::slave::Slave::new(Pxr::new(27.0));
    assert!(slave.respond(&[6, 0x03, 0xE8, 0, 1]).is_some());
    assert_eq!(slave.respond(&[6, 0x03, 0xEA, 0x01, 0xF4]), None);
    assert_eq!(slave.respond(&[3, 0x03, 0xEA, 0, 1]), Some(vec![3, 2, 0x02, 0xBC]));
    samples(&mut slave.device, Sensor::Pt100(27.0), 10);
    assert!(slave.respond(&[6, 0x03, 0xEA, 0x01, 0xF4]).is_some());
    assert_eq!((slave.device.saves(), slave.device.settings[map::SV]), (1, 500));
}

#[test]
fn a_burnt_out_heater_is_not_taken_for_a_warm_up() {
    let pxr = &mut Pxr::new(27.0);
    write(pxr, 1038, 50);
    // 1600 W are 7.3 A at full output.
    (0..100).for_each(|_| pxr.sample(Sensor::Pt100(30.0), 1600.0));
    assert_eq!((read(pxr, 4, 1006), read(pxr, 4, 1009)), (0, 73));
    (0..59).for_each(|_| pxr.sample(Sensor::Pt100(30.0), 0.0));
    assert_eq!(read(pxr, 4, 1006), 0);
    (0..2).for_each(|_| pxr.sample(Sensor::Pt100(30.0), 0.0));
    assert_eq!(read(pxr, 4, 1006), 0b1000);
    (0..2).for_each(|_| pxr.sample(Sensor::Pt100(30.0), 1600.0));
    assert_eq!(read(pxr, 4, 1006), 0);
}

#[test]
fn alarms_are_set_in_the_registers_and_rest_in_standby() {
    let pxr = &mut Pxr::new(27.0);
    // Alarm 2 absolute high with a delay of 2 s, alarm 3 absolute low.
    for (address, value) in [(1025, 1), (1035, 900), (1043, 2), (1026, 2), (1036, 300)] {
        write(pxr, address, value);
    }
    samples(pxr, Sensor::Pt100(95.0), 4);
    assert_eq!(read(pxr, 4, 1006), 0b001);
    samples(pxr, Sensor::Pt100(95.0), 1);
    assert_eq!(read(pxr, 4, 1006), 0b011);
    samples(pxr, Sensor::Pt100(20.0), 1);
    assert_eq!(read(pxr, 4, 1006), 0b100);
    write(pxr, 1003, 1);
    samples(pxr, Sensor::Pt100(20.0), 1);
    assert_eq!(read(pxr, 4, 1006), 0);
}

#[test]
fn tuning_can_be_stopped_and_leaves_p_i_and_d_alone() {
    let pxr = &mut Pxr::new(27.0);
    write(pxr, 1004, 1);
    samples(pxr, Sensor::Pt100(60.0), 10);
    assert_eq!((read(pxr, 3, 1004), pxr.mv_percent()), (1, 100.0));
    write(pxr, 1004, 0);
    samples(pxr, Sensor::Pt100(80.0), 10);
    assert_eq!([1004, 1005, 1006, 1007].map(|address| read(pxr, 3, address)), [0, 50, 2400, 600]);
    assert!(pxr.mv_percent() < 100.0);
}

/// A programme of one minute up to 50 °C and one minute there.
fn short_programme(mode: u16) -> Pxr {
    let mut pxr = Pxr::new(30.0);
    for (address, value) in [(1056, 500), (1057, 500), (1058, 500), (1059, 500), (1064, 1), (1065, 1), (1080, mode)] {
        write(&mut pxr, address, value);
    }
    pxr
}

#[test]
fn the_mode_says_what_happens_at_the_end_and_at_off() {
    let check = |mode: u16, write_off: bool, expect: (i16, i16, i16)| {
        let pxr = &mut short_programme(mode);
        write(pxr, 1081, 1);
        samples(pxr, Sensor::Pt100(30.0), 250);
        if write_off {
            write(pxr, 1081, 0);
            samples(pxr, Sensor::Pt100(30.0), 2);
        }
        let state = (read(pxr, 3, 1081), read(pxr, 4, 1008), read(pxr, 3, 1003));
        assert_eq!(state, expect, "mode {mode:04b}, off {write_off}: program, position, standby");
    };
    check(0b0000, false, (3, 17, 0));
    check(0b0001, false, (3, 17, 1));
    check(0b0001, true, (0, 0, 1));
    check(0b0010, false, (3, 17, 0));
    check(0b0010, true, (0, 0, 1));
    check(0b0000, true, (0, 0, 0));
    check(0b0100, false, (1, 1, 0));
}

#[test]
fn a_programme_waits_in_standby() {
    let pxr = &mut short_programme(0);
    write(pxr, 1081, 1);
    samples(pxr, Sensor::Pt100(30.0), 60);
    let sv = read(pxr, 4, 1001);
    write(pxr, 1003, 1);
    samples(pxr, Sensor::Pt100(30.0), 600);
    assert_eq!((read(pxr, 4, 1001), read(pxr, 4, 1008)), (sv, 1));
}

/// A tank that warms by 0.07 °C/s at full output and cools by 0.005 °C/s, seen late.
struct FirstOrderTank {
    water_c: f64,
    late: std::collections::VecDeque<f64>,
}

impl FirstOrderTank {
    fn at(water_c: f64, late_s: usize) -> FirstOrderTank {
        FirstOrderTank { water_c, late: std::collections::VecDeque::from(vec![water_c; 2 * late_s]) }
    }

    fn sample(&mut self, pxr: &mut Pxr) -> f64 {
        self.water_c += 0.0375 * pxr.mv_percent() / 100.0 - 0.0025;
        self.late.push_back(self.water_c);
        let seen_c = self.late.pop_front().unwrap_or(self.water_c);
        pxr.sample(Sensor::Pt100(seen_c), 0.0);
        seen_c
    }
}

#[test]
fn self_tuning_learns_from_the_approach_and_holds_sv() {
    let (pxr, tank) = (&mut Pxr::new(27.0), &mut FirstOrderTank::at(27.0, 15));
    write(pxr, 1001, 2);
    let highest_c = (0..2400).map(|_| tank.sample(pxr)).fold(0.0, f64::max);
    let tuned = [1005, 1006, 1007].map(|address| read(pxr, 3, address));
    let expect = rule::settings(0.07, 15.0);
    let expect = [100.0 * expect.band_k / 185.0, expect.i_s, expect.d_s].map(|value| 10.0 * value);
    for (tuned, expect) in tuned.into_iter().zip(expect) {
        assert!((f64::from(tuned) / expect - 1.0).abs() < 0.15, "{tuned} instead of {expect} (tenths)");
    }
    assert!(highest_c < 73.0, "{highest_c} °C");
    let last: Vec<f64> = (0..600).map(|_| tank.sample(pxr)).collect();
    assert!(last.iter().all(|c| (c - 70.0).abs() < 0.5), "{last:?}");
}

#[test]
fn self_tuning_calms_a_loop_that_swings() {
    let (pxr, tank) = (&mut Pxr::new(70.0), &mut FirstOrderTank::at(70.0, 60));
    // Far too narrow a band, no D: the output goes to and fro.
    for (address, value) in [(1001, 2), (1005, 3), (1006, 200), (1007, 0)] {
        write(pxr, address, value);
    }
    for _ in 0..14_400 {
        tank.sample(pxr);
    }
    assert!(read(pxr, 3, 1005) > 3, "P is still {}", read(pxr, 3, 1005));
    let last: Vec<f64> = (0..1200).map(|_| tank.sample(pxr)).collect();
    let swing_c = last.iter().fold(0.0_f64, |swing_c, c| swing_c.max((c - 70.0).abs()));
    assert!(swing_c < 1.5, "{swing_c} °C");
}

#[test]
fn a_narrower_range_holds_for_what_was_filtered_before() {
    let mut pxr = Pxr::new(27.0);
    write(&mut pxr, 1023, 5);
    samples(&mut pxr, Sensor::Pt100(-46.4), 1);
    write(&mut pxr, 1017, 26);
    samples(&mut pxr, Sensor::Pt100(-3.9), 1);
    let (low_c, high_c) = pxr.range_c();
    assert_eq!(low_c, 2.6);
    assert!(low_c - OVER_RANGE * (high_c - low_c) <= pxr.pv_c(), "{} °C", pxr.pv_c());
}

proptest! {
    #[test]
    fn no_write_breaks_the_controller_and_limits_always_hold(
        writes in prop::collection::vec((1000..1083_u16, any::<u16>(), 0..40_usize, -50.0..250.0), 1..80),
        small in any::<bool>(),
    ) {
        let mut pxr = Pxr::new(27.0);
        for (address, value, count, sensor_c) in writes {
            // Most settings have few values, which a word at random hardly meets.
            let value = if small { value % 40 } else { value };
            let [[a, b], [c, d]] = [address.to_be_bytes(), value.to_be_bytes()];
            prop_assert!(serve(&mut pxr, &[6, a, b, c, d]).is_some());
            samples(&mut pxr, Sensor::Pt100(sensor_c), count);
            let (low_c, high_c) = pxr.range_c();
            prop_assert!(high_c - low_c >= NARROWEST_K - 1.0, "{low_c}–{high_c} °C");
            let (sv_low_c, sv_high_c) = (pxr.temperature_c(map::SV_LOW), pxr.temperature_c(map::SV_HIGH));
            prop_assert!(low_c <= sv_low_c && sv_low_c <= sv_high_c && sv_high_c <= high_c);
            for place in std::iter::once(map::SV).chain(map::STEP_SV..map::STEP_TIMES) {
                prop_assert!((sv_low_c..=sv_high_c).contains(&pxr.temperature_c(place)));
            }
            if count > 0 {
                prop_assert!((sv_low_c..=sv_high_c).contains(&pxr.sv_c()));
                prop_assert!((0.0..=100.0).contains(&pxr.mv_percent()));
                let margin_c = OVER_RANGE * (high_c - low_c) + 1e-9;
                prop_assert!((low_c - margin_c..=high_c + margin_c).contains(&pxr.pv_c()));
            }
            for address in 1000..1083 {
                read(&mut pxr, 3, address);
                read(&mut pxr, 3, address - 1000);
            }
        }
    }
}
