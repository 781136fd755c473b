//! Counters of 64 bits from a slave to everything that shows, stores and writes them: all digits, everywhere. Beside them a
//! line on which all units are written to, and none answers.

use std::{
    collections::BTreeMap,
    fs,
    io::{Cursor, Read, Write},
    net::{Ipv4Addr, TcpListener, TcpStream},
    path::{Path, PathBuf},
    process::Command,
    sync::{Arc, Mutex},
    thread::spawn,
};

use crate::support::{Process, folder, have, sightglass, sockets};

const LINES: &str = r#"
vendor = "none"
model = "test"
revision = "1"
status = "manual"
source = "test"
address_base = 0
"#;
const COUNTERS: &str = r#"
functions = [3, 16]
default = { table = "holding", type = "uint64", access = "r", poll = "fast", source = "test" }
"#;
const ALL_UNITS: &str = r#"
functions = [5, 6, 15, 16]
default = { table = "holding", type = "uint16", access = "w", poll = "never", source = "test" }
tag = [
    { name = "SIX", address = 10 },
    { name = "SIXTEEN", address = 12, type = "uint64" },
    { name = "FIVE", table = "coil", type = "bool", address = 5 },
    { name = "FIFTEEN", table = "coil", type = "bool", address = 6, write_fc = 15 },
]
"#;

/// Tag, what its row says besides, its number in the registers, and what is shown of it.
const TAGS: [(&str, &str, i128, &str); 12] = [
    ("P53L", "", (1 << 53) - 1, "9007199254740991"),
    ("P53", "", 1 << 53, "9007199254740992"),
    ("P53M", "", (1 << 53) + 1, "9007199254740993"),
    ("P63", "", 1 << 63, "9223372036854775808"),
    ("P64L", "", (1 << 64) - 1, "18446744073709551615"),
    ("N53", "type = \"int64\", ", -(1 << 53) - 1, "-9007199254740993"),
    ("N63", "type = \"int64\", ", -(1 << 63), "-9223372036854775808"),
    ("CDAB", "order = \"CDAB\", ", (1 << 53) + 1, "9007199254740993"),
    ("BADC", "order = \"BADC\", ", (1 << 53) + 1, "9007199254740993"),
    ("DCBA", "order = \"DCBA\", ", (1 << 53) + 1, "9007199254740993"),
    ("KWH", "unit = \"kWh\", scale = 0.001, decimals = 3, ", (1 << 64) - 1, "18446744073709551.615"),
    ("SET", "access = \"rw\", max = 9007199254740995, ", (1 << 53) + 1, "9007199254740993"),
];

/// The words of a number of 64 bits.
fn words(number: i128, row: &str) -> Vec<u16> {
    let bytes = number.to_be_bytes()[8..].to_vec();
    let mut words: Vec<u16> = bytes.chunks(2).map(|pair| u16::from_be_bytes([pair[0], pair[1]])).collect();
    if row.contains("CDAB") || row.contains("DCBA") {
        words.reverse();
    }
    if row.contains("BADC") || row.contains("DCBA") {
        words.iter_mut().for_each(|word| *word = word.swap_bytes());
    }
    words
}

fn listen(serve: impl Fn(TcpStream) + Send + Sync + 'static) -> u16 {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    let (port, serve) = (listener.local_addr().unwrap().port(), Arc::new(serve));
    spawn(move || {
        for stream in listener.incoming().flatten() {
            let serve = serve.clone();
            spawn(move || serve(stream));
        }
    });
    port
}

/// Answers functions 3 and 16 of Modbus TCP.
fn serve(mut stream: TcpStream, registers: &Mutex<BTreeMap<u16, u16>>) {
    let mut head = [0; 7];
    while stream.read_exact(&mut head).is_ok() {
        let mut pdu = vec![0; usize::from(head[5]) - 1];
        stream.read_exact(&mut pdu).unwrap();
        let (first, count) = (u16::from_be_bytes([pdu[1], pdu[2]]), u16::from_be_bytes([pdu[3], pdu[4]]));
        let mut registers = registers.lock().unwrap();
        let answer = match pdu[0] {
            3 => {
                let words =
                    (first..first + count).flat_map(|at| registers.get(&at).copied().unwrap_or(0).to_be_bytes());
                [3, 2 * count as u8].into_iter().chain(words).collect()
            }
            16 => {
                let words = pdu[6..].chunks(2).map(|pair| u16::from_be_bytes([pair[0], pair[1]]));
                registers.extend((first..).zip(words));
                pdu[..5].to_vec()
            }
            other => vec![other | 0x80, 1],
        };
        head[5] = answer.len() as u8 + 1;
        if stream.write_all(&[&head[..], &answer].concat()).is_err() {
            break;
        }
    }
}

