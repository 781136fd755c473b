//! Serial lines at their limit beside a libmodbus master on lines of its own, all at the same time: units that die, and more
//! polls than the wire can carry.

use std::{
    path::Path,
    process::{Child, Command, Stdio},
    sync::Arc,
    thread,
    time::{Duration, Instant},
};

use sightglass::api::plant::{PlantDef, Poll, PollClass, Serial, Transport};

use super::{WORDS, plant, support::PacedSlave, with_station};

const SERIAL: Serial = Serial { baud: 19_200, ..Serial::USUAL };
/// How long an answer is waited for, by both masters.
const TIMEOUT: Duration = Duration::from_secs(1);
/// Units of a line on which some die, and how often each is read.
const UNITS: u8 = 8;
const PERIOD: Duration = Duration::from_millis(250);
/// A unit is known after 32 answers.
const KNOWN_AFTER: usize = 12;
/// What dies when, in seconds.
const DEATHS: [(&str, &[(u8, usize)]); 5] = [
    ("one dies", &[(8, KNOWN_AFTER)]),
    ("three die", &[(3, KNOWN_AFTER), (5, KNOWN_AFTER), (8, KNOWN_AFTER)]),
    ("four die, 10 s apart", &[(2, KNOWN_AFTER), (4, KNOWN_AFTER + 10), (6, KNOWN_AFTER + 20), (8, KNOWN_AFTER + 30)]),
    ("one dead from the start", &[(3, 0)]),
    ("three dead from the start", &[(3, 0), (5, 0), (8, 0)]),
];
/// What the polls want of the wire, in hundredths.
const DEMANDS: [u32; 4] = [102, 115, 153, 300];
/// Normal units of an overloaded line: four each at one, two and four times the shortest period; one critical unit beside them.
const NORMAL: u8 = 12;
const CRITICAL_PERIOD: Duration = Duration::from_secs(1);
/// Overload is known, and the costs are measured, after this time; then it is counted for so long.
const SETTLED_AFTER: usize = 15;
const COUNTED_FOR: usize = 30;

/// A line with its paced slave, and what each unit has answered by the end of each second.
struct Paced {
    port: String,
    slave: PacedSlave,
    answered: Vec<[u64; 64]>,
}

impl Paced {
    fn start() -> Paced {
        let (path, slave) = PacedSlave::start_on(SERIAL);
        Paced { port: path.to_str().unwrap().to_owned(), slave, answered: Vec::new() }
    }

    /// Answers of a unit from one second to another.
    fn answers(&self, unit: u8, from: usize, to: usize) -> f64 {
        let at = |second: usize| self.answered[second][usize::from(unit)];
        (at(to) - at(from)) as f64
    }
}

/// What a unit wants: read so often.
type Unit = (u8, Duration);

/// Runs the station and, if it is there, a libmodbus master on each of these sets of units for so many seconds; gives the
/// station's lines and libmodbus'. `each_second` sees every line at the beginning of each second.
fn run(
    sets: &[Vec<Unit>],
    seconds: usize,
    libmodbus: Option<&Path>,
    mut def: PlantDef,
    each_second: impl Fn(usize, usize, &PacedSlave),
) -> [Vec<Paced>; 2] {
    let mut ours: Vec<Paced> = sets.iter().map(|_| Paced::start()).collect();
    let mut theirs: Vec<Paced> = libmodbus.iter().flat_map(|_| sets.iter().map(|_| Paced::start())).collect();
    for (line, paced) in def.lines.iter_mut().zip(&ours) {
        line.transport = Transport::rtu(&paced.port, SERIAL);
        line.timeout = TIMEOUT;
    }
    // Those that are dead from the start.
    let both = |ours: &[Paced], theirs: &[Paced], second| {
        for lines in [ours, theirs] {
            lines.iter().enumerate().for_each(|(case, paced)| each_second(second, case, &paced.slave));
        }
    };
    both(&ours, &theirs, 0);
    with_station(Arc::new(def), || {
        let masters = libmodbus.into_iter().flat_map(|program| {
            sets.iter().zip(&theirs).map(move |(units, paced)| master(program, &paced.port, units, seconds + 1))
        });
        let mut masters: Vec<Child> = masters.collect();
        let start = Instant::now();
        for second in 0..=seconds {
            thread::sleep((start + Duration::from_secs(second as u64)).saturating_duration_since(Instant::now()));
            both(&ours, &theirs, second);
            ours.iter_mut().chain(&mut theirs).for_each(|paced| paced.answered.push(paced.slave.served_by_unit()));
        }
        for master in &mut masters {
            assert!(master.wait().unwrap().success(), "the libmodbus master failed");
        }
    });
    [ours, theirs]
}

/// A libmodbus master that reads each unit in its period, and all of them in their order when it is late.
fn master(program: &Path, port: &str, units: &[Unit], seconds: usize) -> Child {
    let mut command = Command::new(program);
    command.args(["poll", port, &SERIAL.baud.to_string(), &seconds.to_string()]);
    command.arg(TIMEOUT.as_millis().to_string());
    command.args(units.iter().map(|(unit, period)| format!("{unit}:{}", period.as_micros())));
    command.stdout(Stdio::null()).spawn().unwrap()
}

