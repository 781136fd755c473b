//! What the words of a controller mean, and what to change when it misbehaves: pages to read.

use crate::text::translation;
use crate::ui::tabs::prelude::*;

/// The pages, each with its heading behind `# `; a paragraph is a line, its head before two blanks.
const TEXT: &str = include_str!("guide.txt");

/// Each page: its heading and its paragraphs.
fn pages() -> impl Iterator<Item = (&'static str, std::str::Lines<'static>)> {
    let pages = TEXT.split("# ").skip(1).filter_map(|page| page.trim_end().split_once('\n'));
    pages.map(|(heading, text)| (heading, text.lines()))
}

pub fn count() -> usize {
    pages().count()
}

/// Paragraphs in lines of at most this width, their heads in a column of their own.
fn lines(paragraphs: std::str::Lines<'static>, room: u16) -> Vec<String> {
    let translated = paragraphs.map(|text| translation(text).unwrap_or(text));
    let parts: Vec<(&str, &str)> = translated.map(|text| text.split_once("  ").unwrap_or(("", text))).collect();
    let column = parts.iter().map(|(head, _)| width(head)).max().filter(|head| *head > 0).map_or(0, |head| head + 2);
    let mut lines = Vec::new();
    for (head, body) in parts {
        let indent = if head.is_empty() { 0 } else { column };
        let wrapped = wrap(body, room.saturating_sub(indent));
        if wrapped.is_empty() {
            lines.push(String::new());
        }
        for (n, line) in wrapped.into_iter().enumerate() {
            lines.push(pad(if n == 0 { head } else { "" }, indent) + &line);
        }
    }
    lines
}

pub fn view(cx: &ViewContext, canvas: &mut Canvas, page: usize) {
    let Some((heading, paragraphs)) = pages().nth(page) else { return };
    canvas.text(1, 0, translation(heading).unwrap_or(heading), cx.theme.strong());
    let end = canvas.width().saturating_sub(1);
    canvas.text_right(end, 0, &format!("{}/{}", page + 1, count()), cx.theme.dim());
    for (y, line) in lines(paragraphs, end.saturating_sub(2).min(LINE_MAX)).iter().enumerate() {
        canvas.text(2, to_u16(y) + 2, line, cx.theme.normal());
    }
}

/// Longer lines are hard to read.
const LINE_MAX: u16 = 96;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ui::tests::LANGUAGES;

    #[test]
    fn every_page_can_be_read_whole_on_a_screen_of_80_by_24() {
        assert_eq!(count(), 5);
        for ((heading, paragraphs), language) in
            pages().flat_map(|page| LANGUAGES[..2].iter().map(move |of| (page.clone(), of)))
        {
            let lines = language.locale().within(|| lines(paragraphs, 77));
            assert!(lines.len() <= 16, "{} {heading}: {lines:#?}", language.code());
            assert!(lines.iter().all(|line| !line.ends_with('…')), "{lines:#?}");
        }
    }
}
