//! A line on which another master polls: what it hears becomes values as good as polled ones, and nothing is sent.

use tokio::{
    io::{AsyncReadExt, DuplexStream},
    time::{Instant, sleep, timeout, timeout_at},
};

use super::{slave::correct, *};
use crate::plant::{
    Plant, PlantDef, Snapshot,
    def::{AlarmDef, AlarmId, Condition, Subject},
    line_state::DeviceState,
    number::to_u16,
    sample::{Cause, Quality},
    tag::Decimals,
    traffic::Exchange,
};

const FIRST: TagId = TagId(0);
const READ: [u8; 6] = [1, 3, 0, 10, 0, 4];

/// A line that listens, its plant, and the other end of its port.
struct Bench {
    line: slave::Line,
    plant: Plant,
    port: DuplexStream,
    states: Vec<LineState>,
}

impl Bench {
    fn new(mode: Mode) -> Bench {
        Bench::with(mode, |_| {})
    }

    /// The same with other tags.
    fn with(mode: Mode, change: impl FnOnce(&mut PlantDef)) -> Bench {
        let mut def = plant(mode);
        def.lines[0].listens = true;
        def.tags.iter_mut().for_each(|tag| (tag.decimals, tag.quality_from) = (Decimals::Fixed(0), None));
        change(&mut def);
        let line = line(def.clone());
        let port = plug(&line);
        Bench { line, plant: Plant::new(Arc::new(def), Timestamp::UNIX_EPOCH, 1.0), port, states: Vec::new() }
    }

    /// Time passes: the plant takes what comes, and a tick each second.
    async fn pass(&mut self, seconds: u64) -> Snapshot {
        for _ in 0..seconds {
            let until = Instant::now() + Duration::from_secs(1);
            while let Ok(event) = timeout_at(until, self.line.events.recv()).await {
                let event = event.expect("the line runs");
                if let Event::Line { state, .. } = &event {
                    self.states.push(state.clone());
                }
                self.plant.on_event(event);
            }
            self.plant.on_tick(Timestamp::UNIX_EPOCH + self.line.since.elapsed());
        }
        self.plant.snapshot()
    }

    /// The master asks and, unless the device is `silent`, gets its answer; then a second passes.
    async fn ask(&mut self, mode: Mode, message: &[u8], silent: bool) -> Snapshot {
        let framed = |message: &[u8]| frame::wrap(mode.framing(), 7, message);
        self.port.write_all(&framed(message)).await.expect("the port is open");
        sleep(20 * MS).await;
        if !silent {
            self.port.write_all(&framed(&correct(message))).await.expect("the port is open");
        }
        self.pass(1).await
    }
}

fn plug(line: &slave::Line) -> DuplexStream {
    let (ours, theirs) = tokio::io::duplex(4096);
    line.ports.try_send(ours).expect("room for a port");
    theirs
}

#[tokio::test(start_paused = true)]
async fn what_is_heard_is_a_value_and_nothing_is_ever_sent() {
    for mode in [Mode::Rtu, Mode::Ascii, Mode::RtuOverTcp, Mode::Tcp] {
        let mut bench = Bench::new(mode);
        bench.pass(1).await;
        for _ in 0..5 {
            bench.ask(mode, &READ, false).await;
        }
        let now = bench.ask(mode, &READ, false).await;
        for tag in 0..4 {
            let address = f64::from(bench.plant.def().tags[tag].point.address);
            let raw = now.samples[tag].good_value();
            assert_eq!(raw, Some(address), "{mode:?} {:?}", now.samples[tag]);
        }
        assert_eq!(now.samples[4].quality, Quality::Bad(Cause::NotRead), "the other master never asks for it");
        assert_eq!(now.devices[0].state, DeviceState::Responding);
        let source: &Exchange = now.source_frames[0].as_deref().expect("it has a source");
        assert_eq!(frame::unwrap(mode.framing(), &source.request).as_deref(), Ok(&READ[..]));
        assert!(!source.answer.is_empty() && source.outcome.is_ok());
        let counters = now.lines[0].counters;
        assert_eq!((counters.requests, counters.ok, counters.frames, counters.sent_bytes), (6, 6, 12, 0));
        // Whatever is asked of the task, it has no way to send.
        for request in [
            BusRequest::Refresh { device: DeviceId(0), command: None },
            BusRequest::Write(WriteJob {
                id: WriteId(1),
                tag: FIRST,
                raw: 1.0.into(),
                unlock: None,
                verify: true,
                urgent: true,
                over: None,
                unscaled_by: None,
            }),
        ] {
            bench.line.requests.send(request).await.expect("the line runs");
        }
        bench.pass(30).await;
        let mut byte = [0];
        assert!(timeout(MS, bench.port.read(&mut byte)).await.is_err(), "{mode:?}: it has sent something");
    }
}

