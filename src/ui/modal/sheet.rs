//! Rows of names and words, as windows that only show have them: a word that is too long goes on in the next row.

use ratatui::style::Style;

use crate::ui::{
    theme::Theme,
    widgets::text::{Canvas, fit_words, width, wrap},
};

/// A row: what it is about (empty: it goes on), and its words.
#[derive(Debug, Clone)]
pub(super) struct Fact {
    pub label: &'static str,
    pub text: String,
    pub style: Style,
    /// Words may go on in further rows; bytes and headings are laid out already.
    pub wraps: bool,
}

impl Fact {
    /// Words that go on in further rows where they are too long.
    pub fn new(label: &'static str, text: impl Into<String>, style: Style) -> Fact {
        Fact { label, text: text.into(), style, wraps: true }
    }
}

/// Rows laid out, names at the left.
#[derive(Debug)]
pub(super) struct Sheet {
    rows: Vec<Fact>,
    labels: u16,
}

impl Sheet {
    /// The rows in so many columns, of which the labels take `labels_min` or more.
    pub fn new(rows: Vec<Fact>, columns: u16, labels_min: u16) -> Sheet {
        let labels = label_columns(&rows).max(labels_min);
        let room = columns.saturating_sub(labels).max(1);
        Sheet { rows: rows.into_iter().flat_map(|row| laid_out(row, room)).collect(), labels }
    }

    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Draws it from row `first` on.
    pub fn view(&self, theme: &Theme, canvas: &mut Canvas, first: usize) {
        let room = canvas.width().saturating_sub(self.labels);
        for (y, row) in self.rows.iter().skip(first).take(usize::from(canvas.height())).enumerate() {
            canvas.text(0, y, row.label, theme.dim());
            canvas.text(self.labels, y, &fit_words(&row.text, room), row.style);
        }
    }
}

/// Columns of the labels, with a blank behind them.
pub(super) fn label_columns(rows: &[Fact]) -> u16 {
    rows.iter().map(|row| width(row.label) + 1).max().unwrap_or(0)
}

fn laid_out(row: Fact, room: u16) -> Vec<Fact> {
    if !row.wraps || width(&row.text) <= room {
        return vec![row];
    }
    // A single long word, as a hash is, is broken where the row ends.
    let lines = if row.text.contains(' ') { wrap(&row.text, room) } else { chunks(&row.text, room) };
    let labels = std::iter::once(row.label).chain(std::iter::repeat(""));
    labels.zip(lines).map(|(label, text)| Fact { label, text, style: row.style, wraps: false }).collect()
}

fn chunks(word: &str, room: u16) -> Vec<String> {
    let chars: Vec<char> = word.chars().collect();
    chars.chunks(usize::from(room)).map(|part| part.iter().collect()).collect()
}
