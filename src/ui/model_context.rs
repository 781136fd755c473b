//! What the parts of a terminal read of it, while others of them change.

use ratatui::layout::Rect;

use super::{Model, ViewContext, context::view_context, replay::Replay, tabs::Tabs};

impl Model {
    /// What the parts of the terminal may read.
    pub fn cx(&self) -> ViewContext<'_> {
        context(self, self.screen)
    }

    /// The same of the present, also while a past is shown.
    pub fn present_cx(&self) -> ViewContext<'_> {
        present_context(self, self.screen)
    }
}

/// What the parts of a terminal of this size may read.
pub(super) fn context(model: &Model, screen: Rect) -> ViewContext<'_> {
    past_context(present_context(model, screen), &model.replay)
}

/// What the parts may read that always show the present.
pub(super) fn present_context(model: &Model, screen: Rect) -> ViewContext<'_> {
    let Model { snapshot, theme, preferences, clock, extension, session, numbers, .. } = model;
    view_context(snapshot, (theme, preferences), *clock, screen, extension, (session, numbers))
}

/// A past instead of the present, if one is shown.
pub(super) fn past_context<'a>(present: ViewContext<'a>, replay: &'a Replay) -> ViewContext<'a> {
    match replay.shown() {
        Some(past) => ViewContext {
            snapshot: &past.snapshot,
            now: past.at,
            present: Some(present.now),
            phase: if replay.speed() == 0 { 0 } else { present.phase },
            ..present
        },
        None => present,
    }
}

/// Lets the replay change while it reads the present.
pub(super) fn with_replay<T>(model: &mut Model, change: impl FnOnce(&mut Replay, &ViewContext) -> T) -> T {
    let Model { snapshot, theme, preferences, clock, extension, session, numbers, screen, replay, .. } = model;
    change(replay, &view_context(snapshot, (theme, preferences), *clock, *screen, extension, (session, numbers)))
}

/// Lets the tabs change while they read the rest of the model.
pub(super) fn with_tabs<T>(model: &mut Model, change: impl FnOnce(&mut Tabs, &ViewContext) -> T) -> T {
    let Model { snapshot, theme, preferences, clock, extension, session, numbers, screen, tabs, replay, .. } = model;
    let present = view_context(snapshot, (theme, preferences), *clock, *screen, extension, (session, numbers));
    change(tabs, &past_context(present, replay))
}
