//! When a value is stored in the history.

use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::keyword::keyword_enum;

keyword_enum! {
    /// When a value is stored in the history.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
    pub enum StorePolicy: "store policy" {
        /// When it changes by more than its deadband, and at its longest interval.
        Change => "change",
        /// At every reading.
        Always => "always",
        /// Not at all.
        Never => "never",
    }
}

/// The longest interval: well within the hold of `report`, after which a value without a successor is not known any more.
pub const STORE_EVERY_MAX: Duration = Duration::from_secs(60);
