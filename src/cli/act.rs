//! `sightglass write`, `ack` and `correct`: actions at a running station, with rights, checks and records as on the screen.

use std::sync::Arc;

use crate::plant::{
    Snapshot,
    alarm::manager::subject_name,
    command::{CommandKind, Outcome},
    def::TagId,
    exact::Exact,
};

use super::{CliError, client, in_runtime, say};

/// Arguments of `write`.
#[derive(Debug, clap::Args)]
pub struct WriteArgs {
    /// The tag: TIC-1.SV
    tag: String,
    /// The new value in the tag's unit, or one of its words
    #[arg(allow_negative_numbers = true)]
    value: String,
    #[command(flatten)]
    action: client::ActionArgs,
}

/// Arguments of `ack`.
#[derive(Debug, clap::Args)]
pub struct AckArgs {
    /// Tags or devices whose alarms are acknowledged: TIC-1.PV
    #[arg(required_unless_present = "all")]
    subjects: Vec<String>,
    /// Every alarm that waits for it now
    #[arg(long, conflicts_with = "subjects")]
    all: bool,
    #[command(flatten)]
    action: client::ActionArgs,
}

/// Arguments of `correct`.
#[derive(Debug, clap::Args)]
pub struct CorrectArgs {
    /// The counter: PM-1.E
    tag: String,
    /// What is added to what it counted, in its unit; below 0 it is taken away
    #[arg(allow_negative_numbers = true)]
    amount: Exact,
    #[command(flatten)]
    action: client::ActionArgs,
}

/// Corrects what a counter counted, and prints the outcome; the note is the reason.
pub fn correct(args: CorrectArgs) -> Result<(), CliError> {
    in_runtime(async {
        let mut actor = args.action.attach().await?;
        let snapshot = actor.session.snapshots.borrow().clone();
        let tag = tag_named(&snapshot, &args.tag)?;
        let status = actor.send_command(1, CommandKind::CorrectCounter { tag, amount: args.amount }).await?;
        let (amount, unit) = (snapshot.format(tag, args.amount), snapshot.unit(tag));
        let line = format!("{} corrected by {amount} {unit}: ", args.tag);
        if status.outcome != Outcome::Verified {
            return Err(CliError::Failed(line + &status.outcome.to_string()));
        }
        say(&(line + "done" + client::recorded_words(status.recorded)));
        Ok(())
    })
}

fn tag_named(snapshot: &Snapshot, name: &str) -> Result<TagId, CliError> {
    let unknown = || CliError::Usage(format!("no tag `{name}` in {}", snapshot.def.name));
    snapshot.def.tag_named(name).ok_or_else(unknown)
}

/// Writes and prints the outcome; anything but verified, or sent where nothing can be, is a failure.
pub fn write(args: WriteArgs) -> Result<(), CliError> {
    in_runtime(async {
        let mut actor = args.action.attach().await?;
        let snapshot = actor.session.snapshots.borrow().clone();
        let tag = tag_named(&snapshot, &args.tag)?;
        let value = value(&snapshot, tag, &args.value).map_err(CliError::Usage)?;
        let kind = CommandKind::Write { tag, value };
        let status = actor.send_command(1, kind).await?;
        let words = |value: Option<Exact>| value.map_or_else(|| "----".to_owned(), |value| snapshot.format(tag, value));
        // What the station says that the device holds, which need not be what was typed.
        let new = status.command.kind.written().map(|(_, held)| held);
        let (old, new, unit) = (words(status.old), words(new), snapshot.unit(tag));
        let recorded = client::recorded_words(status.recorded);
        let line = format!("{} {old} → {new} {unit}: {}{recorded}", args.tag, status.outcome);
        if !status.outcome.is_success() {
            return Err(CliError::Failed(line));
        }
        say(&line);
        Ok(())
    })
}

/// Acknowledges alarm after alarm; the first refusal ends it.
pub fn ack(args: AckArgs) -> Result<(), CliError> {
    in_runtime(async {
        let mut actor = args.action.attach().await?;
        let snapshot: Arc<Snapshot> = actor.session.snapshots.borrow().clone();
        let known =
            |name: &str| snapshot.def.alarms.iter().any(|alarm| subject_name(&snapshot.def, alarm.subject) == name);
        if let Some(unknown) = args.subjects.iter().find(|name| !known(name)) {
            return Err(CliError::Usage(format!("nothing called `{unknown}` has an alarm in {}", snapshot.def.name)));
        }
        let waiting: Vec<_> = snapshot
            .alarms
            .iter()
            .filter(|alarm| alarm.state.needs_acknowledgement())
            .filter(|alarm| {
                let subject = subject_name(&snapshot.def, snapshot.def.alarm(alarm.id).subject);
                args.all || args.subjects.iter().any(|name| name == subject)
            })
            .collect();
        for (number, seen) in (1..).zip(&waiting) {
            let (alarm, kind) = (snapshot.def.alarm(seen.id), seen.acknowledge());
            let status = actor.send_command(number, kind).await?;
            let line = format!("{} {}: ", subject_name(&snapshot.def, alarm.subject), alarm.message);
            if status.outcome != Outcome::Verified {
                return Err(CliError::Failed(line + &status.outcome.to_string()));
            }
            say(&(line + "acknowledged" + client::recorded_words(status.recorded)));
        }
        if waiting.is_empty() {
            say("nothing to acknowledge");
        }
        Ok(())
    })
}

/// A word of the tag, or a number. The station checks range and decimals.
fn value(snapshot: &Snapshot, tag: TagId, text: &str) -> Result<Exact, String> {
    let def = snapshot.def.tag(tag);
    let word = def.enum_labels.iter().find(|(_, label)| label.eq_ignore_ascii_case(text));
    if let Some((value, _)) = word {
        return Ok(Exact::whole(*value));
    }
    let labels: Vec<&str> = def.enum_labels.iter().map(|(_, label)| label.as_str()).collect();
    let expected = if labels.is_empty() { "a number".to_owned() } else { format!("one of {}", labels.join(", ")) };
    match text.parse::<Exact>() {
        Ok(value) if value.is_finite() => Ok(value),
        Ok(_) | Err(_) => Err(format!("{}: found `{text}`, expected {expected}", def.name)),
    }
}
