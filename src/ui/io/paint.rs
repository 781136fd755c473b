//! Frames, and the terminal's own picture over them: painted when it has changed, every few seconds at most, and taken away
//! by drawing the cells again. It is encoded beside the terminal's task, one at a time: that takes longer than a frame.

use std::time::Duration;

use tokio::{
    task::{JoinHandle, spawn_blocking},
    time::Instant,
};

use super::{Loop, UiError, own, question};
use crate::ui::{
    self, Msg,
    graphics::{Graphics, Picture},
    update, view,
};

/// Least time between two pictures of one chart.
const PAUSE: Duration = Duration::from_secs(5);

/// What was painted last, or is about to be.
#[derive(Debug, Default)]
pub(super) struct Painter {
    painted: Option<(Picture, Instant)>,
    /// Its bytes on their way.
    encoding: Option<JoinHandle<Option<Vec<u8>>>>,
}

impl Painter {
    /// The picture must go: another place is wanted, another protocol, or none.
    pub fn must_clear(&self, wanted: Option<&Picture>) -> bool {
        let place = |picture: &Picture| (picture.protocol, picture.area);
        self.painted.as_ref().is_some_and(|(painted, _)| Some(place(painted)) != wanted.map(place))
    }

    /// The terminal shows it no more, nor what is still encoded.
    pub fn forget(&mut self) {
        self.painted = None;
    }

    fn encode(&mut self, graphics: Graphics, picture: Picture) {
        self.encoding = Some(spawn_blocking(move || graphics.encode(&picture)));
    }

    /// Waits for the bytes of the picture; `None`: it was forgotten meanwhile, or has no size.
    pub async fn encoded(&mut self) -> Option<(&Picture, Vec<u8>)> {
        let Some(encoding) = &mut self.encoding else { return std::future::pending().await };
        // What a panic had to say is in the log.
        let bytes = encoding.await.ok().flatten();
        self.encoding = None;
        self.painted.as_ref().map(|(picture, _)| picture).zip(bytes)
    }

    /// The picture, if it is to be painted now.
    pub fn due(&mut self, wanted: Option<Picture>, now: Instant) -> Option<&Picture> {
        let wanted = wanted.filter(|_| self.encoding.is_none())?;
        let rests = |(painted, at): &(Picture, Instant)| *painted == wanted || now.duration_since(*at) < PAUSE;
        if self.painted.as_ref().is_some_and(rests) {
            return None;
        }
        self.painted = Some((wanted, now));
        self.painted.as_ref().map(|(picture, _)| picture)
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
        if let Some(picture) = self.painter.due(picture, Instant::now()).cloned() {
            self.painter.encode(self.model.limits.graphics, picture);
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

    #[tokio::test]
    async fn a_picture_is_encoded_alone_and_not_shown_once_forgotten() {
        let (mut painter, start) = (Painter::default(), Instant::now());
        let first = painter.due(Some(picture(1.0, 0)), start).cloned().expect("it is due");
        painter.encode(Graphics::NONE, first.clone());
        assert_eq!(painter.due(Some(picture(2.0, 0)), start + 2 * PAUSE), None, "one at a time");
        let (shown, bytes) = painter.encoded().await.expect("bytes");
        assert_eq!((shown, Some(bytes)), (&first, Graphics::NONE.encode(&first)));
        let second = painter.due(Some(picture(2.0, 0)), start + 2 * PAUSE).cloned().expect("it is due");
        painter.encode(Graphics::NONE, second);
        painter.forget();
        assert_eq!(painter.due(Some(picture(3.0, 0)), start + 2 * PAUSE), None, "one at a time");
        assert_eq!(painter.encoded().await, None, "its place is gone");
        assert!(painter.due(Some(picture(3.0, 0)), start + 2 * PAUSE).is_some());
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
