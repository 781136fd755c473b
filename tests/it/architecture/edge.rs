//! The outside world is spelled `io`: only such files, and named ones of `station` and `cli`, may touch it.

use super::source::{self, Facts, snippet};

/// Parts of the outside world, and the paths that reach them. A method has the path `method::name`, a macro `macro::name`.
const WORLD: &[(&str, &[&str])] = &[
    ("channels", &["tokio::sync"]),
    ("tasks", &["tokio", "tokio_serial", "futures_util::stream", "std::thread"]),
    (
        "files",
        &[
            "std::fs",
            "std::io",
            "std::os::unix::fs",
            "rustix::fs",
            "tokio::fs",
            "tempfile",
            "tracing_appender",
            "method::exists",
            "method::is_file",
            "method::is_dir",
            "method::canonicalize",
            "method::read_dir",
        ],
    ),
    (
        "terminal",
        &[
            "std::io::stdin",
            "std::io::stdout",
            "std::io::stderr",
            "std::io::IsTerminal",
            "crossterm",
            "ratatui::crossterm",
            "rpassword",
            "macro::print",
            "macro::println",
            "macro::eprint",
            "macro::eprintln",
            "macro::dbg",
        ],
    ),
    (
        "clock",
        &[
            "std::time::Instant",
            "std::time::SystemTime",
            "tokio::time::Instant",
            "jiff::Timestamp::now",
            "jiff::Zoned::now",
            "jiff::tz::TimeZone::system",
        ],
    ),
    (
        "process",
        &[
            "std::process",
            "std::env",
            "rustix",
            "sd_notify",
            "uzers",
            "tokio::signal",
            "tokio::process",
            "tokio::runtime",
        ],
    ),
    ("network", &["std::net", "std::os::unix::net", "rustix::net", "tokio::net"]),
    ("database", &["duckdb"]),
];

/// crossterm's words for keys reach nothing.
const HARMLESS: &[&str] = &[
    "crossterm::event::KeyCode",
    "crossterm::event::KeyEvent",
    "crossterm::event::KeyEventKind",
    "crossterm::event::KeyModifiers",
    // Memory, and the trait to write into it; a file needs `std::fs`.
    "std::io::Cursor",
    "std::io::Write",
];

