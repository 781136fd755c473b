//! What a station has said, a line each on standard output, which outlives it: what was acknowledged, which alarms were
//! unacknowledged, what the figures of an hour were. Later lives of the station are held to it.

use std::{collections::BTreeMap, fmt, path::Path};

use jiff::Timestamp;

/// Of all lives so far.
#[derive(Debug, Default)]
pub struct Facts {
    /// Notes of actions that were shown as recorded.
    pub acknowledged: Vec<String>,
    /// Alarms that were unacknowledged for some seconds, by name; of the last life only, and none that an operator worked on.
    pub unacknowledged: Vec<String>,
    /// How many samples were stored before an instant.
    pub stored: Vec<(Timestamp, usize)>,
    /// Procedures that were started on record, and have not ended; of the last life only.
    pub procedures: Vec<String>,
    /// Users who were added on record, with their passwords.
    pub users: BTreeMap<String, String>,
    /// The figures of an hour, as they were first shown.
    pub figures: BTreeMap<Timestamp, String>,
}

/// Says one.
pub fn say(word: &str, what: impl fmt::Display) {
    println!("{word} {what}");
}

/// What does not hold. The run goes on: there may be more.
pub fn wrong(what: impl fmt::Display) {
    say("wrong", what);
}

impl Facts {
    pub fn read(path: &Path) -> Facts {
        let mut facts = Facts::default();
        for line in std::fs::read_to_string(path).unwrap_or_default().lines() {
            let (word, rest) = line.split_once(' ').unwrap_or((line, ""));
            let two = || rest.split_once(' ').unwrap();
            match word {
                "life" => {
                    facts.unacknowledged.clear();
                    facts.procedures.clear();
                }
                "recorded" => facts.acknowledged.push(rest.to_owned()),
                "unacknowledged" => {
                    facts.unacknowledged = rest.split(',').filter(|name| !name.is_empty()).map(str::to_owned).collect()
                }
                "procedure" => match rest.split_once("at work ") {
                    Some((_, name)) => facts.procedures.push(name.to_owned()),
                    None => facts.procedures.clear(),
                },
                "user" => match two() {
                    (user, "?") => drop(facts.users.remove(user)),
                    (user, password) => drop(facts.users.insert(user.to_owned(), password.to_owned())),
                },
                "stored" => facts.stored.push((two().0.parse().unwrap(), two().1.parse().unwrap())),
                "figures" => drop(facts.figures.entry(two().0.parse().unwrap()).or_insert(two().1.to_owned())),
                _ => {}
            }
        }
        facts
    }
}
