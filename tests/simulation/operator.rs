//! Those who work with a station: an operator, who gives commands, and a supervisor, who keeps users and backups.

use std::{collections::BTreeMap, path::PathBuf, sync::Arc, time::Duration};

use jiff::SignedDuration;
use sightglass::api::{
    access::{Completion, Durability, Secret, SessionRequest},
    history::Query,
    plant::{
        AlarmCommand, Command, CommandId, CommandKind, Diagnostic, PlantDef, ProcedureId, RequestRefusal, Role, TagId,
    },
    station::{Request, Session},
};
use tokio::sync::oneshot;

use crate::{
    dice::Dice,
    facts::{say, wrong},
    life::ask,
};

pub struct Operator {
    session: Session,
    def: Arc<PlantDef>,
    setpoint: TagId,
    /// What is written beside a command: which life it was.
    name: String,
    dice: Dice,
    /// In the last life nothing but setpoints is written.
    is_last: bool,
}

impl Operator {
    pub fn new(session: &Session, def: &Arc<PlantDef>, name: &str, dice: Dice, is_last: bool) -> Operator {
        let (session, def, name) = (session.clone(), def.clone(), name.to_owned());
        Operator { session, setpoint: def.tag_named("TIC-1.SV").unwrap(), def, name, dice, is_last }
    }

    /// Works until the station ends.
    pub async fn operate(mut self, after: Duration) {
        tokio::time::sleep(after).await;
        for number in 1.. {
            let pause = if self.is_last { 4_000 } else { 6_000 };
            tokio::time::sleep(Duration::from_millis(self.dice.below(pause))).await;
            let kind = match self.dice.below(if self.is_last { 4 } else { 24 }) {
                0..4 => {
                    let value = (40 + self.dice.below(40)) as f64;
                    Some(CommandKind::Write { tag: self.setpoint, value: value.into() })
                }
                4..9 => self.alarms(),
                9..20 => self.plant(),
                _ => {
                    self.look().await;
                    None
                }
            };
            if let Some(kind) = kind {
                self.send(number, kind);
            }
        }
    }

    fn alarms(&mut self) -> Option<CommandKind> {
        let some = self.def.alarms[self.dice.place(self.def.alarms.len())].id;
        let command = match self.dice.below(5) {
            0..2 => {
                let seen = self.session.snapshots.borrow().annunciations;
                AlarmCommand::AcknowledgeAll { alarms: None, seen }
            }
            2 => return Some(CommandKind::Alarm(AlarmCommand::Silence)),
            3 => AlarmCommand::Shelve { alarms: [some].into(), lasts: Duration::from_secs(600) },
            _ => AlarmCommand::Unshelve(some),
        };
        // Whether it is done may not be known when the station ends.
        say("unacknowledged", "");
        Some(CommandKind::Alarm(command))
    }

    fn plant(&mut self) -> Option<CommandKind> {
        let (device, line) = (self.def.devices[0].id, self.def.lines[0].id);
        let procedure = ProcedureId(self.dice.place(self.def.procedures.len()).try_into().unwrap());
        Some(match self.dice.below(11) {
            0 => CommandKind::HandOver,
            1 => CommandKind::TakeOver,
            2 => CommandKind::Refresh(device),
            3 => CommandKind::Connect(line, self.dice.chance(0.7)),
            4..7 => CommandKind::StartProcedure(procedure),
            7 => CommandKind::AbortProcedure(procedure),
            8 => CommandKind::SaveSet { device, name: format!("set {}", self.dice.below(3)).into(), replace: true },
            9 => CommandKind::Test(line, Diagnostic::Loopback { unit: 1, data: 0xA55A, count: 20 }),
            _ => {
                let tag = self.def.tag_named("PLC-1.BATCHES").unwrap();
                CommandKind::CorrectCounter { tag, amount: 1.0.into() }
            }
        })
    }

    async fn look(&mut self) {
        let to = self.session.snapshots.borrow().at;
        let from = to - SignedDuration::from_secs(3600);
        let tags = self.def.tags.iter().take(8).map(|tag| tag.id).collect();
        let _ = ask(&self.session, Query::Series { tags, from, to, buckets: 100 }).await;
    }

    fn send(&self, number: u32, kind: CommandKind) {
        let id = CommandId { terminal: self.session.terminal, number };
        let snapshot = self.session.snapshots.borrow().clone();
        // A read is no action, and stands in no log.
        let note = (!matches!(kind, CommandKind::Refresh(_))).then(|| format!("{}n{number}", self.name).into());
        let command = Command { note, ..snapshot.command(id, kind) };
        // A station that is too busy refuses it.
        let _ = self.session.send(Request::Command(command, None));
    }
}

/// Users that a supervisor keeps: a password each, by which they are let in.
pub struct Supervisor {
    session: Session,
    /// A terminal at which users log in.
    terminal: Session,
    dice: Dice,
    backups: PathBuf,
}

impl Supervisor {
    pub fn new(session: Session, terminal: Session, dice: Dice, backups: PathBuf) -> Supervisor {
        Supervisor { session, terminal, dice, backups }
    }

    /// Lets in who must be let in, and none else; then keeps users and backups until the station ends.
    pub async fn administer(mut self, users: BTreeMap<String, String>, after: Duration) {
        tokio::time::sleep(after).await;
        for (user, password) in &users {
            if let Err(why) = self.log_in(user, password).await {
                wrong(format!("access: {user}, who was added, is not let in: {why}"));
            }
        }
        for number in 0.. {
            tokio::time::sleep(Duration::from_millis(5_000 + self.dice.below(10_000))).await;
            let user = format!("{}{}", ["kai", "lek", "noi"][self.dice.place(3)], self.dice.below(4));
            match self.dice.below(4) {
                0 => self.back_up(number).await,
                1 => self.remove(user).await,
                2 if self.log_in(&format!("no-{user}"), "a password of nobody").await.is_ok() => {
                    wrong(format!("access: no-{user} is let in, and is no user"));
                }
                _ => self.add(user).await,
            }
        }
    }

    async fn add(&mut self, user: String) {
        let password = format!("correct horse {}", self.dice.below(1_000_000));
        // Whether it is done may not be known when the station ends.
        say("user", format!("{user} ?"));
        let request =
            SessionRequest::AddUser { user: user.clone(), role: Role::Technician, password: Secret(password.clone()) };
        if request_of(&self.session, request).await.is_ok_and(|done| done.durability == Durability::Recorded) {
            say("user", format!("{user} {password}"));
        }
    }

    async fn remove(&mut self, user: String) {
        say("user", format!("{user} ?"));
        let _ = request_of(&self.session, SessionRequest::DeleteUser { user }).await;
    }

    async fn log_in(&self, user: &str, password: &str) -> Result<Completion, RequestRefusal> {
        let _ = request_of(&self.terminal, SessionRequest::Logout).await;
        let request = SessionRequest::Login { user: user.to_owned(), password: Secret(password.to_owned()) };
        request_of(&self.terminal, request).await
    }

    async fn back_up(&self, number: u32) {
        let folder = self.backups.join(number.to_string()).display().to_string();
        let _ = request_of(&self.session, SessionRequest::Backup { folder }).await;
    }
}

async fn request_of(session: &Session, request: SessionRequest) -> Result<Completion, RequestRefusal> {
    let (reply, answer) = oneshot::channel();
    session.send(Request::SessionRequest(request, reply))?;
    answer.await.map_err(|_| RequestRefusal::StationEnded)?
}
