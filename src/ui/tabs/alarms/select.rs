//! Which row of the list is selected, which are marked, and which first-out groups are folded.

use super::*;

impl Alarms {
    /// The alarms whose rows are on the screen.
    pub(super) fn seen<'a>(&self, cx: &ViewContext<'a>) -> Vec<&'a ActiveAlarm> {
        let rows = self.rows(cx);
        let room = view::room(cx, cx.area.width, cx.area.height);
        let first = first(self.place(&rows), rows.len(), room);
        rows.into_iter().skip(first).take(room).map(|row| row.alarm).collect()
    }

    pub(super) fn step(&mut self, cx: &ViewContext, motion: Motion) {
        let room = usize::from(cx.area.height.saturating_sub(3)).max(1);
        match self.page {
            Page::Metrics => self.metrics.step(cx, motion, room),
            Page::Handover => self.handover.step(cx, motion, room),
            Page::Active | Page::Suppressed | Page::System | Page::Journal => {
                self.list_mut(cx).into_iter().for_each(|list| list.step(cx, motion));
            }
        }
    }

    /// Folds the first-out group that the selected alarm belongs to, or shows what is folded.
    pub(super) fn fold(&mut self, cx: &ViewContext, folded: bool) {
        let Some(first_out) = self.selected(cx).and_then(|alarm| alarm.first_out) else { return };
        self.folds.retain(|(began, _)| *began != first_out.began);
        self.folds.push((first_out.began, folded));
        // Folded away with its first-out group, it is the first of it that is selected.
        let rows = self.rows(cx);
        if !rows.iter().any(|row| self.selected.0 == Some(row.alarm.id)) {
            let leader =
                rows.iter().find(|row| row.folded && row.alarm.first_out.map(|b| b.began) == Some(first_out.began));
            self.selected.0 = leader.map(|row| row.alarm.id);
        }
    }

    /// Does the selected alarm belong to a first-out group that is folded, or to one that is shown?
    pub(super) fn is_folded(&self, cx: &ViewContext, folded: bool) -> bool {
        let began = |alarm: &ActiveAlarm| alarm.first_out.map(|first_out| first_out.began);
        let Some(group) = self.selected(cx).and_then(began) else { return false };
        let rows = self.rows(cx);
        rows.iter().any(|row| began(row.alarm) == Some(group) && row.more > 0 && row.folded == folded)
    }

    /// Marks the selected alarm, or takes its mark off, and goes on to the next one.
    pub(super) fn mark(&mut self, cx: &ViewContext) {
        let Some(id) = self.selected(cx).map(|alarm| alarm.id) else { return };
        match self.marked.iter().position(|marked| *marked == id) {
            Some(place) => drop(self.marked.remove(place)),
            None => self.marked.push(id),
        }
        ListPage::step(self, cx, Motion::Rows(1));
    }

    /// The marked alarms, in the order of the list.
    pub fn marked<'a>(&self, cx: &ViewContext<'a>) -> Vec<&'a ActiveAlarm> {
        let listed = self.listed(cx).unwrap_or_default();
        listed.into_iter().filter(|alarm| self.marked.contains(&alarm.id)).collect()
    }

    /// The marked alarms, else the selected one: what a key acts on.
    pub(super) fn meant(&self, cx: &ViewContext) -> Vec<AlarmId> {
        let marked: Vec<AlarmId> = self.marked(cx).into_iter().map(|alarm| alarm.id).collect();
        if marked.is_empty() { self.selected(cx).map(|alarm| alarm.id).into_iter().collect() } else { marked }
    }

    /// Forgets marks and folds of what has gone from the list.
    pub(super) fn forget_gone(&mut self, cx: &ViewContext) {
        let alarms = &cx.snapshot.alarms;
        let there = |began: &Timestamp| {
            alarms.iter().any(|alarm| alarm.first_out.is_some_and(|first_out| first_out.began == *began))
        };
        self.folds.retain(|(began, _)| there(began));
        self.marked.retain(|marked| alarms.iter().any(|alarm| alarm.id == *marked));
    }
}
