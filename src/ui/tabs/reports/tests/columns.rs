//! The columns of the figures on a narrow screen.

use super::*;

#[test]
fn a_narrow_screen_says_that_there_are_more_columns() {
    let mut stand = Stand::new(Theme::FULL, 60, 20);
    stand.answer(true);
    let shown = stand.screen();
    assert!(shown.contains("c 1/2") && shown.contains("mean/+") && !shown.contains("in alarm"), "{shown}");
    stand.press("c");
    let shown = stand.screen();
    assert!(shown.contains("c 2/2") && shown.contains("in alarm") && shown.contains("good"), "{shown}");
    assert!(shown.contains("98.9 %"), "{shown}");
    let mut stand = Stand::new(Theme::FULL, 80, 24);
    stand.answer(true);
    let shown = stand.screen();
    assert!(!shown.contains("c 1/2") && shown.contains("min") && shown.contains("in alarm"), "{shown}");
}

#[test]
fn no_size_is_too_small_to_survive() {
    for (width, height) in
        (0..40).flat_map(|width| (0..20).map(move |height| (width, height))).chain([(200, 60), (80, 12)])
    {
        let mut stand = Stand::new(Theme::FULL, width, height);
        stand.terminal();
        stand.answer(true);
        stand.press("↓↓↓↓↓e");
        assert_eq!(stand.terminal().backend().buffer().area.width, width);
    }
}
