//! Where everything of a report stands on its pages: pure, from a document and the widths of its letters. Lengths are in points.

use unicode_segmentation::UnicodeSegmentation;

use crate::{
    plant::{def::Paper, number::to_usize},
    report::{
        document::{ColumnKind, Content, Document, Fact, Section, Table, plain},
        drawing::{Drawing, Ink, Rgb, Shape, TEXT},
    },
    t,
};

/// Margin around the text, and below the head and above the foot of a page.
const MARGIN: f32 = 42.5;
const HEAD: f32 = 22.0;
/// Sizes of a table's letters that are tried, the largest that fits is taken.
const SIZES: [f32; 4] = [8.5, 7.5, 6.5, 6.0];
/// Height of a line in sizes, and room around a cell.
const LINE: f32 = 1.3;
const PADDING: (f32, f32) = (3.0, 1.5);
/// The ground of a table head.
const HEAD_GROUND: Rgb = Rgb(242, 242, 242);
/// Width of a chart in pixels.
const CHART: u16 = 720;

/// Widths of texts.
pub(super) trait Metrics {
    /// Width of a line.
    fn width(&self, text: &str, size: f32, bold: bool) -> f32;
}

/// A page, its origin at the top left.
#[derive(Debug, Default, PartialEq)]
pub(super) struct Page {
    /// What stands on it.
    pub items: Vec<Item>,
}

/// A piece of a page.
#[derive(Debug, PartialEq)]
pub(super) enum Item {
    /// A line of text; `at` is its baseline's begin.
    Text { at: (f32, f32), size: f32, bold: bool, text: String, ink: Ink },
    /// A line through points.
    Line { points: Vec<(f32, f32)>, width: f32, dashed: bool, ink: Ink },
    /// A filled rectangle: left, top, width, height.
    Fill([f32; 4], Ink),
}

/// Width and height of a paper.
pub(super) fn size(paper: Paper) -> (f32, f32) {
    match paper {
        Paper::A4 => (595.28, 841.89),
        Paper::Letter => (612.0, 792.0),
    }
}

/// Lays a document out.
pub(super) fn pages(document: &Document, paper: Paper, metrics: &impl Metrics) -> Vec<Page> {
    let (width, height) = size(paper);
    let mut layout = Layout {
        metrics,
        document,
        width,
        bottom: height - MARGIN - HEAD,
        y: MARGIN + HEAD,
        pages: vec![Page::default()],
    };
    layout.title();
    document.sections.iter().for_each(|section| layout.section(section));
    layout.end(height)
}

struct Layout<'a, M> {
    metrics: &'a M,
    document: &'a Document,
    width: f32,
    bottom: f32,
    /// Where the next line begins.
    y: f32,
    pages: Vec<Page>,
}

