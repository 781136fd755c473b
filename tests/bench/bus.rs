//! How close the bus comes to the wire, against a bare libmodbus loop in C on the same slaves; prints ratios of one run.
//!
//! `cargo bench --bench bus` runs all parts, `cargo bench --bench bus -- dead overload tcp` these (others: cycle, station).
#![allow(clippy::print_stdout, clippy::unwrap_used, missing_docs)]
#![allow(clippy::cast_lossless, clippy::cast_possible_truncation, clippy::cast_sign_loss)]

#[path = "bus/limits.rs"]
mod limits;
mod support;

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
    sync::Arc,
    time::{Duration, Instant},
};

use jiff::Timestamp;
use rustix::time::{ClockId, clock_gettime};
use sightglass::api::{
    bus::{Clock, Connector, LiveReads, Requests, task},
    plant::{
        ByteOrder, DataType, DeviceDef, DeviceId, Event, Limits, LineDef, LineId, PlantDef, Point, Poll, Serial, Table,
        TagDef, TagId, Transport,
    },
    station,
};
use support::{PacedSlave, TcpSlave};
use tokio::sync::{mpsc, watch};

const BLOCKS: u16 = 10;
const WORDS: u16 = 10;
/// The first second opens ports and files.
const WARM: Duration = Duration::from_secs(1);
/// Blocks of the plans that are read over TCP.
const PLANS: [u16; 4] = [100, 1_000, 3_000, 10_000];
/// Blocks of one device there.
const EACH: u16 = 1_000;

fn main() {
    let wanted: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with('-')).collect();
    let part = |name: &str| wanted.is_empty() || wanted.iter().any(|word| word == name);
    let libmodbus = libmodbus_loop();
    if libmodbus.is_none() {
        println!("libmodbus is not there (Debian package libmodbus-dev, cc): its rows are left out");
    }
    if part("cycle") {
        cycle(libmodbus.as_deref());
    }
    if part("dead") {
        limits::dead(libmodbus.as_deref());
    }
    if part("overload") {
        limits::overload(libmodbus.as_deref());
    }
    if part("tcp") {
        tcp(libmodbus.as_deref());
    }
    if part("station") {
        whole_station();
    }
}

/// Cycle of 10 blocks of 10 registers over the wire's own minimum, with a whole station at work.
fn cycle(libmodbus: Option<&Path>) {
    println!("cycle over the wire's minimum, 10 blocks of 10 registers, 8N1 paced:");
    for baud in [9_600, 19_200, 115_200] {
        let serial = Serial { baud, ..Serial::USUAL };
        let transaction = serial.char_time() * (8 + 5 + 2 * u32::from(WORDS)) + 2 * serial.silent_interval();
        let minimum = transaction * u32::from(BLOCKS);
        let over = minimum * 20;
        let (path, slave) = PacedSlave::start(baud);
        let def = plant(vec![Transport::rtu(path.to_str().unwrap(), serial)], 1, BLOCKS, Duration::from_millis(1), 1);
        let ((from, to), seconds) = measured_station(def, WARM, over, || slave.served());
        let ours = seconds / ((to - from) as f64 / f64::from(BLOCKS)) / minimum.as_secs_f64();
        let hasty = slave.hasty();
        let theirs = libmodbus.map(|program| {
            let (path, _slave) = PacedSlave::start(baud);
            let run = run_loop(program, &["rtu", path.to_str().unwrap(), &baud.to_string(), &seconds_of(over)]);
            run.seconds / (run.transactions / f64::from(BLOCKS)) / minimum.as_secs_f64()
        });
        let theirs = theirs.map_or("–".into(), |ratio| format!("{ratio:.3}"));
        println!(
            "  {baud:6} baud: minimum {:.1} ms, sightglass {ours:.3} ({hasty} too hasty), libmodbus {theirs}",
            minimum.as_secs_f64() * 1e3
        );
    }
}

/// Transactions a second and CPU for each, over loopback: the line task alone, events drained.
fn tcp(libmodbus: Option<&Path>) {
    println!("Modbus TCP over loopback, reads of 10 registers (median of 3):");
    let theirs = libmodbus.map(|program| {
        median(|| {
            let port = TcpSlave::start().port().to_string();
            let run = run_loop(program, &["tcp", "127.0.0.1", &port, "2"]);
            (run.transactions / run.seconds, run.cpu / run.transactions)
        })
    });
    if let Some((rate, cpu)) = theirs {
        println!("  libmodbus loop        {rate:9.0} /s  {:5.1} µs CPU each", cpu * 1e6);
    }
    for (in_flight, blocks) in [1, 16].into_iter().flat_map(|flight| PLANS.map(|blocks| (flight, blocks))) {
        let (rate, cpu) = median(|| line_task(in_flight, blocks));
        let ratio = theirs.map_or("–".into(), |(base, _)| format!("{:.2}", rate / base));
        println!(
            "  sightglass, {in_flight:2} at once, {blocks:6} blocks {rate:9.0} /s  {:5.1} µs CPU each, {ratio} of libmodbus",
            cpu * 1e6
        );
    }
}

