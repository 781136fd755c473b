//! Periods over each other.

use super::*;

/// What curves were asked for: of which tag, from and to.
fn curves(stand: &Stand) -> Vec<(TagId, Timestamp, Timestamp)> {
    let of = |(_, query): &(QueryId, Query)| match query {
        Query::Series { tags, from, to, .. } => Some((tags[0], *from, *to)),
        _ => None,
    };
    stand.asked.iter().filter_map(of).collect()
}

#[test]
fn the_view_lies_over_the_same_time_yesterday() {
    for (name, width, height) in [("overlay_at_80x24", 80, 24), ("overlay_at_160x50", 160, 50)] {
        let mut stand = Stand::new(Theme::FULL, width, height);
        stand.begin = ago(2 * 86_400);
        stand.answer();
        let view = stand.model.tabs.trends.span(&stand.model.cx());
        let day = SignedDuration::from_hours(24);
        stand.press("o⏎");
        let spans = [(TagId(0), view.from, now()), (TagId(0), view.from - day, now() - day)];
        assert_eq!(curves(&stand), spans);
        stand.answer();
        insta::assert_snapshot!(name, stand.screen());
        stand.live(11, |_| Some(60.0));
        assert_eq!(curves(&stand), [spans[0]], "the end of the view was not stored yet, yesterday is known");
        stand.answer();
        stand.live(30, |_| Some(60.0));
        assert_eq!(curves(&stand), [], "now it is");
        stand.answer();
        stand.press("→");
        assert_eq!(curves(&stand).iter().map(|(tag, ..)| *tag).collect::<Vec<_>>(), [TagId(1); 2], "another tag");
        stand.answer();
        stand.press("o");
        assert!(kinds(&stand.asked).starts_with("curves "), "the curves of the view");
    }
}

#[test]
fn what_is_no_period_is_said_in_the_window() {
    let mut stand = Stand::new(Theme::FULL, 80, 24);
    stand.answer();
    stand.press("o!⏎");
    assert!(stand.screen().contains("`!` is not a time: expected"), "{}", stand.screen());
    assert!(stand.model.tabs.trends.overlay.is_none());
}
