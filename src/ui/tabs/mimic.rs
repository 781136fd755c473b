//! The mimic tab: the process at a glance, and the few commands that it is driven by.

mod attention;
mod cards;
mod companions;
mod forecast;
mod keys;
mod may_change;
mod neighbour;
mod overview;
mod page;
mod point;
mod preview;
mod shift;
mod steps;
mod totals;
#[cfg(test)]
mod tests;

use companions::{Companions, Parts, parts};
use neighbour::neighbour;
use overview::Overview;
use point::{placed, scale};
pub use preview::preview;
use shift::Shift;

use crate::ui::tabs::prelude::*;
use crate::{
    history::Series,
    plant::def::{MimicItem, Picture},
    ui::{
        layout::Size,
        widgets::mimic::{CanvasScale, bar, list, panel, pipe, tags, title, trend, unit, vessel},
    },
};

/// The small trends are asked again after this many seconds (real time).
const EVERY_S: f64 = 10.0;
const TIMEOUT_S: f64 = 30.0;

#[derive(Debug, Default)]
pub struct Mimic {
    page: usize,
    /// The selected item, by its place in the picture.
    selected: Option<usize>,
    /// Page and size of the picture that the selection and the trends are of.
    picture: (usize, (u16, u16)),
    still: bool,
    /// Curves of the small trends, by the item's place.
    trends: Vec<(usize, Answered<Vec<Series>>)>,
    companions: Companions,
    /// Is the overview shown where there is a mimic too?
    at_a_glance: bool,
    overview: Overview,
    shift: Shift,
}

impl TabView for Mimic {
    fn new(_snapshot: &Snapshot) -> Mimic {
        Mimic::default()
    }

    fn copied(&self, cx: &ViewContext) -> Vec<String> {
        self.selected_tags(cx).into_iter().flatten().map(|tag| value::line(cx, tag)).collect()
    }

    fn on_point(&mut self, cx: &ViewContext, at: Position) -> bool {
        let (picture, parts) = self.shown(cx, cx.area);
        if self.is_overview(cx) || list::is_shown(cx, picture, parts.picture) || !parts.picture.contains(at) {
            return false;
        }
        self.selected = point::item_at(picture, parts.picture, at).or(self.selected);
        true
    }

    fn on_snapshot(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        if self.is_overview(cx) {
            let shift = self.shift.ask(cx, Overview::columns(cx));
            return self.overview.ask(cx, &self.shift).into_iter().chain(shift).collect();
        }
        let (picture, parts) = self.shown(cx, cx.area);
        self.follow(picture);
        let shift = parts.shift.map_or(Vec::new(), |area| self.shift.ask(cx, area.width));
        let beside = self.companions.ask(cx, &parts);
        let asks = self.trends.iter_mut().filter_map(|(item, trend)| {
            let MimicItem::Trend { tag, window, place } = picture.items.get(*item)? else { return None };
            let from = cx.now.checked_sub(*window).ok()?;
            let buckets = usize::from(scale(picture, parts.picture).place(*place).width.max(1)) * 2;
            let query = Query::Series { tags: vec![*tag], from, to: cx.now, buckets };
            trend.ask(cx, Tab::Mimic, real(cx, EVERY_S), real(cx, TIMEOUT_S), query)
        });
        asks.chain(beside).chain(shift).collect()
    }

