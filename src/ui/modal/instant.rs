//! Instants as they are asked for, typed and written.

use jiff::Timestamp;

use super::{Modal, Prompt};
use crate::{
    report::period_parser::{self, PeriodError},
    t,
    text::date,
    ui::{UiAction, ViewContext},
};

/// Characters of the name of a bookmark.
const NAME_MAX: usize = 60;

/// What a typed instant is for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Asked {
    /// The instant of what was selected, which an empty text means.
    pub selected: Option<Timestamp>,
    /// Where it is shown.
    pub place: Place,
}

/// Where an instant is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    Tab,
    Page,
    /// Nowhere: the text is the name of the instant that is shown.
    Bookmark,
    /// On the tab, that of an alarm on the event page: what an alarm is about is never on one tab alone.
    TabOrPage,
}

/// Asks for an instant; Enter alone takes that of what is selected.
pub fn ask_instant(cx: &ViewContext, selected: Option<Timestamp>, place: Place) -> Modal {
    let hint = t!("03:12   2026-11-20 22:15   -10m   -2h   -3d");
    let hint = match selected {
        Some(at) => t!("{hint}   Enter alone: {at}", hint, at = stamp(cx, at)),
        None => hint.to_owned(),
    };
    let title = match place {
        Place::Page => t!("Event page: everything at a past time"),
        Place::Tab | Place::TabOrPage | Place::Bookmark => t!("Replay: go to a past time"),
    };
    Modal::Prompt(Prompt::new(title, hint, "").for_replay(Asked { selected, place }))
}

/// `2026-11-20 03:12:07`, with milliseconds where it has some.
pub fn stamp(cx: &ViewContext, at: Timestamp) -> String {
    let form = if at.subsec_millisecond() == 0 { "%H:%M:%S" } else { "%H:%M:%S%.3f" };
    let local = at.to_zoned(cx.def().time_zone.clone());
    format!("{} {}", date(local.date()), local.strftime(form))
}

/// The instant that was typed: a time, a date with a time, or how long ago; nothing is the one that was selected.
pub fn typed(cx: &ViewContext, text: &str, asked: Asked) -> Result<Vec<UiAction>, String> {
    let selected = asked.selected.filter(|_| text.trim().is_empty());
    let instant = || selected.map_or_else(|| instant(cx, text), Ok);
    let page = match asked.place {
        Place::Tab => false,
        Place::Page => true,
        Place::Bookmark => return name(cx, text),
        Place::TabOrPage => selected.is_some(),
    };
    let at = instant()?;
    Ok(vec![if page { UiAction::EventPage(at) } else { UiAction::Replay(at) }])
}

/// Keeps the instant under this name.
fn name(cx: &ViewContext, text: &str) -> Result<Vec<UiAction>, String> {
    match text.trim() {
        "" => Err(t!("expected a name").to_owned()),
        name => Ok(vec![UiAction::Bookmark(cx.now, Some(name.chars().take(NAME_MAX).collect()))]),
    }
}

pub fn ask_name(cx: &ViewContext) -> Modal {
    let asked = Asked { selected: None, place: Place::Bookmark };
    Modal::Prompt(Prompt::new(t!("Bookmark: a name for this time"), stamp(cx, cx.now), "").for_replay(asked))
}

/// The same without what was selected.
pub fn instant(cx: &ViewContext, text: &str) -> Result<Timestamp, String> {
    let (present, text) = (cx.present(), text.trim());
    let wrong =
        || t!("`{text}` is not a past time: expected 03:12, 2026-11-20 22:15, or how long ago: -10m -2h -3d", text);
    let Some(ago) = text.strip_prefix('-') else {
        return period_parser::past_instant(cx.def(), text, present).map_err(|error| match error {
            PeriodError::InFuture(text) => t!("{text} lies in the future", text),
            _ => wrong(),
        });
    };
    let span: jiff::Span = ago.trim().parse().map_err(|_| wrong())?;
    let then = present.to_zoned(cx.def().time_zone.clone()).checked_sub(span.abs());
    let then = then.and_then(|then| then.round(jiff::Unit::Second)).map_err(|_| wrong())?;
    Ok(then.timestamp().min(present))
}
