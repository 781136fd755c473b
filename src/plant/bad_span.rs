//! Raw numbers that mean "no value".

use serde::{Deserialize, Serialize};

use super::exact::Exact;

/// Raw numbers that mean "no value": one, or all from the first to the last.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct BadSpan {
    /// The lowest.
    pub first: Exact,
    /// The highest.
    pub last: Exact,
}

impl BadSpan {
    /// Is it one of them?
    pub fn holds(self, raw: Exact) -> bool {
        is_same(self.first, raw) || is_same(self.last, raw) || self.first < raw && raw < self.last
    }

    /// The number, where it is only one.
    pub fn single(self) -> Option<Exact> {
        (self.first == self.last).then_some(self.first)
    }
}

impl<N: Into<Exact>> From<N> for BadSpan {
    fn from(number: N) -> BadSpan {
        let number = number.into();
        BadSpan { first: number, last: number }
    }
}

/// Do the bits of both say the same? −0 of a float is a mark of its own, 0 is either.
fn is_same(mark: Exact, raw: Exact) -> bool {
    let is_minus_zero = |number: Exact| number.near() == 0.0 && number.near().is_sign_negative();
    mark == raw && (!is_minus_zero(mark) || is_minus_zero(raw))
}