    fn queries(&mut self) -> Queries<'_> {
        let parts = [self.companions.queries(), self.overview.queries(), self.shift.queries()];
        let trends = self.trends.iter_mut().map(|(_, trend)| trend as &mut dyn Asked);
        parts.into_iter().flatten().chain(trends).collect()
    }

    fn view(&self, cx: &ViewContext, frame: &mut Frame, area: Rect) {
        if self.is_overview(cx) {
            return self.overview.view(cx, frame, area, &self.shift);
        }
        let (picture, parts) = self.shown(cx, area);
        self.companions.view(cx, frame, &parts);
        if let Some(area) = parts.shift {
            let area = Rect { x: area.x + 1, width: area.width.saturating_sub(2), ..area };
            self.shift.view(cx, &mut Canvas::new(frame.buffer_mut(), area));
        }
        self.headings(cx, &mut Canvas::new(frame.buffer_mut(), area));
        let area = parts.picture;
        let items = &picture.items;
        let mut canvas = Canvas::new(frame.buffer_mut(), area);
        if list::is_shown(cx, picture, area) {
            return list::view(cx, &mut canvas, items, self.selected);
        }
        let (scale, left) = placed(picture, area);
        let mut canvas = canvas.part(left, 0, area.width - left, area.height);
        let joints =
            items.iter().filter_map(|item| if let MimicItem::Joint { at, .. } = item { Some(*at) } else { None });
        let joints: Vec<(u16, u16)> = joints.collect();
        for (n, item) in items.iter().enumerate() {
            self.item(cx, &mut canvas, item, n, (scale, &joints));
        }
        // When all is drawn it is known where there is room for a mark.
        for item in items {
            if let MimicItem::Valve { place, tag, vertical, .. } = item {
                let (x, y) = scale.spot(*place, *vertical);
                let above = y.saturating_sub(1);
                let rows = if *vertical { [y, y + 1, above] } else { [above, y + 1, y + 2] };
                unit::mark(cx, &mut canvas, x + 1, &rows, *tag);
            }
            if let MimicItem::Vessel { place, level: Some(level), .. } = item {
                vessel::limit_marks(cx, &mut canvas, scale.place(*place), *level);
            }
            if let MimicItem::Pump { place, tag, .. } = item {
                let at = scale.place(*place);
                let y = at.y + at.height / 2;
                unit::mark(cx, &mut canvas, at.x, &[y + 1, y.saturating_sub(1), y + 2, y], *tag);
            }
        }
    }
}

impl KeyTable for Mimic {
    fn keys(&self, _cx: &ViewContext) -> Keys<Mimic> {
        Keys::below(&keys::PLANT).and(Keys::of(&[keys::KEYS]))
    }

    /// A selection is of the picture that was drawn.
    fn after_key(&mut self, _cx: &ViewContext) -> Vec<UiAction> {
        Vec::new()
    }

    #[cfg(test)]
    fn chords() -> crate::ui::key_table::PageChords {
        vec![("mimic", Keys::of(&[keys::KEYS]).chords())]
    }
}

impl Mimic {
    /// The overview takes the place of a mimic that there is not; small screens have the list of values.
    fn is_overview(&self, cx: &ViewContext) -> bool {
        cx.def().mimic.pages.is_empty() || self.at_a_glance && Size::Normal <= cx.size
    }

    pub fn show_overview(&mut self) {
        self.at_a_glance = true;
    }

