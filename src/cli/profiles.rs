//! `sightglass profiles`: lists the known profiles, finds or prints one, or prints the page about the format.

use crate::profile::{self, Card, Kind, Search, diagnostic::nearest};

use super::{CliError, say};

/// Arguments of `profiles`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Print this profile instead of the list
    #[arg(conflicts_with_all = ["format", "search"])]
    name: Option<String>,
    /// List only devices that fit: by maker, model, kind, name or a tag that they have
    #[arg(long, value_name = "TEXT", conflicts_with = "format")]
    search: Option<String>,
    /// Print the page that explains every key of plant files and profiles, and the pictures of the mimic
    #[arg(long)]
    format: bool,
}

/// Lists, finds or prints.
pub fn main(args: Args) -> Result<(), CliError> {
    let search = Search::usual();
    match args {
        Args { format: true, .. } => say(profile::FORMAT_PAGE.trim_end()),
        Args { name: Some(name), .. } => return print(&name, &search),
        Args { search: Some(words), .. } => {
            let found = profile::find_cards(profile::cards(&search), &words);
            if found.is_empty() {
                return Err(CliError::Failed(format!("no device profile fits `{words}`")));
            }
            list(found);
        }
        Args { .. } => {
            for kind in [Kind::Plant, Kind::Scenario] {
                say(&format!("{}s", kind.word()));
                for listed in profile::list(&search).iter().filter(|listed| listed.kind == kind) {
                    let from = listed.from.as_ref().map_or("shipped".into(), |path| path.display().to_string());
                    say(&format!("  {:24}  {from}", listed.name));
                }
                say("");
            }
            list(profile::cards(&search));
        }
    }
    Ok(())
}

/// The kinds of device in the order of their first profile.
fn list(cards: Vec<Card>) {
    let mut kinds: Vec<&str> = Vec::new();
    for card in &cards {
        if !kinds.contains(&card.listed.folder.as_str()) {
            kinds.push(&card.listed.folder);
        }
    }
    let width = cards.iter().map(|card| card.listed.name.len()).max().unwrap_or_default();
    for (place, kind) in kinds.iter().enumerate() {
        let gap = if place == 0 { "" } else { "\n" };
        let of_kind: Vec<&Card> = cards.iter().filter(|card| card.listed.folder == *kind).collect();
        let kind = if kind.is_empty() { "devices".into() } else { kind.replace('_', " ") };
        say(&format!("{gap}{kind} ({})", of_kind.len()));
        for Card { listed, vendor, model, status, source, tags } in of_kind {
            let from = listed.from.as_ref().map_or(String::new(), |path| format!("{}: ", path.display()));
            let (name, device, tags) = (&listed.name, format!("{vendor} {model}"), tags.len());
            say(&format!("  {name:width$}  {device:40}  {tags:4} tags  {status:8}  {from}{source}"));
        }
    }
}

fn print(name: &str, search: &Search) -> Result<(), CliError> {
    let Some(text) = profile::text_of(name, search) else {
        let names: Vec<String> = profile::list(search).into_iter().map(|listed| listed.name).collect();
        let known: Vec<&str> = names.iter().map(String::as_str).collect();
        let help = match nearest(name, &known) {
            Some(near) => format!("did you mean `{near}`?"),
            None => "`sightglass profiles --search TEXT` finds one".into(),
        };
        return Err(CliError::Usage(format!("no profile `{name}`; {help}")));
    };
    say(text.trim_end());
    Ok(())
}
