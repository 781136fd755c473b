//! The command that runs after a report: without a shell, in a process group of its own, for a limited time.

use std::{path::Path, process::Stdio};

use rustix::process::{Pid, Signal, kill_process_group};
use tokio::{io::AsyncReadExt, process::Command, time::timeout};

use crate::{plant::visible::is_control_or_bidi, report::automatic::COMMAND_TIME_MAX};

/// Bytes of what a command says that are kept.
const WORDS_BYTES_MAX: usize = 4 << 10;
/// Characters of its last line that are recorded.
const WORDS_MAX: usize = 200;
/// What it said is waited for so long after its end: what it has started may hold its standard error.
const WORDS_TIME_MAX: std::time::Duration = std::time::Duration::from_secs(1);

/// Kills a process group when it is dropped.
struct Group(Option<Pid>);

impl Drop for Group {
    fn drop(&mut self) {
        if let Some(group) = self.0.take() {
            // It may have ended just now.
            let _ = kill_process_group(group, Signal::KILL);
        }
    }
}

/// Runs a command, in a folder if there is one; `Err` says in one line why it failed.
pub async fn run(words: &[String], folder: Option<&Path>) -> Result<(), String> {
    let Some((program, arguments)) = words.split_first() else { return Ok(()) };
    let mut command = Command::new(program);
    command.args(arguments).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped());
    command.process_group(0).kill_on_drop(true);
    if let Some(folder) = folder {
        command.current_dir(folder);
    }
    let mut child = command.spawn().map_err(|error| format!("{program}: {error}"))?;
    let mut group = Group(child.id().and_then(|id| Pid::from_raw(id.cast_signed())));
    let mut errors = child.stderr.take();
    let said = tokio::spawn(async move {
        let (mut text, mut piece) = (Vec::new(), [0; 1024]);
        while let Some(from) = &mut errors
            && let Ok(bytes @ 1..) = from.read(&mut piece).await
        {
            text.extend_from_slice(&piece[..bytes]);
            let excess = text.len().saturating_sub(WORDS_BYTES_MAX);
            text.drain(..excess);
        }
        text
    });
    let Ok(ended) = timeout(COMMAND_TIME_MAX, child.wait()).await else {
        return Err(format!("{program}: ended after {} s", COMMAND_TIME_MAX.as_secs()));
    };
    group.0 = None;
    let status = ended.map_err(|error| format!("{program}: {error}"))?;
    if status.success() {
        return Ok(());
    }
    let said = timeout(WORDS_TIME_MAX, said).await.ok().and_then(Result::ok).unwrap_or_default();
    let said = String::from_utf8_lossy(&said);
    let line = said.lines().rev().find(|line| !line.trim().is_empty()).unwrap_or_default();
    let line: String = line.trim().chars().filter(|letter| !is_control_or_bidi(*letter)).take(WORDS_MAX).collect();
    Err(if line.is_empty() { format!("{program}: {status}") } else { format!("{program}: {status}: {line}") })
}
