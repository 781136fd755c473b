//! How every list looks: heading, columns, rows, how many more there are, and what is known of the selected one.

use std::borrow::Cow;

use super::{
    Heading, List, Listing,
    column::{self, placed},
};
use crate::ui::tabs::prelude::*;

/// Rows of the list at least.
const ROWS_MIN: u16 = 3;

impl<L: Listing> List<L> {
    pub fn view(&self, cx: &ViewContext, canvas: &mut Canvas) {
        let (theme, width, height) = (cx.theme, canvas.width(), canvas.height());
        let rows = self.rows(cx);
        let heading = self.view_heading(cx, canvas, rows.len());
        if let Some((words, style)) = self.of.foot(cx) {
            canvas.text(1, height.saturating_sub(1), &fit_words(&words, width.saturating_sub(2)), style);
        }
        let columns = placed(self.of.columns(cx, width), width.saturating_sub(1), |column| {
            rows.iter().map(|row| text::width(&column.text(cx, row, u16::MAX))).max().unwrap_or(0)
        });
        canvas.text(1, 1, &fit(column::heads(&columns).trim_end(), width.saturating_sub(1)), theme.dim());
        if rows.is_empty() {
            return self.view_empty(cx, canvas, &heading);
        }
        let (place, room, head) = (self.place(&rows), self.room(cx, &rows), self.head(cx));
        let begin = first(place, rows.len(), room);
        for (y, n, row) in on_screen(&rows, begin, room) {
            let mark = match (self.is_marked(row), n == place) {
                (true, _) => theme.pick("■", "*"),
                (false, true) => theme.pick("▸", ">"),
                (false, false) => " ",
            };
            let style = if n == place { theme.focus() } else { self.of.style(cx, row) };
            let y = y + head;
            canvas.text(0, y, &pad(mark, width), style);
            if let Some(words) = self.of.words(cx, row) {
                canvas.text(1, y, &fit(&words, width.saturating_sub(1)), style);
                continue;
            }
            for ((x, text), (column, _)) in column::cells(cx, &columns, row).iter().zip(&columns) {
                let own = column.style.filter(|_| n != place).map(|own| own(cx, row));
                canvas.text(x + 1, y, &fit(text, width.saturating_sub(x + 1)), own.unwrap_or(style));
            }
        }
        let shown = to_u16(room.min(rows.len()));
        let below = rows.len().saturating_sub(begin + room);
        if 0 < below {
            let words = t!("{below} more ▼", below);
            canvas.text_right(
                width.saturating_sub(1),
                head + shown,
                theme.pick(&words, &words.replace('▼', "")),
                theme.dim(),
            );
        }
        for ((text, style), y) in self.detail_lines(cx, &rows[place]).iter().zip(head + shown + 1..height) {
            canvas.text(1, y, text, *style);
        }
    }

    /// Why there is no row.
    pub fn view_empty(&self, cx: &ViewContext, canvas: &mut Canvas, heading: &Heading) {
        let words = self.why_empty(cx, heading);
        for (y, line) in (3..).zip(wrap(&words, canvas.width().saturating_sub(4))) {
            canvas.text(2, y, &line, cx.theme.dim());
        }
    }

    /// Its first row, also above another picture of the same rows.
    pub fn view_heading<'a>(&'a self, cx: &ViewContext<'a>, canvas: &mut Canvas, count: usize) -> Heading<'a> {
        let heading = self.of.heading(cx, self.answered.value.as_ref());
        let (theme, width) = (cx.theme, canvas.width());
        let end = width.saturating_sub(1);
        let x = canvas.text(1, 0, &fit(&heading.title, end.saturating_sub(1)), theme.strong());
        let x = if heading.title.is_empty() { x } else { x + 2 };
        let (all, limit) = (self.all(cx).len(), heading.limit.as_ref());
        let mut words = match (
            heading.trouble.as_ref().or(self.answered.trouble.as_ref()),
            limit.filter(|(most, _)| *most <= all),
            &heading.words,
        ) {
            (Some(trouble), ..) => (trouble.clone(), theme.trouble()),
            (None, Some((_, words)), _) => (words.clone(), theme.normal()),
            (None, None, Some(words)) => words.clone(),
            (None, None, None) => (String::new(), theme.normal()),
        };
        let gap = |words: &str| if words.is_empty() { "" } else { "   " };
        if !self.filter.is_empty() {
            let filter = t!("\"{typed}\": {count} of {all}, / changes it", typed = self.filter, count, all);
            words.0 = format!("{filter}{}{}", gap(&words.0), words.0);
        }
        let columns = self.order.map(|_| self.of.columns(cx, width)).unwrap_or_default();
        if let Some(column) = self.order.and_then(|order| columns.get(order)) {
            let order = if self.reversed {
                t!("sorted by {column}, reversed", column = column.head)
            } else {
                t!("sorted by {column}", column = column.head)
            };
            words.0 = format!("{order}{}{}", gap(&words.0), words.0);
        }
        let right = text::width(&heading.right);
        canvas.text_right(end, 0, &heading.right, theme.dim());
        canvas.text(x, 0, &fit(&words.0, end.saturating_sub(x + if 0 < right { right + 1 } else { 0 })), words.1);
        heading
    }

    fn why_empty(&self, cx: &ViewContext, heading: &Heading) -> String {
        let is_answered = !heading.waits && (self.answered.value.is_some() || self.of.query(cx).is_none());
        match (is_answered, self.filter.is_empty()) {
            (false, _) => self.answered.query.shown_waiting(cx).unwrap_or_else(|| t!("collecting data").to_owned()),
            (true, true) => heading.empty.to_owned(),
            (true, false) => t!("No matching entries.").to_owned(),
        }
    }

    /// Rows of the screen above the list: heading and columns.
    fn head(&self, cx: &ViewContext) -> u16 {
        1 + u16::from(self.of.columns(cx, cx.area.width).iter().any(|column| !column.head.is_empty()))
    }

    /// Rows of the screen that heading and list take.
    pub fn used(&self, cx: &ViewContext) -> u16 {
        let rows = self.rows(cx);
        self.head(cx) + to_u16(rows.len().min(self.room(cx, &rows)))
    }

    fn detail_lines(&self, cx: &ViewContext, row: &L::Row) -> Vec<(String, Style)> {
        let room = cx.area.width.saturating_sub(2);
        let lines = |(text, style): (String, Style)| {
            // What stands in columns keeps its blanks.
            let lines = if text::width(&text) <= room { vec![text] } else { wrap(&text, room) };
            lines.into_iter().map(move |line| (line, style))
        };
        self.of
            .details(cx, row, self.answered.value.as_ref())
            .into_iter()
            .flat_map(lines)
            .filter(|(line, _)| !line.is_empty())
            .collect()
    }

    /// Rows of the list that there is room for: the rest is about the selected one, and one says how many more there are.
    pub(super) fn room(&self, cx: &ViewContext, rows: &[Cow<L::Row>]) -> usize {
        let details = rows.get(self.place(rows)).map_or(0, |row| to_u16(self.detail_lines(cx, row).len()));
        let foot = u16::from(self.of.foot(cx).is_some());
        let room = self.of.height(cx).saturating_sub(self.head(cx) + foot);
        let room = match details {
            0 if rows.len() <= usize::from(room) => room,
            details => room.saturating_sub(details + 1),
        };
        usize::from(room.max(ROWS_MIN))
    }
}
