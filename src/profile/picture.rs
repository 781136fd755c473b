//! A picture of the mimic, read from its text: boxes in thin lines, pipes in double lines, symbols in braces, words.

mod boxes;
mod grid;
mod pipes;
mod symbol;

use std::collections::{BTreeMap, BTreeSet};

pub(crate) use self::symbol::{SymbolKind, Vocabulary};
use self::{
    boxes::BoxOutline,
    grid::Grid,
    pipes::{Crossing, PipeRun, Pipes, Point, Surroundings},
    symbol::Symbol,
};
use super::{diagnostic::Problems, names::Defs, reader::At};
use crate::plant::{
    def::{MimicItem, MimicRect, Picture, TagId},
    exact::digits,
    number::to_u16,
    tag::{Bound, Decimals, TagDef},
};

/// Most columns and rows of a picture.
const SIZE_MAX: (usize, usize) = (500, 200);
/// Most pipes of a picture, from end or joint to end or joint: each may get its flow from all others.
const PIPES_MAX: usize = 1_000;
/// Blanks beyond a symbol that its value may use.
const ROOM_MAX: usize = 30;
/// Blanks that part two words in a row.
const PARTING: usize = 2;

/// A symbol at its place.
struct Placed {
    symbol: Symbol,
    x: usize,
    y: usize,
    /// Columns between and with the braces.
    width: usize,
    /// Columns and rows, if it covers an area.
    area: Option<(usize, usize)>,
    /// Columns for a value: to the next thing in the row.
    room: usize,
    /// Words right before it, which belong to its value.
    label: Option<(usize, String)>,
}

/// Reads a picture; what is wrong in it is added to the problems, the rest is returned.
pub(super) fn picture(text: &At<String>, vocabulary: &Vocabulary, problems: &mut Problems) -> Picture {
    let mut grid = Grid::new(text, problems.text(text.at.source));
    let (width, height) = grid.size();
    if width == 0 || width > SIZE_MAX.0 || height > SIZE_MAX.1 {
        let problem =
            problems.add(grid.span(0, 0, 1), format!("a picture of {width} by {height} cells cannot be drawn"));
        problem.label("expected at most 500 by 200; 80 by 18 fit a terminal of 80 by 24");
        return Picture::default();
    }
    if let Some((x, y)) = find(&grid, '\t') {
        problems.add(grid.span(x, y, 1), "a tab has no fixed width").label("expected spaces");
        return Picture::default();
    }
    let mut placed = symbols(&mut grid, vocabulary, problems);
    let (boxes, edges) = boxes::take(&mut grid, problems);
    let (cells, areas) = taken(&grid, &placed, problems);
    let around = Surroundings { symbols: &cells, edges: &edges, areas: &areas };
    let pipes = pipes::take(&mut grid, &around, problems);
    if PIPES_MAX < pipes.runs.len() {
        let message = format!("a picture of {} pipes cannot be drawn", pipes.runs.len());
        problems.add(grid.span(0, 0, 1), message).label(format!("expected at most {PIPES_MAX}"));
        return Picture::default();
    }
    let busy: BTreeSet<Point> = edges.iter().chain(&areas).chain(cells.keys()).chain(&pipes.cells).copied().collect();
    rooms(&grid, &mut placed, &busy);
    let words = words(&grid, &mut placed, &busy);
    check_rooms(&grid, &placed, vocabulary.defs, problems);
    check_levels(&grid, &placed, &boxes, problems);
    let size = placed.iter().filter_map(|symbol| symbol.area.map(|(w, h)| (symbol.x + w, symbol.y + h)));
    let (width, height) = size.fold((width, height), |(w, h), (x, y)| (w.max(x), h.max(y)));
    Picture { size: (to_u16(width), to_u16(height)), items: items(&placed, &boxes, &pipes, words) }
}

fn find(grid: &Grid, letter: char) -> Option<Point> {
    let (width, height) = grid.size();
    (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).find(|(x, y)| grid.get(*x, *y) == letter)
}

