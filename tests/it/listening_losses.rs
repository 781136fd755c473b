//! A station on the line of another master, whose bytes reach it damaged: no value that it calls good is wrong.

use heard::{Damage, Outcome, damages, models, run};

#[path = "../bench/heard/mod.rs"]
mod heard;

/// Values that are sent on each line, for each kind of damage and each seed; and over a few minutes.
const VALUES: u64 = 600;
const VALUES_LONG: u64 = 40_000;

#[test]
fn no_value_that_is_called_good_is_wrong() {
    let mut all = Outcome::default();
    for seed in 1..4 {
        for damage in damages() {
            for model in models() {
                let outcome = run(&model, &damage, seed, VALUES);
                assert_eq!(outcome.wrong, 0, "seed {seed}, {}, {}", damage.name, model.name);
                all.add(outcome);
            }
        }
    }
    assert!(100_000 < all.heard, "{all:?}");
}

#[test]
fn values_stay_good_for_as_long_as_they_are_heard_often_enough() {
    let named = |name: &str| models().into_iter().find(|model| model.name == name).unwrap();
    for model in [
        "RTU, four blocks a second",
        "RTU, three rates",
        "RTU, any order",
        "ASCII, three blocks in turn",
        "RTU over TCP, three units",
        "TCP, numbered",
    ] {
        let model = named(model);
        for damage in [
            Damage { name: "bytes lost", lost_bytes: 0.003, ..Damage::default() },
            Damage { name: "frames lost", lost_frames: 0.03, ..Damage::default() },
        ] {
            // With the second, responses are lost before the times of the unit are known.
            for seed in [38, 2] {
                let share = run(&model, &damage, seed, VALUES_LONG).good_share();
                assert!(0.97 <= share, "{}, {}, seed {seed}: {share:.3} of the time good", model.name, damage.name);
            }
        }
    }
}
