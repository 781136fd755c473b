//! Words to be read: why something cannot be done now.

use crate::t;
use crossterm::event::{KeyCode, KeyEvent};
use ratatui::{Frame, layout::Rect};

use super::{Modal, Next, window};
use crate::{
    plant::{command::CommandKind, def::DeviceId},
    ui::{
        UiAction, ViewContext, interlock, rights,
        widgets::{
            list::{Motion, Scroll, on_screen},
            text::{width, wrap},
        },
    },
};

/// A message without a choice.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Notice {
    title: String,
    words: Vec<String>,
    /// The first line is why it is there.
    worry: bool,
    /// It stands in the place of a window into which something is typed.
    for_form: bool,
    scroll: Scroll,
}

impl Notice {
    /// Why nothing can be written to this device now; `None` if it can be tried.
    pub fn unreachable(cx: &ViewContext, device: DeviceId) -> Option<Notice> {
        let def = cx.def().device(device);
        let why = interlock::why_unreachable(cx, device)?;
        let words =
            vec![t!("{name} is not responding", name = def.name), why, t!("Writing is not possible now.").to_owned()];
        Some(Notice::for_form(def.name.clone(), words))
    }

    /// Opens a form that ends in this command, or says why the present user may not give it, before anything is filled in.
    pub fn or(cx: &ViewContext, title: &str, kind: &CommandKind, window: Modal) -> UiAction {
        UiAction::Open(match rights::missing(cx, kind) {
            Some(why) => Modal::Notice(Notice::for_form(title, vec![why])),
            None => window,
        })
    }

    /// Words to be read, the first line as the worry.
    pub fn new(title: impl Into<String>, words: Vec<String>) -> Notice {
        Notice { title: title.into(), words, worry: true, for_form: false, scroll: Scroll::default() }
    }

    /// The same in the place of a window into which something would be typed.
    pub fn for_form(title: impl Into<String>, words: Vec<String>) -> Notice {
        Notice { for_form: true, ..Notice::new(title, words) }
    }

    /// What is typed for the window in whose place it stands is dropped: it is no key of a tab.
    pub(super) fn takes_text(&self) -> bool {
        self.for_form
    }

    /// A list without a worry.
    pub fn list(title: impl Into<String>, words: Vec<String>) -> Notice {
        Notice { title: title.into(), words, worry: false, for_form: false, scroll: Scroll::default() }
    }

    pub(super) fn on_key(mut self, cx: &ViewContext, event: KeyEvent) -> Next {
        if let Some(motion) = Motion::from_key(event) {
            let rows = self.rows(cx.area).len();
            self.scroll.on(motion, rows, usize::from(cx.area.height.saturating_sub(4)));
        }
        match event.code {
            KeyCode::Enter => Next::Close,
            KeyCode::Char('q') if !self.for_form => Next::Close,
            _ => Next::Stay(Modal::Notice(self)),
        }
    }

    fn rows(&self, body: Rect) -> Vec<String> {
        let width = body.width.saturating_sub(8).min(64);
        self.words.iter().flat_map(|words| wrap(words, width)).collect()
    }

    pub(super) fn view(&self, cx: &ViewContext, frame: &mut Frame, body: Rect) {
        let rows = self.rows(body);
        let inner = rows.iter().map(|row| width(row)).max().unwrap_or(0);
        let mut canvas = window(cx, frame, body, &self.title, (inner, rows.len() + 2));
        let last = canvas.height().saturating_sub(1);
        let shown = usize::from(last.saturating_sub(1));
        for (y, n, row) in on_screen(&rows, self.scroll.first(rows.len(), shown), shown) {
            let style = if n == 0 && self.worry { cx.theme.trouble() } else { cx.theme.normal() };
            canvas.text(0, y, row, style);
        }
        let keys = if shown < rows.len() { t!("↑↓ scroll   Esc close") } else { t!("Esc close") };
        canvas.text(0, last, &cx.theme.enter(keys), cx.theme.strong());
    }
}

#[cfg(test)]
mod tests {
    use crossterm::event::KeyModifiers;
    use ratatui::{Terminal, backend::TestBackend};

    use super::*;
    use crate::ui::{Model, Msg, fixture::Fixture, theme::Theme, update, view};

    #[test]
    fn a_list_that_is_longer_than_the_screen_scrolls() {
        let session = crate::ui::fixture::session();
        let mut model = Model::new(Fixture::normal().snapshot(), Theme::FULL, 1, session);
        update(&mut model, Msg::Resize(80, 24));
        model.modal = Some(Modal::Notice(Notice::list("writes", (1..=200).map(|n| format!("write {n}.")).collect())));
        let mut shown = |key: KeyCode| {
            update(&mut model, Msg::Key(KeyEvent::new(key, KeyModifiers::NONE)));
            let mut terminal = Terminal::new(TestBackend::new(80, 24)).expect("a test backend never fails");
            terminal.draw(|frame| view(&model, frame)).expect("a test backend never fails");
            terminal.backend().to_string()
        };
        assert!(shown(KeyCode::Home).contains("write 1.") && shown(KeyCode::Home).contains("↑↓ scroll"));
        assert!(shown(KeyCode::End).contains("write 200.") && !shown(KeyCode::End).contains("write 1."));
        assert!(shown(KeyCode::PageUp).contains("write 180."));
    }
}
