//! Every role against everything that can be asked, by every way in: what the tables of rights say is what happens.

use super::*;
use crate::{
    access::right::{needs, needs_for_query, needs_for_request},
    history::Query,
    plant::{
        Plant,
        alarm::AlarmCommand,
        command::{BusRequest, Outcome, WriteJob},
        def::{ActionDef, AlarmId, DeviceId, LineId, ProcedureId, Serial, TagId},
        diagnostics::{Diagnostic, RegisterWrite, Scan},
        event::Event,
        interlock::{InterlockCondition, InterlockDef},
        line_state::LineState,
        live::LiveRead,
        number::to_i8,
        parameter_set::{ParameterSet, PlannedChange},
        port_signals::{OutputSignal, SignalTest},
        procedure::{ProcedureDef, ProcedureStep},
        restore::RestoreRequest,
        scale,
        sweep::Sweep,
        tag::{DataType, Decimals, Table},
    },
    report::Period,
};

/// All examples of a type; without a row for each variant this does not compile.
macro_rules! every {
    ($all:ident: $type:ty { $($pattern:pat => $examples:expr,)* }) => {
        fn $all() -> Vec<$type> {
            let _ = |one: &$type| match one { $($pattern => (),)* };
            let mut all = Vec::new();
            $(all.extend($examples);)*
            all
        }
    };
}

const AT: Timestamp = Timestamp::UNIX_EPOCH;
const ALARM: AlarmId = AlarmId(0);
const L1: LineId = LineId(0);
const UNIT: u8 = 1;

every!(alarm_commands: AlarmCommand {
    AlarmCommand::Acknowledge { .. } => [AlarmCommand::Acknowledge { alarm: ALARM, annunciated_at: AT }],
    AlarmCommand::AcknowledgeAll { .. } => [AlarmCommand::AcknowledgeAll { alarms: None, seen: 0 }],
    AlarmCommand::Silence => [AlarmCommand::Silence],
    AlarmCommand::Reset(_) => [AlarmCommand::Reset(ALARM)],
    AlarmCommand::Shelve { .. } => [AlarmCommand::Shelve { alarms: Arc::from([ALARM]), lasts: Duration::from_secs(60) }],
    AlarmCommand::Unshelve(_) => [AlarmCommand::Unshelve(ALARM)],
    AlarmCommand::OutOfService(_) => [AlarmCommand::OutOfService(ALARM)],
    AlarmCommand::InService(_) => [AlarmCommand::InService(ALARM)],
    AlarmCommand::Tick { .. } => [AlarmCommand::Tick { alarm: ALARM, raised_at: AT, step: 0, done: true }],
});

fn scan(serials: Vec<Serial>) -> Diagnostic {
    Diagnostic::Scan(Scan { first: 1, last: 9, serials, timeout: Duration::from_secs(1) })
}

every!(diagnostics: Diagnostic {
    Diagnostic::Send(_) => [Diagnostic::Send(vec![1])],
    Diagnostic::Loopback { .. } => [Diagnostic::Loopback { unit: UNIT, data: 7, count: 1 }],
    Diagnostic::Pattern { .. } => [Diagnostic::Pattern { bits: 8, count: 1 }],
    Diagnostic::Identify { .. } => [Diagnostic::Identify { unit: UNIT }],
    Diagnostic::Read { .. } => [Diagnostic::Read { unit: UNIT, table: Table::Holding, address: 0, count: 1 }],
    Diagnostic::Scan(_) => [scan(Vec::new()), scan(vec![Serial::USUAL])],
    Diagnostic::Sweep(_) => [Diagnostic::Sweep(Sweep { unit: UNIT, table: Table::Holding, first: 0, last: 9, every: 1 })],
    Diagnostic::Write(_) => [Diagnostic::Write(RegisterWrite {
        unit: UNIT, table: Table::Holding, address: 0, words: vec![1], expected: vec![0], multiple: false, clock: None
    })],
    Diagnostic::Signal(_) => [Diagnostic::Signal(SignalTest { signal: OutputSignal::Rts, on: true, seconds: 1 })],
});

fn restore(tag: TagId, new: f64) -> CommandKind {
    let set = ParameterSet {
        name: "winter".into(),
        device: "TIC-1".into(),
        profile: "fixture".into(),
        saved: AT,
        by: "boss".into(),
        given: Vec::new(),
        values: Vec::new(),
        units: BTreeMap::new(),
        missing: Vec::new(),
    };
    let changes = vec![PlannedChange { tag, old: 0.0.into(), new: new.into() }];
    let request = RestoreRequest { device: fixture::TIC, from: Arc::from("winter"), set: Arc::new(set), changes };
    CommandKind::Restore(Box::new(request))
}

