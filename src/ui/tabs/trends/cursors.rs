//! The cursors A and B, and what every pen did between them: values at both, difference, slope, and exact figures.

use super::*;
use crate::{plant::sample::Quality, report::step_series::HeldValue};

/// How long before an instant its value is asked for: the history answers at equal intervals.
const BEFORE: Duration = Duration::from_millis(1);

/// Cursor B, and the answers about the time between both cursors.
#[derive(Debug, Default)]
pub(super) struct Between {
    b: Option<Timestamp>,
    /// The arrows move B, not A.
    moves_b: bool,
    /// The instants and pens that the answers are about.
    about: Option<(Timestamp, Timestamp, Vec<TagId>)>,
    figures: Answered<Vec<Series>>,
    /// The values in force at A and at B.
    ends: [Answered<Vec<Vec<Option<HeldValue>>>>; 2],
}

/// What a pen did from cursor A to cursor B.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Measured {
    /// The values at A and at B; `None` where nothing is stored.
    pub ends: [Option<HeldValue>; 2],
    /// Least, mean and greatest good value, and the share of good time; `None` until the history has answered.
    pub figures: Option<Figures>,
    /// What a counter counted, less than nothing where B comes before A.
    pub counted: Option<Exact>,
}

impl Measured {
    /// From A to B, of good values only; of a counter what it counted.
    pub fn difference(&self) -> Option<Exact> {
        if self.counted.is_some() {
            return self.counted;
        }
        let [a, b] = self.ends.map(|end| end.filter(|end| end.quality.is_good()).and_then(|end| end.value));
        Some(b? - a?)
    }

    /// The difference per minute.
    pub fn slope(&self, span: SignedDuration) -> Option<f64> {
        let minutes = span.as_secs_f64() / 60.0;
        self.difference().map(|difference| difference.near() / minutes).filter(|slope| slope.is_finite())
    }
}

impl Between {
    pub(super) fn queries(&mut self) -> Queries<'_> {
        let [a, b] = &mut self.ends;
        vec![&mut self.figures, a, b]
    }

    /// Switches cursor B off.
    pub(super) fn clear(&mut self) {
        (self.b, self.moves_b) = (None, false);
    }

    /// The answers that are there are about another interval.
    fn forget(&mut self) {
        self.figures.value = None;
        self.figures.query.want();
        for end in &mut self.ends {
            end.value = None;
            end.query.want();
        }
    }

    /// An answer has come: one about another interval does not count.
    pub(super) fn drop_outdated(&mut self) {
        if self.figures.query.is_wanted() {
            self.figures.value = None;
        }
        for end in &mut self.ends {
            if end.query.is_wanted() {
                end.value = None;
            }
        }
    }
}

impl Trends {
    /// Cursor A, kept on the screen while it is alone.
    pub(super) fn cursor(&self, cx: &ViewContext) -> Option<Timestamp> {
        match self.between.b {
            Some(_) => self.cursor,
            None => self.cursor.map(|at| self.on_screen(cx, at)),
        }
    }

    pub(crate) fn both(&self) -> Option<(Timestamp, Timestamp)> {
        self.cursor.zip(self.between.b)
    }

    pub(super) fn moves_b(&self) -> bool {
        self.between.moves_b
    }

    /// The cursor that the arrows move, on the screen.
    pub(super) fn moving(&self, cx: &ViewContext) -> Option<Timestamp> {
        let at = if self.between.moves_b { self.between.b } else { self.cursor };
        at.map(|at| self.on_screen(cx, at))
    }

    pub(super) fn move_cursor(&mut self, cx: &ViewContext, to: Timestamp) {
        let to = Some(self.on_screen(cx, to));
        *(if self.between.moves_b { &mut self.between.b } else { &mut self.cursor }) = to;
    }

    /// Cursor B on, or the arrows from one cursor to the other. In a replay A is its instant, and B stays where it was put.
    pub(super) fn toggle_cursor_b(&mut self, cx: &ViewContext) {
        let view = self.span(cx);
        match (self.cursor(cx), self.between.b) {
            (Some(_), Some(_)) if cx.is_past() => self.between.clear(),
            (Some(_), Some(_)) => self.between.moves_b = !self.between.moves_b,
            (Some(at), None) => {
                (self.cursor, self.between.b, self.between.moves_b) = (Some(at), Some(at), !cx.is_past());
            }
            (None, _) => {
                let middle = self.on_screen(cx, view.from + view.width() / 2);
                let last = self.on_screen(cx, cx.present());
                (self.cursor, self.between.b, self.between.moves_b) = (Some(middle), Some(last), true);
            }
        }
    }

    /// Asks what lies between both cursors: once, and again while it may not be stored yet.
    pub(super) fn ask_between(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        let Some((a, b)) = self.both() else { return Vec::new() };
        let tags: Vec<TagId> = self.drawn(cx).iter().map(|(_, pen)| pen.tag).collect();
        if tags.is_empty() {
            return Vec::new();
        }
        let about = Some((a, b, tags.clone()));
        if about != self.between.about {
            self.between.about = about;
            self.between.forget();
        }
        let (from, to) = (a.min(b), a.max(b));
        let stored = |at: Timestamp| cx.present().duration_since(at) > real(cx, COMMIT_LAG_S);
        let every = |at| if stored(at) { SignedDuration::MAX } else { real(cx, 1.0) };
        let timeout = real(cx, TIMEOUT_S);
        let mut acts = Vec::new();
        if from < to {
            let query = Query::Series { tags: tags.clone(), from, to, buckets: 1 };
            acts.extend(self.between.figures.ask(cx, Tab::Trends, every(to), timeout, query));
        }
        for (end, at) in self.between.ends.iter_mut().zip([a, b]) {
            let from = at.checked_sub(BEFORE).unwrap_or(at);
            let query = Query::Values { tags: tags.clone(), from, every: BEFORE, count: 1 };
            acts.extend(end.ask(cx, Tab::Trends, every(at), timeout, query));
        }
        acts
    }

    /// What a pen did between both cursors. What is not stored yet is taken from the curve.
    pub(super) fn measured(&self, cx: &ViewContext, tag: TagId) -> Option<Measured> {
        let (a, b) = self.both()?;
        let (_, _, tags) = self.between.about.as_ref()?;
        let place = tags.iter().position(|of| *of == tag)?;
        let drawn = |at: Timestamp| {
            let value = self.traces.get(&tag)?.value_at(at)?;
            Some(HeldValue { value: Some(value), quality: Quality::Good })
        };
        let end = |n: usize, at: Timestamp| {
            let answer = self.between.ends[n].value.as_ref()?;
            let held = answer.get(place).and_then(|values| values.first().copied().flatten());
            let recent = cx.present().duration_since(at) <= real(cx, COMMIT_LAG_S);
            held.or_else(|| drawn(at).filter(|_| recent))
        };
        let figures = self.between.figures.value.as_ref().and_then(|all| all.get(place));
        let counted = figures.and_then(|series| series.counted).map(|counted| if b < a { -counted } else { counted });
        let figures = figures.map(|series| (series.summary, series.good));
        Some(Measured { ends: [end(0, a), end(1, b)], figures, counted })
    }
}
