//! What the window says in the cases that a technician meets.

use std::{sync::Arc, time::Duration};

use jiff::{SignedDuration, Timestamp};

use crate::{
    bus::frame,
    plant::{
        def::DeviceId,
        expr::{Compare, Expr},
        fault::{ExceptionCode, Fault},
        identity::{IdentityObject, IdentityTest},
        line::Framing,
        line_report::{LineReport, PollReport},
        line_state::DeviceState,
        ne107::Reason,
        request_stats::RequestStats,
        sample::{Cause, Sample},
        tag::{Decimals, Poll, Table},
        traffic::Exchange,
    },
    ui::{
        fixture::{self, Fixture},
        tests::{model, screen, type_keys},
        theme::Theme,
    },
};

fn ago(ms: i64) -> Timestamp {
    fixture::now() - SignedDuration::from_millis(ms)
}

/// The plant as a station knows it: a report of the line, and the answer that brought TIC-1's ten registers.
fn fixture() -> Fixture {
    let mut plant = Fixture::normal();
    let (pv, sv) = (plant.tag("TIC-1.PV"), plant.tag("TIC-1.SV"));
    // PV counts in tenths, as SV says: no such device, but every step of the way is there.
    (plant.def.tags[pv.index()].decimals, plant.def.tags[pv.index()].scale) = (Decimals::From(sv), 1.0);
    let mut stats = RequestStats::default();
    for n in 0..200 {
        let outcome = if n % 100 == 7 { Err(Fault::Timeout) } else { Ok(()) };
        stats.count(outcome, outcome.is_ok().then_some(Duration::from_millis(12)));
    }
    stats.jitter.add(Duration::from_millis(2));
    let tags: Vec<_> = plant.def.tags_of(DeviceId(0)).map(|tag| tag.id).collect();
    plant.line.report = Some(Arc::new(LineReport {
        counters: plant.line.counters,
        polls: vec![PollReport {
            device: DeviceId(0),
            table: Table::Holding,
            address: 1_000,
            count: 10,
            tags: tags.into(),
            poll: Poll::Every(Duration::from_secs(1)),
            cost: Duration::from_millis(64),
            next: Some(fixture::now() + SignedDuration::from_millis(600)),
            class: crate::plant::tag::PollClass::Normal,
            factor: 1.0,
            shed: false,
            stats: stats.clone(),
        }],
        devices: vec![(DeviceId(0), stats)],
        ..LineReport::new(plant.def.lines[0].clone())
    }));
    for device in &mut plant.devices {
        device.last_fault = Some((ago(71_000), Fault::Timeout));
    }
    let mut answer = vec![1, 3, 20];
    for word in [642u16, 700, 420, 0, 0, 50, 240, 600, 0, 0] {
        answer.extend(word.to_be_bytes());
    }
    asked(&mut plant, Ok(()), frame::with_crc(&answer), 1);
    plant
}

/// The last request for all of TIC-1's tags ended so.
fn asked(plant: &mut Fixture, outcome: Result<(), Fault>, answer: Vec<u8>, tries: u8) {
    let exchange = Arc::new(Exchange {
        at: ago(420),
        framing: Framing::Rtu,
        request: frame::with_crc(&[1, 3, 0x03, 0xE8, 0, 10]).into(),
        response_time: (!answer.is_empty()).then_some(Duration::from_millis(12)),
        answer: answer.into(),
        outcome,
        tries,
    });
    for tag in plant.def.tags.iter().filter(|tag| tag.device == DeviceId(0)) {
        plant.source_frames[tag.id.index()] = Some(exchange.clone());
    }
}

fn doubt(plant: &mut Fixture, change: impl Fn(Sample) -> Sample) {
    for tag in plant.def.tags.iter().filter(|tag| tag.device == DeviceId(0)) {
        let sample = &mut plant.samples[tag.id.index()];
        *sample = change(Sample { at: ago(4_400), ..*sample });
    }
}

fn cases() -> Vec<(&'static str, Fixture)> {
    let good = fixture();
    let mut timeout = fixture();
    asked(&mut timeout, Err(Fault::Timeout), Vec::new(), 1);
    doubt(&mut timeout, |sample| sample.uncertain(Cause::Timeout));
    timeout.devices[0].state = DeviceState::Failing(2);
    timeout.devices[0].last_fault = Some((ago(420), Fault::Timeout));
    timeout.devices[0].diagnosis = Some(Reason::Failing { failed: 8, of: 64 });
    let mut crc = fixture();
    let mut corrupt = crc.source_frames[0].as_ref().map(|exchange| exchange.answer.to_vec()).unwrap_or_default();
    corrupt[5] ^= 0x40;
    let fault = frame::without_crc(&corrupt).expect_err("a corrupt frame");
    asked(&mut crc, Err(fault), corrupt, 2);
    doubt(&mut crc, |sample| sample.uncertain(Cause::Corrupt));
    crc.devices[0].last_fault = Some((ago(420), fault));
    let mut exception = fixture();
    let fault = Fault::Exception(ExceptionCode(2));
    asked(&mut exception, Err(fault), frame::with_crc(&[1, 0x83, 2]), 1);
    doubt(&mut exception, |sample| Sample::bad(Cause::Exception, sample.at));
    exception.devices[0].last_fault = Some((ago(420), fault));
    let mut never = fixture();
    never.source_frames.fill(None);
    doubt(&mut never, |sample| Sample::bad(Cause::NotRead, sample.at));
    never.devices[0] = Default::default();
    never.line.report =
        never.line.report.map(|report| Arc::new(LineReport { devices: Vec::new(), ..(*report).clone() }));
    let gone = Fixture::line_down();
    let mut down = Fixture { samples: gone.samples, devices: gone.devices, ..fixture() };
    down.line.state = gone.line.state;
    down.devices[0].diagnosis = Some(Reason::NotConnected);
    vec![
        ("good", good),
        ("timeout", timeout),
        ("crc", crc),
        ("exception", exception),
        ("line_down", down),
        ("never_read", never),
    ]
}

