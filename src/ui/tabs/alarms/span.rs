//! Which stretch of time a page is about: the present, or a shift that was chosen.

use super::super::reports::period;
use crate::report::Period;
use crate::ui::tabs::prelude::*;

/// An answer that has not come after so long (real time) counts as lost: a query over weeks may take its time.
const PATIENCE_S: f64 = 30.0;

/// The shift before the one shown; from the present it is the running one.
pub fn earlier(cx: &ViewContext, shown: Option<&Period>) -> Option<Period> {
    match shown {
        None => period::at(cx.def(), cx.now),
        Some(shown) => period::before(cx.def(), shown).or_else(|| Some(shown.clone())),
    }
}

/// The shift after the one shown; after the running one comes the present.
pub fn later(cx: &ViewContext, shown: Option<&Period>) -> Option<Period> {
    shown.and_then(|shown| period::after(cx.def(), shown, cx.now))
}

/// Is it time to ask? What is still going on is asked every `seconds`, the past once in a while.
pub fn due(cx: &ViewContext, periodic: &PeriodicQuery, seconds: f64, shown: Option<&Period>) -> bool {
    let real = |seconds: f64| SignedDuration::from_secs_f64(seconds * cx.snapshot.speed.clamp(0.01, 1e6));
    let past = shown.is_some_and(|shown| shown.to <= cx.now);
    periodic.due(cx.steady(), real(if past { 20.0 * seconds } else { seconds }), real(PATIENCE_S))
}

/// `morning 2026-11-21 06:00–14:00`; a period without a name of its own has its times in it already.
pub fn words(cx: &ViewContext, shown: &Period) -> String {
    let local = |at: jiff::Timestamp| at.to_zoned(cx.def().time_zone.clone()).strftime("%H:%M").to_string();
    match shown.name.contains(':') {
        true => shown.name.clone(),
        false => format!("{} {}–{}", shown.name, local(shown.from), local(shown.to)),
    }
}
