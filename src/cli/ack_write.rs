//! `sightglass write`, `ack` and `correct`: actions at a running station, with rights, checks and records as on the screen.

use std::sync::Arc;

use crate::plant::{
    Snapshot,
    alarm::{ActiveAlarm, AlarmCommand, manager::subject_name},
    command::{CommandKind, Outcome},
    def::TagId,
    entry,
    exact::Exact,
    text_value,
};

use super::{CliError, client, in_runtime, prompt, say};

/// Arguments of `write`.
#[derive(Debug, clap::Args)]
pub struct WriteArgs {
    /// The tag: TIC-1.SV
    tag: String,
    /// The new value in the tag's unit, one of its words, or a text; +5 adds 5, -5 subtracts 5, =-5 is -5; now sets a clock
    #[arg(allow_negative_numbers = true)]
    value: String,
    /// Do not ask again, not even about a large step, a limit, or a value that the device rounds
    #[arg(long)]
    yes: bool,
    #[command(flatten)]
    action: client::ActionArgs,
}

/// Arguments of `ack`.
#[derive(Debug, clap::Args)]
pub struct AckArgs {
    /// Tags or devices whose alarms are acknowledged: TIC-1.PV
    #[arg(required_unless_present = "all")]
    subjects: Vec<String>,
    /// Every alarm that is not acknowledged now
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
    /// Amount to add to what it has counted, in its unit; below 0: to subtract
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
        if snapshot.def.tag(tag).is_text() {
            return write_text(&mut actor, &snapshot, tag, (&args.value, args.yes)).await;
        }
        let value = value(&snapshot, tag, &args.value).map_err(CliError::Usage)?;
        confirm(&snapshot, tag, value, args.yes).await?;
        // The station writes what is asked for, or nothing: what was confirmed is what the device can hold.
        let value = entry::as_confirmed(&snapshot, tag, value);
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

/// Writes a text, a date, a time or an address, and prints the outcome.
async fn write_text(
    actor: &mut client::Actor,
    snapshot: &Snapshot,
    tag: TagId,
    (typed, yes): (&str, bool),
) -> Result<(), CliError> {
    let def = snapshot.def.tag(tag);
    let now = snapshot.at.to_zoned(snapshot.def.time_zone.clone());
    let held = text_value::as_held(def.point.kind, typed, &now);
    let held =
        held.map_err(|expected| CliError::Usage(format!("{}: found `{typed}`, expected {expected}", def.name)))?;
    let seen = snapshot.texts[tag.index()].clone();
    let old = seen.as_deref().map_or("----".to_owned(), text_value::quoted);
    let question: Vec<String> = def.confirm.clone().into_iter().collect();
    ask(&format!("{} {old} → {}", def.name, text_value::quoted(&held)), &question, yes).await?;
    let kind = CommandKind::WriteText { tag, text: typed.into(), seen };
    let status = actor.send_command(1, kind).await?;
    // What the station says that the device holds, which need not be what was typed.
    let new = snapshot.written(&status.command.kind).map_or(held, |(_, new)| new);
    let recorded = client::recorded_words(status.recorded);
    let line = format!("{} {old} → {new}: {}{recorded}", def.name, status.outcome);
    if !status.outcome.is_success() {
        return Err(CliError::Failed(line));
    }
    say(&line);
    Ok(())
}

/// Acknowledges what waits, as it is seen now.
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
        if !waiting.is_empty() {
            // One command, however many there are: the station limits how many a terminal sends at once.
            let alarms = (!args.all).then(|| waiting.iter().map(|alarm| alarm.id).collect());
            let kind = CommandKind::Alarm(AlarmCommand::AcknowledgeAll { alarms, seen: snapshot.annunciations });
            let status = actor.send_command(1, kind).await?;
            let after = actor.session.snapshots.borrow().clone();
            let still = |seen: &ActiveAlarm| {
                let same = |alarm: &&ActiveAlarm| alarm.id == seen.id && alarm.annunciated_at == seen.annunciated_at;
                after.alarms.iter().find(same).is_some_and(|alarm| alarm.state.needs_acknowledgement())
            };
            for seen in &waiting {
                let alarm = snapshot.def.alarm(seen.id);
                let became = match still(seen) {
                    true => "not acknowledged".to_owned(),
                    false => format!("acknowledged{}", client::recorded_words(status.recorded)),
                };
                say(&format!("{} {}: {became}", subject_name(&snapshot.def, alarm.subject), alarm.message));
            }
            if status.outcome != Outcome::Verified {
                return Err(CliError::Failed(status.outcome.to_string()));
            }
        }
        if waiting.is_empty() {
            say("nothing to acknowledge");
        }
        Ok(())
    })
}

