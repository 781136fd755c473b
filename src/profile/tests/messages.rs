//! How problems are reported, whatever the file.

use super::*;

#[test]
fn a_file_that_is_no_toml_is_not_taken_for_a_wrong_one() {
    let check = |bytes: &[u8], expect: &[&str]| {
        let text = load(bytes, METER, PLC).expect_err("it is no plant").to_string();
        for piece in expect {
            assert!(text.contains(piece), "no `{piece}` in\n{text}");
        }
    };
    check(b"", &["small.toml is empty"]);
    check(b"# nothing\n\n", &["small.toml is empty"]);
    check(b"title = \"K\xE4se\"\n", &["small.toml is not UTF-8", "[small.toml:1:11]", "byte 0xE4"]);
    check(b"title = \"a\"\nline = [\n", &["small.toml:2:", "TOML syntax error here"]);
    check(b"title = \"a\"\ntitle = \"b\"\n", &["small.toml:2:1", "duplicate key"]);
}

#[test]
fn a_key_of_every_screen_is_no_command_of_a_plant() {
    for key in ["a", "q", "v", "w", "y"] {
        let from = "[mimic]\n";
        let to = format!("[mimic]\ncommand = [{{ key = \"{key}\", label = \"go\", tag = \"D1.MODE\" }}]\n");
        check(
            from,
            &to,
            &[
                &format!("key `{key}` is taken"),
                "`a` acknowledges an alarm, `q` quits, `v` shows the overview, `w` says why and `y` copies",
            ],
        );
    }
}

#[test]
fn a_missing_file_names_the_plants_there_are() {
    let check = |argument: &str, expect: &str| {
        let errors = crate::profile::load(std::path::Path::new(argument), &crate::profile::Search::shipped())
            .expect_err("no such plant");
        assert!(errors.to_string().contains(expect), "{errors}");
    };
    check("nowhere.toml", "the plant file nowhere.toml does not exist");
    check("nowhere.toml", "known plants: inverter, lab, tank");
    check("tnk", "did you mean `tank`?");
    check("/", "the plant file / is not a file");
}

