//! The palette: go to any tab, device, tag, alarm, key or past time by typing a part of its name.

use crate::text::of_plant;
use std::cmp::Reverse;

use crossterm::event::{KeyCode, KeyEvent};
use jiff::{SignedDuration, Timestamp};
use nucleo_matcher::{
    Config, Matcher, Utf32Str,
    pattern::{CaseMatching, Normalization, Pattern},
};
use ratatui::{Frame, layout::Rect};

use super::{Faceplate, Guidance, Modal, Next, instant, line::Line, window};
use crate::{
    plant::{
        def::{AlarmId, DeviceId, ProcedureId, TagId},
        number::to_u16,
    },
    t,
    text::{searchable, translate},
    ui::{
        UiAction, ViewContext,
        keys::{self, Chord, Hint},
        layout::Size,
        modal::reason::subject,
        preferences::Bookmark,
        tab::Tab,
        widgets::{
            list::{Motion, first, on_screen},
            text::{fit, pad, width},
            value,
        },
    },
};

/// Rows that are listed at most: the best ones.
const FOUND_MAX: usize = 100;
/// What a name that is exactly what was typed counts more.
const EXACT: u32 = 1_000;
/// Columns of the window, where there are as many.
const WIDTH: u16 = 76;

#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Target {
    Tab(Tab),
    Overview,
    /// A device, on the controllers tab.
    Device(DeviceId),
    /// A procedure, on the controllers tab.
    Procedure(ProcedureId),
    /// The faceplate of a tag.
    Tag(TagId),
    Trend(TagId),
    /// What to do about an alarm.
    Alarm(AlarmId),
    /// What a key of the shown tab does.
    Key(Chord),
    Instant(Timestamp),
    /// One that was kept under a name.
    Bookmark(Timestamp),
}

impl Target {
    fn rank(self) -> u8 {
        match self {
            Target::Instant(_) | Target::Tab(_) | Target::Overview => 0,
            Target::Device(_) | Target::Procedure(_) => 1,
            Target::Tag(_) => 2,
            Target::Trend(_) => 3,
            Target::Alarm(_) => 4,
            Target::Key(_) => 5,
            Target::Bookmark(_) => 3,
        }
    }
}

#[derive(Debug, Clone, PartialEq)]
struct Found {
    target: Target,
    kind: &'static str,
    name: String,
    text: String,
    /// Name, text and kind, to be searched.
    words: String,
    /// Bytes of the words that are the name, and the place of those that are the text.
    parts: (usize, std::ops::Range<usize>),
}

impl Found {
    fn new(target: Target, kind: &'static str, name: &str, text: &str) -> Found {
        let mut words = searchable(name);
        let end = words.len();
        words.push(' ');
        words.push_str(&searchable(text));
        let parts = (end, end + 1..words.len());
        words.push(' ');
        words.push_str(&searchable(kind));
        Found { target, kind, name: name.to_owned(), text: text.to_owned(), words, parts }
    }

    fn name_words(&self) -> &str {
        self.words.get(..self.parts.0).unwrap_or_default()
    }

    fn text_words(&self) -> &str {
        self.words.get(self.parts.1.clone()).unwrap_or_default()
    }
}

/// What is typed, and what fits it.
#[derive(Debug, Clone, PartialEq)]
pub struct Palette {
    line: Line,
    rows: Vec<Found>,
    /// Places of the rows that fit, the best first.
    found: Vec<usize>,
    /// The instant that was typed, before all of them.
    instant: Option<Found>,
    selected: usize,
}

impl Palette {
    /// Everything that there is, with the keys of the moment; what was chosen before at first.
    pub fn new(cx: &ViewContext, keys: Vec<Hint>, bookmarks: &[Bookmark], recent: &[Target]) -> Palette {
        let mut rows = rows(cx, keys);
        rows.extend(bookmark_rows(cx, bookmarks));
        let place = |row: &Found| recent.iter().position(|target| *target == row.target).unwrap_or(recent.len());
        rows.sort_by_key(place);
        let mut palette = Palette { line: Line::default(), rows, found: Vec::new(), instant: None, selected: 0 };
        palette.find(cx);
        palette
    }

    /// The bookmarks alone, the latest first.
    pub fn of_bookmarks(cx: &ViewContext, bookmarks: &[Bookmark]) -> Palette {
        let rows = bookmark_rows(cx, bookmarks).rev().collect();
        let mut palette = Palette { line: Line::default(), rows, found: Vec::new(), instant: None, selected: 0 };
        palette.find(cx);
        palette
    }

    /// Takes the selected bookmark off the list.
    fn remove(mut self, cx: &ViewContext) -> Next {
        let Some(Target::Bookmark(at)) = self.listed().get(self.selected).map(|row| row.target) else {
            return Next::Stay(Modal::Palette(Box::new(self)));
        };
        self.rows.retain(|row| row.target != Target::Bookmark(at));
        let selected = self.selected;
        self.find(cx);
        self.selected = selected.min(self.listed().len().saturating_sub(1));
        Next::Both(Modal::Palette(Box::new(self)), vec![UiAction::Bookmark(at, None)])
    }

