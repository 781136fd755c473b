//! What `P` saves, and what must be on record before.

use std::path::PathBuf;

use ratatui::{
    layout::Rect,
    style::{Color, Style},
};

use super::*;
use crate::{
    access::Durability,
    report::typeface::has_letter,
    ui::{
        Msg,
        fixture::Fixture,
        tests::{model, screen, type_keys},
        theme::Theme,
        update,
    },
};

fn request(effects: &[Effect]) -> Option<(QueryId, String)> {
    effects.iter().find_map(|effect| match effect {
        Effect::SessionRequest(id, SessionRequest::Exported { file, .. }) => Some((*id, file.clone())),
        _ => None,
    })
}

fn saved(effects: &[Effect]) -> Option<(PathBuf, String)> {
    effects.iter().find_map(|effect| match effect {
        Effect::SaveReport { tab: None, path, bytes, .. } => {
            Some((path.clone(), String::from_utf8_lossy(bytes).into_owned()))
        }
        _ => None,
    })
}

fn svg(buffer: &Buffer) -> String {
    String::from_utf8(drawing(buffer).svg()).expect("SVG is text")
}

#[test]
fn a_screen_is_put_on_record_and_saved_thrice() {
    let mut model = model(&Fixture::alarm(), Theme::FULL);
    let shown = screen(&mut model, 80, 24);
    let effects = type_keys(&mut model, "P");
    let (id, file) = request(&effects).expect("a request");
    assert!(file.ends_with("-mimic.txt") && saved(&effects).is_none(), "nothing is written before its record: {file}");
    let effects = update(&mut model, Msg::RequestDone(id, Ok(Durability::Recorded)));
    let (path, text) = saved(&effects).expect("the text");
    assert_eq!((path.display().to_string(), text), (file, shown));
    let (id, file) = request(&effects).expect("a second request");
    let effects = update(&mut model, Msg::RequestDone(id, Ok(Durability::Recorded)));
    let (path, picture) = saved(&effects).expect("the picture");
    assert!(file.ends_with("-mimic.svg") && path.ends_with(&file) && picture.starts_with("<svg "));
    assert!(picture.contains(">TK-1 control</text>") && picture.ends_with("</svg>\n"), "{picture}");
    let (id, file) = request(&effects).expect("a third request");
    let effects = update(&mut model, Msg::RequestDone(id, Ok(Durability::Recorded)));
    let (path, picture) = saved(&effects).expect("the picture in pixels");
    assert!(file.ends_with("-mimic.png") && path.ends_with(&file) && picture.contains("PNG"));
    assert_eq!(request(&effects), None);
    update(&mut model, Msg::Saved(None, Ok(path)));
    assert!(screen(&mut model, 80, 24).contains("Screen saved: "), "its place is shown");
}

#[test]
fn a_file_that_is_not_written_is_said_to_the_end() {
    let mut model = model(&Fixture::alarm(), Theme::FULL);
    screen(&mut model, 80, 24);
    let (id, _) = request(&type_keys(&mut model, "P")).expect("a request");
    let effects = update(&mut model, Msg::RequestDone(id, Ok(Durability::Recorded)));
    let (id, _) = request(&effects).expect("a second request");
    update(&mut model, Msg::Saved(None, Err("No space left on device".to_owned())));
    let effects = update(&mut model, Msg::RequestDone(id, Ok(Durability::Recorded)));
    assert_eq!((saved(&effects), request(&effects)), (None, None), "no other one is begun");
    // What was under way comes back well.
    update(&mut model, Msg::Saved(None, Ok("screen.svg".into())));
    assert!(screen(&mut model, 80, 24).contains("The screen was not saved: No space left on device"));
    assert!(request(&type_keys(&mut model, "P")).is_some());
    update(&mut model, Msg::Saved(None, Ok("screen.txt".into())));
    assert!(screen(&mut model, 80, 24).contains("Screen saved: "), "the next screen is another one");
}

#[test]
fn a_window_that_only_shows_is_saved_too() {
    let mut model = model(&Fixture::alarm(), Theme::FULL);
    screen(&mut model, 80, 24);
    type_keys(&mut model, "?");
    assert!(request(&type_keys(&mut model, "P")).is_some(), "help");
    type_keys(&mut model, "⎋s");
    assert_eq!(request(&type_keys(&mut model, "P")), None, "a form takes its letters itself");
}

#[test]
fn a_screen_that_is_not_recorded_is_not_saved() {
    let mut model = model(&Fixture::normal(), Theme::FULL);
    screen(&mut model, 80, 24);
    let (id, _) = request(&type_keys(&mut model, "P")).expect("a request");
    let effects = update(&mut model, Msg::RequestDone(id, Err(RequestRefusal::StationGone)));
    assert_eq!((saved(&effects), request(&effects)), (None, None));
    assert!(screen(&mut model, 80, 24).contains("The screen was not saved: station is gone"));
}

#[test]
fn a_picture_has_shapes_for_lines_and_text_for_words() {
    let mut buffer = Buffer::empty(Rect::new(0, 0, 6, 2));
    buffer.set_string(0, 0, "┌─ A&B", Style::new());
    buffer.set_string(0, 1, "█⣿ ◆", Style::new().fg(Color::Rgb(255, 96, 96)).bg(Color::Indexed(16)));
    insta::assert_snapshot!(svg(&buffer));
}

#[test]
fn no_sign_of_any_screen_is_left_to_the_font_of_a_viewer() {
    let mut model = model(&Fixture::alarm(), Theme::FULL);
    for tab in "1234567".chars() {
        type_keys(&mut model, &tab.to_string());
        screen(&mut model, 160, 50);
        let buffer = drawn(&model);
        let unknown: String = text(&buffer).chars().filter(|c| !c.is_whitespace() && !has_letter(*c)).collect();
        assert_eq!(unknown, "", "question marks in the picture of tab {tab}");
        let picture = svg(&buffer);
        let texts = picture.lines().filter(|line| line.starts_with("<text"));
        let left: String = texts
            .flat_map(str::chars)
            .filter(|c| ('\u{2500}'..='\u{259F}').contains(c) || ('\u{2800}'..='\u{28FF}').contains(c))
            .filter(|c| *c != '╱')
            .collect();
        assert_eq!(left, "", "tab {tab}");
    }
}
