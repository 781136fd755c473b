//! The task of a line on which another master polls: it hears, sends events to the plant, and has no way to send a byte.

use std::{convert::Infallible, sync::Arc, time::Duration};

use jiff::Timestamp;
use tokio::sync::{mpsc, watch};

use super::{
    clock::Clock,
    hearing::Hearing,
    live_reads::LiveReads,
    requests::{Interrupt, Requests},
    tap::Tap,
    transport::Connector,
};
use crate::{
    bus::{
        backoff::Backoff,
        line_stats::{LineStats, Plan},
        listen::{self, Ended, Heard, Losses, Role, Traffic},
        schedule::Load,
    },
    plant::{
        PlantDef,
        command::BusRequest,
        def::{DeviceDef, LineDef, LineId},
        event::{Event, WriteResult},
        fault::Fault,
        line_state::{LineCounters, LineState},
        line_trouble::LineTrouble,
        time::elapsed,
        traffic::Frame,
    },
};

/// A line report is sent this often, in plant time.
const REPORT_EVERY: Duration = Duration::from_secs(1);

// Everything that a line is made of, each once.
#[allow(clippy::too_many_arguments)]
/// Hears a line until `stop` turns true or the request channel closes.
pub async fn run(
    def: Arc<PlantDef>,
    line: LineId,
    clock: Clock,
    connector: &mut Connector,
    events: mpsc::Sender<Event>,
    requests: &mut Requests,
    live: &mut LiveReads,
    stop: watch::Receiver<bool>,
) {
    let task = Task {
        stats: LineStats::new(&def, line, &[]),
        losses: Losses::new(&def),
        counters: LineCounters::default(),
        frames: Vec::new(),
        bytes: 0,
        closed_at: clock.now(),
        line,
        clock,
        connector,
        events,
        requests,
        live,
        stop,
        def,
    };
    // It returns only when the station ends, and then no receiver is left.
    let _ = task.connect_loop().await;
}

/// Why a port is left.
enum Exit {
    Closed,
    Failed(LineTrouble),
    Shutdown,
}

impl From<Interrupt> for Exit {
    /// One that only listens is started again under another definition.
    fn from(_: Interrupt) -> Exit {
        Exit::Shutdown
    }
}

struct Task<'a> {
    def: Arc<PlantDef>,
    line: LineId,
    clock: Clock,
    connector: &'a mut Connector,
    events: mpsc::Sender<Event>,
    requests: &'a mut Requests,
    live: &'a mut LiveReads,
    stop: watch::Receiver<bool>,
    stats: LineStats,
    losses: Losses,
    counters: LineCounters,
    /// What was heard since the last report, in frames and in bytes.
    frames: Vec<Frame>,
    bytes: u32,
    /// When the last report was made.
    closed_at: Timestamp,
}

