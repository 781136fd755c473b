//! On change: which samples differ enough from what was sent last.

use jiff::Timestamp;

use crate::plant::{
    def::{MqttDef, TagId},
    sample::Sample,
};

/// What was sent last of each tag, by [`TagId`].
#[derive(Debug, Clone)]
pub struct Deadband {
    sent: Vec<Option<Sample>>,
}

impl Deadband {
    /// Nothing was sent yet: every sample passes.
    pub fn new(tags: usize) -> Deadband {
        Deadband { sent: vec![None; tags] }
    }

    /// Is this sample to be sent? If so, it counts as sent.
    pub fn pass(&mut self, def: &MqttDef, tag: TagId, sample: Sample) -> bool {
        let Some(sent) = self.sent.get_mut(tag.index()) else { return false };
        let is_due = sent.is_none_or(|sent| differs(def, tag, sent, sample));
        if is_due {
            *sent = Some(sample);
        }
        is_due
    }
}

/// Another quality, a change beyond the deadband, or a value that was sent too long ago.
pub(super) fn differs(def: &MqttDef, tag: TagId, sent: Sample, sample: Sample) -> bool {
    if sent.quality != sample.quality {
        return true;
    }
    match (sent.exact(), sample.exact()) {
        (Some(old), Some(new)) => {
            let band = def.deadband(tag);
            let is_beyond = if band > 0.0 { (new - old).near().abs() > band } else { new != old };
            is_beyond || is_old(def, sent.at, sample.at)
        }
        (None, None) => is_old(def, sent.at, sample.at),
        (None, Some(_)) | (Some(_), None) => true,
    }
}

/// A clock that was set back makes everything old.
fn is_old(def: &MqttDef, sent: Timestamp, at: Timestamp) -> bool {
    at < sent || at.duration_since(sent).unsigned_abs() >= def.max_interval
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::{north::payload::tests::mqtt, plant::sample::Cause};

    #[test]
    fn a_change_a_quality_or_the_time_makes_a_sample_due() {
        let def = MqttDef { deadbands: vec![0.5], max_interval: Duration::from_secs(60), ..mqtt() };
        let at = |second: i64| Timestamp::from_second(1_000 + second).expect("in range");
        let good = |second, value| Sample::good(value, at(second));
        let mut deadband = Deadband::new(1);
        let mut check = |sample, expect: bool| assert_eq!(deadband.pass(&def, TagId(0), sample), expect, "{sample:?}");
        check(good(0, 70.0), true);
        check(good(1, 70.5), false);
        check(good(2, 70.6), true);
        check(good(3, 70.2), false);
        check(Sample::bad(Cause::Timeout, at(4)), true);
        check(Sample::bad(Cause::Timeout, at(5)), false);
        check(Sample::bad(Cause::Corrupt, at(6)), true);
        check(good(7, 70.2), true);
        check(good(66, 70.2), false);
        check(good(67, 70.2), true);
        check(good(30, 70.2), true);
    }

    #[test]
    fn without_a_deadband_only_a_repetition_is_left_out() {
        let def = mqtt();
        let mut deadband = Deadband::new(2);
        let at = Timestamp::from_second(1_000).expect("in range");
        assert!(deadband.pass(&def, TagId(1), Sample::good(1.0, at)));
        assert!(!deadband.pass(&def, TagId(1), Sample::good(1.0, at)));
        assert!(deadband.pass(&def, TagId(1), Sample::good(1.000_001, at)));
        assert!(!deadband.pass(&def, TagId(7), Sample::good(1.0, at)), "a tag that the plant does not have");
    }
}
