//! Played lines: who is read when, and what is left out when there is too much to do.

mod lively;
mod overload;

use proptest::prelude::*;

use super::*;
use crate::{
    bus::admission::{self, Task, Test},
    plant::{
        def::TagId,
        tag::{Poll, Table},
    },
};

pub(super) fn at(ms: i64) -> Timestamp {
    Timestamp::from_millisecond(ms).expect("a small number")
}

fn block(device: u16, poll: Poll) -> Block {
    classed(device, poll, PollClass::Normal)
}

fn classed(device: u16, poll: Poll, class: PollClass) -> Block {
    let (unit, tags, device) = (device as u8 + 1, vec![TagId(0)], DeviceId(device));
    Block {
        device,
        unit,
        table: Table::Input,
        address: 0,
        count: 1,
        tags: tags.into(),
        poll,
        class,
        alignment: 1,
        address_words: 1,
    }
}

fn every(ms: u64) -> Poll {
    Poll::Every(Duration::from_millis(ms))
}

/// A block for each period of a load.
fn blocks(load: &[(u64, i64)], class: impl Fn(usize) -> PollClass) -> Vec<Block> {
    load.iter().enumerate().map(|(n, (period, _))| classed(n as u16, every(*period), class(n))).collect()
}

/// One read: which, and when it began.
type Read = (i64, usize);

/// Plays a line on which block n takes `cost(n, now)` ms; returns what was read.
fn play(schedule: &mut Schedule, from: i64, to: i64, cost: impl Fn(usize, i64) -> i64) -> Vec<Read> {
    let (mut now, mut log) = (from, Vec::new());
    while now < to {
        match schedule.next(at(now)) {
            Next::Run(index) => {
                let spent = cost(index, now);
                log.push((now, index));
                schedule.done(index, at(now), at(now + spent));
                schedule.spent(index, Duration::from_millis(spent as u64));
                now += spent;
            }
            // Stretched periods are no whole milliseconds.
            Next::WaitUntil(until) => now = until.as_millisecond().max(now + 1),
            Next::Idle => break,
        }
    }
    log
}

/// Releases that were skipped, of all polls.
fn missed(schedule: &Schedule) -> u64 {
    schedule.polls().map(|poll| poll.missed).sum()
}

#[test]
fn the_nearest_deadline_goes_first_and_the_grid_does_not_drift() {
    let mut schedule = Schedule::new(&[block(0, every(1000)), block(0, every(250))], at(0));
    let log = play(&mut schedule, 0, 1100, |_, _| 40);
    assert_eq!(log, [(0, 1), (40, 0), (250, 1), (500, 1), (750, 1), (1000, 1), (1040, 0)]);
    assert_eq!(missed(&schedule), 0);
}

#[test]
fn what_is_missed_is_counted_and_not_piled_up() {
    let mut schedule = Schedule::new(&[block(0, every(100))], at(0));
    assert_eq!(schedule.next(at(0)), Next::Run(0));
    let served = schedule.done(0, at(20), at(350));
    assert_eq!(
        served,
        Served { jitter: Some(Duration::from_millis(20)), missed: 2 },
        "100 and 200 are lost, 300 is late"
    );
    assert_eq!((missed(&schedule), schedule.polls().next().map(|poll| poll.missed)), (2, Some(2)));
    assert_eq!(schedule.next(at(350)), Next::Run(0));
    assert_eq!(schedule.done(0, at(350), at(360)).jitter, Some(Duration::from_millis(50)));
    assert_eq!(schedule.next(at(360)), Next::WaitUntil(at(400)));
    schedule.refresh(DeviceId(0), at(370));
    assert_eq!(schedule.done(0, at(370), at(380)).jitter, None, "out of turn");
}

