//! A unit is recognised by its registers, named, and kept as a plant file.

use super::*;

/// A controller that holds what a PXR holds.
fn pxr(table: Table, address: u16) -> Option<u16> {
    match (table, address) {
        (Table::Input, 1000) => Some(696),
        (Table::Input, 1003) => Some(4_500),
        (Table::Input, 1001..=1009) | (Table::Holding, 1001 | 1003 | 1004 | 1016) => Some(0),
        (Table::Holding, 1002) => Some(700),
        (Table::Holding, 1005) => Some(50),
        (Table::Holding, 1015 | 1019) => Some(1),
        (Table::Holding, 1018 | 1031) => Some(1_000),
        (Table::Holding, 1006..=1038) => Some(0),
        _ => None,
    }
}

impl Bench {
    /// A unit that answers the window, then every signature.
    fn at_unit(unit: impl Fn(Table, u16) -> Option<u16>) -> Bench {
        let mut bench = Bench::new();
        assert!(bench.probed.is_empty(), "nothing is asked before the first value of the window");
        bench.answer(0, |address| unit(Table::Holding, address));
        while let Some((id, read)) = bench.probed.pop() {
            assert_eq!(read.check(), Ok(()));
            bench.respond(0, id, &read, &unit);
        }
        bench
    }
}

#[test]
fn a_controller_is_recognised_and_gives_its_names() {
    let mut bench = Bench::at_unit(pxr);
    assert!(bench.screen(80, 24).contains("looks like FUJI PXR: 11 of 11 probes fit"), "{}", bench.screen(80, 24));
    bench.keys("⏎");
    let read = bench.answer(1, |address| pxr(Table::Input, address));
    assert_eq!((read.spans[0].table, read.spans[0].address), (Table::Input, 1000), "it goes to the first name");
    let shown = bench.screen(120, 24);
    assert!(shown.contains("PV  69.6 °C") && shown.contains("MV  45.00 %"), "{shown}");
    assert!(shown.contains("names of FUJI PXR"), "{shown}");
}

#[test]
fn what_fits_no_signature_is_said_as_not_recognised() {
    for unit in [&|_, _| None, &|_, _| Some(0), &|_, address| Some(address)] as [&dyn Fn(Table, u16) -> Option<u16>; 3]
    {
        let mut bench = Bench::at_unit(unit);
        assert!(bench.screen(80, 24).contains("not recognised"), "{}", bench.screen(80, 24));
        bench.keys("⏎");
        assert!(bench.model.tabs.registers.names.is_empty());
    }
}

#[test]
fn a_number_whose_decimals_are_not_known_is_shown_raw() {
    let mut bench = Bench::at_unit(|table, address| pxr(table, address).filter(|_| address != 1019));
    assert!(bench.screen(80, 24).contains("10 of 11"));
    bench.keys("⏎");
    bench.answer(1, |address| pxr(Table::Input, address));
    assert!(bench.screen(120, 24).contains("PV  696 raw"), "{}", bench.screen(120, 24));
}

#[test]
fn each_unit_has_names_of_its_own() {
    let mut bench = Bench::at_unit(pxr);
    bench.keys("⏎U2⏎");
    assert!(bench.model.tabs.registers.names.is_empty());
    bench.keys("U1⏎");
    assert!(!bench.model.tabs.registers.names.is_empty());
}