/// Takes the symbols out of the grid.
fn symbols(grid: &mut Grid, vocabulary: &Vocabulary, problems: &mut Problems) -> Vec<Placed> {
    let (width, height) = grid.size();
    let mut placed = Vec::new();
    for y in 0..height {
        let mut from = 0;
        while let Some(x) = (from..width).find(|x| "{}".contains(grid.get(*x, y))) {
            let end = (x + 1..width).find(|x| "{}".contains(grid.get(*x, y))).filter(|end| grid.get(*end, y) == '}');
            let Some(end) = end.filter(|_| grid.get(x, y) == '{') else {
                let (found, missing) = if grid.get(x, y) == '{' { ('{', '}') } else { ('}', '{') };
                let problem = problems.add(grid.span(x, y, 1), format!("`{found}` without `{missing}` in its row"));
                problem.label("expected {DEVICE.TAG} or {valve DEVICE.TAG}");
                grid.clear(x, y, 1);
                continue;
            };
            let (text, at) = (grid.text(y, x + 1, end), grid.span(x + 1, y, end - x - 1));
            if let Some((symbol, size)) = symbol::read(&text, at, vocabulary, problems) {
                let area = size.map(|(columns, rows)| (usize::from(columns), usize::from(rows)));
                if let Some((columns, rows)) =
                    area.filter(|(w, h)| *w == 0 || *h == 0 || *w > SIZE_MAX.0 || *h > SIZE_MAX.1)
                {
                    let problem = problems.add(at, format!("a symbol of {columns} by {rows} cells cannot be drawn"));
                    problem.label("expected 1x1 to 500x200");
                    grid.clear(x, y, end + 1 - x);
                    from = end + 1;
                    continue;
                }
                placed.push(Placed { symbol, x, y, width: end + 1 - x, area, room: 0, label: None });
            }
            grid.clear(x, y, end + 1 - x);
            from = end + 1;
        }
    }
    placed
}

/// The cells of symbols, each with its symbol and the columns that it takes; and those that areas cover.
/// Reports areas that cover something.
fn taken(grid: &Grid, placed: &[Placed], problems: &mut Problems) -> (BTreeMap<Point, Crossing>, BTreeSet<Point>) {
    let mut cells = BTreeMap::new();
    for (n, symbol) in placed.iter().enumerate().filter(|(_, symbol)| symbol.area.is_none()) {
        let (first, last) = (symbol.x, symbol.x + symbol.width - 1);
        let inline = matches!(symbol.symbol, Symbol::Valve { .. } | Symbol::Pump { .. } | Symbol::Flow(_));
        cells.extend((first..=last).map(|x| ((x, symbol.y), Crossing { symbol: n, first, last, inline })));
    }
    let mut areas = BTreeSet::new();
    for symbol in placed {
        let Some((columns, rows)) = symbol.area else { continue };
        let inside = (symbol.y..symbol.y + rows).flat_map(|y| (symbol.x..symbol.x + columns).map(move |x| (x, y)));
        let covered = inside
            .clone()
            .find(|cell| grid.get(cell.0, cell.1) != ' ' || cells.contains_key(cell) || areas.contains(cell));
        if let Some((x, y)) = covered {
            let problem = problems.add(grid.span(symbol.x, symbol.y, symbol.width), "this covers something else");
            problem.label(format!(
                "{columns} by {rows} cells reach over row {}, column {} of the picture",
                y + 1,
                x + 1
            ));
            // One that is reported takes no cells: areas that do not overlap bound the work.
            continue;
        }
        areas.extend(inside);
    }
    (cells, areas)
}

/// Finds how much room the value of each symbol has in its row.
fn rooms(grid: &Grid, placed: &mut [Placed], busy: &BTreeSet<Point>) {
    let width = grid.size().0;
    for symbol in placed.iter_mut() {
        let (end, y) = (symbol.x + symbol.width, symbol.y);
        let next = (end..end + ROOM_MAX).find(|x| grid.get(*x, y) != ' ' || busy.contains(&(*x, y)));
        let limit = match next {
            Some(x) if x > end => x - 1,
            Some(_) => end,
            None => (end + ROOM_MAX).min(width.max(end)),
        };
        symbol.room = limit - symbol.x;
    }
}

/// What is left in the grid are words; those right before a value are its label.
fn words(grid: &Grid, placed: &mut [Placed], busy: &BTreeSet<Point>) -> Vec<MimicItem> {
    let (width, height) = grid.size();
    let is_word = |x: usize, y: usize| x < width && grid.get(x, y) != ' ' && !busy.contains(&(x, y));
    let mut texts = Vec::new();
    for y in 0..height {
        let mut x = 0;
        while x < width {
            if !is_word(x, y) {
                x += 1;
                continue;
            }
            let mut end = x + 1;
            while let Some(next) = (end..end + PARTING).find(|x| is_word(*x, y)) {
                end = next + 1;
            }
            let text = grid.text(y, x, end);
            let labelled = placed.iter_mut().find(|symbol| {
                matches!(symbol.symbol, Symbol::Value(_) | Symbol::Level(_))
                    && symbol.y == y
                    && (symbol.x == end || symbol.x == end + 1)
            });
            match labelled {
                Some(symbol) => symbol.label = Some((x, text)),
                None => texts.push(MimicItem::Text { place: rect(x, y, end - x, 1), text }),
            }
            x = end;
        }
    }
    texts
}

