//! Page Test: what a technician can try on a line, and what came of it; and the entry for bytes.

mod send;

use ratatui::Frame as Screen;
pub use send::Send;

use super::{
    LineView, Window,
    frames::{broken, bytes_text},
    request::RequestForm,
    results,
    rows::{self, Spans, plain},
};
use crate::ui::tabs::prelude::*;
use crate::{
    bus::{
        ascii,
        dissect::{self, Direction, Dissection},
        frame::hex,
        hex_input::{self, FramedRequest},
        meaning, names, request_lint,
    },
    plant::{command::Refusal, def::Framing, diagnostics::Diagnostic, fault::Fault, line_state::LineState},
    ui::modal::{Next, line::Line},
};

/// Transaction id of a typed Modbus TCP request; polls use others.
pub const TRANSACTION: u16 = 0xFFFE;
/// Characters of the longest frame: 260 bytes in hex with blanks.
const ENTRY_MAX: usize = 800;

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
    const ALL: [TestKind; 8] = [
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
    fn words(self) -> [&'static str; 3] {
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

#[derive(Debug, Default)]
pub struct Bench {
    selected: usize,
    /// First row shown of the results; `None` until the first scroll.
    pub first: Option<usize>,
    /// What was typed last, and whether its check is left out.
    pub text: String,
    /// As it is typed, without a check.
    pub bare: bool,
    /// The form that was filled in last.
    pub form: Option<RequestForm>,
}

impl Bench {
    pub fn selected(&self) -> TestKind {
        TestKind::ALL[self.selected.min(TestKind::ALL.len() - 1)]
    }

    pub fn open(&mut self, cx: &ViewContext, at: &LineView, kind: TestKind) -> Vec<UiAction> {
        self.selected = TestKind::ALL.iter().position(|known| *known == kind).unwrap_or(0);
        self.first = None;
        let window = match kind {
            TestKind::Bytes => Window::Send(Send {
                line: at.id,
                text: Line::long(&self.text, ENTRY_MAX),
                bare: self.bare,
                problem: None,
            }),
            TestKind::Request
            | TestKind::Loopback
            | TestKind::Plug
            | TestKind::Signal
            | TestKind::Identify
            | TestKind::Scan
            | TestKind::Sweep => {
                let last = self.form.take_if(|form| form.is(at.id, kind));
                Window::Form(last.unwrap_or_else(|| RequestForm::new(cx, at, kind)))
            }
        };
        // What is sent as it was typed may be a write.
        let diagnostic = match matches!(kind, TestKind::Bytes | TestKind::Request | TestKind::Plug | TestKind::Signal) {
            true => Diagnostic::Send(Vec::new()),
            false => Diagnostic::Identify { unit: 1 },
        };
        vec![Notice::or(cx, t!("test"), &CommandKind::Test(at.id, diagnostic), Modal::Bus(Box::new(window)))]
    }

    /// Single rows move the selection; pages scroll the results.
    pub fn scroll(&mut self, cx: &ViewContext, at: &LineView, motion: Motion) {
        if matches!(motion, Motion::Rows(_)) {
            self.selected = motion.to(self.selected, TestKind::ALL.len(), 1);
            return;
        }
        let room = usize::from(cx.area.height).saturating_sub(TOP as usize + 1).max(1);
        let count = results::rows(cx, at, cx.area.width).len();
        let end = rows::last_first(count, room);
        let first = self.first.unwrap_or_else(|| begin(at)).min(end);
        self.first = Some(motion.to(first, end + 1, room.saturating_sub(1)));
    }

    /// Draws it: the tests, then what came of the last one.
    pub fn view(&self, cx: &ViewContext, at: &LineView, canvas: &mut Canvas) {
        let theme = cx.theme;
        let (width, height) = (canvas.width(), canvas.height());
        let tests = height.saturating_sub(3).min(TOP - 2);
        let first = list::first(self.selected, TestKind::ALL.len(), usize::from(tests));
        for (y, (n, kind)) in TestKind::ALL.into_iter().enumerate().skip(first).take(usize::from(tests)).enumerate() {
            let [key, name, what] = kind.words().map(translate);
            let y = to_u16(y);
            let chosen = n == self.selected;
            let x = canvas.text(1, y, key, theme.strong());
            let x = canvas.text(x + 1, y, &pad(name, 18), if chosen { theme.focus() } else { theme.normal() });
            canvas.text(x + 1, y, &fit_words(what, width.saturating_sub(x + 2)), theme.dim());
        }
        canvas.run(1, tests, width.saturating_sub(2), '─', theme.dim());
        if let Some(why) = closed(at) {
            canvas.text(3, tests, &format!(" ! {} ", fit_words(&why, width.saturating_sub(10))), theme.trouble());
        }
        let rows = results::rows(cx, at, width);
        let mut below = canvas.part(0, tests + 1, width, height.saturating_sub(tests + 1));
        rows::draw(cx, &mut below, &rows, self.first.unwrap_or_else(|| begin(at)));
    }
}

/// First row of the results until the first scroll: what has one answer is read from its beginning, what goes on for
/// long is followed at its end.
fn begin(at: &LineView) -> usize {
    match at.status.test.as_ref().map(|run| &run.diagnostic) {
        Some(Diagnostic::Loopback { .. } | Diagnostic::Pattern { .. } | Diagnostic::Scan(_) | Diagnostic::Sweep(_)) => {
            usize::MAX
        }
        Some(
            Diagnostic::Send(_)
            | Diagnostic::Identify { .. }
            | Diagnostic::Read { .. }
            | Diagnostic::Write(_)
            | Diagnostic::Signal(_),
        )
        | None => 0,
    }
}

/// Rows of the tests with the line below them.
#[expect(clippy::cast_possible_truncation, reason = "a constant of one digit")]
const TOP: u16 = TestKind::ALL.len() as u16 + 2;

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
            t!("Sends bytes that are no Modbus, between the polls: units on the line may count errors. Start it?")
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

/// The last test once more.
pub fn again(cx: &ViewContext, at: &LineView) -> Vec<UiAction> {
    at.status.test.iter().filter_map(|run| start(cx, at, run.diagnostic.clone()).ok()).collect()
}

pub fn stop(at: &LineView) -> Vec<UiAction> {
    if at.is_testing() { vec![UiAction::Command(CommandKind::StopTest(at.id))] } else { Vec::new() }
}
