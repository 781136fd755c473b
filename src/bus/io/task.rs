//! The task of one line: opens the port, keeps the schedule, serves operators and diagnostics, and sends events to the plant.

mod concurrent;
mod connection;
mod deferred_read_back;
mod exit;
mod hangups;
mod identify;
mod live;
mod opening;
mod poll;
mod read;
mod read_alone;
mod read_before;
mod read_modify_write;
mod recheck;
mod redefine;
mod test;
mod wait;
mod write;

use std::{collections::BTreeMap, convert::Infallible, sync::Arc, time::Duration};

use exit::LinkExit;
use jiff::Timestamp;
use recheck::Recheck;
use tokio::sync::{mpsc, watch};

use super::{
    clock::Clock,
    link::Link,
    live_reads::LiveReads,
    memory::LineMemory,
    requests::{Interrupt, Requests},
    transport::Connector,
};
use crate::{
    bus::{
        backoff::Backoff,
        diagnostics::Job,
        hangup::Hangups,
        identification::Identification,
        in_flight::InFlight,
        line_stats::{LineStats, Plan},
        plan::{self, Block, RangeBisection, UnreadableRanges},
        schedule::{Budget, LIVE_SHARE, Load, Next, Schedule, WRITE_SHARE},
        wide_addresses::WideAddresses,
    },
    plant::{
        PlantDef,
        command::{BusRequest, WriteId},
        def::{DeviceId, LineDef, LineId, TagId},
        event::{Event, WriteResult},
        fault::Fault,
        line_finding::DeviceFinding,
        line_state::LineState,
        time::elapsed,
        traffic::Exchange,
    },
};

/// A line report is sent this often, in plant time.
const REPORT_EVERY: Duration = Duration::from_secs(1);

// Everything that a line is made of, each once.
#[allow(clippy::too_many_arguments)]
/// Runs a line until `stop` turns true or the request channel closes.
pub async fn run(
    def: Arc<PlantDef>,
    line: LineId,
    clock: Clock,
    connector: &mut Connector,
    events: mpsc::Sender<Event>,
    requests: &mut Requests,
    live: &mut LiveReads,
    stop: watch::Receiver<bool>,
    found: &[(DeviceId, DeviceFinding)],
) {
    let mut unreadable = UnreadableRanges::default();
    let mut in_flight = InFlight::default();
    let mut memory = LineMemory::new(def.line(line), clock);
    let own = || found.iter().map(|(id, found)| (def.device(*id), *found)).filter(|(device, _)| device.line == line);
    for (device, found) in own() {
        unreadable.recall(device.unit, found);
        in_flight.recall(device.unit, found);
        memory.request_gaps.recall(device.unit, found);
    }
    let blocks = plan::blocks(&def, line, &unreadable);
    let task = Task {
        stats: LineStats::new(&def, line, &blocks),
        unreadable,
        bisection: RangeBisection::default(),
        requested: Vec::new(),
        budget: Budget::new(WRITE_SHARE, clock.now()),
        live_budget: Budget::new(LIVE_SHARE, clock.now()),
        unconfirmed: Vec::new(),
        under_way: Vec::new(),
        cut: Vec::new(),
        hangups: Hangups::default(),
        in_flight,
        identification: Identification::new(&def, line),
        recheck: Recheck::new(own().map(|(device, _)| device.id).collect(), clock.now()),
        unheard: 0,
        opened_at: clock.now(),
        heard: false,
        timeouts_before: 0,
        deaf: None,
        refused_all: BTreeMap::new(),
        schedule: Schedule::new(&blocks, clock.now()),
        memory: memory.expect(&blocks, WideAddresses::of(&def, line)),
        settings: def.line(line).clone(),
        clock,
        connector,
        events,
        requests,
        live,
        stop,
        blocks,
        closed_at: clock.now(),
        job: None,
        polls_since_step: 0,
        stepped: false,
        line,
        def,
    };
    // It returns only when the station ends, and then no receiver is left.
    let _ = task.connect_loop().await;
}

