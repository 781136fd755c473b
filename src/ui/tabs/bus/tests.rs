//! The bus tab in the whole terminal: what a technician sees and what the keys do.

mod pages;
mod registers;

use std::{sync::Arc, time::Duration};

use crossterm::event::{KeyCode, KeyEvent, KeyModifiers};

use crate::{
    access::{Durability, SessionRequest},
    bus::frame::with_crc,
    history::{Answer, Query},
    plant::{
        command::{CommandId, CommandKind},
        def::{Framing, LineId, Serial},
        diagnostics::{
            Conclusion, Diagnostic, DiagnosticRun, DiagnosticState, DiagnosticStep, Finding, Scan, UnitReply,
        },
        fault::Fault,
        line_minute::LineMinute,
        line_state::{DeviceState, LineState},
        ne107::Reason,
        traffic::Exchange,
    },
    ui::{
        Effect, Model, Msg,
        fixture::{Fixture, now},
        modal::Modal,
        tabs::Tab,
        tests::{assert_acts_only_on_what_was_drawn, model, screen, sent_kind, type_keys},
        theme::Theme,
        update,
    },
};

const L1: LineId = LineId(0);

fn bus(fixture: &Fixture, theme: Theme, keys: &str) -> Model {
    let mut model = model(fixture, theme);
    type_keys(&mut model, "6");
    type_keys(&mut model, keys);
    model
}

fn run(
    diagnostic: Diagnostic,
    state: DiagnosticState,
    done: u32,
    total: u32,
    findings: Vec<Finding>,
) -> Arc<DiagnosticRun> {
    let id = CommandId { terminal: 1, number: 1 };
    let started = now() - jiff::SignedDuration::from_secs(8);
    let serial = Some(Serial { parity: crate::plant::def::Parity::Even, ..Serial::USUAL });
    let asks = Some(DiagnosticStep::Request { unit: 17, function: 3, serial });
    let (by, requests, errors) = ("tech1".into(), done, 0);
    Arc::new(DiagnosticRun { id, by, diagnostic, started, done, total, requests, errors, now: asks, state, findings })
}

#[test]
fn every_page_well_and_in_trouble() {
    let moods = [("well", Fixture::traffic()), ("trouble", Fixture::traffic_trouble())];
    for (mood, fixture) in &moods {
        for (page, keys) in [("line", "l"), ("plan", "B"), ("frames", "F"), ("test", "T")] {
            for (width, height) in [(80, 24), (120, 40)] {
                let mut model = bus(fixture, Theme::FULL, keys);
                insta::assert_snapshot!(format!("{page}_{mood}_{width}x{height}"), screen(&mut model, width, height));
            }
        }
    }
}

#[test]
fn a_frame_is_opened_byte_by_byte() {
    let mut model = bus(&Fixture::traffic(), Theme::FULL, "F⏎");
    insta::assert_snapshot!("window_frame", screen(&mut model, 80, 24));
    type_keys(&mut model, "⎋↑⏎");
    let request = screen(&mut model, 80, 24);
    assert!(request.contains("TX sent") && request.contains("41004"), "{request}");
}

#[test]
fn a_filter_shows_what_passes_or_says_what_it_expects() {
    let mut model = bus(&Fixture::traffic_trouble(), Theme::FULL, "Ff");
    assert!(screen(&mut model, 80, 24).contains("unit 1, fc 3, tx, rx, error"));
    assert!(screen(&mut model, 120, 40).contains("unit 1   fc 3   tx   rx   error"));
    type_keys(&mut model, "error⏎");
    let shown = screen(&mut model, 80, 24);
    assert!(shown.contains("3 of 126 frames") && shown.contains("filter: error"), "{shown}");
    type_keys(&mut model, "f bogus⏎");
    assert!(screen(&mut model, 80, 24).contains("found `bogus`, expected unit N, fc N, tx, rx, error"));
}

