//! The pages of the bus tab and the keys between them.

use super::*;
use crate::plant::{
    def::{Rs485, Transport},
    diagnostics::PatternTally,
    port_signals::{OutputSignal, PortSignals, SignalTest},
};

#[test]
fn a_silent_device_shows_its_next_poll_and_r_polls_it_now() {
    let mut fixture = Fixture::traffic();
    let device = fixture.def.devices[0].id;
    fixture.devices[0].state = DeviceState::Down { since: now() - jiff::SignedDuration::from_secs(75) };
    fixture.devices[0].diagnosis = Some(Reason::Down);
    let mut report = fixture.line.report.as_deref().cloned().expect("the line has reported");
    report.retries = vec![(device, now() + jiff::SignedDuration::from_secs(12))];
    fixture.line.report = Some(Arc::new(report));
    for (width, height) in [(80, 24), (120, 40)] {
        let mut model = bus(&fixture, Theme::FULL, "l");
        let shown = screen(&mut model, width, height);
        assert!(shown.contains("retry 12 s"), "{shown}");
        assert_eq!(sent_kind(&type_keys(&mut model, "r")), Some(&CommandKind::Refresh(device)));
        type_keys(&mut model, "4⏎");
        let shown = screen(&mut model, width, height);
        assert!(shown.contains("not responding, retry 12 s"), "{shown}");
    }
}

#[test]
fn a_frame_or_a_block_is_opened_only_as_it_was_drawn() {
    let mut model = bus(&Fixture::traffic(), Theme::FULL, "F");
    let newer = |model: &mut Model| {
        let mut fixture = Fixture::traffic();
        crate::ui::fixture::more_frames(&mut fixture);
        update(model, Msg::Snapshot(fixture.snapshot()));
        // The page takes new frames in every other second.
        (0..4).for_each(|_| drop(update(model, Msg::Tick { silent: Duration::ZERO })));
    };
    assert_acts_only_on_what_was_drawn(&mut model, newer, "⏎");
    let mut model = bus(&Fixture::traffic(), Theme::FULL, "B");
    let other_plan = |model: &mut Model| {
        let mut fixture = Fixture::traffic();
        let mut report = fixture.line.report.as_deref().cloned().expect("the line has reported");
        report.polls.reverse();
        fixture.line.report = Some(Arc::new(report));
        update(model, Msg::Snapshot(fixture.snapshot()));
    };
    assert_acts_only_on_what_was_drawn(&mut model, other_plan, "⏎");
}

#[test]
fn every_page_in_seven_bits_tells_what_is_wrong() {
    for (page, keys, words) in [
        ("line", "l", "! PLC-1: response timeout at 14:01:50"),
        ("plan", "B", "! TIC-1"),
        ("frames", "F", "x CRC error: got 3C51"),
        ("test", "T", "scan for units"),
    ] {
        let mut model = bus(&Fixture::traffic_trouble(), Theme::PLAIN, keys);
        let shown = screen(&mut model, 80, 24);
        assert!(shown.is_ascii() && shown.contains(words), "{page}:\n{shown}");
    }
}

#[test]
fn pages_are_turned_by_arrows_and_letters() {
    let mut model = bus(&Fixture::traffic(), Theme::FULL, "");
    for (keys, page) in [
        ("", "‹Line›"),
        ("→", "‹Plan›"),
        ("→→", "‹Test›"),
        ("→", "‹Registers›"),
        ("l←", "‹Registers›"),
        ("F", "‹Frames›"),
    ] {
        type_keys(&mut model, keys);
        let shown = screen(&mut model, 80, 24);
        assert!(shown.contains(page), "{keys}: {page}\n{shown}");
    }
    for key in ["w", "z"] {
        assert_eq!(type_keys(&mut model, key), []);
        let shown = screen(&mut model, 80, 24);
        assert!(shown.contains("‹Frames›") && shown.contains("This key does nothing here"), "{key}: {shown}");
    }
    type_keys(&mut model, "lc");
    assert!(matches!(model.modal, Some(Modal::LineSettings(_))));
}

