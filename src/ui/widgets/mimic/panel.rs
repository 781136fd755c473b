//! Panels beside the mimic: a controller with its bar, and a sequence with its steps.

use crate::t;
use crate::text::of_plant;
use ratatui::style::Modifier;

use super::{Bounds, alarm_mark, label_style, limits, put_value, unit::states};
use crate::{
    plant::{
        def::{DeviceDef, Faceplate, TagId},
        number::to_u16,
    },
    ui::{
        ViewContext,
        widgets::{
            text::{Canvas, fit, running, whole, width},
            value,
        },
    },
};

/// A controller: PV, SV, MV, a bar of the range with SV and limits, and its states.
pub fn controller(cx: &ViewContext, canvas: &mut Canvas, at: Bounds, device: &DeviceDef, selected: bool) {
    let mut canvas = canvas.part(at.x, at.y, at.width, at.height);
    let theme = cx.theme;
    let x = canvas.text(0, 0, &device.name, label_style(cx, selected));
    let room = canvas.width().saturating_sub(x + 2);
    canvas.text(x + 2, 0, &fit(&device.model, room), theme.dim());
    let Some(faceplate) = &device.faceplate else { return };
    let mut y = 1;
    for (name, tag) in [("PV", Some(faceplate.pv)), ("SV", Some(faceplate.sv_to_show())), ("MV", faceplate.mv)] {
        let Some(tag) = tag else { continue };
        canvas.text(0, y, name, theme.dim());
        put_value(cx, &mut canvas, 4, y, tag, at.width.saturating_sub(4));
        if let Some(words) = sv_difference(cx, faceplate).filter(|_| tag == faceplate.sv_to_show()) {
            canvas.text_right(at.width, y, &words, theme.strong());
        }
        y += 1;
    }
    if at.height > 7 {
        y += 1;
        scale(cx, &mut canvas, y, faceplate.pv);
        y += 1;
    }
    bar(cx, &mut canvas, y, faceplate);
    let tags: Vec<TagId> = [faceplate.mode, faceplate.tune, faceplate.run].into_iter().flatten().collect();
    let mut x = 0;
    for tag in tags {
        let shown = value::show(cx, tag);
        if Some(tag) == faceplate.tune {
            x = canvas.text(x, y + 1, t!("AT"), theme.dim()) + 1;
        }
        let room = canvas.width().saturating_sub(x);
        x = canvas.text(x, y + 1, &shown.bare(room), shown.style) + 2;
    }
}

/// `set 70.0`, where the controller works towards something else: a program or a ramp moves it.
pub fn sv_difference(cx: &ViewContext, faceplate: &Faceplate) -> Option<String> {
    let value = |tag| cx.snapshot.sample(tag).good_value();
    let set = value(faceplate.sv).filter(|set| value(faceplate.sv_to_show()) != Some(*set))?;
    Some(t!("set {format}", format = cx.snapshot.format(faceplate.sv, set)))
}

/// The ends of the range above the bar.
fn scale(cx: &ViewContext, canvas: &mut Canvas, y: u16, pv: TagId) {
    let Some((min, max)) = cx.snapshot.range(pv) else { return };
    let end = canvas.width();
    let (low, high) =
        (cx.snapshot.format(pv, min), format!("{} {}", cx.snapshot.format(pv, max), cx.snapshot.unit(pv)));
    if width(&low) + 1 + width(&high) <= end {
        canvas.text(0, y, &low, cx.theme.dim());
        canvas.text_right(end, y, &high, cx.theme.dim());
    }
}

