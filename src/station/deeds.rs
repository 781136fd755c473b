//! The way of deeds into the book, and what the station itself puts there: start, stop, plant file, steps of the clock.

use std::{
    collections::VecDeque,
    sync::Arc,
    time::{Duration, Instant as RealInstant, SystemTime},
};

use jiff::Timestamp;
use tokio::{
    sync::{mpsc, oneshot, watch},
    time::Instant,
};

use crate::{
    access::{
        book::{PLANT_FILE, USERS_FILE, sha256},
        io::book::{BookStatus, Handle},
    },
    plant::record::ActionRecord,
    profile::PlantFile,
};

/// A snapshot that shows an outcome, and the answer to a wish, wait so long for the book to have it.
const WAIT_MAX: Duration = Duration::from_secs(1);
/// Answers that wait for the book; one more, and the oldest waits no longer.
const ANSWERS_MAX: usize = 64;
/// A clock that moves more than this against the steady one was set.
const STEP_MIN: Duration = Duration::from_millis(500);
/// Real time between two looks at the clock.
const LOOK_EVERY: Duration = Duration::from_secs(5);

/// What comes from the door, in its order.
#[derive(Debug)]
pub enum Paper {
    /// Put this into the book.
    Deed(ActionRecord),
    /// Tell this once the book has what came before it: nobody is told that something is done which a loss of power undoes.
    Answer(oneshot::Sender<Result<(), String>>, Result<(), String>),
    /// So many deeds found no room on this way.
    Lost(u64),
}

/// An answer that waits for the book to have so many deeds.
#[derive(Debug)]
struct Answer {
    deeds: u64,
    since: Instant,
    reply: oneshot::Sender<Result<(), String>>,
    answer: Result<(), String>,
}

impl Answer {
    /// Whoever has left needs no answer.
    fn tell(self) {
        let _ = self.reply.send(self.answer);
    }
}

/// The plant's end of the book.
#[derive(Debug)]
pub struct Deeds {
    queue: mpsc::Sender<Vec<ActionRecord>>,
    status: watch::Receiver<BookStatus>,
    /// Deeds that were sent, and since when the book is behind.
    sent: u64,
    behind: Instant,
    /// Deeds that the queue had no room for: they are in the history only.
    left_out: u64,
    /// Deeds that did not even come here.
    lost: u64,
    answers: VecDeque<Answer>,
    clock: ClockWatch,
    /// The hash of the plant file that was recorded last.
    plant_file: Option<Arc<str>>,
    /// The hash of the users that was recorded last.
    users_file: Option<Arc<str>>,
}

impl Deeds {
    /// The end of a book that has just been opened.
    pub fn new(book: &Handle) -> Deeds {
        let (queue, status) = (book.deeds.clone(), book.status.clone());
        let clock = ClockWatch::new();
        let (plant_file, users_file) = (book.opened.plant_file.clone(), book.opened.users_file.clone());
        Deeds {
            queue,
            status,
            sent: 0,
            behind: Instant::now(),
            left_out: 0,
            lost: 0,
            answers: VecDeque::new(),
            clock,
            plant_file,
            users_file,
        }
    }

    /// The first deeds of a station: that it has started, and the plant file and the users if they are others than the last
    /// time. `users` is their [`crate::access::Users::digest`], `None` where nobody is asked who he is.
    pub fn started(&mut self, plant: &str, file: Option<&PlantFile>, users: Option<String>, at: Timestamp) {
        let version = concat!("sightglass ", env!("CARGO_PKG_VERSION"));
        let start = ActionRecord { new: Some(version.into()), ..own(at, "start station", plant, "done") };
        let changed = file.and_then(|file| self.plant_file(file, at));
        let people =
            users.map(Arc::from).filter(|users| self.users_file.as_ref() != Some(users)).map(|users| ActionRecord {
                old: self.users_file.take(),
                new: Some(users),
                ..own(at, USERS_FILE, "users", "done: found")
            });
        // Nothing else waits in this queue yet, so nothing comes back.
        self.put([start].into_iter().chain(changed).chain(people).collect());
    }

    /// The record of a plant file, unless it is still the last one that was recorded.
    pub fn plant_file(&mut self, file: &PlantFile, at: Timestamp) -> Option<ActionRecord> {
        let new: Arc<str> = sha256(file.bytes()).into();
        if self.plant_file.as_ref() == Some(&new) {
            return None;
        }
        let old = self.plant_file.replace(new.clone());
        Some(ActionRecord { old, new: Some(new), ..own(at, PLANT_FILE, &file.path().display().to_string(), "done") })
    }

    /// Sends deeds to the book, which sends them on to the history. Gives back those that it has no room for.
    pub fn put(&mut self, deeds: Vec<ActionRecord>) -> Vec<ActionRecord> {
        let count = deeds.len() as u64;
        if self.status.borrow().taken == self.sent {
            self.behind = Instant::now();
        }
        match self.queue.try_send(deeds) {
            Ok(()) => {
                self.sent += count;
                Vec::new()
            }
            Err(refused) => {
                self.left_out += count;
                refused.into_inner()
            }
        }
    }

    /// So many deeds never came here: they are nowhere.
    pub fn lost(&mut self, count: u64) {
        self.lost += count;
    }

