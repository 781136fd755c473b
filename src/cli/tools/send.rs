//! `sightglass send`: bytes as they are, and everything that comes back.

use std::time::Duration;

use super::{PortArgs, answer_lines, run, shown};
use crate::{
    bus::{
        dissect,
        frame::{self, Mbap},
        framing::{self, Reply},
        hex_input::{self, FramedRequest},
        names::{self, Counted, counted},
        request_lint::{check_request, only_reads},
    },
    cli::{CliError, in_runtime, menu, prompt, say, say_error},
    plant::{
        def::Framing,
        diagnostics::{Diagnostic, Finding},
        fault::Fault,
    },
};

/// Arguments of `send`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    port: PortArgs,
    /// Bytes in hex: unit, function, data; the check (TCP: the header) is added unless it is there
    #[arg(value_name = "BYTES", required = true)]
    bytes: Vec<String>,
    /// Add nothing: send exactly these bytes
    #[arg(long)]
    as_is: bool,
    /// Send it even if it is invalid, or a broadcast that every unit executes
    #[arg(long)]
    force: bool,
    /// Send without asking, even if it may change something
    #[arg(long)]
    yes: bool,
}

/// Sends once; an answer that is no Modbus is shown all the same.
pub fn main(args: Args) -> Result<(), CliError> {
    let line = args.port.line()?;
    let framing = line.transport.framing();
    let typed =
        hex_input::parse(&args.bytes.join(" "), Some(framing)).map_err(|error| CliError::Usage(error.to_string()))?;
    let FramedRequest { message, frame } = match args.as_is {
        true => FramedRequest { message: frame::unwrap(framing, &typed.bytes).unwrap_or_default(), frame: typed.bytes },
        false => typed.framed(framing, 1).map_err(|fault| CliError::Usage(format!("nothing was sent: {fault}")))?,
    };
    let wrong = errors(&message, &frame, framing);
    // Bytes that are to go out as they are may be anything.
    if !(args.as_is && message.is_empty()) {
        refuse(&wrong, args.force)?;
    }
    let dissection = dissect::dissect(&frame, Some(framing), Some(dissect::Direction::Request), None);
    let harmless = wrong.is_empty() && only_reads(&message);
    if !args.yes && !harmless {
        let effect = names::effect(&message).map_or_else(String::new, |effect| format!("; {effect}"));
        agree(&format!("{} on {}{effect}", dissection.summary, line.transport))?;
    }
    let sent = [format!("TX {}", shown(&frame, framing)), format!("   {}", dissection.summary)];
    let asked = Asked { framing, frame: frame.clone(), message };
    let run = run(&line, Diagnostic::Send(frame), |finding| match finding {
        Finding::Bytes { bytes, .. } if bytes.is_empty() => sent.to_vec(),
        Finding::Bytes { bytes, response_time } => {
            sent.iter().cloned().chain(asked.lines(bytes, *response_time)).collect()
        }
        Finding::Conclusion(conclusion) => vec![format!("   {conclusion}")],
        Finding::Exchange(_)
        | Finding::Written(_)
        | Finding::Swept(_)
        | Finding::Signals { .. }
        | Finding::Unit { .. }
        | Finding::Object { .. }
        | Finding::Values { .. }
        | Finding::Failed { .. } => Vec::new(),
    })?;
    let answer = run.findings.iter().find_map(|finding| match finding {
        Finding::Bytes { bytes, .. } if !bytes.is_empty() => Some(bytes),
        _ => None,
    });
    let broadcast = asked.message.first().is_some_and(|unit| framing.is_broadcast(*unit));
    match (answer, broadcast) {
        (None, false) => Err(CliError::Failed(format!("no response within {} ms", line.timeout.as_millis()))),
        (None, true) => {
            say("   sent to all units; a broadcast has no response");
            Ok(())
        }
        // What was no request has no answer that could be wrong.
        (Some(_), _) if asked.message.is_empty() => Ok(()),
        (Some(bytes), _) => asked
            .reply(bytes)
            .map(drop)
            .map_err(|why| CliError::Failed(format!("what came back is not the response to this: {why}"))),
    }
}

