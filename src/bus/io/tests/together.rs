//! Several requests under way at once over Modbus TCP: answers come in any order, late, or not at all.

use std::{
    collections::BTreeMap,
    sync::{
        Arc,
        atomic::{AtomicUsize, Ordering},
    },
    time::Duration,
};

use jiff::Timestamp;

use super::slave::{Line, MS, Mode, SlaveAction, line, plant};
use crate::plant::{
    PlantDef,
    command::{BusRequest, WriteId, WriteJob},
    def::{DeviceId, TagId},
    event::{Event, WriteResult},
    fault::Fault,
    tag::Poll,
};

/// Two units behind one gateway: the first is read every 300 ms, the second every 100 ms.
fn gateway() -> PlantDef {
    let mut def = plant(Mode::Tcp16);
    for tag in &mut def.tags {
        if matches!(tag.poll, Poll::Every(_)) {
            tag.poll = Poll::Every(if tag.device == DeviceId(0) { 300 * MS } else { 100 * MS });
        }
    }
    def
}

/// Good reads of each device until a time, in seconds.
async fn reads(line: &mut Line, def: &PlantDef, until: i64) -> BTreeMap<DeviceId, u32> {
    let (mut reads, end) = (BTreeMap::new(), Timestamp::from_second(until).expect("a small number"));
    loop {
        if let Event::Read { at, device, .. } = line.next(def).await {
            if end <= at {
                return reads;
            }
            *reads.entry(device).or_insert(0) += 1;
        }
    }
}

#[tokio::test(start_paused = true)]
async fn a_slow_unit_does_not_hold_the_answers_of_the_others() {
    let def = gateway();
    let mut line = line(def.clone());
    let slow = |_, message: &[u8]| if message[0] == 1 { SlaveAction::Meanwhile(250 * MS) } else { SlaveAction::Answer };
    line.plug(Mode::Tcp16, slow);
    let reads = reads(&mut line, &def, 60).await;
    // Three blocks each.
    assert!(1_780 <= reads[&DeviceId(1)], "of 1,800 reads of the fast unit: {reads:?}");
    assert!(590 <= reads[&DeviceId(0)], "of 600 reads of the slow unit: {reads:?}");
}

#[tokio::test(start_paused = true)]
async fn a_dead_unit_does_not_hold_the_answers_of_the_others() {
    let def = gateway();
    let mut line = line(def.clone());
    line.plug(Mode::Tcp16, |number, message| match message[0] {
        1 if 100 < number => SlaveAction::Silent,
        _ => SlaveAction::Answer,
    });
    let reads = reads(&mut line, &def, 60).await;
    assert!(1_780 <= reads[&DeviceId(1)], "of 1,800 reads of the living unit: {reads:?}");
}

/// What was read before a write is not reported after it: the screen would show the old value once more.
#[tokio::test(start_paused = true)]
async fn no_value_that_was_read_before_a_write_is_reported_after_it() {
    let def = gateway();
    let mut line = line(def.clone());
    line.plug(Mode::Tcp16, |_, message| match message {
        [2, 3, _, 10, ..] => SlaveAction::Meanwhile(80 * MS),
        [1, 3, ..] => SlaveAction::Meanwhile(250 * MS),
        _ => SlaveAction::Answer,
    });
    let seconds = Timestamp::from_second(2).expect("a small number");
    line.until(&def, |event| matches!(event, Event::Read { at, .. } if seconds < *at).then_some(())).await;
    for number in 0..20 {
        let id = WriteId(number);
        let request = BusRequest::Write(WriteJob {
            id,
            tag: TagId(10),
            raw: 10.0.into(),
            unlock: None,
            verify: true,
            urgent: false,
            over: None,
            unscaled_by: None,
        });
        line.requests.send(request).await.expect("the line runs");
        let wrote = |event: &Event| match event {
            Event::Wrote { at, id: done, result } if *done == id => Some((*at, result.clone())),
            _ => None,
        };
        let (wrote_at, result) = line.until(&def, wrote).await;
        assert_eq!(result, WriteResult::ReadBack(10.0.into()));
        for _ in 0..6 {
            let Event::Read { device: DeviceId(1), exchange: Some(exchange), .. } = line.next(&def).await else {
                continue;
            };
            assert!(wrote_at <= exchange.at, "asked at {}, reported after the write of {wrote_at}", exchange.at);
        }
    }
}

#[tokio::test(start_paused = true)]
async fn a_stop_does_not_wait_for_the_answers_of_other_units() {
    let def = gateway();
    let mut line = line(def.clone());
    let (heard, number) = (Arc::new(AtomicUsize::new(0)), Arc::new(AtomicUsize::new(0)));
    let (at, count) = (heard.clone(), number.clone());
    let start = tokio::time::Instant::now();
    line.plug(Mode::Tcp16, move |_, message| {
        count.fetch_add(1, Ordering::Relaxed);
        if message[1] == 6 {
            at.store(start.elapsed().as_millis() as usize, Ordering::Relaxed);
        }
        if message[0] == 1 { SlaveAction::Meanwhile(290 * MS) } else { SlaveAction::Answer }
    });
    let first = |event: &Event| matches!(event, Event::Read { device: DeviceId(1), .. }).then_some(());
    line.until(&def, first).await;
    assert!(0 < number.load(Ordering::Relaxed));
    let asked = start.elapsed().as_millis() as usize;
    let request = BusRequest::Write(WriteJob {
        id: WriteId(1),
        tag: TagId(10),
        raw: 10.0.into(),
        unlock: None,
        verify: false,
        urgent: true,
        over: None,
        unscaled_by: None,
    });
    line.requests.send(request).await.expect("the line runs");
    line.until(&def, |event| matches!(event, Event::Wrote { .. }).then_some(())).await;
    let waited = heard.load(Ordering::Relaxed) - asked;
    assert!(waited < 50, "{waited} ms");
}

