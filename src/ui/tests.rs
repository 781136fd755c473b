//! Tests of the whole terminal: screens as an operator sees them, and keys through `update`.

use std::{collections::HashSet, sync::Arc, time::Duration};

use crossterm::event::{KeyCode, KeyEvent, KeyModifiers};
use ratatui::{Terminal, backend::TestBackend, buffer::Buffer};

use super::{
    fixture::{self, Fixture},
    tabs::Tab,
    theme::{Colours, Glyphs, Theme},
    *,
};
use crate::plant::{
    alarm::AlarmState,
    command::{NotConfirmed, Outcome, Refusal},
    def::Priority,
    event::Fault,
    sample::{Quality, Sample},
};

fn model(fixture: &Fixture, theme: Theme) -> Model {
    Model::new(fixture.snapshot(), theme, 1, Arc::from("tech1"))
}

fn draw(model: &mut Model, width: u16, height: u16) -> Buffer {
    update(model, Msg::Resize(width, height));
    let mut terminal = Terminal::new(TestBackend::new(width, height)).expect("a test backend");
    terminal.draw(|frame| view(model, frame)).expect("a test backend takes every frame");
    terminal.backend().buffer().clone()
}

fn text(buffer: &Buffer) -> String {
    let rows = buffer.content.chunks(usize::from(buffer.area.width.max(1)));
    rows.map(|row| row.iter().map(|cell| cell.symbol()).collect::<String>().trim_end().to_owned() + "\n").collect()
}

/// The screen as text, one line a row.
fn screen(model: &mut Model, width: u16, height: u16) -> String {
    text(&draw(model, width, height))
}

/// Types keys: characters as they are, `⏎`, `⎋`, arrows, `⇥` for Tab.
fn type_keys(model: &mut Model, keys: &str) -> Vec<Effect> {
    let code = |c| match c {
        '⏎' => KeyCode::Enter,
        '⎋' => KeyCode::Esc,
        '⇥' => KeyCode::Tab,
        '↑' => KeyCode::Up,
        '↓' => KeyCode::Down,
        '←' => KeyCode::Left,
        '→' => KeyCode::Right,
        c => KeyCode::Char(c),
    };
    keys.chars().flat_map(|c| update(model, Msg::Key(KeyEvent::new(code(c), KeyModifiers::NONE)))).collect()
}

fn order_of(effects: &[Effect]) -> Option<&Command> {
    effects.iter().find_map(|effect| match effect {
        Effect::Order(_, command) => Some(command),
        Effect::Ask(..) | Effect::SaveReport { .. } | Effect::Redraw | Effect::Quit => None,
    })
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
        ("choose_mode", "4↓↓↓↓⏎"),
        ("confirm_tuning", "4T↓⏎"),
        ("not_verified", "4↓↓↓↓↓↓↓⏎"),
        ("actions", "4f⏎"),
        ("acknowledge_all", "A"),
    ] {
        let mut model = model(&Fixture::alarm(), Theme::FULL);
        screen(&mut model, 80, 24);
        type_keys(&mut model, keys);
        insta::assert_snapshot!(format!("window_{name}"), screen(&mut model, 80, 24));
    }
}

#[test]
fn the_mimic_in_seven_bits() {
    let mut model = model(&Fixture::alarm(), Theme::PLAIN);
    let shown = screen(&mut model, 80, 24);
    assert!(shown.is_ascii());
    insta::assert_snapshot!("mimic_alarm_ascii", shown);
}

#[test]
fn no_size_is_too_small_to_survive() {
    let all = [Tab::Mimic, Tab::Trends, Tab::Alarms, Tab::Controllers, Tab::Reports];
    let sizes = (0..40).flat_map(|width| (0..20).map(move |height| (width, height)));
    let large = [(59, 16), (60, 15), (60, 16), (61, 17), (79, 23), (81, 25), (200, 60), (400, 20), (70, 200)];
    for fixture in [Fixture::alarm(), Fixture::line_down()] {
        let mut model = model(&fixture, Theme::FULL);
        for (width, height) in sizes.clone().chain(large) {
            for tab in all {
                model.tabs.shown = tab;
                screen(&mut model, width, height);
            }
        }
        for keys in ["?", "q", "s", "r", "→⏎", "4⏎", "4f", "4T", "A"] {
            model.modal = None;
            screen(&mut model, 80, 24);
            type_keys(&mut model, keys);
            for (width, height) in sizes.clone().chain(large) {
                screen(&mut model, width, height);
            }
        }
    }
}

