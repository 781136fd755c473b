//! The alarm-state file: a damaged one is not taken for a whole one, and whatever is written is read again.

use sightglass::api::{
    history::alarm_state::{HEADER, LatestEvents, is_cut, line, parse},
    plant::AlarmRecord,
};

/// A file; of its lines those that are events, with or without their checksum, are written once more.
pub fn run(data: &[u8]) {
    match parse(data) {
        Ok(events) => check_written(&events),
        Err(why) => assert!(!why.is_empty()),
    }
    is_cut(data);
    let lines = data.split(|byte| *byte == b'\n').filter_map(|line| {
        let json = line.iter().position(|byte| *byte == b'{').map_or(line, |start| &line[start..]);
        serde_json::from_slice::<AlarmRecord>(json).ok()
    });
    let mut events = LatestEvents::default();
    lines.for_each(|event| events.on_event(event));
    check_written(&events);
}

fn check_written(events: &LatestEvents) {
    let text: String = std::iter::once(HEADER.to_owned()).chain(events.iter().map(line)).collect();
    assert!(!is_cut(text.as_bytes()));
    let read = parse(text.as_bytes()).expect("a file that was just written");
    assert!(read.iter().eq(events.iter()), "{text}");
}
