//! SQL over the history, and raw samples as files: what others get is what is stored, and nothing else can be reached.

use std::path::Path;

use sightglass::api::plant::ParquetVersion;

use crate::{
    archive::archived,
    support::{folder, sightglass},
};

/// Exit code and output of a command on a history.
fn run(history: &Path, args: &[&str]) -> (Option<i32>, String) {
    run_at(history, &[&args[..1], &["tank"], &args[1..]].concat())
}

fn run_at(history: &Path, args: &[&str]) -> (Option<i32>, String) {
    let output = sightglass().args(args).arg("--history").arg(history).output().unwrap();
    (output.status.code(), String::from_utf8([output.stdout, output.stderr].concat()).unwrap())
}

#[test]
fn sql_reads_archive_and_database_as_one() {
    let folder = folder();
    let history = folder.path().join("tank.duckdb");
    archived(&history, ParquetVersion::V1);
    let sql = |args: &[&str]| run(&history, &[&["sql"], args].concat());
    // 26 hours of one sample a second of two tags; the last hour is not archived.
    let by_tag = "SELECT tag, count(*) AS n, sum(value)::DECIMAL(12, 1) AS sum, unit, quality FROM sample
        GROUP BY ALL ORDER BY tag";
    let sum = (0..93_600).map(|second| (second % 1_000) as f64 / 10.0).sum::<f64>();
    let csv =
        format!("tag,n,sum,unit,quality\r\nTIC-1.PV,93600,{sum:.1},°C,good\r\nTIC-1.SV,93600,6552000.0,°C,good\r\n");
    assert_eq!(sql(&[by_tag, "--csv"]), (Some(0), csv));
    let (code, text) =
        sql(&["SELECT tag, count(*) AS n, sum(n)::INTEGER AS samples FROM m1 GROUP BY tag ORDER BY tag"]);
    let table = "tag       n     samples\nTIC-1.PV  1500  90000\nTIC-1.SV  1500  90000\n2 rows\n";
    assert_eq!((code, text.as_str()), (Some(0), table));
    let (code, text) = sql(&["SELECT max(mean) AS most FROM h1", "--json"]);
    let json: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!((code, json[0]["most"].as_f64()), (Some(0), Some(70.0)));
    for (refused, expect) in [
        ("COPY (SELECT 1) TO '/tmp/x.csv'", "expected one SELECT"),
        ("SELECT 1; DROP TABLE tags", "expected one SELECT"),
        ("SELECT 1; SELECT 2", "found 2 statements, expected one SELECT"),
        ("SET enable_external_access = true", "expected one SELECT"),
        ("SELECT 1) TO '/tmp/x' (FORMAT csv); --", "syntax error at or near \")\" (at character 8)"),
        ("SELECT * FROM read_csv('/etc/passwd')", "Cannot access file \"/etc/passwd\""),
        ("SELECT * FROM '/etc/hostname'", "does not exist"),
        ("SELECT foo FROM sample", "LINE 1: SELECT foo FROM sample"),
    ] {
        let (code, text) = sql(&[refused]);
        assert_eq!(code, Some(2), "{refused}: {text}");
        assert!(text.contains(expect), "{refused}: {text}");
    }
    let (code, text) =
        sql(&["SELECT sum(a.range) FROM range(9000000000) a, range(9000000000) b", "--timeout", "200ms"]);
    assert_eq!(code, Some(1), "{text}");
    assert!(text.contains("no result within 0.2 s: ask for less"), "{text}");
}

