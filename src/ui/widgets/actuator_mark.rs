//! How an actuator and its last command do, in one mark.

use ratatui::style::Style;

use super::value;
use crate::{
    plant::{
        command::{CommandStatus, NotConfirmed, Outcome},
        def::TagId,
        interlock::{ActuatorDef, InterlockDef, InterlockStatus},
        time::elapsed,
    },
    t,
    text::translate,
    ui::ViewContext,
};

/// How long the end of a command is marked in the mimic, in seconds of the operator.
const DONE_S: f64 = 5.0;
/// The same for one that did not end well.
const FAILED_S: f64 = 60.0;

/// The latest command for a tag.
fn last_command<'a>(cx: &ViewContext<'a>, command: TagId) -> Option<&'a CommandStatus> {
    let of_command = |status: &&CommandStatus| status.command.kind.written().is_some_and(|(tag, _)| tag == command);
    cx.snapshot.commands.iter().find(of_command)
}

/// The latest command for a tag, while how it ended is news, and whether it went well.
pub fn news<'a>(cx: &ViewContext<'a>, command: TagId) -> Option<(&'a Outcome, Option<bool>)> {
    let status = last_command(cx, command)?;
    let plant_s = elapsed(status.outcome_at, cx.now).as_secs_f64();
    let real_s = plant_s / cx.snapshot.speed.clamp(0.01, 1e6);
    let (well, lasts) = match status.outcome {
        Outcome::Pending => (None, f64::MAX),
        Outcome::Verified | Outcome::Unchanged | Outcome::Sent | Outcome::NotConfirmed(NotConfirmed::NoReadBack) => {
            (Some(true), DONE_S)
        }
        Outcome::Refused(_) | Outcome::NotConfirmed(_) | Outcome::Failed(_) => (Some(false), FAILED_S),
    };
    (real_s <= lasts).then_some((&status.outcome, well))
}

/// The mark of an actuator in the mimic, by its output: what does not follow its command, how the last command went, what is blocked.
pub fn mark(cx: &ViewContext, output: TagId) -> Option<(String, Style)> {
    let theme = cx.theme;
    let logic = &cx.def().logic;
    let (place, actuator) = logic.actuator(output).filter(|(_, actuator)| actuator.output == output)?;
    if cx.snapshot.actuators.feedback_mismatch(logic, place, cx.snapshot.at).is_some() {
        let commanded = cx.snapshot.text(actuator.command).unwrap_or_default();
        return Some((t!("{pick} not {commanded}", pick = theme.pick("≠", "!="), commanded), theme.trouble()));
    }
    let blocks = |lock: &&InterlockDef| lock.tag == actuator.command && lock.value != actuator.off;
    let mut statuses = logic.interlocks.iter().filter(blocks).map(|lock| lock.status(cx.snapshot.sample(lock.of)));
    let blocked = statuses.any(|status| status == InterlockStatus::Blocked);
    match news(cx, actuator.command) {
        Some((_, None)) => return Some((theme.pick(t!("… sent"), t!(".. sent")).to_owned(), theme.strong())),
        Some((outcome, Some(false))) => {
            let word = translate(outcome.label());
            return Some((format!("{} {word}", theme.pick("✗", "x")), theme.trouble()));
        }
        // A command that cannot be read back was taken, which says nothing while it is blocked.
        Some((Outcome::NotConfirmed(_) | Outcome::Sent, Some(true))) if blocked => {}
        // Only while the output is as commanded: another mode may have taken over since.
        Some((outcome, Some(true))) if follows_command(cx, actuator) => {
            let word = match outcome {
                Outcome::NotConfirmed(_) => t!("accepted"),
                Outcome::Unchanged => t!("unchanged"),
                Outcome::Sent => t!("sent"),
                Outcome::Pending | Outcome::Verified | Outcome::Refused(_) | Outcome::Failed(_) => t!("done"),
            };
            return Some((format!("{} {word}", theme.pick("✓", t!("ok"))), theme.normal()));
        }
        Some((_, Some(true))) | None => {}
    }
    blocked.then(|| (theme.pick(t!("⊘ blocked"), t!("(/) blocked")).to_owned(), theme.dim()))
}

/// Is the output certainly as commanded? One that need not follow its command counts as such.
fn follows_command(cx: &ViewContext, actuator: &ActuatorDef) -> bool {
    let command = cx.snapshot.sample(actuator.command).good_value().map(|command| command != actuator.off);
    actuator.travel.is_none() || (command.is_some() && value::is_on(cx, actuator.output) == command)
}
