//! Opens a suspected history in a process of its own: only what ends that process by itself, or what the engine finds in it
//! again and again, is proof of damage.

use std::{
    ffi::OsStr,
    io::{self, PipeReader, Read, Write, pipe},
    os::unix::process::ExitStatusExt,
    path::{Path, PathBuf},
    process::{Command, ExitCode, Stdio},
    time::{Duration, Instant},
};

use jiff::Timestamp;
use rustix::{
    event::{PollFd, PollFlags, Timespec, poll},
    io::Errno,
    process::{Resource, Rlimit, Signal, set_parent_process_death_signal, setrlimit},
};

use super::{
    blocks,
    files::{self, Failure, SetAside},
    room,
    store::Store,
};
use crate::history::{HistoryError, engine_error};

/// The argument with which this program is such a process; the path of the database follows.
const ARGUMENT: &str = "--probe-history";
/// Before what the process says of the history.
const MARK: &str = "sightglass-probe: ";
const SOUND: &str = "sound";
/// A log of a few minutes is replayed within seconds; a process that takes longer proves nothing.
const TIME_MAX: Duration = Duration::from_secs(120);
/// What a process says at most, bytes.
const OUTPUT_MAX: usize = 64 << 10;
/// This many processes must fail in a row.
const FAILURES: usize = 2;
/// A process that ends by one of these has ended itself. Not a bus error: that comes from a disk that cannot be read.
const OWN_SIGNALS: [Signal; 5] = [Signal::ABORT, Signal::SEGV, Signal::ILL, Signal::FPE, Signal::TRAP];

/// What a process says of a history.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Probe {
    /// It opens.
    Sound,
    /// Something else stands in the way, or ended the process from outside: nothing is known of the history.
    Obstacle(HistoryError),
    /// The process was none of this program.
    Untried(String),
    /// The engine finds it damaged, or the process has ended itself.
    Damaged(String),
}

/// Of a history that was examined.
#[derive(Debug, PartialEq, Eq)]
pub struct Proven {
    /// What is damaged of it.
    pub part: SetAside,
    /// What opening it ends with.
    pub why: String,
    /// Where it is now.
    pub target: PathBuf,
}

/// Examines a history whose opening did not end: a kill, a loss of power or the lack of something ends an opening too, so
/// only what `probe` fails on time after time is set aside; the log alone where the file is sound without it.
/// [`HistoryError::Engine`] where that cannot be known now: nothing has changed then.
pub fn examine(db: &Path, now: Timestamp, probe: &dyn Fn(&Path) -> Probe) -> Result<Option<Proven>, HistoryError> {
    let everything = |why| {
        let target = files::set_aside(db, SetAside::Everything, now)?;
        Ok(Some(Proven { part: SetAside::Everything, why, target }))
    };
    let Some(why) = failing(db, probe)? else { return Ok(None) };
    // The opening meets the same, and may mend it.
    if engine_error::damaged_log_entry(&why).is_some() || engine_error::is_of_database(&why) && blocks::are_kept(db) {
        return Ok(None);
    }
    if !files::has_log(db) {
        return everything(why);
    }
    let target = files::set_aside(db, SetAside::Log, now)?;
    let examined = files::copy_logs(&target, db).and_then(|()| {
        // Perhaps only its place on the disk was bad.
        if failing(db, probe)?.is_none() {
            return Ok((true, None));
        }
        files::remove_logs(db);
        Ok((false, failing(db, probe)?))
    });
    match examined {
        Ok((true, _)) => {
            files::remove_logs(&target);
            Ok(None)
        }
        Ok((false, None)) => Ok(Some(Proven { part: SetAside::Log, why, target })),
        Ok((false, Some(why))) => {
            files::put_logs_back(&target, db)?;
            everything(why)
        }
        Err(error) => {
            files::put_logs_back(&target, db)?;
            Err(error)
        }
    }
}

/// With what a process after the other fails; `None` where one does not.
fn failing(db: &Path, probe: &dyn Fn(&Path) -> Probe) -> Result<Option<String>, HistoryError> {
    let mut why = None;
    for _ in 0..FAILURES {
        match probe(db) {
            Probe::Sound => return Ok(None),
            Probe::Obstacle(error) => return Err(error),
            Probe::Untried(words) => return Err(HistoryError::Engine(words)),
            Probe::Damaged(words) => why = Some(words),
        }
    }
    Ok(why)
}

