//! The keys of every tab: rows as those of a tab, but they act on the whole terminal, as those of a replay do.

use crossterm::event::{KeyCode, KeyEvent};

use super::{
    Effect, Model, UiAction,
    keys::{Chord, Hint, char, code, ctrl},
    last_frame,
    modal::{Help, Modal, Palette, TerminalSettings, instant},
    model_context::{with_replay, with_tabs},
    replay::{self, Replay},
    rights, screen_dump,
    tabs::{Tab, alarms::actions, draw::around},
};
use crate::{
    access::SessionRequest,
    plant::{alarm::AlarmCommand, command::CommandKind},
    t,
};

#[derive(Debug, Clone, Copy)]
pub struct GlobalKey {
    chord: Chord,
    label: &'static str,
    help: &'static str,
    reach: Reach,
    rule: Rule,
    does: Does,
}

#[derive(Debug, Clone, Copy)]
enum Does {
    Show(Tab),
    Run(fn(&mut Model) -> Vec<UiAction>),
}

/// Where a key of the terminal is heard; each of these includes the one before.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Reach {
    Tabs,
    /// In windows that only show something.
    Looking,
    /// On a screen that is too small.
    Small,
    /// Where a form of the login page takes every letter.
    Typed,
    Windows,
}

/// What a key of the terminal must not be pressed in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Rule {
    Always,
    /// Not while a past is shown.
    OfPresent,
    /// Not while nothing but the login page is.
    Unlocked,
}

impl GlobalKey {
    pub const fn new(
        chord: Chord,
        label: &'static str,
        help: &'static str,
        run: fn(&mut Model) -> Vec<UiAction>,
    ) -> GlobalKey {
        GlobalKey { chord, label, help, reach: Reach::Tabs, rule: Rule::Always, does: Does::Run(run) }
    }
    /// The same with another reach.
    pub const fn reach(self, reach: Reach) -> GlobalKey {
        GlobalKey { reach, ..self }
    }
    const fn of_present(self) -> GlobalKey {
        GlobalKey { rule: Rule::OfPresent, ..self }
    }
    const fn unlocked(self) -> GlobalKey {
        GlobalKey { rule: Rule::Unlocked, ..self }
    }

    #[cfg(test)]
    pub fn chord(self) -> Chord {
        self.chord
    }
    /// The tab that it shows, if it is a number key.
    pub fn tab(self) -> Option<Tab> {
        if let Does::Show(tab) = self.does { Some(tab) } else { None }
    }
    /// Is it heard there?
    pub fn reaches(self, reach: Reach) -> bool {
        reach <= self.reach
    }
    /// Is a window that only shows saved by it?
    pub fn is_for_looking(self) -> bool {
        self.reach == Reach::Looking
    }
    /// Its row of footer and help.
    pub fn hint(self) -> Hint {
        Hint::of(self.chord, self.label, self.help)
    }

    pub fn press(self, model: &mut Model) -> Vec<UiAction> {
        match (self.rule, self.does) {
            (Rule::OfPresent, _) if model.replay.shown().is_some() => {
                model.note = Some(replay::refused().into());
                Vec::new()
            }
            (Rule::Unlocked, _) if rights::is_closed(&model.session) => Vec::new(),
            (_, Does::Show(tab)) => show(model, tab),
            (_, Does::Run(run)) => run(model),
        }
    }
}

/// The row of a table that fits what was pressed.
pub fn find(table: &[GlobalKey], event: KeyEvent) -> Option<GlobalKey> {
    table.iter().find(|key| key.chord.is(event)).copied()
}

/// Keys of every tab: first the number keys, which show one.
pub fn keys() -> Vec<GlobalKey> {
    let number =
        |tab: &Tab| GlobalKey { does: Does::Show(*tab), ..GlobalKey::new(tab.key(), "", tab.help(), |_| vec![]) };
    let mut shown: Vec<_> = Tab::ALL.iter().map(number).collect();
    shown.rotate_left(1);
    shown.into_iter().chain(KEYS.iter().copied()).collect()
}

/// The key that leads to everything by its name.
pub const PALETTE: Chord = char(':');
/// The same while something is typed.
pub const PALETTE_TOO: Chord = ctrl('p');

