//! Every shipped profile and plant against the devices that its own text simulates: a minute, every fault, golden frames.

use std::{
    collections::{BTreeMap, BTreeSet},
    path::Path,
    sync::{Arc, Mutex},
    time::Duration,
};

use jiff::Timestamp;
use sightglass::api::{
    bus::{Clock, Connector, frame::with_crc},
    plant::{Access, CommandKind, LineDef, LineId, PlantDef, Poll, Snapshot, TagId},
    profile::{self, Kind, Search},
    sim::{InjectedFault, Service, Simulator, SimulatorHandle, TargetKind, serve_stream},
    station::{self, Session},
};
use tokio::{
    io::{AsyncReadExt, AsyncWriteExt, DuplexStream},
    sync::mpsc,
};

use crate::support::folder;

/// What a unit can do wrong on the wire. Each makes every value of the unit doubtful, and none of them wrong. An answer that
/// is only late must be later than any shipped line waits.
fn faults() -> impl Iterator<Item = InjectedFault> {
    let of_unit = InjectedFault::all().filter(|fault| fault.target_kind() == TargetKind::Unit);
    of_unit.map(|fault| {
        if matches!(fault, InjectedFault::Late(_)) { InjectedFault::Late(Duration::from_secs(3)) } else { fault }
    })
}

/// A fault is in force this long, which is longer than the slowest poll of any shipped file and its doubt.
const FAULTY: Duration = Duration::from_secs(120);
/// All is well again within this time of its end. A unit without loopback (function 08) that was late rests for up to ten
/// minutes, until no late answer can be taken for another one.
const CURED_MAX: Duration = Duration::from_secs(900);

fn load(name: &str) -> PlantDef {
    let plant = profile::check(Path::new(name), &Search::shipped()).unwrap_or_else(|errors| panic!("{errors}"));
    (*plant.plant).clone()
}

#[tokio::test(start_paused = true)]
async fn every_shipped_plant_is_simulated_and_survives_every_fault() {
    let listed = profile::list(&Search::shipped()).into_iter();
    let plants: Vec<String> = listed.filter(|listed| listed.kind == Kind::Plant).map(|listed| listed.name).collect();
    assert!(plants.len() >= 3, "the shipped plants were found");
    for name in plants {
        survive(&name, load(&name)).await;
    }
}

/// Devices of the library that are read in different ways; the others differ from them in their numbers.
const DEVICES: &[&str] = &[
    "delta_dtb",
    "delta_vfd_el",
    "eastron_sdm120",
    "eastron_sdm230",
    "eastron_sdm630",
    "fuji_pxr",
    "koyo_dl06",
    "nectec_urtu_rtd",
    "taie_fy",
];

/// Each device in a plant of its own, with every row of its map polled, also those that plants seldom need.
#[tokio::test(start_paused = true)]
async fn shipped_devices_are_simulated_and_survive_every_fault() {
    for name in DEVICES {
        let mut def = load(name);
        assert!(!def.tags.is_empty(), "{name} has tags");
        for tag in def.tags.iter_mut().filter(|tag| tag.access != Access::Write && tag.poll == Poll::Never) {
            tag.poll = Poll::Every(Duration::from_secs(10));
        }
        survive(name, def).await;
    }
}

async fn survive(name: &str, def: PlantDef) {
    let def = Arc::new(def);
    let folder = folder();
    let mut plant = Plant::start(&def, &folder.path().join("history.duckdb"));
    assert!(!plant.polled.is_empty(), "{name}: something is polled");
    plant.until_good(name, Duration::from_secs(60)).await;
    plant.watch(name, Duration::from_secs(60)).await;
    assert_eq!(plant.doubted(), Vec::<String>::new(), "{name}: after a minute without faults");
    for fault in faults() {
        plant.set_all(fault).await;
        plant.watch(&format!("{name}, {fault}"), FAULTY).await;
        assert_eq!(plant.trusted(), Vec::<String>::new(), "{name}, {fault}: still called good");
        plant.simulator.clear_all().await;
        plant.until_good(&format!("{name}, after {fault}"), CURED_MAX).await;
    }
}

