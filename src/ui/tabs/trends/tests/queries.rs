//! Which queries the trends ask, and which answers count.

use super::*;

/// Which queries are on their way, by what they ask about.
pub(super) fn kinds(asked: &[(QueryId, Query)]) -> String {
    let kind = |query: &Query| match query {
        Query::Series { buckets: HOUR_COLUMNS, .. } => "hour",
        Query::Series { .. } => "curves",
        Query::Journal { .. } => "alarms",
        Query::Actions { .. } => "actions",
        Query::Batches { .. } => "batches",
        Query::Audit { .. }
        | Query::LineMinutes { .. }
        | Query::Report { .. }
        | Query::AlarmMetrics { .. }
        | Query::Values { .. }
        | Query::ControlRuns { .. }
        | Query::SampleTime { .. }
        | Query::Reports { .. }
        | Query::Past { .. }
        | Query::Samples { .. }
        | Query::Unarchived { .. }
        | Query::Overview
        | Query::Registers(_) => "other",
    };
    asked.iter().map(|(_, query)| kind(query)).collect::<Vec<_>>().join(" ")
}

#[test]
fn nothing_is_asked_while_the_tab_is_not_shown() {
    let mut stand = Stand::new(Theme::FULL, 80, 24);
    assert_eq!(kinds(&stand.asked), "curves alarms actions batches hour");
    stand.answer();
    stand.press("1");
    stand.live(120, |_| Some(60.0));
    assert_eq!(kinds(&stand.asked), "");
    stand.press("2");
    assert_eq!(kinds(&stand.asked), "curves alarms actions batches hour");
}

#[test]
fn an_answer_to_an_older_question_is_ignored() {
    let mut stand = Stand::new(Theme::FULL, 80, 24);
    let old = std::mem::take(&mut stand.asked);
    stand.press("+");
    stand.live(20, |_| Some(60.0));
    assert_eq!(kinds(&stand.asked), "curves alarms actions batches", "the answers are overdue, and to another view");
    let before = stand.screen();
    for (id, query) in old.into_iter().take(2) {
        let answer = stand.history(&query);
        stand.send(Msg::Answer(id, Ok(answer)));
    }
    assert_eq!(stand.screen(), before);
    stand.answer();
    assert_ne!(stand.screen(), before);
}

#[test]
fn a_late_answer_is_waited_for_and_shown() {
    let mut stand = Stand::new(Theme::FULL, 80, 24);
    let asked = std::mem::take(&mut stand.asked);
    stand.live(40, |_| Some(60.0));
    assert_eq!(kinds(&stand.asked), "", "not asked again while the history is busy with it");
    let before = stand.screen();
    for (id, query) in asked {
        let answer = stand.history(&query);
        stand.send(Msg::Answer(id, Ok(answer)));
    }
    assert_ne!(stand.screen(), before);
}

#[test]
fn fast_keys_do_not_pile_up_questions() {
    let mut stand = Stand::new(Theme::FULL, 80, 24);
    stand.answer();
    stand.press("--++--←←←←");
    assert_eq!(kinds(&stand.asked), "curves alarms actions batches");
    stand.answer();
    let view = stand.model.tabs.trends.span(&stand.model.cx());
    let shown = stand.model.tabs.trends.traces[&TagId(0)].past().map(|series| series.from);
    assert_eq!(shown, Some(view.from), "the last view is asked for in the end");
}

#[test]
fn live_values_are_on_the_screen_before_the_history_has_them() {
    let mut stand = Stand::new(Theme::FULL, 80, 24);
    stand.answer();
    stand.press("+++");
    stand.live(20, |second| if (8..12).contains(&second) { None } else { Some(90.0) });
    let cx = stand.model.cx();
    let trace = &stand.model.tabs.trends.traces[&TagId(0)];
    assert_eq!(trace.value_at(cx.now), Some(90.0.into()));
    assert_eq!(trace.value_at(ago(-9)), None, "no answer is a gap");
    insta::assert_snapshot!(stand.screen());
}

#[test]
fn trouble_of_the_history_is_reported() {
    let mut stand = Stand::new(Theme::FULL, 80, 24);
    let (id, _) = stand.asked[0].clone();
    stand.send(Msg::Answer(id, Err(HistoryError::Engine("disk full".to_owned()))));
    for keys in ["", "m", "m←", "v"] {
        stand.press(keys);
        assert!(stand.screen().contains("history: disk full"), "{}", stand.screen());
    }
    stand.press("vl");
    stand.live(5, |_| Some(60.0));
    stand.answer();
    assert!(!stand.screen().contains("disk full"));
}
