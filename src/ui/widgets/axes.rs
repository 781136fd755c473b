//! Two axes of numbers with their ticks, for plots that are not over time.

use super::{
    chart::axis::Scale,
    text::{Canvas, fit, width},
};
use crate::{
    plant::number::{to_u16, to_usize},
    ui::theme::Theme,
};

/// What stands along both axes.
#[derive(Debug, Clone, Copy)]
pub struct Axes<'a> {
    /// The axis below.
    pub x: Scale,
    /// The axis at the left.
    pub y: Scale,
    /// What they measure.
    pub names: (&'a str, &'a str),
}

impl Axes<'_> {
    /// Draws them; returns the place between them: column, row, columns, rows.
    pub fn draw(&self, theme: &Theme, canvas: &mut Canvas) -> (u16, u16, u16, u16) {
        let style = theme.dim();
        let labels = self.y.ticks().into_iter().map(|tick| width(&self.y.label(tick)));
        let left = labels.max().unwrap_or(0).max(5) + 1;
        let (columns, rows) = (canvas.width().saturating_sub(left + 2), canvas.height().saturating_sub(3));
        if columns < 4 || rows < 2 {
            return (0, 0, 0, 0);
        }
        canvas.text(0, 0, self.names.1, style);
        for y in 1..=rows {
            canvas.text(left - 1, y, theme.pick("│", "|"), style);
        }
        for tick in self.y.ticks() {
            let y = 1 + to_u16(((1.0 - self.y.share(tick)) * f64::from(rows - 1)).round());
            canvas.text_right(left, y, &format!("{}{}", self.y.label(tick), theme.pick("┤", "+")), style);
        }
        let line = theme.pick("─", "-").repeat(to_usize(f64::from(columns)));
        canvas.text(left - 1, rows + 1, &format!("{}{line}", theme.pick("└", "+")), style);
        // The name stands at the right of the labels, whatever else finds room.
        let name = fit(self.names.0, canvas.width() / 2);
        let name_start = canvas.width().saturating_sub(width(&name));
        canvas.text(name_start, rows + 2, &name, style);
        let mut free = 0;
        for tick in self.x.ticks() {
            let x = left + to_u16((self.x.share(tick) * f64::from(columns - 1)).round());
            canvas.text(x, rows + 1, theme.pick("┴", "+"), style);
            let label = self.x.label(tick);
            let start = x.saturating_sub(width(&label) / 2).min(canvas.width().saturating_sub(width(&label)));
            if start >= free && start + width(&label) < name_start {
                free = canvas.text(start, rows + 2, &label, style) + 1;
            }
        }
        (left, 1, columns, rows)
    }
}
