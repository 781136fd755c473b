//! What can be done with a device on any of its pages, and the windows that ask before it.

use super::{Action, Controllers, Page, keys::ProgramCommand};
use crate::ui::tabs::prelude::*;
use crate::{
    plant::interlock::role_to_write,
    ui::{
        modal::{Choice, Settings},
        rights,
        tabs::line_switch,
    },
};

impl Controllers {
    /// What can be done with a device on any of its pages.
    pub(super) fn on_device(&mut self, cx: &ViewContext, device: &DeviceDef, action: Action) -> Vec<UiAction> {
        match action {
            Action::Why if matches!(self.page, Page::Program) => {
                let tag = device.program.as_ref().and_then(|program| self.cell.tag(program));
                Why::open(Why::new(tag.into_iter().collect(), 0))
            }
            Action::Why => {
                let tags = self.table.rows(cx, device.id).into_iter().map(|tag| tag.id).collect();
                Why::open(Why::new(tags, self.table.selected))
            }
            Action::Refresh => vec![UiAction::Command(CommandKind::Refresh(device.id))],
            Action::Actions => {
                let Some(list) = Choice::actions(cx, device.id) else {
                    return notice(device, t!("this device has no actions"));
                };
                open(Notice::unreachable(cx, device.id).map_or(Modal::Choice(list), Modal::Notice))
            }
            Action::Tune => tune(cx, device),
            Action::Run => match device.faceplate.as_ref().and_then(|faceplate| faceplate.run) {
                Some(run) => write(cx, Some(run)),
                None => notice(device, t!("this device cannot be put in standby from here")),
            },
            Action::Settings => open(Modal::Settings(Box::new(Settings::new(cx, device.line)))),
            Action::Line => open(Modal::Confirm(line_switch::confirm(cx, device.line))),
            Action::Control(command) => control(cx, device, command),
            Action::Mode => write(cx, device.program.as_ref().and_then(|program| program.mode)),
            Action::Pattern => write(cx, device.program.as_ref().and_then(|program| program.pattern)),
            Action::Stop => vec![UiAction::Command(CommandKind::StopRestore(device.id))],
            Action::ReadSets => vec![UiAction::Command(CommandKind::ReadSets)],
            // Of one page: it has done them itself.
            Action::Device(_)
            | Action::Move(_)
            | Action::Column(_)
            | Action::Wall
            | Action::Open
            | Action::Lamps
            | Action::Program
            | Action::Sets
            | Action::Find
            | Action::Defaults
            | Action::Guide
            | Action::Turn(_)
            | Action::Save
            | Action::Runs
            | Action::Trend
            | Action::Mark
            | Action::Overlay
            | Action::Tag(_)
            | Action::All
            | Action::SwapDirection => Vec::new(),
        }
    }
}

impl Controllers {
    /// The role that an action of a page needs because of what it writes; `None` where it writes nothing.
    pub(super) fn role_for(&self, cx: &ViewContext, device: &DeviceDef, action: Action) -> Option<Role> {
        let (faceplate, program) = (device.faceplate.as_ref(), device.program.as_ref());
        let written = match (action, &self.page) {
            (Action::Open, Page::Device) => {
                self.table.tag(cx, device.id).filter(|tag| tag.writable()).map(|tag| tag.id)
            }
            (Action::Open, Page::Program) => program.and_then(|program| self.cell.tag(program)),
            (Action::Open, Page::Compare(compare)) => return compare.role_to_restore(cx, device),
            (Action::Tune, _) => faceplate.and_then(|faceplate| faceplate.tune),
            (Action::Run, _) => faceplate.and_then(|faceplate| faceplate.run),
            (Action::Control(_), _) => program.map(|program| program.command),
            (Action::Mode, _) => program.and_then(|program| program.mode),
            (Action::Pattern, _) => program.and_then(|program| program.pattern),
            (Action::Actions, _) => {
                let roles = device.actions.iter().map(|action| role_to_write(cx.def(), action.tag, action.value));
                return roles.min();
            }
            _ => None,
        };
        written.map(|tag| rights::to_write(cx, [tag]))
    }
}

/// Runs, holds or stops the program of a device.
fn control(cx: &ViewContext, device: &DeviceDef, command: ProgramCommand) -> Vec<UiAction> {
    let Some(program) = &device.program else { return Vec::new() };
    let value = match command {
        ProgramCommand::Run => Some(program.run),
        ProgramCommand::Hold => program.halt,
        ProgramCommand::Off => Some(program.off),
    };
    let cannot = || notice(device, t!("this program cannot be held"));
    value.map_or_else(cannot, |value| confirm(cx, program.command, value))
}

/// The window that writes a tag.
pub(super) fn write(cx: &ViewContext, tag: Option<TagId>) -> Vec<UiAction> {
    open(tag.and_then(|tag| Modal::write(cx, tag)))
}

/// The confirmation to write this value, unless nothing can be written now.
pub(super) fn confirm(cx: &ViewContext, tag: TagId, value: f64) -> Vec<UiAction> {
    let device = cx.def().tag(tag).device;
    open(Notice::unreachable(cx, device).map_or_else(|| Modal::Confirm(Confirm::write(cx, tag, value)), Modal::Notice))
}

/// Auto-tuning at work is stopped, else the window asks which kind is wanted.
fn tune(cx: &ViewContext, device: &DeviceDef) -> Vec<UiAction> {
    let Some(tune) = device.faceplate.as_ref().and_then(|faceplate| faceplate.tune) else {
        return notice(device, t!("this device has no auto-tuning"));
    };
    let on = cx.snapshot.sample(tune).good_value().is_some_and(|value| value != 0.0);
    if on { confirm(cx, tune, 0.0) } else { write(cx, Some(tune)) }
}

pub(super) fn notice(device: &DeviceDef, words: &str) -> Vec<UiAction> {
    open(Modal::Notice(Notice::new(device.name.clone(), vec![words.to_owned()])))
}
