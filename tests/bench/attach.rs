//! What twenty terminals cost a station whose tags all change every second; prints CPU, memory, bytes and delays.
//!
//! `cargo bench --bench attach -- 10000 4`: a minute, for 10,000 tags on 4 lines (1,000 on 1 without arguments). Terminals
//! are processes of their own, so the CPU is the station's alone.
#![allow(clippy::print_stdout, clippy::unwrap_used, missing_docs)]
#![allow(clippy::cast_lossless, clippy::cast_possible_truncation, clippy::cast_sign_loss)]

#[path = "support/many.rs"]
mod many;

use std::{
    fs,
    io::{Read, Write},
    os::unix::net::UnixStream,
    path::Path,
    process::{Child, Command, Stdio},
    sync::Arc,
    time::Duration,
};

use jiff::Timestamp;
use many::{TAGS_EACH, plant, tags_of};
use rustix::time::{ClockId, clock_gettime};
use sightglass::api::{
    access::{Completion, Durability, SessionRequest, SessionStatus},
    attach::{
        connect, listen,
        protocol::{self, HANDSHAKE_BYTES_MAX, Handshake, TerminalOrigin},
    },
    plant::{
        DeviceId, Event, Exchange, Frame, FrameResult, Framing, LineReport, LineState, Plant, PlantDef, Poll,
        PollClass, PollReport, RequestStats, Table,
    },
    station::{Request, SessionAcceptor},
};
use tokio::{sync::watch, time::interval};

const TERMINALS: usize = 20;
/// Seconds of each part.
const PART: u64 = 10;

fn main() {
    let words: Vec<String> = std::env::args().collect();
    let after = |name: &str| words.iter().position(|word| word == name).map(|at| Path::new(&words[at + 1]));
    let mut numbers = words.iter().filter_map(|word| word.parse::<u16>().ok());
    match (after("terminal"), after("viewer")) {
        (Some(path), _) => terminal(path),
        (None, Some(path)) => runtime().block_on(viewer(path)),
        (None, None) => station(numbers.next().unwrap_or(1_000) / TAGS_EACH, numbers.next().unwrap_or(1)),
    }
}

fn runtime() -> tokio::runtime::Runtime {
    tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build().unwrap()
}

/// A terminal without a screen: prints what the snapshots of ten seconds cost it, and how long things take.
async fn viewer(path: &Path) {
    let began = std::time::Instant::now();
    let mut session = connect(path).await.unwrap();
    println!("a terminal has its first snapshot after {:.1} ms", began.elapsed().as_secs_f64() * 1e3);
    let (used, began, mut count, mut late, mut answers) = (cpu(), std::time::Instant::now(), 0, 0.0, Vec::new());
    while began.elapsed() < Duration::from_secs(PART) {
        session.snapshots.changed().await.unwrap();
        late += Timestamp::now().duration_since(session.snapshots.borrow_and_update().at).as_secs_f64();
        count += 1;
        let asked = std::time::Instant::now();
        session.request(SessionRequest::Logout).await.unwrap();
        answers.push(asked.elapsed().as_secs_f64() * 1e3);
    }
    answers.sort_by(f64::total_cmp);
    let each = (cpu() - used) / f64::from(count) * 1e3;
    println!("  {each:.2} ms of CPU for each of {count} snapshots, {:.0} ms old", late / f64::from(count) * 1e3);
    println!(
        "  a request is answered in {:.2} ms, at worst {:.2} ms",
        answers[count as usize / 2],
        answers.last().unwrap()
    );
}

/// Reads whatever comes and says how much that was, each second.
fn terminal(path: &Path) {
    let mut stream = UnixStream::connect(path).unwrap();
    let handshake = protocol::encode(&(Handshake::current(), TerminalOrigin::default()), HANDSHAKE_BYTES_MAX);
    stream.write_all(&handshake.unwrap()).unwrap();
    let mut total = 0;
    let mut bytes = vec![0; 1 << 20];
    while let Ok(count) = stream.read(&mut bytes)
        && count != 0
    {
        total += count;
        // The last number is what counts; a reader that has gone is no harm.
        let _ = fs::write(path.with_extension(std::process::id().to_string()), total.to_string());
    }
}

fn station(devices: u16, lines: u16) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bench.sock");
    runtime().block_on(async {
        let def = plant(devices, lines);
        let plant = Plant::new(def.clone(), Timestamp::now(), 1.0);
        let (publish, snapshots) = watch::channel(Arc::new(plant.snapshot()));
        let (acceptor, mut attach_requests, mut requests) = SessionAcceptor::new(snapshots);
        let mut listener = listen(&path).unwrap();
        tokio::spawn(async move { listener.serve(&acceptor).await });
        tokio::spawn(async move {
            let mut there = Vec::new();
            while let Some(request) = attach_requests.recv().await {
                request.status.send_replace(Arc::new(SessionStatus { may_view: true, ..SessionStatus::default() }));
                there.push(request.status);
            }
        });
        tokio::spawn(async move {
            while let Some((_, request)) = requests.recv().await {
                let Request::SessionRequest(_, reply) = request else { continue };
                let _ = reply.send(Ok(Completion::new(Durability::Recorded, None)));
            }
        });
        tokio::spawn(live(plant, def, publish));
        tokio::time::sleep(Duration::from_secs(2)).await;
        part("no terminal", &[]).await;
        let mut terminals = Vec::new();
        for _ in 0..TERMINALS {
            terminals.push(start("terminal", &path));
            // The station drops connections without a handshake when too many come at once.
            tokio::time::sleep(Duration::from_millis(100)).await;
        }
        tokio::time::sleep(Duration::from_secs(2)).await;
        let files: Vec<_> = terminals.iter().map(|child| path.with_extension(child.id().to_string())).collect();
        part("20 terminals", &files).await;
        signal(&terminals[0], "STOP");
        part("20 terminals, one of them stopped: the others", &files[1..]).await;
        start("viewer", &path).wait().unwrap();
        for child in &mut terminals {
            signal(child, "KILL");
            child.wait().unwrap();
        }
    });
}

