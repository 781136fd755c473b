//! What calculated tags cost: a station that polls 800 tags over TCP, each with another value every second, without and with
//! 200 tags calculated from them, and one that polls 1,000. Each is a process of its own; the devices are not in it.
//!
//! `cargo bench --bench history -- calculated [SECONDS]`: so many seconds each (30).

use std::{
    fmt::Write,
    fs,
    path::Path,
    process::Command,
    sync::{OnceLock, atomic::Ordering},
    thread,
    time::{Duration, Instant},
};

use rustix::time::{ClockId, clock_gettime};
use sightglass::api::{
    bus::{Clock, Connector},
    history::thread::{self as history, offer},
    plant::{ExceptionCode, Limits, Record, Table},
    profile::{self, Search},
    sim::pdu::{self, Registers},
    station,
};

use super::{
    load::{Counts, commits, memory_kb, spread},
    support::TcpSlave,
};

/// Tags of a device, which one request reads.
const EACH: u16 = 100;
/// Before the measurement: the station starts.
const SETTLE: Duration = Duration::from_secs(5);

/// Prints what it measured.
pub fn main(words: &[String]) {
    let number = |place: usize, usual: u64| words.get(place).and_then(|word| word.parse().ok()).unwrap_or(usual);
    if words.first().is_some_and(|word| word == "station") {
        return run(Path::new(&words[1]), number(2, 30));
    }
    let slave = TcpSlave::start_with(answer);
    for (devices, calculated) in [(8, 0), (8, 200), (10, 0)] {
        let folder = tempfile::tempdir().expect("a folder");
        fs::write(folder.path().join("meter.toml"), meter()).expect("written");
        fs::write(folder.path().join("many.toml"), plant(slave.port(), devices, calculated)).expect("written");
        println!("{} polled, {calculated} calculated", devices * EACH);
        let own = std::env::current_exe().expect("this program");
        let seconds = number(0, 30).to_string();
        let done = Command::new(own).args(["calculated", "station"]).arg(folder.path()).arg(seconds).status();
        assert!(done.expect("a process").success());
    }
}

/// A device with registers.
fn meter() -> String {
    let mut text = "vendor = \"bench\"\nmodel = \"meter\"\nrevision = \"1\"\nstatus = \"partial\"\nsource = \"none\"\naddress_base = 0\n\
        functions = [4]\n[default]\ntable = \"input\"\ntype = \"uint16\"\nmin = 0\nmax = 65535\npoll = \"fast\"\nconfidence = \"high\"\n\
        group = \"Registers\"\nmeaning = \"a register\"\nsource = \"none\"\n"
        .to_owned();
    for address in 0..EACH {
        write!(text, "[[tag]]\nname = \"R{address}\"\naddress = {address}\nlabel = \"register {address}\"\n")
            .expect("text");
    }
    text
}

/// Devices with as many calculated tags each; half of them of several tags, the others over time.
fn plant(port: u16, devices: u16, calculated: u16) -> String {
    let mut text = format!(
        "title = \"Many tags\"\ntime_zone = \"UTC\"\n[[line]]\nname = \"N1\"\nmode = \"tcp\"\nhost = \"127.0.0.1\"\ntcp_port = {port}\n"
    );
    for device in 1..=devices {
        write!(text, "[[device]]\nname = \"D{device}\"\ntitle = \"meter {device}\"\nprofile = \"meter\"\nline = \"N1\"\nunit = {device}\nfast = \"1s\"\nslow = \"10s\"\ntag = [\n")
            .expect("text");
        for number in 0..calculated / devices {
            let next = number + 1;
            let expr = match number % 2 {
                0 => format!("max(R{number} - R{next}, 0) + (R{number} + R{next}) / 2"),
                _ => format!("integral(R{number} / 1000)"),
            };
            writeln!(text, "{{ name = \"C{number}\", expr = \"{expr}\", decimals = 1, group = \"Calculated\", label = \"calculated {number}\", meaning = \"of registers\" }},")
                .expect("text");
        }
        text.push_str("]\n");
    }
    text
}

/// The station alone: links, plant and history as in a running one.
fn run(folder: &Path, seconds: u64) {
    let def = profile::load(&folder.join("many.toml"), &Search::shipped()).expect("a plant");
    let clock = Clock::real();
    let handle = history::start(&folder.join("many.duckdb"), def.clone(), clock).expect("started");
    let runtime =
        tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build().expect("a runtime");
    let records = handle.records.clone();
    let observer = move |batch: &[Record]| _ = offer(&records, batch.to_vec());
    let connectors = def.lines.iter().map(|line| Connector::Real(line.transport.clone())).collect();
    let station =
        runtime.block_on(async { station::start_transient(def.clone(), clock, connectors, Box::new(observer)) });
    thread::sleep(SETTLE);
    let counts = Counts::default();
    let (rows, cpu, began) = (handle.status.borrow().rows, cpu_s(), Instant::now());
    thread::scope(|scope| {
        let watcher = scope.spawn(|| commits(&handle, clock, &counts));
        thread::sleep(Duration::from_secs(seconds));
        counts.stop.store(true, Ordering::Relaxed);
        spread("  commit", watcher.join().expect("times"));
    });
    let took = began.elapsed().as_secs_f64();
    let (status, cpu) = (handle.status.borrow().clone(), cpu_s() - cpu);
    println!(
        "  {:.0} rows a second, {:.2} % of a core, {} MB resident; lost {}, trouble {:?}",
        (status.rows - rows) as f64 / took,
        cpu / took * 100.0,
        memory_kb("VmRSS") / 1_000,
        status.lost,
        status.trouble
    );
    runtime.block_on(station.stop());
    handle.stop();
}

fn cpu_s() -> f64 {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}

/// Registers that have another value every second.
#[derive(Clone)]
struct Counting;

impl Registers for Counting {
    fn functions(&self) -> &[u8] {
        &[0x04]
    }

    fn limits(&self) -> Limits {
        Limits::STANDARD
    }

    fn bit(&self, _: Table, _: u16) -> Result<bool, ExceptionCode> {
        Ok(false)
    }

    fn write_bit(&mut self, _: u16, _: bool) -> Result<(), ExceptionCode> {
        Ok(())
    }

    fn word(&self, _: Table, address: u16) -> Result<u16, ExceptionCode> {
        static BEGAN: OnceLock<Instant> = OnceLock::new();
        let tenths = BEGAN.get_or_init(Instant::now).elapsed().as_millis() / 100;
        Ok((tenths as u16).wrapping_mul(7).wrapping_add(address.wrapping_mul(661)))
    }

    fn write_word(&mut self, _: u16, _: u16) -> Result<(), ExceptionCode> {
        Ok(())
    }
}

fn answer(message: &[u8]) -> Option<Vec<u8>> {
    let (&unit, request) = message.split_first()?;
    let mut reply = pdu::serve(&mut Counting, request)?;
    reply.insert(0, unit);
    Some(reply)
}
