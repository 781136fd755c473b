//! The page of lamps: what is on, what is off, and what is not known.

use super::*;
use crate::{
    history::{Answer, Query},
    plant::{
        live::{LivePart, LiveReading},
        snapshot::Snapshot,
        tag::Table,
    },
};

/// The PLC with eight bits; its input 8 is known under the plant's name too, and one is not read yet.
fn plc() -> Fixture {
    let mut fixture = Fixture::normal();
    let bits = ["RUN", "AUTO", "MAN.P-1", "P-1", "M-1", "SV-1", "SV-2", "STEP"]
        .map(|short| fixture.tag(&format!("PLC-1.{short}")));
    for (address, tag) in (0..).zip(bits) {
        let def = &mut fixture.def.tags[tag.index()];
        (def.point.table, def.point.address, def.group) = (Table::Coil, address, "Outputs".to_owned());
    }
    fixture.def.tags[bits[7].index()].point.address = 3;
    for (place, on) in [true, false, false, true, false, true, false].into_iter().enumerate() {
        fixture.samples[bits[place].index()] = Sample::good(f64::from(u8::from(on)), fixture::now());
    }
    fixture.samples[bits[7].index()] = Sample::bad(Cause::NotRead, fixture::now());
    fixture.samples[bits[6].index()] = Sample::bad(Cause::NotRead, fixture::now());
    fixture
}

#[test]
fn lamps_show_each_bit_once_and_say_what_is_not_known() {
    let mut model = model(&plc(), Theme::FULL);
    type_keys(&mut model, "4↓⏎i");
    for (width, height) in [(80, 24), (120, 40), (60, 16)] {
        let shown = screen(&mut model, width, height);
        for lamp in ["● RUN", "○ AUTO", "● P-1 STEP", "● SV-1", "? SV-2", "? 1 not read yet"] {
            assert!(shown.contains(lamp), "no {lamp} at {width}x{height}:\n{shown}");
        }
    }
    let effects = type_keys(&mut model, "u");
    assert_eq!(sent_kind(&effects), Some(&CommandKind::Refresh(DeviceId(1))));
    let plain = {
        let mut model = self::model(&plc(), Theme::PLAIN);
        type_keys(&mut model, "4↓⏎i");
        screen(&mut model, 80, 24)
    };
    assert!(plain.contains("# RUN") && plain.contains(". AUTO"), "{plain}");
}

#[test]
fn a_device_without_bits_says_that_it_has_no_lamps() {
    let mut model = model(&plc(), Theme::FULL);
    type_keys(&mut model, "4⏎i");
    assert!(screen(&mut model, 80, 24).contains("no bits to show as lamps"));
    // The arrows go to the devices that have some.
    type_keys(&mut model, "⎋⎋4↓⏎i→");
    assert!(screen(&mut model, 80, 24).contains("● RUN"));
}

/// The lamps as a PLC answers to the query of the page: AUTO is on by now.
fn read(effects: &[Effect], at: jiff::Timestamp) -> Option<(crate::ui::QueryId, LiveReading)> {
    effects.iter().find_map(|effect| match effect {
        Effect::Query(id, Query::Registers(read)) => {
            let parts = read.spans.iter().map(|span| {
                let words = (0..span.count).map(|n| u16::from(span.address + n == 1)).collect();
                LivePart { at, span: *span, words: Ok(words) }
            });
            Some((*id, LiveReading { parts: parts.collect(), ..LiveReading::default() }))
        }
        _ => None,
    })
}

#[test]
fn the_page_reads_its_lamps_and_says_which_may_have_changed() {
    let fixture = plc();
    let mut model = model(&fixture, Theme::FULL);
    let effects = type_keys(&mut model, "4↓⏎i");
    let (id, reading) = read(&effects, fixture::now()).expect("it reads what it shows");
    let span = reading.parts[0].span;
    assert_eq!((reading.parts.len(), span.table, span.address, span.count), (1, Table::Coil, 0, 7));
    let later = |seconds: i64| {
        let snapshot = fixture.snapshot();
        let at = snapshot.at + SignedDuration::from_secs(seconds);
        Msg::Snapshot(std::sync::Arc::new(Snapshot { at, ..(*snapshot).clone() }))
    };
    let mut read_at = reading;
    read_at.parts[0].at = fixture::now() + SignedDuration::from_secs(2);
    update(&mut model, Msg::Answer(id, Ok(Answer::Registers(read_at))));
    let effects = update(&mut model, later(2));
    assert!(read(&effects, fixture::now()).is_some(), "it is read again");
    let shown = screen(&mut model, 80, 24);
    assert!(shown.contains("○ RUN") && shown.contains("● AUTO") && shown.contains("○ SV-2"), "{shown}");
    update(&mut model, later(9));
    let shown = screen(&mut model, 80, 24);
    assert!(shown.contains("◌ RUN") && shown.contains("◉ AUTO"), "{shown}");
    assert!(shown.contains("7 read more than 5 s ago: they may have changed"), "{shown}");
    let effects = type_keys(&mut model, "⎋");
    assert!(read(&effects, fixture::now()).is_none(), "not once the page is closed");
}

#[test]
fn outputs_that_only_the_ladder_drives_are_named() {
    let mut fixture = plc();
    let shown = |fixture: &Fixture| {
        let mut model = model(fixture, Theme::FULL);
        type_keys(&mut model, "4↓⏎i");
        screen(&mut model, 80, 24)
    };
    const WORDS: &str = "Outputs  driven by the device: it overwrites what is written to them";
    assert!(!shown(&fixture).contains(WORDS), "RUN is a command");
    for tag in fixture.def.tags.iter_mut().filter(|tag| tag.group == "Outputs") {
        tag.access = crate::plant::tag::Access::Read;
    }
    assert!(shown(&fixture).contains(WORDS));
}
