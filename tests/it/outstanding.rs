//! A station that is killed and started again at once, with a device that still answers the one that is gone: what is owed to
//! the dead process never becomes a value.

use std::{
    fs,
    path::{Path, PathBuf},
    sync::{
        Arc, Mutex,
        atomic::{AtomicUsize, Ordering},
    },
    time::{Duration, SystemTime, UNIX_EPOCH},
};

use jiff::Timestamp;
use sightglass::api::{
    bus::frame,
    plant::Quality,
    sim::{Pty, open_pty},
};
use tokio::io::{AsyncReadExt, AsyncWriteExt};

use crate::support::{Process, TIMEOUT, folder, sightglass, sockets};

/// Rounds, unless `SIGHTGLASS_KILLS` says how many.
const ROUNDS: u32 = 4;
/// The device needs this for each request; what comes meanwhile waits.
const REPLY: Duration = Duration::from_millis(400);
/// Blocks of one shape: an answer to one looks like an answer to each other.
const BLOCKS: [u16; 3] = [10, 20, 30];
/// Registers of a block.
const WORDS: u16 = 4;
/// A register holds its address times this, and the number of the request, modulo this, that reads it.
const NUMBERS: usize = 1_000;

const PROFILE: &str = r#"
vendor = "none"
model = "slow"
revision = "1"
status = "manual"
source = "test"
address_base = 0
functions = [3, 6, 8]
limits = { gap_registers_max = 0 }
default = { table = "holding", type = "uint16", access = "r", poll = "fast", source = "test" }
"#;

/// The plant file and the profile of its device; every register is a tag that is named by its address.
fn write_plant(folder: &Path) -> PathBuf {
    let tag = |address: u16| format!("{{ name = \"R{address}\", address = {address} }},\n");
    let tags: String = BLOCKS.iter().flat_map(|first| (*first..first + WORDS).map(tag)).collect();
    fs::create_dir(folder.join("devices")).unwrap();
    fs::write(folder.join("devices/slow.toml"), format!("{PROFILE}tag = [\n{tags}]\n")).unwrap();
    let plant = folder.join("slow.toml");
    let text = "title = \"Slow\"\ntime_zone = \"UTC\"\n[[line]]\nname = \"L1\"\nmode = \"rtu\"\nport = \"/dev/none\"\n\
                baud = 19200\nparity = \"N\"\nstop_bits = 1\ntimeout_ms = 1000\n\
                [[device]]\nname = \"D\"\nprofile = \"slow\"\nline = \"L1\"\nunit = 1\nfast = \"1s\"\n";
    fs::write(&plant, text).unwrap();
    plant
}

/// Serves for ever, one request after the other; notes when each was taken.
async fn device(mut pty: Pty, taken: Arc<Mutex<Vec<Timestamp>>>, answered: Arc<AtomicUsize>) {
    let (mut buffer, mut chunk) = (Vec::new(), [0; 256]);
    loop {
        while let Some(frame) = buffer.first_chunk::<8>() {
            let Ok(message) = frame::without_crc(frame).map(<[u8]>::to_vec) else {
                buffer.remove(0);
                continue;
            };
            buffer.drain(..8);
            let number = {
                let mut taken = taken.lock().unwrap();
                taken.push(Timestamp::now());
                (taken.len() - 1) % NUMBERS
            };
            let word = |at: usize| u16::from_be_bytes([message[at], message[at + 1]]);
            let answer: Vec<u8> = match message[1] {
                3 => {
                    let held = |address: u16| (address * NUMBERS as u16 + number as u16).to_be_bytes();
                    let values = (word(2)..word(2) + word(4)).flat_map(held);
                    [message[0], 3, 2 * message[5]].into_iter().chain(values).collect()
                }
                _ => message.clone(),
            };
            // Requests wait in the pseudo-terminal meanwhile, whoever has sent them.
            tokio::time::sleep(REPLY).await;
            pty.write_all(&frame::with_crc(&answer)).await.unwrap();
            answered.fetch_add(1, Ordering::Relaxed);
        }
        let count = pty.read(&mut chunk).await.unwrap();
        buffer.extend_from_slice(&chunk[..count]);
    }
}

