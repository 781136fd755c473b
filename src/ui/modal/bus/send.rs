//! The window that sends bytes as they are typed.

use crossterm::event::{KeyCode, KeyEvent};
use ratatui::{Frame as Screen, layout::Rect};

use super::{
    super::{Next, UiAction, line::Line},
    Window,
    start::{self, ENTRY_MAX, TRANSACTION, TestKind},
};
use crate::{
    bus::{
        ascii,
        dissect::{self, Direction, Dissection},
        frame::hex,
        hex_input::{self, FramedRequest},
        meaning, request_lint,
    },
    plant::{
        def::{Framing, LineId},
        diagnostics::Diagnostic,
        fault::Fault,
        number::to_u16,
    },
    t,
    ui::{
        ViewContext,
        bus_text::{broken, bytes_text},
        keys,
        line_view::LineView,
        widgets::{
            rows::{Spans, plain},
            text::{Canvas, fit, fit_words, wrap},
        },
    },
};

/// Rows of the list of tests with the line below it, which the window covers.
const ROWS: usize = TestKind::ALL.len() + 2;

/// Bytes on their way onto a line.
#[derive(Debug, Clone, PartialEq)]
pub struct Send {
    line: LineId,
    text: Line,
    /// As typed, without a check.
    bare: bool,
    problem: Option<String>,
}

/// What was typed, as it would go over the line.
#[derive(Debug)]
struct Ready {
    frame: Vec<u8>,
    /// What was added to what was typed.
    added: String,
    dissection: Dissection,
    errors: Vec<String>,
}

impl Send {
    /// With a text to start from.
    pub fn new(line: LineId, text: &str, bare: bool) -> Send {
        Send { line, text: Line::long(text, ENTRY_MAX), bare, problem: None }
    }

    /// What is typed, and whether its check is left out.
    pub fn typed(&self) -> (String, bool) {
        (self.text.text(), self.bare)
    }

    /// A key; what is typed is kept for the next time.
    pub(super) fn on_key(mut self, cx: &ViewContext, event: KeyEvent) -> Next {
        if keys::code(KeyCode::Tab).is(event) {
            self.bare = !self.bare;
            self.problem = None;
        } else if keys::code(KeyCode::Enter).is(event) {
            match self.send(cx) {
                Ok(UiAction::Command(kind)) => {
                    let shown = UiAction::ShowTest(self.line);
                    return Next::Do(vec![UiAction::Command(kind), shown, Window::Send(self).open()]);
                }
                Ok(act) => return Next::Do(vec![act]),
                Err(problem) => self.problem = Some(problem),
            }
        } else if self.text.on_key(event) {
            self.problem = None;
        }
        Window::Send(self).stay_and_keep()
    }

    pub fn on_paste(&mut self, text: &str) {
        self.text.paste(text);
    }

    fn send(&self, cx: &ViewContext) -> Result<UiAction, String> {
        let at = LineView::new(cx, self.line).ok_or(t!("this line no longer exists"))?;
        if self.text.missed() {
            return Err(t!("the text was cut; Ctrl-U clears the line").to_owned());
        }
        start::start(cx, &at, Diagnostic::Send(self.ready(at.settings.transport.framing())?.frame))
    }

    fn ready(&self, framing: Framing) -> Result<Ready, String> {
        let typed = hex_input::parse(&self.text.text(), Some(framing)).map_err(|error| error.to_string())?;
        let (frame, added) = match self.bare {
            true => (typed.bytes, String::new()),
            false => framed(&typed, framing).map_err(|fault| fault.to_string())?,
        };
        let dissection = dissect::dissect(&frame, Some(framing), Some(Direction::Request), None);
        let mut errors: Vec<String> =
            request_lint::check_request(&dissection.message, framing).iter().map(ToString::to_string).collect();
        if errors.is_empty() {
            errors.extend(dissection.wrong.clone());
        }
        Ok(Ready { frame, added, dissection, errors })
    }

