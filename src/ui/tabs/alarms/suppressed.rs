//! What is evaluated and journaled, but not annunciated: shelved, out of service, suppressed by design.

use super::view;
use crate::{
    plant::{alarm::SuppressedAlarm, def::AlarmId},
    ui::tabs::prelude::*,
};

pub type Suppressed = List<SuppressedAlarms>;

#[derive(Debug, Default)]
pub struct SuppressedAlarms;

impl Listing for SuppressedAlarms {
    type Answer = ();
    type Row = SuppressedAlarm;
    type Id = AlarmId;

    const SORTS: bool = false;

    fn heading<'a>(&self, cx: &ViewContext<'a>, _: Option<&'a ()>) -> Heading<'a> {
        let words = t!("Evaluated and journaled, but not annunciated. u: unsuppress.");
        Heading::new("", t!("No suppressed alarms.")).words(words, cx.theme.dim())
    }

    fn rows<'a>(&'a self, cx: &ViewContext<'a>, _: Option<&'a ()>) -> Vec<Cow<'a, SuppressedAlarm>> {
        cx.snapshot.suppressed.iter().map(Cow::Borrowed).collect()
    }

    fn id(alarm: &SuppressedAlarm) -> AlarmId {
        alarm.id
    }

    fn columns(&self, _cx: &ViewContext, _room: u16) -> Vec<Column<SuppressedAlarm>> {
        vec![rest(0, "", |cx, alarm: &SuppressedAlarm, room| {
            let text = format!("{} {}", cx.theme.state_mark(alarm.state), guidance_text::suppressed_words(cx, alarm));
            fit_words(&text, room.saturating_sub(1))
        })]
    }

    fn style(&self, cx: &ViewContext, alarm: &SuppressedAlarm) -> Style {
        if alarm.active { cx.theme.strong() } else { cx.theme.normal() }
    }

    /// The guidance of the selected one stands below.
    fn height(&self, cx: &ViewContext) -> u16 {
        view::body(cx).saturating_sub(view::guide_of_suppressed(cx))
    }

    fn state(&self, _cx: &ViewContext, alarm: &SuppressedAlarm) -> String {
        format!("{} {}", alarm.state.word(), alarm.note.at)
    }

    fn moment(&self, alarm: &SuppressedAlarm) -> Option<Timestamp> {
        Some(alarm.note.at)
    }
}
