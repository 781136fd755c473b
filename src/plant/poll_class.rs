//! The poll classes: how important it is that a tag is read in time.

use serde::{Deserialize, Serialize};

use super::keyword::keyword_enum;

keyword_enum! {
    /// How important it is that a tag is read in time, the most important first. On an overloaded line background polls are
    /// shed, then the periods of normal polls are stretched; critical polls keep theirs.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
    pub enum PollClass: "poll class" {
        /// An alarm is evaluated from it.
        Critical => "critical",
        /// A process value.
        Normal => "normal",
        /// Identification.
        Background => "background",
    }
}