/// A station on the simulated devices of its plant, over lines in memory.
struct Plant {
    def: Arc<PlantDef>,
    simulator: SimulatorHandle,
    session: Session,
    /// Tags that are read again and again.
    polled: Vec<TagId>,
    /// What each modelled tag truly was, lowest and highest, since it was last forgotten.
    truth: BTreeMap<TagId, (f64, f64)>,
    _station: station::Station,
}

impl Plant {
    fn start(def: &Arc<PlantDef>, history: &Path) -> Plant {
        let clock = Clock::starting_at(Timestamp::UNIX_EPOCH, 1.0);
        let simulator = SimulatorHandle::spawn(Simulator::new(def).unwrap(), clock);
        let connectors = def.lines.iter().map(|line| plug(&simulator, line)).collect();
        let options = station::Options { def: def.clone(), clock, history: history.to_owned(), connectors, file: None };
        let station = station::start(options).unwrap();
        let every = def.tags.iter().filter(|tag| matches!(tag.poll, Poll::Every(_))).map(|tag| tag.id).collect();
        let session = station.session("test");
        Plant { def: def.clone(), simulator, session, polled: every, truth: BTreeMap::new(), _station: station }
    }

    fn snapshot(&self) -> Arc<Snapshot> {
        self.session.snapshots.borrow().clone()
    }

    fn named(&self, wanted: impl Fn(&Snapshot, TagId) -> bool) -> Vec<String> {
        let snapshot = self.snapshot();
        let found = self.polled.iter().filter(|tag| wanted(&snapshot, **tag));
        found.map(|tag| format!("{} {:?}", self.def.tag(*tag).name, snapshot.sample(*tag))).collect()
    }

    fn doubted(&self) -> Vec<String> {
        self.named(|snapshot, tag| !snapshot.sample(tag).quality.is_good())
    }

    fn trusted(&self) -> Vec<String> {
        self.named(|snapshot, tag| snapshot.sample(tag).quality.is_good())
    }

    async fn set_all(&self, fault: InjectedFault) {
        for (line, unit) in self.simulator.units().collect::<Vec<_>>() {
            self.simulator.inject_into_unit(line, unit, fault).await;
        }
    }

    /// Watches second by second: whatever is called good is what the device truly holds or held a little while ago.
    async fn watch(&mut self, what: &str, time: Duration) {
        for _ in 0..time.as_secs() {
            self.second(what).await;
        }
    }

    async fn until_good(&mut self, what: &str, longest: Duration) {
        for _ in 0..longest.as_secs() {
            self.second(what).await;
            if self.doubted().is_empty() {
                return;
            }
        }
        panic!("{what}: not good after {longest:?}: {:?}", self.doubted());
    }

    /// Looks at what the devices really hold.
    async fn look(&mut self) {
        for tag in self.polled.clone() {
            if let Some(now) = self.simulator.value(tag).await {
                let (low, high) = self.truth.entry(tag).or_insert((now, now));
                (*low, *high) = (low.min(now), high.max(now));
            }
        }
    }

    async fn second(&mut self, what: &str) {
        self.look().await;
        tokio::time::sleep(Duration::from_secs(1)).await;
        self.look().await;
        let snapshot = self.snapshot();
        for (tag, (low, high)) in &self.truth {
            let def = self.def.tag(*tag);
            // What noise, of this tag or of those that it is made of, did between two looks.
            let noise = def.simulate.as_ref().map_or(0.0, |how| 2.0 * how.noise);
            let moves = def.simulate.as_ref().is_some_and(|how| how.motion.is_some());
            let slack = noise + if moves { 0.05 * (high - low) + 0.01 * high.abs().max(low.abs()) } else { 1e-6 };
            if let Some(value) = snapshot.sample(*tag).good_value() {
                let held = (low - slack..=high + slack).contains(&value);
                assert!(held, "{what}: {} shows {value}, the device held {low} to {high}", def.name);
            }
        }
    }
}

/// A port in memory that can be opened again and again, as the line reopens it.
fn plug(simulator: &SimulatorHandle, line: &LineDef) -> Connector {
    let (ports, streams) = mpsc::channel(2);
    let (units, framing) = (simulator.line(line.id), Service::new(line).tcp_framing());
    tokio::spawn(async move {
        loop {
            let (ours, theirs) = tokio::io::duplex(1024);
            if ports.send(ours).await.is_err() {
                return;
            }
            tokio::spawn(serve_stream(theirs, units.clone(), framing));
        }
    });
    Connector::Memory(streams)
}

