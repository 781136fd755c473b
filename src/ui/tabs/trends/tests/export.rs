//! Export of the view: on record first, then written.

use super::*;
use crate::{
    access::{Durability, LoggedInUser, SessionRequest, SessionStatus},
    ui::fixture,
};

/// The effects of a message that are no queries, and the answers to these.
fn effects(stand: &mut Stand, msg: Msg) -> Vec<Effect> {
    let mut all = update(&mut stand.model, msg);
    for _ in 0..10 {
        let queries = all.extract_if(.., |effect| matches!(effect, Effect::Query(..))).collect::<Vec<_>>();
        for effect in queries {
            if let Effect::Query(id, query) = effect {
                let answer = stand.history(&query);
                all.extend(update(&mut stand.model, Msg::Answer(id, Ok(answer))));
            }
        }
    }
    all
}

fn key(letter: char) -> Msg {
    Msg::Key(KeyEvent::new(KeyCode::Char(letter), KeyModifiers::NONE))
}

/// The file that the station is asked to record, and the number of the request.
fn requested(effects: &[Effect]) -> Option<(QueryId, String)> {
    effects.iter().find_map(|effect| match effect {
        Effect::SessionRequest(id, SessionRequest::Exported { file, .. }) => Some((*id, file.clone())),
        _ => None,
    })
}

fn saved(effects: &[Effect]) -> Option<(PathBuf, Vec<u8>)> {
    effects.iter().find_map(|effect| match effect {
        Effect::SaveReport { path, bytes, .. } => Some((path.clone(), bytes.clone())),
        _ => None,
    })
}

#[test]
fn values_of_the_view_are_written_once_on_record() {
    let mut stand = Stand::new(Theme::FULL, 120, 40);
    stand.answer();
    let (id, file) = requested(&effects(&mut stand, key('e'))).expect("the station is asked first");
    assert!(file.contains("-TIC-1-") && file.ends_with(".csv"), "{file}");
    let (path, bytes) = saved(&effects(&mut stand, Msg::RequestDone(id, Ok(Durability::Recorded)))).expect("written");
    let csv = String::from_utf8(bytes).expect("CSV is text");
    assert!(csv.starts_with("time,TIC-1.PV") && csv.contains(",good"), "{csv}");
    effects(&mut stand, Msg::Saved(Some(Tab::Trends), Ok(path)));
    assert!(stand.screen().contains(".csv written"));
    stand.press("↓");
    assert!(!stand.screen().contains("written"));
}

#[test]
fn the_chart_is_written_as_svg_and_then_as_png() {
    let mut stand = Stand::new(Theme::FULL, 120, 40);
    stand.answer();
    let (id, file) = requested(&effects(&mut stand, key('E'))).expect("the SVG is recorded");
    assert!(file.ends_with(".svg"), "{file}");
    assert_eq!(effects(&mut stand, key('E')), [], "one export at a time");
    let (path, bytes) = saved(&effects(&mut stand, Msg::RequestDone(id, Ok(Durability::Recorded)))).expect("written");
    let svg = String::from_utf8(bytes).expect("SVG is text");
    assert!(svg.contains("TIC-1.PV") && svg.contains("HH 90.0") && svg.contains("<polyline"));
    let (id, file) = requested(&effects(&mut stand, Msg::Saved(Some(Tab::Trends), Ok(path)))).expect("then the PNG");
    assert!(file.ends_with(".png"), "{file}");
    effects(&mut stand, Msg::RequestDone(id, Err(RequestRefusal::Failed("audit log full".to_owned()))));
    assert!(stand.screen().contains("not exported: audit log full"));
}

