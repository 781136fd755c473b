//! Opens a port or connection to listen: it is read, and nothing can be written to it.

use std::{fs::OpenOptions, io, os::unix::fs::OpenOptionsExt};

use rustix::{
    fs::{FlockOperation, OFlags, flock},
    termios::{self, ControlModes, InputModes, OptionalActions, QueueSelector},
};
use tokio::{io::AsyncRead, net::unix::pipe};

use super::{
    ports,
    transport::{Opened, connect},
    uart::{self, PortWatch},
};
use crate::plant::{
    line::{Parity, Protocol, Serial, Transport},
    line_state::UartCounters,
    line_trouble::LineTrouble,
    port_signals::OutputSignal,
};

/// The bytes of both sides of a line.
pub struct Tap {
    /// They are read here; there is no way to write.
    pub bytes: Box<dyn AsyncRead + Send + Unpin>,
    watch: Option<PortWatch>,
}

impl Tap {
    /// Opens a serial port for reading only, or a connection to what forwards the bytes of both sides.
    /// `rts`: the signal stays as the system sets it when a port is opened.
    pub async fn open(transport: &Transport, rts: bool) -> Result<Tap, LineTrouble> {
        match transport {
            Transport::Serial { port, serial, .. } => open_serial(port, *serial, rts),
            Transport::Network { protocol: Protocol::Udp, .. } => Err(LineTrouble::DatagramsOfOthers),
            Transport::Network { host, port, .. } => {
                Ok(Tap { bytes: Box::new(connect(host, *port).await?), watch: None })
            }
        }
    }

    /// The receiving side of what is open already.
    pub fn of(opened: Opened) -> Tap {
        Tap { bytes: Box::new(opened.stream), watch: opened.watch }
    }

    /// What the driver of a serial port has counted since then; `None` where it does not count.
    pub fn uart(&self) -> Option<UartCounters> {
        self.watch.as_ref()?.counters()
    }
}

fn open_serial(path: &str, serial: Serial, rts: bool) -> Result<Tap, LineTrouble> {
    let shared = |holder| LineTrouble::Shared { path: path.to_owned(), holder };
    if let Some(user) = ports::user(path) {
        return Err(shared(user));
    }
    let failed = |error: io::Error| ports::why_not(path, &error.into());
    let flags = (OFlags::NONBLOCK | OFlags::NOCTTY).bits().cast_signed();
    let port = OpenOptions::new().read(true).custom_flags(flags).open(path).map_err(failed)?;
    flock(&port, FlockOperation::NonBlockingLockExclusive).map_err(|_| shared(ports::holder(path)))?;
    if !rustix::termios::isatty(&port) {
        return Err(LineTrouble::NotSerial(path.to_owned()));
    }
    // Opening it has raised RTS, by which some adapters switch their driver on: it would hold the line.
    if !rts {
        let _ = uart::set_signal(&port, OutputSignal::Rts, false);
    }
    set(&port, serial).map_err(|error| failed(error.into()))?;
    let watch = Some(PortWatch::of(port.try_clone().map_err(failed)?.into()));
    let bytes = pipe::Receiver::from_file_unchecked(port).map_err(failed)?;
    Ok(Tap { bytes: Box::new(bytes), watch })
}

