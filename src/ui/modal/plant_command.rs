//! The windows of the commands that a plant file puts on keys of the mimic.

use crossterm::event::KeyEvent;

use super::{Choice, Confirm, Modal, Notice};
use crate::{
    plant::def::MimicCommand,
    ui::{ViewContext, interlock, keys},
};

/// The window of the plant's command on this key. Other windows ask too, so that a stop never waits for one to close.
pub fn command_of(cx: &ViewContext, event: KeyEvent) -> Option<Modal> {
    let command = cx.def().mimic.commands.iter().find(|command| keys::char(command.key).is(event))?;
    command_window(cx, command)
}

/// The window of a plant command, or why it cannot be given: a fixed value, or the other of two known states, is confirmed;
/// of two states the present one of which is unknown one is chosen from a list; any other value is entered.
fn command_window(cx: &ViewContext, command: &MimicCommand) -> Option<Modal> {
    let tag = command.tag;
    let def = cx.def().tag(tag);
    if let Some(notice) = Notice::unreachable(cx, def.device) {
        return Some(Modal::Notice(notice));
    }
    if let Some(value) = command.value {
        return Some(Modal::Confirm(Confirm::write(cx, tag, value)));
    }
    if let Some(new) = interlock::other_state(cx, tag) {
        return Some(Modal::Confirm(Confirm::write(cx, tag, new)));
    }
    // Unknown whether it runs: offer the stop, which never takes more than two keys.
    if cx.def().logic.sequences.iter().any(|sequence| sequence.run == tag) {
        return Some(Modal::Confirm(Confirm::write(cx, tag, 0.0)));
    }
    match def.enum_labels.as_slice() {
        [_, _] => Some(Modal::Choice(Choice::values(cx, tag))),
        _ => Modal::write(cx, tag),
    }
}
