//! A station that is killed while it makes reports in every format: each is there once, whole, and agrees with what is on record.

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use jiff::{SignedDuration, Timestamp};
use sightglass::api::{
    access::own_user,
    history::Store,
    plant::{Record, Sample},
    profile::{self, Search},
};

use crate::support::{Process, SmallDisk, folder, sightglass, sockets};

/// Formats without a record of a controller, and the endings of their files.
const FORMATS: [(&str, &str); 8] = [
    ("csv", "csv"),
    ("xlsx", "xlsx"),
    ("pdf", "pdf"),
    ("docx", "docx"),
    ("html", "html"),
    ("json", "json"),
    ("text", "txt"),
    ("parquet", "parquet"),
];
/// Days that are over since the history began.
const DAYS: i64 = 3;
/// The station is killed so often.
const KILLS: usize = 6;
/// The folder is looked into so often for the next file, and a file verified until it is on record.
const LOOKS_MAX: usize = 2_000_000;
const VERIFIED_MAX: usize = 100;

/// A plant whose station makes a report of each day in every format.
struct Place {
    folder: tempfile::TempDir,
    /// Where the reports go.
    reports: PathBuf,
    sockets: std::path::PathBuf,
    /// The first day of the history.
    first: jiff::civil::Date,
}

impl Place {
    fn new() -> Place {
        let place = folder();
        let reports = place.path().join("reports");
        Place::with(place, reports)
    }

    /// The same, with its reports elsewhere.
    fn with(place: tempfile::TempDir, reports: PathBuf) -> Place {
        let text = profile::text_of("tank", &Search::shipped()).expect("a shipped plant");
        let formats = FORMATS.map(|(format, _)| format!("\"{format}\"")).join(", ");
        let rules = format!(
            "\n[[report.automatic]]\nperiod = \"day\"\nformats = [{formats}]\nfolder = {reports:?}\n
             [[access.trusted]]\nuser = \"{}\"\nrole = \"supervisor\"\n",
            own_user()
        );
        fs::write(place.path().join("tank.toml"), text + &rules).expect("written");
        let def = profile::load(&place.path().join("tank.toml"), &Search::shipped()).expect("a plant");
        let pv = def.tag_named("TIC-1.PV").expect("a tag");
        let today = Timestamp::now().to_zoned(def.time_zone.clone()).start_of_day().expect("a day").timestamp();
        let begin = today - SignedDuration::from_hours(24 * DAYS);
        let minute = |minute: i64| {
            let at = begin + SignedDuration::from_mins(minute);
            Record::Sample(pv, Sample::good(50.0 + (minute % 700) as f64 / 10.0, at))
        };
        let store = Store::open(&place.path().join("tank.duckdb"), &def, begin).expect("a new file").store;
        store.append(&(0..DAYS * 1_440).map(minute).collect::<Vec<_>>()).expect("stored");
        store.checkpoint().expect("written");
        Place { folder: place, reports, sockets: sockets(), first: begin.to_zoned(def.time_zone.clone()).date() }
    }

    fn command(&self, args: &[&str]) -> Command {
        let mut command = sightglass();
        command.args(args).env("XDG_RUNTIME_DIR", &self.sockets).env("XDG_STATE_HOME", self.folder.path());
        command.current_dir(self.folder.path());
        command
    }

    fn station(&self) -> Process {
        let args = ["run", "tank.toml", "--log", "-", "--port", "L1=/dev/none", "--history", "tank.duckdb"];
        Process::start(&mut self.command(&args))
    }

    /// Whether a report is verified, and what is said of it.
    fn verified(&self, name: &str, args: &[&str]) -> (bool, String) {
        let file = self.reports.join(name).display().to_string();
        let verified = self.command(&[&["report", "verify", &file, "tank.toml"], args].concat()).output();
        let verified = verified.expect("it runs");
        (verified.status.success(), String::from_utf8_lossy(&[verified.stdout, verified.stderr].concat()).into_owned())
    }

    fn names(&self) -> BTreeSet<String> {
        let entries = fs::read_dir(&self.reports).into_iter().flatten().flatten();
        entries.map(|entry| entry.file_name().into_string().expect("a plain name")).collect()
    }

    /// The files that there must be, in the order in which they are made.
    fn expected(&self) -> Vec<String> {
        let days = (0..DAYS).map(|day| self.first + SignedDuration::from_hours(24 * day));
        days.flat_map(|day| FORMATS.map(|(_, ending)| format!("{day}-day.{ending}"))).collect()
    }
}

/// A file that is there under its name is whole at any instant.
fn check_whole(folder: &Path, names: &BTreeSet<String>) {
    for name in names.iter().filter(|name| name.ends_with(".sha256")) {
        let checked = Command::new("sha256sum").args(["--check", "--status", name]).current_dir(folder).status();
        assert!(checked.expect("sha256sum").success(), "{name}");
    }
}

