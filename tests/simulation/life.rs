//! One life of a station: from its start to its end, by a stop, a kill, or the disk.

use std::{
    collections::{BTreeMap, VecDeque},
    env,
    path::PathBuf,
    process::ExitCode,
    sync::{
        Arc,
        atomic::{AtomicI64, Ordering},
    },
    time::Duration,
};

use jiff::{SignedDuration, Timestamp};
use sightglass::api::{
    access::audit_log,
    bus::{Clock, worker},
    history::{Answer, Query, QueryRequest, Store},
    plant::{
        AlarmId, AlarmState, CommandId, CommandKind, PlantDef, Poll, ProcedureId, ProcedureRun, ProcedureState,
        Quality, Sample, Snapshot, StationFault, TagId,
    },
    profile::{self, Search},
    report::{self, FORMATS, Period, Style},
    sim::{Simulator, SimulatorHandle},
    station::{self, Session, Station},
};
use tokio::sync::oneshot;

use crate::{
    dice::Dice,
    facts::{Facts, say, wrong},
    lines::connectors,
    operator::{Operator, Supervisor},
};

/// So long after the start the alarms are restored, and the history completed from the log.
const SETTLED: Duration = Duration::from_secs(12);
/// A value was so in the device at most so long before its answer arrived, and at most so long after.
const BEFORE: SignedDuration = SignedDuration::from_secs(5);
const AFTER: SignedDuration = SignedDuration::from_millis(600);
/// Samples of the last seconds may be lost.
const LAST: SignedDuration = SignedDuration::from_secs(3);
/// In an entry of the audit log.
const END: &str = r#""action":"end procedure""#;
const STOP_MAX: Duration = Duration::from_secs(30);

/// How a life goes.
struct Life {
    folder: PathBuf,
    dice: Dice,
    /// The last one: nothing misbehaves, and in the end everything is looked at.
    is_last: bool,
    /// The system clock is set in some life of this seed: figures of its hours are not compared.
    clock_is_set: bool,
    facts: Facts,
    /// What is written beside a command: which life it was.
    name: String,
}

pub fn main(seed: u64) -> ExitCode {
    worker::simulate();
    tracing_subscriber::fmt().with_writer(std::io::stderr).with_max_level(tracing::Level::WARN).init();
    let said = |name: &str| env::var(name).unwrap_or_default();
    let folder = PathBuf::from(said("SIGHTGLASS_FOLDER"));
    let number: u64 = said("SIGHTGLASS_LIFE_NUMBER").parse().unwrap();
    let mut of_seed = Dice(seed);
    let life = Life {
        dice: Dice(seed << 8 | number),
        is_last: said("SIGHTGLASS_LAST") == "1",
        clock_is_set: of_seed.chance(0.3),
        facts: Facts::read(&folder.join("facts")),
        name: format!("s{seed}l{number}"),
        folder,
    };
    say("life", &life.name);
    let life = life.without_ended_procedures();
    let base = Timestamp::from_second(said("SIGHTGLASS_BASE").parse().unwrap()).unwrap();
    let runtime = tokio::runtime::Builder::new_current_thread().enable_time().start_paused(true).build().unwrap();
    runtime.block_on(life.live(base));
    say("ended", "");
    ExitCode::SUCCESS
}

impl Life {
    fn history(&self) -> PathBuf {
        self.folder.join("state/sightglass/tank.duckdb")
    }

