//! A report as one page of HTML without scripts: readable on a phone, curves as SVG.

use std::fmt::Write;

use super::{
    ReportFormat, Style,
    document::{Cell, Column, ColumnKind, Content, Document, Fact, Section, Table},
    drawing::escaped,
};

/// Width of a chart in pixels; a narrow window shrinks it.
const CHART: u16 = 720;

/// Tables scroll sideways in a narrow window; on paper a row is not cut.
const LOOK: &str = "\
body{font:16px/1.45 Sarabun,\"Noto Sans Thai\",system-ui,sans-serif;margin:1rem auto;max-width:60rem;padding:0 .75rem;color:#1a1a1a;background:#fff}\
h1{font-size:1.35rem;margin:.2rem 0}h2{font-size:1.1rem;margin:1.6rem 0 .4rem;border-bottom:1px solid #bbb}\
p{margin:.2rem 0}.wide{overflow-x:auto}table{border-collapse:collapse;font-size:.9rem}\
th,td{padding:.2rem .6rem;text-align:left;vertical-align:top;border-bottom:1px solid #ddd}th{background:#f2f2f2;white-space:nowrap}\
td.n,th.n{text-align:right;font-variant-numeric:tabular-nums}td.t{white-space:nowrap}td{overflow-wrap:break-word}td:first-child{white-space:nowrap}td:last-child:not(.n){min-width:9rem}\
dl{display:grid;grid-template-columns:max-content 1fr;gap:.1rem 1rem;margin:0}dt{color:#555}dd{margin:0;overflow-wrap:anywhere}\
svg{max-width:100%;height:auto}.sign{margin-top:2.2rem;border-top:1px solid #555;max-width:18rem}\
@media print{body{font-size:11px}tr{break-inside:avoid}thead{display:table-header-group}}";

/// The format `html`.
#[derive(Debug)]
pub struct Html;

impl ReportFormat for Html {
    fn name(&self) -> &'static str {
        "html"
    }
    fn about(&self) -> &'static str {
        "one page with curves, also for a phone"
    }

    fn extension(&self) -> &'static str {
        "html"
    }

    fn render(&self, document: &Document, _style: &Style) -> Result<Vec<u8>, String> {
        Ok(document.locale.within(|| page(document)).into_bytes())
    }
}

fn page(document: &Document) -> String {
    let (title, heading) = (escaped(&document.title), escaped(&document.heading));
    let language = document.locale.language.code();
    let times = document.times_line();
    let mut page = format!(
        "<!DOCTYPE html>\n<html lang=\"{language}\"><head><meta charset=\"utf-8\">\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\
         <title>{title} – {heading}</title>\n<style>{LOOK}</style></head><body>\n"
    );
    if !document.logo.is_empty() {
        add(&mut page, format_args!("<p>{}</p>\n", escaped(&document.logo)));
    }
    add(&mut page, format_args!("<h1>{title}</h1>\n<p>{heading}</p>\n<p>{}</p>\n", escaped(&times)));
    for section in &document.sections {
        add(&mut page, format_args!("<h2>{}</h2>\n", escaped(&section.title)));
        body(&mut page, document, section);
    }
    page + "</body></html>\n"
}

/// Writing into a string never fails.
fn add(page: &mut String, what: std::fmt::Arguments) {
    let _ = page.write_fmt(what);
}

fn body(page: &mut String, document: &Document, section: &Section) {
    match &section.content {
        Content::Facts(facts) => {
            page.push_str("<dl>");
            for Fact { name, cell, .. } in facts {
                let words = document.fact(cell);
                add(page, format_args!("<dt>{}</dt><dd>{}</dd>", escaped(name), escaped(&words)));
            }
            page.push_str("</dl>\n");
        }
        Content::Table(rows) => table(page, document, &rows.dense()),
        Content::Charts(charts) => {
            for chart in charts {
                let svg = chart.drawing(&document.zone, CHART).svg();
                add(page, format_args!("<p>{}</p>\n", String::from_utf8_lossy(&svg)));
            }
        }
        Content::Signatures(names) => {
            names.iter().for_each(|name| add(page, format_args!("<p class=\"sign\">{}</p>\n", escaped(name))));
        }
    }
}

fn table(page: &mut String, document: &Document, table: &Table) {
    page.push_str("<div class=\"wide\"><table><thead><tr>");
    for Column { heading, kind, .. } in &table.columns {
        add(page, format_args!("<th{}>{}</th>", class(*kind), escaped(heading)));
    }
    page.push_str("</tr></thead><tbody>\n");
    for row in &table.rows {
        page.push_str("<tr>");
        for (cell, column) in row.iter().zip(&table.columns) {
            let words = if *cell == Cell::Empty { String::new() } else { document.words(cell, column.kind) };
            add(page, format_args!("<td{}>{}</td>", class(column.kind), escaped(&words)));
        }
        page.push_str("</tr>\n");
    }
    page.push_str("</tbody></table></div>\n");
}

fn class(kind: ColumnKind) -> &'static str {
    match kind {
        ColumnKind::Text => "",
        ColumnKind::Number => " class=\"n\"",
        ColumnKind::Time | ColumnKind::Milliseconds => " class=\"t\"",
    }
}
