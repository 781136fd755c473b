//! How sure a register map is of a row.

use serde::{Deserialize, Serialize};

use super::keyword::keyword_enum;

keyword_enum! {
    /// How sure a row of a register map is (see the profile's sources).
    #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
    pub enum Confidence: "confidence" {
        /// Recorded on a real device or read in the maker's manual.
        Proven => "proven",
        /// Two independent sources agree.
        High => "high",
        /// One source: a write is flagged "not verified".
        Medium => "medium",
        /// Inference: shown only with `--experimental`.
        Low => "low",
    }
}
