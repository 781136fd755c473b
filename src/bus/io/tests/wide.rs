//! Addresses that hold 32 bits each, as Enron and Daniel count: what a read of them brings, and nothing else.

use std::sync::Mutex;

use super::*;
use crate::plant::{PlantDef, tag::DataType};

/// The first four tags of unit 1 are 7001 to 7004.
fn wide_plant(mode: Mode) -> PlantDef {
    let mut def = plant(mode);
    for (place, address) in (7_001..=7_004).enumerate() {
        let point = &mut def.tags[place].point;
        (point.address, point.kind) = (address, DataType::EnronU32);
    }
    def
}

/// Four bytes for each address from 7000 on.
fn enron(message: &[u8]) -> SlaveAction {
    let word = |at: usize| u16::from_be_bytes([message[at], message[at + 1]]);
    match (message[1], word(2)) {
        (3, 7_000..) => {
            let values = (word(2)..word(2) + word(4)).flat_map(|at| u32::from(at).to_be_bytes());
            SlaveAction::Instead([message[0], 3, 4 * message[5]].into_iter().chain(values).collect())
        }
        _ => SlaveAction::Answer,
    }
}

#[tokio::test(start_paused = true)]
async fn addresses_of_32_bits_are_read_and_written_by_their_count() {
    for mode in Mode::ALL {
        let def = wide_plant(mode);
        let mut line = line(def.clone());
        let seen: Arc<Mutex<Vec<Vec<u8>>>> = Arc::default();
        let log = seen.clone();
        line.plug(mode, move |_, message| {
            log.lock().expect("no panic").push(message.to_vec());
            enron(message)
        });
        let whole = |event: &Event| match event {
            Event::Read { values, .. } => values.iter().any(|(tag, _)| *tag == TagId(3)).then_some(values.len()),
            Event::Failed { fault, .. } => panic!("{mode:?}: {fault}"),
            _ => None,
        };
        assert_eq!(line.until(&def, whole).await, 4, "{mode:?}");
        let result = line.write(&def, 7_001.0, true).await;
        assert_eq!(result, WriteResult::ReadBack(7_001.0.into()), "{mode:?}");
        let seen = seen.lock().expect("no panic").clone();
        assert!(seen.contains(&vec![1, 3, 0x1B, 0x59, 0, 4]), "{mode:?}: {seen:02X?}");
        let write = vec![1, 16, 0x1B, 0x59, 0, 1, 4, 0, 0, 0x1B, 0x59];
        assert_eq!(seen.iter().filter(|message| message[1] == 16).collect::<Vec<_>>(), [&write], "{mode:?}");
    }
}

#[tokio::test(start_paused = true)]
async fn an_answer_that_counts_otherwise_is_no_value() {
    for mode in Mode::ALL {
        // Two bytes for each address of 32 bits.
        let def = wide_plant(mode);
        let mut narrow = line(def.clone());
        narrow.plug(mode, |_, _| SlaveAction::Answer);
        let fault = narrow.fault(&def).await;
        assert!(matches!(fault, Fault::WrongLength { got, asked } if 2 * got == asked), "{mode:?}: {fault}");
        // Four bytes for each register of 16.
        let def = plant(mode);
        let mut wide = line(def.clone());
        wide.plug(mode, |_, message| {
            let bytes = vec![0; 4 * usize::from(message[5])];
            SlaveAction::Instead([&[message[0], 3, bytes.len() as u8], &bytes[..]].concat())
        });
        let fault = wide.fault(&def).await;
        assert!(matches!(fault, Fault::WrongLength { got, asked } if got == 2 * asked), "{mode:?}: {fault}");
    }
}