/// `├───┃────▼──█──┃────┤`: PV filled, SV as a triangle, alarm limits as bars. Without a good PV the bar has no PV.
fn bar(cx: &ViewContext, canvas: &mut Canvas, y: u16, faceplate: &Faceplate) {
    let theme = cx.theme;
    let inner = canvas.width().saturating_sub(2);
    canvas.run(0, y, inner + 2, '─', theme.dim());
    canvas.glyph(0, y, '├', theme.dim());
    canvas.glyph(inner + 1, y, '┤', theme.dim());
    let Some((min, max)) = cx.snapshot.range(faceplate.pv) else { return };
    let column = |value: f64| {
        let share = (value - min) / (max - min);
        share.is_finite().then(|| 1 + to_u16((share.clamp(0.0, 1.0) * f64::from(inner.saturating_sub(1))).round()))
    };
    for (limit, _) in limits(cx, faceplate.pv) {
        if let Some(x) = column(limit) {
            canvas.glyph(x, y, '┃', theme.normal());
        }
    }
    if let Some(x) = cx.snapshot.sample(faceplate.sv_to_show()).good_value().and_then(column) {
        canvas.glyph(x, y, '▼', theme.set_value());
    }
    if let Some(x) = cx.snapshot.sample(faceplate.pv).good_value().and_then(column) {
        // Never reversed: a reversed full block is an empty one.
        let style =
            alarm_mark(cx, faceplate.pv).map_or(theme.strong(), |(_, style)| style.remove_modifier(Modifier::REVERSED));
        canvas.glyph(x, y, '█', style);
    }
}

#[derive(Debug, Clone, Copy)]
pub struct Sequence<'a> {
    pub label: &'a str,
    /// The step; its labels are the steps.
    pub step: TagId,
    /// Seconds left.
    pub remaining: Option<TagId>,
    /// Shown below.
    pub states: &'a [TagId],
}

impl Sequence<'_> {
    /// Draws heading, steps with the present one marked, and states.
    pub fn view(&self, cx: &ViewContext, canvas: &mut Canvas, at: Bounds, selected: bool) {
        let theme = cx.theme;
        let mut canvas = canvas.part(at.x, at.y, at.width, at.height);
        let x = canvas.text(0, 0, self.label, label_style(cx, selected));
        let shown = value::show(cx, self.step);
        let x = canvas.text(x + 2, 0, &shown.text, if shown.note.is_empty() { theme.strong() } else { shown.style });
        // A step without a time of its own has nothing left to tell.
        let untimed = |left: &TagId| cx.snapshot.sample(*left).good_value() == Some(0.0);
        if let Some(left) = self.remaining.filter(|left| !untimed(left)) {
            let text = match cx.snapshot.sample(left).good_value() {
                Some(seconds) if seconds >= 0.0 => {
                    t!("{running} left", running = running(std::time::Duration::from_secs_f64(seconds.min(1e7))))
                }
                Some(_) | None => t!("{text} left", text = value::show(cx, left).text),
            };
            let room = canvas.width().saturating_sub(x + 1);
            let end = canvas.width();
            canvas.text_right(end, 0, &whole(&text, room), theme.normal());
        }
        let last = at.height.saturating_sub(1).max(1);
        let rows = self.steps(cx, &mut canvas.part(0, 1, at.width, last.saturating_sub(1)));
        states(cx, &mut canvas, (rows + 2).min(last), self.states);
    }

    /// Draws the steps; returns the rows that they take.
    fn steps(&self, cx: &ViewContext, canvas: &mut Canvas) -> u16 {
        let theme = cx.theme;
        let now = cx.snapshot.sample(self.step).good_value();
        let (mut x, mut y) = (0, 0);
        for (number, name) in &cx.def().tag(self.step).enum_labels {
            let name = of_plant(name);
            let present = now == Some(*number as f64);
            let text =
                if present { format!("{}{name}", theme.pick("▸", ">")) } else { format!(" {}", name.to_lowercase()) };
            let text = fit(&text, canvas.width());
            if x + width(&text) > canvas.width() {
                (x, y) = (0, y + 1);
            }
            x = canvas.text(x, y, &text, if present { theme.strong() } else { theme.dim() }) + 1;
        }
        y + 1
    }
}