/// A golden exchange: the requests that must leave the station, and what the wire answers in the device's place.
struct Golden<'a> {
    profile: &'a str,
    unit: u8,
    /// Tags that are polled; all others are not.
    polled: &'a [&'a str],
    /// Values that are written then.
    writes: &'a [(&'a str, f64)],
    /// Requests as the manuals and notes spell them, RTU with check.
    frames: &'a [&'a str],
    /// A request, its recorded reply (message without check), the tag that it is about and the value that it means.
    reply: Option<(&'a str, &'a str, &'a str, f64)>,
}

fn bytes(hex: &str) -> Vec<u8> {
    hex.split(' ').map(|byte| u8::from_str_radix(byte, 16).unwrap()).collect()
}

async fn check(golden: Golden<'_>) {
    let name = golden.profile;
    let loaded = profile::check(Path::new(name), &Search::shipped()).unwrap_or_else(|errors| panic!("{errors}"));
    let mut def = (*loaded.plant).clone();
    def.devices[0].unit = golden.unit;
    let full = |short: &str| format!("D-1.{short}");
    for tag in &mut def.tags {
        let polled = golden.polled.iter().any(|short| full(short) == tag.name);
        tag.poll = if polled { Poll::Every(Duration::from_secs(1)) } else { Poll::Never };
    }
    let def = Arc::new(def);
    let clock = Clock::starting_at(Timestamp::UNIX_EPOCH, 1.0);
    let simulator = SimulatorHandle::spawn(Simulator::new(&def).unwrap(), clock);
    let (port, theirs) = tokio::io::duplex(1024);
    let (ports, streams) = mpsc::channel(1);
    ports.try_send(port).unwrap();
    let asked = Arc::new(Mutex::new(Vec::new()));
    let recorded = golden.reply.map(|(request, reply, ..)| (bytes(request), with_crc(&bytes(reply))));
    tokio::spawn(listen(theirs, simulator, recorded, asked.clone()));
    let folder = folder();
    let options = station::Options {
        def: def.clone(),
        clock,
        history: folder.path().join("history.duckdb"),
        connectors: vec![Connector::Memory(streams)],
        file: None,
    };
    let station = station::start(options).unwrap();
    let session = station.session("test");
    tokio::time::sleep(Duration::from_secs(5)).await;
    for (number, (short, value)) in golden.writes.iter().enumerate() {
        let tag = def.tag_named(&full(short)).unwrap();
        session.send_command(number as u32, CommandKind::Write { tag, value: (*value).into() }).unwrap();
        tokio::time::sleep(Duration::from_secs(10)).await;
    }
    let asked: Vec<Vec<u8>> = asked.lock().unwrap().clone();
    for frame in golden.frames {
        let spelled = |frame: &Vec<u8>| frame.iter().map(|byte| format!("{byte:02X}")).collect::<Vec<_>>().join(" ");
        let said: BTreeSet<String> = asked.iter().map(spelled).collect();
        assert!(asked.contains(&bytes(frame)), "{name}: {frame} was not sent, but {said:#?}");
    }
    if let Some((.., short, value)) = golden.reply {
        let snapshot = session.snapshots.borrow().clone();
        let shown = snapshot.sample(def.tag_named(&full(short)).unwrap()).good_value();
        assert!(shown.is_some_and(|shown| (shown - value).abs() < 1e-4), "{name}: {short} shows {shown:?}");
    }
}

/// Answers each request in the device's name, or with what was recorded; keeps what was asked.
async fn listen(
    mut line: DuplexStream,
    simulator: SimulatorHandle,
    recorded: Option<(Vec<u8>, Vec<u8>)>,
    asked: Arc<Mutex<Vec<Vec<u8>>>>,
) {
    let mut buffer = [0; 300];
    while let Ok(count @ 4..) = line.read(&mut buffer).await {
        // The station writes a request in one piece.
        let request = buffer[..count].to_vec();
        let answer = match &recorded {
            Some((frame, reply)) if *frame == request => Some(reply.clone()),
            _ => simulator.ask(LineId(0), request[0], &request[1..count - 2]).await.map(|answer| answer.rtu()),
        };
        asked.lock().unwrap().push(request);
        if let Some(answer) = answer {
            line.write_all(&answer).await.unwrap();
        }
    }
}