/// Opens it in a process of its own, which ends with this one.
pub fn in_child(db: &Path) -> Probe {
    let failed = |error: io::Error| Probe::Obstacle(HistoryError::Engine(error.to_string()));
    let spawned = pipe().and_then(|(reader, writer)| {
        let (mut command, errors) = (command(db), writer.try_clone()?);
        // The command holds the other end, and is dropped here.
        let child = command.stdin(Stdio::null()).stdout(writer).stderr(errors).spawn()?;
        Ok((child, reader))
    });
    let (mut child, reader) = match spawned {
        Ok(spawned) => spawned,
        Err(error) => return failed(error),
    };
    let output = match read_until_closed(reader) {
        Ok(output) => output,
        Err(error) => {
            // One that hangs in the disk is not waited for.
            let _ = child.kill();
            return failed(error);
        }
    };
    match child.wait() {
        Ok(status) => evaluate(db, status.code(), status.signal(), &output),
        Err(error) => failed(error),
    }
}

/// What a process has said when it has ended; an error after [`TIME_MAX`].
fn read_until_closed(mut reader: PipeReader) -> io::Result<String> {
    let (began, mut output, mut piece) = (Instant::now(), Vec::new(), [0; 4096]);
    loop {
        let left = TIME_MAX.saturating_sub(began.elapsed());
        let left = Timespec { tv_sec: left.as_secs().cast_signed(), tv_nsec: left.subsec_nanos().into() };
        match poll(&mut [PollFd::new(&reader, PollFlags::IN)], Some(&left)) {
            Ok(0) => return Err(io::Error::other(format!("opening it takes longer than {} s", TIME_MAX.as_secs()))),
            Err(Errno::INTR) => continue,
            ready => ready?,
        };
        match reader.read(&mut piece)? {
            0 => return Ok(String::from_utf8_lossy(&output).into_owned()),
            count => output.extend_from_slice(&piece[..count.min(OUTPUT_MAX - output.len())]),
        }
    }
}

/// What the end of a process says of the history.
fn evaluate(db: &Path, code: Option<i32>, signal: Option<i32>, output: &str) -> Probe {
    let said = output.lines().find_map(|line| line.split_once(MARK).map(|(_, said)| said));
    match (signal, said) {
        (Some(signal), _) if OWN_SIGNALS.iter().any(|own| own.as_raw() == signal) => {
            match output.lines().find(|line| engine_error::is_obstacle(line)) {
                Some(lack) => Probe::Obstacle(HistoryError::Engine(lack.to_owned())),
                None => Probe::Damaged(format!("opening it ends the process by signal {signal}")),
            }
        }
        (Some(signal), _) => Probe::Obstacle(HistoryError::Engine(format!("opening it was ended by signal {signal}"))),
        (None, Some(SOUND)) => Probe::Sound,
        (None, Some(said)) => match files::diagnose(db, said) {
            Failure::Obstacle(error) => Probe::Obstacle(error),
            Failure::Damaged(why) => Probe::Damaged(why),
        },
        (None, None) => Probe::Untried(format!("it cannot be examined: exit code {}", code.unwrap_or_default())),
    }
}

#[cfg(not(test))]
fn command(db: &Path) -> Command {
    // Also where another version was installed meanwhile.
    let mut command = Command::new("/proc/self/exe");
    command.arg(ARGUMENT).arg(db);
    command
}

#[cfg(test)]
fn command(db: &Path) -> Command {
    super::tests::damage::probe_command(db)
}

/// Whether this process was started to open a history, by the words of its command line.
pub fn requested(words: &[impl AsRef<OsStr>]) -> Option<&Path> {
    match words {
        [_, word, db] if word.as_ref() == ARGUMENT => Some(Path::new(db.as_ref())),
        _ => None,
    }
}

/// Opens it here, and says on standard output what is found.
pub fn child(db: &Path) -> ExitCode {
    // Neither outlives the station, nor fills its disk: it works without these too.
    let _ = set_parent_process_death_signal(Some(Signal::KILL));
    let _ = setrlimit(Resource::Core, Rlimit { current: Some(0), maximum: Some(0) });
    let said = match room::check().and_then(|()| Store::try_out(db, Timestamp::now())) {
        Err(HistoryError::Engine(why)) => files::first_line(&why),
        // Whoever opens it for use meets anything else as well, and can say so.
        Ok(()) | Err(_) => SOUND.to_owned(),
    };
    // Whoever has started this process may have gone.
    let _ = writeln!(io::stdout(), "{MARK}{said}");
    ExitCode::SUCCESS
}
