//! The task of requests from outside: takes them from the broker's connection to a session, and their outcomes back as answers.

use std::{
    path::PathBuf,
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
    },
    time::Duration,
};

use rumqttc::AsyncClient;
use tokio::{
    sync::{mpsc, watch},
    task::JoinHandle,
    time::{MissedTickBehavior, interval},
};

use crate::{
    bus::io::{clock::Clock, worker::spawn_blocking},
    north::{
        io::{
            answers::{self, AnswerStatus},
            broker::Inbox,
            request_file,
            task::RequestChannels,
        },
        payload::Message,
        refusals::Refusal,
        request::{self, Received},
        requests::{Decision, Now, PassOn, Requests},
    },
    plant::{
        def::MqttDef,
        mqtt_request::{MqttRefusal, MqttRequestStatus},
    },
    station::{Request, Session, SessionAcceptor},
};

/// Messages that wait; more are refused without an answer.
const INBOX_MAX: usize = 16;
/// Answers that wait for the broker; more are not sent, and a repeated request gets its answer again.
const ANSWERS_MAX: usize = 64;
/// How often overdue outcomes and lost messages are looked for.
const TICK: Duration = Duration::from_secs(1);

/// Takes requests from outside where the plant file names a user for them, in a task that ends with its last refusals on record.
/// Nothing is subscribed to otherwise.
pub(crate) async fn start(
    mqtt: &MqttDef,
    clock: Clock,
    acceptor: &SessionAcceptor,
    history: &std::path::Path,
    mut stopped: watch::Receiver<bool>,
) -> Option<(RequestChannels, JoinHandle<()>)> {
    let user = mqtt.commands_as.as_ref()?;
    let file = request_file::beside(history);
    let path = file.clone();
    let list = tokio::select! {
        list = spawn_blocking(move || request_file::read(&path)) => list.unwrap_or_else(|error| Err(error.to_string())),
        // The disk hangs.
        () = has_stopped(&mut stopped) => return None,
    };
    let from = format!("MQTT {}:{} as {}, {}", mqtt.host, mqtt.port, mqtt.client_id, request::filter(mqtt));
    let session = acceptor.attach_as(user, &from);
    let (inbox, received) = mpsc::channel(INBOX_MAX);
    let (answers, answer_queue) = mpsc::channel(ANSWERS_MAX);
    let (clients, client) = watch::channel::<Option<AsyncClient>>(None);
    let (publish, status) = watch::channel(MqttRequestStatus::default());
    let lost = Arc::new(AtomicU64::new(0));
    let inbox = Inbox::new(inbox, lost.clone());
    let (publish_answers, answer_status) = watch::channel(AnswerStatus::default());
    tokio::spawn(answers::run(answer_queue, client, publish_answers));
    let now = Now { plant: clock.now(), utc: clock.utc() };
    let requests = Requests::new(mqtt.clone(), list, now);
    let task = RequestTask { requests, clock, session, lost, answers, publish, file };
    let task = tokio::spawn(task.run(received, stopped));
    Some((RequestChannels { inbox, clients, status, answers: answer_status }, task))
}

struct RequestTask {
    requests: Requests,
    clock: Clock,
    session: Session,
    /// Messages for which the queue had no room.
    lost: Arc<AtomicU64>,
    answers: mpsc::Sender<Message>,
    publish: watch::Sender<MqttRequestStatus>,
    /// Where the list of requests is kept.
    file: PathBuf,
}

impl RequestTask {
    async fn run(mut self, mut received: mpsc::Receiver<Received>, mut stopped: watch::Receiver<bool>) {
        let mut tick = interval(TICK);
        tick.set_missed_tick_behavior(MissedTickBehavior::Skip);
        let left = self.requests.after_restart(self.now());
        self.answer(left).await;
        loop {
            self.publish.send_if_modified(|shown| {
                let is_news = shown != self.requests.status();
                shown.clone_from(self.requests.status());
                is_news
            });
            let due = self.requests.refusals(self.now());
            self.record(due);
            tokio::select! {
                biased;
                () = has_stopped(&mut stopped) => break,
                Ok(()) = self.session.status.changed() => {
                    let status = self.session.status.borrow_and_update().clone();
                    let answers = self.requests.on_session(&status, self.session.terminal, self.now());
                    self.answer(answers).await;
                }
                Ok(()) = self.session.snapshots.changed() => {
                    let snapshot = self.session.snapshots.borrow_and_update().clone();
                    let answers = self.requests.on_snapshot(&snapshot, self.session.terminal, self.now());
                    self.answer(answers).await;
                }
                Some(received) = received.recv() => self.on_received(&received).await,
                _ = tick.tick() => self.requests.on_lost(self.lost.swap(0, Ordering::Relaxed)),
            }
        }
        self.requests.stop();
        received.close();
        while let Ok(waiting) = received.try_recv() {
            self.on_received(&waiting).await;
        }
        // The session server waits for these before it ends.
        self.requests.on_lost(self.lost.swap(0, Ordering::Relaxed));
        let rest = self.requests.last_refusals();
        self.record(rest);
    }

    fn record(&mut self, refusals: Vec<Refusal>) {
        for refusal in refusals {
            let record = Request::RecordRefusal { what: refusal.what.clone(), outcome: refusal.outcome() };
            if self.session.send(record).is_err() {
                self.requests.on_refusal_not_recorded(refusal);
            }
        }
    }

    fn now(&self) -> Now {
        Now { plant: self.clock.now(), utc: self.clock.utc() }
    }

    async fn on_received(&mut self, received: &Received) {
        let plant = self.session.snapshots.borrow().def.clone();
        match self.requests.on_received(&plant, received, self.now()) {
            Decision::None => {}
            Decision::Answer(answer) => self.send(answer),
            Decision::PassOn(request) => self.pass_on(request).await,
        }
    }

    /// The list is on disk before the command is sent: no restart makes it be sent twice.
    async fn pass_on(&mut self, request: PassOn) {
        let number = request.number;
        let passed_on = self.save().await.map_err(MqttRefusal::NotRecorded).and_then(|()| {
            let command = request.command(&self.session.snapshots.borrow(), self.session.terminal, self.now())?;
            let sent = self.session.send(Request::Command(command, None));
            sent.map_err(|why| MqttRefusal::NotDelivered(why.to_string()))
        });
        let Err(why) = passed_on else { return };
        let refusal = self.requests.on_not_passed_on(number, why, self.now());
        self.answer(refusal).await;
    }

    /// Keeps what is answered, then sends it. What cannot be kept is sent nevertheless: it is what happened.
    async fn answer(&mut self, answers: impl IntoIterator<Item = Message>) {
        let mut answers = answers.into_iter().peekable();
        if answers.peek().is_none() {
            return;
        }
        if let Err(why) = self.save().await {
            tracing::error!(why, "the list of requests from outside");
        }
        answers.for_each(|answer| self.send(answer));
    }

    fn send(&mut self, answer: Message) {
        if self.answers.try_send(answer).is_err() {
            self.requests.on_answer_lost();
            tracing::warn!("an answer to a request from outside had no room");
        }
    }

    async fn save(&self) -> Result<(), String> {
        let (file, list) = (self.file.clone(), self.requests.log_bytes());
        spawn_blocking(move || request_file::write(&file, &list)).await.unwrap_or_else(|error| Err(error.to_string()))
    }
}

async fn has_stopped(stopped: &mut watch::Receiver<bool>) {
    // A station that is gone has stopped.
    let _ = stopped.wait_for(|stopped| *stopped).await;
}
