//! Tests of the alarms tab: what the operator sees, and what the keys do.

mod actions;
mod columns;
mod languages;
mod steps;

use std::{collections::HashSet, sync::Arc, time::Duration};

use jiff::SignedDuration;

use crate::{
    history::{Answer, Query},
    plant::{
        alarm::{
            ActiveAlarm, AlarmCommand, AlarmState, PeriodMetrics, SuppressedAlarm,
            metrics::{Frequent, Named},
            state::OperatorNote,
        },
        command::CommandKind,
        def::{AlarmClass, AlarmDef, AlarmId, Priority},
        record::{ActionRecord, AlarmEvent, AlarmRecord, FirstOut},
        role::Role,
    },
    ui::{
        Effect, Model, Msg,
        fixture::{self, Fixture, now},
        modal::Modal,
        tabs::Tab,
        tests::{assert_acts_only_on_what_was_drawn, model, screen, sent_kind, type_keys},
        theme::{Glyphs, Theme},
        update,
    },
};

const PRIORITIES: [Priority; 4] = [Priority::Critical, Priority::High, Priority::Medium, Priority::Low];

fn ago(seconds: i64) -> jiff::Timestamp {
    now() - SignedDuration::from_secs(seconds)
}

/// The pump trips; the level, eight more of the process and four of the system follow; one is latched, one acknowledged.
fn storm() -> Fixture {
    let mut fixture = Fixture::alarm();
    let pattern = fixture.def.alarms[2].clone();
    let texts = ["pump tripped", "flow low", "level low", "level falls fast", "heater dry", "valve not open"];
    let device = fixture.def.alarms[3].subject;
    fixture.alarms.truncate(1);
    for n in 0..14u16 {
        let id = AlarmId(4 + n);
        let system = n >= 10;
        let text = if system { "answers late" } else { texts[usize::from(n) % texts.len()] };
        fixture.def.alarms.push(AlarmDef {
            id,
            message: text.to_owned(),
            priority: if n % 5 == 3 { Priority::Medium } else { Priority::Low },
            class: if system { AlarmClass::System } else { AlarmClass::Process },
            subject: if system { device } else { pattern.subject },
            area: "TK-1".to_owned(),
            ..pattern.clone()
        });
        let first_out = Some(FirstOut { began: ago(60), rank: u32::from(n) + 1 });
        let mut alarm = ActiveAlarm::new(id, AlarmState::Unacknowledged, ago(60 - i64::from(n) / 2));
        (alarm.first_out, alarm.value) = (first_out, Some(3.8.into()));
        if n == 2 {
            alarm.state = AlarmState::Acknowledged;
            let reason = Some("pump is looked at".into());
            alarm.acknowledged = Some(OperatorNote { at: ago(20), by: Some("anna".into()), reason, recorded: true });
        }
        if n == 4 {
            (alarm.state, alarm.returned_at) = (AlarmState::LatchedUnacknowledged, Some(ago(9)));
        }
        fixture.alarms.push(alarm);
    }
    fixture.alarms[0].first_out = Some(FirstOut { began: ago(60), rank: 20 });
    let def = fixture.def.clone();
    fixture.alarms.sort_by_key(|alarm| {
        let waits = alarm.state.needs_acknowledgement();
        (def.alarm(alarm.id).priority, !waits, std::cmp::Reverse(alarm.raised_at))
    });
    fixture
}

/// Shelved, suppressed, out of service.
fn suppressed() -> Fixture {
    let mut fixture = storm();
    let note = |seconds, by: Option<&str>, reason: Option<&str>| OperatorNote {
        at: ago(seconds),
        by: by.map(Arc::from),
        reason: reason.map(Arc::from),
        recorded: true,
    };
    let (until, suppressed) = (Some(now() + SignedDuration::from_secs(2_460)), &mut fixture.suppressed);
    suppressed.push(SuppressedAlarm {
        id: AlarmId(1),
        state: AlarmState::Shelved,
        note: note(1_140, Some("anna"), Some("sensor is being cleaned")),
        until,
        active: true,
    });
    suppressed.push(SuppressedAlarm {
        id: AlarmId(2),
        state: AlarmState::OutOfService,
        note: note(90_000, Some("tech1"), Some("level probe broken, spare part ordered")),
        until: None,
        active: false,
    });
    suppressed.push(SuppressedAlarm {
        id: AlarmId(3),
        state: AlarmState::SuppressedByDesign,
        note: note(300, None, None),
        until: None,
        active: false,
    });
    fixture
}