    /// The one that was seen at work may have ended before the station did: the log says so.
    fn without_ended_procedures(mut self) -> Life {
        let log = std::fs::read_to_string(audit_log::beside(&self.history())).unwrap_or_default();
        let is_of_procedure = |line: &&str| line.contains(r#""action":"start procedure""#) || line.contains(END);
        if log.lines().rfind(is_of_procedure).is_some_and(|line| line.contains(END)) {
            self.facts.procedures.clear();
        }
        self
    }

    async fn live(mut self, base: Timestamp) {
        let def =
            profile::load(&self.folder.join("tank.toml"), &Search::shipped()).unwrap_or_else(|why| panic!("{why}"));
        let set_by: &'static AtomicI64 = Box::leak(Box::default());
        let clock = Clock::simulated(base, set_by);
        let simulator = SimulatorHandle::spawn_for(&def, Simulator::new(&def).unwrap(), clock);
        let trouble = if self.is_last { 0.0 } else { [0.0, 0.02, 0.2][self.dice.place(3)] };
        let connectors = connectors(&def, &simulator, trouble, &mut self.dice);
        let options = station::Options { def: def.clone(), clock, history: self.history(), connectors, file: None };
        let station = match station::start(options) {
            Ok(station) => station,
            Err(why) => return wrong(format!("starts: {why}")),
        };
        let session = station.session("anna");
        let operator = Operator::new(&session, &def, &self.name, self.dice, self.is_last);
        let operator = tokio::spawn(operator.operate(SETTLED));
        let backups = self.folder.join("backups").join(&self.name);
        let supervisor = Supervisor::new(station.session("boss"), station.session("terminal"), self.dice, backups);
        let supervisor = tokio::spawn(supervisor.administer(self.facts.users.clone(), SETTLED));
        let lasts = SETTLED + Duration::from_millis(self.dice.below(if self.is_last { 20_000 } else { 60_000 }));
        let mut watch = Watch::new(&def, session.clone(), simulator.clone(), clock);
        watch.until(SETTLED).await;
        self.compare(&session, &def, base).await;
        if self.clock_is_set && !self.is_last && self.dice.chance(0.5) {
            let step = self.dice.below(7_200) as i64 - 3_600;
            set_by.store(step * 1_000_000, Ordering::Relaxed);
        }
        watch.until(lasts).await;
        self.count(&session, clock).await;
        watch.until(lasts + Duration::from_secs(5)).await;
        operator.abort();
        supervisor.abort();
        say("compared", watch.compared);
        if !self.is_last && self.dice.chance(0.6) {
            // As a kill between two operations on the disk.
            let _ = rustix::process::kill_process(rustix::process::getpid(), rustix::process::Signal::KILL);
        }
        let last = session.snapshots.borrow().clone();
        if last.history.failing.is_none() && last.history.damaged.is_none() && !self.clock_is_set {
            // It may be at work again.
            self.compare_procedures(&last, &def, |_| false);
        }
        drop((session, watch));
        self.end(station, &last, &def).await;
    }

    fn compare_procedures(&self, snapshot: &Snapshot, def: &PlantDef, forgets: fn(&ProcedureRun) -> bool) {
        for name in &self.facts.procedures {
            let run = def.procedures.iter().zip(&snapshot.procedures).find(|(def, _)| *def.name == **name);
            if run.is_none_or(|(_, run)| run.as_deref().is_none_or(forgets)) {
                wrong(format!("procedures: {name} was at work when the station ended, which is forgotten"));
            }
        }
    }

    /// What lives before this one have said.
    async fn compare(&self, session: &Session, def: &Arc<PlantDef>, base: Timestamp) {
        let snapshot = session.snapshots.borrow().clone();
        let listed: Vec<String> = snapshot.alarms.iter().map(|alarm| name_of(def, alarm.id)).collect();
        if snapshot.history.failing.is_none() && snapshot.station.is_empty() {
            for alarm in self.facts.unacknowledged.iter().filter(|alarm| !listed.contains(alarm)) {
                wrong(format!("alarms: {alarm} was not acknowledged, and is not listed; listed are {listed:?}"));
            }
        }
        if self.clock_is_set || snapshot.history.damaged.is_some() {
            return;
        }
        // What the history holds is known once it is open, which a full disk delays.
        if snapshot.history.failing.is_none() {
            self.compare_procedures(&snapshot, def, |run| run.state == ProcedureState::Running);
        }
        let hour = base.as_second() / 3600 * 3600;
        for from in [hour - 3600, hour - 7200] {
            let [from, to] = [from, from + 3600].map(|second| Timestamp::from_second(second).unwrap());
            if let Some(Answer::Report(report)) = ask(session, Query::Report { period: Period::free(from, to) }).await
                && report.unstored == Some(0)
            {
                let figures = report::render(FORMATS[0], &report, def, &Style::of(def)).unwrap();
                let figures = String::from_utf8(figures).unwrap().replace("\r\n", " / ");
                match self.facts.figures.get(&from) {
                    Some(before) if *before != figures => wrong(format!("figures: of {from}: {before} now {figures}")),
                    Some(_) => {}
                    None => say("figures", format!("{from} {figures}")),
                }
            }
        }
    }

    /// How much is stored now.
    async fn count(&self, session: &Session, clock: Clock) {
        if self.clock_is_set {
            return;
        }
        let until = clock.utc() - LAST;
        if let Some(count) = samples(session, until).await {
            say("stored", format!("{until} {count}"));
        }
    }

    async fn end(&self, station: Station, last: &Snapshot, def: &Arc<PlantDef>) {
        // A station that stops aborts it into its safe state.
        say("procedure", "ended");
        if tokio::time::timeout(STOP_MAX, station.stop()).await.is_err() {
            return wrong("stops: not within 30 s");
        }
        if !self.is_last {
            return;
        }
        if let Some(why) = &last.history.failing {
            wrong(format!("history: {why}"));
        }
        let bad: Vec<_> = def.tags.iter().filter(|tag| last.samples[tag.id.index()].value.is_none()).collect();
        let polled: Vec<_> = bad.iter().filter(|tag| matches!(tag.poll, Poll::Every(_))).map(|tag| &tag.name).collect();
        if !polled.is_empty() {
            wrong(format!("lines: nothing misbehaves, and there is no value of {polled:?}"));
        }
        self.audit(last.history.damaged.is_some(), def);
    }

    /// The log is whole, has everything that was acknowledged, and the history has the same, each once.
    fn audit(&self, is_damaged: bool, def: &Arc<PlantDef>) {
        let store = match Store::open_read_only(&self.history(), def) {
            Ok(store) => store,
            Err(why) => return wrong(format!("history: {why}")),
        };
        let rows = store.chain_hashes().unwrap();
        let path = audit_log::beside(&self.history());
        if let Err(why) = audit_log::verify(&path, if is_damaged { &[] } else { &rows }) {
            wrong(format!("audit: {why}"));
        }
        let log = notes(std::fs::read_to_string(&path).unwrap().lines().filter_map(note_of));
        for note in self.facts.acknowledged.iter().filter(|note| !log.contains_key(*note)) {
            wrong(format!("audit: {note} was shown as recorded, and is not in the log"));
        }
        let all = Query::Actions { from: Timestamp::UNIX_EPOCH, to: Timestamp::MAX, limit: 1_000_000 };
        let Ok(Answer::Actions(actions)) = store.answer(&all, Timestamp::now()) else {
            return wrong("history: no actions");
        };
        let stored = notes(actions.iter().filter_map(|action| action.note.as_deref().map(str::to_owned)));
        let differ = |(note, count): &(&String, &u32)| log.get(*note) != Some(count);
        let more: Vec<_> = stored.iter().filter(differ).collect();
        let less: Vec<_> = log.keys().filter(|note| !stored.contains_key(*note)).collect();
        if !(more.is_empty() && less.is_empty()) {
            wrong(format!("history: actions differ from the log: too often {more:?}, missing {less:?}"));
        }
        for (until, count) in self.facts.stored.iter().filter(|_| !is_damaged) {
            let query = Query::Samples { epoch: None, from: Timestamp::UNIX_EPOCH, to: *until };
            let Ok(Answer::Samples(samples)) = store.answer(&query, Timestamp::now()) else {
                return wrong("history: no samples");
            };
            if samples.samples.len() < *count {
                wrong(format!("samples: {} before {until}, there were {count}", samples.samples.len()));
            }
        }
    }
}

fn name_of(def: &PlantDef, alarm: AlarmId) -> String {
    let def = def.alarm(alarm);
    format!("{:?} {:?}", def.subject, def.condition).replace(',', ";")
}

fn note_of(line: &str) -> Option<String> {
    let entry: serde_json::Value = serde_json::from_str(line).ok()?;
    let is_request = entry["action"].as_str()?.ends_with(" requested");
    entry["note"].as_str().filter(|_| !is_request).map(str::to_owned)
}

fn notes(all: impl Iterator<Item = String>) -> BTreeMap<String, u32> {
    let mut counted = BTreeMap::new();
    all.for_each(|note| *counted.entry(note).or_default() += 1);
    counted
}

pub async fn ask(session: &Session, query: Query) -> Option<Answer> {
    let (reply, answer) = oneshot::channel();
    session.ask(QueryRequest { query, reply }).ok()?;
    answer.await.ok()?.ok()
}

async fn samples(session: &Session, until: Timestamp) -> Option<usize> {
    match ask(session, Query::Samples { epoch: None, from: Timestamp::UNIX_EPOCH, to: until }).await? {
        Answer::Samples(samples) => Some(samples.samples.len()),
        _ => None,
    }
}

/// Looks at every snapshot as an operator does, who knows what is true.
struct Watch {
    def: Arc<PlantDef>,
    session: Session,
    simulator: SimulatorHandle,
    clock: Clock,
    began: Timestamp,
    /// What was true, oldest first.
    truth: VecDeque<(Timestamp, BTreeMap<TagId, f64>)>,
    unacknowledged: Vec<String>,
    recorded: Vec<CommandId>,
    /// The one at work.
    procedure: Option<ProcedureId>,
    /// Good values that were compared with what was true.
    compared: u64,
}

impl Watch {
    fn new(def: &Arc<PlantDef>, session: Session, simulator: SimulatorHandle, clock: Clock) -> Watch {
        let (def, began) = (def.clone(), clock.now());
        let (truth, unacknowledged, recorded) = (VecDeque::new(), Vec::new(), Vec::new());
        Watch { def, session, simulator, clock, began, truth, unacknowledged, recorded, procedure: None, compared: 0 }
    }

