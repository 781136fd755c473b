//! The program as a person sees it, in a pseudo-terminal.

use crate::{
    pty::Terminal,
    support::{folder, simulated_tank},
};

#[test]
fn every_tab_opens_and_q_asks_before_leaving() {
    let mut terminal = Terminal::start(80, 24, &["demo", "--speed", "10"]);
    terminal.wait_for("TK-1");
    for (key, text) in [("2", "window"), ("3", "suppressed"), ("4", "FUJI"), ("5", "RUNNING"), ("1", "TK-2")] {
        terminal.keys(key);
        terminal.wait_for(text);
    }
    terminal.keys("?");
    terminal.wait_for("every tab");
    terminal.keys("\x1b");
    // Esc and a letter in one go would be Alt and the letter.
    terminal.wait_gone("every tab");
    terminal.keys("q");
    terminal.wait_for("Quit?");
    terminal.keys("\r");
    assert_eq!(terminal.end(), 0);
    terminal.assert_restored();
}

#[test]
fn a_new_plant_is_made_of_what_answers() {
    let (_sim, port) = simulated_tank();
    let folder = folder();
    let file = folder.path().join("works.toml");
    let path = file.to_str().unwrap();
    let mut terminal = Terminal::start(160, 60, &["new", path]);
    let enter = |query: &str, answer: &str| (query.to_owned(), format!("{answer}\r"));
    for (query, keys) in [
        enter("title [Plant]", "Works"),
        enter("time zone", "Nowhere/Atlantis"),
        enter("expected an IANA name", "Asia/Bangkok"),
        enter("line 1:", &port),
        enter("units to look for", "1-3"),
        enter("which of them [all]", ""),
        enter("unit 1: looks like FUJI PXR", ""),
        enter("name [TIC-1]", ""),
        enter("tags to keep [all]", "PV SV 8"),
        enter("unit 2: looks like KOYO DL06", ""),
        enter("name [D-1]", "PLC-1"),
        enter("42 VY0", ""),
        enter("line 2:", ""),
        enter("TIC-1.FAULT high 0.5: fault of sensor or controller", ""),
        enter("shifts, or none", ""),
        enter("write the plant file", ""),
    ] {
        terminal.wait_for(&query);
        terminal.keys(&keys);
    }
    terminal.wait_for("saved");
    assert_eq!(terminal.end(), 0);
    let text = std::fs::read_to_string(&file).unwrap();
    let def = sightglass::api::profile::load(&file, &sightglass::api::profile::Search::shipped()).unwrap();
    let names: Vec<&str> = def.devices.iter().map(|device| device.name.as_str()).collect();
    assert_eq!((def.title.as_str(), names, def.shifts.len()), ("Works", vec!["TIC-1", "PLC-1"], 2));
    for part in ["# The word is 0 while all is well", "{ name = \"CT\", poll = \"never\" }", "replies took"] {
        assert!(text.contains(part), "no `{part}` in {text}");
    }
    let mut again = Terminal::start(160, 24, &["new", path]);
    again.wait_for("is never overwritten");
    assert_eq!(again.end(), 2);
    assert_eq!(std::fs::read_to_string(&file).unwrap(), text);
}

#[test]
fn a_set_value_is_written_and_verified() {
    let mut terminal = Terminal::start(120, 40, &["demo"]);
    terminal.wait_for("70.0");
    terminal.keys("s");
    terminal.wait_for("new");
    terminal.keys("\x15");
    terminal.keys("65.5\r");
    terminal.wait_for("65.5");
    terminal.keys("\r");
    terminal.wait_for("verified");
}

#[test]
fn signals_leave_the_terminal_as_it_was() {
    for signal in ["TERM", "HUP", "INT"] {
        let mut terminal = Terminal::start(80, 24, &["demo"]);
        terminal.wait_for("TK-1");
        terminal.signal(signal);
        terminal.end();
        terminal.assert_restored();
    }
}

#[test]
fn a_closed_session_ends_the_program() {
    let mut terminal = Terminal::start(80, 24, &["demo"]);
    terminal.wait_for("TK-1");
    // Both ends of the master must go: the reader's copy stays in its thread until the program closes its side.
    drop(terminal.writer.take());
    drop(terminal.master.take());
    terminal.signal("HUP");
    terminal.end();
}

#[test]
fn a_tiny_terminal_is_no_reason_to_fall() {
    let mut terminal = Terminal::start(12, 3, &["demo"]);
    terminal.wait_for("too");
    terminal.signal("TERM");
    terminal.end();
    terminal.assert_restored();
}
