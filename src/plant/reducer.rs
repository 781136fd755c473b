//! The reducer of facts: event, order or tick in, effects out. The only place where the plant changes.

mod health;
mod service;

use std::{mem::discriminant, sync::Arc};

use jiff::Timestamp;

use super::{
    alarm::{Book, condition::Facts},
    board::Board,
    command::{BusRequest, Command, Order, OrderId, Outcome, Refusal, WriteId},
    def::{AlarmId, Condition, DeviceId, LineDef, LineId, PlantDef, Subject, TagId},
    event::{Event, Fault, LineState, WriteResult},
    line_minute::LineWatch,
    orders::Desk,
    record::{ActionRecord, AlarmRecord, Record},
    sample::Cause,
    snapshot::{DeviceState, DeviceStatus, HistoryStatus, LineStatus, Snapshot},
    traffic::Exchange,
};

/// What must happen outside because of what became true inside.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Effects {
    /// Requests for link tasks.
    pub bus: Vec<(LineId, BusRequest)>,
    /// Lines of the history.
    pub records: Vec<Record>,
    /// Settings of a line for the plant file, and the order that wishes it.
    pub save: Option<(OrderId, LineDef)>,
}

/// All that is true. Owned by the plant task, seen by everyone else as [`Snapshot`]s.
#[derive(Debug, Clone)]
pub struct Plant {
    def: Arc<PlantDef>,
    at: Timestamp,
    board: Board,
    book: Book,
    desk: Desk,
    lines: Vec<LineStatus>,
    /// Earlier reports, by [`LineId`].
    watches: Vec<LineWatch>,
    devices: Vec<DeviceStatus>,
    /// The last request for each tag, by [`TagId`].
    evidence: Arc<Vec<Option<Arc<Exchange>>>>,
    history: HistoryStatus,
    speed: f64,
}

impl Plant {
    /// Nothing read, nothing connected, as of `at`. `speed` is plant seconds per real second, for display.
    pub fn new(def: Arc<PlantDef>, at: Timestamp, speed: f64) -> Plant {
        Plant {
            board: Board::new(def.clone(), at),
            book: Book::new(def.clone()),
            desk: Desk::new(def.clone()),
            lines: vec![LineStatus::default(); def.lines.len()],
            watches: vec![LineWatch::default(); def.lines.len()],
            devices: vec![DeviceStatus::default(); def.devices.len()],
            evidence: Arc::new(vec![None; def.tags.len()]),
            history: HistoryStatus::default(),
            def,
            at,
            speed,
        }
    }

    /// Takes up the alarms that the journal remembers from before a restart, oldest step first.
    pub fn restore(&mut self, steps: &[AlarmRecord]) {
        self.book.restore(steps);
    }

    /// Takes a fact from the bus.
    pub fn on_event(&mut self, event: Event) -> Effects {
        let (at, action) = match event {
            Event::Read { at, device, values, reply, exchange } => {
                self.board.read(&values, at);
                self.keep_evidence(values.iter().map(|(tag, _)| *tag), exchange);
                let status = &mut self.devices[device.index()];
                status.state = DeviceState::Answering;
                status.reply = Some(reply);
                status.ok += 1;
                status.values += values.len() as u64;
                (at, None)
            }
            Event::Failed { at, device, tags, fault, exchange } => {
                self.keep_evidence(tags.iter().copied(), exchange);
                self.failed(device, &tags, fault, at);
                (at, None)
            }
            Event::Line { at, line, state } => (at, self.line_changed(line, state, at)),
            Event::Report { at, line, report } => {
                let status = &mut self.lines[line.index()];
                status.counters = report.counters;
                status.report = Some(report);
                (at, None)
            }
            Event::Tool { at, line, run } => {
                self.lines[line.index()].test = Some(run);
                (at, None)
            }
            Event::Wrote { at, id, result } => (at, self.wrote(id, result, at)),
        };
        let mut effects = self.settle(at);
        effects.records.extend(action.map(Record::Action));
        effects
    }

