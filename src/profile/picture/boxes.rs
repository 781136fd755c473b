//! The boxes of a picture: vessels and frames, drawn in thin lines with a label in the upper edge.

use std::collections::BTreeSet;

use super::grid::Grid;
use crate::profile::diagnostic::Problems;

/// A closed box.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct BoxOutline {
    pub x: usize,
    pub y: usize,
    pub width: usize,
    pub height: usize,
    pub label: String,
}

/// Thin lines; `╞ ╡ ╥ …` are places where a pipe meets the edge.
const THIN: &str = "─│┌┐└┘├┤┬┴┼╭╮╰╯╞╡╪╤╧╥╨╫";
const ACROSS: &str = "─┬┴┼╤╧╥╨╫";
const DOWN: &str = "│├┤┼╞╡╪";
/// Most blanks side by side in a label.
const BLANKS_MAX: usize = 2;

/// Takes the boxes out of the grid, from the top; reports lines that belong to none.
pub(super) fn take(grid: &mut Grid, problems: &mut Problems) -> (Vec<BoxOutline>, BTreeSet<(usize, usize)>) {
    let (width, height) = grid.size();
    let cells = || (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    let (mut boxes, mut unclosed) = (Vec::new(), 0);
    for (x, y) in cells().filter(|(x, y)| "┌╭".contains(grid.get(*x, *y))) {
        match outline(grid, x, y) {
            Ok(found) => boxes.push(found),
            Err((at_x, at_y, expected)) => {
                unclosed += 1;
                let problem = problems.add(grid.span(x, y, 1), "the box that begins here is not closed");
                problem.label(format!("expected {expected} in row {}, column {} of the picture", at_y + 1, at_x + 1));
            }
        }
    }
    let edge: BTreeSet<(usize, usize)> = boxes.iter().flat_map(edge_cells).collect();
    let stray = cells().find(|(x, y)| THIN.contains(grid.get(*x, *y)) && !edge.contains(&(*x, *y)));
    // The rest of a box that is not closed is not reported again.
    if let Some((x, y)) = stray.filter(|_| unclosed == 0) {
        let problem = problems.add(grid.span(x, y, 1), "a thin line that belongs to no closed box");
        problem.label("pipes are drawn with ═ and ║");
    }
    edge.iter().for_each(|(x, y)| grid.clear(*x, *y, 1));
    (boxes, edge)
}

fn edge_cells(of: &BoxOutline) -> Vec<(usize, usize)> {
    let (right, bottom) = (of.x + of.width - 1, of.y + of.height - 1);
    let across = (of.x..=right).flat_map(|x| [(x, of.y), (x, bottom)]);
    across.chain((of.y..=bottom).flat_map(|y| [(of.x, y), (right, y)])).collect()
}

/// Follows the edges of a box from its upper left corner; else the first cell that is wrong, and what should stand there.
fn outline(grid: &Grid, x: usize, y: usize) -> Result<BoxOutline, (usize, usize, &'static str)> {
    let (width, height) = grid.size();
    let (mut right, mut blanks) = (x + 1, 0);
    while !"┐╮".contains(grid.get(right, y)) {
        let cell = grid.get(right, y);
        blanks = if cell == ' ' { blanks + 1 } else { 0 };
        if right >= width || blanks > BLANKS_MAX || (THIN.contains(cell) && !ACROSS.contains(cell)) {
            return Err((right.saturating_sub(blanks.saturating_sub(1)), y, "─ or ┐"));
        }
        right += 1;
    }
    let mut bottom = y + 1;
    while !"└╰".contains(grid.get(x, bottom)) {
        if bottom >= height || !DOWN.contains(grid.get(x, bottom)) {
            return Err((x, bottom, "│ or └"));
        }
        bottom += 1;
    }
    if let Some(row) = (y + 1..bottom).find(|row| !DOWN.contains(grid.get(right, *row))) {
        return Err((right, row, "│"));
    }
    if let Some(column) = (x + 1..right).find(|column| !ACROSS.contains(grid.get(*column, bottom))) {
        return Err((column, bottom, "─"));
    }
    if !"┘╯".contains(grid.get(right, bottom)) {
        return Err((right, bottom, "┘"));
    }
    let label: String = grid.text(y, x + 1, right).chars().filter(|letter| !ACROSS.contains(*letter)).collect();
    Ok(BoxOutline { x, y, width: right - x + 1, height: bottom - y + 1, label: label.trim().to_owned() })
}
