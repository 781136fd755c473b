//! Screens as an operator sees them: every tab in every mood, every size, with and without colour.

mod cells;
mod signs;

use std::{collections::HashSet, sync::Arc, time::Duration};

use jiff::SignedDuration;

use super::{draw, model, screen, sent_kind, text, type_keys};
use crate::{
    plant::{
        alarm::AlarmState,
        def::Priority,
        interlock::ActuatorDef,
        line_state::LineState,
        ne107::Reason,
        sample::{Cause, Quality, Sample},
        snapshot::Snapshot,
    },
    ui::{
        Model, Msg,
        fixture::{self, Fixture},
        modal::{self, Modal},
        tabs::Tab,
        theme::{Colours, Glyphs, Theme},
        update,
    },
};

/// A program, a ramp or another hand at the controller: what it works towards is what counts.
#[test]
fn the_sv_in_use_stands_beside_the_one_that_was_set() {
    let mut fixture = Fixture::normal();
    let used = fixture.tag("TIC-1.MV");
    if let Some(faceplate) = &mut fixture.def.devices[0].faceplate {
        (faceplate.sv_used, faceplate.mv) = (Some(used), None);
    }
    for (tab, keys) in [(Tab::Mimic, ""), (Tab::Controllers, "⏎")] {
        let mut model = model(&fixture, Theme::FULL);
        model.tabs.shown = tab;
        type_keys(&mut model, keys);
        let shown = screen(&mut model, 120, 40);
        let is_set = |line: &str| line.contains("SV  42.0") && line.contains("set 70.0");
        assert!(shown.lines().any(is_set), "{tab:?}\n{shown}");
    }
}

#[test]
fn screens_in_every_mood() {
    let moods = [("normal", Fixture::normal()), ("alarm", Fixture::alarm()), ("line_down", Fixture::line_down())];
    for (mood, fixture) in &moods {
        for (tab, name) in [(Tab::Mimic, "mimic"), (Tab::Alarms, "alarms"), (Tab::Controllers, "controllers")] {
            for (width, height) in [(80, 24), (120, 40)] {
                let mut model = model(fixture, Theme::FULL);
                model.tabs.shown = tab;
                insta::assert_snapshot!(format!("{name}_{mood}_{width}x{height}"), screen(&mut model, width, height));
            }
        }
    }
}

#[test]
fn windows_on_top() {
    for (name, keys) in [
        ("help", "?"),
        ("leave", "q"),
        ("enter_sv", "s6"),
        ("toggle_run", "r"),
        ("faceplate", "→↓⏎"),
        ("choose_mode", "4⏎↓↓↓↓⏎"),
        ("confirm_tuning", "4⏎T↓⏎"),
        ("not_verified", "4⏎↓↓↓↓↓↓↓⏎"),
        ("actions", "4⏎f⏎"),
        ("acknowledge_all", "A"),
    ] {
        let mut model = model(&Fixture::alarm(), Theme::FULL);
        screen(&mut model, 80, 24);
        type_keys(&mut model, keys);
        insta::assert_snapshot!(format!("window_{name}"), screen(&mut model, 80, 24));
    }
}

/// In MANUAL, with TK-2 full, one actuator more than the fixture has, and a command that failed.
fn commanded() -> Snapshot {
    let mut fixture = Fixture::normal();
    fixture.set("PLC-1.AUTO", 0.0);
    fixture.set("PLC-1.TK-2", 19.5);
    fixture.set("PLC-1.SV-2", 1.0);
    let pump = fixture.def.logic.actuators[0].clone();
    // The fixture has no commands for the valves: the pump's stands in, which is OFF.
    for output in ["PLC-1.SV-2", "PLC-1.SV-1"] {
        fixture.def.logic.actuators.push(ActuatorDef { output: fixture.tag(output), ..pump.clone() });
    }
    let mut snapshot = Arc::unwrap_or_clone(fixture.snapshot());
    let samples = snapshot.samples.clone();
    let since = snapshot.at - SignedDuration::from_secs(8);
    snapshot.actuators.update(&snapshot.def.logic, |tag| samples[tag.index()], since);
    snapshot
}

