//! `sightglass decode`: the fields of a frame and their meaning.

use std::{
    io::{BufRead, IsTerminal},
    sync::Arc,
};

use jiff::Timestamp;

use crate::{
    bus::{
        ascii,
        dissect::{
            Direction, Dissection,
            paste::{self, Asked, Part, Paste, Why},
        },
        frame::{crc16, hex},
        hex_input::{self, HexInputError, Pasted},
        meaning,
        names::{Counted, counted},
        request_lint::check_request,
    },
    plant::{Plant, Snapshot, def::LineDef, line::Framing},
};

use super::{CliError, StationArgs, load, say, say_error};

/// Arguments of `decode`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Bytes in hex (`01 03 00 00 00 01`, `0x01,0x03…`), ASCII frames (`:0103…`) or lines of a log (`TX 01 03 …`), with
    /// anything before, between and behind the frames; none or `-`: lines from standard input
    #[arg(value_name = "BYTES")]
    bytes: Vec<String>,
    /// The bytes are an RTU frame, with CRC
    #[arg(long, group = "framing")]
    rtu: bool,
    /// The bytes are the characters of an ASCII frame, from `:` to CR LF
    #[arg(long, group = "framing")]
    ascii: bool,
    /// The bytes are a Modbus TCP frame, with its header
    #[arg(long, group = "framing")]
    tcp: bool,
    /// A plant file, or the name of a shipped plant: what the frame means for its tags
    #[arg(long, value_name = "PLANT")]
    plant: Option<String>,
}

/// Columns of the table.
const WIDTH: usize = 80;
/// Most bytes on one row.
const BYTES: usize = 8;

/// Decodes every frame; a line that cannot be parsed is reported on standard error, and the others are decoded.
pub fn main(args: Args) -> Result<(), CliError> {
    let framing = match (args.rtu, args.ascii, args.tcp) {
        (true, ..) => Some(Framing::Rtu),
        (_, true, _) => Some(Framing::Ascii),
        (.., true) => Some(Framing::Mbap),
        (false, false, false) => None,
    };
    let plant = args.plant.as_deref().map(|plant| load(plant, &StationArgs::default())).transpose()?;
    let plant = plant.map(|def| Plant::new(Arc::new(def), Timestamp::UNIX_EPOCH, 1.0).snapshot());
    let mut decoder = Decoder { framing, plant: plant.as_ref(), asked: Asked::default() };
    let text = args.bytes.join(" ");
    // A log is read line by line: each says who sent it.
    if text.lines().filter(|line| hex_input::is_of_log(line)).count() > 1 {
        return lines(text.as_bytes(), &mut decoder);
    }
    if !args.bytes.is_empty() && args.bytes != ["-"] {
        let (said, wrong) = decoder.decode(&text).map_err(|error| CliError::Usage(error.to_string()))?;
        said.iter().for_each(|line| say(line));
        return match wrong {
            None => Ok(()),
            Some(wrong) => Err(CliError::Failed(format!("the frame is wrong: {wrong}"))),
        };
    }
    if std::io::stdin().is_terminal() {
        say_error("one frame per line, Ctrl-D ends");
    }
    lines(std::io::stdin().lock(), &mut decoder)
}

/// Explains frames as their lines come. An answer behind its request gets its addresses.
fn lines(input: impl BufRead, decoder: &mut Decoder) -> Result<(), CliError> {
    let (mut frames, mut corrupt, mut wrong) = (0, 0, 0);
    for (index, line) in input.split(b'\n').enumerate() {
        let line = line.map_err(CliError::io("cannot read standard input"))?;
        let line = String::from_utf8_lossy(&line);
        if line.trim().is_empty() {
            continue;
        }
        match decoder.decode(&line) {
            Ok((said, fault)) => {
                let blank = (0 < frames).then(String::new);
                blank.iter().chain(&said).for_each(|line| say(line));
                frames += 1;
                wrong += usize::from(fault.is_some());
            }
            Err(error) => {
                say_error(&format!("line {}: {error}", index + 1));
                corrupt += 1;
            }
        }
    }
    match (frames, corrupt, wrong) {
        (0, 0, _) => Err(CliError::Usage(HexInputError::Empty.to_string())),
        (_, 0, 0) => Ok(()),
        (_, 0, _) => Err(CliError::Failed(format!("{wrong} of {frames} frames are wrong"))),
        _ => Err(CliError::Usage(format!("{corrupt} of {} lines cannot be read", frames + corrupt))),
    }
}

/// Text to words.
struct Decoder<'a> {
    framing: Option<Framing>,
    plant: Option<&'a Snapshot>,
    asked: Asked,
}

