//! Times from instants, and instants from times.

use std::time::Duration;

use jiff::{SignedDuration, Timestamp};

/// Time between two instants; zero if the second is earlier, as after a clock that was set back.
pub fn elapsed(from: Timestamp, to: Timestamp) -> Duration {
    Duration::try_from(to.duration_since(from)).unwrap_or_default()
}

/// The instant `number` intervals later, computed from the start, so that no rounding adds up. `None` if it cannot be.
pub fn instant_of_grid(from: Timestamp, every: Duration, number: usize) -> Option<Timestamp> {
    let nanos = i128::try_from(every.as_nanos()).ok()?.checked_mul(number as i128)?;
    from.checked_add(SignedDuration::from_nanos_i128(nanos)).ok()
}

/// Whether an hour has begun since.
pub fn is_later_hour(stored: Timestamp, at: Timestamp) -> bool {
    stored.as_second().div_euclid(3_600) < at.as_second().div_euclid(3_600)
}
