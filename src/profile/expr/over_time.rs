//! What becomes of an expression over time: totals and delays, each a calculated tag of its own.

use std::time::Duration;

use jiff::SignedDuration;

use super::{Expr, Reader, Total, is_condition, no_condition};
use crate::plant::{
    calculation_def::OverTime,
    delay::{Delay, Edge},
    keyword::Keyword,
};

/// Is it the word before a parenthesis that stands alone?
pub(super) fn is_over_time(word: &str) -> bool {
    Total::from_word(word).is_some() || Edge::from_word(word).is_some()
}

impl Reader<'_, '_> {
    /// `integral(…)`, `on_delay(…, 10 s)`, or an expression.
    pub(super) fn over_time(&mut self) -> Option<(Option<OverTime>, Expr)> {
        let word = self.peek().map_or("", |token| token.value);
        let opens = self.tokens.get(1).is_some_and(|next| next.value == "(");
        if !is_over_time(word) || !opens {
            return Some((None, self.any()?));
        }
        let name = self.take()?;
        self.next += 1;
        let first = self.peek().map_or(self.end, |token| token.at);
        // A comma ends the condition, as in a call.
        self.calls += 1;
        let of = self.nested(Self::any)?;
        self.calls -= 1;
        let over_time = match Edge::from_word(name.value) {
            Some(edge) if is_condition(&of) => OverTime::Delay(Delay { edge, time: self.time()? }),
            Some(_) => {
                no_condition(first, self.problems);
                return None;
            }
            None => OverTime::Total(Total::from_word(name.value)?),
        };
        self.close(name.at)?;
        Some((Some(over_time), of))
    }

    /// `, 10 s`.
    fn time(&mut self) -> Option<Duration> {
        let at = self.peek().map_or(self.end, |token| token.at);
        if !self.takes(",") {
            self.problems.add(at, "`,` and a time are missing").label("expected a time such as `, 10 s`");
            return None;
        }
        let at = self.peek().map_or(self.end, |token| token.at);
        let mut words = Vec::new();
        while let Some(token) = self.peek().filter(|token| token.value != ")") {
            words.push(token.value);
            self.next += 1;
        }
        let text = words.join(" ");
        let time = text.parse::<SignedDuration>().ok().and_then(|time| Duration::try_from(time).ok());
        if time.is_none() {
            self.problems
                .add(at, format!("`{text}` is not a time"))
                .label("expected a time such as `500ms`, `10 s` or `5 min`");
        }
        time
    }
}
