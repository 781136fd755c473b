//! The question of the start on terminals that answer it in their own way, and what they are then sent.

use super::*;
use crate::ui::graphics::kitty;

/// A terminal that answers so; its cells have a size in pixels.
fn answering(answer: &str) -> Pty {
    let mut pty = Pty::open();
    pty.wait_for("\x1b[16t\x1b[c");
    pty.press(answer);
    pty.wait_for("Water tank");
    pty
}

fn seen(pty: &Pty) -> String {
    String::from_utf8_lossy(&pty.seen).into_owned()
}

#[test]
fn a_terminal_with_kitty_graphics_gets_a_png() {
    let delete = String::from_utf8_lossy(kitty::DELETE);
    let mut pty = answering("\x1b_Gi=31;OK\x1b\\\x1b[6;20;10t\x1b[?62;4;22c");
    pty.press("2");
    pty.wait_for("i picture");
    pty.press("i");
    pty.wait_for("\x1b_Ga=T,f=100,");
    assert!(!seen(&pty).contains(&*delete));
    pty.press("i");
    pty.wait_for(&delete);
    pty.press("i");
    pty.wait_for_times("\x1b_Ga=T", 2);
    pty.signal(Signal::TERM);
    pty.ends_restored("test result: ok");
    let all = seen(&pty);
    assert_eq!(all.matches("\x1b_Ga=T").count(), 2, "one each time");
    assert_eq!(all.matches(&*delete).count(), 2, "every way out takes the picture away");
    assert!(all.rfind(&*delete) < all.find("\x1b[?1049l"), "while its screen is up");
    assert!(!all.contains("\x1bP"), "Kitty goes before Sixel");
}

#[test]
fn a_terminal_with_sixel_gets_bands() {
    let mut pty = answering("\x1b[?1;0;16S\x1b[6;20;10t\x1b[?62;4c");
    pty.press("2");
    pty.wait_for("i picture");
    pty.press("i");
    pty.wait_for("\x1bP0;1;0q\"1;1;");
    pty.press("1");
    pty.wait_for("TK-1 control");
    pty.signal(Signal::TERM);
    pty.ends_restored("test result: ok");
    assert!(!seen(&pty).contains("\x1b_Ga=T") && !seen(&pty).contains(&*String::from_utf8_lossy(kitty::DELETE)));
}

#[test]
fn a_terminal_that_answers_nothing_keeps_its_dots() {
    let mut pty = Pty::start();
    pty.press("2");
    pty.wait_for("window 10 min");
    pty.press("i");
    pty.wait_for("neither Kitty graphics nor Sixel announced");
    pty.press("q");
    pty.wait_for("Quit?");
    pty.press("\r");
    pty.ends_restored("test result: ok");
    assert!(!seen(&pty).contains("i picture") && !seen(&pty).contains("\x1b_Ga="));
}

#[test]
fn keys_between_the_answers_arrive() {
    let mut pty = answering("2\x1b_Gi=31;OK\x1b\\q\x1b[6;20;10t\x1b[?62;22c");
    pty.wait_for("Quit?");
    pty.press("\x1b");
    pty.wait_for("i picture");
    pty.signal(Signal::HUP);
    pty.ends_restored("test result: ok");
}

#[test]
fn an_answer_after_the_bound_is_no_key() {
    let mut pty = Pty::start();
    pty.press("2");
    pty.wait_for("window 10 min");
    // As keys: zoom, and the tabs of the digits.
    pty.press("\x1b_Gi=31;OK\x1b\\\x1b[6;20;10t\x1b[?62;4c");
    pty.press("c");
    pty.wait_for("cursor");
    pty.signal(Signal::TERM);
    pty.ends_restored("test result: ok");
    let all = seen(&pty);
    assert!(!all.contains("window 5 min") && !all.contains("neither Kitty"), "{all}");
}