    /// Takes a wish of an operator.
    pub fn on_order(&mut self, order: Order, at: Timestamp) -> Effects {
        let mut effects = Effects::default();
        let action = match order.command.clone() {
            Command::Write { tag, value } => match self.desk.write(&self.board, &order, tag, value, at) {
                Ok(request) => {
                    effects.bus.push((self.line_of(tag), request));
                    None
                }
                Err(action) => action,
            },
            Command::Acknowledge(alarm) => {
                let step = self.book.acknowledge(alarm, at, order.by.clone());
                let outcome = done_if(step.is_some());
                effects.records.extend(step.map(Record::Alarm));
                self.desk.note(&order, outcome, &self.board, at)
            }
            Command::AcknowledgeAll => {
                let waiting = self.book.unacknowledged();
                let outcome = done_if(!waiting.is_empty());
                let steps = waiting.into_iter().filter_map(|id| self.book.acknowledge(id, at, order.by.clone()));
                effects.records.extend(steps.map(Record::Alarm));
                self.desk.note(&order, outcome, &self.board, at)
            }
            Command::Refresh(device) => {
                effects.bus.push((self.def.device(device).line, BusRequest::Refresh(device)));
                // Looking is not a deed: it is shown, but not put on record.
                let _ = self.desk.note(&order, Outcome::Verified, &self.board, at);
                None
            }
            Command::Connect(line, open) => {
                let is_open = self.lines[line.index()].state != LineState::Disconnected;
                if is_open == open {
                    self.desk.note(&order, Outcome::Unchanged, &self.board, at)
                } else {
                    self.desk.take(&order, at);
                    effects.bus.push((line, BusRequest::Connect(open)));
                    None
                }
            }
            Command::Configure(_) | Command::SaveSettings(_) | Command::Test(..) | Command::StopTest(_) => {
                self.line_order(&order, at, &mut effects)
            }
        };
        effects.records.extend(action.map(Record::Action));
        self.at = self.at.max(at);
        effects
    }

    /// The queue to a line was full: the request was not sent.
    pub fn on_undeliverable(&mut self, line: LineId, request: &BusRequest) -> Effects {
        let action = self.desk.undeliverable(line, request, &self.board);
        Effects { records: action.map(Record::Action).into_iter().collect(), ..Effects::default() }
    }

    /// The store says how it stands.
    pub fn on_history(&mut self, status: HistoryStatus) {
        self.history = status;
    }

    /// Time passes: values age, delays run out.
    pub fn on_tick(&mut self, at: Timestamp) -> Effects {
        self.board.age(at);
        let expired = self.desk.expire(at, self.speed, &self.board);
        let minutes = self.minutes(at);
        let mut effects = self.settle(at);
        effects.records.extend(minutes);
        effects.records.extend(expired.into_iter().map(Record::Action));
        effects
    }

    /// The plant as of its last event, order or tick.
    pub fn snapshot(&self) -> Snapshot {
        Snapshot {
            at: self.at,
            def: self.def.clone(),
            samples: self.board.samples().to_vec(),
            decimals: self.def.tags.iter().map(|tag| self.board.shown_decimals(tag)).collect(),
            evidence: self.evidence.clone(),
            lines: self.lines.clone(),
            devices: self.diagnosed(),
            alarms: self.book.active(),
            orders: self.desk.shown(),
            history: self.history.clone(),
            speed: self.speed,
        }
    }

    fn line_of(&self, tag: TagId) -> LineId {
        self.def.device(self.def.tag(tag).device).line
    }

    /// The bytes behind what was just learned of some tags. A value keeps its own when nothing was sent for it.
    fn keep_evidence(&mut self, tags: impl Iterator<Item = TagId>, exchange: Option<Arc<Exchange>>) {
        let Some(exchange) = exchange else { return };
        let evidence = Arc::make_mut(&mut self.evidence);
        for tag in tags {
            evidence[tag.index()] = Some(exchange.clone());
        }
    }

    /// A write ended. Unless it was read back or certainly had no effect, the value held until now is in doubt.
    fn wrote(&mut self, id: WriteId, result: WriteResult, at: Timestamp) -> Option<ActionRecord> {
        let in_doubt = match &result {
            WriteResult::NotRead(_) | WriteResult::Accepted | WriteResult::Lost(_) => self.desk.tag_of(id),
            WriteResult::ReadBack(_) | WriteResult::Refused(_) | WriteResult::NotSent(_) => None,
        };
        if let Some(tag) = in_doubt {
            self.board.failed(&[tag], Fault::Timeout, at);
        }
        self.desk.wrote(id, result, &self.board)
    }