#[test]
fn a_quiet_line_has_no_warnings_and_a_bad_one_says_what_to_do() {
    let quiet = screen(&mut bus(&Fixture::traffic(), Theme::FULL, ""), 80, 24);
    assert!(!quiet.contains('!') && !quiet.contains('✗'), "{quiet}");
    let bad = screen(&mut bus(&Fixture::traffic_trouble(), Theme::FULL, ""), 120, 40);
    for words in [
        "replies take 288 of 300 ms: increase the timeout",
        "check its power, wiring and unit address; each probe takes 312 ms of the line",
        "check baud rate, parity, termination and shield",
        "!corrupt 6",
        "02 illegal data address 2",
        "line overloaded: 41 polls skipped",
    ] {
        assert!(bad.contains(words), "{words} is missing:\n{bad}");
    }
}

#[test]
fn frames_are_held_still_while_they_are_read() {
    let mut fixture = Fixture::traffic();
    let mut model = bus(&fixture, Theme::FULL, "F↑↑");
    let held = screen(&mut model, 80, 24);
    assert!(held.contains("PAUSED"), "{held}");
    crate::ui::fixture::more_frames(&mut fixture);
    for _ in 0..6 {
        update(&mut model, Msg::Tick { silent: Duration::ZERO });
        update(&mut model, Msg::Snapshot(fixture.snapshot()));
    }
    let body = |shown: &str| shown.lines().skip(4).take(18).map(str::to_owned).collect::<Vec<_>>();
    assert_eq!(body(&screen(&mut model, 80, 24)), body(&held));
    type_keys(&mut model, " ");
    let running = screen(&mut model, 80, 24);
    assert!(running.contains("running, newest") && running.contains("07 D0 00 01"), "{running}");
}

#[test]
fn running_frames_are_taken_in_every_two_seconds() {
    let mut fixture = Fixture::traffic();
    let mut model = bus(&fixture, Theme::FULL, "F");
    crate::ui::fixture::more_frames(&mut fixture);
    update(&mut model, Msg::Snapshot(fixture.snapshot()));
    assert!(!screen(&mut model, 80, 24).contains("07 D0 00 01"), "slow lines have few bytes");
    for _ in 0..4 {
        update(&mut model, Msg::Tick { silent: Duration::ZERO });
    }
    assert!(screen(&mut model, 80, 24).contains("07 D0 00 01"));
}

#[test]
fn a_map_that_fails_shows_its_ranges_and_the_whole_reason() {
    use crate::plant::{
        fault::ExceptionCode,
        sweep::{Sweep, SweptOutcome, SweptRange},
    };
    let mut fixture = Fixture::traffic();
    let range = |first, last, outcome| Finding::Swept(SweptRange { first, last, outcome });
    let refused = SweptOutcome::Refused(ExceptionCode::ILLEGAL_ADDRESS);
    let findings = vec![range(0, 1001, refused), range(1002, 1031, SweptOutcome::Answers)];
    let sweep = Sweep { unit: 1, table: crate::plant::tag::Table::Holding, first: 0, last: 0xFFFF, every: 8 };
    let failed = DiagnosticState::Failed("the port was closed by the other side, and is opened again".into());
    fixture.line.test = Some(run(Diagnostic::Sweep(sweep), failed, 1_032, 65_536, findings));
    for (width, height) in [(80, 24), (120, 40)] {
        insta::assert_snapshot!(
            format!("map_failed_{width}x{height}"),
            screen(&mut bus(&fixture, Theme::FULL, "T"), width, height)
        );
    }
}

