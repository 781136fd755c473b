//! The keys of a replay, and what they do.

use crossterm::event::KeyCode;
use jiff::{SignedDuration, Timestamp};

use super::{
    Model, UiAction, ViewContext,
    global::{self, GlobalKey, Reach},
    keys::{char, code},
    modal::instant::ask_name,
    model_context::with_replay,
    replay::{
        Direction::{Earlier, Later},
        Replay, Searched,
    },
};

/// Keys while the past is shown; they come before those of the tab.
pub const KEYS: &[GlobalKey] = &[
    GlobalKey::new(code(KeyCode::Esc), "present", "back to the present", leave).reach(Reach::Small),
    GlobalKey::new(char('['), "", "previous alarm event or action of an operator", |model| {
        act(model, |replay, at, present| replay.search(Searched::Events, Earlier, at, present))
    }),
    GlobalKey::new(char(']'), "event", "next alarm event or action of an operator", |model| {
        act(model, |replay, at, present| replay.search(Searched::Events, Later, at, present))
    }),
    GlobalKey::new(char('<'), "", "a minute earlier", |_| step(-60)),
    GlobalKey::new(char('>'), "minute", "a minute later", |_| step(60)),
    GlobalKey::new(char(','), "", "a second earlier; pauses", |_| step(-1)),
    GlobalKey::new(char('.'), "second", "a second later; pauses", |_| step(1)),
    GlobalKey::new(char('*'), "play", "play ×1, ×10, ×60, ×600, then pause", |model| {
        act(model, |replay, _, present| replay.play(present))
    }),
    GlobalKey::new(char('@'), "time", "go to a past time", global::show_past),
    GlobalKey::new(char('('), "", "previous stored value of what is drawn", |model| {
        act(model, |replay, at, present| replay.search_sample(Earlier, at, present))
    }),
    GlobalKey::new(char(')'), "sample", "next stored value of what is drawn", |model| {
        act(model, |replay, at, present| replay.search_sample(Later, at, present))
    }),
    GlobalKey::new(char('{'), "", "previous begin or end of a batch", |model| {
        act(model, |replay, at, present| replay.search(Searched::Batches, Earlier, at, present))
    }),
    GlobalKey::new(char('}'), "batch", "next begin or end of a batch", |model| {
        act(model, |replay, at, present| replay.search(Searched::Batches, Later, at, present))
    }),
    GlobalKey::new(char('#'), "bookmark", "keep this instant under a name", |model| {
        vec![UiAction::Open(ask_name(&model.cx()))]
    }),
];

/// Acts from the shown instant on; nothing is later than the present.
fn act(model: &mut Model, act: fn(&mut Replay, Timestamp, &ViewContext) -> Vec<UiAction>) -> Vec<UiAction> {
    let Some(at) = model.replay.shown().map(|shown| shown.at) else { return Vec::new() };
    with_replay(model, |replay, present| act(replay, at, present))
}

fn step(seconds: i64) -> Vec<UiAction> {
    vec![UiAction::ReplayStep(SignedDuration::from_secs(seconds))]
}

/// What lies on top of the tab closes before the past does.
fn leave(model: &mut Model) -> Vec<UiAction> {
    let on_tab = model.replay.page().is_none() && !model.small();
    if !(on_tab && global::step_back(model)) {
        model.replay.leave();
    }
    Vec::new()
}