/// Each tag has another value every second, a tenth of the devices at a time; a snapshot after each tenth.
async fn live(mut plant: Plant, def: Arc<PlantDef>, publish: watch::Sender<Arc<sightglass::api::plant::Snapshot>>) {
    let mut tick = interval(Duration::from_millis(100));
    let mut reports: Vec<LineReport> = def.lines.iter().map(|line| LineReport::new(line.clone())).collect();
    for line in &def.lines {
        let own = def.devices.iter().filter(|device| device.line == line.id);
        reports[line.id.index()].polls = own.map(|device| poll(device.id)).collect();
        plant.on_event(Event::Line { at: Timestamp::now(), line: line.id, state: LineState::Connected });
    }
    let mut number = 0;
    for round in 0u64.. {
        tick.tick().await;
        let at = Timestamp::now();
        for device in def.devices.iter().filter(|device| u64::from(device.id.0) % 10 == round % 10) {
            let (request, answer): (Arc<[u8]>, Arc<[u8]>) = ([1; 8].into(), [2; 205].into());
            let raw = |tag: u16| (round * 7 + u64::from(tag)) as f64 % 60_000.0;
            let values = tags_of(device.id.0).map(|tag| (tag, raw(tag.0).into())).collect();
            let response_time = Duration::from_millis(12);
            let (framing, outcome, tries) = (Framing::Rtu, Ok(()), 1);
            let (sent, got) = (request.clone(), answer.clone());
            let exchange =
                Exchange { at, framing, request, answer, outcome, response_time: Some(response_time), tries };
            let exchange = Some(Arc::new(exchange));
            plant.on_event(Event::Read { at, device: device.id, values, texts: Vec::new(), response_time, exchange });
            let report = &mut reports[device.line.index()];
            let poll = report.polls.iter_mut().find(|poll| poll.device == device.id).unwrap();
            poll.stats.count(Ok(()), Some(response_time + Duration::from_millis(round % 9)));
            poll.next = Some(at + jiff::SignedDuration::from_secs(1));
            let frame = |bytes, sent, number| Frame {
                at,
                sent,
                bytes,
                framing,
                result: FrameResult::Good,
                unit: Some(1),
                number,
            };
            number += 2;
            report.frames.extend(vec![frame(sent, true, number - 1), frame(got, false, number)]);
        }
        if round % 10 == 0 {
            for report in &mut reports {
                report.counters.requests = round;
                report.busy.push(0.5 + (round % 3) as f32);
                report.busy.drain(..report.busy.len().saturating_sub(60));
                plant.on_event(Event::Report { at, line: report.settings.id, report: Arc::new(report.clone()) });
            }
            plant.on_tick(at);
        }
        publish.send_replace(Arc::new(plant.snapshot()));
    }
}

/// Waits and prints what that has cost, and what each of these terminals has read.
async fn part(what: &str, files: &[std::path::PathBuf]) {
    let read = || -> Vec<u64> {
        files.iter().map(|file| fs::read_to_string(file).ok().and_then(|text| text.parse().ok()).unwrap_or(0)).collect()
    };
    let (before, used) = (read(), cpu());
    tokio::time::sleep(Duration::from_secs(PART)).await;
    let share = (cpu() - used) / PART as f64 * 100.0;
    let rates: Vec<u64> = read().iter().zip(&before).map(|(now, then)| now.saturating_sub(*then) / PART).collect();
    println!("{what}: {share:.2} % of a core, {} MiB", resident_mib());
    if let (Some(least), Some(most)) = (rates.iter().min(), rates.iter().max()) {
        println!("  {least} to {most} bytes a second for each terminal");
    }
}

fn start(role: &str, path: &Path) -> Child {
    let program = std::env::current_exe().unwrap();
    Command::new(program).arg(role).arg(path).stdin(Stdio::null()).spawn().unwrap()
}

fn signal(child: &Child, name: &str) {
    assert!(Command::new("kill").args([&format!("-{name}"), &child.id().to_string()]).status().unwrap().success());
}

fn cpu() -> f64 {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}

fn resident_mib() -> u64 {
    let pages = fs::read_to_string("/proc/self/statm").unwrap();
    pages.split(' ').nth(1).and_then(|pages| pages.parse::<u64>().ok()).unwrap() * 4 / 1_024
}

fn poll(device: DeviceId) -> PollReport {
    PollReport {
        device,
        table: Table::Holding,
        address: 0,
        count: TAGS_EACH,
        tags: tags_of(device.0).collect::<Vec<_>>().into(),
        poll: Poll::Every(Duration::from_secs(1)),
        cost: Duration::from_millis(50),
        class: PollClass::Normal,
        factor: 1.0,
        shed: false,
        next: None,
        stats: RequestStats::default(),
    }
}
