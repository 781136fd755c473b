//! Windows and outcomes around a replay: no form for a command is open in the past, and none comes out of it.

use std::sync::Arc;

use super::*;
use crate::{access::SessionStatus, ui::replay};

#[test]
fn no_window_of_the_past_opens_a_form_for_a_command() {
    for (tab, window) in [(Tab::Mimic, "C"), (Tab::Mimic, "→⏎"), (Tab::Alarms, "⏎")] {
        for key in ['t', '⏎', 's', 'r', 'm', 'y'] {
            let mut model = replayed(&Fixture::alarm(), tab);
            type_keys(&mut model, window);
            let effects = type_keys(&mut model, &key.to_string());
            let form = model.modal.as_ref().filter(|modal| replay::gives_command(modal));
            assert_eq!((form, sent_kind(&effects)), (None, None), "{tab:?} {window} {key}");
        }
    }
    let mut model = replayed(&Fixture::alarm(), Tab::Mimic);
    type_keys(&mut model, "Cs");
    let shown = screen(&mut model, 120, 40);
    assert!(matches!(model.modal, Some(Modal::Faceplate(_))) && shown.contains("This is the past"), "{shown}");
    assert!(!shown.contains("⏎ write"), "what is refused is not offered: {shown}");
}

#[test]
fn a_lock_keeps_no_work_of_the_past() {
    let mut model = replayed(&Fixture::alarm(), Tab::Mimic);
    type_keys(&mut model, "@");
    let locked = SessionStatus { locked: true, ..(*model.session).clone() };
    update(&mut model, Msg::SessionStatus(Arc::new(locked)));
    assert_eq!(model.kept, None);
}

#[test]
fn what_is_filled_in_meanwhile_stays_in_the_present() {
    let mut model = model(&Fixture::normal(), Theme::FULL);
    let effects = type_keys(&mut model, "@-10m⏎");
    type_keys(&mut model, "s6");
    answer_instants(&mut model, &effects);
    assert_eq!((shown_at(&model), model.modal.is_some()), (None, true));
}

#[test]
fn a_failed_replay_hides_no_outcome() {
    let mut model = model(&Fixture::normal(), Theme::FULL);
    let query = asked(&type_keys(&mut model, "@-10m⏎"));
    answer(&mut model, query[0].0, Err(HistoryError::Engine("the disk is gone".into())));
    assert!(screen(&mut model, 80, 24).contains("the disk is gone"));
    type_keys(&mut model, "r⏎");
    let shown = screen(&mut model, 80, 24);
    assert!(!shown.contains("the disk is gone") && shown.contains("sent …"), "{shown}");
    // Esc gives up one that is on its way.
    type_keys(&mut model, "@-10m⏎⎋");
    assert!(!screen(&mut model, 80, 24).contains("reading the history"));
}

#[test]
fn fast_steps_are_neither_lost_nor_piled_up() {
    let mut model = replayed(&Fixture::normal(), Tab::Mimic);
    let effects = type_keys(&mut model, "<<<");
    assert_eq!(instants(&effects), [ago(660)], "one at a time");
    let (number, _) = asked(&effects)[0];
    let next = answer(&mut model, number, Ok(past(ago(660), 50.0)));
    assert_eq!((shown_at(&model), instants(&next)), (Some(ago(660)), vec![ago(780)]));
    answer_instants(&mut model, &next);
    assert_eq!(shown_at(&model), Some(ago(780)), "three minutes for three keys");
}

#[test]
fn many_events_of_one_instant_end_no_search() {
    let flood: Vec<AlarmRecord> = (0..300).map(|_| raised(ago(500))).chain([raised(ago(100))]).collect();
    let mut model = replayed(&Fixture::normal(), Tab::Mimic);
    assert_eq!(found(&mut model, "]", &flood), Some(ago(500)));
    assert_eq!(found(&mut model, "]", &flood), Some(ago(100)));
    assert_eq!(found(&mut model, "[", &flood), Some(ago(500)));
}

#[test]
fn the_trends_show_no_present_below_the_rule() {
    for keys in ["l", "m", "p", "c", "u"] {
        let mut model = replayed(&Fixture::normal(), Tab::Trends);
        type_keys(&mut model, keys);
        let shown = screen(&mut model, 80, 24);
        assert!(shown.contains("at 13:52:31") && !shown.contains("live"), "{keys}: {shown}");
    }
    let mut model = replayed(&Fixture::normal(), Tab::Trends);
    let later = KeyEvent::new(KeyCode::PageUp, KeyModifiers::NONE);
    assert_eq!(instants(&update(&mut model, Msg::Key(later))), [ago(1_200)], "a whole window earlier");
}

#[test]
fn a_line_of_the_past_says_what_is_known_of_it() {
    let mut model = replayed(&Fixture::normal(), Tab::Bus);
    let shown = screen(&mut model, 80, 24);
    assert!(shown.contains("no request is on record for this minute"), "{shown}");
    assert!(!shown.contains("no data from this line yet") && !shown.contains("TX"), "{shown}");
}

#[test]
fn a_tiny_screen_takes_no_key_but_the_way_back() {
    let mut model = replayed(&Fixture::alarm(), Tab::Mimic);
    let shown = screen(&mut model, 40, 10);
    assert!(shown.contains("UNACK 00:41  TIC-1.PV"), "the banner is of the present: {shown}");
    for key in ["@", "<", "]", "*", ":", "?"] {
        assert_eq!((type_keys(&mut model, key), &model.modal), (Vec::new(), &None), "{key}");
    }
    assert_eq!(shown_at(&model), Some(ago(600)));
    type_keys(&mut model, "⎋");
    assert_eq!(shown_at(&model), None);
}
