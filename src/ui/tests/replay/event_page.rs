//! The event page: what it shows of one past instant, and what it says where nothing is kept.

use super::*;
use crate::plant::{
    line_report::LineReport,
    record::ActionRecord,
    recorded_action::RecordedAction,
    traffic::{Frame, Frames},
};

fn login(at: Timestamp, action: RecordedAction, user: &str, from: &str) -> ActionRecord {
    ActionRecord { from: from.into(), ..ActionRecord::new(at, user, action, user, "done") }
}

/// Answers all queries of the replay as a history would that has some events of an hour ago.
fn answer_page(model: &mut Model, effects: &[Effect], at: Timestamp) {
    for (number, query) in asked(effects) {
        let write = ActionRecord {
            old: Some("70.0 °C".into()),
            new: Some("65.0 °C".into()),
            ..ActionRecord::new(
                at + SignedDuration::from_secs(20),
                "anna",
                RecordedAction::Write,
                "TIC-1.SV",
                "verified",
            )
        };
        let reply = match query {
            Query::Past { at } => {
                let effects = answer(model, number, Ok(past(at, 50.0)));
                answer_page(model, &effects, at);
                continue;
            }
            Query::Journal { .. } => Answer::Journal(vec![raised(at), raised(at - SignedDuration::from_mins(40))]),
            Query::Actions { .. } => Answer::Actions(vec![write]),
            Query::Audit { action, .. } if action == "log" => Answer::Actions(vec![
                login(at - SignedDuration::from_mins(50), RecordedAction::Login, "somchai", "tty1"),
                login(at - SignedDuration::from_mins(90), RecordedAction::Login, "anna", "pts/3"),
                login(at - SignedDuration::from_mins(95), RecordedAction::Login, "tom", "pts/4"),
                login(at - SignedDuration::from_mins(60), RecordedAction::Logout, "tom", "pts/4"),
            ]),
            Query::Audit { .. } => {
                Answer::Actions(vec![login(at - SignedDuration::from_mins(30), RecordedAction::Detach, "", "tty1")])
            }
            Query::Series { .. } => Answer::Series(Vec::new()),
            other => panic!("no query of the page: {other:?}"),
        };
        answer(model, number, Ok(reply));
    }
}

/// A terminal with the event page of an instant.
fn paged(fixture: &Fixture, keys: &str, at: Timestamp) -> Model {
    let mut model = model(fixture, Theme::FULL);
    let effects = type_keys(&mut model, keys);
    assert_eq!(instants(&effects), [at]);
    answer_page(&mut model, &effects, at);
    model
}

#[test]
fn the_event_page_shows_an_instant_at_every_size() {
    let mut model = paged(&Fixture::traffic(), "!-10m⏎", ago(600));
    for (width, height) in [(60, 20), (80, 24), (120, 40), (160, 50)] {
        let shown = screen(&mut model, width, height);
        insta::assert_snapshot!(format!("event_page_{width}x{height}"), shown);
        for words in ["13:52:31.000  here", "anna", "logged in:", "frames", "PAST"] {
            assert!(shown.contains(words), "{width}x{height} lacks {words}: {shown}");
        }
        let order: Vec<Option<usize>> =
            ["temperature high  raised", "here", "write 70.0"].iter().map(|words| shown.find(words)).collect();
        assert!(order.is_sorted() && order[0].is_some(), "{width}x{height}: {shown}");
        assert!(!shown.contains("somchai") && !shown.contains("tom"), "who had left: {shown}");
    }
}

#[test]
fn an_alarm_opens_the_event_page_with_one_key() {
    let raised_at = Fixture::alarm().alarms[0].raised_at;
    for keys in ["3!", "3@⏎"] {
        let mut model = paged(&Fixture::alarm(), keys, raised_at);
        let shown = screen(&mut model, 120, 40);
        assert!(shown.contains("here") && shown.contains("users"), "{keys}: {shown}");
        // The tabs are one key away, and the present is.
        type_keys(&mut model, "!");
        assert!(!screen(&mut model, 120, 40).contains("users"));
        let effects = type_keys(&mut model, "!");
        answer_page(&mut model, &effects, raised_at);
        assert!(screen(&mut model, 120, 40).contains("users"));
        type_keys(&mut model, "2");
        assert!(!screen(&mut model, 120, 40).contains("users") && shown_at(&model).is_some());
        type_keys(&mut model, "!⎋");
        assert_eq!((shown_at(&model), model.replay.page().is_none()), (None, true));
    }
}

