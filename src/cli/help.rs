//! `sightglass help`: the pages of the manual, and the options of each command.

use clap::CommandFactory;

use super::{CliError, say};
use crate::profile::FORMAT_PAGE;

/// The pages: name, what it is about, text.
const TOPICS: [(&str, &str, &str); 10] = [
    ("commands", "what each command does", include_str!("help/commands.md")),
    ("screen", "tabs, keys, and what the signs mean", include_str!("help/screen.md")),
    ("station", "a station on a panel PC: installation, users, rights", include_str!("help/station.md")),
    ("reports", "reports by hand, automatic reports, and how to verify them", include_str!("help/reports.md")),
    ("mqtt", "values for other systems: topics, what arrives, what an outage does", include_str!("help/mqtt.md")),
    ("audit-log", "the audit log: what it holds and what it promises", include_str!("help/audit.md")),
    ("reliability", "what you can rely on, and what happens when something fails", include_str!("help/reliability.md")),
    ("devices", "the shipped devices, and how well each is known", include_str!("help/devices.md")),
    (
        "wiring",
        "RS-485: A and B, termination, bias, number of units, what each fault looks like",
        include_str!("help/wiring.md"),
    ),
    ("format", "every key of plant files and profiles, and the pictures of the mimic", FORMAT_PAGE),
];

/// Arguments of `help`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A page of the manual, or a command
    #[arg(value_name = "TOPIC")]
    topic: Option<String>,
}

/// Prints a page, the options of a command, or the list of pages.
pub fn main(args: &Args) -> Result<(), CliError> {
    let Some(topic) = &args.topic else {
        say("sightglass help TOPIC\n");
        for (name, about, _) in TOPICS {
            say(&format!("  {name:12} {about}"));
        }
        say(
            "\n`sightglass --help` lists the commands, `sightglass help COMMAND` the options of one; on the screen, ? lists the keys.",
        );
        return Ok(());
    };
    if let Some((_, _, text)) = TOPICS.iter().find(|(name, ..)| name == topic) {
        say(text.trim_end());
        return Ok(());
    }
    match options(topic) {
        Some(options) => {
            say(&options);
            Ok(())
        }
        None => {
            let names: Vec<&str> = TOPICS.iter().map(|(name, ..)| *name).collect();
            Err(CliError::Usage(format!("no page and no command `{topic}`; pages: {}", names.join(", "))))
        }
    }
}

/// The options of a command.
fn options(command: &str) -> Option<String> {
    let mut program = super::Args::command();
    // Only a built command knows the names that stand before its own.
    program.build();
    program.find_subcommand_mut(command).map(|command| command.render_long_help().to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_command_stands_on_the_page_of_commands() {
        let page = TOPICS[0].2;
        for command in super::super::Args::command().get_subcommands().map(clap::Command::get_name) {
            assert!(page.contains(&format!("`sightglass {command}")), "{command}");
        }
    }

    #[test]
    fn the_arguments_are_well_formed() {
        super::super::Args::command().debug_assert();
    }

    #[test]
    fn the_usage_of_a_command_begins_with_the_program() {
        let help = options("attach").unwrap_or_default();
        assert!(help.contains("Usage: sightglass attach"), "{help}");
    }

    #[test]
    fn a_page_is_no_command() {
        for (name, about, text) in TOPICS {
            assert!(super::super::Args::command().find_subcommand(name).is_none(), "{name}");
            assert!(text.starts_with("# ") && !about.is_empty(), "{name}");
        }
    }
}
