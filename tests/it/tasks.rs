//! Ten tasks of an operator in the real program, with the keys that each one takes beside typed text.

use crate::{pty::Terminal, support::simulated_tank};

/// Keys beside typed text that a task may take.
const KEYS_MAX: usize = 5;

/// What an operator does, one after the other.
enum Step {
    /// Presses a key.
    Key(&'static str),
    /// Types a text.
    Text(&'static str),
    /// Reads this on the screen.
    Sees(&'static str),
    /// Sees it go: a window closes.
    Gone(&'static str),
}
use Step::{Gone, Key, Sees, Text};

const ENTER: &str = "\r";
const TAB: &str = "\t";
const ESCAPE: &str = "\x1b";
const DOWN: &str = "\x1b[B";
const LEFT: &str = "\x1b[D";
const PAGE_DOWN: &str = "\x1b[6~";
/// Clears the line that is typed into.
const CLEAR: &str = "\x15";

/// Does it; gives the keys.
fn perform(terminal: &mut Terminal, steps: &[Step]) -> usize {
    for step in steps {
        match step {
            Key(keys) | Text(keys) => terminal.keys(keys),
            Sees(text) => terminal.wait_for(text),
            Gone(text) => terminal.wait_gone(text),
        }
    }
    steps.iter().filter(|step| matches!(step, Key(_))).count()
}

/// Leads back to the mimic from anywhere.
fn return_home(terminal: &mut Terminal) {
    if terminal.shows("PAST") {
        terminal.keys(ESCAPE);
        // Esc and a letter in one go would be Alt and the letter.
        terminal.wait_gone("PAST");
    }
    terminal.keys("1");
    terminal.wait_for("TK-2 cold");
}

type Task = (&'static str, &'static [Step]);

const OPERATING: [Task; 9] = [
    (
        "raw frame behind PV",
        &[Key(":"), Text("tic pv"), Sees("TIC-1.PV"), Key(ENTER), Sees("range"), Key("w"), Sees("01 04")],
    ),
    (
        "SV +5, verified",
        &[Key("s"), Sees("new"), Key(CLEAR), Text("75"), Key(ENTER), Sees("75"), Key(ENTER), Sees("verified")],
    ),
    (
        "compare a controller with a saved set",
        &[
            Key("4"),
            Sees("FUJI"),
            Key(ENTER),
            Sees("parameter"),
            Key("s"),
            Sees("winter"),
            Key(ENTER),
            Sees("set winter"),
        ],
    ),
    ("last shift as CSV", &[Key("5"), Sees("RUNNING"), Key(LEFT), Sees("closed"), Key("e"), Sees("written")]),
    ("acknowledge the most urgent alarm", &[Sees("UNACK"), Key("a"), Sees("acked")]),
    ("find its cause", &[Key("3"), Sees("not responding"), Key(ENTER), Sees("cause")]),
    ("unit that does not answer, and since when", &[Key("6"), Sees("DOWN 00:")]),
    (
        "shelve for 30 minutes with a reason",
        &[
            Key("3"),
            Sees("not responding"),
            Key("z"),
            Sees("reason"),
            Key(DOWN),
            Text("cleaning"),
            Key(ENTER),
            Sees("1 suppressed"),
        ],
    ),
    ("mimic and trend at a past time", &[Key("@"), Text("-5s"), Key(ENTER), Sees("PAST"), Key("2"), Sees("window")]),
];

const ADDING: Task = (
    "add a Technician",
    &[
        Key("7"),
        Sees("last login"),
        Key("n"),
        Sees("repeat password"),
        Text("jane"),
        Key(ENTER),
        Text("correct horse battery"),
        Key(ENTER),
        Text("correct horse battery"),
        Key(ENTER),
        Gone("repeat password"),
        Sees("jane"),
        Sees("Technician"),
    ],
);

#[test]
fn ten_tasks_take_at_most_five_keys_each() {
    let mut counted: Vec<(&str, usize)> = Vec::new();
    let mut terminal = Terminal::start(80, 24, &["demo"]);
    terminal.wait_for("70.0");
    perform(&mut terminal, &[Key("4"), Sees("FUJI"), Key(ENTER), Sees("parameter"), Key("s"), Sees("no sets yet")]);
    perform(&mut terminal, &[Key("n"), Sees("as a set"), Text("winter"), Key(ENTER), Sees("same")]);
    return_home(&mut terminal);
    for (name, steps) in &OPERATING {
        if *name == "acknowledge the most urgent alarm" {
            // The first controller of the line falls silent.
            perform(&mut terminal, &[Key("8"), Sees("noise"), Key(PAGE_DOWN), Key(ENTER)]);
        }
        counted.push((name, perform(&mut terminal, steps)));
        return_home(&mut terminal);
    }
    drop(terminal);
    let (_sim, port) = simulated_tank();
    let mut terminal = Terminal::start(80, 24, &["tank", "--port", &format!("L1={port}")]);
    terminal.wait_for("the first Supervisor");
    let words = "correct horse battery staple";
    perform(
        &mut terminal,
        &[Text("anna"), Key(TAB), Text(words), Key(TAB), Text(words), Key(ENTER), Sees("TK-2 cold")],
    );
    counted.push((ADDING.0, perform(&mut terminal, ADDING.1)));
    for (name, keys) in &counted {
        eprintln!("{keys} keys  {name}");
    }
    let too_many: Vec<_> = counted.iter().filter(|(_, keys)| *keys > KEYS_MAX).collect();
    assert!(counted.len() == 10 && too_many.is_empty(), "{too_many:?}");
}