#[tokio::test(start_paused = true)]
async fn the_requests_are_those_of_the_manuals_and_recorded_frames() {
    let plain = Golden { profile: "", unit: 1, polled: &[], writes: &[], frames: &[], reply: None };
    check(Golden {
        profile: "fuji_pxr",
        polled: &["PV", "SV.USED", "DV", "MV", "MV2", "ALARM", "FAULT", "CT"],
        frames: &["01 04 03 E8 00 0A F0 7D", "01 06 03 EB 00 01 38 7A", "01 06 03 EB 00 00 F9 BA"],
        writes: &[("STBY", 1.0), ("STBY", 0.0)],
        ..plain
    })
    .await;
    check(Golden {
        profile: "fuji_pxr",
        polled: &["CTRL", "STBY", "AT", "P", "I", "D", "COOL", "DB"],
        frames: &["01 03 03 E9 00 0A 14 7D"],
        ..plain
    })
    .await;
    check(Golden {
        profile: "fuji_pxr",
        polled: &["P-N2", "P-F", "P-SL", "P-SU", "P-DP"],
        frames: &["01 03 03 F7 00 05 34 7F"],
        ..plain
    })
    .await;
    check(Golden {
        profile: "fuji_pxr",
        polled: &["SV", "P-DP", "SV-L", "SV-H", "P-SL", "P-SU", "P-F"],
        frames: &["01 03 03 EA 00 01 A5 BA", "01 06 03 EA 00 32 29 AF", "01 06 03 E8 00 01 C8 7A"],
        writes: &[("SV", 5.0), ("FIX", 1.0)],
        ..plain
    })
    .await;
    check(Golden {
        profile: "taie_fy",
        polled: &["PV"],
        frames: &["01 03 00 8A 00 01 A5 E0", "01 06 00 00 00 64 88 21"],
        writes: &[("SV", 10.0)],
        reply: Some(("01 03 00 8A 00 01 A5 E0", "01 03 02 03 E8", "PV", 100.0)),
        ..plain
    })
    .await;
    check(Golden {
        profile: "delta_vfd_el",
        polled: &["FAULT", "STATE", "F.CMD", "F.OUT", "I.OUT", "V.DC", "V.OUT"],
        frames: &[
            "01 03 21 00 00 05 8F F5",
            "01 03 21 08 00 02 4F F5",
            "01 06 20 01 17 70 DD DE",
            "01 06 20 00 00 12 02 07",
            "01 06 20 00 00 22 02 13",
            "01 06 20 00 00 01 43 CA",
            "01 06 20 02 00 02 A2 0B",
        ],
        writes: &[
            ("F.SET", 60.0),
            ("CMD", f64::from(0x12)),
            ("CMD", f64::from(0x22)),
            ("CMD", f64::from(0x01)),
            ("TRIP", 2.0),
        ],
        ..plain
    })
    .await;
    check(Golden {
        profile: "eastron_sdm630",
        polled: &["V.L1"],
        frames: &["01 04 00 00 00 02 71 CB"],
        reply: Some(("01 04 00 00 00 02 71 CB", "01 04 04 43 66 33 33", "V.L1", 230.2)),
        ..plain
    })
    .await;
    check(Golden { profile: "eastron_sdm630", polled: &["F"], frames: &["01 04 00 46 00 02 90 1E"], ..plain }).await;
    check(Golden { profile: "delta_dtb", polled: &["PV", "SV"], frames: &["01 03 10 00 00 02 C0 CB"], ..plain }).await;
    let urtu = with_crc(&bytes("01 04 00 30 00 02"));
    let urtu = urtu.iter().map(|byte| format!("{byte:02X}")).collect::<Vec<_>>().join(" ");
    check(Golden { profile: "nectec_urtu_rtd", polled: &["CH1"], frames: &[&urtu], ..plain }).await;
    check(Golden { profile: "koyo_dl06", unit: 2, polled: &["VY0"], frames: &["02 03 41 40 00 01 91 D1"], ..plain })
        .await;
}
