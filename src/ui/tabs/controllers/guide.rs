//! What the words of a controller mean, and what to change when it does not do what it should: pages to read.

use crate::ui::tabs::prelude::*;

/// The pages, each with its heading behind `# `; at most 16 lines of at most 77 columns.
const TEXT: &str = include_str!("guide.txt");

/// Each page: its heading and its lines.
fn pages() -> impl Iterator<Item = (&'static str, std::str::Lines<'static>)> {
    let pages = TEXT.split("# ").skip(1).filter_map(|page| page.trim_end().split_once('\n'));
    pages.map(|(heading, text)| (heading, text.lines()))
}

/// How many there are.
pub fn count() -> usize {
    pages().count()
}

/// Draws a page.
pub fn view(cx: &ViewContext, canvas: &mut Canvas, page: usize) {
    let Some((heading, lines)) = pages().nth(page) else { return };
    canvas.text(1, 0, heading, cx.theme.strong());
    let end = canvas.width().saturating_sub(1);
    canvas.text_right(end, 0, &format!("{}/{}", page + 1, count()), cx.theme.dim());
    for (y, line) in lines.enumerate() {
        canvas.text(2, to_u16(y) + 2, line, cx.theme.normal());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_page_can_be_read_whole_on_a_screen_of_80_by_24() {
        assert_eq!(count(), 5);
        for (heading, lines) in pages() {
            assert!(lines.clone().count() <= 16, "{heading} has {} lines", lines.count());
            for line in lines {
                assert!(width(line) <= 77, "{heading}: {} columns: {line}", width(line));
            }
        }
    }
}
