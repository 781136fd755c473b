//! Frames in words: every byte of a frame with its name and meaning, and one line that says it all.
//!
//! ```text
//!  bytes ─> envelope ─> message ─┬─> request ─┐
//!           CRC LRC MBAP         └─> answer ──┴─> the reading that fits ─> Dissection
//! ```

mod envelope;
mod fields;
pub mod paste;
mod reader;
mod summary;

#[cfg(test)]
mod tests;

use crate::{t, text::translate};
use std::ops::Range;

use self::{envelope::Envelope, reader::Reader};
use super::{
    frame::{self, Request},
    names, pdu, request_lint,
    wide_addresses::WideAddresses,
};
use crate::plant::{fault::Fault, line::Framing, traffic::Frame};

pub use envelope::{message_of, recognise};

/// Who a frame comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Direction {
    /// The master asks.
    Request,
    /// A device answers.
    Answer,
}

/// A run of bytes with its meaning.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Field {
    /// Its place in the frame as it travels (in characters of an ASCII frame).
    pub range: Range<usize>,
    /// The bytes it stands for: `03 EA`.
    pub hex: String,
    /// `unit`, `address`, `41003 / 0x03EA`.
    pub name: String,
    /// What it says.
    pub words: String,
}

/// A frame in words.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Dissection {
    /// How it is framed; `None`: a message without check or header.
    pub framing: Option<Framing>,
    /// Who it comes from; `None` where request and answer are the same bytes.
    pub direction: Option<Direction>,
    /// Unit and PDU.
    pub message: Vec<u8>,
    /// Every byte, in order.
    pub fields: Vec<Field>,
    /// One line: `unit 1 read holding registers 41003–41012 (0x03EA, 10)`.
    pub summary: String,
    /// The same without the unit.
    pub what: String,
    /// The first thing that is wrong.
    pub wrong: Option<String>,
    /// What else these bytes may be: the other reading, or why both are the same.
    pub also: Option<String>,
}

/// Decodes a frame. Framing and direction are recognised if they are not given. `asked` is the request message (unit
/// and PDU) that the frame answers: it gives the values their addresses, and the answer is checked against it.
pub fn dissect(
    bytes: &[u8],
    framing: Option<Framing>,
    direction: Option<Direction>,
    asked: Option<&[u8]>,
) -> Dissection {
    dissect_with(&WideAddresses::default(), bytes, framing, direction, asked)
}

/// The same of a line on which these addresses hold 32 bits each.
fn dissect_with(
    wide: &WideAddresses,
    bytes: &[u8],
    framing: Option<Framing>,
    direction: Option<Direction>,
    asked: Option<&[u8]>,
) -> Dissection {
    let asked = asked.map(|asked| wide.request(asked));
    let asked_of =
        |message: &[u8]| asked.filter(|asked| asked.message.get(1).copied() == message.get(1).map(|code| code & 0x7F));
    let direction = direction.or(asked.map(|_| Direction::Answer));
    let envelope = match framing {
        Some(framing) => envelope::open(bytes, Some(framing)),
        None => best_envelope(bytes, direction),
    };
    let read = Readings::new(&envelope, wide, asked_of(&envelope.message));
    let (direction, reading, also) = read.choose(direction);
    // Bytes without unit and function have no direction.
    let direction = direction.filter(|_| 2 <= envelope.message.len());
    let wrong = asked.filter(|_| direction != Some(Direction::Request)).and_then(|asked| {
        let fault = frame::check_answer(envelope.framing.unwrap_or(Framing::Rtu), asked, &envelope.message).err()?;
        (!matches!(fault, Fault::Exception(_))).then(|| fault.to_string())
    });
    let wrong = envelope.fault.clone().or(reading.trouble).or(wrong);
    let place = |field: Field| Field {
        range: field.range.start * envelope.step + envelope.offset..field.range.end * envelope.step + envelope.offset,
        ..field
    };
    let mut fields = envelope.before;
    fields.extend(reading.fields.into_iter().map(place));
    fields.extend(envelope.after);
    Dissection {
        framing: envelope.framing,
        direction,
        message: envelope.message,
        fields,
        summary: reading.summary,
        what: reading.what,
        wrong,
        also,
    }
}