#[test]
fn a_row_of_the_journal_opens_the_event_page() {
    let mut model = model(&Fixture::normal(), Theme::FULL);
    model.tabs.shown = Tab::Alarms;
    let effects = type_keys(&mut model, "j");
    for effect in effects {
        if let Effect::Query(id @ QueryId { tab: Some(_), .. }, Query::Journal { .. }) = effect {
            update(&mut model, Msg::Answer(id, Ok(Answer::Journal(vec![raised(ago(5)), raised(ago(90))]))));
        }
    }
    assert_eq!(instants(&type_keys(&mut model, "!")), [ago(5)]);
}

#[test]
fn nothing_of_the_hidden_tab_acts_on_the_event_page() {
    let mut model = paged(&Fixture::alarm(), "!-10m⏎", ago(600));
    for key in "wcfsgt\u{8}⏎←x".chars() {
        let effects = type_keys(&mut model, &key.to_string());
        assert_eq!((sent_kind(&effects), &model.modal), (None, &None), "{key}");
    }
    assert!(screen(&mut model, 80, 24).contains("This is the event page"));
}

#[test]
fn the_event_page_says_which_frames_are_kept() {
    let frame = |number: u64, seconds: i64| {
        let mut frame: Frame = frames_of(&Fixture::traffic())[0].clone();
        (frame.at, frame.number) = (ago(seconds), number);
        frame
    };
    for (kept, expect) in [
        (vec![frame(1, 605), frame(2, 595)], "frames of"),
        (vec![frame(1, 300), frame(2, 200)], "frames no longer kept"),
        (Vec::new(), "no frames of that time"),
    ] {
        let mut fixture = Fixture::traffic();
        let report = fixture.line.report.as_deref().cloned().expect("the line has reported");
        fixture.line.report = Some(std::sync::Arc::new(LineReport { frames: Frames::from(kept), ..report }));
        let mut model = paged(&fixture, "!-10m⏎", ago(600));
        let shown = screen(&mut model, 120, 40);
        assert!(shown.contains(expect), "{expect}: {shown}");
    }
}

fn frames_of(fixture: &Fixture) -> Vec<Frame> {
    let report = fixture.line.report.as_ref().expect("the line has reported");
    report.frames.iter().cloned().collect()
}

#[test]
fn the_event_page_asks_again_only_far_from_what_it_knows() {
    let mut model = paged(&Fixture::normal(), "!-10m⏎", ago(600));
    let effects = type_keys(&mut model, ">");
    let mut next = Vec::new();
    for (number, query) in asked(&effects) {
        if let Query::Past { at } = query {
            next = answer(&mut model, number, Ok(past(at, 50.0)));
        }
    }
    assert!(asked(&next).is_empty(), "a minute is within what is known");
    let effects = type_keys(&mut model, "@-1h⏎");
    for (number, query) in asked(&effects) {
        if let Query::Past { at } = query {
            next = answer(&mut model, number, Ok(past(at, 50.0)));
        }
    }
    assert_eq!(asked(&next).len(), 5, "curves, alarms, actions, logins, closed terminals: {next:?}");
}

#[test]
fn only_a_supervisor_asks_for_logins() {
    use crate::{
        access::{LoggedInUser, SessionStatus},
        plant::role::Role,
    };
    let mut model = model(&Fixture::normal(), Theme::FULL);
    let who = LoggedInUser { user: "tom".into(), role: Role::Technician, must_change: false };
    let session = SessionStatus { who: Some(who), ..(*model.session).clone() };
    update(&mut model, Msg::SessionStatus(std::sync::Arc::new(session)));
    let effects = type_keys(&mut model, "!-10m⏎");
    let mut next = Vec::new();
    for (number, query) in asked(&effects) {
        if let Query::Past { at } = query {
            next = answer(&mut model, number, Ok(past(at, 50.0)));
        }
    }
    assert!(!asked(&next).iter().any(|(_, query)| matches!(query, Query::Audit { .. })));
    answer_page(&mut model, &next, ago(600));
    assert!(screen(&mut model, 80, 24).contains("the audit log is for a Supervisor"));
}

#[test]
fn a_plant_without_a_mimic_has_an_event_page() {
    let mut fixture = Fixture::traffic();
    fixture.def.mimic.pages.clear();
    let mut model = paged(&fixture, "!-10m⏎", ago(600));
    for (width, height) in [(80, 24), (120, 40), (160, 50)] {
        let shown = screen(&mut model, width, height);
        let there = ["curves", "journal", "frames", "logged in"].iter().all(|words| shown.contains(words));
        assert!(there && !shown.contains("TK-1"), "{width}x{height}: {shown}");
    }
}
