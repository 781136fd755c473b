//! A pipe: arrows travel along it only while every flow tag is on and good.

use super::CanvasScale;
use crate::{
    plant::def::TagId,
    ui::{
        ViewContext,
        widgets::{text::Canvas, value},
    },
};

/// One arrow in this many cells.
const ARROW_CELLS: usize = 5;

/// One cell of a pipe: column, row, and the directions in and out of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Step {
    x: u16,
    y: u16,
    from: Way,
    to: Way,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Way {
    Right,
    Left,
    Down,
    Up,
}

/// Draws a pipe along its nominal points; `arrows` while its direction is known, `motion` lets them travel.
pub fn view(
    cx: &ViewContext,
    canvas: &mut Canvas,
    points: &[(u16, u16)],
    flow: &[Vec<TagId>],
    scale: CanvasScale,
    (arrows, motion): (bool, bool),
    joints: &[(u16, u16)],
) {
    let all_on = |tags: &Vec<TagId>| {
        let on = tags.iter().map(|tag| value::is_on(cx, *tag));
        on.reduce(|all, on| Some(all? & on?)).flatten()
    };
    let states: Vec<Option<bool>> = flow.iter().map(all_on).collect();
    // One that flows is enough; else one that is unknown could.
    let flowing = match states.contains(&Some(true)) {
        true => Some(true),
        false if states.is_empty() || states.contains(&None) => None,
        false => Some(false),
    };
    let style = match flowing {
        Some(true) => cx.theme.running(),
        Some(false) | None => cx.theme.dim(),
    };
    let steps = steps(points, scale, joints);
    let shift = if motion { cx.phase as usize / 2 } else { 0 };
    for (n, step) in steps.iter().enumerate() {
        let arrow =
            arrows && (n + ARROW_CELLS - shift % ARROW_CELLS) % ARROW_CELLS == ARROW_CELLS / 2 && step.from == step.to;
        let glyph = match flowing {
            Some(true) if arrow => arrow_head(step.to),
            Some(true) => bend(step.from, step.to, true),
            Some(false) => bend(step.from, step.to, false),
            None => unknown(step.from, step.to),
        };
        canvas.glyph(step.x, step.y, glyph, style);
    }
}

/// Draws the cell where pipes meet: branches right 1, down 2, left 4, up 8.
pub fn joint(cx: &ViewContext, canvas: &mut Canvas, (x, y): (u16, u16), branches: u8, scale: CanvasScale) {
    const JOINTS: [char; 16] = [' ', '─', '│', '┌', '─', '─', '┐', '┬', '│', '└', '│', '├', '┘', '┴', '┤', '┼'];
    let glyph = JOINTS[usize::from(branches & 15)];
    canvas.glyph(scale.middle_column(x), scale.middle_row(y), glyph, cx.theme.dim());
}

/// The cells of a pipe in the order of its flow. The ends reach to the edge of their nominal cells, so that they touch
/// what stands beside them at every size.
fn steps(points: &[(u16, u16)], scale: CanvasScale, joints: &[(u16, u16)]) -> Vec<Step> {
    let closed = points.first() == points.last();
    let met = |point: &(u16, u16)| closed || joints.contains(point);
    let middle = |(x, y): (u16, u16)| (scale.middle_column(x), scale.middle_row(y));
    let place = |(n, point): (usize, &(u16, u16))| match met(point) {
        true => middle(*point),
        false => corner(points, n, *point, scale),
    };
    let corners: Vec<(u16, u16)> = points.iter().enumerate().map(place).collect();
    let mut steps: Vec<Step> = Vec::new();
    for pair in corners.windows(2) {
        let ((x0, y0), (x1, y1)) = (pair[0], pair[1]);
        let Some(way) = way(pair[0], pair[1]) else { continue };
        let length = x0.abs_diff(x1).max(y0.abs_diff(y1));
        if let Some(last) = steps.last_mut() {
            last.to = way;
        }
        for n in u16::from(!steps.is_empty())..=length {
            let (x, y) = match way {
                Way::Right => (x0 + n, y0),
                Way::Left => (x0 - n, y0),
                Way::Down => (x0, y0 + n),
                Way::Up => (x0, y0 - n),
            };
            steps.push(Step { x, y, from: way, to: way });
        }
    }
    steps
}

/// A point of the pipe on the screen: the middle of its nominal cell, but at the ends the far edge along the pipe.
fn corner(points: &[(u16, u16)], n: usize, (x, y): (u16, u16), scale: CanvasScale) -> (u16, u16) {
    let (near_x, far_x) = (scale.column(x), scale.column(x + 1).saturating_sub(1));
    let (near_y, far_y) = (scale.row(y), scale.row(y + 1).saturating_sub(1));
    let (middle_x, middle_y) = (scale.middle_column(x), scale.middle_row(y));
    let starts = points.get(1).filter(|_| n == 0).and_then(|next| way((x, y), *next));
    let ends = (n > 0 && n + 1 == points.len()).then(|| way(points[n - 1], (x, y))).flatten();
    match (starts, ends) {
        (Some(Way::Right), _) | (_, Some(Way::Left)) => (near_x, middle_y),
        (Some(Way::Left), _) | (_, Some(Way::Right)) => (far_x, middle_y),
        (Some(Way::Down), _) | (_, Some(Way::Up)) => (middle_x, near_y),
        (Some(Way::Up), _) | (_, Some(Way::Down)) => (middle_x, far_y),
        (None, None) => (middle_x, middle_y),
    }
}

