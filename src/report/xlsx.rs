//! A report as an Excel workbook: the facts on the first sheet, a sheet for each table, the curves as charts over their values.

use jiff::{Timestamp, tz::TimeZone};
use rust_xlsxwriter::{
    Chart, ChartEmptyCells, ChartLine, ChartType, DocProperties, ExcelDateTime, Format, FormatAlign, FormatBorder,
    Workbook, Worksheet, XlsxError,
};

use super::{
    ReportFormat, Style, chart,
    curve::Bucket,
    document::{Cell, ColumnKind, Content, Document, Fact, Section, Table, Times, offset, plain},
};
use crate::{
    plant::{
        def::Paper,
        exact::digits,
        number::{to_u8, to_u16, to_u32},
    },
    t,
};

/// The format `xlsx`.
#[derive(Debug)]
pub struct Xlsx;

impl ReportFormat for Xlsx {
    fn name(&self) -> &'static str {
        "xlsx"
    }
    fn about(&self) -> &'static str {
        "an Excel workbook with a sheet for each table"
    }

    fn extension(&self) -> &'static str {
        "xlsx"
    }

    fn render(&self, document: &Document, style: &Style) -> Result<Vec<u8>, String> {
        document.locale.within(|| workbook(document, style)).map_err(|error| error.to_string())
    }
}

/// Letters of the name of a sheet at most, and what it may not contain.
const NAME_MAX: usize = 31;
const NAME_WITHOUT: [char; 7] = ['[', ']', ':', '*', '?', '/', '\\'];

/// The least, or the greatest, value of a column of a curve.
type Edge = fn(&Bucket) -> f64;

/// Of curves, each with its two edges.
const COLOURS: [&str; 6] = ["1F77B4", "D62728", "2CA02C", "9467BD", "FF7F0E", "17BECF"];

fn workbook(document: &Document, style: &Style) -> Result<Vec<u8>, XlsxError> {
    let mut book = Workbook::new();
    let made = date_time(&TimeZone::UTC, document.until)?;
    let properties = DocProperties::new().set_title(format!("{}: {}", document.title, document.heading));
    book.set_properties(&properties.set_author("sightglass").set_creation_datetime(&made));
    facts(&mut book, document)?;
    for section in &document.sections {
        match &section.content {
            Content::Table(rows) => table(named(book.add_worksheet(), &section.title)?, document, rows)?,
            Content::Charts(charts) => curves(&mut book, document, &section.title, charts)?,
            Content::Facts(_) | Content::Signatures(_) => {}
        }
    }
    for sheet in book.worksheets_mut() {
        // By Excel's numbers of papers: Letter is 1, A4 is 9. One page wide, as many pages as it takes.
        sheet.set_paper_size(if style.paper == Paper::A4 { 9 } else { 1 }).set_print_fit_to_pages(1, 0).set_landscape();
    }
    book.save_to_buffer()
}

fn named<'a>(sheet: &'a mut Worksheet, title: &str) -> Result<&'a mut Worksheet, XlsxError> {
    let name: String = title.chars().filter(|letter| !NAME_WITHOUT.contains(letter)).take(NAME_MAX).collect();
    sheet.set_name(name)
}

fn head() -> Format {
    Format::new().set_bold().set_background_color("F2F2F2").set_border_bottom(FormatBorder::Thin).set_text_wrap()
}

/// What it is, and the facts of all sections.
fn facts(book: &mut Workbook, document: &Document) -> Result<(), XlsxError> {
    let sheet = book.add_worksheet();
    let name = |section: &&Section| matches!(section.content, Content::Facts(_));
    let title = document.sections.iter().find(name).map_or(document.heading.as_str(), |section| &section.title);
    named(sheet, title)?.set_column_width(0, 30)?.set_column_width(1, 40)?;
    let title = Format::new().set_bold().set_font_size(14);
    let mut row = 0;
    let times = document.times_line();
    let lines = [document.logo.as_str(), &document.title, &document.heading, &times];
    for line in lines.into_iter().filter(|line| !line.is_empty()) {
        let format = if line == document.title { title.clone() } else { Format::new() };
        sheet.write_string_with_format(row, 0, line, &format)?;
        row += 1;
    }
    for section in &document.sections {
        let Content::Facts(facts) = &section.content else { continue };
        row += 1;
        sheet.write_string_with_format(row, 0, &section.title, &head())?;
        row += 1;
        for Fact { name, cell, .. } in facts {
            sheet.write_string(row, 0, name)?;
            write(sheet, (row, 1), cell, cell.kind(), &document.zone)?;
            row += 1;
        }
    }
    Ok(())
}

/// A table with frozen heads and filters. An instant takes two columns, the second has its offset.
fn table(sheet: &mut Worksheet, document: &Document, table: &Table) -> Result<(), XlsxError> {
    let mut column = 0;
    let places: Vec<u16> = table
        .columns
        .iter()
        .map(|of| {
            let place = column;
            column += if of.kind.is_time() { 2 } else { 1 };
            place
        })
        .collect();
    for (of, place) in table.columns.iter().zip(&places) {
        let align = if of.kind == ColumnKind::Number { FormatAlign::Right } else { FormatAlign::Left };
        sheet.write_string_with_format(0, *place, &of.heading, &head().set_align(align))?;
        if of.kind.is_time() {
            sheet.write_string_with_format(0, place + 1, plain(t!("offset")), &head())?;
        }
    }
    for (row, cells) in (1..).zip(&table.rows) {
        for ((cell, of), place) in cells.iter().zip(&table.columns).zip(&places) {
            write(sheet, (row, *place), cell, of.kind, &document.zone)?;
            if let Cell::Time(at) = cell {
                sheet.write_string(row, place + 1, offset(&document.zone, *at))?;
            }
        }
    }
    sheet.set_freeze_panes(1, 0)?.set_repeat_rows(0, 0)?;
    sheet.autofilter(0, 0, to_u32(table.rows.len()), column.saturating_sub(1))?;
    sheet.autofit();
    Ok(())
}

