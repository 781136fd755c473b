//! What comes from outside: whether it names things of this plant at all, and is no longer than it can be. Inside, ids are
//! taken on trust.

use jiff::SignedDuration;

use super::protocol::encode;
use crate::{
    history::Query,
    plant::{
        PlantDef,
        alarm::AlarmCommand,
        command::CommandKind,
        def::{AlarmId, DeviceId, LineId, TagId},
        line_check::valid,
        parameter_set::NAME_MAX,
        restore::RestoreRequest,
    },
};

/// Most characters of a name, or of where a set of values comes from.
const WORDS_MAX: usize = 200;
/// Longest text of a tag: that of one read, as the hex of its bytes.
const TEXT_MAX: usize = 750;
/// Most bytes of the settings of a line.
const SETTINGS_BYTES_MAX: usize = 4 << 10;

/// Most columns of a curve: more than any screen has.
pub const BUCKETS_MAX: usize = 4_096;
/// Most columns of all curves of one query.
pub const COLUMNS_MAX: usize = 65_536;
/// The longest span in which the time of a value is searched.
const SAMPLE_SPAN_MAX: SignedDuration = SignedDuration::from_hours(2);
/// Most curves of one query.
pub const SERIES_MAX: usize = 64;
/// Most rows of one answer.
const ROWS_MAX: usize = 10_000;
/// Longest period of a report: five years.
const REPORT_MAX: SignedDuration = SignedDuration::from_hours(5 * 366 * 24);

/// `Err` says what a command names that this plant does not have.
pub fn command(def: &PlantDef, kind: &CommandKind) -> Result<(), String> {
    match kind {
        CommandKind::Write { tag: id, value: _ } | CommandKind::CorrectCounter { tag: id, amount: _ } => tag(def, *id),
        CommandKind::WriteText { tag: id, text, seen } => {
            short("text", text, TEXT_MAX)?;
            short("text", seen.as_deref().unwrap_or_default(), TEXT_MAX)?;
            tag(def, *id)
        }
        CommandKind::Alarm(alarm_command) => of_alarms(def, alarm_command),
        CommandKind::ReadSets | CommandKind::HandOver | CommandKind::TakeOver => Ok(()),
        CommandKind::Refresh(id) | CommandKind::StopRestore(id) => device(def, *id),
        CommandKind::SaveSet { device: id, name, replace: _ } => {
            short("name", name, NAME_MAX)?;
            device(def, *id)
        }
        CommandKind::Connect(id, _) | CommandKind::SaveSettings(id) | CommandKind::StopTest(id) => line(def, *id),
        CommandKind::Test(id, diagnostic) => {
            diagnostic.check()?;
            line(def, *id)
        }
        CommandKind::Configure(settings) => {
            encode(settings, SETTINGS_BYTES_MAX).map_err(|error| format!("settings: {error}"))?;
            valid(settings)?;
            line(def, settings.id)
        }
        CommandKind::Restore(request) => of_restore(def, request),
        CommandKind::StartProcedure(id) | CommandKind::AbortProcedure(id) => {
            known("procedure", id.0, def.procedures.len())
        }
    }
}

fn of_restore(def: &PlantDef, request: &RestoreRequest) -> Result<(), String> {
    device(def, request.device)?;
    short("origin", &request.from, WORDS_MAX)?;
    for (what, name) in
        [("name", &request.set.name), ("device", &request.set.device), ("profile", &request.set.profile)]
    {
        short(what, name, WORDS_MAX)?;
    }
    short("name", &request.set.by, WORDS_MAX)?;
    let (many, count) = (request.changes.len(), def.tags.len());
    if count < many {
        return Err(format!("{many} changes, this plant has {count} tags"));
    }
    request.changes.iter().try_for_each(|change| tag(def, change.tag))
}

/// A text that is no longer than it can be.
fn short(what: &str, text: &str, max: usize) -> Result<(), String> {
    let chars = text.chars().count();
    if chars <= max { Ok(()) } else { Err(format!("{what} of {chars} characters, expected at most {max}")) }
}

/// No more alarms than the plant has.
fn as_many(def: &PlantDef, many: usize) -> Result<(), String> {
    let count = def.alarms.len();
    if many <= count { Ok(()) } else { Err(format!("{many} alarms, this plant has {count}")) }
}

fn of_alarms(def: &PlantDef, alarm_command: &AlarmCommand) -> Result<(), String> {
    match alarm_command {
        AlarmCommand::AcknowledgeAll { alarms: None, .. } => Ok(()),
        AlarmCommand::AcknowledgeAll { alarms: Some(alarms), .. } | AlarmCommand::Shelve { alarms, .. } => {
            as_many(def, alarms.len())?;
            alarms.iter().try_for_each(|id| alarm(def, *id))
        }
        AlarmCommand::Silence => Ok(()),
        AlarmCommand::Acknowledge { alarm: id, .. }
        | AlarmCommand::Tick { alarm: id, .. }
        | AlarmCommand::Reset(id)
        | AlarmCommand::Unshelve(id)
        | AlarmCommand::OutOfService(id)
        | AlarmCommand::InService(id) => alarm(def, *id),
    }
}

