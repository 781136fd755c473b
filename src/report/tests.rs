//! Every format of the same report: the same file each time, in every language, with nothing that runs.

use super::{
    FORMATS, ReportFormat, ShiftReport, Style, TagFigures,
    content::document,
    document::{Cell, Content, Document},
    testing::{THREE, plant, shift_report},
    text::mean_or_difference,
};
use crate::{
    plant::{def::Section, report::REPORT_FORMATS},
    text::{Language, Locale},
};

fn render(name: &str, locale: Locale) -> Vec<u8> {
    let def = plant("Asia/Bangkok", &THREE);
    let format = super::format(name).expect("a format");
    format.render(&document(&shift_report(), &def, locale), &Style::of(&def)).expect("every format can be made")
}

fn text(name: &str, locale: Locale) -> String {
    String::from_utf8(render(name, locale)).expect("it is text")
}

#[test]
fn the_plant_file_knows_every_format() {
    assert_eq!(FORMATS.map(ReportFormat::name), REPORT_FORMATS);
}

#[test]
fn a_counter_has_its_difference_in_place_of_a_mean() {
    let tags = shift_report().tags;
    let (mean, neither) = (&tags[0], &tags[1]);
    let counted = |difference: f64| TagFigures { difference: Some(difference.into()), ..neither.clone() };
    let shown = [mean, neither, &counted(12.0), &counted(0.0)].map(mean_or_difference);
    assert_eq!(shown, ["54.32", "—", "+12", "+0"], "a mean has one decimal more than its values");
    assert!(!mean_or_difference(&counted(-3.0)).starts_with('+'));
}

#[test]
fn the_same_report_is_the_same_file() {
    for format in FORMATS {
        for language in Language::all() {
            let [first, again] = [(); 2].map(|()| render(format.name(), language.locale()));
            assert!(!first.is_empty() && first == again, "{} in {}", format.name(), language.code());
        }
    }
}

#[test]
fn a_language_changes_words_and_no_figure() {
    let figures = |locale| -> Vec<Vec<Cell>> {
        let document = document(&shift_report(), &plant("Asia/Bangkok", &THREE), locale);
        let tables = document.sections.into_iter().filter_map(|section| match section.content {
            Content::Table(table) => Some(table.rows),
            Content::Facts(_) | Content::Charts(_) | Content::Signatures(_) => None,
        });
        let numbers = |row: Vec<Cell>| row.into_iter().filter(|cell| !matches!(cell, Cell::Text(_))).collect();
        tables.flatten().map(numbers).collect()
    };
    let english = figures(Locale::ENGLISH);
    assert!(english.len() > 20 && english == figures(Language::THAI.locale()));
    let thai = text("text", Language::THAI.locale());
    assert!(thai.contains("รายงานกะ") && !thai.contains('\u{200b}'), "{thai}");
}

#[test]
fn names_do_not_become_markup() {
    let html = text("html", Locale::ENGLISH);
    assert!(
        html.contains("temperature high; &quot;check&quot; heater")
            || html.contains("temperature high; \"check\" heater")
    );
    assert!(!html.contains("<script") && html.matches("<svg").count() == 1);
    let json: serde_json::Value = serde_json::from_str(&text("json", Locale::ENGLISH)).expect("JSON");
    let row = &json["values"][0];
    assert_eq!(
        (row["tag"].as_str(), row["mean"].as_f64(), row["max"].as_f64()),
        (Some("TIC-1.PV"), Some(54.32), Some(71.2))
    );
    assert_eq!(json["alarms"][0]["time"].as_str(), Some("2026-11-21T06:12:45.500+07:00"));
    assert_eq!(json["values"][1]["min"], serde_json::Value::Null);
}

