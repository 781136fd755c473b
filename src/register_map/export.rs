//! A device profile in the form of another program; what that cannot say is left out, and listed.

mod csv;
mod home_assistant;
mod telegraf;

use crate::plant::{
    PlantDef,
    keyword::keyword_enum,
    tag::{Decimals, TagDef},
};

keyword_enum! {
    /// What a profile can be written as.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    pub enum Target: "format" {
        /// The `modbus:` section of Home Assistant.
        HomeAssistant => "homeassistant",
        /// `[[inputs.modbus]]` of Telegraf.
        Telegraf => "telegraf",
        /// A list with a heading, which this program and a spreadsheet read.
        Csv => "csv",
    }
}

/// A text, and what is not in it.
#[derive(Debug, Default, PartialEq)]
pub struct Exported {
    /// The file.
    pub text: String,
    /// How many tags it has.
    pub count: usize,
    /// `TAG: why it is left out`.
    pub left_out: Vec<String>,
    /// `TAG: what of it is lost`.
    pub lost: Vec<String>,
}

/// Writes the tags of a device.
pub fn export(plant: &PlantDef, target: Target) -> Exported {
    let mut exported = Exported::default();
    let mut tags = Vec::new();
    for tag in &plant.tags {
        match left_out(tag) {
            Some(why) => exported.left_out.push(format!("{}: {why}", tag.short)),
            None => tags.push(tag),
        }
    }
    match target {
        Target::HomeAssistant => home_assistant::write(plant, &tags, &mut exported),
        Target::Telegraf => telegraf::write(plant, &tags, &mut exported),
        Target::Csv => csv::write(&tags, &mut exported),
    }
    exported
}

/// Why no other program can have it.
fn left_out(tag: &TagDef) -> Option<&'static str> {
    if tag.calculation.is_some() {
        return Some("it is calculated");
    }
    match tag.decimals {
        Decimals::Fixed(_) => None,
        Decimals::From(_) | Decimals::PowerFrom(_) => Some("another register says how it is scaled"),
    }
}

impl Exported {
    /// Notes what of a tag is lost, where it has it.
    fn lose(&mut self, tag: &TagDef, what: &[(bool, &str)]) {
        let lost: Vec<&str> = what.iter().filter(|(has, _)| *has).map(|(_, what)| *what).collect();
        if !lost.is_empty() {
            self.lost.push(format!("{}: {}", tag.short, lost.join(", ")));
        }
    }
}

/// Decimals of a tag that has fixed ones.
fn decimals(tag: &TagDef) -> u8 {
    if let Decimals::Fixed(decimals) = tag.decimals { decimals } else { 0 }
}

/// The name that the other program shows.
fn title(tag: &TagDef) -> &str {
    if tag.label.is_empty() { &tag.short } else { &tag.label }
}

/// A text in double quotes, as JSON, YAML and TOML have it.
fn quoted(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}
