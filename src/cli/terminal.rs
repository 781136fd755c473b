//! What is chosen about a terminal on the command line.

use clap::builder::{PossibleValuesParser, TypedValueParser};

use crate::{text::Language, ui};

/// What every command that starts a terminal takes.
#[derive(Debug, Clone, Default, clap::Args)]
pub struct TerminalArgs {
    /// Language of the screens [default: that of LC_ALL, LC_MESSAGES or LANG, else English]; L changes it
    #[arg(long, value_name = "LANGUAGE", value_parser = language())]
    language: Option<Language>,
}

impl TerminalArgs {
    /// What can be chosen about a terminal.
    pub fn options(&self, leaving: ui::Leaving) -> ui::io::Options {
        let detected = ui::io::Options::new(leaving);
        let language = self.language.unwrap_or(detected.language);
        ui::io::Options { language, language_is_chosen: self.language.is_some(), ..detected }
    }
}

/// Reads the code of a language.
fn language() -> impl TypedValueParser<Value = Language> {
    PossibleValuesParser::new(Language::all().map(Language::code))
        .map(|code| Language::from_code(&code).expect("it is one of them"))
}
