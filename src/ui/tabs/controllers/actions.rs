//! What keys do with a device on its pages, and the windows that ask before it.

use super::{
    Controllers, Page,
    compare::Compare,
    guide,
    keys::{run, tune},
    lamps, procedures,
    runs::{ControlRuns, Runs},
    sets::{self, Sets, SetsOf, Source},
};
use crate::ui::tabs::prelude::*;
use crate::{
    access::right,
    plant::{def::ProgramDef, interlock::role_to_write},
    ui::{
        modal::{Choice, LineSettings},
        rights,
        tabs::line_switch,
    },
};

/// What a key needs that is known only when it is pressed.
impl Controllers {
    /// The device whose page is shown, or lies below; else the one that is selected in the list.
    pub(super) fn device<'a>(&self, cx: &ViewContext<'a>) -> Option<&'a DeviceDef> {
        let is_open = self.pages.contains(&Page::Device);
        let id = if is_open { Some(self.device) } else { self.devices.selected(cx).map(|device| device.id) };
        cx.def().devices.get(id?.index())
    }

    /// In the footer only for a device that has what the key is for.
    pub(super) fn offer(&self, cx: &ViewContext, has: impl FnOnce(&DeviceDef) -> bool) -> Offer {
        Offer::footer_if(self.device(cx).is_some_and(has))
    }

    pub(super) fn role_for(&self, cx: &ViewContext, tag: impl FnOnce(&DeviceDef) -> Option<TagId>) -> Option<Role> {
        self.device(cx).and_then(tag).map(|tag| rights::to_write(cx, [tag]))
    }

    pub(super) fn role_for_actions(&self, cx: &ViewContext) -> Option<Role> {
        let actions = &self.device(cx)?.actions;
        actions.iter().map(|action| role_to_write(cx.def(), action.tag, action.value.into())).min()
    }

    pub(super) fn role_to_start(&self, cx: &ViewContext) -> Option<Role> {
        let id = self.procedures.id(cx)?;
        Some(right::needs(cx.def(), &CommandKind::StartProcedure(id)))
    }

    /// The tag of the selected cell of the program.
    pub(super) fn cell_tag(&self, device: &DeviceDef) -> Option<TagId> {
        self.cell.tag(device.program.as_ref()?)
    }

    pub(super) fn compared(&self) -> Option<&Compare> {
        if let Page::Compare(compare) = self.page() { Some(compare) } else { None }
    }

    fn on_device(
        &mut self,
        cx: &ViewContext,
        act: impl FnOnce(&mut Controllers, &DeviceDef) -> Vec<UiAction>,
    ) -> Vec<UiAction> {
        self.device(cx).map_or_else(Vec::new, |device| act(self, device))
    }

    /// Turns to a page of the device, or says why it has none.
    fn turn_to(&mut self, cx: &ViewContext, page: Page, why_not: Option<&str>) -> Vec<UiAction> {
        self.on_device(cx, |tab, device| match why_not {
            Some(why) => notice(device, why),
            None => {
                tab.pages.push(page);
                Vec::new()
            }
        })
    }
}

/// What can be done with a device on any of its pages.
impl Controllers {
    pub(super) fn refresh(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        self.on_device(cx, |_, device| vec![UiAction::Command(CommandKind::Refresh(device.id))])
    }

    pub(super) fn why(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        let Some(device) = self.device(cx) else { return Vec::new() };
        let tags = self.table.rows(cx, device.id).into_iter().map(|tag| tag.id).collect();
        Why::open(Why::new(tags, self.table.selected))
    }

    pub(super) fn choose_action(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        self.on_device(cx, |_, device| match Choice::actions(cx, device.id) {
            Some(list) => open(Notice::unreachable(cx, device.id).map_or(Modal::Choice(list), Modal::Notice)),
            None => notice(device, t!("this device has no actions")),
        })
    }

    pub(super) fn switch(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        self.on_device(cx, |_, device| open(Modal::Confirm(line_switch::confirm(cx, device.line))))
    }

    pub(super) fn open_settings(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        self.on_device(cx, |_, device| open(Modal::LineSettings(Box::new(LineSettings::new(cx, device.line)))))
    }

    /// Auto-tuning at work is stopped, else the window asks which kind is wanted.
    pub(super) fn tune(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        self.on_device(cx, |_, device| {
            let Some(tune) = tune(device) else { return notice(device, t!("this device has no auto-tuning")) };
            let on = cx.snapshot.sample(tune).good_value().is_some_and(|value| value != 0.0);
            if on { confirm(cx, tune, 0.0) } else { write(cx, Some(tune)) }
        })
    }

    pub(super) fn toggle_standby(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        self.on_device(cx, |_, device| match run(device) {
            Some(run) => write(cx, Some(run)),
            None => notice(device, t!("this device cannot be put in standby from here")),
        })
    }