/// The envelope that makes most sense of bytes.
fn best_envelope(bytes: &[u8], direction: Option<Direction>) -> Envelope {
    let fits = |envelope: &Envelope| {
        let known = envelope.message.get(1).is_some_and(|code| pdu::function(code & 0x7F).is_some());
        known && Readings::of(envelope).fit(direction)
    };
    let (recognised, bare) = (envelope::open(bytes, recognise(bytes)), envelope::open(bytes, None));
    match recognised.framing {
        Some(Framing::Rtu | Framing::Ascii) => return recognised,
        // A message may look as if it had a header.
        Some(Framing::Mbap) if fits(&recognised) || !fits(&bare) => return recognised,
        Some(Framing::Mbap) | None => {}
    }
    // A frame whose check or header is wrong is one all the same, if the rest makes sense.
    let damaged = [Framing::Rtu, Framing::Mbap].into_iter().filter(|framing| match framing {
        Framing::Mbap => bytes.get(2..4) == Some(&[0, 0]),
        Framing::Rtu | Framing::Ascii => true,
    });
    let damaged = damaged.map(|framing| envelope::open(bytes, Some(framing))).find(fits);
    if fits(&bare) { bare } else { damaged.unwrap_or(bare) }
}

/// Decodes a frame of a line, some of whose addresses may hold 32 bits each; `before` are the earlier frames of the line, the
/// latest first: one of them is the request of an answer.
pub fn in_traffic<'a>(wide: &WideAddresses, frame: &Frame, before: impl Iterator<Item = &'a Frame>) -> Dissection {
    let framing = Some(frame.framing);
    if frame.sent {
        return dissect_with(wide, &frame.bytes, framing, Some(Direction::Request), None);
    }
    let asked = request_of(wide, frame, before);
    dissect_with(wide, &frame.bytes, framing, Some(Direction::Answer), asked.as_deref())
}

/// Earlier frames among which the request of an answer is looked for.
const BEFORE: usize = 16;

/// The request message of an answer, among the earlier frames of its line: the latest that it answers, else the latest to
/// its unit with its function, which it answers wrongly.
pub fn request_of<'a>(
    wide: &WideAddresses,
    answer: &Frame,
    before: impl Iterator<Item = &'a Frame>,
) -> Option<Vec<u8>> {
    let message = message_of(&answer.bytes, answer.framing)?;
    let mut nearest = None;
    for frame in before.take(BEFORE).filter(|frame| frame.sent && frame.framing == answer.framing) {
        let Some(request) = message_of(&frame.bytes, frame.framing) else { continue };
        let same = answer.framing != Framing::Mbap || frame.bytes[..2] == answer.bytes[..2];
        if !same || !frame::begins_answer(&request, &message) {
            continue;
        }
        if frame::answers(answer.framing, wide.request(&request), &message) {
            return Some(request);
        }
        nearest.get_or_insert(request);
    }
    nearest
}

/// A message read as a request, or as an answer.
struct Reading {
    fields: Vec<Field>,
    summary: String,
    what: String,
    trouble: Option<String>,
    fits: bool,
    /// No device would refuse its counts and values.
    sound: bool,
    /// Bytes that made sense.
    sense: usize,
}

struct Readings {
    request: Reading,
    answer: Reading,
    /// Why both readings are the same, if they are: the answer repeats the request, or the function is unknown.
    same: Option<&'static str>,
}

impl Readings {
    /// Those of a frame of which nothing else is known.
    fn of(envelope: &Envelope) -> Readings {
        Readings::new(envelope, &WideAddresses::default(), None)
    }

    fn new(envelope: &Envelope, wide: &WideAddresses, asked: Option<Request>) -> Readings {
        let message = &envelope.message;
        let own = wide.request(message);
        let mbap = envelope.framing == Some(Framing::Mbap);
        let same = match message.get(1) {
            Some(code @ 0..=0x7F) => match pdu::function(*code) {
                Some(function) if function.echoes => {
                    Some(t!("the response repeats the request: these bytes may be either"))
                }
                Some(_) => None,
                None => Some(t!("not a standard function: request and response look the same")),
            },
            Some(_) | None => None,
        };
        Readings {
            request: read(message, mbap, Direction::Request, Some(own)),
            answer: read(message, mbap, Direction::Answer, asked),
            same,
        }
    }