/// A day with a flood behind it.
fn figures() -> PeriodMetrics {
    let named = |subject: &str, text: &str| Named { subject: subject.into(), message: text.into() };
    let frequent = |subject, text, raised| Frequent { alarm: named(subject, text), raised };
    PeriodMetrics {
        from: ago(86_400),
        until: now(),
        by_priority: [0, 12, 30, 178],
        windows: 145,
        watched: Duration::from_secs(86_400),
        windows_over: 3,
        most: 34,
        flood: Duration::from_secs(1_900),
        top: vec![frequent("TIC-1.PV", "temperature high", 90), frequent("PLC-1.LT-1", "level low", 61)],
        chattering: vec![named("TIC-1.PV", "temperature high")],
        fleeting: vec![named("PLC-1.LT-1", "level low")],
        stale: 1,
        suppressed: 0,
    }
}

fn shown(fixture: &Fixture, theme: Theme, keys: &str) -> Model {
    let mut model = model(fixture, theme);
    type_keys(&mut model, &format!("3{keys}"));
    model
}

/// Pictures at both sizes in full looks, and at 80x24 in plain ones.
fn assert_pictures(name: &str, fixture: &Fixture, keys: &str) {
    for (look, theme, width, height) in
        [("80x24", Theme::FULL, 80, 24), ("120x40", Theme::FULL, 120, 40), ("plain", Theme::PLAIN, 80, 24)]
    {
        let mut model = shown(fixture, theme, keys);
        let picture = screen(&mut model, width, height);
        assert!(theme != Theme::PLAIN || picture.is_ascii(), "{picture}");
        insta::assert_snapshot!(format!("{name}_{look}"), picture);
    }
}

#[test]
fn a_storm_is_folded_and_counted() {
    assert_pictures("storm", &storm(), "");
    assert_pictures("storm_unfolded", &storm(), "→");
    assert_pictures("system", &storm(), "vv");
    assert_pictures("guidance_acknowledged", &storm(), "→↓↓↓↓↓↓↓↓↓↓");
}

#[test]
fn list_and_guidance_mark_an_unrecorded_acknowledgement() {
    let mut fixture = storm();
    fixture.alarms.iter_mut().filter_map(|alarm| alarm.acknowledged.as_mut()).for_each(|note| note.recorded = false);
    let mut model = shown(&fixture, Theme::FULL, "→");
    let mut picture = |_| {
        type_keys(&mut model, "↓");
        [(80, 24), (160, 40)].map(|(width, height)| screen(&mut model, width, height))
    };
    let pictures: Vec<[String; 2]> = (0..14).map(&mut picture).collect();
    for size in 0..2 {
        let rows = pictures.iter().flat_map(|picture| picture[size].lines()).filter(|row| row.contains("□ "));
        let rows: Vec<&str> = rows.collect();
        assert!(!rows.is_empty() && rows.iter().all(|row| row.contains("NOT RECORDED")), "{rows:?}");
    }
    // Beside the list it goes on in the next row.
    let beside = |picture: &str| {
        let rows = picture.lines().map(|row| row.rsplit('┊').next().unwrap_or_default());
        rows.flat_map(str::split_whitespace).collect::<Vec<_>>().join(" ")
    };
    let guidance = pictures.iter().filter(|picture| beside(&picture[1]).contains("by anna (NOT RECORDED)"));
    assert_eq!(guidance.count(), 1, "{}", pictures[13][1]);
}

#[test]
fn suppressed_alarms_are_listed_and_counted_on_every_page() {
    assert_pictures("suppressed", &suppressed(), "v");
    let mut model = shown(&suppressed(), Theme::FULL, "");
    assert!(screen(&mut model, 120, 40).contains("suppressed 3"));
    let mut quiet = suppressed();
    quiet.alarms.clear();
    let mut model = super::super::super::tests::model(&quiet, Theme::FULL);
    let banner = screen(&mut model, 80, 24).lines().nth(2).map(str::to_owned).unwrap_or_default();
    assert!(banner.contains("no alarms") && banner.contains("2 suppressed"), "{banner}");
}

#[test]
fn the_meter_is_shown_with_target_limit_and_verdict() {
    let mut fixture = storm();
    fixture.alarm_metrics.day = Arc::new(figures());
    (fixture.alarm_metrics.last_10_min, fixture.alarm_metrics.last_hour) = (15, 22);
    fixture.alarm_metrics.flood_since = Some(ago(50));
    assert_pictures("metrics", &fixture, "vvvv");
    let mut model = shown(&fixture, Theme::FULL, "");
    let banner = screen(&mut model, 80, 24).lines().nth(2).map(str::to_owned).unwrap_or_default();
    assert!(banner.contains("FLOOD") && banner.contains("UNACK"), "{banner}");
    // A past shift is asked of the history, and its figures stand under its name only.
    let effects = type_keys(&mut model, "vvvv←←");
    let Some(Effect::Query(id, Query::AlarmMetrics { from, to })) = effects.last() else { panic!("{effects:?}") };
    let span = [from, to].map(ToString::to_string);
    assert_eq!(span, ["2026-11-20T23:00:00Z", "2026-11-21T07:00:00Z"]);
    assert!(screen(&mut model, 80, 24).contains("collecting data"));
    let past = PeriodMetrics { by_priority: [0, 0, 0, 7], ..figures() };
    update(&mut model, Msg::Answer(*id, Ok(Answer::AlarmMetrics(Box::new(past)))));
    assert!(
        screen(&mut model, 80, 24).contains("morning 2026-11-21 06:00 – 14:00 +07: 7 alarms"),
        "{}",
        screen(&mut model, 80, 24)
    );
    type_keys(&mut model, "l");
    assert!(screen(&mut model, 80, 24).contains("last 24 hours: 220 alarms"));
}