/// Asks what a screen asks in a window of its own: a large step, an alarm limit, a rounded value, what the profile wants asked.
async fn confirm(snapshot: &Snapshot, tag: TagId, value: Exact, yes: bool) -> Result<(), CliError> {
    if !entry::needs_confirmation(snapshot, tag, value) {
        return Ok(());
    }
    let def = snapshot.def.tag(tag);
    let words = |value: Option<Exact>| value.map_or_else(|| "----".to_owned(), |value| snapshot.format(tag, value));
    let question = def.confirm.clone().into_iter().chain(entry::rounded_text(snapshot, tag, value));
    let question: Vec<String> = question.chain(entry::warnings(snapshot, tag, value)).collect();
    let change = format!("{} {} → {}", def.name, words(snapshot.sample(tag).good_exact()), words(Some(value)));
    ask(&change, &question, yes).await
}

/// Asks whether to make a change about which there is something to say.
async fn ask(change: &str, question: &[String], yes: bool) -> Result<(), CliError> {
    if yes || question.is_empty() {
        return Ok(());
    }
    let question = question.join("; ");
    if !prompt::is_interactive() {
        return Err(CliError::Usage(format!("{change}: {question}: add --yes to write it")));
    }
    say(&question);
    match &*prompt::ask(&format!("{change}: write it?"), "no").await? {
        "y" | "yes" => Ok(()),
        _ => Err(CliError::Failed("nothing was written".to_owned())),
    }
}

/// A word of the tag, or a number as it is typed on a screen.
fn value(snapshot: &Snapshot, tag: TagId, text: &str) -> Result<Exact, String> {
    let def = snapshot.def.tag(tag);
    // The word itself, else the only one that is it in other letters.
    let alike = |(_, label): &&(i128, String)| label.eq_ignore_ascii_case(text);
    let exact = def.enum_labels.iter().find(|(_, label)| label == text);
    let only = || def.enum_labels.iter().find(alike).filter(|_| def.enum_labels.iter().filter(alike).count() == 1);
    if let Some((value, _)) = exact.or_else(only) {
        return Ok(Exact::whole(*value));
    }
    let labels: Vec<&str> = def.enum_labels.iter().map(|(_, label)| label.as_str()).collect();
    let expected = if labels.is_empty() { "a number".to_owned() } else { format!("one of {}", labels.join(", ")) };
    let entered = entry::check(snapshot, tag, text);
    entered.map_err(|why| format!("{}: found `{text}`, expected {expected}: {why}", def.name))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::{
        Plant,
        fixture::{self, SV},
        sample::Sample,
    };
    use jiff::Timestamp;

    /// SV is 70.0 °C, of one decimal.
    fn snapshot() -> Snapshot {
        let at = Timestamp::UNIX_EPOCH;
        let mut snapshot = Plant::new(Arc::new(fixture::plant()), at, 1.0).snapshot();
        (snapshot.samples[SV.index()], snapshot.decimals[SV.index()]) = (Sample::good(70.0, at), 1);
        snapshot
    }

    #[test]
    fn a_number_is_read_as_on_a_screen() {
        let snapshot = snapshot();
        let read = |text| value(&snapshot, SV, text).map(Exact::near);
        for (text, expect) in [("71", 71.0), ("71,5", 71.5), ("+5", 75.0), ("-0.5", 69.5), ("=71.5", 71.5)] {
            assert_eq!(read(text), Ok(expect), "{text}");
        }
        for text in ["71.25", "1.000", "1e2", "0x10", "inf", "", "71 5", "+"] {
            let why = read(text).expect_err("no number");
            assert!(why.contains(&format!("found `{text}`, expected a number: ")), "{why}");
        }
    }

    #[test]
    fn a_word_is_the_one_that_was_typed() {
        let mut snapshot = snapshot();
        let mut def = (*snapshot.def).clone();
        def.tags[SV.index()].enum_labels = ["run", "Run", "RUN", "Hold"]
            .iter()
            .map(|word| (*word).to_owned())
            .enumerate()
            .map(|(n, word)| (n as i128 + 1, word))
            .collect();
        snapshot.def = Arc::new(def);
        let read = |text| value(&snapshot, SV, text).map(Exact::near);
        assert_eq!(["run", "Run", "RUN", "hold"].map(read), [Ok(1.0), Ok(2.0), Ok(3.0), Ok(4.0)]);
        assert!(read("rUN").is_err_and(|why| why.contains("expected one of run, Run, RUN, Hold")));
    }

    #[tokio::test]
    async fn what_a_screen_asks_again_is_not_written_without_an_answer() {
        let snapshot = snapshot();
        for (value, yes, is_written) in [(71.0, false, true), (20.0, false, false), (20.0, true, true)] {
            let confirmed = confirm(&snapshot, SV, value.into(), yes).await;
            assert_eq!(confirmed.is_ok(), is_written, "{value} {yes} {confirmed:?}");
        }
    }
}