/// What files of `station` and `cli` may touch. A file that is not here decides, and touches nothing.
const ALLOWED: &[(&str, &[&str])] = &[
    ("src/main.rs", &["process"]),
    ("src/cli/attach.rs", &["files", "channels", "tasks", "terminal"]),
    ("src/cli/audit.rs", &["files", "terminal", "clock"]),
    ("src/cli/client.rs", &["tasks", "terminal"]),
    ("src/cli/control.rs", &["tasks", "clock"]),
    ("src/cli/decode.rs", &["files", "terminal"]),
    ("src/cli/demo.rs", &["tasks", "files", "clock", "process"]),
    ("src/cli/drill.rs", &["channels", "tasks", "process"]),
    ("src/cli/history/backup.rs", &["clock"]),
    ("src/cli/history/compact.rs", &["files", "clock"]),
    ("src/cli/history/import.rs", &["clock"]),
    ("src/cli/history/mod.rs", &["files"]),
    ("src/cli/history/restore.rs", &["files", "clock"]),
    ("src/cli/init.rs", &["clock", "process"]),
    ("src/cli/log.rs", &["files", "terminal", "clock", "process"]),
    ("src/cli/menu.rs", &["files", "terminal", "network"]),
    ("src/cli/mimic.rs", &["tasks", "files", "terminal", "process"]),
    ("src/cli/mistyped.rs", &["files"]),
    ("src/cli/mod.rs", &["files", "terminal", "process"]),
    ("src/cli/new.rs", &["files", "clock"]),
    ("src/cli/open_log.rs", &["files"]),
    ("src/cli/own_files.rs", &["files"]),
    ("src/cli/paths.rs", &["process"]),
    ("src/cli/output.rs", &["files", "terminal", "process"]),
    ("src/cli/progress.rs", &["tasks", "terminal", "clock", "process"]),
    ("src/cli/prompt.rs", &["channels", "tasks", "files", "terminal", "process"]),
    ("src/cli/register_map/import.rs", &["files", "terminal"]),
    ("src/cli/report.rs", &["files"]),
    ("src/cli/report/verify.rs", &["files"]),
    ("src/cli/run.rs", &["channels", "tasks", "process"]),
    ("src/cli/sim.rs", &["files", "clock", "network"]),
    ("src/cli/recognition.rs", &["tasks"]),
    ("src/cli/source.rs", &["channels", "clock"]),
    ("src/cli/sql.rs", &["tasks", "clock", "process"]),
    ("src/cli/systemd_unit.rs", &["process"]),
    ("src/cli/work_folder.rs", &["files", "process"]),
    ("src/cli/tools/listen.rs", &["tasks", "clock"]),
    ("src/cli/tools/listen/capture_file.rs", &["files"]),
    ("src/cli/tools/signals.rs", &["channels", "tasks", "files", "terminal", "clock"]),
    ("src/cli/tools/loopback.rs", &["clock"]),
    ("src/cli/tools/mod.rs", &["tasks", "files", "terminal", "clock", "process"]),
    ("src/cli/tools/network.rs", &["tasks", "process", "network"]),
    ("src/station/audit_queue.rs", &["channels", "clock"]),
    ("src/station/blocking_jobs.rs", &["tasks"]),
    ("src/station/past.rs", &["channels"]),
    ("src/station/plant_task.rs", &["channels", "tasks", "clock"]),
    ("src/station/plant_task/files.rs", &["tasks"]),
    ("src/station/session.rs", &["channels"]),
    ("src/station/session_server/history_jobs.rs", &["channels"]),
    ("src/station/session_acceptor.rs", &["channels"]),
    ("src/station/plant_task/reload.rs", &["channels"]),
    ("src/station/session_server.rs", &["channels", "tasks"]),
    ("src/station/session_server/reload.rs", &["channels"]),
    ("src/station/companions.rs", &["files"]),
    ("src/station/sets.rs", &["files"]),
    ("src/station/found.rs", &["files", "tasks"]),
    ("src/station/supervisor.rs", &["channels", "tasks", "clock"]),
    // Unpacks an archive in memory, by the trait that reads files as well.
    ("src/register_map/container/workbook.rs", &["files"]),
];

/// Files that hand on what is in `io`.
const RE_EXPORTS: &[&str] = &["src/api.rs", "src/profile/mod.rs", "src/sim/scenario/read.rs"];

fn is_below(path: &str, start: &str) -> bool {
    path.strip_prefix(start).is_some_and(|rest| rest.is_empty() || rest.starts_with("::"))
}

/// The part of the world that a path reaches: that of the longest start that fits.
fn reaches(path: &str) -> Option<&'static str> {
    if HARMLESS.iter().any(|harmless| is_below(path, harmless)) {
        return None;
    }
    let starts = WORLD.iter().flat_map(|(part, starts)| starts.iter().map(move |start| (*part, *start)));
    starts.filter(|(_, start)| is_below(path, start)).max_by_key(|(_, start)| start.len()).map(|(part, _)| part)
}

fn is_io(path: &str) -> bool {
    path.split('/').any(|part| part == "io" || part == "io.rs")
}

/// Uses of the world where it may not be named.
fn breaches(files: &[Facts]) -> Vec<String> {
    let mut wrong = Vec::new();
    for file in files.iter().filter(|file| !is_io(&file.path)) {
        let allowed = ALLOWED.iter().find(|(path, _)| *path == file.path).map_or(&[][..], |(_, parts)| parts);
        let in_assembly = ["station", "cli"].contains(&file.top_module());
        for name in file.production_names() {
            if let Some(part) = reaches(&name.path).filter(|part| !allowed.contains(part)) {
                wrong.push(format!("{}:{} names {} ({part})", file.path, name.line, name.path));
            }
            let calls_io = name.path.starts_with("crate::") && name.path.split("::").any(|segment| segment == "io");
            // `std::*` or `tokio::*` would hide what is used.
            let hides = ["std::*", "core::*", "tokio::*", "std::time::*", "jiff::*"].contains(&name.path.as_str());
            if calls_io && !in_assembly && !RE_EXPORTS.contains(&file.path.as_str()) || hides {
                wrong.push(format!("{}:{} names {}", file.path, name.line, name.path));
            }
        }
    }
    wrong
}

