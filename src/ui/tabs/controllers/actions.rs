//! What can be done with a device on any of its pages, and the windows that ask before it.

use super::{
    Action, Controllers, Page,
    compare::Compare,
    keys::{self, ProgramCommand, needing, page_keys},
    lamps,
    sets::Source,
};
use crate::ui::tabs::prelude::*;
use crate::{
    access::right,
    plant::interlock::role_to_write,
    ui::{
        keys::{hide, hints},
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
            | Action::Procedures
            | Action::Abort
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
            (Action::Open, Page::Procedures) => {
                let id = self.procedures.id(cx)?;
                return Some(right::needs(cx.def(), &CommandKind::StartProcedure(id)));
            }
            (Action::Open, Page::Compare(compare)) => return compare.role_to_restore(cx, device),
            (Action::Tune, _) => faceplate.and_then(|faceplate| faceplate.tune),
            (Action::Run, _) => faceplate.and_then(|faceplate| faceplate.run),
            (Action::Control(_), _) => program.map(|program| program.command),
            (Action::Mode, _) => program.and_then(|program| program.mode),
            (Action::Pattern, _) => program.and_then(|program| program.pattern),
            (Action::Actions, _) => {
                let roles =
                    device.actions.iter().map(|action| role_to_write(cx.def(), action.tag, action.value.into()));
                return roles.min();
            }
            _ => None,
        };
        written.map(|tag| rights::to_write(cx, [tag]))
    }
}

impl Controllers {
    /// The keys of the page, without those that this device or this moment has no use for.
    pub(super) fn page_hints(&self, cx: &ViewContext) -> Vec<Hint> {
        let mut keys = page_keys(&self.page);
        let device = cx.def().devices.get(self.device.index());
        if let Some(device) = device {
            let (faceplate, program) = (device.faceplate.as_ref(), device.program.as_ref());
            let copies = matches!(&self.page, Page::Compare(Compare { source: Source::Device(_), .. }));
            // Nothing is written or sent on the line of another master, and it has no settings to try.
            let listens = cx.def().listens_on(device.line);
            let lacking = [
                (Action::Refresh, listens),
                (Action::Settings, listens),
                (Action::Tune, faceplate.is_none_or(|faceplate| faceplate.tune.is_none())),
                (Action::Run, faceplate.is_none_or(|faceplate| faceplate.run.is_none())),
                (Action::Lamps, !lamps::has_any(cx, device)),
                (Action::Program, program.is_none()),
                (Action::Runs, !cx.snapshot.has_runs(device.id)),
                (Action::Procedures, cx.def().procedures.is_empty() || cx.is_past()),
                (Action::Abort, self.procedures.to_abort(cx).is_none()),
                (Action::Actions, device.actions.is_empty()),
                (Action::Defaults, cx.def().tags_of(device.id).all(|tag| tag.default.is_none())),
                (Action::Control(keys::ProgramCommand::Hold), program.is_none_or(|program| program.halt.is_none())),
                (Action::Stop, cx.snapshot.restore(device.id).is_none_or(|run| !run.at_work())),
                (Action::SwapDirection, !copies),
            ];
            hide(&mut keys, &lacking);
            keys.retain(|key| !listens || self.role_for(cx, device, key.action).is_none());
            keys = needing(keys, |action| self.role_for(cx, device, action));
        }
        let mut hints = hints(&keys);
        // On the page of a device there is no room left for a key that every operator tries anyway; in the past there is.
        let leads_back = match self.page {
            Page::List => false,
            Page::Device => cx.is_past() && 1 < cx.def().devices.len(),
            Page::Program | Page::Sets | Page::Compare(_) | Page::Guide(..) => true,
            Page::Lamps | Page::Runs | Page::Procedures | Page::Overlay(_) => true,
        };
        if leads_back {
            let enter = keys.iter().position(|key| key.chord == code(KeyCode::Enter));
            let place = enter.map_or(keys.len(), |enter| enter + 1);
            hints.insert(place, Hint::new("Esc", t!("back"), t!("previous page")));
        }
        hints
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
