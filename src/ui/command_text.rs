//! A command and its outcome in words.

use super::ViewContext;
use crate::{
    plant::{
        command::{CommandKind, NotConfirmed, Outcome},
        commands::alarm_action,
        exact::Exact,
        text_value,
    },
    t,
    text::translate,
};

/// An outcome in words, and whether the operator should worry.
pub fn outcome_words(outcome: &Outcome) -> (String, bool) {
    match outcome {
        Outcome::Pending => (t!("pending …").to_owned(), false),
        Outcome::Verified => (t!("verified").to_owned(), false),
        Outcome::Unchanged => (t!("unchanged, nothing written").to_owned(), false),
        Outcome::Sent => (t!("sent to all units; a broadcast has no response").to_owned(), false),
        Outcome::Refused(why) => (t!("REFUSED: {why}", why), true),
        Outcome::NotConfirmed(NotConfirmed::NoReadBack) => (t!("accepted (cannot be read back)").to_owned(), false),
        Outcome::NotConfirmed(how @ (NotConfirmed::PartlyWritten { .. } | NotConfirmed::PartlyAccepted { .. })) => {
            (t!("STOPPED: {how}", how), true)
        }
        Outcome::NotConfirmed(
            why @ (NotConfirmed::NotAnswered(_)
            | NotConfirmed::NotApplied(..)
            | NotConfirmed::Different(_)
            | NotConfirmed::NotRead(_)
            | NotConfirmed::StationStopped
            | NotConfirmed::Reloaded
            | NotConfirmed::ConnectionLost),
        ) => (t!("NOT CONFIRMED: {why}", why), true),
        Outcome::Failed(fault) => (t!("FAILED, may have taken effect: {fault}", fault), true),
    }
}

/// What was requested, in words: `TIC-1.SV 60.0 → 70.0 °C`.
pub fn command_label(cx: &ViewContext, kind: &CommandKind, old: Option<Exact>) -> String {
    match kind {
        CommandKind::Write { tag, .. } | CommandKind::WriteText { tag, .. } => {
            let seen = if let CommandKind::WriteText { seen, .. } = kind { seen.as_deref() } else { None };
            let old = old.map(|old| cx.snapshot.format(*tag, old)).or(seen.map(text_value::quoted));
            let new = cx.snapshot.written(kind).map_or(String::new(), |(_, new)| new);
            format!("{} {} → {new}", cx.def().tag(*tag).name, old.unwrap_or("?".to_owned()))
        }
        CommandKind::Alarm(alarm_command) => {
            let (action, target, _) = alarm_action(cx.def(), alarm_command);
            format!("{} {target}", translate(action.word()))
        }
        CommandKind::Refresh(device) => t!("refresh {name}", name = cx.def().device(*device).name),
        CommandKind::Connect(line, true) => t!("connect {name}", name = cx.def().line(*line).name),
        CommandKind::Connect(line, false) => t!("disconnect {name}", name = cx.def().line(*line).name),
        CommandKind::Configure(settings) => t!("settings of {name}", name = settings.name),
        CommandKind::SaveSettings(line) => t!("save settings of {name}", name = cx.def().line(*line).name),
        CommandKind::Test(line, diagnostic) => format!("{} {diagnostic}", cx.def().line(*line).name),
        CommandKind::StopTest(line) => t!("stop test of {name}", name = cx.def().line(*line).name),
        CommandKind::ReadSets => t!("read parameter sets").to_owned(),
        CommandKind::SaveSet { device, name, .. } => {
            t!("save set {name} of {name2}", name, name2 = cx.def().device(*device).name)
        }
        CommandKind::Restore(request) => {
            t!(
                "{from} to {name}, {count} changes",
                from = request.from,
                name = cx.def().device(request.device).name,
                count = request.changes.len()
            )
        }
        CommandKind::StopRestore(device) => t!("stop restore of {name}", name = cx.def().device(*device).name),
        CommandKind::StartProcedure(id) => t!("start procedure {name}", name = cx.def().procedure(*id).name),
        CommandKind::AbortProcedure(id) => t!("abort procedure {name}", name = cx.def().procedure(*id).name),
        CommandKind::CorrectCounter { tag, amount } => {
            let value = format!("{} {}", cx.snapshot.format(*tag, *amount), cx.snapshot.unit(*tag));
            t!("correct {name} by {value}", name = cx.def().tag(*tag).name, value = value.trim_end())
        }
        CommandKind::HandOver => t!("hand over").to_owned(),
        CommandKind::TakeOver => t!("take over").to_owned(),
    }
}
