//! A line that goes on under another definition: its connection stays, and of its devices those that are as they were.

use std::collections::BTreeSet;

use tokio::sync::{mpsc, oneshot};

use super::{slave::Line, *};
use crate::{
    bus::io::redefine::{LineDefinition, Redefine},
    plant::{PlantDef, def::LineId},
};

/// The line at place 1 instead of 0, behind one that has nothing, and without the first tag: every id is another.
fn shifted(def: &PlantDef) -> PlantDef {
    let mut def = def.clone();
    def.lines.insert(0, LineDef { name: "other".into(), ..def.lines[0].clone() });
    def.tags.remove(0);
    (0..).map(LineId).zip(&mut def.lines).for_each(|(id, line)| line.id = id);
    (0..).map(TagId).zip(&mut def.tags).for_each(|(id, tag)| tag.id = id);
    def.devices.iter_mut().for_each(|device| device.line = LineId(1));
    def
}

/// Lets the line pause, and go on under a definition; its requests are new ones.
pub async fn redefine(line: &mut Line, before: &PlantDef, def: &PlantDef, at: LineId) {
    let ((paused, mut pauses), (next, definition)) = (oneshot::channel(), oneshot::channel());
    line.redefines.send(Redefine { paused, next: definition }).await.expect("the line runs");
    while pauses.try_recv().is_err() {
        tokio::select! {
            biased;
            _ = line.next(before) => {}
            () = tokio::time::sleep(MS) => {}
        }
    }
    let ((requests, queue), (live, live_queue)) = (mpsc::channel(4), mpsc::channel(4));
    (line.requests, line.live) = (requests, live);
    while line.events.try_recv().is_ok() {}
    let next = next.send(LineDefinition { def: Arc::new(def.clone()), line: at, requests: queue, live: live_queue });
    assert!(next.is_ok(), "the line waits for it");
}

/// The addresses whose values come within this many seconds, by unit.
async fn read_within(line: &mut Line, def: &PlantDef, seconds: u64) -> BTreeSet<(u8, u16)> {
    let (mut read, until) = (BTreeSet::new(), tokio::time::Instant::now() + Duration::from_secs(seconds));
    while let Ok(event) = tokio::time::timeout_at(until, line.next(def)).await {
        match event {
            Event::Read { device, values, .. } => {
                let unit = def.device(device).unit;
                read.extend(values.iter().map(|(tag, _)| (unit, def.tag(*tag).point.address)));
            }
            Event::Line { state, .. } => panic!("the port was left: {state:?}"),
            _ => {}
        }
    }
    read
}

#[tokio::test(start_paused = true)]
async fn other_ids_close_no_port_and_read_nothing_again() {
    for mode in Mode::ALL {
        let (def, other) = (plant(mode), shifted(&plant(mode)));
        let mut line = line(def.clone());
        line.plug(mode, |_, _| SlaveAction::Answer);
        line.until(&def, |event| matches!(event, Event::Line { state: LineState::Connected, .. }).then_some(())).await;
        let first = read_within(&mut line, &def, 10).await;
        assert!(first.contains(&(1, 600)) && first.contains(&(2, 600)), "{mode:?}");
        redefine(&mut line, &def, &other, LineId(1)).await;
        let later = read_within(&mut line, &other, 10).await;
        let asked: BTreeSet<(u8, u16)> = first.into_iter().filter(|(_, address)| *address != 600).collect();
        let missing = BTreeSet::from([(1, 10)]);
        assert_eq!(
            later,
            asked.difference(&missing).copied().collect(),
            "{mode:?}: what is read once is not read again"
        );
    }
}