/// Rate of the healthy of eight units while others are dead, over the rate they should have.
pub fn dead(libmodbus: Option<&Path>) {
    let sets = vec![(1..=UNITS).map(|unit| (unit, PERIOD)).collect::<Vec<Unit>>(); DEATHS.len()];
    let lines = vec![Transport::rtu("", SERIAL); DEATHS.len()];
    let def = PlantDef::clone(&plant(lines, UNITS.into(), 1, PERIOD, 1));
    let dying = |second, case: usize, slave: &PacedSlave| {
        DEATHS[case].1.iter().filter(|(_, at)| *at == second).for_each(|(unit, _)| slave.kill(*unit));
    };
    let [ours, theirs] = run(&sets, KNOWN_AFTER + 60, libmodbus, def, dying);
    println!(
        "healthy units of eight at 19200 baud, 10 registers each 250 ms, timeout 1 s: share of their rate they keep"
    );
    println!(
        "  {:<28}{:>12}{:>12}{:>8}   {:>12}{:>12}{:>8}",
        "", "first 20 s", "libmodbus", "ratio", "first 60 s", "libmodbus", "ratio"
    );
    for (case, (what, deaths)) in DEATHS.iter().enumerate() {
        let since = deaths[0].1;
        let kept = |lines: &[Paced], span: usize| {
            let line = lines.get(case)?;
            let healthy = (1..=UNITS).filter(|unit| deaths.iter().all(|(dead, _)| dead != unit));
            let answers: f64 = healthy.map(|unit| line.answers(unit, since, since + span)).sum();
            let full = (usize::from(UNITS) - deaths.len()) as f64 * span as f64 / PERIOD.as_secs_f64();
            Some(answers / full)
        };
        let columns = [20, 60].map(|span| columns(kept(&ours, span).unwrap(), kept(&theirs, span)));
        println!("  {what:<28}{}   {}", columns[0], columns[1]);
    }
}

/// Use of the wire and shares of the polls where they want more than it can carry.
pub fn overload(libmodbus: Option<&Path>) {
    let read = SERIAL.char_time() * (8 + 5 + 2 * u32::from(WORDS)) + 2 * SERIAL.silent_interval();
    let critical = NORMAL + 1;
    let sets: Vec<Vec<Unit>> = DEMANDS.iter().map(|demand| wanted(*demand, read)).collect();
    let lines = vec![Transport::rtu("", SERIAL); DEMANDS.len()];
    let mut def = PlantDef::clone(&plant(lines, critical.into(), 1, PERIOD, 1));
    for tag in &mut def.tags {
        let device = &def.devices[tag.device.index()];
        let (unit, period) = sets[device.line.index()][usize::from(device.unit) - 1];
        tag.poll = Poll::Every(period);
        tag.class = if unit == critical { PollClass::Critical } else { PollClass::Normal };
    }
    let [ours, theirs] = run(&sets, SETTLED_AFTER + COUNTED_FOR, libmodbus, def, |_, _, _| {});
    println!(
        "overloaded line, 12 normal units and a critical one at 19200 baud, {:.1} ms a read on the wire:",
        read.as_secs_f64() * 1e3
    );
    println!(
        "  {:<28}{:>12}{:>12}{:>8}   normal units keep (libmodbus), critical one keeps (libmodbus)",
        "", "wire used", "libmodbus", "ratio"
    );
    for (case, units) in sets.iter().enumerate() {
        let answers = |line: &Paced, unit| line.answers(unit, SETTLED_AFTER, SETTLED_AFTER + COUNTED_FOR);
        let used = |line: &Paced| {
            let all: f64 = units.iter().map(|(unit, _)| answers(line, *unit)).sum();
            all * read.as_secs_f64() / COUNTED_FOR as f64
        };
        let kept = |line: &Paced| {
            let share = |(unit, period): &Unit| answers(line, *unit) * period.as_secs_f64() / COUNTED_FOR as f64;
            let (normal, critical) = units.split_at(usize::from(NORMAL));
            let shares: Vec<f64> = normal.iter().map(share).collect();
            let least = shares.iter().copied().fold(f64::MAX, f64::min);
            let most = shares.iter().copied().fold(0.0, f64::max);
            (format!("{least:.2}–{most:.2}"), format!("{:.2}", share(&critical[0])))
        };
        let ours = &ours[case];
        let (normal, critical) = kept(ours);
        let (their_normal, their_critical) = theirs.get(case).map_or(("–".into(), "–".into()), kept);
        println!(
            "  {:<28}{}   {normal} ({their_normal}), {critical} ({their_critical})",
            format!("demand {} %", DEMANDS[case]),
            columns(used(ours), theirs.get(case).map(used))
        );
    }
}

/// The units of a line with their periods, so that together they want so many hundredths of the wire.
fn wanted(demand: u32, read: Duration) -> Vec<Unit> {
    let critical_share = read.as_secs_f64() / CRITICAL_PERIOD.as_secs_f64();
    let shortest = read.mul_f64(f64::from(NORMAL / 3) * 1.75 / (f64::from(demand) / 100.0 - critical_share));
    let normal = (0..NORMAL).map(|n| (n + 1, shortest * (1 << (n / (NORMAL / 3)))));
    normal.chain([(NORMAL + 1, CRITICAL_PERIOD)]).collect()
}

/// A figure, that of libmodbus, and their ratio.
fn columns(ours: f64, theirs: Option<f64>) -> String {
    let (theirs, ratio) = match theirs {
        Some(theirs) => (format!("{theirs:.3}"), format!("{:.2}", ours / theirs)),
        None => ("–".to_owned(), "–".to_owned()),
    };
    format!("{ours:>12.3}{theirs:>12}{ratio:>8}")
}