/// The device is not asked what it is: a tag that depends on it is as any other.
#[tokio::test(start_paused = true)]
async fn a_device_that_is_only_heard_is_not_asked_what_it_is() {
    for mode in [Mode::Rtu, Mode::Ascii, Mode::RtuOverTcp, Mode::Tcp] {
        let mut bench = Bench::with(mode, |def| def.tags[0].when = identifying::asking(mode).tags[0].when.clone());
        for _ in 0..3 {
            bench.ask(mode, &READ, false).await;
        }
        let now = bench.ask(mode, &READ, false).await;
        assert!(now.sample(FIRST).quality.is_good(), "{mode:?}: {:?}", now.sample(FIRST));
        let mut byte = [0];
        assert!(timeout(MS, bench.port.read(&mut byte)).await.is_err(), "{mode:?}: it has sent something");
    }
}

#[tokio::test(start_paused = true)]
async fn a_silent_master_leaves_no_value_standing_as_good() {
    let mut bench = Bench::new(Mode::Rtu);
    bench.ask(Mode::Rtu, &READ, false).await;
    assert!(bench.ask(Mode::Rtu, &READ, false).await.sample(FIRST).quality.is_good());
    assert!(bench.pass(1).await.sample(FIRST).quality.is_good());
    let now = bench.pass(3).await;
    assert_eq!(now.sample(FIRST).quality, Quality::Uncertain(Cause::NotHeard));
    assert_eq!(now.lines[0].state, LineState::Connected);
    let now = bench.pass(8).await;
    assert_eq!(now.sample(FIRST).quality, Quality::Bad(Cause::NotHeard));
    assert_eq!((&now.lines[0].state, now.lines[0].lost_since.is_some()), (&LineState::NoTraffic, true));
    // Noise is no traffic.
    bench.port.write_all(&[0x55; 9]).await.expect("the port is open");
    assert_eq!(bench.pass(1).await.lines[0].state, LineState::NoTraffic);
    let now = bench.ask(Mode::Rtu, &READ, false).await;
    assert!(now.sample(FIRST).quality.is_good() && now.lines[0].state == LineState::Connected);
    assert_eq!(now.lines[0].lost_since, None);
    // The port goes and comes back.
    bench.port = plug(&bench.line);
    let now = bench.pass(1).await;
    assert_eq!(now.sample(FIRST).quality, Quality::Bad(Cause::NotConnected));
    bench.pass(5).await;
    // What the master has asked meanwhile is not known.
    bench.ask(Mode::Rtu, &READ, false).await;
    assert!(bench.ask(Mode::Rtu, &READ, false).await.sample(FIRST).quality.is_good());
}

#[tokio::test(start_paused = true)]
async fn a_device_that_does_not_answer_its_master_is_down() {
    let mut bench = Bench::new(Mode::Rtu);
    for _ in 0..3 {
        bench.ask(Mode::Rtu, &READ, false).await;
    }
    bench.ask(Mode::Rtu, &READ, true).await;
    bench.ask(Mode::Rtu, &READ, true).await;
    let now = bench.ask(Mode::Rtu, &READ, true).await;
    assert_eq!(now.sample(FIRST).quality, Quality::Uncertain(Cause::Timeout));
    let now = bench.ask(Mode::Rtu, &READ, true).await;
    assert_eq!(now.sample(FIRST).quality, Quality::Bad(Cause::DeviceDown));
    assert!(matches!(now.devices[0].state, DeviceState::Down { .. }), "{:?}", now.devices[0].state);
    // The first responses may be late ones to the requests before.
    let mut asked = 0;
    while !bench.ask(Mode::Rtu, &READ, false).await.sample(FIRST).quality.is_good() {
        asked += 1;
        assert!(asked < 6, "it stays uncertain: {:?}", bench.plant.snapshot().sample(FIRST));
    }
    assert_eq!(bench.plant.snapshot().devices[0].state, DeviceState::Responding);
    // What the master writes is not known until it reads it.
    let now = bench.ask(Mode::Rtu, &[1, 6, 0, 10, 0, 10], false).await;
    assert_eq!(now.sample(FIRST).quality, Quality::Uncertain(Cause::NotReadBack));
}