#[tokio::test(start_paused = true)]
async fn a_new_tag_and_a_changed_device_are_read_at_once() {
    for mode in Mode::ALL {
        let def = plant(mode);
        let mut other = def.clone();
        // Both are read once; the second unit has another gap.
        let tag = TagDef { id: TagId(20), name: "U1.601".into(), ..def.tags[9].clone() };
        other.tags.push(TagDef { point: crate::plant::tag::Point { address: 601, ..tag.point }, ..tag });
        other.devices[1].gap = 5 * MS;
        let mut line = line(def.clone());
        line.plug(mode, |_, _| SlaveAction::Answer);
        line.until(&def, |event| matches!(event, Event::Line { state: LineState::Connected, .. }).then_some(())).await;
        read_within(&mut line, &def, 10).await;
        redefine(&mut line, &def, &other, LineId(0)).await;
        let later = read_within(&mut line, &other, 10).await;
        assert!(later.contains(&(1, 601)) && later.contains(&(2, 600)), "{mode:?}: {later:?}");
    }
}

#[tokio::test(start_paused = true)]
async fn a_silent_device_stays_given_up_under_another_definition() {
    for mode in Mode::ALL {
        let def = plant(mode);
        let mut other = def.clone();
        other.devices[0].gap = 5 * MS;
        let asked = Arc::new(AtomicUsize::new(0));
        let count = asked.clone();
        let mut line = line(def.clone());
        line.plug(mode, move |_, message| {
            if message[0] != 2 {
                return SlaveAction::Answer;
            }
            count.fetch_add(1, Ordering::Relaxed);
            SlaveAction::Silent
        });
        let down = |event: &Event| {
            matches!(event, Event::Failed { device: DeviceId(1), fault: Fault::BackedOff, .. }).then_some(())
        };
        line.until(&def, down).await;
        read_within(&mut line, &def, 60).await;
        let before = asked.load(Ordering::Relaxed);
        redefine(&mut line, &def, &other, LineId(0)).await;
        let given_up = line.until(&other, |event| match event {
            Event::Failed { device: DeviceId(1), fault: Fault::BackedOff, .. } => Some(true),
            Event::Read { at, .. } => (Timestamp::from_second(90).expect("a small number") <= *at).then_some(false),
            _ => None,
        });
        assert!(!given_up.await, "{mode:?}: it was given up long ago");
        let asked = asked.load(Ordering::Relaxed) - before;
        assert!(asked <= 12, "{mode:?}: {asked} requests to a device that is known not to answer");
    }
}

#[tokio::test(start_paused = true)]
async fn a_reload_that_is_given_up_leaves_a_line_as_it_is() {
    let def = plant(Mode::Rtu);
    let mut line = line(def.clone());
    line.plug(Mode::Rtu, |_, _| SlaveAction::Answer);
    line.until(&def, |event| matches!(event, Event::Line { state: LineState::Connected, .. }).then_some(())).await;
    let ((paused, _pauses), (next, definition)) = (oneshot::channel(), oneshot::channel());
    line.redefines.send(Redefine { paused, next: definition }).await.expect("the line runs");
    drop(next);
    assert_eq!(read_within(&mut line, &def, 10).await.len(), 20);
}

#[tokio::test(start_paused = true)]
async fn a_line_that_is_closed_stays_closed_under_another_definition() {
    let def = plant(Mode::Rtu);
    let mut line = line(def.clone());
    line.plug(Mode::Rtu, |_, _| SlaveAction::Answer);
    line.read(&def).await;
    line.requests.send(BusRequest::Connect(false)).await.expect("the line runs");
    line.until(&def, |event| matches!(event, Event::Line { state: LineState::Disconnected, .. }).then_some(())).await;
    let other = shifted(&def);
    redefine(&mut line, &def, &other, LineId(1)).await;
    line.plug(Mode::Rtu, |_, _| SlaveAction::Answer);
    let quiet = tokio::time::timeout(Duration::from_secs(60), line.next(&other)).await;
    assert!(quiet.is_err(), "{quiet:?}");
    line.requests.send(BusRequest::Connect(true)).await.expect("the line takes requests under its new ids");
    line.read(&other).await;
}
