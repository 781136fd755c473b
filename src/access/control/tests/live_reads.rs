//! Live reads: where the line is polled, and where it only listens.

use super::*;
use crate::plant::{
    live::{AddressSpan, LiveRead},
    tag::Table,
};

#[test]
fn a_live_read_on_a_listening_line_is_refused() {
    let spans = vec![AddressSpan { table: Table::Holding, address: 0, count: 1 }];
    let read = LiveRead { line: crate::plant::def::LineId(0), unit: 1, spans, not_before: None, relearn: false };
    let query = Query::Registers(read);
    let mut bench = Bench::new(AccessDef::default());
    bench.open(1, "here");
    bench.login(1, "tech", TECH).unwrap();
    assert_eq!(bench.access.may_ask(1, &query, bench.now), Ok(()));
    let mut def = fixture::plant();
    def.lines[0].listens = true;
    bench.access.def = def.into();
    let refused = Err((Refusal::OnlyListens.to_string(), Vec::new()));
    assert_eq!(bench.access.may_ask(1, &query, bench.now), refused);
    bench.request(1, SessionRequest::Lock).unwrap();
    assert!(bench.access.may_ask(1, &query, bench.now).unwrap_err().0.contains("locked"), "the right comes first");
}
