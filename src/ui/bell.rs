//! When the bell of the terminal rings: once for every alarm that is annunciated, never when one returns; pure.

use std::{collections::HashSet, sync::Arc};

use jiff::Timestamp;

use crate::plant::{
    alarm::AlarmState,
    def::AlarmId,
    snapshot::{ActiveAlarm, Snapshot},
};

/// Does an alarm wait for an acknowledgement that did not before? A silenced plant stays silent until the next one comes.
pub fn rings(before: &Snapshot, now: &Snapshot) -> bool {
    if !now.sound || Arc::ptr_eq(&before.alarms, &now.alarms) {
        return false;
    }
    let known: HashSet<_> = sounding(&before.alarms).collect();
    sounding(&now.alarms).any(|alarm| !known.contains(&alarm))
}

/// Active, unacknowledged alarm activations.
fn sounding(alarms: &[ActiveAlarm]) -> impl Iterator<Item = (AlarmId, Timestamp)> {
    let sounds = |alarm: &&ActiveAlarm| alarm.state == AlarmState::Unacknowledged;
    alarms.iter().filter(sounds).map(|alarm| (alarm.id, alarm.raised_at))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ui::fixture::Fixture;

    #[test]
    fn it_rings_for_what_is_new_and_never_for_what_goes() {
        use AlarmState::{Acknowledged, ReturnedToNormal, Unacknowledged};
        let one = |state, sound| {
            let mut fixture = Fixture::alarm();
            fixture.alarms.truncate(1);
            fixture.alarms[0].state = state;
            Snapshot { sound, ..Arc::unwrap_or_clone(fixture.snapshot()) }
        };
        let none = || Snapshot { alarms: Arc::default(), ..one(ReturnedToNormal, false) };
        let check = |before: Snapshot, now: Snapshot, expect, why: &str| {
            assert_eq!(rings(&before, &now), expect, "{why}");
        };
        check(none(), one(Unacknowledged, true), true, "raised");
        check(one(Unacknowledged, true), one(Unacknowledged, true), false, "it rang already");
        check(one(Unacknowledged, true), one(ReturnedToNormal, true), false, "returned");
        check(one(ReturnedToNormal, false), none(), false, "gone");
        check(none(), one(Unacknowledged, false), false, "silenced");
        check(one(Acknowledged, false), one(Unacknowledged, true), true, "raised again");
        let mut again = one(Unacknowledged, true);
        Arc::make_mut(&mut again.alarms)[0].raised_at = again.at;
        check(one(Unacknowledged, true), again, true, "a new activation of the same");
    }
}
