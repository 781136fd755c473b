//! Numbers that are typed: what is written, rounded or refused.

use super::*;

#[test]
fn a_number_is_written_only_after_enter() {
    let fixture = Fixture::normal();
    let mut model = model(&fixture, Theme::FULL);
    assert_eq!(type_keys(&mut model, "s65.5"), []);
    let effects = type_keys(&mut model, "⏎");
    assert_eq!(sent_kind(&effects), Some(&CommandKind::Write { tag: fixture.tag("TIC-1.SV"), value: 65.5.into() }));
    assert_eq!(model.modal, None);
    assert!(screen(&mut model, 80, 24).contains("TIC-1.SV ? → 65.5 °C  sent"));
}

#[test]
fn what_is_typed_is_what_is_written_or_refused() {
    let fixture = Fixture::normal();
    let check = |keys: &str, expect: Result<f64, &str>| {
        let mut model = model(&fixture, Theme::FULL);
        let command = sent_kind(&type_keys(&mut model, keys)).cloned();
        let shown = screen(&mut model, 80, 24);
        match expect {
            Ok(value) => {
                assert_eq!(
                    command,
                    Some(CommandKind::Write { tag: fixture.tag("TIC-1.SV"), value: value.into() }),
                    "{keys}"
                )
            }
            Err(words) => {
                assert_eq!(command, None, "{keys}");
                assert!(shown.contains(words), "{words} is missing:\n{shown}");
            }
        }
    };
    check("s63,5⏎", Ok(63.5));
    check("s+1⏎", Ok(71.0));
    check("s+5⏎", Err("beyond the alarm limit of TIC-1.PV temperature high (72.0 °C)"));
    check("s3,5⏎", Err("a change of 66.5 °C, 55 % of the range"));
    check("s3,5⏎⏎", Ok(3.5));
    check("s7OO", Err("\"O\" is not part of a number"));
    check("s7OO⏎", Err("the text was cut"));
    check("s1e5⏎", Err("the text was cut"));
    check("s7 0", Err("a space is not part of a number"));
    check("s7-0⏎", Err("\"7-0\" is not a number"));
    check(&format!("s{}⏎", "7".repeat(70)), Err("the text was cut"));
}

#[test]
fn what_was_seen_is_sent_though_values_become_uncertain() {
    let fixture = Fixture::normal();
    let mut model = model(&fixture, Theme::FULL);
    type_keys(&mut model, "s65.5");
    update(&mut model, Msg::Tick { silent: Duration::from_secs(4) });
    let effects = type_keys(&mut model, "⏎");
    let seen = effects.iter().find_map(|effect| match effect {
        Effect::Command(command, _) => Some(command.expected_value),
        _ => None,
    });
    assert_eq!(seen, Some(Some(70.0.into())), "the window showed `old 70.0`");
}

#[test]
fn a_rounded_number_is_shown_rounded_before_it_is_written() {
    let mut fixture = Fixture::normal();
    let sv = fixture.tag("TIC-1.SV");
    fixture.def.tags[sv.index()].scale = 0.5;
    let mut model = model(&fixture, Theme::FULL);
    assert_eq!(sent_kind(&type_keys(&mut model, "s72.3⏎")), None);
    let shown = screen(&mut model, 80, 24);
    assert!(shown.contains("72.3 → the resolution of the device is 0.5: 72.5"), "{shown}");
    assert!(shown.contains("new 72.5 °C"), "{shown}");
    assert_eq!(sent_kind(&type_keys(&mut model, "⏎")), Some(&CommandKind::Write { tag: sv, value: 72.5.into() }));
}
