//! The text of the alarm-state file: of each alarm the last event of every kind (and step of its action), one checked line each, oldest first.
//!
//! ```text
//! sightglass alarm state 4
//! 5f0c9a1be2d34477 {"at":"2026-05-01T12:00:00Z","subject":"TIC-1.PV","text":"high",…}
//!  └ the first 8 bytes of the SHA-256 of what follows
//! ```

use std::{
    collections::{BTreeMap, HashMap},
    fmt::Write,
    sync::Arc,
};

use sha2::{Digest, Sha256};

use crate::plant::record::AlarmRecord;

/// The first line; its number goes up with every change of the others, to one that no flipped bit makes of that before.
pub const HEADER: &str = "sightglass alarm state 4\n";
/// That of files whose events do not say which alarm they are of but by its name.
const HEADER_BEFORE: &str = "sightglass alarm state 2\n";
/// Most events that are kept: seventeen kinds of some thousand alarms, also of those that the plant file no longer has.
const EVENTS_MAX: usize = 50_000;
/// Hexadecimal digits of a checksum.
const DIGITS: usize = 16;

/// All that the state of the alarms depends on: of each alarm the last event of every kind, oldest first.
#[derive(Debug, Clone, Default)]
pub struct LatestEvents {
    events: BTreeMap<u64, AlarmRecord>,
    places: HashMap<Key, u64>,
    next: u64,
}

impl LatestEvents {
    /// The next event; the one of the same kind before it counts no more.
    pub fn on_event(&mut self, event: AlarmRecord) {
        if let Some(old) = self.places.insert(key(&event), self.next) {
            self.events.remove(&old);
        }
        self.events.insert(self.next, event);
        self.next += 1;
        if EVENTS_MAX < self.events.len()
            && let Some((_, oldest)) = self.events.pop_first()
        {
            self.places.remove(&key(&oldest));
        }
    }

    /// Oldest first.
    pub fn iter(&self) -> impl Iterator<Item = &AlarmRecord> {
        self.events.values()
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.events.len()
    }

    /// No alarm has ever had an event.
    pub fn is_empty(&self) -> bool {
        self.events.is_empty()
    }
}