#[test]
fn a_tiny_screen_still_shows_the_alarm() {
    let mut model = model(&Fixture::alarm(), Theme::FULL);
    let shown = screen(&mut model, 50, 5);
    assert!(shown.contains("‹2›! TIC-1.PV temperature high"), "{shown}");
    assert!(shown.contains("screen too small: 50x5, needs 60x16"), "{shown}");
}

#[test]
fn without_colour_every_state_and_quality_looks_different() {
    let theme = Theme { colours: Colours::None, glyphs: Glyphs::Ascii, motion: false };
    let mut looks = HashSet::new();
    let mut states = 0;
    for priority in [Priority::Critical, Priority::High, Priority::Medium, Priority::Low] {
        for state in [AlarmState::Unacknowledged, AlarmState::Acknowledged, AlarmState::Returned] {
            let mut fixture = Fixture::alarm();
            fixture.alarms.truncate(1);
            fixture.alarms[0].state = state;
            fixture.def.alarms[0].priority = priority;
            let mut model = model(&fixture, theme);
            model.tabs.shown = Tab::Alarms;
            let buffer = draw(&mut model, 80, 24);
            assert!(buffer.content.iter().all(|cell| cell.fg == ratatui::style::Color::Reset && cell.bg == ratatui::style::Color::Reset));
            looks.insert(text(&buffer));
            states += 1;
        }
    }
    assert_eq!(looks.len(), states, "two alarm states look the same in plain text");
    let good = Fixture::normal();
    let at = fixture::now();
    let looks: HashSet<String> = Cause::ALL
        .into_iter()
        .flat_map(|cause| [Sample::bad(cause, at), Sample::good(64.2, at).doubted(cause)])
        .chain([Sample::good(64.2, at)])
        .map(|sample| {
            let mut fixture = good.clone();
            let pv = fixture.tag("TIC-1.PV");
            fixture.samples[pv.index()] = sample;
            let mut model = model(&fixture, theme);
            model.modal = modal::Faceplate::new("PV", vec![pv]).map(Modal::Faceplate);
            let shown = screen(&mut model, 80, 24);
            let word = match sample.quality {
                Quality::Good => "good",
                Quality::Uncertain(_) => "uncertain: ",
                Quality::Bad(_) => "bad: ",
            };
            assert!(shown.contains(&format!("quality  {word}")), "{shown}");
            shown
        })
        .collect();
    assert_eq!(looks.len(), 2 * Cause::ALL.len() + 1, "two qualities look the same in plain text");
}

#[test]
fn a_number_is_written_only_after_enter() {
    let fixture = Fixture::normal();
    let mut model = model(&fixture, Theme::FULL);
    assert_eq!(type_keys(&mut model, "s65.5"), []);
    let effects = type_keys(&mut model, "⏎");
    assert_eq!(order_of(&effects), Some(&Command::Write { tag: fixture.tag("TIC-1.SV"), value: 65.5 }));
    assert_eq!(model.modal, None);
    assert!(screen(&mut model, 80, 24).contains("TIC-1.SV ? → 65.5 °C  sent"));
}

#[test]
fn escape_changes_nothing() {
    for keys in ["s65⎋", "r⎋", "m⎋", "A⎋", "q⎋", "4⏎⎋", "4T↓⏎⎋", "4f⏎⎋", "⎋⎋⎋"] {
        let mut model = model(&Fixture::alarm(), Theme::FULL);
        let effects = type_keys(&mut model, keys);
        assert!(effects.iter().all(|effect| matches!(effect, Effect::Ask(..))), "{keys}: {effects:?}");
        assert_eq!(model.modal, None, "{keys}");
    }
}

