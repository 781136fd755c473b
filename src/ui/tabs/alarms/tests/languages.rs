//! What is on record is English; what is shown of it is in the language of the terminal.

use super::*;
use crate::{
    text::{Language, translate},
    ui::glyph_filter::cells,
};

#[test]
fn what_failed_is_listed_in_every_language() {
    let rows = vec![
        action(40, "anna", "write", "TIC-1.SV", "failed: response timeout", None),
        action(100, "anna", "write", "TIC-1.P", "verified", None),
        action(110, "anna", "unlock", "TIC-1.DP", "not confirmed: accepted, not read back; for TIC-1.P", None),
    ];
    for language in [Language::ENGLISH, Language::THAI] {
        let mut model = model(&suppressed(), Theme::FULL);
        model.locale = language.locale();
        let effects = type_keys(&mut model, "3V");
        let Some(Effect::Query(id, Query::Actions { .. })) = effects.last() else { panic!("{effects:?}") };
        update(&mut model, Msg::Answer(*id, Ok(Answer::Actions(rows.clone()))));
        let picture = screen(&mut model, 120, 50);
        let at = |text: &str| picture.find(text).unwrap_or_else(|| panic!("no {text} in {picture}"));
        let title = |english| language.locale().within(|| cells(translate(english)).into_owned());
        let [failed, changed] = ["failed in this shift", "changed in this shift"].map(title);
        assert!(at(&failed) < at("TIC-1.SV ") && at("TIC-1.SV ") < at(&changed), "{picture}");
        assert!(at(&changed) < at("TIC-1.P ") && at(&changed) < at("TIC-1.DP"), "{picture}");
        assert_eq!(picture.contains("verified"), language == Language::ENGLISH, "{picture}");
    }
}
