//! What only the driver of a serial port knows or can do: its error counters, its signals, and the direction of RS-485.
//!
//! These kernel interfaces have no safe wrapper in any library we use; each is one call with one structure.
#![allow(unsafe_code)]

use std::{
    ffi::c_void,
    io,
    os::fd::{AsFd, AsRawFd, BorrowedFd, OwnedFd},
};

use rustix::ioctl::{Ioctl, IoctlOutput, Opcode};
use tokio_serial::SerialStream;

use crate::plant::{
    def::Rs485,
    line_state::UartCounters,
    port_signals::{OutputSignal, PortSignals},
};

/// Looks at what the driver of an open port counts and sees, through a handle of its own, which is closed with this.
#[derive(Debug)]
pub struct PortWatch {
    handle: OwnedFd,
    /// As it had counted at the beginning; `None` for a driver that does not count.
    first: Option<Counts>,
}

impl PortWatch {
    /// Of a port; `None` if it cannot be looked at.
    pub fn new(port: &SerialStream) -> Option<PortWatch> {
        Some(PortWatch::of(borrowed(port).try_clone_to_owned().ok()?))
    }

    /// Through a second handle of a port.
    pub(super) fn of(handle: OwnedFd) -> PortWatch {
        let first = counts(&handle);
        PortWatch { handle, first }
    }

    /// Errors since the beginning; `None` for a port whose driver does not count (a pseudo-terminal, many USB adapters).
    pub fn counters(&self) -> Option<UartCounters> {
        let (first, now) = (self.first?, counts(&self.handle)?);
        let since = |now: i32, first: i32| now.wrapping_sub(first).unsigned_abs();
        Some(UartCounters {
            parity: since(now.parity, first.parity),
            framing: since(now.frame, first.frame),
            overrun: since(now.overrun, first.overrun) + since(now.buf_overrun, first.buf_overrun),
            breaks: since(now.brk, first.brk),
        })
    }

    /// Sets a signal, until what is returned is dropped.
    pub fn hold(&self, signal: OutputSignal, on: bool) -> io::Result<HeldSignal> {
        let before = self.signals().ok_or(io::ErrorKind::Unsupported)?.is_on(signal);
        let held = HeldSignal { handle: self.handle.try_clone()?, signal, before };
        set_signal(&self.handle, signal, on)?;
        Ok(held)
    }

    /// How the signals stand; `None` where the driver has none.
    pub fn signals(&self) -> Option<PortSignals> {
        // SAFETY: TIOCMGET fills one int.
        let bits = unsafe { rustix::ioctl::ioctl(&self.handle, rustix::ioctl::Getter::<0x5415, u32>::new()) };
        bits.ok().map(PortSignals)
    }
}

fn counts(handle: &OwnedFd) -> Option<Counts> {
    // SAFETY: TIOCGICOUNT fills one `serial_icounter_struct`, which `Counts` is, field by field.
    unsafe { rustix::ioctl::ioctl(handle, ReadCounts(Counts::default())) }.ok()
}

/// Makes the driver switch the direction of an RS-485 transceiver by RTS, or leave it alone.
pub fn set_rs485(port: &SerialStream, mode: Rs485) -> io::Result<()> {
    let flags = match mode {
        Rs485::Off => 0,
        Rs485::RtsHigh => ENABLED | RTS_ON_SEND,
        Rs485::RtsLow => ENABLED | RTS_AFTER_SEND,
    };
    let config = Rs485Config { flags, delays: [0; 2], padding: [0; 5] };
    // SAFETY: TIOCSRS485 reads and writes back one `serial_rs485`, which `Rs485Config` is, field by field.
    unsafe { rustix::ioctl::ioctl(borrowed(port), SetRs485(config)) }.map_err(io::Error::from)
}

/// Makes the parity bit always 1 where it was odd, always 0 where it was even.
pub fn set_fixed_parity(port: &SerialStream) -> io::Result<()> {
    use rustix::termios::{ControlModes, OptionalActions, tcgetattr, tcsetattr};
    let mut settings = tcgetattr(borrowed(port))?;
    settings.control_modes.insert(ControlModes::CMSPAR);
    tcsetattr(borrowed(port), OptionalActions::Now, &settings)?;
    // A driver may take the rest and leave this out.
    let is_set = tcgetattr(borrowed(port))?.control_modes.contains(ControlModes::CMSPAR);
    if is_set { Ok(()) } else { Err(io::ErrorKind::Unsupported.into()) }
}

