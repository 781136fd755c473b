//! How two things are compared.

use std::cmp::Ordering;

use serde::{Deserialize, Serialize};

/// How two numbers, versions or texts are compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Compare {
    /// `=`
    Equal,
    /// `!=`
    Differs,
    /// `<`
    Below,
    /// `<=`
    AtMost,
    /// `>`
    Above,
    /// `>=`
    AtLeast,
}

impl Compare {
    /// Does the left fit the right, of which it is `found`? What cannot be ordered only differs.
    pub fn fits(self, found: Option<Ordering>) -> bool {
        match self {
            Compare::Equal => found == Some(Ordering::Equal),
            Compare::Differs => found != Some(Ordering::Equal),
            Compare::Below => found == Some(Ordering::Less),
            Compare::AtMost => found.is_some_and(Ordering::is_le),
            Compare::Above => found == Some(Ordering::Greater),
            Compare::AtLeast => found.is_some_and(Ordering::is_ge),
        }
    }

    /// Does it ask which is the greater?
    pub fn is_order(self) -> bool {
        !matches!(self, Compare::Equal | Compare::Differs)
    }

    /// As it is written.
    pub fn sign(self) -> &'static str {
        match self {
            Compare::Equal => "=",
            Compare::Differs => "!=",
            Compare::Below => "<",
            Compare::AtMost => "<=",
            Compare::Above => ">",
            Compare::AtLeast => ">=",
        }
    }
}