impl Decoder<'_> {
    /// The lines about all that is pasted, and the first thing that is wrong with a frame of it.
    fn decode(&mut self, text: &str) -> Result<(Vec<String>, Option<String>), HexInputError> {
        let Pasted { input, doubt } = hex_input::parse_paste(text)?;
        let direction = input.sent.map(|sent| if sent { Direction::Request } else { Direction::Answer });
        let paste = paste::read(&input.bytes, input.framing.or(self.framing), direction, &mut self.asked);
        if let Some(error) = doubt.filter(|_| !matches!(paste.why, Why::Check | Why::Header)) {
            return Err(error);
        }
        let mut lines = Vec::new();
        if let [Part { dissection: Some(dissection), asked, .. }] = &paste.parts[..] {
            lines.extend(self.describe(dissection, 0, asked.as_deref()));
            lines.extend(wrap(&why(&paste), WIDTH, 2));
            lines.extend(instead(&paste));
        } else {
            lines.extend(wrap(&overview(&paste), WIDTH, 2));
            lines.extend(instead(&paste));
            for part in &paste.parts {
                lines.push(String::new());
                lines.extend(self.part(part, &input.bytes));
            }
        }
        let wrong = paste.parts.iter().find_map(|part| part.dissection.as_ref()?.wrong.clone());
        Ok((lines, wrong))
    }

    /// One frame of several, or what is none.
    fn part(&self, part: &Part, bytes: &[u8]) -> Vec<String> {
        let (first, count) = (part.range.start, part.range.len());
        match &part.dissection {
            Some(dissection) => self.describe(dissection, first, part.asked.as_deref()),
            None => {
                let place = match count {
                    1 => format!("byte {first} is"),
                    _ => format!("bytes {first}–{} are", first + count - 1),
                };
                let none = format!("{place} in no frame: {}", hex(&bytes[part.range.clone()]));
                wrap(&none, WIDTH, 2)
            }
        }
    }

    /// The lines about one frame, whose first byte is at `offset`: what it is, every byte, the checks, what is wrong with it.
    fn describe(&self, dissection: &Dissection, offset: usize, asked: Option<&[u8]>) -> Vec<String> {
        let direction = match dissection.direction {
            Some(Direction::Request) => "request",
            Some(Direction::Answer) => "answer",
            None if dissection.also.is_some() => "request or answer",
            None => "bytes",
        };
        let kind = match dissection.framing {
            Some(framing) => format!("{} {direction}", name_of(framing)),
            None => format!("{direction} without CRC or header"),
        };
        let mut lines = wrap(&format!("{kind}: {}", dissection.summary), WIDTH, 2);
        lines.extend(means(self.plant, dissection, asked).iter().flat_map(|means| wrap(means, WIDTH, 2)));
        lines.extend(table(dissection, offset));
        lines.extend(checks(dissection));
        if let Some(wrong) = &dissection.wrong {
            lines.extend(wrap(&format!("wrong: {wrong}"), WIDTH, 2));
        }
        let refused = check_request(&dissection.message, dissection.framing.unwrap_or(Framing::Rtu));
        if let Some(also) = &dissection.also {
            let words = match (dissection.direction, refused.first()) {
                (None, _) => also.clone(),
                (Some(Direction::Answer), Some(error)) => format!("may also be {also}; but must not be sent: {error}"),
                (Some(_), _) => format!("may also be {also}; as a request no device would refuse it"),
            };
            lines.extend(wrap(&words, WIDTH, 2));
        }
        if dissection.direction != Some(Direction::Answer) && dissection.wrong.is_none() {
            lines.extend(refused.iter().flat_map(|error| wrap(&format!("must not be sent: {error}"), WIDTH, 2)));
        }
        lines
    }
}

/// How many frames there are, and why these bytes are read so.
fn overview(paste: &Paste) -> String {
    let frames = paste.parts.iter().filter(|part| part.dissection.is_some()).count();
    let noise: usize = paste.parts.iter().filter(|part| part.dissection.is_none()).map(|part| part.range.len()).sum();
    let noise = (0 < noise).then(|| format!(", {} in no frame", counted(noise, Counted::Bytes)));
    let kind = paste.framing.map_or("bare", name_of);
    let frames = if frames == 1 { format!("1 {kind} frame") } else { format!("{frames} {kind} frames") };
    format!("{frames}{}; {}", noise.unwrap_or_default(), why(paste))
}

fn name_of(framing: Framing) -> &'static str {
    match framing {
        Framing::Rtu => "RTU",
        Framing::Ascii => "ASCII",
        Framing::Mbap => "TCP",
    }
}

