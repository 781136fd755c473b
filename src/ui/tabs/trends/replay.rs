//! Trends of a past that is shown: its instant stays in the view, and steps to the side move it.

use super::*;

impl Trends {
    /// While a past is shown its instant is in the view with the cursor on it; the present comes back with it.
    pub(super) fn follow_replay(&mut self, cx: &ViewContext) {
        let instant = cx.is_past().then_some(cx.now);
        if instant == self.replayed {
            return;
        }
        self.replayed = instant;
        match instant {
            // Small steps move the cursor, not the curves.
            Some(at) if self.end.is_some() && self.span(cx).holds(at) => self.cursor = Some(at),
            Some(at) => self.go_to_moment(cx, at),
            None => {
                (self.end, self.cursor) = (None, None);
                self.between.clear();
                self.moved();
            }
        }
    }

    /// The instant of the replay so many widths further.
    pub(super) fn replay_by(&self, width: SignedDuration, by: isize) -> Vec<UiAction> {
        vec![UiAction::ReplayStep(width * i32::try_from(by).unwrap_or_default())]
    }
}