#[test]
fn a_result_is_shown_whole_at_every_size() {
    let mut model = model(&Fixture::normal(), Theme::FULL);
    type_keys(&mut model, "3vvvv");
    for (width, height) in [(80, 24), (120, 40), (160, 50)] {
        let picture = screen(&mut model, width, height);
        assert!(picture.contains(" insufficient data"), "{picture}");
    }
}

fn action(seconds: i64, by: &str, action: &str, target: &str, outcome: &str, note: Option<&str>) -> ActionRecord {
    ActionRecord {
        at: ago(seconds),
        by: by.into(),
        from: "".into(),
        action: action.into(),
        target: target.into(),
        old: None,
        new: (action == "write").then(|| "70.0 °C".into()),
        outcome: outcome.into(),
        note: note.map(Arc::from),
        chain_hash: None,
    }
}

#[test]
fn the_handover_tells_what_the_next_shift_must_know() {
    let mut fixture = suppressed();
    fixture.set("PLC-1.AUTO", 0.0);
    let note = "Pump P-1 draws too much current; electrician comes at 16:00.";
    let rows = vec![
        action(40, "anna", "write", "TIC-1.SV", "failed: response timeout", None),
        action(45, "anna", "write", "TIC-1.SV", "failed: response timeout", None),
        action(50, "anna", "unlock terminal", "anna", "done", None),
        action(60, "anna", "acknowledge", "TIC-1.PV temperature high", "verified", None),
        action(100, "anna", "write", "TIC-1.SV", "verified", None),
        action(1_000, "tech1", "hand over", "tank", "verified", Some(note)),
        action(9_000, "tech1", "write", "TIC-1.P", "verified", None),
    ];
    for (look, theme, width, height) in
        [("80x24", Theme::FULL, 80, 24), ("120x40", Theme::FULL, 120, 40), ("plain", Theme::PLAIN, 80, 24)]
    {
        let mut model = model(&fixture, theme);
        let effects = type_keys(&mut model, "3V");
        let Some(Effect::Query(id, Query::Actions { .. })) = effects.last() else { panic!("{effects:?}") };
        update(&mut model, Msg::Answer(*id, Ok(Answer::Actions(rows.clone()))));
        let picture = screen(&mut model, width, height);
        insta::assert_snapshot!(format!("handover_{look}"), picture);
        if look == "120x40" {
            assert!(!picture.contains("TIC-1.P "), "another shift: {picture}");
            assert!(!picture.contains("acknowledge "), "no change of the plant: {picture}");
            assert!(!picture.contains("unlock terminal"), "no change of the plant: {picture}");
            assert!(picture.contains("2× TIC-1.SV"), "what failed alike stands once: {picture}");
            // Whoever hands over does not take over from himself.
            assert!(picture.contains("another user takes over with o"), "{picture}");
            type_keys(&mut model, "o");
            assert!(screen(&mut model, 120, 40).contains("You cannot take over what you handed over yourself."));
            assert_eq!(sent_kind(&type_keys(&mut model, "⏎⏎")), None);
        }
    }
}

#[test]
fn a_handover_names_every_alarm_of_more_than_a_day() {
    let mut fixture = Fixture::alarm();
    fixture.alarms[0].raised_at = ago(100_000);
    let mut model = shown(&fixture, Theme::FULL, "V");
    assert!(screen(&mut model, 80, 24).contains("TIC-1.PV temperature high active for"));
}

#[test]
fn a_shift_is_handed_over_with_a_note_and_taken_over() {
    let mut model = shown(&Fixture::normal(), Theme::FULL, "V");
    let effects = type_keys(&mut model, "nP-1 is loud⏎");
    let Some(Effect::Command(command, _)) = effects.last() else { panic!("{effects:?}") };
    assert_eq!((&command.kind, command.note.as_deref()), (&CommandKind::HandOver, Some("P-1 is loud")));
    assert_eq!(sent_kind(&type_keys(&mut model, "o")), None, "asks first");
    assert_eq!(sent_kind(&type_keys(&mut model, "⏎")), Some(&CommandKind::TakeOver));
}

