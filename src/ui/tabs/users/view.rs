//! The view of the list of users, and of the terminals that are attached.

use super::state;
use crate::ui::rights;
use crate::ui::tabs::prelude::*;

/// Draws both lists; the terminals have the lower third at the most.
pub(super) fn draw(cx: &ViewContext, place: usize, frame: &mut Frame, area: Rect) {
    let mut canvas = Canvas::new(frame.buffer_mut(), area);
    let (width, height) = (canvas.width(), canvas.height());
    let terminals = to_u16(cx.session.sessions.len()) + 2;
    let below = terminals.min(height / 3).max(3.min(height));
    users(cx, place, &mut canvas.part(0, 0, width, height.saturating_sub(below)));
    sessions(cx, &mut canvas.part(0, height.saturating_sub(below), width, below));
}

fn users(cx: &ViewContext, place: usize, canvas: &mut Canvas) {
    let theme = cx.theme;
    let all = &cx.session.users;
    let name = (canvas.width() / 4).clamp(14, 34);
    canvas.text(
        1,
        0,
        &t!("{pad}role         state                      last login", pad = pad(t!("user"), name)),
        theme.dim(),
    );
    let rows = usize::from(canvas.height().saturating_sub(1)).max(1);
    for (y, n, row) in on_screen(all, first(place, all.len(), rows), rows) {
        let last = row.last_login.map_or(t!("never").to_owned(), |at| draw::local(cx, at, "%Y-%m-%d %H:%M"));
        let mark = if n == place { theme.pick("▸", ">") } else { " " };
        let text = format!(
            "{mark}{}{}{}{last}",
            pad(&fit(&row.user, name - 1), name),
            pad(rights::title(row.role), 13),
            pad(&state(cx, row), 27),
        );
        let style = if row.disabled { theme.dim() } else { theme.normal() };
        let style = if n == place { theme.focus() } else { style };
        let width = canvas.width();
        canvas.text(0, y + 1, &pad(&fit(&text, width), width), style);
    }
    if all.is_empty() {
        canvas.text(1, 2, t!("No users: a demonstration needs no login."), theme.dim());
    }
}

fn sessions(cx: &ViewContext, canvas: &mut Canvas) {
    let theme = cx.theme;
    let all = &cx.session.sessions;
    let width = canvas.width();
    canvas.run(0, 0, width, '─', theme.dim());
    canvas.text(1, 0, &t!(" terminals attached {count} ", count = all.len()), theme.dim());
    let rows = usize::from(canvas.height().saturating_sub(1));
    let shown = draw::shown(cx, canvas, all.len(), rows);
    for (y, row) in all.iter().take(shown).enumerate() {
        let user = row.user.as_deref().unwrap_or("–");
        let locked = if row.locked { t!("  LOCKED") } else { "" };
        let text = t!(
            "{terminal}  {pad}since {clock}  {from}{locked}",
            terminal = format!("{:>4}", row.terminal),
            pad = pad(&fit(user, 15), 16),
            clock = clock(row.since, &cx.def().time_zone),
            from = said(&row.from),
            locked
        );
        canvas.text(0, to_u16(y) + 1, &fit(&text, width), theme.normal());
    }
}
