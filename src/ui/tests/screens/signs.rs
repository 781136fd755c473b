//! States and qualities have signs, words and colours; nothing old is left on the screen.

use super::*;

#[test]
fn without_colour_a_little_liquid_is_seen() {
    for (glyphs, shallow, body) in [(Glyphs::Braille, '░', '▒'), (Glyphs::Block, '░', '▒'), (Glyphs::Ascii, ':', '#')]
    {
        let theme = Theme { glyphs, motion: false, ..Theme::PLAIN };
        let liquid = |level: f64| {
            let mut fixture = Fixture::normal();
            for tank in ["PLC-1.LT-1", "PLC-1.TK-2", "PLC-1.TK-3"] {
                fixture.set(tank, 0.0);
            }
            fixture.set("PLC-1.LT-1", level);
            let shown = screen(&mut model(&fixture, theme), 80, 24);
            let bottom = shown.lines().nth(16).unwrap_or_default().to_owned();
            bottom.chars().skip(16).take(15).filter(|c| *c == shallow || *c == body).count()
        };
        assert_eq!(liquid(0.0), 0, "{glyphs:?}");
        assert!(liquid(0.3) > 2, "{glyphs:?}: a little beside the heater's words");
        assert!(liquid(8.0) > 2, "{glyphs:?}: liquid behind the heater's words");
    }
}

#[test]
fn without_colour_every_state_and_quality_looks_different() {
    let theme = Theme { motion: false, ..Theme::PLAIN };
    let mut looks = HashSet::new();
    let mut states = 0;
    for priority in [Priority::Critical, Priority::High, Priority::Medium, Priority::Low] {
        for state in [AlarmState::Unacknowledged, AlarmState::Acknowledged, AlarmState::ReturnedToNormal] {
            let mut fixture = Fixture::alarm();
            fixture.alarms.truncate(1);
            fixture.alarms[0].state = state;
            fixture.def.alarms[0].priority = priority;
            let mut model = model(&fixture, theme);
            model.tabs.shown = Tab::Alarms;
            let buffer = draw(&mut model, 80, 24);
            assert!(
                buffer
                    .content
                    .iter()
                    .all(|cell| cell.fg == ratatui::style::Color::Reset && cell.bg == ratatui::style::Color::Reset)
            );
            looks.insert(text(&buffer));
            states += 1;
        }
    }
    assert_eq!(looks.len(), states, "two alarm states look the same in plain text");
    let good = Fixture::normal();
    let at = fixture::now();
    let looks: HashSet<String> = Cause::ALL
        .into_iter()
        .flat_map(|cause| [Sample::bad(cause, at), Sample::good(64.2, at).uncertain(cause)])
        .chain([Sample::good(64.2, at)])
        .map(|sample| {
            let mut fixture = good.clone();
            let pv = fixture.tag("TIC-1.PV");
            fixture.samples[pv.index()] = sample;
            let mut model = model(&fixture, theme);
            model.modal = modal::Faceplate::new("PV", vec![pv]).map(Modal::Faceplate);
            let shown = screen(&mut model, 80, 24);
            let word = match sample.quality {
                Quality::Good => "good",
                Quality::Uncertain(_) => "uncertain: ",
                Quality::Bad(_) => "bad: ",
            };
            assert!(shown.contains(&format!("quality  {word}")), "{shown}");
            shown
        })
        .collect();
    assert_eq!(looks.len(), 2 * Cause::ALL.len() + 1, "two qualities look the same in plain text");
}

#[test]
fn a_silent_station_is_believed_no_more() {
    let fixture = Fixture::normal();
    let mut model = model(&fixture, Theme::FULL);
    update(&mut model, Msg::Tick { silent: Duration::from_secs(2) });
    assert!(screen(&mut model, 80, 24).contains("64.2 °C"));
    update(&mut model, Msg::Tick { silent: Duration::from_secs(7) });
    let shown = screen(&mut model, 80, 24);
    assert!(
        shown.contains("STATION SILENT 00:07") && shown.contains("64.2? °C 7s") && !shown.contains("64.2 °C"),
        "{shown}"
    );
    assert!(!shown.contains('█'), "no picture without a good value:\n{shown}");
    update(&mut model, Msg::Snapshot(fixture.snapshot()));
    assert!(screen(&mut model, 80, 24).contains("64.2 °C"));
}

#[test]
fn trouble_of_the_store_is_in_the_header() {
    let mut snapshot = Arc::unwrap_or_clone(Fixture::normal().snapshot());
    snapshot.history.lost = 12;
    snapshot.history.trouble = Some("disk full".to_owned());
    snapshot.speed = 60.0;
    let mut model = Model::new(Arc::new(snapshot), Theme::FULL, 1, crate::ui::fixture::session());
    let shown = screen(&mut model, 120, 40);
    let header = shown.lines().next().unwrap_or_default();
    for words in ["history: see 3", "12 records lost", "speed ×60"] {
        assert!(header.contains(words), "{header}");
    }
    assert!(shown.lines().nth(2).is_some_and(|banner| banner.contains("history: disk full")), "{shown}");
    let mut alarm = Arc::unwrap_or_clone(Fixture::alarm().snapshot());
    alarm.history.trouble = Some("the disk is full and nothing has been written since 13:10, ".repeat(2));
    let mut model = Model::new(Arc::new(alarm), Theme::FULL, 1, crate::ui::fixture::session());
    model.tabs.shown = Tab::Alarms;
    let shown = screen(&mut model, 80, 24);
    assert!(shown.lines().nth(2).is_some_and(|banner| banner.contains("temperature high")), "the alarm first: {shown}");
    assert!(shown.lines().nth(4).is_some_and(|row| row.contains("history: the disk is full")), "{shown}");
    assert!(shown.lines().nth(5).is_some_and(|row| row.trim_end().ends_with("13:10,")), "whole: {shown}");
}

#[test]
fn only_unacknowledged_alarms_flash() {
    for (state, flashes) in
        [(AlarmState::Unacknowledged, true), (AlarmState::Acknowledged, false), (AlarmState::ReturnedToNormal, false)]
    {
        let mut fixture = Fixture::alarm();
        fixture.alarms.truncate(1);
        fixture.alarms[0].state = state;
        let mut model = model(&fixture, Theme { motion: false, ..Theme::FULL });
        model.tabs.shown = Tab::Alarms;
        let first = draw(&mut model, 80, 24);
        model.clock.phase += 2;
        let second = draw(&mut model, 80, 24);
        assert_eq!(first != second, flashes, "{state:?}");
    }
}