    fn failed(&mut self, device: DeviceId, tags: &[TagId], fault: Fault, at: Timestamp) {
        self.board.failed(tags, fault, at);
        let status = &mut self.devices[device.index()];
        let down = matches!(status.state, DeviceState::Down { .. });
        match fault {
            // The bus has given the device up; these are its other tags.
            Fault::Resting => {
                if !down {
                    status.state = DeviceState::Down { since: at };
                }
                self.board.gone(device, Cause::DeviceDown, at);
                return;
            }
            Fault::NotConnected => return,
            // A device that says no is there; a gateway that says that it is away speaks for itself.
            Fault::Exception(code) if !code.is_of_gateway() => status.state = DeviceState::Answering,
            Fault::NotANumber => status.state = DeviceState::Answering,
            Fault::Exception(_)
            | Fault::Timeout
            | Fault::Crc { .. }
            | Fault::Lrc { .. }
            | Fault::NotHex(_)
            | Fault::Truncated { .. }
            | Fault::WrongUnit { .. }
            | Fault::WrongFunction { .. }
            | Fault::WrongLength { .. }
            | Fault::WrongEcho => {
                status.state = match status.state {
                    DeviceState::Down { since } => DeviceState::Down { since },
                    DeviceState::Failing(n) => DeviceState::Failing(n.saturating_add(1)),
                    DeviceState::Unknown | DeviceState::Answering => DeviceState::Failing(1),
                };
            }
        }
        status.failed += 1;
        status.last_fault = Some((at, fault));
    }

    fn line_changed(&mut self, line: LineId, state: LineState, at: Timestamp) -> Option<ActionRecord> {
        let status = &mut self.lines[line.index()];
        status.lost_since = match &state {
            LineState::Waiting { .. } => status.lost_since.or(Some(at)),
            LineState::Connecting => status.lost_since,
            LineState::Connected | LineState::Disconnected | LineState::Testing => None,
        };
        if status.since.is_none() || discriminant(&status.state) != discriminant(&state) {
            status.since = Some(at);
        }
        let open = state != LineState::Disconnected;
        // A closed line is the operator's wish: its devices are not asked, so their silence is no fault.
        let gone = match &state {
            LineState::Waiting { .. } => Some(DeviceState::Down { since: at }),
            LineState::Disconnected | LineState::Testing => Some(DeviceState::Unknown),
            // Opened anew at once, with other settings perhaps: what was read before may be of another device.
            LineState::Connecting if self.lines[line.index()].state == LineState::Connected => {
                Some(DeviceState::Unknown)
            }
            LineState::Connecting | LineState::Connected => None,
        };
        self.lines[line.index()].state = state;
        let action = self.desk.connected(line, open, &self.board);
        let Some(device_state) = gone else { return action };
        for device in self.def.devices.iter().filter(|device| device.line == line) {
            let status = &mut self.devices[device.id.index()];
            if !matches!((status.state, device_state), (DeviceState::Down { .. }, DeviceState::Down { .. })) {
                status.state = device_state;
            }
            self.board.gone(device.id, Cause::NotConnected, at);
        }
        action
    }

    /// Judges the alarms and gathers what must be stored.
    fn settle(&mut self, at: Timestamp) -> Effects {
        self.at = self.at.max(at);
        let (def, board, devices) = (&self.def, &self.board, &self.devices);
        let steps = self.book.judge(self.at, |alarm| facts(def, board, devices, alarm));
        let mut records = self.board.records(self.at);
        records.extend(steps.into_iter().map(Record::Alarm));
        Effects { records, ..Effects::default() }
    }
}

