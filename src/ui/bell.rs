//! When the bell of the terminal rings: for every alarm that is annunciated, if wanted again until all are acknowledged,
//! never when one returns; pure.

use std::{collections::HashSet, sync::Arc};

use jiff::Timestamp;

use crate::plant::{
    alarm::{ActiveAlarm, AlarmState},
    def::AlarmId,
    snapshot::Snapshot,
};

/// Does an alarm wait for an acknowledgement that did not before? A silenced plant stays silent until the next one comes.
pub fn rings(before: &Snapshot, now: &Snapshot) -> bool {
    if !now.sound || Arc::ptr_eq(&before.alarms, &now.alarms) {
        return false;
    }
    let known: HashSet<_> = sounding(&before.alarms).collect();
    sounding(&now.alarms).any(|alarm| !known.contains(&alarm))
}

/// Ticks of half a second between two rings for an alarm that stays unacknowledged.
const REPEAT_TICKS: u32 = 20;

/// Does an alarm wait for an acknowledgement, so many ticks after the bell rang? A silenced plant stays silent here too.
pub fn rings_again(now: &Snapshot, ticks: u32) -> bool {
    now.sound && REPEAT_TICKS <= ticks && sounding(&now.alarms).next().is_some()
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

    #[test]
    fn it_rings_again_every_ten_seconds_until_acknowledged() {
        use crate::{
            plant::command::CommandKind,
            ui::{
                Effect, Model, Msg,
                preferences::{Bell, Preferences},
                tests::{model, sent_kind, type_keys},
                theme::Theme,
                update,
            },
        };
        let count = |model: &mut Model, ticks: u32| {
            let tick = || Msg::Tick { silent: std::time::Duration::ZERO };
            (0..ticks).flat_map(|_| update(model, tick())).filter(|effect| *effect == Effect::Bell).count()
        };
        for (bell, rings) in [(Bell::Off, 0), (Bell::Once, 0), (Bell::Repeated, 3)] {
            let mut model = model(&Fixture::alarm(), Theme::FULL);
            model.preferences_file.set(Some("tech1"), Preferences { bell, ..Preferences::default() });
            update(&mut model, Msg::Snapshot(Fixture::alarm().snapshot()));
            assert_eq!(count(&mut model, 60), rings, "{bell:?}: 30 s");
            let silence = update(&mut model, Msg::Key(crate::ui::keys::ctrl('s').event()));
            assert!(matches!(sent_kind(&silence), Some(CommandKind::Alarm(_))));
            let silenced = Snapshot { sound: false, ..Arc::unwrap_or_clone(Fixture::alarm().snapshot()) };
            update(&mut model, Msg::Snapshot(Arc::new(silenced)));
            assert_eq!(count(&mut model, 60), 0, "{bell:?}: silenced");
            type_keys(&mut model, "3b");
            assert_eq!(model.preferences.bell == Bell::Off, bell != Bell::Off, "b switches it off and on");
        }
    }
}
