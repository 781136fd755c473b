//! What the plant file says of a calculated tag.

use serde::{Deserialize, Serialize};

use super::{delay::Delay, expr::Expr, id::TagId, totalizer::Total};

/// How a value is calculated.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Calculation {
    /// As it is written.
    pub text: String,
    /// What becomes of the expression over time; `None` where it is the value itself.
    pub over_time: Option<OverTime>,
    /// What that means.
    pub expr: Expr,
}

/// What becomes of an expression over time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum OverTime {
    /// It is totalled.
    Total(Total),
    /// It is a condition that is delayed.
    Delay(Delay),
}

impl Calculation {
    /// The tags of the expression, each once, in the order in which they are written.
    pub fn inputs(&self) -> Vec<TagId> {
        let mut inputs = Vec::new();
        for tag in self.expr.tags() {
            if !inputs.contains(&tag) {
                inputs.push(tag);
            }
        }
        inputs
    }
}
