//! Export of the view: on record first, then written.

use super::*;
use crate::access::{Durability, SessionRequest};

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
    assert!(file.ends_with("TIC-1.csv"), "{file}");
    let (path, bytes) = saved(&effects(&mut stand, Msg::RequestDone(id, Ok(Durability::Recorded)))).expect("written");
    let csv = String::from_utf8(bytes).expect("CSV is text");
    assert!(csv.starts_with("time,TIC-1.PV") && csv.contains(",good"), "{csv}");
    effects(&mut stand, Msg::Saved(Some(Tab::Trends), Ok(path)));
    assert!(stand.screen().contains("TIC-1.csv written"));
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
    effects(&mut stand, Msg::RequestDone(id, Err("audit log full".to_owned())));
    assert!(stand.screen().contains("not exported: audit log full"));
}