/// Asks whether a request that may change something is to be sent.
fn agree(what: &str) -> Result<(), CliError> {
    if !menu::is_asked() {
        let words = format!("nothing was sent: this may change something in the device ({what}): --yes sends it");
        return Err(CliError::Usage(words));
    }
    say(&format!("This may change something in the device: {what}."));
    match in_runtime(prompt::is_agreed("send it"))? {
        true => Ok(()),
        false => Err(CliError::Failed("nothing was sent".to_owned())),
    }
}

/// What was sent.
struct Asked {
    framing: Framing,
    frame: Vec<u8>,
    /// Unit and PDU; empty if the bytes were no request.
    message: Vec<u8>,
}

impl Asked {
    /// The answer among what came back.
    fn reply(&self, came: &[u8]) -> Result<Reply, Fault> {
        framing::find_reply(self.framing, &self.frame, came, true)
    }

    /// What came back, byte for byte and in words, and whether it is the answer.
    fn lines(&self, came: &[u8], response_time: Option<Duration>) -> Vec<String> {
        let after =
            response_time.map_or_else(String::new, |time| format!(", after {:.1} ms", time.as_secs_f64() * 1e3));
        if self.message.is_empty() {
            return [answer_lines(came, self.framing, &[]), vec![format!("   received{after}")]].concat();
        }
        let reply = self.reply(came);
        let mut lines = vec![format!("RX {}", shown(came, self.framing))];
        let part = reply.as_ref().map_or(came, |reply| &came[reply.range.clone()]);
        lines.extend(answer_lines(part, self.framing, &self.message).into_iter().skip(1));
        lines.push(match &reply {
            Ok(Reply { exception: None, .. }) => format!("   ok{after}"),
            Ok(Reply { exception: Some(code), .. }) => format!("   {code}{after}"),
            Err(fault) => format!("   {fault}{after}"),
        });
        lines.extend(reply.iter().flat_map(|reply| self.oddities(reply, came)));
        lines
    }

    /// What else came with an answer, and what its frame has that it should not have.
    fn oddities(&self, reply: &Reply, came: &[u8]) -> Vec<String> {
        let (before, behind) = (reply.range.start, came.len() - reply.range.end);
        let around = |count: usize, place: &str| {
            (0 < count).then(|| format!("   {} {place} it, not part of it", counted(count, Counted::Bytes)))
        };
        let header = match frame::mbap(&came[reply.range.clone()]) {
            _ if self.framing != Framing::Mbap => None,
            Mbap::Whole { .. } if reply.exception.is_some() && 3 < reply.message.len() => {
                let surplus = counted(reply.message.len() - 3, Counted::Bytes);
                Some(format!("   {surplus} behind the exception code: an exception has none"))
            }
            Mbap::Whole { .. } => None,
            Mbap::Incomplete | Mbap::Broken => {
                let length = u16::from_be_bytes([came[reply.range.start + 4], came[reply.range.start + 5]]);
                Some(format!("   its header says {length} bytes, {} follow", reply.message.len()))
            }
        };
        [around(before, "before"), around(behind, "behind"), header].into_iter().flatten().collect()
    }
}

/// What is wrong stops it, unless forced.
fn refuse(wrong: &[String], force: bool) -> Result<(), CliError> {
    if !wrong.is_empty() && !force {
        return Err(CliError::Usage(format!("nothing was sent (--force sends it): {}", wrong.join("; "))));
    }
    wrong.iter().for_each(|error| say_error(&format!("--force: {error}")));
    Ok(())
}

/// What is wrong with a request, and with what would go out behind it.
fn errors(message: &[u8], frame: &[u8], framing: Framing) -> Vec<String> {
    let mut errors: Vec<String> = check_request(message, framing).into_iter().map(|error| error.to_string()).collect();
    if let (Framing::Rtu, Some((inner, check))) = (framing, message.split_last_chunk::<2>())
        && !errors.is_empty()
        && check_request(inner, framing).is_empty()
    {
        let [low, high] = frame::crc16(inner).to_le_bytes();
        let [got_low, got_high] = check;
        errors = vec![format!("wrong CRC: found {got_low:02X} {got_high:02X}, expected {low:02X} {high:02X}")];
    }
    if message.first().is_some_and(|unit| framing.is_broadcast(*unit)) && errors.is_empty() {
        errors.push("unit 0 is a broadcast: every unit on the line executes it and none responds".into());
    }
    let behind = frame.len().saturating_sub(frame::wrap(framing, 1, message).len());
    if 0 < behind {
        errors.push(format!("{behind} bytes behind the first request: they may be another"));
    }
    errors
}
