//! What a block costs that lives but loses several frames in a row, and one that has died.

use super::*;

/// Plays twelve blocks of one device, of which block 3 is silent for a time; 5 ms each, a second for a timeout. The tries of block 3.
fn tries(silent: std::ops::Range<i64>, until: i64) -> Vec<i64> {
    let blocks: Vec<Block> = (0..12).map(|n| Block { address: 10 * n, ..block(0, every(1000)) }).collect();
    let mut schedule = Schedule::new(&blocks, at(0));
    let (mut now, mut tries) = (0, Vec::new());
    while now < until {
        match schedule.next(at(now)) {
            Next::Run(index) => {
                let lost = index == 3 && silent.contains(&now);
                let spent = if lost { 1_000 } else { 5 };
                tries.extend((index == 3).then_some(now));
                let (sent, ended) = (at(now), at(now + spent));
                schedule.done(index, sent, ended);
                let took = Duration::from_millis(spent as u64);
                if lost {
                    schedule.failed(Some(index), DeviceId(0), Failure::Silence, (sent, took), ended);
                } else {
                    schedule.answered(Some(index), DeviceId(0), Some(took), ended);
                }
                now += spent;
            }
            Next::WaitUntil(until) => now = until.as_millisecond().max(now + 1),
            Next::Idle => break,
        }
    }
    tries
}

#[test]
fn a_block_that_loses_four_frames_in_a_row_is_soon_back() {
    // Four timeouts, and a second after each but the first.
    let tries = tries(10_000..16_500, 30_000);
    let longest = tries.windows(2).map(|pair| pair[1] - pair[0]).max().expect("several tries");
    assert!(longest <= 2_100, "{tries:?}");
    let back = tries.iter().find(|at| 16_500 <= **at).expect("it is tried again");
    assert!(*back < 19_000, "{tries:?}");
}

#[test]
fn a_block_that_has_died_costs_a_twentieth_of_the_line() {
    let tries = tries(10_000..i64::MAX, 310_000);
    let dead = tries.iter().filter(|at| 10_000 <= **at).count();
    assert!((8..=22).contains(&dead), "{dead} timeouts of a second in 300 s");
}

#[test]
fn a_try_of_which_nothing_is_reported_is_not_made_again_at_once() {
    let mut schedule = Schedule::new(&[block(0, every(1000))], at(0));
    schedule.answered(None, DeviceId(0), Some(Duration::from_millis(10)), at(0));
    schedule.done(0, at(0), at(300));
    schedule.failed(Some(0), DeviceId(0), Failure::Silence, (at(0), Duration::from_millis(300)), at(300));
    assert_eq!(schedule.next(at(300)), Next::Run(0));
    schedule.done(0, at(300), at(300));
    assert_eq!(schedule.next(at(300)), Next::WaitUntil(at(1300)));
}
