//! `sightglass listen` beside a master and a slave that we did not write: it hears both, and sends nothing.

use std::{
    fs::{self, File, OpenOptions},
    io::{Read, Write},
    net::{TcpListener, TcpStream},
    path::Path,
    process::Command,
    sync::{
        Arc, Mutex,
        mpsc::{Receiver, channel},
    },
};

use crate::support::{Cable, Process, folder, free_port, have, python, sightglass};

/// What mbpoll asks, one call after the other, and what it prints of a register.
struct Master {
    place: Vec<String>,
    /// The values that it has read.
    read: Vec<u16>,
}

impl Master {
    fn call(&mut self, args: &[&str]) -> bool {
        let common = ["-0", "-1", "-o", "0.5"];
        let output = Command::new("mbpoll").args(&self.place).args(common).args(args).output().unwrap();
        let said = String::from_utf8_lossy(&output.stdout).into_owned();
        let values =
            said.lines().filter_map(|line| line.strip_prefix('[')?.split_once("]:")?.1.split_whitespace().next());
        self.read.extend(values.map(|value| value.parse::<i32>().unwrap() as u16));
        output.status.success()
    }

    /// Reads, a write that is read back, and a refusal; the port or host stands last.
    fn ask_everything(&mut self, place: &str) {
        assert!(self.call(&["-a", "1", "-t", "4", "-r", "1016", "-c", "4", place]));
        assert!(self.call(&["-a", "1", "-t", "4", "-r", "1002", "-c", "3", place]));
        assert!(self.call(&["-a", "1", "-t", "4", "-r", "1002", place, "655"]));
        assert!(self.call(&["-a", "1", "-t", "4", "-r", "1002", "-c", "1", place]));
        assert!(self.call(&["-a", "1", "-t", "3", "-r", "1000", "-c", "4", place]));
        assert!(!self.call(&["-a", "1", "-t", "4", "-r", "30000", "-c", "1", place]));
        assert!(self.call(&["-a", "2", "-t", "4", "-r", "1024", "-c", "3", place]));
    }
}

/// A serial line between a master and pymodbus, with a tap.
pub struct Tapped {
    /// The master takes the first end.
    pub master: Cable,
    /// A listener takes the first end.
    pub tap: Cable,
    /// Puts bytes on the tap alone.
    pub to_tap: Arc<Mutex<dyn Write + Send>>,
    /// What the listener has sent.
    pub sent: Receiver<Vec<u8>>,
    /// With its cable.
    pub slave: (Process, Cable),
}

impl Tapped {
    pub fn new(folder: &Path, python: &Path) -> Tapped {
        let cable = |name: &str| {
            let place = folder.join(name);
            fs::create_dir(&place).unwrap();
            Cable::plug(&place)
        };
        let [master, slave, tap] = ["master", "slave", "tap"].map(cable);
        let open = |path: &Path| OpenOptions::new().read(true).write(true).open(path).unwrap();
        let twice = |file: File| (file.try_clone().unwrap(), file);
        let [(from_master, to_master), (from_slave, to_slave), (from_tap, to_tap)] =
            [&master, &slave, &tap].map(|cable| twice(open(&cable.ends[1])));
        let to_tap: Arc<Mutex<dyn Write + Send>> = Arc::new(Mutex::new(to_tap));
        pump(from_master, to_slave, to_tap.clone());
        pump(from_slave, to_master, to_tap.clone());
        let sent = collect(from_tap);
        let process = pymodbus(python, "rtu", slave.ends[0].to_str().unwrap());
        Tapped { master, tap, to_tap, sent, slave: (process, slave) }
    }
}

/// Gives on what comes, to its side and to the tap, until its end closes.
fn pump(mut from: impl Read + Send + 'static, mut to: impl Write + Send + 'static, tap: Arc<Mutex<dyn Write + Send>>) {
    std::thread::spawn(move || {
        let mut buffer = [0; 512];
        while let Ok(count @ 1..) = from.read(&mut buffer) {
            if tap.lock().unwrap().write_all(&buffer[..count]).is_err() || to.write_all(&buffer[..count]).is_err() {
                break;
            }
        }
    });
}

/// Everything that comes from the listener, which should be nothing.
fn collect(mut from: impl Read + Send + 'static) -> Receiver<Vec<u8>> {
    let (sender, bytes) = channel();
    std::thread::spawn(move || {
        let mut buffer = [0; 512];
        while let Ok(count @ 1..) = from.read(&mut buffer) {
            if sender.send(buffer[..count].to_vec()).is_err() {
                break;
            }
        }
    });
    bytes
}

fn pymodbus(python: &Path, kind: &str, place: &str) -> Process {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/peers/slave.py");
    let mut slave = Process::start(Command::new(python).arg(script).args([kind, place, "calm"]));
    slave.wait_for("ready");
    slave
}