/// Warns of values that do not fit into their room.
fn check_rooms(grid: &Grid, placed: &[Placed], defs: &Defs, problems: &mut Problems) {
    for symbol in placed {
        let (Symbol::Value(id) | Symbol::Level(id)) = symbol.symbol else { continue };
        let tag = &defs.tags[id.index()];
        if let Some(needed) = columns(tag).filter(|needed| symbol.room < *needed) {
            let message = format!("{} needs {needed} columns, here are {}", tag.name, symbol.room);
            problems
                .warn(grid.span(symbol.x, symbol.y, symbol.width), message)
                .label("make room with blanks before } or after it");
        }
    }
}

/// The columns of a value with its unit, as far as the files say how long it can become.
fn columns(tag: &TagDef) -> Option<usize> {
    if tag.is_text() || !tag.bit_labels.is_empty() {
        return None;
    }
    if !tag.enum_labels.is_empty() {
        return tag.enum_labels.iter().map(|(_, label)| label.chars().count()).max();
    }
    let (Some(Bound::Fixed(min)), Some(Bound::Fixed(max)), Decimals::Fixed(decimals)) =
        (tag.min, tag.max, tag.decimals)
    else {
        return None;
    };
    let number = [min, max].map(|value| digits(value, Some(decimals)).len());
    let unit = if tag.unit.is_empty() { 0 } else { 1 + tag.unit.chars().count() };
    Some(number[0].max(number[1]) + unit)
}

/// The innermost box around a symbol.
fn box_of(symbol: &Placed, boxes: &[BoxOutline]) -> Option<usize> {
    let inside = |of: &BoxOutline| {
        of.x < symbol.x && symbol.x < of.x + of.width && of.y < symbol.y && symbol.y + 1 < of.y + of.height
    };
    let around = boxes.iter().enumerate().filter(|(_, of)| inside(of));
    around.min_by_key(|(_, of)| of.width * of.height).map(|(n, _)| n)
}

/// Reports levels that have no vessel of their own.
fn check_levels(grid: &Grid, placed: &[Placed], boxes: &[BoxOutline], problems: &mut Problems) {
    let mut filled = BTreeSet::new();
    for symbol in placed.iter().filter(|symbol| matches!(symbol.symbol, Symbol::Level(_))) {
        let at = grid.span(symbol.x, symbol.y, symbol.width);
        match box_of(symbol, boxes) {
            None => problems.add(at, "a level outside of a box").label("expected inside the box that it fills"),
            Some(vessel) if !filled.insert(vessel) => problems.add(at, "two levels in one box").label("expected one"),
            Some(_) => continue,
        };
    }
}

fn rect(x: usize, y: usize, width: usize, height: usize) -> MimicRect {
    MimicRect { x: to_u16(x), y: to_u16(y), width: to_u16(width), height: to_u16(height) }
}

/// The tags that tell whether a pipe flows: a measured flow is believed more than its valves and pumps.
fn own_flow(run: &PipeRun, placed: &[Placed]) -> Vec<TagId> {
    let symbols = || run.through.iter().map(|n| &placed[*n].symbol);
    let measured: Vec<TagId> = symbols().filter_map(Symbol::measured_flow).collect();
    if measured.is_empty() { symbols().filter_map(Symbol::actuator).collect() } else { measured }
}

/// What each pipe carries: its own flow; without a valve or pump, what the pipes before it give it, through any number of
/// joints. An inlet that nothing measures gives an empty list, which is an unknown flow.
fn flows(runs: &[PipeRun], placed: &[Placed]) -> Vec<Vec<Vec<TagId>>> {
    let own: Vec<Vec<TagId>> = runs.iter().map(|run| own_flow(run, placed)).collect();
    let mut leading_to: BTreeMap<Point, Vec<usize>> = BTreeMap::new();
    for (n, run) in runs.iter().enumerate() {
        run.points.last().into_iter().for_each(|end| leading_to.entry(*end).or_default().push(n));
    }
    let before = |n: usize| {
        let run: &PipeRun = &runs[n];
        let far = run.points.last().filter(|_| !run.directed);
        run.points
            .first()
            .into_iter()
            .chain(far)
            .filter_map(|end| leading_to.get(end))
            .flatten()
            .copied()
            .filter(move |m| *m != n)
    };
    let flow_of = |start: usize| {
        let (mut open, mut seen, mut flow) = (vec![start], BTreeSet::from([start]), BTreeSet::new());
        while let Some(n) = open.pop() {
            if !own[n].is_empty() {
                flow.insert(own[n].clone());
                continue;
            }
            // Without an arrow it may as well lead away.
            if runs[n].directed && before(n).next().is_none() {
                flow.insert(Vec::new());
            }
            open.extend(before(n).filter(|m| seen.insert(*m)));
        }
        flow.into_iter().collect()
    };
    (0..runs.len()).map(flow_of).collect()
}

