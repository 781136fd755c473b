//! Parameter sets: what is compared, asked, written and saved.

use super::*;

/// The restore that these keys command.
pub(super) fn restored(model: &mut Model, keys: &str) -> Option<RestoreRequest> {
    match sent_kind(&type_keys(model, keys)) {
        Some(CommandKind::Restore(request)) => Some((**request).clone()),
        Some(_) | None => None,
    }
}

#[test]
fn a_set_is_written_after_its_differences_are_confirmed() {
    let fixture = with_sets();
    let mut model = model(&fixture, Theme::FULL);
    assert_eq!(restored(&mut model, "4⏎s↓⏎⏎"), None);
    let request = restored(&mut model, "⏎").expect("it was confirmed");
    let names = request.changes.iter().map(|change| fixture.def.tag(change.tag).short.clone());
    assert_eq!(names.collect::<Vec<_>>(), ["P", "SV-H", "SV"], "the limit before the value that needs it");
}

#[test]
fn a_copy_between_controllers_can_be_turned_around() {
    let mut fixture = many(2);
    fixture.set("TIC-2.P", 9.0);
    let mut model = model(&fixture, Theme::FULL);
    type_keys(&mut model, "4⏎s⏎");
    assert!(screen(&mut model, 80, 24).contains("copy of TIC-2 → TIC-1"));
    type_keys(&mut model, "t");
    assert!(screen(&mut model, 80, 24).contains("copy of TIC-1 → TIC-2"));
    let request = restored(&mut model, "⏎⏎").expect("it was confirmed");
    let written: Vec<_> =
        request.changes.iter().map(|change| (change.tag, change.old.near(), change.new.near())).collect();
    assert_eq!((request.device, written), (DeviceId(1), vec![(fixture.tag("TIC-2.P"), 9.0, 1.2)]));
}

#[test]
fn what_does_not_fit_is_reported_and_cannot_be_written() {
    let mut fixture = many(1);
    fixture.sets = vec![set(&fixture, "winter", &[("SV", 150.0)])];
    let mut model = model(&fixture, Theme::FULL);
    type_keys(&mut model, "4s⏎");
    let shown = screen(&mut model, 80, 24);
    assert!(shown.contains("cannot be written: SV 150 is outside 0 … 120"), "{shown}");
    assert_eq!(restored(&mut model, "⏎⏎"), None);
}

#[test]
fn nothing_is_restored_to_a_device_that_does_not_answer() {
    let mut fixture = trouble(2);
    fixture.sets = vec![set(&fixture, "winter", &[("SV", 80.0)])];
    let mut model = model(&fixture, Theme::FULL);
    assert_eq!(restored(&mut model, "4↓⏎s⏎⏎⏎"), None);
    type_keys(&mut model, "⎋⎋⎋⎋");
    let shown = screen(&mut model, 80, 24);
    assert!(shown.contains("2 devices   1 not responding   1 with alarms"), "{shown}");
}

#[test]
fn a_set_is_saved_by_name_and_replaced_after_a_confirmation() {
    let fixture = with_sets();
    let saved = |keys: &str| {
        let mut model = model(&fixture, Theme::FULL);
        let effects = type_keys(&mut model, &format!("4⏎sn{keys}"));
        let commands = effects.into_iter().filter_map(|effect| match effect {
            Effect::Command(Command { kind: CommandKind::SaveSet { name, replace, .. }, .. }, _) => {
                Some((name.to_string(), replace))
            }
            _ => None,
        });
        (commands.collect::<Vec<_>>(), screen(&mut model, 80, 24))
    };
    assert_eq!(saved("autumn⏎").0, [("autumn".to_owned(), false)]);
    let (commands, shown) = saved("winter⏎");
    assert_eq!(commands, []);
    for words in
        ["The set winter exists already: of TIC-1, profile fixture, saved", "2026-11-21 14:02 by anna. Replace it?"]
    {
        assert!(shown.contains(words), "{words} in {shown}");
    }
    let (commands, shown) = saved("summer⏎");
    assert!(commands.is_empty() && shown.contains("summer.toml exists already and is not a valid set"), "{shown}");
    assert_eq!(saved("winter⏎⏎").0, [("winter".to_owned(), true)]);
    let (commands, shown) = saved("../x⏎");
    assert!(commands.is_empty() && shown.contains("no dot at its beginning"), "{shown}");
}
