//! The task that publishes what holds now, and what the history has stored. It waits for the broker and for queries, and no other
//! task waits for it.

use std::{path::PathBuf, sync::Arc, time::Duration};

use jiff::Timestamp;
use rumqttc::AsyncClient;
use tokio::{
    sync::{mpsc, oneshot, watch},
    time::{sleep, timeout},
};

use super::{
    answers::AnswerStatus,
    broker::{Broker, Inbox},
    cursor::{self, Cursor},
};
use crate::{
    bus::io::{clock::Clock, worker::spawn_blocking},
    history::{
        Answer, HistoryError, Query,
        io::{QueryRequest, reader::STATION},
        recorded::StoredSamples,
    },
    north::{
        deadband::Deadband,
        forwarder::{Batch, Forwarder},
        payload,
    },
    plant::{
        PlantDef, Snapshot,
        def::{DeviceDef, MqttDef},
        event::Event,
        mqtt_request::MqttRequestStatus,
        north_status::NorthStatus,
        sample::Sample,
        snapshot::HistoryStatus,
        station_fault::{FaultState, StationFault},
        time::elapsed,
    },
};

/// Real time between two looks at snapshot and history.
const EVERY: Duration = Duration::from_secs(1);
/// Real time before a broker is tried again: the first time, and at most.
const RETRY: (Duration, Duration) = (Duration::from_secs(1), Duration::from_secs(30));
/// Real time that a broker has when the station stops.
const LEAVE_MAX: Duration = Duration::from_secs(3);

/// Everything that the task needs.
pub(crate) struct NorthTask {
    /// The plant.
    pub def: Arc<PlantDef>,
    /// The broker.
    pub mqtt: MqttDef,
    /// Plant time.
    pub clock: Clock,
    /// What holds now.
    pub snapshots: watch::Receiver<Arc<Snapshot>>,
    /// To the history.
    pub queries: mpsc::Sender<(u32, QueryRequest)>,
    /// How the history stands.
    pub history: watch::Receiver<HistoryStatus>,
    /// To the plant: how far it is, and its alarm.
    pub events: mpsc::Sender<Event>,
    /// The file of the history, beside which the cursor lies.
    pub history_file: PathBuf,
    /// Requests from outside, where the plant file permits them.
    pub requests: Option<RequestChannels>,
}

/// What connects the requests from outside with the broker.
pub(crate) struct RequestChannels {
    /// Where they go.
    pub inbox: Inbox,
    /// Gets the connection that answers are sent over.
    pub clients: watch::Sender<Option<AsyncClient>>,
    /// How they stand.
    pub status: watch::Receiver<MqttRequestStatus>,
    /// What the broker made of their answers.
    pub answers: watch::Receiver<AnswerStatus>,
}

/// Runs until the station stops.
pub(crate) async fn run(task: NorthTask, mut stopped: watch::Receiver<bool>) {
    let path = cursor::beside(&task.history_file);
    let now = task.clock.utc();
    let file = path.clone();
    let read = tokio::select! {
        read = spawn_blocking(move || cursor::read(&file)) => read.unwrap_or_else(|error| Err(error.to_string())),
        // The disk hangs.
        _ = stopped.wait_for(|stopped| *stopped) => return,
    };
    let (cursor, damaged) = match read {
        Ok(cursor) => (cursor, None),
        Err(why) => (None, Some(why)),
    };
    let forwarder = forwarder(&task, cursor.unwrap_or(Cursor { at: now, epoch: None, sent: None }));
    let state = Deadband::new(task.def.tags.len());
    let status = NorthStatus { sent_until: forwarder.complete_until(), error: damaged, ..NorthStatus::default() };
    let mut north = North {
        task,
        path,
        forwarder,
        has_delivered: false,
        state,
        status,
        broker: None,
        alarm: None,
        not_subscribed: None,
    };
    if let Some(why) = &north.status.error {
        tracing::error!(why, "samples before now are not sent");
        north.tell(FaultState::Occurred(why.as_str().into()));
    }
    tokio::select! {
        _ = stopped.wait_for(|stopped| *stopped) => {}
        () = north.follow() => {}
    }
    if let Err(why) = north.keep_sent().await {
        tracing::warn!(why, "the next start sends the last seconds once more");
    }
    if let Some(broker) = north.broker.take() {
        // Otherwise the broker says itself that the station is gone.
        let _ = timeout(LEAVE_MAX, broker.leave(&north.task.mqtt)).await;
    }
}