    /// The picture for the room there is, and the parts of the tab; a row above is left for the names of several pages.
    fn shown<'a>(&self, cx: &ViewContext<'a>, area: Rect) -> (&'a Picture, Parts) {
        let pages = &cx.snapshot.def.mimic.pages;
        let headings = if pages.len() > 1 { 1.min(area.height) } else { 0 };
        let area = Rect { y: area.y + headings, height: area.height - headings, ..area };
        let picture = pages.get(self.page).map_or(Picture::empty(), |page| page.picture((area.width, area.height)));
        (picture, parts(picture.size, area))
    }

    /// The selection and the trends are those of one picture: another page or another size begins with its own.
    fn follow(&mut self, picture: &Picture) {
        if std::mem::replace(&mut self.picture, (self.page, picture.size)) != (self.page, picture.size) {
            self.selected = None;
            let items = picture.items.iter().enumerate();
            let trends = items.filter(|(_, item)| matches!(item, MimicItem::Trend { .. }));
            self.trends = trends.map(|(n, _)| (n, Answered::default())).collect();
        }
    }

    /// The names of the pages, the shown one marked.
    fn headings(&self, cx: &ViewContext, canvas: &mut Canvas) {
        let pages = &cx.def().mimic.pages;
        if pages.len() > 1 {
            let mut x = 1;
            for (n, page) in pages.iter().enumerate() {
                x = canvas.text(x, 0, &format!(" {} ", page.name), cx.theme.tab(n == self.page)) + 1;
            }
        }
    }

    /// Shows another page of the mimic, from its first item.
    pub fn show_page(&mut self, cx: &ViewContext, page: usize) -> Vec<UiAction> {
        self.page = page;
        self.on_snapshot(cx)
    }

    /// Selects the first item that shows one of these tags, on whatever page; none if the mimic has none of them.
    pub fn select(&mut self, cx: &ViewContext, wanted: &[TagId]) {
        self.at_a_glance = false;
        let shows = |item: &MimicItem| tags(cx, item).iter().any(|tag| wanted.contains(tag));
        let pages = cx.def().mimic.pages.len();
        for page in std::iter::once(self.page).chain(0..pages) {
            let before = std::mem::replace(&mut self.page, page);
            let (picture, _) = self.shown(cx, cx.area);
            if let Some(item) = picture.items.iter().position(shows) {
                self.follow(picture);
                self.selected = Some(item);
                return;
            }
            self.page = before;
        }
        self.selected = None;
    }

    fn item(
        &self,
        cx: &ViewContext,
        canvas: &mut Canvas,
        item: &MimicItem,
        n: usize,
        (scale, joints): (CanvasScale, &[(u16, u16)]),
    ) {
        let selected = self.selected == Some(n);
        let motion = !self.still && cx.theme.motion;
        match item {
            MimicItem::Vessel { place, label, level, .. } => {
                vessel::view(cx, canvas, scale.place(*place), of_plant(label), *level, selected);
            }
            MimicItem::Valve { place, label, tag, vertical } => {
                unit::valve(cx, canvas, scale.spot(*place, *vertical), of_plant(label), *tag, *vertical, selected)
            }
            MimicItem::Pump { place, label, tag } => {
                unit::pump(cx, canvas, scale.place(*place), of_plant(label), *tag, selected)
            }
            MimicItem::Agitator { place, tag } => {
                vessel::agitator(cx, canvas, scale.place(*place), *tag, selected, motion)
            }
            MimicItem::Heater { place, tag } => vessel::heater(cx, canvas, scale.place(*place), *tag, selected),
            MimicItem::Pipe { points, flow, directed } => {
                pipe::view(cx, canvas, points, flow, scale, (*directed, motion), joints)
            }
            MimicItem::Joint { at, branches } => pipe::joint(cx, canvas, *at, *branches, scale),
            MimicItem::Value { place, label, tag } => {
                unit::labelled(cx, canvas, scale.place(*place), of_plant(label), *tag, selected)
            }
            MimicItem::Bar { place, tag } => bar::view(cx, canvas, scale.place(*place), *tag, selected),
            MimicItem::Link { place, .. } => unit::link(cx, canvas, scale.place(*place), &title(cx, item), selected),
            MimicItem::Controller { place, device } => {
                panel::controller(cx, canvas, scale.place(*place), cx.def().device(*device), selected)
            }
            MimicItem::Sequence { place, label, step, remaining, states } => {
                let sequence = panel::Sequence { label: of_plant(label), step: *step, remaining: *remaining, states };
                sequence.view(cx, canvas, scale.place(*place), selected);
            }
            MimicItem::Trend { place, tag, window } => {
                // The event page has curves of its own.
                let Some((_, trend)) = self.trends.iter().find(|(item, _)| *item == n) else { return };
                let series = trend.value.as_ref().and_then(|series| series.first());
                trend::view(cx, canvas, scale.place(*place), *tag, *window, series, selected);
            }
            MimicItem::Text { place, text } => {
                let at = scale.place(*place);
                canvas.text(at.x, at.y + at.height / 2, &fit(of_plant(text), at.width.max(1)), cx.theme.dim());
            }
        }
    }
}
