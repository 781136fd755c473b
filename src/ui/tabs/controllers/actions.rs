//! What can be done with a device on any of its pages, and the windows that ask before it.

use super::{Action, Controllers, Page, keys::ProgramCommand};
use crate::ui::tabs::prelude::*;
use crate::{
    plant::event::LineState,
    ui::modal::{Choice, Settings},
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
            Action::Line => open(Modal::Confirm(connect(cx, device.line))),
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

/// Closing a line is asked with what it means for everything on it.
fn connect(cx: &ViewContext, line: LineId) -> Confirm {
    let name = &cx.def().line(line).name;
    if cx.snapshot.line(line).state == LineState::Disconnected {
        return Confirm::command(
            t!("connect {name}", name),
            t!("Connect line {name} and poll its devices again?", name),
            CommandKind::Connect(line, true),
        );
    }
    let devices: Vec<&str> =
        cx.def().devices.iter().filter(|device| device.line == line).map(|device| device.name.as_str()).collect();
    let words = t!(
        "Disconnect line {name}? {join} will not be polled, and their alarms not evaluated.",
        name,
        join = devices.join(", ")
    );
    Confirm::command(t!("disconnect {name}", name), words, CommandKind::Connect(line, false))
}
