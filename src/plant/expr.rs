//! The expression language of plant files: a condition `PLC-1.HEATER = ON and PLC-1.LT-1 > 5 cm`, or what a calculated
//! tag is: `max(TIC-1.PV, TIC-2.PV) - 5`.

use std::ops::Add;

use serde::{Deserialize, Serialize};

pub use super::compare::Compare;
use super::{exact::Exact, id::TagId, identity::IdentityTest, keyword::keyword_enum};

/// An expression over tags. As a number, true is 1 and false 0; as a condition, every number but 0 is true.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Expr {
    /// The same always.
    Number(Exact),
    /// The value of a tag, in its unit.
    Tag(TagId),
    /// Two numbers become one.
    Arithmetic(Box<Expr>, Operator, Box<Expr>),
    /// A function of numbers; never without any.
    Call(Function, Vec<Expr>),
    /// Two numbers are compared.
    Test(Box<Expr>, Compare, Box<Expr>),
    /// What a device says of itself is compared with a text.
    Identity(IdentityTest),
    /// The other way round.
    Not(Box<Expr>),
    /// All of these.
    All(Vec<Expr>),
    /// At least one of these.
    Any(Vec<Expr>),
}

keyword_enum! {
    /// How two numbers become one.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
    pub enum Operator: "operator" {
        /// Sum.
        Add => "+",
        /// Difference.
        Subtract => "-",
        /// Product.
        Multiply => "*",
        /// Quotient.
        Divide => "/",
    }
}

keyword_enum! {
    /// A function of numbers.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
    pub enum Function: "function" {
        /// The least.
        Min => "min",
        /// The greatest.
        Max => "max",
        /// The arithmetic mean.
        Mean => "mean",
        /// Without its sign; of one number.
        Abs => "abs",
    }
}

impl Expr {
    /// A tag is compared with a fixed value.
    #[cfg(test)]
    pub fn test(tag: TagId, compare: Compare, value: impl Into<Exact>) -> Expr {
        Expr::Test(Box::new(Expr::Tag(tag)), compare, Box::new(Expr::Number(value.into())))
    }

    /// Whether it is true; `None` if the known tags do not decide it. `value` gives the good value of a
    /// tag.
    pub fn holds(&self, value: &impl Fn(TagId) -> Option<Exact>) -> Option<bool> {
        self.holds_for(value, &|_| None)
    }

    /// The same where it is known what devices say of themselves; `identity` evaluates a test of that.
    pub fn holds_for(
        &self,
        value: &impl Fn(TagId) -> Option<Exact>,
        identity: &impl Fn(&IdentityTest) -> Option<bool>,
    ) -> Option<bool> {
        let number = |expr: &Expr| expr.number_for(value, identity);
        let decided = |parts: &[Expr], decisive| decided(parts, &|part| part.holds_for(value, identity), decisive);
        match self {
            Expr::Test(left, compare, right) => Some(compare.fits(number(left)?.partial_cmp(&number(right)?))),
            Expr::Identity(test) => identity(test),
            Expr::Not(inner) => inner.holds_for(value, identity).map(|holds| !holds),
            Expr::All(parts) => decided(parts, false),
            Expr::Any(parts) => decided(parts, true),
            Expr::Number(_) | Expr::Tag(_) | Expr::Arithmetic(..) | Expr::Call(..) => {
                number(self).map(|number| number != 0.0)
            }
        }
    }

    /// Its value; `None` where a tag is unknown, and for a division by zero and an overflow.
    pub fn number(&self, value: &impl Fn(TagId) -> Option<Exact>) -> Option<Exact> {
        self.number_for(value, &|_| None)
    }