    fn fit(&self, direction: Option<Direction>) -> bool {
        match direction {
            Some(Direction::Request) => self.request.fits,
            Some(Direction::Answer) => self.answer.fits,
            None => self.request.fits || self.answer.fits,
        }
    }

    /// The reading that fits best, and the other one in a line if it fits too.
    fn choose(self, known: Option<Direction>) -> (Option<Direction>, Reading, Option<String>) {
        let Readings { request, answer, same } = self;
        match (known, request.fits, answer.fits) {
            (Some(Direction::Request), ..) => (known, request, None),
            (Some(Direction::Answer), ..) => (known, answer, None),
            (None, true, true) if same.is_some() => (None, request, same.map(str::to_owned)),
            (None, true, true) if !request.sound => {
                let also = t!("a request: {summary}", summary = request.summary);
                (Some(Direction::Answer), answer, Some(also))
            }
            (None, true, true) => {
                let also = t!("a response: {summary}", summary = answer.summary);
                (Some(Direction::Request), request, Some(also))
            }
            (None, true, false) => (Some(Direction::Request), request, None),
            (None, false, true) => (Some(Direction::Answer), answer, None),
            (None, false, false) if request.sense < answer.sense => (Some(Direction::Answer), answer, None),
            (None, false, false) => (Some(Direction::Request), request, None),
        }
    }
}

/// `asked` is the request: the message itself, or that of an answer if it is known.
fn read(message: &[u8], mbap: bool, direction: Direction, asked: Option<Request>) -> Reading {
    let mut reader = Reader::new(message);
    let read = read_message(&mut reader, mbap, direction, asked);
    let (fits, sense) = (reader.fits(), reader.sense());
    let sound = request_lint::check_request(message, Framing::Mbap).is_empty();
    reader.finish();
    let (what, to) = read.unwrap_or_else(|| match message {
        [unit, function, ..] => (t!("{function}, cut short", function = function_name(*function)), Some(*unit)),
        [] => (t!("no frame").to_owned(), None),
        [_] => (t!("no frame: {bytes}", bytes = frame::hex(message)), None),
    });
    let summary = to.map_or_else(|| what.clone(), |unit| t!("unit {unit} {what}", unit, what));
    Reading { fields: reader.fields, summary, what, trouble: reader.trouble, fits, sound, sense }
}

/// What the message says, and the one unit that it goes to.
fn read_message(
    reader: &mut Reader,
    mbap: bool,
    direction: Direction,
    asked: Option<Request>,
) -> Option<(String, Option<u8>)> {
    let unit = reader.byte(t!("unit"), |unit| unit_words(unit, mbap))?;
    let function = reader.byte(t!("function"), |code| match code {
        0x80.. => {
            t!("{code}: exception to {function}", code = names::code(code), function = function_words(code & 0x7F))
        }
        _ => function_words(code),
    })?;
    let what = summary::read(reader, function, direction, asked)?;
    Some(match direction {
        Direction::Answer => (what, None),
        Direction::Request if unit == 0 && !mbap => (t!("broadcast {what}", what), None),
        Direction::Request => (what, Some(unit)),
    })
}

fn unit_words(unit: u8, mbap: bool) -> String {
    match unit {
        0 | 255 if mbap => t!("{unit}, the device itself, no gateway", unit),
        0 => t!("0, broadcast: all execute, none responds").into(),
        1..=247 => format!("{unit}"),
        248..=255 if mbap => format!("{unit}"),
        248..=255 => t!("{unit}, reserved on serial lines (1–247)", unit),
    }
}

/// `3 / 0x03 read holding registers`.
pub fn function_words(code: u8) -> String {
    format!("{} {}", names::code(code), translate(pdu::name(code).unwrap_or(t!("not in the standard"))))
}

fn function_name(code: u8) -> String {
    let known = pdu::name(code & 0x7F).map(|name| translate(name).to_owned());
    known.unwrap_or_else(|| t!("function {code}", code = names::code(code)))
}
