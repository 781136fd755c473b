//! One of a few: the values of an enumeration, or the actions of a device.

use crate::t;
use crate::text::of_plant;
use crossterm::event::{KeyCode, KeyEvent};
use ratatui::{Frame, layout::Rect};

use super::{Confirm, Modal, Next, window, write_words::wire_text};
use crate::{
    plant::{
        def::{DeviceId, TagId},
        exact::Exact,
    },
    ui::{
        ViewContext, keys,
        widgets::{
            list::{Motion, first, on_screen},
            text::width,
            value,
        },
    },
};

const PAGE_ROWS: usize = 8;

/// A list to pick from; picking leads to a confirm window.
#[derive(Debug, Clone, PartialEq)]
pub struct Choice {
    title: String,
    rows: Vec<ChoiceRow>,
    selected: usize,
}

/// A row: its text and the window that it leads to.
#[derive(Debug, Clone, PartialEq)]
struct ChoiceRow {
    text: String,
    tag: TagId,
    next: Confirm,
}

impl Choice {
    /// The values of an enumeration, the present one selected.
    pub fn values(cx: &ViewContext, tag: TagId) -> Choice {
        let def = cx.def().tag(tag);
        // A state that the device only reports is no choice.
        let range = cx.snapshot.bounds(tag);
        let may = |number: Exact| range.is_none_or(|(min, max)| (min..=max).contains(&number));
        let choices = || def.enum_labels.iter().filter(|(number, _)| may(Exact::whole(*number)));
        let rows = choices().map(|(number, label)| {
            let next = Confirm::write(cx, tag, Exact::whole(*number));
            ChoiceRow { text: format!("{number}  {}", of_plant(label)), tag, next }
        });
        let now = cx.snapshot.sample(tag).exact();
        let selected = choices().position(|(number, _)| Some(Exact::whole(*number)) == now).unwrap_or(0);
        Choice {
            title: t!("write {name} {label}", name = def.name, label = of_plant(&def.label)),
            rows: rows.collect(),
            selected,
        }
    }

    /// The actions of a device; `None` if it has none.
    pub fn actions(cx: &ViewContext, device: DeviceId) -> Option<Choice> {
        let def = cx.def().device(device);
        let rows = def.actions.iter().map(|action| {
            let next = Confirm::action(cx, action.tag, action.value, &action.name, &action.confirm);
            ChoiceRow {
                text: format!("{}  {}", of_plant(&action.name), of_plant(&cx.def().tag(action.tag).label)),
                tag: action.tag,
                next,
            }
        });
        let rows: Vec<ChoiceRow> = rows.collect();
        (!rows.is_empty()).then(|| Choice { title: t!("actions of {name}", name = def.name), rows, selected: 0 })
    }

    pub(super) fn on_key(mut self, _cx: &ViewContext, event: KeyEvent) -> Next {
        if keys::code(KeyCode::Enter).is(event) && !self.rows.is_empty() {
            return Next::Stay(Modal::Confirm(self.rows.swap_remove(self.selected).next));
        }
        if let Some(motion) = Motion::from_key(event) {
            self.selected = motion.to(self.selected, self.rows.len(), PAGE_ROWS);
        }
        Next::Stay(Modal::Choice(self))
    }

    pub(super) fn view(&self, cx: &ViewContext, frame: &mut Frame, body: Rect) {
        let shown = usize::from(body.height.saturating_sub(6)).clamp(1, self.rows.len().max(1));
        let first = first(self.selected, self.rows.len(), shown);
        let inner = self.rows.iter().map(|row| width(&row.text)).max().unwrap_or(0).max(46);
        let mut canvas = window(cx, frame, body, &self.title, (inner, shown + 4));
        if let Some(row) = self.rows.get(self.selected) {
            canvas.text(0, 0, &t!("now {whole}", whole = value::show(cx, row.tag).whole()), cx.theme.normal());
            canvas.text(0, 1, &wire_text(cx.def().tag(row.tag)), cx.theme.dim());
        }
        for (y, n, row) in on_screen(&self.rows, first, shown) {
            let style = if n == self.selected { cx.theme.focus() } else { cx.theme.normal() };
            canvas.text(0, y + 2, if n == self.selected { "▸ " } else { "  " }, cx.theme.strong());
            canvas.text(2, y + 2, &row.text, style);
        }
        let last = canvas.height().saturating_sub(1);
        canvas.text(0, last, t!("↑↓ select   ⏎ next   Esc cancel"), cx.theme.strong());
    }
}
