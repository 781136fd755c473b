//! Writes: sent once, read back, and stops that wait for nothing but the transaction under way.

use super::*;
use crate::plant::{tag::Decimals, tag_value::TagValue};

/// Writes register 10 := 10 (so that the read-back fits the address rule) and gives result and number of writes on the wire.
async fn write(action: SlaveAction, read_back: SlaveAction) -> (WriteResult, usize) {
    let def = plant(Mode::Rtu);
    let mut line = line(def.clone());
    let writes = Arc::new(AtomicUsize::new(0));
    let count = writes.clone();
    line.plug(Mode::Rtu, move |_, message| {
        if message[1] == 6 {
            count.fetch_add(1, Ordering::Relaxed);
            return action.clone();
        }
        if message[2..6] == [0, 10, 0, 1] { read_back.clone() } else { SlaveAction::Answer }
    });
    line.read(&def).await;
    let result = line.write(&def, 10.0, true).await;
    for _ in 0..20 {
        line.next(&def).await;
    }
    (result, writes.load(Ordering::Relaxed))
}

#[tokio::test(start_paused = true)]
async fn a_write_is_sent_once_whatever_happens() {
    for (action, read_back, expect) in [
        (SlaveAction::Answer, SlaveAction::Answer, WriteResult::ReadBack(10.0.into())),
        (SlaveAction::Exception(3), SlaveAction::Answer, WriteResult::Refused(ExceptionCode(3))),
        (SlaveAction::Silent, SlaveAction::Answer, WriteResult::ReadBackAfterFault(Fault::Timeout, 10.0.into())),
        (SlaveAction::Silent, SlaveAction::Silent, WriteResult::NoValidResponse(Fault::Timeout)),
        (SlaveAction::Answer, SlaveAction::Silent, WriteResult::NotRead(Fault::Timeout)),
        (
            SlaveAction::Instead(vec![1, 6, 0, 10, 0, 11]),
            SlaveAction::Answer,
            WriteResult::ReadBackAfterFault(Fault::WrongEcho, 10.0.into()),
        ),
        (
            SlaveAction::Exception(4),
            SlaveAction::Answer,
            WriteResult::ReadBackAfterFault(Fault::Exception(ExceptionCode(4)), 10.0.into()),
        ),
    ] {
        assert_eq!(write(action.clone(), read_back).await, (expect, 1), "{action:?}");
    }
}

/// The register holds 10.
#[tokio::test(start_paused = true)]
async fn what_was_seen_long_ago_is_read_before_it_is_written_over() {
    for mode in Mode::ALL {
        for (seen, raw, is_silent, expect) in [
            (10.0, 11.0, false, (WriteResult::ReadBack(10.0.into()), 1)),
            (12.0, 11.0, false, (WriteResult::Held(10.0.into()), 0)),
            (10.0, 10.0, false, (WriteResult::Held(10.0.into()), 0)),
            (12.0, 10.0, false, (WriteResult::Held(10.0.into()), 0)),
            (10.0, 11.0, true, (WriteResult::NotSent(Fault::Timeout), 0)),
        ] {
            let def = plant(mode);
            let mut line = line(def.clone());
            let writes = Arc::new(AtomicUsize::new(0));
            let count = writes.clone();
            line.plug(mode, move |_, message| {
                count.fetch_add(usize::from(message[1] == 6), Ordering::Relaxed);
                let is_before = message[2..6] == [0, 10, 0, 1] && is_silent;
                if is_before { SlaveAction::Silent } else { SlaveAction::Answer }
            });
            line.read(&def).await;
            let result = line.write_over(&def, raw, true, Some(seen.into())).await;
            assert_eq!((result, writes.load(Ordering::Relaxed)), expect, "{mode:?}: {raw} over {seen}");
        }
    }
}

