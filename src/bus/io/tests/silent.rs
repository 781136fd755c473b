//! Units that fall silent, become slow or are repaired.

use super::*;

#[tokio::test(start_paused = true)]
async fn one_dead_unit_leaves_the_others_their_rate() {
    let def = plant(Mode::Rtu);
    let mut line = line(def.clone());
    line.plug(Mode::Rtu, |_, message| if message[0] == 1 { SlaveAction::Silent } else { SlaveAction::Answer });
    let (mut reads, mut reported_down) = (BTreeMap::new(), 0);
    let mut end = Timestamp::UNIX_EPOCH;
    while end < Timestamp::from_second(120).expect("a small number") {
        match line.next(&def).await {
            Event::Read { at, device, .. } => {
                *reads.entry(device).or_insert(0) += 1;
                end = at;
            }
            Event::Failed { fault: Fault::BackedOff, device, tags, .. } => {
                assert_eq!((device, tags.len()), (DeviceId(0), 10), "all its tags at once");
                reported_down += 1;
            }
            _ => {}
        }
    }
    assert_eq!(reported_down, 1);
    // Three blocks a second for two minutes, and one block once.
    let rate = f64::from(reads[&DeviceId(1)]) / 361.0;
    assert!(0.9 <= rate, "the living unit keeps {rate} of its rate");
    assert!(!reads.contains_key(&DeviceId(0)));
}

/// A unit that was silent for minutes is repaired: with the retry of an operator it is read at once.
#[tokio::test(start_paused = true)]
async fn a_repaired_unit_is_read_as_soon_as_an_operator_retries() {
    let def = plant(Mode::Rtu);
    let mut line = line(def.clone());
    let repaired = Arc::new(AtomicUsize::new(0));
    let is_repaired = repaired.clone();
    line.plug(Mode::Rtu, move |_, message| match (message[0], is_repaired.load(Ordering::Relaxed)) {
        (1, 0) => SlaveAction::Silent,
        _ => SlaveAction::Answer,
    });
    let of_other = |event: &Event, after: Timestamp| match event {
        Event::Read { at, device: DeviceId(1), .. } if after < *at => Some(*at),
        _ => None,
    };
    let minutes = Timestamp::from_second(300).expect("a small number");
    let now = line.until(&def, |event| of_other(event, minutes)).await;
    repaired.store(1, Ordering::Relaxed);
    line.requests.send(BusRequest::Refresh { device: DeviceId(0), command: None }).await.expect("the line runs");
    let read = |event: &Event| match event {
        Event::Read { at, device: DeviceId(0), .. } => Some(*at),
        _ => None,
    };
    let waited = line.until(&def, read).await.duration_since(now).as_secs_f64();
    assert!(waited < 1.5, "{waited} s");
}

/// A unit that has always answered at once and falls silent does not hold the line for the whole timeout of 300 ms.
#[tokio::test(start_paused = true)]
async fn a_fast_unit_that_dies_is_not_waited_for_long() {
    let def = plant(Mode::Rtu);
    let mut line = line(def.clone());
    line.plug(
        Mode::Rtu,
        |number, message| if 200 < number && message[0] == 1 { SlaveAction::Silent } else { SlaveAction::Answer },
    );
    let waited = |event: &Event| match event {
        Event::Failed { at, fault: Fault::Timeout, exchange: Some(exchange), .. } => {
            Some(at.duration_since(exchange.at))
        }
        _ => None,
    };
    let waited = Duration::try_from(line.until(&def, waited).await).expect("not negative");
    assert!((100 * MS..150 * MS).contains(&waited), "{waited:?}");
}

/// A unit that becomes slow has the whole timeout again as soon as one of its answers has come late.
#[tokio::test(start_paused = true)]
async fn a_fast_unit_that_becomes_slow_is_waited_for() {
    for mode in [Mode::Rtu, Mode::Ascii, Mode::RtuOverTcp] {
        let slow = |number, _: &[u8]| if 200 < number { SlaveAction::Late(220 * MS) } else { SlaveAction::Answer };
        let (good, failed) = poll(mode, 400, slow).await;
        // Behind this slave requests wait for their turn, so that one late answer makes others late.
        assert!(failed <= 6, "{mode:?}: {good} good, {failed} failed");
    }
}

/// A try that was not even sent, because the unit is out of sync, is not made again at once and for ever.
#[tokio::test(start_paused = true)]
async fn a_silent_unit_that_is_out_of_sync_is_read_again() {
    let script = |number, _: &[u8]| match number {
        0 | 2 => SlaveAction::Silent,
        1 => SlaveAction::Late(1_681 * MS),
        4 => SlaveAction::Late(332 * MS),
        5 => SlaveAction::Torn(0, Duration::ZERO),
        _ => SlaveAction::Answer,
    };
    let (good, failed) = poll(Mode::Ascii, 60, script).await;
    assert!(failed < good, "{good} good, {failed} failed");
}

/// Without connections none can be of use: the line stays as it is while its devices are silent, and they are back at once.
#[tokio::test(start_paused = true)]
async fn a_silent_host_without_a_connection_does_not_move_its_line() {
    for mode in [Mode::Udp, Mode::RtuOverUdp] {
        let def = plant(mode);
        let mut line = line(def.clone());
        line.plug(mode, |number, _| if number < 40 { SlaveAction::Silent } else { SlaveAction::Answer });
        let (mut failed, mut good) = (0, 0);
        while good < 20 {
            match line.next(&def).await {
                Event::Failed { .. } => failed += 1,
                Event::Read { .. } => good += 1,
                Event::Line { state, .. } => {
                    assert!(!matches!(state, LineState::Waiting { .. }), "{mode:?}: {state:?}")
                }
                _ => {}
            }
        }
        assert!(10 < failed, "{mode:?}: {failed} failed before");
    }
}