#[test]
fn a_counter_of_64_bits_has_all_its_digits_in_every_format() {
    let mut report = shift_report();
    let counter = report.tags.iter_mut().find(|figures| figures.difference.is_some()).expect("a counter");
    counter.decimals = 3;
    let exact = |text: &str| text.parse().ok();
    (counter.first, counter.last) = (exact("18446744073709550.613"), exact("18446744073709551.615"));
    counter.difference = exact("9007199254740993.001");
    let def = plant("Asia/Bangkok", &THREE);
    let document = document(&report, &def, Locale::ENGLISH);
    for format in FORMATS.iter().filter(|format| !["pdf", "record", "parquet"].contains(&format.name())) {
        let bytes = format.render(&document, &Style::of(&def)).expect("every format can be made");
        let text = match zip::ZipArchive::new(std::io::Cursor::new(&bytes)) {
            Ok(mut archive) => (0..archive.len()).fold(String::new(), |mut text, place| {
                let mut bytes = Vec::new();
                let mut file = archive.by_index(place).expect("a file");
                std::io::Read::read_to_end(&mut file, &mut bytes).expect("its bytes");
                text.push_str(&String::from_utf8_lossy(&bytes));
                text
            }),
            Err(_) => String::from_utf8(bytes).expect("it is text"),
        };
        for digits in ["18446744073709550.613", "18446744073709551.615", "9007199254740993.001"] {
            assert!(text.contains(digits), "no {digits} in {}: {text}", format.name());
        }
    }
}

#[test]
fn text_keeps_to_80_columns_and_every_number_whole() {
    let text = text("text", Locale::ENGLISH);
    let long: Vec<&str> = text.lines().filter(|line| unicode_width::UnicodeWidthStr::width(*line) > 80).collect();
    assert_eq!(long, Vec::<&str>::new());
    insta::assert_snapshot!(text.replace(env!("CARGO_PKG_VERSION"), "VERSION"));
}

/// Wider than a page in every section: long names, labels and numbers.
#[test]
fn a_page_of_text_is_never_wider_than_80_columns() {
    let mut report = shift_report();
    for tag in &mut report.tags {
        (tag.first, tag.min, tag.max) = (Some(1e14.into()), Some((-1e14).into()), Some(1e14.into()));
        (tag.mean, tag.last, tag.decimals) = (Some(123_456_789_012.5.into()), Some(1e14.into()), 6);
    }
    report.runs[0].tag =
        "PLC-1.PUMP-OF-THE-SECOND-STOREY-ON-THE-LEFT-SIDE-BEHIND-THE-DOOR-WITH-A-LONG-NAME-OF-ITS-OWN".into();
    let compared = report.compared[0].clone();
    report.compared.extend(std::iter::repeat_n(compared, 5));
    let mut def = plant("Asia/Bangkok", &THREE);
    def.tags[0].label = "temperature of the upper tank at the outlet".into();
    def.title =
        "Water tank of the second storey, with a title of which no page has ever seen the end in one line".into();
    def.report.signatures = vec!["the supervisor of the shift that has seen all of this with own eyes".into()];
    def.report.sections.push(Section::Signatures);
    for language in Language::all() {
        let lines = super::text::lines(&document(&report, &def, language.locale()), 80);
        let long: Vec<&String> =
            lines.iter().filter(|line| unicode_width::UnicodeWidthStr::width(&***line) > 80).collect();
        assert_eq!(long, Vec::<&String>::new(), "in {}", language.code());
        assert_eq!(lines.join(" ").matches("1262.5").count(), 0, "the numbers are others");
        assert!(lines.join(" ").matches("100000000000000").count() >= 9, "every number is whole");
    }
}

#[test]
fn records_that_wait_for_the_disk_are_said_to_be_missing() {
    let rows = |unstored| {
        let def = plant("Asia/Bangkok", &THREE);
        let report = ShiftReport { unstored, ..shift_report() };
        let document = document(&report, &def, Language::ENGLISH.locale());
        let format = super::format("text").expect("a format");
        let text =
            String::from_utf8(format.render(&document, &Style::of(&def)).expect("it can be made")).expect("text");
        text.lines().filter(|line| line.contains("not stored yet")).map(str::to_owned).collect::<Vec<_>>()
    };
    assert!(rows(Some(0)).is_empty());
    for (unstored, ends) in [(Some(7), " 7"), (None, " ?")] {
        assert!(rows(unstored).iter().any(|row| row.ends_with(ends)), "{:?}", rows(unstored));
    }
}

