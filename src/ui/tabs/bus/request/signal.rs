//! The fields of a signal test: which signal, which way, for how long.

use super::*;
use crate::plant::port_signals::{HOLD_MAX_S, OutputSignal, SignalTest};

/// Seconds that are enough to read a meter.
const USUAL_S: u16 = 10;

/// Of the form.
pub(super) fn fields() -> Vec<Field> {
    let choice = |label, options: Vec<String>| Field { label, input: Input::Choice(options, 0), range: String::new() };
    vec![
        choice(t!("signal"), OutputSignal::ALL.map(|signal| signal.word().to_owned()).to_vec()),
        choice(t!("state"), [t!("on"), t!("off")].map(str::to_owned).to_vec()),
        Field {
            label: t!("seconds"),
            input: Input::Text(Line::long(&USUAL_S.to_string(), 400)),
            range: format!("1 – {HOLD_MAX_S}"),
        },
    ]
}

impl Form {
    pub(super) fn build_signal(&self, line: &LineDef) -> Result<Built, String> {
        let (signal, on) = (OutputSignal::ALL[self.chosen(0)], self.chosen(1) == 0);
        let seconds = to_u16(number(&self.text(2), t!("seconds"), 1..=i64::from(HOLD_MAX_S))?);
        let test = SignalTest { signal, on, seconds };
        test.check_on(line)?;
        let words = t!("holds {test}, shows which inputs follow, and puts it back. Polling pauses meanwhile.", test);
        Ok((Diagnostic::Signal(test), vec![words]))
    }
}
