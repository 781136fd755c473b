//! What belongs to a measurement.

use super::*;

/// Other runs end after `duration_max`, 4 h unless said otherwise.
#[test]
fn a_measurement_may_last_longer_than_other_runs() {
    let mut def = def();
    def.runs[0].duration_max = Duration::from_secs(100);
    def.procedures[0].steps[3] = ProcedureStep::Hold(Duration::from_secs(150));
    let mut plant = plant_of(def);
    waiting(&mut plant);
    for second in 4..=230 {
        read(&mut plant, second, &[(PV, 503.0), (SV, 500.0)]);
    }
    assert_eq!(run(&plant).state, ProcedureState::Ended(ProcedureEnd::Done), "{:?}", run(&plant));
}

/// The natural order of a step response: the measurement begins, then the procedure itself changes SV.
#[test]
fn a_step_of_the_setpoint_within_a_measurement_belongs_to_it() {
    let mut def = def();
    def.procedures[0].steps = vec![
        ProcedureStep::BeginMeasurement { controller: TIC, label: "heat".into() },
        ProcedureStep::Hold(Duration::from_secs(30)),
        ProcedureStep::Write { tag: SV, value: 50.0 },
        ProcedureStep::Hold(Duration::from_secs(60)),
        ProcedureStep::EndMeasurement { controller: TIC },
    ];
    let mut plant = plant_of(def);
    start(&mut plant);
    let mut sent = Effects::default();
    for second in 2..=31 {
        let effects = read(&mut plant, second, &[(PV, 200.0), (SV, 200.0)]);
        if !written(&effects).is_empty() {
            sent = effects;
        }
    }
    end(&mut plant, &sent, 32, WriteResult::ReadBack);
    for second in 33..=100 {
        read(&mut plant, second, &[(PV, 503.0), (SV, 500.0)]);
    }
    assert_eq!(run(&plant).state, ProcedureState::Ended(ProcedureEnd::Done), "{:?}", run(&plant));
}
