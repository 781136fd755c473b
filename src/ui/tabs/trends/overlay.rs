//! The view, or a typed period, over other periods: today beside the same hours yesterday.

use jiff::Span;

use super::{keys::Key, *};
use crate::{
    plant::def::PlantDef,
    ui::tabs::overlay::{CURVES_MAX, Overlay},
};

/// What may be typed, for the entry window.
const FORMS: &str = "yesterday  7d  8h  2026-11-20  06:00-14:00 / 2026-11-20 06:00-14:00";
/// What is offered: one alone lies over the view.
const OFFERED: &str = "yesterday";

pub(super) const KEYS: &[Key] = &[
    Key::change(code(KeyCode::Left), "", "previous tag", |trends, _| trends.next_overlaid(-1)),
    Key::change(code(KeyCode::Right), "tag", "next tag", |trends, _| trends.next_overlaid(1)),
    Key::new(char('/'), "periods", "other periods", Trends::ask_overlay),
    Key::change(char('o'), "curves", "back to the curves", |trends, _| trends.overlay = None),
];

impl Trends {
    pub(super) fn ask_overlay(&mut self, _cx: &ViewContext) -> Vec<UiAction> {
        self.asking = Asking::Overlay;
        let typed = self.typed_overlay.as_deref().unwrap_or(OFFERED);
        open(Modal::Prompt(Prompt::new(t!("Overlay periods"), FORMS, typed)))
    }

    fn next_overlaid(&mut self, by: isize) {
        self.overlay.iter_mut().for_each(|overlay| overlay.next_tag(by));
    }

    /// Lays the typed periods over each other, beginning with the selected pen.
    pub(super) fn lay_over(&mut self, cx: &ViewContext, text: &str) -> Result<(), String> {
        let (view, pens) = (self.span(cx), self.curved(cx));
        let shown = (view.from, view.to.min(cx.now));
        let spans = periods(cx.def(), text, shown, cx.present())?;
        let selected = pens.iter().position(|(n, _)| *n == self.selected).unwrap_or(0);
        let tags = pens.into_iter().map(|(_, pen)| pen.tag).collect();
        let overlay = Overlay::of_periods(spans, (tags, selected));
        self.overlay = Some(overlay.ok_or_else(|| t!("select a pen that has a curve").to_owned())?);
        self.typed_overlay = Some(text.trim().to_owned());
        Ok(())
    }
}

/// The periods of `A / B`; one alone lies over what is shown. Each is a period as elsewhere, or how much earlier than the
/// first one it is.
fn periods(
    def: &PlantDef,
    text: &str,
    shown: (Timestamp, Timestamp),
    now: Timestamp,
) -> Result<Vec<(Timestamp, Timestamp)>, String> {
    let parts: Vec<&str> = text.split('/').map(str::trim).collect();
    let mut spans = if parts.len() == 1 { vec![shown] } else { Vec::new() };
    for part in parts {
        let span = match (earlier(part), spans.first().copied()) {
            (Some(by), first) => {
                let before = |at: Timestamp| at.to_zoned(def.time_zone.clone()).checked_sub(by);
                let (from, to) = first.unwrap_or(shown);
                let [from, to] = [before(from), before(to)].map(|at| at.map_err(|error| error.to_string()));
                (from?.timestamp(), to?.timestamp())
            }
            (None, _) => period::typed(def, part, now).map(|period| (period.from, period.to.min(now)))?,
        };
        spans.push(span);
    }
    match spans.len() {
        ..=CURVES_MAX => Ok(spans),
        _ => Err(t!("at most {CURVES_MAX} periods", CURVES_MAX)),
    }
}

/// `yesterday`, `7d`, `8h`: how much earlier, by the calendar.
fn earlier(text: &str) -> Option<Span> {
    if text.eq_ignore_ascii_case(OFFERED) {
        return Some(Span::new().days(1));
    }
    let is_span = text.starts_with(|c: char| c.is_ascii_digit()) && text.ends_with(char::is_alphabetic);
    text.parse().ok().filter(|_| is_span)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ui::fixture::{Fixture, now};

    #[test]
    fn periods_are_understood_as_they_are_typed() {
        let def = Fixture::normal().def;
        let shown = (now() - SignedDuration::from_mins(10), now());
        let local = |at: Timestamp| at.to_zoned(def.time_zone.clone()).strftime("%d %H:%M").to_string();
        let check = |text: &str, expect: &str| {
            let found = periods(&def, text, shown, now()).map(|spans| {
                let words = spans.into_iter().map(|(from, to)| format!("{}-{}", local(from), local(to)));
                words.collect::<Vec<_>>().join(", ")
            });
            assert_eq!(found.unwrap_or_else(|error| error), expect, "{text}");
        };
        check("yesterday", "21 13:52-21 14:02, 20 13:52-20 14:02");
        check("7d", "21 13:52-21 14:02, 14 13:52-14 14:02");
        check(" 8h ", "21 13:52-21 14:02, 21 05:52-21 06:02");
        check("06:00-07:00 / yesterday", "21 06:00-21 07:00, 20 06:00-20 07:00");
        check("2026-11-20 / 2026-11-18 / 7d", "20 00:00-21 00:00, 18 00:00-19 00:00, 13 00:00-14 00:00");
        check("night@2026-11-19", "21 13:52-21 14:02, 19 22:00-20 06:00");
        check("1d / 1d / 1d / 1d / 1d / 1d / 1d / 1d / 1d", "at most 8 periods");
        for nonsense in ["", "/", "7", "-7d", "lunch", "2027-01-01", "06:00-07:00 / "] {
            assert!(periods(&def, nonsense, shown, now()).is_err(), "{nonsense}");
        }
    }

    #[test]
    fn the_same_hours_are_those_of_the_clock() {
        let mut def = Fixture::normal().def;
        def.time_zone = jiff::tz::TimeZone::get("Europe/Berlin").expect("a zone");
        let at = |text: &str| text.parse::<Timestamp>().expect("a time of the test");
        let shown = (at("2026-10-25T05:00:00Z"), at("2026-10-25T06:00:00Z"));
        let spans = periods(&def, "yesterday", shown, at("2026-10-25T12:00:00Z")).expect("periods");
        assert_eq!(spans[1], (at("2026-10-24T04:00:00Z"), at("2026-10-24T05:00:00Z")), "06:00 by the clock");
    }
}