impl<M: Metrics> Layout<'_, M> {
    fn room(&self) -> f32 {
        self.width - 2.0 * MARGIN
    }

    fn put(&mut self, item: Item) {
        if let Some(page) = self.pages.last_mut() {
            page.items.push(item);
        }
    }

    /// A line of text below the last one.
    fn line(&mut self, text: &str, size: f32, bold: bool) {
        for text in wrapped(self.metrics, text, size, bold, self.room()) {
            self.need(size * LINE);
            self.text((MARGIN, self.y + size), size, bold, text);
            self.y += size * LINE;
        }
    }

    fn text(&mut self, at: (f32, f32), size: f32, bold: bool, text: String) {
        if !text.is_empty() {
            self.put(Item::Text { at, size, bold, text, ink: Ink::Text });
        }
    }

    /// Begins a page where so much has no room on this one.
    fn need(&mut self, height: f32) {
        if self.bottom < self.y + height {
            self.pages.push(Page::default());
            self.y = MARGIN + HEAD;
        }
    }

    fn title(&mut self) {
        let document = self.document;
        if !document.logo.is_empty() {
            self.line(&document.logo, 10.0, false);
        }
        self.line(&document.title, 16.0, true);
        self.line(&document.heading, 11.0, false);
        self.line(&document.times_line(), 9.0, false);
    }

    fn section(&mut self, section: &Section) {
        // A title does not stand alone at the foot of a page.
        let first = match &section.content {
            Content::Charts(charts) => {
                charts.first().map_or(0.0, |chart| self.scaled(&chart.drawing(&self.document.zone, CHART)).1)
            }
            Content::Facts(_) | Content::Table(_) | Content::Signatures(_) => 50.0,
        };
        self.need(30.0 + first);
        self.y += 12.0;
        self.line(&section.title, 12.0, true);
        self.y += 2.0;
        match &section.content {
            Content::Facts(facts) => self.facts(facts),
            Content::Table(table) => self.table(&table.dense()),
            Content::Signatures(names) => names.iter().for_each(|name| self.signature(name)),
            Content::Charts(charts) => {
                for chart in charts {
                    let drawing = chart.drawing(&self.document.zone, CHART);
                    let (scale, height) = self.scaled(&drawing);
                    self.need(height);
                    self.drawing(drawing.shapes(), scale);
                    self.y += height + 4.0;
                }
            }
        }
    }

    /// The scale at which a drawing has room on a page below a title, and its height then.
    fn scaled(&self, drawing: &Drawing) -> (f32, f32) {
        let (width, height) = drawing.size();
        let room = self.bottom - MARGIN - HEAD - 30.0;
        let scale = (self.room() / f32::from(width)).min(room / f32::from(height));
        (scale, f32::from(height) * scale)
    }

    fn facts(&mut self, facts: &[Fact]) {
        let size = 9.0;
        let names = facts.iter().map(|fact| self.metrics.width(&fact.name, size, false)).fold(0.0, f32::max) + 12.0;
        for fact in facts {
            let words = self.document.fact(&fact.cell);
            let lines = wrapped(self.metrics, &words, size, false, self.room() - names);
            let begins = std::iter::once(fact.name.clone()).chain(std::iter::repeat(String::new()));
            for (line, name) in lines.into_iter().zip(begins) {
                self.need(size * LINE);
                self.text((MARGIN, self.y + size), size, false, name);
                self.text((MARGIN + names, self.y + size), size, false, line);
                self.y += size * LINE;
            }
        }
    }

    fn signature(&mut self, name: &str) {
        self.need(50.0);
        self.y += 34.0;
        self.put(Item::Line {
            points: vec![(MARGIN, self.y), (MARGIN + 200.0, self.y)],
            width: 0.6,
            dashed: false,
            ink: Ink::Text,
        });
        self.line(name, 9.0, false);
    }

    fn table(&mut self, table: &Table) {
        let words = |row: &Vec<_>| -> Vec<String> {
            let cells = row.iter().zip(&table.columns);
            cells.map(|(cell, column)| self.document.words(cell, column.kind)).collect()
        };
        let rows: Vec<Vec<String>> = table.rows.iter().map(words).collect();
        let heads: Vec<String> = table.columns.iter().map(|column| column.heading.clone()).collect();
        let kinds: Vec<ColumnKind> = table.columns.iter().map(|column| column.kind).collect();
        let room = self.room();
        let fitted = SIZES.map(|size| (size, widths(self.metrics, &kinds, &heads, &rows, size, room)));
        let fits = fitted.iter().find(|(_, widths)| widths.iter().sum::<f32>() <= room + 0.1);
        let (size, widths) = fits.unwrap_or(&fitted[SIZES.len() - 1]).clone();
        self.row(&heads, &kinds, &widths, size, true);
        let rows: Vec<Vec<String>> = rows.iter().flat_map(|row| self.parts(row, &widths, size)).collect();
        for row in rows {
            let page = self.pages.len();
            self.need(height(self.metrics, &row, &widths, size, false));
            if page < self.pages.len() {
                self.row(&heads, &kinds, &widths, size, true);
            }
            self.row(&row, &kinds, &widths, size, false);
        }
    }

    /// A row; one that is higher than a page in parts that are not.
    fn parts(&self, row: &[String], widths: &[f32], size: f32) -> Vec<Vec<String>> {
        let most = to_usize(f64::from((self.bottom - MARGIN - HEAD - 60.0) / (size * LINE))).max(1);
        if height(self.metrics, row, widths, size, false) <= most as f32 * size * LINE {
            return vec![row.to_vec()];
        }
        let cells: Vec<Vec<String>> = row
            .iter()
            .zip(widths)
            .map(|(cell, width)| wrapped(self.metrics, cell, size, false, width - 2.0 * PADDING.0))
            .map(|lines| lines.chunks(most).map(|lines| lines.join(" ")).collect())
            .collect();
        let count = cells.iter().map(Vec::len).max().unwrap_or(0);
        let part = |n: usize| cells.iter().map(|parts| parts.get(n).cloned().unwrap_or_default()).collect();
        (0..count).map(part).collect()
    }

    fn row(&mut self, cells: &[String], kinds: &[ColumnKind], widths: &[f32], size: f32, head: bool) {
        let tall = height(self.metrics, cells, widths, size, head);
        let whole: f32 = widths.iter().sum();
        if head {
            self.put(Item::Fill([MARGIN, self.y, whole, tall], Ink::Own(HEAD_GROUND)));
        }
        let mut x = MARGIN;
        for ((cell, kind), width) in cells.iter().zip(kinds).zip(widths) {
            let room = width - 2.0 * PADDING.0;
            for (n, line) in wrapped(self.metrics, cell, size, head, room).into_iter().enumerate() {
                let free = if *kind == ColumnKind::Number { room - self.metrics.width(&line, size, head) } else { 0.0 };
                let y = self.y + PADDING.1 + size + n as f32 * size * LINE;
                self.text((x + PADDING.0 + free, y), size, head, line);
            }
            x += width;
        }
        self.y += tall;
        let rule = vec![(MARGIN, self.y), (MARGIN + whole, self.y)];
        self.put(Item::Line { points: rule, width: 0.4, dashed: false, ink: Ink::Grid });
    }

    /// Shapes in pixels, at this scale.
    fn drawing(&mut self, shapes: &[Shape], scale: f32) {
        let (left, top) = (MARGIN, self.y);
        let place = |(x, y): (f32, f32)| (left + x * scale, top + y * scale);
        for shape in shapes {
            match shape {
                Shape::Line { points, ink, width, dashed } => self.put(Item::Line {
                    points: points.iter().map(|point| place(*point)).collect(),
                    width: width * scale,
                    dashed: *dashed,
                    ink: *ink,
                }),
                Shape::Fill { rects, ink } => rects.iter().for_each(|[x, y, width, height]| {
                    let (x, y) = place((*x, *y));
                    self.put(Item::Fill([x, y, width * scale, height * scale], *ink));
                }),
                Shape::Text { at, anchor, text, ink, look } => {
                    let (size, (x, y)) = (TEXT.0 * 0.8 * scale, place(*at));
                    let before = self.metrics.width(text, size, look.bold) * anchor.before();
                    let at = (x - before, y + size * 0.35);
                    self.put(Item::Text { at, size, bold: look.bold, text: text.clone(), ink: *ink });
                }
            }
        }
    }

    /// Heads and feet of all pages, now that they are counted.
    fn end(self, height: f32) -> Vec<Page> {
        let Layout { metrics, document, width, mut pages, .. } = self;
        let count = pages.len();
        for (page, n) in pages.iter_mut().zip(1..) {
            let (size, bold, ink) = (8.0, false, Ink::Text);
            let mut text = |at, text: String| page.items.push(Item::Text { at, size, bold, text, ink });
            if n > 1 {
                text((MARGIN, MARGIN + size), format!("{}   {}", document.title, document.heading));
            }
            let number = plain(&t!("page {n} of {count}", n, count));
            text((width - MARGIN - metrics.width(&number, size, false), height - MARGIN), number);
            text((MARGIN, height - MARGIN), concat!("sightglass ", env!("CARGO_PKG_VERSION")).to_owned());
        }
        pages
    }
}

