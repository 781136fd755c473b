//! The action as a checklist, in the window of the guidance and beside the list.

use super::*;

fn step_of(effects: &[Effect]) -> Option<(u8, bool)> {
    match sent_kind(effects)? {
        CommandKind::Alarm(AlarmCommand::Tick { step, done, .. }) => Some((*step, *done)),
        _ => None,
    }
}

#[test]
fn space_ticks_the_steps_of_the_action() {
    let mut fixture = Fixture::alarm();
    let done = OperatorNote {
        at: now() - SignedDuration::from_secs(20),
        by: Some("anna".into()),
        reason: Some("lower SV or stop".into()),
        recorded: true,
    };
    let mut model = model(&fixture, Theme::FULL);
    model.tabs.shown = Tab::Alarms;
    screen(&mut model, 80, 24);
    type_keys(&mut model, "⏎");
    assert_eq!(step_of(&type_keys(&mut model, " ")), Some((0, true)));
    assert_eq!(step_of(&type_keys(&mut model, " ")), Some((1, true)), "the next one");
    assert!(model.modal.is_some(), "the window stays");

    fixture.alarms[0].steps = vec![done];
    let mut model = super::model(&fixture, Theme::FULL);
    model.tabs.shown = Tab::Alarms;
    let shown = screen(&mut model, 160, 50);
    assert!(shown.contains("[x] lower SV or stop") && shown.contains("[_] check SSR lamp"), "{shown}");
    screen(&mut model, 80, 24);
    type_keys(&mut model, "⏎");
    let shown = screen(&mut model, 80, 24);
    assert!(shown.contains("▸ [x] lower SV or stop (anna 14:02:11)"), "{shown}");
    assert!(shown.contains("[_] check SSR lamp") && shown.contains("Space tick"), "{shown}");
    assert_eq!(step_of(&type_keys(&mut model, " ")), Some((0, false)), "a tick can be taken back");
}

#[test]
fn a_viewer_reads_why_nothing_is_ticked() {
    let mut model = model(&Fixture::alarm(), Theme::FULL);
    model.session = Arc::new(crate::access::SessionStatus { may_view: true, ..Default::default() });
    model.tabs.shown = Tab::Alarms;
    screen(&mut model, 80, 24);
    type_keys(&mut model, "⏎");
    assert_eq!(type_keys(&mut model, " "), Vec::new());
    assert!(screen(&mut model, 80, 24).contains("needs Technician"));
}
