//! Reads from /proc what the program takes of its computer.

use std::{
    collections::HashMap,
    time::{Duration, Instant},
};

use procfs::{CurrentSI, KernelStats, ProcResult, process::Process, ticks_per_second};
use tokio::sync::{mpsc, watch};

use crate::{
    bus::io::clock::Clock,
    plant::{event::Event, number::to_f32, process_load::ProcessLoad},
};

/// Real time over which the load is taken.
const EVERY: Duration = Duration::from_secs(5);

/// Says the load until the station stops. On a computer without /proc nothing is known of it.
pub(crate) async fn run(clock: Clock, events: mpsc::Sender<Event>, mut stopped: watch::Receiver<bool>) {
    let follow = async {
        let (mut last, mut at) = (Reading::take(), Instant::now());
        loop {
            tokio::time::sleep(EVERY).await;
            let (reading, now) = (Reading::take(), Instant::now());
            let seconds = now.duration_since(at).as_secs_f64();
            let load = match (&last, &reading) {
                (Ok(last), Ok(reading)) => reading.since(last, seconds),
                (Err(error), _) | (_, Err(error)) => {
                    tracing::debug!(%error, "the load of the program cannot be read");
                    None
                }
            };
            (last, at) = (reading, now);
            // If the plant has no room, the next load comes soon.
            let _ = events.try_send(Event::Load { at: clock.now(), load });
        }
    };
    tokio::select! {
        _ = stopped.wait_for(|stopped| *stopped) => {}
        () = follow => {}
    }
}

/// The counters of one moment.
struct Reading {
    /// CPU time of the program in seconds.
    cpu: f64,
    /// How often each thread has waited, by its number.
    waits: HashMap<i32, u64>,
    /// Time of all processors in seconds: idle, and all of it.
    idle: (f64, f64),
    memory: u64,
}

impl Reading {
    fn take() -> ProcResult<Reading> {
        let (process, ticks) = (Process::myself()?, ticks_per_second() as f64);
        let (stat, all) = (process.stat()?, KernelStats::current()?.total);
        let mut waits = HashMap::new();
        for thread in process.tasks()? {
            // One that ends just now has no status any more.
            let Ok(thread) = thread else { continue };
            let Ok(status) = thread.status() else { continue };
            waits.insert(thread.tid, status.voluntary_ctxt_switches.unwrap_or_default());
        }
        let idle = all.idle + all.iowait.unwrap_or_default();
        let others = [all.irq, all.softirq, all.steal].map(Option::unwrap_or_default);
        let busy = all.user + all.nice + all.system + others.iter().sum::<u64>();
        Ok(Reading {
            cpu: (stat.utime + stat.stime) as f64 / ticks,
            waits,
            idle: (idle as f64, (idle + busy) as f64),
            memory: process.status()?.vmrss.unwrap_or_default() * 1024,
        })
    }

    /// The load of this many seconds since the last reading; `None` if the kernel has counted nothing.
    fn since(&self, last: &Reading, seconds: f64) -> Option<ProcessLoad> {
        let waits =
            self.waits.iter().map(|(thread, waits)| waits - last.waits.get(thread).copied().unwrap_or(0).min(*waits));
        let (idle, all) = (self.idle.0 - last.idle.0, self.idle.1 - last.idle.1);
        (0.0 < all).then(|| ProcessLoad {
            cpu: to_f32((self.cpu - last.cpu) / seconds),
            wake_ups: to_f32(waits.sum::<u64>() as f64 / seconds),
            idle: to_f32(idle / all),
            memory: self.memory,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_counters_become_rates() {
        let reading =
            |cpu, waits: &[(i32, u64)], idle| Reading { cpu, waits: waits.iter().copied().collect(), idle, memory: 7 };
        let first = reading(1.0, &[(1, 100), (2, 5)], (100.0, 200.0));
        // Thread 2 has ended, thread 3 is new, and the number of thread 1 was given to another.
        let second = reading(2.5, &[(1, 90), (3, 60)], (118.0, 220.0));
        let load = second.since(&first, 10.0);
        assert_eq!(load, Some(ProcessLoad { cpu: 0.15, wake_ups: 6.0, idle: 0.9, memory: 7 }));
        assert_eq!(second.since(&second, 10.0), None);
    }

    #[test]
    fn the_computer_has_all_counters() {
        let Reading { cpu, waits, idle, memory, .. } = Reading::take().expect("this computer has /proc");
        assert!(0.0 <= cpu && !waits.is_empty() && 1_000_000 < memory, "{cpu} {waits:?} {memory}");
        assert!(0.0 < idle.0 && idle.0 <= idle.1, "{idle:?}");
    }
}
