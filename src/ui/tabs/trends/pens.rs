//! Which pens are drawn: those of a group of the plant, or of a tag from the list of values.

use super::*;

impl Trends {
    /// The pens of the shown group, at most eight; behind the plant's groups comes the tag picked from the list.
    pub(super) fn pens(&self, cx: &ViewContext) -> Vec<Pen> {
        let picked = || self.picked.map(|tag| Pen { tag, scale: None }).into_iter().collect();
        cx.def().trends.get(self.group).map_or_else(picked, |group| group.pens.iter().take(8).copied().collect())
    }

    /// The pens that are switched on, with their place in the group.
    pub(super) fn drawn(&self, cx: &ViewContext) -> Vec<(usize, Pen)> {
        self.pens(cx).into_iter().enumerate().filter(|(_, pen)| !self.off.contains(&pen.tag)).collect()
    }

    pub(super) fn toggle(&mut self, cx: &ViewContext) {
        let Some(pen) = self.pens(cx).get(self.selected).copied() else { return };
        match self.off.iter().position(|off| *off == pen.tag) {
            Some(place) => drop(self.off.remove(place)),
            None => self.off.push(pen.tag),
        }
        self.curves.want();
    }

    pub(super) fn next_group(&mut self, cx: &ViewContext) {
        let count = cx.def().trends.len() + usize::from(self.picked.is_some());
        self.show_group(cx, (self.group + 1) % count.max(1), 0);
    }

    pub(super) fn show_group(&mut self, cx: &ViewContext, group: usize, selected: usize) {
        (self.group, self.selected, self.since) = (group, selected, None);
        let tags: Vec<TagId> = self.pens(cx).iter().map(|pen| pen.tag).collect();
        self.traces.retain(|tag, _| tags.contains(tag));
        self.moved();
        self.hours.query.want();
        self.push_live(cx);
    }

    /// Shows the curve of a tag: in the group of the plant that has it, or alone.
    pub fn open_tag(&mut self, cx: &ViewContext, tag: TagId) {
        let groups = &cx.def().trends;
        let place = |group: &TrendGroup| group.pens.iter().take(8).position(|pen| pen.tag == tag);
        let found = groups.iter().enumerate().find_map(|(n, group)| Some((n, place(group)?)));
        if found.is_none() {
            self.picked = Some(tag);
        }
        self.values = None;
        self.off.retain(|off| *off != tag);
        let (group, selected) = found.unwrap_or((groups.len(), 0));
        self.show_group(cx, group, selected);
    }
}