    pub(super) fn write(
        &mut self,
        cx: &ViewContext,
        tag: impl FnOnce(&Controllers, &DeviceDef) -> Option<TagId>,
    ) -> Vec<UiAction> {
        self.on_device(cx, |tab, device| write(cx, tag(tab, device)))
    }

    /// Runs, holds or stops the program of the device.
    pub(super) fn control(
        &mut self,
        cx: &ViewContext,
        value: impl FnOnce(&ProgramDef) -> Option<f64>,
    ) -> Vec<UiAction> {
        self.on_device(cx, |_, device| match &device.program {
            Some(program) => value(program).map_or_else(
                || notice(device, t!("this program cannot be held")),
                |value| confirm(cx, program.command, value),
            ),
            None => Vec::new(),
        })
    }

    pub(super) fn open_parameter(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        match self.table.tag(cx, self.device) {
            Some(tag) if tag.writable() => write(cx, Some(tag.id)),
            Some(tag) => open(Faceplate::new(tag.label.clone(), vec![tag.id]).map(Modal::Faceplate)),
            None => Vec::new(),
        }
    }
}

/// The pages of a device.
impl Controllers {
    pub(super) fn open_lamps(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        let has_any = self.device(cx).is_some_and(|device| lamps::has_any(cx, device));
        self.turn_to(cx, Page::Lamps, (!has_any).then_some(t!("this device has no bits to show as lamps")))
    }

    pub(super) fn show_program(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        let has_one = self.device(cx).is_some_and(|device| device.program.is_some());
        self.turn_to(cx, Page::Program, (!has_one).then_some(t!("this device has no ramp/soak program")))
    }

    pub(super) fn show_sets(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        self.sets = Sets::new(SetsOf { device: self.device });
        let past = t!("parameter sets are shown in the present only");
        self.turn_to(cx, Page::Sets, cx.is_past().then_some(past))
    }

    pub(super) fn show_runs(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        self.runs = Runs::new(ControlRuns { device: self.device });
        let has_runs = cx.snapshot.has_runs(self.device);
        self.turn_to(cx, Page::Runs, (!has_runs).then_some(t!("this device has no SV and PV")))
    }

    pub(super) fn show_procedures(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        let none = cx.is_past() || cx.def().procedures.is_empty();
        self.turn_to(cx, Page::Procedures, none.then(|| procedures::why_none(cx)))
    }

    pub(super) fn show_guide(&mut self, _cx: &ViewContext) {
        self.pages.push(Page::Guide(0));
    }

    pub(super) fn turn(&mut self, by: isize) {
        if let Some(Page::Guide(page)) = self.pages.last_mut() {
            *page = page.saturating_add_signed(by).min(guide::count() - 1);
        }
    }

    /// The selected set against the device.
    pub(super) fn compare(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        self.on_device(cx, |tab, _| {
            let Some(source) = tab.sets.selected(cx).map(|row| row.source.clone()) else { return Vec::new() };
            if let Some(notice) = sets::problems(cx, &source) {
                return open(Modal::Notice(notice));
            }
            tab.pages.push(Page::Compare(Compare::new(source)));
            Vec::new()
        })
    }

    pub(super) fn restore(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        let confirm = self.compared().and_then(|compare| Some(compare.restore(cx, self.device(cx)?)));
        open(confirm.map(|confirm| confirm.map_or_else(Modal::Notice, Modal::Confirm)))
    }

    /// A copy the other way round: the target is chosen by opening its page.
    pub(super) fn swap_direction(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        self.on_device(cx, |tab, device| {
            let Some(Compare { source: Source::Device(other), .. }) = tab.compared() else {
                return notice(device, t!("only a copy between two controllers can be reversed"));
            };
            tab.show(*other);
            tab.pages.extend([Page::Sets, Page::Compare(Compare::new(Source::Device(device.id)))]);
            Vec::new()
        })
    }

    pub(super) fn ask_set_name(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        self.on_device(cx, |_, device| {
            let title = t!("save the settings of {name} as a set", name = device.name);
            open(Modal::Prompt(Prompt::new(title, sets::save_hint(cx, device.id), "")))
        })
    }
}

fn write(cx: &ViewContext, tag: Option<TagId>) -> Vec<UiAction> {
    open(tag.and_then(|tag| Modal::write(cx, tag)))
}

/// The confirmation to write this value, unless nothing can be written now.
fn confirm(cx: &ViewContext, tag: TagId, value: f64) -> Vec<UiAction> {
    let device = cx.def().tag(tag).device;
    open(Notice::unreachable(cx, device).map_or_else(|| Modal::Confirm(Confirm::write(cx, tag, value)), Modal::Notice))
}

fn notice(device: &DeviceDef, words: &str) -> Vec<UiAction> {
    open(Modal::Notice(Notice::new(device.name.clone(), vec![words.to_owned()])))
}
