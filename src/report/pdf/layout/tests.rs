//! The pages of a report: nothing outside of them, heads repeated, numbers whole.

use super::*;
use crate::{
    report::{
        content::document,
        document::{Cell, Column},
        testing::{THREE, plant, shift_report},
    },
    text::Locale,
};

/// Every letter is half as wide as it is high.
struct Half;

impl Metrics for Half {
    fn width(&self, text: &str, size: f32, _bold: bool) -> f32 {
        text.chars().count() as f32 * size / 2.0
    }
}

fn made() -> Document {
    document(&shift_report(), &plant("Asia/Bangkok", &THREE), Locale::ENGLISH)
}

fn texts(page: &Page) -> Vec<(f32, f32, &str)> {
    let text = |item: &'_ Item| match item {
        Item::Text { at, text, .. } => Some((at.0, at.1, text.clone())),
        Item::Line { .. } | Item::Fill(..) => None,
    };
    let found: Vec<(f32, f32, String)> = page.items.iter().filter_map(text).collect();
    found.into_iter().map(|(x, y, text)| (x, y, &*text.leak())).collect()
}

#[test]
fn nothing_leaves_the_page_and_every_page_is_numbered() {
    for paper in Paper::ALL {
        let (width, height) = size(paper);
        let pages = pages(&made(), paper, &Half);
        for (page, n) in pages.iter().zip(1..) {
            let outside = |(x, y, text): &(f32, f32, &str)| {
                *x < MARGIN - 0.1
                    || width - MARGIN + 0.1 < *x + Half.width(text, 5.0, false)
                    || height - MARGIN + 0.1 < *y
            };
            let found: Vec<_> = texts(page).into_iter().filter(outside).collect();
            assert!(found.is_empty(), "{paper:?}, page {n}: {found:?}");
            let number = format!("page {n} of {}", pages.len());
            assert_eq!(texts(page).iter().filter(|(_, _, text)| *text == number).count(), 1);
        }
    }
}

#[test]
fn a_long_table_repeats_its_head_on_every_page() {
    let mut document = made();
    let rows = (0..200).map(|n| vec![Cell::Text(format!("TAG-{n}")), Cell::Number(f64::from(n).into(), Some(1))]);
    let table = Table::new([Column::text("tag"), Column::number("value")]).with(rows);
    document.sections.truncate(1);
    document.sections[0].content = Content::Table(table);
    let pages = pages(&document, Paper::A4, &Half);
    assert!(pages.len() > 2);
    for page in &pages {
        let heads = texts(page).into_iter().filter(|(_, _, text)| *text == "value").count();
        assert_eq!(heads, 1);
    }
    let of_tags = |page: &Page| texts(page).iter().filter(|(_, _, text)| text.starts_with("TAG-")).count();
    assert_eq!(pages.iter().map(of_tags).sum::<usize>(), 200);
}

#[test]
fn a_number_is_never_broken_and_stands_to_the_right() {
    let words = "a long remark ".repeat(20);
    let kinds = [ColumnKind::Text, ColumnKind::Number];
    let rows = [vec![words, "-1234567.25".to_owned()]];
    let found = widths(&Half, &kinds, &["remark".into(), "value".into()], &rows, 8.0, 200.0);
    assert!(found[1] >= Half.width("-1234567.25", 8.0, false) && found.iter().sum::<f32>() <= 200.1, "{found:?}");
    assert_eq!(wrapped(&Half, "กำลังเริ่ม", 8.0, false, 12.0).concat(), "กำลังเริ่ม");
    assert!(
        wrapped(&Half, "กำลังเริ่ม", 8.0, false, 12.0)
            .iter()
            .all(|line| !line.starts_with(['\u{e31}', '\u{e34}', '\u{e48}']))
    );
}

#[test]
fn a_text_longer_than_a_page_goes_on_inside_the_page() {
    let mut document = made();
    let long = "word ".repeat(3_000);
    document.sections.truncate(2);
    let fact = Fact { id: "note", name: "note".into(), cell: Cell::text(&long) };
    document.sections[0].content = Content::Facts(vec![fact]);
    let columns: Vec<Column> = (0..9).map(|_| Column::text("remark")).collect();
    let row = (0..9).map(|n| if n == 4 { Cell::text(&long) } else { Cell::Text("x".repeat(60)) }).collect();
    document.sections[1].content = Content::Table(Table::new(columns).with(std::iter::once(row)));
    let (width, height) = size(Paper::A4);
    let pages = pages(&document, Paper::A4, &Half);
    let all: Vec<_> = pages.iter().flat_map(texts).collect();
    let words = |text: &str| text.split(' ').filter(|word| *word == "word").count();
    assert_eq!(all.iter().map(|(_, _, text)| words(text)).sum::<usize>(), 6_000);
    for (x, y, text) in all {
        assert!(x + Half.width(text, 6.0, false) <= width - MARGIN + 0.1 && y <= height - MARGIN, "{x} {y} {text}");
    }
}
