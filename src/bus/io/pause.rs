//! Pauses as exact as the silences of a line need: the timers of the runtime tick in milliseconds, 3.5 characters at
//! 19200 baud are 2.0 ms.

use std::time::Duration;

use rustix::{
    fd::OwnedFd,
    io::Errno,
    time::{Itimerspec, TimerfdClockId, TimerfdFlags, TimerfdTimerFlags, Timespec},
};
use tokio::{io::unix::AsyncFd, time::Instant};

/// How to pause until a moment.
#[derive(Debug)]
pub enum Pause {
    /// By a timer of the kernel (some 50 µs late).
    Exact(AsyncFd<OwnedFd>),
    /// By the timers of the runtime, which tests may run in virtual time.
    Coarse,
}

impl Pause {
    /// An exact one, if the system has one to give.
    pub fn exact() -> Pause {
        let flags = TimerfdFlags::NONBLOCK | TimerfdFlags::CLOEXEC;
        let timer = rustix::time::timerfd_create(TimerfdClockId::Monotonic, flags).map_err(std::io::Error::from);
        // SAFETY: the descriptor is owned by what is registered, and never taken out.
        #[allow(unsafe_code)]
        let registered = timer.and_then(|timer| unsafe { AsyncFd::register(timer) }.map_err(std::io::Error::from));
        match registered {
            Ok(timer) => Pause::Exact(timer),
            Err(error) => {
                tracing::warn!(%error, "no exact timer: silences are kept to the next millisecond");
                Pause::Coarse
            }
        }
    }

    /// Returns when `until` has come; may be dropped before.
    pub async fn until(&self, until: Instant) {
        let left = until.saturating_duration_since(Instant::now());
        match self {
            // Zero would disarm the timer.
            Pause::Exact(_) if left.is_zero() => {}
            Pause::Exact(timer) => {
                if expire(timer, left).await.is_err() {
                    tokio::time::sleep_until(until).await;
                }
            }
            Pause::Coarse => tokio::time::sleep_until(until).await,
        }
    }
}

async fn expire(timer: &AsyncFd<OwnedFd>, left: Duration) -> std::io::Result<()> {
    let never = Timespec { tv_sec: 0, tv_nsec: 0 };
    let value = Timespec { tv_sec: left.as_secs() as i64, tv_nsec: i64::from(left.subsec_nanos()) };
    let spec = Itimerspec { it_interval: never, it_value: value };
    rustix::time::timerfd_settime(timer, TimerfdTimerFlags::empty(), &spec)?;
    loop {
        let mut ready = timer.readable().await?;
        // What an earlier pause, dropped on the way, has left behind says nothing about this one: reading tells.
        match ready.try_io(|timer| rustix::io::read(timer, &mut [0; 8]).map_err(std::io::Error::from)) {
            Ok(Err(error)) if error.raw_os_error() != Some(Errno::AGAIN.raw_os_error()) => return Err(error),
            Ok(Ok(_)) => return Ok(()),
            Ok(Err(_)) | Err(_) => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn a_pause_is_never_too_short_even_after_one_that_was_given_up() {
        let pause = Pause::exact();
        assert!(matches!(pause, Pause::Exact(_)));
        for micros in [300, 1_000, 2_500] {
            let given_up = Instant::now() + Duration::from_micros(micros / 3);
            tokio::select! {
                () = pause.until(Instant::now() + Duration::from_secs(100)) => panic!("too long"),
                () = tokio::time::sleep_until(given_up) => {}
            }
            let until = Instant::now() + Duration::from_micros(micros);
            pause.until(until).await;
            assert!(until <= Instant::now());
        }
    }
}
