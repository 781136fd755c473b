//! The mouse, for users who have switched it on: what it does is a key, or the selection that keys would lead to.

#[cfg(test)]
mod tests;

use crossterm::event::KeyCode;
use ratatui::{Terminal, backend::TestBackend, layout::Position, style::Modifier};

use super::{
    Model, UiAction, chrome, dispatch::on_key, keys, last_frame, layout, model_context::with_tabs, msg::Pointer,
};

pub(super) fn on_pointer(model: &mut Model, pointer: Pointer) -> Vec<UiAction> {
    if !model.preferences.mouse || model.small() {
        return Vec::new();
    }
    match pointer {
        Pointer::Wheel { down } => press(model, if down { KeyCode::Down } else { KeyCode::Up }),
        Pointer::Drag(at) if model.modal.is_none() => point(model, at).unwrap_or_default(),
        Pointer::Drag(_) => Vec::new(),
        Pointer::Press(_) if !model.is_as_drawn() => {
            model.note = Some(last_frame::changed().into());
            Vec::new()
        }
        Pointer::Press(at) => {
            if let Some(tab) = chrome::tab_at(model, at) {
                if model.modal.as_ref().is_some_and(|modal| modal.takes_text()) {
                    return Vec::new();
                }
                return on_key(model, tab.key().event());
            }
            match chrome::chord_at(model, at) {
                Some(chord) => on_key(model, chord.event()),
                None => select(model, at),
            }
        }
    }
}

fn press(model: &mut Model, code: KeyCode) -> Vec<UiAction> {
    on_key(model, keys::code(code).event())
}

/// Selects what the shown tab has at this place; `None` where that is a matter of rows.
fn point(model: &mut Model, at: Position) -> Option<Vec<UiAction>> {
    let (mut taken, is_page) = (false, model.replay.page().is_some());
    let actions = with_tabs(model, |tabs, cx| {
        taken = !is_page && cx.area.contains(at) && tabs.shown_mut().on_point(cx, at);
        if taken { tabs.shown_mut().on_snapshot(cx) } else { Vec::new() }
    });
    taken.then_some(actions)
}

/// Moves the selection of the window or tab to the row at this place, as the arrow keys would.
fn select(model: &mut Model, at: Position) -> Vec<UiAction> {
    if model.modal.is_none() && model.replay.page().is_some() {
        return Vec::new();
    }
    if model.modal.is_none()
        && let Some(actions) = point(model, at)
    {
        return actions;
    }
    let (drawn, y) = (rows(model), usize::from(at.y));
    let Some(wanted) = drawn.get(y).filter(|row| !row.words.is_empty()).map(|row| row.words.clone()) else {
        return Vec::new();
    };
    let Some(from) = selected(&drawn) else { return Vec::new() };
    let key = if y < from { KeyCode::Up } else { KeyCode::Down };
    let mut actions = Vec::new();
    for _ in 0..y.abs_diff(from) {
        actions.extend(press(model, key));
        let now = rows(model);
        // A list scrolls under the mouse, and a row may take several lines.
        if selected(&now).is_some_and(|at| now[at].words == wanted) {
            break;
        }
    }
    actions
}

/// A row of the screen: its words without the mark of the selected row, and whether a part of it is selected.
struct Row {
    words: String,
    selected: bool,
}

/// The rows of the window, or of the tab, as they are drawn while no alarm flashes.
fn rows(model: &Model) -> Vec<Row> {
    let (width, height) = (model.screen.width, model.screen.height);
    let Ok(mut terminal) = Terminal::new(TestBackend::new(width, height));
    let cx = super::ViewContext { phase: 2, ..model.cx() };
    let body = layout::layout(model.screen).body;
    let Ok(_) = terminal.draw(|frame| match &model.modal {
        Some(modal) => modal.view(&cx, frame, body),
        None => model.tabs.shown().view(&cx, frame, body),
    });
    let cells = terminal.backend().buffer().content.chunks(usize::from(width.max(1)));
    let row = |cells: &[ratatui::buffer::Cell]| {
        let words: String = cells.iter().map(|cell| cell.symbol()).collect();
        let words = words.trim_matches(|c: char| " ▸>│".contains(c)).to_owned();
        Row { words, selected: cells.iter().any(|cell| cell.modifier.contains(Modifier::REVERSED)) }
    };
    cells.map(row).collect()
}

/// The selected row: the last one, for the headings of pages are marked too and stand above.
fn selected(rows: &[Row]) -> Option<usize> {
    rows.iter().rposition(|row| row.selected)
}