/// The direction from one point to another; along the longer side if they are not in line, none if they are the same.
fn way((x0, y0): (u16, u16), (x1, y1): (u16, u16)) -> Option<Way> {
    match (x1.cmp(&x0), y1.cmp(&y0)) {
        (std::cmp::Ordering::Equal, std::cmp::Ordering::Equal) => None,
        (std::cmp::Ordering::Equal, std::cmp::Ordering::Greater) => Some(Way::Down),
        (std::cmp::Ordering::Equal, std::cmp::Ordering::Less) => Some(Way::Up),
        (std::cmp::Ordering::Greater, _) => Some(Way::Right),
        (std::cmp::Ordering::Less, _) => Some(Way::Left),
    }
}

fn arrow_head(way: Way) -> char {
    match way {
        Way::Right => '►',
        Way::Left => '◄',
        Way::Down => '▼',
        Way::Up => '▲',
    }
}

/// A straight or bent piece: heavy while it flows, light while it does not.
fn bend(from: Way, to: Way, heavy: bool) -> char {
    let (light, strong) = match (from, to) {
        (Way::Right, Way::Right) | (Way::Left, Way::Left) | (Way::Right, Way::Left) | (Way::Left, Way::Right) => {
            ('─', '━')
        }
        (Way::Down, Way::Down) | (Way::Up, Way::Up) | (Way::Down, Way::Up) | (Way::Up, Way::Down) => ('│', '┃'),
        (Way::Right, Way::Down) | (Way::Up, Way::Left) => ('┐', '┓'),
        (Way::Right, Way::Up) | (Way::Down, Way::Left) => ('┘', '┛'),
        (Way::Left, Way::Down) | (Way::Up, Way::Right) => ('┌', '┏'),
        (Way::Left, Way::Up) | (Way::Down, Way::Right) => ('└', '┗'),
    };
    if heavy { strong } else { light }
}

/// Unknown whether it flows.
fn unknown(from: Way, to: Way) -> char {
    match bend(from, to, false) {
        '─' => '╌',
        '│' => '┆',
        corner => corner,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ui::{
        fixture::{Fixture, with_cx},
        theme::Theme,
    };
    use ratatui::{buffer::Buffer, layout::Rect};

    const POINTS: [(u16, u16); 3] = [(0, 0), (9, 0), (9, 2)];

    fn drawn(fixture: &Fixture, phase: u32) -> Vec<String> {
        drawn_with(fixture, phase, &[vec![fixture.tag("PLC-1.SV-1")]])
    }

    fn drawn_with(fixture: &Fixture, phase: u32, flow: &[Vec<TagId>]) -> Vec<String> {
        let mut buffer = Buffer::empty(Rect::new(0, 0, 10, 3));
        let area = buffer.area;
        with_cx(&fixture.snapshot(), |cx| {
            let cx = ViewContext { phase, theme: &Theme::FULL, ..*cx };
            let mut canvas = Canvas::new(&mut buffer, area);
            view(&cx, &mut canvas, &POINTS, flow, CanvasScale::new((10, 3), (10, 3)), (true, true), &[]);
        });
        buffer.content.chunks(10).map(|row| row.iter().map(|cell| cell.symbol()).collect()).collect()
    }

    #[test]
    fn arrows_travel_while_it_flows() {
        let fixture = Fixture::normal();
        assert_eq!(drawn(&fixture, 0), ["━━►━━━━►━┓", "         ┃", "         ┃"]);
        assert_eq!(drawn(&fixture, 2), ["━━━►━━━━►┓", "         ┃", "         ┃"]);
    }

    #[test]
    fn nothing_moves_without_flow_or_without_knowing() {
        let mut fixture = Fixture::normal();
        fixture.set("PLC-1.SV-1", 0.0);
        let shut = ["─────────┐", "         │", "         │"];
        assert_eq!(drawn(&fixture, 0), shut);
        assert_eq!(drawn(&fixture, 7), shut);
        let unknown = ["╌╌╌╌╌╌╌╌╌┐", "         ┆", "         ┆"];
        assert_eq!(drawn(&Fixture::line_down(), 0), unknown);
        assert_eq!(drawn(&Fixture::line_down(), 7), unknown);
        let normal = Fixture::normal();
        assert_eq!(drawn_with(&normal, 0, &[]), unknown, "no tag says whether it flows");
        let shut = vec![fixture.tag("PLC-1.SV-1")];
        assert_eq!(drawn_with(&fixture, 0, &[shut.clone(), Vec::new()]), unknown, "the other way may flow");
        assert_eq!(drawn_with(&normal, 0, &[shut, Vec::new()])[0], "━━►━━━━►━┓", "one that flows is enough");
    }

    #[test]
    fn a_stretched_pipe_still_touches_its_ends() {
        let steps = steps(&[(2, 1), (4, 1), (4, 3)], CanvasScale::new((10, 5), (25, 15)), &[]);
        let (first, last) = (steps[0], steps[steps.len() - 1]);
        assert_eq!((first.x, last.y), (5, 11), "the left edge of column 2 and the lower edge of row 3");
        let met = super::steps(&[(2, 1), (4, 1)], CanvasScale::new((10, 5), (25, 15)), &[(4, 1)]);
        assert_eq!(met.last().map(|step| step.x), Some(11), "in the middle of the cell where pipes meet");
        assert!(steps.windows(2).all(|pair| pair[0].x.abs_diff(pair[1].x) + pair[0].y.abs_diff(pair[1].y) == 1));
    }
}