#[test]
fn a_toggle_is_asked_and_does_what_it_said() {
    let fixture = Fixture::normal();
    let mut model = model(&fixture, Theme::FULL);
    type_keys(&mut model, "r");
    assert!(screen(&mut model, 80, 24).contains("old RUN  →  new STOP"));
    // Meanwhile someone else stops it: the window still writes STOP, not the opposite of what is now.
    let mut later = fixture.clone();
    later.set("PLC-1.RUN", 0.0);
    update(&mut model, Msg::Snapshot(later.snapshot()));
    let effects = type_keys(&mut model, "⏎");
    assert_eq!(order_of(&effects), Some(&Command::Write { tag: fixture.tag("PLC-1.RUN"), value: 0.0 }));
}

#[test]
fn a_toggle_of_the_unknown_becomes_a_choice() {
    let fixture = Fixture::line_down();
    let mut model = model(&fixture, Theme::FULL);
    type_keys(&mut model, "r");
    assert!(matches!(model.modal, Some(Modal::Choice(_))));
}

#[test]
fn a_paste_never_acts() {
    let mut model = model(&Fixture::normal(), Theme::FULL);
    for window in ["", "r", "?", "q", "4⏎"] {
        model.modal = None;
        type_keys(&mut model, window);
        let effects = update(&mut model, Msg::Paste("q\ry\r\n1".to_owned()));
        assert_eq!(effects, [], "{window}");
    }
    model.modal = None;
    type_keys(&mut model, "1s");
    assert_eq!(update(&mut model, Msg::Paste("66\r\n".to_owned())), []);
    assert!(model.modal.is_some(), "the pasted line end did not confirm");
    assert!(order_of(&type_keys(&mut model, "⏎")).is_some());
}

#[test]
fn leaving_is_asked() {
    let mut model = model(&Fixture::normal(), Theme::FULL);
    assert_eq!(type_keys(&mut model, "qn"), []);
    assert_eq!(type_keys(&mut model, "q⏎"), [Effect::Quit]);
    let ctrl_c = KeyEvent::new(KeyCode::Char('c'), KeyModifiers::CONTROL);
    assert_eq!(update(&mut model, Msg::Key(ctrl_c)), []);
    assert_eq!(type_keys(&mut model, "y"), [Effect::Quit]);
    // Out of a text entry as well.
    type_keys(&mut model, "s12");
    update(&mut model, Msg::Key(ctrl_c));
    assert_eq!(type_keys(&mut model, "⏎"), [Effect::Quit]);
}

#[test]
fn acknowledging_takes_the_most_urgent_or_the_selected() {
    let fixture = Fixture::alarm();
    let mut model = model(&fixture, Theme::FULL);
    assert_eq!(order_of(&type_keys(&mut model, "a")), Some(&Command::Acknowledge(fixture.alarms[0].id)));
    assert_eq!(order_of(&type_keys(&mut model, "3↓↓a")), Some(&Command::Acknowledge(fixture.alarms[2].id)));
    assert_eq!(order_of(&type_keys(&mut model, "↑a")), None, "already acknowledged");
    assert_eq!(order_of(&type_keys(&mut model, "A")), None, "all: asks first");
    assert_eq!(order_of(&type_keys(&mut model, "⏎")), Some(&Command::AcknowledgeAll));
    let mut quiet = self::model(&Fixture::normal(), Theme::FULL);
    assert_eq!(type_keys(&mut quiet, "aA"), []);
    assert_eq!(quiet.modal, None);
}