/// Registers hold their own address: the power of ten is 5.
#[tokio::test(start_paused = true)]
async fn a_power_of_ten_is_read_again_with_what_was_written() {
    for mode in Mode::ALL {
        for (seen, unscaled_by, expect) in [
            (None, -5, (WriteResult::ReadBack(10.0.into()), 1)),
            (Some(10.0), -5, (WriteResult::ReadBack(10.0.into()), 1)),
            (Some(10.0), -4, (WriteResult::Held(10.0.into()), 0)),
        ] {
            let mut def = plant(mode);
            (def.tags[0].decimals, def.tags[1].point.address) = (Decimals::PowerFrom(TagId(1)), 5);
            let mut line = line(def.clone());
            let writes = Arc::new(AtomicUsize::new(0));
            let count = writes.clone();
            line.plug(mode, move |_, message| {
                count.fetch_add(usize::from(message[1] == 6), Ordering::Relaxed);
                SlaveAction::Answer
            });
            line.read(&def).await;
            let job = WriteJob {
                id: WriteId(7),
                tag: TagId(0),
                raw: TagValue::Number(11.0.into()),
                unlock: None,
                verify: true,
                urgent: false,
                over: seen.map(|seen: f64| TagValue::Number(seen.into())),
                unscaled_by: Some(unscaled_by),
            };
            line.requests.send(BusRequest::Write(job)).await.expect("the line runs");
            let mut alone = Vec::new();
            let of_event = |event: &Event| match event {
                Event::Read { values, .. } if values.len() == 1 => {
                    alone.push(values[0].0);
                    None
                }
                Event::Wrote { result, .. } => Some(result.clone()),
                _ => None,
            };
            let result = line.until(&def, of_event).await;
            assert!(alone.ends_with(&[TagId(0), TagId(1)]), "{mode:?}: {alone:?}");
            assert_eq!((result, writes.load(Ordering::Relaxed)), expect, "{mode:?} {seen:?} {unscaled_by}");
        }
    }
}

/// A broadcast is sent once, without waiting for a response, by each function that writes. Modbus TCP has none: there unit 0
/// answers as any other does.
#[tokio::test(start_paused = true)]
async fn a_broadcast_is_sent_once_and_never_called_verified() {
    let expected = [
        (Mode::Rtu, WriteResult::Sent),
        (Mode::Ascii, WriteResult::Sent),
        (Mode::AsciiOverTcp, WriteResult::Sent),
        (Mode::RtuOverTcp, WriteResult::Sent),
        (Mode::Tcp, WriteResult::Accepted),
    ];
    for (mode, expect) in expected {
        for function in [5, 6, 15, 16] {
            let mut def = plant(mode);
            def.devices[0].unit = 0;
            def.tags.retain(|tag| tag.device == DeviceId(1));
            let mut everybody = TagDef { device: DeviceId(0), access: Access::Write, ..def.tags[0].clone() };
            everybody.write_fc = Some(function);
            if function != 6 && function != 16 {
                (everybody.point.table, everybody.point.kind) = (Table::Coil, DataType::Bool);
            }
            def.tags.insert(0, everybody);
            for (index, tag) in def.tags.iter_mut().enumerate() {
                tag.id = TagId(index as u16);
            }
            let mut line = line(def.clone());
            let heard = Arc::new(AtomicUsize::new(0));
            let count = heard.clone();
            line.plug(mode, move |_, message| {
                if message[0] != 0 {
                    return SlaveAction::Answer;
                }
                assert_eq!(message[1], function);
                count.fetch_add(1, Ordering::Relaxed);
                if mode == Mode::Tcp { SlaveAction::Answer } else { SlaveAction::Silent }
            });
            line.read(&def).await;
            let result = line.write(&def, 1.0, false).await;
            assert_eq!((result, heard.load(Ordering::Relaxed)), (expect.clone(), 1), "{mode:?}, function {function}");
            line.read(&def).await;
        }
    }
}

