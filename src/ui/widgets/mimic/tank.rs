//! A vessel: its liquid follows the level, its agitator turns, its heater glows, and none of them without a good value.

use crate::t;
use ratatui::style::Style;

use super::{Bounds, alarm_mark, label_style, put_value};
use crate::{
    plant::{
        def::TagId,
        number::{to_u16, to_u32},
    },
    ui::{
        ViewContext, interlock,
        theme::Colours,
        widgets::{
            text::{Canvas, fit, width},
            value,
        },
    },
};

/// What a vessel shows.
#[derive(Debug, Clone, Copy)]
pub struct Tank<'a> {
    /// Written into the upper edge.
    pub label: &'a str,
    /// Level; its range is the height of the vessel.
    pub level: Option<TagId>,
    /// Temperature of the contents.
    pub temperature: Option<TagId>,
    /// Heating power.
    pub heater: Option<TagId>,
    /// Agitator run signal.
    pub agitator: Option<TagId>,
}

impl Tank<'_> {
    /// Draws the vessel into its box.
    pub fn view(&self, cx: &ViewContext, canvas: &mut Canvas, at: Bounds, selected: bool, motion: bool) {
        let mut canvas = canvas.part(at.x, at.y, at.width, at.height);
        canvas.frame("", cx.theme.dim());
        let room = at.width.saturating_sub(2);
        let label = if width(self.label) + 2 <= room { format!(" {} ", self.label) } else { fit(self.label, room) };
        canvas.text(1, 0, &label, label_style(cx, selected));
        let (columns, rows) = (at.width.saturating_sub(2), at.height.saturating_sub(2));
        let eighths = self.level.and_then(|level| eighths(cx, level, rows));
        self.marks(cx, &mut canvas, rows);
        let mut inside = canvas.part(1, 1, columns, rows);
        if let Some(eighths) = eighths {
            liquid(cx, &mut inside, eighths);
        }
        self.fittings(cx, &mut inside, motion);
        self.values(cx, &mut inside);
        // Text over liquid stands on the liquid, not in a hole.
        let Some(eighths) = eighths else { return };
        let full = to_u16(eighths / 8);
        let (top, width) = (inside.height().saturating_sub(full), inside.width());
        if cx.theme.colours == Colours::None {
            (top..inside.height()).for_each(|y| fill_around(&mut inside, y, BODY));
            if eighths % 8 > 0 && top > 0 {
                fill_around(&mut inside, top - 1, SHALLOW);
            }
        } else {
            inside.paint(0, top, width, full, cx.theme.under_liquid());
        }
    }

    /// Level and temperature, from the top; the temperature is what the eye looks for first.
    fn values(&self, cx: &ViewContext, canvas: &mut Canvas) {
        let room = canvas.width();
        let rows = [self.temperature, self.level];
        for (y, tag) in rows.into_iter().flatten().enumerate() {
            let shown = value::show(cx, tag);
            let mark = alarm_mark(cx, tag).map_or(0, |(mark, _)| width(mark) + 1);
            let length = width(&shown.within(room.saturating_sub(mark))) + mark;
            let x = room.saturating_sub(length) / 2;
            canvas.run(x.saturating_sub(1), y, length + 2, ' ', cx.theme.normal());
            put_value(cx, canvas, x, to_u16(y), tag, room);
        }
    }

    /// Agitator and heater, from the bottom.
    fn fittings(&self, cx: &ViewContext, canvas: &mut Canvas, motion: bool) {
        let theme = cx.theme;
        let centre = canvas.width() / 2;
        let mut y = canvas.height();
        if let Some(heater) = self.heater {
            y = y.saturating_sub(1);
            canvas.run(0, y, 15, ' ', theme.normal());
            match value::is_on(cx, heater) {
                Some(true) => {
                    let x = canvas.text(1, y, theme.pick("≋≋≋ ", "^^^ "), theme.running());
                    let x = put_value(cx, canvas, x, y, heater, 11);
                    shape_of_mark(cx, canvas, x + 1, y, heater);
                }
                Some(false) => {
                    let x = canvas.text(1, y, theme.pick(t!("─── off"), t!("--- heater off")), theme.dim());
                    shape_of_mark(cx, canvas, x + 1, y, heater);
                }
                None => {
                    canvas.text(1, y, t!("heater ?"), theme.trouble());
                }
            }
        }
        if let Some(agitator) = self.agitator {
            y = y.saturating_sub(1);
            let shown = value::show(cx, agitator);
            let on = value::is_on(cx, agitator);
            let turn = motion && cx.phase % 4 >= 2;
            let (picture, style) = match (on, turn) {
                (Some(true), false) => (theme.pick("╶─╂─╴", "-+-"), theme.running()),
                (Some(true), true) => (theme.pick(" ╶╂╴ ", " + "), theme.running()),
                (Some(false), _) => (theme.pick("╶─┼─╴", "-|-"), theme.dim()),
                (None, _) => (" ? ", theme.trouble()),
            };
            let x = centre.saturating_sub(5);
            canvas.run(x.saturating_sub(1), y, width(picture) + width(&shown.text) + 3, ' ', theme.normal());
            let x = canvas.text(x, y, picture, style);
            let x = canvas.text(x + 1, y, &shown.text, if on == Some(true) { theme.running() } else { shown.style });
            shape_of_mark(cx, canvas, x + 1, y, agitator);
        }
    }

    /// Quarters of the range on the right wall.
    fn marks(&self, cx: &ViewContext, canvas: &mut Canvas, rows: u16) {
        if self.level.is_none() || rows < 4 {
            return;
        }
        let right = canvas.width().saturating_sub(1);
        for quarter in 1..4 {
            canvas.glyph(right, 1 + rows - rows * quarter / 4, '┤', cx.theme.dim());
        }
    }
}