#[test]
fn raw_samples_are_exported_whole() {
    let folder = folder();
    let history = folder.path().join("tank.duckdb");
    archived(&history, ParquetVersion::V2);
    let out = folder.path().join("samples");
    let export = |format: &str| {
        let args =
            ["export", "--raw", "--from", "2026-03-03T11:59:58", "--to", "2026-03-03T14:00:02", "--tags", "TIC-1.PV"];
        run(&history, &[&args[..], &["--format", format, "--out", out.to_str().unwrap()]].concat())
    };
    let (code, text) = export("csv");
    assert_eq!(code, Some(0), "{text}");
    let text = std::fs::read_to_string(&out).unwrap();
    let mut lines: Vec<&str> = text.split_terminator("\r\n").collect();
    assert_eq!(lines.remove(0), "utc,time_local,tag,value,unit,quality");
    assert!(lines.is_sorted(), "in order of time");
    assert_eq!(lines.len(), 7_204);
    assert_eq!(lines[0], "2026-03-03T04:59:58Z,2026-03-03T11:59:58+07:00,TIC-1.PV,79.8,°C,good");
    assert_eq!(lines[7_203], "2026-03-03T07:00:01Z,2026-03-03T14:00:01+07:00,TIC-1.PV,0.1,°C,good");
    // The same bytes each time, with a mark before them for who asks for it.
    let args = ["export", "--raw", "--bom", "--from", "2026-03-03T11:59:58", "--to", "2026-03-03T14:00:02"];
    assert_eq!(run(&history, &[&args[..], &["--tags", "TIC-1.PV"]].concat()), (Some(0), format!("\u{feff}{text}")));
    let (code, said) = run(&history, &[&args[..], &["--format", "parquet"]].concat());
    assert!(code == Some(2) && said.contains("--bom and --separator are for CSV"), "{said}");
    // A history that lacks them takes them back.
    let other = folder.path().join("other.duckdb");
    let def = sightglass::api::profile::load(Path::new("tank"), &sightglass::api::profile::Search::shipped()).unwrap();
    drop(sightglass::api::history::Store::open(&other, &def, "2026-03-01T00:00:00Z".parse().unwrap()).unwrap());
    let (code, text) = run_at(&other, &["history", "import", "tank", out.to_str().unwrap()]);
    assert_eq!(code, Some(0), "{text}");
    assert!(text.contains("imported 7204 rows"), "{text}");
    assert_eq!(export("parquet").0, Some(0));
    let bytes = std::fs::read(&out).unwrap();
    assert_eq!((&bytes[..4], &bytes[bytes.len() - 4..]), (&b"PAR1"[..], &b"PAR1"[..]));
    let left: Vec<_> = std::fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    assert!(left.iter().all(|name| !name.to_string_lossy().ends_with(".new")), "{left:?}");
}

#[test]
fn the_help_names_the_columns_that_there_are() {
    let folder = folder();
    let history = folder.path().join("tank.duckdb");
    archived(&history, ParquetVersion::V1);
    let (_, help) = run_at(&history, &["sql", "--help"]);
    let help = help.split_whitespace().collect::<Vec<_>>().join(" ");
    let columns = |of: &str| {
        let sql = format!("SELECT string_agg(name, ', ' ORDER BY cid) FROM pragma_table_info('{of}')");
        let (code, text) = run(&history, &["sql", &sql, "--csv"]);
        assert_eq!(code, Some(0), "{text}");
        text.lines().nth(1).unwrap().trim_matches('"').to_owned()
    };
    let named = |view: &str, notes: &[&str]| {
        let after = help.split_once(&format!(" {view} utc")).unwrap_or_else(|| panic!("{view} in {help}")).1;
        let plain = notes.iter().fold(format!("utc{after}"), |text, note| text.replacen(note, "", 1));
        let columns = columns(view);
        assert!(plain.starts_with(&columns), "{view}: found {columns}, the help has {plain}");
    };
    named("sample", &[]);
    named("alarm", &[]);
    named("action", &[]);
    named("batch", &[" (begin)", " (NULL while it runs)"]);
    named("phase", &[" (begin of the batch)", " ('unknown' as well)"]);
    let listed = "m1, h1 minutes and hours of what is archived: utc (begin), ";
    let listed = help.split_once(listed).unwrap().1;
    for tier in ["m1", "h1"] {
        let columns = columns(tier);
        assert!(listed.starts_with(columns.strip_prefix("utc, ").unwrap()), "{tier}: {columns}");
    }
}

#[test]
fn samples_of_a_wrong_clock_are_answered_like_others() {
    let folder = folder();
    let history = folder.path().join("tank.duckdb");
    archived(&history, ParquetVersion::V1);
    let import = folder.path().join("1970.csv");
    let old = "1970-01-01T00:00:10Z";
    std::fs::write(&import, format!("tag,time,value\nTIC-1.PV,{old},1\n")).unwrap();
    let (code, text) = run_at(&history, &["history", "import", "tank", import.to_str().unwrap()]);
    assert_eq!(code, Some(0), "{text}");
    // With the end of its curve.
    let count = "SELECT count(*) AS n FROM sample WHERE tag = 'TIC-1.PV'";
    assert_eq!(run(&history, &["sql", count, "--csv"]), (Some(0), "n\r\n93602\r\n".to_owned()));
}

