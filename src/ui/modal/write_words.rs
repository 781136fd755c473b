//! What is said of a write before it is sent.

use crate::text::of_plant;
use crate::{
    plant::{
        confidence::Confidence,
        def::TagId,
        tag::{Access, TagDef},
    },
    t,
    ui::{ViewContext, widgets::value},
};

/// `old 60.0 °C → new 70.0 °C`; an unknown old value is said to be unknown.
pub(super) fn old_and_new(cx: &ViewContext, tag: TagId, new: &str) -> String {
    match cx.def().tag(tag).access {
        Access::Write => t!("writes {new}", new),
        Access::Read | Access::ReadWrite => t!("old {whole}  →  new {new}", whole = value::show(cx, tag).whole(), new),
    }
}

/// Where a write goes (a read, for a tag that is read-only), in both forms that manuals use: `41007 / 0x03EE, FC 06 / 0x06`.
pub fn wire_text(def: &TagDef) -> String {
    let fc = def.write_function().unwrap_or(def.point.table.read_fc());
    let address = def.point.address;
    t!(
        "{modicon} / 0x{address}, FC {fc} / 0x{fc2}",
        modicon = def.point.table.modicon(address),
        address = format!("{address:04X}"),
        fc = format!("{fc:02}"),
        fc2 = format!("{fc:02X}")
    )
}

/// What the profile wants said before a write.
pub(super) fn write_notes(def: &TagDef) -> Vec<String> {
    let mut notes: Vec<String> = def.confirm.iter().map(|words| of_plant(words).to_owned()).collect();
    match def.confidence {
        Confidence::Proven | Confidence::High => {}
        Confidence::Medium => notes.push(t!("! not verified: this row of the register map has one source").to_owned()),
        Confidence::Low => notes.push(t!("! not verified: this row of the register map is inferred").to_owned()),
    }
    notes
}