#[test]
fn a_wide_screen_shows_line_devices_and_frames_together() {
    let mut model = bus(&Fixture::traffic(), Theme::FULL, "");
    for (width, height, frames) in [(80, 40, false), (120, 40, true), (160, 50, true)] {
        let shown = screen(&mut model, width, height);
        let is_seen = shown.contains("recent frames") && shown.contains(" RX ");
        assert!(is_seen == frames && shown.contains("TIC-1") && shown.contains("settings"), "{shown}");
    }
}

#[test]
fn a_line_is_disconnected_from_its_page_and_from_the_mimic() {
    let mut fixture = Fixture::traffic();
    for open in [true, false] {
        fixture.line.state = if open { LineState::Connected } else { LineState::Disconnected };
        let word = if open { "Disconnect line L1?" } else { "Connect line L1" };
        for keys in ["6D", "1D"] {
            let mut model = bus(&fixture, Theme::FULL, "");
            type_keys(&mut model, keys);
            let shown = screen(&mut model, 80, 24);
            assert!(shown.contains(word), "{keys}:\n{shown}");
            assert_eq!(sent_kind(&type_keys(&mut model, "y")), Some(&CommandKind::Connect(L1, !open)), "{keys}");
        }
    }
}

#[test]
fn the_only_field_of_a_test_is_typed() {
    let clear = "\u{8}".repeat(3);
    let mut model = bus(&Fixture::traffic(), Theme::FULL, &format!("Ti{clear}17"));
    let expect = CommandKind::Test(L1, Diagnostic::Identify { unit: 17 });
    assert_eq!(sent_kind(&type_keys(&mut model, "⏎")), Some(&expect));
}

#[test]
fn a_plug_is_tested_after_a_question_and_its_faults_are_listed() {
    let clear = "\u{8}".repeat(3);
    let mut model = bus(&Fixture::traffic(), Theme::FULL, &format!("Tp{clear}6⏎"));
    assert!(screen(&mut model, 80, 24).contains("Sends bytes that are not Modbus"));
    let effects = type_keys(&mut model, "y");
    let diagnostic = Diagnostic::Pattern { bits: 8, count: 6 };
    assert_eq!(sent_kind(&effects), Some(&CommandKind::Test(L1, diagnostic.clone())));
    let mut fixture = Fixture::traffic();
    let came_back = |bytes: Vec<u8>| Finding::Bytes { bytes, response_time: None };
    let conclusion =
        Finding::Conclusion(Conclusion::Plug(PatternTally { received: 63, missing: 1, ..PatternTally::default() }));
    let findings = vec![came_back(vec![0x55; 32]), came_back(vec![0xAA; 31]), conclusion];
    fixture.line.test = Some(run(diagnostic, DiagnosticState::Done, 2, 2, findings));
    let shown = screen(&mut bus(&fixture, Theme::FULL, "T"), 120, 40);
    let pattern = "✗ pattern 2: 32 bytes sent, 31 received: 0 wrong, 1 missing, 0 more than sent";
    assert!(shown.contains(pattern) && !shown.contains("pattern 1:") && shown.contains("bytes are lost"), "{shown}");
}

#[test]
fn local_echo_and_signals_stand_on_the_page_of_the_line() {
    let mut fixture = Fixture::traffic();
    let mut report = fixture.line.report.as_deref().cloned().expect("the line has reported");
    report.counters.echoes = true;
    fixture.line.report = Some(Arc::new(report));
    let shown = screen(&mut bus(&fixture, Theme::FULL, "l"), 120, 40);
    assert!(shown.contains("local echo: the adapter gives back what it sends"), "{shown}");
    assert!(shown.contains("RTS on") && shown.contains("CTS on") && shown.contains("DCD off"), "{shown}");
}

