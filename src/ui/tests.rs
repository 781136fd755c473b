//! Tests of the whole terminal: screens as an operator sees them, and keys through `update`.

use std::sync::Arc;

use ratatui::{Terminal, backend::TestBackend};

use super::{fixture::Fixture, tabs::Tab, theme::Theme, *};

fn model(fixture: &Fixture, theme: Theme) -> Model {
    Model::new(fixture.snapshot(), theme, 1, Arc::from("tech1"))
}

/// The screen as text, one line a row.
fn screen(model: &mut Model, width: u16, height: u16) -> String {
    update(model, Msg::Resize(width, height));
    let mut terminal = Terminal::new(TestBackend::new(width, height)).expect("a test backend");
    terminal.draw(|frame| view(model, frame)).expect("a test backend takes every frame");
    let buffer = terminal.backend().buffer();
    let rows = buffer.content.chunks(usize::from(width.max(1)));
    rows.map(|row| row.iter().map(|cell| cell.symbol()).collect::<String>().trim_end().to_owned() + "\n").collect()
}

#[test]
fn look() {
    for fixture in [Fixture::normal(), Fixture::alarm(), Fixture::line_down()] {
        for tab in [Tab::Mimic, Tab::Alarms, Tab::Controllers] {
            let mut model = model(&fixture, Theme::FULL);
            model.tabs.shown = tab;
            println!("{}", screen(&mut model, 80, 24));
        }
    }
    let mut model = model(&Fixture::alarm(), Theme::FULL);
    println!("{}", screen(&mut model, 120, 40));
}