#[test]
fn an_exported_chart_has_the_language_of_the_terminal() {
    let mut stand = Stand::new(Theme::FULL, 120, 40);
    stand.answer();
    stand.model.locale = crate::text::Language::THAI.locale();
    let mut written = |letter| {
        let (id, _) = requested(&effects(&mut stand, key(letter))).expect("recorded");
        let (path, bytes) =
            saved(&effects(&mut stand, Msg::RequestDone(id, Ok(Durability::Recorded)))).expect("written");
        effects(&mut stand, Msg::Saved(Some(Tab::Trends), Ok(path)));
        String::from_utf8(bytes).expect("text")
    };
    let csv = written('e');
    assert!(csv.starts_with("time,TIC-1.PV") && csv.contains(",good"), "a CSV is the same for every program: {csv}");
    let svg = written('E');
    assert!(svg.contains("เฉลี่ย") && !svg.contains("mean "), "{svg}");
}

fn change_session(stand: &mut Stand, change: impl FnOnce(&mut SessionStatus)) -> Vec<Effect> {
    let mut session = (*stand.model.session).clone();
    change(&mut session);
    update(&mut stand.model, Msg::SessionStatus(Arc::new(session)))
}

#[test]
fn another_request_does_not_take_the_answer_of_an_export() {
    let mut stand = Stand::new(Theme::FULL, 120, 40);
    stand.answer();
    let (id, _) = requested(&effects(&mut stand, key('E'))).expect("the SVG is recorded");
    let lock = Msg::Key(KeyEvent::new(KeyCode::Char('k'), KeyModifiers::CONTROL));
    effects(&mut stand, lock);
    let written = effects(&mut stand, Msg::RequestDone(id, Ok(Durability::Recorded)));
    assert!(saved(&written).is_some(), "{written:?}");
}

#[test]
fn a_lock_or_another_user_ends_an_export() {
    type Change = fn(&mut SessionStatus);
    let lock: Change = |session| session.locked = true;
    let change: Change = |session| {
        let who = fixture::session().who.clone();
        session.who = who.map(|who| LoggedInUser { user: "boris".into(), ..who });
    };
    for (letter, end) in [('e', lock), ('E', lock), ('e', change), ('E', change)] {
        let mut stand = Stand::new(Theme::FULL, 120, 40);
        stand.answer();
        // The values of a CSV are still read, the SVG is before the station.
        let begun = update(&mut stand.model, key(letter));
        let id = requested(&begun).map(|(id, _)| id);
        change_session(&mut stand, end);
        let number = |effect: &Effect| match effect {
            Effect::Query(id, query) => Some((*id, query.clone())),
            _ => None,
        };
        for (id, query) in begun.iter().filter_map(number) {
            let answer = stand.history(&query);
            let late = update(&mut stand.model, Msg::Answer(id, Ok(answer)));
            assert_eq!(requested(&late), None, "{letter}: not on record under another user");
        }
        let late = id.map(|id| update(&mut stand.model, Msg::RequestDone(id, Ok(Durability::Recorded))));
        assert_eq!(saved(&late.unwrap_or_default()), None, "{letter}");
        change_session(&mut stand, |session| session.locked = false);
        assert!(requested(&effects(&mut stand, key(letter))).is_some(), "{letter}: exported again");
    }
}

#[test]
fn another_plot_is_not_exported_as_a_time_chart() {
    let mut stand = Stand::new(Theme::FULL, 120, 40);
    stand.answer();
    stand.press("x");
    assert_eq!(requested(&effects(&mut stand, key('E'))), None);
    assert!(stand.screen().contains("only the chart over time"), "{}", stand.screen());
}

#[test]
fn the_name_of_a_limit_stands_where_no_curve_runs() {
    let place = |pv: f64| {
        let mut stand = Stand::new(Theme::FULL, 120, 40);
        stand.answer();
        stand.live(40, |_| Some(pv));
        let (id, _) = requested(&effects(&mut stand, key('E'))).expect("the SVG is recorded");
        let written = effects(&mut stand, Msg::RequestDone(id, Ok(Durability::Recorded)));
        let (_, bytes) = saved(&written).expect("written");
        let svg = String::from_utf8(bytes).expect("SVG is text");
        let label = svg.lines().find(|line| line.contains("HH 90.0")).unwrap_or_default().to_owned();
        assert!(!label.is_empty(), "{svg}");
        label
    };
    assert_eq!(place(64.0), place(80.0), "at the right");
    assert_ne!(place(64.0), place(92.0), "the curve ends in it");
}
