//! Writes of texts, dates and times.

use super::*;
use crate::plant::{
    data_type::{Clock, DataType},
    tag::Access,
    tag_value::TagValue,
};

/// The plant in which SV holds a text, which reads so.
fn plant_with(kind: DataType, shown: &str) -> Plant {
    let mut def = fixture::plant();
    def.tags[SV.index()].point.kind = kind;
    let mut plant = Plant::new(Arc::new(def), at(0), 1.0);
    plant.on_event(Event::Line { at: at(0), line: L1, state: LineState::Connected });
    plant.on_event(texts(0, shown));
    plant
}

fn texts(second: i64, text: &str) -> Event {
    let (at, device, texts) = (at(second), TIC, vec![(SV, text.into())]);
    Event::Read { at, device, values: Vec::new(), texts, response_time: Duration::from_millis(12), exchange: None }
}

/// Its write, what went out, its outcome and its record once the device has answered with `result`.
fn write(
    plant: &mut Plant,
    (text, seen): (&str, Option<&str>),
    result: WriteResult,
) -> (Option<TagValue>, ActionRecord) {
    let kind = CommandKind::WriteText { tag: SV, text: text.into(), seen: seen.map(Into::into) };
    let effects = plant.on_command(command(1, kind), at(1));
    let job = effects.bus.iter().find_map(|(_, request)| match request {
        BusRequest::Write(job) => Some(job.clone()),
        _ => None,
    });
    let ended = match &job {
        Some(job) => plant.on_event(Event::Wrote { at: at(3), id: job.id, result }),
        None => effects,
    };
    let record = recorded(&ended).next().expect("it is on record").clone();
    (job.map(|job| job.raw), record)
}

fn back(text: &str) -> WriteResult {
    WriteResult::ReadBack(TagValue::Text(text.into()))
}

#[test]
fn a_text_is_written_over_the_one_that_was_seen() {
    let check = |typed: &str, seen: Option<&str>, result: WriteResult, expect: (Option<&str>, &str)| {
        let mut plant = plant_with(DataType::Text(8), "Line 1");
        let (sent, record) = write(&mut plant, (typed, seen), result);
        let sent = sent.map(|sent| sent.to_string());
        assert_eq!((sent.as_deref(), &*record.outcome), expect, "{typed:?} {seen:?}");
        assert_eq!((&*record.action, &*record.target, record.new.as_deref()), ("write", "TIC-1.SV", Some(typed)));
        assert_eq!(record.old.as_deref(), seen, "what its author saw");
    };
    let seen = Some("Line 1");
    check("Line 2", seen, back("Line 2"), (Some("Line 2"), "verified"));
    check("", seen, back(""), (Some(""), "verified"));
    check("Line 2", seen, back("Line"), (Some("Line 2"), "not confirmed: read back Line"));
    check("Line 2", seen, WriteResult::ReadBack(7.0.into()), (Some("Line 2"), "not confirmed: read back 7"));
    let not_applied = WriteResult::ReadBackAfterFault(Fault::Timeout, TagValue::Text("Line 1".into()));
    let outcome = "not confirmed: response timeout, not applied: the device has Line 1";
    check("Line 2", seen, not_applied, (Some("Line 2"), outcome));
    let fault = Fault::Exception(ExceptionCode(4));
    let failed = WriteResult::ReadBackAfterFault(fault, TagValue::Text("Line 1".into()));
    check(
        "Line 2",
        seen,
        failed,
        (Some("Line 2"), &format!("not confirmed: {fault}, not applied: the device has Line 1")),
    );
    check("Line 1", seen, back(""), (None, "unchanged, not written"));
    check("Line 2", Some("Line 3"), back(""), (None, "refused: it was changed to Line 1 after it was shown"));
    check("Line 2", None, back(""), (None, "refused: it is Line 1 now; check and confirm again"));
    check(
        "A long line",
        seen,
        back(""),
        (None, "refused: expected printable characters in at most 8 bytes, no blank at the end"),
    );
}

#[test]
fn a_clock_is_set_by_the_time_of_its_write() {
    for (shown, outcome) in [
        ("1970-01-01 00:00:01", "verified"),
        ("1970-01-01 00:00:03", "verified"),
        ("1970-01-01 00:05:00", "not confirmed: read back 1970-01-01 00:05:00"),
    ] {
        let mut plant = plant_with(DataType::Clock(Clock::Bcd), "2001-01-01 00:00:00");
        // It goes on, so that no one has seen what it shows now.
        let (sent, record) = write(&mut plant, ("now", Some("2000-12-31 23:59:57")), back(shown));
        assert_eq!(sent, None, "1970 has no two digits of this century");
        assert!(record.outcome.contains("such as 2026-11-30 14:05:00, or now"), "{}", record.outcome);
        let mut plant = plant_with(DataType::Clock(Clock::Words), "2001-01-01 00:00:00");
        let (sent, record) = write(&mut plant, ("now", Some("2000-12-31 23:59:57")), back(shown));
        assert_eq!(sent, Some(TagValue::Text("1970-01-01 00:00:01".into())));
        assert_eq!((&*record.outcome, record.new.as_deref()), (outcome, Some("1970-01-01 00:00:01")));
    }
}

#[test]
fn a_number_is_no_text_and_a_text_no_number() {
    let refused = |plant: &mut Plant, kind: CommandKind| {
        let effects = plant.on_command(command(1, kind), at(1));
        assert!(effects.bus.is_empty());
        actions(&effects)
    };
    let mut plant = plant_with(DataType::Text(8), "Line 1");
    let expected = "anna write TIC-1.SV refused: expected printable characters in at most 8 bytes, no blank at the end";
    assert_eq!(refused(&mut plant, CommandKind::Write { tag: SV, value: 5.0.into() }), [expected]);
    let text = |tag| CommandKind::WriteText { tag, text: "5".into(), seen: None };
    let expected = "refused: expected a text that can be written, which this tag does not hold";
    assert_eq!(refused(&mut running(), text(SV)), [format!("anna write TIC-1.SV {expected}")]);
    let mut def = fixture::plant();
    (def.tags[SV.index()].point.kind, def.tags[SV.index()].access) = (DataType::Text(8), Access::Read);
    let mut plant = Plant::new(Arc::new(def), at(0), 1.0);
    assert_eq!(refused(&mut plant, text(SV)), ["anna write TIC-1.SV refused: read only"]);
}