#[test]
fn the_mimic_with_commands() {
    for (name, theme, width, height) in
        [("80x24", Theme::FULL, 80, 24), ("120x40", Theme::FULL, 120, 40), ("ascii", Theme::PLAIN, 80, 24)]
    {
        let mut model = Model::new(Arc::new(commanded()), theme, 1, fixture::session());
        let shown = screen(&mut model, width, height);
        assert!(theme != Theme::PLAIN || shown.is_ascii());
        insta::assert_snapshot!(format!("mimic_commands_{name}"), shown);
        type_keys(&mut model, "C↓");
        insta::assert_snapshot!(format!("window_commands_{name}"), screen(&mut model, width, height));
    }
    let console = Theme { colours: Colours::Sixteen, glyphs: Glyphs::Block, ..Theme::FULL };
    let mut model = Model::new(Arc::new(commanded()), console, 1, fixture::session());
    assert!(screen(&mut model, 80, 24).contains("! not OFF"));
}

#[test]
fn the_mimic_in_seven_bits() {
    let mut model = model(&Fixture::alarm(), Theme::PLAIN);
    let shown = screen(&mut model, 80, 24);
    assert!(shown.is_ascii());
    insta::assert_snapshot!("mimic_alarm_ascii", shown);
}

#[test]
fn the_linux_console_gets_characters_of_its_font() {
    let console = Theme { colours: Colours::Sixteen, glyphs: Glyphs::Block, ..Theme::FULL };
    let font = "─│┌┐└┘├┤┬┴┼═║╔╗╚╝╢╫►◄▲▼█▄▀▒░°·×←↑→↓≈•○■√┘";
    for tab in Tab::ALL {
        let mut model = model(&Fixture::alarm(), console);
        model.tabs.shown = tab;
        let shown = screen(&mut model, 80, 24);
        let strange: Vec<char> = shown.chars().filter(|c| !c.is_ascii() && !font.contains(*c)).collect();
        assert!(strange.is_empty(), "{tab:?}: {strange:?}");
    }
}

#[test]
fn no_size_is_too_small_to_survive() {
    let all = [Tab::Mimic, Tab::Trends, Tab::Alarms, Tab::Controllers, Tab::Reports, Tab::Bus];
    let sizes = (0..40).flat_map(|width| (0..20).map(move |height| (width, height)));
    let large = [(59, 16), (60, 15), (60, 16), (61, 17), (79, 23), (81, 25), (200, 60), (400, 20), (70, 200)];
    for fixture in [Fixture::alarm(), Fixture::line_down()] {
        let mut model = model(&fixture, Theme::FULL);
        for (width, height) in sizes.clone().chain(large) {
            for tab in all {
                model.tabs.shown = tab;
                assert!(screen(&mut model, width, height).lines().count() <= usize::from(height));
            }
        }
        for keys in
            ["?", "q", "s", "r", "→⏎", "4⏎", "4⏎⏎", "4⏎f", "4⏎T", "A", "w", "4w", "4c", "4⏎s", "4⏎sn", "4⏎g", "4h"]
        {
            model.modal = None;
            screen(&mut model, 80, 24);
            type_keys(&mut model, keys);
            for (width, height) in sizes.clone().chain(large) {
                assert!(screen(&mut model, width, height).lines().count() <= usize::from(height));
            }
        }
    }
}

#[test]
fn a_tiny_screen_still_shows_the_alarm() {
    let mut model = model(&Fixture::alarm(), Theme::FULL);
    let shown = screen(&mut model, 50, 5);
    assert!(shown.contains("‹2›! UNACK 00:41  TIC-1.PV"), "{shown}");
    assert!(shown.contains("screen too small: 50x5, needs 36x8"), "{shown}");
}

