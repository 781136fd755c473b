//! Pens from any tag, and their scales.

use super::*;

#[test]
fn marked_values_are_drawn_together() {
    let mut stand = Stand::new(Theme::FULL, 120, 40);
    stand.answer();
    stand.press("/");
    stand.press("p-1⏎");
    stand.answer();
    let listed = |stand: &Stand| stand.model.tabs.trends.values.rows(&stand.model.cx()).len();
    assert!(stand.screen().contains("\"p-1\""), "the filter is shown");
    let found = listed(&stand);
    stand.press("/");
    stand.press("xyz⏎");
    assert_eq!(listed(&stand), 0);
    stand.press("⏎w ");
    assert!(stand.model.tabs.trends.values.of.picked.is_empty(), "nothing to mark");
    stand.send(Msg::Key(KeyEvent::new(KeyCode::Esc, KeyModifiers::NONE)));
    assert!(listed(&stand) > found, "Esc takes the filter away");
    stand.press(" ↓↓↓ ⏎");
    stand.answer();
    let screen = stand.screen();
    assert!(screen.contains("marked group 3/3"), "{screen}");
    assert_eq!(stand.model.tabs.trends.pens(&stand.model.cx()).len(), 2);
    stand.press("v↓↓ ");
    stand.press("⏎");
    assert_eq!(stand.model.tabs.trends.pens(&stand.model.cx()).len(), 3, "a third pen joins them");
}

#[test]
fn a_value_opened_alone_leaves_the_marked_ones() {
    let mut stand = Stand::new(Theme::FULL, 120, 40);
    stand.answer();
    let def = stand.model.snapshot.def.clone();
    let drawn = |tag: TagId| def.trends.iter().any(|group| group.pens.iter().any(|pen| pen.tag == tag));
    let free: Vec<TagId> = def.tags.iter().map(|tag| tag.id).filter(|tag| !drawn(*tag)).collect();
    let cx = stand.model.cx();
    let mut trends: Trends = TabView::new(&stand.model.snapshot);
    trends.values.of.picked = free[..2].to_vec();
    trends.open_tag(&cx, free[2]);
    assert_eq!(trends.pens(&cx).iter().map(|pen| pen.tag).collect::<Vec<_>>(), free[2..3]);
    assert_eq!(trends.values.of.picked, free[..2]);
    trends.open_value(&cx, free[1]);
    assert_eq!(trends.pens(&cx).len(), 2, "both marked ones");
}

#[test]
fn a_typed_scale_says_where_the_curve_lies() {
    let mut stand = Stand::new(Theme::FULL, 80, 24);
    stand.answer();
    let scale = |stand: &mut Stand, text: &str| {
        stand.press("s");
        for _ in 0..20 {
            stand.send(Msg::Key(KeyEvent::new(KeyCode::Backspace, KeyModifiers::NONE)));
        }
        stand.press(text);
        stand.press("⏎");
    };
    scale(&mut stand, "80 90");
    let screen = stand.screen();
    assert!(screen.contains("↓") && screen.contains("90┤") && !screen.contains("75┤"), "{screen}");
    scale(&mut stand, "90 80");
    assert!(stand.screen().contains("the lower first"));
    stand.send(Msg::Key(KeyEvent::new(KeyCode::Esc, KeyModifiers::NONE)));
    scale(&mut stand, "own");
    let screen = stand.screen();
    assert!(screen.contains("● °C") && screen.contains("scale 0 … 100"), "{screen}");
    scale(&mut stand, "plant");
    assert!(stand.screen().contains("100┤"));
}