#[test]
fn a_dead_device_is_probed_with_backoff_and_read_when_back() {
    let blocks = [block(0, every(1000)), block(0, Poll::Once), block(1, every(1000))];
    let mut schedule = Schedule::new(&blocks, at(0));
    for index in [0, 1, 2] {
        schedule.done(index, at(0), at(10));
    }
    let device = DeviceId(0);
    let fail = |schedule: &mut Schedule, index: usize, sent: i64| {
        assert_eq!(schedule.next(at(sent)), Next::Run(index));
        schedule.done(index, at(sent), at(sent + 300));
        let times = (at(sent), Duration::from_millis(300));
        schedule.failed(Some(index), device, Failure::Silence, times, at(sent + 300))
    };
    schedule.answered(None, device, None, at(10));
    schedule.answered(None, device, Some(Duration::from_millis(10)), at(10));
    assert!(!fail(&mut schedule, 0, 1000));
    assert_eq!(schedule.next(at(1300)), Next::Run(2), "the others go first");
    schedule.done(2, at(1300), at(1310));
    assert!(!fail(&mut schedule, 1, 1310), "it may have lost one frame, or have no answer to one block");
    assert_eq!(schedule.next(at(1610)), Next::WaitUntil(at(2000)));
    schedule.done(2, at(2000), at(2010));
    assert_eq!(schedule.next(at(2010)), Next::WaitUntil(at(2610)), "the third after a second");
    assert!(fail(&mut schedule, 0, 2610), "given up with the third");
    schedule.done(2, at(3000), at(3010));
    assert!(!fail(&mut schedule, 1, 3910), "it is reported once");
    schedule.done(2, at(4210), at(4220));
    schedule.done(2, at(5000), at(5010));
    assert_eq!(schedule.next(at(5210)), Next::WaitUntil(at(6000)), "the other device goes on at its rate");
    schedule.done(2, at(6000), at(6010));
    assert_eq!(schedule.next(at(6010)), Next::WaitUntil(at(6210)), "the next wait is two seconds");
    schedule.answered(None, device, Some(Duration::from_millis(10)), at(6100));
    let mut due = Vec::new();
    while let Next::Run(index) = schedule.next(at(6100)) {
        schedule.done(index, at(6100), at(6100));
        due.push(index);
    }
    due.sort_unstable();
    assert_eq!(due, [0, 1], "also the block that is read once");
}

#[test]
fn a_refresh_polls_a_down_device_at_once_and_resets_its_backoff() {
    let mut schedule = Schedule::new(&[block(0, every(1000))], at(0));
    let mut now = 0;
    let mut fail = |schedule: &mut Schedule, from: i64| {
        now = from;
        schedule.done(0, at(now), at(now));
        schedule.failed(Some(0), DeviceId(0), Failure::Silence, (at(now), Duration::ZERO), at(now));
        schedule.retries()[0].1.as_millisecond() - now
    };
    let waits: Vec<i64> = [0, 10_000, 20_000, 30_000, 40_000].map(|from| fail(&mut schedule, from)).into();
    assert_eq!(waits, [0, 1_000, 2_000, 5_000, 10_000], "one frame may have been lost");
    assert_eq!(schedule.next(at(42_000)), Next::WaitUntil(at(45_000)), "a line without other work waits no longer");
    schedule.refresh(DeviceId(0), at(42_000));
    assert_eq!((schedule.next(at(42_000)), schedule.retries()), (Next::Run(0), vec![(DeviceId(0), at(42_000))]));
    assert_eq!(fail(&mut schedule, 42_000), 1_000);
    schedule.answered(None, DeviceId(0), None, at(51_000));
    assert_eq!(schedule.retries(), []);
}

#[test]
fn units_that_never_answer_are_all_given_up_within_seconds() {
    let blocks: Vec<Block> = (0..5).map(|device| block(device, every(500))).collect();
    let mut schedule = Schedule::new(&blocks, at(0));
    let (mut now, mut given_up) = (0, 0);
    while now < 5_000 {
        match schedule.next(at(now)) {
            Next::Run(index) => {
                schedule.done(index, at(now), at(now + 300));
                let spent = Duration::from_millis(300);
                given_up += u32::from(schedule.failed(
                    Some(index),
                    DeviceId(index as u16),
                    Failure::Silence,
                    (at(now), spent),
                    at(now + 300),
                ));
                now += 300;
            }
            Next::WaitUntil(until) => now = until.as_millisecond().max(now + 1),
            Next::Idle => break,
        }
    }
    assert_eq!(given_up, 5, "none fails for minutes because the tries of others use up their share of the line");
}