/// Goes on where the station before has ended.
fn forwarder(task: &NorthTask, Cursor { at, epoch, sent }: Cursor) -> Forwarder {
    let epoch = epoch.unwrap_or_else(|| task.history.borrow().epoch);
    let forwarder = Forwarder::new((epoch, at), task.def.tags.len(), task.clock.speed());
    match sent {
        Some(sent) => {
            let known = |(name, sample): (String, Sample)| Some((task.def.tag_named(&name)?, sample));
            forwarder.knowing(sent.into_iter().filter_map(known))
        }
        None => forwarder,
    }
}

struct North {
    task: NorthTask,
    path: PathBuf,
    forwarder: Forwarder,
    has_delivered: bool,
    /// Which values of the state were published on this connection.
    state: Deadband,
    status: NorthStatus,
    broker: Option<Broker>,
    /// The words of the alarm that is active.
    alarm: Option<String>,
    /// Why the broker delivers no requests.
    not_subscribed: Option<String>,
}

impl North {
    async fn follow(&mut self) {
        let mut retry = RETRY.0;
        loop {
            match self.step().await {
                Ok(is_behind) => {
                    retry = RETRY.0;
                    self.status.error = None;
                    self.report();
                    if !is_behind {
                        sleep(EVERY).await;
                    }
                }
                Err(why) => {
                    tracing::warn!(why, "data out");
                    self.disconnect();
                    self.status.error = Some(why);
                    self.report();
                    self.pause(retry).await;
                    retry = (retry * 2).min(RETRY.1);
                }
            }
        }
    }

    /// Waits, and goes on saying how far it is.
    async fn pause(&mut self, pause: Duration) {
        let mut left = pause;
        while !left.is_zero() {
            let now = left.min(EVERY);
            sleep(now).await;
            left -= now;
            self.report();
        }
    }

    /// Publishes what has changed and one window of samples. Is there more?
    async fn step(&mut self) -> Result<bool, String> {
        if self.broker.is_none() {
            self.connect().await?;
            // The broker may have forgotten everything.
            self.state = Deadband::new(self.task.def.tags.len());
        }
        self.publish_state().await?;
        self.forward().await
    }

    /// Connects, and asks for requests where the plant file permits them. Data goes out even if the broker refuses these.
    async fn connect(&mut self) -> Result<(), String> {
        let mqtt = &self.task.mqtt;
        let requests = self.task.requests.as_ref();
        let mut broker = Broker::connect(mqtt, requests.map(|requests| &requests.inbox)).await?;
        if let Some(requests) = requests {
            let refused = broker.subscribe(mqtt).await.err();
            self.not_subscribed = refused.map(|why| format!("the broker delivers no requests: {why}"));
            requests.clients.send_replace(Some(broker.client()));
        }
        self.broker = Some(broker);
        Ok(())
    }

    fn disconnect(&mut self) {
        self.broker = None;
        if let Some(requests) = &self.task.requests {
            requests.clients.send_replace(None);
        }
    }

    async fn publish_state(&mut self) -> Result<(), String> {
        let snapshot = self.task.snapshots.borrow_and_update().clone();
        let (mqtt, state) = (&self.task.mqtt, &mut self.state);
        let mut is_due = |device: &DeviceDef| {
            let tags = snapshot.def.tags.iter().filter(|tag| tag.device == device.id);
            // Each is looked at: what is published counts for all tags of the device.
            tags.filter(|tag| state.pass(mqtt, tag.id, snapshot.sample(tag.id))).count() > 0
        };
        let due: Vec<_> = self.task.def.devices.iter().filter(|device| is_due(device)).collect();
        let messages: Vec<_> = due.into_iter().map(|device| payload::state(mqtt, &snapshot, device)).collect();
        self.publish(&messages).await.map(drop)
    }

    async fn publish(&mut self, messages: &[payload::Message]) -> Result<u64, String> {
        match &mut self.broker {
            Some(broker) => broker.publish(messages).await,
            None => Err("not connected".to_owned()),
        }
    }

