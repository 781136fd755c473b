//! Pages of tabs in the past, and what the mimic marks there.

use super::*;

#[test]
fn escape_closes_the_page_before_the_past() {
    let mut model = replayed(&Fixture::alarm(), Tab::Controllers);
    type_keys(&mut model, "h");
    let guide = screen(&mut model, 80, 24);
    assert!(guide.contains("Esc back") && !guide.contains("Esc present"), "{guide}");
    type_keys(&mut model, "⎋⏎");
    let device = screen(&mut model, 80, 24);
    assert!(device.contains("Esc back"), "{device}");
    type_keys(&mut model, "⎋");
    assert!(screen(&mut model, 80, 24).contains("Esc present"));
    assert_eq!(shown_at(&model), Some(ago(600)));
    type_keys(&mut model, "⎋");
    assert_eq!(shown_at(&model), None);
}

#[test]
fn the_past_has_the_marks_of_its_actuators() {
    let mut fixture = Fixture::normal();
    for (tag, value) in [("PLC-1.AUTO", 0.0), ("PLC-1.MAN.P-1", 1.0), ("PLC-1.TK-2", 19.5)] {
        fixture.set(tag, value);
    }
    for (stored, blocked, expect) in [(60, false, Some("≠ not ON")), (0, false, None), (60, true, Some("⊘ blocked"))]
    {
        fixture.set("PLC-1.TK-2", if blocked { 19.5 } else { 9.5 });
        fixture.set("PLC-1.MAN.P-1", if blocked { 0.0 } else { 1.0 });
        let at = ago(600);
        let samples =
            fixture.samples.iter().map(|sample| crate::plant::sample::Sample { at: ago(600 + stored), ..*sample });
        let past = Past { at, samples: samples.collect(), events: Vec::new(), minutes: vec![None] };
        let mut model = model(&Fixture::normal(), Theme::FULL);
        let effects = type_keys(&mut model, "@-10m⏎");
        answer(&mut model, asked(&effects)[0].0, Ok(Answer::Past(Box::new(past))));
        let shown = screen(&mut model, 80, 24);
        let found = ["≠ not ON", "⊘ blocked"].into_iter().find(|mark| shown.contains(mark));
        assert_eq!(found, expect, "{stored}:\n{shown}");
    }
}