fn height(metrics: &impl Metrics, cells: &[String], widths: &[f32], size: f32, bold: bool) -> f32 {
    let lines = |(cell, width): (&String, &f32)| wrapped(metrics, cell, size, bold, width - 2.0 * PADDING.0).len();
    let most = cells.iter().zip(widths).map(lines).max().unwrap_or(1);
    most as f32 * size * LINE + 2.0 * PADDING.1
}

/// Widths of columns that keep every number, time and word whole: headings wrap first, then texts.
fn widths(
    metrics: &impl Metrics,
    kinds: &[ColumnKind],
    heads: &[String],
    rows: &[Vec<String>],
    size: f32,
    room: f32,
) -> Vec<f32> {
    let width = |text: &str, bold| metrics.width(text, size, bold);
    let longest = |text: &str, bold| text.split(' ').map(|word| width(word, bold)).fold(0.0, f32::max);
    // Each at its least and at its best.
    let column = |n: usize| {
        let cells = rows.iter().map(|row| width(&row[n], false)).fold(0.0, f32::max);
        let words = rows.iter().map(|row| longest(&row[n], false)).fold(0.0, f32::max);
        let least = if kinds[n] == ColumnKind::Text { words.min(90.0) } else { cells };
        let least = least.max(longest(&heads[n], true));
        (least + 2.0 * PADDING.0, cells.max(width(&heads[n], true)).max(least) + 2.0 * PADDING.0)
    };
    let mut columns: Vec<(f32, f32)> = (0..heads.len()).map(column).collect();
    // On the smallest letters the widest words are broken rather than left outside of the page.
    if size <= SIZES[SIZES.len() - 1] {
        let capped =
            |cap: f32, n: usize| if kinds[n] == ColumnKind::Text { columns[n].0.min(cap) } else { columns[n].0 };
        let fits = |cap: &u8| (0..columns.len()).map(|n| capped(f32::from(*cap), n)).sum::<f32>() <= room;
        let cap = f32::from((15..=96).rev().find(fits).unwrap_or(15));
        columns = (0..columns.len()).map(|n| (capped(cap, n), columns[n].1)).collect();
    }
    let (least, best): (f32, f32) = columns.iter().fold((0.0, 0.0), |(a, b), (least, best)| (a + least, b + best));
    // What is left beyond the least is shared by how much each column lacks.
    let share = if best <= least { 0.0 } else { ((room - least) / (best - least)).clamp(0.0, 1.0) };
    columns.iter().map(|(least, best)| least + (best - least) * share).collect()
}

/// Lines of a text: broken at spaces, and within a word that is too long between two letters as readers see them.
fn wrapped(metrics: &impl Metrics, text: &str, size: f32, bold: bool, room: f32) -> Vec<String> {
    let fits = |line: &str| metrics.width(line, size, bold) <= room + 0.05;
    if fits(text) {
        return vec![text.to_owned()];
    }
    let (mut lines, mut line) = (Vec::new(), String::new());
    for word in text.split(' ') {
        let longer = if line.is_empty() { word.to_owned() } else { format!("{line} {word}") };
        if fits(&longer) {
            line = longer;
            continue;
        }
        if !line.is_empty() {
            lines.push(std::mem::take(&mut line));
        }
        for letter in word.graphemes(true) {
            if !line.is_empty() && !fits(&format!("{line}{letter}")) {
                lines.push(std::mem::take(&mut line));
            }
            line.push_str(letter);
        }
    }
    lines.push(line);
    lines
}

#[cfg(test)]
mod tests;
