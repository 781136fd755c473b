//! The map of addresses, asked for from here.

use super::*;
use crate::plant::{
    command::CommandId,
    diagnostics::{DiagnosticRun, DiagnosticState, Finding},
    sweep::{Sweep, SweptOutcome, SweptRange},
};

#[test]
fn a_map_of_the_shown_table_is_asked_for_and_shown() {
    let mut bench = Bench::new();
    bench.keys("←m");
    let form = bench.screen(80, 24);
    assert!(form.contains("map of addresses") && form.contains("input") && form.contains("547 requests"), "{form}");
    let effects = type_keys(&mut bench.model, "⏎");
    let wanted = Sweep { unit: 1, table: Table::Input, first: 0, last: 0xFFFF, every: 8 };
    assert_eq!(sent_kind(&effects), Some(&CommandKind::Test(LineId(0), Diagnostic::Sweep(wanted))));
    let shown = bench.screen(80, 24);
    assert!(shown.contains("‹Test›"), "its page shows the map as it grows: {shown}");
    bench.keys("⎋");
    assert_eq!(bench.model.tabs.shown, Tab::Registers, "Esc leads back to where it was asked for");
}

#[test]
fn what_one_unit_answers_late_is_not_listed_for_another() {
    let mut bench = Bench::new();
    bench.answer(0, |_| Some(0));
    let sweep = Sweep { unit: 1, table: Table::Holding, first: 0, last: 0xFFFF, every: 8 };
    let range = SweptRange { first: 5_000, last: 5_010, outcome: SweptOutcome::Answers };
    let mut snapshot = Snapshot::clone(&bench.model.snapshot);
    snapshot.lines[0].test = Some(Arc::new(DiagnosticRun {
        id: CommandId { terminal: 1, number: 1 },
        by: "anna".into(),
        diagnostic: Diagnostic::Sweep(sweep),
        started: now(),
        done: 1,
        total: 1,
        requests: 1,
        errors: 0,
        now: None,
        state: DiagnosticState::Done,
        findings: vec![Finding::Swept(range)],
    }));
    bench.send(Msg::Snapshot(Arc::new(snapshot)));
    bench.asked.clear();
    bench.keys("/702⏎");
    let (id, read) = bench.asked.pop().expect("what the map has found is read first");
    assert_eq!(read.spans[0].address, 5_000);
    bench.keys("U7⏎");
    bench.respond(1, id, &read, |_, _| Some(702));
    assert!(bench.model.tabs.registers.picking.is_none(), "{}", bench.screen(80, 24));
    assert!(bench.model.tabs.registers.cells.get(Table::Holding, 5_000).is_none(), "no register of unit 7");
}
