//! The status signals of NAMUR NE 107.

use serde::{Deserialize, Serialize};

use super::keyword::keyword_enum;

keyword_enum! {
    /// The four status signals of NE 107. A device that is well has none.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
    pub enum Signal: "signal of NE 107" {
        /// Its values are not valid.
        Failure => "F",
        /// Its values are not valid for the moment, because it is being worked on.
        FunctionCheck => "C",
        /// It works outside of what it is meant for: values are late or missing now and then.
        OutOfSpecification => "S",
        /// Values are good, but something wears out: to be looked at before it fails.
        Maintenance => "M",
    }
}

impl Signal {
    /// In the words of the recommendation.
    pub fn label(self) -> &'static str {
        match self {
            Signal::Failure => "failure",
            Signal::FunctionCheck => "function check",
            Signal::OutOfSpecification => "out of specification",
            Signal::Maintenance => "maintenance required",
        }
    }
}
