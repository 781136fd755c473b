//! Settings while they are being typed: choices and texts, and the line that they make.

use crate::t;
use std::time::Duration;

use crossterm::event::{KeyCode, KeyEvent};

use super::SettingsAction;
use crate::{
    plant::{
        def::{Framing, LineDef, Parity, Rs485, Serial, Transport},
        line_check::{BAUDS, check_settings},
    },
    profile::line::{TCP_PORT, usual_data_bits},
    ui::modal::line::Line,
};

/// A row of the form.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Field {
    Mode,
    Port,
    Baud,
    DataBits,
    Parity,
    StopBits,
    Host,
    TcpPort,
    Timeout,
    Gap,
}

impl Field {
    pub fn name(self) -> &'static str {
        match self {
            Field::Mode => t!("mode"),
            Field::Port => t!("port"),
            Field::Baud => t!("baud rate"),
            Field::DataBits => t!("data bits"),
            Field::Parity => t!("parity"),
            Field::StopBits => t!("stop bits"),
            Field::Host => t!("host"),
            Field::TcpPort => t!("TCP port"),
            Field::Timeout => t!("timeout"),
            Field::Gap => t!("gap"),
        }
    }

    pub fn unit(self) -> &'static str {
        match self {
            Field::Timeout | Field::Gap => "ms",
            Field::Baud => "bit/s",
            Field::Mode
            | Field::Port
            | Field::DataBits
            | Field::Parity
            | Field::StopBits
            | Field::Host
            | Field::TcpPort => "",
        }
    }

    /// Picked with ← and →.
    pub fn is_choice(self) -> bool {
        matches!(self, Field::Mode | Field::Baud | Field::DataBits | Field::Parity | Field::StopBits)
    }

    /// Typed, letters and all: here no letter is a key.
    pub fn is_text(self) -> bool {
        matches!(self, Field::Port | Field::Host)
    }
}

/// The modes of a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Mode {
    Rtu,
    Ascii,
    Tcp,
    RtuOverTcp,
    AsciiOverTcp,
}

const MODES: [Mode; 5] = [Mode::Rtu, Mode::Ascii, Mode::Tcp, Mode::RtuOverTcp, Mode::AsciiOverTcp];

/// Settings as they stand in the form. What another mode needs is kept while this one is chosen.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Draft {
    /// Where the rest comes from: name, idle time, turnaround.
    base: LineDef,
    mode: Mode,
    port: Line,
    serial: Serial,
    rs485: Rs485,
    host: Line,
    tcp_port: Line,
    timeout: Line,
    gap: Line,
}

impl Draft {
    /// The form filled with settings.
    pub fn new(settings: &LineDef) -> Draft {
        let number = |number: u128| Line::new(&number.to_string());
        let mut draft = Draft {
            base: settings.clone(),
            mode: Mode::Rtu,
            port: Line::new(t!("/dev/ttyUSB0")),
            serial: Serial::USUAL,
            rs485: Rs485::Off,
            host: Line::default(),
            tcp_port: number(u128::from(TCP_PORT)),
            timeout: number(settings.timeout.as_millis()),
            gap: number(settings.gap.as_millis()),
        };
        match &settings.transport {
            Transport::Serial { port, serial, framing, rs485 } => {
                draft.mode = if *framing == Framing::Ascii { Mode::Ascii } else { Mode::Rtu };
                (draft.port, draft.serial, draft.rs485) = (Line::new(port), *serial, *rs485);
            }
            Transport::Tcp { host, port, framing } => {
                draft.mode = match framing {
                    Framing::Rtu => Mode::RtuOverTcp,
                    Framing::Ascii => Mode::AsciiOverTcp,
                    Framing::Mbap => Mode::Tcp,
                };
                (draft.host, draft.tcp_port) = (Line::new(host), number(u128::from(*port)));
            }
        }
        draft
    }

    /// The settings; `Err` says what is wrong with the first that is.
    pub fn settings(&self) -> Result<LineDef, String> {
        let missed = [&self.port, &self.host, &self.tcp_port, &self.timeout, &self.gap];
        if missed.iter().any(|line| line.missed()) {
            return Err(t!("the text was cut; Ctrl-U clears it").to_owned());
        }
        let settings = LineDef {
            transport: self.transport()?,
            timeout: millis(t!("timeout"), &self.timeout)?,
            gap: millis(t!("gap"), &self.gap)?,
            ..self.base.clone()
        };
        match check_settings(&settings).into_iter().next() {
            Some(error) => Err(format!("{}, {}", error.what, error.expected)),
            None => Ok(settings),
        }
    }

    fn transport(&self) -> Result<Transport, String> {
        let serial = |framing| Transport::Serial {
            port: self.port.text().trim().to_owned(),
            serial: self.serial,
            framing,
            rs485: self.rs485,
        };
        let tcp = |framing| {
            let text = self.tcp_port.text();
            let port =
                text.trim().parse().map_err(|_| t!("\"{text}\" is not a TCP port, expected 1 to 65535", text))?;
            Ok(Transport::Tcp { host: self.host.text().trim().to_owned(), port, framing })
        };
        match self.mode {
            Mode::Rtu => Ok(serial(Framing::Rtu)),
            Mode::Ascii => Ok(serial(Framing::Ascii)),
            Mode::Tcp => tcp(Framing::Mbap),
            Mode::RtuOverTcp => tcp(Framing::Rtu),
            Mode::AsciiOverTcp => tcp(Framing::Ascii),
        }
    }

