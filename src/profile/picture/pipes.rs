//! The pipes of a picture: double lines that are followed through valves and pumps from end to end.

use std::collections::{BTreeMap, BTreeSet};

use super::grid::Grid;
use crate::profile::diagnostic::Problems;

/// Column and row.
pub(super) type Point = (usize, usize);

/// The branches of a cell: right 1, down 2, left 4, up 8.
const RIGHT: u8 = 1;
const DOWN: u8 = 2;
const LEFT: u8 = 4;
const UP: u8 = 8;
const BRANCHES: [u8; 4] = [RIGHT, DOWN, LEFT, UP];

const PIPES: [(char, u8); 11] = [
    ('═', RIGHT | LEFT),
    ('║', DOWN | UP),
    ('╔', RIGHT | DOWN),
    ('╗', LEFT | DOWN),
    ('╚', RIGHT | UP),
    ('╝', LEFT | UP),
    ('╠', RIGHT | DOWN | UP),
    ('╣', LEFT | DOWN | UP),
    ('╦', RIGHT | DOWN | LEFT),
    ('╩', RIGHT | LEFT | UP),
    ('╬', RIGHT | DOWN | LEFT | UP),
];

/// Arrows, which are pipe only in line with other pipe.
const ARROWS: [(char, u8); 8] =
    [('►', RIGHT), ('>', RIGHT), ('▼', DOWN), ('v', DOWN), ('◄', LEFT), ('<', LEFT), ('▲', UP), ('^', UP)];

/// One stretch of pipe between two ends or joints.
#[derive(Debug, Default, PartialEq, Eq)]
pub(super) struct PipeRun {
    /// Its corners in the direction of the flow.
    pub points: Vec<Point>,
    /// The symbols that it runs through, by their numbers.
    pub through: Vec<usize>,
    /// An arrow says which way it flows.
    pub directed: bool,
}

/// All pipes of a picture.
#[derive(Debug, Default)]
pub(super) struct Pipes {
    pub runs: Vec<PipeRun>,
    /// Cells with three or four branches, and pieces of a single cell.
    pub joints: Vec<(Point, u8)>,
    /// All cells of pipe.
    pub cells: BTreeSet<Point>,
    /// Symbols that stand in an upright pipe, by their numbers.
    pub upright: BTreeSet<usize>,
}

/// A symbol in its row.
#[derive(Debug, Clone, Copy)]
pub(super) struct Crossing {
    /// Its number.
    pub symbol: usize,
    /// The columns that it takes.
    pub first: usize,
    pub last: usize,
    /// It is part of its pipe: a valve, a pump.
    pub inline: bool,
}

/// What pipes meet on their way.
pub(super) struct Surroundings<'a> {
    /// The symbol of each cell.
    pub symbols: &'a BTreeMap<Point, Crossing>,
    /// Edges of boxes.
    pub edges: &'a BTreeSet<Point>,
    /// Cells that areas (trends, controllers) cover.
    pub areas: &'a BTreeSet<Point>,
}

/// Takes the pipes out of the grid; reports gaps and arrows that contradict each other.
pub(super) fn take(grid: &mut Grid, around: &Surroundings, problems: &mut Problems) -> Pipes {
    let mut tracer = Tracer { cells: pipe_cells(grid), grid, around, seen: BTreeSet::new() };
    let mut pipes = Pipes::default();
    let starts: Vec<(Point, u8)> = tracer.cells.iter().map(|(point, branches)| (*point, *branches)).collect();
    for (point, branches) in &starts {
        if branches.count_ones() > 2 {
            pipes.joints.push((*point, *branches));
        }
        tracer.check_ends(*point, *branches, problems);
    }
    // From ends and joints first; what is left runs in a circle.
    let is_end = |tracer: &Tracer, (point, branches): &(Point, u8)| {
        let joined =
            BRANCHES.iter().filter(|way| *branches & **way != 0 && tracer.next(*point, **way).is_some()).count();
        joined != 2 || branches.count_ones() > 2
    };
    let (ends, rest): (Vec<_>, Vec<_>) = starts.iter().copied().partition(|start| is_end(&tracer, start));
    for (point, branches) in ends.into_iter().chain(rest) {
        let ways: Vec<u8> = BRANCHES.into_iter().filter(|way| branches & way != 0).collect();
        let joined: Vec<u8> = ways.into_iter().filter(|way| tracer.next(point, *way).is_some()).collect();
        if joined.is_empty() && branches.count_ones() == 2 {
            match tracer.single(point, branches) {
                Some(run) => pipes.runs.push(run),
                None => pipes.joints.push((point, branches)),
            }
        }
        for way in joined {
            pipes.runs.extend(tracer.run(point, way, problems));
        }
    }
    for ((x, y), crossing) in around.symbols.iter().filter(|((x, _), crossing)| *x == crossing.first) {
        let has = |cell: Option<Point>, way: u8| {
            cell.and_then(|cell| tracer.cells.get(&cell)).is_some_and(|branches| branches & way != 0)
        };
        if has(ahead((*x, *y), UP, 1), DOWN) || has(ahead((*x, *y), DOWN, 1), UP) {
            pipes.upright.insert(crossing.symbol);
        }
    }
    pipes.cells = tracer.cells.keys().copied().collect();
    pipes.cells.iter().for_each(|(x, y)| grid.clear(*x, *y, 1));
    pipes
}

