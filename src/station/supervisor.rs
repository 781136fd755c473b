//! Keeps the task of a line running: one that panics is started again, and its operators see why.

use std::{panic::AssertUnwindSafe, sync::Arc, time::Duration};

use futures_util::FutureExt;
use tokio::{
    sync::{mpsc, watch},
    time::Instant,
};

use crate::{
    bus::{
        backoff::Backoff,
        io::{
            clock::Clock,
            listening,
            live_reads::{LiveReads, LiveRequest},
            requests::Requests,
            task,
            transport::Connector,
        },
    },
    plant::{
        PlantDef,
        def::{DeviceId, LineId},
        event::{Event, WriteResult},
        fault::Fault,
        line_finding::DeviceFinding,
        line_state::LineState,
        line_trouble::LineTrouble,
        station_fault::{FaultState, StationFault},
    },
};

/// A task that has run for so long (real time) is started again after the shortest delay.
const STEADY: Duration = Duration::from_secs(60);

// Everything that a line is made of, each once.
#[allow(clippy::too_many_arguments)]
/// Runs a line until the station stops. Requests wait in their queue while it is down: it is up again within seconds.
pub(super) async fn run(
    mut def: Arc<PlantDef>,
    mut line: LineId,
    clock: Clock,
    mut connector: Connector,
    events: mpsc::Sender<Event>,
    mut requests: Requests,
    live: mpsc::Receiver<LiveRequest>,
    mut stopped: watch::Receiver<bool>,
    found: Vec<(DeviceId, DeviceFinding)>,
) {
    let (mut backoff, mut live) = (Backoff::for_ports(), LiveReads::new(live));
    loop {
        let started = Instant::now();
        let stop = stopped.clone();
        let (plant, connector, requests, live) = (def.clone(), &mut connector, &mut requests, &mut live);
        let link = match def.line(line).listens {
            false => {
                task::run(plant, line, clock, connector, events.clone(), requests, live, stop, &found).left_future()
            }
            true => listening::run(plant, line, clock, connector, events.clone(), requests, live, stop).right_future(),
        };
        // Nothing outlives the panic but the port's description and the requests, which it cannot leave half changed.
        if AssertUnwindSafe(link).catch_unwind().await.is_ok() || *stopped.borrow() {
            return;
        }
        if STEADY < started.elapsed() {
            backoff.reset();
        }
        (def, line) = requests.take_definition().unwrap_or((def, line));
        let retry_at = clock.now() + backoff.fail().mul_f64(clock.speed());
        tracing::error!(line = def.line(line).name, "a line task has panicked and is restarted");
        let state = LineState::Waiting { why: LineTrouble::Internal, retry_at };
        let words = format!("line {} was started again; see the log", def.line(line).name);
        let (fault, occurred) = (StationFault::LineTask, FaultState::Occurred(words.into()));
        // Without a plant task there is nothing to report to, and nothing to start again for.
        let at = clock.now();
        let states = [Event::Station { at, fault, state: occurred }, Event::Line { at, line, state }];
        // It cannot be known how far these writes had come.
        let lost = |id| Event::Wrote { at, id, result: WriteResult::NoValidResponse(Fault::NotConnected) };
        for event in requests.take_started().into_iter().map(lost).chain(states) {
            if events.send(event).await.is_err() {
                return;
            }
        }
        tokio::select! {
            _ = stopped.wait_for(|stop| *stop) => return,
            () = clock.sleep_until(retry_at) => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use jiff::Timestamp;

    use super::*;
    use crate::plant::{
        command::{BusRequest, WriteId, WriteJob},
        def::TagId,
        fixture,
    };

    #[tokio::test(start_paused = true)]
    async fn a_line_whose_task_panics_is_started_again_and_says_why() {
        let def = fixture::shared();
        let (sender, mut events) = mpsc::channel(64);
        let (requests, queue) = mpsc::channel(4);
        let (ports, streams) = mpsc::channel(4);
        let (_stop, stopped) = watch::channel(false);
        let clock = Clock::starting_at(Timestamp::UNIX_EPOCH, 1.0);
        tokio::spawn(run(
            def,
            LineId(0),
            clock,
            Connector::Memory(streams),
            sender,
            Requests::new(queue),
            mpsc::channel(1).1,
            stopped,
            Vec::new(),
        ));
        // A tag that this plant does not have: inside, ids are taken on trust.
        let tag = TagId(u16::MAX);
        let request = BusRequest::Write(WriteJob {
            id: WriteId(1),
            tag,
            raw: 0.0.into(),
            unlock: None,
            verify: true,
            urgent: false,
            over: None,
            unscaled_by: None,
        });
        for _ in 0..3 {
            let (ours, _theirs) = tokio::io::duplex(64);
            ports.try_send(ours).expect("room for a port");
            let (mut states, mut alarms, mut ended) = (Vec::new(), 0, Vec::new());
            while !states.iter().any(|state| matches!(state, LineState::Waiting { .. })) {
                let state = match events.recv().await.expect("the station has not ended") {
                    Event::Line { state, .. } => state,
                    Event::Station { fault: StationFault::LineTask, state: FaultState::Occurred(_), .. } => {
                        alarms += 1;
                        continue;
                    }
                    Event::Wrote { id, result, .. } => {
                        ended.push((id, result));
                        continue;
                    }
                    _ => continue,
                };
                if state == LineState::Connected {
                    requests.send(request.clone()).await.expect("the line takes requests");
                }
                states.push(state);
            }
            assert_eq!(alarms, 1);
            // What had been sent of it is not known.
            assert_eq!(ended, [(WriteId(1), WriteResult::NoValidResponse(Fault::NotConnected))]);
            let waits = |state: &LineState| matches!(state, LineState::Waiting { why: LineTrouble::Internal, .. });
            assert_eq!(states[..2], [LineState::Connecting, LineState::Connected]);
            assert!(states.last().is_some_and(waits), "{states:?}");
        }
    }
}