const KEYS: &[GlobalKey] = &[
    GlobalKey::new(code(KeyCode::Tab), "", "next tab", |model| step(model, 1)),
    GlobalKey::new(code(KeyCode::BackTab), "", "previous tab", |model| step(model, -1)),
    GlobalKey::new(char('a'), "", "acknowledge the selected or most urgent alarm", last_frame::acknowledge)
        .reach(Reach::Small)
        .of_present(),
    GlobalKey::new(char('A'), "", "acknowledge all alarms (asks first)", acknowledge_all).of_present(),
    GlobalKey::new(code(KeyCode::Esc), "", "close a window; dismiss a message; previous page", dismiss),
    GlobalKey::new(PALETTE, "go to", "go to any tab, device, tag, alarm, key or past time by its name", open_palette)
        .unlocked(),
    GlobalKey::new(PALETTE_TOO, "", "go to anything by its name", open_palette).unlocked(),
    GlobalKey::new(char('['), "", "back to the tab before", |model| revisit(model, false)),
    GlobalKey::new(char(']'), "", "forward again", |model| revisit(model, true)),
    GlobalKey::new(char('@'), "", "replay: the plant as it was at a past time", show_past).unlocked(),
    GlobalKey::new(char('!'), "", "event page: mimic, curves, journal, frames, users at one past time", |model| {
        on_past(model, true)
    })
    .unlocked(),
    GlobalKey::new(char('\''), "", "bookmarks: past times that were kept under a name", list_bookmarks).unlocked(),
    GlobalKey::new(ctrl('k'), "", "lock this terminal; works in every window", lock).reach(Reach::Windows),
    GlobalKey::new(char('L'), "", "change the language of the screens", next_language).reach(Reach::Small),
    GlobalKey::new(ctrl('t'), "", "change the language, in every window too", next_language).reach(Reach::Windows),
    GlobalKey::new(ctrl('s'), "", "silence the alarm sound (does not acknowledge)", silence).of_present(),
    GlobalKey::new(
        char('P'),
        "",
        "save this screen as text, SVG and PNG in the folder of the reports",
        screen_dump::begin,
    )
    .reach(Reach::Looking)
    .unlocked(),
    GlobalKey::new(
        code(KeyCode::F(2)),
        "",
        "settings: theme, characters, pictures, motion, bell, mouse, language",
        |model| vec![UiAction::Open(Modal::TerminalSettings(TerminalSettings::new(model)))],
    ),
    GlobalKey::new(char('y'), "", "copy what is selected, with its unit, quality and time", copy),
    GlobalKey::new(ctrl('l'), "", "redraw the screen", |_| vec![UiAction::Do(Effect::Redraw)]).reach(Reach::Typed),
    GlobalKey::new(ctrl('c'), "", "quit (asks first)", |_| vec![UiAction::Leave]).reach(Reach::Typed),
    GlobalKey::new(char('q'), "quit", "quit (asks first, and lists what stops)", |_| vec![UiAction::Leave])
        .reach(Reach::Small),
    GlobalKey::new(char('?'), "help", "all keys", |_| vec![UiAction::Open(Modal::Help(Help::default()))]),
];

fn show(model: &mut Model, tab: Tab) -> Vec<UiAction> {
    if Tab::offered(&model.cx()).contains(&tab) {
        if tab == Tab::Alarms && model.tabs.shown != tab {
            model.tabs.alarms.front();
        }
        return vec![UiAction::Show(tab)];
    }
    if model.replay.shown().is_some() {
        model.note = Some(t!("This tab shows the present only: Esc returns to it").into());
    }
    Vec::new()
}

/// Shows the tab this many places further on.
fn step(model: &mut Model, by: isize) -> Vec<UiAction> {
    let offered = Tab::offered(&model.cx());
    let place = offered.iter().position(|tab| *tab == model.tabs.shown).unwrap_or(0);
    vec![UiAction::Show(offered[around(place, by, offered.len())])]
}

/// Shows the tab before, or after it again.
fn revisit(model: &mut Model, forward: bool) -> Vec<UiAction> {
    let (offered, shown) = (Tab::offered(&model.cx()), model.tabs.shown);
    model.visited.step(shown, &offered, forward).map(UiAction::Show).into_iter().collect()
}