/// Raw bytes with these parameters; what came before is dropped, and no other program opens the port.
fn set(port: &std::fs::File, serial: Serial) -> rustix::io::Result<()> {
    termios::ioctl_tiocexcl(port)?;
    let mut settings = termios::tcgetattr(port)?;
    settings.make_raw();
    settings.set_speed(serial.baud)?;
    // A byte whose parity is wrong is read as 0, so that no check is left to chance: that of ASCII is a mere sum.
    settings.input_modes.set(InputModes::INPCK, serial.parity != Parity::None);
    let modes = &mut settings.control_modes;
    modes.remove(
        ControlModes::CSIZE
            | ControlModes::PARENB
            | ControlModes::PARODD
            | ControlModes::CMSPAR
            | ControlModes::CSTOPB
            | ControlModes::CRTSCTS,
    );
    modes.insert(ControlModes::CREAD | ControlModes::CLOCAL);
    modes.insert(if serial.data_bits == 7 { ControlModes::CS7 } else { ControlModes::CS8 });
    modes.insert(match serial.parity {
        Parity::None => ControlModes::empty(),
        Parity::Even => ControlModes::PARENB,
        Parity::Odd => ControlModes::PARENB | ControlModes::PARODD,
        Parity::Mark => ControlModes::PARENB | ControlModes::PARODD | ControlModes::CMSPAR,
        Parity::Space => ControlModes::PARENB | ControlModes::CMSPAR,
    });
    modes.set(ControlModes::CSTOPB, serial.stop_bits == 2);
    termios::tcsetattr(port, OptionalActions::Now, &settings)?;
    termios::tcflush(port, QueueSelector::IFlush)
}

#[cfg(test)]
mod tests {
    use tokio::io::{AsyncReadExt, AsyncWriteExt};
    use tokio_serial::{SerialPort, SerialPortBuilderExt, SerialStream};

    use super::*;

    #[tokio::test]
    async fn a_port_is_read_and_kept_for_itself() {
        let (mut master, slave) = SerialStream::pair().expect("a pseudo-terminal is free");
        let path = slave.name().expect("it has a name");
        let transport = Transport::rtu(&path, Serial { baud: 14_400, parity: Parity::Even, ..Serial::USUAL });
        drop(slave);
        let mut tap = Tap::open(&transport, false).await.expect("the port opens");
        let mut heard = [0; 6];
        master.write_all(&[0x0A, 0x0D, 0x11, 0x13, 0x00, 0xFF]).await.expect("it takes bytes");
        tap.bytes.read_exact(&mut heard).await.expect("they come");
        assert_eq!(heard, [0x0A, 0x0D, 0x11, 0x13, 0x00, 0xFF], "nothing is translated");
        assert_eq!(tap.uart(), None);
        let second = Tap::open(&transport, false).await.err().expect("it does not open").to_string();
        assert!(second.contains("in use by this program"), "{second}");
        assert!(tokio_serial::new(&path, 9_600).open_native_async().is_err());
    }

    #[tokio::test]
    async fn a_byte_whose_parity_is_wrong_is_not_taken_as_it_is() {
        let (_master, slave) = SerialStream::pair().expect("a pseudo-terminal is free");
        let port = std::fs::File::open(slave.name().expect("it has a name")).expect("it opens");
        for (parity, checked) in [(Parity::Even, true), (Parity::Odd, true), (Parity::None, false)] {
            set(&port, Serial { parity, ..Serial::USUAL }).expect("it takes the settings");
            let modes = termios::tcgetattr(&port).expect("it has settings").input_modes;
            assert_eq!(modes.contains(InputModes::INPCK), checked, "{parity:?}");
        }
    }

    #[tokio::test]
    async fn what_cannot_be_listened_to_is_named() {
        let folder = tempfile::tempdir().expect("a folder of its own");
        let file = folder.path().join("file");
        std::fs::write(&file, "text").expect("it can be written");
        for (path, part) in [("/dev/no-such-port", "no such port ("), (&file.to_string_lossy(), "not a serial port")] {
            let failed = Tap::open(&Transport::rtu(path, Serial::USUAL), false)
                .await
                .err()
                .expect("it does not open")
                .to_string();
            assert!(failed.contains(part), "{path}: {failed}");
        }
        let (protocol, framing) = (crate::plant::line::Protocol::Udp, crate::plant::line::Framing::Mbap);
        let datagrams = Transport::Network { protocol, host: "127.0.0.1".into(), port: 502, framing };
        let failed = Tap::open(&datagrams, false).await.err().expect("it does not open").to_string();
        assert!(failed.contains("expected a serial port or a mirror over TCP"), "{failed}");
    }
}
