//! The keys of the mimic tab, and what they do on a picture and on the overview.

use super::{Mimic, neighbour};
use crate::{
    access::right,
    plant::def::MimicItem,
    ui::{
        layout::Size,
        modal::plant_command,
        rights,
        tabs::{line_switch, prelude::*},
        widgets::mimic::{list, tags, title},
    },
};

type Key = crate::ui::key_table::Key<Mimic>;

/// Keys of this tab; [`PLANT`] lists the four arrows as one.
pub(super) const KEYS: &[Key] = &[
    Key::change(code(KeyCode::Left), "", "", |mimic, cx| mimic.step(cx, (-1, 0))),
    Key::change(code(KeyCode::Right), "", "", |mimic, cx| mimic.step(cx, (1, 0))),
    Key::change(code(KeyCode::Up), "", "", |mimic, cx| mimic.step(cx, (0, -1))),
    Key::change(code(KeyCode::Down), "", "", |mimic, cx| mimic.step(cx, (0, 1))),
    Key::new(code(KeyCode::Enter), "open", "faceplate of the selected item", Mimic::open),
    Key::new(char('w'), "why", "explain the value: quality, scaling, bytes", Mimic::why),
    Key::new(char('C'), "commands", "all valves, pumps and heaters with their commands", |_, cx| actuators(cx)),
    Key::new(char('v'), "overview", "all devices at a glance, or the mimic", Mimic::toggle_overview)
        .when(|_, cx| Offer::footer_if(!cx.def().mimic.pages.is_empty() && Size::Normal <= cx.size)),
    Key::new(char('D'), "", "disconnect a line, or connect it again (asks first)", |mimic, cx| {
        line_switch::open(cx, mimic.selected_tags(cx))
    })
    .needs(Role::Technician),
    Key::change(char('M'), "", "animation of agitators and arrows on or off", |mimic, cx| {
        mimic.still ^= !mimic.is_overview(cx);
    }),
    Key::new(code(KeyCode::PageUp), "", "the page before", |mimic, cx| mimic.turn(cx, -1)),
    Key::new(code(KeyCode::PageDown), "page", "the next page of the mimic", |mimic, cx| mimic.turn(cx, 1))
        .when(|_, cx| Offer::footer_if(1 < cx.def().mimic.pages.len())),
];

/// The commands of the plant file.
pub(super) const PLANT: Below<Mimic> =
    Below { hints: |_, cx| hints(cx), press: |_, cx, event| plant_command::command_of(cx, event).map(open) };

fn hints(cx: &ViewContext) -> Vec<Hint> {
    let commands = cx.def().mimic.commands.iter().map(|command| {
        let role = match command.value {
            Some(value) => right::needs(cx.def(), &CommandKind::Write { tag: command.tag, value: value.into() }),
            None => rights::to_write(cx, [command.tag]),
        };
        let label = of_plant(&command.label);
        Hint::new(command.key, label, t!("{label} (asks first)", label)).needs(role)
    });
    commands.chain([Hint::new("←↑↓→", t!("select"), t!("select an item"))]).collect()
}

impl Mimic {
    fn step(&mut self, cx: &ViewContext, by: (i32, i32)) {
        if self.is_overview(cx) {
            return self.overview.on_move(cx, &self.shift, by);
        }
        let (picture, parts) = self.shown(cx, cx.area);
        self.selected = match list::is_shown(cx, picture, parts.picture) {
            true => list::neighbour(cx, &picture.items, self.selected, by),
            false => neighbour(&picture.items, self.selected, by),
        };
    }

    fn item_selected<'a>(&self, cx: &ViewContext<'a>) -> Option<&'a MimicItem> {
        self.selected.and_then(|n| self.shown(cx, cx.area).0.items.get(n))
    }

    /// The tags of the selected item or device.
    pub(super) fn selected_tags(&self, cx: &ViewContext) -> Option<Vec<TagId>> {
        match self.is_overview(cx) {
            true => self.overview.card(cx).map(|card| card.tags),
            false => self.item_selected(cx).map(|item| tags(cx, item)),
        }
    }

    fn open(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        if self.is_overview(cx) {
            return self.overview.card(cx).map(|card| UiAction::ShowDevice(card.device)).into_iter().collect();
        }
        match self.item_selected(cx) {
            Some(MimicItem::Link { page, .. }) => self.show_page(cx, *page),
            item => {
                let faceplate = item.and_then(|item| Faceplate::new(title(cx, item), tags(cx, item)));
                open(faceplate.map(Modal::Faceplate))
            }
        }
    }

    fn why(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        if !self.is_overview(cx) && self.selected.is_none() {
            self.selected = neighbour(&self.shown(cx, cx.area).0.items, None, (1, 0));
        }
        Why::open(self.selected_tags(cx).and_then(|tags| Why::of_all(cx, tags)))
    }

    fn toggle_overview(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        if !self.is_overview(cx) && cx.size < Size::Normal {
            return Vec::new();
        }
        self.at_a_glance = !self.is_overview(cx);
        self.on_snapshot(cx)
    }

    fn turn(&mut self, cx: &ViewContext, by: isize) -> Vec<UiAction> {
        let pages = cx.def().mimic.pages.len();
        let turns = 1 < pages && !self.is_overview(cx);
        if turns { self.show_page(cx, around(self.page, by, pages)) } else { Vec::new() }
    }
}

/// The commands of all actuators, in one faceplate.
fn actuators(cx: &ViewContext) -> Vec<UiAction> {
    let outputs = cx.def().logic.actuators.iter().map(|actuator| actuator.output).collect();
    open(Faceplate::new(t!("commands"), outputs).map(Modal::Faceplate))
}
