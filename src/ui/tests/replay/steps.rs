//! Steps by batch and by stored value, and bookmarks.

use super::*;
use crate::{
    plant::batch::Batch,
    report::batch::BatchReport,
    ui::preferences::{Bookmark, Kept},
};

fn batch(number: u32, from: i64, to: Option<i64>) -> BatchReport {
    let batch = Batch {
        name: "water".into(),
        number,
        from: ago(from),
        to: to.map(ago),
        seen: (true, to.is_some()),
        lasted: Duration::from_secs(1),
        phases: Vec::new(),
        unknown: Duration::ZERO,
    };
    BatchReport::new(batch, now())
}

#[test]
fn braces_lead_to_the_begin_and_the_end_of_batches() {
    let batches = [batch(4, 300, None), batch(3, 900, Some(500)), batch(2, 100_000, Some(99_000))];
    let mut model = replayed(&Fixture::normal(), Tab::Mimic);
    for (key, expect) in [("{", 900), ("}", 500), ("}", 300), ("{", 500), ("{", 900), ("{", 99_000), ("{", 100_000)] {
        let mut effects = type_keys(&mut model, key);
        for _ in 0..5 {
            if !instants(&effects).is_empty() {
                break;
            }
            let [(number, Query::Batches { from, to, .. })] = asked(&effects)[..] else { panic!("{effects:?}") };
            let within =
                |report: &&BatchReport| report.batch.from < to && report.batch.to.is_none_or(|end| from <= end);
            let found = batches.iter().filter(within).cloned().collect();
            effects = answer(&mut model, number, Ok(Answer::Batches(found)));
        }
        assert_eq!(instants(&effects), [ago(expect)], "{key}");
        answer_instants(&mut model, &effects);
    }
    assert!(screen(&mut model, 80, 24).contains("batch water-2 begins"));
}

#[test]
fn brackets_lead_to_the_stored_values_of_what_is_drawn() {
    let mut model = replayed(&Fixture::normal(), Tab::Mimic);
    for (key, latest) in [("(", true), (")", false)] {
        let effects = type_keys(&mut model, key);
        let [(number, Query::SampleTime { tags, from, to, latest: asked_latest })] = &asked(&effects)[..] else {
            panic!("{effects:?}")
        };
        let shown = shown_at(&model).expect("a past is shown");
        assert!(!tags.is_empty() && *asked_latest == latest);
        assert!(if latest { *to == shown } else { *from > shown }, "{key}");
        let at = if latest { ago(607) } else { ago(603) };
        let effects = answer(&mut model, *number, Ok(Answer::SampleTime(Some(at))));
        assert_eq!(instants(&effects), [at]);
        answer_instants(&mut model, &effects);
    }
    let effects = type_keys(&mut model, ")");
    answer(&mut model, asked(&effects)[0].0, Ok(Answer::SampleTime(None)));
    assert!(screen(&mut model, 80, 24).contains("no other stored value within an hour"));
}

#[test]
fn a_bookmark_is_kept_found_and_removed() {
    let mut model = replayed(&Fixture::normal(), Tab::Mimic);
    assert!(type_keys(&mut model, "#⏎").is_empty(), "a name is needed");
    let effects = type_keys(&mut model, "pump tripped⏎");
    let kept = vec![Bookmark { at: ago(600), name: "pump tripped".to_owned() }];
    assert_eq!(effects, [Effect::KeepPreferences(Some("tech1".to_owned()), Kept::Bookmarks(kept))]);
    // From the present: by its list, and by the palette.
    for keys in ["⎋'⏎", "⎋:tripped⏎"] {
        let effects = type_keys(&mut model, keys);
        assert_eq!(instants(&effects), [ago(600)], "{keys}");
    }
    type_keys(&mut model, "⎋'");
    let shown = screen(&mut model, 80, 24);
    assert!(shown.contains("pump tripped") && shown.contains("Del remove bookmark"), "{shown}");
    let delete = KeyEvent::new(KeyCode::Delete, KeyModifiers::NONE);
    let effects = update(&mut model, Msg::Key(delete));
    assert!(effects.contains(&Effect::KeepPreferences(Some("tech1".to_owned()), Kept::Bookmarks(Vec::new()))));
    type_keys(&mut model, "⎋'");
    assert!(screen(&mut model, 80, 24).contains("No bookmarks"));
}
