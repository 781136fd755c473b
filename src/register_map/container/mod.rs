//! What holds the rows of a file: text, a tree of keys, a workbook, tables of a page.

pub mod html;
pub mod json;
pub mod node;
pub mod text;
pub mod toml;
pub mod workbook;
pub mod xml;
pub mod yaml;
