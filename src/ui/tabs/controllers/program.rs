//! The ramp/soak program as a table and as a curve, with the place where it is now.

use super::device::signal_mark;
use crate::ui::tabs::prelude::*;
use crate::{
    history::{Bucket, Series},
    plant::{def::ProgramDef, program::ProgramPosition},
    ui::widgets::mimic::trend,
};

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Cell {
    /// Step, from 0.
    pub row: usize,
    /// Target, ramp, soak.
    pub column: usize,
}

/// Columns of a cell of the table.
const CELL: u16 = 12;

impl Cell {
    pub fn tag(self, program: &ProgramDef) -> Option<TagId> {
        let step = program.steps.get(self.row)?;
        [step.sv, step.ramp, step.soak].get(self.column).copied()
    }
    /// So many columns to the right.
    pub fn turn(&mut self, by: isize) {
        self.column = self.column.saturating_add_signed(by).min(2);
    }
}

pub fn view(cx: &ViewContext, canvas: &mut Canvas, device: &DeviceDef, program: &ProgramDef, cell: Cell) {
    let (wide, high) = (canvas.width(), canvas.height());
    heading(cx, canvas, device, program);
    let rows = to_u16(program.steps.len());
    // The table and what it says of the present; the curve below takes the rest.
    table(cx, &mut canvas.part(0, 2, 54, rows + 1), program, cell);
    facts(cx, &mut canvas.part(56, 2, wide.saturating_sub(57), rows + 1), device, program);
    let top = rows + 4;
    curve(cx, &mut canvas.part(1, top, wide.saturating_sub(2), high.saturating_sub(top)), device, program);
}

fn heading(cx: &ViewContext, canvas: &mut Canvas, device: &DeviceDef, program: &ProgramDef) {
    let theme = cx.theme;
    let x = canvas.text(1, 0, &device.name, theme.focus());
    let x = canvas.text(x + 2, 0, t!("ramp/soak program"), theme.normal());
    let (words, style) = match cx.snapshot.device(device.id).diagnosis {
        Some(reason) => (format!("{} {reason}", signal_mark(reason.signal())), theme.trouble()),
        None => (now_text(cx, device, program), theme.strong()),
    };
    canvas.text(x + 3, 0, &fit_words(&words, canvas.width().saturating_sub(x + 4)), style);
}

/// `RUN, ramp 2, 03:12 of 10 min`.
pub fn now_text(cx: &ViewContext, device: &DeviceDef, program: &ProgramDef) -> String {
    let command = value::show(cx, program.command).text;
    let Some(place) = place(cx, program) else { return t!("{command}, position unknown", command) };
    let (what, length) = match place {
        ProgramPosition::Off => return command,
        ProgramPosition::Ended => return t!("{command}, ended", command),
        ProgramPosition::Ramp(step) => (t!("ramp {step}", step = step + 1), program.steps[step].ramp),
        ProgramPosition::Soak(step) => (t!("soak {step}", step = step + 1), program.steps[step].soak),
    };
    let into = cx.snapshot.programs.get(device.id.index()).copied().flatten();
    let into = match into {
        Some((into, true)) => running(into),
        // Its beginning was not seen.
        Some((into, false)) => t!("more than {running}", running = running(into)),
        None => "?".to_owned(),
    };
    t!("{command}, {what}, {into} of {with_unit}", command, what, into, with_unit = value::show(cx, length).with_unit())
}

fn place(cx: &ViewContext, program: &ProgramDef) -> Option<ProgramPosition> {
    cx.snapshot.sample(program.position).good_value().map(|position| program.place(position))
}

/// The steps that the pattern runs, from 0.
fn chosen(cx: &ViewContext, program: &ProgramDef) -> Option<(usize, usize)> {
    program.steps_of(program.pattern.and_then(|pattern| cx.snapshot.sample(pattern).good_value()))
}