#[test]
fn the_filter_in_force_is_written_and_hides_nothing_silently() {
    let mut model = shown(&Fixture::alarm(), Theme::FULL, "");
    type_keys(&mut model, "/plc-1⏎");
    let picture = screen(&mut model, 80, 24);
    assert!(picture.contains("FILTER \"plc-1\": 2 of 3 shown"), "{picture}");
    assert!(!picture.lines().skip(4).any(|line| line.contains("temperature high")), "{picture}");
    type_keys(&mut model, "f");
    assert!(screen(&mut model, 80, 24).contains("critical  \"plc-1\": 0 of 3 shown"), "{}", screen(&mut model, 80, 24));
    assert!(screen(&mut model, 80, 24).contains("No alarm matches the filter."));
    type_keys(&mut model, "⎋");
    assert!(screen(&mut model, 80, 24).contains("3 shown"));
    // What the filter hides is not acknowledged by A.
    type_keys(&mut model, "/level⏎A");
    let effects = type_keys(&mut model, "⏎");
    let low = &Fixture::alarm().alarms[2];
    let Some(CommandKind::Alarm(AlarmCommand::AcknowledgeAll { alarms: Some(alarms), .. })) = sent_kind(&effects)
    else {
        panic!("{effects:?}")
    };
    assert_eq!(**alarms, [low.id]);
}

#[test]
fn a_page_acknowledges_only_what_was_on_the_screen() {
    let mut model = shown(&storm(), Theme::FULL, "→");
    screen(&mut model, 80, 24);
    type_keys(&mut model, "p");
    let effects = type_keys(&mut model, "⏎");
    let Some(CommandKind::Alarm(AlarmCommand::AcknowledgeAll { alarms: Some(alarms), .. })) = sent_kind(&effects)
    else {
        panic!("{effects:?}")
    };
    let picture = screen(&mut model, 80, 24);
    let on_screen = picture.lines().filter(|line| line.contains("UNACK ") || line.contains("LATCHED ")).count();
    // The banner is one of those lines.
    assert_eq!(alarms.len() + 1, on_screen, "{picture}");
}

#[test]
fn a_note_is_asked_for_where_the_plant_wants_one() {
    let mut fixture = Fixture::alarm();
    let alarm = fixture.alarms[0].clone();
    let command = |fixture: &Fixture, keys: &str| {
        let mut model = shown(fixture, Theme::FULL, "");
        let effects = type_keys(&mut model, keys);
        let command = effects.into_iter().find_map(|effect| match effect {
            Effect::Command(command, _) => Some((command.kind, command.note)),
            _ => None,
        });
        (command, model.modal)
    };
    assert_eq!(command(&fixture, "nSV was raised⏎").0, Some((alarm.acknowledge(), Some("SV was raised".into()))));
    assert_eq!(command(&fixture, "n⏎").0, Some((alarm.acknowledge(), None)), "here it may be left out");
    fixture.def.alarms[0].ack_comment = true;
    assert!(matches!(command(&fixture, "a"), (None, Some(Modal::Reason(_)))), "asks before it is refused");
    assert!(matches!(command(&fixture, "a  ⏎"), (None, Some(Modal::Reason(_)))), "blanks are no note");
    assert_eq!(command(&fixture, "adoor was open⏎").0, Some((alarm.acknowledge(), Some("door was open".into()))));
    let (all, _) = command(&fixture, "Adoor was open⏎");
    assert_eq!(all, fixture.snapshot().acknowledge_all().map(|kind| (kind, Some("door was open".into()))));
}

#[test]
fn an_alarm_is_shelved_for_a_chosen_time_with_a_reason() {
    let fixture = Fixture::alarm();
    let mut model = shown(&fixture, Theme::FULL, "z");
    insta::assert_snapshot!("window_shelve", screen(&mut model, 80, 24));
    type_keys(&mut model, "⏎");
    assert!(screen(&mut model, 80, 24).contains("a reason is required"), "nothing is shelved without a reason");
    let effects = type_keys(&mut model, "↑→→sensor is cleaned⏎");
    let Some(Effect::Command(command, _)) = effects.last() else { panic!("{effects:?}") };
    let shelve = AlarmCommand::Shelve { alarms: [AlarmId(0)].into(), lasts: Duration::from_secs(3_600) };
    assert_eq!((&command.kind, command.note.as_deref()), (&CommandKind::Alarm(shelve), Some("sensor is cleaned")));
    // No time is offered that the plant does not allow.
    let mut short = Fixture::alarm();
    short.def.alarm_rules.shelve_max = Duration::from_secs(1_800);
    let mut model = shown(&short, Theme::FULL, "z");
    let picture = screen(&mut model, 80, 24);
    assert!(!picture.contains("4 h") && !picture.contains("rest of the shift"), "{picture}");
}
