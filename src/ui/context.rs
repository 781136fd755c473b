//! What the parts of a terminal may read: the plant as it is, or as it was at an instant that is shown instead.

use std::{cell::Cell, sync::Arc, time::Duration};

use jiff::Timestamp;
use ratatui::layout::Rect;

use super::{
    Clock,
    extension::Extension,
    layout::{Size, layout},
    preferences::Preferences,
    theme::Theme,
};
use crate::{
    access::SessionStatus,
    plant::{def::PlantDef, snapshot::Snapshot, time::elapsed},
};

/// Gives each query of a terminal a number of its own.
#[derive(Debug, Default)]
pub struct QueryNumbers(Cell<u32>);

impl QueryNumbers {
    /// The number of the next one.
    pub fn next(&self) -> u32 {
        self.0.set(self.0.get().wrapping_add(1));
        self.0.get()
    }
}

/// What every tab, window and widget may read.
#[derive(Debug, Clone, Copy)]
pub struct ViewContext<'a> {
    /// The plant.
    pub snapshot: &'a Snapshot,
    /// The looks.
    pub theme: &'a Theme,
    /// What the user has chosen.
    pub preferences: &'a Preferences,
    /// Plant time now: the snapshot's, carried on while none comes; the instant of a past that is shown.
    pub now: Timestamp,
    /// What time it really is while a past is shown.
    pub present: Option<Timestamp>,
    /// Counts half seconds; stands still in the past.
    pub phase: u32,
    /// Where the shown tab draws, for queries that depend on its width.
    pub area: Rect,
    /// How much the terminal can show.
    pub size: Size,
    /// State that the embedding command adds.
    pub extension: Option<&'a dyn Extension>,
    /// The session: user, role and lock.
    pub session: &'a SessionStatus,
    /// For what is asked.
    pub numbers: &'a QueryNumbers,
}

impl<'a> ViewContext<'a> {
    /// The plant's definition.
    pub fn def(&self) -> &'a PlantDef {
        &self.snapshot.def
    }
    /// The phase in which unacknowledged alarms are reversed: half of every two seconds.
    pub fn flash(&self) -> bool {
        self.phase % 4 < 2
    }
    /// The time that no setting of a clock moves: for what is asked again after a while.
    pub fn monotonic_now(&self) -> Timestamp {
        self.present().checked_sub(self.snapshot.stepped).unwrap_or(self.present())
    }
    /// What time it really is.
    pub fn present(&self) -> Timestamp {
        self.present.unwrap_or(self.now)
    }
    /// Is a past shown instead of the present?
    pub fn is_past(&self) -> bool {
        self.present.is_some()
    }
    /// A local time of the plant in this form of `strftime`.
    pub fn local(&self, at: Timestamp, form: &str) -> String {
        at.to_zoned(self.def().time_zone.clone()).strftime(form).to_string()
    }
    /// Age of a tag's sample now.
    pub fn age(&self, tag: crate::plant::def::TagId) -> Duration {
        elapsed(self.snapshot.sample(tag).at, self.now)
    }
}

/// What the parts may read that always show the present.
pub(super) fn view_context<'a>(
    snapshot: &'a Snapshot,
    (theme, preferences): (&'a Theme, &'a Preferences),
    clock: Clock,
    screen: Rect,
    extension: &'a Option<Arc<dyn Extension>>,
    (session, numbers): (&'a SessionStatus, &'a QueryNumbers),
) -> ViewContext<'a> {
    let ahead = jiff::SignedDuration::from_secs_f64(clock.silent.as_secs_f64() * snapshot.speed.clamp(0.0, 1e6));
    let now = snapshot.at.checked_add(ahead).unwrap_or(snapshot.at);
    let (area, size) = (layout(screen).body, Size::of(screen));
    let extension = extension.as_deref();
    let (present, phase) = (None, clock.phase);
    ViewContext { snapshot, theme, preferences, now, present, phase, area, size, extension, session, numbers }
}
