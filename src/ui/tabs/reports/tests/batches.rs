//! Where the keys of a batch lead.

use super::*;
use crate::plant::{batch::BatchDef, expr::Expr};

#[test]
fn the_curves_of_a_running_batch_reach_the_present() {
    let mut fixture = Fixture::normal();
    let (tags, never) = (vec![fixture.def.trends[0].pens[0].tag], Expr::Number(0.0));
    let (name, start, end) = ("hot-water".into(), never.clone(), never);
    fixture.def.batches.push(BatchDef { name, start, end, phase: None, energy: None, tags });
    let mut stand = Stand::of(&fixture, Theme::FULL, 80, 24);
    stand.press("b");
    stand.answer(true);
    let snapshot = fixture.snapshot();
    let at = snapshot.at + SignedDuration::from_mins(15);
    stand.send(Msg::Snapshot(Arc::new(Snapshot { at, ..(*snapshot).clone() })));
    for (keys, past) in [("t", false), ("5↓t", true)] {
        stand.press(keys);
        assert_eq!((stand.model.tabs.shown, stand.screen().contains(" past ")), (Tab::Trends, past), "{keys}");
    }
}