/// The value of a fact of the summary.
fn fact(report: &ShiftReport, id: &str) -> Option<Cell> {
    let made = document(report, &plant("Asia/Bangkok", &THREE), Locale::ENGLISH);
    let facts = made.sections.into_iter().filter_map(|section| match section.content {
        Content::Facts(facts) => Some(facts),
        Content::Table(_) | Content::Charts(_) | Content::Signatures(_) => None,
    });
    facts.flatten().find(|fact| fact.id == id).map(|fact| fact.cell)
}

#[test]
fn only_the_summary_of_a_running_period_says_until_when() {
    let running = shift_report();
    let over = ShiftReport { until: running.period.to, ..shift_report() };
    let until = |report| fact(report, "still running, figures until");
    assert_eq!((until(&running), until(&over)), (Some(Cell::Time(running.until)), None));
}

#[test]
fn the_share_of_good_values_is_the_mean_of_all_tags() {
    let tags = shift_report().tags;
    for (count, share) in [(0, None), (1, Some(99.9)), (2, Some(49.9))] {
        let report = ShiftReport { tags: tags[..count].to_vec(), ..shift_report() };
        assert_eq!(fact(&report, "good values %"), Some(Cell::number(share, 1)), "{count} tags");
    }
}

#[test]
fn only_the_same_tag_in_the_same_unit_is_compared() {
    for (tag, unit, expect) in [("TIC-1.PV", "°C", Some(50.0)), ("TIC-1.PV", "°F", None), ("TIC-1.SV", "°C", None)] {
        let mut report = shift_report();
        let before = &mut report.compared[0].tags[0];
        (before.tag, before.unit) = (tag.into(), unit.into());
        let made = document(&report, &plant("Asia/Bangkok", &THREE), Locale::ENGLISH);
        let comparison = made.sections.iter().find(|section| section.kind == Section::Comparison);
        let Some(Content::Table(table)) = comparison.map(|section| &section.content) else { panic!("no comparison") };
        assert_eq!(table.rows[0][4], Cell::number(expect, 2), "{tag} {unit}");
    }
}

#[test]
fn a_tag_has_its_label_beside_its_name() {
    let mut def = plant("Asia/Bangkok", &THREE);
    def.tags[0].label = "tank temperature".into();
    let made = document(&shift_report(), &def, Locale::ENGLISH);
    let text = super::text::lines(&made, 200).join("\n");
    assert_eq!(text.matches("TIC-1.PV tank temperature °C").count(), 2, "values and comparison: {text}");
    let json = super::format("json").expect("a format").render(&made, &Style::of(&def)).expect("JSON");
    let json: serde_json::Value = serde_json::from_slice(&json).expect("JSON");
    assert_eq!(json["values"][0]["label"].as_str(), Some("tank temperature"));
    assert_eq!(json["values"][1]["label"], serde_json::Value::Null);
}

#[test]
fn a_thai_report_has_no_english_words() {
    let mut report = shift_report();
    let record = report.actions[0].clone();
    let done = |action: &str, outcome: &str| crate::plant::record::ActionRecord {
        action: action.into(),
        outcome: outcome.into(),
        ..record.clone()
    };
    report.actions = vec![
        done("write", "verified"),
        done("write requested", "pending"),
        done("write", "refused: outside 0.0 … 100.0"),
        done("write", "not confirmed: read back 60.0"),
        done("start procedure", "refused: procedure 5 is running"),
        done("end procedure", "failed: not true within the time limit, step 3 of 9; safe state written"),
        done("login", "refused: wrong name or password; wait 8 s"),
        done("disconnect", "done"),
    ];
    let made = document(&report, &plant("Asia/Bangkok", &THREE), Language::THAI.locale());
    let names = "Water tank morning night TIC PLC PM LT PV SV MV ER kWh UTC SHA Asia Bangkok sightglass Tag hash cmd calc A0 \
                 temperature high check heater level low checksum min";
    let names: Vec<&str> = names.split_whitespace().collect();
    let text = super::text::lines(&made, 80).join("\n");
    let words = text.split(|letter: char| !letter.is_ascii_alphabetic()).filter(|word| 1 < word.len());
    let english: Vec<&str> =
        words.filter(|word| !names.contains(word) && !word.bytes().all(|c| b"a5".contains(&c))).collect();
    assert_eq!(english, Vec::<&str>::new(), "{text}");
}