#[test]
fn why_in_every_case() {
    for (name, fixture) in cases() {
        for (width, height) in [(80, 24), (120, 40)] {
            let mut model = model(&fixture, Theme::FULL);
            type_keys(&mut model, "4w");
            insta::assert_snapshot!(format!("why_{name}_{width}x{height}"), screen(&mut model, width, height));
        }
    }
}

#[test]
fn an_answer_that_holds_no_value_is_no_old_one() {
    for (cause, is_old) in
        [(Cause::NotPresent, false), (Cause::SensorFault, false), (Cause::Unscaled, false), (Cause::Stale, true)]
    {
        let mut fixture = fixture();
        doubt(&mut fixture, |sample| Sample::bad(cause, sample.at));
        let mut model = model(&fixture, Theme::FULL);
        type_keys(&mut model, "4w");
        let shown = screen(&mut model, 120, 40);
        assert_eq!(shown.contains("no good response since"), is_old, "{cause:?}\n{shown}");
    }
}

/// A tag that the device has from revision 2.10 on.
#[test]
fn what_the_device_says_of_itself_stands_beside_what_is_wanted() {
    for (said, expect) in
        [(Some("V2.9"), "revision >= \"2.10\", the device says \"V2.9\""), (None, "revision >= \"2.10\"")]
    {
        let mut fixture = fixture();
        doubt(&mut fixture, |sample| Sample::bad(Cause::NotPresent, sample.at));
        let (pv, device) = (fixture.tag("TIC-1.PV"), DeviceId(0));
        let object = IdentityObject::of("revision").expect("an object");
        let test = IdentityTest { device, object, compare: Compare::AtLeast, with: "2.10".to_owned() };
        fixture.def.tags[pv.index()].when = Some(Arc::new(Expr::Identity(test)));
        fixture.identities.set(device, said.map(|text| (object, text.to_owned())).into_iter().collect());
        let mut model = model(&fixture, Theme::FULL);
        type_keys(&mut model, "4w");
        let shown = screen(&mut model, 120, 40);
        assert!(shown.contains(expect) && shown.contains("the device says") == said.is_some(), "{shown}");
    }
}

#[test]
fn a_small_screen_has_the_essentials_without_scrolling() {
    for (name, fixture) in cases() {
        let mut model = model(&fixture, Theme::FULL);
        type_keys(&mut model, "4w");
        let shown = screen(&mut model, 80, 24);
        let asked = if name == "never_read" { "not yet" } else { "01 03 03 E8 00 0A" };
        for words in ["value", "number", "41001 / 0x03E8", "3 / 0x03", "unit 1", "device", "poll", asked] {
            assert!(shown.contains(words), "{name}: no `{words}`\n{shown}");
        }
        let wants = !matches!(name, "good" | "never_read");
        assert_eq!(shown.contains("action "), wants, "{name}\n{shown}");
    }
}

#[test]
fn it_can_be_asked_wherever_a_value_is_selected() {
    for keys in ["w", "→w", "→⏎w", "2w", "2vw", "3w", "4w", "4↓↓w"] {
        let mut fixture = Fixture::alarm();
        fixture.source_frames = self::fixture().source_frames;
        let mut model = model(&fixture, Theme::FULL);
        type_keys(&mut model, keys);
        let shown = screen(&mut model, 80, 24);
        assert!(shown.contains("┌─ why "), "{keys}\n{shown}");
        type_keys(&mut model, "⎋");
        assert!(model.modal.is_none(), "{keys}");
    }
}

#[test]
fn the_other_values_are_one_key_away() {
    let mut model = model(&fixture(), Theme::FULL);
    type_keys(&mut model, "4w→");
    let shown = screen(&mut model, 80, 24);
    assert!(shown.contains("why TIC-1.SV") && shown.contains("[02 BC]"), "{shown}");
    type_keys(&mut model, "←←");
    assert!(screen(&mut model, 80, 24).contains("why TIC-1.FIX"));
}

#[test]
fn every_byte_is_below_for_who_scrolls() {
    let mut model = model(&fixture(), Theme::FULL);
    type_keys(&mut model, "4w↓↓↓↓↓↓↓↓↓↓↓↓");
    let shown = screen(&mut model, 80, 24);
    assert!(shown.contains("byte by byte") && shown.contains("▸ 02 82        41001 / 0x03E8"), "{shown}");
}
