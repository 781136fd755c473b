//! Keys that act on alarms do so only on what was drawn.

use super::*;

#[test]
fn acknowledging_takes_the_most_urgent_or_the_selected() {
    let fixture = Fixture::alarm();
    let mut model = model(&fixture, Theme::FULL);
    assert_eq!(sent_kind(&type_keys(&mut model, "a")), Some(&fixture.alarms[0].acknowledge()));
    assert_eq!(sent_kind(&type_keys(&mut model, "3↓↓a")), Some(&fixture.alarms[2].acknowledge()));
    assert_eq!(sent_kind(&type_keys(&mut model, "↑a")), None, "already acknowledged");
    let shown = screen(&mut model, 80, 24);
    assert!(shown.contains("already acknowledged"), "{shown}");
    assert!(
        !shown.lines().nth(2).is_some_and(|banner| banner.contains("a ack")),
        "it is not for the banner's: {shown}"
    );
    type_keys(&mut model, "⎋n");
    let noted = screen(&mut model, 80, 24);
    assert!(noted.contains("already acknowledged"), "the key of a note answers as well: {noted}");
    assert_eq!(sent_kind(&type_keys(&mut model, "⎋A")), None, "all: asks first");
    assert_eq!(sent_kind(&type_keys(&mut model, "⏎")), fixture.snapshot().acknowledge_all().as_ref());
    let mut quiet = super::model(&Fixture::normal(), Theme::FULL);
    assert_eq!(type_keys(&mut quiet, "aA"), []);
    assert_eq!(quiet.modal, None);
}

#[test]
fn what_came_after_the_last_frame_is_not_acknowledged_unseen() {
    let mut fixture = Fixture::alarm();
    let newer = crate::plant::alarm::ActiveAlarm { id: AlarmId(1), ..fixture.alarms[0].clone() };
    for tab in ["", "3"] {
        let mut model = model(&fixture, Theme::FULL);
        type_keys(&mut model, tab);
        screen(&mut model, 80, 24);
        let mut later = fixture.clone();
        later.alarms.insert(0, newer.clone());
        update(&mut model, Msg::Snapshot(later.snapshot()));
        assert_eq!(sent_kind(&type_keys(&mut model, "a")), Some(&fixture.alarms[0].acknowledge()), "as it was seen");
        screen(&mut model, 80, 24);
        assert_eq!(sent_kind(&type_keys(&mut model, "a")), Some(&newer.acknowledge()), "now it is seen");
    }
    fixture.alarms.clear();
    let mut model = model(&fixture, Theme::FULL);
    screen(&mut model, 80, 24);
    fixture.alarms.push(newer);
    update(&mut model, Msg::Snapshot(fixture.snapshot()));
    assert_eq!(type_keys(&mut model, "a"), []);
}

#[test]
fn a_selected_alarm_stays_selected_when_the_list_moves() {
    let mut fixture = Fixture::alarm();
    let mut model = model(&fixture, Theme::FULL);
    type_keys(&mut model, "3↓↓");
    let chosen = fixture.alarms[2].id;
    let newer = crate::plant::alarm::ActiveAlarm { id: AlarmId(1), ..fixture.alarms[0].clone() };
    fixture.alarms.insert(0, newer);
    update(&mut model, Msg::Snapshot(fixture.snapshot()));
    assert_eq!(model.tabs.alarms.selected(&model.cx()).map(|alarm| alarm.id), Some(chosen));
}

#[test]
fn the_journal_is_asked_only_while_it_is_shown() {
    let mut model = model(&Fixture::normal(), Theme::FULL);
    let of_alarms = |effect: &Effect| match effect {
        Effect::Query(id, _) if id.tab == Some(Tab::Alarms) => Some(*id),
        _ => None,
    };
    let asks = |effects: Vec<Effect>| effects.iter().filter_map(of_alarms).count();
    let tick = || Msg::Tick { silent: Duration::ZERO };
    assert_eq!(asks(type_keys(&mut model, "3")), 0);
    let asked = type_keys(&mut model, "j");
    assert_eq!(asked.iter().filter_map(of_alarms).count(), 2, "alarms and actions");
    for id in asked.iter().filter_map(of_alarms) {
        update(&mut model, Msg::Answer(id, Ok(Answer::Journal(Vec::new()))));
    }
    let half = |n: u64| Msg::Tick { silent: Duration::from_millis(500 * n) };
    assert_eq!((0..=10).map(|n| asks(update(&mut model, half(n)))).sum::<usize>(), 2, "once more in five seconds");
    type_keys(&mut model, "1");
    assert_eq!((0..30).map(|_| asks(update(&mut model, tick()))).sum::<usize>(), 0);
}

#[test]
fn a_history_without_answer_is_said_so() {
    let mut model = model(&Fixture::normal(), Theme::FULL);
    let effects = type_keys(&mut model, "3j");
    assert!(screen(&mut model, 80, 24).contains("collecting data"));
    for effect in effects {
        if let Effect::Query(id, _) = effect {
            update(&mut model, Msg::Answer(id, Err(HistoryError::Engine("disk full".to_owned()))));
        }
    }
    assert!(screen(&mut model, 80, 24).contains("history: disk full"));
}

/// An alarm fixture whose acknowledgement asks for no note.
pub(super) fn plain_alarms() -> Fixture {
    let mut fixture = Fixture::alarm();
    fixture.def.alarms.iter_mut().for_each(|alarm| alarm.ack_comment = false);
    fixture
}