#[test]
fn a_selected_alarm_stays_selected_when_the_list_moves() {
    let mut fixture = Fixture::alarm();
    let mut model = model(&fixture, Theme::FULL);
    type_keys(&mut model, "3↓↓");
    let chosen = fixture.alarms[2].id;
    let newer = crate::plant::snapshot::ActiveAlarm { id: AlarmId(1), ..fixture.alarms[0].clone() };
    fixture.alarms.insert(0, newer);
    update(&mut model, Msg::Snapshot(fixture.snapshot()));
    assert_eq!(model.tabs.alarms.selected(&model.cx()).map(|alarm| alarm.id), Some(chosen));
}

#[test]
fn the_outcome_of_an_order_is_told_until_it_is_dismissed() {
    let fixture = Fixture::normal();
    let check = |outcome: Outcome, expect: &str| {
        let mut model = model(&fixture, Theme::FULL);
        let effects = type_keys(&mut model, "s60⏎");
        let Some(Effect::Order(id, command)) = effects.first().cloned() else { panic!("{effects:?}") };
        let mut snapshot = Arc::unwrap_or_clone(fixture.snapshot());
        snapshot.orders = vec![OrderStatus { id, by: Arc::from("tech1"), command, at: snapshot.at, old: Some(70.0), outcome }];
        update(&mut model, Msg::Snapshot(Arc::new(snapshot)));
        // The station forgets old orders; the terminal still knows its own.
        update(&mut model, Msg::Snapshot(fixture.snapshot()));
        let shown = screen(&mut model, 80, 24);
        assert!(shown.contains(expect), "{expect} is missing:\n{shown}");
        type_keys(&mut model, "⎋");
        assert!(!screen(&mut model, 80, 24).contains("TIC-1.SV 70.0"));
    };
    check(Outcome::Pending, "TIC-1.SV 70.0 → 60.0 °C  pending");
    check(Outcome::Verified, "TIC-1.SV 70.0 → 60.0 °C  verified 14:02:31");
    check(Outcome::Unchanged, "unchanged, nothing written");
    check(Outcome::Refused(Refusal::ReadOnly), "REFUSED: read only");
    check(Outcome::NotConfirmed(NotConfirmed::Different(65.0)), "NOT CONFIRMED: read back 65");
    check(Outcome::Failed(Fault::Timeout), "FAILED, may or may not have taken effect");
}

#[test]
fn an_order_that_never_left_is_told() {
    let mut model = model(&Fixture::normal(), Theme::FULL);
    let effects = type_keys(&mut model, "s60⏎");
    let Some(Effect::Order(id, _)) = effects.first() else { panic!("{effects:?}") };
    update(&mut model, Msg::Undelivered(*id, "station too busy"));
    assert!(screen(&mut model, 80, 24).contains("NOT SENT: station too busy"));
}

#[test]
fn a_silent_station_is_believed_no_more() {
    let fixture = Fixture::normal();
    let mut model = model(&fixture, Theme::FULL);
    update(&mut model, Msg::Tick { silent: Duration::from_secs(2) });
    assert!(screen(&mut model, 80, 24).contains("64.2 °C"));
    update(&mut model, Msg::Tick { silent: Duration::from_secs(7) });
    let shown = screen(&mut model, 80, 24);
    assert!(shown.contains("STATION SILENT 00:07") && shown.contains("64.2? °C 7s") && !shown.contains("64.2 °C"), "{shown}");
    assert!(!shown.contains('█'), "no picture without a good value:\n{shown}");
    update(&mut model, Msg::Snapshot(fixture.snapshot()));
    assert!(screen(&mut model, 80, 24).contains("64.2 °C"));
}

#[test]
fn trouble_of_the_store_is_in_the_header() {
    let mut snapshot = Arc::unwrap_or_clone(Fixture::normal().snapshot());
    snapshot.history.lost = 12;
    snapshot.history.trouble = Some("disk full".to_owned());
    snapshot.speed = 60.0;
    let mut model = Model::new(Arc::new(snapshot), Theme::FULL, 1, Arc::from("tech1"));
    let shown = screen(&mut model, 120, 40);
    let header = shown.lines().next().unwrap_or_default();
    for words in ["history: disk full", "12 records lost", "speed ×60"] {
        assert!(header.contains(words), "{header}");
    }
}