fn branches(cell: char) -> Option<u8> {
    PIPES.iter().find(|(pipe, _)| *pipe == cell).map(|(_, branches)| *branches)
}

fn arrow(cell: char) -> Option<u8> {
    ARROWS.iter().find(|(arrow, _)| *arrow == cell).map(|(_, way)| *way)
}

fn pipe_cells(grid: &Grid) -> BTreeMap<Point, u8> {
    let (width, height) = grid.size();
    let has = |x: Option<usize>, y: Option<usize>, way: u8| {
        x.zip(y).is_some_and(|(x, y)| branches(grid.get(x, y)).is_some_and(|branches| branches & way != 0))
    };
    let mut cells = BTreeMap::new();
    for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
        if let Some(branches) = branches(grid.get(x, y)) {
            cells.insert((x, y), branches);
        }
        let Some(way) = arrow(grid.get(x, y)) else { continue };
        let across = has(x.checked_sub(1), Some(y), RIGHT) || has(Some(x + 1), Some(y), LEFT);
        let down = has(Some(x), y.checked_sub(1), DOWN) || has(Some(x), Some(y + 1), UP);
        // A letter is an arrow only beside pipe.
        let sign = "►◄▲▼".contains(grid.get(x, y));
        match way {
            RIGHT | LEFT if across || sign => cells.insert((x, y), RIGHT | LEFT),
            DOWN | UP if down || sign => cells.insert((x, y), DOWN | UP),
            _ => None,
        };
    }
    cells
}

fn opposite(way: u8) -> u8 {
    if way > DOWN { way >> 2 } else { way << 2 }
}

/// The cell this many further on; `None` left of or above the picture.
fn ahead((x, y): Point, way: u8, by: usize) -> Option<Point> {
    match way {
        RIGHT => Some((x + by, y)),
        DOWN => Some((x, y + by)),
        LEFT => Some((x.checked_sub(by)?, y)),
        _ => Some((x, y.checked_sub(by)?)),
    }
}

/// The last cell of a symbol for a pipe that comes from this side: a pipe runs along a symbol in its row; from above or
/// below it meets the first column, and none of the others.
fn far_cell(at: Point, way: u8, crossing: &Crossing) -> Option<Point> {
    match way {
        RIGHT => Some((crossing.last, at.1)),
        LEFT => Some((crossing.first, at.1)),
        _ => Some(at).filter(|at| at.0 == crossing.first),
    }
}

struct Tracer<'a> {
    cells: BTreeMap<Point, u8>,
    grid: &'a Grid,
    around: &'a Surroundings<'a>,
    /// Branches that a run has taken.
    seen: BTreeSet<(Point, u8)>,
}

