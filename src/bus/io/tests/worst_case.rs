//! The worst case of a poll against devices whose own time is known: no read takes longer than it says.

use std::{sync::Arc, time::Duration};

use jiff::Timestamp;

use super::slave::{Line, MS, Mode, SlaveAction, correct, line, plant};
use crate::{
    bus::frame,
    plant::{
        Plant, PlantDef,
        def::{AlarmDef, AlarmId, Condition, Subject},
        device_time::TimeSource,
        event::Event,
        line_report::LineReport,
        line_state::LineState,
        record::Record,
    },
};

/// Reports of a line come once a second: this is what a minute gives.
const REPORTS: usize = 60;

/// As good as chance, and the same in each run.
fn chance(number: u64) -> u64 {
    number.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407) >> 33
}

/// A minute of a line whose slave takes its `device` time for the n-th request, and the time of all characters on the wire.
async fn minute(def: &PlantDef, device: impl Fn(u64) -> Duration + Send + 'static) -> Vec<Arc<LineReport>> {
    let char_time = def.lines[0].transport.serial().expect("a serial line").char_time();
    let mut line = line(def.clone());
    line.plug(Mode::Rtu, move |number, message| {
        let bytes = frame::with_crc(message).len() + frame::with_crc(&correct(message)).len();
        SlaveAction::Late(char_time * bytes as u32 + device(number as u64))
    });
    let mut reports = Vec::new();
    while reports.len() < REPORTS {
        reports.extend(next_report(&mut line).await);
    }
    reports
}

async fn next_report(line: &mut Line) -> Option<Arc<LineReport>> {
    match line.events.recv().await.expect("the line runs") {
        Event::Report { report, .. } => Some(report),
        _ => None,
    }
}

/// The longest read of any poll, beside its worst case: `true` where the worst case is at least as long, for all of them.
fn holds(report: &LineReport) -> bool {
    report.polls.iter().all(|poll| poll.stats.read_time.max().is_none_or(|max| max <= poll.cost))
}

/// Ten plants with devices of 0 to 45 ms: what `check` says at load bounds every read, and the report of each second does.
#[tokio::test(start_paused = true)]
async fn no_read_takes_longer_than_the_worst_case() {
    for number in 0..10u64 {
        let longest = Duration::from_millis(5 * number);
        let mut def = plant(Mode::Rtu);
        for device in &mut def.devices {
            // Timers of the runtime are as fine as a millisecond.
            device.response_time = Some(longest + 2 * MS);
        }
        let reports =
            minute(&def, move |request| Duration::from_micros(chance(request) % (longest.as_micros() as u64 + 1)))
                .await;
        let at_load: Vec<Duration> = reports[0].polls.iter().map(|poll| poll.cost).collect();
        let last = reports.last().expect("a minute of reports");
        for (poll, at_load) in last.polls.iter().zip(at_load) {
            let max = poll.stats.read_time.max().expect("each block was read");
            assert!(max <= at_load, "plant {number}: {max:?}, at worst {at_load:?}");
        }
        assert!(reports.iter().all(|report| holds(report)), "plant {number}");
    }
}

/// The same minute in a plant with the alarm for it: raised for a device that takes longer than its profile says, at a time
/// when it was already known how long it takes, and for no other.
#[tokio::test(start_paused = true)]
async fn a_slow_device_raises_its_alarm() {
    for (stated, raised) in [(30 * MS, true), (60 * MS, false)] {
        let mut def = plant(Mode::Rtu);
        let (device, line) = (def.devices[0].id, def.lines[0].id);
        def.devices[0].response_time = Some(stated);
        let id = AlarmId(def.alarms.len() as u16);
        def.alarms.push(AlarmDef::new(id, Subject::Device(device), Condition::SlowerThanStated, "slow"));
        let reports = minute(&def, |_| 45 * MS).await;
        let mut plant = Plant::new(Arc::new(def), Timestamp::UNIX_EPOCH, 1.0);
        plant.on_event(Event::Line { at: Timestamp::UNIX_EPOCH, line, state: LineState::Connected });
        let mut events = Vec::new();
        for (second, report) in (1..).zip(reports) {
            let at = Timestamp::from_second(second).expect("a small number");
            let (values, texts, response_time) = (Vec::new(), Vec::new(), 45 * MS);
            let mut records = plant.on_event(Event::Report { at, line, report }).records;
            let read = Event::Read { at, device, values, texts, response_time, exchange: None };
            records.extend(plant.on_event(read).records);
            records.extend(plant.on_tick(at).records);
            events.extend(records.into_iter().filter_map(|record| match record {
                Record::Alarm(event) => Some((second, event)),
                _ => None,
            }));
        }
        match (&events[..], raised) {
            ([(second, event)], true) => {
                assert!(2 < *second && &*event.message == "slow", "{second} {event:?}");
                let reason = event.reason.as_deref().unwrap_or("");
                assert!(reason.ends_with("for a response, its profile states 30 ms"), "{reason}");
            }
            ([], false) => {}
            other => panic!("{stated:?}: {other:?}"),
        }
    }
}

/// A device of which nothing is stated, and one that takes longer than its profile says: the worst case follows what is seen.
#[tokio::test(start_paused = true)]
async fn a_worst_case_that_was_exceeded_grows_and_says_why() {
    for (stated, before) in [(None, TimeSource::Assumed), (Some(10 * MS), TimeSource::Profile)] {
        let mut def = plant(Mode::Rtu);
        def.devices.iter_mut().for_each(|device| device.response_time = stated);
        let reports = minute(&def, |_| 40 * MS).await;
        let time = |report: &LineReport| report.device_time(def.devices[0].id).expect("a device of the line");
        let (first, last) = (&reports[0], reports.last().expect("a minute of reports"));
        assert_eq!(time(first).source, before);
        assert_eq!(time(last).source, TimeSource::Seen);
        assert!(40 * MS < time(last).bound && time(last).bound < 55 * MS, "{:?}", time(last));
        assert_eq!(time(last).above_stated.is_some(), stated.is_some());
        assert!(first.admission.cycle < last.admission.cycle, "the admission test counts with it");
        assert!(reports.iter().all(|report| holds(report)), "{stated:?}");
        assert!(last.polls.iter().all(|poll| poll.margin().is_none_or(|margin| !margin.is_zero())));
    }
}