#[test]
fn only_unacknowledged_alarms_flash() {
    for (state, flashes) in [(AlarmState::Unacknowledged, true), (AlarmState::Acknowledged, false), (AlarmState::Returned, false)] {
        let mut fixture = Fixture::alarm();
        fixture.alarms.truncate(1);
        fixture.alarms[0].state = state;
        let mut model = model(&fixture, Theme { motion: false, ..Theme::FULL });
        model.tabs.shown = Tab::Alarms;
        let first = draw(&mut model, 80, 24);
        model.clock.phase += 2;
        let second = draw(&mut model, 80, 24);
        assert_eq!(first != second, flashes, "{state:?}");
    }
}

#[test]
fn the_journal_is_asked_only_while_it_is_shown() {
    let mut model = model(&Fixture::normal(), Theme::FULL);
    let asks = |effects: Vec<Effect>| effects.iter().filter(|effect| matches!(effect, Effect::Ask(id, _) if id.tab == Tab::Alarms)).count();
    let tick = || Msg::Tick { silent: Duration::ZERO };
    assert_eq!(asks(type_keys(&mut model, "3")), 0);
    assert_eq!(asks(type_keys(&mut model, "j")), 2, "alarms and actions");
    assert_eq!((0..10).map(|_| asks(update(&mut model, tick()))).sum::<usize>(), 2, "once more in five seconds");
    type_keys(&mut model, "1");
    assert_eq!((0..30).map(|_| asks(update(&mut model, tick()))).sum::<usize>(), 0);
}

#[test]
fn a_history_without_answer_is_said_so() {
    let mut model = model(&Fixture::normal(), Theme::FULL);
    let effects = type_keys(&mut model, "3j");
    assert!(screen(&mut model, 80, 24).contains("reading …"));
    for effect in effects {
        if let Effect::Ask(id, _) = effect {
            update(&mut model, Msg::Answer(id, Err(HistoryError::Engine("disk full".to_owned()))));
        }
    }
    assert!(screen(&mut model, 80, 24).contains("history: disk full"));
}

#[test]
fn the_next_frame_leaves_nothing_of_the_last_one() {
    // Thai clusters and ordinary text, drawn over each other: the diffed screen must equal a fresh one.
    use ratatui::backend::{Backend, CrosstermBackend};
    let texts = ["อุณหภูมิน้ำ", "ถังน้ำร้อน", "ทำงาน", "PV 72.4 °C", "", "น้ำ", "ำ"];
    let frame = |seed: usize| {
        let mut buffer = Buffer::empty(ratatui::layout::Rect::new(0, 0, 24, 3));
        for y in 0..3u16 {
            let text = texts[(seed * 7 + usize::from(y) * 3 + seed / 3) % texts.len()];
            let area = buffer.area;
            let mut canvas = widgets::text::Canvas::new(&mut buffer, area);
            canvas.text((seed * 5 % 9) as u16, y, text, Theme::FULL.normal());
        }
        edge::finish(&mut buffer, &Theme::FULL);
        buffer
    };
    let send = |parser: &mut vt100::Parser, from: &Buffer, to: &Buffer| {
        let mut bytes = Vec::new();
        CrosstermBackend::new(&mut bytes).draw(from.diff_iter(to)).expect("a vector takes every byte");
        parser.process(&bytes);
    };
    let empty = Buffer::empty(ratatui::layout::Rect::new(0, 0, 24, 3));
    let mut living = vt100::Parser::new(3, 24, 0);
    let mut last = empty.clone();
    for seed in 0..300 {
        let next = frame(seed);
        send(&mut living, &last, &next);
        let mut fresh = vt100::Parser::new(3, 24, 0);
        send(&mut fresh, &empty, &next);
        let rows = |parser: &vt100::Parser| parser.screen().rows(0, 24).map(|row| row.trim_end().to_owned()).collect::<Vec<_>>();
        assert_eq!(rows(&living), rows(&fresh), "frame {seed}");
        last = next;
    }
}