#[test]
fn frames_are_saved_as_text_and_for_wireshark() {
    let mut model = bus(&Fixture::traffic(), Theme::FULL, "F");
    let mut effects = type_keys(&mut model, "x");
    let mut saved = Vec::new();
    while let Some(Effect::SessionRequest(id, SessionRequest::Exported { file, sha256 })) = effects.last() {
        assert_eq!(
            (file.starts_with("reports/L1-"), sha256.as_ref().map(String::len)),
            (true, Ok(64)),
            "notes before it is written"
        );
        let id = *id;
        saved.extend(std::mem::take(&mut effects));
        effects = update(&mut model, Msg::RequestDone(id, Ok(Durability::Recorded)));
    }
    saved.extend(effects);
    let saved: Vec<_> = saved
        .into_iter()
        .filter_map(|effect| match effect {
            Effect::SaveReport { tab, path, bytes, .. } => Some((tab, path, bytes)),
            Effect::Command(..)
            | Effect::SessionRequest(..)
            | Effect::Query(..)
            | Effect::Extension(_)
            | Effect::SaveNew { .. }
            | Effect::Load { .. }
            | Effect::Append { .. }
            | Effect::Bell
            | Effect::Redraw
            | Effect::Copy(_)
            | Effect::KeepPreferences(..)
            | Effect::Quit => None,
        })
        .collect();
    let names: Vec<String> = saved.iter().map(|(_, path, _)| path.display().to_string()).collect();
    assert_eq!(names, ["reports/L1-2026-11-21-140231.txt", "reports/L1-2026-11-21-140231.pcapng"]);
    assert!(saved.iter().all(|(tab, ..)| *tab == Some(Tab::Bus)));
    assert_eq!(String::from_utf8_lossy(&saved[0].2).lines().count(), 120);
    assert_eq!(saved[1].2[..4], [0x0A, 0x0D, 0x0D, 0x0A]);
    for (tab, path, _) in saved {
        update(&mut model, Msg::Saved(tab, Ok(path)));
    }
    let shown = screen(&mut model, 80, 24);
    assert!(shown.contains("open with: wireshark reports/L1-2026-11-21-140231.pcapng"), "{shown}");
    update(&mut model, Msg::Saved(Some(Tab::Bus), Err("disk full".to_owned())));
    assert!(screen(&mut model, 80, 24).contains("NOT WRITTEN: disk full"));
}

#[test]
fn the_tags_of_a_block_are_shown_with_their_values() {
    let mut model = bus(&Fixture::traffic(), Theme::FULL, "B⏎");
    insta::assert_snapshot!("window_block", screen(&mut model, 80, 24));
}

#[test]
fn why_goes_through_the_values_of_a_block() {
    let mut model = bus(&Fixture::traffic(), Theme::FULL, "Bw");
    let first = screen(&mut model, 80, 24);
    assert!(first.contains("why ") && first.contains(" 1/"), "{first}");
    type_keys(&mut model, "→");
    assert!(screen(&mut model, 80, 24).contains(" 2/"), "one value after the other");
}

#[test]
fn typed_bytes_are_reported_at_once_and_never_act_as_keys() {
    let mut model = bus(&Fixture::traffic(), Theme::FULL, "Tt");
    assert_eq!(type_keys(&mut model, "01 03 03 EA 00 01"), []);
    insta::assert_snapshot!("window_send", screen(&mut model, 80, 24));
    let effects = type_keys(&mut model, "⏎");
    assert_eq!(sent_kind(&effects), Some(&CommandKind::Test(L1, Diagnostic::Send(with_crc(&[1, 3, 3, 0xEA, 0, 1])))));
    assert!(matches!(model.modal, Some(Modal::Bus(_))), "the entry stays for the next one");
    type_keys(&mut model, "⎋⏎");
    assert!(screen(&mut model, 80, 24).contains("01 03 03 EA 00 01"), "it is remembered");
    update(&mut model, Msg::Paste("q1a\n".to_owned()));
    assert!(matches!(model.modal, Some(Modal::Bus(_))));
}

