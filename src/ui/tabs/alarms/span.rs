//! What the pages that the history fills have in common: the present or a chosen shift, and the query.

use crate::report::Period;
use crate::ui::tabs::prelude::*;

/// An answer that has not come after so long (real time) counts as lost: a query over weeks may take its time.
const TIMEOUT_S: f64 = 30.0;

/// The query, if it is due: every `seconds` for what is still going on, once in a while for the past.
pub fn ask<T: FromAnswer>(
    cx: &ViewContext,
    answered: &mut Answered<T>,
    seconds: f64,
    shown: Option<&Period>,
    query: Query,
) -> Option<UiAction> {
    let past = shown.is_some_and(|shown| shown.to <= cx.present());
    let every = real(cx, if past { 20.0 * seconds } else { seconds });
    answered.ask(cx, Tab::Alarms, every, real(cx, TIMEOUT_S), query)
}
