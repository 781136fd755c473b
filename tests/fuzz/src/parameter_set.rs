//! The file of a parameter set: what is read is the same when it is written and read again.

use sightglass::api::{
    plant::{DeviceId, Exact, parameter_set::compare},
    profile::{read_set, text_of_set},
};

use super::common::TANK;

/// The file.
pub fn run(data: &[u8]) {
    match read_set("winter", "winter.toml", data, &TANK) {
        Err(problems) => assert!(!problems.is_empty(), "refused without a reason"),
        Ok(set) => {
            let text = text_of_set(&set, &TANK);
            assert_eq!(read_set("winter", "winter.toml", text.as_bytes(), &TANK), Ok(set.clone()), "{text}");
            for known in [None, Some(Exact::from(0.0)), Some(Exact::from(1.0))] {
                compare(&TANK, DeviceId(0), &set, &|_| known);
            }
        }
    }
}
