//! A bound of a value: a number, or what another tag holds.

use serde::{Deserialize, Serialize};

use super::{exact::Exact, id::TagId};

/// A bound of a value.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Bound {
    /// A number in the tag's unit.
    Fixed(Exact),
    /// The present value of another tag.
    From(TagId),
}

impl Bound {
    /// What it is now; `Err` names the tag that is not known.
    pub(super) fn now(self, value: impl Fn(TagId) -> Option<Exact>) -> Result<Exact, TagId> {
        match self {
            Bound::Fixed(bound) => Ok(bound),
            Bound::From(from) => value(from).ok_or(from),
        }
    }

    /// The tag that holds it.
    pub(super) fn source(self) -> Option<TagId> {
        match self {
            Bound::From(tag) => Some(tag),
            Bound::Fixed(_) => None,
        }
    }
}