/// A station at such a slave, and where its files are.
struct Stand {
    folder: tempfile::TempDir,
    runtime: PathBuf,
    plant: PathBuf,
}

impl Stand {
    fn new() -> Stand {
        let folder = folder();
        let address = |place: usize| 100 + 4 * place as u16;
        let registers = TAGS
            .iter()
            .enumerate()
            .flat_map(|(place, (_, row, number, _))| (address(place)..).zip(words(*number, row)).collect::<Vec<_>>());
        let registers = Mutex::new(registers.collect());
        let port = listen(move |stream| serve(stream, &registers));
        // What is sent to all units is read, and not answered.
        let silent = listen(|mut stream| drop(std::io::copy(&mut stream, &mut std::io::sink())));
        let rows: String = (TAGS.iter().enumerate())
            .map(|(place, (name, row, ..))| format!("{{ name = \"{name}\", {row}address = {} }},\n", address(place)))
            .collect();
        fs::create_dir(folder.path().join("devices")).unwrap();
        fs::write(folder.path().join("devices/counters.toml"), format!("{LINES}{COUNTERS}tag = [\n{rows}]\n")).unwrap();
        fs::write(folder.path().join("devices/everybody.toml"), format!("{LINES}{ALL_UNITS}")).unwrap();
        let user = Command::new("id").arg("-un").output().unwrap().stdout;
        let plant = folder.path().join("counters.toml");
        let text = format!(
            "title = \"Counters\"\ntime_zone = \"UTC\"\n\
             [[line]]\nname = \"L1\"\nmode = \"tcp\"\nhost = \"127.0.0.1\"\ntcp_port = {port}\n\
             [[line]]\nname = \"L2\"\nmode = \"rtu-over-tcp\"\nhost = \"127.0.0.1\"\ntcp_port = {silent}\n\
             [[device]]\nname = \"M\"\nprofile = \"counters\"\nline = \"L1\"\nunit = 0\nfast = \"1s\"\n\
             [[device]]\nname = \"ALL\"\nprofile = \"everybody\"\nline = \"L2\"\nunit = 0\n\
             [[access.trusted]]\nuser = \"{}\"\nrole = \"supervisor\"\n",
            String::from_utf8(user).unwrap().trim()
        );
        fs::write(&plant, text).unwrap();
        Stand { folder, runtime: sockets(), plant }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn command(&self, args: &[&str]) -> Command {
        let mut command = sightglass();
        command.env("XDG_RUNTIME_DIR", &self.runtime).env("XDG_STATE_HOME", self.folder.path()).args(args);
        command
    }

    fn run(&self, args: &[&str]) -> (Option<i32>, String) {
        let output = self.command(args).output().unwrap();
        let said = [output.stdout, output.stderr].concat();
        (output.status.code(), String::from_utf8(said).unwrap())
    }

    /// The same of a command that takes plant and history.
    fn of_plant(&self, args: &[&str]) -> String {
        let (plant, history) = (self.plant.to_str().unwrap(), self.path("c.duckdb"));
        let args = [&args[..1], &[plant], &args[1..], &["--history", history.to_str().unwrap()]].concat();
        let (code, said) = self.run(&args);
        assert_eq!(code, Some(0), "{args:?}: {said}");
        said
    }
}

/// The state of the station once all its values are good.
fn status(stand: &Stand) -> serde_json::Value {
    let mut state = serde_json::Value::Null;
    for _ in 0..500 {
        let (_, text) = stand.run(&["status", "--json"]);
        state = serde_json::from_str(&text).unwrap_or_else(|_| panic!("{text}"));
        let tags = state["tags"].as_array().cloned().unwrap_or_default();
        if tags.iter().filter(|tag| tag["quality"] == "good").count() == TAGS.len() {
            return state;
        }
    }
    panic!("not all values are good: {state}");
}

fn write(stand: &Stand, tag: &str, value: &str, code: i32, words: &str) {
    let (found, said) = stand.run(&["write", tag, value]);
    assert!(found == Some(code) && said.contains(words), "{tag} {value}: {found:?}, {said}");
}

fn assert_all(text: &str, what: &str) {
    for (name, _, _, shown) in TAGS {
        assert!(text.contains(shown), "{name} is {shown}, which is not in {what}:\n{text}");
    }
}

/// The text of a file that is a ZIP archive of others.
fn unpacked(bytes: Vec<u8>) -> String {
    let mut archive = zip::ZipArchive::new(Cursor::new(bytes)).unwrap();
    (0..archive.len())
        .map(|place| {
            let mut text = Vec::new();
            archive.by_index(place).unwrap().read_to_end(&mut text).unwrap();
            String::from_utf8_lossy(&text).into_owned()
        })
        .collect()
}

fn assert_reports(stand: &Stand, period: &[&str]) {
    let out = stand.path("reports/");
    let formats = ["--format", "csv,text,html,json,xlsx,docx,pdf", "--out", out.to_str().unwrap()];
    stand.of_plant(&[&["report"], period, &formats].concat());
    let pdf = have("pdftotext", "poppler-utils");
    for file in fs::read_dir(&out).unwrap().map(|file| file.unwrap().path()) {
        let bytes = fs::read(&file).unwrap();
        let text = match file.extension().and_then(|ending| ending.to_str()).unwrap() {
            "sha256" => continue,
            "pdf" if !pdf => continue,
            "pdf" => text_of_pdf(&file),
            "xlsx" | "docx" => unpacked(bytes),
            _ => String::from_utf8(bytes).unwrap(),
        };
        assert!(text.contains("18446744073709551.615"), "{}: {text}", file.display());
    }
}

fn text_of_pdf(file: &Path) -> String {
    let output = Command::new("pdftotext").args(["-layout"]).arg(file).arg("-").output().unwrap();
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn a_number_of_64_bits_has_all_its_digits_wherever_it_is_given() {
    let stand = Stand::new();
    let began = jiff::Timestamp::now().to_string();
    let (plant, history) = (stand.plant.to_str().unwrap(), stand.path("c.duckdb"));
    let args = ["run", plant, "--history", history.to_str().unwrap()];
    let mut station = Process::start(&mut stand.command(&args));
    station.wait_for("device M (unit 0): responding");
    let state = status(&stand);
    for (name, _, _, shown) in TAGS {
        let tag = state["tags"].as_array().unwrap().iter().find(|tag| tag["name"] == format!("M.{name}")).unwrap();
        assert_eq!((tag["text"].as_str(), &*tag["value"].to_string()), (Some(shown), shown), "{name}");
    }
    assert_all(&stand.run(&["status"]).1, "the status");

    write(&stand, "M.SET", "9007199254740993", 0, "unchanged");
    write(&stand, "M.SET", "9007199254740996", 1, "outside 0 … 9007199254740995");
    write(&stand, "M.SET", "9007199254740995", 0, "9007199254740993 → 9007199254740995 : verified");
    write(&stand, "M.SET", "9007199254740993", 0, "verified");
    for tag in ["ALL.SIX", "ALL.SIXTEEN", "ALL.FIVE", "ALL.FIFTEEN"] {
        write(&stand, tag, "1", 0, "sent, no unit answers a broadcast");
    }
    station.signal("TERM");
    assert_eq!(station.end(), Some(0));
    let audit = fs::read_to_string(stand.path("c.audit.jsonl")).unwrap();
    assert_eq!(audit.matches("sent, no unit answers a broadcast").count(), 4, "{audit}");
    assert!(audit.contains("9007199254740995") && !audit.contains("not confirmed"), "{audit}");

    let sql = "SELECT DISTINCT coalesce(rtrim(rtrim(exact::VARCHAR, '0'), '.'), value::VARCHAR) FROM sample";
    assert_all(&stand.of_plant(&["sql", sql, "--csv"]), "SQL");
    let last = jiff::Timestamp::now() + jiff::SignedDuration::from_secs(1);
    let period = ["--from", &began, "--to", &last.to_string()];
    assert_all(&stand.of_plant(&[&["export", "--every", "100ms"], &period[..]].concat()), "the export");
    assert_reports(&stand, &period);
    let raw = stand.path("raw.csv");
    stand.of_plant(&[&["export", "--raw", "--out", raw.to_str().unwrap()], &period[..]].concat());
    let text = fs::read_to_string(&raw).unwrap();
    assert_all(&text, "the raw export");

    // Another history takes them back as they are.
    fs::rename(stand.path("c.duckdb"), stand.path("before.duckdb")).unwrap();
    let def = sightglass::api::profile::load(&stand.plant, &sightglass::api::profile::Search::shipped()).unwrap();
    let hour_ago = jiff::Timestamp::now() - jiff::SignedDuration::from_hours(1);
    drop(sightglass::api::history::Store::open(&history, &def, hour_ago).unwrap());
    let (raw, history) = (raw.to_str().unwrap(), history.to_str().unwrap());
    let (code, said) = stand.run(&["history", "import", plant, raw, "--history", history]);
    assert_eq!(code, Some(0), "{said}");
    assert_all(&stand.of_plant(&["sql", sql, "--csv"]), "the history that imported them");
}