/// A text is never a formula, whatever it begins with.
fn write(
    sheet: &mut Worksheet,
    (row, column): (u32, u16),
    cell: &Cell,
    kind: ColumnKind,
    zone: &TimeZone,
) -> Result<(), XlsxError> {
    match cell {
        Cell::Empty => {}
        Cell::Text(text) => {
            sheet.write_string(row, column, text)?;
        }
        // A sheet keeps 15 digits of a number.
        Cell::Number(value, decimals) if value.rest().is_some() => {
            let format = Format::new().set_align(FormatAlign::Right);
            sheet.write_string_with_format(row, column, digits(*value, *decimals), &format)?;
        }
        Cell::Number(value, decimals) => {
            // The figure of the report, not a finer one behind it.
            let figure = digits(*value, *decimals).parse().unwrap_or(value.near());
            sheet.write_number_with_format(row, column, figure, &number_format(*decimals))?;
        }
        Cell::Time(at) => {
            let form = if kind == ColumnKind::Milliseconds { "yyyy-mm-dd hh:mm:ss.000" } else { "yyyy-mm-dd hh:mm:ss" };
            let format = Format::new().set_num_format(form).set_align(FormatAlign::Left);
            sheet.write_datetime_with_format(row, column, date_time(zone, *at)?, &format)?;
        }
    }
    Ok(())
}

fn number_format(decimals: Option<u8>) -> Format {
    match decimals {
        None => Format::new(),
        Some(0) => Format::new().set_num_format("0"),
        Some(decimals) => Format::new().set_num_format(format!("0.{}", "0".repeat(decimals.into()))),
    }
}

/// Local time: a sheet has no zones.
fn date_time(zone: &TimeZone, at: Timestamp) -> Result<ExcelDateTime, XlsxError> {
    let local = at.to_zoned(zone.clone());
    let unsigned = |part: i8| to_u8(part);
    let day = ExcelDateTime::from_ymd(to_u16(local.year()), unsigned(local.month()), unsigned(local.day()))?;
    day.and_hms_milli(
        to_u16(local.hour()),
        unsigned(local.minute()),
        unsigned(local.second()),
        to_u16(local.millisecond()),
    )
}

/// The least and the greatest values of all charts, side by side, and the charts over them. A sheet has no zones: the times of a
/// chart have the offset of its begin, so that they run forward over a change of the clocks.
fn curves(book: &mut Workbook, document: &Document, title: &str, charts: &[chart::Chart]) -> Result<(), XlsxError> {
    let sheet = named(book.add_worksheet(), title)?;
    let name = sheet.name();
    let width = |chart: &chart::Chart| 2 * to_u16(chart.curves.len()) + 2;
    let (mut first, mut top, beside) = (0, 1, charts.iter().map(width).sum());
    for chart in charts {
        let Some(begin) = chart.curves.first() else { continue };
        let zone = document.zone.to_offset(begin.from).to_time_zone();
        let mut heading = plain(t!("time"));
        if document.times == Times::Offset {
            heading = format!("{heading} {}", offset(&zone, begin.from));
        }
        sheet.write_string_with_format(0, first, heading, &head())?.set_column_width(first, 20)?;
        let rows = chart.curves.iter().map(|curve| curve.columns.len()).max().unwrap_or(0);
        for row in 0..rows {
            let after = jiff::SignedDuration::from_secs_f64(begin.step * row as f64);
            let at = begin.from.checked_add(after).unwrap_or(begin.from);
            write(sheet, (to_u32(row + 1), first), &Cell::Time(at), ColumnKind::Time, &zone)?;
        }
        let mut drawn = Chart::new(ChartType::ScatterStraight);
        drawn.title().set_name(&chart.title);
        let is_long = chart.to.duration_since(chart.from).as_hours() > 36;
        drawn.x_axis().set_num_format(if is_long { "mm-dd" } else { "hh:mm" });
        drawn.show_empty_cells_as(ChartEmptyCells::Gaps).set_width(900).set_height(360);
        for (number, curve) in (0..).zip(&chart.curves) {
            let edges: [(&str, Edge); 2] = [(t!("min"), |of| of.min), (t!("max"), |of| of.max)];
            for (place, (word, edge)) in (first + 1 + 2 * number..).zip(edges) {
                let heading = [curve.name.as_str(), &curve.unit, &plain(word)].join(" ").replace("  ", " ");
                sheet.write_string_with_format(0, place, heading, &head())?;
                for (row, bucket) in (1..).zip(&curve.columns) {
                    let value = Cell::number(bucket.as_ref().map(edge), curve.decimals);
                    write(sheet, (row, place), &value, ColumnKind::Number, &zone)?;
                }
                drawn
                    .add_series()
                    .set_name((name.as_str(), 0, place))
                    .set_categories((name.as_str(), 1, first, to_u32(rows), first))
                    .set_values((name.as_str(), 1, place, to_u32(rows), place))
                    .set_format(
                        ChartLine::new().set_color(COLOURS[usize::from(number) % COLOURS.len()]).set_width(1.0),
                    );
            }
        }
        sheet.insert_chart(top, beside, &drawn)?;
        top += 20;
        first += width(chart);
    }
    sheet.set_freeze_panes(1, 0)?;
    Ok(())
}
