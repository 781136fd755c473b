//! Frames, and the terminal's own picture over them: painted when it has changed, every few seconds at most, and taken away
//! by drawing the cells again.

use std::time::Duration;

use tokio::time::Instant;

use super::{Loop, UiError, own, question};
use crate::ui::{self, Msg, graphics::Picture, update, view};

/// Least time between two pictures of one chart.
const PAUSE: Duration = Duration::from_secs(5);

/// What was painted last.
#[derive(Debug, Default)]
pub(super) struct Painter(Option<(Picture, Instant)>);

impl Painter {
    /// The picture must go: another place is wanted, another protocol, or none.
    pub fn must_clear(&self, wanted: Option<&Picture>) -> bool {
        let place = |picture: &Picture| (picture.protocol, picture.area);
        self.0.as_ref().is_some_and(|(painted, _)| Some(place(painted)) != wanted.map(place))
    }

    /// The terminal shows it no more.
    pub fn forget(&mut self) {
        self.0 = None;
    }

    /// The picture, if it is to be painted now.
    pub fn due(&mut self, wanted: Option<Picture>, now: Instant) -> Option<&Picture> {
        let wanted = wanted?;
        let rests = |(painted, at): &(Picture, Instant)| *painted == wanted || now.duration_since(*at) < PAUSE;
        if self.0.as_ref().is_some_and(rests) {
            return None;
        }
        self.0 = Some((wanted, now));
        self.0.as_ref().map(|(picture, _)| picture)
    }
}

impl Loop {
    /// Draws the first frame, then reads what the terminal answers, and what was typed before that. `true`: leave.
    pub(super) fn hear_answers(&mut self) -> Result<bool, UiError> {
        let Some(asked_at) = self.screen.asked_at else { return Ok(false) };
        self.draw()?;
        let answers = question::read_answers(asked_at);
        self.model.limits.graphics = answers.graphics();
        self.late = question::LateAnswer::after(&answers, Instant::now());
        for event in answers.typed {
            if self.on_event(event)? {
                return Ok(true);
            }
        }
        Ok(false)
    }

    pub(super) fn draw(&mut self) -> Result<(), UiError> {
        self.redraw_at = None;
        let picture = own(|| ui::picture(&self.model));
        if self.painter.must_clear(picture.as_ref()) {
            self.painter.forget();
            self.screen.clear_picture()?;
        }
        self.screen.draw(|frame| view(&self.model, frame))?;
        if let Some(picture) = self.painter.due(picture, Instant::now()) {
            self.screen.paint(&self.model.limits.graphics, picture)?;
        }
        own(|| update(&mut self.model, Msg::Drawn));
        self.drawn_at = Some(Instant::now());
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use ratatui::layout::Rect;

    use super::*;
    use crate::{
        report::drawing::{Drawing, Ink},
        ui::graphics::Protocol,
    };

    fn picture(value: f32, x: u16) -> Picture {
        let mut drawing = Drawing::new(40, 40);
        drawing.line(vec![(0.0, value), (40.0, value)], Ink::Text, 1.0, false);
        Picture { protocol: Protocol::Kitty, area: Rect::new(x, 2, 4, 2), drawing }
    }

    #[test]
    fn a_picture_is_painted_when_changed_and_not_too_often() {
        let (mut painter, start) = (Painter::default(), Instant::now());
        let mut due =
            |value, seconds| painter.due(Some(picture(value, 0)), start + Duration::from_secs(seconds)).is_some();
        assert!(due(1.0, 0), "at once");
        assert!(!due(1.0, 9), "nothing has changed");
        assert!(due(2.0, 9));
        assert!(!due(3.0, 13), "too soon");
        assert!(due(3.0, 14));
    }

    #[test]
    fn a_picture_goes_with_its_place() {
        let mut painter = Painter::default();
        assert!(!painter.must_clear(None), "there is none");
        painter.due(Some(picture(1.0, 0)), Instant::now());
        assert!(!painter.must_clear(Some(&picture(2.0, 0))), "the next one takes its place");
        assert!(painter.must_clear(Some(&picture(1.0, 3))));
        assert!(painter.must_clear(None));
        painter.forget();
        assert!(!painter.must_clear(None));
    }
}