struct Task<'a> {
    def: Arc<PlantDef>,
    line: LineId,
    /// Those of the plant file until an operator tries others.
    settings: LineDef,
    clock: Clock,
    connector: &'a mut Connector,
    events: mpsc::Sender<Event>,
    requests: &'a mut Requests,
    live: &'a mut LiveReads,
    stop: watch::Receiver<bool>,
    /// The read plan; a block that is refused is split while the search for the culprit goes on.
    blocks: Vec<Block>,
    /// What the devices do not have, as far as found.
    unreadable: UnreadableRanges,
    bisection: RangeBisection,
    /// Devices of which an operator has asked for everything: what is never polled is in the plan, and read on request.
    requested: Vec<DeviceId>,
    /// The share of the line's time that writes may take from polls.
    budget: Budget,
    /// The same of live reads.
    live_budget: Budget,
    /// Counters and outstanding replies, from one opening to the next.
    memory: LineMemory,
    /// Writes whose result is not known yet.
    unconfirmed: Vec<deferred_read_back::Unconfirmed>,
    /// Reads that are under way over Modbus TCP, no more than a device takes at once.
    under_way: Vec<concurrent::UnderWay>,
    /// What was under way otherwise when the connection went away.
    cut: Vec<Block>,
    /// How connections over a network have ended.
    hangups: Hangups,
    /// How many requests the units take at once, as found.
    in_flight: InFlight,
    /// When what was found of devices is tried again.
    recheck: Recheck,
    /// Which devices are asked what they are.
    identification: Identification,
    /// Connections in a row that were given up because nothing was ever answered.
    unheard: u32,
    /// When the present connection was opened, and whether something was answered on it.
    opened_at: Timestamp,
    heard: bool,
    timeouts_before: u64,
    /// How long the last connections were deaf after they were opened, in a row.
    deaf: Option<(Duration, u32)>,
    /// Units that refuse everything, and until when they are left alone with what they have refused.
    refused_all: BTreeMap<u8, (Backoff, Timestamp)>,
    /// Whose turn it is; what is known of blocks and devices outlives an opening.
    schedule: Schedule,
    /// When the counters of the link were last added to the statistics.
    closed_at: Timestamp,
    stats: LineStats,
    /// The running diagnostic.
    job: Option<Job>,
    polls_since_step: u32,
    /// The last step beside polls was one of the diagnostic.
    stepped: bool,
}