/// CPU and wake-ups of a station with 10 lines and 10,000 tags at 1 s, and of one that has nothing to do.
fn whole_station() {
    let lines = |count: usize| -> Vec<Transport> {
        (0..count).map(|_| Transport::tcp("127.0.0.1", TcpSlave::start().port())).collect()
    };
    for (what, lines, devices, period) in [
        ("10 lines, 10,000 tags at 1 s (the slaves' CPU is in it)", lines(10), 10, Duration::from_secs(1)),
        ("1 line, 100 tags at 1 h (idle)", lines(1), 1, Duration::from_secs(3_600)),
    ] {
        let def = plant(lines, devices, BLOCKS, period, 1);
        let tags = def.tags.len();
        let ((before, after), seconds) =
            measured_station(def, WARM, Duration::from_secs(10), || (cpu(ClockId::ProcessCPUTime), wakeups()));
        let (cpu, wakeups) = (after.0 - before.0, after.1.saturating_sub(before.1));
        println!("station with {what}, {tags} tags:");
        println!("  {:.2} % of a core, {:.0} wake-ups a second", cpu / seconds * 100.0, wakeups as f64 / seconds);
    }
}

/// A plant of so many devices on each line, each with so many blocks of 10 registers, 20 apart.
fn plant(lines: Vec<Transport>, devices: u16, blocks: u16, period: Duration, in_flight: u16) -> Arc<PlantDef> {
    let toml = "title = \"bench\"\ntime_zone = \"UTC\"\n[[line]]\nname = \"L\"\nmode = \"tcp\"\nhost = \"x\"\n\
        [[device]]\nname = \"D\"\nline = \"L\"\nunit = 1\nprofile = \"number\"\n";
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("bench.toml"), toml).unwrap();
    fs::write(folder.path().join("number.toml"), include_str!("../peers/number.toml")).unwrap();
    let search = sightglass::api::profile::Search::usual();
    let base = sightglass::api::profile::load(&folder.path().join("bench.toml"), &search).unwrap();
    let mut def = PlantDef::clone(&base);
    let device = def.devices[0].clone();
    def.alarms.clear();
    def.lines.clear();
    def.devices.clear();
    def.tags.clear();
    def.trends.clear();
    for (line, transport) in lines.into_iter().enumerate() {
        let id = LineId(line as u16);
        let timeout = Duration::from_millis(300);
        def.lines.push(LineDef { timeout, ..LineDef::new(id, &format!("L{line}"), transport) });
        for unit in 1..=devices {
            let device_id = DeviceId(def.devices.len() as u16);
            let limits = Limits { gap_registers_max: WORDS - 2, in_flight_max: in_flight, ..Limits::STANDARD };
            let name = format!("L{line}U{unit}");
            def.devices.push(DeviceDef {
                id: device_id,
                name: name.clone(),
                line: id,
                unit: unit as u8,
                limits,
                gap: Duration::ZERO,
                write_gap: Duration::ZERO,
                faceplate: None,
                actions: Vec::new(),
                ..device.clone()
            });
            // There are no more than 65,536 tags: of the blocks of a great plan the first and the last register have one.
            let step = if blocks <= BLOCKS { 1 } else { usize::from(WORDS) - 1 };
            let words = |block: u16| (0..WORDS).step_by(step).map(move |word| 20 * block + word);
            for address in (0..blocks).flat_map(words) {
                let point =
                    Point { table: Table::Holding, address, kind: DataType::U16, order: ByteOrder::Abcd, field: None };
                let tag_id = TagId(def.tags.len() as u16);
                let poll = Poll::Every(period);
                let fresh = TagDef::new(tag_id, device_id, &format!("{name}.R{address}"), point);
                def.tags.push(TagDef { poll, ..fresh });
            }
        }
    }
    Arc::new(def)
}

/// Runs a whole station for a while after a time `warm`; gives what `look` sees at the beginning and at the end of it, and the
/// seconds.
fn measured_station<T>(def: Arc<PlantDef>, warm: Duration, over: Duration, look: impl Fn() -> T) -> ((T, T), f64) {
    with_station(def, || {
        std::thread::sleep(warm);
        let (from, start) = (look(), Instant::now());
        std::thread::sleep(over);
        ((from, look()), start.elapsed().as_secs_f64())
    })
}

