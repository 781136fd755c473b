//! The widths of the list's columns.

use super::*;
use crate::plant::def::Subject;

#[test]
fn a_status_word_is_shown_in_words_where_there_is_room() {
    let mut fixture = Fixture::alarm();
    let id = fixture.alarms[0].id;
    let Subject::Tag(tag) = fixture.def.alarm(id).subject else { panic!("it watches a tag") };
    fixture.def.tags[tag.index()].bit_labels = vec![(1, "input open".into()), (3, "low".into())];
    fixture.def.tags[tag.index()].unit.clear();
    fixture.samples[tag.index()].value = Some(10.0);
    fixture.alarms[0].value = Some(10.0.into());
    let mut model = model(&fixture, Theme::FULL);
    type_keys(&mut model, "3");
    let shown = screen(&mut model, 160, 50);
    assert!(shown.lines().any(|line| line.contains("■") && line.contains("input open, low")), "{shown}");
    assert!(shown.contains("raised at") && !shown.contains("raised at 10"), "{shown}");
}

#[test]
fn the_alarm_that_every_page_names_is_in_the_list_that_opens() {
    let mut fixture = Fixture::normal();
    let system = &mut fixture.def.alarms[3];
    (system.class, system.priority) = (AlarmClass::System, Priority::Low);
    let id = system.id;
    fixture.alarms = vec![ActiveAlarm::new(id, AlarmState::Unacknowledged, ago(30))];
    let message = fixture.def.alarm(id).message.clone();
    for (width, height) in [(80, 24), (120, 40)] {
        let mut model = model(&fixture, Theme::FULL);
        type_keys(&mut model, "3");
        let shown = screen(&mut model, width, height);
        let rows = shown.lines().skip(4).filter(|row| row.contains(&message)).count();
        assert!(1 <= rows && shown.contains("active 1 (1"), "{shown}");
    }
}