impl Task<'_> {
    fn settings(&self) -> &LineDef {
        self.def.line(self.line)
    }

    /// Opens, listens and waits until the station ends.
    async fn connect_loop(mut self) -> Result<(), Exit> {
        let mut backoff = Backoff::for_ports();
        loop {
            self.publish_state(LineState::Connecting).await?;
            let exit = match self.open().await {
                Ok(tap) => {
                    self.counters.opens += 1;
                    self.publish_state(LineState::Connected).await?;
                    let settings = self.settings();
                    tracing::info!(line = settings.name, transport = %settings.transport, "listening");
                    let heard = self.counters.frames;
                    let hearing = Hearing::new(tap, settings, self.clock);
                    let Err(exit) = self.listen(hearing).await;
                    if heard < self.counters.frames {
                        backoff.reset();
                    }
                    self.stats.rest(&mut self.counters);
                    exit
                }
                Err(exit) => exit,
            };
            match exit {
                Exit::Shutdown => return Err(exit),
                Exit::Closed => {
                    self.publish_state(LineState::Disconnected).await?;
                    self.publish_report().await?;
                    self.wait(None).await?;
                }
                Exit::Failed(why) => {
                    tracing::warn!(line = self.settings().name, %why, "not connected");
                    let retry_at = self.clock.now() + backoff.fail();
                    self.publish_state(LineState::Waiting { why, retry_at }).await?;
                    self.publish_report().await?;
                    self.wait(Some(retry_at)).await?;
                }
            }
        }
    }

    /// Opens the port, unless the station ends or an operator closes the line meanwhile.
    async fn open(&mut self) -> Result<Tap, Exit> {
        let connector = &mut *self.connector;
        let open = async {
            match connector {
                Connector::Real(transport) => Tap::open(transport, false).await,
                Connector::Memory(_) => connector.open().await.map(Tap::of),
            }
        };
        tokio::select! {
            biased;
            _ = self.stop.wait_for(|stop| *stop) => Err(Exit::Shutdown),
            opened = open => opened.map_err(Exit::Failed),
            // The plant has no other settings for a line that only listens.
            request = self.requests.recv_end_of_opening() => Err(request.map_or(Exit::Shutdown, |_| Exit::Closed)),
        }
    }

    /// Hears an open port until it is left.
    async fn listen(&mut self, mut hearing: Hearing) -> Result<Infallible, Exit> {
        self.closed_at = self.clock.now();
        let mut traffic = Traffic::new(listen::silent_after(&self.def, self.line), self.closed_at);
        self.publish_report().await?;
        loop {
            let report_at = self.closed_at + REPORT_EVERY;
            let came = tokio::select! {
                biased;
                _ = self.stop.wait_for(|stop| *stop) => return Err(Exit::Shutdown),
                request = self.requests.recv() => Err(request?),
                heard = hearing.next() => Ok(heard.map_err(Exit::Failed)?),
                () = self.clock.sleep_until(report_at) => Ok(Vec::new()),
            };
            let heard = match came {
                Ok(heard) => heard,
                Err(request) => self.serve_request(request, true).await.map(|_| Vec::new())?,
            };
            let now = self.clock.now();
            if heard.iter().any(is_frame) && traffic.hear(now) {
                self.publish_state(LineState::Connected).await?;
            }
            for heard in heard {
                self.on_heard(heard, now).await?;
            }
            if traffic.falls_silent(now) {
                self.losses = Losses::new(&self.def);
                self.publish_state(LineState::NoTraffic).await?;
            }
            if report_at <= now {
                self.counters.uart = hearing.tap().uart();
                self.publish_report().await?;
            }
        }
    }

    async fn on_heard(&mut self, heard: Heard, now: Timestamp) -> Result<(), Exit> {
        self.count(&heard);
        for event in listen::events(&self.def, self.line, now, &heard) {
            let given_up = self.losses.observe(&self.def, &event);
            self.publish(event).await?;
            if let Some(event) = given_up {
                self.publish(event).await?;
            }
        }
        if let Heard::Frame(heard) = heard {
            self.frames.push(heard.frame);
        }
        Ok(())
    }

    /// Counts what was heard, for the line and for the devices of its unit.
    fn count(&mut self, heard: &Heard) {
        if let Heard::Frame(heard) = heard {
            self.counters.frames += 1;
            self.counters.received_bytes += heard.frame.bytes.len() as u64;
            self.bytes = self.bytes.saturating_add(u32::try_from(heard.frame.bytes.len()).unwrap_or(u32::MAX));
            self.counters.last_rx = Some(heard.frame.at);
            match (&heard.role, heard.frame.unit) {
                (Role::Request, _) => self.counters.requests += 1,
                (Role::Response { .. }, _) => {}
                (Role::Unmatched, unit) => {
                    self.counters.unexpected += 1;
                    self.counters.late += 1;
                    self.stats.late(&self.def, unit.as_slice());
                }
                (Role::Noise, _) => self.counters.unexpected += 1,
            }
        }
        let Heard::Ended(Ended { request, outcome, time, .. }) = heard else { return };
        match outcome {
            Ok(()) | Err(Fault::Unproven) => self.counters.ok += 1,
            Err(Fault::Exception(_)) => self.counters.exceptions += 1,
            Err(Fault::Timeout | Fault::NotHeard) => self.counters.timeouts += 1,
            Err(_) => self.counters.corrupt += 1,
        }
        let is_it = |device: &&DeviceDef| device.line == self.line && Some(&device.unit) == request.first();
        for device in self.def.devices.iter().filter(is_it) {
            self.stats.asked(device.id, *outcome, *time);
        }
    }

    /// Waits without a port until a moment, or until an operator opens the line.
    async fn wait(&mut self, mut until: Option<Timestamp>) -> Result<(), Exit> {
        loop {
            let clock = self.clock;
            let request = tokio::select! {
                biased;
                _ = self.stop.wait_for(|stop| *stop) => return Err(Exit::Shutdown),
                request = self.requests.recv() => request?,
                () = clock.sleep_until_if_any(until) => return Ok(()),
            };
            match self.serve_request(request, false).await {
                Ok(true) => return Ok(()),
                Ok(false) => {}
                Err(Exit::Closed) => {
                    until = None;
                    self.publish_state(LineState::Disconnected).await?;
                }
                Err(exit) => return Err(exit),
            }
        }
    }

    /// The plant refuses what would send something; the port alone is closed and opened. `true`: it is to be opened.
    async fn serve_request(&mut self, request: BusRequest, open: bool) -> Result<bool, Exit> {
        match request {
            BusRequest::Connect(false) => return Err(Exit::Closed),
            BusRequest::Connect(true) => return Ok(!open),
            BusRequest::Write(job) => {
                self.requests.ended(job.id);
                let (at, result) = (self.clock.now(), WriteResult::NotSent(Fault::NotConnected));
                self.publish(Event::Wrote { at, id: job.id, result }).await?;
            }
            BusRequest::Refresh { .. } | BusRequest::Configure(_) | BusRequest::Test { .. } | BusRequest::StopTest => {}
        }
        Ok(false)
    }

    /// Sends the statistics up to now.
    async fn publish_report(&mut self) -> Result<(), Exit> {
        let now = self.clock.now();
        let over = elapsed(self.closed_at, now);
        self.closed_at = now;
        self.live.drop_all();
        let bytes = std::mem::take(&mut self.bytes);
        let busy = self.settings().transport.serial().map(|serial| serial.char_time() * bytes).unwrap_or_default();
        if !over.is_zero() {
            self.stats.spent(busy.as_secs_f32() / self.clock.real_span(over).as_secs_f32().max(1e-6), over);
        }
        self.stats.add_frames(std::mem::take(&mut self.frames), &mut self.counters);
        let plan = Plan {
            blocks: &[],
            polls: Vec::new(),
            refused: Vec::new(),
            retries: Vec::new(),
            load: Load::Normal,
            other_master: None,
            findings: Vec::new(),
        };
        let report = self.stats.report(&self.def, self.settings(), plan, self.counters);
        self.publish(Event::Report { at: now, line: self.line, report }).await
    }

    async fn publish_state(&mut self, state: LineState) -> Result<(), Exit> {
        self.publish(Event::Line { at: self.clock.now(), line: self.line, state }).await
    }

    async fn publish(&mut self, event: Event) -> Result<(), Exit> {
        self.events.send(event).await.map_err(|_| Exit::Shutdown)
    }
}

fn is_frame(heard: &Heard) -> bool {
    matches!(heard, Heard::Frame(heard) if heard.role != Role::Noise)
}