/// Entries of the table that nothing needs.
fn idle(files: &[Facts]) -> Vec<String> {
    let mut idle = Vec::new();
    for (path, parts) in ALLOWED {
        let file = files.iter().find(|file| file.path == *path);
        let uses =
            |part: &str| file.is_some_and(|file| file.production_names().any(|name| reaches(&name.path) == Some(part)));
        idle.extend(parts.iter().filter(|part| !uses(part)).map(|part| format!("{path} needs no {part}")));
    }
    idle
}

#[test]
fn the_outside_world_is_spelled_io() {
    let wrong = breaches(&source::ALL);
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn a_file_is_allowed_no_more_than_it_needs() {
    let idle = idle(&source::ALL);
    assert!(idle.is_empty(), "{}", idle.join("\n"));
}

#[test]
fn every_spelling_of_the_world_is_seen() {
    let check = |path: &str, text: &str| {
        let wrong = breaches(&snippet(path, text));
        assert!(!wrong.is_empty(), "{path}: {text}");
    };
    check("src/plant/sample.rs", "use std::fs;");
    check("src/plant/sample.rs", "use std::{path::Path, fs::File};");
    check("src/plant/sample.rs", "use std as s; fn f() { s::env::var(\"A\"); }");
    check("src/plant/sample.rs", "fn f() { ::std::thread::sleep(d) }");
    check("src/plant/sample.rs", "use std::*; fn f() { process::exit(1) }");
    check("src/plant/sample.rs", "use std::time::{Duration, Instant as Now};");
    check("src/plant/sample.rs", "extern crate tokio as t; fn f() { t::spawn(x) }");
    check("src/plant/sample.rs", "use jiff::Timestamp; fn f() { Timestamp::now(); }");
    check("src/plant/sample.rs", "use jiff as j; fn f() { let now = j::Zoned::now; }");
    check("src/plant/sample.rs", "fn f() { format!(\"{}\", jiff::Timestamp::now()); }");
    check("src/plant/sample.rs", "fn f(path: &Path) -> bool { path.exists() }");
    check("src/plant/sample.rs", "fn f() { eprintln!(\"lost\") }");
    check("src/plant/sample.rs", "fn f() -> Result<(), rustix::io::Errno> { Ok(()) }");
    check("src/plant/sample.rs", "use crate::history::io::sql::Connection;");
    check("src/ui/keys.rs", "use crossterm::event::{KeyCode, EventStream};");
    check("src/history/rows.rs", "fn f(row: &duckdb::Row) {}");
    check("src/station/pulse.rs", "use tokio::sync::mpsc;");
    check("src/station/door.rs", "fn f() { std::fs::read(\"x\"); }");
    check("src/cli/paths.rs", "use std::{env, fs};");
    check("src/plant/sample.rs", "#[cfg(test)]\nmod tests {}\nuse std::fs;");
}

#[test]
fn a_re_export_hides_no_use_of_the_world() {
    let files =
        [("src/bus/io/files.rs", "pub use std::fs as disk;"), ("src/bus/plan.rs", "use super::io::files::disk;")];
    let files: Vec<_> = files.iter().map(|(path, text)| ((*path).to_owned(), (*text).to_owned())).collect();
    let wrong = breaches(&source::facts(&files));
    assert!(wrong.iter().any(|line| line.contains("src/bus/plan.rs:1 names std::fs (files)")), "{wrong:?}");
}

#[test]
fn the_edge_itself_keys_and_tests_are_free() {
    let check = |path: &str, text: &str| assert_eq!(breaches(&snippet(path, text)), Vec::<String>::new(), "{text}");
    check("src/bus/io/link.rs", "use std::{fs, time::Instant}; use tokio::spawn;");
    check("src/station/io.rs", "use std::fs;");
    check("src/ui/keys.rs", "use crossterm::event::{KeyCode, KeyEvent}; fn f() { KeyCode::Enter; }");
    check("src/plant/sample.rs", "use std::{path::Path, time::Duration, sync::Arc}; use jiff::Timestamp;");
    check("src/plant/sample.rs", "#[cfg(test)] mod tests { fn f() { std::fs::read(\"x\"); } }");
    check("src/plant/sample.rs", "#[test] fn f() { std::fs::read(\"x\"); }");
}
