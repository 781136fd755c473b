//! What a key does: of a window, of the replay, of every tab, or of the shown tab.

use super::*;
use modal::{Next, Notice, TerminalSettings};
use widgets::list::Motion;

/// Choices of the palette that are remembered.
const RECENT_MAX: usize = 8;

pub(super) fn on_key(model: &mut Model, event: KeyEvent) -> Vec<UiAction> {
    model.note = None;
    model.replay.dismiss();
    if close_picture(model) && [keys::code(KeyCode::Esc), keys::char('i')].iter().any(|chord| chord.is(event)) {
        return Vec::new();
    }
    if let Some(actions) = on_key_of_every_window(model, event) {
        return actions;
    }
    if session_lock::ask_before_work(model, event) {
        return Vec::new();
    }
    let past = session_lock::is_past_unlock(model, event);
    if let Some(show @ Global::Show(tab)) = keys::find(&keys::global(), event)
        && model.modal.as_ref().is_some_and(|modal| !modal.takes_text())
        && Tab::offered(&model.cx()).contains(&tab)
    {
        // The number of a tab leads there from every window that has no use for it.
        if let Some(Modal::Confirm(_)) = model.modal.take() {
            model.note = Some(t!("Cancelled: nothing was sent").into());
        }
        return on_global(model, show);
    }
    if let Some(actions) = dump_window(model, event) {
        return actions;
    }
    if let Some(modal) = model.modal.take_if(|_| !past) {
        let Model { snapshot, theme, preferences, clock, extension, session, screen, tabs, replay, .. } = model;
        let present = view_context(snapshot, (theme, preferences), *clock, *screen, extension, session);
        let cx = past_context(present, replay);
        let before = cx.is_past().then(|| modal.clone());
        let (rest, actions) = match modal.on_key(&cx, tabs, event) {
            Next::Stay(modal) => (Some(modal), Vec::new()),
            Next::Close => (None, Vec::new()),
            Next::Do(actions) => (None, actions),
            Next::Both(modal, actions) => (Some(modal), actions),
            Next::Go(target) => return go(model, target),
        };
        model.modal = rest;
        if let (Some(before), Some(rest)) = (before, &model.modal)
            && replay::gives_command(rest)
        {
            // A form for a command is not opened in the past, from a window neither.
            (model.modal, model.note) = (Some(before), Some(replay::refused().into()));
            return Vec::new();
        }
        return actions;
    }
    if model.tabs.shown == Tab::Login && model.tabs.login.is_typing() && !model.small() {
        return session_lock::on_typed(model, event);
    }
    let replayed = keys::find(replay::KEYS, event).filter(|_| model.replay.shown().is_some());
    if let Some(action) = replayed.filter(|action| *action == replay::Action::Leave || !model.small()) {
        return on_replay_key(model, action);
    }
    match keys::find(&keys::global(), event) {
        Some(global @ (Global::Quit | Global::Acknowledge | Global::Redraw | Global::Language)) => {
            on_global(model, global)
        }
        // No command goes to what is not visible.
        Some(_) | None if model.small() => Vec::new(),
        Some(global) => on_global(model, global),
        None if model.replay.page().is_some() => on_page_key(model, event),
        None if !model.may_act(event) => Vec::new(),
        None => on_tab_key(model, event),
    }
}

/// A key of the past that is shown; what lies on top of the tab closes before the past does.
fn on_replay_key(model: &mut Model, action: replay::Action) -> Vec<UiAction> {
    let present = model.present_cx().now;
    let on_tab = model.replay.page().is_none() && !model.small();
    let closed = action == replay::Action::Leave && on_tab && step_back(model);
    let actions = if closed {
        Vec::new()
    } else if action == replay::Action::GoTo {
        on_global(model, Global::Replay)
    } else if action == replay::Action::Bookmark {
        vec![UiAction::Open(replay::ask_name(&model.cx()))]
    } else {
        model.replay.on_key(action, present).into_iter().map(UiAction::Do).collect()
    };
    actions.into_iter().chain(with_tabs(model, |tabs, cx| tabs.shown_mut().on_snapshot(cx))).collect()
}

/// Lists the bookmarks.
fn on_bookmarks(model: &mut Model) -> Vec<UiAction> {
    if session_lock::is_closed(&model.session) {
        return Vec::new();
    }
    if model.bookmarks().is_empty() {
        model.note = Some(t!("No bookmarks. In a replay # keeps its time under a name").into());
        return Vec::new();
    }
    let palette = Palette::of_bookmarks(&model.cx(), model.bookmarks());
    vec![UiAction::Open(Modal::Palette(Box::new(palette)))]
}

