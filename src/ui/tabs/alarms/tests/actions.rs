//! What an operator does with alarms, and where their keys lead.

use super::*;

#[test]
fn a_suppressed_alarm_is_put_back() {
    let back = |keys: &str| {
        let mut model = shown(&suppressed(), Theme::FULL, "v");
        assert_eq!(sent_kind(&type_keys(&mut model, keys)), None, "asks first");
        sent_kind(&type_keys(&mut model, "⏎")).cloned()
    };
    assert_eq!(back("u"), Some(CommandKind::Alarm(AlarmCommand::Unshelve(AlarmId(1)))));
    assert_eq!(back("↓u"), Some(CommandKind::Alarm(AlarmCommand::InService(AlarmId(2)))));
    assert_eq!(back("↓↓u"), None, "suppressed by design");
}

#[test]
fn a_technician_reads_that_out_of_service_needs_a_supervisor() {
    let mut model = shown(&Fixture::alarm(), Theme::FULL, "");
    let mut session = Arc::unwrap_or_clone(fixture::session());
    session.who.as_mut().expect("a user is logged in").role = Role::Technician;
    update(&mut model, Msg::SessionStatus(Arc::new(session)));
    let footer = screen(&mut model, 120, 40).lines().last().map(str::to_owned).unwrap_or_default();
    assert!(footer.contains("z shelve") && !footer.contains("o out of service"), "{footer}");
    type_keys(&mut model, "o");
    assert!(screen(&mut model, 80, 24).contains("needs Supervisor; tech1 is Technician"), "before a reason is typed");
    assert_eq!(sent_kind(&type_keys(&mut model, "broken⏎")), None);
}

#[test]
fn the_footer_offers_what_can_be_done_with_the_selected_row() {
    let footer = |fixture: &Fixture, keys: &str| {
        let mut model = shown(fixture, Theme::FULL, keys);
        screen(&mut model, 80, 24).lines().last().map(str::to_owned).unwrap_or_default()
    };
    let mut latched = Fixture::alarm();
    latched.alarms[0].state = AlarmState::LatchedAcknowledged;
    for (keys, reset) in [("", true), ("↓", false)] {
        let footer = footer(&latched, keys);
        assert_eq!((footer.contains("r reset"), footer.contains("v view")), (reset, true), "{keys}: {footer}");
    }
    for (keys, back) in [("v", true), ("v↓", true), ("v↓↓", false)] {
        let footer = footer(&suppressed(), keys);
        assert_eq!((footer.contains("u return"), footer.contains("v view")), (back, true), "{keys}: {footer}");
    }
    for keys in ["vv", "vvv", "vvvv", "vvvvv"] {
        assert!(footer(&suppressed(), keys).contains("v view"), "{keys}");
    }
}

#[test]
fn an_alarm_leads_to_mimic_trend_and_controller() {
    let mut model = shown(&Fixture::alarm(), Theme::FULL, "m");
    assert_eq!(model.tabs.shown, Tab::Mimic);
    type_keys(&mut model, "⏎");
    assert!(screen(&mut model, 80, 24).contains("process value"), "what the alarm watches is selected");
    let mut model = shown(&Fixture::alarm(), Theme::FULL, "t");
    assert_eq!(model.tabs.shown, Tab::Trends);
    assert!(screen(&mut model, 80, 24).contains("14:01:50"), "the cursor: {}", screen(&mut model, 80, 24));
    let mut model = shown(&Fixture::alarm(), Theme::FULL, "↓↓c");
    let shown_now = screen(&mut model, 80, 24);
    assert!(matches!(&type_keys(&mut model, "⏎")[..], []) && model.tabs.shown == Tab::Controllers, "{shown_now}");
    assert!(screen(&mut model, 80, 24).contains("LT-1"), "the parameter of the alarm is selected");
    let model = shown(&Fixture::alarm(), Theme::FULL, "↓c");
    assert_eq!(model.tabs.shown, Tab::Controllers);
}

#[test]
fn every_priority_in_every_state_looks_different_without_colour() {
    for glyphs in [Glyphs::Ascii, Glyphs::Block, Glyphs::Braille] {
        let theme = Theme { glyphs, motion: false, ..Theme::PLAIN };
        let mut looks = HashSet::new();
        for (priority, state) in PRIORITIES.into_iter().flat_map(|p| AlarmState::ALL.map(|state| (p, state))) {
            if state == AlarmState::Normal {
                continue;
            }
            let mut fixture = Fixture::alarm();
            fixture.def.alarms[0].priority = priority;
            let note = OperatorNote { at: now(), by: None, reason: None, recorded: true };
            if state.is_suppressed() {
                fixture.alarms.clear();
                fixture.suppressed = vec![SuppressedAlarm { id: AlarmId(0), state, note, until: None, active: true }];
            } else {
                fixture.alarms.truncate(1);
                fixture.alarms[0].state = state;
            }
            let mut model = shown(&fixture, theme, if state.is_suppressed() { "v" } else { "" });
            let picture = screen(&mut model, 80, 24);
            let row = picture.lines().skip(5).find(|line| line.contains(state.word())).expect("its row").to_owned();
            // The marks at the left alone show it, without reading the row.
            let marks: String = if state.is_suppressed() { row.clone() } else { row.chars().take(7).collect() };
            assert!(looks.insert(marks), "{glyphs:?} {priority:?} {state:?} looks like another one: {row}");
        }
    }
}

