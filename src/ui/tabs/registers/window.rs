//! Which registers are on the screen and read, and how often.

use std::ops::Range;

use super::{ReadFor, Registers, preview::Preview, view};
use crate::{
    access::right::needs_for_query,
    plant::{
        command::Refusal,
        live::{AddressSpan, CELLS_MAX, LiveRead, LiveReading, SPANS_MAX},
        number::to_u32,
    },
    ui::{rights, tabs::prelude::*},
};

/// Periods to choose from.
const PERIODS_MS: [i64; 8] = [200, 500, 1_000, 2_000, 5_000, 10_000, 30_000, 60_000];
/// Words behind the window that are read with it: the last row may be the first word of a 64-bit value. What has a name and reaches
/// further is read with a request of its own.
const BEHIND: u32 = 3;

impl Registers {
    pub(super) fn rows(&self, cx: &ViewContext) -> Range<u32> {
        let first = u32::from(self.first);
        first..(first + to_u32(view::rows(self, cx.area.height))).min(0x1_0000)
    }

    /// What is read: the window, and what its last row may need.
    pub(super) fn span(&self, cx: &ViewContext) -> AddressSpan {
        let rows = self.rows(cx);
        let count = to_u16((rows.end + BEHIND).min(0x1_0000) - rows.start);
        AddressSpan { table: self.table, address: self.first, count }
    }

    /// Values with names that begin in the window and end behind what is read with it.
    fn values_behind(&self, span: AddressSpan) -> Vec<AddressSpan> {
        let reaches = |address: u32| {
            let named = self.names.get(self.table, to_u16(address))?;
            let value = AddressSpan { address: named.address, count: named.count(), ..span };
            (span.range().end < value.range().end && value.range().end <= 0x1_0000).then_some(value)
        };
        span.range().filter_map(reaches).collect()
    }

    pub(super) fn scroll(&mut self, cx: &ViewContext, motion: Motion) {
        let room = view::rows(self, cx.area.height);
        self.selected = to_u16(motion.to(usize::from(self.selected), 0x1_0000, room));
        self.keep_in_sight(cx);
    }

    pub(super) fn keep_in_sight(&mut self, cx: &ViewContext) {
        let room = to_u16(view::rows(self, cx.area.height)).max(1);
        let last_first = u16::MAX - (room - 1);
        self.first = self.first.clamp(self.selected.saturating_sub(room - 1), self.selected).min(last_first);
    }

    pub(super) fn change_period(&mut self, by: isize) {
        let at = PERIODS_MS.iter().position(|ms| SignedDuration::from_millis(*ms) == self.period).unwrap_or(0);
        let at = at.saturating_add_signed(by).min(PERIODS_MS.len() - 1);
        self.period = SignedDuration::from_millis(PERIODS_MS[at]);
    }

    /// Something else is shown: what is on its way is no longer wanted.
    pub(super) fn read_now(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        if self.paused {
            return self.rest();
        }
        self.ask(cx, None)
    }

    pub(super) fn ask(&mut self, cx: &ViewContext, not_before: Option<Timestamp>) -> Vec<UiAction> {
        if cx.def().lines.is_empty() {
            return Vec::new();
        }
        let span = self.span(cx);
        let relearn = std::mem::take(&mut self.relearn);
        let spans = std::iter::once(span).chain(self.values_behind(span)).chain(self.watched_spans(span));
        let spans = spans.chain(self.preview.iter().flat_map(Preview::spans));
        let spans = spans.chain(self.unscaled_spans()).chain(self.listed_spans.iter().copied());
        let mut room = CELLS_MAX;
        let fits = |span: &AddressSpan| {
            let left = room.checked_sub(span.count.into());
            left.inspect(|left| room = *left).is_some()
        };
        let spans = spans.take(SPANS_MAX).filter(fits).collect();
        let read = LiveRead { line: self.line, unit: self.unit, spans, not_before, relearn };
        let silent = cx.def().listens_on(self.line).then(|| Refusal::OnlyListens.to_string());
        if let Some(why) = silent.or_else(|| rights::lacks(cx, needs_for_query(&Query::Registers(read.clone())))) {
            self.trouble = Some(why);
            return Vec::new();
        }
        vec![self.send(cx, ReadFor::Window(span), read)]
    }

    /// The window was read: the next read is due one period later.
    pub(super) fn on_window(&mut self, cx: &ViewContext, reading: LiveReading) -> Vec<UiAction> {
        self.trouble = None;
        self.reads += 1;
        reading.response_time.into_iter().for_each(|reply| self.replies.see(reply));
        self.cells.on_reading(&reading);
        self.name_by_profile();
        self.follow_list(cx);
        let began = reading.began;
        let early = self.due.filter(|due| began + self.period / 2 < *due && *due <= began + self.period);
        let mut actions = self.watch_reading(&reading, early.is_none());
        self.took = cx.monotonic_now().duration_since(began);
        self.last = Some(reading);
        if self.paused {
            return actions;
        }
        actions.extend(self.read_compared(cx));
        actions.extend(self.recognise(cx));
        self.due = early.or_else(|| began.checked_add(self.period).ok());
        actions.extend(self.ask(cx, self.due));
        actions
    }
}
