//! What a key does: of a window, of the replay, of every tab, or of the shown tab.

use super::*;
use crate::text::translate;
use global::{GlobalKey, Reach};
use keys::Hint;
use modal::{Next, Notice};
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
    let global = global::find(&global::keys(), event);
    if let Some(key) = global
        && key.tab().is_some_and(|tab| Tab::offered(&model.cx()).contains(&tab))
        && model.modal.as_ref().is_some_and(|modal| !modal.takes_text())
    {
        // The number of a tab leads there from every window that has no use for it.
        if let Some(Modal::Confirm(_)) = model.modal.take() {
            model.note = Some(t!("Cancelled: nothing was sent").into());
        }
        return key.press(model);
    }
    if let Some(actions) = dump_window(model, event) {
        return actions;
    }
    if let Some(modal) = model.modal.take_if(|_| !past) {
        return on_window_key(model, modal, event);
    }
    if model.tabs.shown == Tab::Login && model.tabs.login.is_typing() && !model.small() {
        return session_lock::on_typed(model, event);
    }
    let hears = |key: &GlobalKey| key.reaches(Reach::Small) || !model.small();
    if let Some(key) = global::find(replay_keys::KEYS, event).filter(|_| model.replay.shown().is_some()).filter(hears) {
        let actions = key.press(model);
        return actions.into_iter().chain(with_tabs(model, |tabs, cx| tabs.shown_mut().on_snapshot(cx))).collect();
    }
    match global.filter(hears) {
        Some(key) => key.press(model),
        // No command goes to what is not visible.
        None if model.small() => Vec::new(),
        None if model.replay.page().is_some() => on_page_key(model, event),
        None if !model.may_act(event) => Vec::new(),
        None => on_tab_key(model, event),
    }
}

/// A key of the open window.
fn on_window_key(model: &mut Model, modal: Modal, event: KeyEvent) -> Vec<UiAction> {
    let before = model.cx().is_past().then(|| modal.clone());
    let next = match modal.on_key(&model.cx(), event) {
        Next::Ask(asked) => with_tabs(model, |tabs, cx| tabs.on_asked(cx, asked)),
        next => next,
    };
    let (rest, actions) = match next {
        Next::Stay(modal) => (Some(modal), Vec::new()),
        Next::Close | Next::Ask(_) => (None, Vec::new()),
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
    actions
}

/// Keys that mean the same in every window and while something is typed.
fn on_key_of_every_window(model: &mut Model, event: KeyEvent) -> Option<Vec<UiAction>> {
    match global::find(&global::keys(), event) {
        Some(key) if key.reaches(Reach::Windows) => Some(key.press(model)),
        Some(_) | None => (model.tour.is_some() && tour::SKIP.is(event)).then(Vec::new),
    }
}

/// A window that only shows is saved with the screen; another one takes the letter itself.
fn dump_window(model: &mut Model, event: KeyEvent) -> Option<Vec<UiAction>> {
    let shows = model.modal.as_ref().is_some_and(|modal| modal.only_looks() && !modal.takes_text());
    let key = global::find(&global::keys(), event).filter(|key| shows && key.is_for_looking())?;
    Some(key.press(model))
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
    let mut is_key = false;
    let actions = with_tabs(model, |tabs, cx| {
        let actions = tabs.shown_mut().press(cx, event);
        is_key = actions.is_some();
        actions.unwrap_or_default()
    });
    if !is_key && matches!(event.code, KeyCode::Char(_)) {
        model.note = Some(t!("This key does nothing here. ? lists the keys, : goes to anything by its name").into());
    }
    actions
}

/// Fills in the list of all keys while it is shown.
pub(super) fn list_keys(model: &mut Model) {
    if !matches!(model.modal, Some(Modal::Help(_))) {
        return;
    }
    let (cx, tab) = (model.cx(), model.tabs.shown);
    let heading = |text: &str| Hint::new("", text, "");
    let own = model.tabs.shown().hints(&cx).into_iter().filter(|hint| !hint.help.is_empty());
    let replayed = replay_keys::KEYS.iter().copied().map(GlobalKey::hint);
    let past = [heading(""), heading(t!("past"))].into_iter().chain(replayed).filter(|_| cx.is_past());
    let offered = Tab::offered(&cx);
    let there = global::keys().into_iter().filter(|key| key.tab().is_none_or(|tab| offered.contains(&tab)));
    let rows = [heading(translate(tab.title()))]
        .into_iter()
        .chain(own)
        .chain(past)
        .chain([heading(""), heading(t!("every tab"))])
        .chain(there.map(GlobalKey::hint))
        .collect();
    if let Some(Modal::Help(help)) = &mut model.modal {
        help.rows = rows;
    }
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
        || rights::is_closed(&model.session)
        || model.tabs.trends.pictured && model.tabs.trends.picture(&model.cx()).is_none();
    if covers {
        close_picture(model);
    }
}