#[test]
fn the_plant_file_chooses_sections_title_and_signatures() {
    let mut def = plant("Asia/Bangkok", &THREE);
    def.report.sections = vec![Section::Values, Section::Signatures];
    def.report.signatures = vec!["operator".into(), "supervisor".into()];
    (def.report.title, def.report.logo) = ("Batch sheet".into(), "ACME Co., Ltd.".into());
    let made = document(&shift_report(), &def, Locale::ENGLISH);
    assert_eq!(made.sections.iter().map(|section| section.kind).collect::<Vec<_>>(), def.report.sections);
    let text = super::text::lines(&made, 80).join("\n");
    assert!(text.starts_with("ACME Co., Ltd.\nWater tank\nBatch sheet: morning 2026-11-21\n"), "{text}");
    assert!(text.contains("supervisor ____"), "{text}");
}

#[test]
fn a_record_that_no_plant_file_asks_for_is_refused() {
    let mut def = plant("Asia/Bangkok", &THREE);
    def.report.sections = vec![Section::Values];
    let made = document(&shift_report(), &def, Locale::ENGLISH);
    let refused = super::format("record").and_then(|format| format.render(&made, &Style::of(&def)));
    assert!(refused.as_ref().is_err_and(|why| why.contains("[report] record")), "{refused:?}");
}

#[test]
fn a_period_names_every_offset_that_its_clocks_have_had() {
    use super::{
        document::Times,
        testing::{at, zone},
    };
    let berlin = zone("Europe/Berlin");
    let times = |from: &str, until: &str| Times::of(&berlin, at(from), at(until));
    assert_eq!(times("2026-01-01T00:00Z", "2026-07-01T00:00Z"), Times::Offset);
    // Over two changes it ends with the offset that it began with.
    assert_eq!(times("2026-01-01T00:00Z", "2027-01-01T00:00Z"), Times::Offset);
    assert_eq!(times("2026-10-25T01:00Z", "2026-10-25T09:00Z"), Times::Clock, "from the change on");
    assert_eq!(times("2026-11-01T00:00Z", "2026-11-20T00:00Z"), Times::Date);
    let made = document(&shift_report(), &plant("Asia/Bangkok", &THREE), Locale::ENGLISH);
    let spring = Document { from: at("2026-03-01T00:00Z"), until: at("2026-04-01T00:00Z"), zone: berlin, ..made };
    assert_eq!(spring.times_line(), "times are local, UTC+01:00, UTC+02:00");
}

#[test]
fn what_lies_outside_of_the_period_has_its_date_and_offset() {
    use super::{document::ColumnKind, testing::at};
    let made = document(&shift_report(), &plant("Asia/Bangkok", &THREE), Locale::ENGLISH);
    let words = |made: &Document, time: &str| made.words(&Cell::Time(at(time)), ColumnKind::Time);
    assert_eq!(words(&made, "2026-11-20T00:12:45+07"), "2026-11-20 00:12:45");
    assert_eq!(words(&made, "2026-11-21T06:12:45+07"), "06:12:45");
    assert_eq!(words(&made, "2026-11-22T06:12:45+07"), "2026-11-22 06:12:45");
    let berlin = Document { zone: super::testing::zone("Europe/Berlin"), ..made };
    assert_eq!(words(&berlin, "2026-07-01T00:00Z"), "2026-07-01 02:00:00 UTC+02:00");
    assert_eq!(berlin.fact(&Cell::Time(at("2026-07-01T00:00Z"))), "2026-07-01 02:00:00 UTC+02:00");
}

