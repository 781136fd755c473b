//! Settings while they are being filled in, and the line that they make.

use crate::t;
use std::time::Duration;

use crate::{
    plant::{
        def::{Framing, LineDef, Parity, Protocol, Rs485, Serial, Transport},
        line_check::{BAUDS, check_settings},
    },
    profile::line::{TCP_PORT, usual_data_bits},
    ui::modal::form::{self, Field, Form},
};

/// The fields of the form, in their order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Setting {
    Mode,
    Port,
    Baud,
    DataBits,
    Parity,
    StopBits,
    Host,
    NetworkPort,
    Timeout,
    Gap,
}

impl Setting {
    /// The unit of the field in this place.
    pub fn unit(n: usize) -> &'static str {
        match n {
            n if n == Setting::Timeout as usize || n == Setting::Gap as usize => "ms",
            n if n == Setting::Baud as usize => "bit/s",
            _ => "",
        }
    }
}

/// The modes of a line: on a serial port or over a network, and with which frames.
const MODES: [(Option<Protocol>, Framing); 8] = [
    (None, Framing::Rtu),
    (None, Framing::Ascii),
    (Some(Protocol::Tcp), Framing::Mbap),
    (Some(Protocol::Tcp), Framing::Rtu),
    (Some(Protocol::Tcp), Framing::Ascii),
    (Some(Protocol::Udp), Framing::Mbap),
    (Some(Protocol::Udp), Framing::Rtu),
    (Some(Protocol::Udp), Framing::Ascii),
];
const STOP_BITS: [u8; 2] = [1, 2];
/// Most characters of a port or a host.
const PLACE_CHARS: usize = 64;

/// Settings as they stand in the form. What another mode needs is kept while this one is chosen.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Draft {
    /// Where the rest comes from: name, idle time, turnaround.
    base: LineDef,
    rs485: Rs485,
    bauds: Vec<u32>,
    pub form: Form,
}

impl Draft {
    /// The form filled with settings; what differs most often is selected.
    pub fn new(settings: &LineDef) -> Draft {
        let usual = (t!("/dev/ttyUSB0"), Serial::USUAL, Rs485::Off, "", TCP_PORT);
        let (port, serial, rs485, host, network_port) = match &settings.transport {
            Transport::Serial { port, serial, rs485, .. } => (&**port, *serial, *rs485, usual.3, usual.4),
            Transport::Network { host, port, .. } => (usual.0, usual.1, usual.2, &**host, *port),
        };
        let is_serial = settings.transport.serial().is_some();
        let mode = (settings.transport.protocol(), settings.transport.framing());
        let mut bauds = BAUDS.to_vec();
        if let Err(place) = bauds.binary_search(&serial.baud) {
            bauds.insert(place, serial.baud);
        }
        let fields = vec![
            Field::one_of(t!("mode"), &MODES, mode, mode_words),
            Field::text(t!("port"), port, PLACE_CHARS),
            Field::one_of(t!("baud rate"), &bauds, serial.baud, |baud| baud.to_string()),
            data_bits(mode.1, serial.data_bits),
            Field::one_of(t!("parity"), &Parity::ALL, serial.parity, parity_words),
            Field::one_of(t!("stop bits"), &STOP_BITS, serial.stop_bits, |bits| bits.to_string()),
            Field::text(t!("host"), host, PLACE_CHARS),
            Field::digits(t!("TCP port"), network_port),
            Field::digits(t!("timeout"), settings.timeout.as_millis()),
            Field::digits(t!("gap"), settings.gap.as_millis()),
        ];
        let first = if is_serial { Setting::Baud } else { Setting::NetworkPort };
        let form = Form::submitting(fields, first as usize);
        let mut draft = Draft { base: settings.clone(), rs485, bauds, form };
        draft.fit();
        draft
    }

    fn mode(&self) -> (Option<Protocol>, Framing) {
        MODES[self.form.chosen(Setting::Mode as usize)]
    }

    /// Are data bits a choice? Modbus RTU always has 8.
    pub fn has_data_bits(&self) -> bool {
        self.mode().1 == Framing::Ascii
    }