every!(commands: CommandKind {
    CommandKind::Write { .. } => [RUN, SV, CommandKind::Write { tag: fixture::RUN, value: 0.0.into() }],
    CommandKind::WriteText { .. } => [CommandKind::WriteText { tag: fixture::SV, text: "A".into(), seen: None }],
    CommandKind::Alarm(_) => alarm_commands().into_iter().map(CommandKind::Alarm),
    CommandKind::Refresh(_) => [CommandKind::Refresh(DeviceId(0))],
    CommandKind::Connect(..) => [CommandKind::Connect(L1, true), CommandKind::Connect(L1, false)],
    CommandKind::Configure(_) => [CommandKind::Configure(Box::new(fixture::plant().lines[0].clone()))],
    CommandKind::SaveSettings(_) => [CommandKind::SaveSettings(L1)],
    CommandKind::Test(..) => diagnostics().into_iter().map(|diagnostic| CommandKind::Test(L1, diagnostic)),
    CommandKind::StopTest(_) => [CommandKind::StopTest(L1)],
    CommandKind::ReadSets => [CommandKind::ReadSets],
    CommandKind::SaveSet { .. } => [CommandKind::SaveSet { device: fixture::TIC, name: "winter".into(), replace: true }],
    CommandKind::Restore(_) => [restore(fixture::SV, 3.4), restore(fixture::RUN, 1.0)],
    CommandKind::StopRestore(_) => [CommandKind::StopRestore(DeviceId(0))],
    CommandKind::StartProcedure(_) => [CommandKind::StartProcedure(ProcedureId(0)), CommandKind::StartProcedure(ProcedureId(1))],
    CommandKind::AbortProcedure(_) => [CommandKind::AbortProcedure(ProcedureId(0))],
    CommandKind::CorrectCounter { .. } => [CommandKind::CorrectCounter { tag: fixture::RUN, amount: 1.0.into() }],
    CommandKind::HandOver => [CommandKind::HandOver],
    CommandKind::TakeOver => [CommandKind::TakeOver],
});

fn span<T>(query: impl FnOnce(Timestamp, Timestamp) -> T) -> [T; 1] {
    [query(AT, AT)]
}

every!(queries: Query {
    Query::Series { .. } => span(|from, to| Query::Series { tags: Vec::new(), from, to, buckets: 1 }),
    Query::Journal { .. } => span(|from, to| Query::Journal { from, to, limit: 1 }),
    Query::Actions { .. } => span(|from, to| Query::Actions { from, to, limit: 1 }),
    Query::Audit { .. } => span(|from, to| {
        let (words, by, action) = Default::default();
        Query::Audit { from, to, words, by, action, limit: 1 }
    }),
    Query::LineMinutes { .. } => span(|from, to| Query::LineMinutes { line: L1, from, to, limit: 1 }),
    Query::Report { .. } => span(|from, to| Query::Report { period: Period::free(from, to) }),
    Query::AlarmMetrics { .. } => span(|from, to| Query::AlarmMetrics { from, to }),
    Query::Values { .. } => [Query::Values { tags: Vec::new(), from: AT, every: Duration::from_secs(1), count: 1 }],
    Query::Batches { .. } => span(|from, to| Query::Batches { from, to, limit: 1 }),
    Query::ControlRuns { .. } => span(|from, to| Query::ControlRuns { controller: None, from, to, limit: 1 }),
    Query::SampleTime { .. } => span(|from, to| Query::SampleTime { tags: Vec::new(), from, to, latest: true }),
    Query::Reports { .. } => [Query::Reports { limit: 1 }],
    Query::Past { .. } => [Query::Past { at: AT }],
    Query::Overview => [Query::Overview],
    Query::Samples { .. } => span(|from, to| Query::Samples { epoch: None, from, to }),
    Query::Unarchived { .. } => span(|from, to| Query::Unarchived { from, to }),
    Query::Registers(_) => [Query::Registers(LiveRead {
        line: L1, unit: UNIT, spans: Vec::new(), not_before: None, relearn: false,
    })],
});

fn eve() -> String {
    "eve".into()
}

