//! What a station knows of the procedure that the one before it left at work.

use super::*;
use crate::plant::recorded_action::RecordedAction;

fn procedure(at: i64, action: RecordedAction, name: &str, outcome: &str) -> Record {
    Record::Action(ActionRecord::new(sec(at), "anna", action, name, outcome))
}

#[test]
fn the_last_start_or_end_of_a_procedure_is_restored() {
    let (_folder, db) = folder();
    let mut expected = None;
    for (n, (record, is_restored)) in [
        (procedure(10, RecordedAction::StartProcedure, "fill", "verified"), true),
        (procedure(20, RecordedAction::Write, "TIC-1.SV", "verified"), false),
        (procedure(30, RecordedAction::StartProcedure, "heat", "refused: procedure fill is running"), false),
        (procedure(40, RecordedAction::EndProcedure, "fill", "interrupted: the station stopped"), true),
        (procedure(50, RecordedAction::StartProcedure, "heat", "verified"), true),
    ]
    .into_iter()
    .enumerate()
    {
        let opened = Store::open_at_start(&db, &def(), sec(n as i64 * 100)).unwrap();
        assert_eq!(opened.read.procedure, expected, "before {record:?}");
        let Record::Action(action) = &record else { panic!("{record:?}") };
        expected = if is_restored { Some(action.clone()) } else { expected };
        opened.store.append(&[record]).unwrap();
    }
    let opened = Store::open_at_start(&db, &def(), sec(900)).unwrap();
    assert_eq!(opened.read.procedure, expected, "it was killed while heat was at work");
}
