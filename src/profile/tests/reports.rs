//! Automatic reports of a plant file.

use std::time::Duration;

use super::*;
use crate::plant::report::{AutomaticReport, PeriodKind};

const SHIFT: &str = "[[shift]]\nname = \"day\"\nstart = \"06:00\"\n";
const TABLE: &str = "[[report.automatic]]\nperiod = \"shift\"\nformats = [\"csv\", \"text\"]\nfolder = \"/srv\"\nkeep_days = 400\n\
    after = [\"curl\", \"-T\", \"{file}\", \"https://x/{plant}\"]\n";

fn with(tables: &str) -> Result<PlantDef, Errors> {
    load(PLANT.replace("[mimic]", &format!("{tables}\n[mimic]")).as_bytes(), METER, PLC)
}

#[test]
fn an_automatic_report_is_read_and_its_mistakes_are_named() {
    let table = format!("{SHIFT}{TABLE}");
    let expect = AutomaticReport {
        period: PeriodKind::Shift,
        formats: vec!["csv".to_owned(), "text".to_owned()],
        folder: Some("/srv".into()),
        keep: Some(Duration::from_secs(400 * 86_400)),
        after: ["curl", "-T", "{file}", "https://x/{plant}"].map(str::to_owned).to_vec(),
    };
    assert_eq!(with(&table).unwrap().report.automatic, [expect]);
    for (from, to, expect) in [
        ("period = \"shift\"", "period = \"year\"", "unknown period `year`"),
        ("period = \"shift\"\n", "", "an automatic report needs `period`"),
        ("\"text\"", "\"txt\"", "unknown format `txt`"),
        ("\"text\"", "\"csv\"", "another automatic report of a shift has the format `csv`"),
        ("[\"csv\", \"text\"]", "[]", "the report has no format"),
        ("{file}", "{path}", "unknown placeholder {path}"),
        ("{plant}", "{PLANT}", "unknown placeholder {PLANT}"),
        ("400", "0", "0 cannot be used here"),
        ("keep_days", "keep", "unknown key `keep`"),
        (
            "period = \"shift\"\nformats = [\"csv\"",
            "period = \"month\"\nformats = [\"record\"",
            "the report of a month has no record",
        ),
        (SHIFT, "", "this plant has no shifts"),
    ] {
        let text = with(&table.replace(from, to)).expect_err(to).to_string();
        assert!(text.contains(expect), "{to}: {text}");
    }
    // Line and column of the placeholder.
    let lines: Vec<String> = with(&table.replace("{file}", "{path}")).expect_err("unknown").lines().collect();
    let line = PLANT.lines().position(|line| line == "[mimic]").unwrap() + 9;
    assert!(lines[0].contains(&format!(":{line}:25: unknown placeholder")), "{lines:?}");
}

#[test]
fn a_command_whose_program_is_missing_is_a_warning() {
    let warned = |program: &str| {
        let table = format!("{SHIFT}{}", TABLE.replace("\"curl\"", &format!("\"{program}\"")));
        let text = PLANT.replace("[mimic]", &format!("{table}\n[mimic]"));
        load_warned(text.as_bytes(), METER, PLC)
            .unwrap()
            .1
            .lines()
            .filter(|line| line.contains("program"))
            .collect::<Vec<_>>()
    };
    assert_eq!(warned("curl"), [""; 0]);
    let warnings = warned("crul");
    assert!(warnings.iter().any(|line| line.contains("program `crul` not found")), "{warnings:?}");
}