#[test]
fn a_value_of_any_size_is_bounded() {
    let folder = folder();
    let history = folder.path().join("tank.duckdb");
    archived(&history, ParquetVersion::V1);
    for select in ["SELECT repeat('x', 4000000000)", "SELECT repeat(repeat('x', 100000), 60000) AS a FROM range(3)"] {
        for format in ["--csv", "--json"] {
            let (code, text) = run(&history, &["sql", select, format, "--timeout", "5s"]);
            assert!(code == Some(1) || code == Some(2), "{code:?} {}", &text[..text.len().min(300)]);
        }
    }
    // On a screen a long value is cut.
    let (code, text) = run(&history, &["sql", "SELECT repeat('x', 100000)"]);
    assert!(code == Some(0) && text.len() < 10_000, "{code:?}, {} bytes", text.len());
}

/// A plant file with one tag of this unit, at this place on Earth.
fn plant_file(folder: &Path, zone: &str, tag: &str, unit: &str) -> String {
    let file = folder.join(format!("{tag}-{unit}.toml"));
    let text = format!(
        "title = 'P'\ntime_zone = '{zone}'\n[[line]]\nname = 'L'\nmode = 'tcp'\nhost = '127.0.0.1'\ntcp_port = 15021\n\
         [[device]]\nname = 'D'\nline = 'L'\nunit = 1\n[[device.tag]]\nname = '{tag}'\ntable = 'holding'\naddress = 0\n\
         type = 'uint16'\nscale = 0.1\nunit = '{unit}'\n"
    );
    std::fs::write(&file, text).unwrap();
    file.to_str().unwrap().to_owned()
}

#[test]
fn each_sample_keeps_the_unit_and_the_tag_it_was_stored_with() {
    let folder = folder();
    let history = folder.path().join("h.duckdb");
    let [celsius, fahrenheit, other] = [("T", "°C"), ("T", "°F"), ("U", "bar")]
        .map(|(tag, unit)| plant_file(folder.path(), "Europe/Berlin", tag, unit));
    let import = |plant: &str, rows: &str| {
        let file = folder.path().join("rows.csv");
        std::fs::write(&file, format!("tag,time,value\n{rows}")).unwrap();
        let (code, text) = run_at(&history, &["history", "import", plant, file.to_str().unwrap()]);
        assert_eq!(code, Some(0), "{text}");
    };
    let raw = |plant: &str| {
        let (code, text) = run_at(
            &history,
            &["export", plant, "--raw", "--from", "2025-10-26T00:00:00Z", "--to", "2025-10-26T03:00:00Z"],
        );
        assert_eq!(code, Some(0), "{text}");
        text
    };
    import(&celsius, "D.T,2025-10-26T00:30:00.25Z,20.5\nD.T,2025-10-26T01:30:00Z,21.5\n");
    let expect = "utc,time_local,tag,value,unit,quality\r\n\
        2025-10-26T00:30:00.25Z,2025-10-26T02:30:00.25+02:00,D.T,20.5,°C,good\r\n\
        2025-10-26T01:30:00Z,2025-10-26T02:30:00+01:00,D.T,21.5,°C,good\r\n";
    assert!(raw(&celsius).starts_with(expect), "{}", raw(&celsius));
    let first = raw(&celsius);
    for plant in [&fahrenheit, &other] {
        assert_eq!(raw(plant), first, "in the database, with {plant}");
    }
    assert_eq!(run_at(&history, &["history", "compact", &celsius]).0, Some(0));
    import(&fahrenheit, "D.T,2025-10-26T02:30:00Z,68.5\n");
    let both = raw(&fahrenheit);
    assert!(both.contains(",D.T,20.5,°C,good\r\n") && both.contains(",D.T,68.5,°F,good\r\n"), "{both}");
    assert_eq!(raw(&other), both, "in the archive and the database");
    let sql = |select: &str| run_at(&history, &["sql", &other, select, "--csv"]);
    let (code, listed) = sql("SELECT utc, unit FROM sample WHERE value IS NOT NULL;");
    let rows = "utc,unit\r\n2025-10-26T00:30:00.25Z,°C\r\n2025-10-26T01:30:00Z,°C\r\n2025-10-26T02:30:00Z,°F\r\n";
    assert_eq!((code, listed.as_str()), (Some(0), rows));
    // And back, where it was at home.
    let copy = folder.path().join("copy.duckdb");
    let file = folder.path().join("back.csv");
    std::fs::write(&file, &first).unwrap();
    let (code, text) = run_at(&copy, &["history", "import", &celsius, file.to_str().unwrap()]);
    assert_eq!(code, Some(0), "{text}");
    let args = [
        "sql",
        &celsius,
        "SELECT utc, tag, value, unit, quality, exact FROM sample WHERE utc < '2025-10-26 02:00'",
        "--csv",
    ];
    assert_eq!(run_at(&copy, &args), run_at(&history, &args));
}