fn table(cx: &ViewContext, canvas: &mut Canvas, program: &ProgramDef, cell: Cell) {
    let theme = cx.theme;
    let names = [t!("target"), t!("ramp"), t!("soak")].map(|name| pad_left(name, CELL));
    canvas.text(1, 0, &format!("{} {}", pad(t!("step"), 6), names.join(" ")), theme.dim());
    let (now, chosen) = (place(cx, program), chosen(cx, program));
    for (row, step) in program.steps.iter().enumerate() {
        let y = to_u16(row) + 1;
        let runs = chosen.is_none_or(|(first, last)| (first..=last).contains(&row));
        let style = if runs { theme.normal() } else { theme.dim() };
        let here = matches!(now, Some(ProgramPosition::Ramp(at) | ProgramPosition::Soak(at)) if at == row);
        let mark = if here { theme.pick("▸", ">") } else { " " };
        canvas.text(1, y, &format!("{mark} {}", row + 1), if here { theme.strong() } else { style });
        for (column, tag) in [step.sv, step.ramp, step.soak].into_iter().enumerate() {
            let shown = value::show(cx, tag);
            let x = 8 + to_u16(column) * (CELL + 1);
            let at = (now == Some(ProgramPosition::Ramp(row)) && column == 1)
                || (now == Some(ProgramPosition::Soak(row)) && column == 2);
            let text = format!("{}{}", if at { theme.pick("▸", ">") } else { "" }, shown.within(CELL - 1));
            let style = match (cell == Cell { row, column }, at) {
                (true, _) => theme.focus(),
                (false, true) => theme.strong(),
                (false, false) if cx.snapshot.sample(tag).quality.is_good() => style,
                (false, false) => shown.style,
            };
            canvas.text(x, y, &pad_left(&text, CELL), style);
        }
        if !runs {
            canvas.text(8 + 3 * (CELL + 1), y, t!("not run"), theme.dim());
        }
    }
}

/// What the program does besides its steps.
fn facts(cx: &ViewContext, canvas: &mut Canvas, device: &DeviceDef, program: &ProgramDef) {
    let sv = device.faceplate.as_ref().map(|faceplate| faceplate.sv_to_show());
    let pv = device.faceplate.as_ref().map(|faceplate| faceplate.pv);
    let rows = [
        (t!("command"), Some(program.command)),
        (t!("pattern"), program.pattern),
        (t!("mode"), program.mode),
        ("PV", pv),
        ("SV", sv),
    ];
    for (y, (name, tag)) in rows.into_iter().filter_map(|(name, tag)| Some((name, tag?))).enumerate() {
        let shown = value::show(cx, tag);
        canvas.text(0, to_u16(y), &pad(name, 8), cx.theme.dim());
        let room = canvas.width().saturating_sub(9);
        canvas.text(9, to_u16(y), &shown.within(room), shown.style);
    }
    canvas.text(0, 6, t!("r run   p hold   o off"), cx.theme.strong());
}

/// One straight piece of the curve: how long, from where (`None`: unknown), to where, and which place it is.
struct Segment {
    minutes: f64,
    from: Option<f64>,
    to: f64,
    place: ProgramPosition,
}

/// The way of the setpoint, from PV as it is now; `None` while a part of it is not known.
fn segments(cx: &ViewContext, device: &DeviceDef, program: &ProgramDef) -> Option<Vec<Segment>> {
    let (first, last) = chosen(cx, program)?;
    let trusted = |tag: TagId| cx.snapshot.sample(tag).good_value();
    // A ramp begins where the step before has ended; the first at PV as it is at the start. Once it runs that is past,
    // and the device does not report it: the first ramp is a gap then.
    let resting = matches!(place(cx, program), Some(ProgramPosition::Off | ProgramPosition::Ended));
    let mut from = device.faceplate.as_ref().and_then(|faceplate| trusted(faceplate.pv)).filter(|_| resting);
    let mut segments = Vec::new();
    for (n, step) in program.steps.iter().enumerate().take(last + 1).skip(first) {
        let (to, ramp, soak) = (trusted(step.sv)?, trusted(step.ramp)?, trusted(step.soak)?);
        segments.push(Segment { minutes: ramp.max(0.0), from, to, place: ProgramPosition::Ramp(n) });
        segments.push(Segment { minutes: soak.max(0.0), from: Some(to), to, place: ProgramPosition::Soak(n) });
        from = Some(to);
    }
    Some(segments)
}