impl Tracer<'_> {
    /// The next cell of pipe on this branch, through symbols in between; with these.
    fn next(&self, from: Point, way: u8) -> Option<(Point, Vec<usize>)> {
        let mut through = Vec::new();
        let mut at = ahead(from, way, 1)?;
        while let Some(crossing) = self.around.symbols.get(&at) {
            at = ahead(far_cell(at, way, crossing)?, way, 1)?;
            through.push(crossing.symbol);
        }
        let joins = self.cells.get(&at).is_some_and(|branches| branches & opposite(way) != 0);
        joins.then_some((at, through))
    }

    /// Reports the branches of a cell that lead nowhere.
    fn check_ends(&self, point: Point, branches: u8, problems: &mut Problems) {
        let (width, height) = self.grid.size();
        for way in BRANCHES.into_iter().filter(|way| branches & way != 0) {
            let Some((x, y)) = ahead(point, way, 1).filter(|(x, y)| *x < width && *y < height) else { continue };
            let touches = self.next(point, way).is_some()
                || [self.around.edges.contains(&(x, y)), self.around.areas.contains(&(x, y))].contains(&true)
                || self.around.symbols.contains_key(&(x, y));
            let cell = self.grid.get(x, y);
            // A word may stand a blank away from the arrow that leads to it.
            let word = [Some((x, y)), ahead(point, way, 2)]
                .into_iter()
                .flatten()
                .any(|place| self.grid.get(place.0, place.1) != ' ' && !self.cells.contains_key(&place));
            if touches || word {
                continue;
            }
            let problem = problems.add(self.grid.span(point.0, point.1, 1), "a gap in a pipe: it ends here");
            let place = format!("column {}, row {} of the picture", x + 1, y + 1);
            match self.cells.contains_key(&(x, y)) {
                true => problem.label(format!("`{cell}` in {place} has no branch to it")),
                false => problem.label(format!("expected pipe, a symbol, a box or a word in {place}")),
            };
        }
    }

    /// Where a pipe ends that leads to the branch of a cell: at the far side of a valve or pump, else in the cell.
    fn end(&self, from: Point, way: u8) -> (Point, Option<usize>) {
        let crossing = ahead(from, way, 1).and_then(|at| Some((at, self.around.symbols.get(&at)?)));
        match crossing {
            Some((at, crossing)) if crossing.inline => {
                (far_cell(at, way, crossing).unwrap_or(from), Some(crossing.symbol))
            }
            Some((_, crossing)) => (from, Some(crossing.symbol)),
            None => (from, None),
        }
    }

    /// A piece of one cell with its valve or pump; `None` without one.
    fn single(&self, point: Point, branches: u8) -> Option<PipeRun> {
        let ways: Vec<u8> = BRANCHES.into_iter().filter(|way| branches & way != 0).collect();
        let ends: Vec<(Point, Option<usize>)> = ways.iter().map(|way| self.end(point, *way)).collect();
        let mut points: Vec<Point> = vec![ends.first()?.0, ends.last()?.0];
        let arrow = arrow(self.grid.get(point.0, point.1));
        if arrow == ways.first().copied() {
            points.reverse();
        }
        let through = ends.iter().filter_map(|(_, symbol)| *symbol).collect();
        (points[0] != points[1]).then_some(PipeRun { points, through, directed: arrow.is_some() })
    }

    /// The run that begins on a branch of a cell; `None` if another one has come from its far end.
    fn run(&mut self, from: Point, way: u8, problems: &mut Problems) -> Option<PipeRun> {
        if self.seen.contains(&(from, way)) {
            return None;
        }
        let (mut at, mut way) = (from, way);
        let mut run = PipeRun::default();
        let mut arrows: Vec<(Point, bool)> = Vec::new();
        let back = self.cells.get(&from).map_or(0, |branches| branches & !way);
        if back.count_ones() == 1 {
            let (start, touched) = self.end(from, back);
            run.through.extend(touched);
            run.points.extend([start].into_iter().filter(|start| *start != from && back != opposite(way)));
            run.points.push(if back == opposite(way) { start } else { from });
            arrows.extend(arrow(self.grid.get(from.0, from.1)).map(|arrow| (from, arrow == way)));
        } else {
            run.points.push(from);
        }
        while let Some((next, through)) = self.next(at, way) {
            self.seen.extend([(at, way), (next, opposite(way))]);
            run.through.extend(through);
            at = next;
            let branches = self.cells.get(&at).copied().unwrap_or(0);
            if branches.count_ones() > 2 {
                way = 0;
                break;
            }
            let onward = branches & !opposite(way);
            arrows.extend(arrow(self.grid.get(at.0, at.1)).map(|arrow| (at, arrow == onward)));
            if onward != way {
                run.points.push(at);
            }
            way = onward;
            if self.seen.contains(&(at, way)) {
                break;
            }
        }
        let (end, touched) = if way == 0 { (at, None) } else { self.end(at, way) };
        run.through.extend(touched);
        if run.points.last() != Some(&end) || run.points.len() == 1 {
            run.points.push(end);
        }
        run.through.sort_unstable();
        run.through.dedup();
        if let Some(((x, y), _)) = arrows.iter().find(|(_, along)| *along != arrows[0].1) {
            problems.add(self.grid.span(*x, *y, 1), "arrows of one pipe point against each other").label("this one");
        }
        run.directed = !arrows.is_empty();
        if arrows.first().is_some_and(|(_, along)| !along) {
            run.points.reverse();
        }
        Some(run)
    }
}
