//! Drawing of a chart: grid, curves, marks, gaps, axes and cursor.

use super::{stroke::straight, *};
use crate::plant::time::elapsed;
use crate::t;

impl Chart<'_> {
    /// Faint points where round values meet round times, to lead the eye; not in ASCII, where a point is a value.
    pub(super) fn draw_grid(&self, plan: &Plan, area: Rect, buf: &mut Buffer) {
        let Some((_, scale)) = plan.scales.iter().find(|(axis, _)| *axis == Axis::Left) else { return };
        if self.theme.glyphs == Glyphs::Ascii || plan.plot.height == area.height {
            return;
        }
        for (at, _) in self.time_labels(plan) {
            let Some(x) = self.cell(at, plan.plot.width) else { continue };
            for tick in scale.ticks() {
                let y = self.row(*scale, tick, plan.plot.height);
                buf[(plan.plot.x + x, plan.plot.y + y)].set_symbol("·").set_style(self.theme.dim());
            }
        }
    }

    pub(super) fn draw_curves(&self, plan: &Plan, buf: &mut Buffer) {
        let plot = plan.plot;
        let mut canvas = Canvas::new(raster(self.theme), plot.width.into(), plot.height.into());
        let (_, height) = canvas.size();
        let across = raster(self.theme).dots().0;
        let mut outside: Vec<(usize, bool, usize)> = Vec::new();
        for (n, curve) in self.curves.iter().enumerate().rev() {
            let scale = plan.scales[n].1;
            let row = |value: f64| dot_of(scale, value, height);
            let lines = (curve.stroke == Stroke::Line).then(|| straight(&plan.columns[n]));
            let columns = lines.as_ref().unwrap_or(&plan.columns[n]);
            let base = 0.0f64.clamp(scale.low, scale.high);
            let mut before: Option<Span> = None;
            for (x, span) in columns.iter().enumerate() {
                if let Some(span) = span {
                    let from = match curve.stroke {
                        Stroke::Step | Stroke::Line => before.map_or(span.last, |before| before.last),
                        Stroke::Dots => span.last,
                        Stroke::Bars => base,
                    };
                    let (low, high) = (span.min.min(from), span.max.max(from));
                    if high < scale.low || scale.high < low {
                        outside.push((x / across, scale.high < low, n));
                    } else if !curve.dashed || row(low) != row(high) || x % 4 < 2 {
                        canvas.bar(x, row(high), row(low), n);
                    }
                }
                before = *span;
            }
        }
        for (x, y, glyph, owner) in canvas.glyphs() {
            let cell = &mut buf[(plot.x + to_u16(x), plot.y + to_u16(y))];
            cell.set_char(glyph).set_style(self.theme.pen(self.curves[owner].pen));
        }
        // What lies outside of a typed scale is no flat line at its end.
        for (x, above, n) in outside {
            let (y, arrow) = if above { (plot.y, ("↑", "^")) } else { (plot.bottom() - 1, ("↓", "v")) };
            let cell = &mut buf[(plot.x + to_u16(x), y)];
            cell.set_symbol(self.theme.pick(arrow.0, arrow.1)).set_style(self.theme.pen(self.curves[n].pen));
        }
    }

    /// The mark of each pen: at the end of its curve, and at regular times so that it travels with the curve.
    pub(super) fn draw_marks(&self, plan: &Plan, buf: &mut Buffer) {
        let (plot, dots) = (plan.plot, raster(self.theme).dots().0);
        let mut taken: Vec<(u16, u16)> = Vec::new();
        let count = self.curves.len() as i64;
        let cell_width = (self.to.as_microsecond() - self.from.as_microsecond()) / i64::from(plot.width.max(1));
        let first = self.from.as_microsecond().div_euclid(cell_width.max(1));
        for (n, curve) in self.curves.iter().enumerate() {
            let place = |x: u16| {
                let cell = &plan.columns[n][usize::from(x) * dots..(usize::from(x) + 1) * dots];
                let last = cell.iter().rev().flatten().next()?.last;
                Some((x, self.row(plan.scales[n].1, last, plot.height)))
            };
            let mut put = |(x, y): (u16, u16)| {
                let free = !taken.contains(&(x, y));
                if free {
                    taken.push((x, y));
                    let cell = &mut buf[(plot.x + x, plot.y + y)];
                    cell.set_symbol(mark(self.theme, curve.pen)).set_style(self.theme.pen(curve.pen));
                }
                free
            };
            // Where two curves end in one place, the second mark stands a little before.
            (0..plot.width).rev().filter_map(place).take(8).any(&mut put);
            let phase = MARK_CELLS * n as i64 / count;
            let due = |x: &u16| count > 1 && (first + i64::from(*x)).rem_euclid(MARK_CELLS) == phase;
            (0..plot.width.saturating_sub(8)).filter(due).filter_map(place).for_each(|at| {
                put(at);
            });
        }
    }

    /// Says how long there is no value of any pen, where there is room to say it. Time that was not read yet is left
    /// blank: nothing is known of it.
    pub(super) fn draw_gaps(&self, plan: &Plan, buf: &mut Buffer) {
        let (plot, across) = (plan.plot, raster(self.theme).dots().0);
        let count = usize::from(plot.width) * across;
        let past = self.cell(self.now, plot.width).map_or(count, |x| usize::from(x) * across);
        let known = |x: &usize| plan.columns.iter().any(|columns| columns[*x].is_some());
        let span = elapsed(self.from, self.to);
        let was_read = |x: usize| {
            let at = self
                .from
                .checked_add(SignedDuration::try_from(span.mul_f64(x as f64 / count as f64)).unwrap_or_default());
            at.is_ok_and(|at| self.curves.iter().any(|curve| curve.trace.covers(at)))
        };
        let mut x = 0;
        while x < past && !plan.columns.is_empty() {
            let end = (x..past).find(known).unwrap_or(past);
            let (first, last) = (to_u16(x.div_ceil(across)), to_u16(end / across));
            let length = span_text(span.mul_f64((end - x) as f64 / count as f64));
            let texts = [t!("no data {length}", length), t!("gap {length}", length), length];
            let fits = |text: &String| first + to_u16(text.width()) + 2 <= last;
            if let Some(text) = texts.into_iter().find(fits).filter(|_| was_read(x + (end - x) / 2)) {
                let start = plot.x + first + (last - first - to_u16(text.width())) / 2;
                buf.set_string(start, plot.y + plot.height / 2, text, self.theme.dim());
            }
            x = end + 1;
        }
    }

    pub(super) fn draw_axes(&self, plan: &Plan, area: Rect, buf: &mut Buffer) {
        let (plot, style) = (plan.plot, self.theme.dim());
        if plot.height == area.height {
            return;
        }
        let (right, below) = (plot.right(), plot.bottom());
        let line = |unicode, ascii| self.theme.pick(unicode, ascii);
        let own = |wanted: Axis| self.curves.iter().zip(&plan.scales).find(move |(_, (axis, _))| *axis == wanted);
        if plot.x > area.x {
            for y in plot.y..below {
                buf[(plot.x - 1, y)].set_symbol(line("│", "|")).set_style(style);
            }
            buf[(plot.x - 1, below)].set_symbol(line("└", "+")).set_style(style);
        }
        if let Some((curve, (_, scale))) = own(Axis::Left).filter(|_| plot.x > area.x) {
            let width = usize::from(plot.x - area.x - 1);
            buf.set_stringn(area.x, area.y, format!("{:>width$}", curve.heading(self.theme)), plot.width.into(), style);
            for tick in scale.ticks() {
                let y = plot.y + self.row(*scale, tick, plot.height);
                buf.set_string(area.x, y, format!("{:>width$}{}", scale.label(tick), line("┤", "+")), style);
            }
        }
        if let Some((curve, (_, scale))) = own(Axis::Right).filter(|_| area.right() > right) {
            for y in plot.y..below {
                buf[(right, y)].set_symbol(line("│", "|")).set_style(style);
            }
            buf.set_stringn(right + 1, area.y, curve.heading(self.theme), usize::from(area.right() - right - 1), style);
            buf[(right, below)].set_symbol(line("┘", "+")).set_style(style);
            for tick in scale.ticks() {
                let y = plot.y + self.row(*scale, tick, plot.height);
                buf.set_string(right, y, format!("{}{}", line("├", "+"), scale.label(tick)), style);
            }
        }
        for x in plot.x..right {
            buf[(x, below)].set_symbol(line("─", "-")).set_style(style);
        }
        self.draw_time(plan, area, buf);
    }

    /// Ticks, labels and events of the time axis. A label is drawn whole or not at all.
    pub(super) fn draw_time(&self, plan: &Plan, area: Rect, buf: &mut Buffer) {
        let (plot, style) = (plan.plot, self.theme.dim());
        let mut free = area.x;
        for (at, label) in self.time_labels(plan) {
            let Some(x) = self.cell(at, plot.width) else { continue };
            buf[(plot.x + x, plot.bottom())].set_symbol(self.theme.pick("┴", "+"));
            let width = to_u16(label.width());
            let start = (plot.x + x).saturating_sub(width / 2).min(area.right().saturating_sub(width)).max(area.x);
            if start >= free && start + width <= area.right() {
                buf.set_string(start, plot.bottom() + 1, &label, style);
                free = start + width + 1;
            }
        }
        for (at, style) in &self.marks {
            if let Some(x) = self.cell(*at, plot.width) {
                buf[(plot.x + x, plot.bottom())].set_symbol("!").set_style(*style);
            }
        }
    }

    pub(super) fn time_labels(&self, plan: &Plan) -> Vec<(Timestamp, String)> {
        let seconds = self.to.as_second() - self.from.as_second();
        let cells_min = if seconds < 8 * 60 { 12 } else { 8 };
        let cells = usize::from(plan.plot.width);
        match self.zone {
            Some(zone) => time_ticks(self.from, self.to, zone, cells, cells_min),
            None => elapsed_ticks(self.from, self.to, cells / cells_min),
        }
    }

    /// A line through the empty cells of a column, and its foot on the time axis.
    fn draw_cursor(&self, plan: &Plan, buf: &mut Buffer, x: u16, has_axis: bool) {
        let (line, foot) = match self.theme.glyphs {
            Glyphs::Braille => ("┊", "┷"),
            Glyphs::Block => ("│", "┴"),
            Glyphs::Ascii => (":", "^"),
        };
        for y in plan.plot.y..plan.plot.bottom() {
            let cell = &mut buf[(x, y)];
            if matches!(cell.symbol(), " " | "·") {
                cell.set_symbol(line).set_style(self.theme.normal());
            } else {
                cell.set_style(self.theme.focus());
            }
        }
        if has_axis {
            buf[(x, plan.plot.bottom())].set_symbol(foot).set_style(self.theme.normal());
        }
    }

    /// The line of each cursor, and the words above it, on whichever side there is room; those of the next cursor begin
    /// behind them.
    pub(super) fn draw_cursors(&self, plan: &Plan, area: Rect, buf: &mut Buffer) {
        let plot = plan.plot;
        let mut free = plot.x;
        for (n, (at, words)) in self.cursors.iter().enumerate() {
            let column = self.cell(*at, plot.width).map(|x| plot.x + x);
            if let Some(x) = column {
                self.draw_cursor(plan, buf, x, plot.y > area.y);
            }
            if plot.y > area.y {
                // One that has left the view is named at the end at which it left.
                let x = column.unwrap_or(if *at < self.from { plot.x } else { plot.right() });
                let later: usize = self.cursors[n + 1..].iter().map(|(_, words)| words.width() + 2).sum();
                let end = plot.right().saturating_sub(2 + to_u16(later));
                let width = to_u16(words.width()).min(end.saturating_sub(free));
                let start = x.saturating_sub(width / 2).min(end.saturating_sub(width)).max(free);
                buf.set_line(start, area.y, words, width);
                free = start + width + 2;
            }
        }
    }

    /// Lines of the limits through the empty cells of their rows, with their names at the right; what lies outside of the
    /// scale has none.
    pub(super) fn draw_limits(&self, plan: &Plan, buf: &mut Buffer) {
        let (plot, style) = (plan.plot, self.theme.dim());
        let line = match self.theme.glyphs {
            Glyphs::Braille => "┈",
            Glyphs::Block => "-",
            Glyphs::Ascii => "~",
        };
        // Where rows are few, two limits may share one: then both are named.
        let mut rows: Vec<(u16, String)> = Vec::new();
        for limit in &self.limits {
            let Some((_, scale)) = plan.scales.get(limit.curve) else { continue };
            if limit.value < scale.low || scale.high < limit.value {
                continue;
            }
            let y = plot.y + self.row(*scale, limit.value, plot.height);
            match rows.iter_mut().find(|(row, _)| *row == y) {
                Some((_, text)) => *text = format!("{text}  {}", limit.text),
                None => rows.push((y, limit.text.clone())),
            }
        }
        for (y, text) in rows {
            let is_blank = |buf: &Buffer, x: u16| matches!(buf[(x, y)].symbol(), " " | "·");
            let taken = (plot.x..plot.right()).filter(|x| !is_blank(buf, *x)).count();
            if taken > usize::from(plot.width / 2) {
                // A curve runs along it.
                continue;
            }
            let width = to_u16(text.width()) + 2;
            // The name stands where nothing is drawn, as far to the right as it can.
            let places = (plot.x..plot.right().saturating_sub(width)).rev();
            let name = places.step_by(2).find(|x| (*x..x + width).all(|x| is_blank(buf, x)));
            for x in plot.x..plot.right() {
                if is_blank(buf, x) {
                    buf[(x, y)].set_symbol(line).set_style(style);
                }
            }
            if let Some(x) = name {
                buf.set_string(x, y, format!(" {text} "), style);
            }
        }
    }

    /// The range between the limits, as a broad stroke on the axis of their curve.
    pub(super) fn draw_normal(&self, plan: &Plan, area: Rect, buf: &mut Buffer) {
        let (plot, Some(limit)) = (plan.plot, self.limits.first()) else { return };
        let Some((axis, scale)) = plan.scales.get(limit.curve) else { return };
        let x = match axis {
            Axis::Left if plot.x > area.x => plot.x - 1,
            Axis::Right if area.right() > plot.right() => plot.right(),
            Axis::Left | Axis::Right | Axis::Own => return,
        };
        let values = |high: bool| self.limits.iter().filter(move |limit| limit.high == high).map(|limit| limit.value);
        let low = values(false).fold(f64::NEG_INFINITY, f64::max).max(scale.low);
        let high = values(true).fold(f64::INFINITY, f64::min).min(scale.high);
        if high < low {
            return;
        }
        for y in self.row(*scale, high, plot.height)..=self.row(*scale, low, plot.height) {
            let cell = &mut buf[(x, plot.y + y)];
            if matches!(cell.symbol(), "│" | "|") {
                let stroke = if *axis == Axis::Left { "▐" } else { "▌" };
                cell.set_symbol(if self.theme.glyphs == Glyphs::Braille { stroke } else { "#" });
            }
        }
    }
}
