//! What an operator and a master notice of the PLC.

use super::*;
use crate::sim::pdu::serve;

const HALF_FULL: Readings = Readings {
    level_cm: 10.2,
    cold_l: 15.0,
    hot_l: 0.0,
    cold_full: false,
    flow_in: 0.0,
    flow_out: 0.0,
    flow_pump: 0.0,
    heater_w: 0.0,
};

fn assert_reply(plc: &mut Dl06, request: &[u8], expect: &[u8]) {
    assert_eq!(serve(plc, request).as_deref(), Some(expect), "request {request:02X?}");
}

#[test]
fn a_written_output_stays_unless_the_sequence_drives_it() {
    let plc = &mut Dl06::new();
    plc.scan(false, &HALF_FULL);
    assert_reply(plc, &[6, 0x41, 0x40, 0xFF, 0xFF], &[6, 0x41, 0x40, 0xFF, 0xFF]);
    plc.scan(false, &HALF_FULL);
    assert_reply(plc, &[1, 8, 0, 0, 16], &[1, 2, 0xFF, 0xFF]);
    assert_reply(plc, &[5, 0x0C, 0, 0xFF, 0], &[5, 0x0C, 0, 0xFF, 0]);
    plc.scan(false, &HALF_FULL);
    // Y0 to Y4 are wired, the others no scan touches.
    assert_reply(plc, &[3, 0x41, 0x40, 0, 1], &[3, 2, 0xFF, 0xE0]);
}

#[test]
fn in_manual_the_sequence_waits_where_it_is() {
    let plc = &mut Dl06::new();
    plc.start();
    plc.scan(false, &HALF_FULL);
    plc.scan(false, &HALF_FULL);
    assert_eq!(plc.step(), Step::Heat);
    assert_reply(plc, &[5, 0x0C, 1, 0, 0], &[5, 0x0C, 1, 0, 0]);
    plc.scan(true, &HALF_FULL);
    assert_eq!((plc.step(), plc.outputs()), (Step::Heat, Outputs::default()));
    assert_reply(plc, &[5, 0x0C, 1, 0xFF, 0], &[5, 0x0C, 1, 0xFF, 0]);
    plc.scan(true, &HALF_FULL);
    assert_eq!(plc.step(), Step::Hold);
    assert_reply(plc, &[5, 0x0C, 0, 0, 0], &[5, 0x0C, 0, 0, 0]);
    plc.scan(true, &HALF_FULL);
    assert_eq!(plc.step(), Step::Idle);
}

#[test]
fn stopping_turns_everything_off_once() {
    let plc = &mut Dl06::new();
    assert_reply(plc, &[15, 0x0C, 0, 0, 4, 1, 0b1101], &[15, 0x0C, 0, 0, 4]);
    plc.scan(false, &HALF_FULL);
    assert_eq!(plc.outputs(), Outputs { pump: true, agitator: true, ..Outputs::default() });
    assert_reply(plc, &[5, 0x0C, 0, 0, 0], &[5, 0x0C, 0, 0, 0]);
    plc.scan(false, &HALF_FULL);
    assert_eq!(plc.outputs(), Outputs::default());
}

#[test]
fn the_interlocks_hold_in_manual_and_behind_forced_lamps() {
    let check = |readings: Readings, blocked: fn(&mut Outputs)| {
        let mut expect = Outputs { pump: true, agitator: true, drain_valve: true, fill_valve: true, heater: true };
        blocked(&mut expect);
        let mut plc = Dl06::new();
        assert_reply(&mut plc, &[15, 0x0C, 0, 0, 7, 1, 0b111_1101], &[15, 0x0C, 0, 0, 7]);
        plc.scan(false, &readings);
        assert_eq!(plc.outputs(), expect, "in manual at {readings:?}");
        let mut forced = Dl06::new();
        assert_reply(&mut forced, &[6, 0x41, 0x40, 0xFF, 0xFF], &[6, 0x41, 0x40, 0xFF, 0xFF]);
        let actuators = forced.actuators(&readings, 100.0);
        let reached = Outputs {
            pump: actuators.pump,
            agitator: actuators.agitator,
            drain_valve: actuators.drain_valve,
            fill_valve: actuators.fill_valve,
            heater: actuators.heater_percent > 0.0,
        };
        assert_eq!(reached, expect, "behind forced lamps at {readings:?}");
    };
    check(HALF_FULL, |_| {});
    check(Readings { level_cm: 4.9, ..HALF_FULL }, |outputs| outputs.heater = false);
    check(Readings { level_cm: 28.1, ..HALF_FULL }, |outputs| outputs.fill_valve = false);
    check(Readings { cold_full: true, ..HALF_FULL }, |outputs| outputs.pump = false);
}

