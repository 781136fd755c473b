//! Pasted bytes: the frames among them, in the framing that explains most, and what stands between.

use std::ops::Range;

use super::{Direction, Dissection, Readings, dissect, envelope};
use crate::{
    bus::{
        frame,
        frame_boundaries::{self, Cut},
        pdu::{self, Length},
        request_lint::check_request,
    },
    plant::line::Framing,
};

/// Requests that an answer may belong to.
const ASKED_MAX: usize = 16;
/// The order of preference where two framings explain as much: text is no accident, a CRC seldom, a header often.
const FRAMINGS: [Framing; 3] = [Framing::Ascii, Framing::Rtu, Framing::Mbap];

/// Bytes in words.
#[derive(Debug, Clone, PartialEq)]
pub struct Paste {
    /// Their framing; `None`: a message without check or header.
    pub framing: Option<Framing>,
    /// All of them, in order.
    pub parts: Vec<Part>,
    /// Why they are read so.
    pub why: Why,
    /// How else they may be read.
    pub instead: Option<Instead>,
}

/// A run of bytes.
#[derive(Debug, Clone, PartialEq)]
pub struct Part {
    /// Its place.
    pub range: Range<usize>,
    /// What the frame says; `None`: no frame.
    pub dissection: Option<Dissection>,
    /// The request message that it answers, if that stood before.
    pub asked: Option<Vec<u8>>,
}

/// Why bytes are read as they are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Why {
    /// The CRC or LRC of its frames fits.
    Check,
    /// Its frames are as long as header and function say.
    Header,
    /// No check and no header, but each byte has its place.
    Message,
    /// Each byte has its place, but the check does not fit.
    BadCheck,
    /// Each byte has its place, but the header is wrong.
    BadHeader,
    /// None of these.
    Nothing,
}

/// A reading that was not preferred.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Instead {
    /// Its framing; `None`: a message without check or header.
    pub framing: Option<Framing>,
    /// What it would say.
    pub summary: String,
}

/// Requests in the order in which they stood, each with its transaction id.
#[derive(Debug, Clone, Default)]
pub struct Asked(Vec<(u16, Vec<u8>)>);

impl Asked {
    /// The request that a frame answers.
    fn of(&self, dissection: &Dissection, bytes: &[u8]) -> Option<&[u8]> {
        let framing = dissection.framing.unwrap_or(Framing::Rtu);
        let same = |(id, _): &&(u16, Vec<u8>)| framing != Framing::Mbap || *id == id_of(bytes);
        // Without transaction ids only the last request can be meant.
        let latest = if framing == Framing::Mbap { ASKED_MAX } else { 1 };
        let (_, asked) = self.0.iter().rev().take(latest).find(same)?;
        // What may be a request is one, unless it answers: the echo of a write.
        let is_answer =
            dissection.direction == Some(Direction::Answer) && frame::begins_answer(asked, &dissection.message);
        (is_answer || frame::answers(framing, asked, &dissection.message)).then_some(&asked[..])
    }

    fn take(&mut self, dissection: &Dissection, bytes: &[u8]) {
        if dissection.direction == Some(Direction::Answer) {
            self.0.retain(|(id, _)| dissection.framing == Some(Framing::Mbap) && *id != id_of(bytes));
            return;
        }
        if self.0.len() == ASKED_MAX {
            self.0.remove(0);
        }
        self.0.push((id_of(bytes), dissection.message.clone()));
    }
}

/// The first two bytes as a number: the transaction id of Modbus TCP.
fn id_of(bytes: &[u8]) -> u16 {
    bytes.first_chunk().map_or(0, |id| u16::from_be_bytes(*id))
}

/// Reads pasted bytes. Framing and direction are recognised if they are not given; `asked` has the requests of earlier
/// bytes, and takes those of these.
pub fn read(bytes: &[u8], framing: Option<Framing>, direction: Option<Direction>, asked: &mut Asked) -> Paste {
    let last = asked.0.last().map(|(_, message)| &message[..]);
    let framings = FRAMINGS.into_iter().filter(|known| framing.is_none_or(|framing| framing == *known));
    let mut readings: Vec<(Framing, Vec<Run>)> =
        framings.map(|known| (known, runs(known, bytes, last, framing.is_some()))).collect();
    let covered = |runs: &[Run]| runs.iter().filter(|run| run.is_frame).map(|run| run.range.len()).sum::<usize>();
    readings.retain(|(_, runs)| 0 < covered(runs));
    // The sort is stable: of two that explain as much the first stays first.
    readings.sort_by_key(|(_, runs)| std::cmp::Reverse(covered(runs)));
    let is_better = |(known, runs): &(Framing, Vec<Run>), message: bool| {
        let needed = match known {
            _ if !message => 1,
            // A few bytes of a message may look like a frame by chance.
            Framing::Ascii | Framing::Rtu => bytes.len().div_ceil(2),
            Framing::Mbap => bytes.len(),
        };
        needed <= covered(runs)
    };
    let bare = if framing.is_none() { sound_message(bytes, direction) } else { None };
    let mut rest = readings.into_iter();
    let Some((known, runs)) = rest.next().filter(|reading| is_better(reading, bare.is_some())) else {
        return whole(bytes, framing, direction, asked);
    };
    let why = if known == Framing::Mbap { Why::Header } else { Why::Check };
    let is_half = |reading: &(Framing, Vec<Run>)| bytes.len() <= 2 * covered(&reading.1);
    let second = rest
        .next()
        .filter(is_half)
        .map(|(framing, runs)| (Some(framing), first_frame(framing, bytes, &runs, direction)));
    let instead = bare.map(|summary| (None, summary)).or(second);
    let parts = runs.into_iter().map(|run| part(known, bytes, run, direction, asked)).collect();
    let instead = instead.map(|(framing, summary)| Instead { framing, summary });
    Paste { framing: Some(known), parts, why, instead }
}

