//! How a curve is drawn: as it was known, as straight lines between its changes, as dots or as bars.

use super::trace::Span;

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Stroke {
    /// A value holds until the next: what the station knew.
    #[default]
    Step,
    /// Straight lines between changes.
    Line,
    /// The values alone.
    Dots,
    /// Bars from zero, or from the end of the scale that is nearest to it.
    Bars,
}

impl Stroke {
    pub const ALL: [Stroke; 4] = [Stroke::Step, Stroke::Line, Stroke::Dots, Stroke::Bars];

    pub fn next(self) -> Stroke {
        match self {
            Stroke::Step => Stroke::Line,
            Stroke::Line => Stroke::Dots,
            Stroke::Dots => Stroke::Bars,
            Stroke::Bars => Stroke::Step,
        }
    }
}

/// The columns of [`Stroke::Line`]: straight from one change to the next, never over a gap. What went beyond both ends of
/// a change stays, so that no spike is lost; after the last change the value holds.
pub fn straight(columns: &[Option<Span>]) -> Vec<Option<Span>> {
    let mut lines = columns.to_vec();
    let mut last_change: Option<usize> = None;
    for n in 0..columns.len() {
        let before = n.checked_sub(1).and_then(|n| columns[n]);
        let (Some(span), Some(before)) = (columns[n], before) else {
            last_change = columns[n].map(|_| n);
            continue;
        };
        if span.min == span.max && span.last == before.last {
            continue;
        }
        if let Some(from) = last_change {
            let (a, b) = (before.last, span.last);
            for (place, line) in lines.iter_mut().enumerate().take(n + 1).skip(from + 1) {
                let at = a + (b - a) * (place - from) as f64 / (n - from) as f64;
                let beyond = |span: &Span| span.min < a.min(b) || a.max(b) < span.max;
                *line = match line.filter(beyond) {
                    Some(span) => Some(span),
                    None => Some(Span { min: at, max: at, last: at }),
                };
            }
        }
        last_change = Some(n);
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(columns: &[Option<(f64, f64, f64)>], expect: &[Option<f64>]) {
        let columns: Vec<Option<Span>> =
            columns.iter().map(|column| column.map(|(min, max, last)| Span { min, max, last })).collect();
        let lasts: Vec<Option<f64>> = straight(&columns).iter().map(|span| span.map(|span| span.last)).collect();
        assert_eq!(lasts, expect);
    }

    #[test]
    fn lines_are_straight_between_changes_and_end_at_gaps() {
        let held = |value: f64| Some((value, value, value));
        check(&[held(0.), held(0.), Some((0., 6., 6.)), held(6.)], &[Some(0.), Some(3.), Some(6.), Some(6.)]);
        check(&[held(0.), None, held(6.)], &[Some(0.), None, Some(6.)]);
        check(&[held(0.), Some((-1., 9., 2.)), held(2.)], &[Some(0.), Some(2.), Some(2.)]);
    }

    #[test]
    fn every_look_has_its_turn() {
        let turns = Stroke::ALL.into_iter().map(Stroke::next).collect::<Vec<_>>();
        assert_eq!(turns, [Stroke::Line, Stroke::Dots, Stroke::Bars, Stroke::Step]);
    }
}