/// The registers in the responses that were printed.
fn registers(said: &[String]) -> Vec<u16> {
    let responses = said.iter().filter_map(|line| line.split_once(" response  ")?.1.split_once(" register"));
    let words = responses.filter_map(|(_, rest)| rest.split_once(": ")?.1.split([',', ';']).next());
    words.flat_map(|words| words.split_whitespace().map(|word| u16::from_str_radix(word, 16).unwrap())).collect()
}

/// Numbers of the summary: requests and responses.
fn totals(said: &[String]) -> (usize, usize) {
    let line = said.iter().find(|line| line.starts_with("listened for")).unwrap();
    let number = |word: &str| line.split_once(word).unwrap().0.rsplit(' ').next().unwrap().parse().unwrap();
    (number(" requests"), number(" responses,"))
}

fn end(listen: &mut Process) -> String {
    listen.signal("INT");
    assert_eq!(listen.end(), Some(0), "{}", listen.said.join("\n"));
    listen.said.join("\n")
}

/// The mode in which a process has opened a port: 0 is for reading only.
pub fn access(process: u32, port: &Path) -> Vec<u32> {
    let port = fs::canonicalize(port).unwrap();
    let handles = fs::read_dir(format!("/proc/{process}/fd")).unwrap().flatten();
    let here = handles.filter(|handle| fs::read_link(handle.path()).is_ok_and(|target| target == port));
    let flags = here.map(|handle| {
        let info = fs::read_to_string(format!("/proc/{process}/fdinfo/{}", handle.file_name().display())).unwrap();
        let flags = info.lines().find_map(|line| line.strip_prefix("flags:")).unwrap();
        u32::from_str_radix(flags.trim(), 8).unwrap() & 3
    });
    flags.collect()
}

#[test]
fn mbpoll_and_pymodbus_are_heard_over_a_serial_tap() {
    let Some(python) = python().filter(|_| have("socat", "socat") && have("mbpoll", "mbpoll")) else { return };
    let folder = folder();
    let Tapped { master, tap, to_tap, sent, slave: _slave } = Tapped::new(folder.path(), &python);

    let capture = folder.path().join("heard.pcapng");
    let port = tap.ends[0].to_str().unwrap();
    let args = ["listen", port, "--profile", "fuji_pxr", "--pcap", capture.to_str().unwrap()];
    let mut listen = Process::start(sightglass().args(args));
    listen.wait_for("listening on RTU");
    let access = access(listen.child.id(), &tap.ends[0]);
    assert!(!access.is_empty() && access.iter().all(|mode| *mode == 0), "it is opened for reading only: {access:?}");
    let place = master.ends[0].to_str().unwrap();
    let mut mbpoll =
        Master { place: ["-m", "rtu", "-b", "9600", "-P", "none"].map(str::to_owned).into(), read: vec![] };
    mbpoll.ask_everything(place);
    // No response, a corrupt one, and noise between two requests.
    assert!(!mbpoll.call(&["-a", "3", "-t", "4", "-r", "410", "-c", "1", place]));
    assert!(!mbpoll.call(&["-a", "3", "-t", "4", "-r", "310", "-c", "1", place]));
    assert!(mbpoll.call(&["-a", "1", "-t", "4", "-r", "1002", "-c", "1", place]));
    to_tap.lock().unwrap().write_all(&[0xFF, 0x00, 0x55]).unwrap();
    assert!(mbpoll.call(&["-a", "1", "-t", "4", "-r", "1002", "-c", "1", place]));
    listen.wait_for("noise     FF 00 55");
    listen.wait_for("response  1 register: 028F");

    let said = end(&mut listen);
    assert_eq!(registers(&listen.said), mbpoll.read, "{said}");
    assert!(mbpoll.read.len() == 17 && mbpoll.read.contains(&655), "{:?}", mbpoll.read);
    for part in [
        "value     SV = 70.0 °C",
        "value     SV = 70.0 °C (uncertain: written, not read back)",
        "value     SV = 65.5 °C",
        "unit 3 read holding registers 40411 (0x019A, 1): response timeout",
        "unit 3 read holding registers 40311 (0x0136, 1): CRC error: got FD40, computed",
        "exception 02 illegal data address",
        "noise     FF 00 55",
        ": 11 requests, 9 responses, 0 responses without request, 10 bytes of noise",
        "     3         2         0        0            1        1          0",
    ] {
        assert!(said.contains(part), "no `{part}` in\n{said}");
    }
    assert!(sent.try_recv().is_err(), "it has sent something");
    check_capture(&capture, totals(&listen.said));
}

