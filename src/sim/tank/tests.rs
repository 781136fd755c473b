//! The water and its heat: the lumped model, the probe, the sight glass.

use proptest::prelude::*;

use super::*;

/// Water in all tanks, in litres.
fn total_l(tank: &Tank) -> f64 {
    tank.cold.volume_l + tank.control.volume_l + tank.hot.volume_l
}

/// Heat in water and walls, counted from 0 °C, in joules.
fn energy_j(tank: &Tank) -> f64 {
    tank.cold.energy_j() + tank.control.energy_j() + tank.hot.energy_j()
}

fn any_actuators() -> impl Strategy<Value = Actuators> {
    (any::<[bool; 4]>(), -10.0..120.0).prop_map(|([pump, agitator, drain_valve, fill_valve], heater_percent)| {
        Actuators { pump, agitator, drain_valve, fill_valve, heater_percent }
    })
}

proptest! {
    #[test]
    fn no_water_and_no_heat_appear_or_vanish(
        start_l in 0.0..20.0,
        start_c in 5.0..90.0,
        moves in prop::collection::vec((any_actuators(), 1_u32..3000), 1..12),
    ) {
        let mut tank = Tank::new(start_l, start_c);
        let before_j = energy_j(&tank);
        let (mut in_j, mut out_j) = (0.0, 0.0);
        for (actuators, steps) in moves {
            for _ in 0..steps {
                let heat = tank.step(0.1, &actuators);
                in_j += heat.heater_j;
                out_j += heat.loss_j;
            }
            for vessel in [&tank.cold, &tank.control, &tank.hot] {
                prop_assert!((0.0..=vessel.capacity_l + 1e-9).contains(&vessel.volume_l));
                prop_assert!((5.0..=105.0).contains(&vessel.temperature_c), "{}", vessel.temperature_c);
            }
        }
        prop_assert!((total_l(&tank) - TOTAL_L).abs() < 1e-9);
        prop_assert!((energy_j(&tank) - before_j - in_j + out_j).abs() < 1.0, "heat balance is off");
    }
}

#[test]
fn five_litres_need_the_time_of_the_lumped_model() {
    let mut tank = Tank::new(5.0, 27.0);
    let full = Actuators { heater_percent: 100.0, agitator: true, ..Actuators::default() };
    let mut seconds = 0.0;
    while tank.control.temperature_c < 70.0 {
        tank.step(0.1, &full);
        seconds += 0.1;
    }
    // Water and wall against full power and loss: −C/U · ln(1 − U·43/1600) plus the lag of the heater.
    let (c, u) = (5.0 * WATER_J_PER_L_K + WALL_J_PER_K, CONTROL_LOSS_W_PER_K);
    let expected = -c / u * (1.0 - u * 43.0 / HEATER_W).ln() + HEATER_LAG_S;
    assert!((seconds - expected).abs() < 1.0, "{seconds} s, expected {expected} s");
}

#[test]
fn the_probe_is_behind_the_water_and_more_so_unstirred() {
    let behind = |agitator| {
        let mut tank = Tank::new(5.0, 27.0);
        for _ in 0..1200 {
            tank.step(0.1, &Actuators { heater_percent: 100.0, agitator, ..Actuators::default() });
        }
        tank.control.temperature_c - tank.probe_c()
    };
    assert!(behind(true) > 15.0 * 0.06 && behind(true) < 1.5);
    assert!(behind(false) > 2.0 * behind(true));
}

#[test]
fn the_ssr_does_most_in_the_middle_of_its_signal() {
    for (percent, share) in [(-5.0, 0.0), (0.0, 0.0), (10.0, 0.0065), (25.0, 0.0908), (50.0, 0.5), (100.0, 1.0)] {
        assert!((power_share(percent) - share).abs() < 1e-4, "{percent} %: {}", power_share(percent));
    }
}

#[test]
fn hot_water_shimmers_at_the_probe_and_cold_water_does_not() {
    let spread = |start_c| {
        let mut tank = Tank::new(5.0, start_c);
        let (mut least_c, mut most_c) = (f64::MAX, f64::MIN);
        for _ in 0..3000 {
            tank.step(0.1, &Actuators { agitator: true, ..Actuators::default() });
            let above_water_c = tank.probe_c() - tank.control.temperature_c;
            (least_c, most_c) = (least_c.min(above_water_c), most_c.max(above_water_c));
        }
        most_c - least_c
    };
    assert!(spread(AMBIENT_C) < 1e-9);
    assert!((0.3..1.0).contains(&spread(70.0)), "{} K", spread(70.0));
}

#[test]
fn the_sight_glass_shows_ten_centimetres_at_five_litres() {
    assert!((Tank::new(5.0, 27.0).readings().level_cm - 10.0).abs() < 0.05);
}

#[test]
fn the_thermostat_keeps_a_forgotten_heater_from_boiling() {
    let mut tank = Tank::new(5.0, 27.0);
    for _ in 0..36_000 {
        tank.step(0.1, &Actuators { heater_percent: 100.0, ..Actuators::default() });
    }
    assert!((CUT_OUT_C - CUT_OUT_HYSTERESIS_K - 1.0..CUT_OUT_C + 1.0).contains(&tank.control.temperature_c));
}