every!(requests: SessionRequest {
    SessionRequest::Login { .. } => [SessionRequest::Login { user: eve(), password: "x".into() }],
    SessionRequest::Logout => [SessionRequest::Logout],
    SessionRequest::Lock => [SessionRequest::Lock],
    SessionRequest::Unlock(_) => [SessionRequest::Unlock("x".into())],
    SessionRequest::Active => [SessionRequest::Active],
    SessionRequest::FirstSupervisor { .. } => [SessionRequest::FirstSupervisor { user: eve(), password: "x".into() }],
    SessionRequest::ChangePassword { .. } => [SessionRequest::ChangePassword { old: "x".into(), new: "y".into() }],
    SessionRequest::AddUser { .. } => {
        [Role::Viewer, Role::Supervisor].map(|role| SessionRequest::AddUser { user: eve(), role, password: "x".into() })
    },
    SessionRequest::SetRole { .. } => ["tech", "TECH", "view"].map(|user| {
        SessionRequest::SetRole { user: user.into(), role: Role::Supervisor }
    }),
    SessionRequest::Disable { .. } => [true, false].map(|disabled| SessionRequest::Disable { user: "boss".into(), disabled }),
    SessionRequest::DeleteUser { .. } => [SessionRequest::DeleteUser { user: "boss".into() }],
    SessionRequest::ResetPassword { .. } => [SessionRequest::ResetPassword { user: "Boss".into(), password: "x".into() }],
    SessionRequest::Exported { .. } => [SessionRequest::Exported { file: eve(), sha256: Ok(eve()) }],
    SessionRequest::Backup { .. } => [SessionRequest::Backup { folder: eve() }],
    SessionRequest::Import { .. } => [SessionRequest::Import { file: eve() }],
    SessionRequest::Stop => [SessionRequest::Stop],
    SessionRequest::Reload => [SessionRequest::Reload],
});

/// A way in: a screen in the process of the station, a terminal or command with a name in two spellings, a command
/// of a trusted user of the operating system, a request over MQTT.
#[derive(Debug, Clone, Copy)]
enum Way {
    Screen,
    Socket,
    Capitals,
    Trusted,
    Mqtt,
}

const WAYS: [Way; 5] = [Way::Screen, Way::Socket, Way::Capitals, Way::Trusted, Way::Mqtt];
const ROLES: [Option<Role>; 4] = [None, Some(Role::Viewer), Some(Role::Technician), Some(Role::Supervisor)];

/// The fixture with values that need another role than their tag.
fn plant() -> PlantDef {
    let mut def = fixture::plant();
    let action = |tag, value, role, stop| ActionDef {
        name: "DO".into(),
        tag,
        value,
        settle: Duration::ZERO,
        confirm: String::new(),
        stop,
        saves: false,
        role,
    };
    def.tags[fixture::RUN.index()].role = Role::Supervisor;
    def.devices[fixture::PLC.index()].actions = vec![action(fixture::RUN, 0.0, None, true)];
    def.devices[fixture::TIC.index()].actions = vec![action(fixture::SV, 3.0, Some(Role::Supervisor), false)];
    def.procedures = [3.4, 50.0].map(procedure).into();
    def
}

fn procedure(value: f64) -> ProcedureDef {
    let steps = vec![ProcedureStep::Write { tag: fixture::SV, value }];
    ProcedureDef { name: "fill".into(), about: String::new(), steps, safe: Vec::new(), reference: None }
}

/// A session of this role, by this way.
fn session(way: Way, role: Option<Role>, def: &PlantDef) -> Bench {
    let mut bench = Bench::new(AccessDef::default());
    let trusted = role.filter(|_| matches!(way, Way::Trusted)).map(|role| ("panel".to_owned(), role));
    let access = AccessDef { trusted: trusted.into_iter().collect(), ..AccessDef::default() };
    bench.access.def = Arc::new(PlantDef { access, ..def.clone() });
    let login = match role {
        None => ("eve", "x"),
        Some(Role::Viewer) => ("view", VIEW),
        Some(Role::Technician) => ("tech", TECH),
        Some(Role::Supervisor) => ("boss", BOSS),
    };
    let peer = |in_process| Peer { from: "here".into(), unix_user: Some("panel".into()), in_process };
    let (capitals, now) = (login.0.to_uppercase(), bench.now);
    let name = match way {
        Way::Mqtt => {
            let opened = bench.access.open_delegate(1, &login.0.into(), "MQTT", now);
            bench.work(opened);
            return bench;
        }
        Way::Capitals => &capitals,
        Way::Screen | Way::Socket | Way::Trusted => login.0,
    };
    bench.access.open(1, peer(matches!(way, Way::Screen)), now);
    if role.is_some() && !matches!(way, Way::Trusted) {
        bench.login(1, name, login.1).unwrap();
    }
    bench
}