/// The refusal of a write that was given up must not be taken for the refusal of the next: that one may take effect.
#[tokio::test(start_paused = true)]
async fn a_late_refusal_is_not_the_answer_to_the_next_write() {
    let def = plant(Mode::Rtu);
    let mut line = line(def.clone());
    let mut writes = 0;
    line.plug(Mode::Rtu, move |_, message| {
        writes += usize::from(message[1] == 6);
        match (message[1], writes) {
            (6, 1) | (8, _) => SlaveAction::Silent,
            (6, _) => SlaveAction::Exception(3),
            _ => SlaveAction::Answer,
        }
    });
    line.read(&def).await;
    for (id, tag) in [(1, 0), (2, 1)] {
        let request = BusRequest::Write(WriteJob {
            id: WriteId(id),
            tag: TagId(tag),
            raw: 10.0.into(),
            unlock: None,
            verify: true,
            urgent: false,
            over: None,
            unscaled_by: None,
        });
        line.requests.send(request).await.expect("the line runs");
    }
    for (id, expect) in
        // Read once the unit is in sync: what the device holds, not what an answer to another write says.
        [(1, TagValue::from(10.0)), (2, 11.0.into())]
    {
        let result = line
            .until(&def, |event| match event {
                Event::Wrote { id: done, result, .. } if *done == WriteId(id) => Some(result.clone()),
                _ => None,
            })
            .await;
        assert!(matches!(&result, WriteResult::ReadBackAfterFault(_, held) if *held == expect), "{id}: {result:?}");
    }
}

/// Writes that got no answer have used up their share of a full line. A stop goes all the same, and what was requested before
/// it and still waits does not undo it.
#[tokio::test(start_paused = true)]
async fn a_stop_waits_for_nothing_but_the_transaction_under_way() {
    let def = plant(Mode::Rtu);
    let mut line = line(def.clone());
    let heard = Arc::new(std::sync::Mutex::new(Vec::new()));
    let list = heard.clone();
    line.plug(Mode::Rtu, move |_, message| {
        list.lock().expect("no panic").push(message[..6].to_vec());
        let lost = message[1] == 6 && message[3] < 20;
        if lost { SlaveAction::Silent } else { SlaveAction::Late(200 * MS) }
    });
    line.read(&def).await;
    let write = |id, tag, raw, urgent| {
        BusRequest::Write(WriteJob {
            id: WriteId(id),
            tag: TagId(tag),
            raw,
            unlock: None,
            verify: true,
            urgent,
            over: None,
            unscaled_by: None,
        })
    };
    for tag in 0..4u16 {
        line.requests.send(write(u64::from(tag), tag, 1.0.into(), false)).await.expect("the line runs");
    }
    line.until(&def, |event| matches!(event, Event::Wrote { id: WriteId(3), .. }).then_some(())).await;
    line.requests.send(write(4, 4, 1.0.into(), false)).await.expect("the line runs");
    line.requests.send(write(5, 4, 0.0.into(), true)).await.expect("the line runs");
    let before = heard.lock().expect("no panic").len();
    let mut results = Vec::new();
    while results.len() < 2 {
        let ended = |event: &Event| match event {
            Event::Wrote { id, result, .. } => Some((id.0, result.clone())),
            _ => None,
        };
        results.push(line.until(&def, ended).await);
    }
    assert_eq!(results, [(4, WriteResult::Superseded), (5, WriteResult::ReadBack(20.0.into()))]);
    let heard = heard.lock().expect("no panic").clone();
    let stop = heard.iter().position(|message| *message == [1, 6, 0, 20, 0, 0]).expect("sent");
    assert!(stop <= before + 1, "{} requests went before the stop: {:?}", stop - before, &heard[before..]);
    assert!(!heard.contains(&vec![1, 6, 0, 20, 0, 1]), "the start is not sent after the stop");
}

