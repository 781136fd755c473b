//! `sightglass decode`: the fields of a frame and their meaning.

use std::{
    io::{BufRead, IsTerminal},
    sync::Arc,
};

use jiff::Timestamp;

use crate::{
    bus::{
        ascii,
        dissect::{self, Direction, Dissection},
        frame::{crc16, hex},
        hex_input::{self, ParsedInput},
        meaning,
        request_lint::check_request,
    },
    plant::{Plant, Snapshot, def::LineDef, line::Framing},
};

use super::{CliError, StationArgs, load, say, say_error};

/// Arguments of `decode`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Bytes in hex (`01 03 00 00 00 01`, `0x01,0x03…`), an ASCII frame (`:0103…`) or lines of a log (`TX 01 03 …`);
    /// none or `-`: lines from standard input
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
    let plant = plant.as_ref();
    if !args.bytes.is_empty() && args.bytes != ["-"] {
        let typed =
            hex_input::parse(&args.bytes.join(" "), framing).map_err(|error| CliError::Usage(error.to_string()))?;
        describe(&typed, framing, None, plant).iter().for_each(|line| say(line));
        return match dissection(&typed, framing, None).wrong {
            None => Ok(()),
            Some(wrong) => Err(CliError::Failed(format!("the frame is wrong: {wrong}"))),
        };
    }
    if std::io::stdin().is_terminal() {
        say_error("one frame per line, Ctrl-D ends");
    }
    lines(std::io::stdin().lock(), framing, plant)
}

/// Explains frames as their lines come. An answer behind its request gets its addresses.
fn lines(input: impl BufRead, framing: Option<Framing>, plant: Option<&Snapshot>) -> Result<(), CliError> {
    let (mut frames, mut corrupt, mut wrong) = (0, 0, 0);
    let mut asked: Option<Dissection> = None;
    for (index, line) in input.split(b'\n').enumerate() {
        let line = line.map_err(CliError::io("cannot read standard input"))?;
        let line = String::from_utf8_lossy(&line);
        if line.trim().is_empty() {
            continue;
        }
        let typed = match hex_input::parse(&line, framing) {
            Ok(typed) => typed,
            Err(error) => {
                say_error(&format!("line {}: {error}", index + 1));
                corrupt += 1;
                continue;
            }
        };
        if 0 < frames {
            say("");
        }
        frames += 1;
        describe(&typed, framing, asked.as_ref(), plant).iter().for_each(|line| say(line));
        wrong += usize::from(dissection(&typed, framing, asked.as_ref()).wrong.is_some());
        let dissection = dissection(&typed, framing, None);
        asked = (dissection.direction != Some(Direction::Answer)).then_some(dissection);
    }
    match (frames, corrupt, wrong) {
        (0, 0, _) => Err(CliError::Usage(hex_input::HexInputError::Empty.to_string())),
        (_, 0, 0) => Ok(()),
        (_, 0, _) => Err(CliError::Failed(format!("{wrong} of {frames} frames are wrong"))),
        _ => Err(CliError::Usage(format!("{corrupt} of {} lines cannot be read", frames + corrupt))),
    }
}

fn dissection(typed: &ParsedInput, framing: Option<Framing>, asked: Option<&Dissection>) -> Dissection {
    let direction = typed.sent.map(|sent| if sent { Direction::Request } else { Direction::Answer });
    // Only what may be an answer to the request before it is read as one.
    let plain = dissect::dissect(&typed.bytes, typed.framing.or(framing), direction, None);
    let matching = asked.filter(|asked| {
        let same =
            |at: usize, mask: u8| plain.message.get(at).map(|byte| byte & mask) == asked.message.get(at).copied();
        direction != Some(Direction::Request) && same(0, 0xFF) && same(1, 0x7F)
    });
    match matching {
        Some(asked) if plain.direction != Some(Direction::Request) => {
            dissect::dissect(&typed.bytes, typed.framing.or(framing), Some(Direction::Answer), Some(&asked.message))
        }
        Some(_) | None => plain,
    }
}

/// The lines about one frame: what it is, every byte, the checks, what is wrong with it.
fn describe(
    typed: &ParsedInput,
    framing: Option<Framing>,
    asked: Option<&Dissection>,
    plant: Option<&Snapshot>,
) -> Vec<String> {
    let dissection = dissection(typed, framing, asked);
    let direction = match dissection.direction {
        Some(Direction::Request) => "request",
        Some(Direction::Answer) => "answer",
        None if dissection.also.is_some() => "request or answer",
        None => "bytes",
    };
    let kind = match dissection.framing {
        Some(Framing::Rtu) => format!("RTU {direction}"),
        Some(Framing::Ascii) => format!("ASCII {direction}"),
        Some(Framing::Mbap) => format!("TCP {direction}"),
        None => format!("{direction} without CRC or header"),
    };
    let mut lines = wrap(&format!("{kind}: {}", dissection.summary), WIDTH, 2);
    lines.extend(means(plant, &dissection, asked).iter().flat_map(|means| wrap(means, WIDTH, 2)));
    lines.extend(table(&dissection));
    lines.extend(checks(&dissection));
    if let Some(wrong) = &dissection.wrong {
        lines.extend(wrap(&format!("wrong: {wrong}"), WIDTH, 2));
    }
    if let Some(also) = &dissection.also {
        let words = if dissection.direction.is_none() { also.clone() } else { format!("may also be {also}") };
        lines.extend(wrap(&words, WIDTH, 2));
    }
    if dissection.direction != Some(Direction::Answer) && dissection.wrong.is_none() {
        for error in check_request(&dissection.message, dissection.framing.unwrap_or(Framing::Rtu)) {
            lines.extend(wrap(&format!("must not be sent: {error}"), WIDTH, 2));
        }
    }
    lines
}

/// What a frame means for the tags of a plant: on whichever of its lines has the unit. Nothing is read, so what a device would
/// say of its decimals is not known.
fn means(plant: Option<&Snapshot>, dissection: &Dissection, asked: Option<&Dissection>) -> Vec<String> {
    let Some(plant) = plant else { return Vec::new() };
    let of_line = |line: &LineDef| match (dissection.direction, asked) {
        (Some(Direction::Answer), Some(asked)) => {
            meaning::of_answer(plant, line.id, &asked.message, &dissection.message)
        }
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

/// Offset counted from 0, bytes, field, meaning.
fn table(dissection: &Dissection) -> Vec<String> {
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
            let at = if index == 0 { field.range.start.to_string() } else { String::new() };
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
