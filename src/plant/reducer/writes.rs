//! What a write does to the plant: begun, and ended.

use jiff::Timestamp;

use super::{Effects, Plant};
use crate::plant::{
    command::{CommandKind, CommandStatus, Outcome, WriteId, WriteResult},
    commands::WriteOrigin,
    def::TagId,
    record::ActionRecord,
};

impl Plant {
    /// A write of a number or of a text.
    pub(super) fn write_command(&mut self, status: &CommandStatus, at: Timestamp, effects: &mut Effects) {
        if let CommandKind::WriteText { tag, text, seen } = &status.command.kind {
            let now = at.to_zoned(self.def.time_zone.clone());
            let written = self.commands.write_text(&self.image, status, (*tag, text, seen.as_deref()), &now);
            effects.write(self.line_of(*tag), written);
        }
        let Some((tag, value)) = status.command.kind.written() else { return };
        let origin = if status.command.is_unconditional { WriteOrigin::Unconditional } else { WriteOrigin::Person };
        let written = self.commands.write(&self.image, status, (tag, value), origin);
        effects.write(self.line_of(tag), written);
        let outcome = self.commands.outcome_of(status.command.id);
        if matches!(outcome, Some(Outcome::Pending | Outcome::Unchanged)) {
            self.leave_safe_state(tag, value, at, effects);
        }
    }

    /// A write ended.
    pub(super) fn wrote(&mut self, id: WriteId, result: WriteResult, at: Timestamp) -> Option<ActionRecord> {
        if let Some(tag) = self.commands.tag_of(id) {
            self.written(tag, &result, at);
        }
        self.commands.wrote(id, result, &self.image, at)
    }

    /// Unless a write was read back or certainly had no effect, the present value becomes uncertain.
    pub(super) fn written(&mut self, tag: TagId, result: &WriteResult, at: Timestamp) {
        match result {
            WriteResult::Accepted | WriteResult::Sent => self.image.written(tag, None, at),
            WriteResult::NotRead(fault) | WriteResult::NoValidResponse(fault) => {
                self.image.written(tag, Some(*fault), at)
            }
            WriteResult::ReadBack(_) | WriteResult::ReadBackAfterFault(..) | WriteResult::Held(_) => {
                self.image.read_for_write(tag, at)
            }
            WriteResult::Refused(_) | WriteResult::NotSent(_) | WriteResult::Superseded => {}
        }
    }
}
