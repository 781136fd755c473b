//! The sheets of an Excel workbook, as rows of cells.

use std::io::{Cursor, Read};

use calamine::{DataRef, Dimensions, Reader, SheetVisible, Xlsx, XlsxFormulaMetadata};

use crate::{register_map::list::cells::Cells, t};

/// Most bytes of a workbook once it is unpacked.
const UNPACKED_MAX: usize = 96 << 20;
/// Most rows and columns of a sheet that are read.
const ROWS_MAX: u32 = 20_000;
const COLUMNS_MAX: u32 = 256;
const SHEETS_MAX: usize = 100;

/// Is it an archive, as a workbook is?
pub fn is_archive(bytes: &[u8]) -> bool {
    bytes.starts_with(b"PK\x03\x04")
}

/// Name and rows of each sheet that is read, and the names of those that are hidden.
pub type Sheets = (Vec<(String, Vec<Cells>)>, Vec<String>);

/// Name and rows of each sheet that has any and is shown, and the names of those that are not.
pub fn sheets(bytes: &[u8]) -> Result<Sheets, String> {
    check_size(bytes)?;
    let no_book = |error: &dyn std::fmt::Display| t!("it is not an Excel workbook (.xlsx): {error}", error);
    let mut book = Xlsx::new(Cursor::new(bytes)).map_err(|error| no_book(&error))?;
    let mut sheets = Vec::new();
    let of = |is_shown: bool| {
        let all = book.sheets_metadata().iter().filter(|sheet| (sheet.visible == SheetVisible::Visible) == is_shown);
        all.map(|sheet| sheet.name.clone()).take(SHEETS_MAX).collect::<Vec<_>>()
    };
    let (shown, hidden) = (of(true), of(false));
    for name in shown {
        // A sheet that is a chart has no cells.
        if let Ok(mut rows) = rows(&mut book, &name) {
            spread(&mut rows, &book.merge_cells_by_sheet_name(&name).unwrap_or_default());
            sheets.push((name, rows));
        }
    }
    sheets.retain(|(_, rows)| !rows.is_empty());
    Ok((sheets, hidden))
}

/// A small file may be a large one in an archive.
fn check_size(bytes: &[u8]) -> Result<(), String> {
    let broken = |error: &dyn std::fmt::Display| t!("it is not an Excel workbook (.xlsx): {error}", error);
    let mut archive = zip::ZipArchive::new(Cursor::new(bytes)).map_err(|error| broken(&error))?;
    let (mut size, mut buffer) = (0, vec![0; 1 << 16]);
    for n in 0..archive.len() {
        let mut entry = archive.by_index(n).map_err(|error| broken(&error))?;
        loop {
            let read = entry.read(&mut buffer).map_err(|error| broken(&error))?;
            if read == 0 {
                break;
            }
            size += read;
            if UNPACKED_MAX < size {
                return Err(t!("it is nested too deeply, or too large").to_owned());
            }
        }
    }
    Ok(())
}

fn rows(book: &mut Xlsx<Cursor<&[u8]>>, name: &str) -> Result<Vec<Cells>, calamine::XlsxError> {
    let mut cells = book.worksheet_cells_reader(name)?;
    let mut rows: Vec<Cells> = Vec::new();
    while let Some(cell) = cells.next_cell_with_formula_metadata()? {
        let (row, column) = cell.pos;
        let formula = cell.formula.map(|formula| match formula {
            XlsxFormulaMetadata::Normal { formula } => format!("={formula}"),
            _ => "=…".to_owned(),
        });
        // A formula without a value stands for itself: an empty cell would mean something else.
        let text = Some(text(&cell.value)).filter(|text| !text.is_empty()).or(formula).unwrap_or_default();
        if text.is_empty() || COLUMNS_MAX <= column {
            continue;
        }
        if ROWS_MAX <= row {
            break;
        }
        let line = usize::try_from(row).unwrap_or(0) + 1;
        if rows.last().is_none_or(|last| last.line != line) {
            rows.push(Cells { line, cells: Vec::new(), is_unclosed: false, is_ruled: false });
        }
        let Some(last) = rows.last_mut() else { continue };
        let column = usize::try_from(column).unwrap_or(0);
        let width = last.cells.len().max(column + 1);
        last.cells.resize(width, String::new());
        last.cells[column] = text;
    }
    Ok(rows)
}

/// A cell that is merged downwards holds for each of its rows.
fn spread(rows: &mut [Cells], merged: &[Dimensions]) {
    let at = |number: u32| usize::try_from(number).unwrap_or(0);
    for one in merged.iter().filter(|one| one.start.0 < one.end.0 && one.start.1 < COLUMNS_MAX) {
        let (first, last, column) = (at(one.start.0) + 1, at(one.end.0) + 1, at(one.start.1));
        let from = rows.partition_point(|row| row.line < first);
        let to = rows.partition_point(|row| row.line <= last);
        let above = rows.get(from).filter(|row| row.line == first).and_then(|row| row.cells.get(column)).cloned();
        let Some(text) = above.filter(|text| !text.is_empty()) else { continue };
        for row in &mut rows[from + 1..to] {
            let width = row.cells.len().max(column + 1);
            row.cells.resize(width, String::new());
            row.cells[column].clone_from(&text);
        }
    }
}

/// A number of a cell is a float that shows no more digits than it has.
fn text(value: &DataRef<'_>) -> String {
    let text = match value {
        DataRef::Empty => String::new(),
        DataRef::Int(number) => number.to_string(),
        // With the fifteen digits that a spreadsheet has.
        DataRef::Float(number) => format!("{number:.14e}").parse().unwrap_or(*number).to_string(),
        DataRef::Bool(flag) => flag.to_string(),
        DataRef::String(text) => text.clone(),
        DataRef::SharedString(text) => (*text).to_owned(),
        // As a day or time: its number of days is none that anybody has written.
        DataRef::DateTime(time) => {
            let (year, month, day, hour, minute, second, _) = time.to_ymd_hms_milli();
            format!("{year}-{month:02}-{day:02} {hour:02}:{minute:02}:{second:02}")
        }
        DataRef::DateTimeIso(text) | DataRef::DurationIso(text) => text.clone(),
        DataRef::Error(error) => error.to_string(),
    };
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}
