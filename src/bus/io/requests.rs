//! The requests to one line: in which order they are served, and which writes among them have not ended.

use std::{collections::VecDeque, pin::pin, sync::Arc, time::Duration};

use tokio::{
    sync::mpsc::{self, error::TryRecvError},
    time::Instant,
};

use super::redefine::Redefine;
use crate::plant::{
    PlantDef,
    command::{BusRequest, WriteId, WriteJob},
    def::{LineId, TagId},
};

/// A stop waits no longer than this (real time) for what is on the wire: a device that answers at all has mostly answered by
/// then, and an answer that is just coming in would collide with the stop.
pub const STOP_WAIT: Duration = Duration::from_millis(500);
/// More requests that are served first than this stay in their queue, where the plant sees that it is full.
const PRIORITY_MAX: usize = 64;

/// The requests to one line. They outlive a task that panics.
#[derive(Debug)]
pub struct Requests {
    queue: mpsc::Receiver<BusRequest>,
    /// Served before all others: stops, then what is neither a write nor a refresh.
    priority: VecDeque<BusRequest>,
    /// Writes that wait for their share of the line's time, and one refresh for each device. The plant has no more than one
    /// write under way for a tag, and a stop beside it.
    waiting: VecDeque<BusRequest>,
    /// Writes that were handed out and have not ended.
    started: Vec<WriteId>,
    /// Other definitions of the line, and the one that it is to go on under next.
    redefines: mpsc::Receiver<Redefine>,
    redefine: Option<Redefine>,
    /// The last that it went on under.
    definition: Option<(Arc<PlantDef>, LineId)>,
}

/// Why no request comes.
#[derive(Debug)]
pub enum Interrupt {
    /// The station is ending.
    Closed,
    /// The line goes on under another definition, see [`Requests::take_redefine`].
    Redefined,
}

impl Requests {
    /// All of `queue`.
    pub fn new(queue: mpsc::Receiver<BusRequest>) -> Requests {
        Requests {
            queue,
            priority: VecDeque::new(),
            waiting: VecDeque::new(),
            started: Vec::new(),
            redefines: mpsc::channel(1).1,
            redefine: None,
            definition: None,
        }
    }

    /// The same, interrupted by other definitions of the line.
    pub fn redefined_by(self, redefines: mpsc::Receiver<Redefine>) -> Requests {
        Requests { redefines, ..self }
    }

    /// What the line is to go on under, once it has been interrupted for that.
    pub fn take_redefine(&mut self) -> Option<Redefine> {
        self.redefine.take()
    }

    /// Goes on with the requests of another definition; those of before mean other tags.
    pub fn go_on(&mut self, def: &Arc<PlantDef>, line: LineId, queue: mpsc::Receiver<BusRequest>) {
        self.queue = queue;
        self.priority.clear();
        self.waiting.clear();
        self.started.clear();
        self.definition = Some((def.clone(), line));
    }

    /// The definition that the line is to be started again under, if that is another one now.
    pub fn take_definition(&mut self) -> Option<(Arc<PlantDef>, LineId)> {
        self.definition.take()
    }

    /// The next request as they come; may be dropped before there is one.
    pub async fn recv(&mut self) -> Result<BusRequest, Interrupt> {
        self.check_redefine()?;
        let request = match self.priority.pop_front() {
            Some(first) => first,
            None => self.receive().await?,
        };
        Ok(self.mark_started(request))
    }

    /// The next request, if one has come.
    pub fn try_recv(&mut self) -> Result<Option<BusRequest>, Interrupt> {
        self.check_redefine()?;
        let request = match self.priority.pop_front() {
            Some(first) => Some(first),
            None => self.try_queue()?,
        };
        Ok(request.map(|request| self.mark_started(request)))
    }

    /// The request to serve now: a stop before all others, writes last and only if they `may_write`.
    pub fn next(&mut self, may_write: bool) -> Result<Option<BusRequest>, Interrupt> {
        self.check_redefine()?;
        self.receive_queued()?;
        let is_write = |request: &BusRequest| matches!(request, BusRequest::Write(_));
        let request = self.priority.pop_front().or_else(|| {
            let refresh = self.waiting.iter().position(|request| !is_write(request));
            self.waiting.remove(refresh.or(may_write.then_some(0))?)
        });
        Ok(request.map(|request| self.mark_started(request)))
    }

    /// Is a stop waiting?
    pub fn stop_waits(&mut self) -> bool {
        // That the station ends shows itself at the next request.
        let _ = self.receive_queued();
        self.has_stop()
    }

    /// Serves this before all others.
    pub fn requeue_first(&mut self, request: BusRequest) {
        self.unmark_started(&request);
        self.priority.push_front(request);
    }

    /// Serves a write or a refresh later. One refresh of a device is as good as two.
    pub fn defer(&mut self, request: BusRequest) {
        self.unmark_started(&request);
        let same = |other: &BusRequest| match (other, &request) {
            (BusRequest::Refresh { device, .. }, BusRequest::Refresh { device: wanted, .. }) => device == wanted,
            _ => false,
        };
        if !self.waiting.iter().any(same) {
            self.waiting.push_back(request);
        }
    }