#[test]
fn a_key_for_an_alarm_that_left_acknowledges_no_other() {
    let mut fixture = plain_alarms();
    let mut model = model(&fixture, Theme::FULL);
    type_keys(&mut model, "3");
    screen(&mut model, 80, 24);
    type_keys(&mut model, "↓↓↓");
    screen(&mut model, 80, 24);
    let chosen = model.tabs.alarms.selected(&model.cx()).map(|alarm| alarm.id).expect("one is selected");
    assert_ne!(chosen, fixture.alarms[0].id, "another one than the first");
    // The frame with it is on the screen; now a colleague's acknowledgement takes it from the list.
    fixture.alarms.retain(|alarm| alarm.id != chosen);
    update(&mut model, Msg::Snapshot(fixture.snapshot()));
    assert_eq!(sent_kind(&type_keys(&mut model, "a")), None);
    assert!(screen(&mut model, 80, 24).contains("The list has changed, press again"));
    // What is on the screen now is what the next press is for.
    assert!(sent_kind(&type_keys(&mut model, "a")).is_some());
    assert!(!screen(&mut model, 80, 24).contains("press again"));
}

#[test]
fn a_chosen_alarm_raised_again_is_not_acknowledged_unseen() {
    let mut fixture = plain_alarms();
    let mut model = model(&fixture, Theme::FULL);
    type_keys(&mut model, "3↓↑");
    screen(&mut model, 80, 24);
    let chosen = model.tabs.alarms.selected(&model.cx()).map(|alarm| alarm.id).expect("one is selected");
    for alarm in fixture.alarms.iter_mut().filter(|alarm| alarm.id == chosen) {
        (alarm.raised_at, alarm.annunciated_at) = (fixture::now(), fixture::now());
    }
    update(&mut model, Msg::Snapshot(fixture.snapshot()));
    assert_eq!(sent_kind(&type_keys(&mut model, "a")), None);
}

#[test]
fn moved_rows_take_no_key_meant_for_another() {
    let mut fixture = plain_alarms();
    let newest = fixture.alarms.remove(0);
    let mut model = model(&fixture, Theme::FULL);
    type_keys(&mut model, "3");
    screen(&mut model, 80, 24);
    // A new one pushes in at the top, unseen: neither the first row nor the next one is what it was.
    fixture.alarms.insert(0, newest);
    update(&mut model, Msg::Snapshot(fixture.snapshot()));
    for keys in ["z", "↓a", "o"] {
        // Moving the selection is possible, but what a key means then is unknown until it is drawn.
        assert_eq!(sent_kind(&type_keys(&mut model, keys)), None, "{keys}");
        assert_eq!(model.modal, None, "{keys}");
    }
}

#[test]
fn what_was_not_annunciated_is_shown_on_request() {
    let mut model = model(&Fixture::normal(), Theme::FULL);
    screen(&mut model, 120, 40);
    let event = |seconds, event| {
        let at = fixture::now() - jiff::SignedDuration::from_secs(seconds);
        AlarmRecord::new(at, "TIC-1.PV", "temperature high", Priority::High, event)
    };
    let events =
        [AlarmEvent::Raised, AlarmEvent::Unsuppressed, AlarmEvent::RaisedSuppressed, AlarmEvent::SuppressedByDesign];
    let journal: Vec<_> = (1..).map(|n| n * 60).zip(events).map(|(ago, kind)| event(ago, kind)).collect();
    for effect in type_keys(&mut model, "3j") {
        if let Effect::Query(id, Query::Journal { .. }) = effect {
            update(&mut model, Msg::Answer(id, Ok(Answer::Journal(journal.clone()))));
        }
    }
    let rows = |model: &mut Model| {
        let shown = screen(model, 120, 40);
        (
            shown.lines().filter(|row| row.contains("temperature high")).count(),
            shown.contains("3 not annunciated hidden, d shows them"),
        )
    };
    assert_eq!(rows(&mut model), (1, true));
    type_keys(&mut model, "d");
    assert_eq!(rows(&mut model), (4, false));
    type_keys(&mut model, "d");
    assert_eq!(rows(&mut model), (1, true));
}

#[test]
fn the_journal_of_an_area_has_its_alarms_and_actions() {
    let mut fixture = Fixture::normal();
    let now = fixture::now();
    fixture.def.alarms[0].area = "furnace".to_owned();
    fixture.def.alarms[2].area = "tank".to_owned();
    let alarm = |n: usize, subject| {
        let def = &fixture.def.alarms[n];
        AlarmRecord::new(now, subject, &def.message, def.priority, AlarmEvent::Raised)
    };
    let alarms = vec![alarm(0, "TIC-1.PV"), alarm(1, "TIC-1.PV"), alarm(2, "PLC-1.LT-1")];
    let action = |target: &str| ActionRecord { target: target.into(), ..write_action() };
    let actions = vec![action("TIC-1.SV"), action("PLC-1.P-1"), action("station")];
    let mut model = model(&fixture, Theme::FULL);
    for effect in type_keys(&mut model, "3j") {
        let Effect::Query(id, query) = effect else { continue };
        let answer = match query {
            Query::Journal { .. } => Answer::Journal(alarms.clone()),
            _ => Answer::Actions(actions.clone()),
        };
        update(&mut model, Msg::Answer(id, Ok(answer)));
    }
    let names = ["temperature high", "temperature very high", "level low", "TIC-1.SV", "PLC-1.P-1", "station "];
    let mut shown = |keys: &str| {
        type_keys(&mut model, keys);
        let shown = screen(&mut model, 80, 24);
        let rows = shown.lines().skip(4).collect::<String>();
        names.map(|name| rows.contains(name))
    };
    assert_eq!(shown(""), [true; 6]);
    assert_eq!(shown("g"), [true, false, false, true, false, false], "the furnace");
    assert_eq!(shown("g"), [false, false, true, false, true, false], "the tank");
    assert_eq!(shown("g"), [true; 6], "all areas again");
}
