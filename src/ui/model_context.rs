//! What the parts of a terminal read of it, while others of them change.

use ratatui::layout::Rect;

use crate::text::{Locale, PlantTexts};

use super::{Model, ViewContext, context::view_context, replay::Replay, tabs::Tabs};

impl Model {
    /// What the parts of the terminal may read.
    pub fn cx(&self) -> ViewContext<'_> {
        context(self, self.screen)
    }

    /// The language of its texts, and those of its plant.
    pub(super) fn words(&self) -> (Locale, PlantTexts) {
        (self.locale(), self.snapshot.def.texts)
    }

    /// The same of the present, also while a past is shown.
    pub fn present_cx(&self) -> ViewContext<'_> {
        present_context(self, self.screen)
    }
}

/// With the texts of the program and of the plant in a language.
pub(super) fn in_words<R>((locale, of_plant): (Locale, PlantTexts), body: impl FnOnce() -> R) -> R {
    of_plant.within(|| locale.within(body))
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