#[test]
fn bytes_go_out_as_typed_where_no_check_is_wanted() {
    let mut model = bus(&Fixture::traffic(), Theme::FULL, "Tt⇥01 03 03 EA 00 01 00 00⏎");
    let shown = screen(&mut model, 80, 24);
    assert!(shown.contains("These bytes are not a valid request: CRC"), "{shown}");
    assert_eq!(sent_kind(&type_keys(&mut model, "⏎")), None, "a second Enter sends nothing");
    let effects = type_keys(&mut model, "y");
    assert_eq!(sent_kind(&effects), Some(&CommandKind::Test(L1, Diagnostic::Send(vec![1, 3, 3, 0xEA, 0, 1, 0, 0]))));
}

#[test]
fn writes_and_broadcasts_are_asked_first() {
    for (typed, bytes, words) in [
        ("01 06 03 EA 00 32", vec![1, 6, 3, 0xEA, 0, 0x32], "This bypasses all limits of the plant file"),
        ("00 06 03 EA 00 32", vec![0, 6, 3, 0xEA, 0, 0x32], "Broadcast: every device executes it, none responds."),
        ("01 08 00 01 00 00", vec![1, 8, 0, 1, 0, 0], "the unit restarts its port"),
        ("00 03 03 EA 00 01", vec![0, 3, 3, 0xEA, 0, 1], "no unit responds to a broadcast"),
    ] {
        let mut model = bus(&Fixture::traffic(), Theme::FULL, &format!("Tt{typed}"));
        let before = screen(&mut model, 80, 24);
        assert_eq!(sent_kind(&type_keys(&mut model, "⏎")), None, "{typed}");
        let shown = screen(&mut model, 120, 40).replace("│", " ").split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(shown.contains(words) || before.contains(words), "{words}:\n{before}\n{shown}");
        let effects = type_keys(&mut model, "y");
        assert_eq!(sent_kind(&effects), Some(&CommandKind::Test(L1, Diagnostic::Send(with_crc(&bytes)))), "{typed}");
    }
}

#[test]
fn a_request_is_built_of_fields_with_either_kind_of_address() {
    let check = |keys: &str, expect: &[u8]| {
        let mut model = bus(&Fixture::traffic(), Theme::FULL, &format!("Tf{keys}"));
        let mut effects = type_keys(&mut model, "⏎");
        if matches!(model.modal, Some(Modal::Confirm(_))) {
            effects = type_keys(&mut model, "y");
        }
        assert_eq!(sent_kind(&effects), Some(&CommandKind::Test(L1, Diagnostic::Send(with_crc(expect)))), "{keys}");
    };
    let clear = "\u{8}".repeat(6);
    check(&format!("↓↓{clear}41003"), &[1, 3, 3, 0xEA, 0, 1]);
    check(&format!("↓↓{clear}1002↓{clear}4"), &[1, 3, 3, 0xEA, 0, 4]);
    check(&format!("{clear}17↓↓{clear}0x3EA"), &[17, 3, 3, 0xEA, 0, 1]);
    check(&format!("↓→→→→↓{clear}41003↓{clear}-2"), &[1, 6, 3, 0xEA, 0xFF, 0xFE]);
    let mut model = bus(&Fixture::traffic(), Theme::FULL, &format!("Tf↓↓{clear}31003⏎"));
    let shown = screen(&mut model, 80, 24);
    assert!(shown.contains("31003 belongs to the table input, this is holding"), "{shown}");
}

#[test]
fn a_closed_line_says_so_instead_of_sending() {
    let mut fixture = Fixture::traffic();
    fixture.line.state = LineState::Disconnected;
    for keys in ["Tt01 03 00 00 00 01⏎", "Tb⏎", "Ti⏎", "Ts⏎"] {
        let mut model = bus(&fixture, Theme::FULL, "");
        assert_eq!(sent_kind(&type_keys(&mut model, keys)), None, "{keys}");
        let shown = screen(&mut model, 80, 24);
        assert!(shown.contains("line L1 is disconnected: connect it first"), "{keys}:\n{shown}");
    }
}