/// What is known for an alarm. Only good values count: an uncertain one neither raises nor clears.
fn facts(def: &PlantDef, board: &Board, devices: &[DeviceStatus], alarm: AlarmId) -> Facts {
    let alarm = def.alarm(alarm);
    let (value, answering) = match alarm.subject {
        Subject::Tag(tag) => (board.sample(tag).trusted(), None),
        Subject::Device(device) => (None, answers(devices[device.index()].state)),
    };
    let reference = match alarm.condition {
        Condition::Deviation { from, .. } => board.sample(from).trusted(),
        Condition::Limit { .. } | Condition::State { .. } | Condition::NotAnswering => None,
    };
    Facts { value, reference, answering }
}

fn answers(state: DeviceState) -> Option<bool> {
    match state {
        DeviceState::Unknown | DeviceState::Failing(_) => None,
        DeviceState::Answering => Some(true),
        DeviceState::Down { .. } => Some(false),
    }
}

fn done_if(done: bool) -> Outcome {
    if done { Outcome::Verified } else { Outcome::Refused(Refusal::NothingToAcknowledge) }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::plant::{
        alarm::AlarmState,
        command::{NotConfirmed, OrderId},
        event::ExceptionCode,
        fixture::{self, DP, FAULT, HIGH, PLC, PV, RUN, SILENT, SV, TIC},
        record::AlarmStep,
        sample::Quality,
    };

    const L1: LineId = LineId(0);

    fn at(second: i64) -> Timestamp {
        Timestamp::from_second(second).expect("a small number")
    }

    fn read(second: i64, values: &[(TagId, f64)]) -> Event {
        Event::Read {
            at: at(second),
            device: TIC,
            values: values.to_vec(),
            reply: Duration::from_millis(12),
            exchange: None,
        }
    }

    fn fail(second: i64, tags: &[TagId], fault: Fault) -> Event {
        Event::Failed { at: at(second), device: TIC, tags: tags.to_vec(), fault, exchange: None }
    }

    fn running() -> Plant {
        let mut plant = Plant::new(fixture::shared(), at(0), 1.0);
        plant.on_event(Event::Line { at: at(0), line: L1, state: LineState::Connected });
        plant.on_event(read(0, &[(PV, 700.0), (SV, 700.0), (DP, 1.0), (FAULT, 0.0)]));
        plant
    }

    fn order(number: u32, command: Command) -> Order {
        Order { id: OrderId { terminal: 1, number }, by: "anna".into(), command }
    }

    /// Orders `SV := value`, answers with `result`, and gives the outcome and the raw number that was sent.
    fn write(plant: &mut Plant, value: f64, result: WriteResult) -> (Outcome, Option<f64>) {
        let effects = plant.on_order(order(1, Command::Write { tag: SV, value }), at(1));
        let sent = effects.bus.first().map(|(_, request)| match request {
            BusRequest::Write { id, raw, .. } => (*id, *raw),
            other => panic!("not a write: {other:?}"),
        });
        if let Some((id, _)) = sent {
            assert_eq!(plant.snapshot().orders[0].outcome, Outcome::Pending);
            plant.on_event(Event::Wrote { at: at(2), id, result });
        }
        (plant.snapshot().orders[0].outcome.clone(), sent.map(|(_, raw)| raw))
    }

    #[test]
    fn a_write_is_verified_only_by_its_own_read_back() {
        let refused = |refusal| Outcome::Refused(refusal);
        for (value, result, outcome, sent) in [
            (72.5, WriteResult::ReadBack(725.0), Outcome::Verified, Some(725.0)),
            (72.5, WriteResult::ReadBack(700.0), Outcome::NotConfirmed(NotConfirmed::Different(70.0)), Some(725.0)),
            (
                72.5,
                WriteResult::NotRead(Fault::Timeout),
                Outcome::NotConfirmed(NotConfirmed::NotRead(Fault::Timeout)),
                Some(725.0),
            ),
            (72.5, WriteResult::Refused(ExceptionCode(3)), refused(Refusal::Exception(ExceptionCode(3))), Some(725.0)),
            (72.5, WriteResult::Lost(Fault::Timeout), Outcome::Failed(Fault::Timeout), Some(725.0)),
            (70.0, WriteResult::Accepted, Outcome::Unchanged, None),
            (
                100.1,
                WriteResult::Accepted,
                refused(Refusal::OutOfRange { min: "0.0".into(), max: "100.0".into() }),
                None,
            ),
            (
                f64::NAN,
                WriteResult::Accepted,
                refused(Refusal::OutOfRange { min: "0.0".into(), max: "100.0".into() }),
                None,
            ),
        ] {
            assert_eq!(write(&mut running(), value, result.clone()), (outcome, sent), "{value} {result:?}");
        }
    }

    #[test]
    fn after_a_write_that_may_have_failed_the_old_value_is_not_trusted() {
        for result in [WriteResult::Lost(Fault::Timeout), WriteResult::NotRead(Fault::Timeout)] {
            let mut plant = running();
            write(&mut plant, 72.5, result);
            assert_eq!(plant.snapshot().sample(SV).quality, Quality::Uncertain(Cause::Timeout));
            // The correction is really written, not taken for unchanged.
            assert_eq!(write(&mut plant, 70.0, WriteResult::ReadBack(700.0)), (Outcome::Verified, Some(700.0)));
        }
    }

    #[test]
    fn a_line_is_closed_when_it_says_so() {
        let mut plant = running();
        let effects = plant.on_order(order(1, Command::Connect(L1, false)), at(1));
        assert_eq!((effects.bus.len(), effects.records.len()), (1, 0));
        assert_eq!(plant.snapshot().orders[0].outcome, Outcome::Pending);
        let effects = plant.on_event(Event::Line { at: at(2), line: L1, state: LineState::Disconnected });
        assert_eq!(plant.snapshot().orders[0].outcome, Outcome::Verified);
        assert!(
            effects
                .records
                .iter()
                .any(|record| matches!(record, Record::Action(deed) if &*deed.action == "disconnect"))
        );
        plant.on_order(order(2, Command::Connect(L1, false)), at(3));
        assert_eq!(plant.snapshot().orders[0].outcome, Outcome::Unchanged);
        let effects = plant.on_order(order(3, Command::Connect(L1, true)), at(4));
        plant.on_undeliverable(L1, &effects.bus[0].1);
        assert_eq!(plant.snapshot().orders[0].outcome, Outcome::Refused(Refusal::Busy));
    }

    #[test]
    fn a_gateway_that_answers_for_a_dead_device_is_not_the_device() {
        let mut plant = running();
        plant.on_event(fail(1, &[PV], Fault::Exception(ExceptionCode(0x0B))));
        assert_eq!(plant.snapshot().devices[TIC.index()].state, DeviceState::Failing(1));
    }

    #[test]
    fn nothing_is_written_blindly() {
        let mut plant = Plant::new(fixture::shared(), at(0), 1.0);
        let unknown = Outcome::Refused(Refusal::Unknown("number of decimals".into()));
        assert_eq!(write(&mut plant, 50.0, WriteResult::Accepted), (unknown, None));
        for (tag, value, refusal) in [(PV, 1.0, Refusal::ReadOnly), (RUN, 2.0, Refusal::NotAChoice)] {
            let effects = plant.on_order(order(2, Command::Write { tag, value }), at(1));
            assert!(effects.bus.is_empty());
            assert_eq!(plant.snapshot().orders[0].outcome, Outcome::Refused(refusal));
        }
    }

    #[test]
    fn a_second_write_waits_for_the_first_and_a_lost_one_is_given_up() {
        let mut plant = running();
        plant.on_order(order(1, Command::Write { tag: SV, value: 71.0 }), at(1));
        plant.on_order(order(2, Command::Write { tag: SV, value: 72.0 }), at(2));
        assert_eq!(plant.snapshot().orders[0].outcome, Outcome::Refused(Refusal::UnderWay));
        let effects = plant.on_tick(at(122));
        assert_eq!(plant.snapshot().orders[1].outcome, Outcome::Failed(Fault::Timeout));
        assert!(effects.records.iter().any(|record| matches!(record, Record::Action(_))), "failures are on record too");
    }

    #[test]
    fn the_record_of_a_write_has_old_new_and_outcome() {
        let mut plant = running();
        let effects = plant.on_order(order(1, Command::Write { tag: SV, value: 72.5 }), at(1));
        let BusRequest::Write { id, .. } = effects.bus[0].1 else { panic!("a write was ordered") };
        let effects = plant.on_event(Event::Wrote { at: at(2), id, result: WriteResult::ReadBack(725.0) });
        let Some(Record::Action(action)) = effects.records.last() else { panic!("no action on record") };
        assert_eq!(
            (
                &*action.by,
                &*action.action,
                &*action.target,
                action.old.as_deref(),
                action.new.as_deref(),
                &*action.outcome
            ),
            ("anna", "write", "TIC-1.SV", Some("70.0 °C"), Some("72.5 °C"), "verified")
        );
    }

    #[test]
    fn a_silent_device_fails_then_is_down_then_comes_back() {
        let mut plant = running();
        plant.on_event(fail(1, &[PV], Fault::Timeout));
        let snapshot = plant.snapshot();
        assert_eq!(snapshot.devices[TIC.index()].state, DeviceState::Failing(1));
        assert_eq!(snapshot.sample(PV).quality, Quality::Uncertain(Cause::Timeout));
        assert_eq!(snapshot.sample(SV).quality, Quality::Good, "only what was asked for is in doubt");
        let effects = plant.on_event(fail(3, &[PV, SV, DP, FAULT], Fault::Resting));
        assert!(plant.snapshot().samples[..4].iter().all(|sample| sample.quality == Quality::Bad(Cause::DeviceDown)));
        assert!(
            effects
                .records
                .iter()
                .any(|record| matches!(record, Record::Alarm(step) if step.step == AlarmStep::Raised))
        );
        assert_eq!(plant.snapshot().alarms[0].id, SILENT);
        plant.on_event(read(9, &[(PV, 700.0), (DP, 1.0), (FAULT, 0.0)]));
        assert_eq!(plant.snapshot().alarms[0].state, AlarmState::Returned);
        assert_eq!(plant.snapshot().sample(PV).quality, Quality::Good);
    }

    #[test]
    fn an_unplugged_line_takes_all_values_and_a_closed_one_raises_no_alarm() {
        let mut plant = running();
        plant.on_event(Event::Line { at: at(1), line: L1, state: LineState::Disconnected });
        assert_eq!(plant.snapshot().sample(PV).quality, Quality::Bad(Cause::NotConnected));
        assert!(plant.snapshot().alarms.is_empty());
        let why = "No such file or directory".to_owned();
        plant.on_event(Event::Line { at: at(2), line: L1, state: LineState::Waiting { why, retry_at: at(3) } });
        assert_eq!(plant.snapshot().alarms.iter().map(|alarm| alarm.id).collect::<Vec<_>>(), [SILENT]);
        assert!(matches!(plant.snapshot().devices[PLC.index()].state, DeviceState::Down { .. }));
    }

    #[test]
    fn an_alarm_is_raised_acknowledged_by_name_and_returns() {
        let mut plant = running();
        plant.on_event(read(1, &[(PV, 760.0)]));
        plant.on_event(read(3, &[(PV, 761.0)]));
        assert_eq!(plant.snapshot().alarms[0].state, AlarmState::Unacknowledged);
        let effects = plant.on_order(order(1, Command::Acknowledge(HIGH)), at(4));
        assert!(matches!(&effects.records[0], Record::Alarm(step) if step.by.as_deref() == Some("anna")));
        let effects = plant.on_order(order(2, Command::AcknowledgeAll), at(4));
        assert!(
            !effects.records.iter().any(|record| matches!(record, Record::Alarm(_))),
            "it was acknowledged already"
        );
        plant.on_event(fail(5, &[PV], Fault::Timeout));
        assert_eq!(plant.snapshot().alarms[0].state, AlarmState::Acknowledged, "no answer is no return");
        plant.on_event(read(6, &[(PV, 700.0)]));
        assert!(plant.snapshot().alarms.is_empty());
    }

    #[test]
    fn a_full_queue_is_told_to_the_operator() {
        let mut plant = running();
        let effects = plant.on_order(order(1, Command::Write { tag: SV, value: 72.5 }), at(1));
        plant.on_undeliverable(effects.bus[0].0, &effects.bus[0].1);
        assert_eq!(plant.snapshot().orders[0].outcome, Outcome::Refused(Refusal::Busy));
    }
}
