//! The page of lamps: what is on, what is off, and what is not known.

use super::*;
use crate::plant::tag::Table;

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