/// The good values in the history: when they were read, of which address, and what they were.
fn stored(history: &Path) -> Vec<(Timestamp, u16, usize)> {
    let db = duckdb::Connection::open(history).unwrap();
    let good = "SELECT epoch_us(s.utc), t.name, s.value FROM sample s JOIN tag t ON t.id = s.tag \
                WHERE s.quality = ? AND s.value IS NOT NULL ORDER BY s.utc";
    let mut statement = db.prepare(good).unwrap();
    let row = |row: &duckdb::Row<'_>| {
        let (at, name, value): (i64, String, f64) = (row.get(0)?, row.get(1)?, row.get(2)?);
        let address = name.trim_start_matches("D.R").parse().unwrap();
        Ok((Timestamp::from_microsecond(at).unwrap(), address, value as usize))
    };
    statement.query_map([Quality::Good.code()], row).unwrap().map(Result::unwrap).collect()
}

/// What is wrong with a value, if anything: it is one of another register, or was asked for by an earlier station.
fn wrong(row: &(Timestamp, u16, usize), lives: &[Timestamp], taken: &[Timestamp]) -> Option<String> {
    let (at, address, value) = *row;
    if value / NUMBERS != usize::from(address) {
        return Some(format!("{at}: register {address} was {value}"));
    }
    let life = *lives.iter().rev().find(|start| **start <= at)?;
    // The numbers come again; the last one before the value was stored is meant.
    let numbered = taken.iter().skip(value % NUMBERS).step_by(NUMBERS);
    let asked = *numbered.rev().find(|asked| **asked <= at)?;
    (asked < life).then(|| format!("{at}: register {address} is of {asked}, before the station started at {life}"))
}

#[tokio::test(flavor = "multi_thread")]
async fn a_reply_to_a_killed_station_is_no_value_of_the_next() {
    let rounds = std::env::var("SIGHTGLASS_KILLS").map_or(ROUNDS, |rounds| rounds.parse().unwrap());
    let (folder, sockets) = (folder(), sockets());
    let plant = write_plant(folder.path());
    let history = folder.path().join("slow.duckdb");
    let (pty, port) = open_pty().unwrap();
    let (taken, answered) = (Arc::default(), Arc::new(AtomicUsize::new(0)));
    let serving = tokio::spawn(device(pty, Arc::clone(&taken), answered.clone()));
    let mut chance = SystemTime::now().duration_since(UNIX_EPOCH).unwrap().subsec_nanos();
    println!("seed {chance}");
    let mut lives = Vec::new();
    for round in 0..=rounds {
        lives.push(Timestamp::now());
        let mut station = Process::start(
            sightglass()
                .arg("run")
                .arg(&plant)
                .args(["--log", "-", "--port", &format!("L1={}", port.display()), "--history"])
                .arg(&history)
                .env("XDG_RUNTIME_DIR", &sockets)
                .env("XDG_STATE_HOME", folder.path())
                .env("SIGHTGLASS_LOG", "warn"),
        );
        chance = chance.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        // Long enough for what is read first to be stored, and to end at any moment of a request.
        let enough = answered.load(Ordering::Relaxed) + 4 + (chance >> 8) as usize % 5;
        let busy = async {
            while answered.load(Ordering::Relaxed) < enough {
                tokio::time::sleep(Duration::from_millis(5)).await;
            }
        };
        tokio::time::timeout(TIMEOUT, busy).await.expect("the device is asked");
        tokio::time::sleep(REPLY * (chance >> 16 & 0xFF) / 0x100).await;
        // The last one stores all that it has read.
        let killed = round < rounds;
        station.signal(if killed { "KILL" } else { "TERM" });
        assert_eq!(station.end(), if killed { None } else { Some(0) });
    }
    serving.abort();
    let (rows, taken) = (stored(&history), taken.lock().unwrap());
    let wrong: Vec<String> = rows.iter().filter_map(|row| wrong(row, &lives, &taken)).collect();
    println!("{rounds} kills, {} requests, {} good values compared, {} wrong", taken.len(), rows.len(), wrong.len());
    assert_eq!(wrong, Vec::<String>::new());
    assert!(!rows.is_empty(), "nothing was read");
}
