//! Which pens are drawn, and on which scales: those of a group of the plant, or tags picked from the list of values.

use super::*;

/// Pens drawn at a time at most.
pub(super) const PENS_MAX: usize = 8;

/// The scale of a pen, where one was typed.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct PenScale {
    /// An axis of its own, not that of its unit.
    pub own: bool,
    /// Exactly this range; `None` fits the data.
    pub range: Option<(f64, f64)>,
}

impl PenScale {
    /// `auto`, `own`, `0 100`, `own 0 100`; `None` for `plant`, the scale of the plant file.
    fn parse(text: &str) -> Result<Option<PenScale>, String> {
        let text = text.trim().to_lowercase();
        let (own, range) = text.strip_prefix("own").map_or((false, text.as_str()), |rest| (true, rest.trim()));
        let numbers: Result<Vec<f64>, _> = range.replace("..", " ").split_whitespace().map(str::parse).collect();
        match (range, numbers.as_deref()) {
            ("plant", _) => Ok(None),
            ("auto" | "", _) => Ok(Some(PenScale { own, range: None })),
            (_, Ok([low, high])) if low < high && (high - low).is_finite() => {
                Ok(Some(PenScale { own, range: Some((*low, *high)) }))
            }
            _ => Err(t!("type two numbers, the lower first, or auto, own or plant").to_owned()),
        }
    }
}

impl std::fmt::Display for PenScale {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        match (self.own, self.range) {
            (false, None) => write!(f, "auto"),
            (true, None) => write!(f, "own"),
            (own, Some((low, high))) => write!(f, "{}{low} {high}", if own { "own " } else { "" }),
        }
    }
}

impl Trends {
    /// The pens of the shown group, at most eight; behind the plant's groups come the tags picked from the list.
    pub(super) fn pens(&self, cx: &ViewContext) -> Vec<Pen> {
        let picked = || self.behind().iter().map(|tag| Pen { tag: *tag, scale: None }).collect();
        let group = cx.def().trends.get(self.group);
        group.map_or_else(picked, |group| group.pens.iter().take(PENS_MAX).copied().collect())
    }

    /// The tags of the group behind those of the plant: the one that was opened alone, or those that are marked.
    pub(super) fn behind(&self) -> &[TagId] {
        if self.opened.is_empty() { &self.values.of.picked } else { &self.opened }
    }

    pub(super) fn groups(&self, cx: &ViewContext) -> usize {
        cx.def().trends.len() + usize::from(!self.behind().is_empty())
    }

    pub(super) fn name(&self, cx: &ViewContext) -> String {
        match (cx.def().trends.get(self.group), self.behind()) {
            (Some(group), _) => of_plant(&group.name).to_owned(),
            (None, [tag]) => cx.def().tag(*tag).name.clone(),
            (None, _) => t!("marked").to_owned(),
        }
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
        let next = (self.group + 1) % self.groups(cx).max(1);
        if !self.values.of.picked.is_empty() {
            self.opened.clear();
        }
        self.show_group(cx, next, 0);
    }

    pub(super) fn show_group(&mut self, cx: &ViewContext, group: usize, selected: usize) {
        (self.group, self.selected, self.since, self.overlay) = (group, selected, None, None);
        let tags: Vec<TagId> = self.pens(cx).iter().map(|pen| pen.tag).collect();
        self.traces.retain(|tag, _| tags.contains(tag));
        self.moved();
        self.values.answered.query.want();
        self.push_live(cx);
    }

    /// Shows the curve of a tag: in the group of the plant that has it, or alone.
    pub fn open_tag(&mut self, cx: &ViewContext, tag: TagId) {
        let groups = &cx.def().trends;
        let place = |group: &TrendGroup| group.pens.iter().take(PENS_MAX).position(|pen| pen.tag == tag);
        let found = groups.iter().enumerate().find_map(|(n, group)| Some((n, place(group)?)));
        if found.is_none() {
            self.opened = vec![tag];
        }
        self.listed = false;
        self.off.retain(|off| *off != tag);
        let (group, selected) = found.unwrap_or((groups.len(), 0));
        self.show_group(cx, group, selected);
    }

    /// Shows a value of the list: with the others that are marked, or as [`Trends::open_tag`] does.
    pub(super) fn open_value(&mut self, cx: &ViewContext, tag: TagId) {
        match self.values.of.picked.iter().position(|picked| *picked == tag) {
            Some(place) => {
                self.listed = false;
                self.opened.clear();
                self.show_group(cx, cx.def().trends.len(), place);
            }
            None => self.open_tag(cx, tag),
        }
    }

    /// Marks the selected value of the list as a pen, or no longer.
    pub(super) fn pick(&mut self, cx: &ViewContext) {
        let Some(tag) = self.listed_value(cx) else { return };
        match self.values.of.picked.iter().position(|picked| *picked == tag) {
            Some(place) => drop(self.values.of.picked.remove(place)),
            None if self.values.of.picked.len() < PENS_MAX => self.values.of.picked.push(tag),
            None => {}
        }
        self.opened.clear();
        self.group = self.group.min(self.groups(cx).saturating_sub(1));
        self.moved();
    }

    /// The next look of the selected pen.
    pub(super) fn next_stroke(&mut self, cx: &ViewContext) {
        if let Some(pen) = self.pens(cx).get(self.selected) {
            let stroke = self.strokes.entry(pen.tag).or_default();
            *stroke = stroke.next();
        }
    }

    pub(super) fn ask_scale(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        let Some(pen) = self.pens(cx).get(self.selected).copied() else { return Vec::new() };
        self.asking = Asking::Scale(pen.tag);
        let title = t!("Scale of {name}", name = cx.def().tag(pen.tag).name);
        let text = self.scales.get(&pen.tag).map_or("plant".to_owned(), PenScale::to_string);
        let forms = t!("0 100   auto   own   own 0 100   plant: as the plant file has it");
        open(Modal::Prompt(Prompt::new(title, forms, &text)))
    }

    pub(super) fn set_scale(&mut self, tag: TagId, text: &str) -> Result<(), String> {
        match PenScale::parse(text)? {
            Some(scale) => drop(self.scales.insert(tag, scale)),
            None => drop(self.scales.remove(&tag)),
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scale_is_typed_as_it_is_shown() {
        for text in ["auto", "own", "0 100", "-5.5 20", "own 0 50"] {
            assert_eq!(
                PenScale::parse(text).map(|scale| scale.map(|scale| scale.to_string())),
                Ok(Some(text.to_owned()))
            );
        }
        assert_eq!(PenScale::parse(" Plant "), Ok(None));
        assert_eq!(PenScale::parse("0..25"), PenScale::parse("0 25"));
        for text in ["5", "10 0", "a b", "0 inf", "NaN 1"] {
            assert!(PenScale::parse(text).is_err(), "{text}");
        }
    }
}
