//! The table of rights: what may be asked of a station, and the least role that may ask it.

use super::SessionRequest;
use crate::{
    history::Query,
    plant::{
        PlantDef, alarm::AlarmCommand, command::CommandKind, def::TagId, diagnostics::Diagnostic, exact::Exact,
        interlock, role::Role,
    },
};

/// What a person may do. A role has the rights of those before it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Right {
    /// See the process, curves, journals and reports.
    View,
    /// Control the process: write, acknowledge, open and close lines, use parameter sets, read-only tests of a line.
    Operate,
    /// Take what the station holds away as a file.
    Export,
    /// Change how a line works, or send bytes to it that may do anything.
    Engineer,
    /// Add, change and remove users.
    ManageUsers,
    /// End the station, give it another plant file, or have it write a backup.
    Station,
}

impl Right {
    /// Every right.
    #[cfg(test)]
    pub const ALL: [Right; 6] =
        [Right::View, Right::Operate, Right::Export, Right::Engineer, Right::ManageUsers, Right::Station];

    /// The least role that has it.
    pub fn role(self) -> Role {
        match self {
            Right::View => Role::Viewer,
            Right::Operate | Right::Export => Role::Technician,
            Right::Engineer | Right::ManageUsers | Right::Station => Role::Supervisor,
        }
    }
}

/// The right that a command needs.
pub fn of_command(kind: &CommandKind) -> Right {
    match kind {
        CommandKind::Write { .. }
        | CommandKind::WriteText { .. }
        | CommandKind::Alarm(
            AlarmCommand::Acknowledge { .. }
            | AlarmCommand::AcknowledgeAll { .. }
            | AlarmCommand::Silence
            | AlarmCommand::Reset(_)
            | AlarmCommand::Shelve { .. }
            | AlarmCommand::Unshelve(_)
            | AlarmCommand::Tick { .. },
        )
        | CommandKind::Refresh(_)
        | CommandKind::Connect(..)
        | CommandKind::StopTest(_)
        | CommandKind::ReadSets
        | CommandKind::SaveSet { .. }
        | CommandKind::Restore(_)
        | CommandKind::StopRestore(_)
        | CommandKind::StartProcedure(_)
        | CommandKind::AbortProcedure(_)
        | CommandKind::HandOver
        | CommandKind::TakeOver => Right::Operate,
        CommandKind::Alarm(AlarmCommand::OutOfService(_) | AlarmCommand::InService(_))
        | CommandKind::Configure(_)
        | CommandKind::SaveSettings(_)
        | CommandKind::CorrectCounter { .. } => Right::Engineer,
        CommandKind::Test(_, diagnostic) => of_diagnostic(diagnostic),
    }
}

/// The right that a test of a line needs.
fn of_diagnostic(diagnostic: &Diagnostic) -> Right {
    match diagnostic {
        // Raw bytes may be a write; with a signal the line is not polled, and a converter may lose its supply.
        Diagnostic::Send(_) | Diagnostic::Write(_) | Diagnostic::Pattern { .. } | Diagnostic::Signal(_) => {
            Right::Engineer
        }
        // While other settings are tried the line is not polled.
        Diagnostic::Scan(scan) if !scan.serials.is_empty() => Right::Engineer,
        Diagnostic::Scan(_)
        | Diagnostic::Sweep(_)
        | Diagnostic::Loopback { .. }
        | Diagnostic::Identify { .. }
        | Diagnostic::Read { .. } => Right::Operate,
    }
}

/// The least role that may give a command: what it writes may need more than its right.
pub fn needs(def: &PlantDef, kind: &CommandKind) -> Role {
    let of_write = |(tag, value): (TagId, Option<Exact>)| match value {
        Some(value) => interlock::role_to_write(def, tag, value),
        None => def.tag(tag).role,
    };
    let written = kind.writes(def).map(of_write);
    of_command(kind).role().max(written.max().unwrap_or(Role::Viewer))
}

/// The least role that may ask a query.
pub fn needs_for_query(query: &Query) -> Role {
    let right = match query {
        Query::Series { .. }
        | Query::Journal { .. }
        | Query::Actions { .. }
        | Query::LineMinutes { .. }
        | Query::AlarmMetrics { .. }
        | Query::Values { .. }
        | Query::Batches { .. }
        | Query::ControlRuns { .. }
        | Query::SampleTime { .. }
        | Query::Reports { .. }
        | Query::Past { .. }
        | Query::Samples { .. }
        | Query::Unarchived { .. }
        | Query::Overview
        | Query::Report { .. } => Right::View,
        Query::Audit { .. } => Right::ManageUsers,
        Query::Registers(_) => Right::Operate,
    };
    right.role()
}