impl Task<'_> {
    /// Operators first, then the schedule and the running diagnostic, else it waits.
    async fn serve_loop(&mut self, link: &mut Link, schedule: &mut Schedule) -> Result<Infallible, LinkExit> {
        let mut report_at = self.clock.now() + REPORT_EVERY;
        // Other settings show at once.
        self.publish_report(Some(schedule)).await?;
        loop {
            if *self.stop.borrow() {
                return Err(LinkExit::Shutdown);
            }
            // Before the second is closed: the schedule, too, learns of answers that came late.
            self.receive_replies(link, schedule).await?;
            self.check_connection(link)?;
            self.check_used_up(link)?;
            self.check_deafness(link);
            let now = self.clock.now();
            if report_at <= now {
                report_at = now + REPORT_EVERY;
                link.look_at_port();
                self.collect_stats(link);
                self.publish_report(Some(schedule)).await?;
            }
            self.publish_unsolicited(link).await?;
            let next = self.suspect_first(link).unwrap_or_else(|| schedule.next(now));
            // Writes have only their share of the time while polls are due.
            let may_write = !matches!(next, Next::Run(_)) || self.budget.allows(now);
            match (self.requests.next(may_write)?, next) {
                (Some(request), _) => self.serve_request(link, schedule, request).await?,
                (None, _) if self.is_turn_of_deferred_read_back(now) => self.deferred_read_back(link, schedule).await?,
                (None, _) if self.recheck.is_due(now) => self.recheck(link, schedule).await?,
                (None, next) if self.is_turn_of_identification(next) => self.identify(link, schedule).await?,
                (None, next) if self.is_turn_of_diagnostic(next) => self.diagnostic_step(link).await?,
                (None, next) if self.is_turn_of_live_read(next) => self.live_step(link).await?,
                (None, Next::Run(index)) => self.poll(link, schedule, index).await?,
                (None, Next::WaitUntil(at)) => self.listen(link, schedule, at.min(report_at)).await?,
                (None, Next::Idle) => self.listen(link, schedule, report_at).await?,
            }
        }
    }

    /// The port is left: what still waits was never sent.
    async fn refuse_waiting(&mut self) -> Result<(), LinkExit> {
        for id in self.requests.take_waiting() {
            self.publish_write_result(id, WriteResult::NotSent(Fault::NotConnected)).await?;
        }
        Ok(())
    }

    /// Nothing is due: drops unsolicited bytes until something is.
    async fn listen(&mut self, link: &mut Link, schedule: &mut Schedule, until: Timestamp) -> Result<(), LinkExit> {
        let (clock, live_from) = (self.clock, self.live_from());
        let others = [self.diagnostic_from(), self.identification_from()];
        let until = others.into_iter().flatten().fold(until, Timestamp::min);
        let live = async {
            clock.sleep_until(live_from).await;
            self.live.due(clock).await;
        };
        let request = tokio::select! {
            // What comes at one moment is taken in this order, so that two runs of a drill give the same result.
            biased;
            _ = self.stop.wait_for(|stop| *stop) => return Err(LinkExit::Shutdown),
            request = self.requests.recv() => request?,
            () = live => return Ok(()),
            ended = link.listen() => return ended.map_err(LinkExit::from),
            () = self.clock.sleep_until(until) => {
                self.stats.dispatched(elapsed(until, self.clock.now()));
                return Ok(());
            }
        };
        self.serve_request(link, schedule, request).await
    }

    async fn serve_request(
        &mut self,
        link: &mut Link,
        schedule: &mut Schedule,
        request: BusRequest,
    ) -> Result<(), LinkExit> {
        match request {
            BusRequest::Connect(true) => Ok(()),
            BusRequest::Connect(false) => Err(LinkExit::Closed),
            BusRequest::Refresh { device, command } => {
                let is_new = command.is_some() && !self.requested.contains(&device);
                if is_new && plan::has_unpolled(&self.def, device) {
                    self.requested.push(device);
                    self.plan_again(link, schedule, self.clock.now());
                }
                link.retry(self.def.device(device).unit);
                schedule.refresh(device, self.clock.now());
                Ok(())
            }
            BusRequest::Configure(settings) => {
                self.configure(*settings);
                Err(LinkExit::Reopen)
            }
            BusRequest::Test { id, by, diagnostic } => {
                self.stop_diagnostic().await?;
                let job = self.job.insert(Job::new(id, by, diagnostic, self.clock.now()));
                if job.is_exclusive() {
                    return Err(LinkExit::Diagnostic);
                }
                self.publish_diagnostic().await
            }
            BusRequest::StopTest => self.stop_diagnostic().await,
            BusRequest::Write(job) => {
                // What was requested before a stop and still waits for this tag would undo it.
                let overtaken = if job.urgent { self.requests.take_writes_of(job.tag) } else { Vec::new() };
                for id in overtaken {
                    self.publish_write_result(id, WriteResult::Superseded).await?;
                }
                let def = self.def.clone();
                match self.wait_until_idle(link, schedule, def.tag(job.tag).device, job.urgent).await {
                    Ok(true) => {}
                    Ok(false) => {
                        self.requests.defer(BusRequest::Write(job));
                        return Ok(());
                    }
                    Err(exit) => {
                        self.publish_write_result(job.id, WriteResult::NotSent(Fault::NotConnected)).await?;
                        return Err(exit);
                    }
                }
                let started = self.clock.now();
                let turn = self.write(link, schedule, &job).await;
                let now = self.clock.now();
                self.budget.spent(elapsed(started, now), now);
                turn
            }
        }
    }

    /// Other settings, for as long as the station runs or until they are taken back.
    fn configure(&mut self, settings: LineDef) {
        tracing::info!(line = settings.name, transport = %settings.transport, "other settings");
        self.stats.forget_times();
        self.stats.admit(&self.def, &settings, &self.blocks);
        self.connector.retarget(&settings.transport);
        self.settings = settings;
    }

    /// Adds what the link has counted since the last call to the statistics.
    fn collect_stats(&mut self, link: &mut Link) {
        let now = self.clock.now();
        let over = elapsed(self.closed_at, now);
        let busy = link.take_busy().as_secs_f32();
        self.stats.spent(busy / self.clock.real_span(over).as_secs_f32().max(1e-6), over);
        self.stats.late(&self.def, &link.take_late());
        self.stats.add_frames(link.take_frames(), link.counters());
        self.stats.admit_as_seen(&self.def, &self.settings, &self.blocks);
        (self.memory, self.closed_at) = (link.memory(), now);
    }

    /// What was read of a unit that sends what it was not asked for may be such a frame itself.
    async fn publish_unsolicited(&mut self, link: &mut Link) -> Result<(), LinkExit> {
        let (def, line) = (self.def.clone(), self.line);
        for unit in link.take_unsolicited() {
            for device in def.devices.iter().filter(|device| device.line == line && device.unit == unit) {
                tracing::warn!(device = device.name, "unsolicited frames: its values are uncertain");
                let tags = def.tags_of(device.id).map(|tag| tag.id).collect();
                self.publish_failure(self.clock.now(), device.id, tags, Fault::OutOfSync, None).await?;
            }
        }
        Ok(())
    }

    async fn publish_report(&mut self, schedule: Option<&Schedule>) -> Result<(), LinkExit> {
        let mut polls: Vec<_> = schedule.map(|schedule| schedule.polls().collect()).unwrap_or_default();
        polls.iter_mut().for_each(|poll| poll.next = poll.next.map(|at| self.clock.to_utc(at)));
        let plan = Plan {
            blocks: &self.blocks,
            polls,
            refused: plan::refused(&self.def, self.line, &self.unreadable),
            retries: schedule.map(Schedule::retries).unwrap_or_default(),
            load: schedule.map_or(Load::Normal, Schedule::load),
            other_master: self.memory.other_master(),
            findings: self.findings(),
        };
        let report = self.stats.report(&self.def, &self.settings, plan, self.memory.counters);
        self.publish(Event::Report { at: self.clock.now(), line: self.line, report }).await
    }

    async fn publish_state(&mut self, state: LineState) -> Result<(), LinkExit> {
        self.publish(Event::Line { at: self.clock.now(), line: self.line, state }).await
    }

    async fn publish_failure(
        &mut self,
        at: Timestamp,
        device: DeviceId,
        tags: Vec<TagId>,
        fault: Fault,
        exchange: Option<Arc<Exchange>>,
    ) -> Result<(), LinkExit> {
        if fault == Fault::BackedOff {
            self.identification.lost(device);
        }
        self.publish(Event::Failed { at, device, tags, fault, exchange }).await
    }

    async fn publish_write_result(&mut self, id: WriteId, result: WriteResult) -> Result<(), LinkExit> {
        self.requests.ended(id);
        self.publish(Event::Wrote { at: self.clock.now(), id, result }).await
    }

    async fn publish(&mut self, event: Event) -> Result<(), LinkExit> {
        self.events.send(event).await.map_err(|_| LinkExit::Shutdown)
    }
}