/// Keys that mean the same in every window and while something is typed.
fn on_key_of_every_window(model: &mut Model, event: KeyEvent) -> Option<Vec<UiAction>> {
    match keys::find(&keys::global(), event) {
        Some(Global::Lock) => Some(session_lock::lock(model)),
        Some(Global::Language) if keys::ctrl('t').is(event) => Some(on_global(model, Global::Language)),
        Some(_) | None => (model.tour.is_some() && tour::SKIP.is(event)).then(Vec::new),
    }
}

/// A window that only shows is saved with the screen; another one takes the letter itself.
fn dump_window(model: &mut Model, event: KeyEvent) -> Option<Vec<UiAction>> {
    let shows = model.modal.as_ref().is_some_and(|modal| modal.only_looks() && !modal.takes_text());
    (shows && keys::find(&keys::global(), event) == Some(Global::Dump)).then(|| on_global(model, Global::Dump))
}

/// A key of the event page, which has the place of the tab.
fn on_page_key(model: &mut Model, event: KeyEvent) -> Vec<UiAction> {
    match (Motion::from_key(event), model.replay.page_mut()) {
        (Some(motion), Some(page)) => page.scroll(motion),
        (None, _) | (_, None) => {
            model.note = Some(t!("This is the event page: a digit or ! leads to the tabs, Esc to the present").into());
        }
    }
    Vec::new()
}

/// A key of the shown tab; one that is none is answered with where they are listed.
fn on_tab_key(model: &mut Model, event: KeyEvent) -> Vec<UiAction> {
    let hints = model.tabs.shown().hints(&model.cx());
    let is_known = hints.iter().any(|hint| hint.chord.is_some_and(|chord| chord.is(event)));
    let actions = with_tabs(model, |tabs, cx| tabs.shown_mut().on_key(cx, event));
    if actions.is_empty() && !is_known && matches!(event.code, KeyCode::Char(_)) {
        model.note = Some(t!("This key does nothing here. ? lists the keys, : goes to anything by its name").into());
    }
    actions
}

/// What was chosen in the palette or in the help.
fn go(model: &mut Model, target: Target) -> Vec<UiAction> {
    match target {
        Target::Key(chord) => return on_key(model, chord.event()),
        // It is typed again as fast as it is found.
        Target::Instant(_) | Target::Bookmark(_) => {}
        Target::Tab(_)
        | Target::Overview
        | Target::Device(_)
        | Target::Procedure(_)
        | Target::Tag(_)
        | Target::Trend(_)
        | Target::Alarm(_) => {
            model.recent.retain(|earlier| *earlier != target);
            model.recent.insert(0, target);
            model.recent.truncate(RECENT_MAX);
        }
    }
    palette::actions(&model.cx(), target)
}

pub(super) fn on_global(model: &mut Model, global: Global) -> Vec<UiAction> {
    match global {
        Global::Show(tab) if Tab::offered(&model.cx()).contains(&tab) => {
            if tab == Tab::Alarms && model.tabs.shown != tab {
                model.tabs.alarms.front();
            }
            vec![UiAction::Show(tab)]
        }
        Global::Show(_) if model.replay.shown().is_some() => {
            model.note = Some(t!("This tab shows the present only: Esc returns to it").into());
            Vec::new()
        }
        Global::Show(_) => Vec::new(),
        Global::Next => vec![UiAction::Show(model.tabs.shown.step(&Tab::offered(&model.cx()), 1))],
        Global::Previous => vec![UiAction::Show(model.tabs.shown.step(&Tab::offered(&model.cx()), -1))],
        Global::Lock => session_lock::lock(model),
        Global::Acknowledge | Global::AcknowledgeAll | Global::Silence if model.replay.shown().is_some() => {
            model.note = Some(replay::refused().into());
            Vec::new()
        }
        Global::Replay | Global::EventPage => on_past(model, global == Global::EventPage),
        Global::Palette if session_lock::is_closed(&model.session) => Vec::new(),
        Global::Palette => {
            let palette = Palette::new(&model.cx(), model.tabs.shown(), model.bookmarks(), &model.recent);
            vec![UiAction::Open(Modal::Palette(Box::new(palette)))]
        }
        Global::Bookmarks => on_bookmarks(model),
        Global::Back | Global::Forward => {
            let (offered, shown) = (Tab::offered(&model.cx()), model.tabs.shown);
            let tab = model.visited.step(shown, &offered, global == Global::Forward);
            tab.map(UiAction::Show).into_iter().collect()
        }
        Global::Language => vec![UiAction::SetLocale(model.locale().language.next().locale())],
        Global::Help => vec![UiAction::Open(Modal::Help(0))],
        Global::Quit => vec![UiAction::Leave],
        Global::Acknowledge => last_frame::acknowledge(model),
        Global::AcknowledgeAll => {
            let cx = model.cx();
            let listed = (model.tabs.shown == Tab::Alarms).then(|| model.tabs.alarms.listed(&cx)).flatten();
            match listed {
                Some(listed) => actions::acknowledge_all(&cx, listed.into_iter(), false),
                None => actions::acknowledge_all(&cx, cx.snapshot.alarms.iter(), false),
            }
        }
        // Where nothing sounds there is nothing to silence.
        Global::Silence if model.snapshot.sound => vec![UiAction::Command(CommandKind::Alarm(AlarmCommand::Silence))],
        Global::Silence => Vec::new(),
        Global::Dump if session_lock::is_closed(&model.session) => Vec::new(),
        Global::Dump => screen_dump::begin(model),
        Global::Copy => copy(model),
        Global::Settings => vec![UiAction::Open(Modal::TerminalSettings(TerminalSettings::new(model)))],
        Global::Redraw => vec![UiAction::Do(Effect::Redraw)],
        Global::Dismiss => {
            // A failure that is being read is dismissed first; everything else does not hold up the way back.
            model.replay.cancel();
            let failed = model.last_command.take().is_some_and(|pending| pending.is_trouble());
            if !failed {
                step_back(model);
            }
            Vec::new()
        }
    }
}

