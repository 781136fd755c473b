//! The checklist of an action: ticked by name and time, kept over a restart, empty for a new activation.

use super::*;

fn checklist() -> Arc<PlantDef> {
    with(|alarm| alarm.guidance.action = "lower SV; check SSR lamp;".into())
}

#[test]
fn steps_are_ticked_by_name_and_come_back_after_a_restart() {
    let def = checklist();
    let mut manager = AlarmManager::new(def.clone());
    manager.evaluate(at(0), facts(80.0, true));
    let mut journal = manager.evaluate(at(2), facts(81.0, true));
    let raised = journal[0].at;
    let mut tick = |manager: &mut AlarmManager, step, done, second| {
        let record = manager.tick(HIGH, raised, (step, done), &note(at(second), None))?;
        journal.push(record.clone());
        Ok::<_, AlarmRefusal>(record)
    };
    let record = tick(&mut manager, 0, true, 10).expect("it can be ticked");
    assert_eq!((record.event, record.reason.as_deref()), (AlarmEvent::StepDone, Some("lower SV")));
    tick(&mut manager, 1, true, 20).expect("it can be ticked");
    assert_eq!(tick(&mut manager, 1, true, 21), Err(AlarmRefusal::TickedAlready));
    assert_eq!(tick(&mut manager, 2, true, 21), Err(AlarmRefusal::NoSuchStep), "two steps");
    let ticked: Vec<_> = manager.active()[0].steps.iter().map(|step| (step.at, step.reason.as_deref())).collect();
    assert_eq!(ticked, [(at(10), Some("lower SV")), (at(20), Some("check SSR lamp"))]);
    tick(&mut manager, 0, false, 30).expect("it can be taken back");
    assert_eq!(manager.active()[0].steps.len(), 1);
    assert!(manager.active()[0].step("lower SV").is_none());

    let mut again = AlarmManager::new(def);
    again.restore(&journal);
    assert_eq!(again.lists(), manager.lists());
}

#[test]
fn a_new_activation_has_no_ticks_and_takes_none_of_the_old() {
    let mut manager = AlarmManager::new(checklist());
    manager.evaluate(at(0), facts(80.0, true));
    let raised = manager.evaluate(at(2), facts(81.0, true))[0].at;
    manager.tick(HIGH, raised, (0, true), &note(at(3), None)).expect("it can be ticked");
    for second in 4..30 {
        manager.evaluate(at(second), facts(20.0, true));
    }
    assert_eq!(manager.active()[0].steps.len(), 1, "returned, but not raised again");
    for second in 30..40 {
        manager.evaluate(at(second), facts(81.0, true));
    }
    assert!(manager.active()[0].steps.is_empty());
    let late = manager.tick(HIGH, raised, (0, true), &note(at(41), None));
    assert_eq!(late, Err(AlarmRefusal::RaisedSince));
}
