//! The mimic tab: the process at a glance, and the few commands that it is driven by.

mod actions;
mod attention;
mod cards;
mod command;
mod companions;
mod forecast;
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

pub use actions::{Action, KEYS};
pub use command::command_of;
use companions::{Companions, Parts, parts};
use neighbour::neighbour;
use overview::Overview;
use point::{placed, scale};
pub use preview::preview;
use shift::Shift;

use crate::ui::tabs::prelude::*;
use crate::{
    access::right,
    history::Series,
    plant::def::{MimicItem, Picture},
    ui::{
        layout::Size,
        rights,
        tabs::line_switch,
        widgets::mimic::{CanvasScale, bar, list, panel, pipe, tags, title, trend, unit, vessel},
    },
};

/// The small trends are asked again after so many seconds (real time).
const EVERY_S: f64 = 10.0;
const TIMEOUT_S: f64 = 30.0;

/// State of this tab.
#[derive(Debug, Default)]
pub struct Mimic {
    /// The page that is shown.
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
    /// Queries asked so far.
    asked: u32,
}

impl TabView for Mimic {
    fn new(_snapshot: &Snapshot) -> Mimic {
        Mimic::default()
    }

    fn hints(&self, cx: &ViewContext) -> Vec<Hint> {
        let commands = cx.def().mimic.commands.iter();
        let commands = commands.map(|command| {
            Hint::new(command.key, &command.label, t!("{label} (asks first)", label = command.label)).needs(
                match command.value {
                    Some(value) => {
                        right::needs(cx.def(), &CommandKind::Write { tag: command.tag, value: value.into() })
                    }
                    None => rights::to_write(cx, [command.tag]),
                },
            )
        });
        let mut table = KEYS.to_vec();
        let pages = cx.def().mimic.pages.len();
        keys::hide(
            &mut table,
            &[(Action::Page(1), pages < 2), (Action::Overview, pages == 0 || cx.size < Size::Normal)],
        );
        commands.chain([Hint::new("←↑↓→", t!("select"), t!("select an item"))]).chain(keys::hints(&table)).collect()
    }

    fn copied(&self, cx: &ViewContext) -> Vec<String> {
        let item = self.selected.and_then(|n| self.shown(cx, cx.area).0.items.get(n));
        let tags = match self.is_overview(cx) {
            true => self.overview.card(cx).map_or(Vec::new(), |card| card.tags),
            false => item.map_or(Vec::new(), |item| tags(cx, item)),
        };
        tags.into_iter().map(|tag| value::line(cx, tag)).collect()
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
            let shift = self.shift.ask(cx, Overview::columns(cx), &mut self.asked);
            return self.overview.ask(cx, &self.shift, &mut self.asked).into_iter().chain(shift).collect();
        }
        let (picture, parts) = self.shown(cx, cx.area);
        self.follow(picture);
        let shift = parts.shift.map_or(Vec::new(), |area| self.shift.ask(cx, area.width, &mut self.asked));
        let beside = self.companions.ask(cx, &parts, &mut self.asked);
        let asks = self.trends.iter_mut().filter_map(|(item, trend)| {
            let MimicItem::Trend { tag, window, place } = picture.items.get(*item)? else { return None };
            let from = cx.now.checked_sub(*window).ok()?;
            let buckets = usize::from(scale(picture, parts.picture).place(*place).width.max(1)) * 2;
            let query = Query::Series { tags: vec![*tag], from, to: cx.now, buckets };
            trend.ask(cx, (Tab::Mimic, &mut self.asked), real(cx, EVERY_S), real(cx, TIMEOUT_S), query)
        });
        asks.chain(beside).chain(shift).collect()
    }

    fn awaits(&self, number: u32) -> bool {
        let pages = self.overview.awaits(number) || self.shift.awaits(number) || self.companions.awaits(number);
        pages || self.trends.iter().any(|(_, trend)| trend.query.awaits(number))
    }

    fn on_answer(&mut self, cx: &ViewContext, number: u32, answer: Result<Answer, HistoryError>) -> Vec<UiAction> {
        self.companions.on_answer(cx, number, &answer);
        self.overview.on_answer(cx, number, &answer);
        self.shift.on_answer(cx, number, &answer);
        self.trends.iter_mut().for_each(|(_, trend)| trend.on_answer(cx, number, &answer));
        Vec::new()
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

    fn on_key(&mut self, cx: &ViewContext, event: KeyEvent) -> Vec<UiAction> {
        match keys::find(KEYS, event) {
            Some(action) => self.act(cx, action),
            None => open(command_of(cx, event)),
        }
    }

    #[cfg(test)]
    fn chords() -> keys::PageChords {
        vec![("mimic", keys::chords_of(KEYS))]
    }
}