#[test]
fn a_scan_of_all_settings_is_asked_and_shows_how_far_it_is() {
    let mut model = bus(&Fixture::traffic(), Theme::FULL, "Ts↓↓→");
    insta::assert_snapshot!("window_scan", screen(&mut model, 80, 24));
    assert_eq!(sent_kind(&type_keys(&mut model, "⏎")), None);
    assert!(screen(&mut model, 80, 24).contains("Polling of L1 pauses while other settings are tested"));
    let effects = type_keys(&mut model, "y");
    let Some(CommandKind::Test(_, diagnostic @ Diagnostic::Scan(scan))) = sent_kind(&effects) else {
        panic!("{effects:?}")
    };
    assert_eq!((scan.first, scan.last, scan.serials.len()), (1, 247, 32));
    let mut fixture = Fixture::traffic();
    fixture.line.state = LineState::Testing;
    let even = Serial { parity: crate::plant::def::Parity::Even, ..Serial::USUAL };
    let found = Finding::Unit { unit: 3, serial: Some(even), reply: UnitReply::Register(77) };
    fixture.line.test = Some(run(diagnostic.clone(), DiagnosticState::Running, 40, 7_904, vec![found]));
    update(&mut model, Msg::Snapshot(fixture.snapshot()));
    insta::assert_snapshot!("scan_at_work", screen(&mut model, 80, 24));
    assert_eq!(sent_kind(&type_keys(&mut model, "x")), Some(&CommandKind::StopTest(L1)));
}

#[test]
fn what_came_back_is_described() {
    let mut fixture = Fixture::traffic();
    let sent = with_crc(&[1, 3, 3, 0xEA, 0, 1]);
    let bytes = with_crc(&[1, 3, 2, 0, 0xC8]);
    let reply = Some(Duration::from_micros(12_400));
    fixture.line.test = Some(run(
        Diagnostic::Send(sent.clone()),
        DiagnosticState::Done,
        1,
        1,
        vec![Finding::Bytes { bytes, response_time: reply }],
    ));
    insta::assert_snapshot!("test_answered_80x24", screen(&mut bus(&fixture, Theme::FULL, "T"), 80, 24));
    insta::assert_snapshot!("test_answered_120x40", screen(&mut bus(&fixture, Theme::FULL, "T"), 120, 40));
    let check = |finding: Finding, words: &str| {
        let mut fixture = Fixture::traffic();
        fixture.line.test = Some(run(Diagnostic::Send(sent.clone()), DiagnosticState::Done, 1, 1, vec![finding]));
        let shown = screen(&mut bus(&fixture, Theme::FULL, "T"), 80, 24);
        assert!(shown.contains(words), "{words} is missing:\n{shown}");
    };
    check(Finding::Bytes { bytes: Vec::new(), response_time: None }, "✗ no response within 300 ms");
    check(
        Finding::Bytes { bytes: with_crc(&[1, 0x83, 2]), response_time: reply },
        "✗ refused by the device   after 12.4 ms",
    );
    check(Finding::Bytes { bytes: vec![1, 3, 2, 0, 0xC8, 0, 0], response_time: reply }, "✗ CRC");
}

