//! Register maps as others write them: read from any of their forms into one model, which the screen shows, a profile
//! says and exporters write.
//!
//! ```text
//!  bytes ─ container ─ format ─ list ─┬─ screen
//!         (text, tree, (one file      ├─ profile ─ TOML
//!          rows)        a form)       └─ export
//! ```

pub mod named;
pub mod list;
mod container;
pub mod export;
mod format;
pub mod profile;
#[cfg(test)]
mod tests;

use self::{
    container::{html, json, node::Tree, text, toml, workbook, xml, yaml},
    list::{List, ListContext, cells},
};
use crate::{plant::keyword::keyword_enum, t};

/// Most bytes of a file that is read.
pub const BYTES_MAX: u64 = 8 << 20;

keyword_enum! {
    /// What a file is.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    pub enum Format: "format" {
        /// Rows of any maker or manual: CSV, columns of a PDF, a table of Markdown, a list of ioBroker or NIBE.
        List => "list",
        /// The sheets of a workbook, the same.
        Workbook => "xlsx",
        /// The tables of a page, the same.
        Html => "html",
        /// `modbus:` of Home Assistant.
        HomeAssistant => "homeassistant",
        /// `modbus_controller` of ESPHome.
        EspHome => "esphome",
        /// `[[inputs.modbus]]` of Telegraf.
        Telegraf => "telegraf",
        /// A device of modbus_local_gateway.
        LocalGateway => "modbus_local_gateway",
        /// An inverter of ha-solarman.
        Solarman => "solarman",
        /// A template of wb-mqtt-serial.
        WirenBoard => "wb-mqtt-serial",
        /// A model of SunSpec.
        SunSpec => "sunspec",
        /// A project of ModbusScope.
        ModbusScope => "modbusscope",
        /// The JSON of MTUI.
        Mtui => "mtui",
        /// The export of ModMaster and Modsak.
        ModMaster => "modmaster",
    }
}

/// Reads a file of any form that is known; else says what it is and what can be read.
pub fn read(bytes: &[u8], context: &ListContext) -> List {
    let list = if workbook::is_archive(bytes) && context.format.is_none_or(|format| format == Format::Workbook) {
        List { format: Some(Format::Workbook), ..of_workbook(bytes, context) }
    } else {
        match text::decode(bytes) {
            Err(why) => List::refused(why),
            Ok(text) => of_text(text.trim_start_matches('\u{FEFF}').trim_end_matches('\u{1A}'), context),
        }
    };
    let known = t!(
        "What can be read: CSV and other text with a heading (address, name, type, scale, unit, table, in any order), columns of a PDF, tables of Markdown, HTML and JSON, sheets of Excel (.xlsx), lists of ioBroker and NIBE, Home Assistant, ESPHome, Telegraf, modbus_local_gateway, solarman, wb-mqtt-serial, models of SunSpec (JSON), ModbusScope, MTUI, and exports of ModMaster and Modsak."
    );
    let refused = list.refused.clone().or_else(|| nothing(&list));
    List { refused: refused.map(|why| format!("{why}. {known}")), ..list }
}

/// A file of a known form without a row is none.
fn nothing(list: &List) -> Option<String> {
    let is_empty = list.named.is_empty() && list.calculated.is_empty() && list.problems.is_empty();
    is_empty.then(|| t!("it is empty").to_owned())
}

fn of_text(text: &str, context: &ListContext) -> List {
    let body = text.trim_start();
    let form = match context.format {
        Some(format) => Ok(format),
        None => format::foreign::format_of(body),
    };
    let format = match form {
        Ok(format) => format,
        Err(form) => {
            let list = of_json(text, context);
            return list.unwrap_or_else(|| List::refused(t!("it is {form}", form)));
        }
    };
    let tree = |parsed: Result<Tree, String>, read: fn(&Tree, &ListContext) -> List| match parsed {
        Ok(tree) => read(&tree, context),
        Err(why) => List::refused(why),
    };
    let list = match format {
        Format::List => list::parse(text, context),
        Format::Workbook => List::refused(t!("it is not an Excel workbook (.xlsx): {error}", error = "PK")),
        Format::Html => of_tables(html::tables(text), context),
        Format::HomeAssistant => tree(yaml::parse(text), format::home_assistant::read),
        Format::EspHome => tree(yaml::parse(text), format::esphome::read),
        Format::LocalGateway => tree(yaml::parse(text), format::local_gateway::read),
        Format::Solarman => tree(yaml::parse(text), format::solarman::read),
        Format::Telegraf => tree(toml::parse(text), format::telegraf::read),
        Format::WirenBoard => tree(json::parse(text), format::wiren_board::read),
        Format::SunSpec => tree(json::parse(text), format::sunspec::read),
        Format::ModbusScope => tree(xml::parse(text), format::modbusscope::read),
        Format::Mtui => {
            let list = format::mtui::read(body);
            let is_none = context.format.is_none() && (list.refused.is_some() || nothing(&list).is_some());
            let table = is_none.then(|| of_json(text, context)).flatten();
            return table.unwrap_or(List { format: Some(format), ..list });
        }
        Format::ModMaster => format::modmaster::read(body, context),
    };
    List { format: Some(format), ..list }
}

/// The arrays of JSON of no program that is known, as tables.
fn of_json(text: &str, context: &ListContext) -> Option<List> {
    let tables = json::tables(&json::parse(text).ok()?)?;
    Some(List { format: Some(Format::List), ..of_tables(tables, context) })
}

/// All tables with a heading; where there is none, what the largest of them is not.
fn of_tables(tables: Vec<Vec<cells::Cells>>, context: &ListContext) -> List {
    let mut all = List::default();
    let mut refused = None;
    for rows in tables {
        let rows = cells::without_rules(rows, &context.means);
        let list = list::of_cells(&rows, true, context);
        match list.refused {
            Some(why) => refused = refused.or(Some(why)),
            None => all.append(list, ""),
        }
    }
    let is_empty = all.named.is_empty() && all.problems.is_empty();
    List { refused: refused.filter(|_| is_empty), ..all }
}

fn of_workbook(bytes: &[u8], context: &ListContext) -> List {
    let (sheets, hidden) = match workbook::sheets(bytes) {
        Ok(sheets) => sheets,
        Err(why) => return List::refused(why),
    };
    let (mut all, mut refused, many) = (List::default(), None, 1 < sheets.len());
    all.warnings.extend(hidden.into_iter().map(|name| t!("sheet {name} is hidden, and not read", name)));
    for (name, rows) in sheets {
        // Its name may be that of a table.
        let title = list::titled(&name);
        let rows = title.into_iter().chain(cells::without_rules(rows, &context.means)).collect::<Vec<_>>();
        let list = list::of_cells(&rows, true, context);
        match list.refused {
            Some(why) if many => all.warnings.push(t!("sheet {name}: {why}", name, why)),
            Some(why) => refused = Some(why),
            None => all.append(list, &if many { format!("{name}: ") } else { String::new() }),
        }
    }
    List { refused, ..all }
}
