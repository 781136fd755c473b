//! What the form does for a technician who looks for the right settings.

use std::{sync::Arc, time::Duration};

use crate::{
    plant::{
        command::CommandKind,
        def::{Framing, LineDef, LineId, Parity, Protocol, Serial, Transport},
        line_state::{DeviceState, LineState},
    },
    ui::{
        Model,
        fixture::Fixture,
        tests::{model, screen, sent_kind, type_keys},
        theme::Theme,
    },
};

fn open(fixture: &Fixture) -> Model {
    let mut model = model(fixture, Theme::FULL);
    type_keys(&mut model, "4c");
    model
}

/// The settings that these keys lead to, confirmed.
fn tried(keys: &str) -> Option<LineDef> {
    let mut model = open(&Fixture::normal());
    type_keys(&mut model, keys);
    match sent_kind(&type_keys(&mut model, "⏎⏎")) {
        Some(CommandKind::Configure(settings)) => Some((**settings).clone()),
        Some(other) => panic!("{other:?}"),
        None => None,
    }
}

fn line() -> LineDef {
    Fixture::normal().def.lines[0].clone()
}

fn with(transport: Transport) -> Option<LineDef> {
    Some(LineDef { transport, ..line() })
}

fn serial(serial: Serial) -> Option<LineDef> {
    with(Transport::rtu("/dev/ttyUSB0", serial))
}

#[test]
fn what_is_chosen_is_what_is_sent() {
    let usual = Serial::USUAL;
    assert_eq!(tried("→"), serial(Serial { baud: 14_400, ..usual }));
    assert_eq!(tried("→→"), serial(Serial { baud: 19_200, ..usual }));
    assert_eq!(tried("←"), serial(Serial { baud: 4_800, ..usual }));
    assert_eq!(tried("↓↓→"), serial(Serial { parity: Parity::Even, ..usual }));
    assert_eq!(tried("↓↓↓→"), serial(Serial { stop_bits: 2, ..usual }));
    let ascii = Serial { data_bits: 7, ..usual };
    let transport = |port: &str, serial, framing| Transport::Serial {
        port: port.into(),
        serial,
        framing,
        rs485: Default::default(),
    };
    assert_eq!(tried("↑↑→"), with(transport("/dev/ttyUSB0", ascii, Framing::Ascii)));
    assert_eq!(tried("↑1u"), with(transport("/dev/ttyUSB01u", usual, Framing::Rtu)), "letters are text here");
    assert_eq!(tried("↑↑→→↓plc7"), with(Transport::tcp("plc7", 502)));
    let udp = Transport::Network { protocol: Protocol::Udp, host: "plc7".into(), port: 502, framing: Framing::Mbap };
    assert_eq!(tried("↑↑→→→→→↓plc7"), with(udp));
    assert_eq!(tried("↓↓↓↓x1").map(|line| line.timeout), Some(Duration::from_millis(3_001)));
}

#[test]
fn what_cannot_be_is_reported_before_anything_is_sent() {
    for (keys, expect) in [
        ("⏎", "these settings are active already"),
        ("↓→", "Modbus RTU always has 8 data bits"),
        ("↑↑→→⏎", "a TCP line needs a host"),
        ("↑↑→→→→→⏎", "a UDP line needs a host"),
        ("↑↑→→→→→", "UDP port"),
        ("↑↑→→→→→↓h↓999⏎", "is not a port"),
        ("↓↓↓↓999⏎", "too long: the line is blocked for this time"),
        ("u", "nothing to revert"),
        ("S", "nothing to save"),
        ("→S", "apply these first"),
    ] {
        let mut model = open(&Fixture::normal());
        let effects = type_keys(&mut model, keys);
        assert_eq!(sent_kind(&effects), None, "{keys}");
        let shown = screen(&mut model, 80, 24);
        assert!(shown.contains(expect), "{keys}: no `{expect}` in\n{shown}");
    }
}

#[test]
fn nothing_is_done_that_was_not_asked_twice() {
    let mut model = open(&Fixture::normal());
    assert_eq!(sent_kind(&type_keys(&mut model, "→⏎n")), None);
    assert!(screen(&mut model, 80, 24).contains("14400"), "the form stays as it was");
    assert_eq!(sent_kind(&type_keys(&mut model, "⏎⎋")), None);
    assert!(model.modal.is_none());
}

/// 19200 baud was applied, and no device answers.
fn tried_out() -> Fixture {
    let mut fixture = Fixture::normal();
    let before = line();
    let serial = Serial { baud: 19_200, ..Serial::USUAL };
    fixture.def.lines[0].transport = Transport::rtu("/dev/ttyUSB0", serial);
    fixture.line.settings_before = Some(Arc::new(before));
    fixture.devices[0].state = DeviceState::Failing(2);
    fixture
}

#[test]
fn settings_can_be_taken_back_and_saved() {
    let mut model = open(&tried_out());
    let effects = type_keys(&mut model, "u⏎");
    assert_eq!(sent_kind(&effects), Some(&CommandKind::Configure(Box::new(line()))));
    let mut model = open(&tried_out());
    assert_eq!(sent_kind(&type_keys(&mut model, "S⏎")), Some(&CommandKind::SaveSettings(LineId(0))));
}

#[test]
fn what_is_asked_can_be_read_on_the_smallest_screen() {
    let mut fixture = tried_out();
    let why = "/dev/ttyUSB7: no such port; here are /dev/ttyUSB0, /dev/ttyS0, /dev/ttyS1, /dev/ttyS2".into();
    fixture.line.state = LineState::Waiting { why, retry_at: crate::ui::fixture::now() };
    for (width, height) in [(60, 16), (80, 24)] {
        let mut model = open(&fixture);
        type_keys(&mut model, "↓↓↓↓↓");
        let shown = screen(&mut model, width, height);
        assert!(shown.contains("gap") && shown.contains("⏎ apply"), "{shown}");
        type_keys(&mut model, "u");
        let shown = screen(&mut model, width, height);
        for words in ["Revert to RTU /dev/ttyUSB0 9600 8N1?", "⏎ yes   n no"] {
            assert!(shown.contains(words), "no `{words}` in\n{shown}");
        }
    }
}

#[test]
fn the_form_as_it_is_seen() {
    let mut gone = tried_out();
    let why = "/dev/ttyUSB7: no such port; here are /dev/ttyUSB0, /dev/ttyS0".into();
    gone.line.state = LineState::Waiting { why, retry_at: crate::ui::fixture::now() };
    for (name, fixture, keys) in [
        ("at_first", Fixture::normal(), ""),
        ("changed", Fixture::normal(), "→↓↓→"),
        ("asked", Fixture::normal(), "→↓↓→⏎"),
        ("tcp", Fixture::normal(), "↑↑→→↓10.0.0.5"),
        ("tried_out", tried_out(), ""),
        ("no_port", gone, ""),
    ] {
        let mut model = open(&fixture);
        type_keys(&mut model, keys);
        insta::assert_snapshot!(format!("settings_{name}"), screen(&mut model, 80, 24));
    }
}