/// A unit that wants to be left alone after a write does not hold the others; it is asked again when its gap is over.
#[tokio::test(start_paused = true)]
async fn the_gap_of_a_unit_after_a_write_does_not_hold_the_others() {
    for mode in Mode::ALL {
        let mut def = plant(mode);
        def.devices[0].write_gap = 700 * MS;
        for tag in &mut def.tags {
            tag.poll = if tag.point.address == 10 { Poll::Every(100 * MS) } else { Poll::Never };
        }
        let mut line = line(def.clone());
        line.plug(mode, |_, _| SlaveAction::Answer);
        let first = |event: &Event| matches!(event, Event::Read { device: DeviceId(1), .. }).then_some(());
        line.until(&def, first).await;
        let request = BusRequest::Write(WriteJob {
            id: WriteId(1),
            tag: TagId(0),
            raw: 10.0.into(),
            unlock: None,
            verify: false,
            urgent: false,
            over: None,
            unscaled_by: None,
        });
        line.requests.send(request).await.expect("the line runs");
        line.until(&def, |event| matches!(event, Event::Wrote { .. }).then_some(())).await;
        let mut others = 0;
        loop {
            match line.next(&def).await {
                Event::Read { device: DeviceId(0), .. } => break,
                Event::Read { .. } => others += 1,
                _ => {}
            }
        }
        assert!((5..=7).contains(&others), "{mode:?}: {others} reads of the other unit in 0.7 s");
    }
}

/// The gap that the plant file states for a device is kept before each request to it: a poll, a retry, a proof that it is in sync, a
/// write and its read-back.
#[tokio::test(start_paused = true)]
async fn the_gap_of_a_device_is_kept_before_every_request() {
    for mode in Mode::ALL {
        let mut def = plant(mode);
        def.devices[0].gap = 100 * MS;
        let mut line = line(def.clone());
        let too_soon = Arc::new(std::sync::Mutex::new(Vec::new()));
        let (list, mut last) = (too_soon.clone(), None);
        line.plug(mode, move |number, message| {
            let now = tokio::time::Instant::now();
            if message[0] != 1 {
                return SlaveAction::Answer;
            }
            if last.replace(now).is_some_and(|last| now < last + 100 * MS) {
                list.lock().expect("no panic").push(message.to_vec());
            }
            match number % 23 {
                5 => SlaveAction::Silent,
                11 if !mode.has_ids() => SlaveAction::BadCheck,
                17 => SlaveAction::Instead(vec![1, 3, 4, 0, 1, 0, 2]),
                _ => SlaveAction::Answer,
            }
        });
        for id in 0..5 {
            for _ in 0..10 {
                line.read(&def).await;
            }
            let (id, raw) = (WriteId(id), 10.0.into());
            let job = WriteJob {
                id,
                tag: TagId(0),
                raw,
                unlock: None,
                verify: true,
                urgent: false,
                over: None,
                unscaled_by: None,
            };
            line.requests.send(BusRequest::Write(job)).await.expect("the line runs");
            line.until(&def, |event| matches!(event, Event::Wrote { .. }).then_some(())).await;
        }
        assert_eq!(*too_soon.lock().expect("no panic"), Vec::<Vec<u8>>::new(), "{mode:?}");
    }
}

/// A unit of a network that has always answered at once is not waited for the whole timeout of 2 s once it is silent.
#[tokio::test(start_paused = true)]
async fn a_fast_unit_that_dies_is_not_waited_for_long_over_tcp() {
    for mode in [Mode::Tcp, Mode::Tcp16, Mode::RtuOverTcp] {
        let mut def = plant(mode);
        def.lines[0].timeout = Duration::from_secs(2);
        let mut line = line(def.clone());
        line.plug(
            mode,
            |number, message| if 200 < number && message[0] == 1 { SlaveAction::Silent } else { SlaveAction::Answer },
        );
        let waited = |event: &Event| match event {
            Event::Failed { at, fault: Fault::Timeout, exchange: Some(exchange), .. } => {
                Some(at.duration_since(exchange.at))
            }
            _ => None,
        };
        let waited = Duration::try_from(line.until(&def, waited).await).expect("not negative");
        assert!((500 * MS..550 * MS).contains(&waited), "{mode:?}: {waited:?}");
    }
}

/// An answer that comes after its request was given up is counted with its unit, which has the whole timeout from then on.
#[tokio::test(start_paused = true)]
async fn a_late_answer_over_tcp_is_known_and_its_unit_waited_for() {
    for mode in [Mode::Tcp, Mode::Tcp16] {
        let mut def = plant(mode);
        def.lines[0].timeout = Duration::from_secs(2);
        let mut line = line(def.clone());
        line.plug(mode, |number, message| match message[0] {
            1 if 200 < number => SlaveAction::Meanwhile(700 * MS),
            _ => SlaveAction::Answer,
        });
        let (mut failed, mut late) = (0, 0);
        for _ in 0..1_000 {
            match line.events.recv().await.expect("the line runs") {
                Event::Failed { .. } => failed += 1,
                Event::Report { report, .. } => {
                    late = report.device(DeviceId(0)).map_or(0, |stats| stats.late);
                    assert_eq!(late, report.counters.late);
                }
                _ => {}
            }
        }
        // No more than one for each of its blocks.
        assert!((1..=3).contains(&late) && failed <= 3, "{mode:?}: {late} late, {failed} failed");
    }
}
