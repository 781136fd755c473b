//! The frame of a past that is shown: which instant, how long ago, whether it plays, and what happened then.

use super::{Canvas, Model, ViewContext, width};
use crossterm::event::KeyCode;

use crate::{
    plant::time::elapsed,
    t,
    ui::{
        global::GlobalKey,
        keys::{Hint, code},
        modal::instant::stamp,
        replay::Event,
        replay_keys,
        tabs::alarms::{action_text, event_text},
        widgets::text::age,
    },
};

/// The line above or below the tab: of slashes while a past is shown.
pub(super) fn line(cx: &ViewContext, canvas: &mut Canvas) {
    let (sign, style) =
        if cx.is_past() { (cx.theme.pick('╱', '/'), cx.theme.strong()) } else { ('─', cx.theme.dim()) };
    canvas.run(0, 0, canvas.width(), sign, style);
}

/// The line above the tab, with the instant in it.
pub(super) fn rule(model: &Model, cx: &ViewContext, canvas: &mut Canvas) {
    line(cx, canvas);
    let Some(shown) = model.replay.shown() else { return };
    let at = stamp(cx, shown.at);
    let ago = t!("{ago} ago", ago = age(elapsed(shown.at, cx.present())));
    let pace = match model.replay.speed() {
        0 => t!("paused").to_owned(),
        pace => t!("playing ×{pace}", pace),
    };
    let words = [t!(" PAST  {at}  {ago}  {pace} ", at, ago, pace), t!(" PAST  {at} ", at)];
    let Some(words) = words.iter().find(|words| width(words) + 4 <= canvas.width()) else { return };
    canvas.text(3, 0, words, cx.theme.focus());
}

/// What the replay waits for, why it got nowhere, or the event that it went to.
pub(super) fn words(model: &Model, cx: &ViewContext) -> Option<String> {
    model.replay.words().or_else(|| {
        let event = model.replay.event()?;
        let text = match event {
            Event::Alarm(record) => event_text(cx, record),
            Event::Batch { label, ended: false, .. } => t!("batch {label} begins", label),
            Event::Batch { label, ended: true, .. } => t!("batch {label} ends", label),
            Event::Sample(_) => t!("a value was stored").to_owned(),
            Event::Action(record) => action_text(cx, record).split_whitespace().collect::<Vec<_>>().join(" "),
        };
        Some(text)
    })
}

/// The keys of the replay, then those of the tab that only look; where Esc leads back on the tab it does not end the past.
pub(super) fn hints(model: &Model, cx: &ViewContext) -> Vec<Hint> {
    let own: Vec<Hint> = match model.replay.page() {
        Some(_) => vec![Hint::new("!", t!("tab"), ""), Hint::new("↑↓", t!("scroll"), "")],
        None => model.tabs.shown().hints(cx).into_iter().filter(|hint| hint.needs.is_none()).collect(),
    };
    let is_escape = |hint: &Hint| hint.chord.is_some_and(|chord| chord == code(KeyCode::Esc));
    let (escape, own): (Vec<Hint>, Vec<Hint>) = own.into_iter().partition(is_escape);
    let replay =
        replay_keys::KEYS.iter().copied().map(GlobalKey::hint).filter(|hint| escape.is_empty() || !is_escape(hint));
    escape.iter().cloned().chain(replay).chain(own).collect()
}
