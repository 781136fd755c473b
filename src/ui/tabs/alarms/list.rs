//! The rows of the list: in order of urgency, a first-out group folded under the alarm that came first; pure.

use std::collections::HashMap;

use jiff::Timestamp;

use crate::plant::{
    alarm::{ActiveAlarm, AlarmState},
    def::{PlantDef, Priority},
};

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AlarmRow<'a> {
    pub alarm: &'a ActiveAlarm,
    /// It is the first-out alarm, and others of its group are in the list.
    pub first: bool,
    /// It stands under the one that its first-out group is folded under.
    pub under: bool,
    /// It is the last of those.
    pub last: bool,
    /// So many alarms of its first-out group are folded under it, or can be.
    pub more: usize,
    /// So many of those wait for an acknowledgement.
    pub more_waiting: usize,
    pub folded: bool,
}

impl<'a> AlarmRow<'a> {
    /// A row of an alarm that stands for itself.
    pub fn plain(alarm: &'a ActiveAlarm) -> AlarmRow<'a> {
        AlarmRow { alarm, first: false, under: false, last: false, more: 0, more_waiting: 0, folded: false }
    }
}

/// A first-out group, as far as it is in the list.
struct Group<'a> {
    /// The earliest of it that is in the list.
    leader: &'a ActiveAlarm,
    rank: u32,
    /// Those that may be folded, in the order of the list; the leader may be among them.
    below: Vec<&'a ActiveAlarm>,
    count: usize,
    listed: bool,
}

/// The rows of these alarms, which come in order of urgency. The first of a first-out group stands where the most urgent of it
/// would, the less urgent others below it, unless they are folded; alarms of high and critical priority are never folded, nor
/// is anything once the first has gone from the list, nor what needs an operator under one that has returned.
pub fn rows<'a>(
    def: &PlantDef,
    alarms: impl Iterator<Item = &'a ActiveAlarm>,
    is_folded: impl Fn(Timestamp) -> bool,
) -> Vec<AlarmRow<'a>> {
    let alarms: Vec<&ActiveAlarm> = alarms.collect();
    let root = |alarm: &&ActiveAlarm| alarm.first_out.filter(|group| group.rank == 1).map(|group| group.began);
    let roots: HashMap<Timestamp, &ActiveAlarm> =
        alarms.iter().filter_map(|alarm| Some((root(alarm)?, *alarm))).collect();
    let mut groups: HashMap<Timestamp, Group> = HashMap::new();
    for alarm in &alarms {
        let Some(first_out) = alarm.first_out else { continue };
        let root = roots.get(&first_out.began);
        let new = || Group { leader: alarm, rank: first_out.rank, below: Vec::new(), count: 0, listed: false };
        let group = groups.entry(first_out.began).or_insert_with(new);
        if first_out.rank < group.rank {
            (group.leader, group.rank) = (alarm, first_out.rank);
        }
        group.count += 1;
        if root.is_some_and(|root| may_fold(def, root, alarm)) {
            group.below.push(alarm);
        }
    }
    let mut rows = Vec::with_capacity(alarms.len());
    for alarm in &alarms {
        let group = alarm.first_out.and_then(|first_out| Some((first_out.began, groups.get_mut(&first_out.began)?)));
        let Some((began, group)) = group.filter(|(_, group)| 1 < group.count && group.rank == 1) else {
            rows.push(AlarmRow::plain(alarm));
            continue;
        };
        if !std::mem::replace(&mut group.listed, true) {
            let below: Vec<_> = group.below.iter().filter(|other| other.id != group.leader.id).copied().collect();
            let more_waiting = below.iter().filter(|other| other.state.needs_acknowledgement()).count();
            let folded = !below.is_empty() && is_folded(began);
            rows.push(AlarmRow {
                first: true,
                more: below.len(),
                more_waiting,
                folded,
                ..AlarmRow::plain(group.leader)
            });
            if !folded {
                let last = below.len().saturating_sub(1);
                let under = |(n, alarm)| AlarmRow { under: true, last: n == last, ..AlarmRow::plain(alarm) };
                rows.extend(below.into_iter().enumerate().map(under));
            }
        }
        if alarm.id != group.leader.id && !may_fold(def, group.leader, alarm) {
            rows.push(AlarmRow::plain(alarm));
        }
    }
    rows
}

