//! What the actions of tabs and windows become: changes of the model, and effects.

use jiff::Timestamp;

use super::*;
use preferences::{Bookmark, Kept};

/// Bookmarks of one user; the oldest make room for new ones.
const BOOKMARKS_MAX: usize = 100;

pub(super) fn perform(model: &mut Model, actions: Vec<UiAction>) -> Vec<Effect> {
    let mut effects = Vec::new();
    for action in actions {
        match action {
            UiAction::Open(modal) => model.modal = Some(modal),
            UiAction::Show(tab) => effects.extend(show(model, tab)),
            UiAction::ShowOverview => {
                effects.extend(show_with(model, Tab::Mimic, |tabs, _| tabs.mimic.show_overview()))
            }
            UiAction::ShowDevice(device) => {
                effects.extend(show_with(model, Tab::Controllers, |tabs, _| tabs.controllers.show(device)));
            }
            UiAction::ShowProcedure(id) => {
                effects.extend(show_with(model, Tab::Controllers, |tabs, _| tabs.controllers.show_procedure(id)));
            }
            UiAction::ShowParameter(tag) => {
                let change = |tabs: &mut Tabs, cx: &ViewContext| tabs.controllers.show_parameter(cx, tag);
                effects.extend(show_with(model, Tab::Controllers, change));
            }
            UiAction::ShowOnMimic(tags) => {
                effects.extend(show_with(model, Tab::Mimic, |tabs, cx| tabs.mimic.select(cx, &tags)));
            }
            UiAction::ShowOnTrends(tag, span) => {
                if model.replay.shown().is_some() && span.0 == span.1 {
                    effects.extend(replay(model, |replay, present| replay.go_to(span.0, present)));
                }
                effects.extend(show_with(model, Tab::Trends, |tabs, cx| tabs.trends.show(cx, tag, span)));
            }
            UiAction::Replay(at) => effects.extend(replay(model, |replay, present| replay.go_to(at, present))),
            UiAction::EventPage(at) => effects.extend(replay(model, |replay, present| replay.open_page(at, present))),
            UiAction::ReplayStep(by) => effects.extend(replay(model, |replay, present| replay.step(by, present))),
            UiAction::Command(kind) => effects.extend(model.send_command(kind.into(), None)),
            UiAction::SendCommand(command, credentials) => effects.extend(model.send_command(command, credentials)),
            UiAction::SessionRequest(tab, request) => {
                let number = model.session_lock.next_request(tab, &request);
                if let Some(Modal::UserForm(form)) = &mut model.modal {
                    form.sent(number);
                }
                effects.push(Effect::SessionRequest(QueryId { tab: Some(tab), number }, request));
            }
            UiAction::KeepPreferences(chosen) => {
                model.modal.take_if(|modal| matches!(modal, Modal::TerminalSettings(_)));
                model.chosen_locale = None;
                let user = model.user().map(str::to_owned);
                let chosen = Kept::Preferences(chosen);
                model.preferences_file.set(user.as_deref(), chosen.clone());
                effects.push(Effect::KeepPreferences(user, chosen));
            }
            UiAction::Bookmark(at, name) => effects.push(bookmark(model, at, name)),
            UiAction::SetLocale(locale) => model.set_locale(locale),
            UiAction::KeepTest(window) => model.tabs.bus.keep(*window),
            UiAction::ShowTest(line) => effects.extend(show_with(model, Tab::Bus, |tabs, _| tabs.bus.show_test(line))),
            UiAction::Note(words) => model.note = Some(words.into()),
            UiAction::Leave => model.modal = Some(Modal::Confirm(Confirm::quit(model.leaving))),
            UiAction::Do(effect) => effects.push(effect),
        }
    }
    effects
}

fn replay(model: &mut Model, change: impl FnOnce(&mut Replay, &ViewContext) -> Vec<UiAction>) -> Vec<Effect> {
    let asked = with_replay(model, change);
    perform(model, asked)
}

/// Keeps an instant under a name, in order of time, or forgets it.
fn bookmark(model: &mut Model, at: Timestamp, name: Option<String>) -> Effect {
    let user = model.user().map(str::to_owned);
    let mut all = model.preferences_file.bookmarks(user.as_deref()).to_vec();
    all.retain(|mark| mark.at != at);
    model.note = Some(match &name {
        Some(name) => t!("Bookmark kept: {name}", name).into(),
        None => t!("Bookmark removed").into(),
    });
    all.extend(name.map(|name| Bookmark { at, name }));
    all.sort_by_key(|mark| mark.at);
    let surplus = all.len().saturating_sub(BOOKMARKS_MAX);
    all.drain(..surplus);
    let kept = Kept::Bookmarks(all);
    model.preferences_file.set(user.as_deref(), kept.clone());
    Effect::KeepPreferences(user, kept)
}

/// Shown where a small screen cannot show what a key leads to.
pub(super) fn needs_room() -> &'static str {
    t!("This needs a larger screen: 60x16")
}

/// Shows a tab; it asks at once for what it needs, and says what it has to say.
pub(super) fn show(model: &mut Model, tab: Tab) -> Vec<Effect> {
    let fits = tab.is_compact() || tab == Tab::Login || !model.tabs.shown.is_compact();
    if Size::of(model.screen) == Size::Compact && !fits {
        model.note = Some(needs_room().into());
        return Vec::new();
    }
    if !tab.has_past() {
        model.replay.leave();
    }
    model.replay.close_page();
    model.visited.note(model.tabs.shown, tab);
    model.tabs.shown = tab;
    let asked = with_tabs(model, |tabs, cx| tabs.shown_mut().on_snapshot(cx));
    perform(model, asked)
}

/// Shows a tab with what this changes of it.
fn show_with(model: &mut Model, tab: Tab, change: impl FnOnce(&mut Tabs, &ViewContext)) -> Vec<Effect> {
    with_tabs(model, change);
    show(model, tab)
}