    /// Is a bookmark selected, which can be removed?
    pub(super) fn is_on_bookmark(&self) -> bool {
        matches!(self.listed().get(self.selected).map(|row| row.target), Some(Target::Bookmark(_)))
    }

    fn find(&mut self, cx: &ViewContext) {
        let text = searchable(&self.line.text());
        self.selected = 0;
        self.instant = instant(cx, &text);
        if text.is_empty() {
            self.found = (0..self.rows.len().min(FOUND_MAX)).collect();
            return;
        }
        let pattern = Pattern::parse(&text, CaseMatching::Ignore, Normalization::Smart);
        let mut matcher = Matcher::new(Config::DEFAULT);
        let mut buffer = Vec::new();
        let mut fits = |text: &str| pattern.score(Utf32Str::new(text, &mut buffer), &mut matcher);
        let mut score = |row: &Found| {
            let all = fits(&row.words)?;
            // What is called so stands before what only mentions it, above all as a whole word at the end of its name.
            let is_last =
                |name: &str| name.rsplit(['.', '-', ' ']).next().is_some_and(|part| part.eq_ignore_ascii_case(&text));
            let exact = is_last(&row.name) || row.text_words().eq_ignore_ascii_case(&text);
            Some(all + fits(row.name_words()).unwrap_or(0) + if exact { EXACT } else { 0 })
        };
        // Of those that fit alike a tag stands before its curve and its alarms.
        let rows = self.rows.iter().enumerate();
        let mut found: Vec<(Reverse<u32>, u8, usize)> =
            rows.filter_map(|(place, row)| Some((Reverse(score(row)?), row.target.rank(), place))).collect();
        found.sort();
        self.found = found.into_iter().take(FOUND_MAX).map(|(.., place)| place).collect();
    }

    fn listed(&self) -> Vec<&Found> {
        self.instant.iter().chain(self.found.iter().filter_map(|place| self.rows.get(*place))).collect()
    }

    pub(super) fn on_key(mut self, cx: &ViewContext, event: KeyEvent) -> Next {
        let listed = self.listed();
        if keys::code(KeyCode::Enter).is(event) {
            return match listed.get(self.selected) {
                Some(row) => Next::Go(row.target),
                None => Next::Stay(Modal::Palette(Box::new(self))),
            };
        }
        if keys::code(KeyCode::Delete).is(event) {
            return self.remove(cx);
        }
        let motion = Motion::from_key(event).filter(|motion| !matches!(motion, Motion::First | Motion::Last));
        if let Some(motion) = motion {
            self.selected = motion.to(self.selected, listed.len(), room(cx.area));
        } else if self.line.on_key(event) {
            self.find(cx);
        }
        Next::Stay(Modal::Palette(Box::new(self)))
    }

    pub(super) fn paste(&mut self, cx: &ViewContext, text: &str) {
        self.line.paste(text);
        self.find(cx);
    }

    pub(super) fn view(&self, cx: &ViewContext, frame: &mut Frame, body: Rect) {
        let inner = WIDTH.min(body.width.saturating_sub(4));
        let room = room(body);
        let mut canvas = window(cx, frame, body, t!("go to"), (inner, room + 3));
        let x = canvas.text(0, 0, ": ", cx.theme.strong());
        self.line.view(cx.theme, &mut canvas, x, 0);
        let listed = self.listed();
        if listed.is_empty() {
            canvas.text(2, 2, t!("nothing fits"), cx.theme.dim());
        }
        let kinds = listed.iter().map(|row| width(row.kind)).max().unwrap_or(0).min(12);
        let names = listed.iter().map(|row| width(&row.name)).max().unwrap_or(0).min(inner / 3);
        let first = first(self.selected, listed.len(), room);
        for (y, n, row) in on_screen(&listed, first, room) {
            let style = if n == self.selected { cx.theme.focus() } else { cx.theme.normal() };
            canvas.text(0, y + 2, if n == self.selected { cx.theme.pick("▸ ", "> ") } else { "  " }, cx.theme.strong());
            let x = canvas.text(2, y + 2, &pad(&fit(row.kind, kinds), kinds + 2), cx.theme.dim());
            let x = canvas.text(x, y + 2, &pad(&fit(&row.name, names), names), style);
            let now = match row.target {
                Target::Tag(tag) => value::show(cx, tag).with_unit(),
                _ => String::new(),
            };
            let end = canvas.width();
            let left = end.saturating_sub(x + 2 + if now.is_empty() { 0 } else { width(&now) + 2 });
            canvas.text(x + 2, y + 2, &fit(&row.text, left), cx.theme.normal());
            canvas.text_right(end, y + 2, &now, cx.theme.strong());
        }
    }
}