/// Values whole, each with its alarm; a window that might not be seen whole does not open.
#[test]
fn a_small_screen_lists_values_and_alarms() {
    let mut fixture = Fixture::alarm();
    fixture.set("TIC-1.MV", 100.0);
    for (width, height) in [(36, 8), (40, 12), (59, 40)] {
        let mut model = model(&fixture, Theme::FULL);
        type_keys(&mut model, "6");
        let first = screen(&mut model, width, height);
        assert_eq!(model.tabs.shown, Tab::Mimic, "the values stand in for a tab without room");
        let mut seen = first.clone();
        for _ in 0..fixture.def.mimic.pages[0].pictures[0].items.len() {
            type_keys(&mut model, "↓");
            seen += &screen(&mut model, width, height);
        }
        assert!(first.contains("‹2›! UNACK 00:41") && !seen.contains("##"), "{seen}");
        let has = |words: [&str; 3]| seen.lines().any(|line| words.iter().all(|word| line.contains(word)));
        assert!(has(["TIC-1.PV", "72.4 °C", "‹2›!"]) && has(["TIC-1.MV", "100.0 %", ""]), "{seen}");
        assert_eq!(type_keys(&mut model, "r"), []);
        assert!(matches!(model.modal, Some(Modal::Notice(_))), "nothing is written here");
        type_keys(&mut model, "⎋3");
        assert!(screen(&mut model, width, height).lines().skip(1).any(|line| line.contains("TIC-1.PV")));
        type_keys(&mut model, "t");
        assert_eq!(model.tabs.shown, Tab::Alarms, "no key leads to a tab without room");
        assert_eq!(type_keys(&mut model, "z30 min, a quiet pump⏎"), [], "what is typed for a window is no key");
        assert_eq!((model.tabs.shown, &model.modal), (Tab::Alarms, &None));
        assert_eq!(sent_kind(&type_keys(&mut model, "a")), Some(&fixture.alarms[0].acknowledge()));
    }
}

#[test]
fn a_value_without_trust_says_so_on_a_small_screen() {
    let shown = screen(&mut model(&Fixture::line_down(), Theme::FULL), 40, 20);
    assert!(shown.lines().any(|line| line.contains("TIC-1.PV") && line.contains("64.2? °C") && line.contains("12s")));
    assert!(shown.contains("---- line not"), "{shown}");
}

#[test]
fn a_screen_of_any_width_says_that_it_is_too_small() {
    for (width, expect) in
        [(50, "screen too small: 50x6, needs 36x8"), (30, "too small: 30x6, needs 36x8"), (20, "too small: 20x6")]
    {
        let mut model = model(&Fixture::normal(), Theme::FULL);
        assert_eq!(screen(&mut model, width, 6).lines().nth(1), Some(expect));
    }
}

#[test]
fn no_alarms_is_not_said_where_they_are_not_shown() {
    let check = |state: LineState, expect: &str| {
        let mut fixture = Fixture::normal();
        fixture.line.state = state;
        let shown = screen(&mut model(&fixture, Theme::FULL), 80, 24);
        let banner = shown.lines().nth(2).unwrap_or_default();
        assert_eq!(banner.trim(), expect);
    };
    check(LineState::Connected, "no alarms");
    check(LineState::Disconnected, "alarms not evaluated: L1 disconnected");
    check(LineState::Connecting, "alarms not evaluated: L1 not connected");
    let waiting = LineState::Waiting { why: "No such file".into(), retry_at: fixture::now() };
    check(waiting, "alarms not evaluated: L1 not connected");
    let mut model = model(&Fixture::normal(), Theme::FULL);
    update(&mut model, Msg::Tick { silent: Duration::from_secs(7) });
    assert!(screen(&mut model, 80, 24).contains("alarms not evaluated: station not responding"));
    let mut model = super::model(&Fixture::alarm(), Theme::FULL);
    update(&mut model, Msg::Tick { silent: Duration::from_secs(3) });
    let shown = screen(&mut model, 80, 24);
    let banner = shown.lines().nth(2).unwrap_or_default();
    assert!(banner.contains("TIC-1.PV") && banner.contains("alarms not evaluated"), "{banner}");
}

#[test]
fn a_long_alarm_leaves_state_and_counts_in_the_banner() {
    let mut fixture = Fixture::alarm();
    let text = "the outlet of the second heat exchanger is much warmer than its jacket permits for this product at all";
    fixture.def.alarms[0].message = text.to_owned();
    for (width, height, counts) in [(60, 16, false), (80, 24, true), (120, 40, true)] {
        let mut model = model(&fixture, Theme::FULL);
        type_keys(&mut model, "3");
        let shown = screen(&mut model, width, height);
        let banner = shown.lines().nth(2).unwrap_or_default();
        assert!(banner.starts_with(" ‹2›! UNACK 00:41  TIC-1.PV the outlet"), "{banner}");
        assert!(banner.ends_with("a ack") && (!counts || banner.contains("×1")), "{banner}");
        let guidance = |line: &'_ str| line.rsplit('┊').next().unwrap_or_default().to_owned();
        let read: String = shown.lines().skip(5).map(guidance).collect::<Vec<_>>().join(" ");
        let read = read.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(width < 80 || read.contains(text), "the whole of it can be read below: {shown}");
    }
}