/// Bytes that are one frame, or none.
struct Run {
    range: Range<usize>,
    is_frame: bool,
}

/// Frames of a framing and what stands between them.
fn runs(framing: Framing, bytes: &[u8], asked: Option<&[u8]>, is_given: bool) -> Vec<Run> {
    let (mut runs, mut at, mut noise) = (Vec::new(), 0, 0);
    let mut asked = asked.map(<[u8]>::to_vec);
    let end_noise = |runs: &mut Vec<Run>, range: Range<usize>| {
        let frames = frame_boundaries::of_unknown_functions(&bytes[range.clone()]).filter(|_| framing == Framing::Rtu);
        let mut from = range.start;
        for length in frames.iter().flatten() {
            runs.push(Run { range: from..from + length, is_frame: true });
            from += length;
        }
        if from < range.end {
            runs.push(Run { range: from..range.end, is_frame: false });
        }
    };
    while at < bytes.len() {
        let message = |length: usize| frame::unwrap(framing, &bytes[at..at + length]).ok();
        // A header has no check: what stands behind it must make sense.
        let known = |message: &Vec<u8>| match is_known(message) {
            true => {
                check_request(message, framing).is_empty()
                    || pdu::response_length(message) == Length::Known(message.len())
            }
            false => is_given,
        };
        match frame_boundaries::cut(framing, &bytes[at..], asked.as_deref(), true) {
            Cut::Frame(length) if framing != Framing::Mbap || message(length).as_ref().is_some_and(known) => {
                end_noise(&mut runs, noise..at);
                runs.push(Run { range: at..at + length, is_frame: true });
                asked = message(length).or(asked);
                at += length;
                noise = at;
            }
            Cut::Frame(_) | Cut::Wait | Cut::Noise => at += 1,
        }
    }
    end_noise(&mut runs, noise..bytes.len());
    runs
}

/// One run of bytes in words.
fn part(framing: Framing, bytes: &[u8], run: Run, direction: Option<Direction>, asked: &mut Asked) -> Part {
    let Run { range, is_frame } = run;
    let bytes = &bytes[range.clone()];
    match is_frame || is_damaged(framing, bytes, direction) {
        true => answered(range, bytes, Some(framing), direction, asked),
        false => Part { range, dissection: None, asked: None },
    }
}

/// Bytes in words, as the answer to their request if that stood before.
fn answered(
    range: Range<usize>,
    bytes: &[u8],
    framing: Option<Framing>,
    direction: Option<Direction>,
    asked: &mut Asked,
) -> Part {
    let plain = dissect(bytes, framing, direction, None);
    let request = asked.of(&plain, bytes).filter(|_| direction != Some(Direction::Request)).map(<[u8]>::to_vec);
    let dissection = match &request {
        Some(request) => dissect(bytes, framing, Some(Direction::Answer), Some(request)),
        None => plain,
    };
    asked.take(&dissection, bytes);
    Part { range, dissection: Some(dissection), asked: request }
}

/// All bytes as one message or frame, whatever is wrong with it.
fn whole(bytes: &[u8], framing: Option<Framing>, direction: Option<Direction>, asked: &mut Asked) -> Paste {
    let part = answered(0..bytes.len(), bytes, framing, direction, asked);
    let framing = part.dissection.as_ref().and_then(|dissection| dissection.framing);
    let envelope = envelope::open(bytes, framing);
    let fits = is_known(&envelope.message) && Readings::of(&envelope).fit(direction);
    let why = match (framing, envelope.fault.is_none()) {
        (None, _) if fits => Why::Message,
        (Some(Framing::Mbap), true) => Why::Header,
        (Some(Framing::Rtu | Framing::Ascii), true) => Why::Check,
        (Some(Framing::Mbap), false) if fits => Why::BadHeader,
        (Some(Framing::Rtu | Framing::Ascii), false) if fits => Why::BadCheck,
        (Some(_) | None, _) => Why::Nothing,
    };
    Paste { framing, parts: vec![part], why, instead: None }
}

/// Would these bytes be a frame, if its check or header were right?
fn is_damaged(framing: Framing, bytes: &[u8], direction: Option<Direction>) -> bool {
    let envelope = envelope::open(bytes, Some(framing));
    is_known(&envelope.message) && Readings::of(&envelope).fit(direction)
}

/// What bytes say as a message without check or header, if each of them has its place there and no device would refuse it.
fn sound_message(bytes: &[u8], direction: Option<Direction>) -> Option<String> {
    let readings = Readings::of(&envelope::open(bytes, None));
    let is_sound = is_known(bytes) && readings.fit(direction) && (readings.request.sound || readings.answer.fits);
    is_sound.then(|| readings.choose(direction).1.summary)
}

fn is_known(message: &[u8]) -> bool {
    message.get(1).is_some_and(|code| pdu::function(code & 0x7F).is_some())
}

fn first_frame(framing: Framing, bytes: &[u8], runs: &[Run], direction: Option<Direction>) -> String {
    let first = runs.iter().find(|run| run.is_frame).map_or(0..0, |run| run.range.clone());
    dissect(&bytes[first], Some(framing), direction, None).summary
}

#[cfg(test)]
mod tests;
