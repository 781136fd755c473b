//! What the tests share: processes that cannot outlive their test, output with deadlines, peers and their installation.

use std::{
    fs::File,
    io::{BufRead, BufReader, Read, Write},
    net::TcpListener,
    os::unix::fs::DirBuilderExt,
    path::{Path, PathBuf},
    process::{Child, Command, Stdio},
    sync::{
        Mutex, MutexGuard, OnceLock, PoisonError,
        atomic::{AtomicU32, Ordering},
        mpsc::{Receiver, RecvTimeoutError, channel},
    },
    time::{Duration, Instant},
};

/// Nothing that these tests wait for takes so long, even on a busy machine.
pub const TIMEOUT: Duration = Duration::from_secs(60);

/// The program under test, where it finds no station of another test.
pub fn sightglass() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_sightglass"));
    command.env_remove("NO_COLOR").env("SIGHTGLASS_LOG", "debug");
    command.env_remove("RUNTIME_DIRECTORY").env("XDG_RUNTIME_DIR", sockets());
    command
}

/// A folder for sockets that no other call gets. Its name is short, because that of a socket has 107 bytes at the most.
pub fn sockets() -> PathBuf {
    // This is never dropped: it stays behind in the temporary folder with nothing but dead sockets in it.
    static ALL: OnceLock<tempfile::TempDir> = OnceLock::new();
    static NEXT: AtomicU32 = AtomicU32::new(0);
    let number = NEXT.fetch_add(1, Ordering::Relaxed);
    let folder = ALL.get_or_init(folder).path().join(number.to_string());
    std::fs::DirBuilder::new().mode(0o700).create(&folder).unwrap();
    folder
}

/// A folder of its own for the state of a program.
pub fn folder() -> tempfile::TempDir {
    tempfile::tempdir().unwrap()
}

/// A process whose lines can be waited for; it ends with the test.
pub struct Process {
    pub child: Child,
    lines: Receiver<String>,
    /// All lines so far.
    pub said: Vec<String>,
}

impl Process {
    pub fn start(command: &mut Command) -> Process {
        let mut child = command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let (sender, lines) = channel();
        let errors = sender.clone();
        let read = |pipe: Box<dyn Read + Send>, sender: std::sync::mpsc::Sender<String>| {
            std::thread::spawn(move || {
                for line in BufReader::new(pipe).lines().map_while(Result::ok) {
                    if sender.send(line).is_err() {
                        break;
                    }
                }
            });
        };
        read(Box::new(child.stdout.take().unwrap()), sender);
        read(Box::new(child.stderr.take().unwrap()), errors);
        Process { child, lines, said: Vec::new() }
    }

    /// Waits for a line with this text and gives it.
    pub fn wait_for(&mut self, text: &str) -> String {
        let end = Instant::now() + TIMEOUT;
        loop {
            match self.lines.recv_timeout(end.saturating_duration_since(Instant::now())) {
                Ok(line) => {
                    self.said.push(line.clone());
                    if line.contains(text) {
                        return line;
                    }
                }
                Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => {
                    panic!("`{text}` was never said, but:\n{}", self.said.join("\n"))
                }
            }
        }
    }

    /// Waits for a line with this text, unless it was said before.
    pub fn expect(&mut self, text: &str) {
        if !self.said.iter().any(|line| line.contains(text)) {
            self.wait_for(text);
        }
    }

    /// Sends a signal by name.
    pub fn signal(&self, name: &str) {
        let sent = Command::new("kill").args([&format!("-{name}"), &self.child.id().to_string()]).status().unwrap();
        assert!(sent.success());
    }