fn acknowledge_all(model: &mut Model) -> Vec<UiAction> {
    let cx = model.cx();
    match (model.tabs.shown == Tab::Alarms).then(|| model.tabs.alarms.listed(&cx)).flatten() {
        Some(listed) => actions::acknowledge_all(&cx, listed.into_iter(), false),
        None => actions::acknowledge_all(&cx, cx.snapshot.alarms.iter(), false),
    }
}

/// Where nothing sounds there is nothing to silence.
fn silence(model: &mut Model) -> Vec<UiAction> {
    let sounds = model.snapshot.sound;
    sounds.then_some(UiAction::Command(CommandKind::Alarm(AlarmCommand::Silence))).into_iter().collect()
}

/// A failure that is being read is dismissed first; everything else does not hold up the way back.
fn dismiss(model: &mut Model) -> Vec<UiAction> {
    model.replay.cancel();
    let failed = model.last_command.take().is_some_and(|pending| pending.is_trouble());
    if !failed && !step_back(model) && model.snapshot.def.is_bench() {
        // The map of a unit stands on another tab than the registers that asked for it.
        return revisit(model, false);
    }
    Vec::new()
}

/// Closes what lies on top of the first page of the tab; `false` if nothing does.
pub(super) fn step_back(model: &mut Model) -> bool {
    with_tabs(model, |tabs, cx| tabs.shown_mut().back(cx))
}

fn open_palette(model: &mut Model) -> Vec<UiAction> {
    let (cx, here) = (model.cx(), [PALETTE, PALETTE_TOO]);
    let global = KEYS.iter().filter(|key| !here.contains(&key.chord)).map(|key| key.hint());
    let keys = model.tabs.shown().hints(&cx).into_iter().chain(global).collect();
    let palette = Palette::new(&cx, keys, model.bookmarks(), &model.recent);
    vec![UiAction::Open(Modal::Palette(Box::new(palette)))]
}

fn list_bookmarks(model: &mut Model) -> Vec<UiAction> {
    if model.bookmarks().is_empty() {
        model.note = Some(t!("No bookmarks. In a replay # keeps its time under a name").into());
        return Vec::new();
    }
    let palette = Palette::of_bookmarks(&model.cx(), model.bookmarks());
    vec![UiAction::Open(Modal::Palette(Box::new(palette)))]
}

fn next_language(model: &mut Model) -> Vec<UiAction> {
    vec![UiAction::SetLocale(model.locale().language.next().locale())]
}

/// Locks at once if a user is logged in.
fn lock(model: &mut Model) -> Vec<UiAction> {
    let may = model.session.who.is_some() && !model.session.locked;
    if may { vec![UiAction::SessionRequest(Tab::Login, SessionRequest::Lock)] } else { Vec::new() }
}

/// Asks for a past instant, to show it on the tab.
pub(super) fn show_past(model: &mut Model) -> Vec<UiAction> {
    on_past(model, false)
}

/// A past instant is wanted, on the event page or on the tab: that of what is selected, or one that is typed.
fn on_past(model: &mut Model, page: bool) -> Vec<UiAction> {
    // A bench has no history.
    if model.snapshot.def.is_bench() {
        return Vec::new();
    }
    if page && model.replay.shown().is_some() {
        return with_replay(model, Replay::toggle_page);
    }
    let (cx, tab) = (model.cx(), model.tabs.shown());
    match tab.moment(&cx).filter(|_| page) {
        Some(at) => vec![UiAction::EventPage(at)],
        None => {
            let of_alarms = model.tabs.shown == Tab::Alarms;
            let place = if page {
                instant::Place::Page
            } else if of_alarms {
                instant::Place::TabOrPage
            } else {
                instant::Place::Tab
            };
            vec![UiAction::Open(instant::ask_instant(&cx, tab.moment(&cx), place))]
        }
    }
}

/// Copies what is selected, and says so.
fn copy(model: &mut Model) -> Vec<UiAction> {
    let lines = match model.replay.page() {
        Some(page) => page.copied(&model.cx()),
        None => model.tabs.shown().copied(&model.cx()),
    };
    let Some(first) = lines.first() else {
        model.note = Some(t!("Nothing is selected that can be copied").into());
        return Vec::new();
    };
    let what = first.replace('\t', "  ");
    model.note = Some(match lines.len() - 1 {
        0 => t!("Copied: {what}", what).into(),
        more => t!("Copied with {more} more: {what}", more, what).into(),
    });
    vec![UiAction::Do(Effect::Copy(lines.join("\n")))]
}