#[test]
fn a_device_at_rest_is_not_asked() {
    let mut schedule = Schedule::new(&[block(0, every(100))], at(0));
    schedule.hold_off(DeviceId(0), at(700));
    assert_eq!(schedule.next(at(0)), Next::WaitUntil(at(700)));
    assert!(schedule.is_resting(DeviceId(0), at(699)) && !schedule.is_resting(DeviceId(0), at(700)));
}

#[test]
fn the_gap_of_one_device_does_not_hold_the_others() {
    let mut schedule = Schedule::new(&[block(0, every(100)), block(1, every(100))], at(0));
    schedule.done(0, at(0), at(10));
    schedule.keep_gap(DeviceId(0), at(150));
    assert_eq!(schedule.next(at(100)), Next::Run(1));
    schedule.done(1, at(100), at(110));
    assert_eq!(schedule.next(at(110)), Next::WaitUntil(at(150)), "its own next request waits");
    schedule.done(1, at(110), at(120));
    assert_eq!(schedule.next(at(150)), Next::Run(0));
}

#[test]
fn a_busy_device_is_asked_again_after_waits_that_grow_and_end() {
    let mut schedule = Schedule::new(&[block(0, every(60_000)), block(1, every(60_000))], at(0));
    let (mut now, mut waits) = (0, Vec::new());
    for _ in 0..9 {
        schedule.done(0, at(now), at(now));
        let until = schedule.on_exception(0, ExceptionCode(6), at(now)).expect("busy").as_millisecond();
        waits.push(until - now);
        schedule.done(1, at(now), at(now));
        assert_eq!(schedule.next(at(now)), Next::WaitUntil(at(until)));
        now = until;
    }
    assert_eq!(waits, [100, 200, 400, 800, 1600, 3200, 5000, 5000, 5000]);
    schedule.done(0, at(now), at(now));
    schedule.done(0, at(now), at(now));
    assert_eq!(schedule.on_exception(0, ExceptionCode(6), at(now)), Some(at(now + 100)), "it was good in between");
}

#[test]
fn acknowledge_waits_parity_error_retries_refusal_does_neither() {
    let mut schedule = Schedule::new(&[block(0, every(100))], at(0));
    schedule.done(0, at(0), at(10));
    assert_eq!(schedule.on_exception(0, ExceptionCode(5), at(10)), Some(at(1010)));
    assert_eq!(schedule.next(at(500)), Next::WaitUntil(at(1010)), "also its own grid waits");
    schedule.done(0, at(1010), at(1020));
    schedule.done(0, at(1100), at(1110));
    assert_eq!(schedule.on_exception(0, ExceptionCode(8), at(1110)), Some(at(1110)));
    assert_eq!(schedule.next(at(1110)), Next::Run(0));
    schedule.done(0, at(1110), at(1120));
    assert_eq!(schedule.on_exception(0, ExceptionCode(8), at(1120)), None, "once");
    for code in [1, 2, 3, 4, 10, 11] {
        assert_eq!(schedule.on_exception(0, ExceptionCode(code), at(1120)), None);
    }
}

#[test]
fn a_new_plan_keeps_the_grid_and_the_health_of_devices() {
    let stays = block(0, every(1000));
    let mut schedule = Schedule::new(&[block(1, every(500)), stays.clone()], at(0));
    play(&mut schedule, 0, 300, |_, _| 10);
    schedule.answered(None, DeviceId(1), Some(Duration::from_millis(10)), at(10));
    let fail =
        |now| schedule.failed(Some(0), DeviceId(1), Failure::Silence, (at(now), Duration::from_millis(300)), at(now));
    assert_eq!([300; 3].map(fail), [false, false, true]);
    let new = Block { address: 7, ..stays.clone() };
    schedule.replan(&[stays, new, block(1, every(700))], at(300));
    assert!(schedule.is_down(DeviceId(1)));
    assert_eq!(play(&mut schedule, 300, 1005, |_, _| 10), [(300, 1), (1000, 0)]);
}

