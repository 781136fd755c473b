//! How far a long work has come.

use super::say_error;
use std::{
    io::{IsTerminal, Write, stderr},
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    time::{Duration, Instant},
};

/// Nothing is said of what is done by then.
const SILENT: Duration = Duration::from_millis(500);
/// Between two lines where the output is no terminal.
const EVERY: Duration = Duration::from_secs(5);

/// Says on standard error what share is done: on a terminal in one line that changes and goes at the end.
pub struct Progress {
    total: u64,
    terminal: bool,
    next: Instant,
    shown: bool,
}

impl Progress {
    /// Of this many rows or bytes.
    pub fn new(total: u64) -> Progress {
        Progress { total, terminal: stderr().is_terminal(), next: Instant::now() + SILENT, shown: false }
    }

    /// This many are done.
    pub fn show(&mut self, done: u64) {
        let now = Instant::now();
        if now < self.next {
            return;
        }
        self.next = now + if self.terminal { SILENT } else { EVERY };
        let words = format!("{} % done, Ctrl-C cancels", percent(done, self.total));
        self.shown = self.terminal;
        let _ = match self.terminal {
            true => write!(stderr(), "\r\x1b[K{words}").and_then(|()| stderr().flush()),
            false => writeln!(stderr(), "sightglass: {words}"),
        };
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if self.shown {
            let _ = write!(stderr(), "\r\x1b[K");
        }
    }
}

/// Is set by Ctrl-C, which no longer ends the program; then `stop` is called.
pub fn cancelled_by_ctrl_c(stop: impl FnOnce() + Send + 'static) -> Arc<AtomicBool> {
    let cancelled = Arc::<AtomicBool>::default();
    let flag = Arc::clone(&cancelled);
    tokio::spawn(async move {
        if tokio::signal::ctrl_c().await.is_ok() {
            flag.store(true, Ordering::Relaxed);
            stop();
        }
    });
    cancelled
}

/// Waits for the work of a station, and says how long that takes.
pub async fn wait_for<T>(work: impl Future<Output = T>) -> T {
    let began = Instant::now();
    let mut next = tokio::time::interval_at((began + SILENT).into(), EVERY);
    let mut work = std::pin::pin!(work);
    loop {
        tokio::select! {
            done = &mut work => return done,
            _ = next.tick() => {
                let seconds = began.elapsed().as_secs();
                say_error(&format!("the station works on it for {seconds} s; Ctrl-C cancels it"));
            }
        }
    }
}

/// Never 100 before all is done.
fn percent(done: u64, total: u64) -> u64 {
    u64::try_from(u128::from(done) * 100 / u128::from(total.max(1))).map_or(100, |percent| percent.min(100))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_share_is_cut_and_not_rounded() {
        let shares = [(0, 3), (2, 3), (999, 1_000), (3, 3), (4, 3), (u64::MAX, u64::MAX), (0, 0)];
        assert_eq!(shares.map(|(done, total)| percent(done, total)), [0, 66, 99, 100, 100, 100, 0]);
    }
}
