//! The screen as files: what `P` saves for a hand-over mail, as text and as pictures.

mod cells;
#[cfg(test)]
mod tests;

use std::path::PathBuf;

use ratatui::{
    Terminal,
    backend::TestBackend,
    buffer::{Buffer, Cell},
};
use unicode_width::UnicodeWidthStr;

pub(crate) use self::cells::{GROUND, INK, drawing, rgb};
use super::{Effect, Model, QueryId, UiAction};
use crate::{
    access::{SessionRequest, audit_log::sha256},
    plant::request_refusal::RequestRefusal,
    t,
};

/// Files of a screen that wait to be put on record, the next one first.
#[derive(Debug, Default)]
pub struct ScreenDump {
    files: Vec<(PathBuf, Vec<u8>)>,
    /// The number of the request that puts the next one on record.
    number: u32,
    /// One of them was not written: no later one hides that.
    failed: bool,
}

/// Takes the screen as it is and asks for it to be put on record.
pub(super) fn begin(model: &mut Model) -> Vec<UiAction> {
    let drawn = drawn(model);
    let cx = model.present_cx();
    let stamp = cx.now.to_zoned(cx.def().time_zone.clone()).strftime("%Y-%m-%d-%H%M%S");
    let name = format!("screen-{stamp}-{}", model.tabs.shown.title().to_lowercase());
    let path = |end: &str| cx.def().report.folder.join(format!("{name}.{end}"));
    let drawing = drawing(&drawn);
    let mut files = vec![(path("txt"), text(&drawn).into_bytes()), (path("svg"), drawing.svg())];
    files.extend(drawing.png().map(|png| (path("png"), png)));
    (model.screen_dump.files, model.screen_dump.failed) = (files, false);
    next(model)
}

/// Requests the record of the next file.
fn next(model: &mut Model) -> Vec<UiAction> {
    let dump = &mut model.screen_dump;
    let Some((path, bytes)) = dump.files.first() else { return Vec::new() };
    dump.number = dump.number.wrapping_add(1);
    let request = SessionRequest::Exported { file: path.display().to_string(), sha256: Ok(sha256(bytes)) };
    vec![UiAction::Do(Effect::SessionRequest(QueryId { tab: None, number: dump.number }, request))]
}

/// The record of a file was made, or refused.
pub(super) fn on_request_done(model: &mut Model, number: u32, answer: Result<(), RequestRefusal>) -> Vec<UiAction> {
    let dump = &mut model.screen_dump;
    if number != dump.number || dump.files.is_empty() {
        return Vec::new();
    }
    let (path, bytes) = dump.files.remove(0);
    if let Err(why) = answer {
        dump.files.clear();
        model.note = Some(t!("The screen was not saved: {why}", why).into());
        return Vec::new();
    }
    let save = UiAction::Do(Effect::SaveReport { tab: None, path, bytes, new: false });
    std::iter::once(save).chain(next(model)).collect()
}

/// A file was written, or not. After one that was not, no other one is begun.
pub(super) fn on_saved(model: &mut Model, result: Result<PathBuf, String>) {
    let dump = &mut model.screen_dump;
    if dump.failed {
        return;
    }
    if result.is_err() {
        dump.failed = true;
        dump.files.clear();
    }
    model.note = Some(match result {
        Ok(path) => {
            let (name, folder) = (path.file_name().unwrap_or_default(), path.parent().unwrap_or(&path));
            t!("Screen saved: {name} in {folder}", name = name.to_string_lossy(), folder = folder.display()).into()
        }
        Err(why) => t!("The screen was not saved: {why}", why).into(),
    });
}

fn drawn(model: &Model) -> Buffer {
    let mut terminal =
        Terminal::new(TestBackend::new(model.screen.width, model.screen.height)).unwrap_or_else(|never| match never {});
    let frame = terminal.draw(|frame| super::view(model, frame));
    frame.map(|frame| frame.buffer.clone()).unwrap_or_else(|never| match never {})
}

/// The characters of a screen, one line a row.
pub(crate) fn text(buffer: &Buffer) -> String {
    let rows = buffer.content.chunks(usize::from(buffer.area.width.max(1)));
    rows.map(|row| row_text(row) + "\n").collect()
}

/// A row without the cells that a wide letter covers.
fn row_text(row: &[Cell]) -> String {
    let mut free = 0;
    let shown = row.iter().enumerate().filter(|(x, cell)| {
        let covered = *x < free;
        free = if covered { free } else { x + cell.symbol().width().max(1) };
        !covered
    });
    shown.map(|(_, cell)| cell.symbol()).collect::<String>().trim_end().to_owned()
}
