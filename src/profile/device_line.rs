//! What the line of a device allows its tags.

use super::{diagnostic::Problems, schema::DeviceTable};
use crate::plant::{
    def::{DeviceDef, LineDef},
    tag::{Access, TagDef},
};

/// Unit 0 of a serial line is a broadcast: it can be written, and no unit answers a read. Of what another master reads it is not
/// known how many bits each address holds.
pub(super) fn check_lines<'a>(
    devices: &[DeviceDef],
    tables: impl Iterator<Item = &'a DeviceTable>,
    lines: &[LineDef],
    tags: &[TagDef],
    problems: &mut Problems,
) {
    for (device, table) in devices.iter().zip(tables) {
        let Some(line) = lines.iter().find(|line| line.id == device.line) else { continue };
        let to_all = line.transport.framing().is_broadcast(device.unit);
        let own = || tags.iter().filter(|tag| tag.device == device.id);
        let readable = own().find(|tag| tag.access != Access::Write);
        if let (true, Some(unit), Some(tag)) = (to_all, table.unit, readable) {
            problems
                .add(unit.at, format!("unit 0 is a broadcast, which no unit answers: {} can never be read", tag.name))
                .label("expected 1 to 247, or a profile whose tags all have access = \"w\"");
        }
        let wide = own().find(|tag| line.listens && tag.point.kind.address_words() != 1);
        if let Some(tag) = wide {
            let at = table.line.as_ref().map_or(table.at, |line| line.at);
            let kind = tag.point.kind;
            problems
                .add(at, format!("{} is {kind}, which cannot be heard on a line that only listens", tag.name))
                .label("expected a line that this program polls");
        }
    }
}
