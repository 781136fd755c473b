//! The procedures: their list beside the reference, the confirmation, the progress, the abort.

use super::*;
use crate::{
    history::{Answer, Query},
    plant::{
        control_run::{ControlRun, RunCause},
        def::{ProcedureDef, ProcedureId, ProcedureStep, Reference},
        expr::{Compare, Expr},
        procedure::{ProcedureEnd, ProcedureRun, ProcedureState, StepFailure},
    },
    ui::QueryId,
};

const MINUTE: Duration = Duration::from_secs(60);

/// Three procedures, of which two measure the first controller.
fn with_procedures() -> Fixture {
    let mut fixture = many(2);
    let (sv, pv, run) = (fixture.tag("TIC-1.SV"), fixture.tag("TIC-1.PV"), fixture.tag("TIC-1.RUN"));
    let wait = ProcedureStep::WaitUntil {
        text: "TIC-1.PV < 27.6 °C".into(),
        condition: Expr::test(pv, Compare::Below, 27.6),
        limit: 40 * MINUTE,
    };
    let cool = vec![ProcedureStep::Write { tag: sv, value: 20.0 }, wait];
    let measured = |label: &str| {
        let begin = ProcedureStep::BeginMeasurement { controller: DeviceId(0), label: label.into() };
        let end = ProcedureStep::EndMeasurement { controller: DeviceId(0) };
        let own = [ProcedureStep::Write { tag: sv, value: 70.0 }, begin, ProcedureStep::Hold(60 * MINUTE), end];
        [cool.clone(), own.to_vec()].concat()
    };
    let reference = |minutes, steady| {
        let (source, at_sv, overshoot) = ("thesis".to_owned(), Some(minutes * MINUTE), Some(0.0));
        Some(Reference { source, at_sv, steady, overshoot })
    };
    let procedure = |name: &str, about: &str, steps, reference| ProcedureDef {
        name: name.into(),
        about: about.to_owned(),
        steps,
        safe: vec![(run, 1.0), (sv, 20.0)],
        reference,
    };
    fixture.def.procedures = vec![
        procedure("cool", "lets the tank cool", cool.clone(), None),
        procedure("PI", "PI control: P 5 %, I 240 s", measured("PI"), reference(13, Some(17 * MINUTE))),
        procedure("PD", "PD control: P 5 %, D 60 s", measured("PD"), reference(12, None)),
    ];
    fixture.procedures = vec![None; 3];
    fixture
}

/// As it stands after three minutes in this step.
fn run(step: usize, state: ProcedureState) -> Option<Arc<ProcedureRun>> {
    let since = fixture::now() - SignedDuration::from_secs(192);
    let mut run = ProcedureRun::new("anna".into(), "".into(), since - SignedDuration::from_mins(9));
    (run.step, run.since, run.state) = (Some(step), since, state);
    Some(Arc::new(run))
}

fn measured() -> Vec<ControlRun> {
    let of = |number, label: &str| ControlRun {
        cause: RunCause::Procedure,
        detail: label.into(),
        ..control_run(number, RunState::Ended)
    };
    vec![control_run(17, RunState::Running), of(16, "PD"), of(15, "PI"), of(14, "PI")]
}

/// Answers what was asked, and returns the begins of the curves.
fn answer(model: &mut Model, effects: &[Effect]) -> Vec<jiff::Timestamp> {
    let asked: Vec<(QueryId, Query)> = effects
        .iter()
        .filter_map(|effect| match effect {
            Effect::Query(id, query) => Some((*id, query.clone())),
            _ => None,
        })
        .collect();
    let mut begins = Vec::new();
    for (id, query) in asked {
        match query {
            Query::ControlRuns { .. } => {
                let _ = update(model, Msg::Answer(id, Ok(Answer::ControlRuns(measured()))));
            }
            Query::Series { from, .. } => begins.push(from),
            _ => {}
        }
    }
    begins
}

fn assert_seen_there(name: &str, fixture: &Fixture, theme: Theme, keys: &str) {
    for (width, height) in SIZES {
        let mut model = model(fixture, theme);
        let effects = type_keys(&mut model, "4e");
        answer(&mut model, &effects);
        type_keys(&mut model, keys);
        insta::assert_snapshot!(format!("{name}_{width}x{height}"), screen(&mut model, width, height));
    }
}

#[test]
fn the_list_has_what_was_measured_beside_its_reference() {
    let mut fixture = with_procedures();
    fixture.procedures[1] = run(5, ProcedureState::Ended(ProcedureEnd::Done));
    assert_seen_there("procedures", &fixture, Theme::FULL, "↓");
    let failed = ProcedureEnd::Failed(StepFailure::TimeLimit);
    fixture.procedures[0] = run(1, ProcedureState::WritingSafeState(failed));
    assert_seen_there("procedures_ascii", &fixture, Theme::PLAIN, "");
    fixture.procedures[0] = run(1, ProcedureState::Running);
    assert_seen_there("procedures_running", &fixture, Theme::FULL, "");
    fixture.procedures[0] = run(1, ProcedureState::Ended(ProcedureEnd::Interrupted));
    assert_seen_there("procedures_interrupted", &fixture, Theme::FULL, "");
}

#[test]
fn a_start_is_asked_with_all_that_would_be_written() {
    let fixture = with_procedures();
    assert_seen_there("procedure_start", &fixture, Theme::FULL, "↓⏎");
    let mut model = model(&fixture, Theme::FULL);
    type_keys(&mut model, "4e↓⏎");
    let effects = type_keys(&mut model, "⏎");
    assert_eq!(sent_kind(&effects), Some(&CommandKind::StartProcedure(ProcedureId(1))));
}

#[test]
fn an_abort_asks_nothing_and_ends_the_one_at_work() {
    let mut fixture = with_procedures();
    fixture.procedures[0] = run(1, ProcedureState::Running);
    let mut model = model(&fixture, Theme::FULL);
    type_keys(&mut model, "4e↓↓");
    let effects = type_keys(&mut model, "x");
    assert_eq!(sent_kind(&effects), Some(&CommandKind::AbortProcedure(ProcedureId(0))), "whatever is selected");
    type_keys(&mut model, "⏎");
    assert!(screen(&mut model, 80, 24).contains("procedure cool is running"), "one at a time");
}

#[test]
fn the_latest_runs_of_the_procedures_lie_over_each_other() {
    let mut model = model(&with_procedures(), Theme::FULL);
    let effects = type_keys(&mut model, "4e");
    answer(&mut model, &effects);
    let effects = type_keys(&mut model, "↓o");
    assert_eq!(answer(&mut model, &effects), [measured()[2].from, measured()[1].from], "one of each, the latest");
    let shown = screen(&mut model, 80, 24);
    assert!(shown.contains("PI 15") && shown.contains("PD 16"), "{shown}");
    type_keys(&mut model, "⎋");
    assert!(screen(&mut model, 80, 24).contains("Procedures"));
}

#[test]
fn the_palette_leads_to_a_procedure() {
    let mut model = model(&with_procedures(), Theme::FULL);
    type_keys(&mut model, ":PD⏎");
    let shown = screen(&mut model, 80, 24);
    assert!(shown.contains("▸PD") && shown.contains("PD control"), "{shown}");
    // A plant without any has no key for them.
    let mut model = super::model(&many(2), Theme::FULL);
    type_keys(&mut model, "4");
    assert!(!screen(&mut model, 120, 40).contains("procedures"));
}
