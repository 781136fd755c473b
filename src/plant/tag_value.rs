//! What a tag holds: a number, or a text.

use std::{fmt, sync::Arc};

use serde::{Deserialize, Serialize};

use super::exact::Exact;

/// What is written into a tag, or read back from it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum TagValue {
    /// A number, raw or in the unit of its tag.
    Number(Exact),
    /// A text as it is shown.
    Text(Arc<str>),
}

impl TagValue {
    /// The number, where it is one.
    pub fn number(&self) -> Option<Exact> {
        match self {
            TagValue::Number(number) => Some(*number),
            TagValue::Text(_) => None,
        }
    }
}

impl<N: Into<Exact>> From<N> for TagValue {
    fn from(number: N) -> TagValue {
        TagValue::Number(number.into())
    }
}

impl fmt::Display for TagValue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            TagValue::Number(number) => number.fmt(f),
            TagValue::Text(text) => f.write_str(text),
        }
    }
}