/// The schedule without its queue, as it was first: looks at every poll.
fn by_scan(schedule: &Schedule, now: Timestamp) -> Next {
    let mut best: Option<((u8, Timestamp), usize)> = None;
    let (mut wake, mut idle): (Option<Timestamp>, Option<(Timestamp, usize)>) = (None, None);
    let earlier = |wake: Option<Timestamp>, from: Timestamp| Some(wake.map_or(from, |wake| wake.min(from)));
    for probed in [false, true] {
        let (is_idle, free_until) = (best.is_none(), wake);
        for index in 0..schedule.polls.len() {
            let health = &schedule.devices[schedule.polls[index].place];
            let Some(spot) = schedule.spot(index).filter(|_| health.probe_at.is_some() == probed) else { continue };
            let from = spot.from.max(health.free_at);
            let idle_from = health.idle_at.max(health.rests_until).max(health.free_at);
            let fits = free_until.is_none_or(|until| now + schedule.idle_timeout(index) <= until);
            if from <= now {
                if best.is_none_or(|best| (schedule.rank(spot, now), index) < best) {
                    best = Some((schedule.rank(spot, now), index));
                }
            } else if probed && now < idle_from {
                wake = earlier(wake, idle_from);
            } else if probed && is_idle && fits {
                idle = Some(idle.map_or((idle_from, index), |idle| idle.min((idle_from, index))));
            } else {
                // What is kept back by the gap of its device may be looked at a little early.
                wake = earlier(wake, if spot.from <= now || probed { from } else { spot.from });
            }
        }
    }
    match (best.map(|best| best.1).or(idle.map(|idle| idle.1)), wake) {
        (Some(index), _) => Next::Run(index),
        (None, Some(at)) => Next::WaitUntil(at),
        (None, None) => Next::Idle,
    }
}

/// Periods and costs of polls, in ms.
fn polls(count: std::ops::Range<usize>) -> impl Strategy<Value = Vec<(u64, i64)>> {
    proptest::collection::vec((50u64..2000, 1i64..80), count)
}