    /// Waits for what is on the wire, but with a stop waiting no longer than [`STOP_WAIT`]: `None`, and the stop is next.
    pub async fn unless_stopped<T>(&mut self, work: impl Future<Output = T>) -> Option<T> {
        let mut work = pin!(work);
        let mut closed = false;
        let mut until = self.has_stop().then(later);
        loop {
            let listens = !closed && until.is_none() && self.priority.len() < PRIORITY_MAX;
            let request = tokio::select! {
                biased;
                done = &mut work => return Some(done),
                () = tokio::time::sleep_until(until.unwrap_or_else(later)), if until.is_some() => return None,
                request = self.queue.recv(), if listens => request,
            };
            match request {
                Some(request) => self.enqueue(request),
                None => closed = true,
            }
            until = self.has_stop().then(later);
        }
    }

    /// Waits for what ends the opening of a port: that it be closed, or opened with other settings. All else waits until it is
    /// open. May be dropped before there is one.
    pub async fn recv_end_of_opening(&mut self) -> Result<BusRequest, Interrupt> {
        let ends = |request: &BusRequest| matches!(request, BusRequest::Connect(false) | BusRequest::Configure(_));
        self.check_redefine()?;
        loop {
            let place = self.priority.iter().position(ends);
            if let Some(request) = place.and_then(|place| self.priority.remove(place)) {
                return Ok(request);
            }
            if PRIORITY_MAX <= self.priority.len() {
                return std::future::pending().await;
            }
            let request = self.receive().await?;
            self.enqueue(request);
        }
    }

    /// The writes of a tag that still wait, taken out: they were requested before a stop, and would undo it.
    pub fn take_writes_of(&mut self, stopped: TagId) -> Vec<WriteId> {
        self.take_writes(|tag| tag == stopped)
    }

    /// Takes the writes and refreshes that wait; gives the writes.
    pub fn take_waiting(&mut self) -> Vec<WriteId> {
        let writes = self.take_writes(|_| true);
        self.waiting.clear();
        writes
    }

    /// A write has ended.
    pub fn ended(&mut self, id: WriteId) {
        self.started.retain(|write| *write != id);
    }

    /// The task of the line is gone: the writes that it had begun and not ended.
    pub fn take_started(&mut self) -> Vec<WriteId> {
        std::mem::take(&mut self.started)
    }

    fn has_stop(&self) -> bool {
        self.priority.front().is_some_and(is_stop)
    }

    /// Looks through the queue for what goes first.
    fn receive_queued(&mut self) -> Result<(), Interrupt> {
        while !self.has_stop() && self.priority.len() < PRIORITY_MAX {
            let Some(request) = self.try_queue()? else { break };
            self.enqueue(request);
        }
        Ok(())
    }

    /// The next of the queue, unless another definition comes.
    async fn receive(&mut self) -> Result<BusRequest, Interrupt> {
        tokio::select! {
            biased;
            Some(redefine) = self.redefines.recv() => {
                self.redefine = Some(redefine);
                Err(Interrupt::Redefined)
            }
            request = self.queue.recv() => request.ok_or(Interrupt::Closed),
        }
    }

    fn check_redefine(&mut self) -> Result<(), Interrupt> {
        self.redefine = self.redefine.take().or_else(|| self.redefines.try_recv().ok());
        if self.redefine.is_some() { Err(Interrupt::Redefined) } else { Ok(()) }
    }

    fn try_queue(&mut self) -> Result<Option<BusRequest>, Interrupt> {
        match self.queue.try_recv() {
            Ok(request) => Ok(Some(request)),
            Err(TryRecvError::Empty) => Ok(None),
            Err(TryRecvError::Disconnected) => Err(Interrupt::Closed),
        }
    }

    fn enqueue(&mut self, request: BusRequest) {
        match request {
            stop if is_stop(&stop) => self.priority.push_front(stop),
            BusRequest::Write(_) | BusRequest::Refresh { .. } => self.defer(request),
            other => self.priority.push_back(other),
        }
    }

    fn mark_started(&mut self, request: BusRequest) -> BusRequest {
        if let BusRequest::Write(job) = &request {
            self.started.push(job.id);
        }
        request
    }

    /// It was handed out, and is not begun.
    fn unmark_started(&mut self, request: &BusRequest) {
        if let BusRequest::Write(job) = request {
            self.ended(job.id);
        }
    }

    fn take_writes(&mut self, of: impl Fn(TagId) -> bool) -> Vec<WriteId> {
        let mut taken = Vec::new();
        self.waiting.retain(|request| match request {
            BusRequest::Write(job) if of(job.tag) => {
                taken.push(job.id);
                false
            }
            _ => true,
        });
        taken
    }
}

fn is_stop(request: &BusRequest) -> bool {
    matches!(request, BusRequest::Write(WriteJob { urgent: true, .. }))
}

fn later() -> Instant {
    Instant::now() + STOP_WAIT
}