#[tokio::test(start_paused = true)]
async fn stated_decimals_scale_until_the_device_says_others() {
    let mut bench = Bench::with(Mode::Rtu, |def| {
        // Registers 10 and 11: the first is scaled by the second, which holds 11 ...
        def.tags[0].decimals = Decimals::From(def.tags[1].id);
        def.tags[1].stated = Some(1.0);
        let subject = Subject::Tag(def.tags[1].id);
        let condition = Condition::OtherThanStated { stated: 1.0 };
        def.alarms.push(AlarmDef::new(AlarmId(to_u16(def.alarms.len())), subject, condition, "other"));
    });
    let only_first = [1, 3, 0, 10, 0, 1];
    let (first, second) = (TagId(0), TagId(1));
    let now = bench.pass(1).await;
    assert_eq!(now.sample(second).quality, Quality::Uncertain(Cause::Stated));
    bench.ask(Mode::Rtu, &only_first, false).await;
    let now = bench.ask(Mode::Rtu, &only_first, false).await;
    assert_eq!((now.sample(first).good_value(), now.decimals[0]), (Some(1.0), 1));
    assert!(now.alarms.is_empty(), "{:?}", now.alarms);
    // ... which is no number of decimals: what the device says counts, then and after it was heard last.
    bench.ask(Mode::Rtu, &READ, false).await;
    let now = bench.ask(Mode::Rtu, &READ, false).await;
    assert_eq!(now.sample(second).good_value(), Some(11.0));
    assert_eq!(now.sample(first).quality, Quality::Bad(Cause::Unscaled));
    assert_eq!(now.alarms.len(), 1);
    for _ in 0..30 {
        bench.ask(Mode::Rtu, &only_first, false).await;
    }
    let now = bench.ask(Mode::Rtu, &only_first, false).await;
    assert_eq!(now.sample(second).quality, Quality::Bad(Cause::NotHeard), "what is stated is known to be wrong");
    assert_eq!(now.sample(first).quality, Quality::Bad(Cause::Unscaled));
    assert_eq!(now.alarms.len(), 1, "it stands until the device agrees");
}

#[tokio::test(start_paused = true)]
async fn what_is_no_answer_of_the_device_changes_no_value() {
    let mut bench = Bench::new(Mode::Rtu);
    for _ in 0..3 {
        bench.ask(Mode::Rtu, &READ, false).await;
    }
    let framed = |message: &[u8]| frame::wrap(Mode::Rtu.framing(), 0, message);
    // A strange unit, half frames, and an unsolicited response.
    bench.ask(Mode::Rtu, &[9, 3, 0, 10, 0, 4], false).await;
    for bytes in [&framed(&READ)[..5], &framed(&correct(&READ))[..9], &framed(&[1, 3, 8, 9, 9, 9, 9, 9, 9, 9, 9])] {
        bench.port.write_all(bytes).await.expect("the port is open");
        let now = bench.pass(1).await;
        assert!(matches!(now.sample(FIRST).value, Some(10.0)), "{:?}", now.sample(FIRST));
        bench.ask(Mode::Rtu, &READ, false).await;
    }
    while !bench.ask(Mode::Rtu, &READ, false).await.sample(FIRST).quality.is_good() {}
    // An exception says that there is no value.
    bench.port.write_all(&framed(&READ)).await.expect("the port is open");
    sleep(20 * MS).await;
    bench.port.write_all(&framed(&[1, 0x83, 2])).await.expect("the port is open");
    assert_eq!(bench.pass(1).await.sample(FIRST).quality, Quality::Bad(Cause::Exception));
    assert!(bench.ask(Mode::Rtu, &READ, false).await.sample(FIRST).quality.is_good());
}

#[tokio::test(start_paused = true)]
async fn a_broadcast_write_leaves_no_old_value_good() {
    let mut bench = Bench::new(Mode::Rtu);
    for _ in 0..3 {
        bench.ask(Mode::Rtu, &READ, false).await;
    }
    let now = bench.ask(Mode::Rtu, &[0, 6, 0, 10, 0, 99], true).await;
    assert_eq!(now.sample(FIRST).quality, Quality::Uncertain(Cause::NotReadBack));
    assert!(now.sample(TagId(1)).quality.is_good(), "it was not written");
    assert!(bench.ask(Mode::Rtu, &READ, false).await.sample(FIRST).quality.is_good());
}
