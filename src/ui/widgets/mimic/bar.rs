//! A value on its range: a moving analog indicator with the limits of its alarms.

use ratatui::style::Modifier;

use super::{Bounds, alarm_mark, limits};
use crate::{
    plant::{
        def::{Level, TagId},
        number::to_u16,
    },
    ui::{ViewContext, widgets::text::Canvas},
};

/// Draws the range with the normal band (else what lies between the inner limits, if there are any), the limits and the good value: `░░▒▒▒▒◆▒▒╎░░`.
/// Upright it is filled up to the value. Without a good value it has none.
pub fn view(cx: &ViewContext, canvas: &mut Canvas, at: Bounds, tag: TagId, selected: bool) {
    indicator(cx, &mut canvas.part(at.x, at.y, at.width, at.height), tag, selected);
}

/// The same on a canvas of its own. The PV of a controller has its setpoint on it.
pub fn indicator(cx: &ViewContext, canvas: &mut Canvas, tag: TagId, selected: bool) {
    let (across, height) = (canvas.width(), canvas.height());
    let (theme, upright) = (cx.theme, height > 1);
    let length = if upright { height } else { across };
    let cell = |n: u16| if upright { (0, length - 1 - n) } else { (n, 0) };
    let dim = if selected { theme.focus() } else { theme.dim() };
    let across = if upright { across } else { 1 };
    let Some((min, max)) = cx.snapshot.range(tag) else { return };
    let place = |value: f64| {
        let share = (value - min) / (max - min);
        share.is_finite().then(|| to_u16((share.clamp(0.0, 1.0) * f64::from(length.saturating_sub(1))).round()))
    };
    let inner = |high: bool| limits(cx, tag).filter(move |(_, level)| is_high(*level) == high).map(|(limit, _)| limit);
    let inside = || {
        let has_limits = limits(cx, tag).next().is_some();
        has_limits.then(|| [inner(false).fold(min, f64::max), inner(true).fold(max, f64::min)])
    };
    // Where neither is given nothing says what is normal.
    let band = cx.def().tag(tag).normal.or_else(inside).and_then(|[low, high]| Some(place(low)?..=place(high)?));
    let value = cx.snapshot.sample(tag).good_value().and_then(place);
    for n in 0..length {
        let (x, y) = cell(n);
        let band = band.as_ref().is_some_and(|band| band.contains(&n));
        let filled = upright && value.is_some_and(|value| n <= value);
        let (glyph, style) = match (filled, band) {
            (true, _) => (theme.pick('█', '#'), theme.normal()),
            (false, true) => (theme.pick('▒', '='), dim),
            (false, false) => (theme.pick('░', '.'), dim),
        };
        canvas.run(x, y, across, glyph, style);
    }
    for (x, y) in limits(cx, tag).filter_map(|(limit, _)| place(limit)).map(cell) {
        let glyph = if upright { theme.pick('─', '-') } else { theme.pick('╎', '|') };
        canvas.run(x, y, across, glyph, theme.normal());
    }
    let faceplates = cx.def().devices.iter().filter_map(|device| device.faceplate.as_ref());
    let controller = faceplates.into_iter().find(|faceplate| faceplate.pv == tag && !upright);
    let sv = controller.and_then(|faceplate| cx.snapshot.sample(faceplate.sv_to_show()).good_value());
    if let Some((x, y)) = sv.and_then(place).map(cell) {
        canvas.glyph(x, y, theme.pick('▽', 'v'), theme.set_value());
    }
    if let Some((x, y)) = value.map(cell) {
        let style = alarm_mark(cx, tag).map_or(theme.strong(), |(_, style)| style.remove_modifier(Modifier::REVERSED));
        canvas.run(x, y, across, if upright { theme.pick('▀', '^') } else { theme.pick('◆', '*') }, style);
    }
}

fn is_high(level: Level) -> bool {
    match level {
        Level::High | Level::HighHigh => true,
        Level::Low | Level::LowLow => false,
    }
}