#[test]
fn large_numbers_are_good_numbers() {
    let blocks = |screen: &str| screen.lines().skip(5).any(|row| row.contains('█') || row.contains('▀'));
    for (width, height) in [(60, 20), (80, 24), (120, 40), (160, 50)] {
        let mut stand = Stand::new(Theme::FULL, width, height);
        stand.press("B");
        let screen = stand.screen();
        assert!(blocks(&screen), "{width}x{height}:\n{screen}");
        assert!(screen.contains("TIC-1.PV  process value") && screen.contains("RUN   good"), "{screen}");
        let more = screen.lines().find(|row| row.contains("enlarge")).unwrap_or_default();
        assert!(!more.contains("TIC-1"), "the names of the pens are beside nothing else: {more}");
        let mut bad = Fixture::line_down();
        let tags: Vec<String> = bad.def.tags.iter().map(|tag| tag.name.clone()).collect();
        for name in tags {
            let tag = bad.tag(&name);
            bad.samples[tag.index()] = bad.samples[tag.index()].uncertain(crate::plant::sample::Cause::Stale);
        }
        stand.send(Msg::Snapshot(bad.snapshot()));
        let screen = stand.screen();
        assert!(!blocks(&screen) && screen.contains("64.2?"), "{width}x{height}:\n{screen}");
    }
    let mut stand = Stand::new(Theme::FULL, 160, 50);
    stand.press("B");
    insta::assert_snapshot!(stand.screen());
}

#[test]
fn a_trend_that_is_opened_leaves_the_marked_pens() {
    let mut stand = Stand::new(Theme::FULL, 120, 40);
    stand.answer();
    stand.press("v ↓ ");
    let marked = stand.model.tabs.trends.values.of.picked.clone();
    let of_group = |tag: &TagId| {
        let groups = &stand.model.snapshot.def.trends;
        groups.iter().any(|group| group.pens.iter().any(|pen| pen.tag == *tag))
    };
    let other = stand.model.snapshot.def.tags.iter().map(|tag| tag.id).find(|tag| !of_group(tag)).expect("a tag");
    let model = &mut stand.model;
    crate::ui::model_context::with_tabs(model, |tabs, cx| {
        tabs.trends.open_tag(cx, other);
    });
    let pens = |stand: &Stand| {
        let pens = stand.model.tabs.trends.pens(&stand.model.cx());
        pens.into_iter().map(|pen| pen.tag).collect::<Vec<_>>()
    };
    assert_eq!((pens(&stand), &stand.model.tabs.trends.values.of.picked), (vec![other], &marked));
    stand.press("ggg");
    assert_eq!(pens(&stand), marked, "the marked ones are a group again");
}

#[test]
fn no_number_of_the_legend_is_cut() {
    for width in [60, 62, 64, 80] {
        let mut stand = Stand::new(Theme::FULL, width, 20);
        stand.gap = (ago(300), ago(180));
        stand.answer();
        for figures in stand.model.tabs.trends.figures.values_mut() {
            *figures = (Some((123_456.7.into(), 1_234_567.8.into(), (-1_234_567.8).into())), 1.0);
        }
        let screen = stand.screen();
        let row = screen.lines().find(|row| row.contains("TIC-1.SV")).unwrap_or_default();
        assert!(row.contains(" ##      ##") && row.contains("100 %"), "{width}: {row}");
    }
}

#[test]
fn no_number_of_the_list_of_values_is_cut_at_60_columns() {
    let mut stand = Stand::new(Theme::FULL, 60, 20);
    stand.press("v");
    stand.answer();
    let values = &stand.model.tabs.trends.values.answered.value;
    let (_, _, max) = values.iter().flatten().find_map(|series| series.summary).expect("answered");
    let (screen, max) = (stand.screen(), stand.model.snapshot.format(TagId(0), max));
    let row = screen.lines().find(|line| line.contains("▸  TIC-1.PV")).expect("the first value");
    assert!(row.split([' ', '"']).any(|word| word == max), "{max} in {row}");
    assert!(screen.contains("1 h max"), "{screen}");
}

#[test]
fn a_label_of_the_list_takes_what_its_value_leaves() {
    let mut stand = Stand::new(Theme::FULL, 80, 24);
    stand.press("v");
    stand.answer();
    let screen = stand.screen();
    let row = screen.lines().find(|row| row.contains("PLC-1.LEFT")).unwrap_or_default();
    assert!(row.contains("seconds left in step "), "{screen}");
}
