//! What may be done with a tag, against where it lies and how its device writes.

use crate::{
    plant::{
        def::Limits,
        tag::{Access, Point, Table},
    },
    profile::{
        address::{Scheme, locate},
        diagnostic::Problems,
        reader::OptionalKey,
        schema::TagTable,
    },
};

pub(super) fn access(row: &TagTable, point: Option<Point>, limits: Limits, problems: &mut Problems) -> Access {
    let access = row.access.value_or(Access::Read);
    let Some(point) = point.filter(|_| access != Access::Read) else { return access };
    let at = row.access.map_or(row.at, |access| access.at);
    // A few devices read a bit with function 02 and write it with 05 all the same (Delta DTB 0810H); they say so.
    let bit = point.table == Table::Discrete && row.write_fc.is_some();
    if matches!(point.table, Table::Discrete | Table::Input) && !bit && row.write_address.is_none() {
        problems
            .add(at, format!("a {} can only be read", point.table.word()))
            .label("expected access = \"r\", or `write_address`");
    }
    let (words, most) = (point.words(), limits.write_registers_max);
    if !point.table.is_bits() && most < words {
        let problem = problems.add(at, format!("the value takes {words} registers, the device writes at most {most}"));
        problem.label("expected access = \"r\"");
    }
    if let Some(write) = row.write.filter(|_| point.part().is_none()) {
        let problem = problems.add(write.at, "only a part of a register is written back with the rest of it");
        problem
            .label("leave this out, or name a field")
            .help("`write = \"rmw\"` is for a field of bits and for int8 and uint8");
    }
    if point.part().is_some() && row.write_fc.is_none() && row.write.is_none() {
        let what = if point.field.is_some() { "a field of bits inside a word" } else { "a byte of a register" };
        problems
            .add(at, format!("{what} cannot be written by a whole word"))
            .label("expected access = \"r\", write_fc = 22, or write = \"rmw\"")
            .help("it would overwrite the other bits; function 22, mask write, does not, if the device has it; \"rmw\" writes them back as they were read right before");
    }
    if let Some(verify) = row.verify.filter(|verify| !verify.value) {
        let problem = problems.add(verify.at, "a write is always verified").label("leave this out");
        problem.help("a tag that cannot be read back has access = \"w\"");
    }
    if let Some(fc) = row.write_fc {
        let is_part = point.part().is_some() && row.write.is_none();
        let allowed: &[u8] = match (point.table.is_bits(), is_part, point.len()) {
            (true, ..) => &[5, 15],
            _ if point.kind.address_words() != 1 => &[16],
            (false, true, _) => &[22],
            (false, false, 1) if row.write.is_some() => &[6, 16],
            (false, false, _) if row.write.is_some() => &[16],
            (false, false, 1) => &[6, 16, 23],
            (false, false, _) => &[16, 23],
        };
        if !allowed.contains(&fc.value) {
            let problem = problems.add(fc.at, format!("function {} cannot write this tag", fc.value));
            problem.label(format!("expected {allowed:?}"));
        }
    }
    access
}

/// Where a tag is written that is read elsewhere: a register for one in registers, a coil for a bit.
pub(super) fn write_at(row: &TagTable, point: Point, scheme: Scheme, problems: &mut Problems) -> Option<(Table, u16)> {
    let written = row.write_address.as_ref()?;
    let (table, address) = locate(written, scheme, problems)?;
    let usual = if point.table.is_bits() { Table::Coil } else { Table::Holding };
    let table = table.unwrap_or(usual);
    if table != usual {
        let problem =
            problems.add(written.at, format!("a {} cannot be written to a {}", point.table.word(), table.word()));
        problem.label(format!("expected a {}", usual.word()));
    }
    if u32::from(address) + u32::from(point.len()) > 0x1_0000 {
        problems.add(written.at, "the value extends past the last address").label("the last is 65535");
    }
    if let Some(write) = row.write {
        let problem = problems.add(write.at, "what is read elsewhere is not what would be written back");
        problem.label("leave this out, or `write_address`").also(written.at, "written here");
    }
    if row.access.is_none_or(|access| access.value == Access::Read) {
        problems.add(written.at, "it is not written").label("expected access = \"rw\" beside it");
    }
    Some((table, address))
}