/// Which alarm, the kind of its event, and the step of its action that the event is about.
type Key = (Arc<str>, Arc<str>, &'static str, Option<Arc<str>>);

fn key(event: &AlarmRecord) -> Key {
    let step = event.reason.clone().filter(|_| event.event.is_of_step());
    (event.subject.clone(), event.message.clone(), event.event.word(), step)
}

/// An event as a line, with its end.
pub fn line(event: &AlarmRecord) -> String {
    let text = serde_json::to_string(event).expect("texts, numbers and times can always be written");
    format!("{} {text}\n", checksum(&text))
}

fn checksum(text: &str) -> String {
    let mut digits = String::with_capacity(DIGITS);
    for byte in &Sha256::digest(text.as_bytes())[..DIGITS / 2] {
        // Writing into a text cannot fail.
        let _ = write!(digits, "{byte:02x}");
    }
    digits
}

/// Does a file end within a line? Nothing of that line was ever confirmed, unless more is missing.
pub fn is_cut(bytes: &[u8]) -> bool {
    bytes.last().is_some_and(|byte| *byte != b'\n') || written(bytes).len() < bytes.len()
}

/// Without the last lines that a loss of power has left with zeros, where a block of the disk was not written yet. Zeros with whole
/// lines behind them are damage.
fn written(bytes: &[u8]) -> &[u8] {
    let Some(zeros) = bytes.windows(2).position(|pair| pair == [0, 0]) else { return bytes };
    let is_whole = bytes[zeros..].split_inclusive(|byte| *byte == b'\n').any(|line| event_of(line).is_some());
    if is_whole { bytes } else { &bytes[..zeros] }
}

/// Reads a file. `Err` names what is damaged. The beginning of a line at the end is left out, see [`is_cut`].
pub fn parse(bytes: &[u8]) -> Result<LatestEvents, String> {
    let bytes = written(bytes);
    let end = bytes.iter().rposition(|byte| *byte == b'\n').map_or(0, |place| place + 1);
    let mut events = LatestEvents::default();
    let mut lines = bytes[..end].split_inclusive(|byte| *byte == b'\n');
    let header = lines.next().unwrap_or_default();
    let is_known = [HEADER, HEADER_BEFORE].map(str::as_bytes).contains(&header);
    if !is_known && header.starts_with(b"sightglass alarm state ") {
        return Err("it has the format of another version".to_owned());
    }
    if !is_known {
        return Err(format!("line 1 is not `{}`", HEADER.trim_end()));
    }
    for (number, line) in (2..).zip(lines) {
        events.on_event(event_of(line).ok_or_else(|| format!("line {number} is not as it was written"))?);
    }
    Ok(events)
}

fn event_of(line: &[u8]) -> Option<AlarmRecord> {
    let (sum, text) = std::str::from_utf8(line).ok()?.strip_suffix('\n')?.split_once(' ')?;
    (sum == checksum(text)).then(|| serde_json::from_str(text).ok())?
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use jiff::Timestamp;
    use proptest::prelude::*;

    use super::*;
    use crate::plant::{
        def::Priority,
        record::{AlarmEvent, FirstOut},
    };

    fn event() -> impl Strategy<Value = AlarmRecord> {
        let words = || proptest::option::of("\\PC{0,20}").prop_map(|words| words.map(Arc::from));
        let number = || proptest::option::of(-1e9..1e9f64);
        let kind = (0..AlarmEvent::ALL.len()).prop_map(|place| AlarmEvent::ALL[place]);
        let time = || (0i64..2_000_000_000_000_000).prop_map(|micros| Timestamp::from_microsecond(micros).unwrap());
        let more = (number(), number(), words(), words(), proptest::option::of(time()));
        (time(), 0..3u8, kind, more, any::<bool>()).prop_map(|(at, subject, event, more, first_out)| {
            let (value, limit, by, reason, until) = more;
            let record = AlarmRecord::new(at, &format!("TIC-{subject}.PV"), "high", Priority::High, event);
            let first_out = first_out.then_some(FirstOut { began: at, rank: 7 });
            AlarmRecord { value: value.map(Into::into), limit, by, reason, until, first_out, ..record }
        })
    }

    proptest! {
        #[test]
        fn the_last_step_of_each_kind_is_read_back(
            journal in proptest::collection::vec(event(), 0..80),
            cut in 0usize..400,
        ) {
            let mut text = HEADER.to_owned();
            journal.iter().for_each(|event| text += &line(event));
            let parsed = parse(text.as_bytes()).unwrap();
            let later = |place: usize, event: &AlarmRecord| journal[place + 1..].iter().any(|other| key(other) == key(event));
            let expected = journal.iter().enumerate().filter(|(place, event)| !later(*place, event)).map(|(_, event)| event);
            prop_assert_eq!(parsed.iter().collect::<Vec<_>>(), expected.collect::<Vec<_>>());
            // A loss of power leaves whole lines and at most the beginning of one.
            let cut = &text.as_bytes()[..(HEADER.len() + cut).min(text.len())];
            let whole = cut.iter().filter(|byte| **byte == b'\n').count() - 1;
            prop_assert_eq!(parse(cut).unwrap().next as usize, whole);
        }

        #[test]
        fn a_flipped_bit_in_a_whole_line_is_found(events in proptest::collection::vec(event(), 1..5), at in 0usize..5_000, bit in 0u8..8) {
            let mut bytes = HEADER.as_bytes().to_vec();
            events.iter().for_each(|event| bytes.extend(line(event).into_bytes()));
            // Not the last end of line: without it the line was never confirmed.
            let place = at % (bytes.len() - 1);
            bytes[place] ^= 1 << bit;
            prop_assert!(parse(&bytes).is_err());
        }
    }

    #[test]
    fn zeros_behind_the_last_whole_line_are_no_damage() {
        let at = Timestamp::UNIX_EPOCH;
        let event = |text: &str| line(&AlarmRecord::new(at, "TIC-1.PV", text, Priority::High, AlarmEvent::Raised));
        let (whole, last) = (format!("{HEADER}{}", event("high")), event("low"));
        let mut lost = last.clone().into_bytes();
        lost[20..60].fill(0);
        let torn = [whole.as_bytes(), &lost].concat();
        assert_eq!((parse(&torn).unwrap().len(), is_cut(&torn)), (1, true));
        let within = [whole.as_bytes(), &lost, last.as_bytes()].concat();
        assert!(parse(&within).is_err_and(|why| why.contains("line 3")));
    }

    #[test]
    fn a_flipped_bit_in_the_header_is_found() {
        for header in [HEADER, HEADER_BEFORE] {
            for (place, bit) in (0..header.len()).flat_map(|place| (0..8).map(move |bit| (place, bit))) {
                let mut bytes = header.as_bytes().to_vec();
                bytes[place] ^= 1 << bit;
                assert!(parse(&bytes).is_err(), "{place} {bit}");
            }
        }
    }

    #[test]
    fn a_newer_or_missing_file_is_not_read_as_no_alarms() {
        assert!(parse(b"").is_err_and(|why| why.contains("line 1")));
        assert!(parse(b"sightglass alarm state 3\n").is_err_and(|why| why.contains("another version")));
        assert!(parse(HEADER.as_bytes()).unwrap().is_empty());
    }

    #[test]
    fn a_file_of_the_version_before_is_read() {
        let text = r#"{"at":"2026-05-01T12:00:00Z","subject":"TIC-1.PV","message":"high","priority":"High","event":"Raised","value":null,"limit":75.0,"by":null,"reason":null,"until":null,"first_out":null}"#;
        let events = parse(format!("{HEADER_BEFORE}{} {text}\n", checksum(text)).as_bytes()).unwrap();
        assert!(events.iter().map(|event| (&*event.message, &event.identity)).eq([("high", &None)]));
    }
}