/// Why bytes are read as they are.
fn why(paste: &Paste) -> String {
    let place = "every other byte has its place";
    match (paste.why, paste.framing) {
        (Why::Check, Some(Framing::Ascii)) => "read as ASCII: the LRC fits".to_owned(),
        (Why::Check, _) => "read as RTU: the CRC fits".to_owned(),
        (Why::Header, _) => "read as TCP: header and function give the same length".to_owned(),
        (Why::Message, _) => {
            "read as a message alone: no CRC fits, there is no header, and every byte has its place".to_owned()
        }
        (Why::BadCheck, Some(Framing::Ascii)) => format!("read as ASCII: the LRC is wrong, but {place}"),
        (Why::BadCheck, _) => format!("read as RTU: the CRC is wrong, but {place}"),
        (Why::BadHeader, _) => format!("read as TCP: the header is wrong, but {place}"),
        (Why::Nothing, _) => {
            "no CRC or LRC fits, there is no header, and no message of the standard looks like this".to_owned()
        }
    }
}

/// The reading that was not preferred, and why.
fn instead(paste: &Paste) -> Vec<String> {
    let Some(other) = &paste.instead else { return Vec::new() };
    let reason = match paste.framing {
        Some(Framing::Rtu) => "a CRC fits by chance once in 65,536 times",
        Some(Framing::Ascii) => "hex digits between `:` and CR LF are no coincidence",
        Some(Framing::Mbap) | None => "a header that fits is less likely by chance",
    };
    let kind = other.framing.map_or("a message alone", name_of);
    wrap(&format!("may also be {kind}: {}; {reason}", other.summary), WIDTH, 2)
}

/// What a frame means for the tags of a plant: on whichever of its lines has the unit. Nothing is read, so what a device would
/// say of its decimals is not known.
fn means(plant: Option<&Snapshot>, dissection: &Dissection, asked: Option<&[u8]>) -> Vec<String> {
    let Some(plant) = plant else { return Vec::new() };
    let of_line = |line: &LineDef| match (dissection.direction, asked) {
        (Some(Direction::Answer), Some(asked)) => meaning::of_answer(plant, line.id, asked, &dissection.message),
        (Some(Direction::Answer), None) => Vec::new(),
        (Some(Direction::Request) | None, _) => meaning::of_request(plant, line.id, &dissection.message),
    };
    plant.def.lines.iter().flat_map(of_line).collect()
}

/// Both checks of the message, as they would be sent.
fn checks(dissection: &Dissection) -> Option<String> {
    let message = &dissection.message;
    (2 <= message.len())
        .then(|| format!("CRC {}   LRC {:02X}", hex(&crc16(message).to_le_bytes()), ascii::lrc(message)))
}

/// Offset counted from 0, bytes, field, meaning; the frame begins at `offset`.
fn table(dissection: &Dissection, offset: usize) -> Vec<String> {
    let hex_rows = |hex: &str| -> Vec<String> {
        let bytes: Vec<&str> = hex.split(' ').collect();
        bytes.chunks(BYTES).map(|row| row.join(" ")).collect()
    };
    let widest = |lengths: &mut dyn Iterator<Item = usize>, least: usize| lengths.max().unwrap_or(0).max(least);
    let hex_width = widest(&mut dissection.fields.iter().map(|field| field.hex.len().min(3 * BYTES - 1)), 5);
    let name_width = widest(&mut dissection.fields.iter().map(|field| field.name.chars().count()), 5);
    let words_width = WIDTH.saturating_sub(2 + 4 + 2 + hex_width + 2 + name_width + 2).max(20);
    let row = |at: &str, hex: &str, name: &str, words: &str| {
        format!("  {at:>4}  {hex:hex_width$}  {name:name_width$}  {words}").trim_end().to_owned()
    };
    let mut lines = vec![row("at", "bytes", "field", "meaning")];
    for field in &dissection.fields {
        let (hex, words) = (hex_rows(&field.hex), wrap(&field.words, words_width, 0));
        for index in 0..hex.len().max(words.len()) {
            let part = |rows: &[String]| rows.get(index).cloned().unwrap_or_default();
            let at = if index == 0 { (offset + field.range.start).to_string() } else { String::new() };
            let name = if index == 0 { field.name.as_str() } else { "" };
            lines.push(row(&at, &part(&hex), name, &part(&words)));
        }
    }
    lines
}

/// Cuts a text between words; lines behind the first are indented.
fn wrap(text: &str, width: usize, indent: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    let mut line = String::new();
    for word in text.split(' ') {
        if !line.trim().is_empty() && width < line.chars().count() + 1 + word.chars().count() {
            lines.push(std::mem::replace(&mut line, " ".repeat(indent)));
        } else if !line.is_empty() {
            line.push(' ');
        }
        line.push_str(word);
    }
    lines.push(line);
    lines
}