    /// Draws it over the tests, so that what comes back is seen below.
    pub fn view(&self, cx: &ViewContext, screen: &mut Screen, body: Rect) {
        let Some(at) = LineView::new(cx, self.line) else { return };
        let theme = cx.theme;
        let area = Rect { height: to_u16(ROWS + 1).min(body.height), ..body };
        let mut outer = Canvas::new(screen.buffer_mut(), area);
        outer.clear();
        outer.frame(
            &t!("send on {name}, {transport}", name = at.settings.name, transport = at.settings.transport),
            theme.strong(),
        );
        let (width, height) = (area.width.saturating_sub(4), area.height.saturating_sub(2));
        let mut canvas = outer.part(2, 1, width, height);
        let x = canvas.text(0, 0, t!("bytes "), theme.dim());
        self.text.view(theme, &mut canvas, x, 0);
        let framing = at.settings.transport.framing();
        let rows = if self.text.text().trim().is_empty() {
            vec![
                plain(t!("such as 01 03 03 EA 00 01: unit, function, address, count; or a line of a log"), theme.dim()),
                plain(t!("the check of the line is added"), theme.dim()),
            ]
        } else {
            match self.ready(framing) {
                Ok(ready) => ready.rows(cx, self.line, self.bare, width),
                Err(why) => wrap(&why, width).into_iter().map(|line| plain(line, theme.trouble())).collect(),
            }
        };
        let problem = self.problem.clone().or_else(|| start::closed(&at));
        let room = height.saturating_sub(2 + u16::from(problem.is_some()));
        if usize::from(room) < rows.len() {
            let more = t!(" {count} more lines: enlarge", count = rows.len() - usize::from(room));
            canvas.text_right(width, 0, &more, theme.strong());
        }
        for (y, row) in rows.iter().take(usize::from(room)).enumerate() {
            let mut x = 0;
            for (text, style) in row {
                x = canvas.text(x, to_u16(y) + 1, &fit_words(text, width.saturating_sub(x)), *style);
            }
        }
        let last = height.saturating_sub(1);
        if let Some(problem) = problem {
            canvas.text(0, last.saturating_sub(1), &fit(&format!("! {problem}"), width), theme.trouble());
        }
        let check = if self.bare { t!("with its check") } else { t!("as typed, without check") };
        canvas.text(0, last, &t!("⏎ send   Tab {check}   Esc close", check), theme.strong());
    }
}

impl Ready {
    fn rows(&self, cx: &ViewContext, line: LineId, bare: bool, width: u16) -> Vec<Spans> {
        let theme = cx.theme;
        let added = match (bare, self.added.is_empty()) {
            (true, _) => t!("as typed, nothing added").to_owned(),
            (false, true) => t!("check already present").to_owned(),
            (false, false) => self.added.clone(),
        };
        let mut rows = vec![plain(fit_words(&added, width), theme.normal())];
        let lines = wrap(&self.dissection.summary, width);
        rows.extend(lines.into_iter().map(|line| plain(line, theme.strong())));
        let means = meaning::of_request(cx.snapshot, line, &self.dissection.message);
        rows.extend(means.iter().flat_map(|means| wrap(means, width)).map(|line| plain(line, theme.strong())));
        for error in &self.errors {
            rows.extend(wrap(&format!("! {error}"), width).into_iter().map(|line| plain(line, theme.trouble())));
        }
        if rows.len() < 4 {
            let framing = self.dissection.framing.unwrap_or(Framing::Rtu);
            let sent = t!("sent as {bytes_text}", bytes_text = bytes_text(framing, &self.frame));
            rows.extend(broken(&sent, width).into_iter().map(|line| plain(line, theme.dim())));
        }
        rows
    }
}

/// The frame of what was typed, and what was added to it, if it is not a frame already.
fn framed(typed: &hex_input::ParsedInput, framing: Framing) -> Result<(Vec<u8>, String), Fault> {
    let FramedRequest { message, frame } = typed.framed(framing, TRANSACTION)?;
    let added = match framing {
        _ if frame == typed.bytes => String::new(),
        Framing::Rtu => t!("+ CRC {crc}", crc = hex(&frame[message.len()..])),
        Framing::Ascii => t!("+ LRC {lrc}, as : hex CR LF", lrc = format!("{:02X}", ascii::lrc(&message))),
        Framing::Mbap => t!("+ header {header}", header = hex(&frame[..6])),
    };
    Ok((frame, added))
}