/// A part of a workbook.
fn part_of(book: &[u8], name: &str) -> String {
    let mut book = zip::ZipArchive::new(std::io::Cursor::new(book)).expect("a workbook");
    let mut text = String::new();
    std::io::Read::read_to_string(&mut book.by_name(name).expect("a part"), &mut text).expect("text");
    text
}

#[test]
fn a_chart_of_a_workbook_has_dates_beyond_36_hours() {
    let def = plant("Asia/Bangkok", &THREE);
    for (hours, form) in [(36, "hh:mm"), (37, "mm-dd")] {
        let mut report = shift_report();
        report.charts[0].to = report.charts[0].from + jiff::SignedDuration::from_hours(hours);
        let made = document(&report, &def, Locale::ENGLISH);
        let bytes = super::format("xlsx").expect("a format").render(&made, &Style::of(&def)).expect("it can be made");
        let chart = part_of(&bytes, "xl/charts/chart1.xml");
        assert!(chart.contains(&format!("formatCode=\"{form}\"")), "{hours} h: {chart}");
    }
}

/// The numbers of a column of a sheet, from the second row on.
fn column(sheet: &str, letter: char) -> Vec<f64> {
    let cells = (2..).map_while(|row| sheet.split_once(&format!("<c r=\"{letter}{row}\"")));
    cells
        .map(|(_, rest)| rest.split_once("<v>").and_then(|(_, value)| value.split_once("</v>")?.0.parse().ok()))
        .map(|value| value.expect("a number"))
        .collect()
}

#[test]
fn a_chart_over_a_change_of_the_clocks_runs_forward() {
    use super::{
        chart::{Chart, ChartCurve},
        curve::Bucket,
        document::{Section as Titled, Times},
        testing::{at, zone},
    };
    let made = document(&shift_report(), &plant("Asia/Bangkok", &THREE), Locale::ENGLISH);
    let (from, to) = (at("2026-10-24T22:00Z"), at("2026-10-25T04:00Z"));
    let bucket = |min: f64, max: f64| Some(Bucket { min, max, mean: 20.0, last: 20.0.into() });
    let columns = (0..12).map(|n| bucket(f64::from(n), if n == 5 { 99.0 } else { 30.0 })).collect();
    let (name, unit) = ("TIC-1.PV".to_owned(), "°C".to_owned());
    let curve = ChartCurve { name, unit, decimals: 1, from, step: 1_800.0, columns };
    let chart = Chart { title: "TIC-1".into(), from, to, curves: vec![curve] };
    let section = Titled { kind: Section::Curves, title: "Curves".into(), content: Content::Charts(vec![chart]) };
    let berlin = zone("Europe/Berlin");
    let times = Times::of(&berlin, from, to);
    let night = Document { from, until: to, times, zone: berlin, sections: vec![section], ..made };
    let def = plant("Europe/Berlin", &THREE);
    let bytes = super::format("xlsx").expect("a format").render(&night, &Style::of(&def)).expect("it can be made");
    let part = |name| part_of(&bytes, name);
    let sheet = part("xl/worksheets/sheet2.xml");
    let instants = column(&sheet, 'A');
    assert!(instants.len() == 12 && instants.is_sorted_by(|one, other| one < other), "{instants:?}");
    assert_eq!(column(&sheet, 'B'), (0..12).map(f64::from).collect::<Vec<_>>());
    assert_eq!((column(&sheet, 'C')[5], column(&sheet, 'C')[6]), (99.0, 30.0));
    let words = part("xl/sharedStrings.xml");
    for heading in ["time UTC+02:00", "TIC-1.PV °C min", "TIC-1.PV °C max"] {
        assert!(words.contains(heading), "{heading}: {words}");
    }
    assert_eq!(part("xl/charts/chart1.xml").matches("<c:ser>").count(), 2);
}