#[test]
fn all_problems_come_at_once_and_in_file_order() {
    let errors = changed(&[
        ("deadband = 1.0", "deadbnd = 1.0"),
        ("Asia/Bangkok", "Mars/Base"),
        ("unit = 2", "unit = 0"),
        ("V2000", "V2008"),
        ("min = 0", "min = 200"),
        ("baud = 9600", "baud = 49"),
    ]);
    let lines: Vec<String> = errors.lines().collect();
    insta::assert_snapshot!(lines.join("\n"), @"
    small.toml:2:13: unknown time zone `Mars/Base`
    small.toml:8:8: 49 baud is out of range
    small.toml:22:8: unit 0 is a broadcast, which no unit answers: PLC.STEP can never be read
    small.toml:27:1: unknown key `deadbnd` in an alarm
    meter.toml:19:7: max 100 is not above min 200
    plc.toml:9:16: `V2008` does not exist: DirectLOGIC counts in octal
    ");
}

#[test]
fn a_message_shows_the_line_and_a_caret() {
    insta::assert_snapshot!(changed(&[("profile = \"meter\"", "profile = \"metr\"")]).to_string(), @r#"
      × unknown profile `metr`
        ╭─[small.toml:13:11]
     12 │ name = "D1"
     13 │ profile = "metr"
        ·           ───┬──
        ·              ╰── no such profile
     14 │ line = "L1"
        ╰────
      help: did you mean `meter`?

    1 problem
    "#);
}

#[test]
fn colours_are_for_terminals_only() {
    let errors = changed(&[("unit = 2", "unit = 1")]);
    assert!(render(&errors, true).contains('\u{1b}'));
    assert!(!render(&errors, false).contains('\u{1b}'));
}

#[test]
fn a_thousand_mistakes_do_not_flood_the_terminal() {
    let errors = changed(&[("title = \"Small\"", &(0..1000).map(|n| format!("wrong{n} = 1\n")).collect::<String>())]);
    let text = errors.to_string();
    assert!(text.contains("more problems") && text.lines().count() < 600, "{} lines", text.lines().count());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    /// However a plant file is torn, the loader answers with a plant or with problems, never with a panic.
    #[test]
    fn a_torn_file_is_reported_and_never_panics(start in 0usize..PLANT.len(), length in 0usize..200, junk in "[a-z0-9=\\[\\]{}\"., \\n°-]{0,12}") {
        let end = (start + length).min(PLANT.len());
        let mut bytes = PLANT.as_bytes()[..start].to_vec();
        bytes.extend_from_slice(junk.as_bytes());
        bytes.extend_from_slice(&PLANT.as_bytes()[end..]);
        if let Err(errors) = load(&bytes, METER, PLC) {
            prop_assert!(errors.count() > 0 && errors.lines().count() == errors.count());
            prop_assert!(!errors.to_string().is_empty());
        }
    }

    /// The same for a device profile.
    #[test]
    fn a_torn_profile_is_reported_and_never_panics(start in 0usize..METER.len(), length in 0usize..200, junk in "[a-z0-9=\\[\\]{}\"., \\n-]{0,12}") {
        // METER holds a degree sign, so the cut is made on bytes and mended like a file that is not UTF-8.
        let end = (start + length).min(METER.len());
        let mut bytes = METER.as_bytes()[..start].to_vec();
        bytes.extend_from_slice(junk.as_bytes());
        bytes.extend_from_slice(&METER.as_bytes()[end..]);
        let meter = String::from_utf8_lossy(&bytes);
        if let Err(errors) = load(PLANT.as_bytes(), &meter, PLC) {
            prop_assert!(errors.count() > 0 && !errors.to_string().is_empty());
        }
    }
}

/// What one reads in an editor or on a screen is what the file says.
#[test]
fn hidden_and_direction_characters_are_refused_at_their_place() {
    let named = "title = \"Small\"";
    for (to, expect) in [
        ("title = \"Sm\\u001b[2Jall\"", ["[small.toml:1:9]", "U+001B"]),
        ("title = \"Sm\\u202Eall\"", ["[small.toml:1:9]", "U+202E"]),
        ("title = \"Sm\u{202E}all\"", ["[small.toml:1:12]", "U+202E"]),
        ("title = \"Small\" # \u{2066}a comment", ["[small.toml:1:19]", "U+2066"]),
    ] {
        let text = load(PLANT.replace(named, to).as_bytes(), METER, PLC).expect_err("it is refused").to_string();
        for piece in expect {
            assert!(text.contains(piece), "no `{piece}` in\n{text}");
        }
        assert!(!text.contains(['\u{1b}', '\u{202E}', '\u{2066}']), "{text:?}");
    }
    check("priority = \"high\"", "priority = \"high\"\n\"a\\u0007\" = 1", &["[small.toml:", "U+0007"]);
    check("message = \"hot\"", "message = \"hot\\u200f\"", &["[small.toml:29:11]", "U+200F"]);
    let meter = METER.replace("ACME", "AC\\u009BME");
    let text = load(PLANT.as_bytes(), &meter, PLC).expect_err("a profile too").to_string();
    assert!(text.contains("U+009B") && text.contains("[meter.toml:1:10]"), "{text}");
}

#[test]
fn a_plant_that_is_too_large_is_refused_before_it_is_made() {
    let large = |tables: &str| {
        let text = load(format!("{PLANT}\n{tables}").as_bytes(), METER, PLC).expect_err("it is refused");
        assert_eq!(text.count(), 1, "one word about the size, none about what is in it");
        text.full_lines().next().unwrap()
    };
    let device = |n: usize| format!("[[device]]\nname = \"M{n}\"\nprofile = \"meter\"\nline = \"L1\"\nunit = 3\n");
    let errors = large(&(0..20_000).map(device).collect::<String>());
    assert!(errors.starts_with("small.toml:") && errors.contains("20002 times [[device]]"), "{errors}");
    assert!(errors.ends_with("(expected at most 2000)"), "{errors}");
    let errors = large(&"[[alarm]]\ntag = \"D1.T\"\n".repeat(10_000));
    assert!(errors.contains("10001 times [[alarm]]"), "{errors}");
    let errors = large(&"[[line]]\nname = \"L\"\n".repeat(70));
    assert!(errors.contains("71 times [[line]]"), "{errors}");

    // Few devices of a profile with many tags.
    let tag = |n: usize| format!("[[tag]]\nname = \"R{n}\"\ntable = \"holding\"\naddress = {n}\ntype = \"uint16\"\n");
    let many = format!("{METER}\n{}", (2_000..10_000).map(tag).collect::<String>());
    let plant = format!("{PLANT}\n{}", (0..2).map(device).collect::<String>());
    let text = load(plant.as_bytes(), &many, PLC).expect_err("it is refused").to_string();
    assert!(text.contains("too many tags: M1 has number 20001") && text.contains("at most 20000 in all"), "{text}");
}

#[test]
fn endless_lines_and_problems_are_reported_in_bounded_text() {
    let long = format!("{PLANT}\n[x]\na = [{}]\n", "[],".repeat(100_000));
    let keys: String = (0..50_000).map(|n| format!("k{n} = 1\n")).collect();
    let devices = "[[device]]\nname = \"\"\n".repeat(1_900);
    for text in [long, format!("{keys}\n{PLANT}"), format!("{PLANT}\n{devices}")] {
        let errors = load(text.as_bytes(), METER, PLC).expect_err("it is refused");
        assert!(
            errors.count() <= 1_000 && errors.to_string().len() < 100_000,
            "{} {}",
            errors.count(),
            errors.to_string().len()
        );
    }
}

#[test]
fn a_normal_band_is_a_range_within_the_bounds() {
    let with = |band: &str, expect: &[&str]| check("max = 100\n", &format!("max = 100\nnormal = {band}\n"), expect);
    with("[70, 60]", &["meter.toml:20:10", "ends at 60 and begins at 70", "expected [low, high]"]);
    with("[-5, 60]", &["meter.toml:20:10", "begins below min 0"]);
    with("[60, 101.5]", &["ends above max 100"]);
    with("[60]", &["normal"]);
    let meter = METER.replace("max = 100\n", "max = 100\nnormal = [60, 70.5]\n");
    let def = load(PLANT.as_bytes(), &meter, PLC).unwrap();
    assert_eq!(def.tag(def.tag_named("D1.T").unwrap()).normal, Some([60.0, 70.5]));
}

#[test]
fn a_profile_is_checked_whatever_its_file_is_called() {
    use crate::profile::{Search, check};
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.b \"c\".toml");
    std::fs::write(&path, METER).unwrap();
    let checked = check(&path, &Search::shipped()).unwrap_or_else(|errors| panic!("{errors}"));
    assert_eq!(checked.plant.devices.len(), 1);
}