/// Rows of the list that the window has room for.
fn room(body: Rect) -> usize {
    usize::from(body.height.saturating_sub(5)).clamp(1, 16)
}

fn instant(cx: &ViewContext, text: &str) -> Option<Found> {
    // A bench has no history, the smallest screen no row that says that a past is shown.
    let has_past = !cx.def().is_bench() && Size::Compact < cx.size;
    let at = (has_past && text.starts_with(|c: char| c.is_ascii_digit() || c == '-'))
        .then(|| instant::instant(cx, text).ok())??;
    Some(Found::new(Target::Instant(at), t!("time"), &instant::stamp(cx, at), t!("replay")))
}

fn bookmark_rows<'a>(cx: &'a ViewContext, bookmarks: &'a [Bookmark]) -> impl DoubleEndedIterator<Item = Found> + 'a {
    let row = |mark: &Bookmark| {
        Found::new(Target::Bookmark(mark.at), t!("bookmark"), &mark.name, &instant::stamp(cx, mark.at))
    };
    bookmarks.iter().map(row)
}

fn rows(cx: &ViewContext, keys: Vec<Hint>) -> Vec<Found> {
    let def = cx.def();
    let tabs = Tab::offered(cx).into_iter();
    let tabs = tabs.map(|tab| Found::new(Target::Tab(tab), t!("tab"), translate(tab.title()), translate(tab.help())));
    let alarm = |id: AlarmId, state: &str| {
        Found::new(
            Target::Alarm(id),
            t!("alarm"),
            &subject(cx, id),
            &format!("{}  {state}", translate(&def.alarm(id).message)),
        )
    };
    let active = cx.snapshot.alarms.iter().map(|active| alarm(active.id, translate(active.state.word())));
    let is_active = |id: AlarmId| cx.snapshot.alarms.iter().any(|active| active.id == id);
    let others = def.alarms.iter().filter(|def| !is_active(def.id)).map(|def| alarm(def.id, ""));
    let keys = keys.into_iter().filter_map(|hint| {
        let help = if hint.help.is_empty() { &hint.label } else { &hint.help };
        Some(Found::new(Target::Key(hint.chord?), t!("key"), &hint.key, help))
    });
    let devices = def.devices.iter().filter(|_| !def.is_bench());
    let devices = devices
        .map(|device| Found::new(Target::Device(device.id), t!("device"), &device.name, of_plant(&device.title)));
    let tags = def.tags.iter().map(|tag| Found::new(Target::Tag(tag.id), t!("tag"), &tag.name, of_plant(&tag.label)));
    let stored = def.tags.iter().filter(|tag| tag.is_stored());
    let trends = stored.map(|tag| Found::new(Target::Trend(tag.id), t!("trend"), &tag.name, of_plant(&tag.label)));
    let overview = Found::new(Target::Overview, t!("page"), t!("overview"), t!("all devices at a glance"));
    let overview = Some(overview).filter(|_| !def.is_bench());
    let procedures = def.procedures.iter().enumerate().filter(|_| !cx.is_past());
    let procedures = procedures.map(|(place, def)| {
        Found::new(Target::Procedure(ProcedureId(to_u16(place))), t!("procedure"), &def.name, of_plant(&def.about))
    });
    let devices = devices.chain(procedures);
    tabs.chain(overview).chain(active).chain(devices).chain(tags).chain(trends).chain(keys).chain(others).collect()
}

/// What a choice leads to, but for a key, which is pressed.
pub fn actions(cx: &ViewContext, target: Target) -> Vec<UiAction> {
    match target {
        Target::Tab(tab) => vec![UiAction::Show(tab)],
        Target::Overview => vec![UiAction::ShowOverview],
        Target::Device(device) => vec![UiAction::ShowDevice(device)],
        Target::Procedure(id) => vec![UiAction::ShowProcedure(id)],
        Target::Tag(tag) => {
            let faceplate = Faceplate::new(cx.def().tag(tag).label.clone(), vec![tag]);
            faceplate.map(|faceplate| UiAction::Open(Modal::Faceplate(faceplate))).into_iter().collect()
        }
        Target::Trend(tag) => {
            let before = cx.now.checked_sub(SignedDuration::from_mins(10)).unwrap_or(cx.now);
            vec![UiAction::ShowOnTrends(tag, (before, cx.now))]
        }
        Target::Alarm(id) => {
            let faceplate = Faceplate::of(cx, cx.def().alarm(id).subject);
            vec![UiAction::Open(Modal::Guidance(Box::new(Guidance::new(id, faceplate))))]
        }
        Target::Key(_) => Vec::new(),
        Target::Instant(at) => vec![UiAction::Replay(at)],
        Target::Bookmark(at) => vec![UiAction::EventPage(at)],
    }
}
