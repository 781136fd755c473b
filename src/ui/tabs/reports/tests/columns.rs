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
