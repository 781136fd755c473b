//! The chart as the terminal's own picture: when it is shown, what it shows, and what closes it.

use tiny_skia::Pixmap;

use super::*;
use crate::ui::{
    graphics::{Graphics, Pictures, kitty},
    picture,
    preferences::Preferences,
    theme::ThemeName,
};

const KITTY: Graphics = Graphics { kitty: true, cell: Some((10, 20)), ..Graphics::NONE };

fn stand(graphics: Graphics) -> Stand {
    let mut stand = Stand::new(Theme { graphics, ..Theme::FULL }, 120, 40);
    stand.answer();
    stand
}

fn cells(stand: &Stand) -> String {
    crate::ui::text_of(stand.terminal().backend().buffer())
}

#[test]
fn a_picture_has_the_pixels_of_its_cells() {
    let mut stand = stand(KITTY);
    let dots = cells(&stand);
    assert_eq!(picture(&stand.model), None);
    stand.press("i");
    let shown = picture(&stand.model).expect("a picture");
    assert_eq!(shown.drawing.size(), (shown.area.width * 10, shown.area.height * 20));
    let pixels = shown.drawing.pixels().expect("it has a size");
    let sent = KITTY.encode(&shown).expect("it has a size");
    assert_eq!(Pixmap::decode_png(&kitty::png_of(&sent)).expect("a PNG"), pixels);
    let has = |wanted: (u8, u8, u8)| {
        pixels.pixels().iter().filter(|pixel| (pixel.red(), pixel.green(), pixel.blue()) == wanted).count()
    };
    assert!(has((0x26, 0x26, 0x26)) > 100_000, "the ground of the theme");
    assert!(has((0x8c, 0xb8, 0xd4)) > 100, "the first pen: {}", has((0x8c, 0xb8, 0xd4)));
    // What is written under it would cover it: the cells below stay blank.
    let blank = cells(&stand);
    let row = |screen: &str, y: u16| screen.lines().nth(y.into()).unwrap_or_default().to_owned();
    let middle = shown.area.y + shown.area.height / 2;
    assert!(!row(&dots, middle).trim().is_empty() && row(&blank, middle).trim().is_empty(), "{blank}");
    assert!(blank.contains("TIC-1.PV") && blank.contains("events"), "legend and events stay: {blank}");
}

#[test]
fn a_picture_has_the_colours_of_the_theme() {
    let mut stand = stand(KITTY);
    let light = Preferences { theme: ThemeName::Light, ..Preferences::default() };
    stand.model.preferences_file.set(Some("tech1"), light);
    stand.press("i");
    let pixels = picture(&stand.model).and_then(|shown| shown.drawing.pixels()).expect("a picture");
    assert_eq!(pixels.pixel(0, 0).map(|pixel| (pixel.red(), pixel.green(), pixel.blue())), Some((0xf2, 0xf2, 0xee)));
}

#[test]
fn every_key_closes_it_and_acts() {
    for (key, tab) in [("i", Tab::Trends), ("⎋", Tab::Trends), ("+", Tab::Trends), ("3", Tab::Alarms)] {
        let mut stand = stand(KITTY);
        let window = stand.model.tabs.trends.window;
        stand.press("i");
        assert!(picture(&stand.model).is_some());
        stand.press(key);
        assert_eq!((picture(&stand.model), stand.model.tabs.shown), (None, tab), "{key}");
        assert_eq!(stand.model.tabs.trends.window != window, key == "+", "{key}");
    }
}

#[test]
fn whatever_opens_over_the_chart_closes_it() {
    let mut stand = stand(KITTY);
    stand.press("i");
    let locked = crate::access::SessionStatus { locked: true, ..(*crate::ui::fixture::session()).clone() };
    update(&mut stand.model, Msg::SessionStatus(Arc::new(locked)));
    assert_eq!(picture(&stand.model).is_some(), stand.model.modal.is_none());
    update(&mut stand.model, Msg::Resize(30, 8));
    assert_eq!(picture(&stand.model), None, "too small for anything");
}

#[test]
fn a_terminal_without_pictures_says_why() {
    let mut stand = stand(Graphics::NONE);
    assert!(!stand.screen().contains("i picture"));
    stand.press("i");
    assert!(stand.screen().contains("neither Kitty graphics nor Sixel announced"), "{}", stand.screen());
    let off = Preferences { pictures: Pictures::Off, ..Preferences::default() };
    stand.model.preferences_file.set(Some("tech1"), off);
    stand.press("ki");
    assert!(stand.screen().contains("Pictures are off in the settings (F2)"), "{}", stand.screen());
    let mut able = self::stand(KITTY);
    assert!(able.screen().contains("i picture"), "{}", able.screen());
    able.press("xi");
    assert!(able.screen().contains("Only the chart over time is shown as a picture"), "{}", able.screen());
}

#[test]
fn a_sixel_picture_is_no_larger_than_the_terminal_takes() {
    let graphics = Graphics { sixel: true, cell: Some((10, 20)), sixel_max: Some((800, 5_000)), ..Graphics::NONE };
    let mut stand = stand(graphics);
    stand.press("i");
    let shown = picture(&stand.model).expect("a picture");
    assert_eq!((shown.area.width, shown.drawing.size().0), (80, 800));
}
