//! Which tags are settings that a parameter set holds: what can be written and read, and is no command.

use super::{
    diagnostic::Problems,
    reader::{At, OptionalKey},
};
use crate::plant::{
    def::DeviceDef,
    tag::{Access, TagDef},
};

/// Marks the tags of parameter sets. `written` is what the profile says with `set`, by tag; else a register that can be
/// read and written is a setting unless the device is commanded by it: an action, run or standby, auto-tuning, the
/// program. A bit that can be written is a command more often than a setting, so it must say `set = true`.
pub(super) fn mark(devices: &[DeviceDef], tags: &mut [TagDef], written: &[Option<At<bool>>], problems: &mut Problems) {
    let commands: Vec<_> = devices
        .iter()
        .flat_map(|device| {
            let plate = device.faceplate.iter().flat_map(|plate| [plate.run, plate.tune]).flatten();
            let program = device.program.iter().map(|program| program.command);
            device.actions.iter().map(|action| action.tag).chain(plate).chain(program)
        })
        .collect();
    for (tag, written) in tags.iter_mut().zip(written) {
        let can = tag.access == Access::ReadWrite;
        if let Some(written) = written.filter(|written| written.value && !can) {
            let problem = problems.add(written.at, format!("{} cannot be part of a parameter set", tag.name));
            problem.label("expected access = \"rw\"");
        }
        let setting = can && !tag.is_text() && !tag.point.table.is_bits() && !commands.contains(&tag.id);
        tag.in_sets = can && written.value_or(setting);
    }
}