    /// Waits for the end and gives the exit code (`None`: killed by a signal).
    pub fn end(&mut self) -> Option<i32> {
        // The pipes close when the process ends; that is the event to wait for.
        let end = Instant::now() + TIMEOUT;
        loop {
            match self.lines.recv_timeout(end.saturating_duration_since(Instant::now())) {
                Ok(line) => self.said.push(line),
                Err(RecvTimeoutError::Disconnected) => return self.child.wait().unwrap().code(),
                Err(RecvTimeoutError::Timeout) => panic!("it did not end; it said:\n{}", self.said.join("\n")),
            }
        }
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The simulated devices of the tank, while they run, and where they serve: `127.0.0.1:PORT`.
pub fn simulated_tank() -> (Process, String) {
    let mut sim = Process::start(sightglass().args(["sim", "tank", "--tcp", "127.0.0.1:0"]));
    let port = sim.wait_for(" on 127.0.0.1:").rsplit(' ').next().unwrap().to_owned();
    (sim, port)
}

/// A TCP port that was free a moment ago.
pub fn free_port() -> u16 {
    TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port()
}

/// A disk of 16 MiB, to be filled and write-protected.
pub struct SmallDisk {
    folder: tempfile::TempDir,
}

impl SmallDisk {
    /// `None`, after [`skip`], where this user may not mount.
    pub fn mount() -> Option<SmallDisk> {
        let disk = SmallDisk { folder: folder() };
        let mounted = disk.try_mount(&["-t", "tmpfs", "-o", "size=16m", "tmpfs"]);
        if !mounted {
            skip("mounting a tmpfs is not permitted; run this test as root");
        }
        mounted.then_some(disk)
    }

    pub fn path(&self) -> &Path {
        self.folder.path()
    }

    /// Takes all that is free.
    pub fn fill(&self) {
        let mut ballast = File::create(self.path().join("ballast")).unwrap();
        while ballast.write_all(&[0xA5; 4096]).is_ok() {}
    }

    /// Gives back what [`SmallDisk::fill`] took.
    pub fn free(&self) {
        std::fs::remove_file(self.path().join("ballast")).unwrap();
    }

    /// Lets nothing be opened for writing any more; files that are open stay as they are.
    pub fn protect(&self) {
        let place = self.path().to_str().unwrap();
        assert!(self.try_mount(&["--bind", place]) && self.try_mount(&["-o", "remount,bind,ro"]));
    }

    /// Ends [`SmallDisk::protect`].
    pub fn unprotect(&self) {
        assert!(self.try_unmount());
    }

    fn try_mount(&self, args: &[&str]) -> bool {
        run_quietly(Command::new("mount").args(args).arg(self.path()))
    }

    fn try_unmount(&self) -> bool {
        run_quietly(Command::new("umount").arg("--lazy").arg(self.path()))
    }
}

impl Drop for SmallDisk {
    fn drop(&mut self) {
        // Also where a test failed between `protect` and `unprotect`.
        while self.try_unmount() {}
    }
}

fn run_quietly(command: &mut Command) -> bool {
    command.stdout(Stdio::null()).stderr(Stdio::null()).status().is_ok_and(|status| status.success())
}

/// A pair of pseudo-terminals joined by socat, as a cable that can be pulled.
pub struct Cable {
    pub ends: [PathBuf; 2],
    _process: Process,
}

impl Cable {
    pub fn plug(folder: &Path) -> Cable {
        let ends = [folder.join("ttyA"), folder.join("ttyB")];
        let end = |path: &Path| format!("pty,raw,echo=0,link={}", path.display());
        let mut process = Process::start(Command::new("socat").args(["-d", "-d", &end(&ends[0]), &end(&ends[1])]));
        process.wait_for("starting data transfer loop");
        Cable { ends, _process: process }
    }
}

/// `true` if a Debian program is here or could be installed. Without it the test is skipped, see [`skip`].
pub fn have(program: &str, package: &str) -> bool {
    let found =
        || Command::new("which").arg(program).stdout(Stdio::null()).status().is_ok_and(|status| status.success());
    if !found() {
        install(package);
    }
    present(found(), &format!("{program} (Debian package {package})"))
}

/// The Python with pymodbus and minimalmodbus, in a virtual environment of the tests.
pub fn python() -> Option<PathBuf> {
    static PYTHON: OnceLock<Option<PathBuf>> = OnceLock::new();
    PYTHON.get_or_init(|| venv("peers-venv", &["pymodbus[serial]==3.16.1", "minimalmodbus==2.1.1"])).clone()
}

/// The Python with a reader of SunSpec devices.
pub fn sunspec() -> Option<PathBuf> {
    venv("sunspec-venv", &["pysunspec2==1.3.7"])
}

/// The Python with engines that read Parquet. Spark needs Java.
pub fn engines() -> Option<PathBuf> {
    let packages =
        ["polars==2.1.0", "pyarrow==26.0.1", "duckdb==2.0.0", "datafusion==55.0.0", "chdb==4.4.0", "pyspark==4.3.0"];
    have("java", "default-jre-headless").then(|| venv("engines-venv", &packages)).flatten()
}

/// A virtual environment with packages of PyPI, in these very versions.
/// Python with readers of Excel, Word and Parquet files.
pub fn office() -> Option<PathBuf> {
    static PYTHON: OnceLock<Option<PathBuf>> = OnceLock::new();
    PYTHON.get_or_init(|| venv("office-venv", &["openpyxl==3.1.5", "python-docx==1.2.0", "pyarrow==26.0.1"])).clone()
}

fn venv(name: &str, packages: &[&str]) -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let python = folder.join("bin/python");
    let find = "import re, sys; from importlib.metadata import version
for package in sys.argv[1:]:
    name, wanted = re.sub('[[].*[]]', '', package).split('==')
    assert version(name) == wanted";
    let works = || run_quietly(Command::new(&python).args(["-c", find]).args(packages));
    if !works() {
        run_quietly(Command::new("python3").args(["-m", "venv"]).arg(&folder));
        run_quietly(Command::new(&python).args(["-m", "pip", "-q", "install"]).args(packages));
    }
    present(works(), &format!("{} (PyPI, through python3 -m venv)", packages.join(", "))).then_some(python)
}

/// libmodbus's own server for unit tests, while it runs. It serves one connection and ends.
pub struct LibmodbusServer {
    _process: Process,
    /// Its port is fixed, so there is one server at a time.
    _turn: MutexGuard<'static, ()>,
}

/// Builds and starts the server that Debian's libmodbus-dev brings as an example: unit 17 on 127.0.0.1:1502.
pub fn libmodbus_server() -> Option<LibmodbusServer> {
    const SOURCE: &str = "/usr/share/doc/libmodbus-dev/examples/unit-test-server.c";
    static TURN: Mutex<()> = Mutex::new(());
    let turn = TURN.lock().unwrap_or_else(PoisonError::into_inner);
    if !Path::new(SOURCE).exists() {
        install("libmodbus-dev");
    }
    let program = Path::new(env!("CARGO_TARGET_TMPDIR")).join("libmodbus-unit-test-server");
    let built = || {
        let mut cc = Command::new("cc");
        cc.args(["-I/usr/include/modbus", SOURCE, "-lmodbus", "-o"]).arg(&program);
        cc.stderr(Stdio::null()).status().is_ok_and(|status| status.success())
    };
    if !present(have("cc", "gcc") && built(), &format!("{SOURCE} (Debian package libmodbus-dev), built with cc")) {
        return None;
    }
    if let Err(error) = TcpListener::bind("127.0.0.1:1502") {
        skip(&format!("port 1502, which the server of libmodbus insists on, is taken: {error}"));
        return None;
    }
    Some(LibmodbusServer { _process: Process::start(&mut Command::new(&program)), _turn: turn })
}

fn install(package: &str) {
    // Tests run side by side, and apt-get gives up where another one is at work.
    static TURN: Mutex<()> = Mutex::new(());
    let _turn = TURN.lock().unwrap_or_else(PoisonError::into_inner);
    let get = format!("apt-get -o DPkg::Lock::Timeout=300 install -y -qq {package}");
    let _ =
        Command::new("sh").args(["-c", &format!("({get} || (apt-get update -qq && {get})) >/dev/null 2>&1")]).status();
}

fn present(found: bool, what: &str) -> bool {
    if !found {
        skip(&format!("{what} is not installed and could not be"));
    }
    found
}

/// Says that the running test checks nothing here. Tests capture what is printed, so this goes to the error stream itself
/// and stands between their results, with the number of tests that were skipped. Under CI (variable `CI`) it is a failure.
fn skip(why: &str) {
    static SKIPPED: AtomicU32 = AtomicU32::new(0);
    assert!(std::env::var_os("CI").is_none(), "under CI no test is skipped: {why}");
    let count = SKIPPED.fetch_add(1, Ordering::Relaxed) + 1;
    let test = std::thread::current().name().unwrap_or("a test").to_owned();
    let _ = writeln!(std::io::stderr(), "SKIPPED {test} (skipped so far: {count}): {why}");
}
