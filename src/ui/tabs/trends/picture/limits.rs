//! The limits on the page: their lines, and their names where no curve runs through them.

use super::*;

/// Draws those that lie on the scale of their curve.
pub(super) fn draw(page: &mut Drawing, cx: &ViewContext, chart: &Chart, scales: &[(Axis, Scale)], frame: &Frame) {
    let (left, right) = (frame.left + 4.0, frame.right - 4.0);
    for limit in &chart.limits {
        let Some((_, scale)) = scales.get(limit.curve) else { continue };
        if !(scale.low..=scale.high).contains(&limit.value) {
            continue;
        }
        let (y, high) = (frame.y(*scale, limit.value), frame.text.0);
        page.line(vec![(frame.left, y), (frame.right, y)], Ink::Text, frame.thick(0.7), true);
        let wide = limit.text.width() as f32 * frame.text.1;
        let is_free = |end: &f32| !is_crossed(cx, chart, scales, frame, (*end - wide, *end), (y - high, y));
        let ends = [right, left + wide, f32::midpoint(left + wide, right)];
        let end = ends.into_iter().find(is_free).unwrap_or(right);
        page.text((end, y - high / 2.0), Anchor::End, limit.text.as_str(), Ink::Text);
    }
}

/// Does a curve run through this part of the page?
fn is_crossed(
    cx: &ViewContext,
    chart: &Chart,
    scales: &[(Axis, Scale)],
    frame: &Frame,
    (from, to): (f32, f32),
    (above, below): (f32, f32),
) -> bool {
    let count = usize::from(PAGE.0);
    chart.curves.iter().zip(scales).any(|(curve, (_, scale))| {
        let columns = curve.trace.columns(frame.from, frame.to, cx.present(), count);
        let mut held = None;
        columns.iter().enumerate().any(|(n, span)| {
            let before = std::mem::replace(&mut held, span.map(|span| span.last));
            let Some(span) = span.filter(|_| (from..=to).contains(&frame.column(n, count))) else { return false };
            // A step goes from the value before it.
            let before = before.unwrap_or(span.last);
            let (least, most) = (span.min.min(before), span.max.max(before));
            frame.y(*scale, most) <= below && above <= frame.y(*scale, least)
        })
    })
}