/// All of the picture in the order in which it is drawn.
fn items(placed: &[Placed], boxes: &[BoxOutline], pipes: &Pipes, words: Vec<MimicItem>) -> Vec<MimicItem> {
    let mut vessels: Vec<(usize, MimicItem)> =
        boxes.iter().enumerate().map(|(n, of)| (of.width * of.height, vessel(n, of, placed, boxes))).collect();
    // What lies inside another box is drawn after it.
    vessels.sort_by_key(|(size, _)| std::cmp::Reverse(*size));
    let flows = flows(&pipes.runs, placed);
    let runs = pipes.runs.iter().zip(flows).map(|(run, flow)| {
        let points = run.points.iter().map(|(x, y)| (to_u16(*x), to_u16(*y))).collect();
        MimicItem::Pipe { points, flow, directed: run.directed }
    });
    let joints = pipes
        .joints
        .iter()
        .map(|((x, y), branches)| MimicItem::Joint { at: (to_u16(*x), to_u16(*y)), branches: *branches });
    let symbols = placed.iter().enumerate().filter_map(|(n, symbol)| item(symbol, pipes.upright.contains(&n)));
    vessels.into_iter().map(|(_, vessel)| vessel).chain(runs).chain(joints).chain(symbols).chain(words).collect()
}

fn vessel(n: usize, of: &BoxOutline, placed: &[Placed], boxes: &[BoxOutline]) -> MimicItem {
    let inside = || placed.iter().filter(move |symbol| box_of(symbol, boxes) == Some(n));
    let level = inside().find_map(|symbol| match symbol.symbol {
        Symbol::Level(tag) => Some(tag),
        _ => None,
    });
    let tag = |symbol: &Placed| match symbol.symbol {
        Symbol::Value(tag) | Symbol::Level(tag) | Symbol::Agitator(tag) | Symbol::Heater(tag) | Symbol::Bar(tag) => {
            Some(tag)
        }
        _ => None,
    };
    let mut inside: Vec<TagId> = inside().filter_map(tag).collect();
    let mut seen = BTreeSet::new();
    inside.retain(|tag| seen.insert(*tag));
    MimicItem::Vessel { place: rect(of.x, of.y, of.width, of.height), label: of.label.clone(), level, inside }
}

/// What is drawn for a symbol; nothing for a flow, which only its pipe shows.
fn item(symbol: &Placed, upright: bool) -> Option<MimicItem> {
    let (x, y) = (symbol.x, symbol.y);
    let (columns, rows) = symbol.area.unwrap_or((symbol.width, 1));
    let place = rect(x, y, columns, rows);
    let with_room = rect(x, y, symbol.room, 1);
    Some(match symbol.symbol.clone() {
        Symbol::Value(tag) | Symbol::Level(tag) => {
            let (from, label) = symbol.label.clone().unwrap_or((x, String::new()));
            MimicItem::Value { place: rect(from, y, x + symbol.room - from, 1), label, tag }
        }
        Symbol::Valve { tag, label, .. } => MimicItem::Valve { place, label, tag, vertical: upright },
        Symbol::Pump { tag, label, .. } => MimicItem::Pump { place, label, tag },
        Symbol::Agitator(tag) => MimicItem::Agitator { place: with_room, tag },
        Symbol::Heater(tag) => MimicItem::Heater { place: with_room, tag },
        Symbol::Flow(_) => return None,
        Symbol::Bar(tag) => MimicItem::Bar { place, tag },
        Symbol::Trend(tag, window) => MimicItem::Trend { place, tag, window },
        Symbol::Controller(device) => MimicItem::Controller { place, device },
        Symbol::Sequence { step, label, remaining, states } => {
            MimicItem::Sequence { place, label, step, remaining, states }
        }
        Symbol::Page(page) => MimicItem::Link { place, page },
    })
}
