//! Closing a line and opening it again, from every tab that shows its devices.

use crate::plant::line_state::LineState;
use crate::ui::tabs::prelude::*;

/// Asks for the line of the selected tags; without any for the one that is closed, or the only one.
pub fn open(cx: &ViewContext, selected: Option<Vec<TagId>>) -> Vec<UiAction> {
    let lines = &cx.def().lines;
    let of_tag = selected.iter().flatten().next().map(|tag| cx.def().device(cx.def().tag(*tag).device).line);
    let mut closed = lines.iter().filter(|line| cx.snapshot.line(line.id).state == LineState::Disconnected);
    let only = || lines.first().filter(|_| lines.len() == 1);
    let modal = match of_tag.or_else(|| closed.next().or_else(only).map(|line| line.id)) {
        Some(line) => Modal::Confirm(confirm(cx, line)),
        None => Modal::Notice(Notice::new(t!("lines"), vec![t!("select an item of the line first").to_owned()])),
    };
    vec![UiAction::Open(modal)]
}

/// Closing a line is asked with what it means for everything on it.
pub fn confirm(cx: &ViewContext, line: LineId) -> Confirm {
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