#[test]
fn loopback_and_identification_are_described() {
    let mut fixture = Fixture::traffic();
    let exchange = |outcome: Result<(), Fault>| {
        let request = with_crc(&[1, 8, 0, 0, 0xA5, 0x37]);
        let answer = if outcome.is_ok() { request.clone() } else { Vec::new() };
        let reply = outcome.is_ok().then_some(Duration::from_millis(12));
        Finding::Exchange(Arc::new(Exchange {
            at: now(),
            framing: Framing::Rtu,
            request: request.into(),
            answer: answer.into(),
            outcome,
            response_time: reply,
            tries: 1,
        }))
    };
    let diagnostic = Diagnostic::Loopback { unit: 1, data: 0xA537, count: 2 };
    let took = std::time::Duration::from_millis(12);
    let conclusion = Finding::Conclusion(Conclusion::Loopback { back: 1, sent: 2, times: (took, took) });
    let findings = vec![exchange(Ok(())), exchange(Err(Fault::Timeout)), conclusion];
    fixture.line.test = Some(run(diagnostic, DiagnosticState::Done, 2, 2, findings));
    let shown = screen(&mut bus(&fixture, Theme::FULL, "T"), 80, 24);
    for words in ["✓ returned after 12 ms", "✗ response timeout", "1 of 2 came back"] {
        assert!(shown.contains(words), "{words} is missing:\n{shown}");
    }
    let object = Finding::Object { id: Some(0), text: "FUJI".to_owned() };
    fixture.line.test = Some(run(Diagnostic::Identify { unit: 1 }, DiagnosticState::Done, 1, 1, vec![object]));
    assert!(screen(&mut bus(&fixture, Theme::FULL, "T"), 80, 24).contains("VendorName           FUJI"));
}

#[test]
fn no_size_breaks_a_page_or_a_window() {
    let mut fixture = Fixture::traffic_trouble();
    let scan = Scan { first: 1, last: 9, serials: vec![], timeout: Duration::from_millis(100) };
    fixture.line.test = Some(run(Diagnostic::Scan(scan), DiagnosticState::Running, 3, 9, Vec::new()));
    for keys in ["l", "B", "F", "T", "B⏎", "F⏎", "Tt01 03", "Tf", "R", "Ts", "Tm"] {
        let mut model = bus(&fixture, Theme::FULL, keys);
        for (width, height) in [(60, 16), (61, 17), (79, 23), (81, 25), (200, 60), (400, 20), (70, 200)] {
            assert!(screen(&mut model, width, height).lines().count() <= usize::from(height));
        }
    }
}

#[test]
fn windows_on_the_smallest_screen_say_what_they_cut() {
    let fixture = Fixture::traffic();
    for (name, keys) in [("request", "Tf"), ("scan", "Ts"), ("map", "Tm"), ("send", "Tt01 03 03 EA 00 01")] {
        let mut model = bus(&fixture, Theme::FULL, keys);
        insta::assert_snapshot!(format!("small_{name}"), screen(&mut model, 60, 16));
    }
}

#[test]
fn backspace_is_a_key_of_the_entries() {
    let mut model = bus(&Fixture::traffic(), Theme::FULL, "Tt01 03x");
    update(&mut model, Msg::Key(KeyEvent::new(KeyCode::Backspace, KeyModifiers::NONE)));
    assert!(!screen(&mut model, 80, 24).contains("03x"));
}

#[test]
fn the_day_of_a_line_is_asked_for_and_shown_as_a_trend() {
    let mut model = model(&Fixture::traffic(), Theme::FULL);
    let effects = type_keys(&mut model, "6");
    let asked = effects.into_iter().find_map(|effect| match effect {
        Effect::Query(id, Query::LineMinutes { line: L1, .. }) => Some(id),
        _ => None,
    });
    let minute = |ago: i64| LineMinute {
        at: now() - jiff::SignedDuration::from_mins(ago),
        line: "L1".into(),
        requests: 60,
        ok: if ago < 60 { 45 } else { 60 },
        timeouts: if ago < 60 { 15 } else { 0 },
        corrupt: 0,
        exceptions: 0,
        retries: 0,
        late: 0,
        missed: 0,
        sent_bytes: 0,
        received_bytes: 0,
        utilisation: 0.5,
        reply_p99_ms: None,
        reply_max_ms: None,
    };
    let minutes = (0..600).rev().map(minute).collect();
    update(&mut model, Msg::Answer(asked.expect("it is asked for"), Ok(Answer::LineMinutes(minutes))));
    let seen = screen(&mut model, 120, 40);
    let errors = seen.lines().find(|line| line.contains("errors")).expect("a row of errors");
    assert!(errors.contains('▁') && errors.contains('█') && errors.contains("25 % now"), "{seen}");
}