/// Closes what lies on top of the first page of the tab; `false` if nothing does.
fn step_back(model: &mut Model) -> bool {
    let mut closed = false;
    with_tabs(model, |tabs, cx| {
        closed = tabs.shown_mut().back(cx);
        Vec::new()
    });
    closed
}

/// A past instant is wanted, on the event page or on the tab: that of what is selected, or one that is typed.
fn on_past(model: &mut Model, page: bool) -> Vec<UiAction> {
    // A bench has no history.
    if model.snapshot.def.is_bench() || session_lock::is_closed(&model.session) {
        return Vec::new();
    }
    if page && model.replay.shown().is_some() {
        return with_replay(model, Replay::toggle_page).into_iter().map(UiAction::Do).collect();
    }
    let (cx, tab) = (model.cx(), model.tabs.shown());
    match tab.moment(&cx).filter(|_| page) {
        Some(at) => vec![UiAction::EventPage(at)],
        None => {
            let of_alarms = model.tabs.shown == Tab::Alarms;
            let place = if page {
                replay::Place::Page
            } else if of_alarms {
                replay::Place::TabOrPage
            } else {
                replay::Place::Tab
            };
            vec![UiAction::Open(replay::ask_instant(&cx, tab, place))]
        }
    }
}

/// The screen has another size: a tab that it has no room for gives way to the values, as long as these are offered.
pub(super) fn fit_screen(model: &mut Model) {
    if Size::of(model.screen) == Size::Compact && !model.tabs.shown.is_compact() {
        let offered = Tab::offered(&model.cx());
        if let Some(values) = offered.first().copied() {
            model.visited.note(model.tabs.shown, values);
            model.tabs.shown = values;
        }
    }
    close_unseen(model);
}

/// Takes the terminal's own picture away: `true` if there was one.
pub(super) fn close_picture(model: &mut Model) -> bool {
    std::mem::take(&mut model.tabs.trends.pictured)
}

/// A window that cannot be seen must not take keys, and none that gives commands opens where it may not be seen whole;
/// the palette only leads on. What it held is dropped, nothing is done; and what is typed for it is no key of the tab.
pub(super) fn close_unseen(model: &mut Model) {
    let small = model.small();
    let closes =
        |modal: &Modal| !modal.is_quit() && (small || !(modal.only_shows() || matches!(modal, Modal::Palette(_))));
    if Size::of(model.screen) <= Size::Compact && model.modal.take_if(|modal| closes(modal)).is_some() && !small {
        let words = vec![effects::needs_room().to_owned()];
        model.modal = Some(Modal::Notice(Notice::for_form(t!("too small"), words)));
    }
    close_covered_picture(model);
}

/// A picture lies over everything: whatever opens above the chart, or takes its place, closes it.
fn close_covered_picture(model: &mut Model) {
    let covers = model.modal.is_some()
        || model.tabs.shown != Tab::Trends
        || model.small()
        || model.replay.page().is_some()
        || session_lock::is_closed(&model.session)
        || model.tabs.trends.pictured && model.tabs.trends.picture(&model.cx()).is_none();
    if covers {
        close_picture(model);
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