#[test]
fn no_screen_is_so_narrow_that_a_number_is_cut() {
    // Every number of the screen stands in the wide screen too: a cut one would not.
    let mut fixture = Fixture::alarm();
    fixture.set("TIC-1.MV", 100.0);
    let numbers = |text: &str| -> HashSet<String> {
        let words = text.split(|c: char| !(c.is_ascii_digit() || c == '.' || c == ':'));
        words.filter(|word| word.contains('.') && word.len() > 1).map(str::to_owned).collect()
    };
    for tab in [Tab::Mimic, Tab::Alarms, Tab::Controllers] {
        let mut model = model(&fixture, Theme::FULL);
        model.tabs.shown = tab;
        let whole = numbers(&screen(&mut model, 200, 60));
        for width in 60..100 {
            let shown = screen(&mut model, width, 40);
            let cut: Vec<String> = numbers(&shown).difference(&whole).cloned().collect();
            assert!(cut.is_empty(), "{tab:?} at {width}: {cut:?}\n{shown}");
        }
    }
}

#[test]
fn a_screen_too_small_for_the_mimic_lists_its_values() {
    let mut fixture = Fixture::alarm();
    fixture.set("TIC-1.MV", 100.0);
    let mut model = model(&fixture, Theme::FULL);
    type_keys(&mut model, "→");
    for (width, height) in [(60, 20), (60, 16), (79, 24), (80, 22), (120, 20)] {
        let shown = screen(&mut model, width, height);
        assert!(!shown.contains("##"), "{width}x{height}:\n{shown}");
        for value in ["PV 72.4 °C", "SV 70.0 °C", "MV 100.0 %", "22.1 cm", "‹2›!"] {
            assert!(shown.contains(value), "{value} is missing at {width}x{height}:\n{shown}");
        }
    }
    for height in [24, 23] {
        // A status line of tmux takes one row, and only the bottom of a tank.
        assert!(screen(&mut model, 80, height).contains("┌TK-2 cold─┐"), "the mimic is back where there is room");
    }
}

#[test]
fn what_is_too_narrow_for_all_words_overlaps_none() {
    let mut model = model(&Fixture::normal(), Theme::FULL);
    type_keys(&mut model, "4⏎");
    let shown = screen(&mut model, 60, 16);
    let heading = shown.lines().nth(4).unwrap_or_default();
    assert!(heading.ends_with(" 1/2") && heading.contains("✓ OK"), "{heading}");
}

#[test]
fn a_device_tells_its_letter_beside_its_name() {
    for (diagnosis, expect) in [
        (None, "✓ OK, 12 ms"),
        (Some(Reason::Down), "✗F failure: not responding"),
        (Some(Reason::LineClosed), "▼C function check:"),
        (Some(Reason::Failing { failed: 9, of: 64 }), "?S out of specification:"),
        (Some(Reason::Late(2)), "◆M maintenance required:"),
    ] {
        let mut fixture = Fixture::normal();
        fixture.devices[0].diagnosis = diagnosis;
        let mut model = model(&fixture, Theme::FULL);
        type_keys(&mut model, "4⏎");
        let shown = screen(&mut model, 120, 40);
        let heading = shown.lines().nth(4).unwrap_or_default();
        assert!(heading.contains(expect), "{heading}");
    }
}

#[test]
fn the_alarms_tab_tells_its_most_important_key() {
    let mut model = model(&Fixture::alarm(), Theme::FULL);
    model.tabs.shown = Tab::Alarms;
    assert!(screen(&mut model, 80, 24).lines().last().is_some_and(|footer| footer.contains("a ack")));
    type_keys(&mut model, "?");
    assert!(screen(&mut model, 80, 24).contains("acknowledge the selected alarm"));
}

#[test]
fn what_cannot_be_read_does_not_wait_to_be_read() {
    let mut model = model(&Fixture::normal(), Theme::FULL);
    type_keys(&mut model, "4⏎f");
    let shown = screen(&mut model, 80, 24);
    assert!(shown.contains("now – write only") && !shown.contains("not read"), "{shown}");
}
