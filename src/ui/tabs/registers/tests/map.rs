//! The map of addresses, asked for from here.

use super::*;
use crate::plant::sweep::Sweep;

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
