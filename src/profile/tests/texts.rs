//! The texts of a plant and of its profiles in other languages.

use super::*;
use crate::text::{Language, of_plant};

const THAI: &str = "[texts.th]\nhot = \"ร้อน\"\n[mimic]";

#[test]
fn texts_of_a_plant_and_of_its_profiles_are_read() {
    let meter = format!("{METER}\n[texts.th]\non = \"เดิน\"\n\"Start?\" = \"เริ่มหรือไม่\"\nhot = \"ไม่ใช้\"\n");
    let (plant, warned) =
        load_warned(PLANT.replacen("[mimic]", THAI, 1).as_bytes(), &meter, PLC).expect("a good plant");
    let thai = |text| plant.texts.within(|| Language::THAI.locale().within(|| of_plant(text).to_owned()));
    assert_eq!(
        ["hot", "on", "Start?", "off"].map(thai),
        ["ร้อน", "เดิน", "เริ่มหรือไม่", "off"],
        "the plant file goes first"
    );
    assert!(!warned.to_string().contains("no text of the plant"), "{warned}");
}

#[test]
fn a_text_that_stands_nowhere_else_is_a_warning() {
    let spelt = PLANT.replacen("[mimic]", &THAI.replace("hot", "hto"), 1);
    let (_, warned) = load_warned(spelt.as_bytes(), METER, PLC).expect("a good plant");
    let text = warned.to_string();
    assert!(text.contains("no text of the plant is `hto`") && text.contains("[small.toml:32:1]"), "{text}");
    assert!(text.contains("`hot`"), "what was probably meant: {text}");
}

#[test]
fn texts_of_no_language_or_of_another_type_are_refused() {
    check("[mimic]", &THAI.replace("texts.th", "texts.thai"), &["unknown language `thai`", "expected one of en, th"]);
    check("[mimic]", &THAI.replace("\"ร้อน\"", "7"), &["[small.toml:32:7]", "a string"]);
    check("[mimic]", &THAI.replace("\"ร้อน\"", "\" \""), &["`hot` has no text in `th`"]);
    check("[mimic]", "[texts]\nth = \"ร้อน\"\n[mimic]", &["expected a table"]);
}