fn curve(cx: &ViewContext, canvas: &mut Canvas, device: &DeviceDef, program: &ProgramDef) {
    let theme = cx.theme;
    let Some(segments) = segments(cx, device, program) else {
        canvas.text(0, 0, t!("no curve: a target or time of the program is unknown"), theme.dim());
        return;
    };
    let total: f64 = segments.iter().map(|segment| segment.minutes).sum();
    if total <= 0.0 {
        canvas.text(0, 0, t!("no curve: all times of the chosen steps are 0"), theme.dim());
        return;
    }
    let (low, high) = segments
        .iter()
        .flat_map(|segment| segment.from.into_iter().chain([segment.to]))
        .fold((f64::MAX, f64::MIN), |(low, high), sv| (low.min(sv), high.max(sv)));
    let step = program.steps[0];
    let label = |value: f64| cx.snapshot.format(step.sv, value);
    let gutter = width(&label(low)).max(width(&label(high))) + 1;
    let (wide, high_rows) = (canvas.width().saturating_sub(gutter), canvas.height().saturating_sub(1));
    if wide < 10 || high_rows < 2 {
        return;
    }
    canvas.text(0, 0, &pad_left(&label(high), gutter - 1), theme.dim());
    canvas.text(0, high_rows - 1, &pad_left(&label(low), gutter - 1), theme.dim());
    let dots = usize::from(wide) * 2;
    let series = way(step.sv, &segments, total, dots, cx);
    let mut plot = canvas.part(gutter, 0, wide, high_rows);
    trend::curve(&mut plot, &series, (low, high.max(low + 0.1)), theme.glyphs, theme.set_value());
    axis(cx, &mut canvas.part(gutter, high_rows, wide, 1), device, program, &segments, total);
}

/// The way as a curve of so many columns.
fn way(tag: TagId, segments: &[Segment], total: f64, dots: usize, cx: &ViewContext) -> Series {
    let at = |minute: f64| {
        let mut left = minute;
        for segment in segments {
            if left <= segment.minutes && segment.minutes > 0.0 {
                return segment.from.map(|from| from + (segment.to - from) * left / segment.minutes);
            }
            left -= segment.minutes;
        }
        segments.last().map(|segment| segment.to)
    };
    let each = total / dots as f64;
    let bucket = |n: usize| {
        let (a, b) = (at(n as f64 * each)?, at((n + 1) as f64 * each)?);
        Some(Bucket { min: a.min(b), max: a.max(b), mean: (a + b) / 2.0, last: b.into() })
    };
    let buckets = (0..dots).map(bucket).collect();
    Series {
        tag,
        from: cx.now,
        step: Duration::from_secs_f64(each * 60.0),
        buckets,
        summary: None,
        counted: None,
        good: 1.0,
    }
}

/// Time below the curve, with a mark where the program is.
fn axis(
    cx: &ViewContext,
    canvas: &mut Canvas,
    device: &DeviceDef,
    program: &ProgramDef,
    segments: &[Segment],
    total: f64,
) {
    let theme = cx.theme;
    let unit = cx.snapshot.unit(program.steps[0].ramp).to_owned();
    canvas.run(0, 0, canvas.width(), '─', theme.dim());
    canvas.text(0, 0, "0", theme.dim());
    let end = canvas.width();
    canvas.text_right(end, 0, &format!(" {total} {unit}"), theme.dim());
    let Some(now) = place(cx, program) else { return };
    let Some(segment) = segments.iter().position(|segment| segment.place == now) else { return };
    let before: f64 = segments[..segment].iter().map(|segment| segment.minutes).sum();
    let into = cx.snapshot.programs.get(device.id.index()).copied().flatten().map_or(0.0, |(into, _)| {
        // Times are in the unit of the device; minutes unless it says seconds.
        into.as_secs_f64() / seconds_of(&unit)
    });
    let share = (before + into.min(segments[segment].minutes)) / total;
    let x = to_u16((share.clamp(0.0, 1.0) * f64::from(canvas.width().saturating_sub(1))).round());
    canvas.glyph(x, 0, '▲', theme.strong());
    canvas.text(if x + 6 < end { x + 1 } else { x.saturating_sub(4) }, 0, t!(" now"), theme.strong());
}

fn seconds_of(unit: &str) -> f64 {
    match unit {
        "s" => 1.0,
        "h" => 3_600.0,
        _ => 60.0,
    }
}
