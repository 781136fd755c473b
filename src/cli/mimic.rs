//! `sightglass mimic`: draws the mimic of a plant file with made-up values, again whenever the file is saved.

use std::{
    io::{IsTerminal, Write},
    path::{Path, PathBuf},
    sync::Arc,
    time::Duration,
};

use crossterm::{cursor, queue, terminal};
use ratatui::{
    backend::{Backend, CrosstermBackend},
    buffer::Buffer,
};

use super::{CliError, say};
use crate::{
    plant::{PlantDef, visible::visible},
    profile::{self, Search},
    ui::{self, preview, theme::Theme},
};

/// Rows that a terminal has beside the mimic.
const CHROME_ROWS: u16 = 6;
/// Between two frames, each of the files as they are then.
const EVERY: Duration = Duration::from_millis(500);

/// Arguments of `mimic`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A plant file, or the name of a shipped plant
    plant: PathBuf,
    /// Draw again whenever the file is saved, until Ctrl-C; values move
    #[arg(long)]
    watch: bool,
    /// Columns and rows of the terminal [default: this one, or 80x24]
    #[arg(long, value_name = "COLUMNSxROWS", value_parser = size)]
    size: Option<(u16, u16)>,
    /// Number of the page, from 1
    #[arg(long, value_name = "NUMBER", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=100))]
    page: u16,
}

fn size(text: &str) -> Result<(u16, u16), String> {
    let parsed = text.split_once('x').and_then(|(columns, rows)| columns.parse().ok().zip(rows.parse().ok()));
    parsed
        .filter(|(columns, rows): &(u16, u16)| (20..=500).contains(columns) && (10..=200).contains(rows))
        .ok_or_else(|| "expected columns and rows such as 120x40".to_owned())
}

/// Draws once, as text; or again and again.
pub fn main(args: &Args) -> Result<(), CliError> {
    let terminal = || std::io::stdout().is_terminal().then(|| terminal::size().ok()).flatten();
    let size = || args.size.or_else(terminal).unwrap_or((80, 24));
    if args.watch {
        return watch(args, size);
    }
    let plant = load(&args.plant)?;
    let page = page_of(&plant, args.page)?;
    let drawn = draw(&plant, page, size(), 0);
    ui::text_of(&drawn).lines().for_each(say);
    Ok(())
}

fn load(path: &Path) -> Result<Arc<PlantDef>, CliError> {
    profile::load(path, &Search::usual()).map_err(|errors| CliError::Profile(Box::new(errors)))
}

fn page_of(plant: &PlantDef, number: u16) -> Result<usize, CliError> {
    let (page, pages) = (usize::from(number) - 1, plant.mimic.pages.len());
    if page < pages || pages == 0 { Ok(page) } else { Err(CliError::Usage(format!("page {number} of {pages} pages"))) }
}

fn draw(plant: &Arc<PlantDef>, page: usize, (columns, rows): (u16, u16), phase: u32) -> Buffer {
    let theme = Theme::detect(|name| std::env::var(name).ok());
    preview(plant, page, (columns, rows.saturating_sub(CHROME_ROWS)), phase, &theme)
}

/// Loads the plant file and its device profiles twice a second; what is wrong in them is shown instead of the picture.
fn watch(args: &Args, size: impl Fn() -> (u16, u16)) -> Result<(), CliError> {
    let failed = CliError::io("the terminal");
    let mut shown = None;
    for phase in 0.. {
        let loaded = load(&args.plant).and_then(|plant| Ok((page_of(&plant, args.page)?, plant)));
        let now = (size(), loaded.map_err(|error| error.to_string()));
        let changed = shown.as_ref() != Some(&now);
        let mut out = Vec::new();
        if changed {
            queue!(out, terminal::Clear(terminal::ClearType::All), cursor::MoveTo(0, 0)).map_err(&failed)?;
        }
        match &now.1 {
            Ok((page, plant)) => frame(&mut out, &draw(plant, *page, now.0, phase)).map_err(&failed)?,
            Err(error) if changed => out.extend(visible(error).replace('\n', "\r\n").into_bytes()),
            Err(_) => {}
        }
        shown = Some(now);
        std::io::stdout().write_all(&out).and_then(|()| std::io::stdout().flush()).map_err(&failed)?;
        std::thread::sleep(EVERY);
    }
    Ok(())
}

/// The whole picture with its colours, and the cursor below it.
fn frame(out: &mut Vec<u8>, drawn: &Buffer) -> std::io::Result<()> {
    let mut backend = CrosstermBackend::new(&mut *out);
    let cells = drawn.content.iter().enumerate().map(|(n, cell)| {
        let (x, y) = drawn.pos_of(n);
        (x, y, cell)
    });
    backend.draw(cells)?;
    Backend::flush(&mut backend)?;
    queue!(out, cursor::MoveTo(0, drawn.area.height))
}
