//! The whole station in virtual time: one thread, one seed, one run. The real station, with its history, its audit log and
//! DuckDB, on simulated devices whose lines misbehave, under an operator, with a system clock that is set, on a disk that
//! fills, and ended at any operation on it (`tests/crash.py`, which starts each life of a station as a process of its own).
//!
//! ```sh
//! cargo test --release --test simulation                                  # a hundred seeds
//! SIGHTGLASS_SEEDS=0-9999 cargo test --release --test simulation
//! SIGHTGLASS_SEEDS=17-17 SIGHTGLASS_KEEP=/tmp/seed cargo test --release --test simulation
//! ```
//!
//! What is not simulated: the disk below the files of the engine and of ours is a real one with a layer between (`tests/crash.c`);
//! sockets, data out to a broker, and what a process of its own does (a file whose opening never ended is examined by one).
#![allow(clippy::unwrap_used, clippy::print_stdout, missing_docs)]

#[path = "../bench/support/dice.rs"]
mod dice;
mod facts;
mod life;
mod lines;
mod operator;

use std::{
    env,
    path::Path,
    process::{Command, ExitCode},
};

use sightglass::api::history::probe;

/// What of a campaign runs with the other tests.
const SEEDS: &str = "0-99";

fn main() -> ExitCode {
    let words: Vec<_> = env::args_os().collect();
    if let Some(db) = probe::requested(&words) {
        return probe::child(db);
    }
    if let Ok(seed) = env::var("SIGHTGLASS_LIFE") {
        return life::main(seed.parse().unwrap());
    }
    let words: Vec<String> = env::args().skip(1).filter(|word| !word.starts_with('-')).collect();
    let is_asked_for = words.is_empty() || words.iter().any(|word| "simulation".contains(word.as_str()));
    if !is_asked_for || env::args().any(|word| word == "--list") {
        return ExitCode::SUCCESS;
    }
    campaign()
}

fn campaign() -> ExitCode {
    let has = |tool: &str| Command::new(tool).arg("--version").output().is_ok();
    if !(has("gcc") && has("python3")) {
        println!("skipped: gcc and python3 are needed");
        return if env::var_os("CI").is_some() { ExitCode::FAILURE } else { ExitCode::SUCCESS };
    }
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/crash.py");
    let mut command = Command::new("python3");
    command.arg(script).arg(Path::new(env!("CARGO_BIN_EXE_sightglass")).parent().unwrap());
    command.arg("--simulated").arg(env::current_exe().unwrap());
    command.args(["--seeds", &env::var("SIGHTGLASS_SEEDS").unwrap_or(SEEDS.to_owned())]);
    if let Ok(folder) = env::var("SIGHTGLASS_KEEP") {
        command.args(["--keep", &folder]);
    }
    if command.status().unwrap().success() { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