/// Wireshark's own reader finds as many requests and responses in the capture.
fn check_capture(capture: &Path, (requests, responses): (usize, usize)) {
    if !have("tshark", "tshark") {
        return;
    }
    let output = Command::new("tshark").arg("-r").arg(capture).args(["-o", "mbrtu.tcp.port:1502"]).output().unwrap();
    let lines = String::from_utf8(output.stdout).unwrap();
    let count = |word: &str| lines.lines().filter(|line| line.contains(word)).count();
    assert_eq!((count("Query"), count("Response")), (requests, responses), "{lines}");
    assert!(0 < requests && lines.contains("Write Single Register"), "{lines}");
}

#[test]
fn mbpoll_and_pymodbus_are_heard_over_a_tcp_mirror() {
    let Some(python) = python().filter(|_| have("mbpoll", "mbpoll")) else { return };
    let folder = folder();
    let port = free_port();
    let _slave = pymodbus(&python, "tcp", &port.to_string());
    let [proxy, mirror] = [(); 2].map(|()| TcpListener::bind("127.0.0.1:0").unwrap());
    let place = |listener: &TcpListener| listener.local_addr().unwrap().to_string();
    let (proxy_port, mirror_place) = (place(&proxy).rsplit(':').next().unwrap().to_owned(), place(&mirror));

    let capture = folder.path().join("heard.pcapng");
    let args = ["listen", &mirror_place, "--verbose", "--pcap", capture.to_str().unwrap()];
    let mut listen = Process::start(sightglass().args(args));
    let tap = mirror.accept().unwrap().0;
    let sent = collect(tap.try_clone().unwrap());
    let tap: Arc<Mutex<dyn Write + Send>> = Arc::new(Mutex::new(tap));
    listen.wait_for("listening on TCP");
    std::thread::spawn(move || {
        for client in proxy.incoming().flatten() {
            let server = TcpStream::connect(("127.0.0.1", port)).unwrap();
            pump(client.try_clone().unwrap(), server.try_clone().unwrap(), tap.clone());
            pump(server, client, tap.clone());
        }
    });
    let mut mbpoll = Master { place: ["-m", "tcp", "-p", &proxy_port].map(str::to_owned).into(), read: vec![] };
    mbpoll.ask_everything("127.0.0.1");
    listen.wait_for("response  3 registers: 0002");

    let said = end(&mut listen);
    assert_eq!(registers(&listen.said), mbpoll.read, "{said}");
    let summary = ": 7 requests, 7 responses, 0 responses without request, 0 bytes of noise";
    assert!(mbpoll.read.len() == 15 && said.contains(summary), "{:?}\n{said}", mbpoll.read);
    assert!(sent.recv().is_err(), "it has sent something");
    check_capture(&capture, totals(&listen.said));
}

#[test]
fn listening_ends_by_itself_and_says_when_nothing_came() {
    if !have("socat", "socat") {
        return;
    }
    let folder = folder();
    let cable = Cable::plug(folder.path());
    let port = cable.ends[0].to_str().unwrap();
    let mut listen = Process::start(sightglass().args(["listen", port, "--for", "200ms"]));
    assert_eq!(listen.end(), Some(0), "{}", listen.said.join("\n"));
    assert!(listen.said.iter().any(|line| line.starts_with("nothing was heard")), "{:?}", listen.said);
    // At the wrong baud rate nothing but noise comes.
    let mut listen = Process::start(sightglass().args(["listen", port]));
    listen.wait_for("listening on");
    let mut other = OpenOptions::new().write(true).open(&cable.ends[1]).unwrap();
    other.write_all(&[0xE0; 40]).unwrap();
    listen.wait_for(" noise ");
    // A second program at the port would take its bytes.
    let mut second = Process::start(sightglass().args(["listen", port]));
    assert_eq!(second.end(), Some(1));
    assert!(second.said.join(" ").contains("in use by "), "{:?}", second.said);
    drop(other);
    let said = end(&mut listen);
    assert!(said.contains("no frame at 9600 8N1") && said.contains("40 bytes of noise"), "{said}");
}

#[test]
fn a_capture_is_never_written_over() {
    if !have("socat", "socat") {
        return;
    }
    let folder = folder();
    let cable = Cable::plug(folder.path());
    let capture = folder.path().join("heard.pcapng");
    fs::write(&capture, "kept").unwrap();
    let args = ["listen", cable.ends[0].to_str().unwrap(), "--pcap", capture.to_str().unwrap(), "--for", "1s"];
    let mut listen = Process::start(sightglass().args(args));
    assert_eq!(listen.end(), Some(1));
    assert!(listen.said.join(" ").contains("File exists"), "{:?}", listen.said);
    assert_eq!(fs::read_to_string(&capture).unwrap(), "kept");
}