#[test]
fn the_bell_rings_only_where_it_was_switched_on() {
    let (quiet, loud) = (Fixture::normal(), Fixture::alarm());
    for (keys, rings) in [("3", 0), ("3b", 1), ("3bb", 0)] {
        let mut model = model(&quiet, Theme::FULL);
        type_keys(&mut model, keys);
        let effects: Vec<Effect> =
            [&loud, &loud, &quiet].iter().flat_map(|f| update(&mut model, Msg::Snapshot(f.snapshot()))).collect();
        assert_eq!(effects.iter().filter(|effect| **effect == Effect::Bell).count(), rings, "{keys}");
    }
}

#[test]
fn silence_is_one_key_on_every_tab_and_acknowledges_nothing() {
    use crossterm::event::{KeyCode, KeyEvent, KeyModifiers};
    let press = |model: &mut Model| update(model, Msg::Key(KeyEvent::new(KeyCode::Char('s'), KeyModifiers::CONTROL)));
    let mut model = crate::ui::tests::model(&Fixture::alarm(), Theme::FULL);
    assert_eq!(sent_kind(&press(&mut model)), Some(&CommandKind::Alarm(AlarmCommand::Silence)));
    let mut snapshot = Arc::unwrap_or_clone(Fixture::alarm().snapshot());
    snapshot.sound = false;
    update(&mut model, Msg::Snapshot(Arc::new(snapshot)));
    assert_eq!(sent_kind(&press(&mut model)), None, "nothing sounds any more");
    assert!(screen(&mut model, 120, 40).lines().nth(2).is_some_and(|banner| banner.contains("silenced")));
}

/// Ten thousand alarms in the audit log, and so many active in one first_out.
pub(super) fn flood(active: u16) -> Model {
    let mut fixture = Fixture::alarm();
    let pattern = fixture.def.alarms[2].clone();
    let priorities = [Priority::Low, Priority::Medium, Priority::Low, Priority::High];
    fixture.def.alarms = (0..10_000u16)
        .map(|n| AlarmDef { id: AlarmId(n), priority: priorities[usize::from(n) % 4], ..pattern.clone() })
        .collect();
    let alarm = |n: u16| {
        let alarm = ActiveAlarm::new(AlarmId(n * (10_000 / active)), AlarmState::Unacknowledged, ago(60));
        ActiveAlarm { first_out: Some(FirstOut { began: ago(60), rank: u32::from(n) + 1 }), ..alarm }
    };
    fixture.alarms = (0..active).map(alarm).collect();
    shown(&fixture, Theme::FULL, "")
}

/// How long a key takes is measured by hand; here, that none is lost however many there are.
#[test]
fn in_a_storm_every_alarm_is_counted_and_every_key_works() {
    for active in [500, 10_000] {
        let mut model = flood(active);
        for key in ["", "↓", "f", "⎋", " ", "v", "V", "p⎋", "A⎋"] {
            type_keys(&mut model, key);
            let seen = screen(&mut model, 120, 40);
            assert!(seen.contains(&format!("active {active} ({active} unack)")), "{key}: {seen}");
        }
    }
}

#[test]
fn a_suppressed_alarm_is_put_back_only_as_it_was_drawn() {
    type Change = fn(&mut Vec<SuppressedAlarm>);
    let first_left: Change = |suppressed| drop(suppressed.remove(0));
    // Back in service and shelved by a colleague: the same alarm, for another reason.
    let shelved_again: Change = |suppressed| suppressed[0].note.at = now();
    for change in [first_left, shelved_again] {
        let mut fixture = suppressed();
        let mut model = shown(&fixture, Theme::FULL, "v");
        change(&mut fixture.suppressed);
        let change = |model: &mut Model| drop(update(model, Msg::Snapshot(fixture.snapshot())));
        assert_acts_only_on_what_was_drawn(&mut model, change, "u");
    }
}