/// The least role that may make a request; `None` where it is about oneself, so that access control decides by who one is.
pub fn needs_for_request(request: &SessionRequest) -> Option<Role> {
    let right = match request {
        SessionRequest::Login { .. }
        | SessionRequest::Logout
        | SessionRequest::Lock
        | SessionRequest::Unlock(_)
        | SessionRequest::Active
        | SessionRequest::FirstSupervisor { .. }
        | SessionRequest::ChangePassword { .. } => return None,
        SessionRequest::AddUser { .. }
        | SessionRequest::SetRole { .. }
        | SessionRequest::Disable { .. }
        | SessionRequest::DeleteUser { .. }
        | SessionRequest::ResetPassword { .. } => Right::ManageUsers,
        SessionRequest::Exported { .. } => Right::Export,
        SessionRequest::Backup { .. }
        | SessionRequest::Import { .. }
        | SessionRequest::Stop
        | SessionRequest::Reload => Right::Station,
    };
    Some(right.role())
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::{
        plant::{
            def::{ActionDef, AlarmId, DeviceId, LineId, TagId},
            diagnostics::Scan,
            fixture,
            parameter_set::{ParameterSet, PlannedChange},
            port_signals::{OutputSignal, SignalTest},
            restore::RestoreRequest,
            tag::Table,
        },
        profile,
    };

    /// The least role for each tag of the shipped controller that can be written; programs and alarms included.
    #[test]
    fn tuning_and_setup_need_a_supervisor_operation_does_not() {
        let def = profile::load(std::path::Path::new("tank"), &profile::Search::shipped()).expect("a shipped plant");
        let operated = ["SV", "STBY", "PROG"];
        let controller = &def.devices[0];
        assert_eq!(controller.profile, "fuji_pxr");
        for tag in def.tags_of(controller.id).filter(|tag| tag.writable()) {
            let role = if operated.contains(&tag.short.as_str()) { Role::Technician } else { Role::Supervisor };
            assert_eq!(needs(&def, &CommandKind::Write { tag: tag.id, value: 1.0.into() }), role, "{}", tag.name);
        }
    }

    #[test]
    fn a_set_needs_the_role_of_its_strictest_setting() {
        let mut def = fixture::plant();
        let change = |tag| PlannedChange { tag, old: 0.0.into(), new: 1.0.into() };
        let set = Arc::new(ParameterSet {
            name: "winter".into(),
            device: "PLC-1".into(),
            profile: "plc".into(),
            saved: jiff::Timestamp::UNIX_EPOCH,
            by: "boss".into(),
            given: Vec::new(),
            values: Vec::new(),
            units: std::collections::BTreeMap::new(),
            missing: Vec::new(),
        });
        let restore = |tags: &[TagId]| {
            let changes = tags.iter().copied().map(change).collect();
            let set = Arc::clone(&set);
            let request = RestoreRequest { device: DeviceId(0), from: Arc::from("winter"), set, changes };
            CommandKind::Restore(Box::new(request))
        };
        assert_eq!(needs(&def, &restore(&[fixture::SV, fixture::RUN])), Role::Technician);
        def.tags[fixture::SV.index()].role = Role::Supervisor;
        assert_eq!(needs(&def, &restore(&[fixture::RUN])), Role::Technician);
        assert_eq!(needs(&def, &restore(&[fixture::SV, fixture::RUN])), Role::Supervisor);
    }

    #[test]
    fn an_action_has_a_role_and_a_stop_needs_only_a_technician() {
        let mut def = fixture::plant();
        def.tags[fixture::RUN.index()].role = Role::Supervisor;
        let write = |value| CommandKind::Write { tag: fixture::RUN, value };
        let role = |def: &PlantDef, value| needs(def, &write(value));
        assert_eq!([0.0, 1.0, 2.0].map(|value| role(&def, value.into())), [Role::Supervisor; 3]);
        let device = def.tag(fixture::RUN).device.index();
        let action = ActionDef {
            name: "GO".into(),
            tag: fixture::RUN,
            value: 1.0,
            settle: std::time::Duration::ZERO,
            confirm: String::new(),
            stop: false,
            saves: false,
            role: Some(Role::Technician),
        };
        let stop = ActionDef { value: 0.0, stop: true, role: None, ..action.clone() };
        def.devices[device].actions = vec![action, stop];
        let expected = [Role::Technician, Role::Technician, Role::Supervisor];
        assert_eq!([0.0, 1.0, 2.0].map(|value| role(&def, value.into())), expected);
        assert_eq!(interlock::least_role_to_write(&def, fixture::RUN), Role::Technician);
    }

    #[test]
    fn each_command_is_for_the_role_that_the_manual_names() {
        let def = fixture::plant();
        let line = def.lines[0].clone();
        let scan =
            |serials| Diagnostic::Scan(Scan { first: 1, last: 9, serials, timeout: std::time::Duration::from_secs(1) });
        let serial = crate::plant::def::Serial::USUAL;
        let signal = SignalTest { signal: OutputSignal::Rts, on: true, seconds: 1 };
        let technician = [
            CommandKind::Write { tag: TagId(1), value: 1.0.into() },
            CommandKind::Alarm(AlarmCommand::Acknowledge {
                alarm: AlarmId(0),
                annunciated_at: jiff::Timestamp::UNIX_EPOCH,
            }),
            CommandKind::Alarm(AlarmCommand::AcknowledgeAll { alarms: None, seen: 0 }),
            CommandKind::Alarm(AlarmCommand::Silence),
            CommandKind::Alarm(AlarmCommand::Reset(AlarmId(0))),
            CommandKind::Refresh(DeviceId(0)),
            CommandKind::Connect(LineId(0), true),
            CommandKind::StopTest(LineId(0)),
            CommandKind::ReadSets,
            CommandKind::SaveSet { device: DeviceId(0), name: Arc::from("winter"), replace: true },
            CommandKind::StopRestore(DeviceId(0)),
            CommandKind::HandOver,
            CommandKind::TakeOver,
            CommandKind::Test(LineId(0), Diagnostic::Loopback { unit: 1, data: 7, count: 1 }),
            CommandKind::Test(LineId(0), Diagnostic::Identify { unit: 1 }),
            CommandKind::Test(LineId(0), Diagnostic::Read { unit: 1, table: Table::Holding, address: 0, count: 1 }),
            CommandKind::Test(LineId(0), scan(Vec::new())),
        ];
        let supervisor = [
            CommandKind::Configure(Box::new(line)),
            CommandKind::SaveSettings(LineId(0)),
            CommandKind::CorrectCounter { tag: TagId(1), amount: 1.0.into() },
            CommandKind::Test(LineId(0), Diagnostic::Send(vec![1])),
            CommandKind::Test(LineId(0), scan(vec![serial])),
            CommandKind::Test(LineId(0), Diagnostic::Signal(signal)),
        ];
        for (commands, role) in [(&technician[..], Role::Technician), (&supervisor[..], Role::Supervisor)] {
            for kind in commands {
                assert_eq!(needs(&def, kind), role, "{kind:?}");
            }
        }
    }

    #[test]
    fn each_request_needs_the_role_of_the_manual() {
        let (user, password) = (String::new(), super::super::Secret::default());
        let own = [
            SessionRequest::Login { user: user.clone(), password: password.clone() },
            SessionRequest::Logout,
            SessionRequest::Lock,
            SessionRequest::Unlock(password.clone()),
            SessionRequest::Active,
            SessionRequest::FirstSupervisor { user: user.clone(), password: password.clone() },
            SessionRequest::ChangePassword { old: password.clone(), new: password.clone() },
        ];
        let supervisor = [
            SessionRequest::AddUser { user: user.clone(), role: Role::Viewer, password: password.clone() },
            SessionRequest::SetRole { user: user.clone(), role: Role::Viewer },
            SessionRequest::Disable { user: user.clone(), disabled: true },
            SessionRequest::DeleteUser { user: user.clone() },
            SessionRequest::ResetPassword { user: user.clone(), password },
            SessionRequest::Backup { folder: user.clone() },
            SessionRequest::Import { file: user.clone() },
            SessionRequest::Stop,
            SessionRequest::Reload,
        ];
        let exported = SessionRequest::Exported { file: user.clone(), sha256: Ok(user) };
        assert!(own.iter().all(|request| needs_for_request(request).is_none()));
        assert!(supervisor.iter().all(|request| needs_for_request(request) == Some(Role::Supervisor)));
        assert_eq!(needs_for_request(&exported), Some(Role::Technician));
    }

    #[test]
    fn a_role_has_every_right_of_the_role_below_it() {
        let rights = |role| Right::ALL.into_iter().filter(move |right| right.role() <= role).count();
        assert_eq!([Role::Viewer, Role::Technician, Role::Supervisor].map(rights), [1, 3, 6]);
    }
}
