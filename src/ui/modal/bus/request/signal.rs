//! The fields of a signal test: which signal, which way, for how long.

use super::*;
use crate::plant::port_signals::{HOLD_MAX_S, OutputSignal, SignalTest};

/// Seconds that are enough to read a meter.
const USUAL_S: u16 = 10;

pub(super) fn fields() -> Vec<Field> {
    vec![
        Field::choice(t!("signal"), OutputSignal::ALL.map(OutputSignal::word), 0),
        Field::choice(t!("state"), [t!("on"), t!("off")], 0),
        typed(t!("seconds"), &USUAL_S.to_string(), &format!("1 – {HOLD_MAX_S}")),
    ]
}

impl RequestForm {
    pub(super) fn build_signal(&self, line: &LineDef) -> Result<Built, String> {
        let (signal, on) = (OutputSignal::ALL[self.form.chosen(0)], self.form.chosen(1) == 0);
        let seconds = to_u16(number(&self.form.text(2), t!("seconds"), 1..=i64::from(HOLD_MAX_S))?);
        let test = SignalTest { signal, on, seconds };
        test.check_on(line)?;
        let words = t!("holds {test}, shows which inputs follow, and puts it back. Polling pauses meanwhile.", test);
        Ok((Diagnostic::Signal(test), vec![words]))
    }
}
