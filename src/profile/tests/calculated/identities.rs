//! Conditions on what a device says of itself.

use super::super::*;
use crate::plant::{
    expr::{Compare, Expr},
    identity::{IdentityObject, IdentityTest},
};

/// The small plant whose meter has its MODE under a condition, which stands in line 33 from the 9th character on.
fn with(condition: &str) -> Result<PlantDef, Errors> {
    let access = format!("access = \"rw\"\nwhen = {condition}");
    load(PLANT.as_bytes(), &METER.replacen("access = \"rw\"", &access, 1), PLC)
}

#[test]
fn a_tag_may_depend_on_what_its_device_says_of_itself() {
    let test = |name: &str, compare, with: &str| {
        let object = IdentityObject::of(name).expect("an object");
        Expr::Identity(IdentityTest { device: DeviceId(0), object, compare, with: with.to_owned() })
    };
    let revision = test("revision", Compare::AtLeast, "2.10");
    for (condition, expect) in [
        ("'revision >= \"2.10\"'", revision.clone()),
        ("\"revision >= '2.10'\"", revision.clone()),
        ("\"revision>='2.10'\"", revision.clone()),
        ("\"model_name = 'PXR 4'\"", test("model_name", Compare::Equal, "PXR 4")),
        ("\"object_0x80 < 'V3'\"", test("object_0x80", Compare::Below, "V3")),
        (
            "\"revision >= '2.10' and not (product_code != 'A and B')\"",
            Expr::All(vec![revision.clone(), Expr::Not(Box::new(test("product_code", Compare::Differs, "A and B")))]),
        ),
    ] {
        let plant = with(condition).unwrap_or_else(|errors| panic!("{condition}: {errors}"));
        let mode = plant.tags.iter().find(|tag| tag.short == "MODE").expect("it is there");
        assert_eq!(mode.when.as_deref(), Some(&expect), "{condition}");
    }
}

#[test]
fn a_condition_on_nothing_that_a_device_says_is_refused() {
    for (condition, expect) in [
        (
            "\"firmware >= '2.10'\"",
            &["[meter.toml:33:9]", "unknown identification object `firmware`", "object_0xFF"][..],
        ),
        ("\"revisions >= '2.10'\"", &["unknown identification object `revisions`", "did you mean `revision`?"]),
        ("\"object_0x07 = 'A'\"", &["unknown identification object `object_0x07`"]),
        ("\"revision >= 2.10\"", &["[meter.toml:33:9]", "the revision of a device is compared with a text"]),
        ("\"revision >= '2.10b'\"", &["[meter.toml:33:21]", "`2.10b` is not a version", "as \"2.10\""]),
        ("\"revision = 'new'\"", &["`new` is not a version"]),
        ("\"model_name > 'PXR'\"", &["`PXR` is not a version"]),
        ("\"model_name = ' '\"", &["the model_name is compared with nothing", "expected a text"]),
        ("\"revision >= '2.10\"", &["the revision of a device is compared with a text", "with the quotes"]),
        ("\"revision '2.10'\"", &["unknown tag `revision`"]),
        ("\"revision >= '2.10' '3'\"", &["`'3'` is one too many"]),
        ("\"DP >= '2.10'\"", &["`'2.10'` is not a state of D1.DP"]),
    ] {
        let errors = with(condition).expect_err(condition);
        let text = errors.to_string();
        expect.iter().for_each(|piece| assert!(text.contains(piece), "{condition}: no `{piece}` in\n{text}"));
        assert_eq!(errors.count(), 1, "{condition}: {text}");
    }
    check(
        "high = 80.0",
        "high = 80.0\nenabled_when = \"revision >= '2.10'\"",
        &["the revision of a device is not known here", "only in the `when` of a tag"],
    );
}

#[test]
fn a_device_without_function_43_says_nothing_of_itself() {
    let meter = METER.replacen("[limits]", "functions = [3, 6]\n[limits]", 1);
    let meter = meter.replacen("access = \"rw\"", "access = \"rw\"\nwhen = \"revision > '2'\"", 1);
    let text = load(PLANT.as_bytes(), &meter, PLC).expect_err("it is never known").to_string();
    assert!(text.contains("D1 has no function 43") && text.contains("`functions`"), "{text}");
    load(PLANT.as_bytes(), &meter.replacen("[3, 6]", "[3, 6, 43]", 1), PLC).unwrap_or_else(|errors| panic!("{errors}"));
}

#[test]
fn a_tag_of_the_same_name_is_compared_with_numbers() {
    let tag = "\n[[tag]]\nname = \"revision\"\ntable = \"holding\"\naddress = 2000\ntype = \"uint16\"\n";
    let meter = METER.replacen("access = \"rw\"", "access = \"rw\"\nwhen = \"revision >= 210\"", 1) + tag;
    let plant = load(PLANT.as_bytes(), &meter, PLC).unwrap_or_else(|errors| panic!("{errors}"));
    let when = plant.tags.iter().find_map(|tag| tag.when.as_deref()).expect("a condition");
    assert_eq!((when.tags().len(), when.identity_tests().len()), (1, 0));
}
