//! The program as a person sees it, in a pseudo-terminal.

use crate::pty::Terminal;

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