    async fn until(&mut self, passed: Duration) {
        let end = self.began + SignedDuration::try_from(passed).unwrap();
        while self.clock.now() < end {
            tokio::select! {
                biased;
                changed = self.session.snapshots.changed() => if changed.is_err() {
                    return wrong("station: it has ended by itself");
                },
                () = self.clock.sleep(Duration::from_millis(200)) => {}
            }
            let Some(report) = self.simulator.report().await else { return };
            self.truth.push_back((self.clock.now(), report.actual));
            while self.truth.front().is_some_and(|(at, _)| *at < self.clock.now() - SignedDuration::from_secs(30)) {
                self.truth.pop_front();
            }
            let snapshot = self.session.snapshots.borrow_and_update().clone();
            self.look(&snapshot);
        }
    }

    fn look(&mut self, snapshot: &Snapshot) {
        for (tag, sample) in self.def.tags.iter().zip(&snapshot.samples) {
            if sample.quality != Quality::Good {
                continue;
            }
            self.compared += 1;
            if let Some(was) = self.is_wrong(tag.id, sample, snapshot) {
                let (value, at) = (sample.value, sample.at);
                wrong(format!("values: {} is shown as {value:?} and good, read at {at}; it was {was:?}", tag.name));
            }
        }
        for status in snapshot.commands.iter().filter(|status| status.outcome.is_success() && status.recorded) {
            if !self.recorded.contains(&status.command.id) {
                self.recorded.push(status.command.id);
                if let Some(note) = &status.command.note {
                    say("recorded", note);
                }
                if let CommandKind::StartProcedure(id) = status.command.kind {
                    say("procedure", format!("at work {}", self.def.procedures[id.index()].name));
                    self.procedure = Some(id);
                }
            }
        }
        if let Some(id) =
            self.procedure.take_if(|id| snapshot.procedure_at_work().is_none_or(|(at_work, _)| at_work != *id))
        {
            say("procedure", format!("ended {}", self.def.procedures[id.index()].name));
        }
        let old = snapshot.at - SignedDuration::from_secs(5);
        let waits = |state| matches!(state, AlarmState::Unacknowledged | AlarmState::ReturnedToNormal);
        let is_kept = !snapshot.station.contains_key(&StationFault::AlarmState);
        let waiting =
            snapshot.alarms.iter().filter(|alarm| is_kept && waits(alarm.state) && alarm.annunciated_at < old);
        let waiting: Vec<String> = waiting.map(|alarm| name_of(&self.def, alarm.id)).collect();
        if waiting != self.unacknowledged {
            say("unacknowledged", waiting.join(","));
            self.unacknowledged = waiting;
        }
    }

    /// What it was about then, where that is something else.
    fn is_wrong(&self, tag: TagId, sample: &Sample, snapshot: &Snapshot) -> Option<(f64, f64)> {
        // What was true is known by steady time.
        let (read, decimals) = (sample.at - snapshot.stepped, snapshot.decimals[tag.index()]);
        let then = |at: Timestamp| read - BEFORE <= at && at <= read + AFTER;
        let of_then = self.truth.iter().filter(|(at, _)| then(*at)).filter_map(|(_, truth)| truth.get(&tag).copied());
        let of_then: Vec<f64> = of_then.collect();
        let (low, high) = of_then.iter().fold((f64::MAX, f64::MIN), |(low, high), now| (low.min(*now), high.max(*now)));
        // Where it keeps changing it may have been further between two looks; where it has stepped once it was not.
        let changes = of_then.windows(3).map(|w| (w[1] - w[0]).abs().min((w[2] - w[1]).abs()));
        let step = changes.fold(0.0, f64::max);
        let grain = 10f64.powi(-i32::from(decimals)) * 1.5 + step;
        let is_right = |value: f64| high < low || (low - grain..=high + grain).contains(&value);
        (!sample.value.is_some_and(is_right)).then_some((low, high))
    }
}
