//! What people type and paste: bytes in hex, the filter of frames, periods and instants.

use sightglass::api::{
    bus::{Filter, frame::hex, hex_input},
    plant::Framing,
    report::period_parser,
};

use super::common::{TANK, framing, now};

/// A byte for the framing, then the words.
pub fn run(data: &[u8]) {
    let [kind, words @ ..] = data else { return };
    let Ok(words) = std::str::from_utf8(words) else { return };
    let framing = framing(*kind);
    for framing in [None, Some(framing)] {
        match hex_input::parse(words, framing) {
            Ok(typed) if typed.framing.is_none() => {
                let again = hex_input::parse(&hex(&typed.bytes), framing).map(|again| again.bytes);
                assert_eq!(again, Ok(typed.bytes.clone()));
            }
            Ok(typed) => assert_eq!(typed.framing, Some(Framing::Ascii)),
            Err(why) => assert!(!why.to_string().is_empty()),
        }
    }
    if let Ok(typed) = hex_input::parse(words, None) {
        _ = typed.framed(framing, 1);
    }
    _ = hex_input::parse_paste(words);
    _ = Filter::parse(words);
    for period in [
        period_parser::named(&TANK, words, now()),
        period_parser::of_calendar(&TANK, words, now()),
        period_parser::period(&TANK, None, Some(words), None, now()),
        period_parser::period(&TANK, None, Some("2026-01-01"), Some(words), now()),
    ]
    .into_iter()
    .flatten()
    {
        assert!(period.from < period.to, "{period:?}");
    }
    _ = period_parser::past_instant(&TANK, words, now());
}