#[test]
fn a_station_killed_while_it_writes_makes_each_report_once() {
    let place = Place::new();
    for kill in 0..KILLS {
        let mut station = place.station();
        // Alternately after a report, and while the next is on its way to the disk.
        station.wait_for("report written");
        let before = place.names();
        let next = || (0..LOOKS_MAX).any(|_| place.names() != before);
        assert!(kill % 2 == 0 || next(), "no further report");
        station.signal("KILL");
        assert_eq!(station.end(), None);
        check_whole(&place.reports, &place.names());
    }
    let expected = place.expected();
    assert!(place.names().len() < 2 * expected.len(), "it was killed before it had made all");
    let mut station = place.station();
    station.wait_for(&format!(
        "report written file=\"{}\"",
        place.reports.join(expected.last().expect("reports")).display()
    ));
    // What is written is on record a moment later: the station says so itself.
    let last = expected.last().expect("reports");
    let is_on_record = || place.verified(last, &[]).1.contains("automatic report day");
    assert!((0..VERIFIED_MAX).any(|_| is_on_record()), "{last} does not come on record");
    station.signal("TERM");
    assert_eq!(station.end(), Some(0), "{:?}", station.said);

    let all = expected.iter().flat_map(|name| [name.clone(), format!("{name}.sha256")]);
    assert_eq!(place.names(), all.collect());
    check_whole(&place.reports, &place.names());
    for name in &expected {
        let (is_verified, said) = place.verified(name, &["--history", "tank.duckdb"]);
        assert!(is_verified, "{said}");
        assert!(said.contains("automatic report day") && said.contains("exported by station"), "{said}");
    }
    let sql = "SELECT count(*) AS n FROM report WHERE event = 'made' AND period = 'day'";
    let listed =
        place.command(&["sql", "tank.toml", sql, "--csv", "--history", "tank.duckdb"]).output().expect("it runs");
    assert_eq!(String::from_utf8_lossy(&listed.stdout), format!("n\r\n{}\r\n", expected.len()));
    let db = duckdb::Connection::open(place.folder.path().join("tank.duckdb")).expect("the history");
    let count = |query: &str| db.query_row(query, [], |row| row.get::<_, usize>(0)).expect("a count");
    assert_eq!(count("SELECT count(*) FROM report WHERE event = 'made'"), expected.len());
    let exports = "SELECT count(*) FROM operator_action WHERE action = 'export' AND outcome = 'done'";
    let files = "SELECT count(DISTINCT target) FROM operator_action WHERE action = 'export' AND outcome = 'done'";
    assert_eq!(count(exports), count(files), "what was found after a kill is no second export");
}

#[test]
fn reports_that_find_no_room_are_made_once_there_is_some() {
    type Change = fn(&SmallDisk);
    let outages: [(Change, Change); 2] =
        [(SmallDisk::fill, SmallDisk::free), (SmallDisk::protect, SmallDisk::unprotect)];
    for (begin, end) in outages {
        let Some(disk) = SmallDisk::mount() else { return };
        let reports = disk.path().join("reports");
        fs::create_dir(&reports).expect("a folder");
        let place = Place::with(folder(), reports);
        begin(&disk);
        let mut station = place.station();
        station.wait_for("a report is not made yet");
        // The report in the next format is tried meanwhile.
        let is_empty = || place.names().is_empty();
        assert!((0..LOOKS_MAX).any(|_| is_empty()), "something is left of what was not written: {:?}", place.names());
        end(&disk);
        let expected = place.expected();
        // A format that found no room is tried again later than the others, whose reports may all be there before.
        for name in &expected {
            station.expect(&format!("report written file=\"{}\"", place.reports.join(name).display()));
        }
        station.signal("TERM");
        assert_eq!(station.end(), Some(0), "{:?}", station.said);
        let all = expected.iter().flat_map(|name| [name.clone(), format!("{name}.sha256")]);
        assert_eq!(place.names(), all.collect());
        check_whole(&place.reports, &place.names());
    }
}

#[test]
fn a_report_without_a_station_is_called_changed_if_it_was() {
    let place = Place::new();
    let history = ["--history", "tank.duckdb"];
    let day = format!("day@{}", place.first);
    let args = ["report", "tank.toml", "--period", &day, "--format", "text", "--out", "reports/own.txt"];
    fs::create_dir_all(place.folder.path().join("reports")).expect("a folder");
    let made = place.command(&[&args[..], &history].concat()).output().expect("it runs");
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    let (is_verified, said) = place.verified("own.txt", &history);
    assert!(!is_verified && said.contains("no station has recorded it") && said.contains("agrees with"), "{said}");
    assert!(!said.contains("is not what was written"), "{said}");
    let file = place.folder.path().join("reports/own.txt");
    let text = fs::read_to_string(&file).expect("the report");
    fs::write(&file, text + "a line\n").expect("written");
    assert!(place.verified("own.txt", &history).1.contains("is not what was written"));
    fs::remove_file(place.folder.path().join("reports/own.txt.sha256")).expect("it was there");
    assert!(place.verified("own.txt", &history).1.contains("has no checksum"));
}
