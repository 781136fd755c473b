//! What becomes of orders that do not reach the plant: whoever gave them is told.

use super::*;
use crate::plant::def::ActionDef;

impl Bench {
    /// The orders of a terminal that did not reach the plant, and why.
    fn undelivered(&self, terminal: u32) -> Vec<(u32, String)> {
        let told = self.access.standing(terminal, self.now).undelivered;
        told.iter().map(|(id, why)| (id.number, why.to_string())).collect()
    }
}

#[test]
fn an_order_with_the_number_of_an_earlier_one_is_not_carried_out_and_its_terminal_is_told() {
    let mut bench = Bench::new(AccessDef::default());
    bench.open(1, "a");
    bench.login(1, "boss", BOSS).unwrap();
    bench.last_order = 6;
    assert_eq!(bench.order(1, RUN, None).unwrap().1, None);
    for last in [6, 3] {
        bench.last_order = last;
        assert!(bench.order(1, RUN, None).is_none(), "number {} came after 7", last + 1);
    }
    let told = bench.undelivered(1);
    assert_eq!(told.iter().map(|(number, _)| *number).collect::<Vec<_>>(), [7, 4]);
    assert!(told[0].1.contains("number of an earlier one"));
    bench.open(2, "b");
    bench.login(2, "boss", BOSS).unwrap();
    bench.last_order = 6;
    assert_eq!(bench.order(2, RUN, None).unwrap().1, None, "each terminal counts for itself");
}

#[test]
fn every_order_of_a_terminal_that_asks_too_fast_reaches_the_plant_or_is_told_to_it() {
    let mut bench = Bench::new(AccessDef::default());
    bench.open(1, "a");
    // Nobody is logged in: 20 refusals, the coming among them, are on record, the next ones are only told, and from the 41st
    // request on it is too many.
    let reached = (0..60).filter(|_| bench.order(1, RUN, None).is_some()).count();
    let told = bench.undelivered(1);
    assert_eq!((reached, told.len()), (19, 41));
    assert_eq!(told[0], (20, "log in first".to_owned()));
    assert_eq!(told[40], (60, TOO_MANY.to_owned()));
    for _ in 0..1_000 {
        bench.order(1, RUN, None);
    }
    assert_eq!(bench.undelivered(1).len(), 64, "only the latest are remembered");
}

#[test]
fn a_stop_is_never_one_request_too_many() {
    let mut bench = Bench::new(AccessDef::default());
    let mut def = PlantDef::clone(&bench.access.def);
    let device = def.tag(fixture::RUN).device.index();
    let (name, confirm, settle) = ("STOP".into(), String::new(), Duration::ZERO);
    let stop = ActionDef { name, confirm, settle, tag: fixture::RUN, value: 0.0, stop: true, saves: false };
    def.devices[device].actions.push(stop);
    bench.access.def = Arc::new(def);
    bench.open(1, "a");
    bench.login(1, "tech", TECH).unwrap();
    for _ in 0..100 {
        bench.order(1, RUN, None);
    }
    assert!(bench.order(1, RUN, None).is_none());
    let off = CommandKind::Write { tag: fixture::RUN, value: 0.0 };
    assert_eq!(bench.order(1, off, None).unwrap().1, None);
}
