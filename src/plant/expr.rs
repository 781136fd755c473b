//! A condition over tags, as plant files write it: `PLC-1.HEATER = ON and PLC-1.LT-1 > 5 cm`.

use serde::{Deserialize, Serialize};

use super::id::TagId;

/// A condition over tags.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Expr {
    /// A tag is compared with a value.
    Test {
        /// Which tag.
        tag: TagId,
        /// How.
        compare: Compare,
        /// With this, in the tag's unit.
        value: f64,
    },
    /// The other way round.
    Not(Box<Expr>),
    /// All of these.
    All(Vec<Expr>),
    /// At least one of these.
    Any(Vec<Expr>),
}

/// How a tag is compared.
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

impl Expr {
    /// Whether it is true; `None` if the known tags do not decide it. `value` gives the good value of a
    /// tag.
    pub fn holds(&self, value: &impl Fn(TagId) -> Option<f64>) -> Option<bool> {
        match self {
            Expr::Test { tag, compare, value: with } => value(*tag).map(|value| compare.holds(value, *with)),
            Expr::Not(inner) => inner.holds(value).map(|holds| !holds),
            Expr::All(parts) => decided(parts, value, false),
            Expr::Any(parts) => decided(parts, value, true),
        }
    }

    /// Every tag in it.
    pub fn tags(&self) -> Vec<TagId> {
        match self {
            Expr::Test { tag, .. } => vec![*tag],
            Expr::Not(inner) => inner.tags(),
            Expr::All(parts) | Expr::Any(parts) => parts.iter().flat_map(Expr::tags).collect(),
        }
    }
}

impl Compare {
    fn holds(self, value: f64, with: f64) -> bool {
        match self {
            Compare::Equal => value == with,
            Compare::Differs => value != with,
            Compare::Below => value < with,
            Compare::AtMost => value <= with,
            Compare::Above => value > with,
            Compare::AtLeast => value >= with,
        }
    }
}

/// One part that is `decisive` decides, whatever is unknown beside it.
fn decided(parts: &[Expr], value: &impl Fn(TagId) -> Option<f64>, decisive: bool) -> Option<bool> {
    let mut unknown = false;
    for part in parts {
        match part.holds(value) {
            Some(holds) if holds == decisive => return Some(decisive),
            Some(_) => {}
            None => unknown = true,
        }
    }
    (!unknown).then_some(!decisive)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_unknown_decides_nothing_unless_the_rest_decides() {
        let test = |n, compare| Expr::Test { tag: TagId(n), compare, value: 5.0 };
        let (low, high, unknown) = (TagId(0), TagId(1), TagId(2));
        let value = |tag: TagId| match tag {
            _ if tag == low => Some(4.0),
            _ if tag == high => Some(5.0),
            _ => None,
        };
        let (yes, no, maybe) = (test(0, Compare::Below), test(1, Compare::Above), test(unknown.0, Compare::Equal));
        for (expr, expect) in [
            (yes.clone(), Some(true)),
            (no.clone(), Some(false)),
            (maybe.clone(), None),
            (test(1, Compare::Equal), Some(true)),
            (test(1, Compare::Differs), Some(false)),
            (test(1, Compare::AtLeast), Some(true)),
            (test(1, Compare::AtMost), Some(true)),
            (Expr::Not(Box::new(no.clone())), Some(true)),
            (Expr::Not(Box::new(maybe.clone())), None),
            (Expr::All(vec![yes.clone(), maybe.clone()]), None),
            (Expr::All(vec![no.clone(), maybe.clone()]), Some(false)),
            (Expr::Any(vec![yes.clone(), maybe.clone()]), Some(true)),
            (Expr::Any(vec![no, maybe]), None),
        ] {
            assert_eq!(expr.holds(&value), expect, "{expr:?}");
        }
    }
}