/// `Err` says what a query names that this plant does not have, or that it asks too much at once.
pub fn query(def: &PlantDef, query: &Query) -> Result<(), String> {
    match query {
        Query::Series { tags, buckets, .. } | Query::Values { tags, count: buckets, .. } => {
            if *buckets == 0 || BUCKETS_MAX < *buckets {
                return Err(format!("{buckets} columns, expected 1 to {BUCKETS_MAX}"));
            }
            if SERIES_MAX < tags.len() {
                return Err(format!("{} curves, expected at most {SERIES_MAX}", tags.len()));
            }
            let columns = tags.len() * buckets;
            if COLUMNS_MAX < columns {
                return Err(format!("{columns} columns of all curves, expected at most {COLUMNS_MAX}"));
            }
            tags.iter().try_for_each(|id| tag(def, *id))
        }
        Query::SampleTime { tags, from, to, .. } => {
            if SERIES_MAX < tags.len() || SAMPLE_SPAN_MAX < to.duration_since(*from) {
                return Err(format!("a search of {} curves, expected at most {SERIES_MAX} and 2 h", tags.len()));
            }
            tags.iter().try_for_each(|id| tag(def, *id))
        }
        Query::LineMinutes { line: id, limit, .. } => {
            rows(*limit)?;
            line(def, *id)
        }
        Query::Journal { limit, .. }
        | Query::Actions { limit, .. }
        | Query::Audit { limit, .. }
        | Query::Batches { limit, .. }
        | Query::ControlRuns { limit, .. }
        | Query::Reports { limit } => rows(*limit),
        Query::Report { period } if REPORT_MAX < period.to.duration_since(period.from) => {
            let days = |time: SignedDuration| time.as_hours() / 24;
            let (asked, most) = (days(period.to.duration_since(period.from)), days(REPORT_MAX));
            Err(format!("a report of {asked} days, expected at most {most}"))
        }
        Query::Report { .. }
        | Query::AlarmMetrics { .. }
        | Query::Past { .. }
        | Query::Samples { .. }
        | Query::Unarchived { .. }
        | Query::Overview => Ok(()),
        Query::Registers(read) => {
            read.check()?;
            line(def, read.line)
        }
    }
}

fn rows(limit: usize) -> Result<(), String> {
    if limit <= ROWS_MAX { Ok(()) } else { Err(format!("{limit} rows, expected at most {ROWS_MAX}")) }
}

fn tag(def: &PlantDef, TagId(id): TagId) -> Result<(), String> {
    known("tag", id, def.tags.len())
}

fn alarm(def: &PlantDef, AlarmId(id): AlarmId) -> Result<(), String> {
    known("alarm", id, def.alarms.len())
}

fn device(def: &PlantDef, DeviceId(id): DeviceId) -> Result<(), String> {
    known("device", id, def.devices.len())
}

fn line(def: &PlantDef, LineId(id): LineId) -> Result<(), String> {
    known("line", id, def.lines.len())
}

fn known(what: &str, id: u16, count: usize) -> Result<(), String> {
    if usize::from(id) < count {
        return Ok(());
    }
    Err(format!("{what} number {id}: this plant has {count}"))
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::plant::{
        def::{LineDef, Serial, Transport},
        diagnostics::{Diagnostic, Scan},
        fixture,
        tag::Table,
    };

    #[test]
    fn a_test_asks_for_no_more_than_a_line_can_carry() {
        let def = fixture::plant();
        let check = |diagnostic: Diagnostic, expect: bool| {
            assert_eq!(
                command(&def, &CommandKind::Test(LineId(0), diagnostic.clone())).is_ok(),
                expect,
                "{diagnostic:?}"
            );
        };
        let usual = Duration::from_millis(100);
        let scan = |serials, timeout| Diagnostic::Scan(Scan { first: 0, last: 255, serials, timeout });
        check(scan(vec![Serial::USUAL; 64], Duration::from_secs(10)), true);
        check(scan(Vec::new(), Duration::MAX), false);
        check(scan(Vec::new(), Duration::from_secs(3_600)), false);
        check(scan(Vec::new(), Duration::ZERO), false);
        check(scan(vec![Serial { baud: 0, ..Serial::USUAL }], usual), false);
        check(scan(vec![Serial { data_bits: 9, ..Serial::USUAL }], usual), false);
        check(scan(vec![Serial::USUAL; 65], usual), false);
        check(Diagnostic::Scan(Scan { first: 2, last: 1, serials: Vec::new(), timeout: usual }), false);
        let read = |address, count| Diagnostic::Read { unit: 1, table: Table::Holding, address, count };
        for (diagnostic, expect) in [(read(0xFF83, 125), true), (read(0xFF84, 125), false), (read(0, 126), false)] {
            check(diagnostic, expect);
        }
        let loopback = |count| Diagnostic::Loopback { unit: 1, data: 0, count };
        for (diagnostic, expect) in [(loopback(1_000), true), (loopback(1_001), false), (loopback(0), false)] {
            check(diagnostic, expect);
        }
        let pattern = |count| Diagnostic::Pattern { bits: 8, count };
        for (diagnostic, expect) in [(pattern(500), true), (pattern(501), false), (pattern(0), false)] {
            check(diagnostic, expect);
        }
        for (length, expect) in [(0, false), (513, true), (514, false)] {
            check(Diagnostic::Send(vec![0; length]), expect);
        }
    }

    #[test]
    fn settings_that_no_line_can_have_do_not_pass_the_socket() {
        let def = fixture::plant();
        let used = def.lines[0].clone();
        let check = |settings: LineDef| command(&def, &CommandKind::Configure(Box::new(settings)));
        assert_eq!(check(used.clone()), Ok(()));
        for wait in [Duration::ZERO, Duration::from_secs(61), Duration::MAX] {
            assert!(check(LineDef { timeout: wait, ..used.clone() }).is_err(), "timeout {wait:?}");
        }
        assert!(check(LineDef { frame_timeout: Duration::MAX, ..used.clone() }).is_err());
        assert!(check(LineDef { gap: Duration::MAX, ..used.clone() }).is_err());
        assert!(check(LineDef { turnaround: Duration::MAX, ..used.clone() }).is_err());
        let transport = Transport::rtu("/dev/null", Serial { baud: 0, ..Serial::USUAL });
        assert!(check(LineDef { transport, ..used }).is_err());
    }
}
