//! Lines with too much to do.

use super::*;

/// Two critical polls, one normal that fills the line, one background.
fn crowd() -> [Block; 4] {
    [
        classed(0, every(200), PollClass::Critical),
        classed(1, every(400), PollClass::Critical),
        classed(2, every(100), PollClass::Normal),
        classed(3, every(1000), PollClass::Background),
    ]
}

#[test]
fn overload_sheds_background_stretches_normal_and_ends() {
    let mut schedule = Schedule::new(&crowd(), at(0));
    // 20 % + 10 % critical, 85 % normal, 4 % background.
    let heavy = |index: usize, _| [40, 40, 85, 40][index];
    play(&mut schedule, 0, 20_000, heavy);
    // What the critical polls leave is 70 %.
    assert!(matches!(schedule.load(), Load::Overload { factor } if (factor / (85.0 / 70.0) - 1.0).abs() < 0.05));
    let state: Vec<_> = schedule.polls().map(|poll| (1.0 < poll.factor, poll.shed)).collect();
    assert_eq!(state, [(false, false), (false, false), (true, false), (false, true)]);
    assert!(schedule.load().to_string().contains("every 1.2 periods"));
    let before = missed(&schedule);
    let log = play(&mut schedule, 20_000, 60_000, heavy);
    let reads = |log: &[Read], poll| log.iter().filter(|(_, index)| *index == poll).count();
    assert_eq!((reads(&log, 0), reads(&log, 1)), (200, 100), "critical at full rate");
    let normal = reads(&log, 2) * 85;
    assert!((26_900..=28_000).contains(&normal), "normal has what is left of 40 s: {normal} ms");
    assert_eq!(missed(&schedule), before, "a stretched poll is not missed");
    // The device has become faster: everything fits again.
    let light = |index: usize, _| [40, 40, 20, 40][index];
    play(&mut schedule, 60_000, 100_000, light);
    assert_eq!(schedule.load(), Load::Normal);
    let log = play(&mut schedule, 100_000, 110_000, light);
    assert_eq!((reads(&log, 2), reads(&log, 3)), (100, 10));
}

#[test]
fn a_device_that_does_not_answer_does_not_overload_its_line() {
    let (critical, background) =
        (|device| classed(device, every(1_000), PollClass::Critical), classed(1, every(10_000), PollClass::Background));
    let mut schedule = Schedule::new(&[critical(0), critical(1), background], at(0));
    let mut now = 0;
    while now < 120_000 {
        match schedule.next(at(now)) {
            Next::Run(index) => {
                let silent = index == 0 && 10_000 < now;
                let spent = if silent { 520 } else { 40 };
                let (began, ended, took) = (at(now), at(now + spent), Duration::from_millis(spent as u64));
                schedule.done(index, began, ended);
                if silent {
                    schedule.failed(Some(index), DeviceId(0), Failure::Silence, (began, took), ended);
                } else {
                    schedule.answered(Some(index), DeviceId(index.min(1) as u16), Some(took), ended);
                    schedule.spent(index, took);
                }
                now += spent;
            }
            Next::WaitUntil(until) => now = until.as_millisecond().max(now + 1),
            Next::Idle => break,
        }
        assert_eq!(schedule.load(), Load::Normal, "at {now} ms");
    }
    assert!(schedule.devices[0].is_down());
}

#[test]
fn identification_is_read_even_on_an_overloaded_line() {
    let blocks = [
        classed(0, every(100), PollClass::Critical),
        classed(1, Poll::Once, PollClass::Background),
        block(2, every(100)),
    ];
    let mut schedule = Schedule::new(&blocks, at(0));
    schedule.done(1, at(0), at(1));
    let cost = |index: usize, _| [90, 30, 90][index];
    play(&mut schedule, 0, 10_000, cost);
    schedule.refresh(DeviceId(1), at(10_000));
    let log = play(&mut schedule, 10_000, 72_000, cost);
    let first = log.iter().find(|(_, index)| *index == 1).expect("it is read in the end");
    assert!((70_000..71_000).contains(&first.0), "after a minute: {first:?}");
}

#[test]
fn a_load_that_swings_is_overload_without_coming_and_going() {
    let mut schedule = Schedule::new(&crowd(), at(0));
    let mut changes = 0;
    let mut overloaded = false;
    for second in 0..3600 {
        // Four seconds too much, twelve seconds little.
        let normal = if second % 16 < 4 { 90 } else { 10 };
        play(&mut schedule, second * 1000, second * 1000 + 1000, |index, _| [40, 40, normal, 40][index]);
        changes += usize::from(overloaded != (schedule.load() != Load::Normal));
        overloaded = schedule.load() != Load::Normal;
    }
    assert!(0 < changes && changes < 40, "{changes} changes in 225 swings of an hour");
}

#[test]
fn five_hundred_polls_have_each_their_turn() {
    let blocks: Vec<Block> = (0..500).map(|n| block(n % 30, every(20_000))).collect();
    let mut schedule = Schedule::new(&blocks, at(0));
    let mut seen: Vec<usize> = play(&mut schedule, 0, 20_000, |_, _| 30).into_iter().map(|(_, index)| index).collect();
    seen.sort_unstable();
    assert_eq!(seen, (0..500).collect::<Vec<_>>());
}

proptest! {
    #[test]
    fn critical_polls_keep_their_period_if_they_are_admissible(
        critical in polls(1..5), normal in proptest::collection::vec((50u64..200, 20i64..80), 4..9),
    ) {
        // Any one of the others may be under way when a critical poll falls due.
        let mut tasks: Vec<Task> =
            critical.iter().map(|(period, cost)| Task { cost: *cost as u64, period: *period }).collect();
        let blocking = normal.iter().map(|(_, cost)| *cost as u64).max().unwrap_or(0);
        tasks.push(Task { cost: blocking, period: 600_000 });
        prop_assume!(admission::test(&tasks) == Test::Accept && admission::utilisation(&tasks) < 0.9);
        let load: Vec<(u64, i64)> = critical.iter().chain(&normal).copied().collect();
        let all: Vec<Task> = load.iter().map(|(period, cost)| Task { cost: *cost as u64, period: *period }).collect();
        prop_assume!(admission::utilisation(&all) > 1.02);
        let class = |n: usize| if n < critical.len() { PollClass::Critical } else { PollClass::Normal };
        let blocks = blocks(&load, class);
        let mut schedule = Schedule::new(&blocks, at(0));
        play(&mut schedule, 0, 20_000, |index, _| load[index].1);
        prop_assert!(schedule.load() > Load::Normal);
        let missed_critical = |schedule: &Schedule| schedule.polls().take(critical.len()).map(|poll| poll.missed).sum::<u64>();
        let before = missed_critical(&schedule);
        play(&mut schedule, 20_000, 200_000, |index, _| load[index].1);
        prop_assert_eq!(missed_critical(&schedule), before);
    }
}