/// Runs a whole station with history and a terminal until `during` returns.
fn with_station<T>(def: Arc<PlantDef>, during: impl FnOnce() -> T) -> T {
    let folder = tempfile::tempdir().unwrap();
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build().unwrap();
    runtime.block_on(async {
        let connectors = def.lines.iter().map(|line| Connector::Real(line.transport.clone())).collect();
        let history = folder.path().join("bench.duckdb");
        let options = station::Options { def, clock: Clock::real(), history, connectors, file: None };
        let running = station::start(options).unwrap();
        let mut session = running.session("bench");
        // A terminal that takes every snapshot.
        let terminal = tokio::spawn(async move { while session.snapshots.changed().await.is_ok() {} });
        let result = tokio::task::block_in_place(during);
        terminal.abort();
        running.stop().await;
        result
    })
}

/// The task of one line with so many blocks, always due, for two seconds: transactions a second, CPU seconds each.
fn line_task(in_flight: u16, blocks: u16) -> (f64, f64) {
    let transport = Transport::tcp("127.0.0.1", TcpSlave::start().port());
    let def =
        plant(vec![transport.clone()], blocks.div_ceil(EACH), blocks.min(EACH), Duration::from_millis(1), in_flight);
    let addresses: Vec<f64> = def.tags.iter().map(|tag| f64::from(tag.point.address)).collect();
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
    runtime.block_on(async {
        let (sender, mut events) = mpsc::channel(256);
        let (_requests, queue) = mpsc::channel(1);
        let (_stop, stopped) = watch::channel(false);
        let clock = Clock::starting_at(Timestamp::now(), 1.0);
        tokio::spawn(async move {
            let mut connector = Connector::Real(transport);
            task::run(
                def,
                LineId(0),
                clock,
                &mut connector,
                sender,
                &mut Requests::new(queue),
                &mut LiveReads::new(mpsc::channel(1).1),
                stopped,
                &[],
            )
            .await;
        });
        // A task of its own receives the events, as in the station: to wake the future of `block_on` costs a system call.
        let drain = async move {
            let (mut reads, start, used) = (0u64, Instant::now(), cpu(ClockId::ThreadCPUTime));
            while start.elapsed() < Duration::from_secs(2) {
                match events.recv().await.unwrap() {
                    Event::Read { values, .. } => {
                        assert!(values.iter().all(|(tag, raw)| addresses[tag.index()] == *raw));
                        reads += 1;
                    }
                    Event::Failed { fault, .. } => panic!("{fault}"),
                    _ => {}
                }
            }
            let (cpu, seconds) = (cpu(ClockId::ThreadCPUTime) - used, start.elapsed().as_secs_f64());
            (reads as f64 / seconds, cpu / reads as f64)
        };
        tokio::spawn(drain).await.unwrap()
    })
}

fn median(run: impl Fn() -> (f64, f64)) -> (f64, f64) {
    let mut runs = [run(), run(), run()];
    runs.sort_by(|a, b| a.0.total_cmp(&b.0));
    runs[1]
}

fn cpu(clock: ClockId) -> f64 {
    let time = clock_gettime(clock);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}

/// Voluntary context switches of all threads of this process.
fn wakeups() -> u64 {
    let threads = fs::read_dir("/proc/self/task").unwrap().flatten();
    let of = |status: String| -> u64 {
        let line = status.lines().find_map(|line| line.strip_prefix("voluntary_ctxt_switches:").map(str::to_owned));
        line.and_then(|count| count.trim().parse().ok()).unwrap_or(0)
    };
    threads.filter_map(|thread| fs::read_to_string(thread.path().join("status")).ok()).map(of).sum()
}

/// What the loop in C has done.
struct Loop {
    transactions: f64,
    seconds: f64,
    cpu: f64,
}

fn run_loop(program: &Path, args: &[&str]) -> Loop {
    let output = Command::new(program).args(args).output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    let numbers: Vec<f64> = text.split_whitespace().map(|word| word.parse().unwrap()).collect();
    let [transactions, seconds, cpu] = numbers[..] else {
        panic!("libmodbus: {text}{}", String::from_utf8_lossy(&output.stderr))
    };
    Loop { transactions, seconds, cpu }
}

/// Builds the loop; `None` without compiler or library.
fn libmodbus_loop() -> Option<PathBuf> {
    let program = Path::new(env!("CARGO_TARGET_TMPDIR")).join("libmodbus-loop");
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/bench/libmodbus_loop.c");
    let mut cc = Command::new("cc");
    cc.args(["-O2", "-I/usr/include/modbus"]).arg(source).args(["-lmodbus", "-o"]).arg(&program);
    cc.status().is_ok_and(|status| status.success()).then_some(program)
}

fn seconds_of(span: Duration) -> String {
    format!("{:.3}", span.as_secs_f64())
}