    /// Tells an answer once the book has all that was sent to it before; see [`Deeds::tell`].
    pub fn answer(&mut self, reply: oneshot::Sender<Result<(), String>>, answer: Result<(), String>) {
        self.answers.push_back(Answer { deeds: self.sent, since: Instant::now(), reply, answer });
        self.tell();
    }

    /// Tells the answers whose deeds are in the book. A book that cannot keep up keeps nobody waiting for ever.
    pub fn tell(&mut self) {
        let (taken, alive) = (self.status.borrow().taken, self.status.has_changed().is_ok());
        let is_due = |answer: &Answer| !alive || answer.deeds <= taken || WAIT_MAX <= answer.since.elapsed();
        while let Some(answer) = self.answers.pop_front_if(|answer| is_due(answer)) {
            answer.tell();
        }
        while ANSWERS_MAX < self.answers.len() {
            self.answers.pop_front().into_iter().for_each(Answer::tell);
        }
    }

    /// The station ends: what it has begun to write is written, so nobody need wait.
    pub fn tell_all(&mut self) {
        self.answers.drain(..).for_each(Answer::tell);
    }

    /// When a snapshot may go out that could have gone at `next`: not before the book has what it shows, but in time.
    pub fn due(&self, next: Instant) -> Instant {
        // A thread that has ended will never take anything any more.
        let alive = self.status.has_changed().is_ok();
        if alive && self.status.borrow().taken < self.sent { next.max(self.behind + WAIT_MAX) } else { next }
    }

    /// Waits until the book has taken something.
    pub async fn changed(book: &mut Option<Deeds>) {
        let changed = match book {
            Some(book) => book.status.changed().await.is_ok(),
            None => false,
        };
        if !changed {
            std::future::pending().await
        }
    }

    /// Deeds that are lost, and what is wrong, in words for the operator.
    pub fn trouble(&mut self) -> (u64, Option<String>) {
        let ended = self.status.has_changed().is_err();
        let status = self.status.borrow_and_update().clone();
        let waits = self.sent.saturating_sub(status.taken);
        let late = waits > 0 && WAIT_MAX <= self.behind.elapsed();
        let trouble = if ended {
            Some("the audit trail has ended by itself, see the log".to_owned())
        } else if status.trouble.is_some() {
            status.trouble
        } else if self.left_out + self.lost > 0 {
            Some(format!("{} deeds are not in the audit trail: it was too slow", self.left_out + self.lost))
        } else {
            late.then(|| format!("the audit trail is slow, {waits} deeds wait for it"))
        };
        (status.lost + self.lost, trouble)
    }

    /// A record if the clock was set since the last look. The time of the plant does not follow such a step before the next
    /// start, so that nothing is stored twice or left out.
    pub fn look_at_clock(&mut self, at: Timestamp) -> Option<ActionRecord> {
        let step = self.clock.look(SystemTime::now(), RealInstant::now())?;
        let record = own(at, "clock step", "system clock", "done: the plant keeps its time until the next start");
        Some(ActionRecord { new: Some(format!("{step:+.1} s").into()), ..record })
    }
}

/// The last deed of a station.
pub fn stopped(plant: &str, at: Timestamp) -> ActionRecord {
    own(at, "stop station", plant, "done")
}

fn own(at: Timestamp, action: &str, target: &str, outcome: &str) -> ActionRecord {
    ActionRecord {
        at,
        by: "station".into(),
        from: "".into(),
        action: action.into(),
        target: target.into(),
        old: None,
        new: None,
        outcome: outcome.into(),
        note: None,
        seal: None,
    }
}

/// Compares the clock that can be set with the one that cannot.
#[derive(Debug)]
struct ClockWatch {
    wall: SystemTime,
    steady: RealInstant,
}

impl ClockWatch {
    fn new() -> ClockWatch {
        ClockWatch { wall: SystemTime::now(), steady: RealInstant::now() }
    }

    /// The step since the last look, seconds; `None` for none worth a word, or where the last look was just now.
    fn look(&mut self, wall: SystemTime, steady: RealInstant) -> Option<f64> {
        let passed = steady.saturating_duration_since(self.steady);
        if passed < LOOK_EVERY {
            return None;
        }
        let moved = match wall.duration_since(self.wall) {
            Ok(ahead) => ahead.as_secs_f64(),
            Err(back) => -back.duration().as_secs_f64(),
        };
        (self.wall, self.steady) = (wall, steady);
        let step = moved - passed.as_secs_f64();
        (STEP_MIN.as_secs_f64() <= step.abs()).then_some(step)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clock_that_was_set_is_seen_and_one_that_only_drifts_is_not() {
        let mut watch = ClockWatch::new();
        let (wall, steady) = (watch.wall, watch.steady);
        let seconds = Duration::from_secs;
        assert_eq!(watch.look(wall + seconds(3600), steady + seconds(1)), None, "not looked at yet");
        let drift = Duration::from_millis(400);
        assert_eq!(watch.look(wall + seconds(5) + drift, steady + seconds(5)), None);
        let step = watch.look(wall + seconds(3610) + drift, steady + seconds(10));
        assert!(step.is_some_and(|step| (step - 3600.0).abs() < 1e-6), "{step:?}");
        let step = watch.look(wall + seconds(15) + drift, steady + seconds(15));
        assert!(step.is_some_and(|step| (step + 3600.0).abs() < 1e-6), "{step:?}");
    }
}
