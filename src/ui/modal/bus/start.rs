//! What can be tried on a line, when it cannot be, and what is asked before it is.

use super::super::{Confirm, Modal, UiAction};
use crate::{
    bus::{
        dissect::{self, Direction},
        frame::hex,
        meaning, names, request_lint,
    },
    plant::{
        command::{CommandKind, Refusal},
        diagnostics::Diagnostic,
        line_state::LineState,
    },
    t,
    text::translate,
    ui::{ViewContext, line_view::LineView},
};

/// Transaction id of a typed Modbus TCP request; polls use others.
pub const TRANSACTION: u16 = 0xFFFE;
/// Characters of the longest frame: 260 bytes in hex with blanks.
pub(super) const ENTRY_MAX: usize = 800;

/// What can be tried.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TestKind {
    Bytes,
    Request,
    /// Diagnostics 08/00.
    Loopback,
    /// Patterns that a plug returns.
    Plug,
    /// RTS or DTR, set by hand for a time.
    Signal,
    /// Device identification.
    Identify,
    /// Which units answer.
    Scan,
    /// Which addresses of a unit answer.
    Sweep,
}

impl TestKind {
    pub const ALL: [TestKind; 8] = [
        TestKind::Bytes,
        TestKind::Request,
        TestKind::Loopback,
        TestKind::Plug,
        TestKind::Signal,
        TestKind::Identify,
        TestKind::Scan,
        TestKind::Sweep,
    ];

    /// Its key, its name and what it is for.
    pub fn words(self) -> [&'static str; 3] {
        match self {
            TestKind::Bytes => ["t", t!("type bytes"), t!("hex of a request, decoded as you type; its check is added")],
            TestKind::Request => {
                ["f", t!("request by fields"), t!("unit, function, address (41003 or 0x03EA), count or value")]
            }
            TestKind::Loopback => ["b", t!("loopback"), t!("08 / 0x08: echo test of the line, with response times")],
            TestKind::Plug => ["p", t!("loopback plug"), t!("bytes that a plug returns; wrong, missing, local echo")],
            TestKind::Signal => ["g", t!("line signals"), t!("RTS or DTR by hand, for a time; which inputs follow")],
            TestKind::Identify => ["i", t!("identify"), t!("43 / 0x2B: vendor, product, version of a device")],
            TestKind::Scan => ["s", t!("scan for units"), t!("units that respond, with these or all serial settings")],
            TestKind::Sweep => ["m", t!("map of addresses"), t!("which of the addresses 0 to 65535 a unit answers at")],
        }
    }
}

/// Why nothing can be sent on a line; `None` if it is open.
pub fn closed(at: &LineView) -> Option<String> {
    let name = &at.settings.name;
    if at.settings.listens {
        return Some(Refusal::OnlyListens.to_string());
    }
    match &at.status.state {
        LineState::Connected | LineState::Testing | LineState::NoTraffic => None,
        LineState::Connecting => Some(t!("line {name} is connecting: nothing can be sent yet", name)),
        LineState::Waiting { why, .. } => Some(t!("line {name} is not connected: {why}", name, why)),
        LineState::Disconnected => Some(t!("line {name} is disconnected: connect it first (page Line, D)", name)),
    }
}

/// Starts a test, or asks first; `Err` says why it cannot be started.
pub fn start(cx: &ViewContext, at: &LineView, diagnostic: Diagnostic) -> Result<UiAction, String> {
    if let Some(why) = closed(at).filter(|_| at.settings.listens || !diagnostic.is_exclusive()) {
        return Err(why);
    }
    diagnostic.check_on(at.settings)?;
    let query = danger(cx, at, &diagnostic);
    let command = CommandKind::Test(at.id, diagnostic);
    let Some(words) = query else { return Ok(UiAction::Command(command)) };
    let title = t!("test of {name}", name = at.settings.name);
    Ok(UiAction::Open(Modal::Confirm(Confirm::command(title, words, command))))
}

/// What must be asked before a test; `None` for one that only reads.
fn danger(cx: &ViewContext, at: &LineView, diagnostic: &Diagnostic) -> Option<String> {
    match diagnostic {
        Diagnostic::Scan(scan) if !scan.serials.is_empty() => Some(t!(
            "Polling of {name} pauses while other settings are tested, and its alarms are not evaluated. Start the scan?",
            name = at.settings.name
        )),
        Diagnostic::Scan(_)
        | Diagnostic::Sweep(_)
        | Diagnostic::Loopback { .. }
        | Diagnostic::Identify { .. }
        | Diagnostic::Read { .. } => None,
        Diagnostic::Pattern { .. } => Some(
            t!("Sends bytes that are not Modbus, between polls: units on the line may count errors. Start it?")
                .to_owned(),
        ),
        Diagnostic::Signal(test) => Some(t!(
            "Polling of {name} pauses, and its alarms are not evaluated: {test}, then put back. Start it?",
            name = at.settings.name,
            test
        )),
        Diagnostic::Write(_) => {
            Some(t!("{diagnostic}. This bypasses all limits of the plant file. Write it?", diagnostic))
        }
        Diagnostic::Send(bytes) => {
            let framing = at.settings.transport.framing();
            let dissection = dissect::dissect(bytes, Some(framing), Some(Direction::Request), None);
            let lint = || request_lint::check_request(&dissection.message, framing).first().map(ToString::to_string);
            let wrong = dissection.wrong.clone().or_else(lint);
            let broadcast = dissection.message.first().is_some_and(|unit| framing.is_broadcast(*unit));
            let means = meaning::of_request(cx.snapshot, at.id, &dissection.message);
            let summary = [vec![dissection.summary], means].concat().join(". ");
            match (wrong, broadcast, request_lint::only_reads(&dissection.message)) {
                (None, false, true) => None,
                (None, true, _) => {
                    Some(t!("{summary}. Broadcast: every device executes it, none responds. Send it?", summary))
                }
                (None, false, false) => Some(match names::effect(&dissection.message) {
                    Some(effect) => {
                        t!("{summary}: {effect}. Send it?", summary, effect = translate(effect))
                    }
                    None => t!(
                        "{summary}. This bypasses all limits of the plant file and is not read back. Send it?",
                        summary
                    ),
                }),
                (Some(wrong), ..) => Some(t!(
                    "These bytes are not a valid request: {wrong}. Send {hex} anyway?",
                    wrong,
                    hex = hex(bytes)
                )),
            }
        }
    }
}
