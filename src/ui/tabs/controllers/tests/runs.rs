//! The control runs of a controller: their table, and some over each other.

use super::*;
use crate::{
    history::{Answer, Bucket, Query, Series},
    plant::{
        control_run::{ControlRun, Figure, RunCause},
        def::Reference,
    },
    report::procedures,
    ui::QueryId,
};

fn runs() -> Vec<ControlRun> {
    let batch = ControlRun {
        cause: RunCause::Batch,
        detail: "hot-water-3".into(),
        settings_changed: true,
        ..control_run(15, RunState::Interrupted)
    };
    vec![control_run(17, RunState::Running), control_run(16, RunState::Ended), batch]
}

fn curve(tag: crate::plant::def::TagId, from: jiff::Timestamp) -> Answer {
    let bucket = |n: u32| {
        let mean = 27.0 + f64::from(n.min(40));
        Some(Bucket { min: mean, max: mean, mean, last: mean.into() })
    };
    let (step, summary) = (Duration::from_secs(22), Some((27.0.into(), 50.0.into(), 67.0.into())));
    Answer::Series(vec![Series {
        tag,
        from,
        step,
        buckets: (0..60).map(bucket).collect(),
        summary,
        counted: None,
        good: 1.0,
    }])
}

/// Answers what was asked, and returns the begins of the curves.
fn answer(model: &mut Model, effects: &[Effect]) -> Vec<jiff::Timestamp> {
    let mut begins = Vec::new();
    let asked: Vec<(QueryId, Query)> = effects
        .iter()
        .filter_map(|effect| match effect {
            Effect::Query(id, query) => Some((*id, query.clone())),
            _ => None,
        })
        .collect();
    for (id, query) in asked {
        let answer = match query {
            Query::ControlRuns { controller, .. } => {
                assert_eq!(controller.as_deref(), Some("TIC-1"));
                Answer::ControlRuns(runs())
            }
            Query::Series { tags, from, .. } => {
                begins.push(from);
                curve(tags[0], from)
            }
            _ => continue,
        };
        update(model, Msg::Answer(id, Ok(answer)));
    }
    begins
}

#[test]
fn marked_runs_lie_over_each_other_and_all_stand_in_a_table() {
    for (width, height) in SIZES {
        let mut model = model(&many(2), Theme::FULL);
        screen(&mut model, width, height);
        type_keys(&mut model, "4⏎");
        let effects = type_keys(&mut model, "r");
        answer(&mut model, &effects);
        type_keys(&mut model, "↓");
        insta::assert_snapshot!(format!("runs_{width}x{height}"), screen(&mut model, width, height));
        type_keys(&mut model, " ↓ ");
        let effects = type_keys(&mut model, "o");
        let begins = answer(&mut model, &effects);
        assert_eq!(begins, [runs()[1].from, runs()[2].from], "the marked ones, each from its own begin");
        insta::assert_snapshot!(format!("runs_overlay_{width}x{height}"), screen(&mut model, width, height));
        type_keys(&mut model, "⎋");
        assert!(screen(&mut model, width, height).contains("■  16"), "the table with its marks");
        type_keys(&mut model, "⎋");
        assert!(!screen(&mut model, width, height).contains('■'), "Esc takes the marks off first");
        type_keys(&mut model, "⎋");
        assert!(screen(&mut model, width, height).contains("‹ TIC-1 ›"));
    }
}

#[test]
fn without_marks_the_selected_run_and_those_before_it() {
    let mut model = model(&many(2), Theme::FULL);
    type_keys(&mut model, "4⏎");
    let effects = type_keys(&mut model, "r");
    answer(&mut model, &effects);
    let effects = type_keys(&mut model, "↓o");
    assert_eq!(answer(&mut model, &effects).len(), 2);
    // The trend of its time is one key away from the table.
    let effects = type_keys(&mut model, "ot");
    let spans = effects.iter().filter_map(|effect| match effect {
        Effect::Query(_, Query::Series { from, to, .. }) => Some((*from, *to)),
        _ => None,
    });
    let run = &runs()[1];
    assert!(spans.into_iter().any(|(from, to)| from <= run.from && run.until <= to), "{effects:?}");
}

#[test]
fn what_was_never_reached_has_one_word_everywhere() {
    let run = ControlRun { at_sv: Figure::NotYet, steady: Figure::NotYet, ..control_run(16, RunState::Ended) };
    let source = Reference { source: String::new(), at_sv: None, steady: None, overshoot: None };
    let [at_sv, steady, ..] = super::super::runs::figures(&run);
    let [known_at_sv, known_steady, _] = procedures::reference(&source, 1);
    assert_eq!([&at_sv, &steady, &known_at_sv, &known_steady], ["never"; 4]);
}