    /// Another mode has other fields, and other data bits are usual there.
    pub fn on_mode(&mut self) {
        let framing = self.mode().1;
        self.form.replace(Setting::DataBits as usize, data_bits(framing, usual_data_bits(framing == Framing::Ascii)));
        self.fit();
    }

    fn fit(&mut self) {
        let protocol = self.mode().0;
        let port = if protocol == Some(Protocol::Udp) { t!("UDP port") } else { t!("TCP port") };
        self.form.label_with(Setting::NetworkPort as usize, port);
        let is_serial = protocol.is_none();
        for row in [Setting::Port, Setting::Baud, Setting::DataBits, Setting::Parity, Setting::StopBits] {
            self.form.hide(row as usize, !is_serial);
        }
        for row in [Setting::Host, Setting::NetworkPort] {
            self.form.hide(row as usize, is_serial);
        }
    }

    /// The settings; `Err` says what is wrong with the first that is.
    pub fn settings(&self) -> Result<LineDef, String> {
        if self.form.is_cut() {
            return Err(form::cut());
        }
        let settings = LineDef {
            transport: self.transport()?,
            timeout: self.millis(Setting::Timeout)?,
            gap: self.millis(Setting::Gap)?,
            ..self.base.clone()
        };
        match check_settings(&settings).into_iter().next() {
            Some(error) => Err(format!("{}, {}", error.what, error.expected)),
            None => Ok(settings),
        }
    }

    fn transport(&self) -> Result<Transport, String> {
        let (text, chosen) =
            (|row: Setting| self.form.text(row as usize), |row: Setting| self.form.chosen(row as usize));
        let (protocol, framing) = self.mode();
        let Some(protocol) = protocol else {
            let serial = Serial {
                baud: self.bauds[chosen(Setting::Baud)],
                data_bits: text(Setting::DataBits).parse().unwrap_or_else(|_| usual_data_bits(false)),
                parity: Parity::ALL[chosen(Setting::Parity)],
                stop_bits: STOP_BITS[chosen(Setting::StopBits)],
            };
            return Ok(Transport::Serial { port: text(Setting::Port), serial, framing, rs485: self.rs485 });
        };
        let port = text(Setting::NetworkPort);
        let port = port.parse().map_err(|_| t!("\"{text}\" is not a port, expected 1 to 65535", text = port))?;
        Ok(Transport::Network { protocol, host: text(Setting::Host), port, framing })
    }

    fn millis(&self, row: Setting) -> Result<Duration, String> {
        let (name, text) = (self.form.label(row as usize), self.form.text(row as usize));
        let number =
            text.parse().map_err(|_| t!("{name} \"{text}\" is not a whole number of milliseconds", name, text));
        number.map(Duration::from_millis)
    }

    /// A value in words; of what this mode does not have, none.
    pub fn words(&self, n: usize) -> String {
        if self.form.is_hidden(n) { "–".to_owned() } else { self.form.text(n) }
    }
}

fn data_bits(framing: Framing, now: u8) -> Field {
    let all: &[u8] = if framing == Framing::Ascii { &[7, 8] } else { &[8] };
    Field::one_of(t!("data bits"), all, now, |bits| bits.to_string())
}

fn mode_words(mode: (Option<Protocol>, Framing)) -> &'static str {
    match mode {
        (None, Framing::Ascii) => "ASCII",
        (None, Framing::Rtu | Framing::Mbap) => "RTU",
        (Some(Protocol::Tcp), Framing::Mbap) => "TCP",
        (Some(Protocol::Tcp), Framing::Rtu) => t!("RTU over TCP"),
        (Some(Protocol::Tcp), Framing::Ascii) => t!("ASCII over TCP"),
        (Some(Protocol::Udp), Framing::Mbap) => "UDP",
        (Some(Protocol::Udp), Framing::Rtu) => t!("RTU over UDP"),
        (Some(Protocol::Udp), Framing::Ascii) => t!("ASCII over UDP"),
    }
}

fn parity_words(parity: Parity) -> &'static str {
    match parity {
        Parity::None => t!("none"),
        Parity::Even => t!("even"),
        Parity::Odd => t!("odd"),
        Parity::Mark => t!("mark (always 1)"),
        Parity::Space => t!("space (always 0)"),
    }
}
