//! A device profile: it is read or refused with reasons, and what is read can run.

use super::common::{checked_file, run_plant};

/// The file.
pub fn run(data: &[u8]) {
    if let Some(def) = checked_file("fuzz.toml", data) {
        run_plant(&def);
    }
}
