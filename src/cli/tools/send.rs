//! `sightglass send`: bytes as they are, and everything that comes back.

use super::{PortArgs, answer_lines, run, shown};
use crate::{
    bus::{
        ascii, dissect, frame, hex_input, names,
        request_lint::{check_request, only_reads},
    },
    cli::{CliError, in_runtime, menu, prompt, say, say_error},
    plant::{
        def::Framing,
        diagnostics::{Diagnostic, Finding},
        event::Fault,
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
    /// Send it although something is wrong with it, or every unit would obey it
    #[arg(long)]
    force: bool,
    /// Send without a query what may change something
    #[arg(long)]
    yes: bool,
}

/// Sends once; an answer that is no Modbus is shown all the same.
pub fn main(args: Args) -> Result<(), CliError> {
    let line = args.port.line()?;
    let framing = line.transport.framing();
    let typed =
        hex_input::parse(&args.bytes.join(" "), Some(framing)).map_err(|error| CliError::Usage(error.to_string()))?;
    let whole = frame::unwrap(framing, &typed.bytes).ok();
    let (message, frame) = match (whole, typed.framing) {
        (whole, _) if args.as_is => (whole.unwrap_or_default(), typed.bytes),
        (Some(message), _) => (message, typed.bytes),
        // The characters of an ASCII frame mean its message, on any line.
        (None, Some(Framing::Ascii)) => {
            let message =
                ascii::open(&typed.bytes).map_err(|fault| CliError::Usage(format!("nothing was sent: {fault}")))?;
            let frame = frame::wrap(framing, 1, &message);
            (message, frame)
        }
        (None, _) => (typed.bytes.clone(), frame::wrap(framing, 1, &typed.bytes)),
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
    let request = message.clone();
    let run = run(&line, Diagnostic::Send(frame), |finding| match finding {
        Finding::Bytes { bytes, .. } if bytes.is_empty() => sent.to_vec(),
        Finding::Bytes { bytes, response_time: reply } => {
            let mut lines = sent.to_vec();
            lines.extend(answer_lines(bytes, framing, &request));
            let verdict = verdict(framing, &request, bytes).unwrap_or_else(|why| why);
            let after = reply.map(|reply| format!(", after {:.1} ms", reply.as_secs_f64() * 1e3)).unwrap_or_default();
            lines.push(format!("   {verdict}{after}"));
            lines
        }
        Finding::Exchange(_)
        | Finding::Written(_)
        | Finding::Swept(_)
        | Finding::Signals { .. }
        | Finding::Unit { .. }
        | Finding::Object { .. }
        | Finding::Values { .. }
        | Finding::Failed { .. }
        | Finding::Conclusion(_) => Vec::new(),
    })?;
    let answer = run.findings.iter().find_map(|finding| match finding {
        Finding::Bytes { bytes, .. } if !bytes.is_empty() => Some(bytes),
        _ => None,
    });
    let broadcast = message.first().is_some_and(|unit| framing.is_broadcast(*unit));
    match (answer, broadcast) {
        (None, false) => Err(CliError::Failed(format!("no answer within {} ms", line.timeout.as_millis()))),
        (None, true) => {
            say("   sent to all units; a broadcast has no response");
            Ok(())
        }
        // What was no request has no answer that could be wrong.
        (Some(_), _) if message.is_empty() => Ok(()),
        (Some(bytes), _) => verdict(framing, &message, bytes)
            .map(drop)
            .map_err(|why| CliError::Failed(format!("what came back is no answer to this: {why}"))),
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

/// What an answer is, in words; `Err` for bytes that are none.
fn verdict(framing: Framing, request: &[u8], bytes: &[u8]) -> Result<String, String> {
    if framing == Framing::Mbap && frame::mbap(bytes) == frame::Mbap::Broken {
        return Err("no Modbus TCP header".to_owned());
    }
    match frame::unwrap(framing, bytes).and_then(|answer| frame::check_answer(framing, request, &answer)) {
        Ok(()) => Ok("ok".to_owned()),
        // A refusal is an answer.
        Err(fault @ Fault::Exception(_)) => Ok(fault.to_string()),
        Err(fault) => Err(fault.to_string()),
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