/// May an alarm be folded under the first of its group?
fn may_fold(def: &PlantDef, root: &ActiveAlarm, alarm: &ActiveAlarm) -> bool {
    if alarm.state == AlarmState::Unacknowledged && root.returned_at.is_some() {
        return false;
    }
    match def.alarm(alarm.id).priority {
        Priority::Critical | Priority::High => false,
        Priority::Medium | Priority::Low => true,
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::{
        plant::{def::AlarmId, record::FirstOut},
        ui::fixture::{Fixture, now},
    };

    const PRIORITIES: [Priority; 4] = [Priority::Critical, Priority::High, Priority::Medium, Priority::Low];

    /// Alarms of these priorities, each with the number of its first-out group and its rank in it.
    fn book(rows: &[(Priority, i64, u32)]) -> (PlantDef, Vec<ActiveAlarm>) {
        let mut def = Fixture::normal().def;
        let pattern = def.alarms[0].clone();
        def.alarms.clear();
        let mut alarms = Vec::new();
        for (n, (priority, first_out, rank)) in rows.iter().enumerate() {
            let id = AlarmId(n as u16);
            def.alarms.push(crate::plant::def::AlarmDef { id, priority: *priority, ..pattern.clone() });
            let began = now() + jiff::SignedDuration::from_secs(*first_out);
            let first_out = (*first_out > 0).then_some(FirstOut { began, rank: *rank });
            alarms.push(ActiveAlarm { first_out, ..ActiveAlarm::new(id, AlarmState::Unacknowledged, now()) });
        }
        alarms.sort_by_key(|alarm| def.alarm(alarm.id).priority);
        (def, alarms)
    }

    fn ids(rows: &[AlarmRow]) -> Vec<u16> {
        rows.iter().map(|row| row.alarm.id.0).collect()
    }

    #[test]
    fn consequences_fold_under_the_first_alarm_urgent_ones_never() {
        use Priority::{High, Low, Medium};
        let (def, alarms) = book(&[(Low, 7, 1), (High, 7, 2), (Medium, 7, 3), (Low, 7, 4), (Medium, 0, 1)]);
        let folded = rows(&def, alarms.iter(), |_| true);
        assert_eq!(ids(&folded), [0, 1, 4], "the cause stands above the urgent one of its first-out group");
        assert!(folded[0].first && folded[0].folded && (folded[0].more, folded[0].more_waiting) == (2, 2));
        let began = alarms[0].first_out.expect("it is in a first-out group").began;
        let open = rows(&def, alarms.iter(), |of| of != began);
        assert_eq!(ids(&open), [0, 2, 3, 1, 4]);
        assert_eq!(open.iter().map(|row| row.under).collect::<Vec<_>>(), [false, true, true, false, false]);
        assert!(!open[1].last && open[2].last, "the branch ends with the last of them");
        assert!(!open[0].folded && open[0].more == 2);
        let alone = rows(&def, alarms.iter().filter(|alarm| alarm.id.0 == 0), |_| true);
        assert!(!alone[0].first, "the first of nothing");
        let headless = rows(&def, alarms.iter().filter(|alarm| alarm.id.0 != 0), |_| true);
        assert!(!headless[0].first, "the second is not called the first once that has gone");
        assert_eq!(headless.len(), 4, "and nothing is folded under it");
        let mut returned = alarms.clone();
        let root = returned.iter_mut().find(|alarm| alarm.id.0 == 0).expect("it is there");
        (root.state, root.returned_at) = (AlarmState::ReturnedToNormal, Some(now()));
        assert_eq!(
            ids(&rows(&def, returned.iter(), |_| true)).len(),
            5,
            "an active alarm is not hidden by one that returned"
        );
    }

    proptest! {
        #[test]
        fn no_alarm_is_lost_and_none_stands_twice(
            seeds in proptest::collection::vec((0..4usize, 0..4i64), 0..40),
            open in any::<bool>(),
        ) {
            let mut ranks = [0u32; 4];
            let seeds: Vec<_> = seeds.into_iter().map(|(priority, first_out)| {
                ranks[first_out as usize] += 1;
                (PRIORITIES[priority], first_out, ranks[first_out as usize])
            }).collect();
            let (def, alarms) = book(&seeds);
            let rows = rows(&def, alarms.iter(), |_| !open);
            let hidden: usize = rows.iter().filter(|row| row.folded).map(|row| row.more).sum();
            prop_assert_eq!(rows.len() + hidden, alarms.len());
            let mut seen = ids(&rows);
            seen.sort_unstable();
            seen.dedup();
            prop_assert_eq!(seen.len(), rows.len());
            for alarm in alarms.iter().filter(|alarm| !may_fold(&def, alarm, alarm)) {
                prop_assert!(rows.iter().any(|row| row.alarm.id == alarm.id));
            }
        }
    }
}
