//! Modbus ASCII: frames among any characters, and their digits.

use sightglass::api::{
    bus::{
        ascii,
        framing::{self, FrameMatch},
    },
    plant::Framing,
};

/// A byte for the length of the request message, the message, then what came.
pub fn run(data: &[u8]) {
    let [length, rest @ ..] = data else { return };
    let (message, buffer) = rest.split_at(usize::from(*length).min(rest.len()));
    match framing::find_answer(Framing::Ascii, message, buffer) {
        FrameMatch::Answer(range) => assert!(ascii::open(&buffer[range]).is_ok(), "a response that cannot be read"),
        FrameMatch::Foreign(end, _) => assert!(0 < end && end <= buffer.len()),
        FrameMatch::Nothing | FrameMatch::Begun | FrameMatch::Corrupt(_) => {}
    }
    framing::left_over(Framing::Ascii, message, buffer);
    for found in ascii::messages(buffer) {
        assert_eq!(ascii::open(&ascii::encode(&found)), Ok(found));
    }
    if let Some(open) = ascii::open_frame(buffer) {
        assert!(open.starts_with(b":") && buffer.ends_with(open));
    }
    if let Ok(bytes) = ascii::decode(buffer) {
        let digits: String = bytes.iter().map(|byte| format!("{byte:02X}")).collect();
        assert!(digits.as_bytes().eq_ignore_ascii_case(buffer));
    }
    if let Ok(opened) = ascii::open(buffer) {
        assert!(ascii::encode(&opened).eq_ignore_ascii_case(buffer));
    }
}