/// An unlock register that was written stays so though the value is refused: that is reported, and it is read again.
#[tokio::test(start_paused = true)]
async fn an_unlock_is_reported_and_read_again_after_a_refusal() {
    let def = plant(Mode::Rtu);
    let (value, unlock_tag) = (TagId(1), TagId(9));
    let mut line = line(def.clone());
    line.plug(Mode::Rtu, |_, message| match message {
        [1, 6, 0, 11, ..] => SlaveAction::Exception(3),
        _ => SlaveAction::Answer,
    });
    // The unlock register is read once at the start and then only on request.
    let holds = |event: &Event| match event {
        Event::Read { values, .. } => values.iter().any(|(tag, _)| *tag == unlock_tag).then_some(()),
        _ => None,
    };
    line.until(&def, holds).await;
    let (id, unlock) = (WriteId(1), Some((unlock_tag, 1.0.into())));
    let request = BusRequest::Write(WriteJob {
        id,
        tag: value,
        raw: 7.0.into(),
        unlock,
        verify: true,
        urgent: false,
        over: None,
        unscaled_by: None,
    });
    line.requests.send(request).await.expect("the line runs");
    let is_result = |event: &Event| match event {
        Event::Unlocked { unlock_tag, result, .. } => Some((Some(*unlock_tag), result.clone())),
        Event::Wrote { result, .. } => Some((None, result.clone())),
        _ => None,
    };
    assert_eq!(line.until(&def, is_result).await, (Some(unlock_tag), WriteResult::Accepted));
    assert_eq!(line.until(&def, is_result).await, (None, WriteResult::Refused(ExceptionCode(3))));
    line.until(&def, holds).await;
}

/// The last exchange that the link remembers is then one of another device.
#[tokio::test(start_paused = true)]
async fn a_write_that_loses_the_port_counts_no_other_exchange() {
    let mut def = plant(Mode::Rtu);
    // The second unit is never polled.
    def.tags.iter_mut().filter(|tag| tag.device == DeviceId(1)).for_each(|tag| tag.poll = Poll::Never);
    let mut line = line(def.clone());
    line.plug(Mode::Rtu, |_, message| match message {
        // It ends, and the port with it.
        [2, 6, ..] => std::panic::resume_unwind(Box::new("unplugged")),
        _ => SlaveAction::Answer,
    });
    line.read(&def).await;
    let (id, tag) = (WriteId(1), TagId(10));
    let request = BusRequest::Write(WriteJob {
        id,
        tag,
        raw: 10.0.into(),
        unlock: None,
        verify: true,
        urgent: false,
        over: None,
        unscaled_by: None,
    });
    line.requests.send(request).await.expect("the line runs");
    let mut lost = false;
    loop {
        match line.events.recv().await.expect("the line runs") {
            Event::Wrote { result, .. } => {
                assert_eq!(result, WriteResult::NoValidResponse(Fault::NotConnected));
                lost = true;
            }
            Event::Report { report, .. } if lost => {
                assert_eq!(report.device(DeviceId(1)).map_or(0, |stats| stats.requests), 0);
                return;
            }
            _ => {}
        }
    }
}

/// A field of four bits in register 10, which holds 0xAB0A when it is read alone: the other bits are written back.
#[tokio::test(start_paused = true)]
async fn a_part_of_a_register_is_written_with_the_rest_as_read() {
    let read = vec![3, 0, 10, 0, 1];
    for (refused, expect, sent) in [
        (false, WriteResult::ReadBack(10.0.into()), vec![read.clone(), vec![6, 0, 10, 0xAB, 5], read.clone()]),
        (true, WriteResult::NotSent(Fault::Exception(ExceptionCode(2))), vec![read]),
    ] {
        let mut def = plant(Mode::Rtu);
        (def.tags[0].point.field, def.tags[0].read_modify_write) = (Some((0, 4)), true);
        let mut line = line(def.clone());
        let heard = Arc::new(std::sync::Mutex::new(Vec::new()));
        let log = heard.clone();
        line.plug(Mode::Rtu, move |_, message| {
            let is_alone = message[0] == 1 && message[1] == 3 && message[2..6] == [0, 10, 0, 1];
            if message[1] == 6 || is_alone {
                log.lock().expect("one at a time").push(message[1..6].to_vec());
            }
            match (is_alone, refused) {
                (true, true) => SlaveAction::Exception(2),
                (true, false) => SlaveAction::Instead(vec![1, 3, 2, 0xAB, 0x0A]),
                (false, _) => SlaveAction::Answer,
            }
        });
        line.read(&def).await;
        let result = line.write(&def, 5.0, true).await;
        assert_eq!((result, heard.lock().expect("one at a time").clone()), (expect, sent));
    }
}