/// Holds the data line low for a quarter of a second.
pub(super) fn send_break(port: &SerialStream) -> io::Result<()> {
    rustix::termios::tcsendbreak(borrowed(port)).map_err(io::Error::from)
}

/// Raises or lowers a signal; a pseudo-terminal has none, and says so.
pub(super) fn set_signal(port: &impl AsFd, signal: OutputSignal, on: bool) -> io::Result<()> {
    let bit = signal.bit();
    // SAFETY: TIOCMBIS and TIOCMBIC read one int, the signals to raise or to lower.
    let set = match on {
        true => unsafe { rustix::ioctl::ioctl(port, rustix::ioctl::Setter::<0x5416, u32>::new(bit)) },
        false => unsafe { rustix::ioctl::ioctl(port, rustix::ioctl::Setter::<0x5417, u32>::new(bit)) },
    };
    set.map_err(io::Error::from)
}

/// A signal that is held by hand. It is put back as it was when this is dropped, whatever ended the test.
#[derive(Debug)]
pub struct HeldSignal {
    handle: OwnedFd,
    signal: OutputSignal,
    before: bool,
}

impl Drop for HeldSignal {
    fn drop(&mut self) {
        if let Err(error) = set_signal(&self.handle, self.signal, self.before) {
            tracing::warn!(signal = self.signal.word(), %error, "a signal could not be put back");
        }
    }
}

fn borrowed(port: &SerialStream) -> BorrowedFd<'_> {
    // SAFETY: the descriptor is open for as long as the port that is borrowed here.
    unsafe { BorrowedFd::borrow_raw(port.as_raw_fd()) }
}

/// `struct serial_icounter_struct` of linux/serial.h.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default)]
struct Counts {
    modem: [i32; 4],
    rx: i32,
    tx: i32,
    frame: i32,
    overrun: i32,
    parity: i32,
    brk: i32,
    buf_overrun: i32,
    reserved: [i32; 9],
}

/// `struct serial_rs485` of linux/serial.h.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
struct Rs485Config {
    flags: u32,
    delays: [u32; 2],
    padding: [u32; 5],
}

const ENABLED: u32 = 1;
const RTS_ON_SEND: u32 = 1 << 1;
const RTS_AFTER_SEND: u32 = 1 << 2;

struct ReadCounts(Counts);

// SAFETY: the opcode is that of TIOCGICOUNT, and the pointer is to the structure it fills.
unsafe impl Ioctl for ReadCounts {
    type Output = Counts;
    const IS_MUTATING: bool = true;

    fn opcode(&self) -> Opcode {
        0x545D
    }
    fn as_ptr(&mut self) -> *mut c_void {
        (&raw mut self.0).cast()
    }
    unsafe fn output_from_ptr(_: IoctlOutput, filled: *mut c_void) -> rustix::io::Result<Counts> {
        // SAFETY: it is the pointer that `as_ptr` gave.
        Ok(unsafe { filled.cast::<Counts>().read() })
    }
}

struct SetRs485(Rs485Config);

// SAFETY: the opcode is that of TIOCSRS485, and the pointer is to the structure it reads and writes back.
unsafe impl Ioctl for SetRs485 {
    type Output = ();
    const IS_MUTATING: bool = true;

    fn opcode(&self) -> Opcode {
        0x542F
    }
    fn as_ptr(&mut self) -> *mut c_void {
        (&raw mut self.0).cast()
    }
    unsafe fn output_from_ptr(_: IoctlOutput, _: *mut c_void) -> rustix::io::Result<()> {
        Ok(())
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn a_port_that_neither_counts_nor_switches_says_so() {
        let (port, _other) = SerialStream::pair().unwrap();
        let watch = PortWatch::new(&port).unwrap();
        assert_eq!((watch.counters(), watch.signals()), (None, None));
        assert!(set_rs485(&port, Rs485::RtsHigh).is_err());
    }
}
