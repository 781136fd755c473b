//! Texts that are written: one request with all of their registers, and what is read back.

use std::sync::Mutex;

use super::*;
use crate::plant::{
    PlantDef,
    tag::{ByteOrder, DataType},
    tag_value::TagValue,
};

/// The first tag of unit 1 holds a text of four characters, the low byte first.
fn text_plant(mode: Mode) -> PlantDef {
    let mut def = plant(mode);
    let point = &mut def.tags[0].point;
    (point.address, point.kind, point.order) = (700, DataType::Text(4), ByteOrder::Badc);
    def
}

#[tokio::test(start_paused = true)]
async fn a_text_is_written_at_once_and_read_back() {
    for mode in Mode::ALL {
        for is_lost in [false, true] {
            let def = text_plant(mode);
            let mut line = line(def.clone());
            let held = Arc::new(Mutex::new(*b"BA  "));
            let device = held.clone();
            line.plug(mode, move |_, message| {
                let mut held = device.lock().expect("no panic");
                match message {
                    [_, 3, 2, 0xBC, 0, 2] => SlaveAction::Instead([&[message[0], 3, 4], &held[..]].concat()),
                    [_, 16, 2, 0xBC, 0, 2, 4, bytes @ ..] => {
                        held.copy_from_slice(bytes);
                        if is_lost { SlaveAction::Silent } else { SlaveAction::Answer }
                    }
                    _ => SlaveAction::Answer,
                }
            });
            let text = |event: &Event| match event {
                Event::Read { texts, .. } => texts.first().map(|(_, text)| text.to_string()),
                _ => None,
            };
            assert_eq!(line.until(&def, text).await, "AB", "{mode:?}");
            let result = line.write(&def, TagValue::Text("Nr 7".into()), true).await;
            let back = TagValue::Text("Nr 7".into());
            // A connection on which an answer is missing is closed.
            let expect = match (is_lost, mode) {
                (true, Mode::Rtu | Mode::Ascii) => WriteResult::ReadBackAfterFault(Fault::Timeout, back),
                (true, _) => WriteResult::NoValidResponse(Fault::Timeout),
                (false, _) => WriteResult::ReadBack(back),
            };
            assert_eq!((result, *held.lock().expect("no panic")), (expect, *b"rN7 "), "{mode:?}");
        }
    }
}

#[tokio::test(start_paused = true)]
async fn a_text_that_does_not_fit_is_not_sent() {
    let def = text_plant(Mode::Rtu);
    let mut line = line(def.clone());
    line.plug(Mode::Rtu, |_, message| {
        assert_ne!(message[1], 16, "{message:02X?}");
        SlaveAction::Answer
    });
    for text in ["Nr 71", "Nr ", "N\nr"] {
        let result = line.write(&def, TagValue::Text(text.into()), true).await;
        assert_eq!(result, WriteResult::NotSent(Fault::NotANumber), "{text:?}");
    }
}