proptest! {
    // Few random sets of polls are just short of what a line can carry.
    #![proptest_config(ProptestConfig { cases: 64, max_global_rejects: 65_536, ..ProptestConfig::default() })]

    #[test]
    fn the_queue_decides_as_a_look_at_every_poll_does(
        load in polls(1..12),
        classes in proptest::collection::vec((0usize..3, 0u16..4, 0u8..8), 12),
        actions in proptest::collection::vec((0u8..40, 0i64..700), 1..60),
    ) {
        let block_of = |n: usize| {
            let (class, device, once) = classes[n];
            let poll = if once == 0 { Poll::Once } else { every(load[n].0) };
            Block { address: n as u16, ..classed(device, poll, [PollClass::Critical, PollClass::Normal, PollClass::Background][class]) }
        };
        let blocks: Vec<Block> = (0..load.len()).map(block_of).collect();
        let mut schedule = Schedule::new(&blocks, at(0));
        let mut now = 0;
        for turn in 0..3_000 {
            let (action, ms) = actions[turn % actions.len()];
            let (device, expect) = (DeviceId(classes[turn % 12].1), by_scan(&schedule, at(now)));
            match (schedule.next(at(now)), expect) {
                (Next::Run(index), Next::Run(same)) => {
                    prop_assert_eq!(index, same, "turn {} at {} ms", turn, now);
                    let (began, device) = (now, blocks[index].device);
                    now += load[index].1;
                    schedule.done(index, at(began), at(now));
                    match action {
                        0 | 1 => { schedule.failed(Some(index), device, Failure::Silence, (at(began), Duration::from_millis(300)), at(now)); }
                        2 => { schedule.on_exception(index, ExceptionCode(6), at(now)); }
                        3 => { schedule.reschedule(index, at(now)); }
                        4..8 => schedule.keep_gap(device, at(now + ms)),
                        _ => {
                            schedule.answered(Some(index), device, Some(Duration::from_millis(20)), at(now));
                            schedule.spent(index, Duration::from_millis(load[index].1 as u64));
                        }
                    }
                }
                // It may look again earlier than it need.
                (Next::WaitUntil(until), Next::WaitUntil(due)) => {
                    prop_assert!(at(now) < until && until <= due, "turn {} at {} ms", turn, now);
                    now = until.as_millisecond().max(now + 1);
                }
                (next, expect) => prop_assert_eq!(next, expect, "turn {} at {} ms", turn, now),
            }
            match action {
                37 => schedule.hold_off(device, at(now + ms)),
                38 => schedule.refresh(device, at(now)),
                39 => schedule.replan(&blocks, at(now)),
                _ => {}
            }
        }
    }

    #[test]
    fn no_poll_starves_whatever_the_classes(load in polls(1..12), classes in proptest::collection::vec(0usize..3, 12)) {
        let class = |n: usize| [PollClass::Critical, PollClass::Normal, PollClass::Background][classes[n]];
        let blocks = blocks(&load, class);
        let mut schedule = Schedule::new(&blocks, at(0));
        let log = play(&mut schedule, 0, 400_000, |index, _| load[index].1);
        for (index, (period, _)) in load.iter().enumerate() {
            let begun = log.iter().filter(|(_, read)| *read == index).map(|(begun, _)| *begun);
            let times: Vec<i64> = std::iter::once(0).chain(begun).chain([400_000]).collect();
            let longest = times.windows(2).map(|pair| pair[1] - pair[0]).max().unwrap_or(0);
            // A stretched period, the wait of a starved one, and its turn among the other starved ones.
            let bound = (*period as i64 * FACTOR_MAX as i64).max(2_000) + 60_000 + 2 * 80 * 12 + 2_000;
            prop_assert!(longest <= bound, "block {} waited {} ms", index, longest);
        }
    }

    #[test]
    fn a_poll_set_that_is_admitted_misses_nothing(load in polls(1..8)) {
        let tasks: Vec<Task> =
            load.iter().map(|(period, cost)| Task { cost: *cost as u64, period: *period }).collect();
        prop_assume!(admission::test(&tasks) == Test::Accept);
        let blocks = blocks(&load, |_| PollClass::Normal);
        let mut schedule = Schedule::new(&blocks, at(0));
        play(&mut schedule, 0, 100_000, |index, _| load[index].1);
        prop_assert_eq!((missed(&schedule), schedule.load()), (0, Load::Normal));
    }

    #[test]
    fn after_a_standstill_each_poll_runs_once_and_is_on_its_grid(load in polls(1..8), pause in 1i64..100_000) {
        let blocks = blocks(&load, |_| PollClass::Normal);
        let mut schedule = Schedule::new(&blocks, at(0));
        let now = play(&mut schedule, 0, 1, |_, _| pause).len() as i64 * pause;
        let mut due = Vec::new();
        while let Next::Run(index) = schedule.next(at(now)) {
            due.push(index);
            schedule.done(index, at(now), at(now));
        }
        prop_assert!(due.len() <= blocks.len(), "{:?}", due);
        for (poll, (period, _)) in schedule.polls().zip(&load) {
            let next = poll.next.map_or(0, |next| next.as_millisecond());
            // Whoever is far too late is overload, and a stretched poll leaves its grid.
            let on_grid = next % *period as i64 == 0 || poll.factor > 1.0;
            prop_assert!(next > now && next <= now + *period as i64 && on_grid);
        }
    }
}