#[test]
fn a_signal_is_set_after_a_question_and_its_inputs_are_listed() {
    let mut model = bus(&Fixture::traffic(), Theme::FULL, "Tg→");
    type_keys(&mut model, "↓→⏎");
    let shown = screen(&mut model, 80, 24);
    assert!(shown.contains("DTR off for") && shown.contains("10 s, then put back"), "{shown}");
    let effects = type_keys(&mut model, "y");
    let test = SignalTest { signal: OutputSignal::Dtr, on: false, seconds: 10 };
    let diagnostic = Diagnostic::Signal(test);
    assert_eq!(sent_kind(&effects), Some(&CommandKind::Test(L1, diagnostic.clone())));
    let mut fixture = Fixture::traffic();
    let signals = |ms, bits| Finding::Signals { after: Duration::from_millis(ms), signals: PortSignals(bits) };
    let findings = vec![signals(250, 0x004), signals(10_000, 0x146)];
    fixture.line.test = Some(run(diagnostic, DiagnosticState::Done, 41, 41, findings));
    let shown = screen(&mut bus(&fixture, Theme::FULL, "T"), 80, 24);
    assert!(shown.contains(" 0.25 s  RTS on  DTR off") && shown.contains("10.00 s  RTS on  DTR on"), "{shown}");
}

#[test]
fn no_signal_is_set_where_the_driver_has_it_or_there_is_none() {
    let on = |transport: &dyn Fn(&mut Transport)| {
        let mut fixture = Fixture::traffic();
        let mut report = fixture.line.report.as_deref().cloned().expect("the line has reported");
        transport(&mut report.settings.transport);
        fixture.line.report = Some(Arc::new(report));
        let mut model = bus(&fixture, Theme::FULL, "Tg");
        assert_eq!(sent_kind(&type_keys(&mut model, "⏎")), None);
        screen(&mut model, 80, 24)
    };
    let shown = on(&|transport| *transport = Transport::tcp("host", 502));
    assert!(shown.contains("a network has no RTS and DTR"), "{shown}");
    let shown = on(&|transport| {
        if let Transport::Serial { rs485, .. } = transport {
            *rs485 = Rs485::RtsHigh;
        }
    });
    assert!(shown.contains("the driver switches RTS on this line"), "{shown}");
}

#[test]
fn a_listening_line_shows_only_what_is_heard() {
    let mut model = bus(&Fixture::listening(), Theme::FULL, "l");
    let shown = screen(&mut model, 80, 24);
    insta::assert_snapshot!("line_heard_80x24", shown);
    for words in ["TX", "bytes out", "timeout ", "retry", "c settings", "cycle"] {
        assert!(!shown.contains(words), "{words}:\n{shown}");
    }
    for key in ["r", "c"] {
        assert_eq!(type_keys(&mut model, key), []);
        assert!(model.modal.is_none(), "{key}");
    }
    type_keys(&mut model, "R");
    let shown = screen(&mut model, 80, 24);
    assert!(shown.contains("unit 1   this line only listens: another master polls it"), "{shown}");
}

#[test]
fn a_silent_master_is_said_once() {
    use crate::plant::{
        alarm::{ActiveAlarm, AlarmState},
        def::{AlarmDef, AlarmId, Condition, Subject},
    };
    let mut fixture = Fixture::listening();
    fixture.line.state = LineState::NoTraffic;
    for device in &mut fixture.devices {
        (device.state, device.diagnosis) = (DeviceState::Unknown, Some(Reason::NoTraffic));
    }
    let id = AlarmId(u16::try_from(fixture.def.alarms.len()).expect("a few"));
    let alarm = AlarmDef::new(id, Subject::Line(L1), Condition::NotConnected, "no traffic heard");
    fixture.def.alarms.push(alarm);
    fixture.alarms = vec![ActiveAlarm::new(id, AlarmState::Unacknowledged, now())];
    let shown = screen(&mut bus(&fixture, Theme::FULL, "l"), 80, 24);
    let banner = shown.lines().nth(2).expect("a banner");
    assert_eq!(banner.matches("no traffic heard").count(), 1, "{shown}");
    assert!(!shown.contains("not polled") && shown.contains("not heard"), "{shown}");
}