    fn number_for(
        &self,
        value: &impl Fn(TagId) -> Option<Exact>,
        identity: &impl Fn(&IdentityTest) -> Option<bool>,
    ) -> Option<Exact> {
        let of_part = |part: &Expr| part.number_for(value, identity);
        let number = match self {
            Expr::Number(number) => *number,
            Expr::Tag(tag) => value(*tag)?,
            Expr::Arithmetic(left, operator, right) => {
                let (left, right) = (of_part(left)?, of_part(right)?);
                match operator {
                    Operator::Add => left + right,
                    Operator::Subtract => left - right,
                    Operator::Multiply => left * right,
                    Operator::Divide => left / right,
                }
            }
            Expr::Call(function, of) => {
                let count = Exact::from(of.len() as f64);
                let mut numbers = of.iter().map(of_part).collect::<Option<Vec<Exact>>>()?.into_iter();
                match function {
                    Function::Min => numbers.reduce(|least, next| if next < least { next } else { least })?,
                    Function::Max => numbers.reduce(|most, next| if most < next { next } else { most })?,
                    Function::Mean => numbers.reduce(Exact::add)? / count,
                    Function::Abs => numbers.next()?.abs(),
                }
            }
            Expr::Test(..) | Expr::Identity(_) | Expr::Not(_) | Expr::All(_) | Expr::Any(_) => {
                f64::from(u8::from(self.holds_for(value, identity)?)).into()
            }
        };
        Some(number).filter(|number| number.is_finite())
    }

    /// Every tag in it, in the order in which they are written.
    pub fn tags(&self) -> Vec<TagId> {
        match self {
            Expr::Number(_) | Expr::Identity(_) => Vec::new(),
            Expr::Tag(tag) => vec![*tag],
            Expr::Not(inner) => inner.tags(),
            Expr::Arithmetic(left, _, right) | Expr::Test(left, _, right) => [left.tags(), right.tags()].concat(),
            Expr::Call(_, parts) | Expr::All(parts) | Expr::Any(parts) => parts.iter().flat_map(Expr::tags).collect(),
        }
    }

    /// Every test in it of what a device says of itself.
    pub fn identity_tests(&self) -> Vec<&IdentityTest> {
        match self {
            Expr::Number(_) | Expr::Tag(_) => Vec::new(),
            Expr::Identity(test) => vec![test],
            Expr::Not(inner) => inner.identity_tests(),
            Expr::Arithmetic(left, _, right) | Expr::Test(left, _, right) => {
                [left.identity_tests(), right.identity_tests()].concat()
            }
            Expr::Call(_, parts) | Expr::All(parts) | Expr::Any(parts) => {
                parts.iter().flat_map(Expr::identity_tests).collect()
            }
        }
    }
}

/// One part that is `decisive` decides, whatever is unknown beside it.
fn decided(parts: &[Expr], holds: &impl Fn(&Expr) -> Option<bool>, decisive: bool) -> Option<bool> {
    let mut unknown = false;
    for part in parts {
        match holds(part) {
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
        let test = |n, compare| Expr::test(TagId(n), compare, 5.0);
        let (low, high, unknown) = (TagId(0), TagId(1), TagId(2));
        let value = |tag: TagId| match tag {
            _ if tag == low => Some(4.0.into()),
            _ if tag == high => Some(5.0.into()),
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

    #[test]
    fn a_number_that_does_not_exist_is_none() {
        let (tag, zero) = (|n| Box::new(Expr::Tag(TagId(n))), || Box::new(Expr::Number(0.0.into())));
        let value = |of: TagId| [Some(6.0), Some(f64::MAX), None].get(of.index()).copied().flatten().map(Exact::from);
        let call = |function, tags: &[u16]| Expr::Call(function, tags.iter().map(|n| Expr::Tag(TagId(*n))).collect());
        for (expr, expect) in [
            (Expr::Arithmetic(tag(0), Operator::Subtract, Box::new(Expr::Number(8.0.into()))), Some(-2.0)),
            (Expr::Arithmetic(tag(0), Operator::Divide, zero()), None),
            (Expr::Arithmetic(zero(), Operator::Divide, zero()), None),
            (Expr::Arithmetic(tag(1), Operator::Add, tag(1)), None),
            (Expr::Arithmetic(tag(0), Operator::Multiply, tag(2)), None),
            (call(Function::Max, &[0, 1]), Some(f64::MAX)),
            (call(Function::Min, &[0, 1]), Some(6.0)),
            (call(Function::Mean, &[0, 0]), Some(6.0)),
            (call(Function::Min, &[0, 2]), None),
            (Expr::test(TagId(0), Compare::Above, 5.0), Some(1.0)),
        ] {
            assert_eq!(expr.number(&value), expect.map(Exact::from), "{expr:?}");
        }
    }
}