    /// The rows that this mode has.
    pub fn fields(&self) -> &'static [Field] {
        use Field::{Baud, DataBits, Gap, Host, Mode as ModeRow, Parity, Port, StopBits, TcpPort, Timeout};
        match self.mode {
            Mode::Rtu | Mode::Ascii => &[ModeRow, Port, Baud, DataBits, Parity, StopBits, Timeout, Gap],
            Mode::Tcp | Mode::RtuOverTcp | Mode::AsciiOverTcp => &[ModeRow, Host, TcpPort, Timeout, Gap],
        }
    }

    /// A value in words; empty for what this mode does not have.
    pub fn words(&self, field: Field) -> String {
        if !self.fields().contains(&field) {
            return "–".to_owned();
        }
        match field {
            Field::Mode => match self.mode {
                Mode::Rtu => "RTU".to_owned(),
                Mode::Ascii => "ASCII".to_owned(),
                Mode::Tcp => "TCP".to_owned(),
                Mode::RtuOverTcp => t!("RTU over TCP").to_owned(),
                Mode::AsciiOverTcp => t!("ASCII over TCP").to_owned(),
            },
            Field::Baud => self.serial.baud.to_string(),
            Field::DataBits => self.serial.data_bits.to_string(),
            Field::Parity => match self.serial.parity {
                Parity::None => t!("none").to_owned(),
                Parity::Even => t!("even").to_owned(),
                Parity::Odd => t!("odd").to_owned(),
                Parity::Mark => t!("mark (always 1)").to_owned(),
                Parity::Space => t!("space (always 0)").to_owned(),
            },
            Field::StopBits => self.serial.stop_bits.to_string(),
            Field::Port | Field::Host | Field::TcpPort | Field::Timeout | Field::Gap => {
                self.text(field).map(Line::text).unwrap_or_default()
            }
        }
    }

    /// The text of a field that is typed.
    pub fn text(&self, field: Field) -> Option<&Line> {
        match field {
            Field::Port => Some(&self.port),
            Field::Host => Some(&self.host),
            Field::TcpPort => Some(&self.tcp_port),
            Field::Timeout => Some(&self.timeout),
            Field::Gap => Some(&self.gap),
            Field::Mode | Field::Baud | Field::DataBits | Field::Parity | Field::StopBits => None,
        }
    }

    fn text_mut(&mut self, field: Field) -> Option<&mut Line> {
        match field {
            Field::Port => Some(&mut self.port),
            Field::Host => Some(&mut self.host),
            Field::TcpPort => Some(&mut self.tcp_port),
            Field::Timeout => Some(&mut self.timeout),
            Field::Gap => Some(&mut self.gap),
            Field::Mode | Field::Baud | Field::DataBits | Field::Parity | Field::StopBits => None,
        }
    }

    /// A key for a field that is typed; `false` if it is none. Numbers take digits only: letters are keys there.
    pub fn on_key(&mut self, field: Field, event: KeyEvent) -> bool {
        let control = event.modifiers.contains(crossterm::event::KeyModifiers::CONTROL);
        let digit = matches!(event.code, KeyCode::Char(c) if !c.is_ascii_digit() && !control);
        match self.text_mut(field) {
            Some(line) if field.is_text() || !digit => line.on_key(event),
            Some(_) | None => false,
        }
    }

    /// Pasted text goes into the field if it is typed.
    pub fn paste(&mut self, field: Field, text: &str) {
        if let Some(line) = self.text_mut(field) {
            line.paste(text);
        }
    }

    /// The next or previous choice, around the end.
    pub fn step(&mut self, field: Field, by: isize) -> Result<Option<SettingsAction>, String> {
        let serial = &mut self.serial;
        match field {
            Field::Mode => {
                self.mode = next(&MODES, self.mode, by);
                // Only ASCII has seven data bits, and they are usual there.
                serial.data_bits = usual_data_bits(self.mode == Mode::Ascii);
            }
            Field::Baud => serial.baud = next(BAUDS, serial.baud, by),
            Field::DataBits if self.mode == Mode::Ascii => serial.data_bits = next(&[7, 8], serial.data_bits, by),
            Field::DataBits => return Err(t!("Modbus RTU always has 8 data bits; 7 are for ASCII").to_owned()),
            Field::Parity => serial.parity = next(&Parity::ALL, serial.parity, by),
            Field::StopBits => serial.stop_bits = next(&[1, 2], serial.stop_bits, by),
            Field::Port | Field::Host | Field::TcpPort | Field::Timeout | Field::Gap => {}
        }
        Ok(None)
    }
}

fn next<T: Copy + PartialEq>(all: &[T], now: T, by: isize) -> T {
    let place = all.iter().position(|one| *one == now).unwrap_or(0) as isize;
    all[(place + by).rem_euclid(all.len() as isize) as usize]
}

fn millis(name: &str, line: &Line) -> Result<Duration, String> {
    let text = line.text();
    let number =
        text.trim().parse().map_err(|_| t!("{name} \"{text}\" is not a whole number of milliseconds", name, text));
    number.map(Duration::from_millis)
}