/// Is it refused because of who asks?
fn is_about_role(why: &RequestRefusal) -> bool {
    matches!(why, RequestRefusal::Role { .. } | RequestRefusal::LogInFirst | RequestRefusal::NoSuchDelegate(_))
}

#[test]
fn every_role_may_by_every_way_what_the_tables_say() {
    let def = plant();
    let (mut cells, mut holes) = (0, Vec::new());
    let mut check = |what: &dyn std::fmt::Debug, way, role: Option<Role>, needed: Role, refused: bool| {
        cells += 1;
        if refused == role.is_some_and(|role| needed <= role) {
            holes.push(format!("{what:?} by {way:?} as {role:?}: refused {refused}"));
        }
    };
    for (way, role) in WAYS.into_iter().flat_map(|way| ROLES.map(|role| (way, role))) {
        for kind in commands() {
            let (_, why) = session(way, role, &def).send_command(1, kind.clone(), None).unwrap();
            let refused = matches!(&why, Some(Refusal::NotPermitted(why)) if is_about_role(why));
            assert!(refused || !matches!(why, Some(Refusal::NotPermitted(_))), "{kind:?}: {why:?}");
            check(&kind, way, role, needs(&def, &kind), refused);
        }
        for query in queries() {
            let mut bench = session(way, role, &def);
            let refused = bench.access.may_ask(1, &query, bench.now).is_err();
            check(&query, way, role, needs_for_query(&query), refused);
        }
        for request in requests() {
            let mut bench = session(way, role, &def);
            let effects = bench.access.on_request(1, 99, request.clone(), bench.now);
            let why = effects.into_iter().find_map(|effect| match effect {
                Effect::Reply(99, Err(why)) => Some(why),
                _ => None,
            });
            let refused = why.as_ref().is_some_and(is_about_role);
            match needs_for_request(&request) {
                Some(needed) => check(&request, way, role, needed, refused),
                None => assert!(!matches!(why, Some(RequestRefusal::Role { .. })), "{request:?}"),
            }
        }
    }
    assert_eq!(holes, [""; 0], "of {cells} cells");
    assert!(cells > 1_300, "{cells}");
}

/// A register, and by how many decimals its device scales it (`None`: the plant file does).
struct Register(DataType, f64, f64, Option<u8>);

const REGISTERS: [Register; 9] = [
    Register(DataType::I16, 1.0, 0.0, None),
    Register(DataType::U16, 1.0, 0.0, None),
    Register(DataType::I16, 0.1, 0.0, None),
    Register(DataType::I16, 0.5, -10.0, None),
    Register(DataType::I16, -1.0, 0.0, None),
    Register(DataType::F32, 1.0, 0.0, None),
    Register(DataType::F32, 0.1, 0.0, None),
    Register(DataType::I16, 1.0, 0.0, Some(0)),
    Register(DataType::I16, 1.0, 0.0, Some(1)),
];

/// Values of a tag with rules of their own.
const STOP: f64 = 0.0;
const SUPERVISOR: f64 = 3.0;
const TECHNICIAN: f64 = 5.0;
const BLOCKED: f64 = 7.0;

/// A plant whose setpoint is such a register, for this role, with a password for all but a stop if `signed`.
fn with_rules(register: &Register, role: Role, signed: bool) -> PlantDef {
    let mut def = plant();
    let Register(kind, scale, offset, announced) = *register;
    let sv = &mut def.tags[fixture::SV.index()];
    (sv.point.kind, sv.scale, sv.offset, sv.min, sv.max) = (kind, scale, offset, None, None);
    (sv.role, sv.reauthenticate) = (role, signed.then_some(Reauthentication::Password));
    if announced.is_none() {
        sv.decimals = Decimals::Fixed(1);
    }
    let action = def.devices[fixture::TIC.index()].actions[0].clone();
    let rules = [(STOP, None), (SUPERVISOR, Some(Role::Supervisor)), (TECHNICIAN, Some(Role::Technician))];
    let actions = rules.map(|(value, role)| ActionDef { value, role, stop: value == STOP, ..action.clone() });
    def.devices[fixture::TIC.index()].actions = actions.into();
    let (when, message) = (InterlockCondition::Is(0.0), "no".to_owned());
    let lock = InterlockDef { tag: fixture::SV, value: BLOCKED, of: fixture::FAULT, when, message, refuse: true };
    def.logic.interlocks = vec![lock];
    def
}