impl Mimic {
    /// The overview takes the place of a mimic that there is not; small screens have the list of values.
    fn is_overview(&self, cx: &ViewContext) -> bool {
        cx.def().mimic.pages.is_empty() || self.at_a_glance && Size::Normal <= cx.size
    }

    /// Shows the overview.
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

    fn act(&mut self, cx: &ViewContext, action: Action) -> Vec<UiAction> {
        if self.is_overview(cx) {
            return self.act_on_overview(cx, action);
        }
        let (picture, parts) = self.shown(cx, cx.area);
        let items = &picture.items;
        let listed = list::is_shown(cx, picture, parts.picture);
        match action {
            Action::Move(dx, dy) if listed => self.selected = list::neighbour(cx, items, self.selected, (dx, dy)),
            Action::Move(dx, dy) => self.selected = neighbour(items, self.selected, (dx, dy)),
            Action::Motion => self.still = !self.still,
            Action::Overview if cx.size < Size::Normal => {}
            Action::Overview => {
                self.at_a_glance = true;
                return self.on_snapshot(cx);
            }
            Action::Page(by) => {
                let pages = cx.def().mimic.pages.len();
                return if pages > 1 { self.show_page(cx, around(self.page, by, pages)) } else { Vec::new() };
            }
            Action::Actuators => return command::actuators(cx),
            Action::Line => {
                return line_switch::open(cx, self.selected.and_then(|n| items.get(n)).map(|item| tags(cx, item)));
            }
            Action::Why => {
                self.selected = self.selected.or_else(|| neighbour(items, None, (1, 0)));
                let item = self.selected.and_then(|n| items.get(n));
                return Why::open(item.and_then(|item| Why::of_all(cx, tags(cx, item))));
            }
            Action::Open => match self.selected.and_then(|n| items.get(n)) {
                Some(MimicItem::Link { page, .. }) => return self.show_page(cx, *page),
                item => {
                    let faceplate = item.and_then(|item| Faceplate::new(title(cx, item), tags(cx, item)));
                    return open(faceplate.map(Modal::Faceplate));
                }
            },
        }
        Vec::new()
    }

    fn act_on_overview(&mut self, cx: &ViewContext, action: Action) -> Vec<UiAction> {
        match action {
            Action::Move(dx, dy) => self.overview.on_move(cx, &self.shift, (dx, dy)),
            Action::Motion | Action::Page(_) => {}
            Action::Actuators => return command::actuators(cx),
            Action::Line => return line_switch::open(cx, self.overview.card(cx).map(|card| card.tags)),
            Action::Overview => {
                self.at_a_glance = false;
                return self.on_snapshot(cx);
            }
            Action::Why => return Why::open(self.overview.card(cx).and_then(|card| Why::of_all(cx, card.tags))),
            Action::Open => {
                return self.overview.card(cx).map(|card| UiAction::ShowDevice(card.device)).into_iter().collect();
            }
        }
        Vec::new()
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
                vessel::view(cx, canvas, scale.place(*place), label, *level, selected);
            }
            MimicItem::Valve { place, label, tag, vertical } => {
                unit::valve(cx, canvas, scale.spot(*place, *vertical), label, *tag, *vertical, selected)
            }
            MimicItem::Pump { place, label, tag } => unit::pump(cx, canvas, scale.place(*place), label, *tag, selected),
            MimicItem::Agitator { place, tag } => {
                vessel::agitator(cx, canvas, scale.place(*place), *tag, selected, motion)
            }
            MimicItem::Heater { place, tag } => vessel::heater(cx, canvas, scale.place(*place), *tag, selected),
            MimicItem::Pipe { points, flow, directed } => {
                pipe::view(cx, canvas, points, flow, scale, (*directed, motion), joints)
            }
            MimicItem::Joint { at, branches } => pipe::joint(cx, canvas, *at, *branches, scale),
            MimicItem::Value { place, label, tag } => {
                unit::labelled(cx, canvas, scale.place(*place), label, *tag, selected)
            }
            MimicItem::Bar { place, tag } => bar::view(cx, canvas, scale.place(*place), *tag, selected),
            MimicItem::Link { place, .. } => unit::link(cx, canvas, scale.place(*place), &title(cx, item), selected),
            MimicItem::Controller { place, device } => {
                panel::controller(cx, canvas, scale.place(*place), cx.def().device(*device), selected)
            }
            MimicItem::Sequence { place, label, step, remaining, states } => {
                let sequence = panel::Sequence { label, step: *step, remaining: *remaining, states };
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
                canvas.text(at.x, at.y + at.height / 2, &fit(text, at.width.max(1)), cx.theme.dim());
            }
        }
    }
}