/// The level in eighths of a row; `None` unless the value is good and its range known.
fn eighths(cx: &ViewContext, level: TagId, rows: u16) -> Option<u32> {
    let value = cx.snapshot.sample(level).good_value()?;
    let (min, max) = cx.snapshot.range(level)?;
    let share = ((value - min) / (max - min)).clamp(0.0, 1.0);
    // A little is not nothing.
    let least = u32::from(share > 0.005);
    share.is_finite().then(|| to_u32((share * f64::from(rows) * 8.0).round()).max(least))
}

/// Without colour liquid is a pattern, so that it is seen beside words and above the bottom of the vessel.
const BODY: char = '▒';
/// A row that is filled in part.
const SHALLOW: char = '░';

/// Fills the blanks of a row, except those next to words.
fn fill_around(canvas: &mut Canvas, y: u16, glyph: char) {
    let width = canvas.width();
    let free = |canvas: &Canvas, x: u16| canvas.symbol(x, y).is_some_and(|symbol| matches!(symbol, " " | "▒" | "░"));
    let empty: Vec<bool> = (0..width).map(|x| free(canvas, x)).collect();
    for x in 0..width {
        let around = usize::from(x).saturating_sub(1)..(usize::from(x) + 2).min(empty.len());
        if empty[around].iter().all(|empty| *empty) {
            canvas.glyph(x, y, glyph, Style::new());
        }
    }
}

fn liquid(cx: &ViewContext, canvas: &mut Canvas, eighths: u32) {
    const SURFACE: [char; 7] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇'];
    let plain = cx.theme.colours == Colours::None;
    let body = if plain { BODY } else { '█' };
    let (width, height) = (canvas.width(), canvas.height());
    let full = to_u16(eighths / 8);
    for y in height.saturating_sub(full)..height {
        canvas.run(0, y, width, body, cx.theme.liquid());
    }
    let rest = (eighths % 8) as usize;
    if rest > 0 && full < height {
        let surface = if plain { SHALLOW } else { SURFACE[rest - 1] };
        canvas.run(0, height - full - 1, width, surface, cx.theme.liquid());
    }
}

/// The mark of an actuator inside the vessel: its shape alone, the faceplate has the words.
fn shape_of_mark(cx: &ViewContext, canvas: &mut Canvas, x: u16, y: u16, output: TagId) {
    if let Some((words, style)) = interlock::mark(cx, output) {
        canvas.text(x, y, words.split(' ').next().unwrap_or_default(), style);
    }
}
