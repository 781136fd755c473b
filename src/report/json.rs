//! A report as JSON, for programs: its sections by name, rows by the English headings, instants with offset.

use serde_json::{Map, Value, json};

use super::{
    ReportFormat, Style,
    csv::{iso, iso_millis},
    document::{Cell, ColumnKind, Content, Document, Fact, Table},
};
use crate::plant::exact::digits;

/// The format `json`.
#[derive(Debug)]
pub struct Json;

impl ReportFormat for Json {
    fn name(&self) -> &'static str {
        "json"
    }
    fn about(&self) -> &'static str {
        "for programs"
    }

    fn extension(&self) -> &'static str {
        "json"
    }

    fn render(&self, document: &Document, _style: &Style) -> Result<Vec<u8>, String> {
        let mut all = Map::new();
        all.insert("title".into(), json!(document.title));
        all.insert("heading".into(), json!(document.heading));
        for section in &document.sections {
            let content = match &section.content {
                Content::Facts(facts) => {
                    let fact = |fact: &Fact| (fact.id.to_owned(), value(document, &fact.cell, fact.cell.kind()));
                    Value::Object(facts.iter().map(fact).collect())
                }
                Content::Table(table) => rows(document, table),
                Content::Charts(_) | Content::Signatures(_) => continue,
            };
            all.insert(section.kind.word().into(), content);
        }
        serde_json::to_vec_pretty(&all).map_err(|error| error.to_string())
    }
}

fn rows(document: &Document, table: &Table) -> Value {
    let row = |row: &Vec<Cell>| -> Value {
        let cells = row.iter().zip(&table.columns);
        Value::Object(cells.map(|(cell, of)| (of.id.clone(), value(document, cell, of.kind))).collect())
    };
    table.rows.iter().map(row).collect()
}

/// A number with the decimals of the report.
fn value(document: &Document, cell: &Cell, kind: ColumnKind) -> Value {
    match cell {
        Cell::Empty => Value::Null,
        Cell::Text(text) => json!(text),
        Cell::Number(number, decimals) => serde_json::from_str(&digits(*number, *decimals)).unwrap_or(Value::Null),
        Cell::Time(at) if kind == ColumnKind::Milliseconds => json!(iso_millis(&document.zone, *at)),
        Cell::Time(at) => json!(iso(&document.zone, *at)),
    }
}