#[test]
fn the_interlock_word_shows_blocks_before_a_command() {
    let check = |readings: Readings, expect: u8| {
        let mut plc = Dl06::new();
        plc.scan(false, &readings);
        assert_reply(&mut plc, &[3, 4, 3, 0, 1], &[3, 2, 0, expect]);
    };
    check(HALF_FULL, 0b000);
    check(Readings { level_cm: 4.9, ..HALF_FULL }, 0b001);
    check(Readings { level_cm: 28.1, ..HALF_FULL }, 0b010);
    check(Readings { level_cm: 0.0, cold_full: true, ..HALF_FULL }, 0b101);
}

#[test]
fn the_fill_of_a_batch_can_be_set_within_its_bounds() {
    let check = |written: u16, expect: u16| {
        let mut plc = Dl06::new();
        let [[high, low], answer] = [written.to_be_bytes(), expect.to_be_bytes()];
        assert_reply(&mut plc, &[6, 4, 4, high, low], &[6, 4, 4, high, low]);
        plc.scan(false, &HALF_FULL);
        assert_reply(&mut plc, &[3, 4, 4, 0, 1], &[3, 2, answer[0], answer[1]]);
    };
    check(0x0050, 0x0050);
    check(0x0200, 0x0200);
    check(0x0201, 0x0200);
    check(0x0000, 0x0030);
    check(0x9999, 0x0200);
    check(0x00A0, 0x0050);
}

#[test]
fn a_large_batch_is_not_stopped_by_the_level_of_a_full_tank() {
    let plc = &mut Dl06::new();
    assert_reply(plc, &[6, 4, 4, 2, 0], &[6, 4, 4, 2, 0]);
    plc.start();
    let half_way = Readings { level_cm: 30.0, ..HALF_FULL };
    plc.scan(false, &half_way);
    plc.scan(false, &half_way);
    assert!(plc.step() == Step::Fill && plc.outputs().fill_valve && !plc.blocked(&half_way).filling);
    plc.scan(false, &Readings { cold_l: 0.0, ..half_way });
    assert_eq!(plc.step(), Step::Heat, "TK-2 is empty, so this is all that there is");
}

#[test]
fn panel_switches_drive_in_manual() {
    let plc = &mut Dl06::new();
    assert_reply(plc, &[5, 0x0C, 0, 0xFF, 0], &[5, 0x0C, 0, 0xFF, 0]);
    plc.set_switch(2, true);
    plc.set_switch(4, true);
    plc.scan(false, &HALF_FULL);
    assert_eq!(plc.outputs(), Outputs { drain_valve: true, ..Outputs::default() });
    assert_reply(plc, &[2, 8, 0, 0, 20], &[2, 3, 0b100, 0, 0]);
}

#[test]
fn numbers_stand_in_v_memory_as_documented() {
    let plc = &mut Dl06::new();
    plc.scan(true, &Readings { flow_in: 0.75, heater_w: 1600.0, ..HALF_FULL });
    assert_reply(plc, &[4, 4, 8, 0, 7], &[4, 14, 0, 102, 0, 150, 0, 0, 0, 75, 0, 0, 0, 0, 0x06, 0x40]);
    assert_reply(plc, &[3, 0x41, 0, 0, 2], &[3, 4, 0, 0b1_0000, 0, 0]);
    for (value, expect) in [(0, 0), (7, 7), (180, 0x180), (1234, 0x1234), (10_000, 0x9999)] {
        assert_eq!(bcd(value), expect);
        assert_eq!(from_bcd(expect), Some(value.min(9999)));
    }
}