/// The values of the rules, and what is off by rounding, sign or the last digit; and what is no number for a register.
fn candidates(scale: f64) -> Vec<f64> {
    let off = [0.0, 0.6, 0.5, 0.4, 0.04, 1e-9, 1e-300, f64::EPSILON];
    let off = off.into_iter().chain([0.6, 0.5, 0.4].map(|part| part * scale));
    let near = |by: f64| [STOP, SUPERVISOR, TECHNICIAN, BLOCKED, 9.0].map(|rule| [rule + by, rule - by, -rule - by]);
    let odd = [-0.0, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300, -1e300, 1e15 + 3.0, 65_539.0, -65_533.0];
    off.flat_map(near).flatten().chain(odd).collect()
}

/// What the line is asked to write when this is sent by a terminal.
fn sent(def: &PlantDef, register: &Register, role: Role, kind: CommandKind) -> Option<WriteJob> {
    let mut plant = Plant::new(Arc::new(def.clone()), AT, 1.0);
    plant.on_event(Event::Line { at: AT, line: L1, state: LineState::Connected });
    let decimals = f64::from(register.3.unwrap_or(1));
    plant.on_event(Event::Read {
        at: AT,
        device: fixture::TIC,
        values: fixture::raw([(fixture::DP, decimals), (fixture::FAULT, 0.0), (fixture::SV, 99.0)]),
        texts: Vec::new(),
        response_time: Duration::ZERO,
        exchange: None,
    });
    let expected_value = plant.snapshot().expected_value(&kind);
    let command = Command { expected_value, ..Command::new(0, CommandId { terminal: 1, number: 1 }, kind) };
    let mut bench = session(Way::Socket, Some(role), def);
    let effects = bench.access.on_command(1, command, None, bench.now);
    let status = effects.into_iter().find_map(|effect| match effect {
        Effect::Command(status) if status.outcome == Outcome::Pending => Some(status),
        _ => None,
    })?;
    plant.on_command(status, AT).bus.into_iter().find_map(|(_, request)| match request {
        BusRequest::Write(job) => Some(job),
        _ => None,
    })
}

#[test]
fn rules_hold_for_what_is_sent_not_for_what_is_typed() {
    let (mut cells, mut written) = (0, 0);
    for register in &REGISTERS {
        for (of_tag, signed) in [(Role::Technician, false), (Role::Supervisor, false), (Role::Technician, true)] {
            let def = with_rules(register, of_tag, signed);
            let tag = def.tag(fixture::SV);
            let raw = |rule: f64| scale::to_raw(tag, rule, register.3.map_or(0, to_i8));
            for (role, value) in [Role::Technician, Role::Supervisor]
                .into_iter()
                .flat_map(|r| candidates(tag.scale).into_iter().map(move |v| (r, v)))
            {
                cells += 1;
                let kind = CommandKind::Write { tag: tag.id, value: value.into() };
                let Some(job) = sent(&def, register, role, kind.clone()) else { continue };
                written += 1;
                let raw_sent = job.raw.number().expect("a number");
                let is = |rule| raw(rule).is_some_and(|rule| scale::same_raw(tag, rule, raw_sent));
                let needed = match () {
                    () if is(STOP) || is(TECHNICIAN) => Role::Technician,
                    () if is(SUPERVISOR) => Role::Supervisor,
                    () => of_tag,
                };
                let case = format!("{:?} · {}: {value:?} as {role:?}, {job:?}", register.0, register.1);
                assert!(needed <= role, "{case}");
                assert!(!is(BLOCKED), "the interlock: {case}");
                assert_eq!(job.urgent, is(STOP), "{case}");
                assert!(!signed || is(STOP), "no password was given: {case}");
                assert!(raw_sent != 0.0 || raw_sent.near().is_sign_positive(), "a zero with a sign: {case}");
                let planned = PlantDef { procedures: vec![procedure(value)], ..def.clone() };
                for other in [restore(tag.id, value), CommandKind::StartProcedure(ProcedureId(0))] {
                    assert_eq!(needs(&planned, &other), needs(&def, &kind), "{case}");
                }
            }
        }
    }
    assert!(cells > 5_000 && written > 1_000, "{cells} {written}");
}