#[test]
fn what_is_done_with_marked_alarms_is_done_with_all() {
    let fixture = storm();
    let mut model = shown(&fixture, Theme::FULL, "→  ");
    let picture = screen(&mut model, 80, 24);
    assert!(picture.contains("2 marked") && picture.lines().filter(|line| line.starts_with('►')).count() == 2);
    // `a` asks, and names those that are marked.
    assert_eq!(type_keys(&mut model, "a"), []);
    let effects = type_keys(&mut model, "⏎");
    let Some(CommandKind::Alarm(AlarmCommand::AcknowledgeAll { alarms: Some(alarms), .. })) = sent_kind(&effects)
    else {
        panic!("{effects:?}")
    };
    assert_eq!(alarms.len(), 2);
    // All are shelved by one command: the station limits how many a terminal sends at once.
    let effects = type_keys(&mut model, "zpump is being repaired⏎");
    let [Effect::Command(command, _)] = effects.as_slice() else { panic!("{effects:?}") };
    let CommandKind::Alarm(AlarmCommand::Shelve { alarms: shelved, .. }) = &command.kind else { panic!("{command:?}") };
    assert_eq!(command.note.as_deref(), Some("pump is being repaired"));
    assert!(shelved.iter().eq(alarms.iter()), "{shelved:?}");
    type_keys(&mut model, "⎋");
    assert!(!screen(&mut model, 80, 24).contains("marked"), "Esc takes the marks off");
    assert!(type_keys(&mut model, "a").iter().any(|effect| matches!(effect, Effect::Command(..))), "only the selected");
    // Marks that the filter hides mean nothing: the key is about the selected alarm.
    let mut model = shown(&fixture, Theme::FULL, "→  /valve⏎nchecked");
    let effects = type_keys(&mut model, "⏎");
    let acknowledged = matches!(sent_kind(&effects), Some(CommandKind::Alarm(AlarmCommand::Acknowledge { .. })));
    assert!(acknowledged, "{effects:?}");
}

#[test]
fn the_list_is_sorted_by_urgency_time_or_tag() {
    let mut model = shown(&Fixture::alarm(), Theme::FULL, "");
    let mut order = |keys: &str| {
        type_keys(&mut model, keys);
        let picture = screen(&mut model, 80, 24);
        let rows = picture.lines().skip(7).take(3);
        rows.filter_map(|row| row.split_whitespace().find(|word| word.contains('-')).map(str::to_owned))
            .collect::<Vec<_>>()
    };
    assert_eq!(order(""), ["TIC-1.PV", "PLC-1", "PLC-1.LT-1"]);
    assert_eq!(order("s"), ["TIC-1.PV", "PLC-1", "PLC-1.LT-1"]);
    assert_eq!(order("s"), ["PLC-1", "PLC-1.LT-1", "TIC-1.PV"]);
    assert_eq!(order("s"), ["TIC-1.PV", "PLC-1", "PLC-1.LT-1"]);
}

#[test]
fn a_wide_screen_shows_guidance_beside_the_list() {
    let event = |seconds, event| AlarmRecord::new(ago(seconds), "TIC-1.PV", "temperature high", Priority::High, event);
    let note = AlarmRecord {
        by: Some("anna".into()),
        reason: Some("relay replaced".into()),
        ..event(85_000, AlarmEvent::Acknowledged)
    };
    let before = vec![event(84_000, AlarmEvent::ReturnedToNormal), note, event(86_000, AlarmEvent::Raised)];
    for (width, height) in [(110, 24), (120, 40), (160, 50), (200, 60)] {
        let mut model = model(&Fixture::alarm(), Theme::FULL);
        screen(&mut model, width, height);
        for effect in type_keys(&mut model, "3") {
            let answer = match &effect {
                Effect::Query(_, Query::Journal { .. }) => Answer::Journal(before.clone()),
                Effect::Query(_, Query::Actions { .. }) => Answer::Actions(Vec::new()),
                Effect::Query(_, Query::Series { tags, .. }) => {
                    assert_eq!(tags, &[Fixture::alarm().tag("TIC-1.PV")]);
                    continue;
                }
                _ => continue,
            };
            let Effect::Query(id, _) = effect else { continue };
            update(&mut model, Msg::Answer(id, Ok(answer)));
        }
        let picture = screen(&mut model, width, height);
        for words in ["10 min, 09:19 left", "temperature high", "once in 30 days", "anna: relay replaced", "go to"] {
            assert!(picture.contains(words), "{words}:\n{picture}");
        }
        assert_eq!(picture.contains("● TIC-1.PV"), 30 <= height, "the curve where there is room:\n{picture}");
        let row = picture.lines().find(|line| line.contains("(3) □")).unwrap_or_default();
        assert!(row.contains('▄') && row.contains('·'), "the ribbon of an acknowledged alarm: {row}");
    }
}

#[test]
fn a_narrow_journal_says_what_happened() {
    let event =
        |event| AlarmRecord::new(ago(60), "TIC-1.PV", "no temperature change while heating", Priority::High, event);
    let rows = vec![event(AlarmEvent::Raised), event(AlarmEvent::ReturnedToNormal)];
    let mut model = model(&Fixture::alarm(), Theme::FULL);
    screen(&mut model, 60, 20);
    let mut shown = |keys: &str| {
        for effect in type_keys(&mut model, keys) {
            let (id, answer) = match effect {
                Effect::Query(id, Query::Journal { .. }) => (id, Answer::Journal(rows.clone())),
                Effect::Query(id, Query::Actions { .. }) => (id, Answer::Actions(Vec::new())),
                _ => continue,
            };
            update(&mut model, Msg::Answer(id, Ok(answer)));
        }
        screen(&mut model, 60, 20)
    };
    let all = shown("3vvv");
    assert!(all.contains("… raised") && all.contains("… RTN"), "{all}");
    let found = shown("/while heating⏎");
    assert!(found.contains("… raised"), "what is cut off is found: {found}");
}