    async fn forward(&mut self) -> Result<bool, String> {
        let latest = {
            // Behind what waits in memory the cursor must not go.
            let history = self.task.history.borrow();
            if history.failing.is_some() || history.waiting > 0 {
                return Ok(false);
            }
            history.epoch
        };
        let now = self.task.clock.utc();
        let Some((epoch, from, to)) = self.forwarder.window(latest, now) else { return Ok(false) };
        let samples = match self.ask(Query::Samples { epoch: Some(epoch), from, to }).await {
            Ok(samples) => samples,
            Err(HistoryError::TooManyRows { .. }) => {
                self.forwarder.on_too_many();
                return Ok(true);
            }
            Err(error) => {
                tracing::debug!(%error, "data out waits for the history");
                return Ok(false);
            }
        };
        let batch = self.forwarder.on_samples(&self.task.mqtt, to, samples);
        self.deliver(&batch).await?;
        Ok(to < now || batch.until.0 != epoch)
    }

    async fn deliver(&mut self, batch: &Batch) -> Result<(), String> {
        let messages = payload::samples(&self.task.mqtt, &self.task.def, &batch.samples);
        let refused = self.publish(&messages).await?;
        self.forwarder.on_delivered(batch);
        self.has_delivered = true;
        self.status.sent += batch.samples.len() as u64;
        self.status.refused += refused;
        self.status.sent_until = self.forwarder.complete_until();
        // After a failure, what was sent lately is sent once more; nothing is lost.
        self.write_cursor(None).await
    }

    /// A station that stops writes down what it has sent, so that the next one sends nothing twice.
    async fn keep_sent(&self) -> Result<(), String> {
        if !self.has_delivered {
            return Ok(());
        }
        let name = |(tag, sample)| (self.task.def.tag(tag).name.clone(), sample);
        self.write_cursor(Some(self.forwarder.sent().map(name).collect())).await
    }

    async fn write_cursor(&self, sent: Option<Vec<(String, Sample)>>) -> Result<(), String> {
        let (epoch, at) = self.forwarder.cursor();
        let (path, cursor) = (self.path.clone(), Cursor { at, epoch: Some(epoch), sent });
        let written = spawn_blocking(move || cursor::write(&path, &cursor)).await;
        written.unwrap_or_else(|error| Err(error.to_string()))
    }

    async fn ask(&self, query: Query) -> Result<StoredSamples, HistoryError> {
        let (reply, answer) = oneshot::channel();
        let request = (STATION, QueryRequest { query, reply });
        self.task.queries.try_send(request).map_err(|_| HistoryError::NotOpen)?;
        match answer.await.unwrap_or(Err(HistoryError::NotOpen))? {
            Answer::Samples(samples) => Ok(samples),
            _ => Err(HistoryError::NotOpen),
        }
    }

    /// Says how far it is, and raises or clears the alarm. What the plant has no room for is said again in a second.
    fn report(&mut self) {
        self.status.connected = self.broker.is_some();
        self.status.requests = self.task.requests.as_ref().map(|requests| {
            let status = requests.status.borrow().clone();
            let AnswerStatus { refused, error } = requests.answers.borrow().clone();
            let error = status.error.or(self.not_subscribed.clone()).or(error);
            MqttRequestStatus { error, unanswered: status.unanswered + refused, ..status }
        });
        let at = self.task.clock.now();
        let _ = self.task.events.try_send(Event::North { at, status: Arc::new(self.status.clone()) });
        let words = alarm_words(&self.task.mqtt, &self.status, self.task.clock.utc());
        if words != self.alarm && self.tell(FaultState::lasting(words.clone())) {
            self.alarm = words;
        }
    }

    fn tell(&self, state: FaultState) -> bool {
        let event = Event::Station { at: self.task.clock.now(), fault: StationFault::DataOut, state };
        !matches!(self.task.events.try_send(event), Err(mpsc::error::TrySendError::Full(_)))
    }
}

/// The words of the alarm: what has waited too long, and why. They change only with the reason.
fn alarm_words(mqtt: &MqttDef, status: &NorthStatus, now: Timestamp) -> Option<String> {
    if elapsed(status.sent_until, now) < mqtt.lag_max {
        return None;
    }
    let why = status.error.as_deref().unwrap_or("the history does not record, or there is more than the broker takes");
    let (host, port) = (&mqtt.host, mqtt.port);
    Some(format!("{host}:{port}: no value has arrived since {:.0}: {why}", status.sent_until))
}
